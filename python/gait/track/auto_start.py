"""Automatic start: where a person stands and which way they walk, from a second of detections.

Gives place, stature, heading and a guess of the cadence, each with its uncertainty; the phase stays unknown.
People are detected against the background or, without one, by their shape.  Cast shadows and the nearer foot
pull a blob's foot point towards the camera, and the feet of the shape detector are imprecise, so the place is
kept uncertain along the viewing ray.
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
from gait.track.person_detection import Detection, detect_change, detect_shape, height_over

Array = NDArray[np.float64]

WINDOW = 1.0  # seconds of detections used
KEEP = 1.5  # seconds after which a detection is forgotten
ENOUGH = 8  # detections, at least
SELDOM = 0.09  # seconds, at least, between frames searched without a background: the shape detector is slow
_BLUR = 0.25  # heights that the feet may seem to move between detections
_FASTEST = 2.0  # heights per second
_LEAD = 0.1  # statures by which the lowest foot is nearer to the camera than the pelvis, on average
_DEPTH_SD = (0.10, 0.02)  # of the foot point along the viewing ray: metres, and share of the distance
_HEAD_SD = 0.03  # of the stature by head and foot ray: hair, shoes, blur; metres
_SIDE_SD = 0.06  # metres across the viewing ray
_SLOW = 0.4  # metres per second below which motion gives neither heading nor cadence
_TOGETHER = 0.3  # seconds over which errors of the feet are correlated
_UNKNOWN = 0.7  # radians of standard deviation from which a heading counts as unknown
_NEAR = 0.05  # metres per second: the least error of a velocity
_USUAL_SPEED, _SPEED_SHARE = 1.2, 0.35  # metres per second, and the standard deviation between people
_HEADING_SD = 0.2  # radians, at least: people do not walk exactly where their blob moves
_BEYOND = 4.0  # standard deviations by which an observed stature contradicts the expected one
_BUILD_SHARE = 0.25  # of the standard deviations of scores and posture: few particles find the phase first

_History = list[tuple[Frame, Detection]]  # of one person, oldest first


@dataclass(frozen=True)
class _Path:
    """Straight path over the ground: place at the first detection, velocity and its covariance (2, 2).

    `scatter` (2, 2) is the mean square of the residuals.
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
    """Find the first state of a walking person in a clip.

    Parameters
    ----------
    video, camera, plate, model
        `plate` is the empty scene, BGR.  Without it, or where no person stands out against it, people are
        detected by their shape.
    first, stop : int
        Frames to search, `first` <= number < `stop`.
    height : float, optional
        Known stature, metres.

    Raises
    ------
    UserError
        If no person is in full view for long enough.
    """
    misplaced: list[float] = []
    for start in _detectors(camera, plate, model, height):
        start.misplaced = misplaced
        for frame in video.frames(first, stop):
            if start.full_second(frame):
                break
            start.observe(frame)
        state = start.state() if start.enough() else None
        if state and (start.by_change or state.sd.heading < np.pi):
            return state
    few = min(video.count, video.count if stop is None else stop) - first
    if few < ENOUGH:
        raise UserError(
            f"{video.path}: only {few} frame{'s'[: few != 1]} to track, --init auto needs {ENOUGH}; "
            "give --init FILE.json"
        )
    if len(misplaced) >= ENOUGH:
        raise UserError(
            f"{video.path}: --init auto found a person in {len(misplaced)} frames that the camera "
            f"{_misplacement(misplaced)}; check the camera's height and tilt, or give --init FILE.json"
        )
    raise UserError(
        f"{video.path}: --init auto found no person in full view for {ENOUGH} frames; give --init FILE.json"
    )


def _misplacement(statures: list[float]) -> str:
    """Describe where a camera puts people of these statures, NaN where no ground is under them."""
    if np.isnan(statures).mean() > 0.5:
        return "puts above the horizon"
    return f"makes {np.nanmedian(statures):.2g} m tall"


def _detectors(
    camera: Camera, plate: Image | None, model: Model, height: float | None
) -> Iterator[AutoStart]:
    """Yield the ways to detect a person: by change first, as it gives the place better."""
    if plate is not None:
        yield AutoStart(camera, plate, model, height)
    yield AutoStart(camera, None, model, height)


