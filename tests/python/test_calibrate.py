"""gait calibrate: known lenses are recovered, every fault is one line, boards are printed true to size."""

import json
import re
import struct

import cv2
import numpy as np
import pytest
from drawn_board import picture, poses, texture

from gait import Camera, VideoWriter
from gait.camera.board import OURS, Board, blur, print_board, read_board
from gait.camera.camera import read_camera
from gait.cli import main

SIZE = (640, 480)
BENT = np.array([-0.12, 0.06, 0.0008, -0.0006, 0.0])


def camera(size=SIZE, focal=560.0):
    return Camera(*size, focal, focal * 1.002, size[0] / 2 + 6, size[1] / 2 - 4, np.eye(3), np.zeros(3), BENT)


def pictures(folder, count, lens=None, board=OURS, suffix=".png", **how):
    """Pictures of a board; their names."""
    lens, sheet, names = lens or camera(), texture(board), []
    draw = {key: how.pop(key) for key in ("smear", "noise") if key in how}
    for k, (turn, shift) in enumerate(poses(count, board, **how)):
        names.append(str(folder / f"p{k:02d}{suffix}"))
        cv2.imwrite(names[-1], picture(lens, turn, shift, board, sheet, seed=k, **draw))
    return names


def run(words, capsys):
    code = main(["calibrate", *map(str, words)])
    return code, *capsys.readouterr()


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """Twelve pictures of the printed board."""
    return pictures(tmp_path_factory.mktemp("shown"), 12)


def test_a_known_lens_comes_back(shown, tmp_path, capsys):
    code, out, _ = run([*shown, "-o", tmp_path / "lens.json", "--json"], capsys)
    found, lens, figures = read_camera(str(tmp_path / "lens.json"), placed=False), camera(), json.loads(out)
    assert code == 0 and found.size == SIZE
    assert found.fx == pytest.approx(lens.fx, rel=0.01) and found.fy == pytest.approx(lens.fy, rel=0.01)
    assert abs(found.fx - lens.fx) < 4 * figures["focal_sd_px"]
    grid = np.stack(np.meshgrid([20, 320, 620], [20, 240, 460]), -1).reshape(-1, 2)
    apart = np.degrees(np.arccos(np.clip((found.rays(grid) * lens.rays(grid)).sum(-1), -1, 1)))
    assert apart.max() < 0.5
    assert figures["used"] == 12 and figures["rms_px"] < 0.15 and max(figures["error_px"].values()) < 0.3


@pytest.mark.long
def test_a_chessboard_without_markers(tmp_path, capsys):
    board, lens = Board(9, 6, False), camera()
    names = pictures(tmp_path, 12, lens, board, far=(2.2, 3.0))
    code, out, err = run([*names, "--board", "9x6", "-o", tmp_path / "lens.json", "--json"], capsys)
    assert code == 0, err
    assert read_camera(str(tmp_path / "lens.json"), placed=False).fx == pytest.approx(lens.fx, rel=0.01)


@pytest.mark.long
def test_sharp_frames_of_a_film_are_picked(tmp_path, capsys):
    """Every pose is held for a while; between poses the board is blurred by its motion."""
    lens, sheet = camera(), texture()
    with VideoWriter(tmp_path / "board.mp4", 24) as writer:
        for k, (turn, shift) in enumerate(poses(9)):
            still = picture(lens, turn, shift, sheet=sheet, seed=k)
            for grey in [cv2.GaussianBlur(still, (0, 0), 5)] * 3 + [still] * 3:
                writer.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    code, out, err = run([tmp_path / "board.mp4", "-o", tmp_path / "lens.json", "--json"], capsys)
    assert code == 0, err
    figures = json.loads(out)
    assert figures["used"] == 9 and figures["pictures"] == 18
    used = [int(name.split()[1]) % 6 for name in figures["error_px"]]
    assert all(number >= 3 for number in used), used
    assert read_camera(str(tmp_path / "lens.json"), placed=False).fx == pytest.approx(lens.fx, rel=0.01)


def test_the_text_names_what_is_missing_and_what_is_next(tmp_path, capsys):
    """A board that never comes near or into the corners."""
    sheet, lens, names = texture(), camera(), []
    for k, (turn, shift) in enumerate(poses(10, far=(3.2, 3.3))):
        middle = shift * [0.25, 0.25, 1]
        names.append(str(tmp_path / f"{k}.png"))
        cv2.imwrite(
            names[-1], picture(lens, np.copysign(turn, [turn[0], 1, turn[2]]), middle, sheet=sheet, seed=k)
        )
    code, out, _ = run([*names, "-o", tmp_path / "lens.json"], capsys)
    assert code == 0 and "px rms in all" in out and "0.png 0." in out
    wanted = re.findall("more certain with: (.*)", out)
    assert "the board in the upper left corner of the picture" in wanted
    assert "the board tilted by 30 degrees, its left edge nearer" in wanted
    assert any("nearer, so that it fills half" in words for words in wanted)
    assert f"gait camera --page VIDEO --lens {tmp_path / 'lens.json'}" in out


