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

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import linalg

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


def chain(prior: SegmentPrior, around: Around, freedom: Freedom) -> Chain:
    """Make the chain of a prior (`SegmentPrior.restricted`) with 2 b frames a segment."""
    segments, frames, markers = around.places.shape[:3]
    size, lasting = 3 * markers * frames // 2, WHOLE + 3 * markers
    diagonal, below = np.zeros((segments + 1, size, size)), np.zeros((segments, size, size))
    border, corner = np.zeros((segments + 1, size, lasting)), np.eye(lasting)
    vector, edge, constant, log_det = np.zeros((segments + 1, size)), np.zeros(lasting), 0.0, 0.0
    for s in range(segments):
        whole = Segment(prior, around, freedom, s)
        factors = [(1.0, whole)] if s == 0 else [(1.0, whole), (-1.0, whole.first_half())]
        for sign, part in factors:
            information = sign * part.information()
            product, reach = information @ part.mean, information @ part.lasting.T
            constant += float(part.mean @ product)
            log_det += sign * part.log_det()
            diagonal[s] += information[:size, :size]
            vector[s] += product[:size]
            border[s] -= reach[:size]
            corner += part.lasting @ reach
            edge -= part.lasting @ product
            if sign > 0:
                below[s] += information[size:, :size]
                diagonal[s + 1] += information[size:, size:]
                vector[s + 1] += product[size:]
                border[s + 1] -= reach[size:]
    return Chain(Information(diagonal, below, border, corner, vector, edge), constant, log_det)


def moved(prior: SegmentPrior, around: Around, freedom: Freedom, places: Floats, lasting: Floats) -> Around:
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
    """One segment in the world: N(mean + lasting' g, diag(variance) + loads' loads), g ~ N(0, I)."""

    def __init__(self, prior: SegmentPrior, around: Around, freedom: Freedom, s: int) -> None:
        component, place = around.component[s], around.places[s]
        turn, stature = axis_rotation(2, around.heading[s]), around.stature
        shape = place - _over_ground(place)
        own = stature * prior.mean[component] @ turn.T
        middle = _over_ground(place) - _over_ground(own)
        growth = (around.grown[s] - _over_ground(around.grown[s])) / stature
        self.mean = (own + middle + (freedom.stature - stature) * growth).ravel()
        outside = stature**2 * prior.gamma * prior.residual[component]
        self.variance = np.broadcast_to(((1 - LASTING) * outside)[None, :, None], place.shape).ravel()
        modes = stature * prior.modes[component] @ turn.T
        size, markers = len(modes), place.shape[1]
        loads = np.zeros((size + 3 + 3 * markers, *place.shape))
        loads[:size] = modes
        loads[size, ..., 0] = loads[size + 1, ..., 1] = GROUND_SD
        if prior.headings == 0:
            loads[size + 2, ..., 0], loads[size + 2, ..., 1] = -shape[..., 1], shape[..., 0]
        loads[size + 2] *= HEADING_SD
        loads[size + 3 :] = _each_marker(np.sqrt((1 - THROUGHOUT) * LASTING * outside), place.shape)
        lasting = np.zeros((WHOLE + 3 * markers, *place.shape))
        lasting[0], lasting[1, ..., 2] = freedom.stature_sd * growth, freedom.height_sd
        own_sd = np.sqrt(THROUGHOUT * LASTING * outside + (stature * OFFSET_SD) ** 2)
        lasting[WHOLE:] = _each_marker(own_sd, place.shape) @ turn.T
        self.rigid = size
        self.loads, self.lasting = loads.reshape(len(loads), -1), lasting.reshape(len(lasting), -1)
        self._prepare()

    def _prepare(self) -> None:
        self._scaled = self.loads / self.variance
        inner = np.eye(len(self.loads)) + self._scaled @ self.loads.T
        self._lower = np.linalg.cholesky(inner)

    def first_half(self) -> Segment:
        """Marginal of the first half."""
        half = object.__new__(Segment)
        keep = len(self.mean) // 2
        half.mean, half.variance = self.mean[:keep], self.variance[:keep]
        half.loads, half.lasting, half.rigid = self.loads[:, :keep], self.lasting[:, :keep], self.rigid
        half._prepare()
        return half

    def information(self) -> Floats:
        """Inverse of the covariance, given what lasts."""
        thin = linalg.solve_triangular(self._lower, self._scaled, lower=True, check_finite=False)
        result = -(thin.T @ thin)
        result[np.diag_indices_from(result)] += 1 / self.variance
        return result

    def log_det(self) -> float:
        """Logarithm of the determinant of the information, given what lasts."""
        return -float(np.log(self.variance).sum() + 2 * np.log(np.diag(self._lower)).sum())

    def explained(self, places: Floats, lasting: Floats) -> tuple[float, Floats, Floats]:
        """Turn of places in radians, their shape by the leading modes and by all, given what lasts."""
        rest = places - self.mean - lasting @ self.lasting
        values = linalg.cho_solve((self._lower, True), self._scaled @ rest, check_finite=False)
        turn = HEADING_SD * values[self.rigid + 2]
        values[self.rigid + 3 :] = 0
        middle = self.mean + lasting[:WHOLE] @ self.lasting[:WHOLE]
        whole = middle + values @ self.loads
        values[LEADING : self.rigid] = 0
        return float(turn), middle + values @ self.loads, whole


def _each_marker(sd: Floats, shape: tuple[int, ...]) -> Floats:
    """Move (3 J, F, J, 3) of each marker along each axis by its sd (J,), alike in all frames."""
    frames, markers = shape[:2]
    own = (np.eye(3 * markers) * np.repeat(sd, 3)).reshape(3 * markers, 1, markers, 3)
    return np.broadcast_to(own, (3 * markers, frames, markers, 3))


def _over_ground(places: Floats) -> Floats:
    """Middle of the first frame over the ground: x, y, 0."""
    return np.array([*places[0, :, :2].mean(axis=0), 0.0])
