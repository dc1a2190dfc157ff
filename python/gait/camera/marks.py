"""Marks on the floor with measured distances: their coordinates, and the camera that sees them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.camera.placing import Points, place
from gait.errors import UserError

Array = NDArray[np.float64]

_STARTS = 40  # starting points of the search for coordinates
_VIEWS = (20.0, 120.0)  # degrees along the longer side: field of view of an unknown lens
_CLICK = 1.0  # pixels; smallest standard deviation of a click
_UNSURE = 0.1  # largest standard deviation, as a fraction of the focal length
_FEWEST = 5  # points needed to determine the focal length too


def coordinates(count: int, distances: Mapping[tuple[int, int], float]) -> tuple[Array, Array]:
    """Place marks by least squares: the first at the origin, the second on the x axis.

    Parameters
    ----------
    count : int
        Number of marks.
    distances : mapping
        Metres between the marks of a pair (i, j).

    Returns
    -------
    xy : ndarray of shape (count, 2)
        Metres; possibly mirrored, since distances do not determine that.
    off : ndarray of shape (len(distances),)
        Residual of each distance, metres.

    Raises
    ------
    UserError
        If there are too few distances, or they contradict each other.
    """
    from scipy.optimize import least_squares

    pairs, lengths = np.array(list(distances)).reshape(-1, 2), np.array(list(distances.values()), float)
    _require_enough(count, pairs)

    def missed(flat: Array) -> Array:
        at = flat.reshape(count, 2)
        return np.asarray(np.linalg.norm(at[pairs[:, 0]] - at[pairs[:, 1]], axis=1) - lengths)

    rng = np.random.default_rng(1)
    found = [least_squares(missed, rng.normal(0, lengths.max(), 2 * count)) for _ in range(_STARTS)]
    best = min(found, key=lambda one: float(one.cost))
    off = missed(best.x)
    _require_agreement(pairs, lengths, off)
    xy = best.x.reshape(count, 2) - best.x[:2]
    angle = np.arctan2(xy[1, 1], xy[1, 0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return xy @ turn, off


def _letter(mark: int) -> str:
    """Name of a mark on the page: A to Z, then AA, AB ..."""
    return ("" if mark < 26 else chr(64 + mark // 26)) + chr(65 + mark % 26)


def _require_enough(count: int, pairs: NDArray[np.int64]) -> None:
    """Raise UserError if too few distances are given."""
    lacking = 2 * count - 3 - len(pairs)
    if lacking > 0:
        more = f"{lacking} more distance{'s' if lacking > 1 else ''}"
        raise UserError(f"marks: give {more} between {count} marks")
    few = [k for k in range(count) if (pairs == k).sum() < 2]
    if few:
        raise UserError(f"marks: give at least two distances to mark {_letter(few[0])}")


def _require_agreement(pairs: NDArray[np.int64], lengths: Array, off: Array) -> None:
    """Raise UserError if the distances contradict each other."""
    worst = int(np.abs(off).argmax())
    if abs(off[worst]) > 0.05 * lengths[worst] + 0.02:
        i, j = map(_letter, pairs[worst])
        raise UserError(
            f"marks: the distances contradict each other by {abs(off[worst]):.2f} m, above all that between "
            f"{i} and {j}; measure again"
        )


def place_marks(lens: Camera, uv: Array, xy: Array, mirrored: bool = False) -> tuple[Camera, Array, Array]:
    """Place a camera whose lens is known.

    Parameters
    ----------
    lens : Camera
    uv : ndarray of shape (n, 2)
        Pixels of the marks.
    xy : ndarray of shape (n, 2) or (n, 3)
        Metres.
    mirrored : bool
        Whether `xy` may be mirrored; the picture then decides.

    Returns
    -------
    camera : Camera
    off : ndarray of shape (n,)
        Reprojection error of each mark, pixels.
    xy : ndarray of shape (n, 2) or (n, 3)
        Coordinates used: as given, or mirrored.

    Raises
    ------
    UserError
        If no camera pose above the floor fits.
    """
    found, fault = list[tuple[Camera, Array, Array]](), None
    for sign in (1.0, -1.0) if mirrored else (1.0,):
        used = xy * ([1.0, sign] if xy.shape[1] == 2 else [1.0, sign, 1.0])
        world = np.pad(used, ((0, 0), (0, 3 - used.shape[1])))
        try:
            camera, off = place(lens, Points("marks", np.arange(1, len(uv) + 1), uv, world))
        except UserError as error:
            fault = error
            continue
        found.append((camera, off, used))
    if not found:
        assert fault is not None
        raise fault
    return min(found, key=lambda one: float((one[1] ** 2).sum()))


def place_unknown(
    size: tuple[int, int], uv: Array, xy: Array, mirrored: bool = False
) -> tuple[Camera, Array, Array, float]:
    """Place a camera and find its focal length, for a lens without distortion and a centred principal point.

    Returns
    -------
    camera, off, xy
        As in `place_marks`.
    sd : float
        Standard deviation of the focal length, as a fraction of it.

    Raises
    ------
    UserError
        If the marks do not determine it.
    """
    if len(uv) < _FEWEST:
        raise UserError(
            f"marks: {len(uv)} do not determine the focal length; give at least {_FEWEST}, or --lens or --fov"
        )

    def lens(log_focal: float) -> Camera:
        return lens_of(size, float(np.exp(log_focal)))

    def cost(log_focal: float) -> float:
        try:
            return float((place_marks(lens(log_focal), uv, xy, mirrored)[1] ** 2).sum())
        except UserError:
            return 1e12

    best, at_end = _least(cost, size)
    camera, off, used = place_marks(lens(best), uv, xy, mirrored)
    step = 0.02
    rise = 0.5 * (cost(best + step) + cost(best - step)) - cost(best)
    noise = max(_CLICK**2, float((off**2).sum()) / max(1, 2 * len(uv) - 7))
    sd = step * float(np.sqrt(noise / max(rise, 1e-12)))
    if sd > _UNSURE or at_end:
        raise UserError(
            "marks: do not determine the focal length; give --lens (gait calibrate) or --fov, or add marks "
            "much nearer and farther"
        )
    return camera, off, used, sd


def _least(cost: Callable[[float], float], size: tuple[int, int]) -> tuple[float, bool]:
    """Find the log focal length with the least cost, and whether it is at an end of the range searched."""
    from scipy.optimize import minimize_scalar

    longest, shortest = (float(np.log(0.5 * max(size) / np.tan(np.radians(0.5 * view)))) for view in _VIEWS)
    tried = np.linspace(shortest, longest, 30)
    k = int(np.argmin([cost(at) for at in tried]))
    around = tried[max(0, k - 1)], tried[min(len(tried) - 1, k + 1)]
    best = minimize_scalar(cost, bounds=around, method="bounded", options={"xatol": 1e-5}).x
    return float(best), k in (0, len(tried) - 1)


def lens_of(size: tuple[int, int], focal: float) -> Camera:
    """Make a camera at the origin, without distortion and with the principal point in the middle."""
    width, height = size
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, np.eye(3), np.zeros(3))


def floor_lines(camera: Camera, xy: Array) -> list[list[list[float]]]:
    """Project a grid on the floor around the marks, up to 3 m from them, into the picture.

    Parameters
    ----------
    camera : Camera
    xy : ndarray of shape (n, 2)

    Returns
    -------
    list
        Lines of [u, v], pixels.
    """
    step, beyond = 1.0, 3.0  # metres
    low = np.floor((xy.min(axis=0) - beyond) / step) * step
    high = np.ceil((xy.max(axis=0) + beyond) / step) * step
    while ((high - low) / step).max() > 60:
        step *= 2
    found = []
    for k in (0, 1):
        along = np.arange(low[1 - k], high[1 - k] + 0.125, 0.25)
        for at in np.arange(low[k], high[k] + 0.5 * step, step):
            line = np.zeros((len(along), 3))
            line[:, k], line[:, 1 - k] = at, along
            deep = camera.depth(line) > 0.3
            uv = camera.project(line)
            visible = deep & (np.abs(uv - np.array(camera.size) / 2) < np.array(camera.size)).all(axis=1)
            for run in np.split(np.arange(len(along)), np.flatnonzero(np.diff(visible)) + 1):
                if len(run) > 1 and visible[run[0]]:
                    found.append(np.round(uv[run], 1).tolist())
    return found
