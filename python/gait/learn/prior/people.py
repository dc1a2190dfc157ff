"""A prior over people's walks that also covers people who were not recorded.

The paper's components (`components`) describe the recorded cycles as well as possible.  With few subjects,
that is not the best for a new person, so the completed cycles are analysed again, together with their mirror
images (left and right swapped, half a cycle later), with equal weights of subjects, and with channels
weighted by how far they move the joints.  What the components of all others do not explain of a subject gives
the standard deviation of static offsets.

The mean cycle depends on the stride rate, as arms and legs swing further when a person walks faster.  People
differ at the same rate, and a person differs between rates; only the latter is regressed here.  The tracker's
state contains the rate anyway (as the paper's does, eq. 7), so this dependence needs no score.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gait.body.model_curves import pace, series, waves
from gait.body.skeleton import CHANNELS, Proportions, default_skeleton, other_sides, points
from gait.errors import UserError
from gait.learn.arrays import Floats, Indices, Mask, by_rows, release, stored
from gait.learn.cycles.fourier import CYCLE_HARMONICS, decode, encode, fourier_basis
from gait.learn.cycles.sequence import Sequence
from gait.learn.prior.components import Components
from gait.learn.prior.imputation import leading_vectors, right_singular

CHANNEL_STEP = 1e-4  # of numerical differentiation, radians or statures
SLOPE_RIDGE = 1e-5  # squared statures per squared unit; gives channels that move no joint a small weight
#: Weights of rotations of the whole body; low, as the particles have a heading, pitch and roll of their own.
TURNING = {"root_roll": 0.3, "root_pitch": 0.3, "root_yaw": 0.3}
#: Weights of root channels that displace the whole body, statures; root_forward is per stride.
DISPLACING = {"root_forward": 0.3, "root_sway": 1.0, "root_height": 1.0}
AGAINST = ("torso_x", "torso_z", "neck_x", "neck_z", "root_sway", "root_roll", "root_yaw")
RELATIVE_RATE_SD, RELATIVE_LENGTH_SD = 0.07, 0.06  # relative sd of stride rate and length among people
ADULT_STATURE = (1.70, 0.095)  # metres, mean and sd of adults of both sexes: a prior, not a training set's
FEWEST_SUBJECTS = 3  # fewest subjects from which differences between people are estimated
LEAST_RELATIVE_SD = 0.01  # least relative sd, even if all recordings are alike
#: Variance of the pace of one imaginary person whose gait does not change with the rate.  It shrinks the
#: slopes towards 0 if only a few people were recorded, or all at similar rates.
CONSTANT_GAIT_VARIANCE = 1.0
#: The length of the stride depends on the rate only in models of several classes, for people who change their
#: pace.  The default model leaves it to the components.
STRIDE = CHANNELS.index("root_forward")
#: Coefficients of a channel's Fourier series: a constant and ten harmonics, which keeps models small.  In a
#: person whose rate is one standard deviation off, higher harmonics would move joints by only 0.12 mm (rms,
#: `make eval-learn`).
TERMS = 21
#: Largest sum of a channel's coefficients, radians or statures per unit of pace; libgait refuses more.
STEEPEST_SLOPE = 1.0


def mirrored(rows: Floats) -> Floats:
    """Mirror cycles (R, T, M): left and right swapped, half a cycle later."""
    sign = [-1.0 if name in AGAINST else 1.0 for name in CHANNELS]
    return np.roll(rows[:, :, other_sides(CHANNELS)] * sign, rows.shape[1] // 2, axis=1)


def joint_metric(mean: Floats, proportions: Proportions) -> Floats:
    """Return coordinates (M, M) in which distances of channels are displacements of the points.

    |x @ metric|^2 is the mean squared displacement of a point about the pelvis plus that of the pelvis,
    squared statures, for a small x whose root channels are weighted by TURNING and DISPLACING; the effect of
    each channel is averaged over the mean curves (T, M).
    """
    sections = default_skeleton(proportions).sections()
    base = points(sections, mean)
    moves = np.empty((len(CHANNELS), base.size))
    for k in range(len(CHANNELS)):
        moved = mean.copy()
        moved[:, k] += CHANNEL_STEP
        moves[k] = TURNING.get(CHANNELS[k], 1.0) * ((points(sections, moved) - base) / CHANNEL_STEP).ravel()
    whole = np.array([DISPLACING.get(name, 0.0) ** 2 for name in CHANNELS])
    gram = moves @ moves.T / (base.size / 3) + np.diag(whole + SLOPE_RIDGE)
    return np.asarray(np.linalg.cholesky(gram), float)


def refine(plain: Components, cycles: Floats, subject: Indices, count: int, metric: Floats) -> Components:
    """Replace the components of an analysis by those of completed cycles (R, T, M) and their mirror images.

    Curves have unit length in the metric over all phases, and the entry of largest magnitude in the first
    half of the cycle is positive.  Scores are of the rows, not of their images; every subject counts alike.
    """
    mean, curves, scores, sd, spectrum = mirrored_components(cycles, subject, count, metric)
    return replace(plain, mean=mean, curves=curves, scores=scores, sd=sd, spectrum=spectrum)


def mirrored_components(
    filled: Floats, subject: Indices, count: int, metric: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Compute mean, curves, scores, sd and shares of the variance of cycles and their mirror images."""
    samples, channels = filled.shape[1:]
    basis = fourier_basis(samples, CYCLE_HARMONICS)
    coded = _with_images(filled, metric, basis)
    weight = np.tile(1 / np.bincount(subject)[subject], 2)
    weight /= weight.sum()
    mean = weight @ coded
    singular, right = right_singular(coded, mean, np.sqrt(weight))
    back = np.linalg.inv(metric)
    curves = decode(right[:count], basis, channels) @ back
    sign = _sign(curves)
    return (
        decode(mean[None], basis, channels)[0] @ back,
        curves * sign[:, None, None],
        (coded[: len(filled)] @ right[:count].T - mean @ right[:count].T) * sign,
        singular[:count],
        singular**2 / max(float(np.sum(singular**2)), 1e-300),
    )


