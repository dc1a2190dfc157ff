"""Known marker sets, and marker maps: files that define positions of other markers on the body.

Positions of landmarks are approximate, for the centre of a 14 mm marker on an adult; the fit moves each by
about its sd.  Sources: placement guides of Plug-in-Gait and Helen Hayes; hip joints after Bell and others
(1990); the joint between neck and trunk after Reed and others (1999); heights after Drillis and Contini
(1966).

A marker map (`gait learn --markers MAP.json`) is

    {
      "set": "plug-in-gait",
      "markers": {
        "Knee1_L": "l_knee_lateral",
        "Cluster_A": {"segment": "l_thigh"},
        "Plate_R": {"segment": "r_shank", "at": [0.02, -0.03, -0.1], "sd": 0.02},
        "LWRA": null
      }
    }

`set` (optional) is a known set to start from; `markers` adds to it or overrides it.  Labels are compared
without the subject before ':', case, blanks and punctuation.  A value is a landmark (`LANDMARKS`), or a
segment of the skeleton (libgait/doc/model-format.md) with the position `at` in its axes (x forward, y left, z
up, from the segment's upper joint) and `sd`, the standard deviation of the position, both in statures;
without `at` the marker is anywhere on the segment.  null excludes a marker.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gait.body.skeleton import SIDES, Proportions, default_skeleton
from gait.errors import UserError
from gait.io.fields import json_object
from gait.learn.arrays import Floats

_P = Proportions()
SEGMENTS = default_skeleton().frames


class Landmark(NamedTuple):
    """A position on the body: segment, position in its axes, and standard deviation of markers, statures."""

    segment: str
    at: tuple[float, float, float]
    sd: float


@dataclass(frozen=True)
class MarkerMap:
    """A marker map."""

    path: Path
    landmarks: dict[str, Landmark]  #: by label, as `plain` returns it
    named: tuple[str, ...]  #: the labels in the file itself, as written


#: Last letters of the points that represent a segment: its origin, then one on each axis.
AXIS_ENDINGS = ("OALP", "OXYZ", "0123")
SQUARE = 0.02  # largest cosine between perpendicular axes; markers on skin are never that exact

BONE = 0.008  # palpable under the skin
FLESH = 0.012  # beside a joint, but not at one bony point
LOOSE_SD_M = 0.045  # somewhere on the segment

#: Left landmarks, named without their side; the right ones mirror them.
_PAIRED: dict[str, Landmark] = {
    "asis": Landmark("pelvis", (0.045, 0.070, 0.045), FLESH),
    "psis": Landmark("pelvis", (-0.055, 0.027, 0.058), FLESH),
    "iliac_crest": Landmark("pelvis", (0.005, 0.085, 0.075), FLESH),
    "pelvis_wand": Landmark("pelvis", (-0.150, 0.010, 0.060), 2 * LOOSE_SD_M),
    "trochanter": Landmark("thigh", (0.0, 0.048, 0.0), FLESH),
    "thigh_side": Landmark("thigh", (0.0, 0.055, -0.140), LOOSE_SD_M),
    "thigh_front": Landmark("thigh", (0.045, 0.0, -0.140), LOOSE_SD_M),
    "knee_lateral": Landmark("thigh", (0.0, 0.033, -_P.thigh), BONE),
    "knee_medial": Landmark("thigh", (0.0, -0.033, -_P.thigh), BONE),
    "shank_side": Landmark("shank", (0.0, 0.040, -0.120), LOOSE_SD_M),
    "shank_front": Landmark("shank", (0.025, 0.0, -0.120), LOOSE_SD_M),
    "ankle_lateral": Landmark("shank", (0.0, 0.024, -_P.shank), BONE),
    "ankle_medial": Landmark("shank", (0.0, -0.024, -_P.shank + 0.005), BONE),
    "heel": Landmark("foot", (-0.042, 0.0, -0.028), BONE),
    "mt1": Landmark("foot", (0.072, -0.020, -0.020), BONE),
    "mt2": Landmark("foot", (0.072, 0.0, -0.014), BONE),
    "mt5": Landmark("foot", (0.052, 0.030, -0.026), BONE),
    "toe_tip": Landmark("foot", (0.105, -0.010, -0.026), FLESH),
    "acromion": Landmark("torso", (0.0, 0.100, 0.300), FLESH),
    "clavicle": Landmark("torso", (0.040, 0.050, 0.290), FLESH),
    "back": Landmark("torso", (-0.065, 0.050, 0.240), LOOSE_SD_M),
    "upper_arm_side": Landmark("upper_arm", (0.0, 0.030, -0.090), LOOSE_SD_M),
    "elbow_lateral": Landmark("upper_arm", (0.0, 0.024, -_P.upper_arm), BONE),
    "elbow_medial": Landmark("upper_arm", (0.0, -0.024, -_P.upper_arm), BONE),
    "forearm_side": Landmark("forearm", (0.0, 0.025, -0.080), LOOSE_SD_M),
    "wrist": Landmark("forearm", (0.0, 0.015, -_P.forearm), FLESH),
    "wrist_radial": Landmark("forearm", (0.020, 0.010, -_P.forearm), FLESH),
    "wrist_ulnar": Landmark("forearm", (-0.020, 0.010, -_P.forearm), FLESH),
    "head_front": Landmark("head", (0.070, 0.042, 0.100), FLESH),
    "head_back": Landmark("head", (-0.040, 0.042, 0.105), FLESH),
    "head_side": Landmark("head", (0.015, 0.047, 0.085), FLESH),
    # Centres of joints, for files that contain them in addition to markers.
    "shoulder": Landmark("torso", _P.shoulder, BONE),
    "elbow": Landmark("upper_arm", (0.0, 0.0, -_P.upper_arm), BONE),
    "wrist_centre": Landmark("forearm", (0.0, 0.0, -_P.forearm), BONE),
    "hip": Landmark("pelvis", _P.hip, BONE),
    "knee": Landmark("thigh", (0.0, 0.0, -_P.thigh), BONE),
    "ankle": Landmark("shank", (0.0, 0.0, -_P.shank), BONE),
    "toe": Landmark("foot", _P.toe, BONE),
}
_SINGLE: dict[str, Landmark] = {
    "sacrum": Landmark("pelvis", (-0.060, 0.0, 0.050), FLESH),
    "c7": Landmark("torso", (-0.038, 0.0, 0.325), FLESH),
    "t10": Landmark("torso", (-0.065, 0.0, 0.200), FLESH),
    "suprasternale": Landmark("torso", (0.040, 0.0, 0.285), FLESH),
    "xiphoid": Landmark("torso", (0.070, 0.0, 0.190), FLESH),
    "neck": Landmark("torso", (0.0, 0.0, _P.neck), BONE),
    "head_top": Landmark("head", (0.015, 0.0, 0.145), FLESH),
    "forehead": Landmark("head", (0.075, 0.0, 0.100), FLESH),
    "occiput": Landmark("head", (-0.045, 0.0, 0.095), FLESH),
}


def _mirrored(mark: Landmark, side: str) -> Landmark:
    x, y, z = mark.at
    segment = mark.segment if mark.segment in SEGMENTS else f"{side}_{mark.segment}"
    return Landmark(segment, (x, y if side == "l" else -y, z), mark.sd)


#: All landmarks: l_asis, r_asis ..., sacrum ...
LANDMARKS = {f"{s}_{name}": _mirrored(mark, s) for name, mark in _PAIRED.items() for s in SIDES} | _SINGLE

#: Middle of a segment on its axis, statures.
MIDDLES = {"pelvis": 0.03, "torso": 0.2, "head": 0.08, "thigh": -0.12, "shank": -0.12, "upper_arm": -0.08}
MIDDLES |= {"forearm": -0.08, "foot": -0.025}

#: Sets: labels, as `plain` returns them, to landmarks; {s} is the side, l or r, or the words left, right.
_PLUG_IN_GAIT = {
    "{s}asi": "asis", "{s}psi": "psis", "sacr": "sacrum", "{s}thi": "thigh_side", "{s}kne": "knee_lateral",
    "{s}knee": "knee_lateral", "{s}knm": "knee_medial", "{s}knein": "knee_medial", "{s}mkne": "knee_medial",
    "{s}medkne": "knee_medial", "{s}tib": "shank_side", "{s}ank": "ankle_lateral", "{s}ankin": "ankle_medial",
    "{s}med": "ankle_medial", "{s}mank": "ankle_medial", "{s}mma": "ankle_medial", "{s}hee": "heel",
    "{s}toe": "mt2", "{s}mt1": "mt1", "{s}mt5": "mt5", "{s}fhd": "head_front", "{s}bhd": "head_back",
    "c7": "c7", "t10": "t10", "clav": "suprasternale", "strn": "xiphoid", "{s}bak": "back",
    "{s}cla": "clavicle", "{s}sho": "acromion", "{s}upa": "upper_arm_side", "{s}elb": "elbow_lateral",
    "{s}elbm": "elbow_medial",
    "{s}fra": "forearm_side", "{s}frm": "forearm_side", "{s}wra": "wrist_radial", "{s}wrb": "wrist_ulnar",
    "{s}trn": "trochanter", "{s}gtr": "trochanter", "{s}ili": "iliac_crest",
    **{f"{{s}}f0{i}": "thigh_front" for i in range(1, 6)},
    **{f"{{s}}t0{i}": "shank_front" for i in range(1, 6)},
}  # fmt: skip
_HELEN_HAYES = {
    "{s}asis": "asis", "{s}psis": "psis", "vsacral": "sacrum", "sacral": "sacrum", "sacrum": "sacrum",
    "s2": "sacrum", "{s}iliaccrest": "iliac_crest", "{s}sacwand": "pelvis_wand", "{s}hip": "trochanter",
    "{s}gtroch": "trochanter", "{s}trochanter": "trochanter", "{s}thigh": "thigh_side",
    "{s}postfem": "thigh_side", "{s}antfem": "thigh_side", "{s}knee": "knee_lateral",
    "{s}kneelat": "knee_lateral",
    "{s}kneelateral": "knee_lateral", "{s}kneemed": "knee_medial", "{s}kneemedial": "knee_medial",
    "{s}shank": "shank_side", "{s}tibia": "shank_side", "{s}posttib": "shank_side", "{s}anttib": "shank_side",
    "{s}ankle": "ankle_lateral", "{s}anklelat": "ankle_lateral", "{s}anklelateral": "ankle_lateral",
    "{s}anklemed": "ankle_medial", "{s}anklemedial": "ankle_medial", "{s}heel": "heel", "{s}toe": "mt2",
    "{s}mt1": "mt1", "{s}mt5": "mt5", "{s}shoulder": "acromion", "{s}clavicle": "clavicle",
    "{s}upperarm": "upper_arm_side", "{s}elbow": "elbow_lateral", "{s}elbowlat": "elbow_lateral",
    "{s}elbowmed": "elbow_medial", "{s}elbowmedial": "elbow_medial", "{s}forearm": "forearm_side",
    "{s}wrist": "wrist", "{s}radius": "wrist_radial", "{s}ulna": "wrist_ulnar", "tophead": "head_top",
    "fronthead": "forehead", "rearhead": "occiput", "backhead": "occiput", "sternum": "xiphoid",
    "c7": "c7", "t10": "t10",
    **{f"{{s}}thigh{i}": "thigh_side" for i in range(1, 7)},
    **{f"{{s}}shank{i}": "shank_side" for i in range(1, 7)},
}  # fmt: skip
_OPENSIM = {
    **_HELEN_HAYES, "{s}toe": "toe_tip", "{s}biceps": "upper_arm_side",
    **{f"{{s}}th{i}": "thigh_side" for i in range(1, 5)},
    **{f"{{s}}sh{i}": "shank_side" for i in range(1, 5)},
}  # fmt: skip
_OPENSIM_SHORT = {
    **_PLUG_IN_GAIT, "{s}toe": "toe_tip", "{s}cal": "heel", "{s}acr": "acromion", "{s}lel": "elbow_lateral",
    "{s}mel": "elbow_medial", "{s}faradius": "wrist_radial", "{s}faulna": "wrist_ulnar",
    "{s}fasuperior": "forearm_side", "{s}lfc": "knee_lateral", "{s}mfc": "knee_medial",
    "{s}lmal": "ankle_lateral", "{s}mmal": "ankle_medial", "{s}mt2": "mt2", "{s}ash": "upper_arm_side",
    **{f"{{s}}ua{i}": "upper_arm_side" for i in range(1, 5)},
    **{f"{{s}}th{i}": "thigh_side" for i in range(1, 5)},
    **{f"{{s}}tb{i}": "shank_side" for i in range(1, 5)},
}  # fmt: skip
#: Landmarks of the skeleton by their anatomical abbreviations (Van Sint Jan 2007), as written by users of
#: Qualisys and AnyBody: L_IAS, L_FLE, CV7.
_ANATOMICAL = {
    "{s}ias": "asis", "{s}ips": "psis", "{s}ict": "iliac_crest", "{s}ftc": "trochanter",
    "{s}ftl": "trochanter", "{s}fle": "knee_lateral", "{s}fme": "knee_medial", "{s}fax": "shank_side",
    "{s}tta": "shank_front", "{s}ttc": "shank_front", "{s}fal": "ankle_lateral", "{s}tam": "ankle_medial",
    "{s}fcc": "heel", "{s}fm1": "mt1", "{s}fm2": "mt2", "{s}fm5": "mt5", "{s}hlx": "toe_tip",
    "{s}dp1": "toe_tip", "cv7": "c7", "tv10": "t10", "sjn": "suprasternale", "sxs": "xiphoid",
    "{s}sae": "acromion", "{s}saj": "acromion", "{s}sia": "back",
    "{s}hle": "elbow_lateral", "{s}hme": "elbow_medial", "{s}rsp": "wrist_radial", "{s}usp": "wrist_ulnar",
    "sgl": "forehead",
    **{f"{{s}}th{i}": "thigh_side" for i in range(1, 5)},
    **{f"{{s}}sk{i}": "shank_side" for i in range(1, 5)},
}  # fmt: skip
_PATTERNS = {
    "plug-in-gait": _PLUG_IN_GAIT,
    "helen-hayes": _HELEN_HAYES,
    "opensim": _OPENSIM,
    "opensim-short": _OPENSIM_SHORT,
    "anatomical": _ANATOMICAL,
}


def _both_sides(patterns: dict[str, str]) -> dict[str, str]:
    """Expand a set to both sides; the side is a letter or a word, before or after the stem."""
    table: dict[str, str] = {}
    for pattern, landmark in patterns.items():
        if "{s}" not in pattern:
            table[pattern] = landmark
            continue
        for s, word in zip(SIDES, ("left", "right"), strict=True):
            stem = pattern.format(s="")
            table |= dict.fromkeys((s + stem, word + stem, stem + word), f"{s}_{landmark}")
    return table


#: For each set its labels (as `plain` returns them) and the names of their landmarks.
SETS = {name: _both_sides(patterns) for name, patterns in _PATTERNS.items()}


def segment_axes(labels: list[str], points: Floats) -> set[int]:
    """Return the columns of points (T, M, 3) that are not markers but represent the axes of segments.

    Gait models such as Plug-in-Gait (PELO PELA PELL PELP, LCLO LCLA ...) and Oxford Foot (LFOF0 to LFOF3)
    write four virtual points per segment: the origin, and one on each axis, at right angles from the origin.
    """
    columns = {label.rsplit(":", 1)[-1].upper(): k for k, label in enumerate(labels)}
    found: set[int] = set()
    for name in columns:
        for ends in AXIS_ENDINGS:
            four = [columns.get(name[:-1] + end) for end in ends] if name[-1:] == ends[0] else []
            known = [k for k in four if k is not None]
            if len(known) == len(ends) and _are_axes(points[:, known]):
                found |= set(known)
    return found


def _are_axes(points: Floats) -> bool:
    """Whether the last three of four points (T, 4, 3) are on perpendicular axes about the first."""
    away = points[:, 1:] - points[:, :1]
    away = away[np.isfinite(away).all(axis=(1, 2))]
    length = np.linalg.norm(away, axis=2, keepdims=True)
    if not len(away) or not (length > 0).all():
        return False
    cosines = np.einsum("tix,tjx->tij", away / length, away / length)
    return bool(np.abs(cosines - np.eye(3)).mean(axis=0).max() < SQUARE)


def plain(label: str) -> str:
    """Return a label without the subject before ':', case, blanks and punctuation."""
    return "".join(c for c in label.rsplit(":", 1)[-1].lower() if c.isalnum())


def known_landmarks(labels: list[str]) -> dict[str, Landmark]:
    """Return the landmarks, by plain label, of the set that knows most of the labels."""
    best = max(SETS.values(), key=lambda table: sum(plain(label) in table for label in set(labels)))
    return {plain(label): LANDMARKS[best[plain(label)]] for label in labels if plain(label) in best}


def read_map(path: Path) -> MarkerMap:
    """Read a marker map; UserError names file, marker and remedy."""
    content = json_object(
        path, "correct it", 'write {"markers": {label: landmark}}', lambda pairs: _unique(path, pairs)
    )
    unknown = set(content) - {"set", "markers"}
    if unknown:
        raise UserError(f"{path}: unknown key {sorted(unknown)[0]!r}; the keys are set and markers")
    table: dict[str, Landmark] = {}
    if "set" in content:
        chosen = _known(path, "set", content["set"], SETS)
        table = {label: LANDMARKS[name] for label, name in SETS[chosen].items()}
    markers = content.get("markers", {})
    if not isinstance(markers, dict):
        raise UserError(f"{path}: markers is not an object; write {{label: landmark}}")
    for label, value in markers.items():
        if value is None:
            table.pop(plain(label), None)
        else:
            table[plain(label)] = _landmark(path, label, value)
    if not table:
        raise UserError(f"{path}: no markers; name some, or a set")
    return MarkerMap(path, table, tuple(markers))


def _unique(path: Path, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise UserError(f"{path}: {twice!r} appears twice; remove one")
    return dict(pairs)


def _known(path: Path, field: str, value: Any, names: Iterable[str]) -> str:
    names = list(names)
    if isinstance(value, str) and value in names:
        return value
    near = difflib.get_close_matches(str(value), names, n=3, cutoff=0.5) or names[:6]
    raise UserError(f"{path}: {field}: {value!r} is not known; did you mean {', '.join(near)}?")


def _landmark(path: Path, label: str, value: Any) -> Landmark:
    if not isinstance(value, dict):
        return LANDMARKS[_known(path, label, value, LANDMARKS)]
    unknown = set(value) - {"segment", "at", "sd"}
    if unknown:
        raise UserError(
            f"{path}: {label}: unknown key {sorted(unknown)[0]!r}; the keys are segment, at and sd"
        )
    segment = _known(path, label, value.get("segment"), SEGMENTS)
    middle = MIDDLES[segment.removeprefix("l_").removeprefix("r_")]
    at = _numbers(path, f"{label}: at", value.get("at", [0.0, 0.0, middle]), 3, -1.0)
    (sd,) = _numbers(path, f"{label}: sd", [value.get("sd", BONE if "at" in value else LOOSE_SD_M)], 1, 1e-4)
    return Landmark(segment, (at[0], at[1], at[2]), sd)


def _numbers(path: Path, field: str, values: Any, count: int, least: float) -> list[float]:
    """Check numbers of statures between `least` and 1."""
    good = isinstance(values, list) and len(values) == count
    if not good or not all(
        isinstance(v, (int, float)) and not isinstance(v, bool) and least <= v <= 1 for v in values
    ):
        raise UserError(
            f"{path}: {field} is {json.dumps(values)}; write {count} numbers in statures, at most 1"
        )
    return [float(v) for v in values]
