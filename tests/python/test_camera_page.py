"""Marks on the floor: their distances, the page on which they are clicked, and the resulting camera."""

import json
import signal

import accessibility
import browser
import cv2
import numpy as np
import pytest
import uvicorn

from gait import Camera, UserError
from gait.camera.camera import read_camera
from gait.camera.marks import coordinates, floor_lines, lens_of, place_marks, place_unknown
from gait.cli import main
from gait.web import camera_page

pytestmark = pytest.mark.long

SIZE = (1280, 720)
TRUE = Camera.looking([0.6, -6.0, 1.5], [1.2, 1.0, 0.6], SIZE, 1000.0)
MARKS = np.array([[0.0, 0.0], [2.4, 0.0], [2.9, 3.0], [-0.4, 2.5], [1.0, 1.2]])
UV = TRUE.project(np.pad(MARKS, ((0, 0), (0, 1))))
PAIRS = [(i, j) for j in range(5) for i in range(j)]
FAR = {(i, j): float(np.linalg.norm(MARKS[i] - MARKS[j])) for i, j in PAIRS}


def apart(camera):
    """How far a camera is from the true one as seen from the first mark, along the line to the second."""
    return np.linalg.norm(camera.centre - TRUE.centre)


def test_distances_give_coordinates():
    xy, off = coordinates(5, FAR)
    assert np.abs(off).max() < 1e-6
    np.testing.assert_allclose(np.abs(xy), np.abs(MARKS), atol=1e-5)
    assert xy[1, 1] == pytest.approx(0, abs=1e-9) and xy[1, 0] > 0


def test_the_picture_shows_which_side_marks_are_on():
    xy, _ = coordinates(5, FAR)
    for given in (xy, xy * [1, -1]):
        camera, off, used = place_marks(lens_of(SIZE, 1000.0), UV, given, mirrored=True)
        assert off.max() < 1e-3 and apart(camera) < 1e-3
        np.testing.assert_allclose(used, MARKS, atol=1e-4)


def test_too_few_distances_are_counted():
    few = dict(list(FAR.items())[:6])
    with pytest.raises(UserError, match="give 1 more distance between 5 marks"):
        coordinates(5, few)
    lonely = {pair: metres for pair, metres in FAR.items() if 4 not in pair} | {(0, 4): FAR[0, 4]}
    with pytest.raises(UserError, match="at least two distances to mark E"):
        coordinates(5, lonely)


def test_a_wrong_distance_is_named():
    words = "contradict each other by .* m, above all that between [A-E] and [A-E]; measure again"
    with pytest.raises(UserError, match=words):
        coordinates(5, FAR | {(0, 1): 4.4})


def test_the_focal_length_comes_from_marks():
    rng = np.random.default_rng(1)
    camera, off, _, sd = place_unknown(SIZE, UV, MARKS)
    assert camera.fx == pytest.approx(1000, rel=1e-3) and off.max() < 0.05 and sd < 0.1
    z = []
    for _ in range(10):
        camera, _, _, sd = place_unknown(SIZE, UV + rng.normal(0, 1, UV.shape), MARKS)
        z.append(np.log(camera.fx / 1000) / sd)
    assert 0.2 < np.std(z) < 3


def test_marks_that_leave_the_focal_length_open_are_refused():
    above = Camera.looking([0, -0.01, 8], [0, 0, 0], SIZE, 1000.0)
    uv = above.project(np.pad(0.3 * MARKS, ((0, 0), (0, 1))))
    with pytest.raises(UserError, match="do not determine the focal length; give --lens"):
        place_unknown(SIZE, uv, 0.3 * MARKS)
    with pytest.raises(UserError, match="4 do not determine"):
        place_unknown(SIZE, UV[:4], MARKS[:4])


def test_the_grid_lies_on_the_floor():
    lines = floor_lines(TRUE, MARKS)
    ground = TRUE.on_plane(np.concatenate(lines))
    assert len(lines) > 10 and np.isfinite(ground).all()
    whole = np.abs(ground[:, :2] - np.round(ground[:, :2])) < 0.06
    assert whole.any(axis=1).mean() > 0.98


def scene(folder, lens=TRUE):
    picture = np.full((SIZE[1], SIZE[0], 3), (150, 160, 150), np.uint8)
    for x, y in np.rint(UV).astype(int):
        cv2.circle(picture, (x, y), 4, (20, 20, 200), -1)
    return camera_page.Scene(
        "hall.png", SIZE, 1, lambda number: picture, lens, "a lens", str(folder / "camera.json")
    )


