#!/usr/bin/env python3
"""How much smaller a segment's posterior is than its prior, by the noise of one parallel view (F5).

    make eval-lift, or lift_volume.py

The volumes do not depend on the observed positions, only on the direction of view and the noise.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import eval_clips
import numpy as np
import table
from lift_mocap import AXES, ONE_OF_EACH, HeldOut, one_of_each
from scipy.optimize import brentq

from gait.bindings.lifter import Lifter
from gait.lift.keypoints.observations import Observations
from gait.lift.report.segment_figures import placed_as_learnt
from gait.lift.smooth.rows import orthographic

sys.path.insert(0, str(Path(__file__).parents[1] / "reference"))

from segment_posterior import Gaussian, Posterior, infer, place

NOISE = (0.005, 0.010, 0.020, 0.050, 0.100, 0.200, 0.500, 1.000)  # metres
PAPER = -14.0  # the paper's volume; the paper does not state the noise
EXACT = 1e-9  # largest relative error of the volume compared with the closed form


def main() -> int:
    """Publish the table; exit code 1 if a volume is not the closed form or does not grow with the noise."""
    if eval_clips.absent():
        return 0
    rows = []
    for source, known in one_of_each():
        rows += _curve(source, known)
    _publish(rows)
    return any("NO" in row for row in rows)


def _curve(source: str, known: HeldOut) -> Iterator[list[object]]:
    """Rows of a prior: the volume at each noise, then the noise that gives the paper's volume."""
    gaussian = place(known.prior, stature=known.stature, ground_sd=0.0, height_sd=0.0)
    plain = replace(gaussian, residual=np.zeros_like(gaussian.residual))
    s = np.linalg.svd(_observed(plain, 1.0).system.design, compute_uv=False)  # metres
    papers = float(brentq(lambda sd: _closed(s, sd) - PAPER, NOISE[0] / 10, 10 * NOISE[-1]))
    last = -np.inf
    for sd in (*NOISE, papers):
        volume, closed = _lifted(known, sd, residual=0.0), _closed(s, sd)
        met = abs(volume - closed) <= EXACT * abs(closed) and (sd == papers or volume > last)
        last = volume
        yield [
            *("F5", source, len(s), 1000 * sd, volume, _observed(plain, sd).resolved, int((s > sd).sum())),
            *(_lifted(known, sd), _observed(gaussian, sd).resolved, "yes" if met else "NO"),
        ]


def _closed(s: np.ndarray, sd: float) -> float:
    return float(-0.5 * np.log10(1 + (s / sd) ** 2).sum())


def _observed(gaussian: Gaussian, sd: float) -> Posterior:
    """Posterior of the mean segment, seen from the side."""
    uv = gaussian.mean @ AXES.T
    return infer(gaussian, orthographic(Observations(uv, np.full(uv.shape[:2], sd)), AXES))


def _lifted(known: HeldOut, sd: float, **changes: float) -> float:
    """log10 of the volume that the C core computes."""
    lifter = Lifter(known.model, AXES, placed_as_learnt(known.stature, **changes))
    return lifter.segment(known.stature * known.prior.mean[0] @ AXES.T, sd).log10_volume


def _publish(rows: list[list[object]]) -> None:
    note = (
        "All markers of a segment of half a second are seen in one parallel view from the side; heading "
        f"and place are known. The priors are learnt without {ONE_OF_EACH[0]} and without "
        f"{ONE_OF_EACH[1]}.\n\n"
        "- volume: log10 of sqrt(det Q / det Lambda), the posterior's volume divided by the prior's, "
        "from the C core without variation outside the modes, as in the paper\n"
        f"- met: the volume equals -1/2 sum log10(1 + s^2/noise^2) to {EXACT:g}, where s are the singular "
        "values of P U Lambda^1/2, and grows with the noise\n"
        "- slope: derivative of the volume with respect to log10 of the noise; it is modes - tr Q = sum "
        "s^2/(s^2 + noise^2), to which a mode contributes 1 if it is resolved and 0 if not\n"
        "- above: number of modes whose s is above the noise\n"
        "- as used, resolved: the volume and modes - tr Q with variation outside the modes, which limits "
        "both however small the noise is\n\n"
        f"The last row of each prior is the noise that gives the paper's volume of {PAPER:g}."
    )
    head = ["measure", "prior", "modes", "noise mm", "volume", "slope", "above", "as used", "resolved", "met"]
    table.publish("lift_volume", "Volume of the posterior by the noise", head, rows, note)


if __name__ == "__main__":
    sys.exit(main())
