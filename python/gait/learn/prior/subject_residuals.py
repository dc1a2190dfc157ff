"""What mean and plain components cannot follow of each subject: learnt from, and left out of learning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, EVAL15, JOINTS, Proportions, default_skeleton, points
from gait.learn.prior import fpca
from gait.learn.prior.between import ADULT_STATURE

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]

LEAST_SUBJECTS, MOST_SUBJECTS = 3, 12  # each costs a fit
MOST_CYCLES = 600
COMPARED = [JOINTS.index(name) for name in EVAL15 if name != "pelvis"]


@dataclass(frozen=True)
class SubjectResiduals:
    """Errors of n subjects, NaN where nothing is seen; first row: learnt from, second: left out.

    Attributes
    ----------
    degrees : (2, n)
        Root mean square over the angles.
    millimetres : (2, n)
        Mean distance of 14 joints with the pelvis aligned (place and orientation), on one body for all; over
        the phases at which all angles are seen.
    """

    degrees: Floats
    millimetres: Floats


def subject_residuals(
    values: Floats,
    mask: Rows,
    scale: Floats,
    subject: npt.NDArray[np.intp],
    count: int,
    proportions: Proportions,
) -> SubjectResiduals | None:
    """Fit the components of all, and of all but each subject; None if subjects are few, or fits too many.

    Parameters
    ----------
    values, mask : (R, T, M)
        Cycles, own units, and where they are observed.
    scale : (M,)
        Of the channels in the components.
    subject : (R,)
        Index of each cycle's.
    count : int
        Components.
    proportions : Proportions
        The body on which joints are compared, of an adult's mean stature.
    """
    people = int(subject.max()) + 1
    if not LEAST_SUBJECTS <= people <= MOST_SUBJECTS or len(values) > MOST_CYCLES:
        return None

    def learnt(rows: Rows) -> fpca.Components:
        return fpca.fit(values[rows] * scale, mask[rows], min(count, int(rows.sum()) - 1))

    def left(components: fpca.Components, rows: Rows) -> tuple[float, float]:
        told = _told(components, values[rows] * scale, mask[rows]) / scale
        data, seen, angles = values[rows], mask[rows], slice(len(ANGLES))
        off = (told - data)[:, :, angles][seen[:, :, angles]]
        whole = seen[:, :, angles].all(axis=2)
        away = _joints(told[whole], proportions) - _joints(data[whole], proportions)
        return (
            float(np.degrees(np.sqrt(np.mean(off**2)))) if len(off) else np.nan,
            1000 * ADULT_STATURE[0] * float(np.linalg.norm(away, axis=2).mean()) if len(away) else np.nan,
        )

    own = [subject == i for i in range(people)]
    together = learnt(np.ones(len(subject), bool))
    found = np.array([[left(together, rows) for rows in own], [left(learnt(~rows), rows) for rows in own]])
    return SubjectResiduals(found[:, :, 0], found[:, :, 1])


def _told(components: fpca.Components, values: Floats, mask: Rows) -> Floats:
    """Mean and components nearest to what is seen of rows (R, T, M)."""
    told = np.empty_like(values)
    for row, seen, nearest in zip(values, mask, told, strict=True):
        basis = components.curves[:, seen].T
        scores = np.linalg.lstsq(basis, (row - components.mean)[seen], rcond=None)[0]
        nearest[:] = components.mean + np.tensordot(scores, components.curves, 1)
    return told


def _joints(channels: Floats, proportions: Proportions) -> Floats:
    """Places (n, 14, 3) from the pelvis along its axes, statures, of channels (n, M)."""
    still = channels.copy()
    still[:, len(ANGLES) :] = 0
    return points(default_skeleton(proportions).sections(), still)[:, COMPARED]
