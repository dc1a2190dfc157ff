"""The report of gait learn: its figures show the data, on ordinary and unusual input."""

import contextlib
import io
import json
from dataclasses import replace
from html.parser import HTMLParser
from types import SimpleNamespace

import accessibility
import mocap_files as files
import numpy as np
import pytest

import gait.cli
from gait.body.skeleton import ANGLES, CHANNELS
from gait.learn.corpus import load, sources
from gait.learn.options import LearnOptions
from gait.learn.prior import fit
from gait.learn.report import figures, figures_model
from gait.learn.report import page as pages
from gait.learn.report.figures_model import SHOWN_ANGLES
from gait.report.figures import Drawing
from gait.reproducible import one_thread

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", autouse=True)
def as_the_command_does():
    with one_thread():
        yield


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Six toy walks of three subjects and a broken file."""
    folder = files.write_people(tmp_path_factory.mktemp("walks"))
    (folder / "02/02_99.amc").write_text(files.BROKEN)
    return folder


@pytest.fixture(scope="module")
def sequences(walks):
    return load.load_all(sources.find([str(walks)])[0]).sequences


@pytest.fixture(scope="module")
def learned(sequences):
    return fit.fit(sequences, LearnOptions(components=3))


class Page(HTMLParser):
    """Check that elements nest; collect texts, links and pictures."""

    def __init__(self, text):
        super().__init__()
        self.open, self.texts, self.links, self.ids, self.pictures, self.cells = [], [], [], [], [], 0
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        named = dict(attributes)
        self.ids += [named["id"]] if "id" in named else []
        self.links += [named["href"]] if tag == "a" else []
        self.pictures += [named["src"]] if tag == "img" else []
        self.cells += tag == "td"
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def report(walks, tmp_path_factory):
    """The report that the command wrote over an earlier one, and its summary."""
    folder = tmp_path_factory.mktemp("deep") / "report"
    folder.mkdir()
    (folder / "strip-9.png").write_bytes(b"of an earlier run")
    words = ["learn", str(walks), "-o", str(folder.parent / "m.gait"), "--components", "3"]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert gait.cli.main([*words, "--report", str(folder), "--json"]) == 0
    return folder, json.loads(out.getvalue())


def test_the_page_holds_everything_and_needs_nothing(report):
    folder, summary = report
    page = Page((folder / "index.html").read_text())
    accessibility.check_file(folder / "index.html")
    stems = {p.stem for p in folder.glob("*.png")}
    strips = {"strip-rate", *(f"strip-{k + 1}" for k in range(summary["components"]))}
    assert stems == strips | {
        "strip-mean", "alignment", "convergence", "components", "cycles", "missing", "periods", "residuals",
        "snr", "spectrum", "subjects",
    }  # fmt: skip
    assert all(p.read_bytes()[:4] == b"\x89PNG" and p.stat().st_size > 5000 for p in folder.glob("*.png"))
    assert len(page.pictures) == len(stems) and all(s.startswith("data:image/png") for s in page.pictures)
    assert (
        {link.removeprefix("#") for link in page.links} == set(page.ids) == stems | {"sequences", "left-out"}
    )
    assert page.cells == 10 * 6 and sum("02_99.amc:3" in t for t in page.texts) == 1
    assert any("mocap.cs.cmu.edu" in t for t in page.texts)
    assert [row["subject"] for row in summary["by_subject"]] == summary["subjects"]
    assert all(row["left_out_mm"] > row["learnt_from_mm"] > 0 for row in summary["by_subject"])


def test_the_table_shows_what_was_cut_and_why_a_sequence_was_taken(learned):
    first = replace(learned.sequences[0], kept=(120, 400), cut=("it stands <still>", ""))
    unusual = replace(learned, sequences=[first, *learned.sequences[1:]])
    page = Page(pages._sequences(unusual))
    assert "120 to 399 (before: it stands <still>)" in page.texts
    assert any("repeats 0.9" in t or "repeats 1" in t for t in page.texts)
    assert "SNR" in page.texts and f"{np.nanmax(first.period.scores):.0f}" in page.texts


def test_the_ratio_peaks_at_the_period_and_noise_is_flat(learned):
    figure = figures.ratios(figures.richest(learned))
    rows, total = figure.axes[:-1], figure.axes[-1]
    assert [axes.get_ylabel() for axes in rows][:2] == ["white noise", "neck x"] and len(rows) == 25
    noise = rows[0].lines[0].get_ydata()
    assert 0.9 < np.nanmean(noise) < 1.1 and np.nanmax(noise) < rows[0].get_ylim()[1] / 2
    best = total.lines[-1].get_xdata()[0]
    assert best == pytest.approx(figures.richest(learned).period.frames, abs=1.5)


def test_the_map_of_periods_shows_every_peak_however_narrow(learned):
    (image,) = figures.periods(learned).axes[0].images
    for row, s in zip(image.get_array(), learned.sequences, strict=True):
        assert np.nanmax(row) == 1
        assert figures.GRID[np.nanargmax(row)] == pytest.approx(s.period.frames / s.fps, abs=0.011)


def test_alignment_brings_the_curves_together(learned):
    figure = figures.alignment(learned)
    before, after = figure.axes[:2]

    def sd(axes):
        """Mean distance of the drawn curves from the drawn mean."""
        x, mean = axes.lines[-1].get_data()
        parts = [
            np.interp(np.asarray(line.get_xdata()), x, mean) - line.get_ydata() for line in axes.lines[:-1]
        ]
        return np.nanmean(np.abs(np.concatenate(parts)))

    assert len(before.lines) == len(learned.sequences) + 1
    assert sd(after) < 0.4 * sd(before)


def test_a_strip_shows_the_person_plus_and_minus_two_sd(learned):
    turned = learned.curves[1]
    figure = figures_model.strip(learned, turned)
    side = figure.axes[0]
    assert len(side.lines) == 3 * 8 * 9 + 1  # turns, phases, chains; the ground
    heights = np.concatenate([np.asarray(line.get_ydata()) for line in side.lines])
    assert heights.min() == pytest.approx(0, abs=1e-9) and 0.9 < heights.max() < side.get_ylim()[1] < 1.2
    mean, less, more = (
        figures_model.bodies(learned, learned.curves[0] + turn * turned) for turn in (0.0, -2.0, 2.0)
    )
    assert np.abs(more - less).max() > 0.02
    assert (more + less) / 2 == pytest.approx(mean, abs=0.05)


@pytest.mark.parametrize(("cycles", "named"), [((9, 1, 9), ["a", "b", "c"]), ((99, 1, 3), ["a", "b", ""])])
def test_names_in_the_map_do_not_lie_over_each_other(cycles, named):
    rows = np.repeat([0, 1, 2], cycles)
    mask = np.ones((len(rows), 4, len(CHANNELS)), bool)
    few = SimpleNamespace(row_subject=rows, subjects=["a", "b", "c"], cycles=SimpleNamespace(mask=mask))
    labels = figures.missing(few).axes[0].get_yticklabels()
    assert [label.get_text() for label in labels] == named


def test_a_subject_left_out_is_followed_less_well(learned):
    for axes in figures.errors(learned).axes:
        within, without = (np.asarray(line.get_xdata()) for line in axes.lines)
        assert np.all(without > within) and np.all(within > 0)


def test_residuals_in_millimetres_are_those_of_the_joints(learned):
    """A knee bent too little by a known angle moves the ankle by the shank times that angle."""
    values = np.repeat(learned.curves[:1], 6, axis=0)
    subject = np.repeat([0, 1, 2], 2)
    knee = CHANNELS.index("r_knee_flexion")
    values[subject == 2, :, knee] += 0.01
    mask = np.ones(values.shape, bool)
    body = learned.proportions

    def residuals(mask):
        rows = SimpleNamespace(values=values, mask=mask)
        return fit._subject_residuals(rows, learned.scale, subject, 0, body)

    found = residuals(mask)
    off = np.array([0.01 / 3, 0.01 / 3, 0.02 / 3])  # from the mean of all
    assert found.degrees[0] == pytest.approx(np.degrees(off / np.sqrt(len(ANGLES))))
    assert found.millimetres[0] == pytest.approx(1700 * body.shank * off / 14, rel=1e-4)
    assert found.degrees[1] == pytest.approx(
        np.degrees(np.array([0.005, 0.005, 0.01]) / np.sqrt(len(ANGLES)))
    )
    mask[subject == 2, :, knee] = False
    blind = residuals(mask)
    assert np.isnan(blind.millimetres[:, 2]).all() and np.isfinite(blind.degrees).all()


def one_file(sequences):
    return fit.fit(sequences[:1], LearnOptions(components=1))


def lower_body(sequences):
    """Only the legs were recorded."""
    legs = np.array([any(part in name for part in ("hip", "knee", "ankle")) for name in ANGLES])
    cut = [replace(s, channels=s.channels.copy()) for s in sequences[::2]]
    for s in cut:
        s.channels[:, : len(ANGLES)][:, ~legs] = np.nan
    return fit.fit(cut, LearnOptions(components=2))


def many_subjects(sequences):
    """More sequences than have names or are drawn, more subjects than have a legend or a separate fit."""
    many = [
        replace(s, subject=f"{s.subject}{k}", name=f"{s.name}_{k}") for k in range(13) for s in sequences[:1]
    ]
    return fit.fit(many, LearnOptions(components=4))


@pytest.mark.filterwarnings("error::RuntimeWarning:gait.learn.prior.model")
@pytest.mark.parametrize("make", [one_file, lower_body, many_subjects])
def test_unusual_input_gives_a_report_too(sequences, tmp_path, monkeypatch, make):
    monkeypatch.setattr(figures, "MOST_NAMED_ROWS", 10)
    monkeypatch.setattr(figures, "MOST_SEQUENCES", 10)
    monkeypatch.setattr(Drawing, "png", lambda self: self.figure.draw_without_rendering() or b"PNG")
    unusual = make(sequences)
    pages.write(tmp_path, unusual, LearnOptions(activity="walk & run"), [], [], {})
    page = Page((tmp_path / "index.html").read_text())
    assert "Cyclic model of walk & run" in page.texts and "left-out" not in page.ids
    assert len(page.pictures) >= 10 and page.cells == 10 * len(unusual.sequences)
    assert ("subjects" in page.ids) == (make is lower_body)
    texts = [t.get_text() for axes in figures.cycles(unusual).axes for t in axes.texts]
    unseen = [name for name in SHOWN_ANGLES if not unusual.cycles.mask[:, :, CHANNELS.index(name)].any()]
    assert texts == ["not observed"] * len(unseen) and bool(unseen) == (make is lower_body)


def test_a_foreign_page_is_kept_and_one_of_ours_replaced(walks, report, tmp_path, capsys):
    page = tmp_path / "site/index.html"
    page.parent.mkdir()
    page.write_text("<title>Home</title>" + "gait learn" * 1000)
    words = ["learn", str(walks), "-o", str(tmp_path / "m.gait"), "--report", str(page.parent), "--quiet"]
    assert gait.cli.main(words) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and "index.html there was not made by gait learn; choose another" in err
    assert "Home" in page.read_text() and not (tmp_path / "m.gait").exists()
    pages.require_own(report[0])


@pytest.mark.parametrize("place", ["{tmp}/file", "{tmp}/file/below"])
def test_a_place_that_is_no_folder_is_refused_before_the_work(walks, tmp_path, capsys, place):
    (tmp_path / "file").write_text("")
    words = ["learn", str(walks), "-o", str(tmp_path / "m.gait"), "--report", place.format(tmp=tmp_path)]
    assert gait.cli.main(words) == 1
    err = capsys.readouterr().err
    assert "is a file; give the name of a folder" in err and err.count("\n") == 1
    assert not (tmp_path / "m.gait").exists()
