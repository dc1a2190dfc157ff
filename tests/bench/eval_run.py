"""One run: track a clip through the public Python API and judge the track file."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import eval_marks
import eval_measures
import eval_pictures
import numpy as np
from eval_clips import noisy_start
from eval_plan import Clip, Job

from gait import Camera, Model, Start, Tracker, TrackerConfig, UserError, Video
from gait.bindings.abi import Mode
from gait.bindings.estimate import Estimate
from gait.bindings.library import library
from gait.bindings.model import read_blob
from gait.errors import GaitError
from gait.io import blob
from gait.io.track_file import Track, TrackWriter, read_track, read_truth
from gait.io.video import Frame, Image, median_plate, read_plate
from gait.motion.evaluate import evaluate
from gait.motion.footfalls import Strikes, strikes_of
from gait.track.box_start import BoxStart
from gait.track.clip import track_scene
from gait.track.first_state import first_state
from gait.track.options import ClipOptions
from gait.track.read_scene import read_scene


@dataclass
class Result:
    """What a job produced.

    Attributes
    ----------
    measures : dict
        Those of `gait eval`, `eval_measures` and `eval_marks`; empty after a failure.
    series : dict of str to ndarray
        Frame by frame, for the plots.
    pictures : list of (str, bytes)
        Caption and JPEG.
    failure : str
        The one line with which the tracker or the start failed, if it did.
    """

    job: Job
    measures: dict[str, Any] = field(default_factory=dict)
    series: dict[str, np.ndarray] = field(default_factory=dict)
    pictures: list[tuple[str, bytes]] = field(default_factory=list)
    failure: str = ""


class Thinned(Video):
    """Every n-th frame of a video, with the numbers and times they have there."""

    def __init__(self, clip: Clip, every: int) -> None:
        super().__init__(clip.video)
        self._first, self._every = clip.first, every

    def frames(self, start: int = 0, stop: int | None = None, *, grey: bool = False) -> Iterator[Frame]:
        """Yield the chosen frames from `start` on."""
        for frame in super().frames(start, stop, grey=grey):
            if (frame.number - self._first) % self._every == 0:
                yield frame


@dataclass
class _Kept:
    """What the run keeps of each frame in addition to the track file."""

    estimates: dict[int, Estimate] = field(default_factory=dict)
    nees: list[float] = field(default_factory=list)
    step_ms: float = 0.0


def run(job: Job) -> Result:
    """Track and judge; an error caused by input is a result and does not end the evaluation."""
    cv2.setNumThreads(1)  # jobs run side by side
    library()  # a library that does not load is no result
    try:
        return _run(job)
    except (UserError, GaitError) as exc:
        return Result(job, failure=str(exc))


def _run(job: Job) -> Result:
    clip, arm = job.clip, job.arm
    video = Thinned(clip, arm.every)
    camera, model = Camera.read(str(clip.camera), video.size), Model(job.model)
    kept = _from_truth(job, video, camera, model) if arm.init == "truth" else _as_gait_track(job)
    track = read_track(job.track)
    result = _judge(job, track, camera)
    phase_sd = np.array([kept.estimates[n].sd.phase for n in track.frame.tolist()])
    result.measures |= {
        "frames": len(track.frame),
        "first": int(track.frame[0]),
        "nees": float(np.median(kept.nees)) if kept.nees else None,
        "step_ms": {"median": kept.step_ms},
        **eval_measures.phase_interval(result.series, phase_sd),
    }
    if job.pictures:
        result.pictures = eval_pictures.pictures(result, video, camera, model, kept.estimates)
    return result


def _plate(job: Job, video: Video) -> Image | None:
    choice = job.arm.background
    if choice == "none" or (choice == "plate" and job.clip.plate is None):
        return None
    return median_plate(video) if choice == "auto" else read_plate(job.clip.plate, video.size)


def _as_gait_track(job: Job) -> _Kept:
    """Track as ``gait track --init auto`` does: with the detector, and also backwards from the start."""
    clip, arm, kept = job.clip, job.arm, _Kept()
    plate = str(clip.plate) if arm.background == "plate" and clip.plate else "none"
    options = ClipOptions(
        video=str(clip.video),
        camera=str(clip.camera),
        output=str(job.track),
        model=str(job.model),
        background="auto" if arm.background == "auto" else plate,
        height=clip.height,
        mode=Mode[arm.mode.upper()],
        seed=job.seed,
        start=clip.first,
        stop=clip.stop,
        detector="full" if arm.init == "auto" else "none",
        quiet=True,
    )
    scene = read_scene(options)
    figures = track_scene(
        options,
        scene,
        first_state(options, scene),
        lambda frame, estimate: kept.estimates.__setitem__(frame.number, estimate),
    )
    kept.step_ms = figures["step_ms"]["median"]
    return kept


def _from_truth(job: Job, video: Video, camera: Camera, model: Model) -> _Kept:
    """Track into the run's CSV file from the true state with noise; search again for a lost person."""
    clip, arm, kept = job.clip, job.arm, _Kept()
    plate = _plate(job, video)
    config = TrackerConfig.default(Mode[arm.mode.upper()], seed=job.seed, **dict(arm.changes))
    tracker = Tracker(model, camera, config, background=plate)
    auto_start = BoxStart(camera, plate, model, clip.height)
    path = job.track.with_suffix(".init.json")
    path.write_text(json.dumps(noisy_start(clip, job.seed, arm.stature_error)))
    start = Start.read(path, model)
    uncertainty = eval_measures.Uncertainty(clip.truth, model) if arm.mode == "default" else None
    steps = []
    with TrackWriter(job.track, model.info.components, model.joint_names, model.angle_names) as rows:
        for frame in video.frames(start.frame, clip.stop):
            if frame.number == start.frame:
                tracker.start(start.mean, start.sd, frame.utime)
            begun = time.thread_time()
            estimate = tracker.step(frame.image, frame.utime)
            steps.append(1000 * (time.thread_time() - begun))
            rows.write(frame, estimate)
            kept.estimates[frame.number] = estimate
            if uncertainty is not None and uncertainty.wants(frame.number):
                kept.nees.append(uncertainty.nees(frame.number, estimate, *tracker.particles()))
            anew = auto_start.find_lost(frame, estimate.status)
            if anew is not None:
                tracker.start(anew.mean, anew.sd, frame.utime)
    if not steps:
        raise UserError(f"{video.path}: no frame from {start.frame} on")
    kept.step_ms = float(np.median(steps))
    return kept


