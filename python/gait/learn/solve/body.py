"""Bodies: the joints and axes needed for the default skeleton, from the bones of recordings."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from gait.body.skeleton import SIDES
from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import NO_NOTES, FileNotes, Recording
from gait.learn.rotations import frame_from, rotation_vectors, unit

#: Names of bones in files; {S} = left/right, {s} = l/r.  Compared without case, punctuation and words with
#: which most bones begin or end (Character1_, mixamorig:, Bip01, _jnt); the side may be before or after the
#: rest.  From CMU's ASF; cgspeed and Mixamo; Poser; 3ds Max; and bones named by the joint at which they begin
#: (Biovision, Xsens, SMPL).
ALIASES = {
    "pelvis": ("hips", "pelvis", "hip", "root"),
    "neck": ("upperneck", "neck1", "neck01", "neck", "lowerneck"),
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
REQUIRED = ("pelvis", "{s}_thigh", "{s}_shank", "{s}_foot")  #: without these there is no gait
#: Why a body is rejected that cannot be rotated to a valid one.
MIRRORED = (
    "axes are left-handed, or left and right are swapped: a mirror image fits a body; negate one axis, or "
    "swap the names"
)
RECORDED = "marker "  # prefix of names in `Body.joints` that are markers of the file
UPRIGHT = 0.8  # least height of hips above ankles, over the leg's length, in an upright rest pose
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")
SIDE_WORDS = {"l": "left", "left": "left", "r": "right", "right": "right"}
MOST_AFFIXED_SHARE = 0.7  # share of the bones whose names begin or end with a meaningless word
BIPED = re.compile(r"^bip0*\d*")


@dataclass
class Body:
    """Joints and axes of a person, T frames; metres, world with z up, NaN where missing."""

    name: str  #: name of the recording
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
        """Return frames start <= t < stop."""
        return self._at(slice(start, stop))

    def reversed(self) -> Body:
        """Return the motion in reversed time."""
        return self._at(slice(None, None, -1))

    def _at(self, frames: slice) -> Body:
        joints = {name: places[frames] for name, places in self.joints.items()}
        lateral = {name: axes[frames] for name, axes in self.lateral.items()}
        return replace(self, joints=joints, pelvis=self.pelvis[frames], lateral=lateral)


def from_bones(recording: Recording) -> Body:
    """Return the body of a recorded skeleton; UserError if the pelvis or a bone of the legs is missing.

    A missing neck is assumed to begin at the head; other missing parts are NaN.
    """
    bones, lacking = _find_bones(recording)
    joints = _joints(recording, bones)
    stands = _rest_stands(recording, bones)
    axes, head = (_rest_axes if stands else _posed_axes)(recording, bones, joints)
    missing = np.full((len(recording.start), 3), np.nan)
    lateral = {"head": recording.rotation[:, bones["head"]] @ head if "head" in bones else missing}
    for s in SIDES:
        for joint, upper, lower in (("knee", "thigh", "shank"), ("elbow", "upper_arm", "forearm")):
            if not {f"{s}_{upper}", f"{s}_{lower}"} <= set(bones):
                lateral[f"{s}_{joint}"] = missing
                continue
            hinge = _hinge(recording, bones[f"{s}_{upper}"], bones[f"{s}_{lower}"], stands)
            lateral[f"{s}_{joint}"] = recording.rotation[:, bones[f"{s}_{upper}"]] @ hinge
            lateral[f"{s}_{joint}"] *= _left_sign(joint, s, joints, lateral[f"{s}_{joint}"])
    pelvis = recording.rotation[:, bones["pelvis"]] @ axes
    notes = replace(recording.notes, lacking=lacking)
    return Body(recording.name, recording.fps, joints, pelvis, lateral, notes=notes)


def level_pelvis(hips: Floats) -> Floats:
    """Return the pelvis's axes (T, 3, 3) if only the vectors (T, 3) from right to left hip are known."""
    return frame_from(np.broadcast_to([0.0, 0, 1], hips.shape), hips, exact="y")


def _plain(name: str) -> str:
    return BIPED.sub("", "".join(c for c in name.rsplit(":", 1)[-1].lower() if c.isalnum()))


def _known_as(names: list[str]) -> dict[str, int]:
    """Map each searched name to its bone (the first, if several), with the name as written."""
    known = {_plain(name): i for i, name in reversed(list(enumerate(names)))}
    for i, words in enumerate(_own_words([_words(name) for name in names])):
        stem = "".join(word for word in words if word not in SIDE_WORDS)
        sides = {SIDE_WORDS[word] for word in words if word in SIDE_WORDS}
        for side in sides if len(sides) == 1 else {""}:
            for before in {side, side[:1]}:
                known.setdefault(before + stem, i)
    return known


def _words(name: str) -> list[str]:
    """Split a name at punctuation, blanks and capitals: UpperLeg_L to upper, leg, l."""
    return [word.lower() for word in WORD.findall(name)]


def _own_words(names: list[list[str]]) -> list[list[str]]:
    """Remove words with which most names begin or end, such as the character's name."""
    for at in (0, -1):
        while True:
            first = [words[at] for words in names if len(words) > 1 and words[at] not in SIDE_WORDS]
            word, count = Counter(first).most_common(1)[0] if first else ("", 0)
            if count < MOST_AFFIXED_SHARE * len(names):
                break
            names = [
                words[1 + at : len(words) + at] if len(words) > 1 and words[at] == word else words
                for words in names
            ]
    return names


