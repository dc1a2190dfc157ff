"""Join several classes of motion in one blob (model-format.md, sections of classes)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gait.bindings.abi import MAX_CLASSES
from gait.body.motion_classes import CLASS_TAGS, class_names, class_sections, of_class
from gait.errors import UserError
from gait.io import blob

Sections = Mapping[str, blob.Array]


@dataclass(frozen=True)
class Change:
    """How often people change from one class to another, and at which phase."""

    rate: float  #: per second, at the most likely phase and pace
    concentration: float = 0.0  #: of the phases; 0: any phase
    phase: float = 0.0  #: most likely phase; half a stride later is as likely
    slope: float = 0.0  #: of the log rate with the pace


@dataclass(frozen=True)
class MotionClass:
    """One class, with its own sections or the curves of another."""

    name: str
    direction: int = 1  #: of the phase: 1 forwards, -1 backwards, 0 standing still
    own: Sections | None = None  #: sections of a model with the same channels
    source: str = ""  #: without `own`: the class whose curves it uses
    cycles: int = 0  #: number of cycles from which it was learnt
    recordings: int = 0
    changes: Mapping[str, Change] = field(default_factory=dict)  #: to other classes
    meta: Mapping[str, Any] = field(default_factory=dict)  #: META of the model it was alone in, if known


def join(first: Sections, classes: Sequence[MotionClass]) -> dict[str, blob.Array]:
    """Return the sections of `first`, whose curves are those of classes[0], with those of all classes.

    UserError if a class does not fit: it has other channels, an existing name, or no source.
    """
    names = [c.name for c in classes]
    if len(set(names)) < len(names) or len(names) > MAX_CLASSES:
        raise UserError(f"classes {' '.join(names)}: give each its own name, at most {MAX_CLASSES}")
    out = {tag: array for tag, array in first.items() if not of_class(tag)}
    info = np.zeros((len(classes), 4), np.int32)
    changes = np.zeros((len(classes), len(classes), 4), np.float32)
    for k, one in enumerate(classes):
        info[k] = (one.direction, _source(one, k, classes), one.cycles, one.recordings)
        if k and one.own is not None:
            _require_channels(first, one)
            out |= {CLASS_TAGS[tag].format(k): one.own[tag] for tag in CLASS_TAGS if tag in one.own}
        for to, change in one.changes.items():
            if to in names:
                changes[k, names.index(to)] = (change.rate, change.concentration, change.phase, change.slope)
    out["CLNM"] = blob.pack_names(names)
    out["CLIN"], out["CLSW"] = info, changes
    return out


def classes_of(sections: Sections) -> list[MotionClass]:
    """Return the classes of a model with their changes, as `join` takes them; empty if it has no classes."""
    names, found = class_names(sections), []
    for k, (name, row) in enumerate(zip(names, sections.get("CLIN", ()), strict=True)):
        direction, source, cycles, recordings = (int(value) for value in row)
        changes = {
            to: Change(*(float(value) for value in change))
            for to, change in zip(names, sections["CLSW"][k], strict=True)
            if change[0]
        }
        own = class_sections(sections, k) if source == k else None
        found.append(MotionClass(name, direction, own, names[source], cycles, recordings, changes))
    return found


def _source(one: MotionClass, k: int, classes: Sequence[MotionClass]) -> int:
    if k == 0 or one.own is not None:
        return k
    earlier = [c.name for c in classes[:k]]
    if one.source not in earlier:
        raise UserError(f"class {one.name}: has no curves, and no class {one.source!r} before it has them")
    return earlier.index(one.source)


def _require_channels(first: Sections, one: MotionClass) -> None:
    if one.own is not None and "CHNM" in one.own and one.own["CHNM"].tobytes() != first["CHNM"].tobytes():
        raise UserError(f"class {one.name}: its model has other channels; learn it with this version")
