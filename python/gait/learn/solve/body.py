"""Bodies: the joints and axes that the default skeleton needs, and how bones of recordings give them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

import numpy as np

from gait.body.skeleton import SIDES
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import NO_NOTES, FileNotes, Recording
from gait.learn.rotations import rotation_vectors, unit

#: Names of bones in files; {S} = left/right, {s} = l/r.  Compared without case, punctuation and any prefix up
#: to ':' (Mixamo) or of a biped (3ds Max).  From CMU's ASF; cgspeed and Mixamo; Poser; 3ds Max; and bones
#: named by the joint where they begin (Biovision, Xsens, SMPL).
ALIASES = {
    "pelvis": ("root", "hips", "hip", "pelvis"),
    "neck": ("upperneck", "neck1", "neck", "lowerneck"),
    "head": ("head",),
    "{s}_thigh": ("{s}femur", "{S}upleg", "{S}upperleg", "{S}thigh", "{s}thigh", "{S}hip", "{s}hip"),
    "{s}_shank": (
        *("{s}tibia", "{S}leg", "{S}lowerleg", "{S}shin", "{s}shin", "{S}calf", "{s}calf"),
        *("{S}knee", "{s}knee"),
    ),
    "{s}_foot": ("{S}ankle", "{s}ankle", "{s}foot", "{S}foot"),
    "{s}_upper_arm": (
        *("{s}humerus", "{S}arm", "{S}shldr", "{s}shldr", "{S}upperarm", "{s}upperarm"),
        *("{S}shoulder", "{s}shoulder"),
    ),
    "{s}_forearm": (
        *("{s}radius", "{S}forearm", "{s}forearm", "{S}lowerarm", "{s}lowerarm"),
        *("{S}elbow", "{s}elbow"),
    ),
    "{s}_hand": ("{s}hand", "{S}hand", "{S}wrist"),
}
RECORDED = "marker "  # prefix of names in `Body.joints` that are markers of the file
BIPED = re.compile(r"^bip0*\d*")


@dataclass
class Body:
    """Joints and axes of a person, T frames; metres, world with z up, NaN where missing."""

    name: str  #: of the recording
    fps: float  #: frames per second
    #: Positions (T, 3): pelvis (the middle of the hips), neck, head (a point above the neck on the head's
    #: axis), {l,r}_{shoulder,elbow,wrist,hip,knee,ankle,toe}; markers of the file as RECORDED and their
    #: label.
    joints: dict[str, Floats]
    pelvis: Floats  #: (T, 3, 3) axes forward, left, up as columns
    #: Directions (T, 3): the head's left, and the hinge axes {l,r}_{knee,elbow}, to the left in the rest
    #: pose.
    lateral: dict[str, Floats] = field(default_factory=dict)
    residual: float | None = None  #: rms distance of markers from the body, metres; None without markers
    notes: FileNotes = NO_NOTES

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.pelvis)

    def part(self, start: int, stop: int) -> Body:
        """Return frames start to stop."""
        joints = {name: places[start:stop] for name, places in self.joints.items()}
        lateral = {name: axes[start:stop] for name, axes in self.lateral.items()}
        return replace(self, joints=joints, pelvis=self.pelvis[start:stop], lateral=lateral)


def from_bones(recording: Recording) -> Body:
    """Return the body of a recorded skeleton; UserError if a bone is missing under all its known names."""
    bones = _find_bones(recording)
    joints = _joints(recording, bones)
    rest = {s: recording.rest_start[bones[f"{s}_thigh"]] for s in SIDES}
    axes = _rest_axes(rest["l"] - rest["r"])
    lateral = {"head": recording.rotation[:, bones["head"]] @ axes[:, 1]}
    for s in SIDES:
        for joint, upper, lower in (("knee", "thigh", "shank"), ("elbow", "upper_arm", "forearm")):
            hinge = _hinge(recording, bones[f"{s}_{upper}"], bones[f"{s}_{lower}"])
            lateral[f"{s}_{joint}"] = recording.rotation[:, bones[f"{s}_{upper}"]] @ hinge
            lateral[f"{s}_{joint}"] *= _left_sign(joint, s, joints, lateral[f"{s}_{joint}"])
    pelvis = recording.rotation[:, bones["pelvis"]] @ axes
    return Body(recording.name, recording.fps, joints, pelvis, lateral, notes=recording.notes)


def _plain(name: str) -> str:
    return BIPED.sub("", "".join(c for c in name.rsplit(":", 1)[-1].lower() if c.isalnum()))


def _find_bones(recording: Recording) -> dict[str, int]:
    """Return the bone of each key of ALIASES."""
    known = {_plain(name): i for i, name in reversed(list(enumerate(recording.bones)))}
    found = {}
    for role, names in ALIASES.items():
        for s, side in zip(SIDES, ("left", "right"), strict=True) if "{s}" in role else [("", "")]:
            wanted = [name.format(s=s, S=side) for name in names]
            index = next((known[name] for name in wanted if name in known), None)
            if index is None and role != "{s}_hand":
                raise UserError(
                    f"{recording.source}: no bone for {role.format(s=s)!r}; name it one of {wanted}"
                )
            if index is not None:
                found[role.format(s=s)] = index
    return found


def _joints(recording: Recording, bones: dict[str, int]) -> dict[str, Floats]:
    start, end = recording.start, recording.end
    joints = {"neck": start[:, bones["neck"]], "head": end[:, bones["head"]]}
    for s in SIDES:
        starts = {"shoulder": "upper_arm", "elbow": "forearm", "hip": "thigh", "knee": "shank"}
        for joint, bone in starts.items():
            joints[f"{s}_{joint}"] = start[:, bones[f"{s}_{bone}"]]
        hand = bones.get(f"{s}_hand")
        joints[f"{s}_wrist"] = end[:, bones[f"{s}_forearm"]] if hand is None else start[:, hand]
        joints[f"{s}_ankle"], joints[f"{s}_toe"] = start[:, bones[f"{s}_foot"]], end[:, bones[f"{s}_foot"]]
    joints["pelvis"] = (joints["l_hip"] + joints["r_hip"]) / 2
    return joints


def _rest_axes(left: Floats) -> Floats:
    """Return the body axes of the rest pose as columns, from the direction between the hips."""
    y = unit(np.array([left[0], left[1], 0.0]))
    return np.stack([np.cross(y, [0.0, 0, 1]), y, [0.0, 0, 1]], axis=-1)


def _hinge(recording: Recording, upper: int, lower: int) -> Floats:
    """Return the axis of a hinge in the rest pose: the file's own, else the main axis of its rotations."""
    name = recording.bones[lower]
    if name in recording.hinges:
        return recording.hinges[name]
    relative = np.swapaxes(recording.rotation[:, upper], -1, -2) @ recording.rotation[:, lower]
    vectors = rotation_vectors(relative[np.isfinite(relative).all(axis=(1, 2))])
    _, axes = np.linalg.eigh(vectors.T @ vectors)
    return axes[:, -1]


def _left_sign(joint: str, s: str, joints: dict[str, Floats], axis: Floats) -> float:
    """Return the sign that makes the axis point left: knees bend back, elbows forward, on average."""
    ends = ("hip", "knee", "ankle") if joint == "knee" else ("shoulder", "elbow", "wrist")
    a, b, c = (joints[f"{s}_{end}"] for end in ends)
    bends = np.einsum("ti,ti->t", np.cross(unit(b - a), unit(c - b)), axis)
    bend = bends[np.isfinite(bends)].sum()
    return float(np.copysign(1.0, bend if joint == "knee" else -bend))
