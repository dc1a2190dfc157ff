"""Terms of reports, familiar to clinicians, with explanations: angles, gait parameters, errors."""

from __future__ import annotations

ANGLE_TERMS = {
    "root_pitch": (
        "Pelvic tilt",
        "forward +",
        "From the walking model at this phase: the hips alone do not determine it.",
    ),
    "root_roll": (
        "Pelvic obliquity",
        "left side up +",
        "Angle between the line through both hips and the floor.",
    ),
    "root_yaw": (
        "Pelvic rotation",
        "left side back +",
        "Rotation of the line through both hips about the vertical.",
    ),
    "torso_y": ("Trunk lean", "forward +", "Of the trunk against the pelvis."),
    "torso_x": ("Trunk side lean", "to the right +", "Of the trunk against the pelvis."),
    "torso_z": ("Trunk rotation", "to the left +", "Of the trunk against the pelvis."),
    "neck_y": ("Head nod", "forward +", "Of the head against the trunk."),
    "neck_x": ("Head tilt", "to the right +", "Of the head against the trunk."),
    "neck_z": ("Head turn", "to the left +", "Of the head against the trunk."),
    "hip_flexion": ("Hip flexion", "thigh forward +", "Of the thigh against the pelvis."),
    "hip_abduction": ("Hip abduction", "away from the body +", "Of the thigh against the pelvis."),
    "hip_rotation": ("Hip rotation", "inwards +", "Rotation of the thigh about its own axis."),
    "knee_flexion": ("Knee flexion", "shank back +", "0 is a straight leg."),
    "ankle_flexion": ("Ankle dorsiflexion", "toes up +", "0 is a foot at a right angle to the shank."),
    "shoulder_flexion": ("Shoulder flexion", "arm forward +", "Of the upper arm against the trunk."),
    "shoulder_abduction": (
        "Shoulder abduction",
        "away from the body +",
        "Of the upper arm against the trunk.",
    ),
    "shoulder_rotation": ("Shoulder rotation", "inwards +", "Rotation of the upper arm about its own axis."),
    "elbow_flexion": ("Elbow flexion", "forearm up +", "0 is a straight arm."),
}
"""Name in files, without its side, to: name, positive direction, and explanation."""

QUANTITY_TERMS = {
    "stride_time_s": "From a heel strike to the next one of the same foot.",
    "cadence_spm": "Steps per minute: two steps make a stride.",
    "stride_length_m": "Distance along the path between two stances of the same foot.",
    "speed_m_s": "Distance that the pelvis moves over the floor in a stride, divided by the stride time.",
    "step_time_s": "From the heel strike of the other foot to the heel strike of this foot.",
    "step_length_m": "Distance along the path from the stance of the other foot to that of this foot.",
    "step_width_m": "Distance between the lines along which left and right ankles are placed.",
    "foot_clearance_m": "Lowest height of the toe joint in mid-swing, above its height in stance.",
    "stance_percent": "Share of the stride in which the foot is on the floor.",
    "double_support_percent": "Share of the stride in which both feet are on the floor.",
}
"""Name in files to explanation."""

NORMS = {
    "pace": "People drawn from the model who walk at this cadence.",
    "speed": "People drawn from the model who walk at this speed.",
    "age": "Comfortable speed of healthy adults of this age (Bohannon 1997, 230 people).",
}
"""Source of a norm to explanation."""

COLUMN_TERMS = {
    "asymmetry, %": "200 (right − left) / (right + left): 0 if both sides are equal.",
}

STATUS_TERMS = {
    "tracking": ("tracking", "left and right are known"),
    "ambiguous": (
        "uncertain",
        "the person is followed, but left and right may be swapped or the figure may be off",
    ),
    "init": ("settling", "tracking has just begun, in the first frames or at a later start"),
    "lost": ("lost", "the drawn figure is a guess"),
    "": ("no estimate", "the person was not found in the frame"),
}
"""Status of a frame to its words and their meaning."""

