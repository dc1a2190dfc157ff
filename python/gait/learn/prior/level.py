"""Components that keep the feet on the floor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gait.body.skeleton import SIDES, points
from gait.io import blob
from gait.learn.arrays import Floats
from gait.learn.prior.model import DIGITS, rounded

_STANDING = 1 / 3  # share of the phases: those in which the lowest foot is lowest


def level_components(own: Mapping[str, blob.Array], body: Mapping[str, blob.Array]) -> blob.Array:
    """Return CURV (1 + q, T, M) whose components leave the feet as high as the mean curves have them.

    Learnt from people whose legs are longer or shorter than the skeleton's, a component has the height of
    their pelvis but not their legs: it moves the feet above or below the floor, and a single camera takes
    that for distance.  The mean of `root_height` over the stride follows the skeleton's legs instead; its
    course within the stride is kept.

    Parameters
    ----------
    own : mapping
        Sections with CURV (1 + q, T, M).
    body : mapping
        Sections with the same channels and the skeleton that walks.
    """
    curves = np.asarray(own["CURV"], float)
    names, column = blob.unpack_names(body["PTNM"]), blob.unpack_names(body["CHNM"]).index("root_height")
    feet = [names.index(f"{side}_{part}") for side in SIDES for part in ("heel", "toe")]

    def lowest(channels: Floats) -> Floats:
        """Return the height of the lowest heel or toe (T,), statures."""
        return np.asarray(points(body, channels)[:, feet, 2].min(axis=1) + channels[:, column])

    mean = curves[0].copy()
    standing = np.argsort(np.round(lowest(mean), DIGITS), kind="stable")[: round(_STANDING * len(mean))]
    for component in curves[1:]:
        change = 0.5 * (lowest(mean + component) - lowest(mean - component))
        component[:, column] -= np.round(change[standing].mean(), DIGITS)
    return rounded(curves)