class AutoStart:
    """Watches frames for a person to start with; keeps the latest detections of every person.

    Parameters
    ----------
    camera, plate, model
        `plate` is the empty scene, BGR; without one people are detected by their shape, every `SELDOM`
        seconds.
    height : float, optional
        Known stature, metres.

    Attributes
    ----------
    misplaced : list of float or None
        If given, gets a stature for each frame in which the camera makes a person's stature implausible.
    """

    def __init__(
        self, camera: Camera, plate: Image | None, model: Model, height: float | None = None
    ) -> None:
        self._camera, self._plate, self._model, self._height = camera, plate, model, height
        self.misplaced: list[float] | None = None
        self._people: list[_History] = []
        self._last_time = -np.inf  # of the last search without a plate

    @property
    def by_change(self) -> bool:
        """Whether people are detected by change, and not by a shape that standing things may have too."""
        return self._plate is not None

    def forget(self) -> None:
        """Start afresh."""
        self._people.clear()

    def observe(self, frame: Frame) -> None:
        """Detect people in a frame and assign them to those detected before."""
        if self._plate is None:
            if 0 <= frame.time - self._last_time < SELDOM:
                return
            self._last_time = frame.time
        kept = ([item for item in history if frame.time - item[0].time < KEEP] for history in self._people)
        self._people = [history for history in kept if history]
        stamp = Frame(frame.number, frame.time, frame.image[:0])
        for one in self._detect(frame.image):
            known = min(self._people, key=lambda history: _apart(history, stamp, one), default=None)
            if known is None or _apart(known, stamp, one) > 1:
                self._people.append([(stamp, one)])
            else:
                known.append((stamp, one))

    def enough(self) -> bool:
        """Whether a person was detected often enough."""
        return any(len(history) >= ENOUGH for history in self._people)

    def full_second(self, frame: Frame) -> bool:
        """Whether a person was detected often enough over the whole second before `frame`."""
        return any(_full(history, frame) for history in self._people)

    def walks_in(self, frame: Frame) -> bool:
        """Whether such a person moves as well: a person who stands has no phase to find."""
        return any(_full(history, frame) and _speed(history) >= _SLOW for history in self._people)

    def state(self, *, latest: bool = False) -> Start:
        """First state at the first detection of the person, or at the latest.

        Of several people, one who walks is preferred to one who stands, then the one most clearly detected.
        """
        often = [history for history in self._people if len(history) >= ENOUGH]
        person = max(often, key=lambda h: (_speed(h) >= _SLOW, sum(one.strength for _, one in h)))
        at = person[-1 if latest else 0][0]
        mean, sd, apparent = _state(person, self._camera, self._model, self._height, at.time)
        return Start(at.number, mean, sd, apparent)

    def _detect(self, image: Image) -> list[Detection]:
        if self._plate is None:
            return detect_shape(image, self._camera)
        return detect_change(image, self._plate, self._camera, self.misplaced)


def _apart(history: _History, frame: Frame, one: Detection) -> float:
    """Distance of a detection from a person's last, as a share of how far they can have walked since."""
    last, was = history[-1]
    if last.number == frame.number:
        return np.inf
    reach = (_BLUR + _FASTEST * (frame.time - last.time)) * was.tall
    return float(np.hypot(*(one.foot - was.foot))) / reach


def _full(history: _History, frame: Frame) -> bool:
    return len(history) >= ENOUGH and frame.time - history[0][0].time >= WINDOW


def _speed(history: _History) -> float:
    """Metres per second over the ground, by the feet."""
    times = np.array([frame.time for frame, _ in history])
    return float(np.hypot(*_fit(times, np.array([one.place[:2] for _, one in history])).velocity))


def _state(
    history: _History, camera: Camera, model: Model, height: float | None, when: float
) -> tuple[State, State, float | None]:
    """Mean and standard deviation of the state at a time; the apparent stature if it contradicts the mean."""
    mean, sd = model.prior()
    if height is not None:
        set_height(mean, sd, height)
    distances, apparent = _distances(history, camera, model, mean, sd)
    times = np.array([frame.time for frame, _ in history])
    places = np.array([_place(camera, one, d) for (_, one), d in zip(history, distances, strict=True)])
    path = _fit(times - times[0], places)
    _set_motion(mean, sd, path, model)
    mean.pelvis[:2] = path.place + (when - times[0]) * path.velocity
    mean.pelvis[2] = model.pelvis_height(mean)
    sd.pelvis[:] = _place_sd(camera, mean.pelvis[:2], history[0][1].sd * mean.stature)
    sd.pelvis[:2] = np.hypot(sd.pelvis[:2], np.sqrt(path.scatter.diagonal()))
    sd.coef, sd.offset = _BUILD_SHARE * sd.coef, _BUILD_SHARE * sd.offset
    return mean, sd, apparent


