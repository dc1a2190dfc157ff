"""Size of a motion unlike the prior: from the bones, not from the fit.

A motion unlike those learnt fits best as a small body near the lens, where what does not fit is few metres.
A change of size about the lens leaves the picture as it is; so the size may be taken from the bones, whose
lengths per stature hardly depend on what a person does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.lift.smooth.soft_constraints import BONES

Floats = npt.NDArray[np.float64]

PROPORTION_SD = 0.04  # relative, of the bones of people of one stature
UNLIKELY = 2.0  # standard deviations of the size from which a motion that does not fit is not trusted with it
IMPOSSIBLE = 4.0  # and one that fits


@dataclass(frozen=True)
class Resized:
    """Motion whose size and standard deviations were checked.

    Attributes
    ----------
    places, sd, rooted_sd : (T, J, 3)
        Metres, as in `motion.Motion`.
    factor : float
        By which the size was changed; 1 if it is a likely one.
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
    """Whether hips and an ankle are seen in half of the frames: other parts leave the distance open."""
    shares = dict(zip(keypoints.names, keypoints.visible.mean(axis=0).tolist(), strict=True))
    parts = (("l_hip", "r_hip", "pelvis"), ("l_ankle", "r_ankle"))
    return all(max(shares.get(name, 0.0) for name in part) >= 0.5 for part in parts)


def bones_ratio(prior: SegmentPrior, places: Floats, stature: float) -> float:
    """Median over bones and frames of their length in places (T, J, 3) over that of most people; 1 without.

    Parameters
    ----------
    stature : float
        Metres.
    """
    known = [bone for bone in BONES if set(bone) <= set(prior.names)]
    if not known:
        return 1.0
    first, last = (prior.index([bone[end] for bone in known]) for end in (0, 1))
    mean, modes = prior.mean[0], prior.modes[0]
    # the prior has the second moments of what it was learnt from, and so the mean squares of lengths
    squares = ((mean[:, last] - mean[:, first]) ** 2).sum(axis=2)
    squares += ((modes[:, :, last] - modes[:, :, first]) ** 2).sum(axis=(0, 3))
    usual = stature * np.sqrt(squares.mean(axis=0))
    length = np.linalg.norm(places[:, last] - places[:, first], axis=2)
    return float(np.median(np.median(length, axis=0) / usual))


def resized(
    found: Resized, camera: Camera, ratio: float, own: float, chi2: float, limit: float = UNLIKELY
) -> Resized:
    """Divide a motion's size by `ratio` about the lens if it is off by `limit` standard deviations or more.

    Standard deviations grow by the larger of how far off the size was and of the chi2, in standard deviations
    (Birge's ratio), and by the size that the person's own bones may have.

    Parameters
    ----------
    found : Resized
        With standard deviations as the fit has them.
    ratio : float
        Of `bones_ratio`.
    own : float
        Relative standard deviation of the size of one person's bones.
    chi2_per_observation : float
        As in `motion.Motion`.
    """
    off = abs(float(np.log(ratio))) / own
    if off < limit:
        return widened(found, chi2)
    lens = -camera.R.T @ camera.t
    grown = max(off, float(np.sqrt(chi2))) / ratio
    sized = replace(found.grown(grown), places=lens + (found.places - lens) / ratio, factor=1 / ratio)
    return of_any_size(sized, camera, own)


def of_any_size(found: Resized, camera: Camera, own: float) -> Resized:
    """Widen standard deviations by the relative standard deviation `own` of size and distance.

    Covariances stay: neither angles nor the picture depend on it.
    """
    away = found.places - (-camera.R.T @ camera.t)
    rooted = away - away.mean(axis=1, keepdims=True)
    return replace(
        found,
        sd=np.hypot(found.sd, own * np.abs(away)),
        rooted_sd=np.hypot(found.rooted_sd, own * np.abs(rooted)),
    )


def widened(found: Resized, chi2: float) -> Resized:
    """Widen standard deviations by the root of chi2 per observation, if that is above 1."""
    return found.grown(float(np.sqrt(max(chi2, 1.0))))
