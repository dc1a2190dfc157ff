"""First states: read from a file, with every fault reported, and found in the pictures."""

import json
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from drawn_person import DATA, camera, clip, draw, state_at, wall, write

from gait import Camera, Model, Start, UserError, Video
from gait.bindings.initial import DEFAULT_SD
from gait.bindings.model import read_blob
from gait.bindings.start_fit import Box, StartFit
from gait.io import blob
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_truth
from gait.io.video import Frame
from gait.track.box_start import BoxStart, find_start
from gait.track.clip_background import one_is_grey, stays

MODEL = Model()
SECTIONS = blob.decode(read_blob(None))
FULL = {
    "frame": 64,
    "pelvis": [-0.1, 5.47, 0.82],
    "heading_rad": -1.5708,
    "phase": 0.108,
    "stride_hz": 0.816,
    "stature_m": 1.65,
    "sd": {"pelvis": 0.1, "heading_rad": 0.2, "phase": 0.06, "stride_hz": 0.07, "stature_m": 0.02},
}


@pytest.fixture
def init(tmp_path):
    def write_json(data):
        path = tmp_path / "init.json"
        path.write_text(data if isinstance(data, str) else json.dumps(data))
        return path

    return write_json


def test_a_full_file_is_taken_as_it_is(init):
    start = Start.read(init(FULL), MODEL)
    mean, sd = start.mean, start.sd
    assert start.frame == 64
    np.testing.assert_array_equal(mean.pelvis, FULL["pelvis"])
    assert (mean.heading, mean.phase, mean.stride_hz, mean.stature) == (-1.5708, 0.108, 0.816, 1.65)
    np.testing.assert_array_equal(sd.pelvis, [0.1, 0.1, 0.1])
    assert (sd.heading, sd.phase, sd.stride_hz, sd.stature) == (0.2, 0.06, 0.07, 0.02)


def test_given_values_without_sd_get_the_documented_one(init):
    start = Start.read(init({k: v for k, v in FULL.items() if k != "sd"}), MODEL)
    sd = start.sd
    assert (sd.heading, sd.phase, sd.stride_hz, sd.stature) == tuple(
        DEFAULT_SD[k] for k in ("heading_rad", "phase", "stride_hz", "stature_m")
    )
    np.testing.assert_array_equal(sd.pelvis, [0.05] * 3)


@pytest.mark.parametrize("key", ["pelvis", "heading_rad", "phase", "stride_hz", "stature_m"])
def test_absent_values_keep_the_broad_prior(key, init):
    mean, sd = MODEL.prior()
    start = Start.read(init({k: v for k, v in FULL.items() if k not in (key, "sd")}), MODEL)
    name = {"heading_rad": "heading", "stature_m": "stature"}.get(key, key)
    np.testing.assert_array_equal(getattr(start.sd, name), getattr(sd, name))
    if key != "pelvis":
        assert getattr(start.mean, name) == getattr(mean, name)


def test_an_empty_file_is_the_prior_standing_on_the_ground(init):
    mean, sd = MODEL.prior()
    start = Start.read(init({}), MODEL)
    assert start.frame == 0 and start.sd.phase == sd.phase
    assert start.mean.pelvis[2] == pytest.approx(MODEL.pelvis_height(mean))


def test_pelvis_without_height_stands_on_the_ground(init):
    start = Start.read(init({**FULL, "pelvis": [1.0, 2.0]}), MODEL)
    assert start.mean.pelvis[2] == pytest.approx(MODEL.pelvis_height(start.mean))
    taller = Start.read(init({**FULL, "pelvis": [1.0, 2.0]}), MODEL, height=1.9)
    assert taller.mean.stature == 1.9
    assert taller.mean.pelvis[2] == pytest.approx(start.mean.pelvis[2] * 1.9 / 1.65)


def test_sd_of_each_axis(init):
    start = Start.read(init({**FULL, "sd": {"pelvis": [0.1, 0.2, 0.3]}}), MODEL)
    np.testing.assert_array_equal(start.sd.pelvis, [0.1, 0.2, 0.3])
    assert start.sd.phase == DEFAULT_SD["phase"]


def test_phase_one_is_phase_zero(init):
    assert Start.read(init({"phase": 1.0}), MODEL).mean.phase == 0


@pytest.mark.parametrize("place", [[1.1e4, 0], [0, -1e6, 0.9], [0, 0, 2e4]])
def test_a_pelvis_beyond_ten_kilometres_is_refused(place, init):
    with pytest.raises(UserError, match=r"pelvis is more than 10000 m from the origin; put"):
        Start.read(init(FULL | {"pelvis": place}), MODEL)


