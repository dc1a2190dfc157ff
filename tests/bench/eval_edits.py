"""New clips made from simulated ones: frames held, reversed, covered, cut out or joined, with their truth.

Each edit reads the folders of its sources, writes a clip into a new folder, and returns what its meta.json
states in addition to the first source: ``steady`` False if the phase means nothing, ``person`` False if there
is none.
"""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gait import Camera, Video, VideoWriter
from gait.io.track_file import read_truth
from gait.io.video import Image

Edit = Callable[[Sequence[Path], Path], dict[str, Any]]

_NOISE = 2.0  # noise of the sensor on frames that are held, grey levels
_STOP = 50  # frame at which the person of `stopping` freezes
_HIDDEN = (40, 70)  # frames without a view of the person: a second
_DIFFERENT = 24  # grey levels by which a pixel of a person differs from the plate


def standing(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """A person stands in mid-stride from the start."""
    return _held(sources[0], target, [0] * 90)


def stopping(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """A person who freezes."""
    return _held(sources[0], target, [min(n, _STOP) for n in range(_STOP + 60)])


def _held(source: Path, target: Path, picked: list[int]) -> dict[str, Any]:
    frames = _frames(source)
    rng = np.random.default_rng(1)
    shown = (_noisy(frames[n], rng) if i and picked[i - 1] == n else frames[n] for i, n in enumerate(picked))
    _write(source, target, shown, picked)
    return {"steady": False, "difficulty": ["held frames"]}


def backwards(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """A walk played in reverse: the person moves backwards while the body looks forwards."""
    frames = _frames(sources[0])
    order = list(range(len(frames)))[::-1]
    _write(sources[0], target, (frames[n] for n in order), order)
    return {"steady": False, "difficulty": ["time reversed"]}


def hidden(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """A textured screen in front of the person's whole path for a second."""
    source = sources[0]
    screen = cv2.GaussianBlur(np.random.default_rng(2).uniform(40, 215, _plate(source).shape), (0, 0), 4)
    frames = _frames(source)
    for n in range(*_HIDDEN):
        low, high = _box(source, n, 0.12)
        frames[n][low[1] : high[1], low[0] : high[0]] = screen[low[1] : high[1], low[0] : high[0]]
    _write(source, target, frames, list(range(len(frames))))
    return {"difficulty": [f"hidden in frames {_HIDDEN[0]}-{_HIDDEN[1] - 1}"]}


def leaves(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """Only the middle of the picture: the person enters and leaves."""
    source = sources[0]
    camera = Camera.read(str(source / "camera.json"))
    left = camera.width // 4 // 2 * 2
    part = slice(left, camera.width - left)
    frames = _frames(source)
    _write(source, target, (np.ascontiguousarray(f[:, part]) for f in frames), list(range(len(frames))))
    cv2.imwrite(str(target / "background.png"), _plate(source)[:, part])
    data = json.loads((source / "camera.json").read_text())
    data |= {"width": camera.width - 2 * left, "cx": data["cx"] - left}
    (target / "camera.json").write_text(json.dumps(data))
    return {"width": data["width"], "difficulty": ["enters and leaves the picture"]}


def second_person(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """Another person crosses in front, cut out of another clip (and therefore without a shadow)."""
    frames, others, plate = _frames(sources[0]), _frames(sources[1]), _plate(sources[1])
    made = []
    for mine, other in zip(frames, others, strict=True):
        off = np.abs(other.astype(int) - plate.astype(int)).max(axis=2).astype(np.uint8)
        mask = cv2.morphologyEx((off > _DIFFERENT).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((7, 7)))
        _, labels, stats, _ = cv2.connectedComponentsWithStats(mask)
        person = labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()) if len(stats) > 1 else mask > 1
        blurred = cv2.GaussianBlur(person.astype(np.float32), (0, 0), 0.8)[..., None]
        made.append(np.rint(blurred * other + (1 - blurred) * mine).astype(np.uint8))
    _write(sources[0], target, made, list(range(len(made))))
    return {"distractors": ["a second person crosses in front"]}


def no_person(sources: Sequence[Path], target: Path) -> dict[str, Any]:
    """The empty scene, with a start that claims a person."""
    plate, rng = _plate(sources[0]), np.random.default_rng(3)
    _write(sources[0], target, (_noisy(plate, rng) for _ in range(60)), None)
    shutil.copy(sources[0] / "init.json", target / "init.json")
    return {"person": False, "difficulty": ["no_person"]}


def _write(source: Path, target: Path, frames: Iterable[Image], rows: list[int] | None) -> None:
    """Write video, plate, camera and the truth of the source's frames `rows`."""
    with VideoWriter(target / "video.mp4", Video(source / "video.mp4").fps, crf=14) as film:
        for frame in frames:
            film.write(frame)
    for name in ("background.png", "camera.json"):
        shutil.copy(source / name, target / name)
    if rows is None:
        return
    with open(source / "truth.csv", newline="", encoding="utf-8") as file:
        head, *lines = list(csv.reader(file))
    times = [line[1] for line in lines]
    with open(target / "truth.csv", "w", newline="", encoding="utf-8") as file:
        step = float(times[1]) - float(times[0])
        made = [[str(i), f"{i * step:.6f}", *lines[n][2:]] for i, n in enumerate(rows)]
        csv.writer(file, lineterminator="\n").writerows([head, *made])


def _frames(folder: Path) -> list[Image]:
    return [frame.image for frame in Video(folder / "video.mp4").frames()]


def _plate(folder: Path) -> Image:
    return np.asarray(cv2.imread(str(folder / "background.png")), np.uint8)


def _noisy(image: Image, rng: np.random.Generator) -> Image:
    return np.clip(np.rint(image + rng.normal(0, _NOISE, image.shape)), 0, 255).astype(np.uint8)


def _box(folder: Path, frame: int, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners, pixels, of a box around the person's joints at `frame`, wider by `margin` of their height."""
    camera, truth = Camera.read(str(folder / "camera.json")), read_truth(folder / "truth.csv")
    uv = camera.project(truth.eval15()[frame])
    space = margin * np.ptp(uv[:, 1])
    size = [camera.width, camera.height]
    return (
        np.clip(uv.min(axis=0) - space, 0, size).astype(int),
        np.clip(uv.max(axis=0) + space, 0, size).astype(int),
    )
