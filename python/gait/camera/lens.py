"""Approximate lenses with other terms than k1 k2 p1 p2 k3 by a lens with these, if one agrees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gait import extras

Array = NDArray[np.float64]

AGREE = 0.5  #: pixels by which the approximation may differ anywhere in the picture
_CELLS = 40  # points along the longer side of the picture at which lenses are compared
_RETURNS = 1e-3  # pixels by which a pixel may move when converted to a ray and back


def agreeing(
    model: str, coefficients: Array, matrix: Array, size: tuple[int, int]
) -> tuple[Array, float, float] | None:
    """Find the k1 k2 p1 p2 k3 that agree best with another lens over a picture.

    `model`: OpenCV's ``fisheye`` with four coefficients, or ``opencv`` with 8, 12 or 14; `matrix` (3, 3);
    `size`: width and height in pixels.  Returns the coefficients (5,), the factor for the focal lengths, and
    the largest difference in pixels; None if some pixel has no ray in front of the camera, or more than one.
    """
    with extras.importing("gait.Camera", "video"):
        import cv2

    step = max(size) / _CELLS
    u, v = (np.linspace(-0.5, n - 0.5, max(2, round(n / step)) + 1) for n in size)
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 1, 2)
    same = np.eye(3)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    if model == "fisheye":
        rays = cv2.fisheye.undistortPoints(pixels, matrix, coefficients, R=same, P=same, criteria=stop)
        if np.abs(rays).max() > 1e3:  # what OpenCV returns if it finds no ray
            return None
        back = cv2.fisheye.distortPoints(rays, matrix, coefficients)
    else:
        rays = cv2.undistortPointsIter(pixels, matrix, coefficients, same, same, stop)
        world = np.concatenate([rays, np.ones((len(rays), 1, 1))], axis=2)
        back = cv2.projectPoints(world, np.zeros(3), np.zeros(3), matrix, coefficients)[0]
    if not np.abs(back - pixels).max() <= _RETURNS:
        return None
    x, y = rays[:, 0].T
    r2, cross = x * x + y * y, 2 * x * y
    along_u = np.stack([x, x * r2, x * r2**2, cross, r2 + 2 * x * x, x * r2**3], axis=1)
    along_v = np.stack([y, y * r2, y * r2**2, r2 + 2 * y * y, cross, y * r2**3], axis=1)
    terms = np.concatenate([matrix[0, 0] * along_u, matrix[1, 1] * along_v])
    wanted = (pixels[:, 0] - matrix[:2, 2]).T.ravel()
    scale = np.abs(terms).max(axis=0)
    found = np.linalg.lstsq(terms / scale, wanted, rcond=None)[0] / scale
    larger, lens = float(found[0]), found[1:] / found[0]
    new = np.diag([larger, larger, 1.0]) @ matrix
    new[:2, 2] = matrix[:2, 2]
    again = cv2.undistortPointsIter(pixels, new, lens, same, same, stop)[:, 0]
    inverse = np.abs((again - rays[:, 0]) * np.diag(new)[:2]).max()  # rays must also be found from pixels
    return lens, larger, float(max(np.abs(terms @ found - wanted).max(), inverse))
