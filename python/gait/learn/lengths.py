"""How people of one stature differ in their proportions: limbs longer or shorter, hips and trunk.

The lengths of every frame of the skeleton (its points, its limbs, the origins of its children) are multiplied
by one factor; principal components of the subjects' factors, weighed by how far they move the joints, are the
section PROP of a blob.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.learn.retarget import Measures, own_proportions
from gait.skeleton import Proportions, default_skeleton, points

Floats = npt.NDArray[np.float64]

COUNT = 4  # components kept, fewer with few subjects
LARGEST = 0.09  # relative change per standard deviation; the library takes no more than a tenth
STEP = 1e-3
#: Frames that change together (names end so).
GROUPS = ("pelvis", "torso", "upper_arm", "forearm", "thigh", "shank", "foot")


def spans(p: Proportions) -> Floats:
    """Characteristic length (7,) of each group, statures."""
    return np.array(
        [p.hip[1], p.neck, p.upper_arm, p.forearm, p.thigh, p.shank, float(np.hypot(p.toe[0], p.toe[2]))]
    )


def learn(bodies: Sequence[Measures | None], mean: Proportions, pose: Floats, count: int = COUNT) -> Floats:
    """PROP (p, F + 1): relative changes of the frames' lengths and of the pelvis's height, per deviation.

    Parameters
    ----------
    bodies : sequence of Measures
        One per subject; those that were not seen whole are left out.
    pose : (T, M)
        Mean curves: joints are moved from there.

    Returns
    -------
    table : (p, F + 1)
        Empty with fewer than three subjects.
    """
    skeleton = default_skeleton(mean)
    member = np.array([[name.endswith(group) for name in skeleton.frames] for group in GROUPS], float)
    whole = [m for m in bodies if m is not None and np.isfinite(_lengths(m)).all()]
    if len(whole) < 3:
        return np.zeros((0, member.shape[1] + 1))
    each = np.array([spans(own_proportions(m)) for m in whole])
    factors = each / each.mean(axis=0) - 1
    effect = _effect(skeleton.sections(), pose, member)
    metric = np.asarray(np.linalg.cholesky(effect + 1e-9 * np.eye(len(GROUPS))), float)
    _, singular, right = np.linalg.svd((factors - factors.mean(axis=0)) @ metric, full_matrices=False)
    kept = min(count, len(whole) - 2)
    rows = right[:kept] @ np.linalg.inv(metric) * (singular[:kept, None] / np.sqrt(len(whole) - 1))
    leg = np.array([0, 0, 0, 0, mean.thigh, mean.shank, mean.sole]) / (mean.thigh + mean.shank + mean.sole)
    table = np.concatenate([rows @ member, (rows @ leg)[:, None]], axis=1)
    sign = np.sign(table[np.arange(kept), np.abs(table).argmax(axis=1)])
    return np.asarray(np.clip(table * sign[:, None], -LARGEST, LARGEST))


def _lengths(m: Measures) -> Floats:
    return np.concatenate([m.hip.ravel(), m.upper_arm, m.forearm, m.thigh, m.shank, m.foot, [m.neck]])


def _effect(sections: Mapping[str, Any], pose: Floats, member: Floats) -> Floats:
    """Mean squared displacement (7, 7) of the points by unit changes of the groups, squared statures."""
    base = points(sections, pose)
    moves = []
    for row in member:
        changed = {**sections, "PROP": np.append(row, 0.0)[None] * STEP}
        moves.append(((points(changed, pose, [1.0]) - base) / STEP).ravel())
    return np.asarray(np.array(moves) @ np.array(moves).T / (base.size / 3))
