"""Inputs of tracking for a clip: video, camera, empty scene, keypoints of people, first state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import Mode
from gait.bindings.frame import FrameKeypoints
from gait.bindings.initial import OUTSIDE_PICTURE, Start
from gait.bindings.model import Model
from gait.bindings.start_fit import StartFit
from gait.body.measured import model_of
from gait.camera.camera import Camera, read_camera
from gait.camera.path import CameraPath, CameraPose, one_place, stand_still
from gait.detect import weights
from gait.detect.shapes import find_people
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.detections import Clip
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video, background, median, sample_frames
from gait.progress import note, progress, warning
from gait.track.box_start import find_start
from gait.track.camera_check import contradiction
from gait.track.from_walk import Calibration
from gait.track.keypoint_start import find_keypoint_start, keypoint_noise
from gait.track.moving_video import MovingVideo, map_pixels, panorama_of
from gait.track.options import ClipOptions
from gait.track.other_people import OtherPeople, Outline
from gait.track.stabilise import (
    FURTHEST_TURN,
    CameraTurns,
    expected_lens,
    find_travel,
    find_turns,
    in_reference,
    in_words,
    turn_in_samples,
)
from gait.track.walk_camera import calibrate_film, note_camera

Array = NDArray[np.float64]

_COLOUR_LEVELS = 4.0  # grey levels; least difference between channels, in half of a colour picture
_TRUNK = ("l_shoulder", "r_shoulder", "l_hip", "r_hip")
_TRUNKS = 200  # frames whose trunks are compared, evenly spread over the clip
_SHAPES = 16  # frames searched for people's shapes, which is slow
_TRUNK_HEIGHTS = (0.52, 0.81)  # of hips and shoulders, fractions of a person's height
_TRUNK_HALF_WIDTH = 0.2  # of a trunk seen from the side, as a fraction of its height
_FILLED = 0.72  # of the pictures' sides; all points of a copy of two thirds of their size or less are within
_FOR_OFFSETS_S = 10.0  # seconds of a film, or its frames to track, that show time offsets of other films
_STAYS = 0.45  # share of a clip's frames from which the median may show a person


@dataclass(frozen=True)
class Scene:
    """A clip, its camera, and what was found in it before tracking.

    Attributes
    ----------
    video : Video
        A `MovingVideo` if the camera moves.
    camera : Camera
        If the camera moves, that of the reference frame of `motion`, or of the first frame.
    model : Model
    plate : image or None
        The empty scene; with a moving camera, the frames of `video` have it.
    motion : CameraTurns or None
        How the camera turns, if that was estimated from the clip.
    frames : range
        Frames to track.
    people : dict of int to Keypoints
        Keypoints of everyone found, by id.
    person : int
        Id in `people` of the person to track; -1 without keypoints.
    keypoints : dict of int to dict of int to FrameKeypoints
        The keypoints with their standard deviations, by id and frame.
    calibration : Calibration or None
        The estimate of the camera, if none was given.
    apart : dict of int to dict of int to FrameKeypoints
        Like `keypoints`, of people who have their own tracks.
    outlines : dict of int to Outline
        Areas of the picture that people cover, by id, if several people are tracked.
    further : tuple of Scene
        The same walk filmed by further cameras; `video` contains their frames.
    began : tuple of str
        Time offset of each of these films, in words.
    offsets : tuple of float
        When each of them began, seconds after the first film.
    turn : float or None
        How far the camera turns although it counts as still, as for `turn_in_samples`; 0 if it does not.
    longer : dict of int to Keypoints
        `people` also in frames that are not tracked, from which time offsets are estimated.
    against_camera : str
        How the camera file contradicts the walk, in words; empty if it does not.
    """

    video: Video
    camera: Camera
    model: Model
    plate: Image | None
    motion: CameraTurns | None
    frames: range
    people: dict[int, Keypoints]
    person: int
    keypoints: dict[int, dict[int, FrameKeypoints]]
    calibration: Calibration | None
    apart: dict[int, dict[int, FrameKeypoints]] = field(default_factory=dict)
    outlines: dict[int, Outline] = field(default_factory=dict)
    further: tuple[Scene, ...] = ()
    began: tuple[str, ...] = ()
    offsets: tuple[float, ...] = ()
    turn: float | None = 0.0
    longer: dict[int, Keypoints] = field(default_factory=dict)
    against_camera: str = ""

    @property
    def moved(self) -> str:
        """How the camera moves although it counts as still, in words; empty if it does not."""
        return in_words(self.turn) if self.turn != 0 else ""

    @property
    def moves_far(self) -> bool:
        """Whether it does more than turn a little, so that a person who walks may seem to walk in place."""
        return self.turn is None or self.turn > FURTHEST_TURN * self.video.width

    @property
    def moving(self) -> MovingVideo | None:
        """Return `video` if the camera moves, otherwise None."""
        return self.video if isinstance(self.video, MovingVideo) else None

    @property
    def poses(self) -> Mapping[int, CameraPose]:
        """Return the camera's pose in each frame if it moves, otherwise nothing."""
        return self.moving.poses if self.moving else {}

    @property
    def empty(self) -> Image | None:
        """The empty scene, as a panorama if the camera turns; None if it is unknown."""
        if self.moving is None or self.moving.panorama is None:
            return self.plate
        return self.moving.panorama.image

    def camera_at(self, number: int) -> Camera:
        """Return the camera of a frame."""
        return self.poses[number].camera(self.camera) if self.poses else self.camera

    def without_plate(self) -> Scene:
        """Return the same scene without its plate."""
        return replace(self, plate=None, video=self.moving.without_panorama() if self.moving else self.video)

    def nearest_of(self) -> Callable[[Frame], Image | None]:
        """Return the function that finds who is nearest in each pixel of a frame."""
        if not self.outlines or self.empty is None:
            return lambda _: None
        others = [outline for id, outline in self.outlines.items() if id != self.person]
        return OtherPeople(self.camera, self.outlines[self.person], others).nearest

    def others(self) -> list[int]:
        """Return the ids that are never in view together with the person, and so may be the same person."""
        if not self.people:
            return []
        frames = {id: one.visible_frames() for id, one in self.people.items()}
        return [id for id in frames if id != self.person and frames[id].isdisjoint(frames[self.person])]

    @staticmethod
    def read(options: ClipOptions, *, starts: bool = True) -> Scene:
        """Read the files, run the detector if there is one, and estimate the camera if none is given.

        `starts`: whether the track starts in this film, which must then show the person including the feet.

        Raises
        ------
        UserError
            If a file cannot be read or does not fit the others.
        """
        video = Video(options.video)
        warning(video.broken or "", options.quiet or not video.broken)
        frames = video.span(options.start or 0, options.stop)
        camera, poses = _cameras(options, video, frames)
        name = options.model or ("paper" if options.mode == Mode.PAPER else "walk")
        model = Model(name if options.body is None else model_of(options.body, name))
        if starts and camera is not None and options.init != "auto":
            _read_start(options, video, camera, poses, model)  # to fail early if it is invalid
        _require_detector(options)
        given = None if options.background in ("auto", "none") else background(options.background, video)
        with ThreadPoolExecutor(1) as pool:
            # Another core computes the median of the clip while the detector runs.
            beside = pool.submit(_sample, options, video, poses) if detects(options) else None
            if beside is None:
                with progress("background", video.count, options.quiet) as update:
                    samples, plate = _sample(options, video, poses, update)
            if options.keypoints:
                people, person = {0: _read_keypoints(options, video, model, frames)}, 0
            else:
                people, person = _detect(options, video, _frames_to_detect(options, video, frames))
            if beside is not None:
                samples, plate = beside.result()
        longer = people
        if options.further:
            people, person = _in_frames(people, person, frames)
        motion: CameraTurns | None = None
        turn: float | None = 0.0
        if not options.camera_path:
            poses, motion, turn = _camera_motion(options, video, camera, samples, people, given, frames)
        calibration = None
        if camera is None:
            person, calibration = _calibrate(options, video, model, people, motion)
            camera = calibration.camera
        if motion is not None:
            poses = motion.poses(camera)
        plate = (plate if turn == 0 else None) if given is None else given
        if poses:
            wanted = options.background != "none"
            panorama = panorama_of(samples, camera, poses, given) if wanted else None
            video, plate = MovingVideo(video, camera, poses, panorama), None
        if starts and people and not options.keypoints and options.init == "auto" and options.people is None:
            if calibration is None:
                person = _who_starts(options, people, person, camera, model, frames, poses)
            _require_feet(people[person], video)
        sure = {id: keypoint_noise(found) for id, found in people.items()}
        scene = Scene(video, camera, model, plate, motion, frames, people, person, sure, calibration)
        scene = replace(scene, longer=longer, turn=turn)
        return replace(scene, against_camera=_against_camera(options, scene)) if starts else scene


