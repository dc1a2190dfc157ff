"""Automatic start from pictures: find boxes around people in a clip until a person walks.

People are found where frames differ from the empty scene or, if that is unknown, by their shape; the library
fits a walk to one second of their boxes (`gait.bindings.start_fit`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from gait.bindings.abi import TrackStatus
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.bindings.start_fit import Box, Hypothesis, StartFit
from gait.camera.camera import Camera
from gait.detect import weights
from gait.detect.shapes import PLAUSIBLE, find_people
from gait.errors import GaitError, UserError
from gait.io.video import Frame, Image, Video

_FEWEST_FRAMES = 8  # fewest frames with a person
_SELDOM = 0.09  # least seconds between frames searched without a background, which is slow
_BOX_WINDOW_S = 1.0  # seconds of boxes that are fitted
_LEAST_WINDOW = 0.3  # least seconds in a short clip
_PROBES = 6  # frames of a clip, at least one of which must show a person
_FIT_STEP_S = 0.1  # seconds from one fit to the next
_GOES_ON = 1.5  # seconds searched after the first window with a walk, which may show only its beginning
_ONLY_STANDING = (
    "--init auto found a person who stays in place but none who walks along the floor; give --init FILE.json "
    f"or use the detector ({weights.FETCH})"
)
_GIVEN_STATURE_SD_M = 0.03  # metres, of a stature given by the user
_BEYOND = 4.0  # standard deviations from which an apparent stature contradicts the expected one


class BoxStart:
    """Watches frames for a person to start with.

    Parameters
    ----------
    camera, plate, model
        `plate` is the empty scene, BGR; without it people are found by their shape, at most every 0.09 s.
        Frames of a moving camera have their own.
    height : float, optional
        Known stature, metres.
    window : float
        Seconds for which a person must be in view.

    Attributes
    ----------
    misplaced : list of float
        Apparent stature of the largest person, metres, in each frame in which all statures would be
        implausible; NaN above the horizon.
    """

    def __init__(
        self,
        camera: Camera,
        plate: Image | None,
        model: Model,
        height: float | None = None,
        window: float = _BOX_WINDOW_S,
    ) -> None:
        known = {} if height is None else {"stature": height, "stature_sd": _GIVEN_STATURE_SD_M}
        self._fit = StartFit(model, camera, box_time=window, **known)
        self._expected = model.prior()[0].stature if height is None else height
        self._plate, self._window = plate, window
        self.misplaced: list[float] = []
        self._times: list[tuple[int, float]] = []  # number and time of the frames observed
        self._statures: list[float] = []
        self._last_fit = -np.inf

    def forget(self) -> None:
        """Forget all frames observed."""
        self._fit.reset()
        self._times.clear()
        self._statures.clear()

    def observe(self, frame: Frame) -> None:
        """Find people in a frame and add their boxes to the fit."""
        if self._plate is None and self._times and 0 <= frame.time - self._times[-1][1] < _SELDOM:
            return
        boxes = self._boxes(frame)
        self._times.append((frame.number, frame.time))
        self._fit.add_boxes(frame.utime, boxes)
        self._statures += [self._fit.stature(box) for box in boxes[:1]]

    def worth(self, video: Video, first: int, stop: int) -> bool:
        """Whether to search a clip: without the empty scene, which is slow, a probe must show a person."""
        if self._plate is not None:
            return True
        probes = np.unique(np.linspace(first, stop - 1, _PROBES).astype(int)).tolist()
        shown = (frame for n in probes for frame in video.frames(n, n + 1))
        return any(self._boxes(frame) for frame in shown)

    def best(self, frame: Frame, *, latest: bool = False) -> tuple[Start, Hypothesis] | None:
        """Find the most probable start, at a frame (`latest`) or half a window earlier; None if none fits."""
        back = 0.0 if latest else self._window / 2
        at = next((item for item in self._times if item[1] >= frame.time - back - 1e-6), None)
        if at is None:
            return None
        try:
            found = self._fit.solve(round(1e6 * at[1]))
        except GaitError:
            return None
        apparent = float(np.median(self._statures))
        sure = abs(apparent - self._expected) < _BEYOND * np.hypot(0.07, 0.03 * self._expected)
        one = found[0]
        stature = None if sure else apparent
        return Start(at[0], one.mean, one.sd, stature, hypotheses=tuple(found)), one

    def walks_in(self, frame: Frame) -> Start | None:
        """Return a start at the frame just observed if a person walks there, otherwise None."""
        if not self._times or self._times[-1][0] != frame.number:
            return None
        if 0 <= frame.time - self._last_fit < _FIT_STEP_S:
            return None
        self._last_fit = frame.time
        found = self.best(frame, latest=True)
        return found[0] if found is not None and found[1].walks else None

    def find_lost(self, frame: Frame, status: TrackStatus) -> Start | None:
        """Return a start at a frame in which a lost person walks; while they are tracked, forget frames."""
        if status in (TrackStatus.TRACKING, TrackStatus.AMBIGUOUS):
            self.forget()
        if status != TrackStatus.LOST:
            return None
        self.observe(frame)
        return self.walks_in(frame)

    def _boxes(self, frame: Frame) -> list[Box]:
        plate = self._plate
        if frame.pose is not None:
            self._fit.set_pose(frame.pose)
            plate = None if plate is None else frame.plate
        if self._plate is None:
            return find_people(frame.image, self._fit.stature)
        boxes = [] if plate is None else self._fit.find_boxes(frame.image, plate)
        statures = [self._fit.stature(box) for box in boxes]
        people = [
            box for box, tall in zip(boxes, statures, strict=True) if PLAUSIBLE[0] <= tall <= PLAUSIBLE[1]
        ]
        if statures and not people:
            self.misplaced.append(statures[0])
        return people


def find_start(
    video: Video,
    camera: Camera,
    plate: Image | None,
    model: Model,
    *,
    first: int = 0,
    stop: int | None = None,
    height: float | None = None,
    shapes: bool = True,
    shapes_first: bool = False,
) -> Start:
    """Find the first state of the first person who walks in a clip.

    If no person walks, a person who stands out against the empty scene is used, with an unknown heading,
    unless the scene may not be empty (`shapes_first`).

    Parameters
    ----------
    video, camera, plate, model
        `plate` is the empty scene, BGR.
    first, stop : int
        Frames to search, `first` <= number < `stop`.
    height : float, optional
        Known stature, metres.
    shapes : bool
        Also find people by their shape, which is slow, if none stands out against the empty scene.
    shapes_first : bool
        Find people by their shape before using the scene, since it may not be empty.

    Raises
    ------
    UserError
        If no person is in full view for long enough.
    """
    misplaced: list[float] = []
    count = min(video.count, video.count if stop is None else stop) - first
    window = float(np.clip(0.8 * count / video.fps, _LEAST_WINDOW, _BOX_WINDOW_S))
    standing: Start | None = None
    for finder in _finders(camera, plate, model, height, window, shapes, shapes_first):
        if not finder.worth(video, first, first + count):
            continue
        walking, stands = _search(finder, video.frames(first, stop))
        if walking is not None:
            return walking
        standing = standing or stands
        misplaced += finder.misplaced
    if standing is not None and plate is not None and not shapes_first:
        return standing
    words = _no_person(count, misplaced) if standing is None else _ONLY_STANDING
    raise UserError(f"{video.path}: {words}")


def _search(finder: BoxStart, frames: Iterable[Frame]) -> tuple[Start | None, Start | None]:
    """Search frames; return the start of a person who walks, and the first start of one who may not walk.

    After the first window with a walk the search continues, and the window with the most certain speed is
    used: people who are just starting to walk are slower, and their direction is uncertain.
    """
    first: Start | None = None
    best: tuple[float, Start] | None = None
    last_fit, until = -np.inf, np.inf
    for frame in frames:
        finder.observe(frame)
        if frame.time - last_fit < _FIT_STEP_S:
            continue
        last_fit = frame.time
        found = finder.best(frame)
        if found is not None:
            start, one = found
            first = first or start
            sure = one.probability * one.speed / one.speed_sd
            if one.walks and (best is None or sure > best[0]):
                best = sure, start
        if best is not None:
            until = min(until, frame.time + _GOES_ON)
        if frame.time >= until:
            break
    return (None if best is None else best[1]), first


def _finders(
    camera: Camera,
    plate: Image | None,
    model: Model,
    height: float | None,
    window: float,
    shapes: bool,
    shapes_first: bool,
) -> Iterator[BoxStart]:
    """Yield the ways to find a person, with the empty scene first, as it gives a better position."""
    by_plate = None if plate is None else BoxStart(camera, plate, model, height, window)
    by_shape = BoxStart(camera, None, model, height, window) if shapes else None
    order = (by_shape, by_plate) if shapes_first else (by_plate, by_shape)
    yield from (finder for finder in order if finder is not None)


def _no_person(count: int, misplaced: list[float]) -> str:
    """Explain why there is no start, and what to do."""
    if count == 1:
        return "only 1 frame to track; give at least one second of film, and check --start and --stop"
    if count < _FEWEST_FRAMES:
        return f"only {count} frames to track, --init auto needs {_FEWEST_FRAMES}; give --init FILE.json"
    if len(misplaced) < _FEWEST_FRAMES:
        return f"--init auto found no person in full view for {_FEWEST_FRAMES} frames; give --init FILE.json"
    tall = np.nanmedian(misplaced) if np.isfinite(misplaced).any() else np.nan
    what = f"makes {tall:.2g} m tall" if tall > 0 else "puts upside down"
    if np.isnan(misplaced).mean() > 0.5:
        what = "places above the horizon"
    return (
        f"--init auto found a person in {len(misplaced)} frames that the camera {what}; "
        "check the camera's height and tilt, or give --init FILE.json"
    )
