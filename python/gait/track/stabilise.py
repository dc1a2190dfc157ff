"""Estimate how the camera of a clip without poses turns or travels.

The track is in the scene's frame: the world of the reference frame, for which the given camera is valid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video
from gait.progress import note, progress, warning
from gait.track.camera_motion import Box, CameraMotion, View, fit_view
from gait.track.camera_travel import CameraTravel
from gait.track.moving_video import map_pixels
from gait.track.walk_camera import expected_camera, expected_fov

Array = NDArray[np.float64]

_KEYPOINT_MARGIN = 0.15  # of a person's height, around the keypoints
#: Of the picture's width; a camera that turns less may count as still.
FURTHEST_TURN = 0.1
#: Of the usual focal length; neighbours differ by a half, and a pan is found with one a third too short.
_FOCAL_FACTORS = (2 / 3, 3 / 2, 9 / 4, 27 / 8)
_MOSTLY = 0.8  # share of the frames in which the camera must be found, or be still
_TRAVELS = 1.0  # pixels in a picture 640 wide; median residual from which the camera does not only turn
#: Metres in a second from which it travels, if the floor is seen; more than a hand moves.
_TRAVEL_M_PER_S = 0.15


@dataclass(frozen=True)
class CameraTurns:
    """How a camera turns during a clip.

    Attributes
    ----------
    camera : Camera
        Camera of the reference; without calibration, its position is meaningless and its focal length a
        guess.
    views : list of View
        View of each frame relative to the reference.
    reference : int
        Number of the reference frame; -1 for the background image.
    """

    camera: Camera
    views: list[View]
    reference: int

    def furthest(self, frames: range | None = None) -> float:
        """Return the largest shift of a frame (of all, or of some), pixels in the middle of the picture."""
        middle = np.array([[self.camera.cx, self.camera.cy]])
        views = self.views if frames is None else self.views[frames.start : frames.stop]
        places = [map_pixels(middle, self.camera, view.camera(self.camera)) - middle for view in views]
        return float(np.nanmax(np.hypot(*np.concatenate(places).T)))

    def in_reference(self, captured: Keypoints) -> Keypoints:
        """Convert keypoints of the captured frames to the pixels of the reference's camera."""
        cameras = {number: view.camera(self.camera) for number, view in enumerate(self.views)}
        return in_reference(captured, cameras, self.camera)

    def cameras(self, camera: Camera) -> dict[int, Camera]:
        """Return the camera of each frame; `camera`: a possibly better estimate of the reference's camera."""
        poses = self.poses(camera)
        return {number: replace(camera, R=pose.R, t=pose.t) for number, pose in poses.items()}

    def poses(self, camera: Camera) -> dict[int, CameraPose]:
        """Return the pose of each frame; `camera`: a possibly better estimate of the reference's camera."""
        u, v = (np.linspace(0, size - 1, 7) for size in camera.size)
        before = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        out = {}
        for number, view in enumerate(self.views):
            after = map_pixels(before, self.camera, view.camera(self.camera))
            inside = np.isfinite(after).all(axis=1)
            out[number] = CameraPose.of(fit_view(camera, before[inside], after[inside])[0].camera(camera))
        return out


def in_reference(captured: Keypoints, cameras: Mapping[int, Camera], reference: Camera) -> Keypoints:
    """Convert keypoints of a camera that turns in place to the pixels of `reference`, in the same place.

    `cameras`: that of each frame; in other frames there are then no points.
    """
    uv = np.full_like(captured.uv, np.nan)
    for row, number in enumerate(captured.frame.tolist()):
        if number in cameras:
            uv[row] = map_pixels(captured.uv[row], cameras[number], reference)
    return replace(captured, uv=uv)


