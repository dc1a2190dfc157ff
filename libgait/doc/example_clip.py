"""Convert a clip of `gait simulate --size 640x480` to what example.c reads: PGM pictures and scene.txt."""

import json
import sys
from pathlib import Path

import cv2

import gait

folder = Path(sys.argv[1] if len(sys.argv) == 2 else sys.exit("usage: example_clip.py FOLDER"))
for name in ("camera.json", "init.json", "background.png", "video.mp4"):
    if not (folder / name).is_file():
        sys.exit(f"{folder / name}: no such file; make the clip by gait simulate -o {folder} --size 640x480")
camera = gait.Camera.read(str(folder / "camera.json"))
start = json.loads((folder / "init.json").read_text(encoding="utf-8"))
scene = [camera.fx, camera.fy, camera.cx, camera.cy, *camera.R.ravel(), *camera.t, *start["pelvis"][:2]]
(folder / "scene.txt").write_text(" ".join(map(str, [*scene, start["heading_rad"]])), encoding="utf-8")
cv2.imwrite(str(folder / "empty.pgm"), cv2.imread(str(folder / "background.png"), cv2.IMREAD_GRAYSCALE))
for frame in gait.Video(str(folder / "video.mp4")).frames():
    grey = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
    cv2.imwrite(str(folder / f"frame{frame.number:03d}.pgm"), grey)
