"""A track beside the truth: errors frame by frame, and the part of a report that shows them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gait.bindings.model import read_cyclic
from gait.camera.camera import Camera
from gait.io.track_file import Joints, Track, read_truth
from gait.motion.evaluate import Measures, evaluate, root_errors
from gait.motion.footfalls import Strikes, strikes_of
from gait.report import terms
from gait.report.colours import BLUE, GREY, ORANGE
from gait.report.gait_parts import time_span, tint
from gait.report.page import Page
from gait.report.plots import time_plot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """Errors over the frames that track and truth have in common.

    Attributes
    ----------
    measures : dict
        Of `gait.motion.evaluate.evaluate`.
    time : ndarray of shape (k,)
        Seconds.
    abs_mm, root_mm : ndarray of shape (k,)
        Mean over EVAL15 as it is, and with the hip midpoints laid on each other.
    phase : ndarray of shape (k,) or None
        Estimate minus truth, cycles in [-0.5, 0.5).
    true_path : ndarray of shape (k, 2)
        Pelvis on the ground, metres.
    """

    measures: Measures
    time: Array
    abs_mm: Array
    root_mm: Array
    phase: Array | None
    true_path: Array


def compare(track: Track, truth: str, model: str | None, camera: Camera | None) -> Comparison:
    """Put a track beside the file of the true motion; `model` and `camera` as for `evaluate`."""
    true = read_truth(truth)
    strikes = strikes_of(true, Path(truth).parent / "meta.json")
    measures = evaluate(track, true, strikes=strikes, model=read_cyclic(model), camera=camera)
    return _by_frame(measures, track, true, strikes)


def _by_frame(measures: Measures, track: Track, truth: Joints, strikes: Strikes) -> Comparison:
    common, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    found, true = track.eval15()[ours], truth.eval15()[theirs]
    phase = strikes.phase(common)
    return Comparison(
        measures=measures,
        time=track.time[ours],
        abs_mm=1000 * np.linalg.norm(found - true, axis=2).mean(axis=1),
        root_mm=root_errors(found, true),
        phase=None if phase is None else (track.phase[ours] - phase + 0.5) % 1.0 - 0.5,
        true_path=truth.places["pelvis"][theirs, :2],
    )


def add_errors(page: Page, track: Track, errors: Comparison) -> None:
    """Add tables and plots of the errors."""
    rows, tips = _rows(errors.measures)
    page.grid("Error against the truth", ("", "median", "mean", "9 of 10 frames below"), rows, tips)
    shares, explained = _shares(errors.measures)
    page.table("How far intervals and status can be believed", shares, explained)
    page.html(time_plot(lambda axes: _paint_errors(axes, track, errors), time_span(track), 2.8, "Error, mm"))
    if errors.phase is not None:
        title = "Phase, estimate minus truth, % of the stride"
        page.html(time_plot(lambda axes: _paint_phase(axes, track, errors), time_span(track), 2.2, title))


def _rows(m: Measures) -> tuple[list[list[str]], dict[str, str]]:
    """Cells of the table of errors, and explanations by the words of its rows."""
    free = m["free"]
    parts = {
        "abs": (m["abs"], 1.0, 0),
        "root": (m["root"], 1.0, 0),
        "root12": (m["root12"], 1.0, 0),
        "proc": (m["proc"], 1.0, 0),
        "px": (m["px"], 1.0, 1),
        "phase": (m["phase"], 100.0, 1),
        "static": (m["static"]["root"], 1.0, 0),
        "free": (None if free is None else free["root"], 1.0, 0),
    }
    known = {name: part for name, part in parts.items() if part[0] is not None}
    rows = [
        [terms.ERRORS[name][0], *(f"{scale * values[key]:.{digits}f}" for key in ("median", "mean", "p90"))]
        for name, (values, scale, digits) in known.items()
    ]
    return rows, {terms.ERRORS[name][0]: terms.ERRORS[name][1] for name in known}


def _shares(m: Measures) -> tuple[dict[str, str], dict[str, str]]:
    """Single figures in words, and explanations by the same words."""
    found = {
        "within50": f"{m['coverage']['50']:.0%}",
        "within90": f"{m['coverage']['90']:.0%}",
        "width": f"{m['calibration']['width_mm']:.0f} mm",
        "score": f"{m['calibration']['crps_mm']:.1f} mm",
        "lost": f"{m['lost']:.1%} of {m['frames']} frames",
        "wrong": f"{m['trust']['wrong_tracking']:.1%}",
    }
    if m["phase"] is not None:
        found["flips"] = f"{m['phase']['flips']:.1%}"
        found["bias"] = f"{100 * m['phase']['bias']:+.1f} %"
    words = {terms.SHARES[name][0]: value for name, value in found.items()}
    return words, {terms.SHARES[name][0]: terms.SHARES[name][1] for name in found}


def _paint_errors(axes: Axes, track: Track, errors: Comparison) -> None:
    tint(axes, track)
    axes.plot(errors.time, errors.abs_mm, color=BLUE, label="joints in space")
    axes.plot(errors.time, errors.root_mm, color=ORANGE, ls="--", label="pose, hips laid together")
    axes.set(ylim=(0, None))
    axes.legend(loc="best")


def _paint_phase(axes: Axes, track: Track, errors: Comparison) -> None:
    tint(axes, track)
    if "phase_sd" in track.numbers:
        band = 200 * track.numbers["phase_sd"]
        axes.fill_between(track.time, -band, band, color=GREY, alpha=0.25, lw=0, label="two sd")
    axes.plot(errors.time, 100 * np.asarray(errors.phase), color=BLUE, label="error")
    axes.axhline(0, color=GREY, lw=0.8)
    axes.legend(loc="best")
