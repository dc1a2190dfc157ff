"""Points that a detector put elsewhere for longer: frozen, on the other leg, on somebody else.

What lies far from where the whole motion has it loses its say: beyond `FAR` deviations its own deviation
grows with the square of its distance, so that its pull falls with the third power.  Nearer points keep
theirs, so that an estimate without wrong points is left as it is.  Where half of a frame's points are off, as
before the first steps and in motions unlike the prior's, far means far beyond those.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.lift.observe import Observations

Floats = npt.NDArray[np.float64]

FAR = 4.0  # deviations from which a point is doubted; of right ones fewer than one in a thousand is as far
BEYOND = 3.0  # times the median of the frame's points


def distances(points: Observations, said: Floats) -> Floats:
    """Distances (T, P) of points from where an estimate has them (T, P, 2), in deviations; 0 if not seen."""
    apart = np.linalg.norm(points.uv - said, axis=2) / points.sd
    return np.where(points.seen, apart, 0.0)


def doubted(points: Observations, said: Floats) -> Observations:
    """Points with the deviations that their distances leave them."""
    apart = distances(points, said)
    limit = np.full(len(apart), FAR)
    for t, seen in enumerate(points.seen):
        if seen.any():
            limit[t] = max(FAR, BEYOND * float(np.median(apart[t, seen])))
    far = np.maximum(apart / limit[:, None], 1.0)
    return points if (far == 1.0).all() else Observations(points.uv, points.sd * far**2)


def price(points: Observations, trusted: Observations) -> float:
    """Give what larger deviations cost the logarithm of the points' density: two coordinates each."""
    seen = points.seen
    return 2 * float(np.log(trusted.sd[seen] / points.sd[seen]).sum())