def test_frame_comes_from_the_file_or_from_the_caller(init):
    path = init(FULL)
    assert Start.read(path, MODEL, frame=64).frame == 64
    with pytest.raises(UserError, match="init.json: frame is 64, --start is 60; leave one"):
        Start.read(path, MODEL, frame=60)
    assert Start.read(init({"phase": 0.2}), MODEL, frame=7).frame == 7


def test_a_byte_order_mark_is_passed_over(init):
    assert Start.read(init("\ufeff" + json.dumps(FULL)), MODEL).frame == 64


FAULTS = [
    ({"phase": float("nan")}, "phase is not finite; give the phase"),
    ({"phase": 1.2}, "phase is 1.2, outside"),
    ({"phase": "0.3"}, "phase is not a number"),
    ({"heading_rad": 90}, "heading_rad is 90, outside .*radians"),
    ({"stride_hz": 0}, "stride_hz is 0, outside"),
    ({"stature_m": 165}, "stature_m is 165, outside .*metres"),
    ({"stature_m": None}, "stature_m is not a number"),
    ({"frame": 1.5}, "frame is 1.5, not a whole number"),
    ({"frame": -1}, "frame is -1, outside"),
    ({"frame": 10**30}, r"frame is 1e\+30, outside"),
    ({"frame": 10**400}, "frame is not finite"),
    ({"pelvis": [1, [2, 3]]}, "pelvis is not an array of numbers"),
    ({"pelvis": [10**400, 2]}, "pelvis is not an array of numbers"),
    ({"pelvis": None}, "pelvis is null; give x and y"),
    ({"pelvis": [1]}, "pelvis has shape 1, not 2; give x and y"),
    ({"pelvis": 3.0}, "pelvis has shape one number, not 2"),
    ({"pelvis": [1, 2, float("inf")]}, "pelvis is not finite"),
    ({"pelvis": {"x": 1}}, "pelvis is not an array of numbers"),
    ({"sd": {"phase": -0.1}}, "sd: phase is -0.1, outside"),
    ({"sd": {"pelvis": -0.1}}, "sd: pelvis is negative"),
    ({"sd": {"pelvis": [0.1, 0.1]}}, "sd: pelvis has shape 2, not"),
    ({"sd": {"speed": 1}}, "sd: speed is not a known key; use pelvis"),
    ({"sd": 0.1}, "sd is not a table of keys"),
    ({"heading": 0.1}, "heading is not a known key; use frame pelvis heading_rad"),
    ("{'phase': 1}", "not valid JSON"),
    ("3", "contains no JSON object"),
    ("[" * 100_000, r"not valid JSON \(brackets nested too deeply\); correct it"),
    ('{"frame": ' + "1" * 5000 + "}", "not valid JSON .*; correct it"),
]


@pytest.mark.parametrize("data, words", FAULTS, ids=[f[1] for f in FAULTS])
def test_every_fault_names_file_and_key(data, words, init):
    with pytest.raises(UserError, match=f"init.json: {words}") as caught:
        Start.read(init(data), MODEL)
    assert "\n" not in str(caught.value)


def test_a_stature_in_centimetres_is_refused(init):
    with pytest.raises(UserError, match="--height: 165 m is not a stature; give metres"):
        Start.read(init({}), MODEL, height=165)


def walk(tmp_path, view, **motion):
    """Drawn walk after a few empty frames, as a video; returns it with its states."""
    pictures, states = clip(MODEL, SECTIONS, 34, view=view, **motion)
    write(tmp_path / "walk.mp4", [wall()] * 3 + pictures)
    return Video(tmp_path / "walk.mp4"), states


@pytest.mark.parametrize("heading, start", [(0.0, (-0.6, 0.0)), (2.6, (0.5, -0.2)), (-0.8, (-0.5, 1.2))])
def test_a_person_is_found_in_place(heading, start, tmp_path):
    view = camera(place=(0.0, -6.0, 2.2))
    video, states = walk(tmp_path, view, heading=heading, start=start)
    found = find_start(video, view, wall(), MODEL)
    assert 3 <= found.frame <= 22  # in the middle of what was seen of the person
    truth = states[found.frame - 3]
    mean, sd = found.mean, found.sd
    assert (np.abs(mean.pelvis - truth.pelvis) < 2.5 * sd.pelvis).all()
    assert mean.stature == pytest.approx(1.75, abs=2.5 * sd.stature)
    assert abs((mean.heading - heading + np.pi) % (2 * np.pi) - np.pi) < 2 * sd.heading < 1.0
    assert mean.stride_hz == pytest.approx(0.9, abs=2 * sd.stride_hz) and sd.phase >= 0.5
    # wide along the viewing ray, narrow across
    assert sd.pelvis[1] > 2 * sd.pelvis[0]


