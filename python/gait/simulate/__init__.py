"""Test clips with exact truth: a walking person with their own body, clothes and gait in a generated scene.

Nothing here uses the tracker's model, limbs or likelihood, so a tracker that does well on these clips has not
merely inverted its own assumptions.  `clip.simulate` writes a clip; the demo
and the evaluation use `scenario.PRESETS`.
"""
