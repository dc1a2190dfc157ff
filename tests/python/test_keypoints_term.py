"""The tracker's likelihood term of keypoints, through Python."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_person import FPS, camera, clip

from gait import Model, State, Term, Tracker, TrackerConfig
from gait.bindings.frame import FrameKeypoints
from gait.bindings.model import read_blob
from gait.io import blob

MODEL = Model()
FRAMES, TRUE = clip(MODEL, blob.decode(read_blob(None)), 14)
VIEW = camera()
CONFIG = TrackerConfig.default(particles=300)


def found(i: int, noise: float = 1.0) -> FrameKeypoints:
    """What a detector reports for a frame: most joints, in its own order, and one that the model lacks."""
    rng = np.random.default_rng(i)
    uv = VIEW.project(MODEL.pose(TRUE[i])[0]) + noise * rng.normal(size=(len(MODEL.joint_names), 2))
    uv[rng.random(len(uv)) < 0.2] = np.nan
    names = [*MODEL.joint_names[::-1], "nose"]
    return FrameKeypoints(names, np.vstack([uv[::-1], [[1.0, 2.0]]]), 2.0)


def follow(terms: Term, keypoints: bool) -> tuple[str, float]:
    """Digest, and mean distance of the joints in the pictures of the second half, pixels."""
    tracker = Tracker(MODEL, VIEW, TrackerConfig.default(particles=300, terms=terms))
    sd = State(phase=0.05, stride_hz=0.05, stature=0.02, heading=0.15, pelvis=np.full(3, 0.1))
    tracker.start(TRUE[0], sd, 0)
    off = []
    for i, image in enumerate(FRAMES):
        joint = tracker.step(image, round(1e6 * i / FPS), found(i) if keypoints else None).joints
        off.append(VIEW.project(joint) - VIEW.project(MODEL.pose(TRUE[i])[0]))
    return f"{tracker.digest():016x}", float(np.linalg.norm(off[len(off) // 2 :], axis=2).mean())


def test_keypoints_help() -> None:
    _, without = follow(Term.TEXTURE, keypoints=False)
    _, helped = follow(Term.TEXTURE | Term.KEYPOINTS, keypoints=True)
    assert helped < 0.7 * without and helped < 2.0


def test_keypoints_are_not_read_while_the_term_is_off() -> None:
    assert follow(Term.TEXTURE, keypoints=True) == follow(Term.TEXTURE, keypoints=False)
    assert Term.KEYPOINTS not in CONFIG.terms  # by default


def test_wrong_shapes_are_refused() -> None:
    tracker = Tracker(MODEL, VIEW, CONFIG)
    tracker.start(TRUE[0], State(phase=0.1), 0)
    with pytest.raises(ValueError, match="keypoints: uv has shape"):
        tracker.step(FRAMES[0], 0, FrameKeypoints(["pelvis"], np.zeros((2, 2))))
