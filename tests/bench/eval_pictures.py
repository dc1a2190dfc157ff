"""Overlays of a run: its worst, median and best frame, with the truth or the marks beside the estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from eval_marks import Marks

from gait import Camera, Model, Video
from gait.overlay import Overlay
from gait.tracker import Estimate
from gait.trackfile import read_truth
from gait.video import Image

if TYPE_CHECKING:
    from eval_run import Result

WIDTH = 640  # of a picture, pixels
_WHITE = (255, 255, 255)


def pictures(
    result: Result, video: Video, camera: Camera, model: Model, estimates: dict[int, Estimate]
) -> list[tuple[str, bytes]]:
    """Caption and JPEG of the worst, median and best frame; first, middle, last without a truth."""
    chosen = _choose(result)
    overlay, out = Overlay(model, camera), {}
    numbers = {number for number, _ in chosen}
    for frame in video.frames(min(numbers), max(numbers) + 1):
        if frame.number in numbers:
            canvas = overlay.draw(frame.image, estimates[frame.number], frame.number)
            _draw_known(result, overlay, canvas, frame.number)
            out[frame.number] = _jpeg(_crop(canvas, camera, estimates[frame.number]))
    return [(words, out[number]) for number, words in chosen if number in out]


def _choose(result: Result) -> list[tuple[int, str]]:
    """Frame numbers and captions."""
    series = result.series
    frames, status = series["frame"], series["status"]
    key, unit = ("root", "mm root") if "root" in series else ("marked_px", "px at the marks")
    if key not in series or not np.isfinite(series[key]).any():
        rows = [0, len(frames) // 2, len(frames) - 1]
        return [(int(frames[i]), f"frame {frames[i]}, {status[i]}") for i in rows]
    order = np.argsort(series[key])
    order = order[np.isfinite(series[key][order])]
    rows = {"worst": order[-1], "median": order[len(order) // 2], "best": order[0]}
    return [
        (int(frames[i]), f"{word}: frame {frames[i]}, {series[key][i]:.0f} {unit}, {status[i]}")
        for word, i in rows.items()
    ]


def _draw_known(result: Result, overlay: Overlay, canvas: Image, number: int) -> None:
    """Truth as a thin white skeleton, marks as white rings, in place."""
    clip = result.job.clip
    if clip.truth is not None:
        truth = read_truth(clip.truth)
        row = np.flatnonzero(truth.frame == number)
        if len(row) and all(name in truth.places for name in overlay.model.joint_names):
            joints = np.stack([truth.places[name][row[0]] for name in overlay.model.joint_names])
            overlay.sticks(canvas, joints, 1, _WHITE)
    elif clip.marks is not None:
        marks = Marks.read(clip.marks)
        for row in np.flatnonzero(marks.frames == number):
            for uv, seen in zip(marks.uv[row], marks.seen[row], strict=True):
                if seen:
                    cv2.circle(canvas, tuple(np.rint(uv).astype(int).tolist()), 6, _WHITE, 1, cv2.LINE_AA)


def _crop(canvas: Image, camera: Camera, estimate: Estimate) -> Image:
    """Large pictures are cut to the person's surroundings; the instrument panel stays at the top left."""
    height, width = canvas.shape[:2]
    if width <= 2 * WIDTH:
        return canvas
    middle = camera.project(estimate.joints.mean(axis=0))
    left = 0 if not np.isfinite(middle).all() else int(np.clip(middle[0] - WIDTH, 0, width - 2 * WIDTH))
    out = canvas[:, left : left + 2 * WIDTH].copy()
    corner = (slice(0, round(0.2 * height)), slice(0, round(0.3 * WIDTH * 2)))
    out[corner] = canvas[corner]
    return out


def _jpeg(image: Image) -> bytes:
    height, width = image.shape[:2]
    small = cv2.resize(image, (WIDTH, round(height * WIDTH / width)), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 80])[1].tobytes()