def _distances(
    history: _History, camera: Camera, model: Model, mean: State, sd: State
) -> tuple[Array, float | None]:
    """Horizontal distances of the detections from the lens; an apparent stature that contradicts the mean.

    Unknown are the stature and one common factor on the distances by the feet; the height at which the
    head rays pass there ties the two (a linear Gaussian update).
    """
    by_foot = (
        np.array([np.hypot(*(one.place - camera.centre)[:2]) for _, one in history]) + _LEAD * mean.stature
    )
    share = _crown_share(model, mean)
    tall = np.array(
        [
            [height_over(camera, one.head, d * f) for f in (1.0, 1.1)]
            for (_, one), d in zip(history, by_foot, strict=True)
        ]
    )
    stature, steeper = np.median(tall, axis=0) / share
    slope = (steeper - stature) / 0.1  # of the head's stature against the factor
    middle = float(np.median(by_foot))
    foot_sd = history[0][1].sd * mean.stature
    stature_var, factor_var = sd.stature**2, (_depth_sd(camera, middle, foot_sd) / middle) ** 2
    surprise = float(stature - mean.stature)
    total = stature_var + slope**2 * factor_var + _HEAD_SD**2 + foot_sd**2
    mean.stature += stature_var / total * surprise
    sd.stature = float(np.sqrt(stature_var - stature_var**2 / total))
    apparent = float(stature) if abs(surprise) > _BEYOND * np.sqrt(total) else None
    return np.asarray(by_foot * (1 - slope * factor_var / total * surprise)), apparent


def _crown_share(model: Model, mean: State) -> float:
    """Height of the crown over ground while walking, as a share of stature."""
    heights = []
    for phase in np.arange(8) / 8:
        state = State(phase=float(phase), stature=mean.stature)
        crown = model.pose(state)[0][model.joint_names.index("head_top"), 2]
        heights.append(crown + model.pelvis_height(state))
    return float(np.mean(heights)) / mean.stature


def _place(camera: Camera, one: Detection, distance: float) -> Array:
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
    alone = max(1.0, len(times) * _TOGETHER / float(times[-1] - times[0]))  # detections that count as one
    return _Path(start, velocity, scatter * alone / (len(times) * times.var()), scatter)


def _set_motion(mean: State, sd: State, path: _Path, model: Model) -> None:
    """Set heading and cadence from the motion, if it is fast enough."""
    info = model.info
    usual = info.stride_length * mean.stature * mean.stride_hz or _USUAL_SPEED  # a model may have no stride
    heading, heading_sd, speed, speed_sd = _course(path, usual)
    if float(np.hypot(*path.velocity)) < _SLOW or heading_sd > _UNKNOWN:
        mean.heading, sd.heading = 0.0, np.pi
        return
    mean.heading = heading
    sd.heading = float(np.hypot(_HEADING_SD, heading_sd))
    if not (info.stride_length > 0 and sd.stride_hz > 0):  # no stride in the model, or a known rate
        return
    rate = speed / (info.stride_length * mean.stature)
    rate_sd = rate * float(np.hypot(speed_sd / speed, info.stride_length_sd / info.stride_length))
    prior, measured = 1 / sd.stride_hz**2, 1 / rate_sd**2  # precisions
    mean.stride_hz = (mean.stride_hz * prior + rate * measured) / (prior + measured)
    sd.stride_hz = float(1 / np.sqrt(prior + measured))


def _course(path: _Path, usual: float) -> tuple[float, float, float, float]:
    """Heading and speed, each with its standard deviation, given the path and how fast people walk."""
    heading = np.linspace(-np.pi, np.pi, 360, endpoint=False)[:, None]
    speed = np.linspace(0.1, 3.0, 59)[None, :]
    off = speed[..., None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1) - path.velocity
    chi2 = np.einsum("hsi,ij,hsj->hs", off, np.linalg.inv(path.covariance + _NEAR**2 * np.eye(2)), off)
    chi2 += ((speed - usual) / (_SPEED_SHARE * usual)) ** 2
    share = np.exp(-0.5 * (chi2 - chi2.min()))
    share /= share.sum()
    resultant = complex((share * np.exp(1j * heading)).sum())
    fast = float((share * speed).sum())
    fast_sd = float(np.sqrt((share * (speed - fast) ** 2).sum()))
    length = max(abs(resultant), 1e-12)  # 0 where nothing moves: no heading at all
    return float(np.angle(resultant)), float(np.sqrt(-2 * np.log(length))), fast, fast_sd


def _depth_sd(camera: Camera, distance: float, foot_sd: float) -> float:
    """Return the sd along the viewing ray, metres; `foot_sd` is that of the feet's height, metres."""
    own = float(np.hypot(_DEPTH_SD[0], _DEPTH_SD[1] * distance))
    return float(np.hypot(own, foot_sd * distance / abs(float(camera.centre[2]))))


def _place_sd(camera: Camera, place: Array, foot_sd: float) -> Array:
    """Return sds (3,) along the world's axes: large along the viewing ray, small across it."""
    away = place - camera.centre[:2]
    distance = float(np.hypot(*away))
    along = _depth_sd(camera, distance, foot_sd) * away / distance
    across = np.hypot(_SIDE_SD, foot_sd) * away[::-1] / distance
    return np.array([*np.hypot(along, across), 0.03])
