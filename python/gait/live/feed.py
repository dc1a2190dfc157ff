"""Content of the live page: estimates drawn into their own frames, and numbers.

A tracker follows one person.  For several people there are several trackers, which all receive frames on one
URL and publish either there, each on its own channels (``gait-trackd --people``), or each on its own URL.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.body.skeleton import BONES
from gait.camera.camera import Camera
from gait.errors import UsageError, UserError
from gait.io.video import Image
from gait.lcm.link import gaitmsg, handle, is_log, listener, now, waiting
from gait.lcm.messages import camera_of, classes_message, decode, estimate_after, picture
from gait.report.drawing import Overlay, class_words
from gait.web.motion_data import curve, motion_data, rounded

_KEPT_FRAMES = 64  # most frames that wait for their estimate, and most bytes of them
_KEPT_BYTES = 100_000_000
_RECENT = 9  # frames from which a camera's frame interval is computed
_QUEUED = 8  # frames that wait in LCM
#: Longest time without a drawing [s], even if messages wait or a tracker does not answer.
_LONGEST_PAUSE_S = 0.5
_ANNOUNCED = 1.0  # seconds between reports that frames arrive
_RATED = 2.0  # seconds over which estimates are counted
_NUMBERS = "[0-9]|[12][0-9]|30"  # of cameras, as gait capture and gait-trackd allow
KEPT_S = 20.0
"""Duration of the plots, seconds."""


@dataclass
class _View:
    """One camera, and its frames that wait for their estimate."""

    frames: dict[int, Any]
    given: bool
    size: tuple[int, int] = (0, 0)
    overlay: Overlay | None = None
    camera: Camera | None = None
    recent: deque[int] = field(default_factory=lambda: deque(maxlen=_RECENT))

    def add(self, image: Any) -> None:
        """Keep a frame until its estimate arrives."""
        self.frames[image.utime] = image
        self.recent.append(image.utime)
        while (
            len(self.frames) > _KEPT_FRAMES
            or sum(len(one.data) for one in self.frames.values()) > _KEPT_BYTES
        ):
            del self.frames[next(iter(self.frames))]

    def nearest(self, utime: int) -> int | None:
        """Return the time of the frame nearest to `utime`, within half a frame interval, or None."""
        found = min(self.frames, key=lambda one: abs(one - utime), default=None)
        return found if found is not None and abs(found - utime) <= self._apart() else None

    def take(self, utime: int) -> Any | None:
        """Return the frame at a time, if there is one, and forget it and earlier ones."""
        found = self.nearest(utime)
        image = None if found is None else self.frames[found]
        self.forget(utime if found is None else found + self._apart() + 1)
        return image

    def forget(self, utime: int) -> None:
        """Forget frames before this time."""
        for old in [one for one in self.frames if one < utime - self._apart()]:
            del self.frames[old]

    def _apart(self) -> int:
        """Half a frame interval, microseconds."""
        return int(np.median(np.abs(np.diff(self.recent)))) // 2 if len(self.recent) > 1 else 0

    def use(self, camera: Camera, model: Model) -> None:
        self.overlay, self.size, self.camera = Overlay(model, camera), camera.size, camera


class Answers(NamedTuple):
    """URL and channels on which a person's tracker publishes."""

    name: str
    """Number of the person."""
    url: str
    channel: str
    """Channel of the estimates."""
    ending: str
    """Ending of all its channels, such as ``_2`` for person 2."""


def answers(url: str, people: Sequence[str]) -> list[Answers]:
    """Parse `people`: numbers are people on `url`, others are URLs; without any, one person on `url`."""
    return [
        Answers(one, url, f"GAIT_ESTIMATE_{one}", f"_{one}")
        if one.isdigit()
        else Answers(str(k), one, "GAIT_ESTIMATE", "")
        for k, one in enumerate(people or (url,), 1)
    ]


