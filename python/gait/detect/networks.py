"""The two networks of BlazePose: one finds people in a picture, one the landmarks of a person in a crop.

Both run in LiteRT (package ``ai-edge-litert``).  Without it the landmark network runs in OpenCV, about half
as fast but with the same results, and OpenCV's detector of upright people replaces the person network, which
OpenCV cannot read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.detect import weights
from gait.detect.shapes import hog_detector
from gait.io.video import Image
from gait.reproducible import one_opencv_thread

Array = NDArray[np.float64]
Network = Callable[[NDArray[np.float32]], dict[str, NDArray[np.float32]]]

_PERSON_SIDE, _CROP_SIDE, _HEAT_SIDE = 224, 256, 64  # inputs, pixels; heat maps, cells
LEAST_SCORE = 0.5
"""Least score of a person in a crop."""
_LANDMARKS = 39  # 33 of the body, then centre and top of the person's circle, then four that are not used
_CENTRE, _TOP = 33, 34
_LEAST_PERSON = 0.5  # score of a box
_SAME_BOX = 0.3  # intersection over union from which boxes are around the same person
_HEAT_RADIUS, _LEAST_HEAT = 3, 0.5
_CROP_MARGIN = 1.25  # side of a crop over the diameter of the person's circle
_THREADS = 2  # threads of LiteRT: faster than one, with the same bits

LANDMARK_JOINTS = {
    "l_shoulder": 11, "r_shoulder": 12, "l_elbow": 13, "r_elbow": 14, "l_wrist": 15, "r_wrist": 16,
    "l_hip": 23, "r_hip": 24, "l_knee": 25, "r_knee": 26, "l_ankle": 27, "r_ankle": 28,
    "l_heel": 29, "r_heel": 30, "l_toe": 31, "r_toe": 32,
}  # fmt: skip
"""Landmarks that are joints of the walking model, by their names there."""


class Crop(NamedTuple):
    """A square of the picture, rotated so that the person in it is upright."""

    centre: Array
    """(u, v), pixels."""
    side: float
    """Pixels."""
    turn: float
    """Radians from the picture's up, clockwise."""


class Person(NamedTuple):
    """One person, as found by the landmark network."""

    score: float
    """Probability that there is a person in the crop."""
    uv: Array
    """Joints in the order of `LANDMARK_JOINTS`, pixels, shape (16, 2)."""
    confidence: Array
    """Probability that each joint is in the picture and not hidden, shape (16,)."""
    crop: Crop
    """Where to search for this person in the next frame."""


def crop_about(centre: Array, top: Array) -> Crop:
    """Make the crop for a person whose circle has this centre and, above it, passes through this point."""
    up = top - centre
    return Crop(centre, float(2.0 * _CROP_MARGIN * np.hypot(*up)), float(np.arctan2(up[0], -up[1])))


def whole_picture(image: Image) -> Crop:
    """Make a crop of the whole picture, for a person who fills it."""
    height, width = image.shape[:2]
    return Crop(np.array([width - 1, height - 1]) / 2, float(max(width, height)), 0.0)


