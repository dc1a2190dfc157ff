"""The whole of learning: sequences to mean curves, components and statistics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES, CHANNELS, Proportions, default_skeleton, points
from gait.errors import UserError
from gait.learn.cycles import align, cycles
from gait.learn.cycles.sequence import Sequence
from gait.learn.model_options import DEFAULT_COMPONENTS
from gait.learn.prior import fpca, ground, lengths, pace, prior, rank, unseen
from gait.learn.prior.subject_residuals import SubjectResiduals, subject_residuals
from gait.learn.solve import retarget
from gait.learn.spool import by_rows, release, stored

Floats = npt.NDArray[np.float64]

SAMPLES = 120  # phases of a cycle: five components take less than 100 kB
MOST_NAMES = 4  # of files in a message
#: Radians that one unit of a root channel counts for in the components: a displacement of a stature is as
#: much as the leg's turn by 1 / 0.3 rad (a leg's angle moves the joints below it by about 0.3 statures per
#: radian).
ROOT_SCALE = {"root_forward": 1.0, "root_sway": 3.3, "root_height": 3.3}


@dataclass
class Residuals:
    """What the components leave of the cycles.

    Attributes
    ----------
    squares : (R, M)
        Sum of the squares over the phases observed.
    count : (R, M)
        How many these are.
    """

    squares: Floats
    count: npt.NDArray[np.intp]

    def rms(self, rows: Any = slice(None), columns: Any = slice(None)) -> float:
        """Root mean square over all entries of some rows and channels; NaN if there are none."""
        count = int(self.count[rows][:, columns].sum())
        return float(np.sqrt(np.sum(self.squares[rows][:, columns]) / count)) if count else float("nan")


@dataclass
class Learned:
    """Everything that `gait learn` knows about a set of sequences.

    Attributes
    ----------
    sequences : list of Sequence
    subjects : list of str
        Sorted names; `subject_index` (n,) gives each sequence's.
    proportions : Proportions
    alignment : align.Alignment
        Offsets with phase 0 at the right heel strike.
    cycles : cycles.Cycles
        Rows of the analysis, channels in their own units.
    components : fpca.Components
        In the channels' own units; gaps are filled in units scaled by `scale` (M,), and `rmse` is in those.
        Mean, components and scores are of the cycles as they would be at the mean stride rate.
    pace_curve : (T, M)
        How the mean curves follow the stride rate (PACE is its series); 0 in the paper's model.
    paces : (n,)
        Pace of each sequence.
    lengths : (p, F + 1)
        PROP: how limbs differ in length among people of one stature; no rows in the paper's model.
    shifts : (p, F, 3)
        SHFT: how origins of frames (the shoulders') differ besides.
    static : (M,)
        Standard deviation over subjects of a person's constant offsets from the model.
    held_out : (n,)
        Error on held-out blocks for 0, 1 ... components, scaled units; empty unless chosen automatically.
    """

    sequences: list[Sequence]
    subjects: list[str]
    subject_index: npt.NDArray[np.intp]
    proportions: Proportions
    alignment: align.Alignment
    cycles: cycles.Cycles
    components: fpca.Components
    pace_curve: Floats
    paces: Floats
    scale: Floats
    held_out: Floats
    lengths: Floats
    shifts: Floats
    static: Floats

    @property
    def curves(self) -> Floats:
        """CURV: mean, then components times their standard deviation, (1 + q, T, M), own units."""
        c = self.components
        return np.concatenate([c.mean[None], c.curves * c.sd[:, None, None]])

    @cached_property
    def residuals(self) -> Residuals:
        """Data minus reconstruction over the observed phases, own units."""
        values, mask = self.cycles.values, self.cycles.mask
        squares = np.empty((len(values), values.shape[2]))
        for part in by_rows(values):
            told = self.components.reconstruct(part)
            told += self.paces[self.cycles.sequence[part], None, None] * self.pace_curve
            rest = np.where(mask[part], values[part] - told, 0.0)
            squares[part] = np.sum(rest**2, axis=1)
        return Residuals(squares, mask.sum(axis=1))

    @cached_property
    def by_subject(self) -> SubjectResiduals | None:
        """What is left of each subject; None if they are too few or too many.  It costs a fit for each."""
        values, mask, components = self.cycles.values, self.cycles.mask, len(self.components.sd)
        return subject_residuals(values, mask, self.scale, self.row_subject, components, self.proportions)

    @property
    def row_subject(self) -> npt.NDArray[np.intp]:
        """Subject index of each row of the analysis."""
        return self.subject_index[self.cycles.sequence]


def channel_scale() -> Floats:
    """Scale (M,) of the channels in the components."""
    return np.array([ROOT_SCALE.get(name, 1.0) for name in CHANNELS])


def fit(
    sequences: list[Sequence],
    components: int | str | None = None,
    seed: int = 1,
    kind: str = "people",
    others: list[retarget.Measures] | None = None,
) -> Learned:
    """Learn the cyclic model of prepared sequences.

    Parameters
    ----------
    components : int, "auto" or None
        None: DEFAULT_COMPONENTS, or two less than there are cycles if that is fewer.
    kind : "people" or "paper"
        The prior that reaches people who were not recorded (`gait.learn.prior.prior`), or the paper's
        components of the recorded cycles and one body for everybody.
    others : list of Measures, optional
        Bodies of people whose motion is not learnt: they tell how proportions differ.

    Raises
    ------
    UserError
        If there are too few cycles for the components asked for.
    """
    subjects = sorted({s.subject for s in sequences})
    index = np.array([subjects.index(s.subject) for s in sequences])
    proportions = _mean_body(sequences, index, len(subjects))
    signals = [s.channels for s in sequences]
    periods = np.array([s.period.frames for s in sequences])
    alignment = align.align([z[:, : len(ANGLES)] for z in signals], periods, hips=align.HIPS)
    start = heel_strike(align.common_curve(signals, periods, alignment.offsets), proportions)
    alignment.offsets = (alignment.offsets + start * periods) % periods
    release(*signals)
    rows = cycles.slice_cycles(signals, periods, alignment.offsets, SAMPLES)
    wanted = most_components(len(rows.values), components, [str(s.source) for s in sequences])
    scale = channel_scale()
    scaled, held_out = _times(rows.values, scale), np.zeros(0)
    if components == "auto":
        rng = np.random.default_rng(seed)
        wanted, held_out = rank.choose(scaled, rows.mask, rng, index[rows.sequence], largest=wanted)
    model = _own_units(fpca.fit(scaled, rows.mask, wanted), scale)
    row_subject = np.unique(index[rows.sequence], return_inverse=True)[1]
    metric = prior.joint_metric(model.mean, proportions)
    paces = pace.of(sequences, index)
    slope, even = np.zeros(model.mean.shape), model.filled
    if kind == "people":
        whole = unseen.bounded(model.filled, rows.mask, row_subject)
        slope = pace.slope(whole, row_subject, paces[rows.sequence])
        even = pace.without(whole, paces[rows.sequence], slope)
        model = prior.refine(model, even, row_subject, wanted, metric)
    static = prior.static_spread(even, row_subject, wanted, metric)
    model = ground.grounded(model, rows.seen, proportions)
    bodies = [*_bodies(sequences, index, len(subjects)), *(others or [])] if kind == "people" else []
    table, shifts = lengths.learn(bodies, proportions, model.mean)
    return Learned(
        sequences=sequences,
        subjects=subjects,
        subject_index=index,
        proportions=proportions,
        alignment=alignment,
        cycles=rows,
        components=model,
        pace_curve=slope,
        paces=paces,
        scale=scale,
        held_out=held_out,
        lengths=table,
        shifts=shifts,
        static=static,
    )


def most_components(cycles: int, wanted: int | str | None, files: list[str] | None = None) -> int:
    """Components to learn from so many cycles of these files; with "auto", to try.

    Raises
    ------
    UserError
        If there are too few cycles for the number asked for, or for any.
    """
    allowed = cycles - 2
    if isinstance(wanted, int):
        least = wanted
    else:
        least, wanted = 1, min(rank.LARGEST if wanted == "auto" else DEFAULT_COMPONENTS, allowed)
    if allowed < least:
        what = "1 component" if least == 1 else f"{least} components"
        more = f" or ask for {allowed} at most" if allowed >= 1 else ", 3 cycles at least"
        named = " ".join((files or [])[:MOST_NAMES]) + (" ..." if len(files or []) > MOST_NAMES else "")
        held = "1 cycle is" if cycles == 1 else f"{cycles} cycles are"
        raise UserError(f"{named}{': ' * bool(named)}{held} too few for {what}; add recordings{more}")
    return wanted


def _own_units(c: fpca.Components, scale: Floats) -> fpca.Components:
    """Components of scaled channels in the channels' own units."""
    return replace(c, mean=c.mean / scale, curves=c.curves / scale, filled=_times(c.filled, 1 / scale))


def _times(rows: Floats, scale: Floats) -> Floats:
    """Put rows (R, T, M) times the scale (M,) of their channels on disk."""
    return stored((rows[part] * scale for part in by_rows(rows)), rows.shape[1:])


def _mean_body(sequences: list[Sequence], index: npt.NDArray[np.intp], subjects: int) -> Proportions:
    """Average the proportions; every subject counts once."""
    return retarget.generic_proportions(_bodies(sequences, index, subjects))


def _bodies(
    sequences: list[Sequence], index: npt.NDArray[np.intp], subjects: int
) -> list[retarget.Measures | None]:
    """One body of each subject: of the recordings, the first that shows most of it and that most agree on."""

    def known(s: Sequence) -> tuple[int, int]:
        return retarget.known_parts(s.measures), s.recordings

    return [
        max((s for s, k in zip(sequences, index, strict=True) if k == i), key=known).measures
        for i in range(subjects)
    ]


def heel_strike(curve: Floats, proportions: Proportions) -> float:
    """Phase at which the right heel is farthest ahead of the pelvis in a mean curve (n, M).

    Where nobody has the angles of the right leg it is the phase at which the hips are farthest apart.
    """
    sections = default_skeleton(proportions).sections()
    joints = default_skeleton(proportions).points
    forward = points(sections, curve)[:, joints.index("r_heel"), 0]
    if not np.isfinite(forward).all():
        return align.hip_phase(curve)
    n, top = len(forward), int(np.argmax(forward))
    left, peak, right = forward[[top - 1, top, (top + 1) % n]]
    return float((top + 0.5 * (left - right) / (left - 2 * peak + right)) / n)
