"""Make the pictures of the tutorial from a simulated walk: screenshots.py [FOLDER] (make screenshots).

Needs Chromium and playwright.  Every step is the command that the tutorial names.
"""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import uvicorn
from playwright.sync_api import Page, sync_playwright

import gait
from gait.camera.board import OURS, print_board
from gait.web import camera_page, serve

DOC = Path(__file__).resolve().parents[1]
LARGEST = 150_000  # bytes of a picture in the repository
MARKS = np.array([[-1.5, -0.8], [1.5, -0.8], [1.8, 1.6], [-1.8, 1.6]])


def run(*words: str) -> None:
    """Run a gait command."""
    subprocess.run([sys.executable, "-m", "gait", *words, "--quiet"], check=True, stdout=subprocess.DEVNULL)


@contextmanager
def browser(width: int, height: int) -> Iterator[Page]:
    """Page of a headless Chromium."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        sys.exit("screenshots: no chromium (Debian: apt install chromium)")
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=options)
        page = chromium.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(60_000)
        yield page
        chromium.close()


def keep(picture: np.ndarray, path: Path) -> None:
    """Write a picture as JPEG below `LARGEST` bytes."""
    for quality in range(88, 30, -6):
        data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) < LARGEST:
            break
    path.write_bytes(data)
    print(f"{path} {len(data)} bytes")


def shot(page: Page) -> np.ndarray:
    """Take what a page shows."""
    return cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)


def board(folder: Path) -> None:
    """Draw the printed board."""
    print_board(folder / "board.png", ".png", OURS, "a4")
    keep(
        cv2.resize(cv2.imread(str(folder / "board.png")), (780, 551), interpolation=cv2.INTER_AREA),
        folder / "board.jpg",
    )
    (folder / "board.png").unlink()


def clicking(clip: Path, folder: Path) -> None:
    """Click marks on the floor of a frame."""
    camera = gait.Camera.read(str(clip / "camera.json"))
    picture = next(iter(gait.Video(clip / "video.mp4").frames(40, 41))).image
    uv = camera.project(np.pad(MARKS, ((0, 0), (0, 1))))
    for at in np.rint(uv).astype(int):
        cv2.circle(picture, tuple(map(int, at)), 3, (40, 220, 240), -1, cv2.LINE_AA)  # tape
    lens = gait.Camera(*camera.size, camera.fx, camera.fy, camera.cx, camera.cy, np.eye(3), np.zeros(3))
    scene = camera_page.Scene(
        "walk.mp4",
        camera.size,
        1,
        lambda number: picture,
        lens,
        "Lens of lens.json.",
        str(clip / "page" / "camera.json"),
    )
    own = serve.listen(0)
    app = camera_page.application(scene, own.getsockname()[1])
    server = uvicorn.Server(uvicorn.Config(app, log_level="error", lifespan="off"))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [own]})
    thread.start()
    try:
        with browser(1280, 760) as page:
            page.goto(serve.address(own))
            page.locator("[role=status]").filter(has_text="click 4 more").wait_for()
            page.locator(".film img").evaluate("image => image.decode()")
            box = page.locator(".film canvas").bounding_box()
            for one in uv.tolist():
                x, y = page.evaluate("(uv) => window.page.picture.toScreen(uv)", one)
                page.mouse.click(box["x"] + x, box["y"] + y)
            for i in range(4):
                for j in range(i + 1, 4):
                    metres = f"{np.linalg.norm(MARKS[i] - MARKS[j]):.2f}"
                    page.get_by_label(f"Metres from {'ABCD'[i]} to {'ABCD'[j]}").fill(metres)
            page.locator("[role=status]").filter(has_text="Fits").wait_for()
            page.locator(".side").evaluate("side => { side.scrollTop = 0; }")
            keep(shot(page), folder / "camera_page.jpg")
    finally:
        server.should_exit = True
        thread.join()


def tracking(clip: Path, folder: Path) -> None:
    """Frame of the overlay, and the page of the run."""
    overlay, report = str(clip / "overlay.mp4"), clip / "run.html"
    camera = str(clip / "camera.json")
    run(
        *(
            "track",
            str(clip / "video.mp4"),
            "--camera",
            camera,
            "--height",
            "1.75",
            "--smooth",
            "-o",
            str(clip / "track.csv"),
        ),
        *("--overlay", overlay, "--report", str(report)),
    )
    film = gait.Video(overlay)
    keep(next(iter(film.frames(60, 61))).image, folder / "overlay.jpg")
    with browser(1280, 1000) as page:
        page.goto(report.as_uri())
        page.wait_for_function("document.querySelector('video').readyState >= 2")
        page.get_by_label("Frame of the film").fill("60")
        page.get_by_text("frame 60").wait_for()
        page.wait_for_function("!document.querySelector('video').seeking")
        page.wait_for_timeout(500)  # what is drawn over it
        keep(shot(page), folder / "run.jpg")


def correcting(clip: Path, folder: Path) -> None:
    """Show a joint to correct on the studio's page."""
    words = ["video.mp4", "--camera", "camera.json", "--track", "track.csv", "--port", "0"]
    command = [sys.executable, "-m", "gait", "studio", *words, "--json", "--quiet"]
    starting = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=clip)
    with starting as server, browser(1280, 720) as page:
        assert server.stdout is not None
        try:
            page.goto(json.loads(server.stdout.readline())["url"])
            page.get_by_role("button", name="Begin").click()
            page.get_by_role("button", name="Follow").click()
            page.locator("#joint").select_option(label="right ankle")
            page.get_by_label("Frame of the film").fill("60")
            page.wait_for_timeout(1500)  # the film goes there
            keep(shot(page), folder / "studio.jpg")
        finally:
            server.send_signal(signal.SIGINT)


def main() -> int:
    """Make all of them."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DOC / "tutorial"
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        clip = Path(temporary) / "walk"
        run("simulate", "-o", str(clip), "--size", "960x540", "--frames", "100", "--stature", "1.75")
        board(folder)
        clicking(clip, folder)
        tracking(clip, folder)
        correcting(clip, folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
