"""Path of the pelvis in recordings that show only angles: from legs that stand on the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import CHANNELS, SIDES, Proportions, default_skeleton, points
from gait.learn.cycles.fourier import decode, encode, fourier_basis
from gait.learn.prior.fpca import Components

Floats = npt.NDArray[np.float64]

HEIGHT, FORWARD = CHANNELS.index("root_height"), CHANNELS.index("root_forward")
HARMONICS = 4  # of the pelvis's height within a stride
USUAL = 0.8  # statures per stride, where the legs tell none that a walker has
PLAUSIBLE = (0.3, 1.6)  # statures per stride


def unseen(seen: npt.NDArray[np.bool_]) -> list[str]:
    """Names of the root channels that `grounded` has to make up, for the channels (M,) observed."""
    return [CHANNELS[c] for c in (HEIGHT, FORWARD) if not seen[c]]


def grounded(model: Components, seen: npt.NDArray[np.bool_], proportions: Proportions) -> Components:
    """Give mean curves in own units a height and a speed of the pelvis where no recording (M,) shows them."""
    if not unseen(seen):
        return model
    mean = model.mean.copy()
    height, stride = from_legs(mean, proportions)
    if not seen[HEIGHT]:
        mean[:, HEIGHT] = height
    if not seen[FORWARD]:
        mean[:, FORWARD] = stride
    return replace(model, mean=mean)


def from_legs(mean: Floats, proportions: Proportions) -> tuple[Floats, float]:
    """Height of the pelvis (T,), statures, and statures per stride, of mean curves (T, M).

    The lower of toes and heels is on the ground.  The speed is the median of how fast it moves back under the
    pelvis; `USUAL` if that is not a walker's, as in somebody who marches in place.
    """
    skeleton = default_skeleton(proportions)
    over = {"toe": proportions.sole + proportions.toe[2], "heel": proportions.sole + proportions.heel[2]}
    feet = [skeleton.points.index(f"{s}_{name}") for s in SIDES for name in over]
    place = points(skeleton.sections(), mean)[:, feet]
    below = place[:, :, 2] - np.tile(list(over.values()), len(SIDES))
    basis = fourier_basis(len(mean), HARMONICS)
    height = decode(encode(-below.min(axis=1)[None, :, None], basis), basis, 1)[0, :, 0]
    ahead = place[:, :, 0]
    speed = (np.roll(ahead, 1, axis=0) - np.roll(ahead, -1, axis=0)) / 2 * len(mean)
    stride = float(np.median(np.take_along_axis(speed, below.argmin(axis=1)[:, None], axis=1)))
    return height, stride if PLAUSIBLE[0] <= stride <= PLAUSIBLE[1] else USUAL