def fault(words, capsys, output):
    code, out, err = run([*words, "-o", output], capsys)
    assert code == 1 and out == "" and err.count("\n") == 1 and not output.exists(), err
    return err


def test_one_picture_is_not_enough(shown, tmp_path, capsys):
    err = fault(shown[:1], capsys, tmp_path / "l.json")
    assert "in 1 pose, 6 are needed; show it in 10 or more" in err


def test_one_pose_many_times_is_one_pose(tmp_path, capsys):
    turn, shift = next(poses(1))
    for k in range(8):
        cv2.imwrite(str(tmp_path / f"{k}.png"), picture(camera(), turn, shift, seed=k))
    assert "in 1 pose, 6" in fault(sorted(map(str, tmp_path.glob("*.png"))), capsys, tmp_path / "l.json")


def test_pictures_without_a_board(tmp_path, capsys):
    grey = np.random.default_rng(1).integers(0, 255, (240, 320), np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), cv2.GaussianBlur(grey, (0, 0), 3))
    err = fault([tmp_path / "a.png"], capsys, tmp_path / "l.json")
    assert "no ChArUco board of 7x5 squares in 1 pictures; show all of it" in err


def test_blurred_pictures_are_refused(tmp_path, capsys):
    names = pictures(tmp_path, 8, smear=(2.6, 0.0), far=(1.5, 1.7))
    assert "blurred in" in (err := fault(names, capsys, tmp_path / "l.json")) and "move it slowly" in err


@pytest.mark.long
def test_another_board_is_named(shown, tmp_path, capsys):
    other = pictures(tmp_path, 2, board=Board(7, 5, False), far=(2.2, 2.4))
    for given, board, words in (
        (other, "9x6", r"shows a chessboard of 7x5 inner corners; give --board 7x5"),
        (other, "charuco", r"shows a chessboard of 7x5 inner corners; give --board 7x5"),
        (shown[:1], "9x6", "shows the ChArUco board of 7x5 squares .*; leave out --board"),
    ):
        err = fault([*given, "--board", board], capsys, tmp_path / "l.json")
        assert re.search(words, err), err


def test_pictures_of_mixed_sizes(shown, tmp_path, capsys):
    turned, small = str(tmp_path / "turned.png"), str(tmp_path / "small.png")
    grey = cv2.imread(shown[0], 0)
    cv2.imwrite(turned, cv2.rotate(grey, cv2.ROTATE_90_CLOCKWISE))
    cv2.imwrite(small, cv2.resize(grey, (320, 240)))
    err = fault([*shown[:2], turned], capsys, tmp_path / "l.json")
    assert "turned.png: is 480x640, turned by 90 degrees" in err
    assert "small.png: is 320x240, " in fault([*shown[:2], small], capsys, tmp_path / "l.json")


def test_a_lens_that_changes_is_refused(shown, tmp_path, capsys):
    """Half of the pictures with another zoom."""
    names = pictures(tmp_path, 12, camera(focal=700.0), seed=2)
    err = fault([*shown[:6], *names[6:]], capsys, tmp_path / "l.json")
    assert re.search(
        r"focal length changes from 5[4-8]. px in the earlier pictures to (6[89]|7[012]). px", err
    )


def test_flat_poses_leave_the_focal_length_open(tmp_path, capsys):
    names = pictures(tmp_path, 8, tilt=0.01, noise=6.0, far=(2.5, 3.2))
    assert "do not determine the focal length" in fault(names, capsys, tmp_path / "l.json")


def test_a_picture_that_does_not_fit_is_left_out(shown, tmp_path, capsys):
    squeezed = cv2.warpAffine(cv2.imread(shown[3], 0), np.array([[0.9, 0.05, 20.0], [0, 1, 0]]), SIZE)
    cv2.imwrite(str(tmp_path / "squeezed.png"), squeezed)
    code, out, _ = run([*shown, tmp_path / "squeezed.png", "-o", tmp_path / "l.json", "--json"], capsys)
    assert code == 0 and json.loads(out)["left_out"] == [str(tmp_path / "squeezed.png")]


