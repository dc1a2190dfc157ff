"""Detections of other tools: link the people of all frames over time, and choose one of them."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gait.errors import UserError
from gait.io.layouts import LAYOUTS, joint_named, points_of
from gait.progress import warning

Array = NDArray[np.float64]
_T = TypeVar("_T")
_U = TypeVar("_U")

_LONGEST_BREAK = 30  # frames; a person who is missing for longer counts as another one
_SHORT_BREAK = 5  # frames; people who are missing for longer may have changed places
_MOVED = 0.6  # largest movement of points between detections, as a fraction of the person's extent
_NAMED = 6  # most people that a note lists


@dataclass(frozen=True)
class Clip:
    """What a user can add to files of other tools: which person to use, and facts about the video."""

    person: str | None = None  #: id of the person to use; None: the one who is seen most comes first
    fps: float | None = None  #: frames per second
    times: Array | None = None  #: (n,) seconds of the video's frames
    size: tuple[int, int] | None = None  #: width and height of the picture, pixels
    quiet: bool = False  #: print no notes

    @property
    def given(self) -> bool:
        """Whether the user gave any of it as options."""
        return self.person is not None or self.fps is not None


class Detection(NamedTuple):
    """One person in one frame."""

    frame: int
    person: str | None
    """Id of the person; None if the tool does not follow people."""
    points: Array
    """(P, 3): u, v in pixels and a confidence, about 0 to 1; NaN where not seen."""


@dataclass(frozen=True)
class Detections:
    """Content of a file: people in frames, with P points each."""

    names: tuple[str, ...]  #: P names
    found: Sequence[Detection]
    own: bool = False  #: whether the user chose the names
    shares: bool = False  #: whether u and v are fractions of the picture's width and height
    fps: float | None = None  #: frames per second, if the file has them
    times: Mapping[int, float] = field(default_factory=dict)  #: seconds of frames, if the file has them


def names_of(where: str, count: int, given: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the names of `count` points: those in the file, or those of the layout with that many points.

    UserError if the file has none and no layout has that many points.
    """
    names = tuple(given) if len(given) == count else points_of(count)
    if not names:
        known = ", ".join(f"{n} ({name})" for n, (name, _) in LAYOUTS.items())
        raise UserError(f"{where}: has {count} points without names, an unknown layout; known: {known}")
    return names


@dataclass(frozen=True)
class Person:
    """Joints of the model of one person in T frames."""

    frame: NDArray[np.int64]  #: (T,) numbers
    time: Array  #: (T,) seconds
    uv: Array  #: (T, J, 2) pixels, NaN where not seen
    confidence: Array  #: (T, J) from 0 to 1


def read_people(
    path: str | os.PathLike[str], detected: Detections, clip: Clip
) -> tuple[dict[str, Person], tuple[str, ...], list[str]]:
    """Link the people, those with the largest frames times extent first, or only the one asked for.

    Also returns the names of the J joints, and those of points that are not joints of the model.
    UserError in one line that names the file.
    """
    joints = [joint_named(name, detected.own) for name in detected.names]
    used = [i for i, joint in enumerate(joints) if joint and joints.index(joint) == i]
    if not used:
        shown = " ".join(name for name in detected.names[:8] if name)
        raise UserError(
            f"{path}: none of its points is a joint of the model ({shown or 'they have no names'}); "
            "name them as l_knee, left_knee or LKnee"
        )
    people, anew = _people(detected.found)
    if anew:
        warning(
            f"{path}: people may have changed places before frame {', '.join(map(str, anew[:_NAMED]))}, "
            "after a gap; from there they count as others",
            clip.quiet,
        )
    if detected.shares and clip.size is None:
        raise UserError(
            f"{path}: has fractions of the picture's width and height; give --video or --camera for its size"
        )

    def person(chain: list[Detection]) -> Person:
        return _person(path, chain, used, detected, clip)

    found = usable(_ranked(path, people, clip), person)
    names = tuple(joints[i] for i in used)
    return found, names, [name for i, name in enumerate(detected.names) if name and i not in used]


def usable(people: Mapping[str, _T], convert: Callable[[_T], _U]) -> dict[str, _U]:
    """Convert people; leave out those after the first whose conversion raises UserError."""
    found: dict[str, _U] = {}
    for id, person in people.items():
        try:
            found[id] = convert(person)
        except UserError:
            if not found:
                raise
    return found


def _person(
    path: str | os.PathLike[str], chain: list[Detection], used: list[int], detected: Detections, clip: Clip
) -> Person:
    """Return the points with indices `used` of a person's detections."""
    frame = np.array([detection.frame for detection in chain], np.int64)
    points = np.stack([detection.points[used] for detection in chain])
    uv = points[..., :2].copy()
    confidence = np.clip(np.nan_to_num(points[..., 2]), 0.0, 1.0)
    unseen = (confidence <= 0) | (uv == 0).all(axis=2) | (uv == -1).all(axis=2) | ~np.isfinite(uv).all(axis=2)
    uv[unseen], confidence[unseen] = np.nan, 0.0
    if detected.shares:
        assert clip.size is not None
        uv = uv * clip.size - 0.5  # pixel centres at integers
    return Person(frame, _times(path, frame, detected, clip), uv, confidence)


