"""Input of the studio: a film, the keypoints of a person in it, the view, and a folder beside the film.

The folder ``walk.studio`` beside ``walk.mp4`` contains files that take long to make or must not be lost:
keypoints of the detector or of a track; film.mp4, which every browser can play frame by frame; and
corrections.json.
"""

from __future__ import annotations

import fcntl
import json
import os
import shlex
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.bindings.model import Model
from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.files import replacing
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_track
from gait.io.video import FAST, Video, VideoWriter, sample_frames
from gait.lift import run as lift_run
from gait.lift.run import Request, Warn
from gait.lift.smooth.options import Options
from gait.lift.video import run as video_run
from gait.progress import progress
from gait.studio.keypoint_lift import KeypointLift
from gait.studio.picture_lift import PictureLift
from gait.studio.shown import Lift
from gait.track.from_walk import Calibration
from gait.track.stabilise import FURTHEST_TURN, find_motion, moves
from gait.track.walk_camera import calibrate_film, expected_camera, find_people, note_camera

Floats = npt.NDArray[np.float64]

LARGEST_SIDE_PX = 1280  # pixels; largest longer side of the film for browsers
DETECTED = "keypoints.csv"  # the detector's keypoints, in the folder beside the film
KEYFRAMES = 8  # frames from one I-frame to the next, the most that seeking has to decode
LEAST_JOINT_SD_PX = 1.0  # pixels; least standard deviation of a track's joints
WITHOUT_PERSON = ("init", "lost")  # statuses of frames whose joints are not used


@dataclass(frozen=True)
class Wanted:
    """Arguments of the command: files, None if not given; stature in metres; field of view in degrees."""

    video: str
    camera: str | None = None
    scale_camera: bool = False
    height: float | None = None
    fov: float | None = None
    start: int | None = None
    stop: int | None = None
    keypoints: str | None = None
    track: str | None = None
    placement: str | None = None
    background: str | None = None
    corrections: str | None = None
    model: str | None = None

    def more(self) -> list[str]:
        """Arguments of ``gait lift`` for the frames to lift and the field of view."""
        given = {"--fov": self.fov, "--start": self.start, "--stop": self.stop}
        return [word for name, value in given.items() if value is not None for word in (name, f"{value:g}")]


@dataclass(frozen=True)
class Source:
    """Input of a session.

    Attributes
    ----------
    video : Video
    folder : Path
        Folder beside the film.
    film : Path
        Video for browsers; its frame k is frame k of the film.
    corrections : Path
        File of the corrections; may not exist yet.
    prior : SegmentPrior
    lift : Lift
        How to lift it.
    camera_words, model_words : list of str
        Options with which other commands use the same camera (none if it was estimated) and model.
    """

    video: Video
    folder: Path
    film: Path
    corrections: Path
    prior: SegmentPrior
    lift: Lift
    camera_words: list[str]
    model_words: list[str]


def open_source(wanted: Wanted, video: Video, folder: Path, warn: Warn, quiet: bool) -> Source:
    """Find or read everything; results that take long are kept in the `folder` beside the film (`folder_of`).

    Raises
    ------
    UserError
        One line that names the file at fault.
    """
    camera = Camera.read(wanted.camera, video.size, wanted.scale_camera) if wanted.camera else None
    if camera is not None and wanted.camera is not None:
        camera.check_place(wanted.camera)
    prior = lift_run.load_prior(wanted.model, warn)
    lift: Lift
    if wanted.placement:
        lift = _pictures(wanted, video, folder, prior, warn, quiet)
    else:
        lift = _keypoint_lift(wanted, video, camera, folder, prior, warn, quiet)
    film = _kept(folder / "film.mp4", video, lambda target: _write_film(target, video, quiet))
    if video.broken and (wanted.keypoints or wanted.track):  # other inputs have caused the warning
        warn(video.broken)
    corrections = Path(wanted.corrections) if wanted.corrections else folder / "corrections.json"
    words = ["--camera", shlex.quote(wanted.camera)] if wanted.camera else []
    words += ["--scale-camera"] if wanted.scale_camera else []
    model = ["--model", shlex.quote(wanted.model)] if wanted.model else []
    return Source(video, folder, film, corrections, prior, lift, words, model)


