"""A person is followed wherever they are in view: before the start, after a loss, beside other people."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_person import camera, clip, wall, write

from gait import Model, Tracker, TrackerConfig, TrackStatus, Video
from gait.bindings.frame import FrameKeypoints
from gait.bindings.model import read_blob
from gait.cli import main
from gait.io import blob, keypoints_file, video
from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.track.person_keypoints import PersonKeypoints
from gait.track.plausible import Plausibility

MODEL = Model()
FRAMES, TRUE = clip(MODEL, blob.decode(read_blob(None)), 30)
JOINTS = np.array([MODEL.pose(state)[0] for state in TRUE])
START = 15
GAP = 45


def init(folder, frame, number):
    state = TRUE[frame]
    start = {
        "frame": number,
        "pelvis": state.pelvis.tolist(),
        "heading_rad": state.heading,
        "phase": state.phase,
        "stride_hz": state.stride_hz,
        "stature_m": state.stature,
    }
    (folder / "init.json").write_text(json.dumps(start))


@pytest.fixture
def folder(tmp_path):
    """The drawn walk with its camera, its empty scene and a start in its middle."""
    write(tmp_path / "walk.mp4", FRAMES)
    cv2.imwrite(str(tmp_path / "plate.png"), wall())
    (tmp_path / "camera.json").write_text(json.dumps(camera().to_dict()))
    init(tmp_path, START, START)
    return tmp_path


def track(folder, *options):
    words = ["track", folder / "walk.mp4", "--camera", folder / "camera.json", "-o", folder / "o.csv"]
    words += ["--init", folder / "init.json", "--particles", 400, "--detector", "none"]
    if "--background" not in options:
        words += ["--background", folder / "plate.png"]
    return main([str(word) for word in (*words, *options)])


def errors(folder):
    """Frames of the track, and their errors as far as they show the walk, metres."""
    rows = read_track(folder / "o.csv")
    mine = np.stack([rows.places[name] for name in ("l_knee", "r_knee", "l_ankle", "r_ankle")], axis=1)
    order = [MODEL.joint_names.index(name) for name in ("l_knee", "r_knee", "l_ankle", "r_ankle")]
    return rows, mine, order


def test_every_frame_is_covered_from_a_start_in_the_middle(folder, capsys):
    more = ("--overlay", folder / "o.mp4", "--trc", folder / "o.trc")
    assert track(folder, *more) == 0
    rows, mine, order = errors(folder)
    assert rows.frame.tolist() == list(range(len(FRAMES))) and set(rows.status) == {"tracking"}
    off = np.linalg.norm(mine - JOINTS[:, order], axis=2).mean(axis=1)
    assert off.max() < 0.12 and np.median(off[:START]) < 0.06
    assert Video(folder / "o.mp4").count == len(FRAMES)
    assert len((folder / "o.trc").read_text().splitlines()) == len(FRAMES) + 6
    assert "followed from frame 0 to 29" in capsys.readouterr().err


def test_the_smoother_covers_the_frames_before_the_start_too(folder):
    assert track(folder, "--smooth", "--draws", folder / "d.npz") == 0
    rows, mine, order = errors(folder)
    with np.load(folder / "d.npz") as draws:
        assert rows.frame.tolist() == draws["frame"].tolist() == list(range(len(FRAMES)))
    assert np.linalg.norm(mine - JOINTS[:, order], axis=2).mean() < 0.12


def test_frames_from_the_last_to_the_first(folder, monkeypatch):
    film = Video(folder / "walk.mp4")
    monkeypatch.setattr(video, "_CHUNK_BYTES", 1)  # the least chunk, 8 frames
    back, forth = list(film.backwards(21, 2)), list(film.frames(2, 21))
    assert [(f.number, f.time) for f in back] == [(f.number, f.time) for f in reversed(forth)]
    assert np.array_equal(back[0].image, forth[-1].image)


@pytest.mark.parametrize("at", [0, len(FRAMES) + GAP + START])
def test_a_person_who_comes_back_is_found_by_keypoints(at, folder, capsys):
    """The person walks, is away, and walks again from the first place; the start is in either walk."""
    write(folder / "walk.mp4", [*FRAMES, *[wall()] * GAP, *FRAMES])
    again = len(FRAMES) + GAP
    init(folder, at % again, at)
    count = 2 * len(FRAMES) + GAP
    uv = np.full((count, len(MODEL.joint_names), 2), np.nan)
    uv[: len(FRAMES)] = uv[-len(FRAMES) :] = camera().project(JOINTS)
    frame = np.arange(count)
    found = keypoints_file.Keypoints(frame, frame / 30, MODEL.joint_names, uv, np.ones(uv.shape[:2]))
    keypoints_file.write(folder / "k.csv", found)
    assert track(folder, "--keypoints", folder / "k.csv") == 0
    rows, mine, order = errors(folder)
    assert rows.frame.tolist() == frame.tolist()
    assert "lost" in rows.status[len(FRAMES) : again]
    for walk in (slice(0, len(FRAMES)), slice(again, count)):
        off = np.linalg.norm(mine[walk] - JOINTS[:, order], axis=2).mean(axis=1)
        assert off.max() < 0.15 and "lost" not in rows.status[walk]
    assert "back at frame" in capsys.readouterr().err


def test_a_film_of_noise_ends_with_a_warning(folder, capsys):
    random = np.random.default_rng(1)
    write(folder / "walk.mp4", random.integers(0, 255, (40, 240, 320, 3), dtype=np.uint8))
    assert track(folder, "--background", "auto") == 1
    assert "the person was lost nearly all the time" in capsys.readouterr().err
    rows = read_track(folder / "o.csv")
    assert "tracking" not in rows.status and rows.status[-1] == "lost"


@pytest.fixture(scope="module")
def estimate():
    """What a tracker has of the walk's last frame."""
    tracker = Tracker(MODEL, camera(), TrackerConfig.default(particles=200), background=wall())
    mean, sd = MODEL.prior()
    sd.pelvis[:] = sd.heading = sd.phase = 0.02
    tracker.start(TRUE[-1], sd, 0)
    tracker.step(FRAMES[-1], 0)
    now = tracker.step(FRAMES[-1], 1)
    return replace(now, joints=JOINTS[-1], mean=TRUE[-1], status=TrackStatus.TRACKING)


