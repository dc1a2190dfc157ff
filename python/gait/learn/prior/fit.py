"""Fit the cyclic model: from prepared sequences to mean curves, components and statistics."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gait.body.skeleton import (
    ANGLES,
    CHANNELS,
    EVAL15,
    JOINTS,
    PAPER_ANGLES,
    SIDES,
    Proportions,
    default_skeleton,
    points,
)
from gait.counts import count_of
from gait.errors import UserError
from gait.learn.arrays import Floats, Indices, Mask, by_rows, release, stored
from gait.learn.cycles import align, cutting
from gait.learn.cycles.fourier import decode, encode, fourier_basis
from gait.learn.cycles.sequence import Sequence
from gait.learn.options import DEFAULT, DEFAULT_COMPONENTS, PAPER_COMPONENTS, LearnOptions
from gait.learn.prior import components, iterated_svd, lengths, people, rank
from gait.learn.prior.components import Components
from gait.learn.prior.people import ADULT_STATURE
from gait.learn.solve.retarget import Measures, generic_proportions, known_parts

CYCLE_SAMPLES = 120  # phases of a cycle; five components take less than 100 kB
MOST_NAMED_FILES = 4  # most files in a message
#: Weight of a unit of a root channel in the components, in radians: a displacement by one stature counts like
#: a rotation of the leg by 1 / 0.3 rad (a leg's angle moves the joints below it by about 0.3 statures per
#: radian).
ROOT_SCALE = {"root_forward": 1.0, "root_sway": 3.3, "root_height": 3.3}
HEIGHT_COLUMN, FORWARD_COLUMN = CHANNELS.index("root_height"), CHANNELS.index("root_forward")
HEIGHT_HARMONICS = 4  # of the pelvis's height within a stride
USUAL_STRIDE = 0.8  # statures, if the legs show no plausible one
PLAUSIBLE_STRIDE = (0.3, 1.6)  # statures
LEAST_SUBJECTS, MOST_SUBJECTS = 3, 12  # of `Learned.by_subject`; each costs a fit
MOST_COMPARED_CYCLES = 600
COMPARED_JOINTS = [JOINTS.index(name) for name in EVAL15 if name != "pelvis"]


@dataclass
class Residuals:
    """Residuals of R cycles about the components."""

    squares: Floats  #: (R, M) sum of the squares over the observed phases
    count: Indices  #: (R, M) number of observed phases

    def rms(self, rows: Any = slice(None), columns: Any = slice(None)) -> float:
        """Return the rms over all entries of some rows and channels; NaN if there are none."""
        count = int(self.count[rows][:, columns].sum())
        return float(np.sqrt(np.sum(self.squares[rows][:, columns]) / count)) if count else float("nan")


@dataclass(frozen=True)
class SubjectResiduals:
    """Errors of n subjects with the model of all (row 0) and of all others (row 1); NaN if unknown."""

    degrees: Floats  #: (2, n) rms over the angles
    #: (2, n) mean distance of 14 joints, on the same body and with the pelvis aligned (position and
    #: orientation), over the phases at which all angles are visible.
    millimetres: Floats


@dataclass
class Learned:
    """Everything that `gait learn` learns from n sequences."""

    sequences: list[Sequence]
    subjects: list[str]  #: sorted names
    subject_index: Indices  #: (n,) subject of each sequence
    proportions: Proportions
    alignment: align.Alignment  #: offsets with phase 0 at the right heel strike
    cycles: cutting.Cycles  #: rows of the analysis, channels in their own units
    #: In the channels' own units (but gaps are filled, and `rmse` is given, in units of `scale`); mean,
    #: components and scores are those of the cycles converted to the mean stride rate.
    components: Components
    pace_curve: Floats  #: (T, M) dependence of the mean curves on the stride rate; 0 in the paper's model
    paces: Floats  #: (n,) pace of each sequence
    scale: Floats  #: (M,)
    held_out: Floats  #: error on held-out data for 0, 1 ... components, scaled units; empty unless "auto"
    lengths: Floats  #: (p, F + 1) section PROP: variation of limb lengths; empty in the paper's model
    shifts: Floats  #: (p, F, 3) section SHFT: additional variation of the shoulders' origins
    lasting: Floats  #: (people, M) constant offsets of people from a model of the others
    paper: bool = False  #: whether the components are the paper's, of 19 angles, the other channels constant

    @property
    def curves(self) -> Floats:
        """Section CURV: mean, then components times their standard deviation, (1 + q, T, M), own units."""
        c = self.components
        return np.concatenate([c.mean[None], c.curves * c.sd[:, None, None]])

    @property
    def static(self) -> Floats:
        """Standard deviations (M,) over people of their constant offsets."""
        return np.asarray(np.sqrt(np.mean(np.square(self.lasting), axis=0)))

    @cached_property
    def residuals(self) -> Residuals:
        """Data minus reconstruction over the observed phases, own units."""
        values, mask = self.cycles.values, self.cycles.mask
        squares = np.empty((len(values), values.shape[2]))
        for part in by_rows(values):
            model = self.components.reconstruct(part)
            model += self.paces[self.cycles.sequence[part], None, None] * self.pace_curve
            rest = np.where(mask[part], values[part] - model, 0.0)
            squares[part] = np.sum(rest**2, axis=1)
        return Residuals(squares, mask.sum(axis=1))

    @cached_property
    def by_subject(self) -> SubjectResiduals | None:
        """Residuals of each subject; None if they are too few or too many, as each costs a fit."""
        return _subject_residuals(
            self.cycles, self.scale, self.row_subject, len(self.components.sd), self.proportions, self.paper
        )

    @property
    def row_subject(self) -> Indices:
        """Subject index of each row of the analysis."""
        return self.subject_index[self.cycles.sequence]


def channel_scale() -> Floats:
    """Return the scale (M,) of the channels in the components."""
    return np.array([ROOT_SCALE.get(name, 1.0) for name in CHANNELS])


def fit(
    sequences: list[Sequence], options: LearnOptions = DEFAULT, others: list[Measures] | None = None
) -> Learned:
    """Learn the cyclic model of prepared sequences.

    `others`: bodies of people whose motion is not learnt, which also show how proportions vary.  UserError if
    there are too few cycles for the components asked for.
    """
    subjects = sorted({s.subject for s in sequences})
    index = np.array([subjects.index(s.subject) for s in sequences])
    own = _bodies(sequences, index, len(subjects))
    proportions = generic_proportions(own)
    signals = [s.channels for s in sequences]
    periods = np.array([s.period.frames for s in sequences])
    paper = options.prior == "paper"
    alignment = _aligned(signals, periods, paper)
    start = heel_strike(align.common_curve(signals, periods, alignment.offsets), proportions)
    alignment.offsets = (alignment.offsets + start * periods) % periods
    release(*signals)
    rows = cutting.cut_cycles(signals, periods, alignment.offsets, CYCLE_SAMPLES, closing=not paper)
    asked = PAPER_COMPONENTS if paper and options.components is None else options.components
    wanted = most_components(len(rows.values), asked, [str(s.source) for s in sequences])
    scale = channel_scale()
    scaled, held_out = _times(rows.values, scale), np.zeros(0)
    if options.components == "auto":
        rng = np.random.default_rng(options.seed)
        wanted, held_out = rank.choose(scaled, rows.mask, rng, index[rows.sequence], largest=wanted)
    model = _own_units(_analysed(scaled, rows.mask, wanted, paper), scale)
    row_subject = np.unique(index[rows.sequence], return_inverse=True)[1]
    metric = people.joint_metric(model.mean, proportions)
    paces = people.paces(sequences, index)
    slope, even = np.zeros(model.mean.shape), model.filled
    if not paper:
        slope, even = _paces_removed(
            model.filled, rows.mask, row_subject, paces[rows.sequence], options.several
        )
        model = people.refine(model, even, row_subject, wanted, metric)
    lasting = people.lasting_offsets(even, row_subject, wanted, metric)
    model = grounded(model, rows.visible, proportions)
    bodies = [] if paper else [*own, *(others or [])]
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
        lasting=lasting,
        paper=paper,
    )


def _aligned(signals: list[Floats], periods: Floats, paper: bool) -> align.Alignment:
    """Align sequences (T, M) by their angles, or as the paper does: by its 19, equally weighted, from 0."""
    if not paper:
        return align.align([z[:, : len(ANGLES)] for z in signals], periods, hips=align.HIP_COLUMNS)
    count = len(PAPER_ANGLES)
    start, weights = np.zeros(len(signals)), np.ones(count)
    return align.align([z[:, :count] for z in signals], periods, start, align.HIP_COLUMNS, weights)


def _analysed(values: Floats, mask: Mask, count: int, paper: bool) -> Components:
    """Fill and analyse cycles (R, T, M); in paper mode only the paper's angles vary, the rest is constant."""
    if not paper:
        return components.fit(values, mask, count)
    angles = len(PAPER_ANGLES)
    found = components.fit(values[:, :, :angles], mask[:, :, :angles], count, fill=iterated_svd.complete)
    visible = mask[:, :, angles:]
    total = np.where(visible, values[:, :, angles:], 0.0).sum(axis=(0, 1))
    constant = total / np.maximum(visible.sum(axis=(0, 1)), 1)

    def widened(curves: Floats, rest: Floats) -> Floats:
        return np.concatenate([curves, np.broadcast_to(rest, (*curves.shape[:-1], len(rest)))], axis=-1)

    return replace(
        found,
        filled=stored((widened(found.filled[p], constant) for p in by_rows(values)), values.shape[1:]),
        mean=widened(found.mean, constant),
        curves=widened(found.curves, np.zeros(len(constant))),
    )


