"""The classes of motion of a model, in figures and in words."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from gait.body.motion_classes import class_names, class_sections
from gait.body.skeleton import ANGLES
from gait.counts import count_of
from gait.io import blob
from gait.learn.arrays import Floats

NO_METAS: Mapping[str, Mapping[str, Any]] = MappingProxyType({})


def figures(
    sections: Mapping[str, blob.Array], metas: Mapping[str, Mapping[str, Any]] = NO_METAS
) -> list[dict[str, Any]]:
    """Return the figures of each class, and how often people change from it; empty without classes.

    `metas`: META, by class, of the models that the classes after the first come from, where known: it has
    their people, sequences and explained variance, which the sections have only for the first class.
    """
    if not (names := class_names(sections)):
        return []
    own_meta, found = blob.read_meta(sections), []
    metas, observed = {**metas, names[0]: own_meta}, own_meta.get("changes", {})
    for k, (name, row, change) in enumerate(zip(names, sections["CLIN"], sections["CLSW"], strict=True)):
        direction, source, cycles, recordings = (int(value) for value in row)
        own = class_sections(sections, k)
        gait, curves = own["GAIT"].astype(float), own["CURV"]
        rate, rate_sd, length, length_sd = (round(float(gait[i]), 4) for i in (0, 1, 3, 4))
        meta, residuals = metas.get(name, {}), own["CHST"][: len(ANGLES), 0].astype(float)
        explained = metas.get(names[source], {}).get("variance_explained", [])
        found.append({
            "name": name,
            "direction": direction,
            "curves_of": names[source],
            "components": len(curves) - 1,
            "cycles": cycles,
            "recordings": recordings,
            "people": meta.get("subject_count"),
            "stride_hz": rate if direction else 0.0,
            "stride_hz_sd": rate_sd if direction else 0.0,
            "stride_length_statures": length,
            "stride_length_sd_statures": length_sd,
            "speed_statures_s": round(direction * gait[0] * gait[3], 4),
            "variance_explained": explained[: len(curves) - 1],
            "residual_deg": _rms_deg(residuals) if direction else None,
            "sequences": meta.get("sequences") if k else None,
            "changes_observed": observed.get(name, {}).get("to", {}),
            "changes_per_s": {to: round(float(c[0]), 4) for to, c in zip(names, change, strict=True) if c[0]},
        })  # fmt: skip
    return found


def _rms_deg(residuals: Floats) -> float | None:
    """Return the rms of the residual sds of angles, radians, that recordings have; None if there are none."""
    found = residuals[residuals > 0]
    return round(float(np.degrees(np.sqrt(np.mean(found**2)))), 2) if len(found) else None


def line(one: Mapping[str, Any]) -> str:
    """Describe a class of `figures` in one line."""
    cells = words(one)
    parts = [cells["from"], cells["strides/s"]]
    if one["direction"]:
        parts[1] += f" strides/s (period {cells['period, s']} s)"
        parts += [
            f"stride length {cells['stride length, statures']} statures ({cells['statures/s']} statures/s)"
        ]
    parts += [count_of(one["components"], "component")]
    parts += [f"{cells['variance, %']} % of the variance"] if cells["variance, %"] else []
    parts += [f"residual {cells['residual, °']} deg"] if cells["residual, °"] else []
    return f"class {one['name']}: {', '.join(parts)}; changes per second: {cells['changes per second']}"


def words(one: Mapping[str, Any], between: str = "+-") -> dict[str, str]:
    """Describe a class of `figures`, by column of a table; `between` mean and standard deviation."""
    source = "derived from the walk"
    if one["cycles"] or one["recordings"]:
        people = (
            ""
            if one["people"] is None
            else f" of {one['people']} {'person' if one['people'] == 1 else 'people'}"
        )
        cycles = f", {count_of(one['cycles'], 'cycle')}" if one["cycles"] else ""
        source = f"recorded: {count_of(one['recordings'], 'recording')}{people}{cycles}"
    if one["curves_of"] != one["name"]:
        source = f"derived: the curves of {one['curves_of']} in reverse"
    moves = one["direction"] != 0
    rate, length = (
        f"{one[name]:.2f} {between} {one[sd]:.2f}" if moves else ""
        for name, sd in (
            ("stride_hz", "stride_hz_sd"),
            ("stride_length_statures", "stride_length_sd_statures"),
        )
    )
    return {
        "class": one["name"],
        "from": source,
        "strides/s": rate or "stands still",
        "period, s": f"{1 / one['stride_hz']:.2f}" if moves else "",
        "stride length, statures": length,
        "statures/s": f"{one['speed_statures_s']:.2f}" if moves else "",
        "components": str(one["components"]),
        "variance, %": f"{100 * one['variance_explained'][-1]:.0f}" if one["variance_explained"] else "",
        "residual, °": "" if one["residual_deg"] is None else f"{one['residual_deg']:.1f}",
        "changes per second": ", ".join(
            f"{to} {rate:g} ({_observed(one['changes_observed'].get(to))})"
            for to, rate in one["changes_per_s"].items()
        ),
    }


def _observed(count: int | None) -> str:
    """How many changes a rate was learnt from; None: it was not."""
    return "prior" if count is None else count_of(count, "change")
