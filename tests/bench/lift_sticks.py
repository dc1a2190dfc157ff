"""Pictures of walking stick figures with known truth, for the estimate from images (F9, F10)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import BONES
from gait.camera.camera import Camera
from gait.io.video import Frame, Image
from gait.lift.video.clip_segments import ClipSegments, Settings
from gait.lift.video.energy import PLACE_COLUMNS
from gait.lift.video.fit_clip import ClipFit, Sequence
from gait.lift.video.placement import Placement
from gait.lift.video.sensors import CameraView, Film

Array = NDArray[np.float64]

SIZE, FOCAL = (640, 480), 1000.0
DISTANCE, HEIGHT = 6.5, 1.4  # metres
GROUND, INK, NOISE = 150, 40, 3.0  # grey levels
PLACED = 0.1  # metres and radians, standard deviation of a rough placement


@dataclass(frozen=True)
class Walk:
    """Joints (T, P, 3) of `names` at `fps`; heading at frame 0 and stature; metres, radians."""

    names: list[str]
    joints: Array
    fps: float
    heading: float
    stature: float


def camera(walk: Walk, angle: float) -> Camera:
    """Camera that sees the middle of a walk from an angle: 0 from ahead, pi / 2 from the left."""
    middle = walk.joints[:, walk.names.index("pelvis")].mean(axis=0)
    turn = walk.heading + angle
    place = middle + DISTANCE * np.array([np.cos(turn), np.sin(turn), 0.0])
    return Camera.looking([*place[:2], HEIGHT], [*middle[:2], 0.9], SIZE, FOCAL)


def pictures(walk: Walk, view: Camera, seed: int) -> list[Frame]:
    """Draw the sticks on a plain ground with noise."""
    rng = np.random.default_rng(seed)
    uv = view.project(walk.joints)
    return [
        Frame(k, k / walk.fps, _drawn(dict(zip(walk.names, at, strict=True)), rng)) for k, at in enumerate(uv)
    ]


def _drawn(uv: dict[str, Array], rng: np.random.Generator) -> Image:
    image = np.full((SIZE[1], SIZE[0]), GROUND, np.uint8)
    for a, b in BONES:
        ends = [tuple(np.rint(uv[joint] * 16).astype(int).tolist()) for joint in (a, b)]
        cv2.line(image, *ends, INK, 5, cv2.LINE_AA, 4)
    return np.asarray(np.clip(image + NOISE * rng.standard_normal(image.shape), 0, 255), np.uint8)


def stick_clip(prior: SegmentPrior, walk: Walk, angle: float, seed: int = 0, frame: int = 0) -> ClipSegments:
    """Clip of a stick figure, roughly placed in a frame."""
    rng, view = np.random.default_rng(seed), CameraView(camera(walk, angle))
    pelvis = walk.joints[frame, walk.names.index("pelvis")]
    noise = PLACED * rng.standard_normal(3)
    placed = Placement(frame, pelvis[:2] + noise[:2], walk.heading + noise[2], walk.stature)
    film = Film.make(pictures(walk, view.camera, seed), walk.stature * view.scale(pelvis))
    return ClipSegments(prior, view, film, placed, (), Settings())


def depth_gaps(clip: ClipSegments, sequence: Sequence) -> Array:
    """How much nearer (B - 1,) each segment puts the frames it shares with the last one, mean in metres."""
    frames, hop = clip.prior.frames, clip.prior.hop
    places = [
        clip.shapes[int(c)].positions(state, np.eye(frames), slice(None))[0]
        for c, state in zip(sequence.components, sequence.states, strict=True)
    ]
    away = [clip.view.away(state[PLACE_COLUMNS]) for state in sequence.states[1:]]
    pairs = zip(places[:-1], places[1:], away, strict=True)
    return np.array([((early[hop:] - late[: frames - hop]) @ line).mean() for early, late, line in pairs])


def at_joins(clip: ClipSegments) -> NDArray[np.bool_]:
    """Frames (T,) where a segment begins or ends."""
    ends = np.concatenate([clip.starts, clip.starts + clip.span])
    return np.asarray(np.abs(clip.film.times[:, None] - ends).min(axis=1) < 1e-3)


def spike(clip: ClipSegments, fit: ClipFit) -> float:
    """Largest jump of a marker where segments begin or end, metres.

    A jump is the difference between a step from one frame to the next and the mean of the steps before and
    after.
    """
    step, near = np.diff(fit.places, axis=0), at_joins(clip)
    size = np.linalg.norm(step[1:-1] - (step[:-2] + step[2:]) / 2, axis=2)
    return float(size[near[1:-2] | near[2:-1]].max())


def bends(clip: ClipSegments, fit: ClipFit) -> tuple[Array, Array]:
    """Second differences of the markers' places where segments begin or end, and elsewhere, metres."""
    size, near = np.linalg.norm(np.diff(fit.places, 2, axis=0), axis=2), at_joins(clip)[1:-1]
    return size[near].ravel(), size[~near].ravel()
