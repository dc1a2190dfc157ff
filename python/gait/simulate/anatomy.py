"""Skeleton of a simulated walker: its own joints and proportions, not those of the tracker's model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gait.simulate.arrays import Array

SIDES = ("l", "r")

# bone: parent; each turns about the joint of the same row in `JOINT_OF`
PARENTS: dict[str, str | None] = {"pelvis": None, "torso": "pelvis", "head": "torso"}
JOINT_OF = {"pelvis": "pelvis", "torso": "spine", "head": "neck"}
for _s in SIDES:
    PARENTS |= {f"{_s}_upper_arm": "torso", f"{_s}_forearm": f"{_s}_upper_arm", f"{_s}_hand": f"{_s}_forearm"}
    PARENTS |= {f"{_s}_thigh": "pelvis", f"{_s}_shank": f"{_s}_thigh", f"{_s}_foot": f"{_s}_shank"}
    PARENTS |= {f"{_s}_toes": f"{_s}_foot"}
    JOINT_OF |= {
        f"{_s}_upper_arm": f"{_s}_shoulder",
        f"{_s}_forearm": f"{_s}_elbow",
        f"{_s}_hand": f"{_s}_wrist",
    }
    JOINT_OF |= {f"{_s}_thigh": f"{_s}_hip", f"{_s}_shank": f"{_s}_knee", f"{_s}_foot": f"{_s}_ankle"}
    JOINT_OF |= {f"{_s}_toes": f"{_s}_toe"}
BONES = tuple(PARENTS)
BONE_INDEX = {name: i for i, name in enumerate(BONES)}

# reported point: the bone it is fixed to
POINT_BONE = {
    "pelvis": "pelvis", "neck": "head", "head_top": "head",
    "l_shoulder": "l_upper_arm", "r_shoulder": "r_upper_arm", "l_elbow": "l_forearm", "r_elbow": "r_forearm",
    "l_wrist": "l_hand", "r_wrist": "r_hand", "l_hip": "l_thigh", "r_hip": "r_thigh",
    "l_knee": "l_shank", "r_knee": "r_shank", "l_ankle": "l_foot", "r_ankle": "r_foot",
    "l_toe": "l_toes", "r_toe": "r_toes", "l_heel": "l_foot", "r_heel": "r_foot",
    "l_toetip": "l_toes", "r_toetip": "r_toes",
}  # fmt: skip
POINTS = tuple(POINT_BONE)

# mean adult proportions in statures; the segment lengths sum to a stature of 1 (see `_upright_height`)
_MEAN = {
    "ankle_height": 0.0465, "shank": 0.2430, "thigh": 0.2440, "hip_drop": 0.0070, "hip_half": 0.0520,
    "spine_up": 0.0560, "neck_up": 0.3020, "neck_forward": -0.0060, "head_up": 0.1575, "head_forward": 0.0060,
    "shoulder_up": 0.2560, "shoulder_half": 0.1010, "upper_arm": 0.1680, "forearm": 0.1480, "hand": 0.1040,
    "heel_back": 0.0330, "heel_up": 0.0140, "ball_forward": 0.0760, "ball_up": 0.0180, "toe_forward": 0.1180,
}  # fmt: skip
_UPRIGHT = ("ankle_height", "shank", "thigh", "hip_drop", "neck_up", "head_up")


@dataclass(frozen=True)
class Anatomy:
    """Lengths of one person.

    Attributes
    ----------
    stature : float
        Height of the head's top over the ground in the rest pose, shoes on, metres.
    lengths : dict of float
        Keys of the proportions table, metres.
    rest : dict of ndarray of shape (3,)
        Joints and reported points in the rest pose (limbs hang, feet forward; x forward, y left, z up)
        relative to the pelvis joint, metres.
    """

    stature: float
    lengths: dict[str, float]
    rest: dict[str, Array]

    def __getitem__(self, name: str) -> float:
        return self.lengths[name]

    @property
    def leg(self) -> float:
        """Hip to ankle of the straight leg, metres."""
        return self["thigh"] + self["shank"]


def draw_anatomy(stature: float, rng: np.random.Generator) -> Anatomy:
    """Draw a person of `stature` metres: every proportion varies by about 4 % (standard deviation)."""
    share = {
        key: value * float(1 + 0.04 * np.clip(rng.standard_normal(), -2, 2)) for key, value in _MEAN.items()
    }
    upright = sum(share[key] for key in _UPRIGHT)
    for key in _UPRIGHT:
        share[key] /= upright
    share["shoulder_up"] = share["neck_up"] - _MEAN["neck_up"] + _MEAN["shoulder_up"]
    lengths = {key: value * stature for key, value in share.items()}
    return Anatomy(stature, lengths, _rest_pose(lengths))


def _rest_pose(k: dict[str, float]) -> dict[str, Array]:
    """Place the joints of a person who stands with hanging arms, relative to the pelvis joint."""
    at = {
        "pelvis": (0.0, 0.0, 0.0),
        "spine": (-0.004, 0.0, k["spine_up"]),
        "neck": (k["neck_forward"], 0.0, k["neck_up"]),
        "head_top": (k["neck_forward"] + k["head_forward"], 0.0, k["neck_up"] + k["head_up"]),
    }
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        y = sign * k["shoulder_half"]
        at[f"{side}_shoulder"] = (-0.004, y, k["shoulder_up"])
        at[f"{side}_elbow"] = (-0.004, y, k["shoulder_up"] - k["upper_arm"])
        at[f"{side}_wrist"] = (-0.004, y, k["shoulder_up"] - k["upper_arm"] - k["forearm"])
        hip, y = -k["hip_drop"], sign * k["hip_half"]
        ground = hip - k["thigh"] - k["shank"] - k["ankle_height"]
        at[f"{side}_hip"] = (0.0, y, hip)
        at[f"{side}_knee"] = (0.0, y, hip - k["thigh"])
        at[f"{side}_ankle"] = (0.0, y, hip - k["thigh"] - k["shank"])
        at[f"{side}_heel"] = (-k["heel_back"], y, ground + k["heel_up"])
        at[f"{side}_toe"] = (k["ball_forward"], y, ground + k["ball_up"])
        at[f"{side}_toetip"] = (k["toe_forward"], y, ground + 0.7 * k["ball_up"])
    return {name: np.array(xyz) for name, xyz in at.items()}
