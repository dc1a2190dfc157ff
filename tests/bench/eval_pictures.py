"""Overlays of a run: its worst, median and best frame, with the truth or the marks beside the estimate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
from eval_marks import Marks

from gait import Camera, Model, Video
from gait.bindings.estimate import Estimate
from gait.body.skeleton import BONES
from gait.io.track_file import read_truth
from gait.io.video import Image
from gait.report.drawing import Overlay

if TYPE_CHECKING:
    from eval_run import Result

Array = np.ndarray
WIDTH, HEIGHT = 480, 420  # of a picture, pixels
KNOWN = (255, 60, 255)  # colour of truth and marks, BGR
_SPACE = 1.35  # height of the picture in heights of the person


def pictures(
    result: Result, video: Video, camera: Camera, model: Model, estimates: dict[int, Estimate]
) -> list[tuple[str, bytes]]:
    """Caption and JPEG of the worst, median and best frame; of the first, middle and last without a truth."""
    chosen = _choose(result)
    overlay, out = Overlay(model, camera), {}
    numbers = {number for number, _ in chosen}
    for frame in video.frames(min(numbers), max(numbers) + 1):
        if frame.number in numbers:
            estimate, known = estimates[frame.number], _known(result, model, camera, frame.number)
            posed = np.isfinite(estimate.mean.phase)  # a person who stands has joints but no phase
            canvas = overlay.body(frame.image, estimate.mean) if posed else frame.image.copy()
            overlay.skeleton(canvas, estimate.joints)
            shown = np.vstack([camera.project(estimate.joints), known])
            picture, place = _crop(canvas, shown[np.isfinite(shown).all(axis=1)])
            _draw_known(picture, place(known), model.joint_names if result.job.clip.truth else None)
            out[frame.number] = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 82])[1].tobytes()
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


def _known(result: Result, model: Model, camera: Camera, number: int) -> Array:
    """Pixels of the truth in the order of the model's joints, or of the visible marks; NaN where unknown."""
    clip = result.job.clip
    if clip.truth is not None:
        truth = read_truth(clip.truth)
        places = [
            truth.places.get(name, np.full_like(truth.places["pelvis"], np.nan)) for name in model.joint_names
        ]
        row = truth.frame == number
        return camera.project(np.stack(places)[:, row][:, 0]) if row.any() else np.zeros((0, 2))
    if clip.marks is not None:
        marks = Marks.read(clip.marks)
        row = marks.frames == number
        return marks.uv[row][marks.visible[row] > 0]
    return np.zeros((0, 2))


def _crop(canvas: Image, shown: Array) -> tuple[Image, Callable[[Array], Array]]:
    """Picture of the surroundings of the points `shown`, and the function that takes pixels there."""
    height, width = canvas.shape[:2]
    low, high = np.clip([shown.min(axis=0), shown.max(axis=0)], 0, [width - 1, height - 1])
    tall = max(_SPACE * float((high - low)[1]), _SPACE * float((high - low)[0]) * HEIGHT / WIDTH, 60.0)
    scale = HEIGHT / tall
    move = 0.5 * np.array([WIDTH, HEIGHT]) - scale * 0.5 * (low + high)
    picture = cv2.warpAffine(
        canvas, np.array([[scale, 0, move[0]], [0, scale, move[1]]]), (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR
    )
    return np.asarray(picture, np.uint8), lambda uv: scale * uv + move


def _draw_known(picture: Image, uv: Array, names: Sequence[str] | None) -> None:
    """Draw the truth as a thin skeleton of the joints `names`, or marks as rings, in place."""
    if names is None or len(uv) == 0:
        for at in uv[np.isfinite(uv).all(axis=1)]:
            cv2.circle(picture, tuple(np.rint(at).astype(int).tolist()), 5, KNOWN, 1, cv2.LINE_AA)
        return
    at = dict(zip(names, uv, strict=True))
    for a, b in BONES:
        if np.isfinite([at[a], at[b]]).all():
            ends = np.rint([at[a], at[b]]).astype(int).tolist()
            cv2.line(picture, tuple(ends[0]), tuple(ends[1]), KNOWN, 1, cv2.LINE_AA)
