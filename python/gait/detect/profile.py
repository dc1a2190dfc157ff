"""How a detector's joints differ from the model's: where they lie, and how much and how long they err.

A detector has learnt hips, ankles and toes from pictures; those of the model are centres of joints.  A
profile gives the difference of each joint as a sum of vectors between keypoints of the person:

    trunk      middle of the shoulders to middle of the hips
    outwards   middle of the hips to the hip of the joint's side
    limb       from the hip to the knee of the joint's side, or from the knee to the ankle
    forwards   heel to toe; of hips and arms the mean of both feet

Differences in space that are fixed to the body project to the same sums from every view, so that a profile
holds for any camera.  What remains is split into an error that lasts for a walk and one that changes in it.
Profiles are learnt on clips with known joints (`make detector-profile`) and stored in `profile.json`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gait.io.keypoints_file import Keypoints

Array = NDArray[np.float64]

FILE = Path(__file__).with_name("profile.json")
LEG = 0.49  # of a person's height: hip to ankle
_ARMS = ("shoulder", "elbow", "wrist", "hip")
_LASTS = 1.0  # seconds in which an error that lasts for a walk counts as one observation


@dataclass(frozen=True)
class JointProfile:
    """One joint of either side.

    Attributes
    ----------
    offset : tuple of float
        Shares of the three `vectors` that lead from the detector's joint to the model's.
    bias : float
        Standard deviation of an error that lasts for a walk, along an axis, person's heights.
    sd : float
        The same of an error that changes within a walk.
    correlation_s : float
        Seconds in which such errors count as one observation: twice the integral of their autocorrelation.
    """

    offset: tuple[float, ...]
    bias: float
    sd: float
    correlation_s: float

    def effective_sd(self, step: float) -> float:
        """Give the sd, person's heights, with which frames `step` seconds apart count as independent."""
        changes = max(self.correlation_s / step, 1.0)
        return float(np.sqrt(self.sd**2 * changes + self.bias**2 * max(_LASTS / step, 1.0)))


@cache
def load(network: str) -> dict[str, JointProfile]:
    """Profile of a landmark network by joint, without its side."""
    joints = json.loads(FILE.read_text(encoding="utf-8"))["networks"][network]
    return {name: JointProfile(tuple(joint.pop("offset")), **joint) for name, joint in joints.items()}


def vectors(keypoints: Keypoints, name: str) -> Array:
    """Vectors in the picture (T, 2, 3), pixels, of which a joint's offset is a weighted sum."""

    def at(point: str) -> Array:
        return np.asarray(keypoints.uv[:, keypoints.names.index(point)])

    side, _, joint = name.partition("_")
    feet = [at(f"{foot}_toe") - at(f"{foot}_heel") for foot in "lr"]
    hips = 0.5 * (at("l_hip") + at("r_hip"))
    outwards = at(f"{side}_hip") - hips
    if joint in _ARMS:
        trunk = hips - 0.5 * (at("l_shoulder") + at("r_shoulder"))
        return np.stack([trunk, outwards, 0.5 * (feet[0] + feet[1])], axis=2)
    if joint == "knee":
        return np.stack([at(f"{side}_knee") - at(f"{side}_hip"), outwards, 0.5 * (feet[0] + feet[1])], axis=2)
    return np.stack([at(f"{side}_ankle") - at(f"{side}_knee"), outwards, feet["lr".index(side)]], axis=2)


def picture_height(keypoints: Keypoints) -> Array:
    """Height of the person in each frame (T,) from trunk and legs, pixels; the median where unknown."""
    places = [
        keypoints.names.index(f"{side}_{joint}") for joint in ("shoulder", "hip", "ankle") for side in "lr"
    ]
    shoulder, hip, ankle = keypoints.uv[:, places].reshape(-1, 3, 2, 2).mean(axis=2).swapaxes(0, 1)
    height = (np.hypot(*(hip - shoulder).T) + np.hypot(*(ankle - hip).T)) / (0.28 + LEG)
    return np.asarray(np.where(np.isfinite(height), height, np.nanmedian(height)))


def corrected(keypoints: Keypoints, network: str) -> Keypoints:
    """Move a detector's joints to where the model has them, and give their standard deviations.

    Parameters
    ----------
    keypoints : Keypoints
        All joints of the detector.
    network : str
        ``full``, ``lite`` or ``heavy``.

    Returns
    -------
    Keypoints
        With `sd` in pixels, such that frames count as independent.
    """
    profile = load(network)
    step = float(np.median(np.diff(keypoints.time))) if len(keypoints.time) > 1 else _LASTS
    height = picture_height(keypoints)
    uv, sd = keypoints.uv.copy(), np.empty(keypoints.uv.shape[:2])
    for j, name in enumerate(keypoints.names):
        joint = profile[name.partition("_")[2]]
        uv[:, j] += vectors(keypoints, name) @ np.array(joint.offset)
        sd[:, j] = joint.effective_sd(step) * height / np.maximum(keypoints.confidence[:, j], 0.1)
    return replace(keypoints, uv=uv, sd=sd)
