"""What to simulate: the options of a clip, their limits, and named presets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gait.errors import UsageError

if TYPE_CHECKING:
    import numpy as np

GENERATOR = "generator"
VIEWS = ("side", "oblique", "toward", "away", "above", "circle")
DIRECTIONS = ("lr", "rl")
MOTIONS = ("walk", "stop", "stand", "backwards", "turn", "run", "accelerate")
AIDS = ("none", "stick", "crutches")
BODIES = ("table", "drawn")
MOVING = ("none", "follow", "pan", "shake")
COMPANY = {"one": 0, "crossing": 1, "abreast": 2, "overtaking": 1}
"""Number of people in addition to the first."""
MOST_CAMERAS = 4

# option: smallest and largest value
_LIMITS = {
    "frames": (2, 20_000), "fps": (5.0, 240.0), "stature": (1.2, 2.2), "speed": (0.3, 2.5),
    "stride_hz": (0.4, 1.6),
    "distance": (1.0, 100.0), "camera_height": (0.2, 20.0), "seed": (0, 2**31 - 1), "flicker": (0.0, 50.0),
    "noise": (0.0, 64.0), "asymmetry": (-30.0, 30.0),
}  # fmt: skip
_SIZE = (64, 4096)


@dataclass(frozen=True)
class Scenario:
    """Options of `gait simulate`; None lets the seed decide."""

    #: One of `VIEWS`; ``lr`` walks to the right of the picture, ``rl`` to the left.
    view: str = "side"
    direction: str = "lr"
    frames: int = 120
    fps: float = 30.0  #: frames per second
    size: tuple[int, int] = (640, 480)  #: width and height, even, pixels
    stature: float | None = None  #: metres, with shoes
    #: Metres per second, strides (two steps) per second; one implies the other.
    speed: float | None = None
    stride_hz: float | None = None
    #: Horizontal distance of the camera from the middle of the path, and its height above the ground, metres.
    distance: float | None = None
    camera_height: float | None = None
    seed: int = 1  #: of everything random: body, clothes, gait, scene, noise
    #: A pole in front of the path; a stronger background.
    pole: bool = False
    clutter: bool = False
    flicker: float = 0.0  #: standard deviation of the exposure, per cent
    noise: float = 2.0  #: standard deviation of the sensor noise, grey levels
    #: One of `MOTIONS`: ``stop`` walks, stops, stands and continues, ``turn`` turns a corner, ``run``
    #: has the curves of runs, those of `gait` or of the package, ``accelerate`` walks and begins to run.
    motion: str = "walk"
    #: Per cent by which the left leg is spared, as with a prosthesis, negative the right one: it strikes
    #: later and further ahead, stands shorter, its knee stays straighter and its foot pushes off less.
    asymmetry: float = 0.0
    #: One of `AIDS`: a ``stick`` in the hand away from the spared leg, or forearm ``crutches``, each moving
    #: with the leg of the other side.
    aid: str = "none"
    #: One of `BODIES`: textbook proportions, varied independently, or ``drawn`` from those of the people from
    #: which the package's model was learnt.
    body: str = "table"
    #: One of `MOVING`: a robot follows the person, a camera is turned to them, a hand holds it.
    moving: str = "none"
    #: One of `COMPANY`: another person comes the other way, three walk abreast, a faster person overtakes.
    people: str = "one"
    cameras: int = 1  #: number of static cameras that film the walk
    gait: str = GENERATOR  #: ``generator``, or the file of a ``.gait`` model whose curves to use

    def __post_init__(self) -> None:
        """Check every option; the message names it as on the command line."""
        if self.view not in VIEWS:
            raise UsageError(f"--view {self.view}: unknown; use one of {' '.join(VIEWS)}")
        if self.direction not in DIRECTIONS:
            raise UsageError(f"--direction {self.direction}: unknown; use lr or rl")
        if self.motion not in MOTIONS:
            raise UsageError(f"--motion {self.motion}: unknown; use one of {' '.join(MOTIONS)}")
        if self.aid not in AIDS:
            raise UsageError(f"--aid {self.aid}: unknown; use one of {' '.join(AIDS)}")
        if self.body not in BODIES:
            raise UsageError(f"--body {self.body}: unknown; use table or drawn")
        if (self.asymmetry or self.aid != "none") and self.motion in ("backwards", "run", "accelerate"):
            raise UsageError(
                f"--motion {self.motion}: cannot be combined with --asymmetry and --aid; leave them out"
            )
        if self.moving not in MOVING:
            raise UsageError(f"--moving {self.moving}: unknown; use one of {' '.join(MOVING)}")
        if self.moving != "none" and (self.pole or self.motion == "stand"):
            raise UsageError("--moving: needs a walking person and no --pole")
        if self.people not in COMPANY:
            raise UsageError(f"--people {self.people}: unknown; use one of {' '.join(COMPANY)}")
        alone = self.pole or self.moving != "none" or self.motion != "walk" or self.view == "circle"
        if self.people != "one" and alone:
            raise UsageError("--people: needs straight walks, a static camera and no --pole")
        if not 1 <= self.cameras <= MOST_CAMERAS:
            raise UsageError(f"--cameras {self.cameras}: give 1 to {MOST_CAMERAS}")
        if self.cameras > 1 and (self.moving != "none" or self.pole):
            raise UsageError("--cameras: must be static; leave out --moving and --pole")
        for name, (low, high) in _LIMITS.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise UsageError(
                    f"--{name.replace('_', '-')} {value:g}: give a value from {low:g} to {high:g}"
                )
        for pixels in self.size:
            if not _SIZE[0] <= pixels <= _SIZE[1] or pixels % 2:
                width, height = self.size
                raise UsageError(f"--size {width}x{height}: give even numbers from {_SIZE[0]} to {_SIZE[1]}")

    def stream(self, name: str, *more: int) -> np.random.Generator:
        """Return random numbers for one purpose, so that one option does not change the others."""
        import numpy as np  # here, so that --help answers at once

        return np.random.default_rng([self.seed, *name.encode(), *more])


PRESETS: dict[str, Scenario] = {
    "demo": Scenario(seed=24, stature=1.75, speed=1.2),
    "side": Scenario(direction="rl", seed=31, flicker=1.0),
    "oblique": Scenario(view="oblique", frames=110, seed=30),
    "toward": Scenario(view="toward", frames=150, seed=37),
    "pole": Scenario(view="oblique", frames=120, seed=34, pole=True, clutter=True),
    "stopping": Scenario(motion="stop", view="oblique", frames=150, seed=61),
    "standing": Scenario(motion="stand", view="oblique", frames=100, seed=62),
    "backwards": Scenario(motion="backwards", view="oblique", frames=120, seed=63),
    "turning": Scenario(motion="turn", direction="rl", frames=120, seed=64),
    "slow": Scenario(speed=0.6, frames=180, seed=65),
    "fast": Scenario(view="oblique", speed=1.9, frames=90, seed=66),
    "limping": Scenario(view="oblique", speed=1.0, asymmetry=18.0, frames=130, seed=67),
    "stick": Scenario(direction="rl", speed=0.8, asymmetry=-12.0, aid="stick", frames=150, seed=68),
    "crutches": Scenario(speed=0.7, asymmetry=15.0, aid="crutches", frames=160, seed=69),
    "running": Scenario(motion="run", frames=90, seed=70),
    "accelerating": Scenario(motion="accelerate", frames=120, seed=71),
}
"""Scenarios for the demo and for evaluation.

=========  =============================================================
demo       side view, left to right: what ``make demo`` shows
side       side view, right to left, the exposure flickers by 1 %
oblique    45 degrees, coming nearer
toward     5 s straight towards the camera
pole       45 degrees, a pole hides the person, strong background
stopping   45 degrees, walks, stops, stands and walks on
standing   45 degrees, stands
backwards  45 degrees, walks backwards
turning    side view, goes round a corner
slow       side view, 0.6 m/s
fast       45 degrees, 1.9 m/s
limping    45 degrees, spares the left leg, as with a prosthesis
stick      side view, spares the right leg, a stick in the left hand
crutches   side view, forearm crutches, spares the left leg
running    side view, curves of the package's runners
accelerating  side view, walks and begins to run
=========  =============================================================
"""
