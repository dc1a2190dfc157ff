"""The segment prior over a whole sequence: a Markov chain of half segments, given the lasting unknowns.

Frames at the prior's rate are divided into blocks of half a segment.  Two neighbouring blocks are a segment,
so the prior gives p(first, second) and, by division, p(second | first).  The sequence has the density p(X_0,
X_1) prod_s p(X_s+1 | X_s), in which every overlap counts once.  Its information matrix is a block arrowhead.
In the world a segment is X = stature Rz(heading) x + shift, where shift and heading are also unknown and are
included by their linear effects around the present estimate (`Around`).

A Markov chain forgets: by itself, every half segment would be new evidence about the person's size and the
floor, and more frames would make it ever more certain of the mean person.  Therefore what is constant
throughout (stature, floor, and offsets of the person's joints) are separate unknowns g, and the chain is
conditional on g.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import blas, lapack

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import axis_rotation
from gait.lift.segment.explain import GROUND_SD
from gait.lift.smooth.block_arrowhead import Information

Floats = npt.NDArray[np.float64]

LASTING = 0.7  # share of the variance outside the modes that is constant within a segment
THROUGHOUT = 0.5  # share of the latter that is constant in the whole sequence
OFFSET_SD = 0.009  # statures, of the offsets of a person's joints
UNKNOWN_HEADING_SD = 2.0  # radians around the present estimate; practically unknown
#: Lasting unknowns that move the whole body: stature and floor; each marker's offset follows.
WHOLE_BODY_UNKNOWNS = 2
LEADING = 3  # modes in the shapes around which views are linearised


@dataclass(frozen=True)
class Freedom:
    """Freedom of a sequence in addition to the prior's modes.

    Attributes
    ----------
    stature, stature_sd : float
        Metres.
    height_sd : float
        Standard deviation of the height of the floor under the person, metres.
    """

    stature: float
    stature_sd: float
    height_sd: float


@dataclass(frozen=True)
class Around:
    """Estimate around which the chain is linearised, with S segments of 2 b frames.

    Attributes
    ----------
    heading : (S,)
        Radians.
    component : (S,)
        Index in the prior's mixture.
    stature : float
        Metres.
    places : (S, 2 b, J, 3)
        Markers in the world, metres, from the leading modes.
    grown : (S, 2 b, J, 3)
        The same from all modes, for the derivatives by stature.  If some modes did not scale with the
        stature, they would cost a small body near the lens less, and all estimates would be drawn towards it.
    """

    heading: Floats
    component: npt.NDArray[np.intp]
    stature: float
    places: Floats
    grown: Floats


@dataclass(frozen=True)
class Chain:
    """Information form of the chain: B blocks of n = 3 b J unknowns, and lasting ones (`block_arrowhead`).

    Attributes
    ----------
    information : Information
    constant : float
        Mean' information mean, summed over the factors of the density.
    log_det : float
        Log determinant of the information matrix.
    segments : list of Segment
    """

    information: Information
    constant: float
    log_det: float
    segments: list[Segment]


@dataclass(frozen=True)
class Common:
    """What all segments of a component have in common, whatever their position, heading and stature.

    In the body's axes, and in units of the standard deviations of what changes from frame to frame, modes and
    offsets of markers are the same in all segments, and so is the factor of their part of I + loads loads'.

    Attributes
    ----------
    sd : (n / 3,)
        Standard deviation of what changes from frame to frame, for each marker and frame, statures.
    lower : (k, k)
        Cholesky factor of I + scaled scaled', of modes and offsets.
    thin : (k, n)
        lower^-1 scaled.
    offsets : (3 J, n)
        Offsets of markers that last throughout, in standard deviations.
    left : (3 J, n)
        These times I - thin' thin.
    squares : (3 J, 3 J)
        left offsets'.
    """

    sd: Floats
    lower: Floats
    thin: Floats
    offsets: Floats
    left: Floats
    squares: Floats

    @classmethod
    def of(cls, prior: SegmentPrior, component: int, frames: int) -> Common:
        """Compute it for the first frames of a component."""
        modes, outside = prior.modes[component][:, :frames], prior.gamma * prior.residual[component]
        sd = np.sqrt((1 - LASTING) * outside)
        shares = _each_marker(np.full(len(sd), np.sqrt((1 - THROUGHOUT) * LASTING / (1 - LASTING))), frames)
        scaled = np.concatenate([modes / sd[:, None], shares]).reshape(len(modes) + len(shares), -1)
        lower = np.linalg.cholesky(np.eye(len(scaled)) + scaled @ scaled.T)
        thin = _divided(lower, scaled)
        offsets = _each_marker(_offset_sd(outside) / sd, frames).reshape(len(shares), -1)
        left = offsets - (offsets @ thin.T) @ thin
        return cls(np.tile(sd, frames), lower, thin, offsets, left, left @ offsets.T)

    def information(self) -> Floats:
        """Information (n, n) of a body with stature 1 m, without rigid motions, in its own axes."""
        sd = np.repeat(self.sd, 3)
        return np.asarray((np.eye(len(sd)) - self.thin.T @ self.thin) / (sd * sd[:, None]))


class Prior:
    """A segment prior, with precomputed matrices that all its chains need.

    Attributes
    ----------
    segments : SegmentPrior
    common : tuple of (Common, Common)
        For each of the C components: of whole segments, and of their first halves.
    alone : (C, n, n)
        Marginal information of the first half, as in `Common.information`.
    diagonal : (10 C, n n)
        `_harmonics` of the information of a whole segment: its first block minus `alone`; its second block.
    below : (5 C, n n)
        `_harmonics` of the information between the second half and the first.
    """

    def __init__(self, segments: SegmentPrior) -> None:
        self.segments = segments
        half = segments.frames // 2
        parts = [[Common.of(segments, c, n) for n in (2 * half, half)] for c in range(len(segments.mean))]
        self.common = tuple(tuple(part) for part in parts)
        whole, self.alone = (
            np.stack([own.information() for own in each]) for each in zip(*parts, strict=True)
        )
        n = self.alone.shape[1]
        first, second, across = whole[:, :n, :n] - self.alone, whole[:, n:, n:], whole[:, n:, :n]
        self.diagonal = np.concatenate([_harmonics(own) for own in (*first, *second)])
        self.below = np.concatenate([_harmonics(own) for own in across])


def chain(prior: Prior, around: Around, freedom: Freedom) -> Chain:
    """Make the chain of a prior (from `SegmentPrior.restricted`) with 2 b frames per segment."""
    segments, frames, markers = around.places.shape[:3]
    size, lasting = 3 * markers * frames // 2, WHOLE_BODY_UNKNOWNS + 3 * markers
    diagonal, below = _common_information(prior, around, size)
    border, corner = np.zeros((segments + 1, size, lasting)), np.eye(lasting)
    vector, edge, constant, log_det = np.zeros((segments + 1, size)), np.zeros(lasting), 0.0, 0.0
    wholes = [Segment(prior, around, freedom, s) for s in range(segments)]
    for s, whole in enumerate(wholes):
        half = whole.first_half()
        for sign, part in ((1.0, whole), (-1.0 if s else 0.0, half)):
            product, squares = part.products()
            constant += sign * float(squares[0, 0])
            log_det += sign * part.log_det()
            corner += sign * squares[1:, 1:]
            edge -= sign * squares[1:, 0]
            for block, own in enumerate(np.split(sign * product, product.shape[1] // size, axis=1), s):
                vector[block] += own[0]
                border[block] -= own[1:].T
        thin, alone = whole.rigid_thin(), half.rigid_thin()
        first, second = thin[:, :size], thin[:, size:]
        if s:
            diagonal[s] += np.vstack([-first, alone]).T @ np.vstack([first, alone])
        else:
            diagonal[s] -= first.T @ first
        diagonal[s + 1] -= second.T @ second
        below[s] -= second.T @ first
    return Chain(Information(diagonal, below, border, corner, vector, edge), constant, log_det, wholes)


def _common_information(prior: Prior, around: Around, size: int) -> tuple[Floats, Floats]:
    """Blocks (B, n, n) and (B - 1, n, n) of the information matrix without the rigid motions."""
    count, components = len(around.heading), len(prior.common)
    each = np.zeros((count, components, 5))
    each[np.arange(count), around.component] = _circle(around.heading) / around.stature**2
    own = each.reshape(count, -1)
    turns = np.hstack([np.pad(own, ((0, 1), (0, 0))), np.pad(own, ((1, 0), (0, 0)))])
    diagonal = (turns @ prior.diagonal).reshape(-1, size, size)
    below = (own @ prior.below).reshape(-1, size, size)
    diagonal[0] += _turned(prior.alone[around.component[0]], around.heading[0]) / around.stature**2
    return diagonal, below


def moved(before: Chain, around: Around, freedom: Freedom, places: Floats, lasting: Floats) -> Around:
    """Linearise around new positions (grid, J, 3): headings, stature and shapes that they imply.

    `before`: the chain `around` the old ones.

    The shapes contain only the leading modes.  The other modes of an estimate fit noise, so derivatives there
    would be correlated with the residuals and draw the body to the lens, where the same residuals in the
    picture are fewer metres (errors in variables, in proportion to the number of modes).  All segments and
    views are linearised around the same shapes, so that scaling the body about the lens costs nothing by
    itself. Derivatives by stature use all modes (`Around`).
    """
    headings, shapes, grown = [], [], []
    half = around.places.shape[1] // 2
    for segment, heading, place in zip(
        before.segments, around.heading, overlapping(places, half), strict=True
    ):
        turn, shape, full = segment.explained(place, lasting)
        grown.append(full)
        headings.append(heading + turn)
        shapes.append(shape)
    common = overlapping(blended(np.stack(shapes), half), half)
    stature = freedom.stature + freedom.stature_sd * float(lasting[0])
    return Around(np.array(headings), around.component, stature, common, np.stack(grown))


def overlapping(values: Floats, half: int) -> Floats:
    """Cut a sequence (grid, ...) into segments (S, 2 half, ...), each `half` frames after the one before."""
    return np.stack([values[at : at + 2 * half] for at in range(0, len(values) - half, half)])


def blended(segments: Floats, half: int) -> Floats:
    """Blend overlapping segments (S, F, ...), `half` frames after each other, by triangular weights."""
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
    """Concatenate every second of overlapping segments (S, F, ...), ending with the last one's last block."""
    last = len(segments) - 1
    owner = [min(block - block % 2, last) for block in range(last + 2)]
    return np.concatenate(
        [segments[s][(block - s) * half : (block - s + 1) * half] for block, s in enumerate(owner)]
    )


