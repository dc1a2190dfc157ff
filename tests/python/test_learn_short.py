"""Trials of little more than a stride: their period from steps, and several of a person learnt together."""

from pathlib import Path

import gait_generator as g
import mocap_files as files
import numpy as np
import pytest

from gait import cli
from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.learn.corpus import load
from gait.learn.cycles import period, sequence, stride, verdict
from gait.learn.options import LearnOptions
from gait.learn.solve import readers
from gait.reproducible import one_thread

MORE = Path(__file__).resolve().parents[2] / "../shared/data/mocap/more"
FPS, TRUE = 100.0, 108.0
COLUMNS = {"shoulder_flexion": 0, "elbow_flexion": 3, "hip_flexion": 4, "knee_flexion": 7}


@pytest.fixture(autouse=True)
def single():
    with one_thread():
        yield


def walking(cycles, seed=0, unlike=0.0):
    """Angles (T, 24), radians, of a walk whose left side is shifted by 3 degrees, plus `unlike`."""
    rng, frames = np.random.default_rng(seed), round(cycles * TRUE)
    angles = np.full((frames, len(ANGLES)), np.nan)
    start = rng.uniform(0, 1)
    for side, shift in (("r", 0.0), ("l", 0.5)):
        curve = g.mean_curves(np.arange(frames) / TRUE + start + shift)[:, 3:11]
        for name, k in COLUMNS.items():
            change = (3 + unlike * np.sin(np.arange(frames) / 9)) * (side == "l")
            angles[:, ANGLES.index(f"{side}_{name}")] = curve[:, k] + change + rng.normal(size=frames)
    return np.radians(angles)


@pytest.mark.parametrize("cycles", [1.1, 1.25, 1.4])
def test_steps_give_the_period_of_hardly_more_than_a_stride(cycles):
    found = [stride.find_by_steps(walking(cycles, seed), FPS).frames for seed in range(8)]
    assert np.abs(np.array(found) / TRUE - 1).max() < 0.03
    assert stride.step_repeats(walking(cycles), TRUE) > 0.9
    assert stride.step_repeats(walking(cycles), 0.75 * TRUE) < 0.8


def test_nothing_visible_has_no_period():
    assert np.isnan(stride.find_by_steps(np.full((120, len(ANGLES)), np.nan), FPS).frames)
    assert np.isnan(stride.step_repeats(np.full((120, len(ANGLES)), np.nan), TRUE))
    assert np.isnan(stride.find_by_steps(walking(0.3), FPS).frames)


def test_sides_that_move_otherwise_are_refused():
    unlike = walking(1.2, unlike=40.0)
    found = stride.find_by_steps(unlike, FPS)
    assert not verdict.judge(unlike, found, None, "walk", by_steps=True).accepted


def test_a_value_just_below_its_limit_is_not_rounded_to_it():
    assert str(verdict.Evidence("n", 1.496, 1.5, words="short")) == "short (n 1.496, at least 1.5)"
    assert str(verdict.Evidence("n", 1.31, 1.5, words="short")) == "short (n 1.3, at least 1.5)"


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    """Three people: Ida with three trials of 1.2 strides, Max with one, and a long walk."""
    folder = tmp_path_factory.mktemp("trials")
    for k in range(3):
        files.write_toy(folder / "11", f"11_0{k}", period=110.0, frames=135, offset=30.0 * k, seed=k)
    files.write_toy(folder / "12", "12_01", period=110.0, frames=135)
    files.write_toy(folder / "13", "13_01", period=115.0, frames=400)
    return folder


def test_short_trials_of_one_person_are_that_persons_cycles(trials, tmp_path, capsys):
    out = tmp_path / "m.gait"
    words = ["learn", str(trials), "-o", str(out), "--components", "2", "--segments", "none", "--jobs", "1"]
    assert cli.main(words) == 0
    printed = capsys.readouterr()
    assert "4 sequences of 2 subjects (11 13)" in printed.out
    assert "12_01.amc: the trial is too short by itself: 1.23 cycles (at least 1.5); add more" in printed.err


def test_a_short_trial_named_by_itself_is_an_error(trials):
    path = trials / "12/12_01.amc"
    made = sequence.load(path)
    assert made.short and made.period.frames == pytest.approx(110, rel=0.03)
    assert made.cycles < period.FEWEST_CYCLES
    with pytest.raises(UserError, match="too short by itself"):
        load.load_all([(path, False), (trials / "13/13_01.amc", True)], LearnOptions(jobs=1))


@pytest.mark.skipif(not MORE.is_dir(), reason="needs recordings of further people beside the repository")
@pytest.mark.parametrize(("name", "true"), [("mcgill/m04/m04_01", 1.02), ("btk/b6/b6_01", 1.06)])
def test_parts_of_recorded_walks_have_the_period_of_the_whole(name, true):
    path = MORE / f"{name}.trc"
    body = readers.read(path)
    part = body.part(0, round(1.2 * true * body.fps))
    made = sequence.prepare(path, part)
    assert made.short and made.period.frames / made.fps == pytest.approx(true, rel=0.04)