def test_a_known_stature_is_believed(tmp_path):
    view = camera(place=(0.0, -6.0, 3.0))
    video, _ = walk(tmp_path, view, stature=1.6)
    unknown, known = (
        find_start(video, view, wall(), MODEL),
        find_start(video, view, wall(), MODEL, height=1.6),
    )
    assert known.sd.stature < unknown.sd.stature and known.mean.stature == pytest.approx(1.6, abs=0.03)


def test_a_standing_person_has_no_heading(tmp_path):
    view = camera(place=(0.0, -6.0, 2.2))
    pictures, states = clip(MODEL, SECTIONS, 1, view=view)
    write(tmp_path / "stand.mp4", pictures * 33)
    found = find_start(Video(tmp_path / "stand.mp4"), view, wall(), MODEL)
    assert found.sd.heading >= np.pi - 1e-6
    assert found.mean.stride_hz == pytest.approx(MODEL.info.stride_hz)


@pytest.mark.parametrize(
    "count, words",
    [
        (1, "only 1 frame to track; give at least one second of film, and check --start"),
        (5, "only 5 frames to track, --init auto needs 8; give --init FILE"),
    ],
)
def test_too_few_frames_to_find_a_person_are_reported(tmp_path, count, words):
    write(tmp_path / "few.mp4", [wall()] * count)
    with pytest.raises(UserError, match=f"few.mp4: {words}"):
        find_start(Video(tmp_path / "few.mp4"), camera(), wall(), MODEL)


def test_an_empty_picture_is_reported(tmp_path):
    write(tmp_path / "empty.mp4", [wall()] * 12)
    with pytest.raises(UserError, match="empty.mp4: --init auto found no person .*give --init FILE.json"):
        find_start(Video(tmp_path / "empty.mp4"), camera(), wall(), MODEL)
    with pytest.raises(UserError, match="empty.mp4: --init auto found no person .*give --init FILE.json"):
        find_start(Video(tmp_path / "empty.mp4"), camera(), None, MODEL)


CLIPS = DATA / "eval" / "dev"


@pytest.mark.long
@pytest.mark.skipif(not CLIPS.is_dir(), reason="../shared/data is absent")
@pytest.mark.parametrize("name", ["side_rl_16", "oblique45_pole_05", "toward300_08"])
def test_a_person_is_found_without_a_background(name):
    video, truth = (Video(CLIPS / name / "video.mp4"), read_truth(CLIPS / name / "truth.csv"))
    found = find_start(video, Camera.read(str(CLIPS / name / "camera.json"), video.size), None, MODEL)
    path = truth.places["pelvis"][found.frame : found.frame + 31]
    off = found.mean.pelvis - path[0]
    assert (np.abs(off) < 2.5 * found.sd.pelvis).all() and found.sd.pelvis.max() < 1.5
    turn = found.mean.heading - np.arctan2(*(path[-1] - path[0])[1::-1])
    assert abs((turn + np.pi) % (2 * np.pi) - np.pi) < 2 * found.sd.heading < 1.5


def test_who_walks_goes_before_who_stands_nearer(tmp_path):
    view = camera(place=(0.0, -6.0, 2.2))
    standing, _ = clip(MODEL, SECTIONS, 1, view=view, start=(1.2, -1.5))
    pictures, states = [], []
    for i in range(34):
        states.append(state_at(MODEL, SECTIONS, i / 30, start=(-1.4, 0.0)))
        pictures.append(draw(MODEL, view, states[-1], standing[0], i))
    write(tmp_path / "two.mp4", pictures)
    found = find_start(Video(tmp_path / "two.mp4"), view, wall(), MODEL)
    off = found.mean.pelvis - states[found.frame].pelvis
    assert (np.abs(off) < 2.5 * found.sd.pelvis).all() and abs(found.mean.heading) < 2 * found.sd.heading


