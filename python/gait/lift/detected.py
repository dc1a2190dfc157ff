"""Find the person in a video for `gait lift`: keypoints from the detector, the camera from the walk."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gait.bindings.model import walking_model
from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.io.video import Video, sample_frames
from gait.lift.keypoints.corrections import read_corrections, read_edits
from gait.progress import warning
from gait.track.from_walk import Calibration
from gait.track.stabilise import CameraTurns, expected_lens, find_turns, in_words, turn_in_samples
from gait.track.walk_camera import calibrate_film, find_people, note_camera


@dataclass(frozen=True)
class Request:
    """What to find.

    Attributes
    ----------
    video : str
        File.
    camera, model, corrections : str, optional
        Files. Without a camera it is estimated; corrections are only checked, before long work.
    scale_camera : bool
        Whether to resize a camera of another resolution to the video's.
    parallel : bool
        Whether the view is orthographic, so that there is no camera to estimate.
    height : float, optional
        The person's stature, metres; an estimate of the camera needs it.
    fov : float, optional
        Horizontal field of view, degrees.
    start, stop : int, optional
        First frame to use, and the first not to use.
    stabilize : bool
        Whether to undo turns of the camera.
    """

    video: str
    camera: str | None = None
    model: str | None = None
    corrections: str | None = None
    scale_camera: bool = False
    parallel: bool = False
    height: float | None = None
    fov: float | None = None
    start: int | None = None
    stop: int | None = None
    stabilize: bool = False


@dataclass(frozen=True)
class Detected:
    """What was found.

    Attributes
    ----------
    people : mapping of id to Keypoints
        First the person to lift, or of several views of the first one.  If there are `turns`, in pixels of
        the reference's camera.
    calibration : Calibration, optional
        The camera, if it was estimated.
    turns : CameraTurns, optional
        How the camera turns; None if it is static or turns are not to be undone.
    still : Video, optional
        The film, if its camera stands still.
    """

    people: Mapping[int, Keypoints]
    calibration: Calibration | None = None
    turns: CameraTurns | None = None
    still: Video | None = None

    @property
    def keypoints(self) -> Keypoints:
        """Keypoints of the person to lift."""
        return next(iter(self.people.values()))


def find_keypoints(request: Request, prior: SegmentPrior, quiet: bool) -> Detected:
    """Find the keypoints of the person, and the camera unless the view is given.

    Raises
    ------
    UserError
        One line that names the file at fault.
    """
    video = Video(request.video)
    frames, given = video.span(request.start or 0, request.stop), None
    if request.camera:
        given = Camera.read(request.camera, video.size, request.scale_camera)
        given.check_place(request.camera)
    if request.corrections:
        read_edits(request.corrections, prior, frames, video.size)
    people = find_people(video, quiet, request.start or 0, request.stop)
    turns, samples = None, sample_frames(video)
    turn: float | None = 0.0
    camera = given or expected_lens(video, request.fov, samples, people)
    if request.stabilize:
        turns = find_turns(video, camera, samples, people, None, frames, quiet, first=given is not None)
    elif (turn := turn_in_samples(camera, samples, people)) != 0:
        how = in_words(turn)
        warning(f"the camera {how} and counts as still: --stabilize auto estimates its turns", quiet)
    if turns is not None:
        people = {id: turns.in_reference(keypoints) for id, keypoints in people.items()}
    still = video if turns is None and turn == 0 else None
    if request.camera or request.parallel:
        return Detected(people, None, turns, still)
    id, calibration = _calibrate(request, video, people, quiet)
    return Detected({id: people[id]}, calibration, turns, still)


def find_camera(request: Request, prior: SegmentPrior, quiet: bool) -> Calibration:
    """Estimate a video's camera from the walk, for lifting its images; errors as in `find_keypoints`."""
    video = Video(request.video)
    if request.corrections:
        read_corrections(request.corrections, prior, video.count, size=video.size)
    return _calibrate(request, video, find_people(video, quiet), quiet)[1]


def _calibrate(
    request: Request, video: Video, people: dict[int, Keypoints], quiet: bool
) -> tuple[int, Calibration]:
    """Find a person who walks, estimate the camera from that walk, and print it."""
    assert request.height is not None
    model = walking_model(request.model)
    id, found = calibrate_film(video, people, model, request.height, request.fov, quiet)
    note_camera(found, quiet)
    return id, found
