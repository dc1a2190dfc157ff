"""A prior over how people walk that reaches those who were not recorded.

The paper's components (`fpca`) describe the recorded cycles as well as possible.  With few subjects that is
not what a new person needs, so the completed cycles are taken up once more: each also mirrored (left and
right exchanged, half a cycle later), every subject counting alike, and channels weighed by how far they move
the joints.  What is left of a subject after the components of all others is the spread of static offsets.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import CHANNELS, SIDES, Proportions, default_skeleton, points
from gait.learn.cycles.fourier import HARMONICS, decode, encode, fourier_basis
from gait.learn.prior.fpca import Components
from gait.learn.prior.singular import leading, right_singular
from gait.learn.spool import by_rows

Floats = npt.NDArray[np.float64]
Groups = npt.NDArray[np.intp]

STEP = 1e-4  # of the numerical derivatives, radians and statures
RIDGE = 1e-5  # squared statures per squared unit: channels that move no joint still count a little
#: What turns of the whole body count for: a particle has a heading, pitch and roll of its own besides.
TURNING = {"root_roll": 0.3, "root_pitch": 0.3, "root_yaw": 0.3}
#: What root channels that displace the whole body count for, statures; forward speed is per stride.
DISPLACING = {"root_forward": 0.3, "root_sway": 1.0, "root_height": 1.0}
AGAINST = ("torso_x", "torso_z", "neck_x", "neck_z", "root_sway", "root_roll", "root_yaw")


def mirrored(rows: Floats) -> Floats:
    """Cycles (R, T, M) of the mirror image: left and right exchanged, half a cycle later."""
    order, sign = [], []
    for name in CHANNELS:
        twin = f"{SIDES[1 - SIDES.index(name[0])]}{name[1:]}" if name[:2] in ("l_", "r_") else name
        order.append(CHANNELS.index(twin))
        sign.append(-1.0 if name in AGAINST else 1.0)
    return np.roll(rows[:, :, order] * sign, rows.shape[1] // 2, axis=1)


def joint_metric(mean: Floats, proportions: Proportions) -> Floats:
    """Coordinates (M, M) in which distances of channels are displacements of the points.

    Parameters
    ----------
    mean : (T, M)
        Mean curves; the effect of each channel is averaged over them.

    Returns
    -------
    metric : (M, M)
        |x @ metric|^2 is the mean squared displacement of a point about the pelvis plus that of the pelvis,
        squared statures, for a small x whose root channels are counted by TURNING and DISPLACING.
    """
    sections = default_skeleton(proportions).sections()
    base = points(sections, mean)
    moves = np.empty((len(CHANNELS), base.size))
    for k in range(len(CHANNELS)):
        moved = mean.copy()
        moved[:, k] += STEP
        moves[k] = TURNING.get(CHANNELS[k], 1.0) * ((points(sections, moved) - base) / STEP).ravel()
    whole = np.array([DISPLACING.get(name, 0.0) ** 2 for name in CHANNELS])
    gram = moves @ moves.T / (base.size / 3) + np.diag(whole + RIDGE)
    return np.asarray(np.linalg.cholesky(gram), float)


def components(
    filled: Floats, subject: Groups, count: int, metric: Floats, harmonics: int = HARMONICS
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Components of completed cycles (R, T, M) and their mirror images, own units.

    Returns
    -------
    mean : (T, M)
    curves : (q, T, M)
        Of unit length in the metric over all phases; the entry of largest magnitude in the first half of the
        cycle is positive.
    scores : (R, q)
        Of the rows, not of their images.
    sd : (q,)
        With every subject counting alike.
    spectrum : (n,)
        Shares of the variance.
    """
    samples, channels = filled.shape[1:]
    basis = fourier_basis(samples, harmonics)
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
    """Coefficients (2 R, P) in the metric of cycles and, below them, of their mirror images."""
    coded = np.empty((2, len(filled), basis.shape[0] * filled.shape[2]))
    for part in by_rows(filled):
        coded[0, part] = encode(filled[part] @ metric, basis)
        coded[1, part] = encode(mirrored(filled[part]) @ metric, basis)
    return coded.reshape(-1, coded.shape[2])


def _sign(curves: Floats) -> Floats:
    """Signs (q,) that make the largest entry of the first half positive.

    In the other half lies its mirror image, as large and perhaps of the other sign.
    """
    half = curves[:, : curves.shape[1] // 2].reshape(len(curves), -1)
    return np.asarray(np.where(half[np.arange(len(half)), np.abs(half).argmax(axis=1)] < 0, -1.0, 1.0))


def refine(plain: Components, cycles: Floats, subject: Groups, count: int, metric: Floats) -> Components:
    """Replace the components of an analysis (own units) by those of completed cycles that reach further."""
    mean, curves, scores, sd, spectrum = components(cycles, subject, count, metric)
    return replace(plain, mean=mean, curves=curves, scores=scores, sd=sd, spectrum=spectrum)


def static_spread(filled: Floats, subject: Groups, count: int, metric: Floats) -> Floats:
    """Find how far a person is, on average over the cycle, from what all others explain: sd (M,) over people.

    Zero if there are fewer than three subjects.
    """
    if subject.max() < 2:
        return np.zeros(filled.shape[2])
    basis = fourier_basis(filled.shape[1], HARMONICS)
    coded, image = _with_images(filled, metric, basis), np.tile(subject, 2)
    left = []
    for held in np.unique(subject):
        weight = np.where(image == held, 0.0, 1 / np.bincount(subject)[image])
        weight /= weight.sum()
        mean = weight @ coded
        right = leading(coded, mean, np.sqrt(weight), count)
        # The mean over a cycle is its first coefficient, and the residual of the mean that of the cycles.
        rest = coded[: len(subject)][subject == held].mean(axis=0) - mean
        rest -= (right @ rest) @ right
        left.append(rest[: filled.shape[2]] / np.sqrt(filled.shape[1]) @ np.linalg.inv(metric))
    return np.sqrt(np.mean(np.square(left), axis=0))
