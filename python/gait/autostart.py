"""Automatic start: where a walker stands and heads, from a second of blobs against the background.

Gives place, stature, heading and a guess of the cadence, each with its uncertainty; the phase stays
unknown.  Cast shadows and the nearer foot pull the blob's foot point towards the camera, so the place is
kept wide along the viewing ray.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.camera import Camera
from gait.errors import UserError
from gait.initial import Start, set_height
from gait.model import Model
from gait.sighting import Sighting, height_over, sightings
from gait.state import State
from gait.video import Frame, Image, Video

Array = NDArray[np.float64]

WINDOW = 1.0  # seconds of sightings used
KEEP = 1.5  # seconds after which a sighting is forgotten
ENOUGH = 8  # sightings, at least
_LEAD = 0.1  # statures by which the lowest foot is nearer to the camera than the pelvis, on average
_DEPTH_SD = (0.10, 0.02)  # of the foot point along the viewing ray: metres, and share of the distance
_HEAD_SD = 0.03  # of the stature by head and foot ray: hair, shoes, blur; metres
_SIDE_SD = 0.06  # metres across the viewing ray
_SLOW = 0.4  # metres per second below which motion says nothing about heading or cadence
_HEADING_SD = 0.2  # radians, at least: people do not walk exactly where their blob moves


@dataclass(frozen=True)
class _Path:
    """Straight path of the blob over the ground: place at the first sighting, velocity and its error."""

    place: Array
    velocity: Array
    velocity_sd: float


def find_start(
    video: Video,
    camera: Camera,
    plate: Image | None,
    model: Model,
    *,
    first: int = 0,
    stop: int | None = None,
    height: float | None = None,
) -> Start:
    """Find the first state of a walker in a clip.

    Parameters
    ----------
    video, camera, plate, model
        `plate` is the empty scene, BGR.
    first, stop : int
        Frames to look at, `first` <= number < `stop`.
    height : float, optional
        Known stature, metres.

    Raises
    ------
    UserError
        If there is no plate, or no person stands in full view for long enough.
    """
    if plate is None:
        raise UserError("--init auto: needs a background to see the person against; give --init FILE.json")
    spotter = Spotter(camera, plate, model, height)
    for frame in video.frames(first, stop):
        if spotter.full_second(frame):
            break
        spotter.see(frame)
    if not spotter.enough():
        raise UserError(
            f"{video.path}: --init auto found nobody in full view for {ENOUGH} frames; give --init FILE.json"
        )
    return spotter.start()


class Spotter:
    """Watches frames for somebody to start with; keeps the latest sightings.

    Parameters
    ----------
    camera, plate, model
        `plate` is the empty scene, BGR.
    height : float, optional
        Known stature, metres.
    """

    def __init__(self, camera: Camera, plate: Image, model: Model, height: float | None = None) -> None:
        self._camera, self._plate, self._model, self._height = camera, plate, model, height
        self._seen: list[tuple[Frame, Sighting]] = []

    def forget(self) -> None:
        """Begin anew."""
        self._seen.clear()

    def see(self, frame: Frame) -> None:
        """Look for the largest person in a frame."""
        self._seen = [item for item in self._seen if frame.time - item[0].time < KEEP]
        found = sightings(frame.image, self._plate, self._camera)
        if found:
            self._seen.append((Frame(frame.number, frame.time, self._plate[:0]), found[0]))

    def enough(self) -> bool:
        """Whether somebody was seen often enough."""
        return len(self._seen) >= ENOUGH

    def full_second(self, frame: Frame) -> bool:
        """Whether somebody was seen often enough over the whole second before `frame`."""
        return self.enough() and frame.time - self._seen[0][0].time >= WINDOW

    def walks_in(self, frame: Frame) -> bool:
        """Whether somebody was seen often enough and moved: who stands has no phase to find."""
        if not self.full_second(frame):
            return False
        places = np.array([one.place[:2] for _, one in self._seen])
        path = _fit(np.array([seen.time for seen, _ in self._seen]), places)
        return float(np.hypot(*path.velocity)) >= _SLOW

    def start(self, *, latest: bool = False) -> Start:
        """First state at the first of the sightings, or at the latest."""
        at = self._seen[-1 if latest else 0][0]
        mean, sd = _state(self._seen, self._camera, self._model, self._height, at.time)
        return Start(at.number, mean, sd)


def _state(
    seen: list[tuple[Frame, Sighting]], camera: Camera, model: Model, height: float | None, when: float
) -> tuple[State, State]:
    """Mean and deviation of the walker at a time, seconds."""
    mean, sd = model.prior()
    if height is not None:
        set_height(mean, sd, height)
    distances = _distances(seen, camera, model, mean, sd)
    times = np.array([frame.time for frame, _ in seen])
    places = np.array([_place(camera, one, d) for (_, one), d in zip(seen, distances, strict=True)])
    path = _fit(times - times[0], places)
    _set_motion(mean, sd, path, model)
    mean.pelvis[:2] = path.place + (when - times[0]) * path.velocity
    mean.pelvis[2] = model.pelvis_height(mean)
    sd.pelvis[:] = _place_sd(camera, mean.pelvis[:2])
    return mean, sd


def _distances(
    seen: list[tuple[Frame, Sighting]], camera: Camera, model: Model, mean: State, sd: State
) -> Array:
    """Horizontal distances of the sightings from the lens; sets the stature.

    Unknown are the stature and one common factor on the distances by the feet; the height at which the
    head rays pass there ties the two (a linear Gaussian update).
    """
    by_foot = np.array([np.hypot(*(one.place - camera.centre)[:2]) for _, one in seen]) + _LEAD * mean.stature
    share = _crown_share(model, mean)
    tall = np.array(
        [
            [height_over(camera, one.head, d * f) for f in (1.0, 1.1)]
            for (_, one), d in zip(seen, by_foot, strict=True)
        ]
    )
    stature, steeper = np.median(tall, axis=0) / share
    slope = (steeper - stature) / 0.1  # of the head's stature against the factor
    middle = float(np.median(by_foot))
    stature_var, factor_var = sd.stature**2, (_depth_sd(middle) / middle) ** 2
    surprise = float(stature - mean.stature)
    total = stature_var + slope**2 * factor_var + _HEAD_SD**2
    mean.stature += stature_var / total * surprise
    sd.stature = float(np.sqrt(stature_var - stature_var**2 / total))
    return np.asarray(by_foot * (1 - slope * factor_var / total * surprise))


def _crown_share(model: Model, mean: State) -> float:
    """Height of the crown over ground while walking, as a share of stature."""
    heights = []
    for phase in np.arange(8) / 8:
        state = State(phase=float(phase), stature=mean.stature)
        crown = model.pose(state)[0][model.joint_names.index("head_top"), 2]
        heights.append(crown + model.pelvis_height(state))
    return float(np.mean(heights)) / mean.stature


def _place(camera: Camera, one: Sighting, distance: float) -> Array:
    """Ground point (2,) below the blob's middle at a horizontal distance from the lens."""
    away = (one.place - camera.centre)[:2]
    return np.asarray(camera.centre[:2] + away * distance / np.hypot(*away))