def _paces_removed(
    filled: Floats, mask: Mask, subject: Indices, paces: Floats, stride: bool
) -> tuple[Floats, Floats]:
    """Return the change of curves with the pace (T, M), and the cycles (R, T, M) at the mean pace."""
    whole = people.bounded(filled, mask, subject)
    slope = people.pace_slope(whole, subject, paces, stride=stride)
    return slope, people.at_mean_pace(whole, paces, slope)


def most_components(cycles: int, wanted: int | str | None, files: list[str] | None = None) -> int:
    """Return the number of components to learn (with "auto", to try) from this many cycles of these files.

    UserError if there are too few cycles for the number asked for, or for any.
    """
    allowed = cycles - 2
    if isinstance(wanted, int):
        least = wanted
    else:
        least, wanted = (
            1,
            min(rank.MOST_TRIED_COMPONENTS if wanted == "auto" else DEFAULT_COMPONENTS, allowed),
        )
    if allowed < least:
        more = f" or ask for {allowed} at most" if allowed >= 1 else ", 3 cycles at least"
        named = " ".join((files or [])[:MOST_NAMED_FILES]) + (
            " ..." if len(files or []) > MOST_NAMED_FILES else ""
        )
        held = f"{count_of(cycles, 'cycle')} {'is' if cycles == 1 else 'are'}"
        what = count_of(least, "component")
        raise UserError(f"{named}{': ' * bool(named)}{held} too few for {what}; add recordings{more}")
    return wanted


