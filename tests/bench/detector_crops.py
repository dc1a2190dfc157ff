#!/usr/bin/env python3
"""Crops for the landmark network: from its own last landmarks, or from the joints that the tracker predicts.

    detector_crops.py [CLIP...]

The detector runs on each development clip as it is, and with a box painted over the person for a second.  The
tracker has seen the whole clip with the detector's keypoints, and predicts each frame from its estimates of
the two frames before.  True joints in place of predicted ones show what a perfect tracker would gain.
"""

from __future__ import annotations

import contextlib
import io
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import eval_clips
import numpy as np
import numpy.typing as npt
import table
from facts import facts

from gait import Camera, Video, VideoWriter
from gait.cli import main as gait
from gait.detect import profile
from gait.detect.networks import LANDMARK_JOINTS, Crop, LandmarkNetwork, crop_about
from gait.detect.people import detect as detect_people
from gait.io.keypoints_file import Keypoints, read
from gait.io.track_file import Joints, read_track, read_truth

Floats = npt.NDArray[np.float64]
NETWORK = "lite"
#: Of the circle around the person in a crop, in lengths of head, trunk and legs: as the network's.
RADIUS = 0.56
LEAST_SCORE = 0.5  # of a person in a crop, as in gait.detect.people
RIGHT = 0.05  # error of the median joint that counts as right, in person's heights
HIDDEN_S = 1.0


def main() -> int:
    """Run the detector on every clip and publish; exit code 0 also if the data are absent."""
    if eval_clips.absent():
        return 0
    folder = eval_clips.DATA / "eval" / "dev"
    clips = eval_clips.chosen(folder.iterdir())
    rows = [row for clip in clips for row in _rows(clip)]
    head = ["clip", "crops", "found %", "median %", "95th percentile %", "found, hidden %", "back after s"]
    note = (
        f"{facts()}\n\n"
        f"Network {NETWORK}. Share of the frames in which the person is found, and distance of the joints "
        "found from the true ones in per cent of the person's height. The joints are moved by the detector's "
        "profile, which is learnt from other people. For a box painted over the person "
        f"for {HIDDEN_S:g} s: share of these frames in which a person is found, and seconds from their "
        f"end to the first frame whose median joint is within {100 * RIGHT:g} % of the height."
    )
    table.publish("detector_crops", "Crops of the detector", head, rows, note)
    return 0


def _rows(clip: Path) -> list[list[object]]:
    """Rows of a clip, one for each source of crops."""
    true, _ = read(clip / "truth.csv", tuple(LANDMARK_JOINTS), ignore_unknown=True)
    true = replace(
        true,
        uv=true.uv[:, [true.names.index(name) for name in LANDMARK_JOINTS]],
        names=tuple(LANDMARK_JOINTS),
    )
    height = profile.picture_height(true)
    video = Video(clip / "video.mp4")
    hidden = (video.count / 2 + 0.5 * HIDDEN_S * video.fps * np.array([-1, 1])).astype(int).tolist()
    with tempfile.TemporaryDirectory() as tmp:
        painted = _painted(video, true, hidden, Path(tmp) / "painted.mp4")
        plain = _searched(clip, video, true, Path(tmp))
        behind = _searched(clip, painted, true, Path(tmp))
    rows: list[list[object]] = []
    for source in plain:
        off = np.hypot(*(plain[source] - true.uv).T).T / height[:, None]
        found = np.isfinite(off).all(axis=1)
        later = np.hypot(*(behind[source] - true.uv).T).T / height[:, None]
        unseen = np.isfinite(later[slice(*hidden)]).all(axis=1)
        right = np.flatnonzero(np.median(later[hidden[1] :], axis=1) < RIGHT)
        back = float(right[0] / video.fps) if len(right) else None
        errors = 100 * np.percentile(off[found], (50, 95))
        rows.append([clip.name, source, 100 * found.mean(), *errors, 100 * unseen.mean(), back])
    return rows


