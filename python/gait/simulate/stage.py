"""All parts of a clip before rendering: people, walks, camera, scene."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from gait.bindings.model import read_blob
from gait.body.skeleton import axis_rotation
from gait.camera.camera import Camera
from gait.errors import UsageError
from gait.io import blob
from gait.simulate import aids, motion
from gait.simulate.body import Anatomy, Mesh, draw_anatomy
from gait.simulate.curves import curves_of_model, normative
from gait.simulate.figure import build_figure
from gait.simulate.geometry import Array, Ints
from gait.simulate.moving import make_cameras
from gait.simulate.scenario import GENERATOR, Scenario
from gait.simulate.scene import Coats, Layout, Scene, build_scene, draw_layout
from gait.simulate.walk import RUN_TOE_OFF, TOE_OFF, Path, Shaped, Walk, draw_timing, make_walk
from gait.simulate.wardrobe import Appearance, draw_appearance

CIRCLE_RADIUS = 2.5
CORNER_ANGLE = np.radians(80.0)  # angle of a corner, away from a camera at the side
_CLOSEST = 2.2  # least metres between lens and path
_AROUND = 20.0  # metres before and after the path that several cameras, or a moving one, may show
_TURNS = 60.0, -60.0, 30.0  # degrees about the middle of the path from the first camera to the others
# heading of the path for left to right, degrees from world x; the camera looks along +y
_HEADING = {"side": 0, "oblique": -45, "toward": -90, "away": 90, "above": -30, "circle": 0}
_OPPOSITE = {"toward": "away", "away": "toward"}  # view of a person who comes the other way
_HEIGHT = {"side": 1.5, "oblique": 1.6, "toward": 1.5, "away": 1.5, "above": 3.6, "circle": 1.7}
_AWAY = {"side": 6.5, "oblique": 5.0, "toward": 5.0, "away": 4.5, "above": 5.5, "circle": 6.5}


def make_path(view: str, direction: str, seed_turn: float) -> Path:
    """Return the path; `seed_turn` (-1..1) turns straight paths by up to 3 degrees and shifts the circle."""
    mirrored = direction == "rl"
    if view == "circle":
        return Path(np.pi * seed_turn, -CIRCLE_RADIUS if mirrored else CIRCLE_RADIUS)
    heading = np.radians(_HEADING[view] + 3 * seed_turn)
    return Path(np.pi - heading if mirrored else heading)


def make_camera(
    view: str, size: tuple[int, int], points: Array, distance: float | None, height: float | None
) -> Camera:
    """Place the camera at (0, -distance, height) with the longest lens that keeps all `points` in view.

    `size`: width and height, pixels. `points` (n, 3): points around the person, world, metres. `distance`:
    horizontal distance from the origin, metres; by default large enough for the person. `height`: metres.
    UsageError if the person would come too close to the lens.
    """
    near = -float(points[:, 1].min())
    if distance is None:
        distance = max(_AWAY[view], near + (4.0 if view in ("toward", "oblique", "away") else 3.0))
    if distance - near < _CLOSEST:
        raise UsageError(
            f"--distance {distance:g}: the person comes within {distance - near:.1f} m of the camera; "
            f"give at least {near + _CLOSEST:.1f}"
        )
    place = np.array([0.0, -distance, _HEIGHT[view] if height is None else height])
    middle = 0.5 * (points.min(0) + points.max(0))
    rotation = _aim_at(place, middle)
    for _ in range(4):  # turn until the person's extent is centred
        low, high = _extent(points, place, rotation)
        ray = np.array([*(low + high) / 2, 1.0]) @ rotation
        rotation = _aim_at(place, place + ray)
    low, high = _extent(points, place, rotation)
    width, tall = size
    across = max(high[0], -low[0])
    focal = min((0.5 - 0.035) * width / across, 0.86 * tall / (high[1] - low[1]))
    return Camera(
        width, tall, float(focal), float(focal), (width - 1) / 2, (tall - 1) / 2, rotation, -rotation @ place
    )


def _aim_at(place: Array, target: Array) -> Array:
    """Return world-to-camera rotation with a level horizon."""
    ahead = (target - place) / np.linalg.norm(target - place)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def _extent(points: Array, place: Array, rotation: Array) -> tuple[Array, Array]:
    """Return the smallest and largest (x / z, y / z) of the points."""
    in_camera = (points - place) @ rotation.T
    flat = in_camera[:, :2] / in_camera[:, 2:]
    return flat.min(0), flat.max(0)


_RUN = 2.5, 1.36  # m/s, strides/s
_BRISK = 0.3  # m/s; how much faster people walk who are about to run
_USUAL_SPEED, _USUAL_CADENCE, _USUAL_STATURE = 1.25, 0.92, 1.75  # m/s, strides/s, m
_SURFACE = 0.10  # metres from a joint to the skin, hair or shoe around it
_APART = (0.65, 0.95)  # metres between the paths of people who meet
_FASTER = 1.4  # speed over that of the person who is overtaken


@dataclass(frozen=True)
class Stage:
    """What is in front of the camera."""

    scenario: Scenario
    body: Anatomy
    walk: Walk
    camera: Camera
    cameras: list[Camera]  #: camera of each frame, if it moves; `camera` is then the first
    frames: Ints  #: (frames,) index of each frame on the walk's time grid
    classes: list[str]  #: class of motion of each frame
    others: list[Stage] = field(default_factory=list)  #: further people, in front of the same camera
    beside: list[Camera] = field(default_factory=list)  #: further, static cameras

    def project(self, places: Array) -> Array:
        """Project positions (frames, ..., 3) to pixels (frames, ..., 2), each by its frame's camera."""
        if not self.cameras:
            return self.camera.project(places)
        return np.array([camera.project(one) for camera, one in zip(self.cameras, places, strict=True)])


