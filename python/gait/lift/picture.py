"""A lifted motion in the picture: uncertainty, useful corrections, the overlay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.io.video import Video
from gait.lift.keypoints.corrections import ERRS_FOR, found_alike
from gait.lift.keypoints.suggestions import FramePosterior, Suggestion, suggest
from gait.lift.run import Lifted
from gait.lift.segment.view import Perspective
from gait.lift.video.figure import Figure, write_overlay
from gait.lift.video.fit_clip import KNOWN_JOINT_SD
from gait.lift.video.sensors import CameraView, FlatView, View
from gait.track.moving_video import map_pixels
from gait.track.stabilise import CameraTurns

Floats = npt.NDArray[np.float64]

NEAR_S = 0.35  # seconds around a correction of a joint in which another one of it would add little


def views(lifted: Lifted) -> list[View]:
    """Return the view of each frame: the camera, or an orthographic view whose scale may change."""
    motion, view = lifted.motion, lifted.view.alone()
    assert motion.uv is not None
    if isinstance(view, Perspective):
        return [CameraView(view.camera)] * len(motion.places)
    found: list[View] = []
    for places, uv in zip(motion.places, motion.uv, strict=True):
        flat, middle = places @ view.axes[:2].T, uv.mean(axis=0)
        pixels = float(np.linalg.norm(uv - middle) / np.linalg.norm(flat - flat.mean(axis=0)))
        u, v = middle - pixels * flat.mean(axis=0)
        found.append(FlatView(pixels, (float(u), float(v)), view.axes))
    return found


def slopes(lifted: Lifted) -> Floats:
    """Return derivatives (T, J, 2, 3) of the markers' pixels by their positions."""
    places = lifted.motion.places
    return np.stack([view.project(body)[1] for view, body in zip(views(lifted), places, strict=True)])


def covariances(lifted: Lifted) -> Floats:
    """Covariances (T, 3 J, 3 J) of the coordinates of a frame's markers, square metres.

    For segments estimated alone, only standard deviations relative to the hips are known.  Errors of joints
    are then assumed independent, which makes the intervals of angles too wide.
    """
    motion = lifted.motion
    if motion.covariance is not None:
        return motion.covariance
    variance = motion.rooted_sd.reshape(len(motion.places), -1) ** 2
    return np.asarray(variance[:, :, None] * np.eye(variance.shape[1]))


def picture_sd(lifted: Lifted) -> Floats:
    """Return standard deviations (T, J) of the markers along an axis of the picture, pixels.

    Errors of the camera move markers in the world, but hardly in its picture.
    """
    by_place, frames = slopes(lifted), len(lifted.motion.places)
    count = by_place.shape[1]
    blocks = covariances(lifted).reshape(frames, count, 3, count, 3)
    own = np.moveaxis(np.diagonal(blocks, axis1=1, axis2=3), -1, 1)  # (T, J, 3, 3)
    square = np.einsum("tjab,tjbc,tjac->tj", by_place, own, by_place)
    return np.asarray(np.sqrt(np.maximum(square / 2, 0.0)))


def missed(lifted: Lifted) -> Floats:
    """Distance (T, J) of each marker from its detection, pixels.

    It is 0 if the marker was not detected, and near a correction of it, which shows the detector's error.
    """
    motion, points = lifted.motion, lifted.keypoints
    found = np.zeros(motion.places.shape[:2])
    for column, name in enumerate(points.names):
        found[:, motion.names.index(name)] = np.nan_to_num(motion.error[:, column])
    rows = {int(frame): row for row, frame in enumerate(points.frame)}
    for done in lifted.edits.corrections:
        if done.joint in motion.names and done.frame in rows:
            near = np.abs(points.time - points.time[rows[done.frame]]) < NEAR_S
            found[np.ix_(near, found_alike(motion.names, done.joint))] = 0.0
    return found


def suggestions(lifted: Lifted, most: int) -> list[Suggestion]:
    """Suggest corrections of joints, most useful first, for a motion lifted from keypoints."""
    motion, points = lifted.motion, lifted.keypoints
    joints = [name for name in motion.names if name in JOINTS]
    columns = [motion.names.index(name) for name in joints]
    rows = (3 * np.array(columns)[:, None] + np.arange(3)).ravel()
    by_place, off = slopes(lifted)[:, columns], missed(lifted)[:, columns]
    slope = np.zeros((len(by_place), len(joints), 2, len(rows)))
    for j in range(len(joints)):
        slope[:, j, :, 3 * j : 3 * j + 3] = by_place[:, j]
    # Errors of a detector last a while, and concern a foot as a whole, so a correction also shows those
    # around it.
    lasts = np.exp(-2 * np.abs(points.time[:, None] - points.time) / ERRS_FOR)
    alike = np.array(
        [[other in found_alike(joints, joint) for other in range(len(joints))] for joint in joints]
    )
    missed_around = lasts @ off**2 @ alike.T
    posteriors = [
        FramePosterior(
            points.frame[[t]],
            slope[[t]],
            own[np.ix_(rows, rows)],
            off[[t]],
            missed_around[[t]],
            float(lasts[t].sum()),
        )
        for t, own in enumerate(covariances(lifted))
    ]
    enough = (
        KNOWN_JOINT_SD * motion.stature * float(np.median(np.linalg.norm(by_place, axis=(2, 3)))) / np.sqrt(2)
    )
    near = NEAR_S / float(np.median(np.diff(points.time) / np.diff(points.frame)))
    return suggest(posteriors, joints, near, enough, most)


def draw_overlay(
    path: str, video: Video, lifted: Lifted, quiet: bool, turns: CameraTurns | None = None
) -> None:
    """Write a video with the cylinder figure and the corrections drawn into it.

    Parameters
    ----------
    turns : CameraTurns, optional
        Turns of the calibrated camera, if the keypoints were stabilised.
    """
    motion, frame, by_frame = lifted.motion, lifted.keypoints.frame, views(lifted)
    figure = Figure.fit(motion.places, motion.names)
    rows = {int(number): row for row, number in enumerate(frame)}
    pulled = [
        (c, motion.places[rows[c.frame], motion.names.index(c.joint)]) for c in lifted.edits.corrections
    ]
    if turns is not None and isinstance(lifted.view, Perspective):
        reference = lifted.view.camera
        own = turns.cameras(reference)
        by_frame = [CameraView(own.get(number, reference)) for number in frame.tolist()]
        pulled = [
            (replace(c, uv=tuple(map_pixels(np.array(c.uv), reference, own[c.frame]).tolist())), place)
            for c, place in pulled
        ]
    write_overlay(path, video, frame, by_frame, figure, pulled, quiet)
