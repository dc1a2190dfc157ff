"""Frames 0 to 50 of a clip, tracked from a true start, judged as figure 6 of Ormoneit and others (2000)."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from eval_clips import noisy_start
from eval_marks import Marks
from eval_plan import Clip

from gait import Camera, Model, Start, TrackerConfig, Video
from gait.bindings.abi import Mode
from gait.io import blob
from gait.io.video import Frame, Image, read_plate
from gait.paper.scene import Run, Scene, follow, share_lost
from gait.paper.tracking import FIGURE_FRAMES, TAIL, followed, joints_of, picture_height


class Footage:
    """The first frames of a clip in memory, and what is known about them."""

    def __init__(self, clip: Clip) -> None:
        video = Video(clip.video)
        self.clip, self.camera = clip, Camera.read(str(clip.camera), video.size)
        self.frames: list[Frame] = list(video.frames(clip.first, clip.first + FIGURE_FRAMES + 1))
        self.plate: Image | None = None if clip.plate is None else read_plate(clip.plate, video.size)
        self.scene: Scene | None = None
        if clip.truth:
            self.scene = Scene.of(clip.name, self.camera, self.plate, self.frames, str(clip.truth))

    def baselines(self, model: Path) -> dict[str, float]:
        """Errors without any image, mm: the mean pose at the true place, the mean cycle running freely."""
        if self.scene is None:
            return {"static": np.nan, "free": np.nan}
        return self.scene.baselines(blob.decode(model.read_bytes(), str(model)))

    def start(self, seed: int, model: Model) -> Start:
        """True state of the first frame with noise drawn with the seed, or the clip's own."""
        with tempfile.TemporaryDirectory(prefix="gait-") as folder:
            path = Path(folder) / "init.json"
            path.write_text(json.dumps(noisy_start(self.clip, seed, 0.0)))
            return Start.read(path, model)

    def run(self, model: Model, mode: Mode, seed: int, changes: dict[str, Any] | None = None) -> Run:
        """Track once."""
        cv2.setNumThreads(1)
        start = self.start(seed, model)
        config = TrackerConfig.default(mode, seed=seed, **(changes or {}))
        found = follow(model, self.camera, self.plate, config, start, self.frames)
        if self.scene is not None:
            return self.scene.judged(found)
        off = self._marked(found)
        tail = off[-TAIL:][np.isfinite(off[-TAIL:])]
        held = followed(tail, picture_height(self.camera, joints_of(found[:1])), marked=True)
        return Run(np.nan, float(np.nanmedian(off)), held, share_lost(found), float(np.median(tail)))

    def _marked(self, found: list[Any]) -> np.ndarray:
        """Mean distance from the clear marks of each frame, NaN where none is marked."""
        marks = Marks.read(self.clip.marks)
        off = np.full(len(found), np.nan)
        for k, (frame, estimate) in enumerate(zip(self.frames, found, strict=True)):
            row = np.flatnonzero(marks.frames == frame.number)
            if len(row):
                off[k] = np.mean(
                    [self._distance(marks, int(row[0]), j, estimate) for j in _clear(marks, row)]
                )
        return off

    def _distance(self, marks: Marks, row: int, joint: int, estimate: Any) -> float:
        uv = self.camera.project(estimate.joint(marks.joints[joint]))
        return float(np.linalg.norm(uv - marks.uv[row, joint]))


def _clear(marks: Marks, row: np.ndarray) -> list[int]:
    clear = np.flatnonzero(marks.visible[int(row[0])] == 2)
    return [int(j) for j in clear if marks.joints[j] != "head_centre"]
