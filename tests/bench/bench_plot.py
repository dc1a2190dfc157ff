"""Draw what ``make bench`` wrote: speed, stages, and cost by particles, threads, memory and picture size."""

from __future__ import annotations

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

Row = dict[str, str]


def section(rows: list[Row], name: str) -> list[Row]:
    """Rows of one table of the bench."""
    return [r for r in rows if r["section"] == name]


def number(row: Row, name: str) -> float:
    """A number of a row; 0 if it was not measured."""
    return float(row[name] or 0)


def per_particle(row: Row, name: str) -> float:
    """Convert milliseconds per step to nanoseconds per particle."""
    return 1e6 * number(row, name) / number(row, "particles")


def by_threads(rows: list[Row]) -> dict[str, list[Row]]:
    """Rows of each number of threads, in the order of the table."""
    return {n: [r for r in rows if r["threads"] == n] for n in dict.fromkeys(r["threads"] for r in rows)}


def threads(count: str) -> str:
    """Label for a number of threads."""
    return f"{count} thread{'s' if count != '1' else ''}"


def stages(row: Row) -> list[str]:
    """Columns of a step's stages, with the likelihood split into its parts."""
    parts = [name for name in row if name.startswith("likelihood_")]
    whole = [name for name in row if name.startswith("stage_")]
    at = whole.index("stage_likelihood_ms")
    return whole[:at] + parts + whole[at + 1 :]


def draw_modes(axes: Axes, rows: list[Row]) -> None:
    """Frames per second of the usual settings, by time of day."""
    runs = by_threads([r for r in section(rows, "modes") if r["what"] != "twins"])
    for k, (count, of) in enumerate(runs.items()):
        at = [i + 0.4 * k for i in range(len(of))]
        rates = [1e3 / number(r, "median_ms") for r in of]
        bars = axes.bar(at, rates, 0.4, label=threads(count))
        axes.bar_label(bars, [f"{x:.0f}" for x in rates])
    names = [f"{r['what']}\n{int(r['particles']):,}" for r in runs["1"]]
    axes.set_xticks([i + 0.2 * (len(runs) - 1) for i in range(len(names))], names)
    axes.axhline(30, color="grey", lw=0.8, ls="--", label="30 frames per second")
    axes.margins(y=0.15)
    axes.set_ylabel("frames per second, median step by time of day")
    axes.legend()
    axes.set_title("speed by mode and number of particles")


def draw_stages(axes: Axes, rows: list[Row]) -> None:
    """Where the time goes with each instruction set."""
    runs = section(rows, "isa")
    names = [f"{r['isa']}\n{per_particle(r, 'cpu_ms'):,.0f} ns" for r in runs]
    left = [0.0] * len(runs)
    for k, stage in enumerate(stages(runs[0])):
        broad = [100 * number(r, stage) / number(r, "cpu_ms") for r in runs]
        label = stage.split("_")[1]
        axes.barh(names, broad, left=left, label=label, color=plt.get_cmap("tab20")(k))
        left = [a + b for a, b in zip(left, broad, strict=True)]
    rest = [100 - a for a in left]
    axes.barh(names, rest, left=left, label="the rest", color="lightgrey")
    axes.set_xlim(0, 100)
    axes.invert_yaxis()
    axes.set_xlabel("% of a step's CPU time")
    axes.legend(fontsize=8, ncols=5, loc="upper center", bbox_to_anchor=(0.5, -0.15))
    axes.set_title(f"stages by instruction set, ns per particle, {int(runs[0]['particles']):,} particles")


def draw_particles(axes: Axes, rows: list[Row]) -> None:
    """Cost per particle by the number of particles."""
    runs = section(rows, "particles")
    many = [number(r, "particles") for r in runs]
    axes.semilogx(
        many, [per_particle(r, "cpu_ms") for r in runs], "o-", label="whole step, including features"
    )
    axes.semilogx(many, [per_particle(r, "stage_likelihood_ms") for r in runs], "s-", label="likelihood")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("particles")
    axes.set_ylabel("CPU ns per particle, one thread")
    axes.legend(loc="lower right")
    axes.set_title("cost per particle by number of particles")


def draw_threads(axes: Axes, rows: list[Row]) -> None:
    """How a step speeds up with threads, and the combined speed of two trackers that share nothing."""
    for count, of in by_threads(section(rows, "threads")).items():
        gain = [1 / number(r, "ratio") for r in of]
        axes.semilogx([number(r, "particles") for r in of], gain, "o-", label=threads(count))
    for r in section(rows, "modes"):
        if r["what"] == "twins":
            label = "two trackers at the same time, combined"
            axes.plot(number(r, "particles"), 2 / number(r, "ratio"), "kx", label=label)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("particles")
    axes.set_ylabel("speed relative to one thread")
    axes.legend(loc="lower right")
    axes.set_title("speed by threads")


def draw_memory(axes: Axes, rows: list[Row]) -> None:
    """Memory of the tracker, which it never exceeds."""
    for marker, (count, of) in zip("osd^v", by_threads(section(rows, "threads")).items(), strict=False):
        many, size = ([scale * number(r, c) for r in of] for c, scale in (("particles", 1), ("bytes", 1e-6)))
        axes.loglog(many, size, f"{marker}-", fillstyle="none", label=threads(count))
    for x, y in zip(many, size, strict=True):
        axes.annotate(f"{y:.1f}", (x, y), (0, 8), textcoords="offset points", ha="center")
    axes.set_xlabel("particles")
    axes.set_ylabel("MB")
    axes.margins(0.1, 0.15)
    axes.legend(loc="lower right")
    axes.set_title("peak memory of the tracker, all allocated at the start")


def draw_pictures(axes: Axes, rows: list[Row]) -> None:
    """Cost of a step by picture size."""
    runs = section(rows, "pictures")
    names = [f"{r['width']}x{r['height']}" for r in runs]
    features = [number(r, "stage_features_ms") for r in runs]
    rest = [number(r, "cpu_ms") - f for r, f in zip(runs, features, strict=True)]
    axes.bar(names, features, label="features")
    axes.bar(names, rest, bottom=features, label="the rest")
    axes.set_ylabel(f"CPU ms per step, {int(runs[0]['particles']):,} particles")
    axes.margins(y=0.25)
    axes.legend(ncols=2, loc="upper center")
    axes.set_title("cost by picture size, with the person equally large")


PANELS = [draw_modes, draw_stages, draw_particles, draw_threads, draw_memory, draw_pictures]


def figure_of(path: Path) -> Figure:
    """Read the CSV and draw all its sections."""
    with path.open(encoding="utf-8", newline="") as f:
        rows = list(csv.DictReader(f))
    figure, axes = plt.subplots(3, 2, figsize=(13, 13.5), layout="constrained")
    for panel, place in zip(PANELS, axes.flat, strict=True):
        panel(place, rows)
    figure.suptitle(f"{path.stem}, {section(rows, 'modes')[0]['isa']}")
    return figure


def draw(path: Path, png: Path) -> None:
    """Read the CSV and write the figure."""
    png.parent.mkdir(parents=True, exist_ok=True)
    figure_of(path).savefig(png, dpi=110)
    print(png)
