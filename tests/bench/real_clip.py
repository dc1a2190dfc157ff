"""A film of a real person with 2-D reference joints, and how well a track follows them."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from gait import Camera, Video
from gait.body.skeleton import EVAL15
from gait.io import keypoints_file
from gait.io.track_file import Track, read_true_phase, read_truth
from gait.motion.evaluate import root_errors
from gait.motion.footfalls import strikes_of
from gait.report.drawing import draw_bones

Points = dict[str, np.ndarray]

LEGS = ("l_knee", "r_knee", "l_ankle", "r_ankle")
HIPS = ("l_hip", "r_hip")
JOINTS = tuple(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist") for side in "lr") + HIPS + LEGS
KINDS = ("good", "swap", "legs", "off", "none")
"""Kinds of frames: all in place; left and right swapped; legs elsewhere; hips or legs far off; no row."""
#: Largest errors, person's heights, of legs that are good, and of hips and legs that are not far off.
_GOOD, _HIPS, _LEGS = 0.09, 0.15, 0.20
_EARS = 0.925  # height of the ears, person's heights
_STRIKES = Path(__file__).parent / "real_strikes.json"
_TILES, _TILE = 8, 300  # of a contact sheet; pixels


@dataclass(frozen=True)
class Clip:
    """Files of a film and what is known of the person.

    Attributes
    ----------
    folder, video : Path
    first, last : int
        Frames in which the person walks in full view.
    fps, stature : float
    stride_hz : float or None
        Counted in the pictures; of the strikes where only these were counted.  None if there is none.
    strikes : list of (float, float)
        Frame of a heel strike in the pictures, and its phase: 0 right, 0.5 left.
    reference : dict of int to Points
        Joints of a 2-D detector by frame, checked by a person, pixels.
    """

    folder: Path
    video: Path
    first: int
    last: int
    fps: float
    stature: float
    stride_hz: float | None
    strikes: list[tuple[float, float]]
    reference: dict[int, Points]


@dataclass(frozen=True)
class Score:
    """How well a track follows a clip.

    Attributes
    ----------
    share : dict of str to float
        Of the frames of each of KINDS.
    tracking, wrong : int
        Frames under status ``tracking``, and those of them that are not good.
    error : float
        Median error of the joints, person's heights.
    stride_error : float
        Of the stride rate, as a share.
    strike_error : float
        Median distance of a heel strike by the phase from the one counted, frames.
    """

    share: dict[str, float]
    tracking: int = 0
    wrong: int = 0
    error: float = np.nan
    stride_error: float = np.nan
    strike_error: float = np.nan


def read_clips(folder: Path, names: list[str] | None) -> list[Clip]:
    """Clips in a folder, one per subfolder with video.*, meta.json and reference2d.csv."""
    metas = sorted(folder.glob("*/meta.json"))
    return [_read(path) for path in metas if not names or path.parent.name in names]


def _read(path: Path) -> Clip:
    meta, folder = json.loads(path.read_text()), path.parent
    known = json.loads(_STRIKES.read_text()).get(folder.name, {"right": [], "left": []})
    strikes = [(frame, phase) for side, phase in (("right", 0.0), ("left", 0.5)) for frame in known[side]]
    return Clip(
        folder,
        next(video for video in sorted(folder.iterdir()) if video.stem == "video"),
        first=meta["window"][0],
        last=meta["window"][1],
        fps=meta["fps"],
        stature=meta["stature_m"],
        stride_hz=meta.get("stride_hz") or rate_of(strikes, meta["fps"]),
        strikes=strikes,
        reference=_read_reference(folder / "reference2d.csv"),
    )


def rate_of(strikes: list[tuple[float, float]], fps: float) -> float | None:
    """Strides per second from successive heel strikes, right and left in turn; None if there are too few."""
    frames = sorted(frame for frame, _ in strikes)
    return 0.5 * fps / float(np.polyfit(range(len(frames)), frames, 1)[0]) if len(frames) > 2 else None


def from_truth(folder: Path) -> Clip:
    """Describe a clip of `gait simulate`, or one like it, with the true joints as the reference.

    Frames with a joint outside the picture do not count.  A person who stands at times has no stride rate.
    """
    meta, truth = json.loads((folder / "meta.json").read_text()), read_truth(folder / "truth.csv")
    names = (*JOINTS, "l_heel", "r_heel", "head_top")
    true, _ = keypoints_file.read(folder / "truth.csv", names, ignore_unknown=True)
    inside = ((true.uv >= 0) & (true.uv < (meta["width"], meta["height"]))).all(axis=(1, 2))
    reference = {}
    for frame, uv in zip(true.frame[inside].tolist(), true.uv[inside], strict=True):
        points = dict(zip(true.names, uv, strict=True))
        heels = max(points["l_heel"][1], points["r_heel"][1])
        crown = points.pop("head_top")
        ear = np.array([crown[0], heels - _EARS * (heels - crown[1])])
        reference[frame] = points | {"l_ear": ear, "r_ear": ear}
    known = strikes_of(truth, folder / "meta.json")
    feet = ((known.right, 0.0), (known.left, 0.5))
    strikes = [(float(frame), phase) for frames, phase in feet for frame in frames]
    phase = read_true_phase(folder / "truth.csv")
    stands = phase is not None and np.isnan(phase).any()
    return Clip(
        folder,
        folder / "video.mp4",
        first=min(reference),
        last=max(reference),
        fps=meta["fps"],
        stature=meta.get("stature_m") or meta["limb_lengths_m"]["stature"],
        stride_hz=None if stands else rate_of(strikes, meta["fps"]),
        strikes=strikes,
        reference=reference,
    )


def _read_reference(path: Path) -> dict[int, Points]:
    found = {}
    for row in csv.DictReader(path.read_text().splitlines()):
        names = [key[:-2] for key in row if key.endswith("_u") and row[key]]
        if "l_hip" in names:
            found[int(row["frame"])] = {
                name: np.array([float(row[f"{name}_u"]), float(row[f"{name}_v"])]) for name in names
            }
    return found


def read_cameras(path: Path, reference: Camera) -> dict[int, Camera]:
    """Camera of each frame, from the file of ``gait track --cameras-out`` and the camera of the reference."""
    return {
        int(row["frame"]): replace(
            reference,
            fx=float(row["fx"]),
            fy=float(row["fy"]),
            R=np.array([float(row[f"r{i}{j}"]) for i in (1, 2, 3) for j in (1, 2, 3)]).reshape(3, 3),
            t=np.array([float(row[f"t{axis}"]) for axis in "xyz"]),
        )
        for row in csv.DictReader(path.read_text().splitlines())
    }


def score(clip: Clip, track: Track, cameras: Mapping[int, Camera]) -> Score:
    """Compare a track with the reference joints, in the frames of the clip that have them.

    `cameras` are those of the frames, by number.
    """
    at = {frame: i for i, frame in enumerate(track.frame.tolist())}
    frames = [frame for frame in range(clip.first, clip.last + 1) if frame in clip.reference]
    kinds, errors, tracking, wrong = Counter[str](), [], 0, 0
    for frame in frames:
        if frame not in at:
            kinds["none"] += 1
            continue
        kind, error = _verdict(project(track, at[frame], cameras[frame]), clip.reference[frame])
        kinds[kind] += 1
        errors.append(error)
        if track.status[at[frame]] == "tracking":
            tracking += 1
            wrong += kind != "good"
    share = {kind: kinds[kind] / len(frames) for kind in KINDS}
    error = float(np.median(errors)) if errors else np.nan
    return Score(share, tracking, wrong, error, *_timing(clip, track))


def _verdict(points: Points, reference: Points) -> tuple[str, float]:
    """Kind of a frame, of KINDS, and the median error of its joints, person's heights."""
    ears = np.mean([reference[ear][1] for ear in ("l_ear", "r_ear") if ear in reference])
    size = abs(max(reference[heel][1] for heel in ("l_heel", "r_heel") if heel in reference) - ears) / _EARS
    if any(joint not in points for joint in HIPS + LEGS):
        return "off", 9.0

    def off(joint: str, other: str) -> float:
        return float(np.linalg.norm(points[joint] - reference[other])) / size

    hips = np.linalg.norm(np.mean([points[joint] - reference[joint] for joint in HIPS], axis=0)) / size
    straight = float(np.mean([off(joint, joint) for joint in LEGS]))
    crossed = float(np.mean([off(joint, {"l": "r", "r": "l"}[joint[0]] + joint[1:]) for joint in LEGS]))
    error = float(
        np.median([off(joint, joint) for joint in JOINTS if joint in points and joint in reference])
    )
    if hips > _HIPS or min(straight, crossed) > _LEGS:
        return "off", error
    if straight < _GOOD:
        return "good", error
    return ("swap" if crossed < _GOOD and crossed < 0.7 * straight else "legs"), error


