"""Draw what ``make bench`` wrote: stages by instruction set, cost by particles and picture, steps by mode."""

from __future__ import annotations

import csv
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

PARTS = ["kinematics", "projection", "raster", "samples", "texture", "silhouette", "edges", "template"]
WHOLE = ["features", "resample", "propagate", "weights", "estimate", "lag"]
Row = dict[str, str]


def number(row: Row, name: str) -> float:
    """A figure of a row; 0 where it was not measured."""
    return float(row[name] or 0)


def per_particle(row: Row, name: str) -> float:
    """Milliseconds of a step as nanoseconds a particle."""
    return 1e6 * number(row, name) / number(row, "particles")


def draw_stages(axes: Axes, rows: list[Row]) -> None:
    """Where the time goes with each instruction set, 10,000 particles."""
    runs = [r for r in rows if r["what"] == "default" and r["particles"] == "10000" and r["features_ms"]]
    runs = list({r["isa"]: r for r in reversed(runs)}.values())[::-1]
    names = [r["isa"] for r in runs]
    left = [0.0] * len(runs)
    for k, part in enumerate(PARTS + WHOLE):
        wide = [per_particle(r, f"{part}_ms") for r in runs]
        axes.barh(names, wide, left=left, label=part, color=plt.get_cmap("tab20")(k))
        left = [a + b for a, b in zip(left, wide, strict=True)]
    for name, end in zip(names, left, strict=True):
        axes.text(end, name, f" {end:.0f}", va="center")
    axes.set_xlim(0, 1.12 * max(left))
    axes.invert_yaxis()
    axes.set_xlabel("CPU ns per particle, 10,000 particles, one thread")
    axes.legend(fontsize=7, ncols=2, loc="lower right")
    axes.set_title("stages of a step")


def draw_sizes(axes: Axes, rows: list[Row]) -> None:
    """Cost of a particle by their number."""
    runs = [r for r in rows if r["what"] == "default" and r["isa"] == rows[0]["isa"] and r["height"] == "480"]
    last = {int(r["particles"]): r for r in runs if r["threads"] == "1" and r["features_ms"]}  # one each
    many = sorted(last)
    runs = [last[n] for n in many]
    axes.semilogx(many, [per_particle(r, "cpu_ms") for r in runs], "o-", label="whole step")
    axes.semilogx(many, [per_particle(r, "likelihood_ms") for r in runs], "s-", label="likelihood")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("particles")
    axes.set_ylabel("CPU ns per particle")
    axes.legend()
    axes.set_title(f"cost by number of particles ({rows[0]['isa']})")


def draw_pictures(axes: Axes, rows: list[Row]) -> None:
    """Cost of a step by the picture's size."""
    runs = list(
        {
            r["width"]: r
            for r in rows
            if r["what"] == "default" and r["particles"] == "2000" and r["features_ms"]
        }.values()
    )
    names = [f"{r['width']}x{r['height']}" for r in runs]
    features = [number(r, "features_ms") for r in runs]
    rest = [number(r, "cpu_ms") - f for r, f in zip(runs, features, strict=True)]
    axes.bar(names, features, label="features")
    axes.bar(names, rest, bottom=features, label="the rest")
    axes.set_ylabel("CPU ms per step, 2000 particles")
    axes.margins(y=0.25)
    axes.legend(ncols=2, loc="upper center")
    axes.set_title("cost by size of the picture, the person as large")


def draw_modes(axes: Axes, rows: list[Row]) -> None:
    """Frames a second of the settings in use, by time of day."""
    runs = [r for r in rows if r["what"] in {"default", "paper"} and not r["features_ms"]][:5]
    names = [f"{r['what']} {r['particles']}\n{r['threads']} thread{'s'[: r['threads'] != '1']}" for r in runs]
    rates = [1e3 / number(r, "median_ms") for r in runs]
    bars = axes.bar(names, rates)
    axes.bar_label(bars, [f"{x:.0f}" for x in rates])
    axes.axhline(30, color="grey", lw=0.8, ls="--")
    axes.margins(y=0.15)
    axes.set_ylabel("frames per second (time of day, median step)")
    axes.tick_params(axis="x", labelsize=8)
    axes.set_title("speed")


def draw(path: Path, png: Path) -> None:
    """Read the CSV, write the figure."""
    with path.open(encoding="utf-8", newline="") as f:
        rows = list(csv.DictReader(f))
    figure, axes = plt.subplots(2, 2, figsize=(13, 9), layout="constrained")
    draw_modes(axes[0][0], rows)
    draw_stages(axes[0][1], rows)
    draw_sizes(axes[1][0], rows)
    draw_pictures(axes[1][1], rows)
    figure.suptitle(path.stem)
    png.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(png, dpi=110)
    print(png)
