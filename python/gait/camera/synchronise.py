"""Time offset between two films of a walk, from the person's motion in both, or as given.

The rays along which two cameras see a joint at the same time intersect: the second lies in the plane through
both cameras and the first ray (the epipolar constraint).  If the films are shifted in time, joints that move
across these planes are off them.  Errors of the detector and the camera files last, so the mismatch contains
both the distances of rays from the planes and the changes of these distances from each joint's average.

The detector's errors differ between views and repeat in each stride, so this offset is off by about half a
frame.  If the cameras stand still, silhouettes in the films improve it (`gait.camera.silhouette_offset`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints, neighbours

if TYPE_CHECKING:  # imports PyAV, not needed for files of keypoints
    from gait.io.video import Video

Array = NDArray[np.float64]

_OVERLAP_S = 1.0  # seconds; least time that both films must show at the offset found
_COMPARED_S = 0.5  # seconds; least time that both films must show at offsets compared with it
_SHARE = 0.3  # of the shorter film; least time, as `_COMPARED_S`
_VISIBLE = 1 / 3  # of this time; least part in which rays are known
_MOST_FRAMES = 300  # most frames compared
_LEAST_SINE = 0.05  # of the angle between a ray and the direction to the other camera
_OTHER_OFFSET_S = 0.2  # seconds; offsets further from the best count as others
_CLEAR_RATIO = 1.25  # least ratio of any other offset's mismatch to the best one's
_SAME_PLACE_M = 0.01  # metres between two cameras; from nearer by, their rays give no distance
_FINE = 10  # steps per frame of the final search
_AS_WELL = 1.15  # offsets with up to this times the best mismatch fit about as well
_TOGETHER_FRAMES = (
    1.5  # films began together if that is less than this from the best offset, and fits as well
)
_TOGETHER_S = 0.005  # seconds; films that began less apart began together


Id = TypeVar("Id", int, str)


@dataclass(frozen=True)
class Film(Generic[Id]):
    """A film, or a file of keypoints found in it.

    Attributes
    ----------
    path : str
    camera : Camera
    people : mapping of id to Keypoints
        The people seen in it.
    person : id
        The one who is tracked or lifted; of a further film, if the motion does not show who that is.
    video : Video, optional
        Its pictures, if its camera stands still.
    """

    path: str
    camera: Camera
    people: Mapping[Id, Keypoints]
    person: Id
    video: Video | None = None


@dataclass(frozen=True)
class Offset:
    """Time offset of a film.

    Attributes
    ----------
    seconds : float
        Time of its first frame after that of the other film.
    mismatch : float
        Angle between rays and epipolar planes, degrees.
    certain : bool
        Whether the films show enough at this offset and all others fit clearly worse.
    source : str
        What showed it: the person's ``motion``, or their ``silhouette``, then to some milliseconds.
    margin : float
        Of an offset by motion: how far away offsets fit about as well, seconds.
    """

    seconds: float
    mismatch: float
    certain: bool
    source: str = "motion"
    margin: float = 0.0


def require_apart(paths: Sequence[str], cameras: Sequence[Camera]) -> None:
    """Raise UserError, naming the films `paths`, if two of their cameras are at the same place."""
    for k, (path, camera) in enumerate(zip(paths, cameras, strict=True)):
        for before, other in zip(paths, cameras[:k], strict=False):
            if np.linalg.norm(camera.centre - other.centre) < _SAME_PLACE_M:
                raise UserError(
                    f"{path}: its camera is at the same place as that of {before}; give each film and camera "
                    "once"
                )


def synchronise(films: Sequence[Film[Id]], other: Film[Id], given: float | None) -> tuple[Id, Offset, str]:
    """Find the person of the first film in another film, and the film's offset, with words that describe it.

    Parameters
    ----------
    films : sequence of Film
        The first film, and others before this one.
    given : float, optional
        The offset, seconds, if it is known.

    Raises
    ------
    UserError
        If the motion does not show an offset that is not given.
    """
    first = films[0]
    person, offset = same_person(first, other, given)
    if given is None and not offset.certain:
        raise UserError(
            f"{other.path}: its time offset from {first.path} cannot be estimated from the person's motion, "
            f"which both must show for over {_OVERLAP_S:.0f} s; give --offsets, the seconds by which each "
            "further film began later, and check the cameras"
        )
    if given is None:
        offset = _improved(offset, first, other, person)
    return person, offset, _words(offset, given is not None)


def _improved(offset: Offset, first: Film[Id], other: Film[Id], person: Id) -> Offset:
    """Return the offset by the silhouettes if the films' pictures show it, otherwise `offset`."""
    if first.video is None or other.video is None:
        return offset
    from gait.camera.silhouette_offset import Filmed, silhouette_offset  # here, as it loads OpenCV

    ours, theirs = first.people[first.person], other.people[person]
    seconds = silhouette_offset(
        Filmed(first.video, first.camera, ours), Filmed(other.video, other.camera, theirs), offset.seconds
    )
    if seconds is None:
        return offset
    seconds = 0.0 if abs(seconds) < _TOGETHER_S else seconds
    joints = find_offset(ours, first.camera, theirs, other.camera, seconds)
    return replace(
        offset, seconds=seconds, mismatch=np.nan if joints is None else joints.mismatch, source="silhouette"
    )


def same_person(first: Film[Id], other: Film[Id], given: float | None) -> tuple[Id, Offset]:
    """Find the person of the first film in another film: the one whose rays fit best, and the offset."""
    found: dict[Id, Offset] = {}
    person = first.people.get(first.person)
    for id, keypoints in other.people.items():
        if person is None or min(len(person.time), len(keypoints.time)) < 2:
            continue
        one = find_offset(person, first.camera, keypoints, other.camera, given)
        if one is not None:
            found[id] = one
    if not found:
        return other.person, Offset(given or 0.0, np.nan, False)
    id = min(found, key=lambda id: (not found[id].certain, found[id].mismatch))
    return id, found[id]