@dataclass(frozen=True)
class Set:
    """Everything needed for drawing: the figure, those of `Stage.others`, and the empty scene."""

    mesh: Mesh
    appearance: Appearance
    others: list[tuple[Mesh, Appearance]]
    layout: Layout
    coats: Coats
    scene: Scene


def set_stage(scenario: Scenario) -> Stage:
    """Draw people and make them walk in front of a camera. UserError if options contradict each other."""
    path = make_path(scenario.view, scenario.direction, float(scenario.stream("path").uniform(-1, 1)))
    if scenario.motion == "turn":
        path = replace(path, corner=CORNER_ANGLE if scenario.direction == "lr" else -CORNER_ANGLE)
    first, *others = [_cast(one, way) for one, way in [(scenario, path), *_company(scenario, path)]]
    reach, follows = _envelope(first.walk, first.frames), scenario.moving == "follow"
    away, high = (None, None) if follows else (scenario.distance, scenario.camera_height)
    reaches = [reach, *(_envelope(one.walk, one.frames) for one in others)]
    points = np.concatenate(reaches, axis=1).reshape(-1, 3)
    camera = make_camera(scenario.view, scenario.size, points, away, high)
    beside = [_turned_camera(scenario, points, turn) for turn in _TURNS[: scenario.cameras - 1]]
    cameras = []
    if scenario.moving != "none":
        rng = scenario.stream("moving")
        pelvis, away, high = first.walk.origins[first.frames, 0], scenario.distance, scenario.camera_height
        cameras = make_cameras(scenario.moving, camera, pelvis, reach, scenario.fps, rng, away, high)
        camera = cameras[0]
    others = [replace(one, camera=camera) for one in others]
    return replace(first, camera=camera, cameras=cameras, others=others, beside=beside)


def _turned_camera(scenario: Scenario, points: Array, degrees: float) -> Camera:
    """Place a camera like the first one, rotated about the middle of the path."""
    turn = axis_rotation(2, np.radians(degrees))
    there = make_camera(
        scenario.view, scenario.size, points @ turn, scenario.distance, scenario.camera_height
    )
    return replace(there, R=there.R @ turn.T)


def _cast(scenario: Scenario, path: Path) -> Stage:
    """Draw a person who walks along a path, with a dummy camera until the real one is placed."""
    rng = scenario.stream("body")
    stature = scenario.stature or float(np.clip(rng.normal(1.73, 0.08), 1.55, 1.95))
    model = blob.decode(read_blob(None)) if scenario.body == "drawn" else None
    body = draw_anatomy(stature, rng, model)
    speed, cadence = pace(scenario, stature)
    rng = scenario.stream("gait")
    runs, generated = scenario.motion == motion.RUN, scenario.gait == GENERATOR
    if generated and not runs:
        curves = normative(rng)
    else:
        source, kind = "classes" if generated else scenario.gait, motion.RUN if runs else motion.WALK
        curves = curves_of_model(source, rng, cadence, kind)
    timing = draw_timing(cadence, scenario.fps, scenario.frames, len(curves.modes), rng)
    toe_off = RUN_TOE_OFF if runs else TOE_OFF
    timing = replace(timing, spared=scenario.asymmetry / 100, toe_off=toe_off)
    stop, shaped = motion.pause(timing, scenario.motion, scenario.frames), None
    if stop is not None:
        blend = partial(motion.posture, stop=stop, rng=scenario.stream("idle"))
        shaped = Shaped(stop.timing, stop.clock, stop.amplitude, blend)
    faster = None
    if scenario.motion == motion.ACCELERATE:
        own = scenario.stream("run")
        run = curves_of_model("classes", own, _RUN[1], motion.RUN)
        even = replace(timing, phase=_RUN[1] * timing.time, toe_off=RUN_TOE_OFF)
        faster = motion.accelerate(timing, even, (speed, _RUN[0]), run)
    walk = make_walk(body, curves, timing, path, speed, rng, shaped, faster)
    held = aids.hands(scenario.aid, scenario.asymmetry)
    if held:
        aids.carry(walk, held)
    if scenario.motion == motion.BACKWARDS:
        walk = motion.reversed_in_time(walk)
    names = motion.classes(scenario.motion, stop, walk.timing)
    zero = int(np.argmin(np.abs(timing.time)))
    frames = zero + timing.per_frame * np.arange(scenario.frames)
    unplaced = Camera(*scenario.size, 1.0, 1.0, 0.0, 0.0, np.eye(3), np.zeros(3))
    return Stage(scenario, body, walk, unplaced, [], frames, [names[k] for k in frames.tolist()])


