"""Films of a camera that turns: how it turned, and the empty scene that it sees in each frame."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from walking_keypoints import MODEL, walk_at

from gait import Camera, Video
from gait.camera.camera import write_camera
from gait.camera.path import CameraPose, write_path
from gait.cli import main
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints, write
from gait.io.video import VideoWriter, sample_frames
from gait.lift import detected
from gait.studio.source import require_still
from gait.track.camera_motion import View
from gait.track.clip_background import stays
from gait.track.clip_camera import motion_remedy
from gait.track.moving_video import MovingVideo, map_pixels, panorama_of
from gait.track.options import ClipOptions
from gait.track.read_scene import read_scene
from gait.track.stabilise import expected_lens, find_motion, find_travel, moves, turn_in_samples

CAMERA = Camera.looking((0.0, -6.0, 1.5), (0.0, 0.0, 1.0), (320, 240), 270.0)
PANORAMA = replace(CAMERA, width=800, height=600, cx=400.0, cy=300.0)
FRAMES, PERSON = 10, 40
LANE = 0.5  # metres; of a floor that shows 13 to 24 corners


def scene(texture: float) -> np.ndarray:
    """Still picture of `PANORAMA`; `texture` in grey levels."""
    rng, picture = np.random.default_rng(3), np.full((600, 800), 120.0)
    for size in (6, 15, 40):
        coarse = rng.normal(size=(600 // size + 2, 800 // size + 2))
        picture += texture * cv2.resize(coarse, (800, 600), interpolation=cv2.INTER_CUBIC)
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def views(pan: float, shake: float, count: int = FRAMES) -> list[View]:
    """Views of a camera that pans and shakes, radians, and zooms a little."""
    turns = [(shake * np.sin(2 * k), pan * k / (count - 1), shake * np.cos(3 * k)) for k in range(count)]
    zooms = [1 + 0.002 * np.sin(k) * (shake > 0) for k in range(count)]
    return [View(cv2.Rodrigues(np.array(turn))[0], zoom) for turn, zoom in zip(turns, zooms, strict=True)]


def film(path, turned: list[View], texture: float = 25.0, cameras=(CAMERA, PANORAMA)) -> Video:
    """Write what a camera sees: the scene, and a box that walks through it.

    `cameras`: the one that films, and that of the picture of the whole scene.
    """
    lens, whole = cameras
    still, grid = scene(texture), np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1)
    with VideoWriter(path, 30, crf=6) as out:
        for k, view in enumerate(turned):
            places = map_pixels(grid, view.camera(lens), whole).astype(np.float32)
            picture = cv2.remap(still, *cv2.split(places), cv2.INTER_LINEAR)
            picture[80:200, 20 * (k % FRAMES) :][:, :PERSON] = 30 + 10 * (k % FRAMES)
            out.write(picture)
    return Video(path)


def people() -> dict[int, Keypoints]:
    """Corners of the box in every frame."""
    uv = np.array([[(20 * k, 80), (20 * k + PERSON, 200)] for k in range(FRAMES)], float)
    return {0: Keypoints(np.arange(FRAMES), np.arange(FRAMES) / 30, ("a", "b"), uv, np.ones((FRAMES, 2)))}


@pytest.mark.parametrize(("pan", "shake"), [(0.0, 0.01), (0.3, 0.004)])
def test_the_turns_of_the_camera_are_found(tmp_path, pan, shake):
    turned = views(pan, shake)
    video = film(tmp_path / "v.mp4", turned)
    samples = sample_frames(video)
    assert moves(CAMERA, samples, people())
    motion, why = find_motion(video, CAMERA, samples, people())
    assert motion is not None and why == ""
    back = turned[motion.reference].inverse()
    pixels = np.array([[40.0, 40.0], [270.0, 50.0], [160.0, 120.0], [60.0, 200.0], [280.0, 210.0]])
    for found, made in zip(motion.views, turned, strict=True):
        wanted = map_pixels(pixels, CAMERA, made.after(back).camera(CAMERA))
        assert np.hypot(*(map_pixels(pixels, CAMERA, found.camera(CAMERA)) - wanted).T).max() < 0.5
    poses = motion.poses(CAMERA)
    panorama = panorama_of(samples, CAMERA, poses)
    assert panorama is not None and panorama.camera.width >= video.width + (60 if pan else 0)
    rows, columns = slice(25, 70), slice(20, 300)  # over the box
    for frame in MovingVideo(video, CAMERA, poses, panorama).frames():
        assert frame.plate is not None and frame.pose is poses[frame.number]
        assert np.median(np.abs(frame.image[rows, columns].astype(float) - frame.plate[rows, columns])) < 4
        found = map_pixels(pixels, CAMERA, frame.camera(CAMERA))
        wanted = map_pixels(pixels, CAMERA, turned[frame.number].after(back).camera(CAMERA))
        assert np.hypot(*(found - wanted).T).max() < 1.0  # the zoom is no part of a pose
        moved = replace(people()[0], frame=np.array([frame.number]), uv=found[None, :2])
        assert motion.in_reference(moved).uv[0] == pytest.approx(pixels[:2], abs=0.7)


def travelling(
    path, away: float, angle: float, floor: float = 99.0, wall: float = 0.0
) -> tuple[Video, list[Camera]]:
    """Write what a robot's camera sees that drives `away` metres and turns by `angle`: floor, sky, a box.

    `floor`: metres to each side of the robot's way where the floor is not plain.  `wall`: y of a wall that
    hides everything else, metres; 0 for none.
    """
    rng, count = np.random.default_rng(4), 12
    texture = cv2.resize(rng.integers(40, 220, (300, 300)).astype(np.uint8), (1800, 1800))
    ways = np.linspace(0, 1, count)
    lens = Camera.looking((0.0, -2.0, 1.0), (0.0, 0.0, 0.8), (320, 240), 200.0)
    cameras = [
        Camera.looking(
            (0.2 * away * way, -2 + away * way, 1.0), (angle * way, away * way, 0.8), lens.size, 200.0
        )
        for way in ways
    ]
    grid = np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1)
    with VideoWriter(path, 30, crf=6) as out:
        for k, camera in enumerate(cameras):
            rays = camera.rays(grid)
            down = np.minimum(rays[..., 2:], -1e-3)
            there = 60 * (camera.centre[:2] - camera.centre[2] * rays[..., :2] / down) + 900
            sky = 300 * np.stack([np.arctan2(rays[..., 0], rays[..., 1]), rays[..., 2]], axis=-1) + 900
            ground = rays[..., 2:] < -0.02
            if wall:
                hit = camera.centre + (wall - camera.centre[1]) / rays[..., 1:2] * rays
                there = sky = 60 * hit[..., ::2] + 900
            maps = np.where(ground, there, sky).astype(np.float32)
            picture = cv2.remap(texture, *cv2.split(maps), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
            picture[ground[..., 0] & (np.abs(there[..., 0] - 900) > 60 * floor)] = 120
            picture[100:180, 130 + 2 * k : 170 + 2 * k] = 30
            out.write(np.repeat(picture[..., None], 3, axis=2))
    return Video(path), cameras


@pytest.mark.parametrize("floor", [99.0, LANE])
def test_the_poses_of_a_camera_that_travels_over_a_floor_are_found(tmp_path, capsys, floor):
    """Although a box moves with the camera and is not known to be a person, or only a lane has texture."""
    video, cameras = travelling(tmp_path / "v.mp4", 0.8, 0.2, floor)
    poses = find_travel(video, cameras[0], sample_frames(video), {}, range(12), quiet=False)
    assert len(poses) == len(cameras) and "the camera travelled up to 0.8 m" in capsys.readouterr().err
    for number, camera in enumerate(cameras):
        assert np.linalg.norm(poses[number].centre - camera.centre) < 0.02
        assert np.degrees(np.linalg.norm(cv2.Rodrigues(poses[number].R @ camera.R.T)[0])) < 0.3


@pytest.mark.parametrize(("away", "floor", "wall"), [(0.0, 99.0, 0.0), (0.8, 0.0, 0.0), (0.8, 99.0, 2.0)])
def test_a_camera_that_only_turns_or_sees_no_floor_has_no_path(tmp_path, away, floor, wall):
    video, cameras = travelling(tmp_path / "v.mp4", away, 0.0 if wall else 0.2, floor, wall)
    assert find_travel(video, cameras[0], sample_frames(video), {}, range(12), quiet=True) == {}


def test_the_reported_motion_is_that_in_the_frames_to_track(tmp_path, capsys):
    half = range(FRAMES // 2)
    video, cameras = travelling(tmp_path / "v.mp4", 0.8, 0.2)
    find_travel(video, cameras[0], sample_frames(video), {}, half, quiet=False)
    assert "the camera travelled up to 0.3 m" in capsys.readouterr().err
    video = film(tmp_path / "w.mp4", views(0.3, 0.0))
    motion, _ = find_motion(video, CAMERA, sample_frames(video), people(), first=True)
    assert motion.furthest(half) < 0.5 * motion.furthest()


def test_a_path_that_was_to_be_estimated_and_was_not_is_not_written(tmp_path, monkeypatch):
    """By default such a camera counts as still, and the file has that camera."""
    monkeypatch.setattr("gait.track.clip_camera.find_travel", lambda *_: {})
    monkeypatch.setattr("gait.track.clip_camera.find_turns", lambda *_, first: None)
    _, cameras = travelling(tmp_path / "v.mp4", 0.8, 0.2)
    write_camera(tmp_path / "camera.json", cameras[0])
    names = (str(tmp_path / name) for name in ("v.mp4", "camera.json", "t.csv"))
    options = ClipOptions(*names, detector="none", stabilize="auto", cameras_out=str(tmp_path / "p.csv"))
    with pytest.raises(UserError, match="p.csv: not written, as the camera .* is not estimated"):
        read_scene(options)
    assert read_scene(replace(options, stabilize="pans")).moved


def test_cameras_of_a_pan_that_is_not_estimated_are_not_written(tmp_path):
    film(tmp_path / "v.mp4", views(0.3, 0.0))
    write_camera(tmp_path / "camera.json", CAMERA)
    names = (str(tmp_path / name) for name in ("v.mp4", "camera.json", "t.csv"))
    options = ClipOptions(*names, detector="none", stabilize="off", background="none")
    with pytest.raises(UserError, match="p.csv: not written, .* --stabilize auto estimates its motion"):
        read_scene(replace(options, cameras_out=str(tmp_path / "p.csv")))


def test_a_person_followed_by_a_camera_with_given_poses_does_not_stay(tmp_path):
    """Where they are in the picture of a camera that stands still."""
    count = 30
    turned = views(0.3, 0.0, count)
    video = film(tmp_path / "v.mp4", turned)
    write_camera(tmp_path / "camera.json", CAMERA)
    write_path(
        tmp_path / "poses.csv",
        range(count),
        [CameraPose.of(view.camera(CAMERA)) for view in turned],
        by_frame=True,
    )
    places = [walk_at(k / 30, (0.0, (-0.6, 0.0))) for k in range(count)]
    found = {True: [view.camera(CAMERA).project(now) for view, now in zip(turned, places, strict=True)]}
    found[False] = [view.camera(CAMERA).project(places[0]) for view in turned]
    for walks, uv in found.items():
        known = np.ones((count, len(MODEL.joint_names)))
        write(
            tmp_path / "k.csv",
            Keypoints(np.arange(count), video.times, MODEL.joint_names, np.array(uv), known),
        )
        read = read_scene(
            ClipOptions(
                *(str(tmp_path / name) for name in ("v.mp4", "camera.json", "t.csv")),
                camera_path=str(tmp_path / "poses.csv"),
                keypoints=str(tmp_path / "k.csv"),
            )
        )
        assert read.empty is not None and stays(read) is not walks


def test_a_pan_of_a_lens_of_unknown_length_is_found(tmp_path, capsys):
    """Also if its picture is two to three times as narrow as usual; a given field of view is believed."""
    lens = replace(CAMERA, fx=680.0, fy=680.0)
    turned = [View(cv2.Rodrigues(np.array((0.0, 0.35 * k / (FRAMES - 1), 0.0)))[0]) for k in range(FRAMES)]
    whole = replace(lens, width=800, height=600, cx=400.0, cy=300.0)
    video = film(tmp_path / "v.mp4", turned, cameras=(lens, whole))
    samples = sample_frames(video)
    assert turn_in_samples(expected_lens(video, 65.0, samples, people()), samples, people()) is None
    found = expected_lens(video, None, samples, people())
    assert 0.7 < found.fx / lens.fx < 1.4
    turn = turn_in_samples(found, samples, people())
    assert turn == pytest.approx(np.tan(0.35) * lens.fx, rel=0.05)


def test_no_motion_is_promised_for_a_camera_that_travels_without_a_file():
    for stabilize in ("pans", "auto"):
        options = ClipOptions("v.mp4", None, "t.csv", height=1.75, stabilize=stabilize)
        assert "--stabilize" not in motion_remedy(options, None)
        assert "--camera and --camera-path" in motion_remedy(options, None)
    options = ClipOptions("v.mp4", None, "t.csv", height=1.75)
    assert "--stabilize auto" in motion_remedy(options, 20.0)


def test_a_camera_that_stands_still_is_left_alone(tmp_path):
    video = film(tmp_path / "v.mp4", [View(np.eye(3))] * FRAMES)
    assert find_motion(video, CAMERA, sample_frames(video), people()) == (None, "")
    assert not moves(CAMERA, sample_frames(video), people())


@pytest.mark.parametrize("background", ["auto", "none"])
@pytest.mark.parametrize(("pan", "shake"), [(0.0, 0.0), (0.0, 0.02), (0.3, 0.004)])
def test_by_default_a_camera_that_turns_far_is_stabilised_and_one_that_shakes_is_reported(
    tmp_path, capsys, pan, shake, background
):
    """A tenth of the picture's width are 32 px; the median of a camera that moves is no background."""
    film(tmp_path / "v.mp4", views(pan, shake))
    write_camera(tmp_path / "camera.json", CAMERA)
    names = (str(tmp_path / name) for name in ("v.mp4", "camera.json", "t.csv"))
    read = read_scene(ClipOptions(*names, detector="none", background=background))
    err = capsys.readouterr().err
    assert (read.motion is not None) == bool(read.poses) == bool(pan)
    assert ("turned by up to" in err and "to frame 0" in err) == bool(pan)
    assert ("counts as still" in err) == (read.moved != "") == (shake > 0 and not pan)
    assert (read.empty is not None) == (background == "auto" and not read.moved)


