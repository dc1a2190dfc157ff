"""Variation of proportions between people of the same stature: sections PROP and SHFT of a blob.

One factor scales all lengths of a frame of the skeleton (its points, its limbs, the origins of its children);
shoulders also move independently, as they do not follow the neck.  The sections are the principal components
of these changes, weighted by how far they move the joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gait.body.skeleton import SIDES, Proportions, default_skeleton, points
from gait.learn.arrays import Floats
from gait.learn.solve.retarget import Measures, own_proportions

MOST_LENGTH_COMPONENTS = 4  # components kept, fewer with few subjects
#: Relative change, or shift in statures, per standard deviation; the library accepts 0.1.
LARGEST_CHANGE = 0.09
LENGTH_STEP = 1e-3
#: Ends of the names of frames that change together; three coordinates of the shoulders follow them in a
#: change.
GROUPS = ("pelvis", "torso", "upper_arm", "forearm", "thigh", "shank", "foot")
TORSO = GROUPS.index("torso")
CHANGE_COUNT = len(GROUPS) + 3


def spans(p: Proportions) -> Floats:
    """Return the characteristic length (7,) of each group, statures."""
    return np.array(
        [p.hip[1], p.neck, p.upper_arm, p.forearm, p.thigh, p.shank, float(np.hypot(p.toe[0], p.toe[2]))]
    )


def learn(
    bodies: Sequence[Measures | None], mean: Proportions, pose: Floats, count: int = MOST_LENGTH_COMPONENTS
) -> tuple[Floats, Floats]:
    """Return relative changes of lengths and shifts of origins per standard deviation of each component.

    There is one body per subject; incomplete ones are left out.  Effects on joints are computed at the mean
    curves (T, M).  The changes (p, F + 1) are PROP: of the lengths in each frame, and of the pelvis's height;
    empty with fewer than three subjects.  The shifts (p, F, 3) are SHFT: of the frames' origins, statures.
    """
    whole = [m for m in bodies if m is not None and np.isfinite(_lengths(m)).all()]
    if len(whole) < 3:
        return tables(np.zeros((0, CHANGE_COUNT)), mean)
    changes = _changes(whole)
    metric = np.asarray(np.linalg.cholesky(_effect(mean, pose) + 1e-9 * np.eye(CHANGE_COUNT)), float)
    _, singular, right = np.linalg.svd(changes @ metric, full_matrices=False)
    kept = min(count, len(whole) - 2)
    rows = right[:kept] @ np.linalg.inv(metric) * (singular[:kept, None] / np.sqrt(len(whole) - 1))
    rows *= np.sign(rows[np.arange(kept), np.abs(rows).argmax(axis=1)])[:, None]
    table, shift = tables(rows, mean)
    return np.clip(table, -LARGEST_CHANGE, LARGEST_CHANGE), np.clip(shift, -LARGEST_CHANGE, LARGEST_CHANGE)


def tables(changes: Floats, mean: Proportions) -> tuple[Floats, Floats]:
    """Return PROP (k, F + 1) and SHFT (k, F, 3) of changes (k, 10): relative ones, then the left shoulder."""
    frames = default_skeleton(mean).frames
    member = np.array([[name.endswith(group) for name in frames] for group in GROUPS], float)
    leg = np.array([0, 0, 0, 0, mean.thigh, mean.shank, mean.sole]) / (mean.thigh + mean.shank + mean.sole)
    groups, shoulder = changes[:, : len(GROUPS)], changes[:, len(GROUPS) :]
    shift = np.zeros((len(changes), len(frames), 3))
    for s in SIDES:
        shift[:, frames.index(f"{s}_upper_arm")] = shoulder * (1, 1 if s == "l" else -1, 1)
    return np.concatenate([groups @ member, (groups @ leg)[:, None]], axis=1), shift


def _changes(bodies: Sequence[Measures]) -> Floats:
    """Return differences (n, 10) from the mean: relative lengths, then shoulders relative to the torso."""
    own = [own_proportions(m) for m in bodies]
    each, shoulder = np.array([spans(p) for p in own]), np.array([p.shoulder for p in own])
    factor = each / each.mean(axis=0)
    centre = shoulder.mean(axis=0)
    return np.concatenate([factor - 1, shoulder - factor[:, TORSO : TORSO + 1] * centre], axis=1)


def _lengths(m: Measures) -> Floats:
    ends = [m.hip.ravel(), m.shoulder.ravel()]
    return np.concatenate([*ends, m.upper_arm, m.forearm, m.thigh, m.shank, m.foot, [m.neck]])


def _effect(mean: Proportions, pose: Floats) -> Floats:
    """Return the mean squared displacement (10, 10) of the points by unit changes, squared statures."""
    sections: dict[str, Any] = default_skeleton(mean).sections()
    base = points(sections, pose)
    moves = []
    for row in np.eye(CHANGE_COUNT) * LENGTH_STEP:
        table, shift = tables(row[None], mean)
        moved = points({**sections, "PROP": table, "SHFT": shift}, pose, [1.0])
        moves.append(((moved - base) / LENGTH_STEP).ravel())
    return np.asarray(np.array(moves) @ np.array(moves).T / (base.size / 3))
