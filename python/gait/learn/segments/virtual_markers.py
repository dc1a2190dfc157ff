"""Virtual markers of the default skeleton: its joints, and points on the skin of its limbs (37 in all).

A skin marker is on the surface of a limb, at a share of the way from start to end and in a direction of the
limb's frame (x forward, y left), so that it follows the body's proportions.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gait.body.skeleton import ELLIPSOID, JOINTS, SIDES, Proportions, Skeleton, default_skeleton
from gait.learn.arrays import Floats

FRONT, BACK, LEFT, RIGHT = (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)
_BONES = ("upper_arm", "forearm", "thigh", "shank")

#: Marker to its limb, share of the limb's length from its start, and direction (forward, left).
SKIN: dict[str, tuple[str, float, tuple[float, float]]] = {
    "head_front": ("head", 0.5, FRONT),
    "head_back": ("head", 0.5, BACK),
    "chest_front": ("torso", 0.7, FRONT),
    "chest_back": ("torso", 0.7, BACK),
    "chest_l": ("torso", 0.7, LEFT),
    "chest_r": ("torso", 0.7, RIGHT),
    "pelvis_front_l": ("pelvis", 0.6, (1.0, 1.0)),
    "pelvis_front_r": ("pelvis", 0.6, (1.0, -1.0)),
    "pelvis_back_l": ("pelvis", 0.6, (-1.0, 1.0)),
    "pelvis_back_r": ("pelvis", 0.6, (-1.0, -1.0)),
    **{
        f"{side}_{bone}": (f"{side}_{bone}", 0.5, LEFT if side == "l" else RIGHT)
        for bone in _BONES
        for side in SIDES
    },
}
MARKERS = (*JOINTS, *SKIN)


def marked_skeleton(p: Proportions | None = None) -> Skeleton:
    """Return the default skeleton with all of `MARKERS` as its points."""
    body = default_skeleton(p)
    on_skin = [_on_skin(body, *place) for place in SKIN.values()]
    return replace(
        body,
        points=list(MARKERS),
        point_frames=np.array([*body.point_frames, *(frame for frame, _ in on_skin)], np.int32),
        point_positions=np.concatenate([body.point_positions, [at for _, at in on_skin]]),
    )


def _on_skin(body: Skeleton, limb: str, share: float, direction: tuple[float, float]) -> tuple[int, Floats]:
    """Return the frame of a limb and the point on its surface."""
    index = body.limbs.index(limb)
    (frame, shape), row = body.limb_frames[index], body.limb_shapes[index]
    start, end, (left0, ahead0, left1, ahead1) = row[:3], row[3:6], row[6:]
    left, ahead = left0 + share * (left1 - left0), ahead0 + share * (ahead1 - ahead0)
    if shape == ELLIPSOID:
        round_off = np.sqrt(1 - (2 * share - 1) ** 2)
        left, ahead = left0 * round_off, ahead0 * round_off
    way = np.array(direction) / np.hypot(*direction)
    return int(frame), start + share * (end - start) + (ahead * way[0], left * way[1], 0.0)
