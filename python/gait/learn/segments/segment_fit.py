"""Segments of a corpus to the prior over them: mean, modes, what lies outside, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.errors import UserError
from gait.learn.segment_options import Segments
from gait.learn.segments import segment_heldout, segment_mixture
from gait.learn.segments.segment_basis import Basis, basis, filled
from gait.learn.segments.segment_corpus import Recorded, Table, tabulate
from gait.learn.segments.segment_heldout import Fitted

Floats = npt.NDArray[np.float64]

FEWEST = 8  # segments
EACH = 4  # segments that a mode needs: with more modes they are learnt by heart
USUAL_STATURE = 1.70  # metres, where no recording shows one


def fit(recordings: Sequence[Recorded], wanted: Segments) -> SegmentPrior:
    """Learn the prior of recordings.

    Raises
    ------
    UserError
        If there are too few segments.
    """
    table = tabulate(recordings, wanted)
    real = int(table.real.sum()) // max(wanted.headings, 1)
    if real < FEWEST:
        seconds = wanted.frames / wanted.fps
        raise UserError(
            f"the recordings hold {real} segments of {seconds:g} s, fewer than {FEWEST}; add recordings, "
            "or leave the prior out (--segments none)"
        )
    modes = min(wanted.modes, max(1, real // EACH))
    found = basis(filled(table.rows, modes), len(table.names))
    everyone = segment_heldout.fitted(found, np.ones(len(table.rows), bool), modes)
    folds = segment_heldout.groups(table.subject, table.recording)
    others = (segment_heldout.fitted(found, ~gone, modes) for gone in folds)
    gamma = segment_heldout.gamma(
        [
            segment_heldout.fold(found, model, gone & table.real)
            for model, gone in zip(others, folds, strict=True)
        ]
    )
    mixture = segment_mixture.choose(found, everyone, folds, table.real, wanted.mixture)
    return _prior(table, found, everyone, mixture, gamma, wanted, real)


def _prior(
    table: Table,
    found: Basis,
    model: Fitted,
    mixture: segment_mixture.Mixture,
    gamma: float,
    wanted: Segments,
    real: int,
) -> SegmentPrior:
    """Put the parts into statures, every component's modes by their own variance."""
    shape, means, modes, deviations = (wanted.frames, len(table.names), 3), [], [], []
    for centre, covariance in zip(mixture.means, mixture.covariances, strict=True):
        values, turn = np.linalg.eigh(covariance)
        sd = np.sqrt(np.maximum(values[::-1], 0))
        axes = found.directions @ (model.vectors @ turn[:, ::-1])
        axes = axes * np.sign(axes[np.abs(axes).argmax(axis=0), np.arange(len(sd))])
        means.append((found.mean + found.directions @ (model.mean + model.vectors @ centre)).reshape(shape))
        modes.append((axes * sd).T.reshape(-1, *shape))
        deviations.append(sd)
    statures = [r.stature for r in table.recordings if np.isfinite(r.stature)]
    count = len(mixture.weights)
    return SegmentPrior(
        names=table.names,
        hop=wanted.hop,
        fps=wanted.fps,
        headings=wanted.headings,
        weights=mixture.weights,
        mean=np.array(means),
        modes=np.array(modes),
        sd=np.array(deviations),
        residual=np.tile(model.residual, (count, 1)),
        gamma=gamma,
        stature=float(np.mean(statures)) if statures else USUAL_STATURE,
        segments=real,
        recordings=len(table.recordings),
    )
