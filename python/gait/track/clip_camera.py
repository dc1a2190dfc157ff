"""The camera of a clip: as given or estimated from a walk, and how it moves."""

from __future__ import annotations

from gait.bindings.model import Model
from gait.camera.camera import Camera, read_camera
from gait.camera.path import CameraPath, CameraPose, stand_still
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video
from gait.progress import note, warning
from gait.track.from_walk import Calibration
from gait.track.options import ClipOptions
from gait.track.stabilise import (
    FURTHEST_TURN,
    CameraTurns,
    expected_lens,
    find_travel,
    find_turns,
    in_words,
    moves,
    turn_in_samples,
)
from gait.track.walk_camera import calibrate_film, note_camera


def given_camera(
    options: ClipOptions, video: Video, frames: range
) -> tuple[Camera | None, dict[int, CameraPose]]:
    """Read the given camera, and its pose in each frame if it moves."""
    if options.camera_path:
        assert options.camera is not None
        lens = read_camera(options.camera, video.size, placed=False, scale=options.scale_camera)
        path = CameraPath.read(options.camera_path)
        found = path.at_times(video.times[frames.start : frames.stop], frames.start)
        camera = found[0].camera(lens)
        camera.check_place(options.camera_path)
        still = stand_still(found)
        return camera, {} if still else dict(zip(frames, found, strict=True))
    if options.camera is None:
        return None, {}
    camera = Camera.read(options.camera, video.size, options.scale_camera)
    camera.check_place(options.camera)
    return camera, {}


def camera_motion(
    options: ClipOptions,
    video: Video,
    camera: Camera | None,
    samples: list[Frame],
    people: dict[int, Keypoints],
    given: Image | None,
    frames: range,
    *,
    still: bool = False,
) -> tuple[dict[int, CameraPose], CameraTurns | None, float | None]:
    """Estimate the poses or turns of a camera that is not to count as still.

    Of one that counts as still although it moves, return how far it turns, and print a note.  `still`: known
    to stand still.

    Raises
    ------
    UserError
        If its motion is not estimated and a file of its poses is to be written; by default, only if it turns
        far.
    """
    lens, first = camera or expected_lens(video, options.fov, samples, people), camera is not None
    turn = turn_in_samples(lens, samples, people) if samples and not still else 0.0
    far = turn is not None and turn > FURTHEST_TURN * video.width and not options.further
    estimated = options.stabilize == "auto" or (options.stabilize == "pans" and far)
    if estimated and first and given is None:
        poses = find_travel(video, lens, samples, people, frames, options.quiet)
        if poses:
            return poses, None, 0.0
    motion = None
    if estimated:
        motion = find_turns(video, lens, samples, people, given, frames, options.quiet, first=first)
    if motion is not None or turn == 0:
        return {}, motion, 0.0
    how, remedy = in_words(turn), motion_remedy(options, turn)
    if options.cameras_out and (far or options.stabilize != "pans"):
        raise UserError(
            f"{options.cameras_out}: not written, as the camera {how} and its motion is not estimated; "
            f"{remedy}, or leave out --cameras-out"
        )
    if not estimated:
        without = ", without a background" if options.background == "auto" else ""
        warning(f"the camera {how} and counts as still{without}: {remedy}", options.quiet)
    return {}, None, turn


def static_plate(
    options: ClipOptions, video: Video, camera: Camera | None, samples: list[Frame], plate: Image | None
) -> Image | None:
    """Return the empty scene if the camera stands still in the samples; otherwise None, and print a note."""
    if plate is None:
        note_overlaps(options, "there is no background")
    if plate is None or not samples:
        return plate
    lens = camera or expected_lens(video, options.fov, samples, {})
    if not moves(lens, samples, {}, plate):
        return plate
    note_overlaps(options, "the camera moves")
    return None


def note_overlaps(options: ClipOptions, why: str) -> None:
    """Print why people who overlap are not found one by one."""
    note(f"{why}: people who overlap are not found one by one", options.quiet)


def motion_remedy(options: ClipOptions, turn: float | None) -> str:
    """State what gives the motion of a camera that counts as still; `turn` as for `turn_in_samples`."""
    if options.camera is None and turn is None:
        return "turns do not explain its motion: give its poses with --camera and --camera-path"
    estimated = "" if options.stabilize == "auto" else "--stabilize auto estimates its motion, "
    return f"{estimated}--camera-path gives its poses"


def calibrate_clip(
    options: ClipOptions, video: Video, model: Model, people: dict[int, Keypoints], motion: CameraTurns | None
) -> tuple[int, Calibration]:
    """Estimate the camera from a walk; also return the id of the person who walks."""
    from gait.detect.people import by_size  # here, as it loads the networks' runtime

    assert options.height is not None
    still = {id: people[id] if motion is None else motion.in_reference(people[id]) for id in by_size(people)}
    person, found = calibrate_film(video, still, model, options.height, options.fov, options.quiet)
    note_camera(found, options.quiet)
    return person, found