def test_two_people_who_pass_are_kept_apart(tmp_path):
    view = camera(place=(0.0, -6.0, 2.2))
    both = []
    for i in range(34):
        mine = state_at(MODEL, SECTIONS, i / 30, start=(-1.3, 0.0))
        other = state_at(MODEL, SECTIONS, i / 30, start=(1.6, 1.5), heading=np.pi)
        both.append(draw(MODEL, view, mine, draw(MODEL, view, other, wall(), i), i))
    write(tmp_path / "two.mp4", both)
    found = find_start(Video(tmp_path / "two.mp4"), view, wall(), MODEL)
    at, turned = (0.0, 0.0) if abs(found.mean.heading) < 1 else (1.5, np.pi)
    assert abs(found.mean.pelvis[1] - at) < 2.5 * found.sd.pelvis[1]
    assert abs((found.mean.heading - turned + np.pi) % (2 * np.pi) - np.pi) < 2 * found.sd.heading


def in_mirror(view, state, i):
    """The wall with a mirror 1.5 m behind the path, which shows the person from the knees up."""
    corners = view.project([[x, 1.5, z] for x, z in ((-2.5, 0.5), (2.5, 0.5), (2.5, 2.2), (-2.5, 2.2))])
    glass = cv2.fillPoly(np.zeros(wall().shape[:2], np.uint8), [np.rint(corners).astype(np.int32)], 255)
    pelvis = state.pelvis * [1, -1, 1] + [0, 3.0, 0]
    image = replace(state, heading=-state.heading, phase=(state.phase + 0.5) % 1, pelvis=pelvis)
    return np.where(glass[..., None] > 0, draw(MODEL, view, image, wall(), i), wall())


def with_shadow(view, state, _):
    """The wall with the person's shadow on the floor."""
    joints, _ = MODEL.pose(state)
    on_floor = joints * [1, 1, 0] + joints[:, 2:] * [0.45, 0.2, 0]
    places = dict(zip(MODEL.joint_names, np.rint(view.project(on_floor)).astype(np.int32), strict=True))
    shade = np.zeros(wall().shape[:2], np.uint8)
    for chain in ("head_top neck pelvis", *(f"{s}_shoulder {s}_hip {s}_knee {s}_ankle" for s in "lr")):
        cv2.polylines(shade, [np.array([places[name] for name in chain.split()])], False, 255, 9)
    return np.where(shade[..., None] > 0, wall() * 0.55, wall()).astype(np.uint8)


@pytest.mark.parametrize("scene", [in_mirror, with_shadow])
def test_a_mirror_image_and_a_shadow_lose_against_the_person(tmp_path, scene):
    view = camera(place=(-3.0, -5.5, 2.2))
    states = [state_at(MODEL, SECTIONS, i / 30) for i in range(34)]
    pictures = [draw(MODEL, view, state, scene(view, state, i), i) for i, state in enumerate(states)]
    write(tmp_path / "scene.mp4", pictures)
    found = find_start(Video(tmp_path / "scene.mp4"), view, wall(), MODEL)
    off = found.mean.pelvis - states[found.frame].pelvis
    assert (np.abs(off) < 2.5 * found.sd.pelvis).all() and abs(found.mean.heading) < 2 * found.sd.heading < 1
    assert found.hypotheses[0].walks


def test_the_automatic_start_takes_a_person_who_walks_in(tmp_path):
    view = camera(place=(0.0, -6.0, 2.2))
    pictures, _ = clip(MODEL, SECTIONS, 45, view=view)
    write(tmp_path / "walk.mp4", pictures)
    start = BoxStart(view, wall(), MODEL)
    for frame in Video(tmp_path / "walk.mp4").frames(0):
        start.observe(frame)
        found = start.walks_in(frame)
        if found:
            break
    assert found.frame == frame.number and 25 <= frame.number <= 40
    start.forget()
    assert start.best(frame) is None and not start.walks_in(frame)


def test_the_automatic_start_leaves_a_standing_person(tmp_path):
    view = camera(place=(0.0, -6.0, 2.2))
    pictures, _ = clip(MODEL, SECTIONS, 1, view=view)
    write(tmp_path / "stand.mp4", pictures * 45)
    start = BoxStart(view, wall(), MODEL)
    for frame in Video(tmp_path / "stand.mp4").frames(0):
        start.observe(frame)
        assert not start.walks_in(frame)
    assert start.best(frame)


