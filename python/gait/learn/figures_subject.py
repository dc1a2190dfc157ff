"""Figure of the errors by subject: with the subject among the training set, and left out of it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gait.learn import fpca
from gait.learn.figures_base import BLUE, ORANGE, Floats, grid
from gait.learn.fit import Learned
from gait.skeleton import ANGLES

CAPTION = (
    "Root mean square over the angles of what mean and components cannot follow: with the subject among "
    "those learnt from, and learnt from the others only."
)
MOST_SUBJECTS = 12  # each costs a fit
MOST_CYCLES = 600


def errors(learned: Learned) -> Figure | None:
    """Draw both residuals per subject; None if they are too few, or too many to fit again for each."""
    count = len(learned.subjects)
    if not 3 <= count <= MOST_SUBJECTS or len(learned.cycles.values) > MOST_CYCLES:
        return None
    within = [_rms(learned.residuals[learned.row_subject == i]) for i in range(count)]
    without = [_left_out(learned, i) for i in range(count)]
    figure, (axes,) = grid(1, 1, 7, 0.3 * count + 1.3)
    rows = np.arange(count)
    axes.hlines(rows, within, without, color="#cccccc", lw=2, zorder=1)
    axes.plot(within, rows, "o", color=BLUE, label="learnt from")
    axes.plot(without, rows, "o", color=ORANGE, label="left out")
    axes.set_yticks(rows, learned.subjects)
    axes.set(xlabel="residual, degrees (rms)", ylabel="subject", xlim=(0, None), ylim=(count - 0.5, -0.5))
    figure.legend(loc="outside upper right", ncols=2, fontsize=8, frameon=False)
    return figure


def _rms(residuals: Floats) -> float:
    """Root mean square over the angles of what is not NaN, degrees."""
    own = residuals[:, :, : len(ANGLES)]
    return float(np.degrees(np.sqrt(np.nanmean(own**2)))) if np.isfinite(own).any() else float("nan")


def _left_out(learned: Learned, subject: int) -> float:
    """Residual of a subject's cycles in the components of the others' cycles."""
    values, mask, own = (
        learned.cycles.values * learned.scale,
        learned.cycles.mask,
        learned.row_subject == subject,
    )
    others = fpca.fit(values[~own], mask[~own], min(len(learned.components.sd), int((~own).sum()) - 1))
    rest = np.full_like(values[own], np.nan)
    for row, seen, left in zip(values[own], mask[own], rest, strict=True):
        basis = others.curves[:, seen].T
        scores = np.linalg.lstsq(basis, (row - others.mean)[seen], rcond=None)[0]
        left[seen] = (row - others.mean)[seen] - basis @ scores
    return _rms(rest / learned.scale)
