"""The modes of a clip's first segment where the phase of walking is known: which leg is ahead.

Seen from the side both legs look alike, and a segment with left and right exchanged fits as well.  The mean
cycle of a cyclic model at a phase, turned into modes of the segment prior, says which it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import pose
from gait.bindings.segment_prior import SegmentPrior
from gait.io import blob
from gait.lift.corrections import Placement

Floats = npt.NDArray[np.float64]

UNKNOWN_SD = 0.25  # strides: a phase less sure than that tells nothing


@dataclass(frozen=True)
class Beginning:
    """Mean and standard deviations (K, k) of the modes of the first segment, by component."""

    mean: Floats
    sd: Floats

    @staticmethod
    def of(prior: SegmentPrior, cycle: Mapping[str, Any], placement: Placement) -> Beginning | None:
        """Take the phase of a placement; None if it has none, or one that is hardly known.

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
        return Beginning(np.stack([mean for mean, _ in found]), np.stack([sd for _, sd in found]))


def _columns(
    prior: SegmentPrior, cycle: Mapping[str, Any], placement: Placement, markers: list[str]
) -> Floats:
    """Mean cycle about the pelvis in a segment's frames, and its steps by one deviation of what is unknown.

    Returns
    -------
    (1 + 2 + q, F, M, 3)
        Statures: the cycle at the phase; steps by phase, by rate and by each component of the motion.
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
    """Posterior mean and deviations (k,) of a component's modes, seeing markers about the pelvis."""
    index, pelvis = prior.index(markers), prior.index(["pelvis"])
    mean = prior.mean[component, :, index].swapaxes(0, 1) - prior.mean[component][:, pelvis]
    modes = prior.modes[component][:, :, index] - prior.modes[component][:, :, pelvis]
    sd = np.sqrt(prior.gamma * (prior.residual[component, index] + prior.residual[component, pelvis]))
    rows = (modes / sd[:, None]).reshape(prior.size, -1)
    covariance = np.linalg.inv(rows @ rows.T + np.eye(prior.size))
    known, *steps = ((values / sd[:, None]).ravel() for values in (columns[0] - mean, *columns[1:]))
    spread = covariance @ rows @ np.stack(steps, axis=1)
    variance = np.diag(covariance) + (spread**2).sum(axis=1)
    return covariance @ rows @ known, np.sqrt(np.minimum(variance, 1.0))
