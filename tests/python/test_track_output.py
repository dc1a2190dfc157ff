"""What `gait track` reports about a clip as a whole."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gait.bindings.abi import TrackStatus
from gait.track.clip_output import Results
from gait.track.wrong_way import AGAINST_STRIDES

RATE = 30.0  # frames per second
IN_VIEW = SimpleNamespace(shows=lambda joints: True)
WALKING: dict[str, Any] = {"status": TrackStatus.TRACKING, "phase": 0.2, "reason": "", "speed": 1.3}
STANDING = {"phase": np.nan, "speed": 0.0}
BACKWARDS = {"status": TrackStatus.AMBIGUOUS, "reason": AGAINST_STRIDES}
RUNNING = {"speed": 2.6}


def results(other: dict[str, Any], frames: int) -> Results:
    """Results of 60 frames of a walk, then `frames` of another motion, then 20 of the walk."""
    found = Results(SimpleNamespace(cameras=[None]))  # type: ignore[arg-type]
    place = 0.0
    for number in range(60 + frames + 20):
        one = WALKING | (other if 60 <= number < 60 + frames else {})
        frame = SimpleNamespace(number=number, time=number / RATE, camera=lambda camera: IN_VIEW)
        estimate = SimpleNamespace(
            status=one["status"], joints=np.array([[place, 0.0, 0.9]]), frame=number,
            mean=SimpleNamespace(phase=one["phase"]), reason=one["reason"],
        )  # fmt: skip
        found.add(frame, estimate)  # type: ignore[arg-type]
        place += one["speed"] / RATE
    return found


@pytest.mark.parametrize(
    "other, frames, noticed",
    [
        (WALKING, 60, False),
        (STANDING, 12, False),
        (STANDING, 18, True),
        (BACKWARDS, 18, True),
        (RUNNING, 60, True),
        (RUNNING | {"status": TrackStatus.LOST}, 60, False),
        (STANDING | {"status": TrackStatus.LOST}, 60, False),
        (WALKING | {"status": TrackStatus.LOST, "speed": 90.0}, 3, False),  # found elsewhere
    ],
)
def test_half_a_second_of_another_motion_is_noticed(other, frames, noticed):
    assert results(other, frames).walks() is not noticed


@pytest.mark.parametrize("frames, noticed", [(20, False), (70, False), (90, True)])
def test_a_person_who_is_hardly_ever_tracked_is_noticed(frames, noticed):
    assert results({"status": TrackStatus.AMBIGUOUS}, frames).walks() is not noticed


def test_a_person_who_leaves_is_not_one_who_is_hardly_ever_tracked():
    assert results({"status": TrackStatus.LOST}, 90).walks()
