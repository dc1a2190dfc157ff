"""How a detector's joints differ from the model's: offsets, and size and duration of errors.

A detector has learnt hips, ankles and toes from pictures; the model's are centres of joints.  A profile
describes the difference of each joint as a weighted sum of vectors between keypoints of the person:

    trunk      middle of the shoulders to middle of the hips
    outwards   middle of the hips to the hip of the joint's side
    limb       from the hip to the knee of the joint's side, or from the knee to the ankle
    forwards   heel to toe; for hips and arms the mean of both feet

Differences that are fixed to the body in space project to the same sums in every view, so that a profile is
valid for any camera.  The remaining error is split into one that lasts for many seconds and one that changes.
Profiles are learnt on clips with known joints (`make detector-profile`) and stored in `profile.json`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gait.io.keypoints_file import LEAST_CONFIDENCE, Keypoints

Array = NDArray[np.float64]

FILE = Path(__file__).with_name("profile.json")
LEG_LENGTH, TRUNK_LENGTH = 0.49, 0.28  # fractions of a person's height: hip to ankle, shoulder to hip
_ARMS = ("shoulder", "elbow", "wrist", "hip")


@dataclass(frozen=True)
class JointProfile:
    """Errors of one joint, the same on both sides.

    Attributes
    ----------
    offset : tuple of float
        Weights of the three `vectors` whose sum leads from the detector's joint to the model's.
    lasting_sd : float
        Standard deviation, along an axis, of the lasting error, as a fraction of the person's height.
    sd : float
        Standard deviation of the error that changes from frame to frame, in the same unit.
    correlation_s : float
        Seconds over which changing errors count as one observation: twice the integral of their
        autocorrelation.
    """

    offset: tuple[float, ...]
    lasting_sd: float
    sd: float
    correlation_s: float

    def effective_sd(self, step: float) -> float:
        """Enlarge `sd` so that frames `step` seconds apart may count as independent."""
        return float(self.sd * np.sqrt(max(self.correlation_s / step, 1.0)))


@dataclass(frozen=True)
class Profile:
    """Errors of a landmark network.

    Attributes
    ----------
    joints : dict of JointProfile
        Keys are joints without their side.
    lasting_s : float
        Seconds in which the autocorrelation of a lasting error falls to 1/e.
    repeated : float
        Share of the variance of changing errors that repeats in every stride.
    """

    joints: dict[str, JointProfile]
    lasting_s: float
    repeated: float

    def joint(self, name: str) -> JointProfile:
        """Return the profile of a joint with its side; that of an elbow if the joint is unknown."""
        return self.joints.get(name.partition("_")[2], self.joints["elbow"])


@cache
def load(network: str) -> Profile:
    """Load the profile of a landmark network."""
    found = json.loads(FILE.read_text(encoding="utf-8"))["networks"][network]
    joints = {name: JointProfile(**joint) for name, joint in found["joints"].items()}
    return Profile(joints, found["lasting_s"], found["repeated"])


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
    """Estimate the person's height in each frame (T,) from legs and trunk, pixels; the median if unknown."""
    joints = ("shoulder", "hip", "ankle") if "l_shoulder" in keypoints.names else ("hip", "ankle")
    places = [keypoints.names.index(f"{side}_{joint}") for joint in joints for side in "lr"]
    middles = keypoints.uv[:, places].reshape(-1, len(joints), 2, 2).mean(axis=2)
    length = np.hypot(*np.diff(middles, axis=1).T).sum(axis=0)
    height = length / (LEG_LENGTH if len(joints) == 2 else TRUNK_LENGTH + LEG_LENGTH)
    return np.asarray(np.where(np.isfinite(height), height, np.nanmedian(height)))


def frame_sd(keypoints: Keypoints, network: str = "full") -> Array:
    """Return the standard deviations (T, J) of all errors in one frame, lasting and changing, pixels.

    A detector without a profile is assumed to have the errors of `full`.
    """
    joints = _joints(keypoints, network)
    return _pixels(keypoints, [float(np.hypot(joint.lasting_sd, joint.sd)) for joint in joints])


def changing_sd(keypoints: Keypoints, network: str = "full") -> tuple[Array, Array]:
    """Return the changing errors: their sd (T, J), pixels, and correlation time (J,), seconds.

    Unknown detectors and joints are treated as in `frame_sd`.
    """
    joints = _joints(keypoints, network)
    return _pixels(keypoints, [joint.sd for joint in joints]), np.array([j.correlation_s for j in joints])


def _joints(keypoints: Keypoints, network: str) -> list[JointProfile]:
    """Return the profile of each joint (J,)."""
    return [load(network).joint(name) for name in keypoints.names]


def _pixels(keypoints: Keypoints, share: list[float]) -> Array:
    """Convert fractions of the person's height to standard deviations (T, J) in pixels, by confidence."""
    sd = picture_height(keypoints)[:, None] * share
    return np.asarray(sd / np.maximum(keypoints.confidence, LEAST_CONFIDENCE))


def corrected(keypoints: Keypoints, network: str) -> Keypoints:
    """Convert a detector's joints to the model's, and add their standard deviations.

    Parameters
    ----------
    keypoints : Keypoints
        All joints of the detector.
    network : str
        ``full``, ``lite`` or ``heavy``.

    Returns
    -------
    Keypoints
        With `sd` (enlarged so that frames may count as independent), `lasting_sd` and `frame_sd`, pixels.
    """
    profile = load(network)
    step = float(np.median(np.diff(keypoints.time))) if len(keypoints.time) > 1 else np.inf
    joints = _joints(keypoints, network)
    uv = keypoints.uv.copy()
    for j, (name, joint) in enumerate(zip(keypoints.names, joints, strict=True)):
        uv[:, j] += vectors(keypoints, name) @ np.array(joint.offset)
    return replace(
        keypoints,
        uv=uv,
        sd=_pixels(keypoints, [joint.effective_sd(step) for joint in joints]),
        lasting_sd=_pixels(keypoints, [joint.lasting_sd for joint in joints]),
        lasting_s=profile.lasting_s,
        repeated=profile.repeated,
        frame_sd=frame_sd(keypoints, network),
    )
