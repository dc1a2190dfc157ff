"""Reader of Biovision hierarchies (.bvh): any skeleton, y or z up, any of the usual units."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gait.errors import UserError, quoted
from gait.io.files import text_lines
from gait.learn.arrays import Floats
from gait.learn.mocap.recording import (
    DEGREES,
    FARTHEST_POSITION_M,
    Y_UP,
    ZERO_BONES,
    FileNotes,
    Recording,
    mask_zero_runs,
    require_frames,
    require_range,
    zero_run,
)
from gait.learn.rotations import from_angles

AXES = "XYZ"
#: Metres per unit: metre, inch, CMU's unit (inch / 0.45), centimetre, millimetre.  Files do not state their
#: unit; the one with which the body is nearest to an adult's height is used.
UNITS = (1.0, 0.0254, 0.0254 / 0.45, 0.01, 0.001)
NOMINAL_STATURE_M = 1.7


@dataclass
class Joint:
    """One joint; `end` is the offset of its End Site, if it has one."""

    name: str
    parent: int
    offset: Floats = field(default_factory=lambda: np.zeros(3))
    channels: list[str] = field(default_factory=list)
    end: Floats | None = None


class _Words:
    """The words of a file with their line numbers."""

    def __init__(self, path: Path, lines: list[str]) -> None:
        self.path, self.line = path, 0
        self.words: Iterator[tuple[int, str]] = (
            (i, w) for i, row in enumerate(lines, 1) for w in row.split()
        )

    def next(self, expected: str | None = None) -> str:
        self.line, word = next(self.words, (self.line, ""))
        if not word:
            raise UserError(f"{self.path}:{self.line}: the file ends too early; get it again")
        if expected and word.upper() != expected:
            raise UserError(
                f"{self.path}:{self.line}: {quoted(word)} instead of {expected}; restore the file"
            )
        return word

    def after(self, label: str) -> float:
        """Read the number after a label and ':', with or without blanks between."""
        text = self.next().upper()
        while not text.startswith(f"{label}:"):
            if not f"{label}:".startswith(text):
                raise UserError(
                    f"{self.path}:{self.line}: {quoted(text)} instead of {label.title()!r}; restore the file"
                )
            text += self.next().upper()
        return self.number(text.removeprefix(f"{label}:"))

    def number(self, word: str = "") -> float:
        word = word or self.next()
        try:
            value = float(word)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise UserError(f"{self.path}:{self.line}: {quoted(word)} instead of a number; restore the file")
        return value


def read(path: Path, fps: float | None = None, zeros_missing: bool = False) -> Recording:
    """Read a .bvh file; `fps` defaults to the value in the file.

    With `zeros_missing`, three or more exact zeros of a joint in a row are missing data.  UserError names
    file, line and remedy.
    """
    lines = text_lines(path)
    words = _Words(path, lines)
    joints = _hierarchy(words)
    values, stated = _motion(words, lines, sum(len(j.channels) for j in joints))
    return assemble(path, joints, values, fps or stated, zeros_missing)


def _hierarchy(words: _Words) -> list[Joint]:
    """Read the joints in file order, parents first."""
    words.next("HIERARCHY")
    words.next("ROOT")
    joints, stack, site = [Joint(words.next(), -1)], [-1], False
    words.next("{")
    stack.append(0)
    while len(stack) > 1:
        word = words.next().upper()
        if word == "OFFSET":
            offset = np.array([words.number() for _ in range(3)])
            if site:
                joints[stack[-1]].end = offset
            else:
                joints[stack[-1]].offset = offset
        elif word == "CHANNELS":
            joints[stack[-1]].channels = _channels(words)
        elif word == "JOINT":
            joints.append(Joint(words.next(), stack[-1]))
            words.next("{")
            stack.append(len(joints) - 1)
        elif word == "END":
            words.next("SITE")
            words.next("{")
            site = True
        elif word == "}":
            if not site:
                stack.pop()
            site = False
        else:
            raise UserError(
                f"{words.path}:{words.line}: {quoted(word)} does not belong in a hierarchy; restore the file"
            )
    return joints


def _channels(words: _Words) -> list[str]:
    """Read channel names such as Xposition, in file order."""
    names = [words.next() for _ in range(int(words.number()))]
    for name in names:
        if name[0].upper() not in AXES or name[1:].lower() not in ("position", "rotation"):
            raise UserError(f"{words.path}:{words.line}: unknown channel {quoted(name)}; restore the file")
    return [name[0].upper() + name[1:].lower() for name in names]


def _motion(words: _Words, lines: list[str], width: int) -> tuple[Floats, float]:
    """Read the channel values (T, width) and the frame rate."""
    words.next("MOTION")
    count, interval = int(words.after("FRAMES")), words.after("FRAMETIME")
    require_frames(words.path, count)
    if interval <= 0:
        raise UserError(f"{words.path}:{words.line}: the frame time is {interval} s; restore the file")
    rows = [(i, line.split()) for i, line in enumerate(lines[words.line :], words.line + 1) if line.strip()]
    if len(rows) < count or (len(rows) > count and len(rows[count][1]) == width):
        raise UserError(
            f"{words.path}: {len(rows)} rows for {count} frames; correct 'Frames:' to {len(rows)}"
        )
    values = np.empty((count, width))
    for row, (line, numbers) in zip(values, rows, strict=False):
        try:
            row[:] = np.array([float(n) for n in numbers])
        except ValueError:
            raise UserError(
                f"{words.path}:{line}: {len(numbers)} words instead of {width} numbers; cut the file there"
            ) from None
    return values, 1.0 / interval


def assemble(
    path: Path, joints: list[Joint], values: Floats, fps: float, zeros_missing: bool = False
) -> Recording:
    """Compute the forward kinematics of the file's own skeleton in metres, z up."""
    _require_ranges(path, joints, values, "rotation", DEGREES)
    rest = _rest(joints)
    start, end = np.empty((2, len(values), len(joints), 3))
    rotation = np.empty((len(values), len(joints), 3, 3))
    column, heirs, parts = 0, _ends(joints), {}
    for i, joint in enumerate(joints):
        own = values[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        parts[joint.name] = own
        place, turn = _split(joint, mask_zero_runs(own) if zeros_missing else own)
        parent = joint.parent
        rotation[:, i] = turn if parent < 0 else rotation[:, parent] @ turn
        start[:, i] = (
            place if parent < 0 else start[:, parent] + np.einsum("tij,tj->ti", rotation[:, parent], place)
        )
        end[:, i] = start[:, i] + rotation[:, i] @ heirs[i]
    turn_up, metres = _upright(start[:, _trunk(joints) :])
    _require_ranges(path, joints, metres * values, "position", FARTHEST_POSITION_M)
    return Recording(
        name=path.stem,
        source=path,
        fps=fps,
        bones=[joint.name for joint in joints],
        start=start @ turn_up.T * metres,
        end=end @ turn_up.T * metres,
        rotation=turn_up @ rotation @ turn_up.T,
        rest_start=rest[0] @ turn_up.T * metres,
        rest_end=rest[1] @ turn_up.T * metres,
        notes=FileNotes(zeros="" if zeros_missing else zero_run(parts, ZERO_BONES)),
    )


def _rest(joints: list[Joint]) -> Floats:
    """Return start and end (2, B, 3) of the bones at rest, relative to the root, in file units."""
    rest = np.zeros((2, len(joints), 3))
    for i, (joint, heir) in enumerate(zip(joints, _ends(joints), strict=True)):
        if joint.parent >= 0:
            rest[0, i] = rest[0, joint.parent] + joint.offset
        rest[1, i] = rest[0, i] + heir
    return rest


def _require_ranges(path: Path, joints: list[Joint], values: Floats, kind: str, limit: float) -> None:
    """Raise UserError for channels of a `kind`, "position" or "rotation", that no person reaches."""
    named = [(joint.name, channel) for joint in joints for channel in joint.channels]
    for k, (name, channel) in enumerate(named):
        if channel.endswith(kind):
            unit = "degrees" if kind == "rotation" else "metres"
            require_range(path, f"{name} {channel}", values[:, k : k + 1], limit, unit)


def _ends(joints: list[Joint]) -> Floats:
    """Return where the bone of each joint ends in its own axes: at its End Site or its first child."""
    ends = np.zeros((len(joints), 3))
    for i, joint in reversed(list(enumerate(joints))):
        if joint.end is not None:
            ends[i] = joint.end
        if joint.parent >= 0:
            ends[joint.parent] = joint.offset
    return ends


def _split(joint: Joint, values: Floats) -> tuple[Floats, Floats]:
    """Return position (T, 3) in the parent and rotation (T, 3, 3) of a joint from its channels."""
    place = np.broadcast_to(joint.offset, (len(values), 3)).copy()
    turns = []
    for k, name in enumerate(joint.channels):
        axis = AXES.index(name[0])
        if name.endswith("position"):
            place[:, axis] = values[:, k]
        else:
            turns.append((k, axis))
    angles = np.radians(values[:, [k for k, _ in turns]])
    return place, from_angles(angles, [axis for _, axis in turns])


def _upright(start: Floats) -> tuple[Floats, float]:
    """Find the rotation to z up and the metres per unit from where bones begin in the frames, (T, B, 3).

    Up is y or z, whichever the body is longer along; its length gives the unit.  The rest pose does not show
    this, as in some files all its bones are along one axis.
    """
    extents = np.ptp(start[np.isfinite(start).all(axis=(1, 2))], axis=1)
    posed = np.median(extents, axis=0) if len(extents) else np.ones(3)
    up = 1 if posed[1] >= posed[2] else 2
    return Y_UP if up == 1 else np.eye(3), _unit(float(posed[up]))


def _trunk(joints: list[Joint]) -> int:
    """Return the first joint that branches; those above it only move the body, which may be far away."""
    children = [sum(other.parent == i for other in joints) for i in range(len(joints))]
    return next((i for i, count in enumerate(children) if count > 1), 0)


def _unit(height: float) -> float:
    """Return metres per unit, for a body of this height."""
    return UNITS[int(np.argmin(np.abs(np.log(np.array(UNITS) * max(height, 1e-9) / NOMINAL_STATURE_M))))]
