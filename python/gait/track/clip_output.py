"""Write the results of a tracked clip: files, and figures for the report."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from itertools import groupby
from typing import Any

import cv2
import numpy as np

from gait.ahead import ahead
from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.camera.camera import Camera, write_camera
from gait.camera.path import CameraPose, write_path
from gait.io.files import replacing
from gait.io.track_file import TrackWriter
from gait.io.video import Frame
from gait.motion.footfalls import Draws
from gait.progress import durations, progress
from gait.report.drawing import LEGEND_SECONDS, Overlay
from gait.report.film import Films, PageFilm
from gait.track.from_walk import Calibration
from gait.track.options import ClipOptions
from gait.track.person_keypoints import PersonKeypoints
from gait.track.plausible import Plausibility
from gait.track.scene import Scene
from gait.track.smooth import Smoother
from gait.track.standing import Estimated, Moved, Sink, Standing
from gait.track.tracker import Tracker
from gait.track.wrong_way import AGAINST_STRIDES

#: What shows that a person does not only walk.
_OTHER_MOTIONS = "the person seems to stand, run or walk backwards at times"
HARDLY_TRACKED = "a model of walking follows the person in less than half of the frames"
_HARDLY = 0.1  # share of the frames; a person followed in fewer was hardly followed
_TRACKED = 0.5  # share of the frames; of a person who walks more are `tracking`
_ENOUGH_S = 3.0  # seconds after which that holds; a track may need one to settle
_RUNS = 2.2  # m/s; few people walk faster
_WAY_S = 1.0  # seconds in which the way of a person shows that they run
_OTHER_MOTION_S = 0.5  # seconds in which a person seems to do anything but walk, if they do


class Results:
    """Collects from each step what the final report needs.

    Attributes
    ----------
    times : list of float
        Times of the estimates written, seconds.
    joints : list of ndarray of shape (J, 3)
        Their joints, metres.
    starts : list of (int, float, float)
        Frame of each start of the tracker, and the person's position there, metres.
    film : PageFilm or None
        Film on the report's page.
    draws : Draws or None
        Motions drawn from a smoothed track.
    """

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self._count = 0
        self._statuses: list[TrackStatus] = []
        self._begun = time.perf_counter()
        self.times: list[float] = []
        self.joints: list[np.ndarray[Any, Any]] = []
        self._frames: list[tuple[int, bool, bool]] = []  # number, whether lost, whether in the picture
        self._not_walking: list[bool] = []  # whether the person stands, or walks backwards
        self.starts: list[tuple[int, float, float]] = []
        self.film: PageFilm | None = None
        self.draws: Draws | None = None

    def step(self, frame: Frame, estimate: Estimate) -> None:
        """Count a step of the tracker."""
        if estimate.frame == 0:
            self.starts.append((frame.number, *estimate.mean.pelvis[:2]))
        self._count += 1
        self._wall = time.perf_counter() - self._begun

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Add an estimate that is written."""
        self._statuses.append(estimate.status)
        self.times.append(frame.time)
        self.joints.append(estimate.joints)
        shown = frame.camera(self._tracker.cameras[0]).shows(estimate.joints[:1])
        self._frames.append((frame.number, estimate.status == TrackStatus.LOST, shown))
        ahead = self._tracker.model.directions[estimate.motion_class] > 0
        stands, backwards = np.isnan(estimate.mean.phase), estimate.reason == AGAINST_STRIDES
        self._not_walking.append(bool(not ahead or stands or backwards))

    def coverage(self) -> list[str]:
        """Describe in which frames the person was followed, left the picture, or was lost."""
        spans = [list(span) for _, span in groupby(self._frames, key=lambda frame: frame[1])]
        out = []
        for span, after in zip(spans, [*spans[1:], None], strict=True):
            (first, lost, _), (last, _, shown) = span[0], span[-1]
            if not lost:
                out.append(f"followed from frame {first} to {last}")
                continue
            what = "lost" if shown else "left the picture"
            out.append(f"{what} at frame {first}" + (f", back at frame {after[0][0]}" if after else ""))
        return out

    def hardly_followed(self) -> bool:
        """Whether the person was lost most of the time and hardly ever followed."""
        count = len(self._statuses)
        return self._statuses.count(TrackStatus.LOST) > count / 2 and self._followed < _HARDLY * count

    def against_walk(self) -> str:
        """Why a model of walking does not follow what the person does, in words; empty if it does."""
        times, places = np.array(self.times), np.array([joints[0, :2] for joints in self.joints])
        lost, shown = np.array([frame[1:] for frame in self._frames], bool).reshape(-1, 2).T
        if len(times) < 2:
            return ""
        later = np.searchsorted(times, times + _WAY_S)
        whole, later = later < len(times), np.minimum(later, len(times) - 1)
        runs = np.linalg.norm(places[later] - places, axis=1) > _RUNS * (times[later] - times)
        losses = np.cumsum(lost)
        runs &= whole & (losses[later] == losses)  # where the person is found again, the place may jump
        other = (runs | np.array(self._not_walking)) & ~lost
        if other.sum() * np.median(np.diff(times)) >= _OTHER_MOTION_S:
            return _OTHER_MOTIONS
        if not self._followed:
            return HARDLY_TRACKED
        if times[-1] - times[0] > _ENOUGH_S and self.tracking < _TRACKED * (shown | ~lost).sum():
            return HARDLY_TRACKED
        return ""

    @property
    def _followed(self) -> int:
        """Number of frames that are `tracking` or `ambiguous`."""
        return self.tracking + self._statuses.count(TrackStatus.AMBIGUOUS)

    @property
    def tracking(self) -> int:
        """Number of frames that are `tracking`."""
        return self._statuses.count(TrackStatus.TRACKING)

    def summary(self, threads: int, step_seconds: Sequence[float]) -> dict[str, Any]:
        """Return the figures of ``--json``; step_ms is only the time in gait_tracker_step."""
        tracker = self._tracker
        return {
            "frames": self._count,
            "particles": tracker.config.particles,
            "threads": threads,
            "step_ms": durations(1000 * np.asarray(step_seconds)),
            "wall_fps": self._count / self._wall,
            **{status.name.lower(): self._statuses.count(status) for status in TrackStatus},
            "followed": not self.hardly_followed(),
            "memory_bytes": tracker.memory_bytes,
            "digest": f"{tracker.digest():016x}",
        }


