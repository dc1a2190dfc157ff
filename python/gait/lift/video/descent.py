"""Levenberg-Marquardt over a chain of segments that share frames with their neighbours.

Two neighbours describe the frames they share; their positions may differ by what both priors leave out.  The
normal equations are block-tridiagonal, so a clip of any length costs its number of segments.

What a clip gets wrong from end to end, and how far that moves the estimate.

Clothes, hair and shoes lie where the stick figure does not, and a person's build looks nearer or further than
the prior's.  Every frame brings the same error anew, so that no number of frames makes it less.  The estimate
stays as it is; its covariance grows by how far each error, one standard deviation large, would move it
(consider covariance, Schmidt 1966).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError

from gait.lift.smooth.block_arrowhead import Factor, factor
from gait.lift.video.energy import GAIN, Energy

Floats = npt.NDArray[np.float64]

ROUNDS = 15
FLAT = 1e-3  # relative gain at which a descent ends
DAMPING = (1e-6, 1e-3, 1e8)  # least, first and last


@dataclass(frozen=True)
class Link:
    """The frames that neighbouring segments share.

    Attributes
    ----------
    hop : int
        Frames from the start of a segment to that of the next.
    sd : (J,)
        Standard deviation of the difference of a coordinate of each marker, metres.
    """

    hop: int
    sd: Floats


@dataclass(frozen=True)
class Normal:
    """Gauss-Newton's equations: cost, information (B, n, n) and (B - 1, n, n) below, gradient (B, n)."""

    cost: float
    diagonal: Floats
    below: Floats
    gradient: Floats


def normal(chain: Sequence[Energy], link: Link | None, states: Floats) -> Normal:
    """Linearise a chain at states (B, n); without a link segments do not know each other."""
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
    """Places and slopes of the frames shared with the segment before and after; in standard deviations."""
    frames = energy.weights.shape[1]
    places, slope = energy.shape.positions(state, np.eye(frames), slice(None))
    places, slope = places / link.sd[:, None], slope / link.sd[:, None, None]
    shared = frames - link.hop
    first, last = (
        (places[k].ravel(), slope[k].reshape(-1, len(state))) for k in (slice(shared), slice(link.hop, None))
    )
    return first, last


def descend(chain: Sequence[Energy], link: Link | None, states: Floats) -> tuple[Floats, float]:
    """Find states (B, n) of least energy near a start; also the energy."""
    states, now = states.copy(), normal(chain, link, states)
    least, damping, most = DAMPING
    diagonal = np.einsum("bii->bi", now.diagonal).copy()
    for _ in range(ROUNDS):
        trial = _stepped(chain, states, now, damping * diagonal)
        then = None if trial is None else normal(chain, link, trial)
        if trial is not None and then is not None and then.cost < now.cost:
            gain, states, now = now.cost - then.cost, trial, then
            diagonal = np.einsum("bii->bi", now.diagonal).copy()
            damping = max(0.2 * damping, least)
            if gain < FLAT * now.cost:
                break
        else:
            damping *= 8
            if damping > most:
                break
    return states, now.cost


def _stepped(chain: Sequence[Energy], states: Floats, now: Normal, damping: Floats) -> Floats | None:
    """States after a damped step; None if it fails or leads behind the lens."""
    information = now.diagonal + damping[:, :, None] * np.eye(damping.shape[1])
    try:
        trial = states - factor(information, now.below).solve(now.gradient)
    except LinAlgError:
        return None
    ahead = all(energy.visible(state) for energy, state in zip(chain, trial, strict=True))
    return trial if ahead else None


def information(chain: Sequence[Energy], link: Link | None, states: Floats) -> Factor:
    """Factor of the information matrix of a chain at states (B, n)."""
    at = normal(chain, link, states)
    return factor(at.diagonal, at.below)


# Nearly most likely on people of `gait simulate` and sticks of people left out, none of the published clips.
SHIFT_SD = (0.03, 0.05)  # metres, across and along the picture: where sensors see the figure
SIZE_SD = 0.03  # share by which they see it larger


def moves(chain: Sequence[Energy], factor: Factor, states: Floats, drifted: Floats) -> Floats:
    """Move the states (B, n) by one sd of each error: two shifts, size, two drifts; shape (B, n, 5).

    Parameters
    ----------
    chain : sequence of B Energy
    factor : Factor
        Of the chain's information matrix at the states.
    drifted : (B,)
        How far the figure may have drifted in each segment, metres, in one sense:
        `gait.lift.fit_correlation`.
    """
    pulls = np.stack([_pull(energy, state) for energy, state in zip(chain, states, strict=True)])
    drifts = pulls[..., :2] * drifted[:, None, None] / SHIFT_SD
    return -factor.solve(np.concatenate([pulls, drifts], axis=-1))


def _pull(energy: Energy, state: Floats) -> Floats:
    """Change (n, 3) of half the energy's gradient by one standard deviation of each error."""
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
    by_error = np.exp(state[GAIN]) * np.concatenate([by_shift, by_size[..., None]], axis=-1)
    _, slope = energy.sensor_rows(reading, state)
    return np.asarray(slope.T @ by_error.reshape(len(slope), -1) / reading.sd)
