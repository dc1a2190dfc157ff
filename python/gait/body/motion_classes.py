"""The classes of motion in the sections of a blob (model-format.md), and the model of one of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gait.io import blob

WALKING = "walk"  # class that needs no mention
STANDING = "stand"  # class of a person without a phase
RUNNING = ("run", "running", "jog", "jogging")  # names of classes in which both feet leave the floor
#: Sections that a class may have itself, with their tags for class k.
CLASS_TAGS = {"CURV": "CUR{}", "CHST": "CHS{}", "SCST": "SCS{}", "GAIT": "GAI{}", "PACE": "PAC{}"}
_SOURCE_COLUMN = 1  # of CLIN


def class_names(sections: Mapping[str, Any]) -> list[str]:
    """Return the names of a model's classes of motion; empty if it has no sections of classes."""
    return blob.unpack_names(sections["CLNM"]) if "CLNM" in sections else []


def first_class(sections: Mapping[str, Any]) -> str:
    """Return the name of a model's first class of motion, also if it has no sections of classes."""
    names = class_names(sections)
    return names[0] if names else str(blob.read_meta(sections).get("activity", WALKING))


def of_class(tag: str) -> bool:
    """Whether a section belongs to classes after the first, or lists them."""
    return tag[:2] == "CL" or tag[3].isdigit()


def class_sections(sections: Mapping[str, Any], index: int) -> dict[str, Any]:
    """Return the model of one class: its curves and statistics as those of the first, without other classes.

    `index`: number of the class; 0 in a model without sections of classes.
    """
    source = int(sections["CLIN"][index][_SOURCE_COLUMN]) if index else 0
    own = {tag: tag if source == 0 else name.format(source) for tag, name in CLASS_TAGS.items()}
    common = {tag: array for tag, array in sections.items() if not of_class(tag) and tag not in own}
    return common | {tag: sections[name] for tag, name in own.items() if name in sections}