def _find_bones(recording: Recording) -> tuple[dict[str, int], tuple[str, ...]]:
    """Return the bone for each key of ALIASES that exists, and the keys of missing bones."""
    known = _known_as(recording.bones)
    found, lacking = dict[str, int](), list[str]()
    for role, names in ALIASES.items():
        for s, side in zip(SIDES, ("left", "right"), strict=True) if "{s}" in role else [("", "")]:
            wanted, part = [name.format(s=s, S=side) for name in names], role.format(s=s)
            index = next((known[name] for name in wanted if name in known), None)
            if index is not None:
                found[part] = index
            elif role in REQUIRED:
                raise UserError(f"{recording.source}: no bone for {part!r}; name it one of {wanted}")
            elif role != "{s}_hand":
                lacking.append(part)
    if "head" in found and "neck" not in found:
        found["neck"] = found["head"]
        lacking.remove("neck")
    return found, tuple(lacking)


def _joints(recording: Recording, bones: dict[str, int]) -> dict[str, Floats]:
    missing = np.full((len(recording.start), 3), np.nan)

    def start(part: str) -> Floats:
        return recording.start[:, bones[part]] if part in bones else missing

    def end(part: str) -> Floats:
        return recording.end[:, bones[part]] if part in bones else missing

    joints = {"neck": start("neck"), "head": end("head")}
    for s in SIDES:
        starts = {"shoulder": "upper_arm", "elbow": "forearm", "hip": "thigh", "knee": "shank"}
        for joint, bone in starts.items():
            joints[f"{s}_{joint}"] = start(f"{s}_{bone}")
        hand = f"{s}_hand"
        joints[f"{s}_wrist"] = start(hand) if hand in bones else end(f"{s}_forearm")
        joints[f"{s}_ankle"], joints[f"{s}_toe"] = start(f"{s}_foot"), end(f"{s}_foot")
    joints["pelvis"] = (joints["l_hip"] + joints["r_hip"]) / 2
    return joints


def _rest_stands(recording: Recording, bones: dict[str, int]) -> bool:
    """Whether the rest pose is upright: legs point down, and the head is above the hips."""
    start = recording.rest_start
    for s in SIDES:
        hip, knee, ankle = (start[bones[f"{s}_{part}"]] for part in ("thigh", "shank", "foot"))
        leg = np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee)
        if not hip[2] - ankle[2] > UPRIGHT * leg:
            return False
    return "neck" not in bones or bool(start[bones["neck"]][2] > max(hip[2], knee[2]))


def _rest_axes(
    recording: Recording, bones: dict[str, int], joints: dict[str, Floats]
) -> tuple[Floats, Floats]:
    """Return the pelvis's axes as columns, and the head's left, from an upright rest pose."""
    left, right = (recording.rest_start[bones[f"{s}_thigh"]] for s in SIDES)
    y = unit(np.array([left[0] - right[0], left[1] - right[1], 0.0]))
    return np.stack([np.cross(y, [0.0, 0, 1]), y, [0.0, 0, 1]], axis=-1), y


def _posed_axes(
    recording: Recording, bones: dict[str, int], joints: dict[str, Floats]
) -> tuple[Floats, Floats]:
    """Return `_rest_axes` without a rest pose: pelvis and head are level and face forward on average."""
    pelvis, head = (recording.rotation[:, bones.get(part, 0)] for part in ("pelvis", "head"))
    hips = joints["l_hip"] - joints["r_hip"]
    axes = frame_from(_mean_in(pelvis, np.broadcast_to([0.0, 0, 1], hips.shape)), _mean_in(pelvis, hips), "y")
    return axes, unit(_mean_in(head, pelvis @ axes[:, 1]))


def _mean_in(frames: Floats, vectors: Floats) -> Floats:
    """Return the mean of vectors (T, 3) in the axes of frames (T, 3, 3)."""
    return np.asarray(np.nanmean(np.einsum("tji,tj->ti", frames, vectors), axis=0))


def _hinge(recording: Recording, upper: int, lower: int, stands: bool) -> Floats:
    """Return the axis of a hinge in the rest pose: the file's own, or else the main axis of its rotations.

    Rotations are relative to the rest pose if that is upright, with straight limbs, otherwise to the mean.
    """
    name = recording.bones[lower]
    if name in recording.hinges:
        return recording.hinges[name]
    relative = np.swapaxes(recording.rotation[:, upper], -1, -2) @ recording.rotation[:, lower]
    relative = relative[np.isfinite(relative).all(axis=(1, 2))]
    if not stands:
        u, _, vt = np.linalg.svd(relative.mean(axis=0))
        relative = relative @ (u @ vt).T
    vectors = rotation_vectors(relative)
    _, axes = np.linalg.eigh(vectors.T @ vectors)
    return axes[:, -1]


def _left_sign(joint: str, s: str, joints: dict[str, Floats], axis: Floats) -> float:
    """Return the sign for which the axis points left: on average, knees bend back and elbows forward."""
    ends = ("hip", "knee", "ankle") if joint == "knee" else ("shoulder", "elbow", "wrist")
    a, b, c = (joints[f"{s}_{end}"] for end in ends)
    bends = np.einsum("ti,ti->t", np.cross(unit(b - a), unit(c - b)), axis)
    bend = bends[np.isfinite(bends)].sum()
    return float(np.copysign(1.0, bend if joint == "knee" else -bend))
