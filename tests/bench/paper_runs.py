"""Frames 0 to 50 of a clip, tracked from a true start, judged as figure 6 of Ormoneit and others (2000)."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from eval_clips import noisy_start
from eval_marks import LOST_SHARE, Marks
from eval_plan import Clip

from gait import Camera, Model, Start, Tracker, TrackerConfig, Video
from gait.bindings.abi import Mode, TrackStatus
from gait.body.skeleton import EVAL15
from gait.io import blob
from gait.io.track_file import Joints, read_truth
from gait.io.video import Frame, Image, read_plate
from gait.motion.evaluate import free_run, root_errors, static_pose
from gait.motion.footfalls import strikes_of
from gait.paper.tracking import FRAMES, HELD

TAIL = 10  #: last frames, in which a person who is held is near


@dataclass(frozen=True)
class Run:
    """How far a run is off.

    Attributes
    ----------
    root : float
        Millimetres, root-aligned, median over the frames; NaN without the truth.
    px : float
        Median distance of the joints in the picture.
    held : bool
        In the last frames the joints are on average within a tenth of the person's height in the picture.
    lost : float
        Share of frames that are reported as lost.
    """

    root: float
    px: float
    held: bool
    lost: float


class Footage:
    """The first frames of a clip in memory, with what is known of them."""

    def __init__(self, clip: Clip) -> None:
        video = Video(clip.video)
        self.clip, self.camera = clip, Camera.read(str(clip.camera), video.size)
        self.frames: list[Frame] = list(video.frames(clip.first, clip.first + FRAMES + 1))
        self.plate: Image | None = None if clip.plate is None else read_plate(clip.plate, video.size)
        self.truth: Joints | None = read_truth(clip.truth) if clip.truth else None
        if self.truth is not None:
            self.rows = [self.truth.frame.tolist().index(f.number) for f in self.frames]
            self.true = np.stack([self.truth.places[name] for name in EVAL15], axis=1)[self.rows]
            ends = self.camera.project(self.true[:, [EVAL15.index("head_top"), EVAL15.index("l_ankle")]])
            self.height = float(np.median(np.abs(np.diff(ends[..., 1], axis=1))))

    def baselines(self, model: Path) -> dict[str, float]:
        """Errors without any image, mm: the mean pose at the true place, the mean cycle running free."""
        if self.truth is None:
            return {"static": np.nan, "free": np.nan}
        sections = blob.decode(model.read_bytes(), str(model))
        strikes = strikes_of(self.truth, self.clip.folder / "meta.json")
        still = static_pose(sections, self.truth)[self.rows]
        free = free_run(sections, self.truth, strikes, first=self.rows[0])
        errors = {"static": still, "free": None if free is None else free[self.rows]}
        return {
            name: np.nan if found is None else float(np.median(root_errors(found, self.true)))
            for name, found in errors.items()
        }

    def start(self, seed: int, model: Model) -> Start:
        """True state of the first frame with noise drawn by the seed, or the clip's own."""
        with tempfile.TemporaryDirectory(prefix="gait-") as folder:
            path = Path(folder) / "init.json"
            path.write_text(json.dumps(noisy_start(self.clip, seed, 0.0)))
            return Start.read(path, model)

    def run(self, model: Model, mode: Mode, seed: int, changes: dict[str, Any] | None = None) -> Run:
        """Track once."""
        cv2.setNumThreads(1)
        start = self.start(seed, model)
        config = TrackerConfig.default(mode, seed=seed, **(changes or {}))
        tracker = Tracker(model, self.camera, config, background=self.plate)
        tracker.start(start.mean, start.sd, self.frames[0].utime)
        found = [tracker.step(frame.image, frame.utime) for frame in self.frames]
        lost = float(np.mean([e.status == TrackStatus.LOST for e in found]))
        if self.truth is None:
            off, height = self._marked(found)
            limit, root = LOST_SHARE * height, np.nan
        else:
            joints = np.array([[e.joint(name) for name in EVAL15] for e in found])
            off = np.linalg.norm(self.camera.project(joints) - self.camera.project(self.true), axis=2).mean(1)
            limit, root = HELD * self.height, float(np.median(root_errors(joints, self.true)))
        return Run(root, float(np.nanmedian(off)), bool(np.nanmedian(off[-TAIL:]) < limit), lost)

    def _marked(self, found: list[Any]) -> tuple[np.ndarray, float]:
        """Mean distance from the clear marks of each frame, NaN where none is marked; the person's height."""
        marks = Marks.read(self.clip.marks)
        off = np.full(len(found), np.nan)
        for k, (frame, estimate) in enumerate(zip(self.frames, found, strict=True)):
            row = np.flatnonzero(marks.frames == frame.number)
            if len(row):
                off[k] = np.mean(
                    [self._distance(marks, int(row[0]), j, estimate) for j in _clear(marks, row)]
                )
        return off, marks.height

    def _distance(self, marks: Marks, row: int, joint: int, estimate: Any) -> float:
        uv = self.camera.project(estimate.joint(marks.joints[joint]))
        return float(np.linalg.norm(uv - marks.uv[row, joint]))


def _clear(marks: Marks, row: np.ndarray) -> list[int]:
    clear = np.flatnonzero(marks.visible[int(row[0])] == 2)
    return [int(j) for j in clear if marks.joints[j] != "head_centre"]