def _timing(clip: Clip, track: Track) -> tuple[float, float]:
    """Error of the stride rate, as a share, and of the heel strikes, frames; NaN without a reference."""
    followed = np.isin(track.status, ("tracking", "ambiguous"))
    used = followed & (track.frame >= clip.first) & (track.frame <= clip.last) & np.isfinite(track.phase)
    if used.sum() <= 15:
        return np.nan, np.nan
    frames, cycles = track.frame[used], np.unwrap(track.phase[used], period=1.0)
    stride_hz = clip.fps * abs(float(np.polyfit(frames, cycles, 1)[0]))  # the phase of backward walks falls
    late = [
        abs((np.interp(frame, frames, cycles) - phase + 0.5) % 1.0 - 0.5)
        for frame, phase in clip.strikes
        if frames[0] <= frame <= frames[-1]
    ]
    strike_error = float(np.median(late)) * clip.fps / stride_hz if late else np.nan
    return stride_hz / clip.stride_hz - 1 if clip.stride_hz else np.nan, strike_error


def errors_in_space(clip: Clip, track: Track, rows: np.ndarray) -> list[float]:
    """Root-aligned and absolute error of 15 true joints, mm: medians over `rows` of the track."""
    if not rows.any():
        return [np.nan, np.nan]
    return [float(np.median(values)) for values in errors_of_rows(clip, track, rows)]


