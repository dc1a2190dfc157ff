"""How long the studio's page takes from the release of a joint to the painted overlay, in Chromium."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

import browser

from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints

Drag = tuple[int, str, tuple[float, float]]
"""Frame, joint, and the pixel that it is dragged to."""


def seconds(folder: Path, points: Keypoints, drags: Sequence[Drag]) -> list[float]:
    """Drag joints one by one, while the whole clip is solved in the background; empty without Chromium.

    Parameters
    ----------
    folder : Path
        Clip, with video and camera; nothing is written there.
    points : Keypoints
        What the page begins with.
    drags : sequence of Drag
    """
    if shutil.which("chromium") is None and shutil.which("chromium-browser") is None:
        print("eval-studio: no chromium, so the page is not measured", file=sys.stderr)
        return []
    with tempfile.TemporaryDirectory() as temporary:
        film, given = Path(temporary) / "video.mp4", Path(temporary) / "keypoints.csv"
        film.symlink_to((folder / "video.mp4").resolve())
        keypoints_file.write(given, points)
        words = ["studio", film, "--keypoints", given, "--camera", folder / "camera.json", "--port", "0"]
        command = [sys.executable, "-m", "gait", *map(str, words), "--json", "--quiet"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
            assert server.stdout is not None
            try:
                url = json.loads(server.stdout.readline())["url"]
                with browser.opened() as page:
                    page.goto(url)
                    browser.until(page, "window.studio?.film?.video?.readyState >= 2", 300)
                    page.get_by_role("button", name="Begin").click()
                    return [_drag(page, *drag) for drag in drags]
            finally:
                server.send_signal(signal.SIGINT)


def _drag(page: Any, frame: int, joint: str, uv: tuple[float, float]) -> float:
    page.evaluate(f"studio.film.seek({frame} - studio.data.first)")
    page.evaluate("studio.sent = 0")
    box = page.locator("#film .stage canvas").bounding_box()

    def on_screen(pixel: str) -> tuple[float, float]:
        x, y = page.evaluate(f"studio.film.picture.toScreen({pixel})")
        return box["x"] + x, box["y"] + y

    shown = f"studio.data.uv[studio.film.index][studio.data.joints.indexOf('{joint}')]"
    page.mouse.move(*on_screen(shown))
    page.mouse.down()
    page.mouse.move(*on_screen(str(list(uv))), steps=4)
    page.mouse.up()
    browser.until(page, "studio.sent > 0", 60)
    return float(page.evaluate("studio.sent")) / 1000


def words(spent: list[float], wanted: float) -> str:
    """Sentence on what was measured."""
    if not spent:
        return ""
    middle, longest = sorted(spent)[len(spent) // 2], max(spent)
    verdict = "met" if longest <= wanted else "MISSED"
    return (
        f" From the release of the mouse to the painted overlay, in Chromium with a software GPU and "
        f"{os.cpu_count()} processors, {len(spent)} drags of that clip: median {middle:.2f} s, longest "
        f"{longest:.2f} s ({verdict}; load of the machine then {os.getloadavg()[0]:.0f})."
    )
