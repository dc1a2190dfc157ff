"""What `gait track` reports about a clip as a whole."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gait.bindings.abi import TrackStatus
from gait.track.clip_output import HARDLY_TRACKED, Results
from gait.track.wrong_way import AGAINST_STRIDES

RATE = 30.0  # frames per second
WALKING: dict[str, Any] = {
    "status": TrackStatus.TRACKING, "phase": 0.2, "reason": "", "speed": 1.3, "motion_class": "walk",
    "shown": True,
}  # fmt: skip
STANDING = {"phase": np.nan, "speed": 0.0}
BACKWARDS = {"status": TrackStatus.AMBIGUOUS, "reason": AGAINST_STRIDES}
RUNNING = {"speed": 2.6}


def results(other: dict[str, Any], frames: int) -> Results:
    """Results of 60 frames of a walk, then `frames` of another motion, then 20 of the walk."""
    model = SimpleNamespace(directions={"walk": 1, "stand": 0, "backwards": -1})
    found = Results(SimpleNamespace(cameras=[None], model=model))  # type: ignore[arg-type]
    place = 0.0
    for number in range(60 + frames + 20):
        one = WALKING | (other if 60 <= number < 60 + frames else {})
        view = SimpleNamespace(shows=lambda joints, shown=one["shown"]: shown)
        frame = SimpleNamespace(number=number, time=number / RATE, camera=lambda camera, view=view: view)
        estimate = SimpleNamespace(
            status=one["status"], joints=np.array([[place, 0.0, 0.9]]), frame=number,
            mean=SimpleNamespace(phase=one["phase"]), reason=one["reason"], motion_class=one["motion_class"],
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
        ({"motion_class": "backwards"}, 18, True),
        (RUNNING, 60, True),
        (RUNNING | {"status": TrackStatus.LOST}, 60, False),
        (STANDING | {"status": TrackStatus.LOST}, 60, False),
        (WALKING | {"status": TrackStatus.LOST, "speed": 90.0}, 3, False),  # found elsewhere
    ],
)
def test_half_a_second_of_another_motion_is_noticed(other, frames, noticed):
    assert bool(results(other, frames).against_walk()) is noticed


@pytest.mark.parametrize(
    "other, frames, noticed",
    [
        ({"status": TrackStatus.AMBIGUOUS}, 20, False),  # too short to know
        ({"status": TrackStatus.AMBIGUOUS}, 70, False),
        ({"status": TrackStatus.AMBIGUOUS}, 90, True),
        ({"status": TrackStatus.LOST}, 90, True),
        ({"status": TrackStatus.LOST, "shown": False}, 90, False),  # who has left is not hardly tracked
    ],
)
def test_a_person_who_is_hardly_ever_tracked_is_noticed(other, frames, noticed):
    assert (results(other, frames).against_walk() == HARDLY_TRACKED) is noticed
