"""Figure of the errors by subject: with the subject among the training set, and left out of it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from gait.learn import fpca
from gait.learn.figures_base import BLUE, ORANGE, grid
from gait.learn.fit import Learned
from gait.skeleton import ANGLES

Rows = npt.NDArray[np.bool_]

CAPTION = (
    "Root mean square over the angles of what mean and plain components cannot follow: with the subject "
    "among those learnt from, and learnt from the others only."
)
MOST_SUBJECTS = 12  # each costs a fit
MOST_CYCLES = 600


def errors(learned: Learned) -> Figure | None:
    """Draw both residuals per subject; None if they are too few, or too many to fit again for each."""
    count = len(learned.subjects)
    if not 3 <= count <= MOST_SUBJECTS or len(learned.cycles.values) > MOST_CYCLES:
        return None
    everybody = np.ones(len(learned.row_subject), bool)
    own = [learned.row_subject == i for i in range(count)]
    together = _components(learned, everybody)
    within = [_rest(learned, together, rows) for rows in own]
    without = [_rest(learned, _components(learned, ~rows), rows) for rows in own]
    figure, (axes,) = grid(1, 1, 7, 0.3 * count + 1.3)
    rows = np.arange(count)
    axes.hlines(rows, within, without, color="#cccccc", lw=2, zorder=1)
    axes.plot(within, rows, "o", color=BLUE, label="learnt from")
    axes.plot(without, rows, "o", color=ORANGE, label="left out")
    axes.set_yticks(rows, learned.subjects)
    axes.set(xlabel="residual, degrees (rms)", ylabel="subject", xlim=(0, None), ylim=(count - 0.5, -0.5))
    figure.legend(loc="outside upper right", ncols=2, fontsize=8, frameon=False)
    return figure


def _components(learned: Learned, rows: Rows) -> fpca.Components:
    """Components of some cycles, as many as the model has."""
    count = min(len(learned.components.sd), int(rows.sum()) - 1)
    return fpca.fit(learned.cycles.values[rows] * learned.scale, learned.cycles.mask[rows], count)


def _rest(learned: Learned, model: fpca.Components, rows: Rows) -> float:
    """Degrees (rms of the angles) that mean and components leave after least squares over what was seen."""
    left = np.full_like(learned.cycles.values[rows], np.nan)
    data = learned.cycles.values[rows] * learned.scale - model.mean
    for off, seen, rest in zip(data, learned.cycles.mask[rows], left, strict=True):
        basis = model.curves[:, seen].T
        rest[seen] = off[seen] - basis @ np.linalg.lstsq(basis, off[seen], rcond=None)[0]
    own = (left / learned.scale)[:, :, : len(ANGLES)]
    return float(np.degrees(np.sqrt(np.nanmean(own**2)))) if np.isfinite(own).any() else float("nan")
