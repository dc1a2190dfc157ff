"""What Leventon and Freeman (1998) print, in numpy: the independent reference of the C core in tests."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from gait.lift.observe import Rows
from gait.lift.posterior import Gaussian, system

Floats = npt.NDArray[np.float64]


def dual(gaussian: Gaussian, rows: Rows) -> tuple[Floats, Floats, float]:
    """Eqs. 5 and 6 with a matrix of the measurements' size: alpha, covariance and log evidence."""
    s = system(gaussian, rows)
    wide = s.design @ s.design.T + np.eye(len(s.y))
    gain = np.linalg.solve(wide, s.design).T
    alpha, covariance = gain @ s.y, np.eye(len(gaussian.modes)) - gain @ s.design
    spread = np.linalg.slogdet(wide)[1] - 2 * np.log(np.linalg.det(s.whiten)).sum()
    fit = s.y @ (s.y - s.design @ alpha)
    return alpha, covariance, -0.5 * float(fit + spread + len(s.y) * np.log(2 * np.pi))


def log10_volume(gaussian: Gaussian, rows: Rows) -> float:
    """log10 sqrt(det Q / det Lambda) in closed form: -1/2 sum log10(1 + s_i^2), s of the whitened design."""
    s = np.linalg.svd(system(gaussian, rows).design, compute_uv=False)
    return float(-0.5 * np.log10(1 + s**2).sum())


def likelihood_only(gaussian: Gaussian, rows: Rows) -> Floats:
    """Segment (F, J, 3) in the span of the modes that fits the measurements best, whatever the prior says.

    Of all that do, the one nearest to the mean (least squares of minimum norm); the deviations of the
    observations weigh them, the prior has no part.
    """
    norm = np.linalg.norm(gaussian.modes.reshape(len(gaussian.modes), -1), axis=1)
    unit = gaussian.modes / norm[:, None, None, None]
    weight = 1 / np.sqrt(rows.variance)
    design = np.einsum("nai,mni->nam", rows.direction, unit[:, rows.frame, rows.marker])
    y = weight * rows.shifted(gaussian.mean).value
    flat = (design * weight[..., None]).reshape(y.size, -1)
    scores = np.linalg.lstsq(flat, y.ravel(), rcond=1e-10)[0]
    return np.asarray(gaussian.mean + np.tensordot(scores, unit, 1))
