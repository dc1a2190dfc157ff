"""Calibrate a lens from pictures of a board in many poses (Zhang 2000, with OpenCV), and check the result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.board import Board, Grey, blur, other_board
from gait.camera.camera import Camera
from gait.counts import count_of
from gait.errors import UserError
from gait.io.files import require_file
from gait.io.video import Video

Array = NDArray[np.float64]

FEWEST_POSES, MOST_POSES = 6, 40  # fewest and most pictures, of different poses, of a calibration
_SEARCHED_FPS = 8.0  # frames per second of a film that are searched
_BLURRED = 6.0  # pixels; width of edges from which a picture counts as blurred
_LEAST_POSE_DIFFERENCE = 0.12  # least difference between poses: fractions of the picture, and sines of tilts
_WIDTH = 1280.0  # pixels along the longer side; in larger pictures the limits in pixels grow in proportion
_RMS = 1.0  # pixels; largest reprojection error
_FOCAL_SD = 0.02  # largest standard deviation, as a fraction of the focal length
_CHANGED = 0.02  # change of the focal length that is refused, in addition to three standard deviations
_OFF_MIDDLE = 0.15  # largest offset of the principal point, as a fraction of the picture
_WRONG_PICTURE = (
    3.0,
    0.5,
)  # a picture is left out if its error exceeds this many times the median, and these pixels
_CORNER = 0.3  # size of a corner of the picture, as a fraction of its sides
_TILT, _LEAST_TILT = 15.0, 20.0  # degrees: tilt to each side asked for; range of tilts below which we refuse
_NEAR_WIDTH, _NEARER = 0.4, 1.3  # length of the board over that of the picture; nearest over farthest
_TRIED = 5  # pictures searched for another kind of board


@dataclass(frozen=True)
class View:
    """A board found in picture number `order`: its corners' numbers (n,) and pixels (n, 2)."""

    order: int
    name: str
    number: NDArray[np.int64]
    uv: Array
    blur: float
    pose: Array  #: approximate: middle (2) and size as fractions of the picture, sines of two tilts


@dataclass(frozen=True)
class Lens:
    """A calibrated lens.

    Attributes
    ----------
    camera : Camera
        At the origin.
    focal_sd : float
        Standard deviation of the focal length, pixels.
    views : tuple of View
        The views used, in the order of the pictures.
    error : ndarray of shape (V,)
        Reprojection error of each view, pixels rms.
    left_out : tuple of str
        Views that did not fit the others.
    tried, blurred : int
        Number of pictures searched for the board; number of these in which it was blurred.
    missing : tuple of str
        Poses that would make the calibration more precise, in words.
    """

    camera: Camera
    focal_sd: float
    views: tuple[View, ...]
    error: Array
    left_out: tuple[str, ...] = ()
    tried: int = 0
    blurred: int = 0
    missing: tuple[str, ...] = ()

    @property
    def rms(self) -> float:
        """Reprojection error over all corners, pixels rms."""
        weights = [len(view.uv) for view in self.views]
        return float(np.sqrt(np.average(self.error**2, weights=weights)))

    @property
    def fov(self) -> tuple[float, float]:
        """Horizontal and vertical field of view, degrees, without distortion."""
        c = self.camera
        across, down = (
            2 * np.degrees(np.arctan(0.5 * n / f)) for n, f in ((c.width, c.fx), (c.height, c.fy))
        )
        return float(across), float(down)


def calibrate_film(video: Video, board: Board, progress: Callable[[int], None]) -> Lens:
    """Calibrate from a film in which the board or the camera moves; errors as in `calibrate_pictures`."""
    step = max(1, round(video.fps / _SEARCHED_FPS))
    wanted = range(0, video.count, step)

    def pictures() -> Iterator[tuple[str, Grey]]:
        for frame in video.frames(grey=True):
            progress(frame.number)
            if frame.number in wanted:
                yield f"frame {frame.number}", frame.image

    return _calibrate(str(video.path), pictures(), board, video.size)


def calibrate_pictures(paths: Sequence[str], board: Board, progress: Callable[[int], None]) -> Lens:
    """Calibrate from pictures of the same size.

    Raises
    ------
    UserError
        If a picture cannot be read or has another size, or the calibration would be bad; with the remedy.
    """
    size = read_picture(paths[0]).shape[::-1]

    def pictures() -> Iterator[tuple[str, Grey]]:
        for done, path in enumerate(paths):
            grey = read_picture(path)
            if grey.shape[::-1] != size:
                turned = ", turned by 90 degrees" if grey.shape == size else ""
                raise UserError(
                    f"{path}: is {grey.shape[1]}x{grey.shape[0]}{turned}, and {paths[0]} is "
                    f"{size[0]}x{size[1]}; calibrate each size separately"
                )
            progress(done)
            yield path, grey

    where = paths[0] if len(paths) == 1 else f"{len(paths)} pictures"
    return _calibrate(where, pictures(), board, size)


def read_picture(path: str) -> Grey:
    """Read a picture from a file as grey, rotated as its EXIF data state."""
    require_file(path, "picture")
    grey = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise UserError(f"{path}: cannot be read as a picture; give JPEG or PNG, or one film")
    return np.asarray(grey, np.uint8)