def _company(scenario: Scenario, path: Path) -> list[tuple[Scenario, Path]]:
    """Return who else walks, and where: beside the first person's path, on either side."""
    if scenario.people == "one":
        return []
    rng = scenario.stream("people")
    other = replace(
        scenario, people="one", stature=None, speed=None, stride_hz=None, asymmetry=0.0, aid="none"
    )
    speed = pace(scenario, scenario.stature or _USUAL_STATURE)[0]
    side, apart = float(rng.choice([-1, 1])), float(rng.uniform(*_APART))
    if scenario.people == "crossing":
        back = replace(
            other,
            seed=_another(scenario, 1),
            direction="rl" if scenario.direction == "lr" else "lr",
            view=_OPPOSITE.get(scenario.view, scenario.view),
        )
        return [(back, replace(path, heading=path.heading + np.pi, aside=-side * apart))]
    if scenario.people == "overtaking":
        faster = replace(other, seed=_another(scenario, 1), speed=min(_FASTER * speed, 2.5))
        return [(faster, replace(path, aside=side * apart))]
    return [
        (
            replace(other, seed=_another(scenario, k), speed=speed),
            replace(path, aside=way * float(rng.uniform(*_APART)), ahead=float(rng.uniform(-0.25, 0.25))),
        )
        for k, way in ((1, 1.0), (2, -1.0))
    ]


def _another(scenario: Scenario, number: int) -> int:
    """Return the seed of another person in the same clip."""
    return (scenario.seed + 7919 * number) % 2**31


def build_set(stage: Stage) -> Set:
    """Make the figures and paint the scene."""
    scenario = stage.scenario
    people = [stage, *stage.others]
    (mesh, appearance), *others = [_figure(one) for one in people]
    ground = np.concatenate([one.walk.origins[one.frames, 0, :2] for one in people])
    rng = scenario.stream("scene")
    one_view = not (stage.cameras or stage.beside)
    extent = None if one_view else (ground[:, 0].min() - _AROUND, ground[:, 0].max() + _AROUND)
    layout = draw_layout(stage.camera, ground, scenario.clutter, scenario.pole, rng, extent)
    coats = Coats(rng, keep=not one_view)
    return Set(mesh, appearance, others, layout, coats, build_scene(stage.camera, layout, coats))


def _figure(stage: Stage) -> tuple[Mesh, Appearance]:
    """Dress a person."""
    scenario = stage.scenario
    appearance = draw_appearance(scenario.stream("look"))
    carried = aids.parts(scenario.aid, aids.hands(scenario.aid, scenario.asymmetry), stage.body)
    return build_figure(stage.body, appearance, scenario.stream("cloth"), carried), appearance


def pace(scenario: Scenario, stature: float) -> tuple[float, float]:
    """Return speed (m/s) and strides per second, which increase together; taller people step more slowly."""
    rng = scenario.stream("pace")
    usual = _USUAL_CADENCE * np.sqrt(_USUAL_STATURE / stature) * rng.uniform(0.97, 1.03)
    speed, cadence = scenario.speed, scenario.stride_hz
    if scenario.motion == motion.RUN:
        return speed or _RUN[0], cadence or _RUN[1]
    drawn = float(rng.uniform(1.12, 1.38))
    if scenario.motion == motion.ACCELERATE:
        drawn += _BRISK
    if speed is None:
        speed = drawn if cadence is None else _USUAL_SPEED * (cadence / usual) ** 2
    if cadence is None:
        cadence = usual * np.sqrt(speed / _USUAL_SPEED)
    return float(speed), float(cadence)


def _envelope(walk: Walk, frames: Ints) -> Array:
    """Return points (frames, n, 3) around the person's surface."""
    joints = np.stack(list(walk.points(frames).values()), axis=1)
    offsets = _SURFACE * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-0.3, 0.5)])
    return (joints[:, :, None] + offsets).reshape(len(frames), -1, 3)
