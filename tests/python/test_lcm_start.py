"""Where a track begins: START and --init combined with the frames that arrive."""

import json

import cv2
import lcm_rig as rig
import pytest

from gait.bindings.initial import Start
from gait.lcm.link import gaitmsg
from gait.lcm.messages import command_message, state_message


def tracked(outcome):
    return [m.frame for m in outcome.estimates]


def track(tmp_path, events, *options):
    return rig.play(rig.write_log(tmp_path / "a.log", events), *options)


def test_start_waits_for_its_capture_time(tmp_path):
    events = [*rig.opening()[:2], ("GAIT_COMMAND", rig.start(3)), *rig.frames(0, 6)]
    outcome = track(tmp_path, events)
    assert tracked(outcome) == [3, 4, 5]
    assert [m.step for m in outcome.estimates] == [0, 1, 2]


def test_start_without_a_time_begins_at_the_next_frame(tmp_path):
    events = [*rig.opening()[:2], *rig.frames(0, 2), ("GAIT_COMMAND", rig.start(2, at=0)), *rig.frames(2, 5)]
    assert tracked(track(tmp_path, events)) == [2, 3, 4]


def test_start_between_two_frames_predicts_to_the_second(tmp_path):
    events = [*rig.opening()[:2], ("GAIT_COMMAND", rig.start(2, at=rig.utime(2) - 10_000)), *rig.frames(0, 5)]
    assert tracked(track(tmp_path, events)) == [2, 3, 4]


def test_a_start_long_past_is_refused(tmp_path):
    events = [
        *rig.opening()[:2],
        ("GAIT_COMMAND", rig.start(0, at=rig.utime(0) - 900_000)),
        *rig.frames(0, 3),
    ]
    outcome = track(tmp_path, events, "--max-gap", 0.8)
    assert outcome.frames == 0 and "0.900 s later than the start" in outcome.words
    assert track(tmp_path, events).frames == 3


def test_unknown_fields_of_start_take_the_prior(tmp_path):
    mean, sd = rig.model().prior()
    known = {"phase": 0.1, "pelvis": [-0.5, 0, 0.95]}
    uncertainty = {"phase": 0.05, "pelvis": [0.05] * 3}
    partial, full = rig.start(0), rig.start(0)
    partial.mean, partial.sd = state_message(known), state_message(uncertainty)
    mean.phase, mean.pelvis, sd.phase, sd.pelvis = 0.1, known["pelvis"], 0.05, uncertainty["pelvis"]
    full.mean, full.sd = state_message(mean), state_message(sd)
    outcomes = [
        track(tmp_path, [*rig.opening()[:2], ("GAIT_COMMAND", start), *rig.frames(0, 3)])
        for start in (partial, full)
    ]
    assert outcomes[0].digest == outcomes[1].digest and outcomes[0].frames == 3


def test_camera_scene_and_start_by_file_are_the_same_as_by_message(tmp_path):
    camera, scene, init = tmp_path / "c.json", tmp_path / "p.ppm", tmp_path / "i.json"
    camera.write_text(json.dumps(rig.CAMERA.to_dict()))
    cv2.imwrite(str(scene), rig.plate())  # a PPM is RGB
    state = rig.person(2)
    content = {
        "frame": 2,
        "pelvis": state.pelvis.tolist(),
        "heading_rad": state.heading,
        "phase": state.phase,
        "stride_hz": state.stride_hz,
        "stature_m": state.stature,
        "sd": {"pelvis": 0.03, "heading_rad": 0.05, "phase": 0.02, "stride_hz": 0.02, "stature_m": 0.02},
    }
    init.write_text(json.dumps(content))
    options = ("--camera", camera, "--background", scene, "--init", init)
    by_file = track(tmp_path, rig.frames(0, 6), *options)
    assert tracked(by_file) == [2, 3, 4, 5]

    read = Start.read(init, rig.model())
    start = command_message(gaitmsg.command_t.START, rig.utime(2), read.mean, read.sd)
    opening = rig.opening()
    scene_message = opening[1][1]
    scene_message.data = rig.plate()[..., ::-1].tobytes()
    scene_message.pixelformat = scene_message.PIXEL_FORMAT_RGB
    by_message = track(tmp_path, [*opening[:2], ("GAIT_COMMAND", start), *rig.frames(0, 6)])
    assert by_message.digest == by_file.digest


def test_a_start_at_a_lost_frame_is_dated_between_its_neighbours(tmp_path):
    init = tmp_path / "i.json"
    init.write_text(json.dumps({"frame": 2, "pelvis": rig.person(2).pelvis.tolist(), "phase": 0.2}))
    frames = rig.frames(0, 6)
    events = [*rig.opening()[:2], *frames[:2], *frames[3:]]
    assert tracked(track(tmp_path, events, "--init", init)) == [3, 4, 5]
    outcome = track(tmp_path, [*rig.opening()[:2], *frames[3:]], "--init", init)
    assert outcome.frames == 0 and "began at frame 3, the start is for frame 2" in outcome.words


def bad_start(part, **change):
    start = rig.start(0)
    for name, value in change.items():
        setattr(getattr(start, part), name, value)
    return ("GAIT_COMMAND", start)


@pytest.mark.parametrize(
    ("part", "change", "words"),
    [
        ("mean", {"ncoef": 99}, "ncoef 99"),
        ("mean", {"stature": -1.0}, "start mean.stature = -1 is outside [0.5, 2.5]; send another START"),
        ("mean", {"pelvis": [1e30, 0, 1]}, "start mean.pelvis = 1e+30 is outside"),
        ("sd", {"stature": 1e6}, "start sd.stature = 1e+06 is outside [0, 10]"),
        ("sd", {"heading": float("inf")}, "start sd.heading = inf is outside"),
    ],
)
def test_a_senseless_start_is_refused_at_once(tmp_path, part, change, words):
    """Before a frame or the camera arrives, and while a person is tracked, who continues to be tracked."""
    camera, scene, good = rig.opening()
    bad = bad_start(part, **change)
    for events in ([camera, scene, bad], [bad, camera, scene]):
        assert track(tmp_path, events).words.count(words) == 1
    running = track(tmp_path, [camera, scene, good, *rig.frames(0, 3), bad, *rig.frames(3, 6)])
    assert running.words.count(words) == 1
    plain = track(tmp_path, [camera, scene, good, *rig.frames(0, 6)])
    assert running.digest == plain.digest and tracked(running) == list(range(6))