def find_motion(
    video: Video,
    camera: Camera,
    samples: Sequence[Frame],
    people: Mapping[int, Keypoints],
    plate: Image | None = None,
    update: Callable[[int], None] | None = None,
    *,
    first: bool = False,
) -> tuple[CameraTurns | None, str]:
    """Measure how the camera turns.

    Parameters
    ----------
    video : Video
    camera : Camera
        Camera of the reference.
    samples : sequence of Frame
        Frames spread over the clip, which show whether the camera moves at all.
    people : mapping of int to Keypoints
        People in the clip, who are not part of the scene.
    plate : image, optional
        The empty scene, which is then the reference.
    first : bool
        Without `plate`, whether the reference is the first frame or the one in the middle of the motion.

    Returns
    -------
    motion : CameraTurns or None
        None if the camera stands still or does not only turn.
    why : str
        Why its motion could not be estimated, in words, or empty.
    """
    boxes = _boxes(people)
    motion = _begin(camera, samples, boxes, plate)
    if _still(motion, samples):
        return None, ""
    views = []
    for frame in video.frames(grey=True):
        views.append(motion.step(frame.image, boxes.get(frame.number, ())))
        if update is not None:
            update(frame.number)
    if not _only_turns(motion, views):
        return None, "the camera travels, or the scene has too little texture to show how it turns"
    reference = -1 if plate is not None else 0 if first else _middle(views)
    if reference >= 0:
        back = views[reference].inverse()
        views = [view.after(back) for view in views]
    return CameraTurns(camera, views, reference), ""


def find_turns(
    video: Video,
    camera: Camera,
    samples: Sequence[Frame],
    people: Mapping[int, Keypoints],
    plate: Image | None,
    frames: range,
    quiet: bool,
    *,
    first: bool,
) -> CameraTurns | None:
    """Measure and report how a clip's camera turns; None if it stands still or does not only turn.

    Parameters are as for `find_motion`; `frames`: those for which the turn is reported.
    """
    with progress("camera's motion", video.count, quiet) as update:
        motion, why = find_motion(video, camera, samples, people, plate, update, first=first)
    if why:
        warning(f"{why}; its motion is ignored: give its poses with --camera-path", quiet)
    if motion is None:
        return None
    place = "the background" if plate is not None else f"frame {motion.reference}"
    note(
        f"the camera turned by up to {motion.furthest(frames):.0f} px: frames are stabilised to {place}, to "
        "which camera and positions refer",
        quiet,
    )
    return motion


def find_travel(
    video: Video,
    camera: Camera,
    samples: Sequence[Frame],
    people: Mapping[int, Keypoints],
    frames: range,
    quiet: bool,
) -> dict[int, CameraPose]:
    """Measure how the camera travels over the floor, and report it.

    Parameters are as for `find_turns`; `camera` is that of the first frame, above the floor z = 0.

    Returns
    -------
    poses : dict of int to CameraPose
        Poses by frame number; empty if the camera stands still or only turns, or if too little of the floor
        is visible to know.
    """
    if not moves(camera, samples, people):
        return {}
    boxes, poses, on_floor = _boxes(people), {}, []
    with progress("camera's path", video.count, quiet) as update:
        travel: CameraTravel | None = None
        for frame in video.frames(grey=True):
            there = boxes.get(frame.number, ())
            pose: CameraPose | None = CameraPose.of(camera)
            if travel is None:
                travel = CameraTravel(camera, frame.image, there)
            else:
                pose = travel.step(frame.image, there)
                on_floor.append(travel.on_floor)
            if pose is None:
                return {}
            poses[frame.number] = pose
            update(frame.number)
    centres = np.array([pose.centre for pose in poses.values()])
    second = min(max(1, round(video.fps)), len(centres) - 1)
    away = np.linalg.norm(centres[second:] - centres[:-second], axis=1).max()
    if away < _TRAVEL_M_PER_S or np.mean(on_floor) < _MOSTLY:
        return {}
    far = float(np.linalg.norm(centres[frames.start : frames.stop] - centres[0], axis=1).max())
    note(
        f"the camera travelled up to {far:.1f} m from where it was in frame 0, to which camera and positions "
        "refer: its poses are estimated from the floor, with errors that grow with the way",
        quiet,
    )
    return poses