def errors_of_rows(clip: Clip, track: Track, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Root-aligned and absolute error of 15 true joints, mm, of each of `rows` of the track."""
    truth = read_truth(clip.folder / "truth.csv")
    found, true = (
        np.stack([joints.places[name][at] for name in EVAL15], axis=1)
        for joints, at in ((track, rows), (truth, np.searchsorted(truth.frame, track.frame[rows])))
    )
    return root_errors(found, true), 1000 * np.linalg.norm(found - true, axis=2).mean(axis=1)


def project(track: Track, row: int, camera: Camera) -> Points:
    """Joints in the picture by name; joints behind the camera are left out."""
    names = [name for name in track.places if np.isfinite(track.places[name][row]).all()]
    uv = camera.project(np.array([track.places[name][row] for name in names]))
    return {name: at for name, at in zip(names, uv, strict=True) if np.isfinite(at).all()}


def contact_sheet(clip: Clip, track: Track, cameras: Mapping[int, Camera], out: Path) -> None:
    """Write a picture of frames over the whole clip: the track's bones, and the reference joints as dots."""
    at = {frame: i for i, frame in enumerate(track.frame.tolist())}
    chosen = set(np.linspace(clip.first, clip.last, _TILES).round().astype(int).tolist())
    tiles = []
    for frame in Video(clip.video).frames(min(chosen), max(chosen) + 1):
        if frame.number not in chosen:
            continue
        canvas, points = frame.image.copy(), clip.reference.get(frame.number, {})
        status = "no row"
        if frame.number in at:
            draw_bones(canvas, project(track, at[frame.number], cameras[frame.number]), 2)
            status = track.status[at[frame.number]]
        for place in points.values():
            cv2.circle(canvas, (round(place[0]), round(place[1])), 3, (255, 60, 255), -1)
        tile = cv2.resize(_crop(canvas, points), (_TILE, _TILE))
        cv2.putText(
            tile, f"{frame.number} {status}", (5, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 2
        )
        tiles.append(tile)
    out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(out), np.vstack([np.hstack(tiles[i : i + 4]) for i in range(0, len(tiles) - 3, 4)]))


def _crop(image: np.ndarray, points: Points) -> np.ndarray:
    """Square around the reference joints, 1.5 times their extent."""
    if not points:
        return image
    places = np.array(list(points.values()))
    middle, half = (places.min(axis=0) + places.max(axis=0)) / 2, 0.75 * float(np.ptp(places, axis=0).max())
    height, width = image.shape[:2]
    x0, y0 = (max(0, round(float(edge - half))) for edge in middle)
    x1, y1 = min(width, round(float(middle[0] + half))), min(height, round(float(middle[1] + half)))
    return image[y0:y1, x0:x1]
