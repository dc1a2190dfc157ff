"""Joints of a body to the 24 angles of the default skeleton and to the body's own proportions.

Every limb's frame has z against the limb and y along its hinge; angles are exact decompositions of the frames
of neighbours (model-format.md), continuous in time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, SIDES, Proportions
from gait.learn.rotations import decompose_yxz, decompose_zyx, frame_from, unit, unwrap
from gait.learn.solve.body import Body

Floats = npt.NDArray[np.float64]

HEAD = 0.141  # neck to head top, statures: files end the head's bone at different heights
#: Trunk and upper arms of a body by anatomy, statures: recordings end the clavicle near the acromion and the
#: spine near its back; here the shoulder's centre is lower, the neck further ahead, the elbow nearer.
ANATOMICAL: dict[str, Any] = {
    "shoulder": (0.043, 0.1085, 0.2595),
    "neck": 0.3205,
    "neck_ahead": 0.048,
    "head": (0.027, 0.0, 0.130),
    "upper_arm": 0.161,
}
BALL = 0.0235  # centre of the ball of the foot over the ground in stance, statures
#: What the parts of a standing body that may be unknown take of its height, statures.
SHARES = {"rise": Proportions().sole - BALL, "neck": Proportions().neck}
STANCE_SHARE = 0.15  # share of frames in which a foot moves least: it is flat on the ground then


@dataclass(frozen=True)
class Measures:
    """A body's own size, metres, of the same meaning as `gait.body.skeleton.Proportions` times the stature.

    Lengths of parts that were never seen are NaN; the stature is then that of a person with the rest.
    """

    stature: float
    hip: Floats  #: (2, 3) left and right, in the pelvis frame
    shoulder: Floats  #: (2, 3) left and right, in the torso frame
    neck: float
    upper_arm: Floats  #: (2,) and so on
    forearm: Floats
    thigh: Floats
    shank: Floats
    foot: Floats  #: (2,) ankle to ball
    slope: Floats  #: (2,) of the line ankle to ball below the sole's direction, radians
    sole: float  #: ankle over the ground in stance


def stance(body: Body, side: str) -> npt.NDArray[np.intp]:
    """Frames in which the foot of a side lies flat: ankle and ball, if it is known, both move least."""
    points = [body.joints[f"{side}_{joint}"] for joint in ("ankle", "toe")]
    known = [place for place in points if np.isfinite(place).any()]
    speed = sum((np.linalg.norm(np.gradient(p, axis=0), axis=1) for p in known), np.zeros(body.frames))
    seen = int(np.isfinite(speed).sum())
    order = np.argsort(np.where(np.isfinite(speed), speed, np.inf), kind="stable")
    return order[: min(max(3, int(STANCE_SHARE * seen)), seen)]


def measure(body: Body) -> Measures:
    """Lengths of a body whose floor is level (any height)."""
    j = body.joints

    def distances(upper: str, lower: str) -> Floats:
        return np.array([_distance(j[f"{s}_{upper}"], j[f"{s}_{lower}"]) for s in SIDES])

    torso = torso_frames(body)
    flat = {s: stance(body, s) for s in SIDES}
    rise = np.array([median((j[f"{s}_ankle"] - j[f"{s}_toe"])[flat[s], 2]) for s in SIDES])
    foot, neck = distances("ankle", "toe"), _distance(j["pelvis"], j["neck"])
    thigh, shank = distances("hip", "knee"), distances("knee", "ankle")
    parts = {"rise": mean(rise), "thigh": mean(thigh), "shank": mean(shank), "neck": neck}
    known = 1 - HEAD - BALL - sum(share for part, share in SHARES.items() if np.isnan(parts[part]))
    stature = float(sum(length for length in parts.values() if np.isfinite(length))) / known
    return Measures(
        stature=stature,
        hip=np.array([_in_frame(body.pelvis, j[f"{s}_hip"] - j["pelvis"]) for s in SIDES]),
        shoulder=np.array([_in_frame(torso, j[f"{s}_shoulder"] - j["pelvis"]) for s in SIDES]),
        neck=neck,
        upper_arm=distances("shoulder", "elbow"),
        forearm=distances("elbow", "wrist"),
        thigh=thigh,
        shank=shank,
        foot=foot,
        slope=np.arcsin(np.clip(rise / foot, -1, 1)),
        sole=parts["rise"] + BALL * stature,
    )


def known_parts(m: Measures | None) -> int:
    """Count the lengths of a body that are known; 0 of none."""
    return 0 if m is None else sum(int(np.isfinite(getattr(m, part.name)).sum()) for part in fields(m))


def mean(values: Floats) -> float:
    """Mean of what is known; NaN if nothing is."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def median(values: Floats) -> float:
    """Median of what is known; NaN if nothing is."""
    return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")


def _distance(a: Floats, b: Floats) -> float:
    return mean(np.asarray(np.linalg.norm(a - b, axis=1)))


def _in_frame(frames: Floats, vectors: Floats) -> Floats:
    """Mean of vectors (T, 3) seen in frames (T, 3, 3)."""
    seen = np.einsum("tji,tj->ti", frames, vectors)
    return np.asarray(np.nanmean(seen, axis=0)) if np.isfinite(seen).any() else np.full(3, np.nan)


