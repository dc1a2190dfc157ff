"""The person's position in one frame of a clip, given by the user.

Placement (JSON), with a camera, in the form of ``gait track --init``::

    {"frame": 64, "pelvis": [-0.1, 5.5, 0.9], "heading_rad": -1.57, "stature_m": 1.65, "phase": 0.3,
     "sd": {"pelvis": 0.1, "heading_rad": 0.1, "phase": 0.1}}

and without one, where heading 0 is to the right of the picture and +90 degrees away from the viewer::

    {"frame": 64, "pelvis_px": [1376, 734], "height_px": 415, "heading_rad": 3.14, "stature_m": 1.65}

The phase of walking, from 0 (right heel strike) to 1, determines which leg is in front.  Seen from the side
both legs look alike, and a segment with left and right swapped fits as well.  `PhasePrior` converts the mean
cycle of a cyclic model at the given phase to modes of the segment prior, which decides between them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.bindings.initial import FILE_SCALARS, frame_number, read_start
from gait.bindings.segment_prior import SegmentPrior
from gait.bindings.state import state_range
from gait.body.skeleton import pose
from gait.io import blob
from gait.io.fields import Fields

Floats = npt.NDArray[np.float64]

PLACE_SD = 0.3  # metres on the ground, and radians of heading, unless the placement states it
PLACED_HEADING_SD = 0.3
STATURE_SD_M = 0.03  # metres
PHASE_SD = 0.1  # strides; of a phase estimated by a user
RATE_SD_HZ = 0.05  # strides per second
HEIGHT_SD = 0.05  # metres, of the body above the ground, as the floor may not be at 0
FURTHEST = 1e6  # largest coordinate, pixels or metres
_SPACE, _PICTURE = ("pelvis",), ("pelvis_px", "height_px")  # keys of the position with and without a camera
_KNOWN = ("frame", *_SPACE, *_PICTURE, "heading_rad", "stature_m", "phase", "stride_hz", "sd")


@dataclass(frozen=True)
class Placement:
    """Rough position of the person in one frame.

    Attributes
    ----------
    frame : int
    ground : (2,)
        Pelvis on the ground, metres; in a flat view, relative to the point at `pelvis_px`.
    heading : float
        Radians about z.
    stature : float
        Metres.
    ground_sd, heading_sd, stature_sd : float
    pelvis_px : (float, float), optional
        Without a camera: the pelvis in the picture.
    height_px : float, optional
        Without a camera: height of the standing person in pixels.
    phase : float, optional
        Phase of walking, from 0 (right heel strike) to 1.
    stride_hz : float, optional
        Strides per second.
    phase_sd, stride_hz_sd : float
    unused : tuple of str
        Keys of the file that are not used in this view.
    """

    frame: int
    ground: Floats
    heading: float
    stature: float
    ground_sd: float = PLACE_SD
    heading_sd: float = PLACED_HEADING_SD
    stature_sd: float = STATURE_SD_M
    pelvis_px: tuple[float, float] | None = None
    height_px: float | None = None
    phase: float | None = None
    stride_hz: float | None = None
    phase_sd: float = PHASE_SD
    stride_hz_sd: float = RATE_SD_HZ
    unused: tuple[str, ...] = ()


def read_placement(path: str | os.PathLike[str], prior: SegmentPrior, calibrated: bool) -> Placement:
    """Read a placement file.

    Raises
    ------
    UserError
        One line naming file, key and remedy.
    """
    fields, sds = read_start(path, "placement", _KNOWN)
    stature = prior.stature
    if "stature_m" in fields:
        stature = fields.number("stature_m", *state_range("stature"), "give the person's height in metres")
    placed = Placement(
        frame=frame_number(fields),
        ground=_ground(fields) if calibrated else np.zeros(2),
        heading=fields.number(
            "heading_rad", *state_range("heading"), "give the body's direction about z in radians"
        ),
        stature=stature,
        ground_sd=_sd_of(sds, "pelvis", PLACE_SD),
        heading_sd=_sd_of(sds, "heading_rad", PLACED_HEADING_SD),
        stature_sd=_sd_of(sds, "stature_m", STATURE_SD_M),
        phase=_optional(fields, "phase"),
        stride_hz=_optional(fields, "stride_hz"),
        phase_sd=_sd_of(sds, "phase", PHASE_SD),
        stride_hz_sd=_sd_of(sds, "stride_hz", RATE_SD_HZ),
        unused=tuple(key for key in (_PICTURE if calibrated else _SPACE) if key in fields),
    )
    return placed if calibrated else replace(placed, **_in_picture(fields))


def _in_picture(fields: Fields) -> dict[str, Any]:
    """Read position and size of the person in the picture."""
    if "pelvis_px" not in fields:
        raise fields.fail("pelvis_px", "is missing", "give the pelvis in the picture, or --camera")
    u, v = fields.array("pelvis_px", (2,), "give column and row of the pelvis, pixels")
    height = fields.number("height_px", 10.0, FURTHEST, "give the height of the person in pixels")
    return {"pelvis_px": (float(u), float(v)), "height_px": height}


def _optional(fields: Fields, key: str) -> float | None:
    """Read a number with the key and range of the tracker's start; None if absent."""
    name, remedy = FILE_SCALARS[key]
    return fields.number(key, *state_range(name), remedy) if key in fields else None