def test_a_scene_without_texture_is_reported(tmp_path):
    video = film(tmp_path / "v.mp4", views(0.1, 0.01), texture=0.0)
    motion, why = find_motion(video, CAMERA, sample_frames(video), people())
    assert motion is None and "too little texture" in why


@pytest.mark.long
def test_gait_lift_undoes_the_turns_too(tmp_path, monkeypatch, capsys):
    """A person who walks 1.2 m/s before a camera that follows them, as a detector finds them."""
    count = 30
    turned = views(0.3, 0.003, count)
    video = film(tmp_path / "walk.mp4", turned)
    places = np.array([walk_at(k / 30, (0.0, (-0.6, 0.0))) for k in range(count)])
    uv = np.array([view.camera(CAMERA).project(now) for view, now in zip(turned, places, strict=True)])
    rng, frame = np.random.default_rng(5), np.arange(count)
    uv += 0.5 * rng.standard_normal(uv.shape)
    known = Keypoints(frame, video.times[frame], MODEL.joint_names, uv, np.ones(uv.shape[:2]))
    monkeypatch.setattr(detected, "find_people", lambda *_: {1: known})
    write_camera(tmp_path / "c.json", turned[0].camera(CAMERA))  # of the first frame
    errors = []
    for choice in ("auto", "off"):
        words = ["lift", video.path, "--camera", tmp_path / "c.json", "-o", tmp_path / "o.csv"]
        words += ["--overlay", tmp_path / "o.mp4"] if choice == "auto" else []
        assert main([*map(str, words), "--stabilize", choice]) == 0
        found = np.genfromtxt(tmp_path / "o.csv", delimiter=",", names=True)
        off = found["l_hip_x"] - places[:, MODEL.joint_names.index("l_hip"), 0]
        errors.append(np.abs(off).max())
    err = capsys.readouterr().err
    assert "frames are stabilised to frame 0" in err and "counts as still: --stabilize auto" in err
    assert errors[0] < 0.1 < 0.5 < errors[1]
    shown, drawn = (list(v.frames())[-1].image.astype(int) for v in (video, Video(tmp_path / "o.mp4")))
    figure = np.nonzero(np.abs(drawn - shown).max(axis=2) > 40)[1]
    assert np.median(figure) == pytest.approx(uv[-1, :, 0].mean(), abs=8)  # where the camera has turned to


def test_stabilising_is_for_videos(tmp_path, capsys):
    (tmp_path / "k.csv").write_text("frame,time\n")
    words = ["lift", str(tmp_path / "k.csv"), "-o", str(tmp_path / "o.csv"), "--stabilize", "auto"]
    assert main(words) == 2
    assert "--stabilize is for a video" in capsys.readouterr().err


def test_the_studio_refuses_a_camera_that_turns_and_reports_one_that_shakes(tmp_path):
    noted: list[str] = []
    require_still(film(tmp_path / "still.mp4", views(0.0, 0.0)), CAMERA, people(), noted.append)
    assert not noted
    require_still(film(tmp_path / "shaken.mp4", views(0.0, 0.01)), CAMERA, people(), noted.append)
    assert len(noted) == 1 and "shaken.mp4: its camera turns by up to" in noted[0]
    with pytest.raises(
        UserError, match="panned.mp4: its camera turns by up to .*; lift it by gait lift --stab"
    ):
        require_still(film(tmp_path / "panned.mp4", views(0.3, 0.0)), CAMERA, people(), noted.append)
