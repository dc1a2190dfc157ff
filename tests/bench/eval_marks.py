"""The real clip, judged with joints marked by hand in the picture (reference2d.json)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from eval_measures import shares

from gait import Camera
from gait.io.track_file import Track
from gait.motion.evaluate import phase_errors
from gait.motion.footfalls import Strikes

LEG = ("hip", "knee", "ankle")
LOST_SHARE = (
    0.15  # of the person's height in the picture: a frame whose marks are further off on average is lost
)
_GUESSED, _CLEAR = 1, 2  # values of vis


@dataclass(frozen=True)
class Marks:
    """Marked joints.

    Attributes
    ----------
    frames : ndarray of int, shape (n,)
    joints : list of str
        Names of the k joints; head_centre lies between neck and head_top.
    uv : ndarray of shape (n, k, 2)
        Pixels.
    seen : ndarray of int, shape (n, k)
        0 hidden, 1 guessed under cloth, 2 clear.
    near : str
        Side turned to the camera: ``l`` or ``r``.
    strikes : Strikes
        Heel strikes, as marked.
    """

    frames: np.ndarray
    joints: list[str]
    uv: np.ndarray
    visible: np.ndarray
    near: str
    strikes: Strikes

    @staticmethod
    def read(path: Path) -> Marks:
        """Read reference2d.json."""
        data = json.loads(path.read_text())
        strikes = data["heel_strikes"]
        return Marks(
            np.array(data["frame_numbers"]),
            data["joints"],
            np.array(data["uv"], float),
            np.array(data["vis"]),
            data["near_side"][0],
            Strikes(np.array(strikes["right"], float), np.array(strikes["left"], float)),
        )

    def distances(self, track: Track, camera: Camera) -> np.ndarray:
        """Pixels from each mark to the estimate, (n, k); NaN where the frame was not tracked."""
        out = np.full(self.visible.shape, np.nan)
        _, rows, at = np.intersect1d(self.frames, track.frame, return_indices=True)
        for k, joint in enumerate(self.joints):
            if joint == "head_centre":
                place = 0.5 * (track.places["neck"] + track.places["head_top"])[at]
            else:
                place = track.places[joint][at]
            out[rows, k] = np.linalg.norm(camera.project(place) - self.uv[rows, k], axis=1)
        return out

    @property
    def height(self) -> float:
        """Person's height in the picture, pixels: from the head's centre to the toes, plus half a head."""
        head, toe = self.joints.index("head_centre"), self.joints.index(f"{self.near}_toe")
        neck = self.joints.index("neck")
        up = np.abs(self.uv[:, neck, 1] - self.uv[:, head, 1])
        return float(np.median(self.uv[:, toe, 1] - self.uv[:, head, 1] + up))

    def measure(self, track: Track, camera: Camera) -> dict[str, Any]:
        """Measures of a track.

        ``near_px`` (hip, knee, ankle turned to the camera) and ``clear_px`` (all clear joints): medians over
        joints and frames; ``phase`` as in `gait eval`, ``lost`` (share of the marked frames) and ``status``.
        """
        off = self.distances(track, camera)
        tracked = np.isfinite(off).all(axis=1)
        leg = [self.joints.index(f"{self.near}_{name}") for name in LEG]
        near = off[:, leg][(self.visible[:, leg] >= _GUESSED) & tracked[:, None]]
        clear = off[(self.visible == _CLEAR) & tracked[:, None]]
        true = self.strikes.phase(track.frame)
        lost = {n for n, status in zip(track.frame.tolist(), track.status, strict=True) if status == "lost"}
        far = self._mean_distance(off)[tracked] > LOST_SHARE * self.height
        reported = np.array([n in lost for n in self.frames[tracked].tolist()])
        believed = np.isin(self.frames[tracked], track.frame[np.array(track.status) == "tracking"])
        return {
            "near_px": float(np.median(near)),
            "clear_px": float(np.median(clear)),
            "joint_px": {
                name: float(np.median(off[:, k][(self.visible[:, k] == _CLEAR) & tracked]))
                for k, name in enumerate(self.joints)
                if ((self.visible[:, k] == _CLEAR) & tracked).any()
            },
            "phase": phase_errors(track.phase, true),
            "lost": float((far | reported).mean()),
            "trust": {
                "wrong_tracking": float((far & believed).mean()),
                "weighted_lost": float(((far | reported) + 1.0 * (far & believed)).mean()),
            },
            "status": shares(track),
        }

    def series(self, track: Track, camera: Camera) -> dict[str, np.ndarray]:
        """``marked_px``: mean distance of the visible marks at each frame, NaN where there is none."""
        mean = dict(
            zip(self.frames.tolist(), self._mean_distance(self.distances(track, camera)), strict=True)
        )
        return {
            "marked_px": np.array([mean.get(n, np.nan) for n in track.frame.tolist()]),
            "limit_px": np.array([LOST_SHARE * self.height]),
        }

    def _mean_distance(self, off: np.ndarray) -> np.ndarray:
        visible = self.visible > 0
        return np.where(visible, off, 0).sum(axis=1) / visible.sum(axis=1)
