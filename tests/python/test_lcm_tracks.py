"""gait-trackd --keypoints-term: joints of a detector are used with the frames that they were found in."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import lcm_rig as rig
import numpy as np
import pytest

from gait.bindings.abi import Term
from gait.bindings.config import TrackerConfig
from gait.bindings.frame import FrameKeypoints
from gait.lcm.link import gaitmsg
from gait.lcm.messages import image_message, tracks_message
from gait.track.tracker import Tracker

FRAMES, SD = 16, 1.0
PRINTED = re.compile(r"keypoint_messages (\d+) keypoints_used (\d+) keypoints_late (\d+)")


@cache
def found(frame: int) -> tuple[np.ndarray, np.ndarray]:
    """What a detector reports for a frame: pixels (P, 2) with gaps, and confidences."""
    rng = np.random.default_rng(frame)
    uv = rig.CAMERA.project(rig.model().pose(rig.person(frame))[0])
    uv = (uv + 0.3 * rng.normal(size=uv.shape)).astype(np.float32)
    uv[rng.random(len(uv)) < 0.15] = np.nan
    return uv, rng.uniform(0.3, 1.0, len(uv)).astype(np.float32)


def image(frame: int) -> rig.Event:
    return "GAIT_IMAGE_0", rig.frame_message(frame)


def tracks(frame: int, names: list[str] | None = None) -> rig.Event:
    uv, confidence = found(frame)
    order = slice(None, None, -1)  # a detector has an order of its own
    names = names or list(rig.model().joint_names[order])
    return "GAIT_TRACKS_0", tracks_message(names, uv[order], rig.utime(frame), frame, confidence[order])


def errors(frame: int) -> np.ndarray:
    """Errors that a detector states: all and lasting, pixels, and correlation, seconds."""
    rng = np.random.default_rng(100 + frame)
    return rng.uniform([0.5, 0.1, 0.0], [3.0, 0.4, 2.0], (len(rig.model().joint_names), 3))


def play(tmp_path: Path, events: list[rig.Event], *options: object) -> tuple[rig.Outcome, tuple[int, ...]]:
    """Track a log with the term; also return how many tracks came, were used and were late."""
    log = rig.write_log(tmp_path / "a.log", [*rig.opening(), *events])
    outcome = rig.play(log, "--keypoints-term", "--keypoints-sd", SD, *options)
    printed = PRINTED.search(outcome.printed)
    assert printed, outcome.printed
    return outcome, tuple(int(n) for n in printed.groups())


def each(first: int = 0, stop: int = FRAMES) -> list[rig.Event]:
    """Every frame, followed by what is found in it."""
    return [event for i in range(first, stop) for event in (image(i), tracks(i))]


def as_in_messages(camera: rig.Camera) -> rig.Camera:
    return replace(
        camera, R=camera.R.astype(np.float32).astype(float), t=camera.t.astype(np.float32).astype(float)
    )


def by_python(stated: bool = False) -> str:
    """Digest of the library with the same input; `stated`: the errors of `errors`."""
    terms = TrackerConfig.default().terms | Term.KEYPOINTS
    tracker = Tracker(
        rig.model(),
        as_in_messages(rig.CAMERA),
        TrackerConfig.default(particles=rig.PARTICLES, terms=terms, lag=5),
        background=rig.plate(),
    )
    tracker.start(rig.person(0), rig.SD, rig.utime(0))
    for i in range(FRAMES):
        uv, confidence = found(i)
        sd = errors(i)[:, 0] if stated else SD / confidence.astype(float)
        tracker.step(rig.picture(i), rig.utime(i), FrameKeypoints(rig.model().joint_names, uv, sd))
    return f"{tracker.digest():016x}"


def test_joints_are_those_of_their_frame_whichever_comes_first(tmp_path: Path) -> None:
    after, printed = play(tmp_path, each())
    assert printed == (FRAMES, FRAMES, 0) and (after.frames, after.dropped) == (FRAMES, 0)
    assert [e.frame for e in after.estimates] == list(range(FRAMES))
    assert after.digest == by_python()
    before, _ = play(tmp_path, [event for i in range(FRAMES) for event in (tracks(i), image(i))])
    mixed, _ = play(tmp_path, [*each(0, 7), tracks(8), image(7), tracks(7), image(8), *each(9)])
    assert before.digest == after.digest == mixed.digest


def test_a_start_at_the_next_frame_is_not_spent_on_one_that_waits(tmp_path: Path) -> None:
    """The frame before a pause waits for its keypoints until the next one arrives."""
    camera, scene, _ = rig.opening()
    late = [("GAIT_IMAGE_0", rig.frame_message(i, utime=rig.utime(i + 100))) for i in range(1, 9)]
    events = [camera, scene, image(0), ("GAIT_COMMAND", rig.start(1, at=0)), *late]
    outcome = rig.play(rig.write_log(tmp_path / "a.log", events), "--keypoints-term")
    assert [e.frame for e in outcome.estimates] == list(range(1, 9))
    assert "stopped" not in outcome.words and outcome.dropped == 0


def test_errors_that_a_detector_states_count_as_in_a_film(tmp_path: Path) -> None:
    events = []
    for i in range(FRAMES):
        uv, confidence = found(i)
        message = tracks_message(rig.model().joint_names, uv, rig.utime(i), i, confidence, errors=errors(i))
        events += [image(i), ("GAIT_TRACKS_0", message)]
    outcome, printed = play(tmp_path, events)
    assert printed == (FRAMES, FRAMES, 0) and outcome.digest == by_python(stated=True)
    events[9][1].tracks[3].sd = float("nan")
    outcome, printed = play(tmp_path, events)
    assert "or a standard deviation is wrong" in outcome.words and printed == (FRAMES, FRAMES, 0)


def test_they_help_and_are_not_read_without_the_option(tmp_path: Path) -> None:
    log = rig.write_log(tmp_path / "b.log", [*rig.opening(), *each()])
    plain, without = rig.play(log), rig.play(rig.write_log(tmp_path / "c.log", [*rig.opening(), *frames()]))
    assert plain.digest == without.digest and "tracks" not in plain.printed
    fog = np.full((rig.CAMERA.height, rig.CAMERA.width), 120, np.uint8)
    blank = [("GAIT_IMAGE_0", image_message(fog, rig.utime(i), i)) for i in range(FRAMES)]
    dark = [event for i in range(FRAMES) for event in (blank[i], tracks(i))]
    helped, _ = play(tmp_path, dark, "-n", 500)
    unheard, _ = play(tmp_path, dark, "-n", 500, "--keypoints-weight", 0)
    assert error(helped) < 0.6 * error(unheard)


def frames() -> list[rig.Event]:
    return [image(i) for i in range(FRAMES)]


def error(outcome: rig.Outcome) -> float:
    """Mean distance of the joints in the second half, metres."""
    off = [
        np.array([j.position for j in e.joints]) - rig.model().pose(rig.person(e.frame))[0]
        for e in outcome.estimates[FRAMES // 2 :]
    ]
    return float(np.linalg.norm(off, axis=2).mean())


def test_points_of_no_use_are_left_out_and_counted(tmp_path: Path) -> None:
    clean, _ = play(tmp_path, each())
    events = each()
    for _, message in events[1::2]:
        for name in ("nose", message.tracks[0].name):
            track = gaitmsg.track_t()
            track.name, track.u, track.v, track.confidence = name, 5.0, 5.0, 0.9
            message.tracks.append(track)
        message.ntracks = len(message.tracks)
    outcome, printed = play(tmp_path, events)
    assert outcome.digest == clean.digest and printed == (FRAMES, FRAMES, 0)
    assert f" keypoints_left_out {2 * FRAMES} " in outcome.printed
    assert outcome.words.count("'nose' is ignored: the model does not know it") == 1
    assert outcome.words.count("names it twice") == 1


def test_frames_do_not_wait_longer_than_for_the_next_one(tmp_path: Path) -> None:
    """Keypoints that arrive later are counted and named, and change nothing."""
    without, printed = play(tmp_path, frames())
    assert printed == (0, 0, 0) and without.frames == FRAMES  # also the last one, when the log ends
    late = [event for i in range(FRAMES) for event in ([image(i), tracks(i - 1)] if i else [image(0)])]
    outcome, printed = play(tmp_path, late)
    assert printed == (FRAMES - 1, 0, FRAMES - 1) and outcome.digest == without.digest
    assert outcome.words.count("keypoints arrived after their frame had been tracked") == 1


def test_a_clock_set_back_makes_no_later_tracks_late(tmp_path: Path) -> None:
    """All frames after the next START have their joints, including the frame of the START."""
    back = each()
    for _, message in back:
        message.utime -= 900_000
    again = ("GAIT_COMMAND", rig.start(1, at=0))
    outcome, printed = play(tmp_path, [*each(0, 4), *back[:4], again, *back[4:]], "--max-gap", 0.5)
    assert printed == (4 + FRAMES, 2 + FRAMES, 1) and outcome.frames == 2 + FRAMES
    assert outcome.words.count("capture time went back by") == 1


def test_memory_holds_the_largest_frame_and_does_not_grow(tmp_path: Path) -> None:
    size = []
    for stop in (4, FRAMES):
        outcome, _ = play(tmp_path, each(0, stop))
        size.append(int(outcome.printed.split("memory_bytes ")[1].split()[0]))
    plain = rig.play(rig.write_log(tmp_path / "b.log", [*rig.opening(), *frames()]))
    without = int(plain.printed.split("memory_bytes ")[1].split()[0])
    assert size[0] == size[1] and size[0] - without >= 3 * rig.CAMERA.width * rig.CAMERA.height
    broad = image_message(rig.picture(2), rig.utime(2), 2)
    broad.data += bytes(1 << 17)  # more than there is space for: tracked at once, its joints are late
    broad.size = len(broad.data)
    outcome, printed = play(tmp_path, [*each(0, 2), ("GAIT_IMAGE_0", broad), tracks(2), *each(3)])
    assert outcome.frames == FRAMES and printed == (FRAMES, FRAMES - 1, 1)


@pytest.mark.parametrize(
    ("event", "words"),
    [
        (("GAIT_TRACKS_0", tracks(5)[1].encode()[:-3]), "GAIT_TRACKS_0: damaged message"),
        (("GAIT_TRACKS_0", b"x"), "GAIT_TRACKS_0: not a gaitmsg.tracks_t"),
        (tracks(5, [f"p{i}" for i in range(19)]), "the model knows none of these keypoints"),
    ],
    ids=["cut", "other", "strangers"],
)
def test_keypoints_without_use_are_named(tmp_path: Path, event: rig.Event, words: str) -> None:
    outcome, printed = play(tmp_path, [*each(0, 5), image(5), event, *each(6)])
    assert words in outcome.words
    assert outcome.frames == FRAMES and printed[1] == FRAMES - 1