def found(shift=0.0, joints=JOINTS[-1]):
    """Keypoints of a person so many metres aside."""
    return FrameKeypoints(MODEL.joint_names, camera().project(joints + [shift, 0, 0]), 2.0)


def test_keypoints_of_another_person_are_left_out(estimate):
    us, them, away = found(0.03), found(0.9), replace(estimate, status=TrackStatus.LOST)
    people = PersonKeypoints(camera(), {1: {0: them, 1: them}, 2: {0: us}}, 1)
    zero, one, two = (Frame(i, i / 30, FRAMES[-1]) for i in range(3))
    assert people.choose(zero, estimate) is us and people.choose(one, estimate) is None
    assert people.choose(one, None) is them and people.choose(one, away) is them
    assert people.agree(zero, estimate) is True and people.agree(one, estimate) is False
    assert people.agree(two, estimate) is None and not people.contradict(two, estimate)
    assert people.contradict(one, estimate) and not people.contradict(zero, estimate)


def test_legs_that_keypoints_show_elsewhere_are_no_agreement(estimate):
    legs = [i for i, name in enumerate(MODEL.joint_names) if name[2:] in ("knee", "ankle")]
    astride = JOINTS[-1].copy()
    astride[legs, 0] += [0.25 * (-1) ** i for i in range(len(legs))]
    people = PersonKeypoints(camera(), {0: {0: found(joints=astride)}}, 0)
    frame = Frame(0, 0.0, FRAMES[-1])
    assert people.choose(frame, estimate) is not None and people.agree(frame, estimate) is False


@pytest.mark.parametrize(
    "spike, grown, status", [(0.0, 0.0, "TRACKING"), (1.0, 0.0, "AMBIGUOUS"), (0.0, 0.5, "AMBIGUOUS")]
)
def test_without_keypoints_a_walk_must_be_plausible(estimate, spike, grown, status):
    plausible = Plausibility(PersonKeypoints(camera(), {}, -1), 1.75, 0.05, 0.0)
    for i in range(40):
        mean = replace(TRUE[-1], stature=1.75 + grown, heading=0.0)
        mean.pelvis = np.array([1.2 * i / 30 + spike * (i > 20), 0.0, 0.95])
        now = plausible.judged(Frame(i, i / 30, FRAMES[0]), replace(estimate, mean=mean, speed=1.2))
    assert now.status == TrackStatus[status]
