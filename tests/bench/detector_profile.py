"""Learn the profile of each landmark network: where its joints lie beside the model's, and how they err.

Runs the networks on clips with known joints and writes python/gait/detect/profile.json.  Offsets are fitted
on all clips; errors are those of each clip by offsets fitted on the others, who are other people.

    python tests/bench/detector_profile.py CLIPS
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gait.detect.people import detect, main_person
from gait.detect.profile import FILE, picture_height, vectors
from gait.detect.weights import LANDMARKS
from gait.io.keypoints_file import read
from gait.io.video import Video

MOST = 0.08  # person's heights; larger errors are outliers
RIDGE = 2e-3  # pulls offsets to zero that the clips do not show
LAGS = 15  # frames over which errors may be correlated
QUIET = 0.05  # correlation that is none
SPREAD = 1.4826  # median absolute deviation to standard deviation


@dataclass
class Joint:
    """A joint in one clip, in person's heights: known less found (T, 2), and vectors (T, 2, 3)."""

    off: np.ndarray
    along: np.ndarray
    step: float


def clip_joints(folder: Path, network: str) -> dict[str, Joint]:
    """Compare the detector's joints in a clip with the known ones."""
    people = detect(Video(str(folder / "video.mp4")), network, correct=False)
    found = people[main_person(people)]
    known, _ = read(folder / "truth.csv", found.names, ignore_unknown=True)
    rows = np.searchsorted(known.frame, found.frame)
    height = np.median(picture_height(found))
    joints = {}
    for j, name in enumerate(found.names):
        off = known.uv[rows, known.names.index(name)] - found.uv[:, j]
        joints[name] = Joint(
            off / height, vectors(found, name) / height, float(np.median(np.diff(found.time)))
        )
    return joints


def fitted(joints: list[Joint]) -> np.ndarray:
    """Fit offsets by least squares, every walk of the same weight."""
    normal, right = RIDGE * np.eye(3), np.zeros(3)
    for joint in joints:
        good = (np.abs(joint.off) < MOST).all(axis=1) & np.isfinite(joint.along).all(axis=(1, 2))
        along, off = joint.along[good].reshape(-1, 3), joint.off[good].ravel()
        normal += along.T @ along / max(good.sum(), 1)
        right += along.T @ off / max(good.sum(), 1)
    return np.linalg.solve(normal, right)


def errors(joint: Joint, offset: np.ndarray) -> tuple[float, float, float]:
    """Measure the mean square of the lasting error; sd and correlation (seconds) of its change."""
    left = joint.off - joint.along @ offset
    left = left[np.isfinite(left).all(axis=1)]
    middle = np.median(left, axis=0)
    change = left - middle
    sd = float(SPREAD * np.median(np.abs(change)))
    change = np.clip(change, -5 * sd, 5 * sd)
    total = 1.0
    for lag in range(1, LAGS):
        share = np.sum(change[:-lag] * change[lag:]) / np.sum(change**2)
        if share < QUIET:
            break
        total += 2 * share
    return float(np.mean(middle**2)), sd, total * joint.step


def profile(folders: list[Path], network: str) -> dict[str, dict[str, object]]:
    """Profile of a network."""
    clips = [clip_joints(folder, network) for folder in folders]
    found: dict[str, dict[str, object]] = {}
    for name in sorted({name[2:] for name in clips[0]}):
        by_clip = [[clip[f"{side}_{name}"] for side in "lr"] for clip in clips]
        left = []
        for k, own in enumerate(by_clip):
            others = fitted([joint for i, pair in enumerate(by_clip) if i != k for joint in pair])
            left += [errors(joint, others) for joint in own]
        square, sd, correlation = np.array(left).T
        offset = fitted([joint for pair in by_clip for joint in pair])
        found[name] = {
            "offset": offset.round(3).tolist(),
            "bias": round(float(np.sqrt(square.mean())), 4),
            "sd": round(float(np.sqrt((sd**2).mean())), 4),
            "correlation_s": round(float(correlation.mean()), 3),
        }
        print(network, name, found[name], flush=True)
    return found


def main() -> None:
    """Learn and write."""
    folders = sorted(path.parent for path in Path(sys.argv[1]).glob("*/truth.csv"))
    if len(folders) < 2:
        sys.exit(f"{sys.argv[1]}: needs folders of two clips or more with video.mp4 and truth.csv")
    networks = {network: profile(folders, network) for network in LANDMARKS}
    source = f"{len(folders)} rendered walks of as many people ({', '.join(f.name for f in folders)})"
    text = json.dumps({"source": source, "command": "make detector-profile", "networks": networks}, indent=1)
    FILE.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
