#!/usr/bin/env python3
"""Which wrong cameras `gait track` and `gait lift` report, on rendered clips and on films.

    camera_check.py [CLIP...]

Each clip's camera file is changed in several ways.  A fault is found either before the video is read
("refused") or from the keypoints of the walking person: in the focal length, in the person's stature, in
frames that are turned, or in the axes of the world.  Turned frames are simulated by turning the keypoints.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import eval_clips
import numpy as np
import table
from facts import facts

from gait.bindings.model import Model
from gait.camera.camera import Camera, read_camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.video import Video
from gait.track.camera_check import contradiction
from gait.track.walk_camera import find_people

THIRD = 4 / 3
Change = Callable[[Camera], Camera]
WORDS = {
    "m tall by it": "stature",
    "its focal length;": "focal",
    "its tilt;": "tilt",
    "its roll;": "roll",
    "frames are turned": "frames",
    "no walk on its floor": "no walk",
}


def main() -> int:
    """Check every clip with every camera and publish; exit code 0 also if the data are absent."""
    if eval_clips.absent():
        return 0
    folders = [eval_clips.DATA / "eval" / "dev", eval_clips.DATA / "real"]
    clips = [c for folder in folders for c in sorted(folder.iterdir()) if (c / "camera.json").is_file()]
    chosen = eval_clips.chosen(clips)
    rows = [_clip(clip) for clip in chosen]
    counts = np.array([[cell != "" for cell in row[1:]] for row in rows]).sum(axis=0)
    rows.append(["reported", *(f"{count} of {len(chosen)}" for count in counts)])
    head = ["clip", "right", *(name for name, _ in _changes()), "frames turned by 180", "size halved"]
    note = (
        f"{facts()}\n\n"
        "The table shows what is reported about each camera file: unchanged (correct for the six "
        "rendered clips, guessed for the films), and with one fault. The stature is given. refused: an "
        "error before the clip is read; stature: the person appears more than 12 % taller or shorter; "
        "focal: the walk contradicts the focal length; frames: turned frames. An empty cell means that "
        "nothing is reported."
    )
    table.publish("camera_check", "Wrong cameras", head, rows, note)
    return 0


def _changes() -> Iterator[tuple[str, Change]]:
    """Names of faults, and functions that put them into a camera."""
    for name, share in (("focal x 1.5", 1.5), ("focal / 1.5", 1 / 1.5)):
        yield name, lambda camera, share=share: replace(camera, fx=share * camera.fx, fy=share * camera.fy)
    for name, share in (("height x 4/3", THIRD), ("height / (4/3)", 1 / THIRD)):
        yield name, lambda camera, share=share: _raised(camera, share)
    for name, sign in (("y up", 1.0), ("y down", -1.0)):
        axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, sign], [0.0, -sign, 0.0]])
        yield name, lambda camera, axes=axes: replace(camera, R=camera.R @ axes.T)


def _raised(camera: Camera, share: float) -> Camera:
    """Change the camera's height by a factor."""
    return replace(camera, t=-camera.R @ (camera.centre * [1.0, 1.0, share]))


def _clip(folder: Path) -> list[Any]:
    """Row of a clip: what is reported about its own camera and about each changed one."""
    video = Video(next(folder.glob("video.*")))
    meta = json.loads((folder / "meta.json").read_text())
    stature = meta.get("stature_m") or meta["limb_lengths_m"]["stature"]
    camera = read_camera(str(folder / "camera.json"), video.size)
    keypoints, model = next(iter(find_people(video, quiet=True).values())), Model()
    cells = [_reported(camera, video, keypoints, model, stature)]
    for _, change in _changes():
        cells.append(_reported(change(camera), video, keypoints, model, stature))
    turned = replace(keypoints, uv=np.array(video.size) - 1 - keypoints.uv)
    cells.append(_reported(camera, video, turned, model, stature))
    cells.append(_reported(camera.scaled(0.5), video, keypoints, model, stature))
    return [folder.name, *cells]


def _reported(camera: Camera, video: Video, keypoints: Keypoints, model: Model, stature: float) -> str:
    """Name what is reported, in one word."""
    try:
        camera.check_size("camera.json", video.size)
        camera.check_place("camera.json")
    except UserError:
        return "refused"
    words = contradiction(camera, keypoints, model, stature)
    return "" if words is None else next(word for part, word in WORDS.items() if part in words)


if __name__ == "__main__":
    sys.exit(main())