Check = Callable[[Results], None]


def accept(results: Results) -> None:
    """Accept any results."""


def write(
    options: ClipOptions,
    scene: Scene,
    tracker: Tracker,
    found: Iterable[Estimated],
    plausibility: Plausibility,
    keypoints: PersonKeypoints | None,
    also: Sink | None = None,
    moved: Moved | None = None,
    check: Check = accept,
) -> Results:
    """Write the estimates to all outputs, which appear together at the end unless `check` raises.

    Keypoints, if there are any, show in which frames the person takes no strides.  If `also` is given, it
    receives all estimates, with the joints of the model's body; otherwise `moved` may move these.
    """
    model, video, span, results = tracker.model, scene.video, scene.frames, Results(tracker)
    with ExitStack() as stack:
        rows = TrackWriter(
            options.output, model.info.components, model.joint_names, model.angle_names, model.classes,
            span, None if scene.calibration is None else scene.calibration.change_at,
            scene.person if scene.outlines else None, video.digest,
        )  # fmt: skip
        if options.camera_out:
            write_camera(stack.enter_context(replacing(options.camera_out)), scene.camera)
        if options.cameras_out:
            still = CameraPose.of(scene.camera)
            poses = [scene.poses.get(number, still) for number in span]
            file = stack.enter_context(replacing(options.cameras_out))
            write_path(file, span, poses, by_frame=True, lens=scene.camera)
        sinks: list[Sink] = [results.add, _widened(stack.enter_context(rows).write, scene.calibration)]
        size = Drawing.size(scene)
        films = stack.enter_context(Films(options.overlay, options.report, span, size, video.fps))
        if films.wanted:
            sinks.append(Drawing(model, scene, films).add)
        update = stack.enter_context(progress("tracking", len(span), options.quiet))
        estimates = _counted(found, results, update)
        if options.smooth:
            estimates = _smoothed(options, scene, tracker, estimates, plausibility, results)
        else:
            estimates = plausibility.known_later(estimates if films.wanted else _without_pictures(estimates))
        if keypoints is not None:
            estimates = Standing(keypoints, tracker.model.directions).decided(estimates)
        if also is not None:
            estimates = _passed(estimates, also)
        elif moved is not None:
            estimates = moved(estimates)
        if not options.smooth:  # frames are tracked while earlier ones are written
            estimates = stack.enter_context(closing(ahead(estimates)))
        for frame, estimate in estimates:
            for sink in sinks:
                sink(frame, estimate)
        if not results.times:
            raise video.no_frame(span.start)
        check(results)
        if options.draws and results.draws is not None:
            results.draws.write(options.draws)
    results.film = films.page
    return results