def test_a_lens_is_no_camera_yet(shown, tmp_path, capsys):
    assert run([*shown, "-o", tmp_path / "lens.json"], capsys)[0] == 0
    assert main(["track", "v.mp4", "--camera", str(tmp_path / "lens.json"), "-o", "o.csv"]) == 1
    lens = str(tmp_path / "lens.json")
    with pytest.raises(Exception, match="R and t are missing; place the camera: gait camera --lens"):
        Camera.read(lens)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "give a film or pictures and -o LENS.json"),
        (["a.png"], "give a film or pictures and -o LENS.json"),
        (["a.png", "-o", "l.json", "--board", "9"], "--board 9: give charuco"),
        (["a.png", "-o", "l.json", "--board", "2x9"], "--board 2x9: give charuco"),
        (["a.png", "b.mp4", "-o", "l.json"], "give one film, or only pictures"),
        (["a.png", "--print-board", "b.pdf"], "leave out the film"),
    ],
)
def test_wrong_usage(words, expected, capsys):
    code, _, err = run(words, capsys)
    assert code == 2 and expected in err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["absent.png", "-o", "l.json"], "absent.png: no such picture"),
        (["absent.mp4", "-o", "l.json"], "absent.mp4: no such video file"),
    ],
)
def test_files_that_are_not_there(words, expected, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(words, capsys)
    assert code == 1 and expected in err and err.count("\n") == 1


def test_a_file_that_is_no_picture(tmp_path, capsys):
    (tmp_path / "a.png").write_text("no picture")
    assert "a.png: cannot be read as a picture" in fault([tmp_path / "a.png"], capsys, tmp_path / "l.json")


@pytest.mark.parametrize(("name", "paper"), [("charuco", "a4"), ("9x6", "letter"), ("charuco", "a3")])
def test_a_board_is_printed_true_to_size(name, paper, tmp_path, capsys):
    code, out, _ = run(
        ["--print-board", tmp_path / "b.png", "--board", name, "--paper", paper, "--json"], capsys
    )
    side, data = json.loads(out)["square_mm"], (tmp_path / "b.png").read_bytes()
    at = data.index(b"pHYs") + 4
    dots = struct.unpack(">II", data[at : at + 8])
    assert code == 0 and dots == (11811, 11811)  # a metre: 300 an inch
    grey, board = cv2.imread(str(tmp_path / "b.png"), 0), read_board(name)
    number, uv = board.find(grey)
    millimetres = 1000 * uv / dots[0]
    apart = np.linalg.norm(millimetres[number == 0] - millimetres[number == board.columns - 1])
    assert apart == pytest.approx(side * (board.columns - 1), abs=0.15)
    below = grey[round(uv[:, 1].max() + 1.1 * side / 25.4 * 300) :]
    bar = np.flatnonzero(max(below, key=lambda row: (row == 0).sum()) == 0)
    assert 1000 * len(bar) / dots[0] == pytest.approx(100, abs=0.1) and np.ptp(bar) + 1 == len(bar)


def test_the_pdf_has_the_rectangles_of_the_board(tmp_path, capsys):
    assert run(["--print-board", tmp_path / "b.pdf"], capsys)[0] == 0
    text = (tmp_path / "b.pdf").read_text("latin-1")
    width, height = map(float, re.search(r"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", text).groups())
    assert np.array([width, height]) / 72 * 25.4 == pytest.approx([297, 210], abs=0.01)
    drawn = [list(map(float, row.split()[:4])) for row in text.splitlines() if row.endswith(" re")]
    assert len(drawn) == len(OURS.rectangles()) + 1
    assert np.ptp(np.array(drawn)[:-1, 0]) < 36 * 7 and "/PrintScaling /None" in text
    start = int(re.search(r"startxref\n(\d+)", text)[1])
    assert text[start : start + 4] == "xref"
    for number, place in enumerate(re.findall(r"^(\d{10}) 00000 n", text, re.M), 1):
        assert text[int(place) :].startswith(f"{number} 0 obj")


def test_blur_is_the_width_of_edges(tmp_path):
    print_board(tmp_path / "b.png", ".png", OURS, "a4")
    grey = cv2.resize(
        cv2.imread(str(tmp_path / "b.png"), 0), None, fx=0.3, fy=0.3, interpolation=cv2.INTER_AREA
    )
    number, uv = OURS.find(grey)
    for sd in (2.0, 3.0):
        across = blur(cv2.GaussianBlur(grey, (0, 0), sd), OURS, number, uv)
        assert across == pytest.approx(2.5 * sd, rel=0.3)  # an edge of sd s is s sqrt(2 pi) wide
        smeared = cv2.GaussianBlur(grey, (0, 0), sd, sigmaY=0.1)
        assert blur(smeared, OURS, number, uv) == pytest.approx(across, rel=0.25)
    assert blur(grey, OURS, number, uv) < 3