def _people(found: Sequence[Detection]) -> tuple[dict[str, list[Detection]], list[int]]:
    """Group the detections by person; keys are ids, values in the order of frames.

    Also return the frames before which people may have changed places, so that new persons begin there.
    """
    ordered = sorted(found, key=lambda detection: detection.frame)
    ids = Counter((detection.frame, detection.person) for detection in ordered)
    people: dict[str, list[Detection]] = {}
    if all(person is not None for _, person in ids) and max(ids.values(), default=0) == 1:
        for detection in ordered:
            people.setdefault(str(detection.person), []).append(detection)
        return people, []
    anew: list[int] = []
    open_chains: list[list[Detection]] = []
    frames: dict[int, list[Detection]] = {}
    for detection in ordered:
        frames.setdefault(detection.frame, []).append(detection)
    for number, present in frames.items():
        open_chains = [chain for chain in open_chains if number - chain[-1].frame <= _LONGEST_BREAK]
        linked, contested = _linked(present, open_chains)
        anew += [number] * bool(contested)
        open_chains = [chain for chain in open_chains if not any(chain is one for one in contested)]
        for detection, chain in linked:
            if chain is None:
                people[str(len(people))] = chain = []
                open_chains.append(chain)
            chain.append(detection)
    return people, anew


def _linked(
    present: list[Detection], chains: list[list[Detection]]
) -> tuple[list[tuple[Detection, list[Detection] | None]], list[list[Detection]]]:
    """Pair each detection of a frame with the chain that it continues, nearest first; None: a new person.

    Chains without a long gap come first.  Also return the chains with one that two detections, or one of two
    such chains, may continue: they end.
    """
    pairs = sorted(
        (_is_missed(chain, detection.frame), moved, i, k)
        for i, detection in enumerate(present)
        for k, chain in enumerate(chains)
        if (moved := _moved(chain[-1].points, detection.points)) <= _MOVED
    )
    continued: dict[int, list[Detection]] = {}
    taken: set[int] = set()
    contested: set[int] = set()
    for missed, _, i, k in pairs:
        if i in continued or k in taken:
            continue
        left = [(n, m) for late, _, n, m in pairs if late and n not in continued and m not in taken]
        if missed and sum(n == i or m == k for n, m in left) > 1:
            contested |= {m for n, m in left if n == i or m == k}
            continue
        continued[i] = chains[k]
        taken.add(k)
    ended = [chains[k] for k in sorted(contested - taken)]
    return [(detection, continued.get(i)) for i, detection in enumerate(present)], ended


def _is_missed(chain: list[Detection], frame: int) -> bool:
    """Whether a person was missing for so long that others may have taken the place."""
    return frame - chain[-1].frame > _SHORT_BREAK + 1


def _moved(before: Array, after: Array) -> float:
    """Median movement of the points visible in both, over the person's extent; inf if there are none."""
    both = _visible(before) & _visible(after)
    if not both.any():
        return np.inf
    extent = max(float(np.ptp(points[_visible(points), :2], axis=0).max()) for points in (before, after))
    return float(np.median(np.linalg.norm(after[both, :2] - before[both, :2], axis=1))) / max(extent, 1e-9)


def _visible(points: Array) -> NDArray[np.bool_]:
    return np.isfinite(points).all(axis=1) & (points[:, 2] > 0)


def _ranked(
    path: str | os.PathLike[str], people: dict[str, list[Detection]], clip: Clip
) -> dict[str, list[Detection]]:
    """Return the people's visible detections, those with the largest frames times extent first.

    Only those of the person asked for, if any.
    """
    visible = {name: [d for d in chain if _visible(d.points).any()] for name, chain in people.items()}
    weight = {name: sum(_extent(d.points) for d in chain) for name, chain in visible.items() if chain}
    if not weight:
        raise UserError(f"{path}: no point of a person is visible in any frame")
    ranked = {name: visible[name] for name in sorted(weight, key=lambda name: -weight[name])}
    if clip.person is None:
        return ranked
    if clip.person not in ranked:
        counts = {name: len(chain) for name, chain in ranked.items()}
        raise UserError(f"{path}: has no person {clip.person}; --person is one of {listed(counts)}")
    return {clip.person: ranked[clip.person]}


def listed(people: Mapping[str, int]) -> str:
    """List people by id, with the number of frames in which each is seen."""
    words = ", ".join(f"{name} ({count} frames)" for name, count in list(people.items())[:_NAMED])
    return words + f" and {len(people) - _NAMED} more" * (len(people) > _NAMED)


def _extent(points: Array) -> float:
    """Height or width of a person, whichever is larger, in the unit of the points; at least 1e-9."""
    return max(float(np.ptp(points[_visible(points), :2], axis=0).max()), 1e-9)


def _times(path: str | os.PathLike[str], frame: NDArray[np.int64], detected: Detections, clip: Clip) -> Array:
    """Take the times of frames, seconds, from the video, from --fps, or from the file."""
    if clip.times is not None:
        if frame[0] < 0 or frame[-1] >= len(clip.times):
            raise UserError(
                f"{path}: has frames {frame[0]} to {frame[-1]}, the video 0 to {len(clip.times) - 1}; "
                "are they from this video?"
            )
        return np.asarray(clip.times, float)[frame]
    if clip.fps is None and detected.times:
        return np.array([detected.times[number] for number in frame.tolist()])
    fps = clip.fps or detected.fps
    if fps is None:
        raise UserError(
            f"{path}: has no times; give --fps HZ, or --video VIDEO in which the points were found"
        )
    return frame / fps
