"""Move joint centres of Acclaim skeletons to the anatomical ones of marker fits and ISB.

ISB (Wu and others 2002, 2005) and marker fits put the knee midway between the epicondyles, the ankle midway
between the malleoli, and the shoulder at the head of the humerus.  In the skeletons of the CMU database, the
main source of recordings, knees are too far forward and too high, ankles too low, shoulders near the acromion
and wrists in the hand. Therefore hips, knees and ankles flex more, by constants that have nothing to do with
gait.

The constants are differences of means between people of CMU and people with markers from other laboratories
(tests/bench/results/learn_people.md); the ratio of thigh and shank is anthropometric (Drillis and Contini
1966), as it varies among CMU's skeletons.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gait.body.skeleton import SIDES
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import Recording
from gait.learn.rotations import frame_from, unit
from gait.learn.solve import retarget
from gait.learn.solve.body import Body

CMU_BONES = {"lhipjoint", "rhipjoint", "lowerback"}  # only in Acclaim skeletons of CMU and their copies
THIGH = 0.506  # share of the leg's length: 0.245 of 0.245 + 0.239 statures, as in marker fits
KNEE_AHEAD = 0.0135  # statures by which the knee is in front of the anatomical one, in the thigh's axes
ANKLE = (0.004, 0.0, 0.007)  # statures to the anatomical ankle, in the shank's axes
SHOULDER = 0.019  # statures by which shoulders, and the arms with them, are too high
WRIST = 0.014  # statures by which wrists are too far from the elbow


def is_acclaim(recording: Recording) -> bool:
    """Whether a skeleton is one of CMU's, also if it was converted to .bvh."""
    return {"".join(c for c in bone.lower() if c.isalnum()) for bone in recording.bones} >= CMU_BONES


def anatomical(body: Body) -> Body:
    """Move the joint centres of an Acclaim skeleton to the anatomical ones."""
    stature = retarget.measure(retarget.levelled(body)).stature
    joints, torso = dict(body.joints), retarget.torso_frames(body)
    down = torso @ np.array([0.0, 0.0, -SHOULDER * stature])
    for s in SIDES:
        hip, knee, ankle = (joints[f"{s}_{name}"] for name in ("hip", "knee", "ankle"))
        hinge = body.lateral[f"{s}_knee"]
        joints[f"{s}_ankle"] = ankle + frame_from(knee - ankle, hinge) @ (np.array(ANKLE) * stature)
        thigh, shank = _length(hip - knee), _length(knee - joints[f"{s}_ankle"])
        to_knee = np.array([-KNEE_AHEAD * stature, 0.0, thigh - THIGH * (thigh + shank)])
        joints[f"{s}_knee"] = knee + frame_from(hip - knee, hinge) @ to_knee
        forearm = unit(joints[f"{s}_wrist"] - joints[f"{s}_elbow"])
        for name in ("shoulder", "elbow", "wrist"):
            joints[f"{s}_{name}"] = joints[f"{s}_{name}"] + down
        joints[f"{s}_wrist"] = joints[f"{s}_wrist"] - WRIST * stature * forearm
    return replace(body, joints=joints)


def _length(way: Floats) -> float:
    """Return the mean length of vectors (T, 3), metres."""
    return retarget.mean(np.linalg.norm(way, axis=1))
