"""The clip of figures 6 and 7: the user's, or one that is rendered here."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.io.track_file import read_truth
from gait.learn.arrays import Floats
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS

PRESET = "demo"
POINTING = 3.0  # pixels, sd of a simulated click
CLICKED = [name for name in EVAL15 if name not in ("pelvis", "neck", "head_top")]
JOINTS_PER_CLICK = 7  # joints from one click to the next
CHECK_INTERVAL = 5  # one click of so many is not used: it is judged by


@dataclass(frozen=True)
class Clip:
    """Files of a clip; `corrections` and `truth` may be missing, and the camera of another resolution."""

    name: str
    video: str
    camera: str
    init: str
    background: str = "auto"
    corrections: str | None = None
    truth: str | None = None
    scale_camera: bool = False

    def calibration(self, size: tuple[int, int] | None) -> Camera:
        """Read the camera, for pictures of a size if that is known."""
        return Camera.read(self.camera, size, self.scale_camera)

    @property
    def real(self) -> bool:
        """Whether it is the user's, not a rendered one."""
        return self.truth is None

    def without_phase(self, folder: Path) -> str:
        """Write the init file without the phase of walking, of which the second paper knows nothing."""
        known = json.loads(Path(self.init).read_text(encoding="utf-8"))
        for key in ("phase", "stride_hz"):
            known.pop(key, None)
            known.get("sd", {}).pop(key, None)
        path = folder / "placement.json"
        path.write_text(json.dumps(known), encoding="utf-8")
        return str(path)

    def clicks_within(self, frames: range, folder: Path) -> tuple[str | None, list[dict[str, Any]]]:
        """Write the corrections of some frames without every `CHECK_INTERVAL`-th; return the file or None.

        Those that are left out are returned, as they stand in the file.
        """
        if self.corrections is None:
            return None, []
        known = json.loads(Path(self.corrections).read_text(encoding="utf-8"))
        within = [c for c in known["corrections"] if c["frame"] in frames]
        known["corrections"] = [c for k, c in enumerate(within, 1) if k % CHECK_INTERVAL]
        path = folder / "clicks.json"
        path.write_text(json.dumps(known), encoding="utf-8")
        return str(path), within[CHECK_INTERVAL - 1 :: CHECK_INTERVAL]

    def joints(self) -> tuple[list[int], dict[str, Floats]]:
        """Return frames and places of the true joints."""
        assert self.truth is not None
        truth = read_truth(self.truth)
        return truth.frame.tolist(), truth.places


def rendered(folder: Path, update: Callable[[int], None]) -> Clip:
    """Render a walk, and click a joint in each frame as a user would."""
    simulate(PRESETS[PRESET], folder, update, keep=False)
    files = ("video.mp4", "camera.json", "init.json", "background.png")
    video, camera_file, init, plate = (str(folder / name) for name in files)
    clip = Clip("a walk", video, camera_file, init, plate, truth=str(folder / "truth.csv"))
    frames, places = clip.joints()
    camera, rng = Camera.read(clip.camera), np.random.default_rng(1)
    listed = []
    for k, frame in enumerate(frames):
        joint = CLICKED[JOINTS_PER_CLICK * k % len(CLICKED)]
        at = camera.project(places[joint][k]) + POINTING * rng.normal(size=2)
        listed.append({"frame": frame, "joint": joint, "uv": at.tolist(), "sd_px": POINTING})
    path = folder / "corrections.json"
    path.write_text(json.dumps({"corrections": listed}), encoding="utf-8")
    return replace(clip, corrections=str(path))