def _own_units(c: Components, scale: Floats) -> Components:
    """Convert components of scaled channels to the channels' own units."""
    return replace(c, mean=c.mean / scale, curves=c.curves / scale, filled=_times(c.filled, 1 / scale))


def _times(rows: Floats, scale: Floats) -> Floats:
    """Scale the channels of rows (R, T, M) by (M,), on disk."""
    return stored((rows[part] * scale for part in by_rows(rows)), rows.shape[1:])


def _bodies(sequences: list[Sequence], index: Indices, subjects: int) -> list[Measures | None]:
    """Return a body of each subject, from the first of the most complete and most consistent recordings."""

    def known(s: Sequence) -> tuple[int, int]:
        return known_parts(s.measures), s.recordings

    return [
        max((s for s, k in zip(sequences, index, strict=True) if k == i), key=known).measures
        for i in range(subjects)
    ]


def heel_strike(curve: Floats, proportions: Proportions) -> float:
    """Return the phase of a mean curve (n, M) at which the right heel is farthest ahead of the pelvis.

    Without angles of the right leg it is the phase at which the hips are farthest apart.
    """
    sections = default_skeleton(proportions).sections()
    joints = default_skeleton(proportions).points
    forward = points(sections, curve)[:, joints.index("r_heel"), 0]
    if not np.isfinite(forward).all():
        return align.hip_phase(curve)
    n, top = len(forward), int(np.argmax(forward))
    left, peak, right = forward[[top - 1, top, (top + 1) % n]]
    return float((top + 0.5 * (left - right) / (left - 2 * peak + right)) / n)


def made_up_channels(visible: Mask) -> list[str]:
    """Return the root channels that `grounded` must compute, given the channels (M,) observed."""
    return [CHANNELS[c] for c in (HEIGHT_COLUMN, FORWARD_COLUMN) if not visible[c]]


