"""The figure of `make bench` shows every row of the table."""

import csv
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench_plot

SIZES = ["640x480", "1920x1080"]


def row(section, particles, threads="1", size=SIZES[0], isa="avx2", **others):
    """A row as the bench writes it."""
    width, height = size.split("x")
    fixed = {"section": section, "what": "default", "isa": isa, "width": width, "height": height}
    times = {"median_ms": 4, "cpu_ms": 4, "ratio": 1, "bytes": 1000 * particles}
    stages = {
        "stage_features_ms": 1,
        "stage_likelihood_ms": 2,
        "likelihood_raster_ms": 1,
        "stage_lag_ms": 0.5,
    }
    return {**fixed, "particles": particles, "threads": threads, **times, **stages, **others}


@pytest.fixture
def figure(tmp_path):
    """What is drawn of a small table."""
    rows = [
        *(row("modes", 2000, n, what=what) for what in ("default", "paper") for n in "12"),
        row("modes", 2000, "2", what="twins", ratio=1.25),
        *(row("isa", 1000, isa=isa) for isa in ("scalar", "avx2")),
        *(row("particles", n) for n in (100, 3000)),
        *(row("threads", n, t, ratio=1 / int(t)) for n in (100, 3000) for t in "12"),
        *(row("pictures", 500, size=size) for size in SIZES),
        {"section": "limit", "what": "limit_both", "isa": "avx2", "threads": "1", "cpu_ms": 9},
    ]
    path = tmp_path / "a-machine.csv"
    with path.open("w", newline="") as f:
        table = csv.DictWriter(f, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return bench_plot.figure_of(path)


def words(texts):
    """Contents of texts."""
    return [t.get_text() for t in texts]


def test_every_section_has_its_panel(figure):
    modes, stages, particles, threads, memory, pictures = figure.axes
    assert words(modes.get_xticklabels()) == ["default\n2,000", "paper\n2,000"]
    assert [len(bars) for bars in modes.containers] == [2, 2] and words(modes.texts) == ["250"] * 4
    assert words(stages.get_yticklabels()) == ["scalar\n4,000 ns", "avx2\n4,000 ns"]
    assert [list(line.get_xdata()) for line in particles.lines] == [[100, 3000]] * 2
    assert [list(line.get_ydata()) for line in threads.lines] == [[1, 1], [2, 2], [1.6]]
    assert words(memory.texts) == ["0.1", "3.0"]
    assert words(pictures.get_xticklabels()) == SIZES


def test_the_likelihood_is_drawn_by_its_parts_and_the_bars_are_whole(figure):
    stages = figure.axes[1]
    assert words(stages.get_legend().get_texts()) == ["features", "raster", "lag", "the rest"]
    ends = [bar.get_x() + bar.get_width() for bar in stages.containers[-1]]
    assert ends == pytest.approx([100, 100])
