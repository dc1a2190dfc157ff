"""A person's measured body: a file of lengths, and a model whose skeleton has those lengths."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.bindings.model import read_cyclic
from gait.bindings.state import state_range
from gait.body.skeleton import SIDES
from gait.errors import UserError
from gait.io import blob
from gait.io.fields import read_json

Floats = npt.NDArray[np.float64]

#: Each length to the frame or point at its end, whose position in its parent frame gives the length, or half
#: of a width.  `_SUMS` are lengths with two parts.
_LIMBS = {"thigh": "shank", "shank": "foot", "upper_arm": "forearm", "forearm": "wrist"}
_WIDTHS = {"hip_width": "thigh", "shoulder_width": "upper_arm"}
_SUMS = {"leg": ("thigh", "shank"), "arm": ("upper_arm", "forearm")}
LENGTHS = (*_SUMS, *_LIMBS, *_WIDTHS)
_USUAL = 0.7, 1.4  # accepted lengths, as multiples of the model's at the same stature
_REMEDY = "give metres between centres of joints"


@dataclass(frozen=True)
class MeasuredBody:
    """Measurements of a person's body.

    Attributes
    ----------
    stature : float
        Metres.
    lengths : dict of str to float
        Metres between centres of joints, for some of `LENGTHS`: ``leg`` from hip to ankle and ``arm`` from
        shoulder to wrist, or their parts, equal on both sides; ``hip_width``, ``shoulder_width``.
    source : str
        File with the measurements, for messages.
    """

    stature: float
    lengths: dict[str, float] = field(default_factory=dict)
    source: str = "body"

    @staticmethod
    def read(path: str | os.PathLike[str]) -> MeasuredBody:
        """Read a JSON file with ``stature_m`` and lengths such as ``thigh_m``.

        Raises
        ------
        UserError
            One line naming file, key and remedy.
        """
        fields = read_json(path, "body")
        fields.only(("stature_m", *(f"{name}_m" for name in LENGTHS)))
        stature = fields.number("stature_m", *state_range("stature"), "give the person's height in metres")
        lengths = {
            name: fields.number(f"{name}_m", 0.02, 1.5, _REMEDY) for name in LENGTHS if f"{name}_m" in fields
        }
        for whole, parts in _SUMS.items():
            if all(name in lengths for name in (whole, *parts)):
                raise fields.fail(
                    f"{whole}_m", "is given together with both of its parts", "leave one of them out"
                )
        return MeasuredBody(stature, lengths, str(path))


def model_of(body: MeasuredBody, source: str | os.PathLike[str] | None = None) -> bytes:
    """Give the skeleton of a model, by default the package's, the lengths of a body; return the blob.

    Lengths that were not measured stay in proportion to the stature.

    Raises
    ------
    UserError
        If the model cannot be read or lacks a limb, or if a length is implausible.
    """
    return blob.encode(_with_lengths(read_cyclic(source), body))


def _with_lengths(sections: Mapping[str, Any], body: MeasuredBody) -> dict[str, Any]:
    """Return the sections of a blob, changed to the lengths of a body."""
    origins, places = np.array(sections["FRMF"], float), np.array(sections["PTNF"], float)
    limbs = np.array(sections["LIMF"], float)
    frames, points = blob.unpack_names(sections["FRNM"]), blob.unpack_names(sections["PTNM"])
    try:
        usual = _lengths(frames, origins, points, places)
    except ValueError as error:
        raise UserError(f"{body.source}: of the model {error}; use one of gait learn") from None
    factors = _factors(body, usual)
    for name, factor in factors.items():
        for side in SIDES:
            if name in _WIDTHS:
                origins[frames.index(f"{side}_{_WIDTHS[name]}"), 1] *= factor
                continue
            frame = frames.index(f"{side}_{name}")
            origins[np.asarray(sections["FRMI"])[:, 0] == frame] *= factor
            places[np.asarray(sections["PTNI"]) == frame] *= factor
            limbs[np.asarray(sections["LIMI"])[:, 0] == frame, :6] *= factor
    longer = sum((factors.get(part, 1.0) - 1.0) * usual[part] for part in _SUMS["leg"])
    scaled = {"FRMF": origins, "PTNF": places, "LIMF": limbs} | raised(sections, longer)
    return {**sections, **{tag: values.astype(np.float32) for tag, values in scaled.items()}}


def _lengths(frames: list[str], origins: Floats, points: list[str], places: Floats) -> dict[str, float]:
    """Lengths of limbs, and widths, in statures; ValueError if the skeleton lacks a part."""
    out = {}
    for name, end in _LIMBS.items():
        at = places[points.index(f"l_{end}")] if end == "wrist" else origins[frames.index(f"l_{end}")]
        out[name] = float(np.linalg.norm(at))
    for name, end in _WIDTHS.items():
        out[name] = 2 * abs(float(origins[frames.index(f"l_{end}"), 1]))
    return out


def _factors(body: MeasuredBody, usual: Mapping[str, float]) -> dict[str, float]:
    """Measured lengths as multiples of the `usual` ones; UserError for an implausible one."""
    measured = {name: length / body.stature for name, length in body.lengths.items()}
    for whole, parts in _SUMS.items():
        if whole not in measured:
            continue
        rest, length = [part for part in parts if part not in measured], measured.pop(whole)
        length -= sum(measured[part] for part in parts if part in measured)
        measured |= {part: length * usual[part] / sum(usual[other] for other in rest) for part in rest}
    factors = {name: length / usual[name] for name, length in measured.items()}
    for name, factor in factors.items():
        if not _USUAL[0] <= factor <= _USUAL[1]:
            raise UserError(
                f"{body.source}: {name}_m is {measured[name] * body.stature:.2f}, {factor:.2f} times that of "
                f"people of this stature; {_REMEDY}"
            )
    return factors


def raised(sections: Mapping[str, Any], longer: float) -> dict[str, Floats]:
    """Curves of all classes of motion, with the pelvis raised by `longer`, statures, as the legs are."""
    height = blob.unpack_names(sections["CHNM"]).index("root_height")
    factor = 1.0 + longer / float(np.mean(sections["CURV"][0, :, height]))
    curves = {tag: np.array(values, float) for tag, values in sections.items() if tag[:3] in ("CUR", "PAC")}
    for values in curves.values():
        values[..., height] *= factor
    return curves
