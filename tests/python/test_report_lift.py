"""`gait report lift`: figures and page, with and without a recording and a clip."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import accessibility
import numpy as np
import pytest
import threadpoolctl
from toy_segments import toy_blob, toy_prior

from gait.camera.camera import Camera
from gait.cli import main, report_lift
from gait.io.keypoints_file import Keypoints, read, write
from gait.learn.segments import motion as segment_motion
from gait.lift.report import motion_figures, segment_figures
from gait.lift.segment.explain import Uncertain
from gait.lift.segment.view import Parallel, Perspective, looking_along
from gait.lift.smooth import motion

MOCAP = Path(__file__).parents[2] / "../shared/data/mocap"
FIGURES = {"spectrum", "synthesis", "draws", "estimates", "uncertain"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    prior = toy_prior(6, 19, 4, seed=5)
    (tmp_path / "m.gait").write_bytes(toy_blob(prior))
    walk = prior.mean[0, :1] + np.arange(12)[:, None, None] * (0.02, 0, 0)  # as the prior's mean
    uv = 200 * walk[..., [0, 2]] * (1, -1)
    write("t.csv", Keypoints(np.arange(12), np.arange(12) / 20, prior.names, uv, np.ones(uv.shape[:2])))
    return tmp_path


@pytest.mark.long
def test_figures_of_a_draw(folder, capsys):
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--clip", "t.csv", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["bayes_mm"] < found["likelihood_mm"]
    assert found["bayes_mm"] < found["mean_mm"]
    page = (folder / "r/report.html").read_text(encoding="utf-8")
    assert "error of the Bayesian estimate" in page and "bayes_mm" not in page
    assert {p.stem for p in (folder / "r").glob("*.png")} == FIGURES | {"clip"}
    page = (folder / "r" / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(FIGURES) + 1
    assert 'src="http' not in page
    accessibility.check_file(folder / "r/report.html")


def test_the_variance_explained_is_that_of_the_segments_learnt_from(folder):
    prior = replace(toy_prior(6, 19, 4, seed=5), gamma=60.0)  # what other people ask for does not count
    assert prior.components == 1
    (folder / "m.gait").write_bytes(toy_blob(prior))
    found = segment_figures.case("m.gait", None, 1.7, "a draw", 1)
    drawn = segment_figures.spectrum(found).figure.axes[1].lines[0].get_ydata()
    rng = np.random.default_rng(2)
    inside = np.tensordot(rng.normal(size=(2000, prior.size)), prior.modes[0], 1)
    outside = rng.normal(size=inside.shape) * np.sqrt(prior.residual[0])[:, None]
    assert drawn[-1] == pytest.approx(
        100 * inside.var(axis=0).sum() / (inside + outside).var(axis=0).sum(), abs=1
    )
    assert 0 < drawn[0] < drawn[-1] < 100


def test_a_bad_clip_leaves_nothing(folder, capsys):
    (folder / "bad.csv").write_text("frame,time,m0_u,m0_v\n0,0,1,x\n")
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--clip", "bad.csv"]) == 1
    assert "bad.csv" in capsys.readouterr().err and not (folder / "r").exists()


@pytest.mark.parametrize("far", [False, True])
def test_dots_are_where_a_right_estimate_is(far):
    camera = Camera.looking((0, -6, 1.0), (0, 0, 1.0), (640, 480), 600)
    places = np.random.default_rng(0).normal(size=(2, 3, 3)) * 0.3
    view = Parallel(looking_along("y"), None, np.zeros(2)) if far else Perspective(camera)
    uv = 150 * places @ view.axes[:2].T + (40, 30) if far else camera.project(places)
    uv[1, 2] = np.nan
    keypoints = Keypoints(np.arange(2), np.arange(2) / 20, ("a", "b", "c"), uv, np.ones((2, 3)))
    left = Uncertain(0.0, *np.zeros((4, 3)))
    found = motion.Motion(("a", "b", "c"), places, places, places, uv[..., 0], 1.7, 1, True, 0.0, left)
    for frame, observed in ((0, 3), (1, 2)):
        drawn, points = motion_figures._in_picture(view, found, frame, keypoints)
        assert drawn.shape == (3, 2) and points.shape == (observed, 2)
        np.testing.assert_allclose(drawn[:observed], points, atol=1e-6)


def test_a_camera_is_of_a_clip(folder, capsys):
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--camera", "cam.json"]) == 2
    assert "give its keypoints with --clip" in capsys.readouterr().err and not (folder / "r").exists()


def test_the_method_is_of_a_clip(folder, monkeypatch, capsys):
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--method", "blend"]) == 2
    assert "give its keypoints with --clip" in capsys.readouterr().err and not (folder / "r").exists()
    lift, methods = motion.lift, []

    def watched(prior, keypoints, view, options, *args):
        methods.append(options.method)
        return lift(prior, keypoints, view, options, *args)

    monkeypatch.setattr(motion, "lift", watched)
    command = ["report", "lift", "-m", "m.gait", "-o", "r", "--clip", "t.csv"]
    assert main([*command, "--method", "blend"]) == 0 and methods == ["blend"]


def test_a_clip_is_lifted_in_one_thread_as_gait_lift_does_it(folder, monkeypatch, capsys):
    """Threads of the linear algebra slow each other down with matrices this small."""
    lift, observed = motion.lift, []

    def watched(prior, keypoints, *args):
        observed.append(({pool["num_threads"] for pool in threadpoolctl.threadpool_info()}, keypoints))
        return lift(prior, keypoints, *args)

    keypoints, _ = read("t.csv", toy_prior(6, 19, 4, seed=5).names)
    uv = keypoints.uv.copy()
    uv[6, 3] += 500
    write("t.csv", replace(keypoints, uv=uv))
    monkeypatch.setattr(motion, "lift", watched)
    with threadpoolctl.threadpool_limits(2):
        assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--clip", "t.csv"]) == 0
    threads, used = observed[0]
    assert threads == {1} and not used.visible[6, 3] and used.visible.sum() == used.visible.size - 1
    assert "dropped, far from" in capsys.readouterr().err


def test_an_interruption_leaves_nothing(folder, capsys, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(motion_figures, "clip", interrupted)  # after all other figures
    before = sorted(folder.iterdir())
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--clip", "t.csv"]) == 1
    assert "interrupted" in capsys.readouterr().err and sorted(folder.iterdir()) == before


@pytest.mark.parametrize("command", [["lift", "-m", "m.gait"], ["track", "t.csv"]])
def test_a_file_where_the_folder_shall_be(folder, capsys, command):
    (folder / "r").write_text("mine")
    assert main(["report", *command, "-o", "r"]) == 1
    assert "is a file; give the name of a folder" in capsys.readouterr().err
    assert (folder / "r").read_text() == "mine"


def test_markers_must_be_known(folder, capsys):
    path = MOCAP / "cmu_walk" / "35" / "35_01.amc"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    (folder / "m.gait").write_bytes(toy_blob(toy_prior(6, 21, 4)))
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--mocap", str(path)]) == 1
    assert "has no marker 'm19'" in capsys.readouterr().err


def test_a_recording(folder, capsys):
    path = MOCAP / "cmu_walk" / "35" / "35_01.amc"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--mocap", str(path), "--quiet"]) == 0
    assert "a segment of 35_01.amc" in (folder / "r" / "report.html").read_text()


@pytest.mark.parametrize("recording", ["walk", "run"])
def test_markers_that_a_recording_lacks_are_named(folder, capsys, recording):
    """They cover seconds of motion, but the head has no markers."""
    path = MOCAP / "trc" / f"motion_capture_{recording}.trc"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    assert main(["report", "lift", "-m", "m.gait", "-o", "r", "--mocap", str(path)]) == 1
    assert (
        f"{path}: never shows neck head_top, which the model's prior has; choose" in capsys.readouterr().err
    )
    assert not (folder / "r").exists()


@pytest.mark.parametrize(
    ("frames", "words"), [(4, "lasts 0.2 s, a segment of the model 0.3 s"), (9, "has gaps")]
)
def test_why_a_recording_has_no_segment(frames, words):
    prior = toy_prior(6, 19, 4)
    places = np.full((frames, 19, 3), np.nan)
    places[::2] = 0
    read = segment_motion.Motion(prior.names, places, places[:, 0], 1.7, places[:0, None])
    assert words in report_lift._why_no_segment(read, prior)


def test_every_figure_has_a_column_of_its_own():
    """One row drifts away, as least squares may: no figure is cut off or runs into the next."""
    rng = np.random.default_rng(1)
    names = ("head_top", "neck", "pelvis", "l_hip", "l_knee", "l_ankle", "r_hip", "r_knee", "r_ankle")
    truth = rng.normal(size=(9, len(names), 3)) * (0.3, 0.3, 0.4) + (0, 0, 0.8)
    off = truth + np.linspace(0, 2, 9)[:, None, None] * (1, 0, -1)
    strips = motion_figures.Strips(("truth", "off"), names, 1.7, 20.0)
    strips.add(0, truth, motion_figures.SIDE, "black")
    strips.add(1, truth, motion_figures.SIDE, "black", ghost=True)
    strips.add(1, off, motion_figures.SIDE, "blue", path=truth)
    figure = strips.figure()
    assert [text.get_text() for text in figure.axes[0].texts] == [
        f"{t:.2f} s" for t in (0, 0.1, 0.2, 0.3, 0.4)
    ]
    assert "0.5 m   bold: right side, thin: left" in [text.get_text() for text in figure.axes[1].texts]
    scales = []
    for axes, motions in zip(figure.axes, (1, 2), strict=True):
        drawn = [line.get_xydata() for line in axes.lines if line.get_linewidth() in (0.9, 1.8, 3.4, 4.3)]
        columns = np.array_split(np.arange(len(drawn) // motions), 5)
        reach = [
            [np.concatenate([drawn[m * len(drawn) // motions + k] for m in range(motions) for k in column])]
            for column in columns
        ]
        left, right = ([f(r[0], axis=0) for r in reach] for f in (np.min, np.max))
        assert all(a[0] < b[0] for a, b in zip(right, left[1:], strict=False))
        (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        assert low < left[0][0] and right[-1][0] < high
        assert bottom < min(each[1] for each in left) and max(each[1] for each in right) < top
        box = axes.get_position().bounds * np.tile(figure.get_size_inches(), 2)
        scales += [box[2] / (high - low), box[3] / (top - bottom)]
    np.testing.assert_allclose(scales, scales[0])  # of all rows, across and up
