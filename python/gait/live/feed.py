"""What the live page shows: estimates drawn into their own frames, and numbers beside them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.state import POSE_SCALARS
from gait.body.skeleton import BONES
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.video import Image
from gait.lcm.link import gaitmsg, handle, is_log, listener, now, waiting
from gait.lcm.messages import camera_of, decode, estimate_of, picture
from gait.report.drawing import Overlay
from gait.web.motion_data import curve, motion_data, rounded

_KEPT = 64  # frames that wait for their estimate, at most, and their bytes
_KEPT_BYTES = 100_000_000
_QUEUED = 8  # frames that wait in LCM
_FURTHEST = 1e6  # metres, or anything else that is drawn
_LONGEST = 0.5  # seconds without a drawing while messages wait
_RATED = 2.0  # seconds over which estimates are counted
KEPT_S = 20.0
"""Seconds of the plots."""


@dataclass
class _View:
    """One camera: what it looks like, and its frames that wait for their estimate."""

    frames: dict[int, Any]
    given: bool
    size: tuple[int, int] = (0, 0)
    overlay: Overlay | None = None
    camera: Camera | None = None

    def use(self, camera: Camera, model: Model) -> None:
        self.overlay, self.size, self.camera = Overlay(model, camera), camera.size, camera


class Feed:
    """Follows the channels of a tracker and draws estimates into their own frames.

    Live, it draws the newest estimate when no message waits, or after `_LONGEST` at the latest, so that it
    never falls behind; of a log, all.

    Parameters
    ----------
    url : str
    streams : sequence of int
        Numbers of the cameras.
    model : Model
        Whose body is drawn.
    cameras : mapping of int to Camera
        Those that are known; others are taken from ``GAIT_CAMERA_<i>``.
    show : callable
        Gets the number of a camera and its finished BGR picture.
    report : callable, optional
        Gets "sample" with the numbers of an estimate, or "health" with those of a status.
    scale : bool
        Whether cameras that were calibrated at another resolution are resized to the pictures.
    watched : callable, optional
        Whether to draw: the newest estimate waits until it is so.

    Attributes
    ----------
    damage : str or None
        Describes what is wrong with the first message that could not be shown.
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
    ) -> None:
        self.url, self._scale = url, scale
        self._lcm, self._log = listener(url), is_log(url)
        self._model, self._show, self._report, self._watched = model, show, report, watched
        self._views = {stream: _View({}, stream in cameras) for stream in streams}
        self._origin: int | None = None
        self._due: dict[int, tuple[Any, Estimate, int]] = {}
        self._drawn = 0.0
        self._arrivals: deque[int] = deque()
        self._drops = Drops()
        self.damage: str | None = None
        for stream, camera in cameras.items():
            self._views[stream].use(camera, model)
        for stream in streams:
            self._subscribe(f"GAIT_IMAGE_{stream}", partial(self._on_image, stream), _QUEUED)
            self._subscribe(f"GAIT_CAMERA_{stream}", partial(self._on_camera, stream), 1)
        self._subscribe("GAIT_ESTIMATE", self._on_estimate, _KEPT)
        self._subscribe("GAIT_STATUS", self._on_status, _KEPT)

    def _subscribe(self, channel: str, handler: Callable[[str, bytes], None], capacity: int) -> None:
        self._lcm.subscribe(channel, handler).set_queue_capacity(capacity)

    def handle(self, seconds: float) -> bool:
        """Take in a message, waiting at most so long, but for damaged ones; False at the end of a log."""
        more = True
        try:
            more = handle(self._lcm, seconds, self._log)
            late = time.monotonic() > self._drawn + _LONGEST
            if self._due and self._watched() and (self._log or late or not waiting(self._lcm)):
                self._draw()
        except UserError as fault:
            self.damage = self.damage or str(fault)
        return more

    def _draw(self) -> None:
        due, self._due, self._drawn = self._due, {}, time.monotonic()
        for stream, (image, estimate, frame) in due.items():
            view = self._views[stream]
            if view.overlay is not None:
                pixels = self._fitting(image, view)
                self._show(stream, view.overlay.draw(pixels, estimate, frame))

    def _fitting(self, image: Any, view: _View) -> Image:
        """Picture of the camera's size, or with `scale` a camera of the picture's."""
        pixels = picture(image)
        found = pixels.shape[1], pixels.shape[0]
        if found != view.size and self._scale and view.camera is not None and view.camera.same_aspect(found):
            view.use(view.camera.for_size(found), self._model)
        if found != view.size:
            size, own = ("{}x{}".format(*pair) for pair in (found, view.size))
            raise UserError(f"a picture of {size}, the camera's is {own}; give its --camera")
        return pixels

    def _on_image(self, stream: int, channel: str, data: bytes) -> None:
        message, frames = decode(gaitmsg.image_t, data, channel), self._views[stream].frames
        frames[message.utime] = message
        while len(frames) > _KEPT or sum(len(one.data) for one in frames.values()) > _KEPT_BYTES:
            del frames[next(iter(frames))]

    def _on_camera(self, stream: int, channel: str, data: bytes) -> None:
        view = self._views[stream]
        if not view.given:  # the newest counts: an earlier one may have been wrong
            view.use(camera_of(decode(gaitmsg.camera_t, data, channel)), self._model)

    def _on_estimate(self, channel: str, data: bytes) -> None:
        message = decode(gaitmsg.estimate_t, data, channel)
        estimate = estimate_of(message)
        if estimate.joint_names != self._model.joint_names:
            raise UserError(
                f"{channel}: an estimate of other joints than the model's; give the model tracked"
            )
        if not _plausible(estimate):
            raise UserError(f"{channel}: an estimate with numbers that are not finite")
        self._origin = message.utime if self._origin is None else self._origin
        # The panel shows seconds since the first frame, not the time of the day.
        estimate = replace(estimate, utime=message.utime - self._origin)
        if self._report:
            self._report("sample", self._sample(estimate, message))
        for stream, view in self._views.items():
            image = view.frames.pop(message.utime, None)
            if image is not None:
                self._due[stream] = image, estimate, message.frame

    def _sample(self, estimate: Estimate, message: Any) -> dict[str, Any]:
        """Report an estimate: numbers of the page, joints of the figure, values of the plots."""
        self._arrivals.append(now())
        while self._arrivals[-1] - self._arrivals[0] > 1e6 * _RATED:
            self._arrivals.popleft()
        span = 1e-6 * (self._arrivals[-1] - self._arrivals[0])
        mean = estimate.mean
        return {
            "time": estimate.utime * 1e-6,
            "frame": message.frame,
            "status": estimate.status.name.lower(),
            "sure": round(float(estimate.hypothesis_weight), 3),
            "points": rounded(estimate.joints),
            "sd": rounded(estimate.joint_sd),
            "phase": round(float(mean.phase), 4),
            "cadence": round(120.0 * float(mean.stride_hz), 1),
            "speed": round(float(estimate.speed), 3),
            "rate": round((len(self._arrivals) - 1) / span, 1) if span > 0 else None,
            "latency_ms": None if self._log else round(1e-3 * (now() - message.utime), 1),
            "step_ms": round(1e-3 * message.step_us, 2),
            "values": _values(estimate, [angle.name for angle in message.angles]),
        }

    def _on_status(self, channel: str, data: bytes) -> None:
        message = decode(gaitmsg.status_t, data, channel)
        if self._report:
            self._report("health", health(message, self._drops))

    def page_data(self) -> dict[str, Any]:
        """Make what scene.js and curves.js begin with, see motion_data.py: no frame yet."""
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
            curves=[curve(name, unit, none, side=side) for name, unit, side, _ in PLOTTED],
            camera=None if camera is None else rounded(camera.centre),
            url=self.url,
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
    known |= {"speed": float(estimate.speed), "phase": float(estimate.mean.phase)}
    return [round(known[key], 3) if key in known else None for *_, key in PLOTTED]


