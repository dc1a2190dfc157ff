"""The classes of motion of a model, in figures and in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gait.body.motion_classes import class_names, class_sections
from gait.counts import count_of
from gait.io import blob


def figures(sections: Mapping[str, blob.Array]) -> list[dict[str, Any]]:
    """Return for each class its rate, speed and how often people change from it; empty without classes."""
    if not (names := class_names(sections)):
        return []
    found, observed = [], blob.read_meta(sections).get("changes", {})
    for k, (name, row, change) in enumerate(zip(names, sections["CLIN"], sections["CLSW"], strict=True)):
        direction, source, cycles, recordings = (int(value) for value in row)
        own = class_sections(sections, k)
        gait, curves = own["GAIT"].astype(float), own["CURV"]
        found.append({
            "name": name,
            "direction": direction,
            "curves_of": names[source],
            "components": len(curves) - 1,
            "cycles": cycles,
            "recordings": recordings,
            "stride_hz": round(gait[0], 4) if direction else 0.0,
            "speed_statures_s": round(direction * gait[0] * gait[3], 4),
            "changes_observed": observed.get(name, {}).get("to", {}),
            "changes_per_s": {to: round(float(c[0]), 4) for to, c in zip(names, change, strict=True) if c[0]},
        })  # fmt: skip
    return found


def words(one: Mapping[str, Any]) -> dict[str, str]:
    """Describe a class of `figures`, by column of a table."""
    source = "derived from the walk"
    if one["cycles"] or one["recordings"]:
        cycles = f", {one['cycles']} cycles" if one["cycles"] else ""
        source = f"recorded: {count_of(one['recordings'], 'recording')}{cycles}"
    if one["curves_of"] != one["name"]:
        source = f"derived: the curves of {one['curves_of']} in reverse"
    moves = one["direction"] != 0
    return {
        "class": one["name"],
        "from": source,
        "strides/s": f"{one['stride_hz']:.2f}" if moves else "stands still",
        "statures/s": f"{one['speed_statures_s']:.2f}" if moves else "",
        "components": str(one["components"]),
        "changes per second": ", ".join(
            f"{to} {rate:g} ({_observed(one['changes_observed'].get(to))})"
            for to, rate in one["changes_per_s"].items()
        ),
    }


def _observed(count: int | None) -> str:
    """How many changes a rate was learnt from; None: it was not."""
    return "prior" if count is None else count_of(count, "change")