def _judge(job: Job, track: Track, camera: Camera) -> Result:
    """Measures and series of a track, compared with whatever truth the clip has."""
    clip = job.clip
    result = Result(job)
    result.series = {
        "frame": track.frame,
        "status": np.array(track.status),
        "phase": track.phase,
        "path": track.places["pelvis"][:, :2],
    }
    strikes: Strikes | None = None
    if clip.truth is not None:
        truth = read_truth(clip.truth)
        strikes = strikes_of(truth, clip.folder / "meta.json")
        sections = blob.decode(read_blob(job.model), str(job.model))
        result.measures = evaluate(track, truth, strikes=strikes, model=sections, camera=camera)
        result.series |= eval_measures.against_truth(track, truth, camera)
    elif clip.marks is not None:
        marks = eval_marks.Marks.read(clip.marks)
        strikes = marks.strikes
        result.measures = marks.measure(track, camera)
        result.series |= marks.series(track, camera)
    else:
        result.measures = {"status": eval_measures.shares(track)}
    if not clip.steady:
        result.measures["phase"] = None
    elif strikes is not None:
        result.measures["events"] = eval_measures.strike_errors(track, strikes)
        true_phase = strikes.phase(track.frame)
        if true_phase is not None:
            result.series["true_phase"] = true_phase
            result.measures["start"] = eval_measures.start_quality(track, true_phase)
    return result