class PersonNetwork:
    """Finds people in a whole picture."""

    def __init__(self) -> None:
        network = _litert(weights.load(weights.PERSON))
        self._find = _windows if network is None else self._boxes
        self._network = network
        self._anchors = _anchors()

    def __call__(self, image: Image, small: bool = True) -> Iterator[list[Crop]]:
        """Search the whole picture, then smaller parts; for each size yield the people, most certain first.

        `small`: also search parts of half its shorter side.
        """
        height, width = image.shape[:2]
        side = min(height, width)
        for part in dict.fromkeys((max(height, width), side, *([side // 2] if small else []))):
            found = [crop for box in _tiles(width, height, part) for crop in self._find_in(image, box)]
            yield [crop for _, crop in _apart(sorted(found, key=lambda f: -f[0]))]

    def _find_in(self, image: Image, box: tuple[int, int, int, int]) -> list[tuple[float, Crop]]:
        x, y, right, bottom = box
        found = self._find(image[y:bottom, x:right])
        return [(score, crop._replace(centre=crop.centre + (x, y))) for score, crop in found]

    def _boxes(self, image: Image) -> list[tuple[float, Crop]]:
        """Return score and crop of every person that the network finds in a picture."""
        assert self._network is not None
        scale = _PERSON_SIDE / max(image.shape[:2])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        square = np.zeros((_PERSON_SIDE, _PERSON_SIDE, 3), np.float32)
        offset = np.array([_PERSON_SIDE - small.shape[1], _PERSON_SIDE - small.shape[0]]) // 2
        square[offset[1] :, offset[0] :][: small.shape[0], : small.shape[1]] = small[..., ::-1] / 127.5 - 1.0
        out = self._network(square[None])
        score = _sigmoid(out["Identity_1"][0, :, 0])
        sure = np.flatnonzero(score > _LEAST_PERSON)
        # Centre, size and four points of each box, in the picture; the size is a difference, not a point.
        points = out["Identity"][0][sure].reshape(-1, 6, 2).astype(np.float64)
        points[:, (0, 2, 3, 4, 5)] += self._anchors[sure, None] * _PERSON_SIDE - offset
        return _merged(score[sure], points / scale)


class LandmarkNetwork:
    """Finds the landmarks of the person in a crop.

    Parameters
    ----------
    name : str
        ``full``, ``lite`` or ``heavy``.

    Raises
    ------
    UserError
        If its weights are missing or damaged.
    """

    def __init__(self, name: str = "full") -> None:
        data = weights.load(weights.LANDMARK_NETWORKS[name])
        self._network = _litert(data) or _opencv(data)

    def __call__(self, image: Image, crop: Crop) -> Person:
        """Find the person in a crop of a BGR picture."""
        scale = crop.side / _CROP_SIDE
        turn = scale * np.array(
            [[np.cos(crop.turn), -np.sin(crop.turn)], [np.sin(crop.turn), np.cos(crop.turn)]]
        )
        shift = crop.centre - turn @ np.full(2, (_CROP_SIDE - 1) / 2)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        square = cv2.warpAffine(image, np.column_stack([turn, shift]), (_CROP_SIDE, _CROP_SIDE), flags=flags)
        out = self._network((square[None, ..., ::-1] / 255.0).astype(np.float32))
        marks = out["Identity"].reshape(_LANDMARKS, 5)
        place = _refined(marks[:, :2].astype(np.float64), out["Identity_3"][0]) @ turn.T + shift
        joints = list(LANDMARK_JOINTS.values())
        confidence = _sigmoid(marks[:, 3]) * _sigmoid(marks[:, 4])
        return Person(
            float(out["Identity_1"].ravel()[0]),
            place[joints],
            confidence[joints],
            crop_about(place[_CENTRE], place[_TOP]),
        )


def _sigmoid(x: NDArray[np.float32]) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(x.astype(np.float64), -100.0, 100.0))))


def _refined(place: Array, heat: NDArray[np.float32]) -> Array:
    """Replace regressed positions in use by the centres of the heat maps around them, if there is a peak."""
    cell = _CROP_SIDE / _HEAT_SIDE
    for j in (*LANDMARK_JOINTS.values(), _CENTRE, _TOP):
        x, y = (place[j] / cell).astype(int)
        rows = slice(max(y - _HEAT_RADIUS, 0), max(y + _HEAT_RADIUS + 1, 0))
        columns = slice(max(x - _HEAT_RADIUS, 0), max(x + _HEAT_RADIUS + 1, 0))
        warm = _sigmoid(heat[rows, columns, j])
        if warm.size and warm.max() >= _LEAST_HEAT:
            u = np.arange(columns.start, columns.start + warm.shape[1])
            v = np.arange(rows.start, rows.start + warm.shape[0])[:, None]
            place[j] = cell * np.array([(warm * u).sum(), (warm * v).sum()]) / warm.sum()
    return place


def _anchors() -> Array:
    """Centres of the person network's anchors, fractions of its input: 2, 2, 6 per 8, 16, 32 pixels."""
    grids = []
    for stride, count in ((8, 2), (16, 2), (32, 6)):
        cells = _PERSON_SIDE // stride
        v, u = np.mgrid[:cells, :cells]
        grids.append(np.repeat(np.stack([u.ravel(), v.ravel()], axis=1) + 0.5, count, axis=0) / cells)
    return np.concatenate(grids)


def _merged(score: Array, points: Array) -> list[tuple[float, Crop]]:
    """Average overlapping boxes, weighted by score (n; n x 6 x 2: centre, size, four points)."""
    found = []
    left = np.argsort(-score, kind="stable")
    while len(left):
        low = points[left, 0] - points[left, 1] / 2
        high = points[left, 0] + points[left, 1] / 2
        shared = np.prod(np.clip(np.minimum(high, high[0]) - np.maximum(low, low[0]), 0, None), axis=1)
        area = np.prod(points[left, 1], axis=1)
        same = shared > _SAME_BOX * (area + area[0] - shared)
        same[0] = True
        mean = np.average(points[left[same]], axis=0, weights=score[left[same]])
        found.append((float(score[left[0]]), crop_about(mean[2], mean[3])))
        left = left[~same]
    return found


def _near(crop: Crop, others: Sequence[Crop]) -> bool:
    """Whether a crop is around the same person as one of the others."""
    return any(np.hypot(*(crop.centre - other.centre)) < other.side / 6 for other in others)


def _apart(found: list[tuple[float, Crop]]) -> list[tuple[float, Crop]]:
    """Leave out crops around the same person as an earlier one, since parts of the picture overlap."""
    kept: list[tuple[float, Crop]] = []
    for score, crop in found:
        if not _near(crop, [other for _, other in kept]):
            kept.append((score, crop))
    return kept


def _tiles(width: int, height: int, side: int) -> list[tuple[int, int, int, int]]:
    """Cover a picture with squares (left, top, right, bottom) that overlap by half."""

    def starts(length: int) -> list[int]:
        count = max(1, int(np.ceil(2 * length / side)) - 1)
        return [int(s) for s in np.linspace(0, max(length - side, 0), count).round()]

    return [(x, y, x + side, y + side) for y in starts(height) for x in starts(width)]


def _windows(image: Image) -> list[tuple[float, Crop]]:
    """Find upright people with OpenCV's detector (Dalal and Triggs 2005) if the person network cannot run."""
    scale = min(1.0, 640 / max(image.shape[:2]))
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    with one_opencv_thread():
        boxes, votes = hog_detector().detectMultiScale(small, winStride=(8, 8), padding=(16, 16), scale=1.05)
    found = []
    for (x, y, width, height), vote in zip(boxes, np.ravel(votes), strict=True):
        hips = np.array([x + 0.5 * width, y + 0.5 * height]) / scale
        found.append((float(vote), crop_about(hips, hips - (0, 0.5 * height / scale))))
    return found


def _litert(data: bytes) -> Network | None:
    """Load a network in LiteRT; None if the package is not installed."""
    try:
        from ai_edge_litert.interpreter import Interpreter
    except ImportError:
        return None
    with _silenced():
        interpreter = Interpreter(model_content=data, num_threads=_THREADS)
        interpreter.allocate_tensors()
    given = interpreter.get_input_details()[0]["index"]
    results = interpreter.get_output_details()

    def run(x: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
        interpreter.set_tensor(given, x)
        interpreter.invoke()
        return {r["name"]: interpreter.get_tensor(r["index"]) for r in results}

    return run


class _silenced:
    """Keep LiteRT's own start-up messages off stderr."""

    def __enter__(self) -> None:
        self._stderr, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 2)
        os.close(null)

    def __exit__(self, *_: object) -> None:
        os.dup2(self._stderr, 2)
        os.close(self._stderr)


def _opencv(data: bytes) -> Network:
    """Load a network in OpenCV, whose tensors have the channels first."""
    network = cv2.dnn.readNetFromTFLite(np.frombuffer(data, np.uint8))
    names = [
        n for n in network.getUnconnectedOutLayersNames() if n in ("Identity", "Identity_1", "Identity_3")
    ]

    def run(x: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
        network.setInput(np.ascontiguousarray(x.transpose(0, 3, 1, 2)))
        results = (np.asarray(r, np.float32) for r in network.forward(names))
        out = dict(zip(names, results, strict=True))
        out["Identity_3"] = out["Identity_3"].transpose(0, 2, 3, 1)
        return out

    return run
