"""Reader of Acclaim skeletons and motions (.asf with .amc), the format of the CMU database."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
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

INCH = 0.0254
CMU_FPS = 120.0  # of the CMU database, whose files do not state it
AXES = "xyz"
DOF = {"rx", "ry", "rz", "tx", "ty", "tz", "l"}


@dataclass
class Bone:
    """One bone of the skeleton file; vectors in the file's axes."""

    name: str
    direction: Floats = field(default_factory=lambda: np.zeros(3))
    length: float = np.nan  # 0 for the root
    axis: Floats = field(default_factory=lambda: np.eye(3))
    dof: list[str] = field(default_factory=list)
    parent: int = -1


@dataclass
class Skeleton:
    """Bones, parents before children; bone 0 is the root."""

    bones: list[Bone]
    metres: float
    degrees: bool


def read(path: Path, fps: float | None = None, zeros_missing: bool = False) -> Recording:
    """Read an .amc with the .asf in its folder; of several, the one named like the part before '_'.

    `fps` defaults to the value in the file, else 120.  With `zeros_missing`, three or more exact zeros of a
    bone in a row are missing data.  UserError names file, line and remedy.
    """
    skeleton = read_skeleton(find_skeleton(path))
    values, zeros = read_motion(path, skeleton), ""
    if zeros_missing:
        values = {name: mask_zero_runs(columns) for name, columns in values.items()}
    else:
        zeros = zero_run(values, ZERO_BONES)
    degrees, stated = _declared(path)
    skeleton.degrees = skeleton.degrees if degrees is None else degrees
    _require_ranges(path, skeleton, values)
    return replace(assemble(path, skeleton, values, fps or stated or CMU_FPS), notes=FileNotes(zeros=zeros))


def _require_ranges(path: Path, skeleton: Skeleton, values: dict[str, Floats]) -> None:
    """Raise UserError for positions and angles that no person reaches."""
    turn, unit = (1.0, "degrees") if skeleton.degrees else (np.degrees(1.0), "degrees (radians in the file)")
    for bone in skeleton.bones:
        for k, name in enumerate(bone.dof if bone.name in values else []):
            column, what = values[bone.name][:, k : k + 1], f"{bone.name} {name}"
            if name[0] == "r":
                require_range(path, what, turn * column, DEGREES, unit)
            else:
                require_range(path, what, skeleton.metres * column, FARTHEST_POSITION_M, "metres")


