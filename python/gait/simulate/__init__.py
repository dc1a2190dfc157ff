"""Test clips with ground truth: a walking person with their own body, clothes and gait in a generated scene.

Nothing here uses the tracker's model, limbs or likelihood, so a tracker cannot do well on these clips merely
by inverting its own assumptions.  `clip.simulate` writes a clip; the demo and the evaluation use
`scenario.PRESETS`.
"""
