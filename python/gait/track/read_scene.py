"""Read the files of a clip and find in it what is needed before tracking."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

from gait.bindings.model import Model
from gait.body.measured import model_of
from gait.io.video import Video, background, reporting_damage
from gait.progress import progress, warning
from gait.track.camera_check import contradiction
from gait.track.clip_background import require_background, sample
from gait.track.clip_camera import (
    calibrate_clip,
    camera_motion,
    given_camera,
    note_overlaps,
    static_plate,
)
from gait.track.clip_keypoints import cut_to, detects, find_people, require_detector
from gait.track.first_state import read_start, who_starts
from gait.track.keypoint_start import keypoint_noise
from gait.track.moving_video import MovingVideo, panorama_of
from gait.track.options import ClipOptions
from gait.track.scene import Scene, person_in_reference
from gait.track.stabilise import CameraTurns

_FILLED = 0.72  # of the pictures' sides; all points of a copy of two thirds of their size or less are within


def read_scene(options: ClipOptions, *, starts: bool = True) -> Scene:
    """Read the files, run the detector if there is one, and estimate the camera if none is given.

    `starts`: whether the track starts in this film, which must then show the person including the feet.

    Raises
    ------
    UserError
        If a file cannot be read or does not fit the others.
    """
    video = Video(options.video)
    frames = video.span(options.start or 0, options.stop)
    camera, poses = given_camera(options, video, frames)
    model = tracker_model(options)
    first = frames.start
    if starts and camera is not None and options.init != "auto":
        first = read_start(options, video, camera, poses, model).frame  # to fail early if it is invalid
    require_detector(options)
    given = None if options.background in ("auto", "none") else background(options.background, video)
    if given is not None:
        require_background(options, video, camera, model, given, first)
    empty = None
    warn = partial(warning, quiet=options.quiet)
    with reporting_damage(video, warn), ThreadPoolExecutor(1) as pool:
        if detects(options):
            # Another core computes the median of the clip while the detector runs.
            beside = pool.submit(sample, options, video, poses)
            if options.people is not None and poses:
                note_overlaps(options, "the camera moves")
            elif options.people is not None:
                samples, plate = beside.result()
                empty = static_plate(options, video, camera, samples, plate if given is None else given)
            people, person = find_people(options, video, model, frames, empty)
            samples, plate = beside.result()
        else:
            people, person = find_people(options, video, model, frames, empty)
            with progress("background", video.count, options.quiet) as update:
                samples, plate = sample(options, video, poses, update)
    longer = people
    if options.further:
        people, person = cut_to(people, person, frames)
    motion: CameraTurns | None = None
    turn: float | None = 0.0
    if not options.camera_path:
        poses, motion, turn = camera_motion(
            options, video, camera, samples, people, given, frames, still=empty is not None
        )
    calibration = None
    if camera is None:
        person, calibration = calibrate_clip(options, video, model, people, motion)
        camera = calibration.camera
    if motion is not None:
        poses = motion.poses(camera)
    plate = (plate if turn == 0 else None) if given is None else given
    if poses:
        wanted = options.background != "none"
        panorama = panorama_of(samples, camera, poses, given) if wanted else None
        video, plate = MovingVideo(video, camera, poses, panorama), None
    sure = {id: keypoint_noise(found) for id, found in people.items()}
    scene = Scene(video, camera, model, plate, motion, frames, people, person, sure, calibration)
    scene = replace(scene, longer=longer, turn=turn)
    if starts and people and not options.keypoints and options.init == "auto" and options.people is None:
        from gait.detect.people import require_feet  # here, as it loads the networks' runtime

        if calibration is None:
            scene = replace(scene, person=who_starts(options, scene))
        require_feet(people[scene.person], video)
    return replace(scene, against_camera=_against_camera(options, scene)) if starts else scene


def tracker_model(options: ClipOptions) -> Model:
    """Load the model to track with, with the person's measurements if these are given."""
    name = options.model_name
    return Model(name if options.body is None else model_of(options.body, name))


def _against_camera(options: ClipOptions, scene: Scene) -> str:
    """State how the camera file contradicts the walk; empty if it does not."""
    keypoints = person_in_reference(scene)
    if options.camera is None or keypoints is None:
        return ""
    words = contradiction(scene.camera, keypoints, scene.model, options.height)
    u, v = keypoints.reach()
    if words and options.keypoints and max(u / scene.video.size[0], v / scene.video.size[1]) < _FILLED:
        what = f"{options.keypoints}: all points are in the upper left {u:.0f}x{v:.0f} of the pictures: "
        return f"{what}were they found in smaller ones? They contradict {options.camera}: {words}"
    return f"{options.camera}: {words}" if words else ""