class Segment:
    """One segment in its body's axes: N(mean + lasting' g, diag(sd^2) + loads' loads), g ~ N(0, I).

    The loads are the modes, the markers' offsets, and `rigid`: position on the ground and heading.  The
    inverse of the covariance is (I - thin' thin) with rows and columns divided by sd, where thin contains the
    rows of `Common` and those of the rigid motions.
    """

    def __init__(self, prior: Prior, around: Around, freedom: Freedom, s: int) -> None:
        component, stature = around.component[s], around.stature
        self._turn = axis_rotation(2, around.heading[s])
        place, grown = around.places[s] @ self._turn, around.grown[s] @ self._turn
        known = prior.segments
        whole, self._half = prior.common[component]
        shape = place - _over_ground(place)
        own = stature * known.mean[component]
        growth = (grown - _over_ground(grown)) / stature
        mean = own + _over_ground(place) - _over_ground(own) + (freedom.stature - stature) * growth
        floor = np.zeros(place.shape)
        floor[..., 2] = freedom.height_sd
        self.own = np.stack([mean, freedom.stature_sd * growth, floor]).reshape(1 + WHOLE_BODY_UNKNOWNS, -1)
        self._modes = known.modes[component].reshape(-1, own.size)
        rigid = np.zeros((3, *place.shape))
        rigid[0, ..., 0] = rigid[1, ..., 1] = GROUND_SD
        if known.headings == 0:
            rigid[2, ..., 0], rigid[2, ..., 1] = (
                -UNKNOWN_HEADING_SD * shape[..., 1],
                UNKNOWN_HEADING_SD * shape[..., 0],
            )
        self.rigid = rigid.reshape(3, -1)
        self._offset_sd = stature * _offset_sd(known.gamma * known.residual[component])
        self._stature = stature
        self._prepare(whole)

    def _in_world(self, values: Floats) -> Floats:
        return (values.reshape(-1, 3) @ self._turn.T).reshape(values.shape)

    def _prepare(self, common: Common) -> None:
        """Extend the factor common to all segments by the rigid motions."""
        self._common, self.sd = common, np.repeat(self._stature * common.sd, 3)
        rigid = self.rigid / self.sd
        self._across = rigid @ common.thin.T
        self._lower = np.linalg.cholesky(np.eye(3) + rigid @ rigid.T - self._across @ self._across.T)
        self._rigid_thin = _divided(self._lower, rigid - self._across @ common.thin)

    def first_half(self) -> Segment:
        """Return the marginal of the first half."""
        half = copy(self)
        keep = len(self.sd) // 2
        half.own, half.rigid = self.own[:, :keep], self.rigid[:, :keep]
        half._prepare(self._half)
        return half

    def log_det(self) -> float:
        """Log determinant of the information, given the lasting unknowns."""
        roots = (
            np.abs(self.sd),
            np.diag(self._common.lower),
            np.diag(self._lower),
        )  # sd has the sign of the stature
        return -2 * sum(float(np.log(values).sum()) for values in roots)

    def rigid_thin(self) -> Floats:
        """Compute rows (3, n) of the rigid motions in the world, whose product reduces the information."""
        return self._in_world(self._rigid_thin / self.sd)

    def products(self) -> tuple[Floats, Floats]:
        """Return information times mean and lasting (1 + G, n), in the world, and this times the same."""
        common, own = self._common, self.own / self.sd
        left = np.concatenate([own - (own @ common.thin.T) @ common.thin, common.left])
        across = np.concatenate([own, common.offsets]) @ self._rigid_thin.T
        squares = np.empty((len(left), len(left)))
        squares[: len(own)] = own @ left.T
        squares[len(own) :, : len(own)] = squares[: len(own), len(own) :].T
        squares[len(own) :, len(own) :] = common.squares
        return self._in_world((left - across @ self._rigid_thin) / self.sd), squares - across @ across.T

    def explained(self, places: Floats, lasting: Floats) -> tuple[float, Floats, Floats]:
        """Return the turn of positions (F, J, 3), radians, and their shapes by leading and by all modes."""
        middle = self.own[0] + lasting[:WHOLE_BODY_UNKNOWNS] @ self.own[1:]
        offsets = lasting[WHOLE_BODY_UNKNOWNS:].reshape(-1, 3) * self._offset_sd[:, None]
        off = ((places @ self._turn - offsets).ravel() - middle) / self.sd
        rigid = np.linalg.solve(self._lower.T, self._rigid_thin @ off)
        rest = self._common.thin @ off - rigid @ self._across
        modes = self._stature * lapack.dtrtrs(self._common.lower.T, rest)[0][: len(self._modes)]
        leading = middle + rigid @ self.rigid + modes[:LEADING] @ self._modes[:LEADING]
        full = leading + modes[LEADING:] @ self._modes[LEADING:]
        leading, full = (self._in_world(shape).reshape(places.shape) for shape in (leading, full))
        return UNKNOWN_HEADING_SD * float(rigid[2]), leading, full


