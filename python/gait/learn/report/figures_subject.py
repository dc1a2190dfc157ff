"""Figure of the errors by subject: with the subject among the training set, and left out of it."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from gait.report.colours import BLUE, ORANGE
from gait.learn.prior.between import ADULT_STATURE
from gait.learn.prior.fit import Learned
from gait.learn.report.figures_base import grid

CAPTION = (
    "What mean and plain components cannot follow, with the subject among those learnt from and learnt from "
    "the others only. Left: root mean square over the angles. Right: mean distance of 14 joints with the "
    f"pelvis aligned, the angles given to one body of mean proportions, {ADULT_STATURE[0]:.2f} m tall."
)


def errors(learned: Learned) -> Figure | None:
    """Draw both residuals per subject; None if they are too few, or too many to fit again for each."""
    found = learned.by_subject
    if found is None:
        return None
    count = len(learned.subjects)
    figure, panels = grid(1, 2, 9, 0.3 * count + 1.3, sharey="all")
    rows = np.arange(count)
    units = {"angles, degrees (rms)": found.degrees, "joints, mm (mean)": found.millimetres}
    for axes, (unit, (within, without)) in zip(panels, units.items(), strict=True):
        axes.hlines(rows, within, without, color="#cccccc", lw=2, zorder=1)
        axes.plot(within, rows, "o", color=BLUE, label="learnt from")
        axes.plot(without, rows, "o", color=ORANGE, label="left out")
        axes.set(xlabel=f"residual: {unit}", xlim=(0, None), ylim=(count - 0.5, -0.5))
    panels[0].set_yticks(rows, learned.subjects)
    panels[0].set_ylabel("subject")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=2, fontsize=8, frameon=False
    )
    return figure