def _with_images(filled: Floats, metric: Floats, basis: Floats) -> Floats:
    """Return coefficients (2 R, P) in the metric of cycles and, below them, of their mirror images."""
    coded = np.empty((2, len(filled), basis.shape[0] * filled.shape[2]))
    for part in by_rows(filled):
        coded[0, part] = encode(filled[part] @ metric, basis)
        coded[1, part] = encode(mirrored(filled[part]) @ metric, basis)
    return coded.reshape(-1, coded.shape[2])


def _sign(curves: Floats) -> Floats:
    """Return signs (q,) that make the largest entry of the first half positive.

    Its mirror image in the other half is as large and perhaps of the other sign.
    """
    half = curves[:, : curves.shape[1] // 2].reshape(len(curves), -1)
    return np.asarray(np.where(half[np.arange(len(half)), np.abs(half).argmax(axis=1)] < 0, -1.0, 1.0))


def lasting_offsets(filled: Floats, subject: Indices, count: int, metric: Floats) -> Floats:
    """Return each person's mean over the cycle that the others' components do not explain, (people, M).

    One row of zeros if there are fewer than three subjects.
    """
    if subject.max() < 2:
        return np.zeros((1, filled.shape[2]))
    basis = fourier_basis(filled.shape[1], CYCLE_HARMONICS)
    coded, image = _with_images(filled, metric, basis), np.tile(subject, 2)
    left = []
    for held in np.unique(subject):
        weight = np.where(image == held, 0.0, 1 / np.bincount(subject)[image])
        weight /= weight.sum()
        mean = weight @ coded
        right = leading_vectors(coded, mean, np.sqrt(weight), count)
        # The mean over a cycle is its first coefficient, and the residual of the mean is the mean of
        # residuals.
        rest = coded[: len(subject)][subject == held].mean(axis=0) - mean
        rest -= (right @ rest) @ right
        left.append(rest[: filled.shape[2]] / np.sqrt(filled.shape[1]) @ np.linalg.inv(metric))
    return np.array(left)


def by_subject(values: Floats, group: Indices, usual: float) -> tuple[float, float]:
    """Return mean and sd of the subjects' means; NaN values do not count.

    With fewer than `FEWEST_SUBJECTS` subjects the variance is shrunk towards that of people in general, whose
    relative sd is `usual`, but is never below that of the sequences.
    """
    group, values = group[np.isfinite(values)], values[np.isfinite(values)]
    if not len(values):
        return 0.0, 0.0
    means = np.array([values[group == g].mean() for g in np.unique(group)])
    middle, sample = float(means.mean()), means if len(means) > 1 else values
    visible = float(sample.std(ddof=1)) if len(sample) > 1 else 0.0
    share = min((len(means) - 1) / (FEWEST_SUBJECTS - 1), 1.0)
    variance = share * visible**2 + (1 - share) * max(visible, usual * middle) ** 2
    return middle, max(float(np.sqrt(variance)), LEAST_RELATIVE_SD * middle)


def paces(sequences: list[Sequence], subject: Indices) -> Floats:
    """Return the pace (n,) of sequences: their stride rates as `gait.body.model_curves` defines it."""
    rates = np.array([s.fps / s.period.frames for s in sequences])
    return pace(by_subject(rates, subject, RELATIVE_RATE_SD), rates)


def pace_slope(
    filled: Floats, subject: Indices, paces: Floats, terms: int = TERMS, *, stride: bool = False
) -> Floats:
    """Return the change (T, M) of the cycle per unit of pace, common to all people, who have equal weights.

    It is the least-squares slope of the differences between a person's completed cycles (R, T, M), own units,
    and their mean, with their mirror images, as a Fourier series.  It is 0 with one person or one pace, and
    for `STRIDE` unless `stride` is true.  UserError if an angle changes more than any walk's, as with jumps
    of 360 degrees between recordings.
    """
    together, variance = np.zeros(filled.shape[1:]), CONSTANT_GAIT_VARIANCE
    people = np.unique(subject)
    for person in people if len(people) > 1 else ():
        rows = np.flatnonzero(subject == person)
        away = (paces[rows] - paces[rows].mean()) / len(rows)
        variance += float(np.sum(away**2)) * len(rows)
        for part in by_rows(rows):
            # Differences of the pace sum to 0, so the mean cycle need not be subtracted.
            together += np.tensordot(away[part], filled[rows[part]], 1)
            release(filled)
    found = together[None] / variance
    found[..., STRIDE] *= stride
    slope = series(0.5 * (found + mirrored(found))[0], terms)
    channel = int(np.abs(slope).sum(axis=0).argmax())
    if np.abs(slope[:, channel]).sum() > STEEPEST_SLOPE:
        raise UserError(
            f"{CHANNELS[channel]}: recordings of one person differ more than walks at two rates can; "
            "remove turns of 360 degrees from the angles, or leave recordings out with --exclude"
        )
    return np.asarray(waves(terms, filled.shape[1]).T @ slope)


def at_mean_pace(filled: Floats, paces: Floats, slope: Floats) -> Floats:
    """Return cycles (R, T, M) as they would be at the mean rate, on disk."""
    parts = (filled[part] - paces[part, None, None] * slope for part in by_rows(filled))
    return stored(parts, filled.shape[1:])


def never_shown(mask: Mask, subject: Indices) -> tuple[int, Mask]:
    """Return how many people never show channels (M,) that others show, and which these are.

    `mask` (R, T, M) is what was recorded, `subject` (R,) the person of each cycle.
    """
    lacks = _lacking(mask, subject)
    return int(lacks.any(axis=1).sum()), np.asarray(lacks.any(axis=0))


def lacking(mask: Mask, subject: Indices) -> list[int]:
    """Return the people who never show channels that others show, beginning with those who lack most."""
    lacks = _lacking(mask, subject).sum(axis=1)
    order = np.argsort(-lacks, kind="stable")
    return [int(np.unique(subject)[k]) for k in order if lacks[k]]


def _lacking(mask: Mask, subject: Indices) -> Mask:
    """Return which channels (people, M) a person never shows that others show."""
    shown = np.array([mask[subject == who].any(axis=(0, 1)) for who in np.unique(subject)])
    return np.asarray(~shown & shown.any(axis=0))


def bounded(filled: Floats, mask: Mask, subject: Indices) -> Floats:
    """Limit the distance from the mean of channels that a person never shows to what is usual among people.

    Imputation predicts them linearly from the others, without bound: a person with an unusual walk would get
    arms that no one has, which would count like a recording.  Takes and returns completed cycles (R, T, M);
    the result is on disk, or is `filled` itself if there is nothing to do.
    """
    people = range(subject.max() + 1)
    shown = np.array([mask[subject == who].any(axis=(0, 1)) for who in people])
    if np.all(shown == shown.any(axis=0)):
        return filled
    share = shown / np.maximum(shown.sum(axis=0), 1)  # (people, M): equal weights of all who show a channel
    mean = sum(share[who] * _mean(filled, subject == who) for who in people)
    away = np.array([_mean(filled, subject == who, mean) for who in people])
    usual = np.sum(share * away, axis=0)
    # A channel that no person shows has no reference and is unchanged.
    held = ~shown & shown.any(axis=0)
    keep = np.where(held, np.sqrt(np.minimum(1.0, usual / np.maximum(away, 1e-300))), 1.0)
    nearer = (_drawn(filled[part], mean, keep[subject[part], None]) for part in by_rows(filled))
    return stored(nearer, filled.shape[1:])


def _drawn(cycles: Floats, mean: Floats, keep: Floats) -> Floats:
    """Scale the distance of cycles from the mean by `keep`; where `keep` is 1, the bits are unchanged."""
    return np.where(keep < 1, mean + keep * (cycles - mean), cycles)


def _mean(filled: Floats, rows: Mask, about: Floats | None = None) -> Floats:
    """Return the mean cycle (T, M) of some rows, or their mean square (M,) about a cycle."""
    at = np.flatnonzero(rows)
    total: Floats = np.zeros(filled.shape[1:])
    for part in by_rows(at):
        values = filled[at[part]]
        total += np.sum(values if about is None else (values - about) ** 2, axis=0)
        release(filled)
    return total / len(at) if about is None else total.mean(axis=0) / len(at)
