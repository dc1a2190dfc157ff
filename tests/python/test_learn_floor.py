"""The floor for unseen people: static offsets are found, and limited by the learnt distribution."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gait.bindings.model import read_blob
from gait.body.model_curves import curves
from gait.body.skeleton import CHANNELS
from gait.io.blob import decode

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import floor_fit

ELBOW = CHANNELS.index("l_elbow_flexion")
BENT = np.radians(12)


@pytest.fixture(scope="module")
def sections():
    """Mean and two components of the shipped model."""
    found = decode(read_blob(None))
    return {**found, "CURV": found["CURV"][:3], "PROP": found["PROP"][:0], "SHFT": found["SHFT"][:0]}


@pytest.fixture(scope="module")
def walk(sections):
    """A person with the mean body and scores of 0, whose one elbow is always bent more."""
    at = np.arange(30) / 10
    channels = curves(sections, at, np.zeros((30, 2)))
    channels[:, ELBOW] += BENT
    measures = SimpleNamespace(stature=1.8)  # of all measures the one that counts here
    empty = floor_fit.Walk("01", at, np.zeros((30, len(floor_fit.COLUMNS), 3)), channels, measures, 0.0)
    joints = floor_fit.model_joints(empty, sections, np.zeros((1, 3)), channels[None])[0]
    return floor_fit.Walk("01", at, joints, channels, measures, 0.0)


def offset(sd: float) -> np.ndarray:
    row = np.zeros((1, len(CHANNELS)))
    row[0, ELBOW] = sd
    return row


def test_an_offset_takes_the_rest_that_components_leave(sections, walk):
    without = floor_fit.in_joints(walk, sections)
    found = floor_fit.in_joints(walk, {**sections, floor_fit.OFFSETS: offset(BENT)})
    assert without.joints_mm > 2
    assert found.joints_mm < 0.1 * without.joints_mm


def test_an_offset_is_held_back_more_by_frames_alike_and_by_less_variance(sections, walk):
    def left(sd: float, frames_alike: bool) -> float:
        return floor_fit.in_joints(walk, {**sections, floor_fit.OFFSETS: offset(sd)}, frames_alike).joints_mm

    free = left(BENT / 4, False)
    assert left(BENT / 4, True) > 1.5 * free
    assert left(BENT / 40, False) > 1.5 * free