class Drops:
    """Frames dropped since the page was opened, also over restarts and RESETs of the tracker."""

    def __init__(self) -> None:
        self._before: int | None = None
        self.total = 0

    def add(self, reported: int) -> int:
        """Take in a tracker's own count, which begins anew when it does; return all of them."""
        if self._before is None or reported < self._before:
            self.total += reported
        else:
            self.total += reported - self._before
        self._before = reported
        return self.total


def health(message: Any, drops: Drops) -> dict[str, Any]:
    """Report a ``status_t``."""
    names = {0: "waiting", 1: "ready", 2: "armed", 3: "running"}
    return {
        "state": names.get(message.state, "unknown"),
        "text": message.text,
        "version": message.version,
        "frames": message.frames,
        "dropped": drops.add(message.dropped),
        "rejected": message.rejected,
        "particles": message.particles,
        "threads": message.threads,
    }


def _plausible(estimate: Estimate) -> bool:
    """Whether all numbers that are drawn are finite and on this planet."""
    mean = [getattr(estimate.mean, name) for name in POSE_SCALARS]
    numbers = np.concatenate([estimate.joints.ravel(), estimate.joint_sd.ravel(), estimate.mean.pelvis, mean])
    shown = [estimate.speed, estimate.ess, estimate.hypothesis_weight, *estimate.angles]
    return bool((np.abs([*numbers, *shown]) < _FURTHEST).all())  # False for NaN
