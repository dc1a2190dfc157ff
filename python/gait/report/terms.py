"""Words of reports that a clinician knows, each with its explanation: angles, gait parameters, errors."""

from __future__ import annotations

ANGLES = {
    "root_pitch": (
        "Pelvic tilt",
        "forward +",
        "Of the walking model at this phase: hips alone do not show it.",
    ),
    "root_roll": ("Pelvic obliquity", "left side up +", "Of the line through both hips against the floor."),
    "root_yaw": ("Pelvic rotation", "left side back +", "Of the line through both hips about the vertical."),
    "torso_y": ("Trunk lean", "forward +", "Of the trunk against the pelvis."),
    "torso_x": ("Trunk side lean", "to the right +", "Of the trunk against the pelvis."),
    "torso_z": ("Trunk rotation", "to the left +", "Of the trunk against the pelvis."),
    "neck_y": ("Head nod", "forward +", "Of the head against the trunk."),
    "neck_x": ("Head tilt", "to the right +", "Of the head against the trunk."),
    "neck_z": ("Head turn", "to the left +", "Of the head against the trunk."),
    "hip_flexion": ("Hip flexion", "thigh forward +", "Of the thigh against the pelvis."),
    "hip_abduction": ("Hip abduction", "away from the body +", "Of the thigh against the pelvis."),
    "hip_rotation": ("Hip rotation", "inwards +", "Of the thigh about its own axis."),
    "knee_flexion": ("Knee flexion", "shank back +", "0 is a straight leg."),
    "ankle_flexion": ("Ankle dorsiflexion", "toes up +", "0 is a foot at a right angle to the shank."),
    "shoulder_flexion": ("Shoulder flexion", "arm forward +", "Of the upper arm against the trunk."),
    "shoulder_abduction": (
        "Shoulder abduction",
        "away from the body +",
        "Of the upper arm against the trunk.",
    ),
    "shoulder_rotation": ("Shoulder rotation", "inwards +", "Of the upper arm about its own axis."),
    "elbow_flexion": ("Elbow flexion", "forearm up +", "0 is a straight arm."),
}
"""Name in files, without its side, to name, direction that counts as positive, and explanation."""

QUANTITIES = {
    "stride_time_s": "From a heel strike to the next one of the same foot.",
    "cadence_spm": "Steps per minute: two steps make a stride.",
    "stride_length_m": "From where a foot stands to where the same foot stands next, along the way.",
    "speed_m_s": "Way of the pelvis over the floor in a stride, by its time.",
    "step_time_s": "From the heel strike of the other foot to that of this one.",
    "step_length_m": "From where the other foot stands to where this one stands next, along the way.",
    "step_width_m": "Between the lines on which the ankles stand.",
    "foot_clearance_m": "Least height of the toe joint in the middle of the swing, over where it stood.",
    "stance_percent": "Share of the stride in which the foot is on the floor.",
    "double_support_percent": "Share of the stride in which both feet are on the floor.",
}
"""Name in files to explanation."""

NORMS = {
    "pace": "People as those that the model was learnt from, drawn from it, who walk at this cadence.",
    "speed": "People as those that the model was learnt from, who walk at this speed.",
    "age": "Comfortable speed of healthy adults of this age (Bohannon 1997, 230 people).",
}
"""Source of a norm to explanation."""

COLUMNS = {
    "asymmetry, %": "200 (right − left) / (right + left): 0 where both sides are alike.",
}

STATUSES = {
    "tracking": ("tracking", "left and right are known"),
    "ambiguous": ("unsure", "the person is followed; left and right may be swapped, or the figure be off"),
    "init": ("settling", "the track has just begun"),
    "lost": ("lost", "what is drawn is a guess"),
    "": ("no estimate", "the person was not found in the frame"),
}
"""Status of a frame to its words and their meaning."""

ERRORS = {
    "abs": ("Joints in space, mm", "Mean distance of 15 joints from where they truly are."),
    "root": (
        "Pose, mm",
        "The same after the midpoints of the hips are laid on each other: place left aside.",
    ),
    "root12": ("Pose of arms and legs, mm", "Pose of the 12 joints that 2-D pose networks have."),
    "proc": (
        "Shape, mm",
        "After the best rotation, scale and shift of each frame; only to compare with other publications.",
    ),
    "static": (
        "A standing figure, mm",
        "Pose error of the mean standing pose at the true place: a simple rival.",
    ),
    "free": (
        "A blind walk, mm",
        "Pose error of the mean stride that runs on from the true first frame: a rival.",
    ),
    "px": ("In the picture, px", "Distance of the joints from the true ones in the pixels of the film."),
    "phase": ("Phase, % of the stride", "Error of the moment in the stride, swapped sides left aside."),
}
"""Errors of which median, mean and 90th percentile are known: words and explanation."""

SHARES = {
    "within50": (
        "Truth within the 50 % intervals",
        "Share of coordinates; 50 % is right, less means too sure of itself.",
    ),
    "within90": (
        "Truth within the 90 % intervals",
        "Share of coordinates; 90 % is right, less means too sure of itself.",
    ),
    "width": ("Width of the 90 % intervals", "Mean over joints, axes and frames."),
    "score": (
        "Score of the intervals",
        "Continuous ranked probability score: error and width in one; lower is better.",
    ),
    "squared": (
        "Squared errors over variances",
        "Mean; 1 is right, more means too sure of itself.",
    ),
    "flips": ("Left and right swapped", "Share of frames whose phase is nearer to half a stride off."),
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
    "Heel strikes are where the heel is furthest ahead of the pelvis, toe-offs where the toe is furthest "
    "behind it.",
    "Angles are those of the model's joints in degrees. The trunk is measured against the pelvis, the "
    "head against the trunk; flexion moves a limb forward, abduction away from the body, rotation "
    "inwards, on both sides alike.",
    "Standard deviations and bands state how sure the tracker is, given model and camera. What these get "
    "wrong, such as a stature that is off by a few per cent, comes on top.",
    "The norm is the people the model was learned from. Where the picture does not show a limb, the "
    "tracker fills it in from the same people, so the true departure is larger than shown, most of all "
    "for small or hidden limbs.",
)
"""How to read a report."""


def angle(name: str) -> tuple[str, str, str]:
    """Return name, positive direction and explanation of an angle by its name in files."""
    plain = name[2:] if name[:2] in ("l_", "r_") else name
    return ANGLES.get(plain, (plain.replace("_", " "), "", ""))


def sided(name: str) -> str:
    """Return the name of an angle with its side: ``Left knee flexion``."""
    side = {"l_": "Left ", "r_": "Right "}.get(name[:2], "")
    words = angle(name)[0]
    return side + (words[0].lower() + words[1:] if side else words)