@pytest.mark.parametrize(
    ("marks", "words"),
    [
        ({}, "give numbers of pixels"),
        ({"uv": []}, "click 4 more marks"),
        ({"uv": UV[:3].tolist()}, "click 1 more mark on"),
        ({"uv": UV[:4].tolist(), "xy": [[0, 0]] * 3}, "give x and y of every mark"),
        ({"uv": UV[:4].tolist(), "xy": [[0, None]] * 4}, "give numbers of metres for every mark"),
        ({"uv": UV[:4].tolist(), "xy": [[0, 0], [1, 0], [2, 0], [3, 0]]}, "x, y, z are on a line"),
        ({"uv": UV[:4].tolist(), "distances": [[0, 1, -2]]}, "give distances in metres, above 0"),
        ({"uv": UV[:4].tolist(), "distances": [[0, 9, 2]]}, "give distances in metres, above 0"),
        ({"uv": UV[:4].tolist(), "distances": 3}, "give distances in metres, above 0"),
        ({"uv": [[1e9, 0]] * 4, "xy": [[0, 0]] * 4}, "give numbers of pixels"),
        ({"uv": [[1, 2]] * 61}, "give numbers of pixels"),
    ],
)
def test_faults_of_the_marks(marks, words, tmp_path):
    with pytest.raises(UserError, match=words):
        camera_page.solve(scene(tmp_path), marks)


@pytest.mark.parametrize(("width", "height", "dark"), [(1280, 720, True), (390, 844, False)])
def test_marks_are_clicked_and_the_camera_is_written(tmp_path, width, height, dark):
    lines = []

    def app(port):
        return camera_page.application(scene(tmp_path), port, lines.append)

    with browser.serving(app) as url, browser.opened(width, height, dark) as page:
        page.goto(url)
        status = page.locator("[role=status]")
        status.filter(has_text="click 4 more marks").wait_for()
        page.locator(".film img").evaluate("image => image.decode()")
        box = page.locator(".film canvas").bounding_box()
        for uv in UV[:4].tolist():
            x, y = page.evaluate("(uv) => window.page.picture.toScreen(uv)", uv)
            page.mouse.click(box["x"] + x, box["y"] + y)
        for i, j in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]:
            page.get_by_label(f"Metres from {'ABCD'[i]} to {'ABCD'[j]}").fill(
                f"{FAR[i, j]:.3f}".replace(".", ",")
            )
        status.filter(has_text="Fits").wait_for()
        if not dark:
            accessibility.check(page)
            page.set_viewport_size({"width": width, "height": height})
        page.reload()  # what was clicked is kept
        status.filter(has_text="Fits").wait_for()
        page.locator("button.primary").click()
        page.wait_for_selector("#written")
    camera = Camera.read(str(tmp_path / "camera.json"), SIZE)
    assert apart(camera) < (0.1 if width > 400 else 0.5)  # a click is within a pixel of the screen
    assert len(lines) == 1 and "camera.json: written" in lines[0]


def test_a_mark_is_moved_by_keys_and_removed(tmp_path):
    with (
        browser.serving(lambda port: camera_page.application(scene(tmp_path), port)) as url,
        browser.opened() as page,
    ):
        page.goto(url)
        page.locator("[role=status]").filter(has_text="click 4 more marks").wait_for()
        box = page.locator(".film canvas").bounding_box()
        for x, y in [(200, 300), (400, 320)]:
            page.mouse.click(box["x"] + x, box["y"] + y)
        before = page.evaluate("window.page.state.marks[1].uv")
        page.keyboard.press("ArrowRight")
        assert page.evaluate("window.page.state.marks[1].uv")[0] == pytest.approx(before[0] + 0.5, abs=0.06)
        page.get_by_label("Metres from A to B").fill("2")
        page.get_by_label("Remove mark A").click()
        assert page.evaluate("window.page.state.marks.length") == 1
        assert page.evaluate("Object.keys(window.page.state.lengths).length") == 0


@pytest.mark.parametrize(
    ("words", "code", "expected"),
    [
        (["--page", "a.mp4", "p.csv"], 2, "leave out POINTS.csv"),
        (["--page", "a.mp4", "--lens", "l.json", "--fov", "60"], 2, "leave out --lens or --fov"),
        (["--frame", "3", "p.csv", "--lens", "l.json"], 2, "--frame: is for --page"),
        (["--page", "absent.png"], 1, "absent.png: no such picture"),
        (["--page", "absent.mp4"], 1, "absent.mp4: no such video file"),
    ],
)
def test_wrong_usage(words, code, expected, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["camera", *words, "-o", "c.json"]) == code
    assert expected in capsys.readouterr().err


def test_a_lens_of_another_size_is_refused(tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((480, 640, 3), np.uint8))
    (tmp_path / "lens.json").write_text(json.dumps(TRUE.to_dict()))
    assert read_camera(str(tmp_path / "lens.json"), placed=False).size == SIZE
    words = [
        "--page",
        str(tmp_path / "a.png"),
        "--lens",
        str(tmp_path / "lens.json"),
        "-o",
        str(tmp_path / "c.json"),
    ]
    assert main(["camera", *words]) == 1
    assert "calibrated for 1280x720, the video is 640x480" in capsys.readouterr().err


def test_a_page_that_the_user_ends_is_no_failure(tmp_path, monkeypatch):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((480, 640, 3), np.uint8))

    def ended(server, sockets):
        sockets[0].close()
        signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr(uvicorn.Server, "run", ended)
    words = ["--page", str(tmp_path / "a.png"), "-o", str(tmp_path / "c.json"), "--port", "0"]
    assert main(["camera", *words]) == 0
