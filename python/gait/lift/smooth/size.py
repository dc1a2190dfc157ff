"""Size of a motion unlike the prior, from the bones instead of the fit.

A motion unlike those in training fits best as a small body near the lens, where its residuals are fewer
metres. Scaling it about the lens does not change the picture, so the size can be taken from the bones, whose
lengths relative to the stature hardly depend on what a person does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.lift.smooth.soft_constraints import LIMB_BONES

Floats = npt.NDArray[np.float64]

PROPORTION_SD = 0.04  # relative sd of bones among people of one stature
UNLIKELY = 2.0  # standard deviations of the size from which a motion that does not fit is resized
IMPOSSIBLE = 4.0  # the same for a motion that fits


@dataclass(frozen=True)
class Resized:
    """Motion after a check of its size and standard deviations.

    Attributes
    ----------
    places, sd, rooted_sd : (T, J, 3)
        Metres, as in `motion.Motion`.
    factor : float
        Factor by which the size was changed; 1 if it was plausible.
    covariance : (T, 3 J, 3 J) or None
        As in `motion.Motion`.
    """

    places: Floats
    sd: Floats
    rooted_sd: Floats
    factor: float = 1.0
    covariance: Floats | None = None

    def grown(self, factor: float) -> Resized:
        """Multiply the standard deviations."""
        wider = None if self.covariance is None else factor**2 * self.covariance
        return replace(self, sd=factor * self.sd, rooted_sd=factor * self.rooted_sd, covariance=wider)


def shows_distance(keypoints: Keypoints) -> bool:
    """Whether hips and an ankle are visible in half of the frames; other parts do not determine distance."""
    shares = dict(zip(keypoints.names, keypoints.visible.mean(axis=0).tolist(), strict=True))
    parts = (("l_hip", "r_hip", "pelvis"), ("l_ankle", "r_ankle"))
    return all(max(shares.get(name, 0.0) for name in part) >= 0.5 for part in parts)


def bones_ratio(prior: SegmentPrior, places: Floats, stature: float) -> float:
    """Median over bones and frames of the length in `places` (T, J, 3) over that of most people.

    It is 1 if the prior has no bones.

    Parameters
    ----------
    stature : float
        Metres.
    """
    known = [bone for bone in LIMB_BONES if set(bone) <= set(prior.names)]
    if not known:
        return 1.0
    first, last = (prior.index([bone[end] for bone in known]) for end in (0, 1))
    mean, modes = prior.mean[0], prior.modes[0]
    # the prior has the second moments of its training set, and so the mean squares of lengths
    squares = ((mean[:, last] - mean[:, first]) ** 2).sum(axis=2)
    squares += ((modes[:, :, last] - modes[:, :, first]) ** 2).sum(axis=(0, 3))
    usual = stature * np.sqrt(squares.mean(axis=0))
    length = np.linalg.norm(places[:, last] - places[:, first], axis=2)
    return float(np.median(np.median(length, axis=0) / usual))


def resized(
    found: Resized, camera: Camera, ratio: float, own: float, chi2: float, limit: float = UNLIKELY
) -> Resized:
    """Divide a motion's size by `ratio` about the lens if it is off by `limit` standard deviations or more.

    Standard deviations are multiplied by the larger of the error of the size, in standard deviations, and the
    root of chi2 (Birge's ratio), and then increased by the variation of people's bones.

    Parameters
    ----------
    found : Resized
        Motion with the standard deviations of the fit.
    ratio : float
        From `bones_ratio`.
    own : float
        Relative standard deviation of the size of one person's bones.
    chi2 : float
        `chi2_per_observation` as in `motion.Motion`.
    """
    off = abs(float(np.log(ratio))) / own
    if off < limit:
        return widened(found, chi2)
    lens = -camera.R.T @ camera.t
    grown = max(off, float(np.sqrt(chi2))) / ratio
    sized = replace(found.grown(grown), places=lens + (found.places - lens) / ratio, factor=1 / ratio)
    return of_any_size(sized, camera, own)


def of_any_size(found: Resized, camera: Camera, own: float) -> Resized:
    """Increase standard deviations by the relative standard deviation `own` of size and distance.

    Covariances are unchanged, as neither angles nor the picture depend on size.
    """
    away = found.places - (-camera.R.T @ camera.t)
    rooted = away - away.mean(axis=1, keepdims=True)
    return replace(
        found,
        sd=np.hypot(found.sd, own * np.abs(away)),
        rooted_sd=np.hypot(found.rooted_sd, own * np.abs(rooted)),
    )


def widened(found: Resized, chi2: float) -> Resized:
    """Multiply standard deviations by the root of chi2 per observation, if that is above 1."""
    return found.grown(float(np.sqrt(max(chi2, 1.0))))
