"""Test clips with exact truth: a walking person with their own body, clothes and gait in a generated scene.

Nothing here uses the tracker's model, limbs or likelihood, so a tracker that does well on these clips has not
merely inverted its own assumptions.  `simulate` writes a clip; the demo and the evaluation use `PRESETS`.
"""

from gait.simulate.clip import FILES, simulate
from gait.simulate.scenario import PRESETS, Scenario

__all__ = ["FILES", "PRESETS", "Scenario", "simulate"]
