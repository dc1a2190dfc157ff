"""Map other tools' keypoints to joints of the model, by number of points or by name."""

from __future__ import annotations

import re

_COCO = (
    "- - - - - l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist "
    "l_hip r_hip l_knee r_knee l_ankle r_ankle"
)
_HALPE = f"{_COCO} head - hip l_big_toe r_big_toe - - l_heel r_heel"
_ARMS = "r_shoulder r_elbow r_wrist l_shoulder l_elbow l_wrist"
_LEGS = "r_hip r_knee r_ankle l_hip l_knee l_ankle"
_FEET = "l_big_toe - l_heel r_big_toe - r_heel"

#: Layouts by their number of points: name and points; "-" and any after the last one are not joints.
LAYOUTS = {
    15: ("MPI of OpenPose", f"head - {_ARMS} {_LEGS} -"),
    16: ("MPII", "r_ankle r_knee r_hip l_hip l_knee l_ankle pelvis - - head_top "
         "r_wrist r_elbow r_shoulder l_shoulder l_elbow l_wrist"),
    17: ("COCO-17", _COCO),
    18: ("COCO-18 of OpenPose", f"- - {_ARMS} {_LEGS} - - - -"),
    25: ("BODY_25 of OpenPose", f"- - {_ARMS} mid_hip {_LEGS} - - - - {_FEET}"),
    26: ("HALPE-26", _HALPE),
    33: ("BlazePose of MediaPipe", f"{'- ' * 11}l_shoulder r_shoulder l_elbow r_elbow l_wrist r_wrist "
         f"{'- ' * 6}l_hip r_hip l_knee r_knee l_ankle r_ankle l_heel r_heel l_foot_index r_foot_index"),
    133: ("COCO-WholeBody", f"{_COCO} {_FEET}"),
    136: ("HALPE-136", _HALPE),
}  # fmt: skip

_SIDED = {
    **{part: part for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "heel", "toe")},
    **dict.fromkeys(("bigtoe", "footindex", "toes"), "toe"),
}
_MIDDLE = {"pelvis": "pelvis", "midhip": "pelvis", "hip": "pelvis", "hips": "pelvis", "headtop": "head_top"}
_SIDES = {"l": "l", "left": "l", "r": "r", "right": "r"}


def points_of(count: int) -> tuple[str, ...]:
    """List names in the layout with `count` points, '' for those that are not joints; empty if unknown."""
    names = LAYOUTS.get(count, ("", ""))[1].split()
    return tuple([name.strip("-") for name in names] + [""] * (count - len(names))) if names else ()


def joint_named(name: str, own: bool = False) -> str:
    """Return the model's joint for a point with this name; '' if there is none.

    Sides may be l, r, left or right, before or after the part.  `own`: the user chose the name, so that head
    and neck may be anything; otherwise head is the top of the head, as in HALPE and OpenPose.  The neck of
    other tools is between the shoulders and not the neck of the model.
    """
    if own and name in ("neck", "head_top"):
        return name
    spaced = re.sub(r"(?<=[a-z\d])(?=[A-Z])|(?<=^[LR])(?=[A-Z])", "_", name).lower()
    words = [word for word in re.split(r"[^a-z\d]+", spaced) if word]
    sides = {_SIDES[word] for word in words if word in _SIDES}
    part = "".join(word for word in words if word not in _SIDES)
    if not sides and (glued := re.fullmatch(r"(left|right|l|r)([a-z]+)", part)) and glued[2] in _SIDED:
        sides, part = {_SIDES[glued[1]]}, glued[2]
    if len(sides) == 1 and part in _SIDED:
        return f"{sides.pop()}_{_SIDED[part]}"
    if sides:
        return ""
    return "head_top" if part == "head" and not own else _MIDDLE.get(part, "")
