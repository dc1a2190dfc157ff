"""Mapping files: which markers of a set of one's own sit where on the body (`gait learn --markers MAP.json`).

    {
      "set": "plug-in-gait",
      "markers": {
        "Knee1_L": "l_knee_lateral",
        "Cluster_A": {"segment": "l_thigh"},
        "Plate_R": {"segment": "r_shank", "at": [0.02, -0.03, -0.1], "sd": 0.02},
        "LWRA": null
      }
    }

`set` (optional) is a known set to start from; `markers` adds to it or overrides it.  A label is compared
without the subject before ':', case, blanks and punctuation.  Its value is a
landmark of `gait.learn.mocap.marker_sets`, or a segment of the skeleton (libgait/doc/model-format.md) with
the place `at` in its axes (x forward, y left, z up, from the segment's upper joint) and `sd`, how far the
marker may be from there, both in statures; without `at` it is anywhere on the segment.  null leaves a marker out.
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from gait.errors import UserError
from gait.io.fields import json_object
from gait.learn.mocap.marker_sets import BONE, LANDMARKS, LOOSE, SETS, Landmark, plain
from gait.learn.solve.articulated import SEGMENTS

#: Middle of a segment on its axis, statures.
MIDDLES = {"pelvis": 0.03, "torso": 0.2, "head": 0.08, "thigh": -0.12, "shank": -0.12, "upper_arm": -0.08}
MIDDLES |= {"forearm": -0.08, "foot": -0.025}


def read(path: Path) -> dict[str, Landmark]:
    """Read a mapping: plain label to place.

    Raises
    ------
    UserError
        Naming file, marker and remedy.
    """
    content = _content(path)
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
    return table


def named(path: Path) -> list[str]:
    """Labels that a mapping (of which `read` is sure) names, as they are written."""
    return list(_content(path).get("markers", {}))


def _content(path: Path) -> dict[str, Any]:
    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        twice = next((key for key in keys if keys.count(key) > 1), None)
        if twice is not None:
            raise UserError(f"{path}: {twice!r} is there twice; remove one")
        return dict(pairs)

    return json_object(path, "correct it", 'write {"markers": {label: landmark}}', unique)


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
    (sd,) = _numbers(path, f"{label}: sd", [value.get("sd", BONE if "at" in value else LOOSE)], 1, 1e-4)
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