@dataclass
class _Person:
    """One tracker: arrival times of its estimates, dropped frames, and time of the last message."""

    arrivals: deque[int]
    drops: Drops
    heard: float = -np.inf  # seconds, monotonic
    classes: Any = None  # the newest ``classes_t``, which comes before its estimate

    def rate(self) -> float | None:
        """Count an estimate that arrives now; return estimates per second."""
        self.heard = time.monotonic()
        self.arrivals.append(now())
        while self.arrivals[-1] - self.arrivals[0] > 1e6 * _RATED:
            self.arrivals.popleft()
        span = 1e-6 * (self.arrivals[-1] - self.arrivals[0])
        return round((len(self.arrivals) - 1) / span, 1) if span > 0 else None


class Feed:
    """Receives the channels of one or several trackers, and draws estimates into their own frames.

    Live, it draws the newest estimate when no message waits, or after `_LONGEST_PAUSE_S`, so that it
    never falls behind; from a log, it draws all.

    Parameters
    ----------
    url : str
        URL on which frames arrive.
    streams : sequence of int
        Numbers of the cameras.
    model : Model
        Model whose body is drawn.
    cameras : mapping of int to Camera
        Known cameras; others are received on ``GAIT_CAMERA_<i>``.
    show : callable
        Called with the number of a camera and the finished BGR picture.
    report : callable, optional
        Called with "sample" and the numbers of an estimate, "health" and those of a status, or "frames", at
        most once a second while frames arrive.
    scale : bool
        Whether to resize cameras that were calibrated at another resolution to the pictures.
    watched : callable, optional
        Whether to draw; until then the newest estimate waits.
    people : sequence of str
        Numbers of people whose trackers publish on `url`, or URLs of trackers; by default the tracker that
        publishes on `url` without a number.

    Attributes
    ----------
    damage : str or None
        Describes the fault of the first message that could not be shown.
    scene : dict of str to bytes
        The newest message of each camera and background on `url`, by channel.
    """

    def __init__(
        self,
        url: str,
        streams: Sequence[int],
        model: Model,
        cameras: Mapping[int, Camera],
        show: Callable[[int, Image], None],
        report: Callable[[str, dict[str, Any]], None] | None = None,
        scale: bool = False,
        watched: Callable[[], bool] = lambda: True,
        people: Sequence[str] = (),
    ) -> None:
        self.url, self._scale, self.people = url, scale, answers(url, people)
        urls = list(dict.fromkeys([url, *(one.url for one in self.people)]))
        if len(urls) > 1 and any(map(is_log, urls)):
            raise UsageError("--person URL: is for live trackers; give the numbers of people in a log")
        self._links, self._log = {name: listener(name) for name in urls}, is_log(url)
        self._model, self._show, self._report, self._watched = model, show, report, watched
        self._views = {stream: _View({}, stream in cameras) for stream in streams}
        self._origin: int | None = None
        self._persons = [_Person(deque(), Drops()) for _ in self.people]
        self._answers: dict[int, dict[int, tuple[Estimate, int]]] = {}  # by capture time and person
        self._drawn, self._announced = 0.0, -np.inf
        self.damage: str | None = None
        self.scene: dict[str, bytes] = {}
        self._subscribe(url, f"GAIT_(CAMERA|BACKGROUND)_({_NUMBERS})", self._on_scene, _QUEUED)
        for stream, camera in cameras.items():
            self._views[stream].use(camera, model)
        for stream in streams:
            self._subscribe(url, f"GAIT_IMAGE_{stream}", partial(self._on_image, stream), _QUEUED)
            self._subscribe(url, f"GAIT_CAMERA_{stream}", partial(self._on_camera, stream), 1)
        for person, one in enumerate(self.people):
            self._subscribe(one.url, one.channel, partial(self._on_estimate, person), _KEPT_FRAMES)
            self._subscribe(
                one.url, f"GAIT_CLASSES{one.ending}", partial(self._on_classes, person), _KEPT_FRAMES
            )
            self._subscribe(
                one.url, f"GAIT_STATUS{one.ending}", partial(self._on_status, person), _KEPT_FRAMES
            )

    def _subscribe(self, url: str, channel: str, handler: Callable[[str, bytes], None], most: int) -> None:
        self._links[url].subscribe(channel, handler).set_queue_capacity(most)

    def handle(self, seconds: float) -> bool:
        """Process messages, waiting at most this long; skip damaged ones; False at the end of a log."""
        more, links = True, list(self._links.values())
        try:
            if len(links) == 1:
                more = handle(links[0], seconds, self._log)
            else:
                for link in waiting(links, seconds):
                    link.handle()
            late = time.monotonic() > self._drawn + _LONGEST_PAUSE_S
            utime = self._answered(late)
            if utime is not None and self._watched() and (self._log or late or not waiting(links)):
                self._draw(utime)
        except UserError as fault:
            self.damage = self.damage or str(fault)
        return more

    def _answered(self, late: bool) -> int | None:
        """Return the time of the newest frame that all active trackers (if `late`, any) have answered.

        Older frames are forgotten.
        """
        begun = time.monotonic() - _LONGEST_PAUSE_S
        working = {k for k, person in enumerate(self._persons) if person.heard > begun}
        whole = [utime for utime, found in self._answers.items() if working <= found.keys()]
        newest = max(whole or (self._answers if late else ()), default=None)
        if newest is not None:
            self._answers = {utime: found for utime, found in self._answers.items() if utime >= newest}
            for view in self._views.values():
                view.forget(newest)
        return newest

    def _draw(self, utime: int) -> None:
        found, self._drawn = self._answers[utime], time.monotonic()
        images = {stream: view.take(utime) for stream, view in self._views.items()}
        self._answers = {other: answer for other, answer in self._answers.items() if other > utime}
        for stream, view in self._views.items():
            if images[stream] is not None and view.overlay is not None:
                pixels = self._fitting(images[stream], view)
                if len(self.people) == 1:
                    self._show(stream, view.overlay.draw(pixels, *found[0]))
                else:
                    people = {self.people[k].name: estimate for k, (estimate, _) in sorted(found.items())}
                    self._show(stream, view.overlay.draw_people(pixels, people))

    def _fitting(self, image: Any, view: _View) -> Image:
        """Decode a picture of the camera's size, or, with `scale`, resize the camera to the picture."""
        pixels = picture(image)
        found = pixels.shape[1], pixels.shape[0]
        if found != view.size and self._scale and view.camera is not None and view.camera.same_aspect(found):
            view.use(view.camera.for_size(found), self._model)
        if found != view.size:
            size, own = ("{}x{}".format(*pair) for pair in (found, view.size))
            raise UserError(f"a picture of {size}, the camera's is {own}; give the right --camera")
        return pixels

    def _on_image(self, stream: int, channel: str, data: bytes) -> None:
        self._views[stream].add(decode(gaitmsg.image_t, data, channel))
        if self._report and time.monotonic() - self._announced > _ANNOUNCED:
            self._announced = time.monotonic()
            self._report("frames", {"stream": stream})

    def _on_scene(self, channel: str, data: bytes) -> None:
        """Keep the newest camera or background, for recordings."""
        if "CAMERA" in channel:
            camera_of(decode(gaitmsg.camera_t, data, channel))
        else:
            decode(gaitmsg.image_t, data, channel)
        self.scene[channel] = data

    def _on_camera(self, stream: int, channel: str, data: bytes) -> None:
        view = self._views[stream]
        if not view.given:  # the newest counts, as an earlier one may have been wrong
            view.use(camera_of(decode(gaitmsg.camera_t, data, channel)), self._model)

    def _on_classes(self, person: int, channel: str, data: bytes) -> None:
        self._persons[person].classes = classes_message(data, channel)

    def _on_estimate(self, person: int, channel: str, data: bytes) -> None:
        message, estimate = estimate_after(data, channel, classes=self._persons[person].classes)
        if estimate.joint_names != self._model.joint_names:
            raise UserError(
                f"{channel}: an estimate of other joints than the model's; give the model that is tracked"
            )
        self._origin = message.utime if self._origin is None else self._origin
        # The panel shows seconds since the first frame, not the time of day.
        estimate = replace(estimate, utime=message.utime - self._origin)
        if self._report:
            self._report("sample", self._sample(person, estimate, message))
        if any(view.nearest(message.utime) is not None for view in self._views.values()):
            self._answers.setdefault(message.utime, {})[person] = estimate, message.frame

    def _sample(self, person: int, estimate: Estimate, message: Any) -> dict[str, Any]:
        """Report an estimate: numbers for the page, joints of the figure, values of the plots."""
        mean = estimate.mean
        return {
            "person": person,
            "time": estimate.utime * 1e-6,
            "frame": message.frame,
            "status": estimate.status.name.lower(),
            "sure": round(float(estimate.hypothesis_weight), 3),
            "points": rounded(estimate.joints),
            "sd": rounded(estimate.joint_sd),
            "phase": round(float(mean.phase), 4) if estimate.takes_strides else None,
            "cadence": round(120.0 * float(mean.stride_hz), 1) if estimate.takes_strides else None,
            "speed": round(float(estimate.speed), 3),
            "motion": class_words(estimate),
            "rate": self._persons[person].rate(),
            "latency_ms": None if self._log else round(1e-3 * (now() - message.utime), 1),
            "step_ms": round(1e-3 * message.step_us, 2),
            "values": _values(estimate, [angle.name for angle in message.angles]),
        }

    def _on_status(self, person: int, channel: str, data: bytes) -> None:
        message = decode(gaitmsg.status_t, data, channel)
        if self._report:
            found = health(message, self._persons[person].drops)
            self._report("health", {"person": person} | found)

    def page_data(self) -> dict[str, Any]:
        """Make the initial object for scene.js and curves.js, without frames; see motion_data.py."""
        names = self._model.joint_names
        camera = next((view.camera for view in self._views.values() if view.camera is not None), None)
        none = np.empty(0)
        return motion_data(
            30.0,
            none,
            names,
            [(names.index(a), names.index(b)) for a, b in BONES if a in names and b in names],
            np.empty((0, len(names), 3)),
            np.empty((0, len(names), 3)),
            curves=[
                curve(name, unit, none, side=side, limits=(0, 1) if name == "phase" else None)
                for name, unit, side, _ in PLOTTED
            ],
            camera=None if camera is None else rounded(camera.centre),
            url=self.url,
            people=[one._asdict() for one in self.people],
            streams=list(self._views),
            seconds=KEPT_S,
        )


