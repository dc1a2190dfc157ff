"""Automatic start: where a walker stands and heads, from a second of sightings.

Gives place, stature, heading and a guess of the cadence, each with its uncertainty; the phase stays
unknown.  People are seen against the background, or, without one, by a detector.  Cast shadows and the nearer
foot pull a blob's foot point towards the camera, and a detector's feet are vague, so the place is kept wide
along the viewing ray.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.bindings.initial import Start, set_height
from gait.bindings.model import Model
from gait.bindings.state import State
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.video import Frame, Image, Video
from gait.track.person_detection import Sighting, height_over, people, sightings

Array = NDArray[np.float64]

WINDOW = 1.0  # seconds of sightings used
KEEP = 1.5  # seconds after which a sighting is forgotten
ENOUGH = 8  # sightings, at least
SELDOM = 0.09  # seconds, at least, between frames looked at without a background: the detector is slow
_BLUR = 0.25  # heights that the feet seem to jump between sightings
_FASTEST = 2.0  # heights per second
_LEAD = 0.1  # statures by which the lowest foot is nearer to the camera than the pelvis, on average
_DEPTH_SD = (0.10, 0.02)  # of the foot point along the viewing ray: metres, and share of the distance
_HEAD_SD = 0.03  # of the stature by head and foot ray: hair, shoes, blur; metres
_SIDE_SD = 0.06  # metres across the viewing ray
_SLOW = 0.4  # metres per second below which motion says nothing about heading or cadence
_TOGETHER = 0.3  # seconds over which errors of the feet go together
_DOUBT = 0.7  # radians: a heading known worse counts as unknown
_NEAR = 0.05  # metres per second: the least error of a velocity
_USUAL_SPEED, _SPEED_SHARE = 1.2, 0.35  # metres per second, and the deviation between people
_HEADING_SD = 0.2  # radians, at least: people do not walk exactly where their blob moves
_BEYOND = 4.0  # deviations by which a stature seen is another than was believed
_BUILD_SHARE = 0.25  # of the deviations of scores and posture: few particles find the phase first

_Seen = list[tuple[Frame, Sighting]]  # of one person, oldest first


@dataclass(frozen=True)
class _Path:
    """Straight path over the ground: place at the first sighting, velocity and its covariance (2, 2).

    `scatter` (2, 2) is the mean square of what it leaves.
    """

    place: Array
    velocity: Array
    covariance: Array
    scatter: Array


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
        `plate` is the empty scene, BGR; where nobody is seen against it, or without it, people are told by
        their looks.
    first, stop : int
        Frames to look at, `first` <= number < `stop`.
    height : float, optional
        Known stature, metres.

    Raises
    ------
    UserError
        If no person stands in full view for long enough.
    """
    misplaced: list[float] = []
    for spotter in _spotters(camera, plate, model, height):
        spotter.misplaced = misplaced
        for frame in video.frames(first, stop):
            if spotter.full_second(frame):
                break
            spotter.see(frame)
        start = spotter.start() if spotter.enough() else None
        if start and (spotter.sees_change or start.sd.heading < np.pi):
            return start
    few = min(video.count, video.count if stop is None else stop) - first
    if few < ENOUGH:
        raise UserError(
            f"{video.path}: only {few} frame{'s'[: few != 1]} to track, --init auto needs {ENOUGH}; "
            "give --init FILE.json"
        )
    if len(misplaced) >= ENOUGH:
        raise UserError(
            f"{video.path}: --init auto saw somebody in {len(misplaced)} frames whom the camera "
            f"{_puts(misplaced)}; check the camera's height and tilt, or give --init FILE.json"
        )
    raise UserError(
        f"{video.path}: --init auto found nobody in full view for {ENOUGH} frames; give --init FILE.json"
    )


def _puts(statures: list[float]) -> str:
    """Where a camera has people of these statures, which are not numbers where no ground is under them."""
    if np.isnan(statures).mean() > 0.5:
        return "puts above the horizon"
    return f"makes {np.nanmedian(statures):.2g} m tall"


def _spotters(camera: Camera, plate: Image | None, model: Model, height: float | None) -> Iterator[Spotter]:
    """Yield what to look for somebody with: the background first, because it tells the place better."""
    if plate is not None:
        yield Spotter(camera, plate, model, height)
    yield Spotter(camera, None, model, height)