@pytest.mark.parametrize("rate", [6, 10, 15, 25, 30, 60])
def test_detections_alone_suffice_at_any_frame_rate(monkeypatch, rate):
    """Enough detections in time, and no more than a slow detector can deliver."""
    view = camera(place=(0.0, -6.0, 2.2))
    boxes = []

    def one(image, stature):
        foot, head = view.project(np.array([[0.0, 0, 0], [0, 0, 1.7]]))
        boxes.append(Box(foot, head, 0.04 * float(np.hypot(*(foot - head)))))
        return boxes[-1:]

    monkeypatch.setattr("gait.track.box_start.find_people", one)
    start = BoxStart(view, None, MODEL)
    for n in range(2 * rate):
        frame = Frame(n, n / rate, wall())
        start.observe(frame)
    assert start.best(frame)
    assert len(boxes) <= 22


@pytest.mark.skipif(not CLIPS.is_dir(), reason="../shared/data is absent")
def test_a_standing_person_does_not_start_by_detections_alone(tmp_path):
    folder = CLIPS / "oblique45_07"
    first = next(Video(folder / "video.mp4").frames(0)).image
    noise = np.random.default_rng(5)
    held = [np.clip(first + noise.normal(0, 2, first.shape), 0, 255).astype(np.uint8) for _ in range(26)]
    write(tmp_path / "held.mp4", held)
    video = Video(tmp_path / "held.mp4")
    with pytest.raises(
        UserError, match="held.mp4: --init auto found a person who stays .*give --init FILE.json"
    ):
        find_start(video, Camera.read(str(folder / "camera.json"), video.size), None, MODEL)


def test_another_scene_is_reported_and_exposure_is_none():
    fit = StartFit(MODEL, camera())
    bright = np.clip(1.2 * wall() + 10, 0, 255).astype(np.uint8)
    noisy = np.clip(wall() + np.random.default_rng(2).normal(0, 8, wall().shape), 0, 255).astype(np.uint8)
    assert not fit.other_scene(bright, wall()) and not fit.other_scene(noisy, wall())
    assert fit.other_scene(wall(seed=1), wall()) and fit.other_scene(wall(), np.roll(wall(), 12, axis=1))


def test_a_grey_plate_does_not_suit_colours():
    grey = np.repeat(wall()[..., :1], 3, axis=2)
    assert one_is_grey(wall(), grey) and one_is_grey(grey, wall())
    assert not one_is_grey(grey, grey) and not one_is_grey(wall(), wall(seed=1))


def test_a_camera_whose_height_is_wrong_is_reported(tmp_path):
    pictures, _ = clip(MODEL, SECTIONS, 20)
    write(tmp_path / "walk.mp4", pictures)
    true = camera()
    low = replace(true, t=-true.R @ (true.centre * [1, 1, 0.4]))
    with pytest.raises(
        UserError, match=r"found a person in \d+ frames that the camera makes 0\.\d+ m tall; check the"
    ):
        find_start(Video(tmp_path / "walk.mp4"), low, wall(), MODEL)


def test_a_wrong_camera_is_reported_from_most_frames(tmp_path):
    pictures, _ = clip(MODEL, SECTIONS, 20)
    write(tmp_path / "walk.mp4", pictures)
    up = np.array([[1, 0, 0], [0, 0.5, -0.866], [0, 0.866, 0.5]])
    upward = replace(camera(), R=up, t=-up @ camera().centre)
    with pytest.raises(
        UserError, match=r"found a person in \d+ frames that the camera places above the horizon"
    ):
        find_start(Video(tmp_path / "walk.mp4"), upward, wall(), MODEL)


@pytest.mark.parametrize(
    "aside, nearer, shown, expected",
    [(0.0, 1.0, 1.0, True), (0.0, 2.5, 1.0, True), (3.0, 1.0, 1.0, False), (0.0, 1.0, 0.3, False)],
)
def test_who_stays_in_one_place_of_the_picture_is_in_the_median(aside, nearer, shown, expected):
    """In place, towards the camera, across the view; and for a third of the clip only."""
    trunk = np.array([[-0.1, 0.0], [0.1, 0.0], [-0.08, 0.5], [0.08, 0.5]]) * 100 + 300
    done = np.linspace(0, 1, 90)[:, None, None]
    uv = (1 + (nearer - 1) * done) * (trunk - 300) + 300 + done * [100 * aside, 0.0]
    names = ("l_shoulder", "r_shoulder", "l_hip", "r_hip")
    frame = np.arange(90)
    film = SimpleNamespace(count=round(90 / shown))
    people = {0: Keypoints(frame, frame / 30, names, uv, np.ones(uv.shape[:2]))}
    assert stays(SimpleNamespace(people=people, person=0, video=film, poses={})) == expected
