"""Test clips: a walker with a body, clothes and gait of its own in a generated scene, with exact truth.

Nothing here uses the tracker's model, limbs or likelihood: what tracks these clips well has not merely
inverted its own assumptions.  `simulate` writes a clip; the demo and the evaluation use
those of `PRESETS`.
"""

from gait.simulate.clip import FILES, simulate
from gait.simulate.scenario import PRESETS, Scenario

__all__ = ["FILES", "PRESETS", "Scenario", "simulate"]