class Drawing:
    """Draws every frame as captured, also those before the first estimate; several cameras side by side.

    Parameters
    ----------
    model : Model
    scene : Scene
    films : Films
    """

    def __init__(self, model: Model, scene: Scene, films: Films) -> None:
        self._model, self._scene, self._films = model, scene, films
        self._overlays = [Overlay(model, one.camera) for one in (scene, *scene.further)]
        self._beside = [np.zeros((*one.camera.size[::-1], 3), np.uint8) for one in scene.further]
        self._begun = False

    @staticmethod
    def size(scene: Scene) -> tuple[int, int]:
        """Width and height of the drawn frames in pixels; all cameras' are as tall as the first one's."""
        width, height = scene.camera.size
        return width + sum(_scaled_width(one.camera, height) for one in scene.further), height

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Draw a frame; frame numbers must increase."""
        scene = self._scene
        if not self._begun and frame.number > scene.frames.start:
            for before in scene.video.frames(scene.frames.start, frame.number):
                self._draw(before, None)
        self._begun = True
        self._draw(frame, estimate)

    def _draw(self, frame: Frame, estimate: Estimate | None) -> None:
        camera, (overlay, *others) = self._scene.camera, self._overlays
        if frame.pose is not None:
            overlay = Overlay(self._model, frame.camera(camera))
        legend = frame.time - self._scene.video.times[self._scene.frames.start] < LEGEND_SECONDS
        if estimate is None:
            picture = overlay.draw_absent(frame.image, frame.time, frame.number, legend=legend)
        else:
            picture = overlay.draw(frame.image, estimate, frame.number, legend=legend)
        for k, (other, view) in enumerate(zip(others, frame.others, strict=True)):
            if view is not None:  # otherwise keep the camera's last picture
                drawn = view.image if estimate is None else other.draw_people(view.image, {"": estimate})
                self._beside[k] = drawn
        size = camera.height
        beside = [
            cv2.resize(one, (_scaled_width(self._scene.further[k].camera, size), size))
            for k, one in enumerate(self._beside)
        ]
        self._films.write(np.hstack([picture, *beside]) if beside else picture, frame.number)


def _scaled_width(camera: Camera, height: int) -> int:
    """Width of a camera's picture when scaled to another height, pixels."""
    return 2 * round(camera.width * height / camera.height / 2)


def _widened(sink: Sink, calibration: Calibration | None) -> Sink:
    """Return a sink that adds the uncertainty of an estimated camera to each estimate."""
    if calibration is None:
        return sink
    return lambda frame, estimate: sink(frame, calibration.widened(frame.time, estimate))


def _without_pictures(found: Iterable[Estimated]) -> Iterator[Estimated]:
    """Yield every frame with its estimate, without the pictures: some wait, and would need memory."""
    nothing = np.empty((0, 0, 3), np.uint8)
    for frame, estimate in found:
        others = tuple(view and view._replace(image=nothing, plate=None) for view in frame.others)
        yield frame._replace(image=nothing, plate=None, others=others), estimate


def _passed(found: Iterable[Estimated], to: Sink) -> Iterator[Estimated]:
    """Yield every frame with its estimate after passing them to a sink."""
    for frame, estimate in found:
        to(frame, estimate)
        yield frame, estimate


def _counted(
    found: Iterable[Estimated], results: Results, update: Callable[[int], None]
) -> Iterator[Estimated]:
    """Yield every frame with its estimate, and count the steps."""
    for done, (frame, estimate) in enumerate(found, 1):
        results.step(frame, estimate)
        update(done)
        yield frame, estimate


def _smoothed(
    options: ClipOptions,
    scene: Scene,
    tracker: Tracker,
    found: Iterable[Estimated],
    plausibility: Plausibility,
    results: Results,
) -> Iterator[Estimated]:
    """Yield every frame with its smoothed estimate, and add the draws to the results."""
    with Smoother(tracker) as smoother:
        for frame, estimate in found:
            smoother.add(frame, estimate)
        if not len(smoother):
            return
        with progress("smoothing", len(smoother), options.quiet) as update:
            rows, results.draws = smoother.finish(update=update)
    frames: Iterable[Frame] = (frame for frame, _ in rows)
    if options.overlay or options.report:  # decode the pictures again
        frames = scene.video.frames(rows[0][0].number, rows[-1][0].number + 1)
    judged = plausibility.judged_later(rows)
    yield from ((frame, estimate) for frame, (_, estimate) in zip(frames, judged, strict=True))
