"""The segment prior over a whole sequence: a Markov chain of half segments, given what lasts.

Frames of the prior's rate are cut into blocks of half a segment.  Two neighbouring blocks are a segment, so
that the prior gives p(first, second) and, by division, p(second | first): the sequence has the density p(X_0,
X_1) prod_s p(X_s+1 | X_s), in which every overlap counts once.  Its information matrix is block-
block_arrowhead.  In the world a segment is X = stature Rz(heading) x + shift; shift and heading are unknown
too and enter by their linear effects around the present estimate (`Around`).

A chain forgets: left to it, every half segment would bring news of the person's size and of the floor, and
the more frames, the surer it would be of the mean person.  So what stays the same throughout - stature, floor
and where a person's joints are taken to be - are numbers g of their own, and the chain is that given g.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import blas, lapack

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import axis_rotation
from gait.lift.smooth.block_arrowhead import Information

Floats = npt.NDArray[np.float64]

GROUND_SD = 10.0  # metres, where on the ground
LASTING = 0.7  # share of the variance outside the modes that stays as it is within a segment
THROUGHOUT = 0.5  # share of that which stays as it is in the whole sequence
OFFSET_SD = 0.009  # statures, of where a person's joints are taken to be
HEADING_SD = 2.0  # radians around the present estimate: as good as unknown
WHOLE = 2  # numbers that last and move the whole body, stature and floor; each marker's offset follows
LEADING = 3  # modes whose scores enter the shapes that views are linearised around


@dataclass(frozen=True)
class Freedom:
    """What the sequence may do beyond the prior's modes.

    Attributes
    ----------
    stature, stature_sd : float
        Metres.
    height_sd : float
        Of the floor under the person, metres.
    """

    stature: float
    stature_sd: float
    height_sd: float


@dataclass(frozen=True)
class Around:
    """Estimate that the chain is linearised around, S segments of 2 b frames.

    Attributes
    ----------
    heading : (S,)
        Radians.
    component : (S,)
        Of the prior's mixture.
    stature : float
        Metres.
    places : (S, 2 b, J, 3)
        Markers in the world, metres.
    grown : (S, 2 b, J, 3)
        What grows with the stature: the same by all modes.  If some did not grow, a small body near the lens
        would pay less for them, and everyone was drawn to it.
    """

    heading: Floats
    component: npt.NDArray[np.intp]
    stature: float
    places: Floats
    grown: Floats


@dataclass(frozen=True)
class Chain:
    """Information form of the chain, B blocks of n = 3 b J numbers, and of what lasts (`block_arrowhead`).

    Attributes
    ----------
    information : Information
    constant : float
        Mean' information mean, summed over the factors.
    log_det : float
        Of the information matrix.
    """

    information: Information
    constant: float
    log_det: float


@dataclass(frozen=True)
class Common:
    """What all segments of a component have in common, whatever their place, heading and stature.

    In standard deviations of what changes from frame to frame, a segment's modes and its markers' offsets are
    the same but for the heading.  So is the factor of their part of I + loads loads'.

    Attributes
    ----------
    sd : (n / 3,)
        Of a number of each marker that changes from frame to frame, statures.
    lower : (k, k)
        Cholesky factor of I + scaled scaled', of modes and offsets.
    thin : (k, n)
        lower^-1 scaled.
    """

    sd: Floats
    lower: Floats
    thin: Floats

    @classmethod
    def of(cls, prior: SegmentPrior, component: int, frames: int) -> Common:
        """Prepare the first frames of a component."""
        modes = prior.modes[component][:, :frames]
        sd = np.sqrt((1 - LASTING) * prior.gamma * prior.residual[component])
        offsets = _each_marker(np.full(len(sd), np.sqrt((1 - THROUGHOUT) * LASTING / (1 - LASTING))), frames)
        scaled = np.concatenate([modes / sd[:, None], offsets]).reshape(len(modes) + len(offsets), -1)
        lower = np.linalg.cholesky(np.eye(len(scaled)) + scaled @ scaled.T)
        return cls(np.tile(sd, frames), lower, _divided(lower, scaled))


class Prior:
    """A segment prior with what its chains need over and over."""

    def __init__(self, segments: SegmentPrior) -> None:
        self.segments = segments
        half = segments.frames // 2
        parts = [[Common.of(segments, c, n) for n in (2 * half, half)] for c in range(len(segments.mean))]
        self.common = tuple(tuple(part) for part in parts)


def chain(prior: Prior, around: Around, freedom: Freedom) -> Chain:
    """Make the chain of a prior (of `SegmentPrior.restricted`) with 2 b frames a segment."""
    segments, frames, markers = around.places.shape[:3]
    size, lasting = 3 * markers * frames // 2, WHOLE + 3 * markers
    diagonal, below = np.zeros((segments + 1, size, size)), np.empty((segments, size, size))
    border, corner = np.zeros((segments + 1, size, lasting)), np.eye(lasting)
    vector, edge, constant, log_det = np.zeros((segments + 1, size)), np.zeros(lasting), 0.0, 0.0
    halves = slice(0, size), slice(size, 2 * size)
    for s in range(segments):
        whole = Segment(prior, around, freedom, s)
        factors = [(1.0, whole)] if s == 0 else [(1.0, whole), (-1.0, whole.first_half())]
        for sign, part in factors:
            thin, sure = part.thin / part.sd, part.sd**-2
            both = np.vstack([part.mean, part.lasting])
            product = sign * (both * sure - (both @ thin.T) @ thin)
            constant += float(part.mean @ product[0])
            log_det += sign * part.log_det()
            corner += part.lasting @ product[1:].T
            edge -= part.lasting @ product[0]
            for block, half in enumerate(halves[: 1 + (sign > 0)], s):
                own = thin[:, half]
                diagonal[block] -= sign * (own.T @ own)
                diagonal[block].flat[:: size + 1] += sign * sure[half]
                vector[block] += product[0, half]
                border[block] -= product[1:, half].T
            if sign > 0:
                np.matmul(-thin[:, size:].T, thin[:, :size], out=below[s])
    return Chain(Information(diagonal, below, border, corner, vector, edge), constant, log_det)


def moved(prior: Prior, around: Around, freedom: Freedom, places: Floats, lasting: Floats) -> Around:
    """Linearise around new places (grid, J, 3): headings, stature and shapes that they imply under the prior.

    The shapes hold the leading modes only.  What else an estimate fits goes with the noise that it is fitted
    to: derivatives taken there are correlated with the residuals, and draw the body to the lens, where the
    same residuals in the picture are fewer metres (errors in variables; by the share of fitted numbers).  All
    segments and all views are linearised around the same shapes, so that a change of size about the lens
    costs nothing by itself.  What grows with the stature holds all modes (`Around`).
    """
    headings, shapes, grown = [], [], []
    half = around.places.shape[1] // 2
    for s, place in enumerate(overlapping(places, half)):
        turn, shape, full = Segment(prior, around, freedom, s).explained(place.ravel(), lasting)
        grown.append(full.reshape(place.shape))
        headings.append(around.heading[s] + turn)
        shapes.append(shape.reshape(place.shape))
    common = overlapping(blended(np.stack(shapes), half), half)
    stature = freedom.stature + freedom.stature_sd * float(lasting[0])
    return Around(np.array(headings), around.component, stature, common, np.stack(grown))


def overlapping(values: Floats, half: int) -> Floats:
    """Segments (S, 2 half, ...) of a sequence (grid, ...), each `half` frames after the one before."""
    return np.stack([values[at : at + 2 * half] for at in range(0, len(values) - half, half)])


def blended(segments: Floats, half: int) -> Floats:
    """Overlapping segments (S, F, ...), each `half` frames after the one before, by triangular weights."""
    count, frames = segments.shape[:2]
    weight = 1 - np.abs((np.arange(frames) + 0.5) / frames * 2 - 1)
    weight = weight.reshape(-1, *[1] * (segments.ndim - 2))
    total = np.zeros(((count - 1) * half + frames, *segments.shape[2:]))
    norm = np.zeros((len(total), *[1] * (segments.ndim - 2)))
    for s, segment in enumerate(segments):
        total[s * half : s * half + frames] += weight * segment
        norm[s * half : s * half + frames] += weight
    return total / norm


def in_turn(segments: Floats, half: int) -> Floats:
    """Every second of overlapping segments (S, F, ...) after the other; the last block from the last one."""
    last = len(segments) - 1
    owner = [min(block - block % 2, last) for block in range(last + 2)]
    return np.concatenate(
        [segments[s][(block - s) * half : (block - s + 1) * half] for block, s in enumerate(owner)]
    )


class Segment:
    """One segment in the world: N(mean + lasting' g, diag(sd^2) + loads' loads), g ~ N(0, I).

    The loads are `modes`, offsets of the markers, and `rigid`: place on the ground and heading.  The inverse
    of the covariance is (I - thin' thin) with rows and columns divided by sd.
    """

    def __init__(self, prior: Prior, around: Around, freedom: Freedom, s: int) -> None:
        component, place, stature = around.component[s], around.places[s], around.stature
        known, (frames, markers) = prior.segments, place.shape[:2]
        self._turn = axis_rotation(2, around.heading[s])
        whole, self._half = prior.common[component]
        shape = place - _over_ground(place)
        own = stature * self._turned(known.mean[component])
        middle = _over_ground(place) - _over_ground(own)
        growth = (around.grown[s] - _over_ground(around.grown[s])) / stature
        self.mean = (own + middle + (freedom.stature - stature) * growth).ravel()
        self.modes = stature * self._turned(known.modes[component]).reshape(-1, own.size)
        rigid = np.zeros((3, *place.shape))
        rigid[0, ..., 0] = rigid[1, ..., 1] = GROUND_SD
        if known.headings == 0:
            rigid[2, ..., 0], rigid[2, ..., 1] = -HEADING_SD * shape[..., 1], HEADING_SD * shape[..., 0]
        self.rigid = rigid.reshape(3, -1)
        outside = known.gamma * known.residual[component]
        lasting = np.zeros((WHOLE + 3 * markers, *place.shape))
        lasting[0], lasting[1, ..., 2] = freedom.stature_sd * growth, freedom.height_sd
        offset_sd = stature * np.sqrt(THROUGHOUT * LASTING * outside + OFFSET_SD**2)
        lasting[WHOLE:] = self._turned(_each_marker(offset_sd, frames))
        self.lasting = lasting.reshape(len(lasting), -1)
        self._stature = stature
        self._prepare(whole)

    def _turned(self, places: Floats) -> Floats:
        return (places.reshape(-1, 3) @ self._turn.T).reshape(places.shape)

    def _prepare(self, common: Common) -> None:
        """Complete the factor of what segments have in common by the rigid motions."""
        self._common, self.sd = common, np.repeat(self._stature * common.sd, 3)
        thin, rigid = self._turned(common.thin), self.rigid / self.sd
        self._across = rigid @ thin.T
        self._lower = np.linalg.cholesky(np.eye(3) + rigid @ rigid.T - self._across @ self._across.T)
        self.thin = np.concatenate([thin, _divided(self._lower, rigid - self._across @ thin)])

    def first_half(self) -> Segment:
        """Marginal of the first half."""
        half = copy(self)
        keep = len(self.mean) // 2
        half.mean, half.rigid, half.lasting = self.mean[:keep], self.rigid[:, :keep], self.lasting[:, :keep]
        half._prepare(self._half)
        return half

    def log_det(self) -> float:
        """Logarithm of the determinant of the information, given what lasts."""
        roots = (
            np.abs(self.sd),
            np.diag(self._common.lower),
            np.diag(self._lower),
        )  # sd has the sign of stature
        return -2 * sum(float(np.log(values).sum()) for values in roots)

    def explained(self, places: Floats, lasting: Floats) -> tuple[float, Floats, Floats]:
        """Turn of places in radians, their shape by the leading modes and by all, given what lasts."""
        values = self.thin @ ((places - self.mean - lasting @ self.lasting) / self.sd)
        rigid = np.linalg.solve(self._lower.T, values[-3:])
        rest = values[:-3] - rigid @ self._across
        modes = lapack.dtrtrs(self._common.lower.T, rest)[0][: len(self.modes)]
        middle = self.mean + lasting[:WHOLE] @ self.lasting[:WHOLE] + rigid @ self.rigid
        leading = middle + modes[:LEADING] @ self.modes[:LEADING]
        return HEADING_SD * float(rigid[2]), leading, leading + modes[LEADING:] @ self.modes[LEADING:]


def _divided(lower: Floats, rows: Floats) -> Floats:
    """Multiply rows (k, n) by the inverse of a lower triangle (k, k), without copies."""
    return np.asarray(blas.dtrsm(1.0, lower.T, rows.T, side=1).T)


def _each_marker(sd: Floats, frames: int) -> Floats:
    """Move (3 J, F, J, 3) of each marker along each axis by its sd (J,), alike in all frames."""
    own = (np.eye(3 * len(sd)) * np.repeat(sd, 3)).reshape(3 * len(sd), 1, len(sd), 3)
    return np.broadcast_to(own, (3 * len(sd), frames, len(sd), 3))


def _over_ground(places: Floats) -> Floats:
    """Middle of the first frame over the ground: x, y, 0."""
    return np.array([*places[0, :, :2].mean(axis=0), 0.0])
