"""The first state of the person in a scene: who is tracked, and from where."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from gait.bindings.abi import Mode
from gait.bindings.initial import OUTSIDE_PICTURE, Start
from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.detect import weights
from gait.errors import UserError
from gait.io.video import Video
from gait.progress import note, warning
from gait.track.box_start import find_start
from gait.track.clip_background import require_scene
from gait.track.clip_keypoints import detects, finds_shapes, has_detector
from gait.track.keypoint_start import find_keypoint_start
from gait.track.options import ClipOptions
from gait.track.scene import Scene


def first_state(options: ClipOptions, scene: Scene) -> Start:
    """Return the first state, from the init file or found in the clip."""
    if options.init != "auto":
        start = read_start(options, scene.video, scene.camera, scene.poses, scene.model)
        require_scene(options, scene, start.frame)
        stop = start.frame + round(1.2 * scene.video.fps)
        found = start_in_keypoints(scene, scene.person, start.frame, stop)
        start = replace(start, in_place=found is not None and found.in_place)
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
    if wanted and not has_detector(options):
        warning(f"without a detector start and track are less reliable: {weights.FETCH}", options.quiet)
    return start


def read_start(
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


def start_in_keypoints(
    scene: Scene, id: int, first: int, stop: int, height: float | None = None, best_second: bool = False
) -> Start | None:
    """Find a start in a person's keypoints, as `find_keypoint_start`; None also without keypoints."""
    if id not in scene.people:
        return None
    return find_keypoint_start(
        scene.people[id],
        scene.camera,
        scene.model,
        first=first,
        stop=stop,
        height=height,
        poses=scene.poses,
        best_second=best_second,
    )


def _find_first_state(options: ClipOptions, scene: Scene) -> Start:
    """Find the first state from the keypoints or, if these do not fit a walk, from the pictures."""
    frames, height = scene.frames, options.height
    found = start_in_keypoints(scene, scene.person, frames.start, frames.stop, height)
    if found is not None:
        given = "the joints detected in the images" if options.keypoints is None else options.keypoints
        return replace(found, source=given)
    found = find_start(
        scene.video,
        scene.camera,
        scene.empty,
        scene.model,
        first=frames.start,
        stop=options.stop,
        height=height,
        shapes=not detects(options),  # slow, and useless if the detector found no person
        shapes_first=finds_shapes(options),  # a median may show people
    )
    return replace(found, source="the shape of a person in the images")


def who_starts(options: ClipOptions, scene: Scene) -> int:
    """Choose the person to track: the first in `by_size` who walks, or that of the scene if no one does."""
    from gait.detect.people import by_size  # here, as it loads the networks' runtime

    for id in by_size(scene.people) if len(scene.people) > 1 else []:
        found = start_in_keypoints(scene, id, scene.frames.start, scene.frames.stop, options.height)
        if found is not None and found.hypotheses[0].walks:
            return id
    return scene.person


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
