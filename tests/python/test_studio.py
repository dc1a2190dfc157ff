"""gait studio in a real Chromium: a clip with known truth, corrected with the mouse."""

import contextlib
import csv
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import urllib.request

import accessibility
import browser
import numpy as np
import pytest

from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.cli import main
from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_estimates
from gait.io.video import Video
from gait.lift.keypoints.corrections import Correction, Edits, read_edits
from gait.lift.run import load_prior

pytestmark = pytest.mark.long

WRONG = range(18, 32)  # frames in which the detector has lost a foot
FOOT = ("r_ankle", "r_toe", "r_heel")
FRAMES, FPS = 54, 30.0
PULLED = [(20, "r_ankle"), (23, "r_toe"), (23, "r_ankle"), (27, "r_heel"), (30, "r_ankle")]


def table(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A short clip, and keypoints that are right except for a foot in `WRONG`."""
    browser.chromium()
    folder = tmp_path_factory.mktemp("studio")
    shown = ["--frames", str(FRAMES), "--fps", f"{FPS:g}", "--size", "480x270", "--view", "side", "--quiet"]
    assert main(["simulate", "-o", str(folder / "clip"), *shown]) == 0
    rows = table(folder / "clip/truth.csv")
    uv = np.array([[[float(row[f"{j}_{a}"]) for a in "uv"] for j in JOINTS] for row in rows])
    points = uv + np.random.default_rng(2).normal(0, 0.4, uv.shape)
    for joint in FOOT:
        points[WRONG.start : WRONG.stop, JOINTS.index(joint)] += [4.0, -13.0]
    number = np.arange(FRAMES)
    found = Keypoints(number, number / FPS, tuple(JOINTS), points, np.ones(points.shape[:2]))
    keypoints_file.write(folder / "keypoints.csv", found)
    return folder, uv


class Server:
    """The command as a user runs it."""

    def __init__(self, folder, *source):
        given = source or ("--keypoints", "keypoints.csv")
        self.folder, self.command = folder, [sys.executable, "-m", "gait", "studio", "clip/video.mp4", *given]
        self.command += ["--camera", "clip/camera.json", "--port", "0", "--json", "--quiet"]
        self.start()

    def start(self):
        environment = os.environ | {"GAIT_WEB": str(browser.FETCHED)}
        self.process = subprocess.Popen(
            self.command, cwd=self.folder, stdout=subprocess.PIPE, text=True, env=environment
        )
        line = self.process.stdout.readline()
        assert line, "gait studio ended"
        self.url = json.loads(line)["url"]

    def end(self, number):
        self.process.send_signal(number)
        code = self.process.wait(60)
        self.process.stdout.close()
        return code


@pytest.fixture(scope="module")
def running(clip):
    """A server for the tests that leave it running."""
    started = Server(clip[0])
    yield started
    assert started.end(signal.SIGINT) == 0


@pytest.fixture
def server(running):
    """The server without corrections."""
    assert post(running.url, "edit", {"do": "clear"})[0] == 200
    return running


@contextlib.contextmanager
def studio(url, **how):
    with browser.opened(**how) as page:
        show(page, url)
        yield page


def show(page, url):
    page.goto(url)
    browser.until(page, "window.studio?.film?.video?.readyState >= 2")
    if page.locator("#helping").is_visible():
        page.get_by_role("button", name="Begin").click()


def screen(page, frame, uv):
    """Position of a frame's pixel on the screen; shows the frame."""
    page.evaluate(f"studio.film.seek({frame})")
    box = page.locator("#film .stage canvas").bounding_box()
    x, y = page.evaluate(f"studio.film.picture.toScreen([{uv[0]}, {uv[1]}])")
    return box["x"] + x, box["y"] + y


def drag(page, frame, joint, target):
    """Drag a joint to a pixel, as a person does."""
    shown = page.evaluate(f"studio.data.uv[{frame}][studio.data.joints.indexOf('{joint}')]")
    version = page.evaluate("studio.data.version")
    x, y = screen(page, frame, target)
    page.mouse.move(*screen(page, frame, shown))
    page.mouse.down()
    page.mouse.move(x, y, steps=3)
    page.mouse.up()
    made = f"c.frame === {frame} && c.joint === '{joint}'"  # a whole motion of the drag before counts as well
    there = f"(studio.data.edits.corrections ?? []).some((c) => {made})"
    browser.until(page, f"studio.data.version > {version} && studio.sent > 0 && {there}")


def rest(page, server):
    """Wait for the whole motion."""
    whole_motion(server)
    browser.until(page, "!studio.data.refining")


def misses(uv, truth, names):
    """Distance in the picture, pixels, of the foot where the detector had lost it."""
    rows = slice(WRONG.start, WRONG.stop)
    return [
        float(np.linalg.norm(uv[rows, names.index(j)] - truth[rows, JOINTS.index(j)], axis=1).mean())
        for j in FOOT
    ]


def test_five_drags_bring_the_figure_to_the_person(clip, server):
    folder, truth = clip
    saved = folder / "clip/video.mp4.studio/corrections.json"
    with studio(server.url) as page:
        names = page.evaluate("studio.data.joints")
        before = misses(np.array(page.evaluate("studio.data.uv")), truth, names)
        for frame, joint in PULLED:
            drag(page, frame, joint, truth[frame, JOINTS.index(joint)])
        assert len(json.loads(saved.read_text())["corrections"]) == 5
        near = misses(np.array(page.evaluate("studio.data.uv")), truth, names)
        assert np.mean(near) < 0.5 * np.mean(before)  # at once
        rest(page, server)
        after = misses(np.array(page.evaluate("studio.data.uv")), truth, names)
        assert np.mean(after) < 0.4 * np.mean(before) and np.mean(before) > 5
        with page.expect_download() as download:
            page.select_option("#export", "csv")
        exported = (folder / "exported.csv", folder / "batch.csv", folder / "uncorrected.csv")
        download.value.save_as(exported[0])

        page.reload()
        show(page, server.url)
        assert page.evaluate("studio.data.edits.corrections.length") == 5
        assert page.locator("#edits li").count() == 5

    words = ["lift", str(folder / "keypoints.csv"), "--camera", str(folder / "clip/camera.json"), "--quiet"]
    assert main([*words, "-o", str(exported[2])]) == 0
    assert main([*words, "--corrections", str(saved), "-o", str(exported[1])]) == 0
    assert exported[0].read_bytes() == exported[1].read_bytes()
    true = {
        j: np.array([[float(r[f"{j}_{a}"]) for a in "xyz"] for r in table(folder / "clip/truth.csv")])
        for j in FOOT
    }
    rows = slice(WRONG.start, WRONG.stop)
    errors = [
        np.mean([np.linalg.norm(read_estimates(p).places[j][rows] - true[j][rows], axis=1) for j in FOOT])
        for p in exported[1:]
    ]
    assert errors[0] < 0.6 * errors[1]

    assert server.end(signal.SIGKILL) == -signal.SIGKILL
    server.start()
    with studio(server.url) as page:
        assert page.evaluate("studio.data.edits.corrections.length") == 5
        uv = np.array(page.evaluate("studio.data.uv"))
        assert misses(uv, truth, names) == pytest.approx(after, abs=0.02)


def test_plays_steps_undoes_and_removes(clip, server):
    _, truth = clip
    with studio(server.url) as page:
        page.keyboard.press("ArrowRight")
        assert page.evaluate("studio.film.index") == 1
        page.get_by_label("Speed").select_option("0.1")  # a busy machine must not reach the end
        page.keyboard.press("Space")
        browser.until(page, "studio.film.index > 3")
        page.keyboard.press("Space")
        assert not page.evaluate("studio.film.playing")
        assert page.evaluate("studio.scene.index") == page.evaluate("studio.film.index")
        assert page.evaluate("studio.curves.index") == page.evaluate("studio.film.index")

        drag(page, 30, "r_ankle", truth[30, JOINTS.index("r_ankle")])
        for press, count in (("Control+z", 0), ("Control+Shift+z", 1)):
            page.keyboard.press(press)
            browser.until(page, f"studio.data.edits.corrections.length === {count}")
        page.mouse.click(*screen(page, 30, truth[30, JOINTS.index("r_ankle")]), button="right")
        browser.until(page, "studio.data.edits.corrections.length === 0")

        page.evaluate("studio.film.seek(10)")
        page.keyboard.press("i")
        page.evaluate("studio.film.seek(14)")
        page.keyboard.press("o")
        page.keyboard.press("s")
        browser.until(page, "studio.data.edits.swapped?.length === 1")
        assert page.evaluate("studio.data.edits.swapped[0]") == {"first": 10, "last": 14}
        page.keyboard.press("h")
        browser.until(page, "studio.data.edits.hidden?.length === 1")
        page.keyboard.press("f")
        page.mouse.click(*screen(page, 50, truth[50, JOINTS.index("l_heel")]))
        browser.until(page, "studio.data.edits.floor?.length === 1")
        page.locator("#edits button", has_text="×").first.click()
        browser.until(page, "!studio.data.edits.swapped")
        rest(page, server)
        assert page.evaluate("studio.data.fault") == ""


def test_a_joint_is_moved_by_keys_and_proposals_are_visited(server):
    with studio(server.url) as page:
        rest(page, server)
        page.keyboard.press("n")
        first = page.evaluate("studio.data.proposals[0]")
        assert page.evaluate("studio.film.index") == first["frame"]
        assert page.locator("#joint option:checked").inner_text() == first["joint"].replace("r_", "right ")
        assert first["joint"] in FOOT and WRONG.start - 2 <= first["frame"] < WRONG.stop + 2
        page.keyboard.press("Alt+ArrowDown")
        browser.until(page, "studio.data.edits.corrections.length === 1")
        assert page.evaluate("studio.data.edits.corrections[0].joint") == first["joint"]


def post(url, path, body, origin=None):
    """Status of a request of the page."""
    head = {"Origin": url.rstrip("/") if origin is None else origin}
    request = urllib.request.Request(url + path, json.dumps(body).encode(), head)
    with contextlib.suppress(urllib.error.HTTPError), urllib.request.urlopen(request) as answer:
        return answer.status, json.loads(answer.read())
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(request)
    with refused.value as answer:
        return answer.code, answer.read().decode()


def test_a_start_is_placed_on_the_floor(clip, server):
    folder, _ = clip
    rows = table(folder / "clip/truth.csv")
    camera = Camera.read(str(folder / "clip/camera.json"))
    here, ahead = (np.array([float(rows[k][f"pelvis_{axis}"]) for axis in "xy"] + [0.0]) for k in (30, 45))
    with studio(server.url) as page:
        begin = screen(page, 30, camera.project(here))
        end = screen(page, 30, camera.project(ahead))
        page.keyboard.press("b")
        page.mouse.move(*begin)
        page.mouse.down()
        page.mouse.move(*end, steps=3)
        page.mouse.up()
        browser.until(page, "studio.data.start")
        assert "gait track" in page.locator("#start").inner_text()
    placed = Start.read(folder / "clip/video.mp4.studio/init.json", Model())
    assert placed.frame == 30
    assert placed.mean.pelvis[:2] == pytest.approx(here[:2], abs=0.05)
    way = ahead - here
    assert placed.mean.heading == pytest.approx(np.arctan2(way[1], way[0]), abs=0.1)
    phase = float(rows[30]["phase"])
    assert abs((placed.mean.phase - phase + 0.5) % 1 - 0.5) < 0.1


def test_the_film_comes_in_ranges_and_bad_requests_are_refused(clip, server):
    request = urllib.request.Request(server.url + "film.mp4", headers={"Range": "bytes=10-19"})
    with urllib.request.urlopen(request) as answer:
        assert answer.status == 206 and len(answer.read()) == 10
    pull = {"do": "pull", "frame": 3, "joint": "l_knee", "uv": [1, 2]}
    for wrong, words in (
        ({"frame": 99}, "frame is 99"),
        ({"joint": "tail"}, "joint is 'tail'"),
        ({"uv": [1]}, "uv has shape 1"),
        ({"uv": [1e9, 0]}, "far outside"),
        ({"do": "fly"}, "unknown"),
        ({"do": "pin", "joint": "l_heel", "uv": [240, -150]}, "above the horizon; click where"),
    ):
        status, text = post(server.url, "edit", pull | wrong)
        assert status == 409 and words in text
    assert post(server.url, "edit", [1])[0] == 400
    assert post(server.url, "edit", "x" * 20000)[0] == 413
    assert post(server.url, "redo", {})[0] == 409
    assert post(server.url, "edit", pull, origin="http://evil.example")[0] == 403
    assert json.loads((clip[0] / "clip/video.mp4.studio/corrections.json").read_text()) == {"corrections": []}


def test_what_is_saved_can_be_read(clip, server):
    """No request writes something into the file that the next start would reject."""
    folder, saved = clip[0], clip[0] / "clip/video.mp4.studio/corrections.json"
    pull = {"do": "pull", "frame": 30, "joint": "r_toe", "uv": [200.123456, 150], "sd_px": 2}
    assert post(server.url, "edit", pull)[0] == 200
    known = load_prior(None, print), range(FRAMES), Video(folder / "clip/video.mp4").size
    assert read_edits(saved, *known) == Edits((Correction(30, "r_toe", (200.12, 150.0), 2.0),))
    before, near = saved.read_bytes(), {"frame": 40, "joint": "r_heel", "uv": [200, 150], "sd_px": 2}
    requests = [("edit", {"do": do} | near) for do in ("pull", "pin")]
    requests += [("edit", {"do": "swap", "first": 3, "last": 5})]
    requests += [("edit", {"do": "hide", "first": 3, "last": 5, "joint": "r_toe"})]
    requests += [("edit", {"do": "remove", "list": "corrections", "index": 0})]
    requests += [("start", {"frame": 3, "from": [200, 150], "to": [210, 150]})]
    for path, request in requests:
        for key in request.keys() - {"do"}:
            for wrong in (True, "3", -9, 1e300, None, [True, 3], ["2", "3"], [], {}):
                status, text = post(server.url, path, request | {key: wrong})
                assert status == 409, (request, key, wrong, text)
    assert saved.read_bytes() == before


def test_fits_every_width_light_and_dark(server):
    with studio(server.url) as page:
        accessibility.check(page)
        for name in ("#film .stage", "#scene", "#curves", "#proposals"):
            box = page.locator(name).bounding_box()
            assert box["width"] > 200 and box["height"] > 20
        page.keyboard.press("?")
        accessibility.check_here(page)


def get(url, path):
    with urllib.request.urlopen(url + path) as answer:
        return answer.read()


def whole_motion(server):
    """Export the whole motion once it is solved, however busy the machine; fails if a process has ended."""
    while True:
        try:
            return get(server.url, "export/csv")
        except urllib.error.HTTPError as refused:
            words = refused.read().decode()
            assert "still being computed" in words, words


def test_pictures_are_corrected_as_the_batch_command_does(clip, monkeypatch):
    """Without a browser, as the page would request it."""
    folder, truth = clip
    here = folder / "pictures/clip"
    shutil.copytree(folder / "clip", here, ignore=shutil.ignore_patterns("*.studio"))
    words = ["--placement", "clip/init.json", "--background", "none", "--stop", "40"]
    server = Server(folder / "pictures", *words)
    target = (truth[20, JOINTS.index("l_ankle")] + [6.0, 0.0]).tolist()
    state = json.loads(get(server.url, "state"))
    assert set(state["without"]) == {"hide", "pin", "swap"} and state["proposals"]
    joint = state["joints"].index("l_ankle")
    before = math.dist(state["uv"][20][joint], target)
    pull = {"do": "pull", "frame": 20, "joint": "l_ankle", "uv": target, "sd_px": 1.0}
    near = post(server.url, "edit", pull)[1]
    assert math.dist(near["uv"][near["rows"].index(20)][joint], target) < 0.5 * before
    exported = whole_motion(server)
    state = json.loads(get(server.url, "state"))
    assert not state["refining"]
    assert math.dist(state["uv"][20][joint], target) < 0.5 * before and state["fault"] == ""
    (folder / "overlay.mp4").write_bytes(get(server.url, "export/mp4"))
    assert Video(folder / "overlay.mp4").count == 40
    assert server.end(signal.SIGINT) == 0
    monkeypatch.chdir(folder / "pictures")
    assert main([*state["command"].replace("motion.csv", "batch.csv").split()[1:], "--quiet"]) == 0
    assert (folder / "pictures/batch.csv").read_bytes() == exported


def test_a_track_is_corrected_as_the_batch_command_does(clip, monkeypatch):
    """Without a browser; the state is that of the page."""
    folder, truth = clip
    here = folder / "tracked/clip"
    shutil.copytree(folder / "clip", here, ignore=shutil.ignore_patterns("*.studio"))
    monkeypatch.chdir(here.parent)
    words = ["clip/video.mp4", "--camera", "clip/camera.json", "--particles", "300", "--stop", "40"]
    words += ["--init", "clip/init.json", "--quiet"]
    assert main(["track", *words, "-o", "track.csv"]) == 0
    server = Server(here.parent, "--track", "track.csv", "--stop", "40")
    state = json.loads(get(server.url, "state"))
    joint, target = state["joints"].index("r_ankle"), truth[20, JOINTS.index("r_ankle")] + [6.0, 0.0]
    assert math.dist(state["uv"][20][joint], truth[20, JOINTS.index("r_ankle")]) < 8
    pull = {"do": "pull", "frame": 20, "joint": "r_ankle", "uv": target.tolist(), "sd_px": 1.0}
    assert post(server.url, "edit", pull)[0] == 200
    exported = whole_motion(server)
    state = json.loads(get(server.url, "state"))
    assert math.dist(state["uv"][20][joint], target) < 3 and state["fault"] == ""
    assert server.end(signal.SIGINT) == 0
    assert main([*state["command"].replace("motion.csv", "batch.csv").split()[1:], "--quiet"]) == 0
    assert (here.parent / "batch.csv").read_bytes() == exported


def test_a_refused_start_leaves_nothing(clip, capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("GAIT_WEB", str(browser.FETCHED))
    shutil.copy(clip[0] / "clip/video.mp4", tmp_path)
    (tmp_path / "c.json").write_text('{"hidden": [{"first": true, "last": 5, "joint": "r_toe"}]}')
    film, camera = str(tmp_path / "video.mp4"), ["--camera", str(clip[0] / "clip/camera.json")]
    words = [
        *camera,
        "--keypoints",
        str(clip[0] / "keypoints.csv"),
        "--corrections",
        str(tmp_path / "c.json"),
    ]
    assert main(["studio", film, *words, "--port", "0", "--quiet"]) == 1
    assert "hidden entry 1: first is not a number" in capsys.readouterr().err
    assert main(["studio", film, *camera, "--start", str(FRAMES - 1), "--port", "0", "--quiet"]) == 1
    assert f"only 1 frame of {FRAMES} left, from {FRAMES - 1} on" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.json", "video.mp4"]


def test_usage_is_one_line(capsys, tmp_path, monkeypatch):
    assert main(["studio"]) == 2
    assert "give VIDEO, or --fetch" in capsys.readouterr().err
    assert main(["studio", "film.mp4", "--keypoints", "k.csv", "--start", "3"]) == 2
    assert "cut that file" in capsys.readouterr().err
    assert main(["studio", "film.mp4", "--camera", "camera.json", "--fov", "60"]) == 2
    assert "no --camera" in capsys.readouterr().err
    assert main(["studio", "film.mp4", "--keypoints", "k.csv", "--height", "1.75"]) == 2
    assert "gait camera --walk k.csv --size WxH --height 1.75" in capsys.readouterr().err
    monkeypatch.setenv("GAIT_WEB", str(tmp_path))
    assert main(["studio", "film.mp4"]) == 1
    assert "run gait studio --fetch once" in capsys.readouterr().err
