"""Which bodies eqs. 10 to 13 of Ormoneit and others (2000) prefer: true, displaced, or at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from gait.bindings.abi import Mode
from gait.bindings.config import TrackerConfig
from gait.bindings.model import Model
from gait.bindings.state import State
from gait.io.video import Image
from gait.learn.arrays import Floats
from gait.motion.footfalls import walking_direction
from gait.paper.scene import Scene
from gait.track.tracker import Tracker

EVERY = 4  # frames
FRAME_US = 33_333  # microseconds from frame to frame
NOISE_NAMES = ("phase", "rate", "forward", "lateral", "vertical", "heading", "tilt", "coef")
STILL = {f"{name}_noise": 0.0 for name in NOISE_NAMES}
#: Displacements along the direction of walking (m), across it (m), and in phase (strides).
PLACES = {
    "on the person": (0.0, 0.0, 0.0),
    "a quarter stride late": (0.0, 0.0, -0.25),
    "half a stride late": (0.0, 0.0, -0.5),
    "0.7 m behind": (-0.7, 0.0, 0.0),
    "0.7 m beside": (0.0, 0.7, 0.0),
}
BACKGROUND = "0.7 m behind", "0.7 m beside"  # where a body covers the background
Place = tuple[float, float, float]
Seen = tuple[Image, Image]
Row = tuple[str, float, float]  #: a body, and its log-likelihoods walking and at rest
_FULL_EVIDENCE = {"evidence_time": 0.0, "rejuvenation_time": 0.0}  # every frame counts in full


def config(mode: Mode, **changes: float) -> TrackerConfig:
    """Return settings with a few particles and no noise, so that all remain the same body."""
    whole = {} if mode == Mode.PAPER else _FULL_EVIDENCE
    return TrackerConfig.default(mode, particles=16, **STILL, **whole, **changes)


class Probe:
    """The likelihood of one body in a scene: the mean cycle at the true position and phase, or displaced.

    Parameters
    ----------
    config : TrackerConfig
        Settings without noise, from `config`.
    """

    def __init__(self, scene: Scene, model: Model, config: TrackerConfig, stature: float) -> None:
        self.scene = scene
        self.tracker = Tracker(model, scene.camera, config, background=scene.plate)
        self.mean, sd = model.prior()
        self.mean = replace(self.mean, stature=stature)
        self.exactly = replace(sd, **{x.name: np.zeros_like(getattr(sd, x.name)) for x in fields(sd)})
        way = walking_direction(scene.truth)[scene.rows]
        self.heading = np.arctan2(way[:, 1], way[:, 0])
        cycles = scene.cycles()
        assert cycles is not None
        self.cycles: Floats = cycles

    def state(self, k: int, along: float, across: float, late: float) -> State:
        """Mean cycle at the true position in frame k, displaced."""
        turn = float(self.heading[k])
        way = np.array([np.cos(turn), np.sin(turn), 0.0])
        left = np.array([-way[1], way[0], 0.0])
        pelvis = self.scene.truth.places["pelvis"][self.scene.rows[k]]
        return replace(
            self.mean,
            phase=float((self.cycles[k] + late) % 1.0),
            stride_hz=float((self.cycles[k + 1] - self.cycles[k]) * 1e6 / FRAME_US),
            heading=turn,
            pelvis=pelvis + along * way + across * left,
        )

    def step(self, k: int, place: Place, speed: float, seen: Seen | None = None) -> tuple[float, State]:
        """Log-likelihood of frame k + 1 and the body there, which moves on from frame k.

        speed : as a multiple of the person's.
        seen : two images that replace frames k and k + 1.
        """
        now, then = seen or (self.scene.frames[k].image, self.scene.frames[k + 1].image)
        self.tracker.start(self.state(k, *place), self.exactly, FRAME_US)
        self.tracker.step(now, FRAME_US)
        later = 2 * FRAME_US if speed == 1 else FRAME_US + max(1, round(speed * FRAME_US))
        found = self.tracker.step(then, later)
        return found.log_evidence, found.mean

    @property
    def picked(self) -> range:
        """Frames at which steps start."""
        return range(EVERY, len(self.scene.frames) - 3, EVERY)

    def nats(self, place: Place, speed: float) -> float:
        """Mean log-likelihood of the next frame; parameters as for `step`."""
        return float(np.mean([self.step(k, place, speed)[0] for k in self.picked]))

    def table(self) -> list[Row]:
        """Return the log-likelihoods of the body at each place, walking on with the person and at rest."""
        return [(name, self.nats(place, 1.0), self.nats(place, 0.0)) for name, place in PLACES.items()]


def gain_at_rest(rows: Sequence[Row]) -> float:
    """Return by how many nats the best body at rest on the background scores better than the true one."""
    return max(rest for name, _, rest in rows if name in BACKGROUND) - rows[0][1]


def best_at_rest(rows: Sequence[Row]) -> str:
    """Return the place on the background where a body at rest has the highest likelihood."""
    return max((row for row in rows if row[0] in BACKGROUND), key=lambda row: row[2])[0]