def _calibrate(where: str, pictures: Iterator[tuple[str, Grey]], board: Board, size: tuple[int, int]) -> Lens:
    sharp, blurred, tried, others = list[View](), 0, 0, list[str]()
    for name, grey in pictures:
        tried += 1
        found = board.find(grey)
        if found is None:
            if not sharp and not blurred and tried <= _TRIED and (other := other_board(grey, board)):
                others.append(f"{name} {other}")
            continue
        number, uv = found
        width = blur(grey, board, number, uv)
        if width > _BLURRED * max(1.0, max(size) / _WIDTH):
            blurred += 1
        else:
            sharp.append(View(tried, name, number, uv, width, _pose(board, number, uv, size)))
    views = sorted(different(sharp), key=lambda view: view.order)
    if len(views) < FEWEST_POSES:
        raise UserError(f"{where}: {_too_few(board, len(sharp), len(views), blurred, tried, others)}")
    lens = _without_wrong(board, views, size)
    _require_good(where, board, lens)
    _require_one_focal(where, board, lens)
    return replace(lens, tried=tried, blurred=blurred, missing=tuple(missing(board, lens)))


def _too_few(
    board: Board, sharp: int, different: int, blurred: int, tried: int, others: Sequence[str]
) -> str:
    """Describe why there are too few usable pictures, and the remedy."""
    if sharp + blurred == 0:
        return (
            others[0]
            if others
            else (f"no {board} in {tried} pictures; show all of it, flat and evenly lit, or give --board")
        )
    if sharp < FEWEST_POSES and blurred > sharp:
        return (
            f"the board is blurred in {blurred} of {sharp + blurred} pictures; move it slowly, in good "
            "light, and stop at each pose"
        )
    return (
        f"the board is seen sharply in {count_of(different, 'pose')}, {FEWEST_POSES} are needed; "
        "show it in 10 or more: in every corner of the picture, tilted to all sides, near and far"
    )


def different(views: Sequence[View]) -> list[View]:
    """Choose at most `MOST_POSES` views whose poses differ, sharp ones first."""
    left = sorted(views, key=lambda view: view.blur)
    if not left:
        return []
    chosen, poses = [left[0]], np.array([view.pose for view in left])
    apart = np.linalg.norm(poses - poses[0], axis=1)
    while len(chosen) < MOST_POSES:
        far = apart > _LEAST_POSE_DIFFERENCE
        if not far.any():
            break
        score = np.where(far, apart - 0.02 * np.array([view.blur for view in left]), -np.inf)
        k = int(score.argmax())
        chosen.append(left[k])
        apart = np.minimum(apart, np.linalg.norm(poses - poses[k], axis=1))
    return chosen


def _pose(board: Board, number: NDArray[np.int64], uv: Array, size: tuple[int, int]) -> Array:
    """Estimate a board's pose roughly, assuming a focal length equal to the longer side of the picture."""
    focal = float(max(size))
    matrix = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
    _, turn, _ = cv2.solvePnP(board.corners[number], uv, matrix, np.zeros(5), flags=cv2.SOLVEPNP_IPPE)
    normal = np.asarray(cv2.Rodrigues(turn)[0])[:, 2]
    normal = normal if normal[2] > 0 else -normal
    middle, long = uv.mean(axis=0) / size, np.ptp(uv, axis=0).max() / max(size)
    return np.array([*middle, long, *normal[:2]])


def _without_wrong(board: Board, views: Sequence[View], size: tuple[int, int]) -> Lens:
    """Calibrate, then again without the views that do not fit the others."""
    first = fit(board, views, size)
    times, pixels = _WRONG_PICTURE
    limit = max(times * float(np.median(first.error)), pixels * max(1.0, max(size) / _WIDTH))
    kept = [view for view, error in zip(views, first.error, strict=True) if error <= limit]
    if len(kept) == len(views) or len(kept) < FEWEST_POSES:
        return first
    names = tuple(view.name for view in views if view not in kept)
    return replace(fit(board, kept, size), left_out=names)


def fit(board: Board, views: Sequence[View], size: tuple[int, int]) -> Lens:
    """Calibrate with k1 k2, adding p1 p2, then k3; return the model with the best Bayesian criterion."""
    corners = board.corners.astype(np.float32)
    world = [np.ascontiguousarray(corners[view.number]) for view in views]
    seen = [np.ascontiguousarray(view.uv[:, None], np.float32) for view in views]
    count = 2 * sum(len(view.uv) for view in views)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-10)
    best: tuple[float, Lens] | None = None
    for terms, flags in ((2, cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST), (4, cv2.CALIB_FIX_K3), (5, 0)):
        rms, matrix, lens, _, _, sd, _, error = cv2.calibrateCameraExtended(
            world, seen, size, np.zeros((3, 3)), np.zeros(5), flags=flags, criteria=stop
        )
        fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
        bent = np.asarray(lens, np.float64).ravel()[:5]
        camera = Camera(*size, fx, fy, cx, cy, np.eye(3), np.zeros(3), bent)
        if best is not None and _folds(camera):
            continue
        criterion = count * np.log(max(rms, 1e-6) ** 2) + terms * np.log(count)
        if best is None or criterion < best[0]:
            best = (
                criterion,
                Lens(camera, float(sd[0, 0]), tuple(views), np.asarray(error, np.float64).ravel()),
            )
    assert best is not None
    return best[1]


