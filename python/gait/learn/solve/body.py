"""From the bones of any recording to the joints and axes that the default skeleton needs."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import SIDES
from gait.errors import UserError
from gait.learn.mocap.recording import Recording
from gait.learn.mocap.remarks import NOTHING, Remarks
from gait.learn.rotations import rotation_vectors, unit

Floats = npt.NDArray[np.float64]

#: Role to the names it has in files; {S} = left/right, {s} = l/r.  Compared without case, punctuation and any
#: prefix up to ':' (Mixamo) or of a biped (3ds Max).  CMU's ASF; cgspeed and Mixamo; Poser; 3ds Max; bones
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
RECORDED = "marker "  # begins the names of joints that are markers as a file has them
BIPED = re.compile(r"^bip0*\d*")


@dataclass
class Body:
    """A walker's joints and axes, T frames; metres, world with z up, NaN where missing.

    Attributes
    ----------
    name, fps
        Of the recording.
    joints : dict of str to (T, 3)
        pelvis (the middle of the hips), neck, head, {l,r}_{shoulder,elbow,wrist,hip,knee,ankle,toe};
        head is any point above the neck on the head's axis.  Markers of a file, if it has any, are there as
        RECORDED and their label.
    pelvis : (T, 3, 3)
        Pelvis axes forward, left, up as columns.
    lateral : dict of str to (T, 3)
        The head's direction to the left and the hinge axes {l,r}_{knee,elbow}, to the left in the rest pose.
    residual : float or None
        Rms distance of markers from the body fitted to them, metres; None if it is not fitted to markers.
    remarks : Remarks
        What else the reader noticed in the file.
    """

    name: str
    fps: float
    joints: dict[str, Floats]
    pelvis: Floats
    lateral: dict[str, Floats] = field(default_factory=dict)
    residual: float | None = None
    remarks: Remarks = NOTHING

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.pelvis)


def body(recording: Recording) -> Body:
    """Find the joints of a recording.

    Raises
    ------
    UserError
        If a bone is missing from the file under all names that are known for it.
    """
    bones = _roles(recording)
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
    return Body(recording.name, recording.fps, joints, pelvis, lateral, remarks=recording.remarks)


def _plain(name: str) -> str:
    return BIPED.sub("", "".join(c for c in name.rsplit(":", 1)[-1].lower() if c.isalnum()))


def _roles(recording: Recording) -> dict[str, int]:
    """Role to bone index."""
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
        for joint, bone in (
            ("shoulder", "upper_arm"),
            ("elbow", "forearm"),
            ("hip", "thigh"),
            ("knee", "shank"),
        ):
            joints[f"{s}_{joint}"] = start[:, bones[f"{s}_{bone}"]]
        hand = bones.get(f"{s}_hand")
        joints[f"{s}_wrist"] = end[:, bones[f"{s}_forearm"]] if hand is None else start[:, hand]
        joints[f"{s}_ankle"], joints[f"{s}_toe"] = start[:, bones[f"{s}_foot"]], end[:, bones[f"{s}_foot"]]
    joints["pelvis"] = (joints["l_hip"] + joints["r_hip"]) / 2
    return joints


def _rest_axes(left: Floats) -> Floats:
    """Body axes of the rest pose as columns, from the direction between the hips."""
    y = unit(np.array([left[0], left[1], 0.0]))
    return np.stack([np.cross(y, [0.0, 0, 1]), y, [0.0, 0, 1]], axis=-1)


def _hinge(recording: Recording, upper: int, lower: int) -> Floats:
    """Axis of a hinge in the rest pose: the file's own, else the main axis of the relative rotations."""
    name = recording.bones[lower]
    if name in recording.hinges:
        return recording.hinges[name]
    relative = np.swapaxes(recording.rotation[:, upper], -1, -2) @ recording.rotation[:, lower]
    vectors = rotation_vectors(relative[np.isfinite(relative).all(axis=(1, 2))])
    _, axes = np.linalg.eigh(vectors.T @ vectors)
    return axes[:, -1]


def _left_sign(joint: str, s: str, joints: dict[str, Floats], axis: Floats) -> float:
    """Sign that makes the axis point left: the knee bends back and the elbow forward on average."""
    ends = ("hip", "knee", "ankle") if joint == "knee" else ("shoulder", "elbow", "wrist")
    a, b, c = (joints[f"{s}_{end}"] for end in ends)
    bends = np.einsum("ti,ti->t", np.cross(unit(b - a), unit(c - b)), axis)
    bend = bends[np.isfinite(bends)].sum()
    return float(np.copysign(1.0, bend if joint == "knee" else -bend))
