"""The cylinder figure: a body with constant bone lengths, fitted to markers by least squares, and drawn.

This is the last step of Leventon & Freeman 1998; `gait.learn.solve.skeleton_fit` does the fit, as for motion
capture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ELLIPSOID, JOINTS, default_skeleton
from gait.errors import UserError
from gait.io.video import FAST, Image, Video, VideoWriter
from gait.learn.segments.virtual_markers import MARKERS, SKIN, marked_skeleton
from gait.learn.solve import skeleton_fit
from gait.learn.solve.kinematics import Pose, pose_skeleton, segment_origins, segment_scales
from gait.lift.keypoints.corrections import Correction
from gait.lift.video.sensors import View
from gait.progress import progress
from gait.report.drawing import draw_bones, tinted

Floats = npt.NDArray[np.float64]

FIGURE_JOINT_SD, SKIN_SD = 0.01, 0.02  # statures; errors of a joint's, or skin marker's, position in its limb
FEWEST_MARKERS = 8  # fewest markers
_BODY = default_skeleton()
BODY_LIMBS = tuple(_BODY.limbs)


@dataclass(frozen=True)
class Figure:
    """A body with limbs of constant length, in T poses.

    Attributes
    ----------
    log_scales : (S,)
        Log length scales of the body (`gait.learn.solve.kinematics.SCALES`).
    pose : Pose
    residual : (T, M)
        Distances from the markers used, metres.
    """

    log_scales: Floats
    pose: Pose
    residual: Floats

    @staticmethod
    def fit(places: Floats, names: Sequence[str]) -> Figure:
        """Fit a body to markers (T, J, 3), metres, world with z up; unknown markers are ignored.

        Raises
        ------
        UserError
            If too few markers are among `gait.learn.segments.virtual_markers.MARKERS`.
        """
        used = [name for name in names if name in MARKERS]
        if len(used) < FEWEST_MARKERS:
            raise UserError(f"the cylinder figure needs {FEWEST_MARKERS} markers of {' '.join(MARKERS)}")
        body = marked_skeleton()
        row = [body.points.index(name) for name in used]
        points = skeleton_fit.Points(
            segment=body.point_frames[row].astype(np.intp),
            at=body.point_positions[row],
            sd=np.array([SKIN_SD if name in SKIN else FIGURE_JOINT_SD for name in used]),
        )
        found = skeleton_fit.fit(places[:, [list(names).index(name) for name in used]], points)
        return Figure(found.log_scales, found.pose, found.residual)

    @property
    def stature(self) -> float:
        """Height of the body, metres, if all its parts had usual proportions."""
        return float(np.exp(self.log_scales[0]))

    def joints(self) -> Floats:
        """Compute the positions (T, 19, 3) of `gait.body.skeleton.JOINTS`, metres."""
        segment = _BODY.point_frames.astype(np.intp)
        local = segment_scales(self.log_scales)[segment] * _BODY.point_positions
        posed = pose_skeleton(self.pose, segment_origins(self.log_scales))
        return posed.points(local, segment)

    def lengths(self) -> dict[str, float]:
        """Return the lengths of thighs, shanks, upper arms and forearms, metres."""
        place = dict(zip(JOINTS, self.joints()[0], strict=True))
        ends = {
            "thigh": ("hip", "knee"), "shank": ("knee", "ankle"),
            "upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"),
        }  # fmt: skip
        return {
            f"{side}_{bone}": float(np.linalg.norm(place[f"{side}_{a}"] - place[f"{side}_{b}"]))
            for side in "lr"
            for bone, (a, b) in ends.items()
        }

    def surfaces(self) -> Floats:
        """Compute points (T, L, P, 3), metres, on the surfaces of `BODY_LIMBS`: each limb is their hull."""
        posed = pose_skeleton(self.pose, segment_origins(self.log_scales))
        segment = np.repeat(_BODY.limb_frames[:, 0], RING * SLICES).astype(np.intp)
        local = segment_scales(self.log_scales)[segment] * _SURFACE.reshape(-1, 3)
        points = posed.points(local, segment)
        return points.reshape(len(points), len(BODY_LIMBS), -1, 3)


RING, SLICES = 20, 7  # points around a limb, and rings along it


def _surface(shape: int, row: Floats) -> Floats:
    """Make points (RING * SLICES, 3) on a limb in its frame, statures; LIMI, LIMF: see model-format.md."""
    start, end, (a0, b0, a1, b1) = row[:3], row[3:6], row[6:]
    axis = (end - start) / np.linalg.norm(end - start)
    first = np.array([0.0, 1.0, 0.0]) - axis[1] * axis
    first /= np.linalg.norm(first)
    third = np.cross(first, axis)
    turn = 2 * np.pi * np.arange(RING) / RING
    rings = []
    for share in 0.5 - 0.5 * np.cos(np.pi * np.arange(SLICES) / (SLICES - 1)):
        a, b = a0 + share * (a1 - a0), b0 + share * (b1 - b0)
        if shape == ELLIPSOID:
            a, b = (r * np.sqrt(max(0.0, 1 - (2 * share - 1) ** 2)) for r in (a0, b0))
        ring = start + share * (end - start)
        rings.append(ring + np.outer(a * np.cos(turn), first) + np.outer(b * np.sin(turn), third))
    return np.concatenate(rings)


_SURFACE = np.stack(
    [_surface(int(s), row) for (_, s), row in zip(_BODY.limb_frames, _BODY.limb_shapes, strict=True)]
)

_DARK = (30, 30, 30)
_CORRECTION = (90, 240, 255)  # BGR
_BITS = 3  # fractional bits of OpenCV's drawing coordinates


def draw_figure(
    image: Image,
    view: View,
    surfaces: Floats,
    joints: Floats,
    corrections: Sequence[tuple[Correction, Floats]] = (),
) -> Image:
    """Draw limbs, sticks and corrections into a copy of a picture, BGR.

    Parameters
    ----------
    image : (h, w) or (h, w, 3)
    view : View
    surfaces : (L, P, 3)
        Points whose hulls are the limbs, metres.
    joints : (19, 3)
        Positions of `gait.body.skeleton.JOINTS`, metres.
    corrections : sequence of (Correction, (3,))
        Corrections of this frame, and the positions of their markers, metres.
    """
    canvas = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    if not view.visible(surfaces):
        return np.asarray(canvas, np.uint8)
    size = max(0.3, 1.7 * view.scale(joints[JOINTS.index("pelvis")]) / 400)
    width = max(1, round(1.5 * size))
    canvas = tinted(
        np.asarray(canvas, np.uint8), _limb_ids(canvas.shape[:2], view, surfaces), BODY_LIMBS, width
    )
    uv = dict(zip(JOINTS, view.project(joints)[0], strict=True))
    draw_bones(canvas, uv, width + 2, _DARK)
    draw_bones(canvas, uv, width)
    for correction, place in corrections:
        _draw_correction(canvas, np.asarray(correction.uv), view.project(place[None])[0][0], width)
    return canvas


def write_overlay(
    path: str,
    video: Video,
    frame: npt.NDArray[np.int64],
    views: Sequence[View],
    figure: Figure,
    corrections: Sequence[tuple[Correction, Floats]],
    quiet: bool,
) -> None:
    """Write a video with the figure drawn into the frames from the first to the last of a motion.

    Parameters
    ----------
    path : str
        Video to write.
    video : Video
    frame : (T,)
        Numbers of the motion's frames; frames in between are not changed.
    views : sequence of T View
    figure : Figure
        In T poses.
    corrections : sequence of (Correction, (3,))
        Corrections, and the positions of their markers, metres.
    quiet : bool
        Show no progress.
    """
    surfaces, joints = figure.surfaces(), figure.joints()
    rows = {int(number): row for row, number in enumerate(frame)}
    first, end = int(frame[0]), int(frame[-1]) + 1
    with (
        VideoWriter(path, video.fps, preset=FAST) as film,
        progress("drawing", end - first, quiet) as update,
    ):
        for done, shown in enumerate(video.frames(first, end), 1):
            image, row = shown.image, rows.get(shown.number)
            if row is not None:
                own = [each for each in corrections if each[0].frame == shown.number]
                image = draw_figure(image, views[row], surfaces[row], joints[row], own)
            film.write(image)
            update(done)


def _limb_ids(size: tuple[int, ...], view: View, surfaces: Floats) -> npt.NDArray[np.uint8]:
    """Compute limb index + 1 of every pixel, 0 for none; the nearest limbs are painted last."""
    ids = np.zeros(size, np.uint8)
    uv, _ = view.project(surfaces)
    for limb in np.argsort(-view.depth(surfaces).mean(axis=1)):
        outline = cv2.convexHull(np.clip(uv[limb], -1e6, 1e6).astype(np.float32))
        fixed = np.rint(outline * (1 << _BITS)).astype(np.int32)
        cv2.fillConvexPoly(ids, fixed, int(limb) + 1, cv2.LINE_8, _BITS)
    return ids


def _draw_correction(canvas: Image, wanted: Floats, found: Floats, width: int) -> None:
    """Draw a circle where the user wants a marker, and a line from there to where it is."""
    near, far = (tuple(np.clip(np.rint(p), -1e6, 1e6).astype(int).tolist()) for p in (wanted, found))
    cv2.line(canvas, near, far, _CORRECTION, width, cv2.LINE_AA)
    cv2.circle(canvas, near, 3 + 2 * width, _DARK, width + 2, cv2.LINE_AA)
    cv2.circle(canvas, near, 3 + 2 * width, _CORRECTION, width, cv2.LINE_AA)
