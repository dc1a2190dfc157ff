"""Figures of the report, as SVG text."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.io.track_file import Joints, Track
from gait.lcm.record import Run
from gait.motion.evaluate import root_errors
from gait.motion.footfalls import Strikes
from gait.report.colours import BLUE, GREY, ORANGE

Array = NDArray[np.float64]
Painter = Callable[[Axes], None]

_WIDTH, _HEIGHT = 7.2, 2.6  # inches of one figure
_STATUS = {TrackStatus.INIT: "#c8c8c8", TrackStatus.AMBIGUOUS: "#f4d06f", TrackStatus.LOST: "#e07a7a"}


@dataclass(frozen=True)
class Comparison:
    """Errors frame by frame, over the frames that track and truth have in common.

    Attributes
    ----------
    frame : ndarray of int, shape (k,)
    abs_mm, root_mm : ndarray of shape (k,)
        Mean over EVAL15 as it is, and with the hip midpoints laid on each other.
    phase : ndarray of shape (k,) or None
        Estimate minus truth, cycles in [-0.5, 0.5).
    true_path : ndarray of shape (k, 2)
        Pelvis on the ground, metres.
    """

    frame: NDArray[np.int64]
    abs_mm: Array
    root_mm: Array
    phase: Array | None
    true_path: Array


def compare(track: Track, truth: Joints, strikes: Strikes) -> Comparison:
    """Put a track beside the truth."""
    common, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    found, true = track.eval15()[ours], truth.eval15()[theirs]
    phase = strikes.phase(common)
    return Comparison(
        frame=common,
        abs_mm=1000 * np.linalg.norm(found - true, axis=2).mean(axis=1),
        root_mm=root_errors(found, true),
        phase=None if phase is None else (track.phase[ours] - phase + 0.5) % 1.0 - 0.5,
        true_path=truth.places["pelvis"][theirs, :2],
    )


def error_plot(run: Run, errors: Comparison) -> str:
    """Draw the 3-D error over frames."""

    def paint(axes: Axes) -> None:
        axes.plot(errors.frame, errors.abs_mm, color=BLUE, label="as it is (abs)")
        axes.plot(errors.frame, errors.root_mm, color=ORANGE, label="hips aligned (root)")
        axes.set(xlabel="frame", ylabel="error, mm", ylim=(0, None))
        axes.legend(loc="best")

    return _figure(run, paint)


def phase_plot(run: Run, errors: Comparison | None) -> str:
    """Draw the phase with its spread or, where the truth is known, its error."""
    sd = np.array([e.sd.phase for e in run.estimates])
    phase = np.array([e.mean.phase for e in run.estimates])

    def paint(axes: Axes) -> None:
        if errors is None or errors.phase is None:
            axes.scatter(run.frame, phase, s=6, color=BLUE)
            axes.set(xlabel="frame", ylabel="phase, strides", ylim=(0, 1))
            return
        axes.plot(errors.frame, errors.phase, color=BLUE, label="estimate minus truth")
        axes.fill_between(run.frame, -2 * sd, 2 * sd, color=BLUE, alpha=0.15, lw=0, label="two deviations")
        axes.axhline(0, color=GREY, lw=0.8)
        axes.set(xlabel="frame", ylabel="phase error, strides")
        axes.legend(loc="best")

    return _figure(run, paint)


def gait_plot(run: Run) -> str:
    """Draw cadence and speed over frames."""

    def paint(axes: Axes) -> None:
        axes.plot(run.frame, [120 * e.mean.stride_hz for e in run.estimates], color=BLUE)
        axes.set(xlabel="frame", ylabel="steps per minute")
        axes.yaxis.label.set_color(BLUE)
        speed = axes.twinx()
        speed.plot(run.frame, [e.speed for e in run.estimates], color=ORANGE)
        speed.set(ylabel="speed, m/s", ylim=(0, None))
        speed.yaxis.label.set_color(ORANGE)

    return _figure(run, paint)


def time_plot(run: Run, live: bool) -> str:
    """Draw the time of each step and, for a live stream, the latency."""

    def paint(axes: Axes) -> None:
        if live:
            axes.plot(run.frame, run.latency_ms, color=ORANGE, label="capture to estimate received")
        axes.plot(run.frame, run.step_ms, color=BLUE, label="step of the tracker")
        if len(run.seconds) > 1:
            interval = 1000 * float(np.median(np.diff(run.seconds)))
            axes.axhline(interval, color=GREY, ls="--", lw=0.8, label="frame interval")
        axes.set(xlabel="frame", ylabel="milliseconds", ylim=(0, None))
        axes.legend(loc="best")

    return _figure(run, paint)


def path_plot(run: Run, errors: Comparison | None) -> str:
    """Draw the way of the pelvis over the ground, seen from above."""
    pelvis = run.estimates[0].joint_names.index("pelvis")
    path = np.array([e.joints[pelvis, :2] for e in run.estimates])

    def paint(axes: Axes) -> None:
        if errors is not None:
            axes.plot(*errors.true_path.T, color=GREY, lw=3, label="truth")
        axes.plot(*path.T, color=BLUE, label="estimate")
        axes.set(xlabel="x, m", ylabel="y, m")
        axes.set_aspect("equal", adjustable="datalim")
        axes.legend(loc="best")

    return _figure(run, paint, frames=False)


def _figure(run: Run, paint: Painter, frames: bool = True) -> str:
    """Draw one pair of axes; frames in another status than tracking get a tinted ground."""
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "gait", "font.size": 9}):
        figure = Figure(figsize=(_WIDTH, _HEIGHT), layout="constrained")
        axes = figure.add_subplot()
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
        paint(axes)
        for number, estimate in zip(run.frame, run.estimates, strict=True) if frames else ():
            if estimate.status in _STATUS:
                axes.axvspan(number - 0.5, number + 0.5, color=_STATUS[estimate.status], alpha=0.35, lw=0)
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return text.getvalue()[text.getvalue().index("<svg") :]