def grounded(model: Components, visible: Mask, proportions: Proportions) -> Components:
    """Set height and speed of the pelvis in mean curves, own units, if no recording (M,) shows them."""
    if not made_up_channels(visible):
        return model
    mean = model.mean.copy()
    height, stride = _from_legs(mean, proportions)
    if not visible[HEIGHT_COLUMN]:
        mean[:, HEIGHT_COLUMN] = height
    if not visible[FORWARD_COLUMN]:
        mean[:, FORWARD_COLUMN] = stride
    return replace(model, mean=mean)


def _from_legs(mean: Floats, proportions: Proportions) -> tuple[Floats, float]:
    """Return the height of the pelvis (T,), statures, and statures per stride, of mean curves (T, M).

    The lowest toe or heel is assumed to be on the ground.  The speed is the median speed at which it moves
    back under the pelvis, or `USUAL_STRIDE` if that is implausible, as for a person who marches in place.
    """
    skeleton = default_skeleton(proportions)
    over = {"toe": proportions.sole + proportions.toe[2], "heel": proportions.sole + proportions.heel[2]}
    feet = [skeleton.points.index(f"{s}_{name}") for s in SIDES for name in over]
    place = points(skeleton.sections(), mean)[:, feet]
    below = place[:, :, 2] - np.tile(list(over.values()), len(SIDES))
    basis = fourier_basis(len(mean), HEIGHT_HARMONICS)
    height = decode(encode(-below.min(axis=1)[None, :, None], basis), basis, 1)[0, :, 0]
    ahead = place[:, :, 0]
    speed = (np.roll(ahead, 1, axis=0) - np.roll(ahead, -1, axis=0)) / 2 * len(mean)
    stride = float(np.median(np.take_along_axis(speed, below.argmin(axis=1)[:, None], axis=1)))
    return height, stride if PLAUSIBLE_STRIDE[0] <= stride <= PLAUSIBLE_STRIDE[1] else USUAL_STRIDE


def _subject_residuals(
    rows: cutting.Cycles,
    scale: Floats,
    subject: Indices,
    count: int,
    proportions: Proportions,
    paper: bool = False,
) -> SubjectResiduals | None:
    """Fit the components of all, and of all but each subject; `proportions`: of the body for comparison."""
    values, mask = rows.values, rows.mask
    number = int(subject.max()) + 1
    if not LEAST_SUBJECTS <= number <= MOST_SUBJECTS or len(values) > MOST_COMPARED_CYCLES:
        return None

    def learnt(some: Mask) -> Components:
        most = min(count, int(some.sum()) - 1)
        return _analysed(values[some] * scale, mask[some], most, paper)

    def left(model: Components, some: Mask) -> tuple[float, float]:
        nearest = _nearest(model, values[some] * scale, mask[some]) / scale
        data, visible, angles = values[some], mask[some], slice(len(ANGLES))
        off = (nearest - data)[:, :, angles][visible[:, :, angles]]
        whole = visible[:, :, angles].all(axis=2)
        away = _joints(nearest[whole], proportions) - _joints(data[whole], proportions)
        return (
            float(np.degrees(np.sqrt(np.mean(off**2)))) if len(off) else np.nan,
            1000 * ADULT_STATURE[0] * float(np.linalg.norm(away, axis=2).mean()) if len(away) else np.nan,
        )

    own = [subject == i for i in range(number)]
    together = learnt(np.ones(len(subject), bool))
    found = np.array([[left(together, some) for some in own], [left(learnt(~some), some) for some in own]])
    return SubjectResiduals(found[:, :, 0], found[:, :, 1])


def _nearest(model: Components, values: Floats, mask: Mask) -> Floats:
    """Return the mean and components nearest to what is observed of rows (R, T, M)."""
    result = np.empty_like(values)
    for row, visible, nearest in zip(values, mask, result, strict=True):
        basis = model.curves[:, visible].T
        scores = np.linalg.lstsq(basis, (row - model.mean)[visible], rcond=None)[0]
        nearest[:] = model.mean + np.tensordot(scores, model.curves, 1)
    return result


def _joints(channels: Floats, proportions: Proportions) -> Floats:
    """Return joints (n, 14, 3) in the axes of the pelvis, statures, of channels (n, M)."""
    still = channels.copy()
    still[:, len(ANGLES) :] = 0
    return points(default_skeleton(proportions).sections(), still)[:, COMPARED_JOINTS]
