"""Describe a camera in words, for reports."""

from __future__ import annotations

import numpy as np

from gait.camera.camera import Camera


def camera_facts(camera: Camera) -> dict[str, str]:
    """Describe a camera: names of facts, to words."""
    view = 2 * np.degrees(np.arctan(camera.width / 2 / camera.fx))
    tilt = np.degrees(np.arcsin(np.clip(-camera.R[2, 2], -1, 1)))
    return {
        "focal length": f"{camera.fx:.0f} px, a view {view:.0f}° across",
        "height of the camera": f"{camera.centre[2]:.2f} m above the floor",
        "tilt of the camera": f"{abs(tilt):.0f}° {'down' if tilt >= 0 else 'up'}",
    }