def _painted(video: Video, true: Keypoints, hidden: list[int], out: Path) -> Video:
    """The video with a textured box over the person in the frames hidden[0] <= number < hidden[1]."""
    texture = np.random.default_rng(1).integers(0, 255, (video.height // 8, video.width // 8, 3), np.uint8)
    texture = cv2.resize(texture, video.size, interpolation=cv2.INTER_CUBIC)
    with VideoWriter(out, video.fps) as film:
        for frame in video.frames():
            if hidden[0] <= frame.number < hidden[1]:
                uv = true.uv[frame.number]
                margin = 0.15 * np.ptp(uv[:, 1])
                (x, y), (right, bottom) = uv.min(axis=0) - margin * np.array([1, 2]), uv.max(axis=0) + margin
                box = slice(max(int(y), 0), int(bottom)), slice(max(int(x), 0), int(right))
                frame.image[box] = texture[box]
            film.write(frame.image)
    return Video(out)


def _distance(uv: Floats, true: Floats) -> Floats:
    """Median distance (T,) of joints (T, J, 2) from the true ones, pixels; infinite where none are found."""
    return np.nan_to_num(np.median(np.hypot(*(uv - true).T), axis=0), nan=np.inf)


def _searched(clip: Path, video: Video, true: Keypoints, folder: Path) -> dict[str, Floats]:
    """Joints (T, J, 2) with each source of crops, pixels, moved to the model's; NaN where none are found."""
    landmarks = np.full((video.count, len(LANDMARK_JOINTS), 2), np.nan)
    for person in detect_people(video, NETWORK).values():  # the one nearest to the truth in each frame
        nearer = _distance(person.uv, true.uv[person.frame]) < _distance(
            landmarks[person.frame], true.uv[person.frame]
        )
        landmarks[person.frame[nearer]] = person.uv[nearer]
    track = folder / "track.csv"
    words = ["track", str(video.path), "--camera", str(clip / "camera.json"), "-o", str(track), "--quiet"]
    with contextlib.redirect_stdout(io.StringIO()):
        gait([*words, "--detector", NETWORK])
    camera, truth = Camera.read(str(clip / "camera.json"), video.size), read_truth(clip / "truth.csv")
    tracked = _from_joints(video, _predicted(camera, read_track(track)))
    return {"landmarks": landmarks, "tracker": tracked, "truth": _from_joints(video, _crops(camera, truth))}


def _crops(camera: Camera, joints: Joints) -> dict[int, Crop]:
    """Crop around the joints of each frame."""
    hips = (joints.places["l_hip"] + joints.places["r_hip"]) / 2
    ankles = (joints.places["l_ankle"] + joints.places["r_ankle"]) / 2
    size = sum(
        np.linalg.norm(a - b, axis=1)
        for a, b in (
            (joints.places["head_top"], joints.places["neck"]),
            (joints.places["neck"], hips),
            (hips, ankles),
        )
    )
    up = joints.places["neck"] - hips
    up *= (RADIUS * size / np.linalg.norm(up, axis=1))[:, None]
    centres, tops = camera.project(hips), camera.project(hips + up)
    pairs = zip(joints.frame.tolist(), centres, tops, strict=True)
    return {frame: crop_about(centre, top) for frame, centre, top in pairs}


def _predicted(camera: Camera, track: Joints) -> dict[int, Crop]:
    """Crop of each frame as predicted by the two estimates before it."""
    known = _crops(camera, track)
    predicted = {}
    for frame in known:
        if frame - 1 in known and frame - 2 in known:
            last, before = known[frame - 1], known[frame - 2]
            predicted[frame] = last._replace(centre=2 * last.centre - before.centre)
    return predicted


def _from_joints(video: Video, crops: dict[int, Crop]) -> Floats:
    """Joints (T, J, 2) that the network finds in crops, moved to the model's; NaN where it finds none."""
    network = LandmarkNetwork(NETWORK)
    uv, confidence = (
        np.full((video.count, len(LANDMARK_JOINTS), 2), np.nan),
        np.zeros((video.count, len(LANDMARK_JOINTS))),
    )
    for frame in video.frames():
        if frame.number in crops:
            person = network(frame.image, crops[frame.number])
            if person.score >= LEAST_SCORE:
                uv[frame.number], confidence[frame.number] = person.uv, person.confidence
    frames = np.arange(video.count)
    return profile.corrected(
        Keypoints(frames, frames / video.fps, tuple(LANDMARK_JOINTS), uv, confidence), NETWORK
    ).uv


if __name__ == "__main__":
    sys.exit(main())
