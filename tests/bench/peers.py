#!/usr/bin/env python3
"""The tracker beside its peers on one machine: likelihoods a second, frames a second, errors.

    peers.py [--clips NAME ...] [--mediapipe PYTHON] [--bodytrack PROGRAM DATA] [--record]

The tracker (one thread) and BlazePose, the network of `gait detect`, run on the clips of ../shared/data with
true joints.  MediaPipe Pose runs on the same clips in a Python of its own that can import it, and bodytrack
of PARSEC on PARSEC's own pictures, of four cameras; whatever is missing is left out, with a line on
how to get it.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import cv2
import eval_clips
import numpy as np
import table
from eval_plan import Clip
from facts import facts

from gait import Camera, Model, Start, Tracker, TrackerConfig, Video
from gait.body.skeleton import EVAL15
from gait.detect import weights
from gait.detect.networks import LANDMARK_JOINTS
from gait.detect.people import PeopleDetector
from gait.io.track_file import read_truth
from gait.io.video import read_plate
from gait.motion.evaluate import LIMB_COLUMNS, root_errors

GET = {
    "weights": "BlazePose: run `.venv/bin/gait detect --fetch` for the weights",
    "mediapipe": "MediaPipe: run python3 -m venv build/mediapipe and build/mediapipe/bin/pip install "
    "mediapipe==0.10.21 (Python 3.9 to 3.12), then give --mediapipe build/mediapipe/bin/python",
    "bodytrack": "bodytrack: build that package of PARSEC 3.0 (parsec.cs.princeton.edu) and unpack its input "
    "simlarge or native, then give --bodytrack PROGRAM FOLDER, the folder of pictures, such as sequenceB_4",
}
PARTICLES, LAYERS = 4000, 5  # of bodytrack, in PARSEC's inputs 'simlarge' and 'native'
NAMES = [EVAL15[i] for i in LIMB_COLUMNS]
HEAD = ["clip", "peer", "likelihoods/s", "frames/s", "12 joints, mm", "12 joints, px"]

NOTE = """\
Seconds are of CPU time, of all threads of the peer, without decoding. The tracker begins at the true state
with noise and has a camera, a background and a model learnt without the person; the networks have nothing but
the picture, and find no path. Errors: medians over frames, 12 limb joints; in space with the hips aligned.
BlazePose is the network of `gait detect` (full) in our code, MediaPipe Pose the same in MediaPipe, with the
joints in space that it gives."""

# Runs in MediaPipe's Python: seconds; of each frame world landmarks (metres, the camera's axes) and pixels.
MEDIAPIPE = """
import json, sys, time
import cv2, mediapipe
pose = mediapipe.solutions.pose.Pose(model_complexity=1)
film, out, seconds = cv2.VideoCapture(sys.argv[1]), [], 0.0
while True:
    more, image = film.read()
    if not more:
        break
    begun = time.process_time()
    found = pose.process(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
    seconds += time.process_time() - begun
    height, width = image.shape[:2]
    both = found.pose_landmarks and zip(found.pose_world_landmarks.landmark, found.pose_landmarks.landmark)
    out.append(both and [[p.x, p.y, p.z, q.x * width, q.y * height] for p, q in both])
print(json.dumps([seconds, out]))
"""

Row = list[object]
Joints = dict[int, np.ndarray]


def main() -> int:
    """Measure, print, and record if asked to; exit code 0 also if peers are missing."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--clips", nargs="+", default=["side_lr_35", "oblique45_07", "toward300_08"])
    parser.add_argument("--mediapipe", metavar="PYTHON", type=Path)
    parser.add_argument("--bodytrack", metavar=("PROGRAM", "FOLDER"), nargs=2, type=Path)
    parser.add_argument("--record", action="store_true")
    args = parser.parse_args()
    if eval_clips.absent():
        return 0
    load = os.getloadavg()[0]
    cv2.setNumThreads(1)
    clips, models = eval_clips.people(args.clips)
    missing = [name for name in ("mediapipe", "bodytrack") if not getattr(args, name)]
    detects = weights.find(weights.PERSON) is not None
    missing += [] if detects else ["weights"]
    rows: list[Row] = []
    for clip in clips:
        rows.append(_tracker(clip, models[str(clip.subject)]))
        rows += [_blazepose(clip)] if detects else []
        rows += [_mediapipe(clip, args.mediapipe)] if args.mediapipe else []
    rows += [_bodytrack(*args.bodytrack)] if args.bodytrack else []
    own = f"bodytrack has its own pictures, of four cameras, {PARTICLES} particles and {LAYERS} layers."
    note = f"{facts()}\n\n{NOTE} {own}"
    note += "".join(f"\n\nLeft out, {GET[name]}." for name in missing)
    title = "The tracker beside its peers"
    table.publish_speed(args.record, load, "peers", title, HEAD, rows, note)
    for name in missing:
        print(f"left out, {GET[name]}", file=sys.stderr)
    return 0