class Spotter:
    """Watches frames for somebody to start with; keeps the latest sightings of everybody.

    Parameters
    ----------
    camera, plate, model
        `plate` is the empty scene, BGR; without one people are told by their looks (`people`), every
        `SELDOM` seconds.
    height : float, optional
        Known stature, metres.
    """

    def __init__(
        self, camera: Camera, plate: Image | None, model: Model, height: float | None = None
    ) -> None:
        self._camera, self._plate, self._model, self._height = camera, plate, model, height
        self.misplaced: list[float] | None = (
            None  # a stature for each frame with blobs of no person's, if given
        )
        self._everybody: list[_Seen] = []
        self._looked = -np.inf  # when, without a plate

    @property
    def sees_change(self) -> bool:
        """Whether people are told by the background, and not by looks, which things that stand have, too."""
        return self._plate is not None

    def forget(self) -> None:
        """Begin anew."""
        self._everybody.clear()

    def see(self, frame: Frame) -> None:
        """Look for people in a frame, and for whom of those seen before they are."""
        if self._plate is None:
            if 0 <= frame.time - self._looked < SELDOM:
                return
            self._looked = frame.time
        kept = ([item for item in seen if frame.time - item[0].time < KEEP] for seen in self._everybody)
        self._everybody = [seen for seen in kept if seen]
        bare = Frame(frame.number, frame.time, frame.image[:0])
        for one in self._look(frame.image):
            known = min(self._everybody, key=lambda seen: _apart(seen, bare, one), default=None)
            if known is None or _apart(known, bare, one) > 1:
                self._everybody.append([(bare, one)])
            else:
                known.append((bare, one))

    def enough(self) -> bool:
        """Whether somebody was seen often enough."""
        return any(len(seen) >= ENOUGH for seen in self._everybody)

    def full_second(self, frame: Frame) -> bool:
        """Whether somebody was seen often enough over the whole second before `frame`."""
        return any(_full(seen, frame) for seen in self._everybody)

    def walks_in(self, frame: Frame) -> bool:
        """Whether somebody was seen often enough and moved: who stands has no phase to find."""
        return any(_full(seen, frame) and _speed(seen) >= _SLOW for seen in self._everybody)

    def start(self, *, latest: bool = False) -> Start:
        """First state at the first of the sightings, or at the latest.

        Of several people whoever walks goes before whoever stands, then who was seen most of.
        """
        often = [seen for seen in self._everybody if len(seen) >= ENOUGH]
        seen = max(often, key=lambda seen: (_speed(seen) >= _SLOW, sum(one.strength for _, one in seen)))
        at = seen[-1 if latest else 0][0]
        mean, sd, looks = _state(seen, self._camera, self._model, self._height, at.time)
        return Start(at.number, mean, sd, looks)

    def _look(self, image: Image) -> list[Sighting]:
        if self._plate is None:
            return people(image, self._camera)
        return sightings(image, self._plate, self._camera, self.misplaced)


def _apart(seen: _Seen, frame: Frame, one: Sighting) -> float:
    """How far a sighting is from somebody's last, as a share of what a walker may have gone since."""
    last, was = seen[-1]
    if last.number == frame.number:
        return np.inf
    reach = (_BLUR + _FASTEST * (frame.time - last.time)) * was.tall
    return float(np.hypot(*(one.foot - was.foot))) / reach


def _full(seen: _Seen, frame: Frame) -> bool:
    return len(seen) >= ENOUGH and frame.time - seen[0][0].time >= WINDOW


def _speed(seen: _Seen) -> float:
    """Metres per second over the ground, by the feet."""
    times = np.array([frame.time for frame, _ in seen])
    return float(np.hypot(*_fit(times, np.array([one.place[:2] for _, one in seen])).velocity))


def _state(
    seen: _Seen, camera: Camera, model: Model, height: float | None, when: float
) -> tuple[State, State, float | None]:
    """Mean and deviation of the walker at a time, seconds, and the stature seen if another was believed."""
    mean, sd = model.prior()
    if height is not None:
        set_height(mean, sd, height)
    distances, looks = _distances(seen, camera, model, mean, sd)
    times = np.array([frame.time for frame, _ in seen])
    places = np.array([_place(camera, one, d) for (_, one), d in zip(seen, distances, strict=True)])
    path = _fit(times - times[0], places)
    _set_motion(mean, sd, path, model)
    mean.pelvis[:2] = path.place + (when - times[0]) * path.velocity
    mean.pelvis[2] = model.pelvis_height(mean)
    sd.pelvis[:] = _place_sd(camera, mean.pelvis[:2], seen[0][1].spread * mean.stature)
    sd.pelvis[:2] = np.hypot(sd.pelvis[:2], np.sqrt(path.scatter.diagonal()))
    sd.coef, sd.offset = _BUILD_SHARE * sd.coef, _BUILD_SHARE * sd.offset
    return mean, sd, looks


