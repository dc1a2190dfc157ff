"""Everything of one clip before its pictures: person, walk, camera, scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gait.camera.camera import Camera
from gait.simulate.anatomy import Anatomy, draw_anatomy
from gait.simulate.arrays import Array, Ints
from gait.simulate.model_curves import curves_of_model
from gait.simulate.curves import normative
from gait.simulate.figure import build_figure
from gait.simulate.layout import Layout, draw_layout
from gait.simulate.mesh import Mesh
from gait.simulate.scenario import GENERATOR, Scenario
from gait.simulate.scene import Scene, build_scene
from gait.simulate.stride import draw_timing
from gait.simulate.views import make_camera, make_path
from gait.simulate.walk import Walk, make_walk
from gait.simulate.wardrobe import Look, draw_look

_USUAL_SPEED, _USUAL_CADENCE, _USUAL_STATURE = 1.25, 0.92, 1.75  # m/s, strides/s, m
_SURFACE = 0.10  # metres from a joint to the skin, hair or shoe around it


@dataclass(frozen=True)
class Stage:
    """What is in front of the camera.

    Attributes
    ----------
    scenario, body, walk, camera
    frames : ndarray of shape (frames,)
        Index of each frame on the walk's time grid.
    """

    scenario: Scenario
    body: Anatomy
    walk: Walk
    camera: Camera
    frames: Ints


@dataclass(frozen=True)
class Set:
    """What is needed to draw: the figure and the empty scene."""

    mesh: Mesh
    look: Look
    layout: Layout
    scene: Scene


def set_stage(scenario: Scenario) -> Stage:
    """Draw a person and let them walk before a camera.

    Raises
    ------
    UserError
        If the options contradict each other.
    """
    rng = scenario.stream("body")
    stature = scenario.stature or float(np.clip(rng.normal(1.73, 0.08), 1.55, 1.95))
    body = draw_anatomy(stature, rng)
    speed, cadence = pace(scenario, stature)
    rng = scenario.stream("gait")
    generated = scenario.gait == GENERATOR
    curves = normative(rng) if generated else curves_of_model(scenario.gait, rng, cadence)
    timing = draw_timing(cadence, scenario.fps, scenario.frames, len(curves.modes), rng)
    path = make_path(scenario.view, scenario.direction, float(scenario.stream("path").uniform(-1, 1)))
    walk = make_walk(body, curves, timing, path, speed, rng)
    zero = int(np.argmin(np.abs(timing.time)))
    frames = zero + timing.per_frame * np.arange(scenario.frames)
    camera = make_camera(
        scenario.view, scenario.size, _envelope(walk, frames), scenario.distance, scenario.camera_height
    )
    return Stage(scenario, body, walk, camera, frames)


def build_set(stage: Stage) -> Set:
    """Make the figure and paint the scene."""
    scenario, walk = stage.scenario, stage.walk
    look = draw_look(scenario.stream("look"))
    mesh = build_figure(stage.body, look, scenario.stream("cloth"))
    ground = walk.origins[stage.frames, 0, :2]
    rng = scenario.stream("scene")
    layout = draw_layout(stage.camera, ground, scenario.clutter, scenario.pole, rng)
    return Set(mesh, look, layout, build_scene(stage.camera, layout, rng))


def pace(scenario: Scenario, stature: float) -> tuple[float, float]:
    """Return speed (m/s) and strides per second: they rise together, and taller people step slower."""
    rng = scenario.stream("pace")
    usual = _USUAL_CADENCE * np.sqrt(_USUAL_STATURE / stature) * rng.uniform(0.97, 1.03)
    speed, cadence = scenario.speed, scenario.stride_hz
    drawn = float(rng.uniform(1.12, 1.38))
    if speed is None:
        speed = drawn if cadence is None else _USUAL_SPEED * (cadence / usual) ** 2
    if cadence is None:
        cadence = usual * np.sqrt(speed / _USUAL_SPEED)
    return float(speed), float(cadence)


def _envelope(walk: Walk, frames: Ints) -> Array:
    """Return points (n, 3) around all that the walker's surface reaches."""
    joints = np.concatenate(list(walk.points(frames).values()))
    offsets = _SURFACE * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-0.3, 0.5)])
    return (joints[:, None] + offsets).reshape(-1, 3)