ERRORS = {
    "abs": ("Joints in 3-D, mm", "Mean distance of 15 joints from their true positions."),
    "root": (
        "Pose, mm",
        "The same after aligning the midpoints of the hips, so that position does not count.",
    ),
    "root12": ("Pose of arms and legs, mm", "Pose error of the 12 joints that 2-D pose networks detect."),
    "proc": (
        "Shape, mm",
        "Pose error after the best rotation, scale and shift of each frame; only for comparison with "
        "publications.",
    ),
    "static": (
        "A standing figure, mm",
        "Pose error of the mean standing pose at the true position: a simple baseline.",
    ),
    "free": (
        "A blind walk, mm",
        "Pose error of the mean stride continued from the true first frame: a baseline.",
    ),
    "px": ("In the picture, px", "Distance of the joints from the true ones in the pixels of the film."),
    "phase": ("Phase, % of the stride", "Error of the phase, not counting swapped sides."),
}
"""Errors with median, mean and 90th percentile: words and explanation."""

SHARE_TERMS = {
    "within50": (
        "Truth within the 50 % intervals",
        "Share of coordinates; 50 % is right, less means overconfident.",
    ),
    "within90": (
        "Truth within the 90 % intervals",
        "Share of coordinates; 90 % is right, less means overconfident.",
    ),
    "width": ("Width of the 90 % intervals", "Mean over joints, axes and frames."),
    "score": (
        "Score of the intervals",
        "Continuous ranked probability score: combines error and width; lower is better.",
    ),
    "squared": (
        "Squared errors over variances",
        "Mean; 1 is right, more means overconfident.",
    ),
    "flips": (
        "Left and right swapped",
        "Share of frames whose phase is closer to half a stride off than to the truth.",
    ),
    "bias": ("Phase early (−) or late (+)", "Mean error of the phase, % of the stride."),
    "lost": ("Far off or lost", "Share of frames with a pose error over 150 mm, or status lost."),
    "wrong": (
        "Far off though tracking",
        "Share of frames with a pose error over 150 mm and status tracking.",
    ),
}
"""Single figures of the comparison: words and explanation."""

CONVENTIONS = (
    "The world has z up and the floor at z = 0; x and y are those of the camera file, or, where the "
    "camera was estimated from the walk, y points away from the camera and x to its right.",
    "The phase of a stride runs from 0 at the right heel strike to 1 (100 %) at the next. Curves of the "
    "left side begin at the left heel strike.",
    "A heel strike is where the heel is furthest in front of the pelvis, a toe-off where the toe is "
    "furthest behind it.",
    "Angles are those of the model's joints in degrees. The trunk is measured relative to the pelvis, the "
    "head relative to the trunk; flexion moves a limb forward, abduction away from the body, rotation "
    "inwards, on both sides alike.",
    "With the default model, knees are about 10 degrees more flexed than in ISB's convention, because it has "
    "the knee centres of CMU's skeletons. The pelvis is level on average; ISB's is tilted forward by about "
    "10 degrees.",
    "Standard deviations and bands assume that model and camera are correct. Errors of these, such as a "
    "stature that is wrong by a few per cent, come on top.",
    "The norm is the people whose motion the model was learnt from. If the picture does not show a limb, "
    "the tracker infers it from the same people, so the true departure is larger than shown, above all for "
    "small or hidden limbs.",
)
"""How to read a report."""


def angle(name: str) -> tuple[str, str, str]:
    """Return name, positive direction and explanation of an angle by its name in files."""
    plain = name[2:] if name[:2] in ("l_", "r_") else name
    return ANGLE_TERMS.get(plain, (plain.replace("_", " "), "", ""))


def sided(name: str) -> str:
    """Return the name of an angle with its side: ``Left knee flexion``."""
    side = {"l_": "Left ", "r_": "Right "}.get(name[:2], "")
    words = angle(name)[0]
    return side + (words[0].lower() + words[1:] if side else words)
