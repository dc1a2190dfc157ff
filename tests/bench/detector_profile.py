"""Learn the profile of each landmark network: the offsets of its joints from the model's, and their errors.

Runs the networks on clips with known joints and writes python/gait/detect/profile.json.  Offsets are fitted
to all clips.  Errors are cross-validated: each clip is judged with offsets fitted to the others, which show
other people.  Without CLIPS, walks of `detector_clips` are made in build/detector-profile first, each with
the gait of another recorded person, none of them from the development clips.

    python tests/bench/detector_profile.py [CLIPS]
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gait.detect.people import detect, main_person
from gait.detect.profile import FILE, picture_height, vectors
from gait.detect.weights import LANDMARK_NETWORKS
from gait.io.keypoints_file import read
from gait.io.video import Video
from gait.progress import progress

CLIPS = Path("build/detector-profile")
MOST = 0.08  # person's heights; larger errors are outliers: swapped sides, another object
RIDGE = 2e-3  # shrinks offsets to zero that the clips do not show
LAGS = 15  # frames over which errors may be correlated
QUIET = 0.05  # a smaller correlation counts as none
SPREAD = 1.4826  # standard deviation over median absolute deviation of a normal distribution
#: The lasting sd is the HELD quantile of the errors over that of a normal distribution; a few are far larger.
HELD, NORMAL = 0.9, 1.645
WINDOW = 0.8  # seconds over which changing errors nearly average out; these are measured in two windows
DURATIONS = np.geomspace(
    0.5, 10.0, 60
)  # longest duration of an error in seconds; clips do not show longer ones


@dataclass
class Joint:
    """A joint in one clip, in person's heights: known minus found (T, 2), and vectors (T, 2, 3).

    `step` and `stride` are in seconds.
    """

    off: np.ndarray
    along: np.ndarray
    step: float
    stride: float

    @property
    def good(self) -> np.ndarray:
        """Frames (T,) without outliers; none if most are outliers."""
        good = (np.abs(self.off) < MOST).all(axis=1) & np.isfinite(self.along).all(axis=(1, 2))
        return good & (good.mean() > 0.5)


@dataclass
class Errors:
    """What remains of a joint's error in one clip after the offsets, in person's heights.

    Attributes
    ----------
    mean : (2,)
        Error in the whole clip.
    sd, correlation_s : float
        Standard deviation of the changing error, and the seconds that count as one observation of it.
    seconds : float
        Length of the clip.
    windows : (W, 2)
        Mean errors in intervals of `WINDOW`; NaN where the joint is not known.
    variance : float
        Of the changing error, without outliers.
    repeated : (N, 2)
        Products of the changing error with that one stride later.
    """

    mean: np.ndarray
    sd: float
    correlation_s: float
    seconds: float
    windows: np.ndarray
    variance: float
    repeated: np.ndarray

    def noise(self, seconds: float) -> float:
        """Variance that the changing error adds to the mean over an interval."""
        return self.sd**2 * min(self.correlation_s / seconds, 1.0)


def clip_joints(folder: Path, network: str) -> dict[str, Joint]:
    """Compare the detector's joints in a clip with the known ones."""
    people = detect(Video(str(folder / "video.mp4")), network, correct=False)
    found = people[main_person(people)]
    known, _ = read(folder / "truth.csv", found.names, ignore_unknown=True)
    rows = np.searchsorted(known.frame, found.frame)
    height = np.median(picture_height(found))
    step = float(np.median(np.diff(found.time)))
    stride = json.loads((folder / "meta.json").read_text(encoding="utf-8"))["stride_period_s"]
    joints = {}
    for j, name in enumerate(found.names):
        off = known.uv[rows, known.names.index(name)] - found.uv[:, j]
        joints[name] = Joint(off / height, vectors(found, name) / height, step, stride)
    return joints


def fitted(joints: list[Joint]) -> np.ndarray:
    """Fit offsets by least squares, with equal weight for every walk."""
    normal, right = RIDGE * np.eye(3), np.zeros(3)
    for joint in joints:
        along, off = (
            joint.along[joint.good].reshape(-1, 3),
            joint.off[joint.good].ravel(),
        )
        normal += along.T @ along / max(joint.good.sum(), 1)
        right += along.T @ off / max(joint.good.sum(), 1)
    return np.linalg.solve(normal, right)


