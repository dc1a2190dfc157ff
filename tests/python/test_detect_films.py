"""People in generated films: in portrait, filling the picture, small; and films without a person."""

import json

import cv2
import numpy as np
import pytest

from gait import Camera, Video, VideoWriter, cli
from gait.detect import weights
from gait.detect.networks import LANDMARK_JOINTS
from gait.detect.people import detect
from gait.io.keypoints_file import read
from gait.io.track_file import read_track

FRAMES, SIZE = 12, (640, 480)
MATRIX = 44  # bytes from the name of an MP4 file's track header to its matrix
TURNS = {0: (1, 0, 0, 1), 90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}
"""Entries a, b, c, d of the matrix by the degrees that players turn the picture clockwise."""


pytestmark = pytest.mark.usefixtures("fetched")


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A simulated walk: its folder, its pictures, and its joints (T, 16, 2) in them."""
    folder = tmp_path_factory.mktemp("walk")
    size = "x".join(map(str, SIZE))
    words = ["simulate", "-o", str(folder), "--frames", str(FRAMES), "--size", size, "--quiet"]
    assert cli.main(words) == 0
    true, _ = read(folder / "truth.csv", tuple(LANDMARK_JOINTS), ignore_unknown=True)
    joints = true.uv[:, [true.names.index(name) for name in LANDMARK_JOINTS]]
    return folder, [frame.image for frame in Video(folder / "video.mp4").frames()], joints


def film(path, pictures, turned=0):
    """Write pictures as a camera does that was held rotated clockwise: sideways, with a matrix."""
    with VideoWriter(path, 30, crf=10) as video:
        for picture in pictures:
            video.write(np.ascontiguousarray(np.rot90(picture, turned // 90)))
    data = bytearray(path.read_bytes())
    at = data.index(b"tkhd") + MATRIX
    a, b, c, d = (65536 * value for value in TURNS[turned])
    data[at : at + 36] = np.array([a, b, 0, c, d, 0, 0, 0, 1 << 30], ">i4").tobytes()
    path.write_bytes(data)
    return Video(path)


def off(found, true):
    """Median distance of the joints found from the true ones, heights of the person."""
    assert list(found) == [1]
    rows = found[1].frame
    assert len(rows) >= FRAMES - 2
    distance = np.median(np.hypot(*(found[1].uv - true[rows]).T))
    return float(distance / np.median(np.ptp(true[..., 1], axis=1)))


@pytest.mark.long
@pytest.mark.parametrize("turned", TURNS)
def test_the_matrix_of_a_film_is_honoured(turned, walk, tmp_path):
    picture = walk[1][0][:, 100:460]
    video = film(tmp_path / "film.mp4", [picture] * 3, turned)
    assert video.size == (360, 480)
    frame = next(video.frames()).image
    assert np.abs(frame.astype(float) - picture).mean() < 4


@pytest.mark.long
def test_a_person_in_portrait_video_is_found_and_tracked(walk, tmp_path):
    folder, pictures, true = walk
    left = 100
    video = film(tmp_path / "film.mp4", [p[:, left : left + 360] for p in pictures], 90)
    assert off(detect(video, "lite"), true - [left, 0]) < 0.05
    camera = json.loads((folder / "camera.json").read_text())
    camera |= {"width": 360, "cx": camera["cx"] - left}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    words = ["track", video.path, "--camera", tmp_path / "camera.json", "--init", folder / "init.json"]
    plate = cv2.imread(str(folder / "background.png"))[:, left : left + 360]
    cv2.imwrite(str(tmp_path / "plate.png"), plate)
    words += [
        "--background",
        tmp_path / "plate.png",
        "-o",
        tmp_path / "track.csv",
        "--detector",
        "lite",
        "--particles",
        500,
        "--quiet",
    ]
    assert cli.main([str(word) for word in words]) == 0
    track = read_track(tmp_path / "track.csv")
    assert track.frame.tolist() == list(range(FRAMES)) and "lost" not in track.status
    joints = np.stack([track.places[name] for name in LANDMARK_JOINTS], axis=1)
    seen = Camera.read(str(tmp_path / "camera.json"), (360, 480)).project(joints)
    height = np.ptp(true[..., 1], axis=1).mean()
    assert np.median(np.hypot(*(seen - true + [left, 0]).T)) < 0.04 * height


def test_a_person_who_fills_the_picture_is_found(walk, tmp_path):
    """The camera pans with them."""
    _, pictures, true = walk
    lefts = np.rint(true[:, :, 0].mean(axis=1) - 110).astype(int)
    tops = np.rint(true[:, :, 1].min(axis=1) - 85).astype(int)
    views = [p[t : t + 400, x : x + 220] for p, x, t in zip(pictures, lefts, tops, strict=True)]
    found = detect(film(tmp_path / "film.mp4", views), "lite")
    assert off(found, true - np.stack([lefts, tops], axis=1)[:, None]) < 0.05


def test_a_person_of_80_pixels_is_found(walk, tmp_path):
    folder, pictures, true = walk
    scale = 80 / 390  # from head to foot
    scene = cv2.resize(cv2.imread(str(folder / "background.png")), (640, 360))
    x, y = 400, 180
    views = []
    for picture in pictures:
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        view = scene.copy()
        view[y : y + small.shape[0], x : x + small.shape[1]] = small
        views.append(view)
    found = detect(film(tmp_path / "film.mp4", views), "lite")
    assert off(found, true * scale + [x, y]) < 0.06


def refused(capsys, folder, *words):
    """Run a command that must end with one line and write nothing; return the line."""
    before = sorted(folder.iterdir())
    assert cli.main([str(word) for word in (*words, "--quiet")]) == 1
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and sorted(folder.iterdir()) == before
    return err


def commands(folder, name):
    """Every command that finds people in a film by itself."""
    path = folder / name
    return {
        "detect": ("detect", path, "--network", "lite", "-o", folder / "k.csv"),
        "camera": ("camera", "--walk", path, "--height", 1.7, "-o", folder / "c.json"),
        "lift": ("lift", path, "--height", 1.7, "-o", folder / "m.csv"),
        "track": (
            *("track", path, "--height", 1.7, "--detector", "lite", "-o", folder / "t.csv"),
            *("--camera-out", folder / "c.json", "--overlay", folder / "o.mp4"),
        ),
    }


COMMANDS = ["detect", "camera", "lift", "track"]
FEET = (
    "the person's feet are not in view for 0.3 s; film the whole person, feet included, for at least a second"
)


@pytest.mark.parametrize("command", COMMANDS[1:])
def test_feet_that_are_never_in_view_are_named(command, walk, tmp_path, capsys):
    film(tmp_path / "film.mp4", [picture[:330] for picture in walk[1]])
    assert FEET in refused(capsys, tmp_path, *commands(tmp_path, "film.mp4")[command])


def test_a_film_of_a_few_frames_is_too_short(walk, tmp_path, capsys):
    film(tmp_path / "film.mp4", walk[1][:5])
    assert FEET in refused(capsys, tmp_path, *commands(tmp_path, "film.mp4")["track"])


@pytest.mark.parametrize("command", COMMANDS[1:])
def test_a_person_larger_than_the_picture_is_refused(command, walk, tmp_path, capsys):
    """Shoulders to knees fill it."""
    views = [cv2.resize(picture[150:350, 180:400], (640, 580)) for picture in walk[1]]
    film(tmp_path / "film.mp4", views)
    line = refused(capsys, tmp_path, *commands(tmp_path, "film.mp4")[command])
    assert any(words in line for words in (FEET, "no person found", "film a walk in full view"))


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", ["two.mp4", "picture.jpg", "picture.png"])
def test_two_frames_and_a_picture_are_no_film(name, command, walk, tmp_path, capsys):
    if name == "two.mp4":
        film(tmp_path / name, walk[1][:2])
    else:
        cv2.imwrite(str(tmp_path / name), walk[1][0])
    count = "2 frames" if name == "two.mp4" else "1 frame"
    line = refused(capsys, tmp_path, *commands(tmp_path, name)[command])
    assert f"{name}: has only {count}; give a video of at least a second" in line


@pytest.mark.parametrize("command", COMMANDS)
def test_a_film_of_noise_shows_no_person(command, tmp_path, capsys):
    random = np.random.default_rng(2)
    film(tmp_path / "film.mp4", random.integers(0, 255, (4, 240, 320, 3), np.uint8))
    line = refused(capsys, tmp_path, *commands(tmp_path, "film.mp4")[command])
    assert "no person found; the whole body should be in view" in line


@pytest.mark.parametrize("command", COMMANDS)
def test_an_empty_file_is_no_film(command, tmp_path, capsys):
    (tmp_path / "film.mp4").write_bytes(b"")
    line = refused(capsys, tmp_path, *commands(tmp_path, "film.mp4")[command])
    assert "film.mp4: is empty; copy or make the video file again" in line


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", ["cut off", "of the other network"])
def test_wrong_weights_are_refused(
    fault, command, walk, fetched, tmp_path, tmp_path_factory, monkeypatch, capsys
):
    folder = tmp_path_factory.mktemp("weights")
    full, lite = (weights.LANDMARK_NETWORKS[name].file for name in ("full", "lite"))
    (folder / weights.PERSON.file).symlink_to(fetched / weights.PERSON.file)
    for name, other in ((full, lite), (lite, full)):
        data = (fetched / other).read_bytes() if fault != "cut off" else (fetched / name).read_bytes()[:-9]
        (folder / name).write_bytes(data)
    monkeypatch.setenv("GAIT_WEIGHTS", str(folder))
    film(tmp_path / "film.mp4", walk[1][:4])
    line = refused(capsys, tmp_path, *commands(tmp_path, "film.mp4")[command])
    assert "is damaged or has another version; delete it" in line
