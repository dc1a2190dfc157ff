#!/usr/bin/env python3
"""Valid inputs of every fuzz target, from which fuzzing starts: seeds.py FOLDER.

Further inputs that fuzzing found are kept, minimised, in tests/fuzz/corpus (fuzz_long.py --keep).
"""

from __future__ import annotations

import json
import struct
import sys
import tempfile
from pathlib import Path

import cv2
import lcm
import numpy as np

import gait
from gait.bindings.abi import MAX_JOINTS
from gait.lcm.link import gaitmsg
from gait.lcm.messages import camera_message, command_message, image_message, tracks_message

WIDTH, HEIGHT = 48, 32
CAMERA = gait.Camera(
    WIDTH,
    HEIGHT,
    50.0,
    50.0,
    24.0,
    16.0,
    np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    np.array([0.0, 1, 5]),
)
IMAGE, CAMERA_KIND, BACKGROUND, TRACKS, COMMAND, STATUS = range(6)
FURTHER_CAMERA, FURTHER_BACKGROUND, FURTHER_IMAGE = 64, 65, 66
WITH_FURTHER, WITH_SECOND_PERSON = 16, 64  # bits of the choice
TO_SECOND_PERSON = 32  # bit of the kind
START = {"phase": 0.2, "stride_hz": 0.9, "stature": 1.7, "heading": 0.0, "pelvis": [0.0, 0.0, 0.9]}


def picture(frame: int) -> np.ndarray:
    """A dark bar that moves over a bright scene."""
    image = np.full((HEIGHT, WIDTH), 180, np.uint8)
    image[6:, 8 + frame : 14 + frame] = 30
    return image


def part(kind: int, message: object) -> bytes:
    """One message in the form that fuzz_messages.c reads: kind, length, bytes without the type."""
    data = message.encode()[8:]  # type: ignore[attr-defined]
    return struct.pack(">BH", kind, len(data)) + data


def messages(choice: int, jpeg: int | None) -> bytes:
    """A session: camera, background, start, frames with keypoints, a foreign status, stop."""
    kinds = gaitmsg.command_t
    uv = np.column_stack([np.linspace(16, 30, 6), np.linspace(5, 30, 6)])
    names = ["pelvis", "head", "l_knee", "r_knee", "m0", "m1"]
    parts = [
        part(CAMERA_KIND, camera_message(CAMERA, 1)),
        part(BACKGROUND, image_message(np.full((HEIGHT, WIDTH), 180, np.uint8), 1, -1, jpeg)),
        part(
            COMMAND, command_message(kinds.START, 0, START, dict.fromkeys(START, 0.1) | {"pelvis": [0.1] * 3})
        ),
    ]
    if choice & WITH_FURTHER:
        plate = image_message(np.full((HEIGHT, WIDTH), 180, np.uint8), 1, -1, jpeg)
        parts += [part(FURTHER_CAMERA, camera_message(CAMERA, 1)), part(FURTHER_BACKGROUND, plate)]
    for frame in range(2):
        utime = 1000 + 40000 * frame
        if choice & WITH_FURTHER:
            parts.append(part(FURTHER_IMAGE, image_message(picture(frame), utime, frame, jpeg)))
        parts.append(part(IMAGE, image_message(picture(frame), utime, frame, jpeg)))
        parts.append(part(TRACKS, tracks_message(names, uv, utime, frame)))
        if choice & WITH_SECOND_PERSON:
            parts.append(part(TO_SECOND_PERSON | TRACKS, tracks_message(names, uv + 4, utime, frame)))
            if frame == 0:
                start = {**START, "pelvis": [0.2, 0.0, 0.9]}
                sd = dict.fromkeys(START, 0.1) | {"pelvis": [0.1] * 3}
                parts.append(part(TO_SECOND_PERSON | COMMAND, command_message(kinds.START, 0, start, sd)))
    parts.append(part(COMMAND, command_message(kinds.STOP)))
    status = gaitmsg.status_t()
    status.version = status.text = "other"
    parts.append(part(STATUS, status))
    return bytes([choice]) + b"".join(parts)


def files(kind: int, text: str | bytes) -> bytes:
    """A file for fuzz_files.c: its kind, then its contents."""
    return bytes([kind]) + (text.encode() if isinstance(text, str) else text)


def number(value: float) -> bytes:
    """What fuzz_number() reads as about this value, in [-1.75, 59.75)."""
    quarters = int((value + 4) * 4)
    return bytes([quarters, round(100 * (value + 4 - quarters / 4))])


def person_walks(keypoints: bool) -> bytes:
    """Ten frames for fuzz_start.c of a person who walks to the right: keypoints, or a box."""
    random = np.random.default_rng(1)
    frames = []
    for frame in range(10):
        at = 22 + 0.4 * frame
        joints = [(at + random.normal(), v, 1) for v in np.linspace(9, 26, MAX_JOINTS)]
        box = (at, 26, at, 9, 1)
        frames += [
            b"".join(number(x) for joint in joints for x in joint),
            bytes([keypoints]),
            bytes(192),  # pictures
            b"" if keypoints else b"\1" + b"".join(number(x) for x in box),
            bytes([0, 60]),  # no further box; time to the next frame
        ]
    data = bytes(2) + b"".join(frames)
    return data + bytes([-sum(data) % 8])  # one of the inputs on which the search is spent


def log() -> bytes:
    """An LCM log of two events."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a"
        out = lcm.EventLog(str(path), "w", overwrite=True)
        for i, channel in enumerate(("GAIT_COMMAND", "OTHER")):
            out.write_event(i, channel, b"data")
        out.close()
        return path.read_bytes()


def main() -> int:
    """Write them."""
    folder = Path(sys.argv[1])
    random = np.random.default_rng(1)
    jpeg = cv2.imencode(".jpg", picture(0)[:16, :16])[1].tobytes()
    init = {"frame": 3, "pelvis": [0, 0, 0.9], "phase": 0.5, "sd": {"pelvis": [0.1, 0.2, 0.3]}}
    settings = "model = 'walk.gait' # of the shop\nseed = 5\n\nphase-noise=0.2\nlift = yes\n"
    seeds = {
        "model": [bytes([choice]) for choice in range(6)],
        "snapshot": [bytes([kind]) for kind in range(3)],
        "frame": [random.integers(9, 255, 900, np.uint8).tobytes() for _ in range(4)],
        "lift": [random.integers(9, 200, 300, np.uint8).tobytes() for _ in range(4)],
        "start": [bytes(range(9, 200)) * 20, person_walks(True), person_walks(False)],
        "messages": [
            messages(choice, quality)
            for choice, quality in ((0, None), (1, 80), (10, None), (13, 60), (17, 60), (33, 60), (65, 60))
        ],
        "files": [
            files(0, json.dumps(CAMERA.to_dict())),
            files(1, json.dumps(init)),
            files(2, settings),
            files(3, b"P5 # made by hand\n4 2\n255\n" + bytes(8)),
            files(3, b"P6\n2 2\n255\n" + bytes(12)),
            files(4, b"GAITTRD1" + bytes(200)),
            files(5, bytes([15, 15]) + jpeg),
        ],
        "log": [log(), log()[:-3], b"x" + log()[:24] + bytes([127] + 3 * [255]) + log()[28:], b"x" + log()],
    }
    for name, inputs in seeds.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        for i, data in enumerate(inputs):
            (folder / name / f"seed_{i}").write_bytes(data)
    return 0


if __name__ == "__main__":
    sys.exit(main())