def find_skeleton(path: Path) -> Path:
    """Find the .asf that belongs to an .amc."""
    candidates = sorted(p for p in path.parent.iterdir() if p.suffix.lower() == ".asf")
    for candidate in candidates:
        if candidate.stem in (path.stem, path.stem.rsplit("_", 1)[0]):
            return candidate
    if len(candidates) == 1:
        return candidates[0]
    raise UserError(
        f"{path}: no skeleton {path.stem.rsplit('_', 1)[0]}.asf beside it; put the .asf in that folder"
    )


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield numbered lines split into words, without comments and empty lines."""
    numbered = ((i, line.split("#")[0].split()) for i, line in enumerate(text_lines(path), 1))
    return ((i, words) for i, words in numbered if words)


def _numbers(words: list[str], path: Path, line: int, count: int | None = None) -> Floats:
    """Convert words to finite numbers and check how many there are."""
    try:
        values = np.array([float(w) for w in words])
    except ValueError:
        raise UserError(
            f"{path}:{line}: {quoted(' '.join(words))} is not a list of numbers; restore the file"
        ) from None
    if (count is not None and len(values) != count) or not np.isfinite(values).all():
        raise UserError(
            f"{path}:{line}: {len(values)} numbers, expected {count} finite ones; restore the file"
        )
    return values


def read_skeleton(path: Path) -> Skeleton:
    """Read an .asf file; UserError names line and remedy."""
    sections: dict[str, list[tuple[int, list[str]]]] = {}
    here: list[tuple[int, list[str]]] = []
    for line, words in _lines(path):
        if words[0].startswith(":"):
            here = sections.setdefault(words[0].lower(), [])
            words = words[1:]
        if words:
            here.append((line, words))
    for name in (":units", ":root", ":bonedata", ":hierarchy"):
        if name not in sections:
            raise UserError(f"{path}: section {name} is missing; the .asf is incomplete, get it again")
    units = {words[0].lower(): (line, words[1:]) for line, words in sections[":units"]}
    degrees = _degrees(path, *units.get("angle", (0, ["deg"])))
    length = units.get("length", (0, ["1"]))
    scale = float(_numbers(length[1][:1], path, length[0], 1)[0])
    if scale <= 0:
        raise UserError(f"{path}:{length[0]}: the unit of length is {scale:g}; correct it")
    bones = [_root(sections[":root"], path, degrees)] + _bones(sections[":bonedata"], path, degrees)
    return Skeleton(_linked(bones, sections[":hierarchy"], path), INCH / scale, degrees)


def _degrees(path: Path, line: int, words: list[str]) -> bool:
    """Whether the unit of angles is degrees rather than radians."""
    unit = words[0].lower() if words else ""
    if not unit.startswith(("deg", "rad")):
        raise UserError(f"{path}:{line}: unknown angle unit {quoted(unit)}; write 'angle deg' or 'angle rad'")
    return unit.startswith("deg")


def _declared(path: Path) -> tuple[bool | None, float | None]:
    """Read from the header of an .amc whether angles are degrees, and the frame rate; None if not stated."""
    degrees, rate = None, None
    for line, words in _lines(path):
        if not words[0].startswith(":"):
            break
        key = words[0][1:].lower()
        if key in ("degrees", "radians"):
            degrees = key == "degrees"
        elif key == "samples-per-second":
            rate = float(_numbers(words[1:2], path, line, 1)[0])
            if rate <= 0:
                raise UserError(f"{path}:{line}: {rate:g} frames per second; correct it")
    return degrees, rate


def _turn(words: list[str], path: Path, line: int, degrees: bool) -> Floats:
    """Return the constant rotation of an `axis` line: three angles and their order."""
    angles = _numbers(words[:3], path, line, 3)
    named = (words[3] if len(words) > 3 else "XYZ").lower()
    if sorted(named) != list(AXES):
        raise UserError(f"{path}:{line}: {quoted(named)} is not an order of X, Y and Z; restore the file")
    order = [AXES.index(c) for c in named]
    angles = np.radians(angles) if degrees else angles
    return from_angles(angles[::-1], order[::-1])


def _root(lines: list[tuple[int, list[str]]], path: Path, degrees: bool) -> Bone:
    bone = Bone("root", length=0.0)
    for line, words in lines:
        key = words[0].lower()
        if key == "order":
            bone.dof = [w.lower() for w in words[1:]]
        elif key == "orientation":
            bone.axis = _turn(words[1:], path, line, degrees)
    if sorted(bone.dof) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
        raise UserError(
            f"{path}: the root's order is {quoted(' '.join(bone.dof))}; it must name TX TY TZ RX RY RZ"
        )
    return bone


def _bones(lines: list[tuple[int, list[str]]], path: Path, degrees: bool) -> list[Bone]:
    bones: list[Bone] = []
    for line, words in lines:
        key = words[0].lower()
        if key == "begin":
            bones.append(Bone(""))
        elif not bones:
            raise UserError(f"{path}:{line}: {quoted(key)} outside begin ... end; restore the file")
        elif key == "name" and len(words) > 1:
            bones[-1].name = words[1]
        elif key == "direction":
            bones[-1].direction = _numbers(words[1:4], path, line, 3)
        elif key == "length":
            bones[-1].length = float(_numbers(words[1:2], path, line, 1)[0])
        elif key == "axis":
            bones[-1].axis = _turn(words[1:], path, line, degrees)
        elif key == "dof":
            bones[-1].dof = [w.lower() for w in words[1:]]
            if len(set(bones[-1].dof) & DOF) != len(words) - 1:
                what = quoted(" ".join(words[1:]))
                raise UserError(f"{path}:{line}: {what} are not degrees of freedom; restore the file")
    for bone in bones:
        if not np.isfinite(bone.length):
            raise UserError(f"{path}: bone {quoted(bone.name)} has no length; restore the file")
    return bones


def _linked(bones: list[Bone], lines: list[tuple[int, list[str]]], path: Path) -> list[Bone]:
    """Set the parents and sort the bones, parents first."""
    known = {bone.name: bone for bone in bones}
    order = ["root"]
    for line, words in lines:
        if words[0].lower() in ("begin", "end"):
            continue
        for word in words:
            if word not in known:
                raise UserError(f"{path}:{line}: bone {quoted(word)} is not in :bonedata; restore the file")
        if words[0] not in order:
            raise UserError(
                f"{path}:{line}: {quoted(words[0])} has children before it has a parent; sort :hierarchy"
            )
        for word in words[1:]:
            if word in order:
                raise UserError(f"{path}:{line}: {quoted(word)} has two parents; restore the file")
            known[word].parent = order.index(words[0])
            order.append(word)
    return [known[name] for name in order]


def read_motion(path: Path, skeleton: Skeleton) -> dict[str, Floats]:
    """Read an .amc file: bone name to (T, dof) in the units of the file; fixed bones have no entry."""
    moving = {bone.name: bone for bone in skeleton.bones if bone.dof}
    values = _regular(path, moving) or _by_lines(path, moving)
    require_frames(path, len(values.get("root", ())))
    return values


def _regular(path: Path, moving: dict[str, Bone]) -> dict[str, Floats] | None:
    """Read all lines at once if every frame has the layout of the first; otherwise return None."""
    lines = text_lines(path)
    begins = (i for i, line in enumerate(lines) if line.strip().isdigit())
    first = next(begins, len(lines))
    frame = [line.split() for line in lines[first : next(begins, len(lines))]]
    words, width = " ".join(lines[first:]).split(), sum(map(len, frame))
    numbers, columns = words[::width] if width else [], dict[str, list[list[str]]]()
    place = 1
    for name, *values in filter(None, frame[1:]):
        expected = len(moving[name].dof) if name in moving and name not in columns else -1
        if len(values) != expected or words[place::width] != [name] * len(numbers):
            return None
        columns[name] = [words[k::width] for k in range(place + 1, place + 1 + len(values))]
        place += 1 + len(values)
    if "root" not in columns or len(words) % width or not all(map(str.isdigit, numbers)):
        return None
    try:
        result = {b: np.array(columns[b], dtype=float).T.copy() for b in moving if b in columns}
    except ValueError:
        return None
    counted = np.array_equal(np.diff(np.array(numbers, dtype=float)), np.ones(len(numbers) - 1))
    return result if counted and all(np.isfinite(v).all() for v in result.values()) else None


def _by_lines(path: Path, moving: dict[str, Bone]) -> dict[str, Floats]:
    """Read a motion of any layout line by line; errors name the line."""
    rows: dict[str, list[Floats]] = {name: [] for name in moving}
    frame, first, line = 0, 0, 0
    for line, words in _lines(path):
        if words[0].startswith(":"):
            continue
        if len(words) == 1 and words[0].isdigit():
            _check_frame(rows, frame, path, line)
            number, first = int(words[0]), first or int(words[0])
            if number != first + frame:
                raise UserError(
                    f"{path}:{line}: frame {number} follows {first + frame - 1}; restore the file"
                )
            frame += 1
        elif words[0] not in moving:
            raise UserError(
                f"{path}:{line}: bone {quoted(words[0])} does not move in the .asf; "
                "use the .asf of this subject, or restore the file"
            )
        elif len(rows[words[0]]) != frame - 1:
            raise UserError(
                f"{path}:{line}: bone {words[0]!r} is out of place in frame {frame}; restore the file"
            )
        else:
            rows[words[0]].append(_numbers(words[1:], path, line, len(moving[words[0]].dof)))
    _check_frame(rows, frame, path, line)
    return {name: np.array(values) for name, values in rows.items() if values}


def _check_frame(rows: dict[str, list[Floats]], frame: int, path: Path, line: int) -> None:
    """Raise UserError unless the root and every bone of frame 1 are in every frame."""
    lacking = [name for name, values in rows.items() if len(values) != frame and (values or name == "root")]
    if lacking:
        raise UserError(
            f"{path}:{line}: frame {frame} has no bone {lacking[0]!r}; cut the file before that frame"
        )


def assemble(path: Path, skeleton: Skeleton, values: dict[str, Floats], fps: float) -> Recording:
    """Compute the forward kinematics of the file's own skeleton in metres, z up."""
    bones, frames = skeleton.bones, len(values["root"])
    start, end = np.empty((2, frames, len(bones), 3))
    rotation = np.empty((frames, len(bones), 3, 3))
    rest = np.zeros((2, len(bones), 3))
    for i, bone in enumerate(bones):
        turn = _motion(bone, values.get(bone.name), skeleton.degrees, frames)
        offset = bone.direction * bone.length * skeleton.metres
        if bone.parent < 0:
            rotation[:, i] = turn
            place = [bone.dof.index(f"t{c}") for c in AXES]
            start[:, i] = end[:, i] = values["root"][:, place] * skeleton.metres
            continue
        rotation[:, i] = rotation[:, bone.parent] @ turn
        start[:, i] = end[:, bone.parent]
        end[:, i] = start[:, i] + rotation[:, i] @ offset
        rest[0, i], rest[1, i] = rest[1, bone.parent], rest[1, bone.parent] + offset
    hinges = {b.name: Y_UP @ b.axis[:, AXES.index(b.dof[0][1])] for b in bones if len(b.dof) == 1}
    return Recording(
        name=path.stem,
        source=path,
        fps=fps,
        bones=[bone.name for bone in bones],
        start=start @ Y_UP.T,
        end=end @ Y_UP.T,
        rotation=Y_UP @ rotation @ Y_UP.T,
        rest_start=rest[0] @ Y_UP.T,
        rest_end=rest[1] @ Y_UP.T,
        hinges=hinges,
    )


def _motion(bone: Bone, values: Floats | None, degrees: bool, frames: int) -> Floats:
    """Return the rotation of a bone relative to its parent and the rest pose: C M C^-1 (root: M C)."""
    if values is None:
        return np.broadcast_to(np.eye(3), (frames, 3, 3))
    columns = [k for k, name in enumerate(bone.dof) if name[0] == "r"]
    angles = np.radians(values[:, columns]) if degrees else values[:, columns]
    order = [AXES.index(bone.dof[k][1]) for k in columns]
    turn = from_angles(angles[:, ::-1], order[::-1])
    return turn @ bone.axis if bone.parent < 0 else bone.axis @ turn @ bone.axis.T