def _circle(heading: Floats) -> Floats:
    """Return basis functions (S, 5) of headings for a rotated matrix: 1, cos, sin, cos and sin of twice."""
    turns = [f(k * heading) for k in (1, 2) for f in (np.cos, np.sin)]
    return np.stack([np.ones(len(heading)), *turns], axis=-1)


def _harmonics(matrix: Floats) -> Floats:
    """Return the coefficients (5, n n) of these functions for a matrix (n, n) whose axes are rotated."""
    angles = 2 * np.pi / 5 * np.arange(5.0)
    turned = np.stack([_turned(matrix, angle).ravel() for angle in angles])
    return np.asarray(np.linalg.inv(_circle(angles)) @ turned)


def _turned(matrix: Floats, heading: float) -> Floats:
    """Rotate the axes of a matrix (n, n) of markers' coordinates."""
    turn = axis_rotation(2, heading).T
    rows = (matrix.reshape(-1, 3) @ turn).reshape(matrix.shape).T
    return np.asarray((rows.reshape(-1, 3) @ turn).reshape(rows.shape).T)


def _offset_sd(outside: Floats) -> Floats:
    """Return standard deviations (J,) of markers' offsets that last throughout, statures."""
    return np.asarray(np.sqrt(THROUGHOUT * LASTING * outside + OFFSET_SD**2))


def _divided(lower: Floats, rows: Floats) -> Floats:
    """Multiply the inverse of a lower triangle (k, k) by rows (k, n), without copies."""
    return np.asarray(blas.dtrsm(1.0, lower.T, rows.T, side=1).T)


def _each_marker(sd: Floats, frames: int) -> Floats:
    """Return moves (3 J, F, J, 3) of each marker along each axis by its sd (J,), the same in all frames."""
    own = (np.eye(3 * len(sd)) * np.repeat(sd, 3)).reshape(3 * len(sd), 1, len(sd), 3)
    return np.broadcast_to(own, (3 * len(sd), frames, len(sd), 3))


def _over_ground(places: Floats) -> Floats:
    """Return the middle of the first frame, projected on the ground: x, y, 0."""
    return np.array([*places[0, :, :2].mean(axis=0), 0.0])
