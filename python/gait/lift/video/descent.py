"""Levenberg-Marquardt over a chain of segments that share frames with their neighbours.

Two neighbours both describe the frames that they share; positions there may differ by what the priors do not
explain.  The normal equations are block-tridiagonal, so the time is proportional to the number of segments.

`moves` accounts for errors that are common to a whole clip.  Clothes, hair and shoes are where the stick
figure is not, and a person's build makes them look nearer or further than the prior's body.  As every frame
has the same error, more frames do not reduce it.  The estimate is unchanged, but its covariance is increased
by the effect of each error of one standard deviation (consider covariance, Schmidt 1966).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError

from gait.lift.smooth.block_arrowhead import Factor, factor
from gait.lift.video.energy import GAIN_COLUMN, Energy

Floats = npt.NDArray[np.float64]

MOST_DESCENT_STEPS = 15
LEAST_DESCENT_GAIN = 1e-3  # relative gain at which a descent ends
DAMPING_RANGE = (1e-6, 1e-3, 1e8)  # least, first and largest


@dataclass(frozen=True)
class Link:
    """Coupling of neighbouring segments in the frames that they share.

    Attributes
    ----------
    hop : int
        Frames from the start of a segment to that of the next.
    sd : (J,)
        Standard deviation, per coordinate, of the difference of each marker between the two, metres.
    """

    hop: int
    sd: Floats


@dataclass(frozen=True)
class Normal:
    """Gauss-Newton equations: cost; information, (B, n, n) and below (B - 1, n, n); gradient (B, n)."""

    cost: float
    diagonal: Floats
    below: Floats
    gradient: Floats


def normal(chain: Sequence[Energy], link: Link | None, states: Floats) -> Normal:
    """Linearise a chain at states (B, n); without a link the segments are independent."""
    count, size = states.shape
    diagonal, gradient = np.empty((count, size, size)), np.empty((count, size))
    below, cost = np.zeros((count - 1, size, size)), 0.0
    for s, (energy, state) in enumerate(zip(chain, states, strict=True)):
        residual, slope = energy.rows(state)
        diagonal[s], gradient[s] = slope.T @ slope, slope.T @ residual
        cost += float(residual @ residual)
    if link is None:
        return Normal(cost, diagonal, below, gradient)
    ends = [_ends(energy, state, link) for energy, state in zip(chain, states, strict=True)]
    for s in range(count - 1):
        (_, (old, by_old)), ((new, by_new), _) = ends[s], ends[s + 1]
        residual = old - new
        diagonal[s] += by_old.T @ by_old
        diagonal[s + 1] += by_new.T @ by_new
        below[s] = -by_new.T @ by_old
        gradient[s] += by_old.T @ residual
        gradient[s + 1] -= by_new.T @ residual
        cost += float(residual @ residual)
    return Normal(cost, diagonal, below, gradient)


def _ends(energy: Energy, state: Floats, link: Link) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Compute positions and slopes in the frames shared with the neighbours, in standard deviations."""
    frames = energy.weights.shape[1]
    places, slope = energy.shape.positions(state, np.eye(frames), slice(None))
    places, slope = places / link.sd[:, None], slope / link.sd[:, None, None]
    shared = frames - link.hop
    first, last = (
        (places[k].ravel(), slope[k].reshape(-1, len(state))) for k in (slice(shared), slice(link.hop, None))
    )
    return first, last


def descend(chain: Sequence[Energy], link: Link | None, states: Floats) -> tuple[Floats, float]:
    """Find states (B, n) of least energy near a start; also return the energy."""
    states, now = states.copy(), normal(chain, link, states)
    least, damping, most = DAMPING_RANGE
    diagonal = np.einsum("bii->bi", now.diagonal).copy()
    for _ in range(MOST_DESCENT_STEPS):
        trial = _stepped(chain, states, now, damping * diagonal)
        then = None if trial is None else normal(chain, link, trial)
        if trial is not None and then is not None and then.cost < now.cost:
            gain, states, now = now.cost - then.cost, trial, then
            diagonal = np.einsum("bii->bi", now.diagonal).copy()
            damping = max(0.2 * damping, least)
            if gain < LEAST_DESCENT_GAIN * now.cost:
                break
        else:
            damping *= 8
            if damping > most:
                break
    return states, now.cost


def _stepped(chain: Sequence[Energy], states: Floats, now: Normal, damping: Floats) -> Floats | None:
    """Return the states after a damped step; None if it fails or leads behind the lens."""
    information = now.diagonal + damping[:, :, None] * np.eye(damping.shape[1])
    try:
        trial = states - factor(information, now.below).solve(now.gradient)
    except LinAlgError:
        return None
    ahead = all(energy.visible(state) for energy, state in zip(chain, trial, strict=True))
    return trial if ahead else None


def information(chain: Sequence[Energy], link: Link | None, states: Floats) -> Factor:
    """Factor the information matrix of a chain at states (B, n)."""
    at = normal(chain, link, states)
    return factor(at.diagonal, at.below)


# Near the maximum likelihood on people of `gait simulate` and sticks of held-out people, not on the published
# clips.
SHIFT_SD = (0.03, 0.05)  # metres, across and down the picture, of the figure's apparent position
SIZE_SD = 0.03  # of its apparent relative size


def moves(chain: Sequence[Energy], factor: Factor, states: Floats, drifted: Floats) -> Floats:
    """Return moves (B, n, 5) of the states (B, n) by one sd of each error: two shifts, size, two drifts.

    Parameters
    ----------
    chain : sequence of B Energy
    factor : Factor
        Factor of the chain's information matrix at the states.
    drifted : (B,)
        How far the figure may have drifted in each segment, metres, with sign; see
        `gait.lift.video.fit_clip`.
    """
    pulls = np.stack([_pull(energy, state) for energy, state in zip(chain, states, strict=True)])
    drifts = pulls[..., :2] * drifted[:, None, None] / SHIFT_SD
    return -factor.solve(np.concatenate([pulls, drifts], axis=-1))


def _pull(energy: Energy, state: Floats) -> Floats:
    """Compute the change (n, 3) of half the energy's gradient by one standard deviation of each error."""
    reading = energy.reading
    if reading is None or not len(reading.value):
        return np.zeros((len(state), 3))
    places, _ = energy.shape.positions(state, energy.weights, energy.sticks.markers)
    uv, _ = energy.view.project(places)
    _, by_uv = energy.sticks.responses(uv, reading.places, reading.blur)
    pixels = np.array([energy.view.scale(body.mean(axis=0)) for body in places])
    from_middle = uv - (uv.min(axis=1, keepdims=True) + uv.max(axis=1, keepdims=True)) / 2
    by_shift = pixels[:, None, None] * SHIFT_SD * by_uv.sum(axis=2)
    by_size = SIZE_SD * (by_uv * from_middle[:, None]).sum(axis=(2, 3))
    by_error = np.exp(state[GAIN_COLUMN]) * np.concatenate([by_shift, by_size[..., None]], axis=-1)
    _, slope = energy.sensor_rows(reading, state)
    return np.asarray(slope.T @ by_error.reshape(len(slope), -1) / reading.sd)