def _distances(
    seen: _Seen, camera: Camera, model: Model, mean: State, sd: State
) -> tuple[Array, float | None]:
    """Horizontal distances of the sightings from the lens; sets the stature, and tells one that surprises.

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
    spread = seen[0][1].spread * mean.stature
    stature_var, factor_var = sd.stature**2, (_depth_sd(camera, middle, spread) / middle) ** 2
    surprise = float(stature - mean.stature)
    total = stature_var + slope**2 * factor_var + _HEAD_SD**2 + spread**2
    mean.stature += stature_var / total * surprise
    sd.stature = float(np.sqrt(stature_var - stature_var**2 / total))
    looks = float(stature) if abs(surprise) > _BEYOND * np.sqrt(total) else None
    return np.asarray(by_foot * (1 - slope * factor_var / total * surprise)), looks


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
    scatter = off.T @ off / len(times)
    alone = max(1.0, len(times) * _TOGETHER / float(times[-1] - times[0]))  # sightings that are as one
    return _Path(start, velocity, scatter * alone / (len(times) * times.var()), scatter)


def _set_motion(mean: State, sd: State, path: _Path, model: Model) -> None:
    """Heading and cadence from the motion, where it is fast enough to tell."""
    info = model.info
    usual = info.stride_length * mean.stature * mean.stride_hz or _USUAL_SPEED  # a model may have no stride
    heading, heading_sd, speed, speed_sd = _course(path, usual)
    if float(np.hypot(*path.velocity)) < _SLOW or heading_sd > _DOUBT:
        mean.heading, sd.heading = 0.0, np.pi
        return
    mean.heading = heading
    sd.heading = float(np.hypot(_HEADING_SD, heading_sd))
    if not (info.stride_length > 0 and sd.stride_hz > 0):  # the model has no stride, or knows its rate
        return
    rate = speed / (info.stride_length * mean.stature)
    rate_sd = rate * float(np.hypot(speed_sd / speed, info.stride_length_sd / info.stride_length))
    known, seen = 1 / sd.stride_hz**2, 1 / rate_sd**2
    mean.stride_hz = (mean.stride_hz * known + rate * seen) / (known + seen)
    sd.stride_hz = float(1 / np.sqrt(known + seen))


def _course(path: _Path, usual: float) -> tuple[float, float, float, float]:
    """Heading and speed with their deviations, given the path and how fast people walk, on a grid of both."""
    heading = np.linspace(-np.pi, np.pi, 360, endpoint=False)[:, None]
    speed = np.linspace(0.1, 3.0, 59)[None, :]
    off = speed[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1) - path.velocity
    misfit = np.einsum("hsi,ij,hsj->hs", off, np.linalg.inv(path.covariance + _NEAR**2 * np.eye(2)), off)
    misfit += ((speed - usual) / (_SPEED_SHARE * usual)) ** 2
    share = np.exp(-0.5 * (misfit - misfit.min()))
    share /= share.sum()
    resultant = complex((share * np.exp(1j * heading)).sum())
    fast = float((share * speed).sum())
    spread = float(np.sqrt((share * (speed - fast) ** 2).sum()))
    length = max(abs(resultant), 1e-12)  # 0 where nothing moves: no heading at all
    return float(np.angle(resultant)), float(np.sqrt(-2 * np.log(length))), fast, spread


def _depth_sd(camera: Camera, distance: float, spread: float) -> float:
    """Deviation along the viewing ray, metres; `spread`: of the feet's height, metres."""
    own = float(np.hypot(_DEPTH_SD[0], _DEPTH_SD[1] * distance))
    return float(np.hypot(own, spread * distance / abs(float(camera.centre[2]))))


def _place_sd(camera: Camera, place: Array, spread: float) -> Array:
    """Deviations (3,) along the world's axes: wide along the viewing ray, narrow across."""
    away = place - camera.centre[:2]
    distance = float(np.hypot(*away))
    along = _depth_sd(camera, distance, spread) * away / distance
    across = np.hypot(_SIDE_SD, spread) * away[::-1] / distance
    return np.array([*np.hypot(along, across), 0.03])
