"""Standing, derived from the walk: legs as in mid-stance but below the hips, everything else average.

Few recordings show people standing, but every walk shows which angles of its skeleton mean a straight leg, a
level foot and hanging arms.  People stand in different ways: components, in units of their standard
deviation, are one foot in front of the other, the width of the stance, bent knees and weight on one leg; the
height of the pelvis follows from the legs.  Recordings of people who stand replace the mean angles.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, SIDES
from gait.errors import UserError
from gait.io import blob
from gait.learn.arrays import Floats, column_means
from gait.learn.mocap.tables import AngleTable
from gait.learn.solve import retarget
from gait.learn.solve.body import Body

STANDING_PHASES = 8  # the fewest that a model may have, as nothing moves
STANCE_PHASES = 0.15, 0.45  # phases in which the right foot carries the body and is flat
STANDING_COMPONENTS: tuple[dict[str, float], ...] = (
    {"l_hip_flexion": 9.0, "r_hip_flexion": -9.0, "l_ankle_flexion": -9.0, "r_ankle_flexion": 9.0},
    {"l_hip_abduction": 4.0, "r_hip_abduction": 4.0},
    {
        "l_hip_flexion": 7.0, "r_hip_flexion": 7.0, "l_knee_flexion": 14.0, "r_knee_flexion": 14.0,
        "l_ankle_flexion": 7.0, "r_ankle_flexion": 7.0,
    },
    {"root_roll": 3.0, "l_hip_abduction": 4.0, "r_hip_abduction": -4.0, "torso_x": -3.0},
)  # fmt: skip
"""Degrees for one standard deviation."""
STILL_S = 1.0  # seconds for which a person must stand still; feet of people who walk slowly rest for 0.4 s
STILL_M = 0.03  # metres; most that pelvis and ankles move in them
BENT_KNEES = np.radians(40.0)  # from which a person sits or crouches
RAISED_ARMS = np.radians(40.0)  # of an upper arm from the vertical, from which a pose is one of calibration
#: Standard deviations of posture, degrees: arms may hang, fold, point or carry.
STANDING_POSTURE_SD_DEG = {"shoulder_flexion": 25.0, "shoulder_abduction": 12.0, "shoulder_rotation": 20.0,
           "elbow_flexion": 35.0, "torso_y": 6.0, "torso_x": 4.0, "torso_z": 8.0}  # fmt: skip


def body_of(path: Path, read: Body | AngleTable) -> Body:
    """Return a recording on a level floor. UserError if it has only angles, which show no speed."""
    if isinstance(read, AngleTable):
        raise UserError(f"{path}: has only angles; give recordings of places, which show the speed")
    return retarget.levelled(read)


def posture_of(path: Path, read: Body | AngleTable, throughout: bool = False) -> Floats:
    """Return the mean angles (24,), radians, of a person while standing still; NaN where nothing shows them.

    UserError if the person does not stand still for `STILL_S`; with `throughout`, if the person ever moves,
    or holds the arms as for calibration.
    """
    body = body_of(path, read)
    still = _still(body)
    if not still.any() or (throughout and not still.all()):
        how_long = "throughout" if throughout else f"for {STILL_S:g} s"
        raise UserError(
            f"{path}: not learnt as 'stand': the person does not stand still {how_long}; leave it out"
        )
    if throughout and _raises_an_arm(body):
        raise UserError(f"{path}: not learnt as 'stand': an arm is raised; leave it out")
    posture = column_means(retarget.observed_angles(body, retarget.measure(body))[still])
    knees = posture[[ANGLES.index(f"{s}_knee_flexion") for s in SIDES]]
    if (knees > BENT_KNEES).any():
        bent, most = np.degrees((np.nanmax(knees), BENT_KNEES))
        raise UserError(
            f"{path}: not learnt as 'stand': the knees are bent by {bent:.0f} degrees (at most {most:.0f}); "
            "leave it out"
        )
    return posture


def _raises_an_arm(body: Body) -> bool:
    """Whether an upper arm is raised on average; False if no arm is visible."""
    arms = [body.joints[f"{s}_elbow"] - body.joints[f"{s}_shoulder"] for s in SIDES]
    down = np.array([-arm[:, 2] / np.linalg.norm(arm, axis=1) for arm in arms])
    return bool((column_means(down.T) < np.cos(RAISED_ARMS)).any())


def _still(body: Body) -> npt.NDArray[np.bool_]:
    """Return the frames (T,) within a second in which neither the pelvis nor an ankle moves."""
    width = round(STILL_S * body.fps)
    still = np.zeros(body.frames, bool)
    if body.frames < width:
        return still
    places = np.stack([body.joints[name] for name in ("pelvis", "l_ankle", "r_ankle")], axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(places, width, axis=0)
    quiet = (np.ptp(windows, axis=-1) <= STILL_M).all(axis=(1, 2))  # not where a place is missing
    for start in np.flatnonzero(quiet):
        still[start : start + width] = True
    return still


def sections(walk: Mapping[str, blob.Array], angles: Floats | None = None) -> dict[str, blob.Array]:
    """Return CURV, CHST, SCST and GAIT of standing from those of a walk of the default skeleton.

    `angles` (24,): mean angles of people who stand, as from `posture_of`; where missing, those of the walk.
    """
    names = blob.unpack_names(walk["CHNM"])
    mean = np.asarray(walk["CURV"], float)[0]
    posture, lowest = _standing(walk, names, mean)
    if angles is not None:
        for name, angle in zip(ANGLES, angles, strict=True):
            if np.isfinite(angle):
                posture[names.index(name)] = angle
    posture[names.index("root_height")] = lowest + _leg_height(walk, names, posture)
    rows = [posture]
    for component in STANDING_COMPONENTS:
        change = np.zeros(len(names))
        for name, degrees in component.items():
            change[names.index(name)] = np.radians(degrees)
        height = 0.5 * (
            _leg_height(walk, names, posture + change) + _leg_height(walk, names, posture - change)
        )
        change[names.index("root_height")] = min(height - _leg_height(walk, names, posture), 0.0) / 2
        rows.append(change)
    curves = np.repeat(np.array(rows)[:, None, :], STANDING_PHASES, axis=1)
    statistics = np.array(walk["CHST"], float)
    for k, name in enumerate(names):
        for part, degrees in STANDING_POSTURE_SD_DEG.items():
            if name.endswith(part):
                statistics[k, 3] = np.radians(degrees)
    statistics[:, 1:3] = posture[:, None]
    scores = np.zeros((len(STANDING_COMPONENTS), 3))
    scores[:, 1] = 1.0
    gait = np.array(walk["GAIT"], float)
    gait[3:5] = 0.0
    return {
        "CURV": _stored(curves),
        "CHST": _stored(statistics),
        "SCST": _stored(scores),
        "GAIT": _stored(gait),
    }


def _stored(values: Floats) -> blob.Array:
    return np.asarray(values, np.float32)


def _standing(walk: Mapping[str, blob.Array], names: list[str], mean: Floats) -> tuple[Floats, float]:
    """Mean channels (M,) of a person who stands with feet together; the ankles' height in statures."""
    at = {name: k for k, name in enumerate(names)}
    posture = mean.mean(axis=0)
    first, last = (int(phase * len(mean)) for phase in STANCE_PHASES)
    knee = float(mean[first:last, at["r_knee_flexion"]].min())  # when the leg is straightest
    ankle = [c[at["root_height"]] - _leg_height(walk, names, c, "r") for c in mean[first:last]]
    flat = mean[first + int(np.argmin(ankle))]  # the sole is on the ground
    pitch = flat[at["r_hip_flexion"]] - flat[at["r_knee_flexion"]] + flat[at["r_ankle_flexion"]]
    thigh, shank = _lengths(walk)
    hip = np.arctan2(shank * np.sin(knee), thigh + shank * np.cos(knee))
    for side in "lr":
        posture[at[f"{side}_knee_flexion"]] = knee
        posture[at[f"{side}_hip_flexion"]] = hip
        posture[at[f"{side}_ankle_flexion"]] = pitch - hip + knee
        posture[at[f"{side}_hip_abduction"]] = 0.0
    for name in (
        "root_forward",
        "root_sway",
        "root_roll",
        "root_yaw",
        "torso_x",
        "torso_z",
        "neck_x",
        "neck_z",
    ):
        posture[at[name]] = 0.0
    return posture, float(min(ankle))


def _lengths(walk: Mapping[str, blob.Array]) -> tuple[float, float]:
    """Return the lengths of thigh and shank, statures."""
    frames = blob.unpack_names(walk["FRNM"])
    origin = np.asarray(walk["FRMF"], float)
    return -float(origin[frames.index("r_shank")][2]), -float(origin[frames.index("r_foot")][2])


def _leg_height(
    walk: Mapping[str, blob.Array], names: list[str], channels: Floats, sides: str = "lr"
) -> float:
    """Height of the hips above the ankles, statures, of the longer leg."""
    thigh, shank = _lengths(walk)
    at = {name: k for k, name in enumerate(names)}
    heights = []
    for side in sides:
        hip = channels[at[f"{side}_hip_flexion"]]
        lower = hip - channels[at[f"{side}_knee_flexion"]]
        out = np.cos(channels[at[f"{side}_hip_abduction"]])
        heights.append(float(out * (thigh * np.cos(hip) + shank * np.cos(lower))))
    return max(heights)