def _ground(fields: Fields) -> Floats:
    remedy = "give x and y of the pelvis on the ground, metres"
    three = fields.count("pelvis", remedy) == 3
    return fields.array("pelvis", (3,) if three else (2,), remedy)[:2]


def _sd_of(sds: Fields, key: str, usual: float) -> float:
    """Read a standard deviation: one number, or the largest of three; the usual one if absent."""
    if key not in sds:
        return usual
    remedy = "give a positive standard deviation"
    values = np.atleast_1d(sds.one_or_three(key, remedy))
    wrong = values[(values <= 0) | (values >= FURTHEST)]
    if len(wrong):
        raise sds.fail(key, f"is {wrong[0]:g}", remedy)
    return float(values.max())


UNKNOWN_SD = 0.25  # strides; a less certain phase is useless


@dataclass(frozen=True)
class PhasePrior:
    """Mean and standard deviations (K, k) of the first segment's modes, by component."""

    mean: Floats
    sd: Floats

    @staticmethod
    def of(prior: SegmentPrior, cycle: Mapping[str, Any], placement: Placement) -> PhasePrior | None:
        """Compute the prior from the phase of a placement; None if that has none, or a very uncertain one.

        Parameters
        ----------
        prior : SegmentPrior
        cycle : mapping
            Sections of a blob with a cyclic model.
        placement : Placement
        """
        if placement.phase is None or placement.phase_sd >= UNKNOWN_SD:
            return None
        markers = [name for name in blob.unpack_names(cycle["PTNM"]) if name in prior.names]
        columns = _columns(prior, cycle, placement, markers)
        found = [_modes(prior, c, markers, columns) for c in range(prior.components)]
        return PhasePrior(np.stack([mean for mean, _ in found]), np.stack([sd for _, sd in found]))


def _columns(
    prior: SegmentPrior, cycle: Mapping[str, Any], placement: Placement, markers: list[str]
) -> Floats:
    """Compute the mean cycle about the pelvis in a segment's frames, and changes by one sd of the unknowns.

    Returns
    -------
    (1 + 2 + q, F, M, 3)
        Statures: the cycle at the phase; changes by phase, by rate and by each component of the motion.
    """
    rate, rate_sd = (float(value) for value in cycle["GAIT"][:2])
    if placement.stride_hz is not None:
        rate, rate_sd = placement.stride_hz, placement.stride_hz_sd
    time = np.arange(prior.frames) / prior.fps
    size = len(cycle["CURV"]) - 1
    heading = 0.0 if prior.headings == 0 else placement.heading
    assert placement.phase is not None

    def body(phase: float, rate: float, coef: Floats) -> Floats:
        joints, _ = pose(
            cycle, phase + rate * time, coef, 1.0, heading, 0.0, 0.0, np.zeros(3), stride_hz=rate
        )
        names = blob.unpack_names(cycle["PTNM"])
        places = joints[:, [names.index(name) for name in markers]]
        return np.asarray(places - joints[:, names.index("pelvis"), None])

    known = body(placement.phase, rate, np.zeros(size))
    moved = [
        body(placement.phase + placement.phase_sd, rate, np.zeros(size)),
        body(placement.phase, rate + rate_sd, np.zeros(size)),
        *(body(placement.phase, rate, unit) for unit in np.eye(size)),
    ]
    return np.stack([known, *(other - known for other in moved)])


def _modes(prior: SegmentPrior, component: int, markers: list[str], columns: Floats) -> tuple[Floats, Floats]:
    """Compute the posterior (mean and sd, (k,)) of a component's modes, given markers about the pelvis."""
    index, pelvis = prior.index(markers), prior.index(["pelvis"])
    mean = prior.mean[component, :, index].swapaxes(0, 1) - prior.mean[component][:, pelvis]
    modes = prior.modes[component][:, :, index] - prior.modes[component][:, :, pelvis]
    sd = np.sqrt(prior.gamma * (prior.residual[component, index] + prior.residual[component, pelvis]))
    rows = (modes / sd[:, None]).reshape(prior.size, -1)
    covariance = np.linalg.inv(rows @ rows.T + np.eye(prior.size))
    known, *steps = ((values / sd[:, None]).ravel() for values in (columns[0] - mean, *columns[1:]))
    sds = covariance @ rows @ np.stack(steps, axis=1)
    variance = np.diag(covariance) + (sds**2).sum(axis=1)
    return covariance @ rows @ known, np.sqrt(np.minimum(variance, 1.0))
