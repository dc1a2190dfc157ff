"""The first frames of a clip with known truth, in memory: runs of trackers on them, and their errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gait.bindings.abi import TrackStatus
from gait.bindings.config import TrackerConfig
from gait.bindings.estimate import Estimate
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.io.track_file import Joints, read_truth
from gait.io.video import Frame, Image, Video, background
from gait.learn.arrays import Floats
from gait.motion.evaluate import free_run, root_errors, static_pose
from gait.motion.footfalls import strikes_of
from gait.paper import tracking
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS
from gait.track.tracker import Tracker

PRESET_VIEWS = {"side": "demo", "oblique": "oblique", "toward": "toward"}  # presets by name
VIEW_SIZE_PX = (480, 360)  # pixels of a rendered view
SPARE = 20  # frames after those used, so that the last steps are whole


@dataclass(frozen=True)
class Run:
    """How far a run is off."""

    root: float  #: millimetres, root-aligned, median over the frames; NaN without the truth
    px: float  #: distance of the joints in the picture, pixels, median over the frames
    held: bool  #: in the last frames the joints are near in the picture
    lost: float  #: share of frames that are reported as lost
    last: float  #: distance of the joints in the picture in the last frames, pixels, median


@dataclass(frozen=True)
class Scene:
    """Frames from the start of a clip, its camera and background, and the true joints."""

    name: str
    camera: Camera
    plate: Image | None
    frames: list[Frame]
    truth: Joints  #: of the whole clip
    rows: list[int]  #: of the truth, of the frames
    meta: Path  #: file that may list heel strikes

    @classmethod
    def of(cls, name: str, camera: Camera, plate: Image | None, frames: list[Frame], truth: str) -> Scene:
        """Return frames with the truth of a file; meta.json beside it may list heel strikes."""
        known = read_truth(truth)
        rows = [known.frame.tolist().index(frame.number) for frame in frames]
        return cls(name, camera, plate, frames, known, rows, Path(truth).with_name("meta.json"))

    @property
    def true(self) -> Floats:
        """True joints, EVAL15 (n, 15, 3)."""
        return np.stack([self.truth.places[name] for name in EVAL15], axis=1)[self.rows]

    @property
    def height(self) -> float:
        """Height of the person in the picture from head to ankle, pixels."""
        return tracking.picture_height(self.camera, self.true)

    def cycles(self) -> Floats | None:
        """Return the true phase of the frames without wrapping, strides; None if it is unknown."""
        found = strikes_of(self.truth, self.meta).cycles(self.truth.frame)
        return None if found is None else found[self.rows]

    def baselines(self, sections: dict[str, Any]) -> dict[str, float]:
        """Errors without any image, mm, of a model's sections: mean pose, mean cycle running free; or NaN."""
        free = free_run(sections, self.truth, strikes_of(self.truth, self.meta), first=self.rows[0])
        errors = {"static": static_pose(sections, self.truth), "free": free}
        return {
            name: np.nan if found is None else float(np.median(root_errors(found[self.rows], self.true)))
            for name, found in errors.items()
        }

    def judged(self, found: Sequence[Estimate]) -> Run:
        """Compare the estimates of the frames with the truth."""
        joints = tracking.joints_of(found)
        off = np.linalg.norm(self.camera.project(joints) - self.camera.project(self.true), axis=2).mean(
            axis=1
        )
        root = float(np.median(root_errors(joints, self.true)))
        tail = off[-tracking.TAIL :]
        held = tracking.followed(tail, self.height, marked=False)
        return Run(root, float(np.median(off)), held, share_lost(found), float(np.median(tail)))


def share_lost(found: Sequence[Estimate]) -> float:
    """Return the share of frames that are reported as lost."""
    return float(np.mean([e.status == TrackStatus.LOST for e in found]))


def reported(runs: Sequence[Run], held: bool) -> str:
    """Return in how many of the runs that hold the person, or leave it, some frame is reported as lost."""
    chosen = [run for run in runs if run.held == held]
    return f"{sum(run.lost > 0 for run in chosen)} of {len(chosen)}"


def follow(
    model: Model,
    camera: Camera,
    plate: Image | None,
    config: TrackerConfig,
    start: Start,
    frames: Sequence[Frame],
) -> list[Estimate]:
    """Track the frames."""
    tracker = Tracker(model, camera, config, background=plate)
    tracker.start(start.mean, start.sd, frames[0].utime)
    return [tracker.step(frame.image, frame.utime) for frame in frames]


def rendered(folder: Path, update: Callable[[int], None]) -> list[tuple[Scene, str]]:
    """Render a walk seen from several sides; return scenes, and the init files of their true starts."""
    found = []
    for k, (name, preset) in enumerate(PRESET_VIEWS.items()):
        place, frames = folder / name, tracking.FIGURE_FRAMES + 1
        simulate(replace(PRESETS[preset], size=VIEW_SIZE_PX, frames=frames + SPARE), place, keep=False)
        video = Video(str(place / "video.mp4"))
        camera = Camera.read(str(place / "camera.json"), video.size)
        plate = background(str(place / "background.png"), video)
        shown = list(video.frames(0, frames))
        found.append(
            (Scene.of(name, camera, plate, shown, str(place / "truth.csv")), str(place / "init.json"))
        )
        update(k + 1)
    return found