def expected_lens(
    video: Video, fov: float | None, samples: Sequence[Frame], people: Mapping[int, Keypoints]
) -> Camera:
    """Return the camera expected without using the walk.

    If its focal length is unknown, and turns of the usual one do not explain the samples, it is that of a few
    others whose turns explain them best.

    Parameters
    ----------
    fov : float, optional
        Horizontal field of view given by the user, degrees.
    video, samples, people
        As for `find_motion`.
    """
    usual = expected_camera(video, fov)
    known = expected_fov(video, fov, quiet=True)[0] is not None
    if known or not samples or turn_in_samples(usual, samples, people) is not None:
        return usual
    residuals = {}
    for factor in _FOCAL_FACTORS:
        lens = replace(usual, fx=factor * usual.fx, fy=factor * usual.fy)
        motion, views = _views(lens, samples, people)
        if _only_turns(motion, views):
            residuals[factor] = np.nanmedian([view.residual for view in views]), lens
    return min(residuals.values(), key=lambda found: found[0])[1] if residuals else usual


def turn_in_samples(
    camera: Camera, samples: Sequence[Frame], people: Mapping[int, Keypoints]
) -> float | None:
    """Return how far the camera turns between the samples and the first of them.

    Parameters are as for `find_motion`.

    Returns
    -------
    turn : float or None
        The largest shift of a sample, pixels in the middle of the picture; 0 if the camera stands still, None
        if it does not only turn.
    """
    if not moves(camera, samples, people):
        return 0.0
    motion, views = _views(camera, samples, people)
    return CameraTurns(camera, views, 0).furthest() if _only_turns(motion, views) else None


def _views(
    camera: Camera, samples: Sequence[Frame], people: Mapping[int, Keypoints]
) -> tuple[CameraMotion, list[View]]:
    """Find the view of each sample, relative to the first."""
    boxes = _boxes(people)
    motion = _begin(camera, samples, boxes, None)
    return motion, [motion.step(frame.image, boxes.get(frame.number, ())) for frame in samples]


def in_words(turn: float | None) -> str:
    """Describe a result of `turn_in_samples`: what the camera does."""
    return "moves" if turn is None else f"turns by up to {turn:.0f} px"


def moves(
    camera: Camera, samples: Sequence[Frame], people: Mapping[int, Keypoints], plate: Image | None = None
) -> bool:
    """Whether the camera moves at all; parameters are as for `find_motion`."""
    return not _still(_begin(camera, samples, _boxes(people), plate), samples)


def _begin(
    camera: Camera, samples: Sequence[Frame], boxes: Mapping[int, list[Box]], plate: Image | None
) -> CameraMotion:
    """Set the empty scene, or the first sample, as the reference."""
    motion = CameraMotion(camera)
    if plate is None:
        motion.start(samples[0].image, boxes.get(samples[0].number, []))
    else:
        motion.start(plate)
    return motion


def _still(motion: CameraMotion, samples: Sequence[Frame]) -> bool:
    """Whether most samples have the view of the reference."""
    return bool(np.mean([motion.still(frame.image) for frame in samples]) > _MOSTLY)


def _only_turns(motion: CameraMotion, views: Sequence[View]) -> bool:
    """Whether a rotation of the camera explains most frames, of which `motion` found these views."""
    residuals = np.array([view.residual for view in views])
    found = residuals[np.isfinite(residuals)]
    return len(found) >= _MOSTLY * len(residuals) and bool(motion.scale * np.median(found) <= _TRAVELS)


def _boxes(people: Mapping[int, Keypoints]) -> dict[int, list[Box]]:
    """Make boxes around everyone, by frame number."""
    boxes: dict[int, list[Box]] = {}
    for keypoints in people.values():
        for frame, uv in zip(keypoints.frame.tolist(), keypoints.uv, strict=True):
            uv = uv[np.isfinite(uv).all(axis=1)]
            if len(uv):
                (left, top), (right, bottom) = uv.min(axis=0), uv.max(axis=0)
                edge = _KEYPOINT_MARGIN * (bottom - top)
                boxes.setdefault(frame, []).append((left - edge, top - edge, right + edge, bottom + edge))
    return boxes


def _middle(views: list[View]) -> int:
    """Find the frame whose view is nearest to the median of all."""
    turns = np.array([cv2.Rodrigues(view.turn)[0][:, 0] for view in views])
    off = np.linalg.norm(turns - np.median(turns, axis=0), axis=1)
    off[[not np.isfinite(view.residual) for view in views]] = np.inf
    return int(off.argmin())