def _fit(times: Array, places: Array) -> _Path:
    """Line through places (n, 2) by the medians of all pairwise slopes (Theil 1950)."""
    early, late = np.triu_indices(len(times), max(1, len(times) // 3))
    slopes = (places[late] - places[early]) / (times[late] - times[early])[:, None]
    velocity = np.median(slopes, axis=0)
    start = np.median(places - times[:, None] * velocity, axis=0)
    off = places - start - times[:, None] * velocity
    scatter = 1.4826 * np.median(np.hypot(*off.T))
    spread = np.sqrt(len(times)) * times.std()
    return _Path(start, velocity, float(3 * scatter / spread))  # 3: errors of neighbouring frames go together


def _set_motion(mean: State, sd: State, path: _Path, model: Model) -> None:
    """Heading and cadence from the motion, where it is fast enough to tell."""
    speed = float(np.hypot(*path.velocity))
    doubt = path.velocity_sd / max(speed, 1e-6)
    if speed < _SLOW or doubt > 0.5:
        mean.heading, sd.heading = 0.0, np.pi
        return
    mean.heading = float(np.arctan2(path.velocity[1], path.velocity[0]))
    sd.heading = float(np.hypot(_HEADING_SD, doubt))
    info = model.info
    if not (info.stride_length > 0 and sd.stride_hz > 0):  # the model has no stride, or knows its rate
        return
    rate = speed / (info.stride_length * mean.stature)
    rate_sd = rate * float(np.hypot(doubt, info.stride_length_sd / info.stride_length))
    known, seen = 1 / sd.stride_hz**2, 1 / rate_sd**2
    mean.stride_hz = (mean.stride_hz * known + rate * seen) / (known + seen)
    sd.stride_hz = float(1 / np.sqrt(known + seen))


def _depth_sd(distance: float) -> float:
    return float(np.hypot(_DEPTH_SD[0], _DEPTH_SD[1] * distance))


def _place_sd(camera: Camera, place: Array) -> Array:
    """Deviations (3,) along the world's axes: wide along the viewing ray, narrow across."""
    away = place - camera.centre[:2]
    distance = float(np.hypot(*away))
    along, across = _depth_sd(distance) * away / distance, _SIDE_SD * away[::-1] / distance
    return np.array([*np.hypot(along, across), 0.03])