def _keypoint_lift(
    wanted: Wanted,
    video: Video,
    camera: Camera | None,
    folder: Path,
    prior: SegmentPrior,
    warn: Warn,
    quiet: bool,
) -> KeypointLift:
    path, keypoints = _keypoints(wanted, video, camera, folder, prior, warn, quiet)
    require_still(video, camera or expected_camera(video, wanted.fov), {0: keypoints}, warn)
    request = Request(
        options=Options(stature=wanted.height),
        camera=wanted.camera,
        size=video.size if wanted.scale_camera else None,
        calibration=_calibration(wanted, video, keypoints, quiet),
        hints=False,
    )
    prepared = lift_run.prepare(path, keypoints, prior, request, warn, quiet)
    return KeypointLift(path, prior, prepared, request, wanted.video, wanted.more())


def require_still(video: Video, camera: Camera, people: dict[int, Keypoints], warn: Warn) -> None:
    """Raise UserError if the camera turns far, as corrections need a static view; warn about small motion.

    Parameters are as for `gait.track.stabilise.find_motion`.
    """
    samples = sample_frames(video)
    if not moves(camera, samples, people):
        return
    motion, _ = find_motion(video, camera, samples, people)
    far = 0.0 if motion is None else motion.furthest()
    if far > FURTHEST_TURN * video.width:
        raise UserError(
            f"{video.path}: its camera turns by up to {far:.0f} px, and gait studio corrects films of one "
            "that stands still; lift it by gait lift --stabilize auto"
        )
    how = f"turns by up to {far:.0f} px" if far else "moves"
    warn(f"{video.path}: its camera {how}, which counts as motion of the person")


def _pictures(
    wanted: Wanted, video: Video, folder: Path, prior: SegmentPrior, warn: Warn, quiet: bool
) -> PictureLift:
    assert wanted.placement is not None
    calibration = None
    if wanted.height and not wanted.camera:
        path = _detected(wanted, video, folder, quiet)
        keypoints, _ = keypoints_file.read(path, prior.names, ignore_unknown=True)
        calibration = _calibration(wanted, video, keypoints, quiet)
    request = video_run.Request(
        video=wanted.video,
        placement=wanted.placement,
        model=wanted.model,
        camera=wanted.camera,
        scale_camera=wanted.scale_camera,
        calibration=calibration,
        height=wanted.height,
        background=wanted.background or "auto",
        start=wanted.start,
        stop=wanted.stop,
    )
    _, clip = video_run.open_clip(request, prior, warn, quiet)
    return PictureLift(clip, request, wanted.more())


def _calibration(wanted: Wanted, video: Video, keypoints: Keypoints, quiet: bool) -> Calibration | None:
    """Estimate the camera from the walk, if the stature is given and no camera."""
    if wanted.camera or not wanted.height:
        return None
    _, found = calibrate_film(video, {1: keypoints}, Model(None), wanted.height, wanted.fov, quiet)
    note_camera(found, quiet)
    return found


@contextmanager
def folder_of(video: Video) -> Iterator[Path]:
    """Provide the folder beside the film, locked so that two processes do not overwrite each other's files.

    If the block raises an error, a new folder keeps only the detector's keypoints.
    """
    folder = video.path.with_name(f"{video.path.name}.studio")
    before = folder.exists()
    try:
        folder.mkdir(exist_ok=True)
        lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until the process ends
    except BlockingIOError:
        raise UserError(f"{folder}: another gait studio has this film open; use or close that one") from None
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}; copy the film to a writable folder") from error
    try:
        yield folder
    except UserError:
        if not before:
            _tidy(folder)
        raise


def _tidy(folder: Path) -> None:
    """Remove all but the detector's keypoints, and the folder if there are none."""
    found = folder / DETECTED
    for file in set(folder.iterdir()) - ({found, _mark(found)} if _mark(found).exists() else set()):
        file.unlink()
    with suppress(OSError):  # not empty
        folder.rmdir()


def _mark(path: Path) -> Path:
    """Return the file that states from what a kept file was made."""
    return path.with_name(f".{path.name}.json")