def errors(joint: Joint, offset: np.ndarray) -> Errors | None:
    """Measure what remains after the offsets; None if most frames are outliers."""
    good = joint.good
    if not good.any():
        return None
    whole = np.where(good[:, None], joint.off - joint.along @ offset, np.nan)
    parts = np.array_split(whole, max(int(len(whole) * joint.step / (2 * WINDOW)), 1))
    moved = np.concatenate([part - np.nanmedian(part, axis=0) for part in parts if len(part)])
    change = moved[good]
    sd = float(SPREAD * np.median(np.abs(change)))
    change = np.clip(change, -5 * sd, 5 * sd)
    total = 1.0
    for lag in range(1, LAGS):
        share = np.sum(change[:-lag] * change[lag:]) / np.sum(change**2)
        if share < QUIET:
            break
        total += 2 * share
    later = round(joint.stride / joint.step)
    repeated = np.clip(moved[:-later], -5 * sd, 5 * sd) * np.clip(moved[later:], -5 * sd, 5 * sd)
    frames = round(WINDOW / joint.step)
    parts = whole[: len(whole) // frames * frames].reshape(-1, frames, 2)
    known = np.isfinite(parts).all(axis=2).mean(axis=1) > 0.5
    parts = np.where(known[:, None, None], parts, 0.0)
    windows = np.where(known[:, None], np.nanmean(parts, axis=1), np.nan)
    mean, seconds = whole[good].mean(axis=0), len(good) * joint.step
    repeated = repeated[np.isfinite(repeated).all(axis=1)]
    return Errors(
        mean,
        sd,
        total * joint.step,
        seconds,
        windows,
        float(np.mean(change**2)),
        repeated,
    )


def duration(measured: list[Errors]) -> float:
    """Seconds in which the autocorrelation of lasting errors falls to 1/e, from the means of windows."""
    square = np.concatenate([(e.windows**2 - e.noise(WINDOW)).ravel() for e in measured])
    longest = max(len(e.windows) for e in measured)
    lags, shares, counts = [], [], []
    for lag in range(1, longest):
        both = np.concatenate([(e.windows[:-lag] * e.windows[lag:]).ravel() for e in measured])
        if count := int(np.isfinite(both).sum()):
            lags.append(lag * WINDOW)
            shares.append(np.nanmean(both) / np.nanmean(square))
            counts.append(count)
    miss = np.exp(-np.array(lags) / DURATIONS[:, None]) - shares
    return float(DURATIONS[np.argmin(miss**2 @ np.array(counts, float))])


def again(measured: list[Errors]) -> float:
    """Share of the variance of changing errors that recurs in every stride."""
    products = np.concatenate([e.repeated for e in measured])
    squares = np.concatenate([np.full(e.repeated.shape, e.variance) for e in measured])
    return float(np.clip(products.mean() / squares.mean(), 0.0, 1.0)) if products.size else 0.0


def learn(clips: list[dict[str, Joint]]) -> dict[str, object]:
    """Profile of a network from the joints of its clips."""
    found: dict[str, dict[str, object]] = {}
    every = []
    for name in sorted({name[2:] for name in clips[0]}):
        by_clip = [[clip[f"{side}_{name}"] for side in "lr"] for clip in clips]
        measured = []
        for k, own in enumerate(by_clip):
            others = fitted([joint for i, pair in enumerate(by_clip) if i != k for joint in pair])
            measured += [e for joint in own if (e := errors(joint, others)) is not None]
        lasting = np.quantile([np.abs(e.mean) for e in measured], HELD) / NORMAL
        noise = np.mean([e.noise(e.seconds) for e in measured])
        found[name] = {
            "offset": fitted([joint for pair in by_clip for joint in pair]).round(3).tolist(),
            "lasting_sd": round(float(np.sqrt(max(lasting**2 - noise, 0.0))), 4),
            "sd": round(float(np.sqrt(np.mean([e.sd**2 for e in measured]))), 4),
            "correlation_s": round(float(np.mean([e.correlation_s for e in measured])), 3),
        }
        every += measured
    return {
        "lasting_s": round(duration(every), 1),
        "repeated": round(again(every), 2),
        "joints": found,
    }


def main() -> None:
    """Learn and write."""
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        folders = sorted(path.parent for path in folder.glob("*/truth.csv"))
    else:
        import detector_clips  # needs ../shared/data

        folder = CLIPS
        with progress("clips", len(detector_clips.recordings())) as update:
            folders = detector_clips.make(folder, update)
    if len(folders) < 2:
        sys.exit(f"{folder}: needs folders of two clips or more with video.mp4 and truth.csv")
    networks = {}
    for network in LANDMARK_NETWORKS:
        networks[network] = learn([clip_joints(each, network) for each in folders])
        print(network, json.dumps(networks[network]), flush=True)
    source = f"{len(folders)} rendered walks of as many people ({', '.join(f.name for f in folders)})"
    text = json.dumps(
        {"source": source, "command": "make detector-profile", "networks": networks},
        indent=1,
    )
    FILE.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