PLOTTED = (
    ("knee flexion", "°", "left", "l_knee_flexion"),
    ("knee flexion", "°", "right", "r_knee_flexion"),
    ("hip flexion", "°", "left", "l_hip_flexion"),
    ("hip flexion", "°", "right", "r_hip_flexion"),
    ("speed", "m/s", "", "speed"),
    ("phase", "", "", "phase"),
)
"""Plots: name, unit, side, and the angle or number of the estimate."""


def _values(estimate: Estimate, angles: list[str]) -> list[float | None]:
    known = dict(zip(angles, np.degrees(estimate.angles).tolist(), strict=False))
    known["speed"] = float(estimate.speed)
    if estimate.takes_strides:
        known["phase"] = float(estimate.mean.phase)
    return [round(known[key], 3) if key in known else None for *_, key in PLOTTED]


class Drops:
    """Count of dropped frames, including those before the page was opened, across restarts of the tracker."""

    def __init__(self) -> None:
        self._before, self._frames = 0, 0
        self.total = 0

    def add(self, reported: int, frames: int) -> int:
        """Add a tracker's counts of drops and frames, which restart with it; return all drops."""
        restarted = reported < self._before or frames < self._frames
        self.total += reported if restarted else reported - self._before
        self._before, self._frames = reported, frames
        return self.total


def health(message: Any, drops: Drops) -> dict[str, Any]:
    """Report a ``status_t``."""
    names = {0: "waiting", 1: "ready", 2: "armed", 3: "running"}
    return {
        "state": names.get(message.state, "unknown"),
        "text": message.text,
        "version": message.version,
        "frames": message.frames,
        "dropped": drops.add(message.dropped, message.frames),
        "rejected": message.rejected,
        "particles": message.particles,
        "threads": message.threads,
    }
