"""Markers on people: on the default skeleton in known poses, and on recorded bodies."""

import numpy as np
from scipy.spatial.transform import Rotation

from gait.body.skeleton import ANGLES, SIDES, Proportions
from gait.learn import rotations
from gait.learn.mocap.markers import LANDMARKS, SETS
from gait.learn.solve import kinematics, retarget
from gait.learn.solve.kinematics import SEGMENTS

#: Labels of Plug-in-Gait's full body, as in Vicon's files.
CENTRAL = ["SACR", "C7", "T10", "CLAV", "STRN"]
LEG = ["ASI", "PSI", "THI", "KNE", "TIB", "ANK", "HEE", "TOE"]
ARM = ["FHD", "BHD", "SHO", "UPA", "ELB", "FRA", "WRA", "WRB"]
FULL = CENTRAL + [side + name for side in "LR" for name in LEG + ARM]
LOWER = [side + name for side in "LR" for name in LEG] + ["SACR"]


def landmarks(labels):
    """Landmarks of Plug-in-Gait labels."""
    return [LANDMARKS[SETS["plug-in-gait"][label.lower()]] for label in labels]


def walk_angles(frames, period, seed=0):
    """Smooth cyclic angles (T, 24), radians, with the range of a walk."""
    rng, phase = np.random.default_rng(seed), 2 * np.pi * np.arange(frames) / period
    angles = np.radians(rng.uniform(3, 8, len(ANGLES))) * np.sin(
        phase[:, None] + rng.uniform(0, 6, len(ANGLES))
    )
    for s, lag in (("l", 0.0), ("r", np.pi)):
        angles[:, ANGLES.index(f"{s}_hip_flexion")] = 0.1 + 0.45 * np.sin(phase + lag + 1)
        angles[:, ANGLES.index(f"{s}_knee_flexion")] = 0.5 + 0.45 * np.sin(phase + lag)
        angles[:, ANGLES.index(f"{s}_elbow_flexion")] = 0.5 + 0.25 * np.sin(phase + lag)
    return angles


def own_lengths(rng, sd=0.08):
    """Log length scales of a person whose proportions are all off by `sd`."""
    log_scales = sd * rng.choice([-1.0, 1.0], kinematics.SCALE_TABLE.shape[2])
    log_scales[0] = np.log(1.82)
    log_scales[-len(kinematics.LIMBS) :] = 0  # both sides alike
    return log_scales


def person(labels, frames=360, fps=120.0, period=120.0, sd=0.08, noise=0.003, seed=0, again=None):
    """Points (T, M, 3), metres, z up, and the true pose, of a person with unusual lengths and marker places.

    With `again` it is another recording of the person `seed`, with markers attached anew.
    """
    rng = np.random.default_rng(seed)
    angles = walk_angles(frames, period, seed)
    log_scales = own_lengths(rng, sd)
    if again is not None:
        rng = np.random.default_rng([seed, again])
    time, phase = np.arange(frames) / fps, 2 * np.pi * np.arange(frames) / period
    place = np.stack([1.3 * time, 0.02 * np.sin(phase), 0.97 + 0.02 * np.cos(2 * phase)], axis=1)
    turns = np.stack([0.03 * np.sin(phase), 0.02 * np.cos(2 * phase), 0.1 * np.sin(phase)], 1)
    turn = Rotation.from_rotvec(turns).as_matrix()
    pose = kinematics.Pose(place, turn, angles)
    marks = landmarks(labels)
    segment = np.array([SEGMENTS.index(m.segment) for m in marks])
    local = kinematics.segment_scales(log_scales)[segment] * np.array([m.at for m in marks])
    local = local + rng.normal(scale=0.006, size=local.shape)
    points = kinematics.pose_skeleton(pose, kinematics.segment_origins(log_scales)).points(local, segment)
    return points + rng.normal(scale=noise, size=points.shape), pose


def on_body(body, measures, labels):
    """Points (T, M, 3) at the landmarks of a recorded body's own segments, whatever its joints do."""
    j, generic = body.joints, Proportions()
    frames = {"pelvis": (body.pelvis, j["pelvis"], measures.neck / generic.neck)}
    frames["torso"] = (retarget.torso_frames(body), j["pelvis"], measures.neck / generic.neck)
    head = rotations.frame_from(j["head"] - j["neck"], body.lateral["head"])
    frames["head"] = (head, j["neck"], measures.stature)
    for i, s in enumerate(SIDES):
        for part, upper, lower, hinge in (
            ("thigh", "hip", "knee", "knee"),
            ("shank", "knee", "ankle", "knee"),
            ("upper_arm", "shoulder", "elbow", "elbow"),
            ("forearm", "elbow", "wrist", "elbow"),
        ):
            axes = rotations.frame_from(j[f"{s}_{upper}"] - j[f"{s}_{lower}"], body.lateral[f"{s}_{hinge}"])
            scale = getattr(measures, part)[i] / getattr(generic, part)
            frames[f"{s}_{part}"] = (axes, j[f"{s}_{upper}"], scale)
        ahead = rotations.unit(j[f"{s}_toe"] - j[f"{s}_ankle"])
        foot = rotations.frame_from(np.cross(ahead, body.lateral[f"{s}_knee"]), body.lateral[f"{s}_knee"])
        pitch = rotations.from_angles(np.array([-measures.slope[i]]), (1,))
        frames[f"{s}_foot"] = (foot @ pitch, j[f"{s}_ankle"], measures.stature)
    points = []
    for mark in landmarks(labels):
        axes, origin, scale = frames[mark.segment]
        points.append(origin + axes @ (np.array(mark.at) * (measures.stature, measures.stature, scale)))
    return np.stack(points, axis=1)