def _folds(camera: Camera) -> bool:
    """Whether the distortion folds back on itself within the picture."""
    k1, k2, _, _, k3 = camera.distortion
    far = max(
        np.hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)
        for u in (0, camera.width)
        for v in (0, camera.height)
    )
    r = np.linspace(0, far, 200)  # undistorted; the corners show points at most a little nearer
    return bool((1 + 3 * k1 * r**2 + 5 * k2 * r**4 + 7 * k3 * r**6 <= 0).any())


def _require_good(where: str, board: Board, lens: Lens) -> None:
    """Raise UserError for a bad calibration, with the remedy."""
    camera, fault, tilts = lens.camera, "", _tilts(board, lens)
    limit = _RMS * max(1.0, max(camera.size) / _WIDTH)
    off = max(abs(camera.cx / camera.width - 0.5), abs(camera.cy / camera.height - 0.5))
    if lens.rms > limit:
        worst = lens.views[int(lens.error.argmax())].name
        fault = (
            f"the reprojection error of the corners is {lens.rms:.2f} px, worst in {worst}; use "
            "a flat board, one zoom, no stabilisation, and move slowly"
        )
    elif lens.focal_sd > _FOCAL_SD * camera.fx or min(np.ptp(tilts, axis=0)) < _LEAST_TILT:
        fault = (
            "the poses do not determine the focal length; tilt the board by 30 degrees to all four sides: "
            "upper, lower, left and right edge nearer"
        )
    elif off > _OFF_MIDDLE:
        fault = (
            f"the estimated principal point is ({camera.cx:.0f}, {camera.cy:.0f}) of {camera.width}x"
            f"{camera.height}; show the board tilted and in all corners, in pictures that are not cropped"
        )
    elif _folds(camera):
        fault = (
            "the estimated distortion folds back in the corners; show the board in the corners of the picture"
        )
    if fault:
        raise UserError(f"{where}: {fault}")


def _require_one_focal(where: str, board: Board, lens: Lens) -> None:
    """Raise UserError if the earlier and the later pictures have different focal lengths."""
    middle = len(lens.views) // 2
    halves = lens.views[:middle], lens.views[middle:]
    if len(halves[0]) < FEWEST_POSES:
        return
    found = [fit(board, half, lens.camera.size) for half in halves]
    if any(min(np.ptp(_tilts(board, half), axis=0)) < _LEAST_TILT for half in found):
        return
    first, second = (half.camera.fx for half in found)
    sd = float(np.hypot(found[0].focal_sd, found[1].focal_sd))
    if abs(first - second) > _CHANGED * lens.camera.fx + 3 * sd:
        raise UserError(
            f"{where}: the focal length changes from {first:.0f} px in the earlier pictures to {second:.0f} "
            "px in the later ones; film with one zoom and with locked focus"
        )


def missing(board: Board, lens: Lens) -> Iterator[str]:
    """Describe poses that would make the calibration more precise."""
    camera = lens.camera
    uv = np.concatenate([view.uv for view in lens.views]) / camera.size
    for down, row in (("upper", uv[:, 1] < _CORNER), ("lower", uv[:, 1] > 1 - _CORNER)):
        for across, column in (("left", uv[:, 0] < _CORNER), ("right", uv[:, 0] > 1 - _CORNER)):
            if not (row & column).any():
                yield f"the board in the {down} {across} corner of the picture"
    tilts = _tilts(board, lens)
    sides = (
        ("its right edge nearer", tilts[:, 0].max()),
        ("its left edge nearer", -tilts[:, 0].min()),
        ("its lower edge nearer", tilts[:, 1].max()),
        ("its upper edge nearer", -tilts[:, 1].min()),
    )
    for words, most in sides:
        if most < _TILT:
            yield f"the board tilted by 30 degrees, {words}"
    sizes = np.array([view.pose[2] for view in lens.views])
    if sizes.max() < _NEAR_WIDTH:
        yield "the board nearer, so that it fills half of the picture"
    elif sizes.max() < _NEARER * sizes.min():
        yield "the board at another distance"


def _tilts(board: Board, lens: Lens) -> Array:
    """Return the tilts of the boards, shape (V, 2), degrees: right edge nearer, lower edge nearer."""
    found = []
    for view in lens.views:
        world = board.corners[view.number]
        _, turn, _ = cv2.solvePnP(
            world, view.uv, lens.camera.matrix, lens.camera.distortion, flags=cv2.SOLVEPNP_IPPE
        )
        normal = np.asarray(cv2.Rodrigues(turn)[0])[:, 2]
        found.append(normal[:2] if normal[2] > 0 else -normal[:2])
    return np.degrees(np.arcsin(np.clip(found, -1, 1)))
