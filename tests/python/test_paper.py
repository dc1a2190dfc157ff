"""`gait paper`: the papers' own algorithms find what was planted, and the page contains all figures."""

from __future__ import annotations

import csv
import itertools
import json
import re
from dataclasses import replace
from pathlib import Path

import accessibility
import browser
import mocap_files as files
import numpy as np
import pytest

from gait import Mode, TrackerConfig
from gait.body.skeleton import ANGLES, PAPER_ANGLES
from gait.cli import main
from gait.io.blob import decode, unpack_names
from gait.learn.corpus import load, sources
from gait.learn.report import figures_model
from gait.paper import clip as clips
from gait.paper import freeze, ladder, lifting, ormoneit, recordings, scene, tracking
from gait.report.figures import Drawing
from gait.reproducible import one_thread
from gait.simulate.scenario import PRESETS

FROZEN = Path(__file__).resolve().parents[1] / "bench" / "results" / "search_paper.csv"


@pytest.fixture(scope="module", autouse=True)
def alone():
    """BLAS in one thread, as in the command."""
    with one_thread():
        yield


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Folder of six toy walks of three people, two and a half strides each."""
    return files.write_people(tmp_path_factory.mktemp("walks"))


@pytest.fixture(scope="module")
def learning(walks):
    return ormoneit.learn(load.load_all(sources.find([str(walks)])[0]).sequences)


@pytest.mark.long
def test_whole_periods_are_found_but_a_long_walk_of_a_broken_one_is_not(learning):
    assert learning.agreeing == len(learning.walks)
    for found, walk in zip(learning.literal_walks, learning.walks, strict=True):
        assert found.period.frames == round(found.period.frames)
        assert found.period.frames == pytest.approx(walk.period.frames, abs=1)
    literal, refined = learning.long
    assert refined == pytest.approx(ormoneit.LONG_PERIOD, abs=0.05)
    assert abs(literal - ormoneit.LONG_PERIOD) > 1  # a multiple that is nearly whole


def test_offsets_from_zero_end_where_ours_do_and_the_error_falls(learning):
    course = np.array(learning.eight.found.objective)
    assert np.all(np.diff(course) <= 1e-9 * course[0]) and course[-1] < course[0]
    apart = np.angle(np.exp(2j * np.pi * (learning.eight.phases - learning.eight_ours.phases)))
    assert np.abs(apart).max() / (2 * np.pi) < 0.02


def test_removed_blocks_are_filled_better_than_by_the_mean(learning):
    removal = learning.removal
    assert np.all(np.diff(removal.passes) <= 1e-9)
    assert removal.literal < 0.5 * removal.mean
    assert len(figures_model.convergence(learning.literal).axes) == 2  # no likelihood to show


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--camera", "c.json"], "with walks; --camera is for a clip"),
        (
            ["--mocap", "absent", "--video", "v.mp4", "--camera", "c.json", "--init", "i.json"],
            "absent: no such file or folder; check the name; c.json: no such camera file",
        ),
        (["--mocap", "{walks}", "--video", "v.mp4"], "--video needs --camera and --init"),
        (["--mocap", "absent"], "absent: no such file or folder"),
        (["--mocap", "{one}"], "the first paper needs 3"),
        (["--mocap", "{still}"], "holds no walk, and the first paper needs 3"),
    ],
)
def test_what_is_missing_is_one_line(words, expected, walks, tmp_path, capsys):
    one = next(iter(sorted(walks.rglob("*.amc"))))
    still = tmp_path.with_name("still")
    files.write_toy(still, swing=0.0)
    words = [word.format(walks=walks, one=one, still=still) for word in words]
    assert main(["paper", *words, "-o", str(tmp_path / "p.html"), "--quiet"]) in (1, 2)
    error = capsys.readouterr().err
    assert expected in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_paper_mode_has_the_values_that_the_search_froze():
    paper = {item.name: item.paper for item in TrackerConfig.settings()}
    with open(FROZEN, newline="", encoding="utf-8") as file:
        frozen = {row["setting"]: float(row["frozen"]) for row in csv.DictReader(file)}
    assert len(frozen) >= 12
    with open(FROZEN.with_name("search_paper_lost.csv"), newline="", encoding="utf-8") as file:
        tried = {
            float(row["stayed_nats"]): float(row["difference of shares"]) for row in csv.DictReader(file)
        }
    frozen["stayed_nats"] = max(tried, key=lambda nats: (tried[nats], nats))
    assert {name: paper[name] for name in frozen} == pytest.approx(frozen, rel=1e-3)


def test_a_person_is_held_by_the_last_frames_alone_and_marks_by_hand_may_be_farther_off():
    marked = list(range(0, 51, 6))  # of these 42 and 48 are among the last ten
    near = np.array([50.0] * 7 + [11.0, 7.0])
    for errors, held in ((near, (True, True)), (near + 3.0, (False, True)), (near + 8.0, (False, False))):
        tail = tracking._tail(marked, errors)
        assert len(tail) == 2
        assert tuple(tracking.followed(tail, 100.0, by_hand) for by_hand in (False, True)) == held
    assert not tracking.followed(tracking._tail(marked[:7], near[:7]), 1e6, True)  # nothing to judge by


ADDED = (  # settings that change from rung to rung, with the mode and the model of the rung
    *(set(ladder.UNSEARCHED), {"model", "components"}, {"model"}, set(ladder._RELAXING)),
    *(set(ladder._TURNING), {"particles"}, {"resample_ess"}),
    *({"mode", "texture_weight", "joint_sd_model", "components"}, {"model"}, {"model"}),
    *({"terms"}, {"terms"}, {"terms"}, {"evidence_time"}, {"rejuvenation_time"}, {"offset_angles"}),
    {"stature_noise", "stature_noise_start"},
)


def test_the_ladder_goes_from_the_paper_to_the_default_and_adds_one_thing_a_rung():
    assert (
        not ladder.PAPER_RUNG.changes
        and ladder.PAPER_RUNG.mode == Mode.PAPER
        and ladder.PAPER_RUNG.model == "paper"
    )
    assert not ladder.RUNGS[-1].changes and ladder.RUNGS[-1].mode == Mode.DEFAULT
    fields = [item.name for item in TrackerConfig.settings()]
    settings = [
        {name: getattr(ladder.config_of(rung, 1), name) for name in (*fields, "mode")}
        | {"model": rung.model, "acquisition_particles": 0}  # which only a start without a phase has
        for rung in ladder.RUNGS
    ]
    for added, (before, after) in zip(ADDED, itertools.pairwise(settings), strict=True):
        changed = {name for name in after if after[name] != before[name]}
        assert changed and changed <= added


def test_the_models_of_the_ladder_differ_in_one_thing_a_rung():
    shipped = Path(ladder.__file__).parents[1] / "data"
    found = ladder.blobs(*((shipped / f"{name}.gait").read_bytes() for name in ("paper", "walk")))
    assert list(found) == list(ladder.FREE)
    sections = [decode(found[name]) for name in ("rigid", "plain", "root", "people")]
    names = unpack_names(sections[0]["CHNM"])
    moving = [
        {name for k, name in enumerate(names) if np.ptp(each["CURV"][:, :, k], axis=1).any()}
        for each in sections
    ]
    assert moving[1] - moving[0] == set(ANGLES) - set(PAPER_ANGLES) and moving[0] > set(PAPER_ANGLES)
    assert moving[2] - moving[1] == {"root_forward", "root_sway", "root_height"} and moving[2] == moving[3]
    assert ["PACE" in each for each in sections] == [False, False, False, True]


def test_the_plot_of_the_ladder_has_each_rungs_own_cycle():
    without = {name: 40.0 + k for k, name in enumerate((ladder.STATIC_POSE, *ladder.FREE.values()))}
    tracked = {rung.name: 60.0 - k for k, rung in enumerate(ladder.RUNGS)}
    axes = ladder.plot(without | tracked).axes[0]
    assert [bar.get_width() for bar in axes.patches] == [*without.values(), *tracked.values()]
    free = [line.get_xdata()[0] for line in axes.lines]  # of the rung's own model, without any image
    assert free == [without[ladder.FREE[rung.model]] for rung in ladder.RUNGS]


@pytest.mark.long
def test_the_page_holds_every_figure_and_needs_no_other_file(walks, learning, tmp_path, monkeypatch, capsys):
    """A whole run on toy walks and a small rendered clip."""
    small = replace(PRESETS[clips.PRESET], size=(320, 240), frames=16)
    monkeypatch.setitem(PRESETS, clips.PRESET, small)
    monkeypatch.setattr(tracking, "FIGURE_FRAMES", 12)
    monkeypatch.setattr(tracking, "FIGURE_SHOWN", (0, 6, 12))
    monkeypatch.setattr(tracking, "PAPER_PARTICLES", 200)
    monkeypatch.setattr(tracking, "SEEDS", 2)
    monkeypatch.setattr(ladder, "SEEDS", 1)
    few = {"particles": 200}
    monkeypatch.setattr(ladder, "RUNGS", [replace(rung, changes=rung.changes | few) for rung in ladder.RUNGS])
    monkeypatch.setattr(ladder, "PAPER_RUNG", ladder.RUNGS[1])
    monkeypatch.setattr(scene, "PRESET_VIEWS", {"side": "demo"})
    monkeypatch.setattr(scene, "VIEW_SIZE_PX", (320, 240))
    monkeypatch.setattr(lifting, "LIFTED_FRAMES", 14)
    monkeypatch.setattr(recordings, "ECLECTIC", 4)
    monkeypatch.setattr(recordings, "cores", lambda: 1)
    monkeypatch.setattr(ormoneit, "learn", lambda *_: learning)  # of the same walks
    monkeypatch.setattr(Drawing, "png", lambda self: b"PNG")  # Matplotlib takes a second for each
    page = tmp_path / "a.html"
    assert main(["paper", "--mocap", str(walks), "-o", str(page), "--quiet", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [len(each) for each in found.values()] == [8, 8]
    text = page.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert re.search(r"without any image, .* likelihood (gains|loses) \d+ mm", text)
    edges, total = (
        [float(x) for x in re.findall(r"<td>([-+.\d]+)", re.search(rf">{name}.*?</tr>", text)[0])]
        for name in (freeze.LAST_CASE, "log-likelihood, their sum")
    )
    assert len(edges) == len(total) == 3 and np.abs(edges).max() < 0.3 < np.abs(total[:2]).min()
    for heading in (name for each in found.values() for name in each):
        assert text.count(heading) >= 2  # in the table and over its pictures
    assert text.count("<img") >= 15 and "<animate" in text
    with browser.opened(strict=False) as shown:  # without Chromium the rest of this test is skipped
        shown.goto(page.as_uri())
        accessibility.check(shown)