def _words(offset: Offset, given: bool) -> str:
    when = "together with the first film"
    if offset.seconds != 0:
        when = f"{abs(offset.seconds):.3f} s {'after' if offset.seconds > 0 else 'before'} the first film"
    how = "as given" if given else f"estimated from the person's {offset.source}"
    how += f" to {offset.margin:.2f} s" if not given and offset.source == "motion" else ""
    fit = "" if np.isnan(offset.mismatch) else f" (joints fit to {offset.mismatch:.1f} deg)"
    return f"began {when}, {how}{fit}"


def no_shared_frame(path: str, first: str, began: float, last: float) -> UserError:
    """Describe a film without a frame while the first is shown, seconds; `last`: the end of the first."""
    when = f"{abs(began):.2f} s {'before' if began < 0 else 'after'} that"
    return UserError(
        f"{path}: no frame is at the time of one of {first}: it begins {when}, which takes {last:.2f} s; "
        "correct --offsets"
    )


def find_offset(
    first: Keypoints, first_camera: Camera, other: Keypoints, camera: Camera, given: float | None = None
) -> Offset | None:
    """Find the offset of a film.

    Parameters
    ----------
    first, other : Keypoints
        Keypoints of the same person in two films, pixels; at least two frames.
    first_camera, camera : Camera
        Their cameras, in the same world.
    given : float, optional
        The offset, seconds, if only its mismatch is wanted.

    Returns
    -------
    offset : Offset or None
        None if with no offset both films show the person for long enough.
    """
    names = [name for name in first.names if name in other.names]
    planes, times = _planes(first, names, first_camera, camera.centre - first_camera.centre)
    rays = _rays(other, names, camera)
    step = float(np.median(np.diff(first.time)))
    compared = max(_COMPARED_S, _SHARE * min(np.ptp(first.time), np.ptp(other.time)))
    fewest = int(_VISIBLE * compared / np.median(np.diff(times))) * len(names)

    def mismatch(offset: float) -> float:
        return _mismatch(planes, times, rays, other.time, offset, fewest)

    if given is not None:
        fit = mismatch(given)
        return Offset(given, fit, True) if np.isfinite(fit) else None
    low, high = times[0] - other.time[-1], times[-1] - other.time[0]
    offsets = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    shown = np.minimum(times[-1], other.time[-1] + offsets) - np.maximum(times[0], other.time[0] + offsets)
    offsets, shown = offsets[shown > compared - step], shown[shown > compared - step]
    coarse = np.array([mismatch(offset) for offset in offsets])
    known = np.flatnonzero(np.isfinite(coarse))
    if len(known) == 0:
        return None
    best = int(np.nanargmin(coarse))
    at = float(offsets[best])
    fine = at + step * np.arange(-_FINE, _FINE + 1) / _FINE
    near = np.array([mismatch(offset) for offset in fine])
    least = float(np.nanmin(near))
    away = np.abs(offsets - at)
    certain = not (coarse[away > _OTHER_OFFSET_S] < _CLEAR_RATIO * least).any()
    certain &= bool(shown[best] > _OVERLAP_S - 1.5 * step and known[0] < best < known[-1])
    # Interpolation averages noise, so offsets by whole frames are compared with each other.
    as_well = coarse < _AS_WELL * coarse[best]
    margin = max(step / 2, float(away[as_well & (away <= _OTHER_OFFSET_S)].max()))
    if abs(at) < _TOGETHER_FRAMES * step and as_well[np.abs(offsets).argmin()]:
        return Offset(0.0, mismatch(0.0), certain, margin=margin)
    return Offset(float(fine[np.nanargmin(near)]), least, certain, margin=margin)


def _planes(keypoints: Keypoints, names: list[str], camera: Camera, baseline: Array) -> tuple[Array, Array]:
    """Return unit normals (T, J, 3) of the planes through both cameras and each joint, and times (T,)."""
    every = slice(None, None, len(keypoints.time) // _MOST_FRAMES + 1)
    rays = _rays(keypoints, names, camera)[every]
    normals = np.cross(baseline / np.linalg.norm(baseline), rays)
    sine = np.linalg.norm(normals, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = np.where(sine > _LEAST_SINE, normals / sine, np.nan)
    return normals, keypoints.time[every]


def _rays(keypoints: Keypoints, names: list[str], camera: Camera) -> Array:
    """Return unit directions (T, J, 3) of joints in the world; NaN where they were not found."""
    columns = [keypoints.names.index(name) for name in names]
    visible = keypoints.visible[:, columns]
    rays = camera.rays(np.where(visible[..., None], keypoints.uv[:, columns], 0.0))
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return np.asarray(np.where(visible[..., None], rays, np.nan))


def _mismatch(
    planes: Array, times: Array, rays: Array, ray_times: Array, offset: float, fewest: int
) -> float:
    """Compute the mismatch of an offset, degrees; NaN if less than `fewest` rays can be compared."""
    after, share, known = neighbours(ray_times, times - offset)
    between = rays[after - 1] + share[:, None, None] * (rays[after] - rays[after - 1])
    sine = (planes * between).sum(axis=-1)[known]
    if np.isfinite(sine).sum() < max(fewest, 1):
        return np.nan
    sine = sine[:, np.isfinite(sine).any(axis=0)]
    parts = np.nanmedian(np.abs(sine)), np.nanmedian(np.abs(sine - np.nanmedian(sine, axis=0)))
    return float(np.degrees(np.arcsin(np.clip(parts, 0, 1))).sum())