def torso_frames(body: Body) -> Floats:
    """Torso axes (T, 3, 3): up from the pelvis to the neck, left from shoulder to shoulder."""
    j = body.joints
    return frame_from(j["neck"] - j["pelvis"], j["l_shoulder"] - j["r_shoulder"])


def angles(body: Body, measures: Measures) -> Floats:
    """Angles (T, 24) in the order of `gait.body.skeleton.ANGLES`, radians; NaN where a joint is missing."""
    j = body.joints
    result: dict[str, Floats] = {}
    torso = torso_frames(body)
    head = frame_from(j["head"] - j["neck"], body.lateral["head"])
    for name, child, parent in (("torso", torso, body.pelvis), ("neck", head, torso)):
        turns = decompose_zyx(np.swapaxes(parent, 1, 2) @ child)
        result |= {f"{name}_{axis}": turns[:, k] for k, axis in enumerate("zyx")}
    for i, s in enumerate(SIDES):
        chains = (("shoulder", "elbow", "wrist", torso, -1.0), ("hip", "knee", "ankle", body.pelvis, 1.0))
        for first, second, third, parent, sense in chains:
            hinge = body.lateral[f"{s}_{second}"]
            upper = frame_from(j[f"{s}_{first}"] - j[f"{s}_{second}"], hinge)
            turns = decompose_yxz(np.swapaxes(parent, 1, 2) @ upper) * (
                (-1, 1, -1) if s == "l" else (-1, -1, 1)
            )
            result |= {
                f"{s}_{first}_{n}": turns[:, k] for k, n in enumerate(("flexion", "abduction", "rotation"))
            }
            lower = j[f"{s}_{second}"] - j[f"{s}_{third}"]
            result[f"{s}_{second}_flexion"] = sense * _about_y(upper, lower)
        shank = frame_from(j[f"{s}_knee"] - j[f"{s}_ankle"], body.lateral[f"{s}_knee"])
        sole = _about_y(shank, j[f"{s}_toe"] - j[f"{s}_ankle"])
        result[f"{s}_ankle_flexion"] = np.pi / 2 - sole + measures.slope[i]
    table = np.stack([result[name] for name in ANGLES], axis=1)
    return _centred(table)


def _about_y(frames: Floats, vectors: Floats) -> Floats:
    """Angle (T,) about the frames' y axis from their z axis to vectors, in (-pi, pi]."""
    local = np.einsum("tji,tj->ti", frames, unit(vectors))
    return np.asarray(np.arctan2(local[:, 0], local[:, 2]))


def _centred(table: Floats) -> Floats:
    """Without jumps of a whole turn, each column's mean within half a turn."""
    result = unwrap(table)
    for column in result.T:
        seen = np.isfinite(column)
        if seen.any():
            column -= 2 * np.pi * np.round(np.mean(column[seen]) / (2 * np.pi))
    return result


def generic_proportions(bodies: Sequence[Measures | None]) -> Proportions:
    """Mean proportions for people who were not measured: legs and forearms recorded, the rest `ANATOMICAL`.

    Where hips and neck lie in a body is a matter of definition, and no image tells which is meant.  These are
    set by the tracker's errors on the rendered bodies (MakeHuman) of the development clips of ../shared/data,
    which are therefore no independent proof; what it costs on CMU's walkers tests/bench/learn_floor.py tells.
    """
    return replace(mean_proportions(bodies), **ANATOMICAL)


def own_proportions(m: Measures) -> Proportions:
    """Proportions of one body, made symmetric."""
    return mean_proportions([m])


def mean_proportions(bodies: Sequence[Measures | None]) -> Proportions:
    """Mean proportions of bodies, each divided by its stature; left and right made symmetric.

    Every part is the mean over those bodies that have it, generic if none does; None is a body without any.
    """
    generic, measured = Proportions(), [m for m in bodies if m is not None]

    def part(value: Callable[[Measures], Floats | float], default: float) -> float:
        found = mean(np.array([mean(np.asarray(value(m))) / m.stature for m in measured]))
        return found if np.isfinite(found) else default

    def offset(points: str) -> tuple[float, float, float]:
        known = [m for m in measured if np.isfinite(getattr(m, points)).all()]
        if not known:
            return getattr(generic, points)
        both = np.mean([getattr(m, points) / m.stature for m in known], axis=0)
        middle = (both[0] + both[1] * (1, -1, 1)) / 2
        return float(middle[0]), float(middle[1]), float(middle[2])

    foot = part(lambda m: m.foot, float(np.hypot(generic.toe[0], generic.toe[2])))
    slope = part(lambda m: m.slope * m.stature, float(np.arctan2(-generic.toe[2], generic.toe[0])))
    sole = part(lambda m: m.sole, generic.sole)
    toe = (foot * np.cos(slope), 0.0, -foot * np.sin(slope))
    return Proportions(
        hip=(0.0, offset("hip")[1], 0.0),
        shoulder=offset("shoulder"),
        neck=part(lambda m: m.neck, generic.neck),
        head=(0.0, 0.0, HEAD),
        upper_arm=part(lambda m: m.upper_arm, generic.upper_arm),
        forearm=part(lambda m: m.forearm, generic.forearm),
        thigh=part(lambda m: m.thigh, generic.thigh),
        shank=part(lambda m: m.shank, generic.shank),
        toe=(float(toe[0]), 0.0, float(toe[2])),
        heel=(generic.heel[0], 0.0, generic.heel[2] + generic.sole - sole),
        sole=sole,
    )