def _kept(path: Path, video: Video, make: Callable[[Path], None], **how: int | None) -> Path:
    """Make a file, unless it has been made from this film in the same way."""
    mark = _mark(path)
    state = Path(video.path).stat()
    source = {"film": Path(video.path).name, "bytes": state.st_size, "changed": state.st_mtime_ns} | how
    try:
        known = json.loads(mark.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        known = None
    if known != source or not path.is_file():
        make(path)
        with replacing(mark) as temporary:
            temporary.write_text(json.dumps(source), encoding="utf-8")
    return path


def _keypoints(
    wanted: Wanted,
    video: Video,
    camera: Camera | None,
    folder: Path,
    prior: SegmentPrior,
    warn: Warn,
    quiet: bool,
) -> tuple[str, Keypoints]:
    """Return keypoints (given, from a track, or from the detector), and the file that contains them."""
    if wanted.keypoints:
        path = wanted.keypoints
    elif wanted.track:
        if camera is None:
            raise UserError(
                f"{wanted.track}: give the --camera that it was tracked with; gait track --camera-out writes "
                "an estimated one"
            )
        path = str(folder / "track.csv")
        track = read_track(wanted.track)
        if track.frame[-1] >= video.count:
            raise UserError(
                f"{wanted.track}: has frame {track.frame[-1]}, {video.path} ends at {video.count - 1}; "
                "give the track of this film"
            )
        if other := track.compare_film(wanted.track, video):
            warn(other)
        found, span = keypoints_of_track(wanted.track, camera), video.span(wanted.start or 0, wanted.stop)
        rows = slice(*np.searchsorted(found.frame, [span.start, span.stop]))
        keypoints_file.write(path, found.part(rows))
    else:
        path = _detected(wanted, video, folder, quiet, wanted.start or 0, wanted.stop)
    keypoints, _ = keypoints_file.read(path, prior.names, ignore_unknown=True)
    if note := keypoints.compare_times(path, video.times):
        raise UserError(f"{path}: {note}")
    return path, keypoints


def _detected(
    wanted: Wanted, video: Video, folder: Path, quiet: bool, start: int = 0, stop: int | None = None
) -> str:
    """Make the file of the detector's keypoints in frames `start` <= frame < `stop`.

    If the camera is to be estimated, they are those of the person from whose walk it is.
    """
    height = None if wanted.camera else wanted.height

    def detect(target: Path) -> None:
        people = find_people(video, quiet, start, stop)
        id = next(iter(people))
        if height and len(people) > 1:
            id, _ = calibrate_film(video, people, Model(None), height, wanted.fov, True)
        keypoints_file.write(target, people[id])

    walks = int(height is not None)
    return str(_kept(folder / DETECTED, video, detect, start=start, stop=stop, walks=walks))


def keypoints_of_track(path: str, camera: Camera) -> Keypoints:
    """Project the joints of a track to keypoints, with standard deviations.

    Parameters
    ----------
    path : str
        Track, from ``gait track``.
    camera : Camera
        Camera with which it was tracked.
    """
    track = read_track(path)
    names = tuple(track.places)
    places = np.stack([track.places[name] for name in names], axis=1)
    sd = np.stack([track.sd[name] for name in names], axis=1)
    tracked = ~np.isin(track.status, WITHOUT_PERSON)
    uv = np.where(tracked[:, None, None], camera.project(places), np.nan)
    pixels = np.maximum(_picture_sd(camera.project, places, sd), LEAST_JOINT_SD_PX)
    return Keypoints(
        track.frame,
        track.time,
        names,
        uv,
        np.ones(uv.shape[:2]),
        np.nan_to_num(pixels, nan=LEAST_JOINT_SD_PX),
    )


def _picture_sd(project: Callable[[Floats], Floats], places: Floats, sd: Floats) -> Floats:
    """Return standard deviations (T, J) along an axis of the picture, for positions and sd (T, J, 3).

    Parameters
    ----------
    project : callable
        Projects positions (T, J, 3) to pixels (T, J, 2).
    """
    here = project(places)
    moved = [project(places + sd * axis) - here for axis in np.eye(3)]
    return np.asarray(np.sqrt(sum((each**2).sum(axis=2) for each in moved) / 2))


def _write_film(path: Path, video: Video, quiet: bool) -> None:
    """Write the film as H.264 with constant frame rate, so that a browser can show any single frame."""
    import cv2

    factor = min(1.0, LARGEST_SIDE_PX / max(video.size))
    writer = VideoWriter(path, video.fps, crf=23, preset=FAST, keyframes=KEYFRAMES)
    with writer as film, progress("film", video.count, quiet) as update:
        for frame in video.frames():
            small = cv2.resize(frame.image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            film.write(np.asarray(small, np.uint8))
            update(frame.number + 1)