def _cameras(
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


def _sample(
    options: ClipOptions,
    video: Video,
    poses: Mapping[int, CameraPose],
    update: Callable[[int], None] | None = None,
) -> tuple[list[Frame], Image | None]:
    """Sample frames over the clip if they are needed, and compute their median if it is the background."""
    static = options.stabilize == "off" and not options.cameras_out
    if options.background != "auto" and (static or options.camera_path):
        return [], None
    samples = sample_frames(video, progress=update)
    wanted = options.background == "auto" and not poses
    return samples, median([frame.image for frame in samples]) if wanted else None


def _camera_motion(
    options: ClipOptions,
    video: Video,
    camera: Camera | None,
    samples: list[Frame],
    people: dict[int, Keypoints],
    given: Image | None,
    frames: range,
) -> tuple[dict[int, CameraPose], CameraTurns | None, float | None]:
    """Estimate the poses or turns of a camera that is not to count as still.

    Of one that counts as still although it moves, return how far it turns, and print a note.

    Raises
    ------
    UserError
        If its motion is not estimated and a file of its poses is to be written; by default, only if it turns
        far.
    """
    lens, first = camera or expected_lens(video, options.fov, samples, people), camera is not None
    turn = turn_in_samples(lens, samples, people) if samples else 0.0
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


def motion_remedy(options: ClipOptions, turn: float | None) -> str:
    """State what gives the motion of a camera that counts as still; `turn` as for `turn_in_samples`."""
    if options.camera is None and turn is None:
        return "turns do not explain its motion: give its poses with --camera and --camera-path"
    estimated = "" if options.stabilize == "auto" else "--stabilize auto estimates its motion, "
    return f"{estimated}--camera-path gives its poses"


def _calibrate(
    options: ClipOptions, video: Video, model: Model, people: dict[int, Keypoints], motion: CameraTurns | None
) -> tuple[int, Calibration]:
    """Estimate the camera from a walk; also return the id of the person who walks."""
    if not people:
        remedy = (
            "leave out --detector none, or give --camera" if options.detector == "none" else weights.FETCH
        )
        raise UserError(f"{video.path}: without --camera the keypoints of a walk are needed: {remedy}")
    from gait.detect.people import by_size  # here, as it loads the networks' runtime

    assert options.height is not None
    still = {id: people[id] if motion is None else motion.in_reference(people[id]) for id in by_size(people)}
    person, found = calibrate_film(video, still, model, options.height, options.fov, options.quiet)
    note_camera(found, options.quiet)
    return person, found


def first_state(options: ClipOptions, scene: Scene) -> Start:
    """Return the first state, from the init file or found in the clip."""
    if options.init != "auto":
        start = _read_start(options, scene.video, scene.camera, scene.poses, scene.model)
        require_scene(options, scene, start.frame)
        start = replace(start, in_place=_in_place(scene, start.frame))
    else:
        require_scene(options, scene, scene.frames.start)
        try:
            start = _find_first_state(options, scene)
        except UserError as error:
            raise UserError(scene.against_camera or str(error)) from error
    if scene.against_camera:
        warning(scene.against_camera, options.quiet)
    if options.init == "auto":
        _note_start(options, scene, start)
    wanted = options.detector == "auto" and not options.keypoints and options.mode != Mode.PAPER
    if wanted and not _has_detector(options):
        warning(f"without a detector start and track are less reliable: {weights.FETCH}", options.quiet)
    return start


def _read_start(
    options: ClipOptions, video: Video, camera: Camera, poses: Mapping[int, CameraPose], model: Model
) -> Start:
    """Read a start from the init file; UserError unless it is in the picture, in a frame to track."""
    start = Start.read(options.init, model, frame=options.start, height=options.height)
    stop = video.count if options.stop is None else min(options.stop, video.count)
    if start.frame >= stop:
        raise UserError(
            f"{options.init}: frame is {start.frame}, the frames to track end at {stop - 1}; give one of them"
        )
    there = poses[start.frame].camera(camera) if start.frame in poses else camera
    if not there.shows(model.pose(start.mean)[0]):
        raise UserError(f"{options.init}: {OUTSIDE_PICTURE}")
    return start


def _in_place(scene: Scene, frame: int) -> bool:
    """Whether the keypoints of one second, from a frame, show a person who walks in place."""
    if not scene.people:
        return False
    stop = frame + round(1.2 * scene.video.fps)
    keypoints = scene.people[scene.person]
    found = find_keypoint_start(
        keypoints, scene.camera, scene.model, first=frame, stop=stop, poses=scene.poses
    )
    return found is not None and found.in_place


def stays(scene: Scene) -> bool:
    """Whether the person's trunk covers the same part of the picture in about half of the clip's frames.

    This is so if the person walks in place, towards the camera or away from it.  Without keypoints, trunks
    are those of people's shapes.
    """
    low, high, shown = _trunks(scene) if scene.people else _shape_trunks(scene)
    if not len(low):
        return False
    reach = _TRUNK_HALF_WIDTH * (high - low)[:, 1:] * (1, 0)  # half of a trunk seen from the side
    middle = (low + high)[:, None] / 2
    covered = ((middle > low - reach) & (middle < high + reach)).all(axis=2)  # (middles, frames)
    return bool(covered.mean(axis=1).max() * shown > _STAYS)


def _trunks(scene: Scene) -> tuple[Array, Array, float]:
    """Corners (n, 2) of the person's trunk in frames that have keypoints of it, and the share of these."""
    keypoints = _in_reference(scene)
    assert keypoints is not None
    trunk = keypoints.uv[:, [keypoints.names.index(name) for name in _TRUNK]]
    trunk = trunk[np.isfinite(trunk).all(axis=(1, 2))]
    trunk = trunk[:: len(trunk) // _TRUNKS + 1]
    return trunk.min(axis=1), trunk.max(axis=1), len(keypoints.frame) / scene.video.count


def _shape_trunks(scene: Scene) -> tuple[Array, Array, float]:
    """Return the same for frames in which a person's shape is found."""
    fit, found = StartFit(scene.model, scene.camera), []
    samples = sample_frames(scene.video, _SHAPES)
    for frame in samples:
        if frame.pose is not None:
            fit.set_pose(frame.pose)
        for box in find_people(frame.image, fit.stature)[:1]:
            ends = np.array([box.head, box.foot])
            moved = frame.pose is not None
            found.append(map_pixels(ends, frame.camera(scene.camera), scene.camera) if moved else ends)
    head, foot = np.array(found).reshape(-1, 2, 2).swapaxes(0, 1)
    trunk = [foot + share * (head - foot) for share in _TRUNK_HEIGHTS]
    return np.minimum(*trunk), np.maximum(*trunk), len(found) / len(samples)


def start_words(start: Start) -> str:
    """Where the person starts, how tall and in which direction, in words."""
    at, turn, turn_sd = start.mean, np.degrees(start.mean.heading), np.degrees(start.sd.heading)
    return (
        f"x {at.pelvis[0]:.2f} y {at.pelvis[1]:.2f} m, stature {at.stature:.2f} m, "
        f"heading {turn:.0f} +- {turn_sd:.0f} deg"
    )


def _note_start(options: ClipOptions, scene: Scene, start: Start) -> None:
    """Print where the start is, and what makes it uncertain."""
    note(f"start found at frame {start.frame}: {start_words(start)}", options.quiet)
    if start.apparent_stature:
        remedy = "check --height and" if options.height else "give --height or check"
        warning(
            f"the person appears {start.apparent_stature:.2f} m tall by the camera, taken for "
            f"{start.mean.stature:.2f} m: {remedy} the camera",
            options.quiet,
        )


def _find_first_state(options: ClipOptions, scene: Scene) -> Start:
    """Find the first state from the keypoints or, if these do not fit a walk, from the pictures."""
    camera, model, frames, height = scene.camera, scene.model, scene.frames, options.height
    if scene.people:
        keypoints = scene.people[scene.person]
        found = find_keypoint_start(
            keypoints,
            camera,
            model,
            first=frames.start,
            stop=frames.stop,
            height=height,
            poses=scene.poses,
        )
        if found is not None:
            return replace(found, source="the joints detected in the images")
    found = find_start(
        scene.video,
        camera,
        scene.empty,
        model,
        first=frames.start,
        stop=options.stop,
        height=height,
        shapes=not detects(options),  # slow, and useless if the detector found no person
        shapes_first=finds_shapes(options),  # a median may show people
    )
    return replace(found, source="the shape of a person in the images")


def _in_reference(scene: Scene) -> Keypoints | None:
    """Convert the person's keypoints to those of a camera that stands still; None if the camera travels."""
    keypoints = scene.people.get(scene.person)
    if keypoints is None or not scene.poses:
        return keypoints
    if not one_place(list(scene.poses.values())):
        return None
    cameras = {number: pose.camera(scene.camera) for number, pose in scene.poses.items()}
    return in_reference(keypoints, cameras, scene.camera)


def _against_camera(options: ClipOptions, scene: Scene) -> str:
    """State how the camera file contradicts the walk; empty if it does not."""
    keypoints = _in_reference(scene)
    if options.camera is None or keypoints is None:
        return ""
    words = contradiction(scene.camera, keypoints, scene.model, options.height)
    u, v = keypoints.reach()
    if words and options.keypoints and max(u / scene.video.size[0], v / scene.video.size[1]) < _FILLED:
        what = f"{options.keypoints}: all points are in the upper left {u:.0f}x{v:.0f} of the pictures: "
        return f"{what}were they found in smaller ones? They contradict {options.camera}: {words}"
    return f"{options.camera}: {words}" if words else ""


def require_scene(options: ClipOptions, scene: Scene, first: int) -> None:
    """Raise UserError if the background shows another scene than frame `first`, or only one has colours."""
    frame = next(iter(scene.video.frames(first, first + 1)), None)
    plate = frame.plate if frame is not None and scene.moving else scene.plate
    if plate is None or frame is None:
        return
    if one_is_grey(frame.image, plate):
        raise UserError(
            f"{options.background}: either it or {scene.video.path} is grey, the other in colour; give both "
            "in the same colours"
        )
    if not StartFit(scene.model, scene.camera).other_scene(frame.image, plate):
        return
    differs = f"half of frame {first} differs from"
    if options.background != "auto":
        raise UserError(
            f"{options.background}: {differs} it; give the empty scene of this camera, auto or none"
        )
    warning(
        f"{differs} the median of the clip, the background: if the camera moves, give --camera-path, "
        "--stabilize auto or --background none",
        options.quiet,
    )


def one_is_grey(image: Image, plate: Image) -> bool:
    """Whether one of two BGR pictures is entirely grey and the other in colour."""
    colour = [float(np.median(np.ptp(one[::4, ::4], axis=2))) for one in (image, plate)]
    return min(colour) == 0 and max(colour) > _COLOUR_LEVELS


def _frames_to_detect(options: ClipOptions, video: Video, frames: range) -> range:
    """Return the frames to track, and more around few of them if time offsets are to be estimated."""
    if not options.further or options.offsets is not None:
        return frames
    wanted = round(_FOR_OFFSETS_S * video.fps)
    stop = min(max(frames.stop, frames.start + wanted), video.count)
    return range(max(min(frames.start, stop - wanted), 0), stop)


def _in_frames(people: dict[int, Keypoints], person: int, frames: range) -> tuple[dict[int, Keypoints], int]:
    """Cut keypoints to `frames`; return them and the main person: `person` if nothing is cut."""
    if all(one.frame[0] in frames and one.frame[-1] in frames for one in people.values()):
        return people, person
    from gait.detect.people import main_person  # here, as it loads the networks' runtime

    visible = {}
    for id, one in people.items():
        rows = np.flatnonzero(
            (one.frame >= frames.start) & (one.frame < frames.stop) & one.visible.any(axis=1)
        )
        if len(rows):
            visible[id] = one.part(slice(rows[0], rows[-1] + 1))
    return visible, main_person(visible) if visible else -1


def _detect(options: ClipOptions, video: Video, frames: range) -> tuple[dict[int, Keypoints], int]:
    """Find everyone's keypoints with the detector, and the main person; empty without a detector."""
    if not detects(options):
        return {}, -1
    from gait.detect import people as detector  # here, as it loads the networks' runtime

    if not options.camera:
        detector.require_length(video, frames)
    with progress("detecting", len(frames), options.quiet) as update:
        everyone = options.people is not None
        people = detector.detect(
            video, options.network, first=frames.start, stop=frames.stop, update=update, everyone=everyone
        )
    if not options.camera:
        detector.require_person(people, video)
    if not people:
        return {}, -1
    return people, detector.main_person(people)


def _require_feet(keypoints: Keypoints, video: Video) -> None:
    """Raise UserError if the person's feet are not in view for a start."""
    from gait.detect.people import require_feet  # here, as it loads the networks' runtime

    require_feet(keypoints, video)


def _who_starts(
    options: ClipOptions,
    people: dict[int, Keypoints],
    person: int,
    camera: Camera,
    model: Model,
    frames: range,
    poses: Mapping[int, CameraPose],
) -> int:
    """Choose the person to track: the first in `by_size` who walks, or `person` if no one does."""
    from gait.detect.people import by_size  # here, as it loads the networks' runtime

    for id in by_size(people) if len(people) > 1 else []:
        found = find_keypoint_start(
            people[id],
            camera,
            model,
            first=frames.start,
            stop=frames.stop,
            height=options.height,
            poses=poses,
        )
        if found is not None and found.hypotheses[0].walks:
            return id
    return person


def _require_detector(options: ClipOptions) -> None:
    """Raise UserError, before long work, if weights are damaged, or missing although asked for."""
    if detects(options):
        weights.load(weights.PERSON)
        weights.load(weights.LANDMARK_NETWORKS[options.network])


def detects(options: ClipOptions) -> bool:
    """Whether to run the detector: not with a file of keypoints, and with ``auto`` only if it has weights."""
    if options.keypoints or options.detector == "none" or options.mode == Mode.PAPER:
        return False
    return options.detector != "auto" or _has_detector(options)


def finds_shapes(options: ClipOptions) -> bool:
    """Whether to search people's shapes: if there are no keypoints, and no empty scene was given."""
    given = options.keypoints or options.background not in ("auto", "none")
    return not (given or options.mode == Mode.PAPER or detects(options))


def _has_detector(options: ClipOptions) -> bool:
    """Whether the weights are on this machine."""
    needed = (weights.PERSON, weights.LANDMARK_NETWORKS.get(options.network))
    return all(weight is not None and weights.find(weight) for weight in needed)


def _read_keypoints(options: ClipOptions, video: Video, model: Model, frames: range) -> Keypoints:
    """Read keypoints of the model's joints from a file; UserError unless some are in frames to track."""
    assert options.keypoints is not None
    clip = Clip(options.person, times=video.times, size=video.size, quiet=options.quiet)
    read, ignored = keypoints_file.read(options.keypoints, model.joint_names, ignore_unknown=True, clip=clip)
    if ignored:
        warning(f"ignored: {' '.join(ignored)}", options.quiet)
    read.require_extent(options.keypoints, options.keypoints_sd)
    read.require_inside(options.keypoints, video.size)
    if not any(frame in frames for frame in read.frame.tolist()):
        raise UserError(
            f"{options.keypoints}: has none of the tracked frames; number frames as in the video, from 0"
        )
    if words := read.compare_times(options.keypoints, video.times):
        warning(f"{options.keypoints}: {words}", options.quiet)
    return replace(read, frame_sd=read.in_frame(options.keypoints_sd))