def _truth(clip: Clip) -> tuple[Joints, Camera]:
    """True joints by frame number, shape (15, 3), and the camera."""
    truth = read_truth(clip.truth)
    return dict(zip(truth.frame.tolist(), truth.eval15(), strict=True)), Camera.read(str(clip.camera))


def _errors(pose: Joints, flat: Joints, true: Joints, camera: Camera) -> list[float]:
    """Median errors in space (mm, hips aligned) and in the picture; pose: (15, 3), flat: (12, 2) by frame."""
    off = [
        np.linalg.norm(uv - camera.project(true[n][LIMB_COLUMNS]), axis=1).mean() for n, uv in flat.items()
    ]
    root = [root_errors(at[None], true[n][None], LIMB_COLUMNS) for n, at in pose.items()]
    return [float(np.median(root)) if root else np.nan, float(np.median(off))]


def _tracker(clip: Clip, blob: Path) -> Row:
    """Row of our tracker in its default mode."""
    true, camera = _truth(clip)
    video, model = Video(clip.video), Model(blob)
    path = eval_clips.ROOT / "build" / "eval" / f"peers.{clip.name}.init.json"
    path.write_text(json.dumps(eval_clips.noisy_start(clip, 1, 0.0)))
    start = Start.read(path, model)
    tracker = Tracker(model, camera, TrackerConfig.default(), background=read_plate(clip.plate, video.size))
    pose, seconds, evaluated = {}, 0.0, 0
    order = [model.joint_names.index(name) for name in EVAL15]
    for frame in video.frames(start.frame):
        if frame.number == start.frame:
            tracker.start(start.mean, start.sd, frame.utime)
        begun = time.process_time()
        estimate = tracker.step(frame.image, frame.utime)
        seconds += time.process_time() - begun
        evaluated += len(tracker.particles()[1])
        pose[frame.number] = estimate.joints[order]
    flat = {n: camera.project(at[LIMB_COLUMNS]) for n, at in pose.items()}
    rates = [evaluated / seconds, len(pose) / seconds]
    return [clip.name, "libgait, default", *rates, *_errors(pose, flat, true, camera)]


def _blazepose(clip: Clip) -> Row:
    """Row of the network of `gait detect`."""
    true, camera = _truth(clip)
    detector, flat, seconds, frames = PeopleDetector("full"), {}, 0.0, 0
    order = [list(LANDMARK_JOINTS).index(name) for name in NAMES]
    for frame in Video(clip.video).frames():
        begun = time.process_time()
        found = detector.step(frame)
        seconds += time.process_time() - begun
        frames += 1
        if found:
            flat[frame.number] = found[0][1].uv[order]
    return [clip.name, "BlazePose (gait detect)", None, frames / seconds, *_errors({}, flat, true, camera)]


def _mediapipe(clip: Clip, python: Path) -> Row:
    """Row of MediaPipe Pose; its axes are those of the camera."""
    true, camera = _truth(clip)
    done = subprocess.run([python, "-c", MEDIAPIPE, clip.video], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"peers: {python} cannot run MediaPipe: {done.stderr.strip().splitlines()[-1]}")
    seconds, frames = json.loads(done.stdout)
    order = [LANDMARK_JOINTS[name] for name in NAMES]
    pose, flat = {}, {}
    for number, points in enumerate(frames):
        if points:
            at = np.array(points)[order]
            pose[number] = np.zeros((len(EVAL15), 3))
            pose[number][LIMB_COLUMNS] = at[:, :3] @ camera.R
            flat[number] = at[:, 3:]
    return [clip.name, "MediaPipe Pose", None, len(frames) / seconds, *_errors(pose, flat, true, camera)]


def _bodytrack(program: Path, folder: Path) -> Row:
    """Row of PARSEC's bodytrack on its own pictures, one thread."""
    frames = len(list((folder / "CAM1").glob("image*")))
    words = [program, folder, 4, frames, PARTICLES, LAYERS]
    before = os.times()
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    seconds = os.times().children_user - before.children_user
    if done.returncode or not frames:
        raise SystemExit(
            f"peers: {program} failed on {folder}: {(done.stderr or done.stdout).strip()[-200:]}"
        )
    rates = [frames * PARTICLES * LAYERS / seconds, frames / seconds]
    return [folder.name, "PARSEC bodytrack, 4 cameras", *rates, None, None]


if __name__ == "__main__":
    sys.exit(main())
