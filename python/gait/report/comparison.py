"""Compare a track with the truth: errors frame by frame, and the part of a report that shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gait.bindings.model import read_cyclic
from gait.camera.camera import Camera
from gait.io.track_file import Joints, Track, read_true_phase, read_truth
from gait.motion.evaluate import Measures, evaluate, root_errors
from gait.motion.footfalls import meta_of, strikes_of
from gait.report.colours import BLUE, GREY, ORANGE
from gait.report.error_table import ERROR_HEADER, OTHER_WORLD, error_rows, share_rows
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
        From `gait.motion.evaluate.evaluate`.
    time : ndarray of shape (k,)
        Seconds.
    abs_mm, root_mm : ndarray of shape (k,)
        Mean error over EVAL15, unaligned and after aligning the hip midpoints.
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
    """Compare a track with the file of the true motion; `model` and `camera` as for `evaluate`."""
    true = read_truth(truth)
    strikes, stated = strikes_of(true, meta_of(truth)), read_true_phase(truth)
    phase = strikes.phase(true.frame) if stated is None else stated
    measures = evaluate(track, true, strikes=strikes, model=read_cyclic(model), camera=camera, phase=phase)
    return _by_frame(measures, track, true, phase)


def _by_frame(measures: Measures, track: Track, truth: Joints, phase: Array | None) -> Comparison:
    _, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    found, true = track.eval15()[ours], truth.eval15()[theirs]
    return Comparison(
        measures=measures,
        time=track.time[ours],
        abs_mm=1000 * np.linalg.norm(found - true, axis=2).mean(axis=1),
        root_mm=root_errors(found, true),
        phase=None if phase is None else (track.phase[ours] - phase[theirs] + 0.5) % 1.0 - 0.5,
        true_path=truth.places["pelvis"][theirs, :2],
    )


def add_errors(page: Page, track: Track, errors: Comparison) -> None:
    """Add tables and plots of the errors."""
    rows, tips = error_rows(errors.measures)
    page.grid("Error against the truth", ERROR_HEADER, rows, tips)
    if track.camera_change is not None:
        page.words(f"{OTHER_WORLD[0].upper()}{OTHER_WORLD[1:]}.", "warning")
    shares, explained = share_rows(errors.measures)
    page.table("How reliable intervals and status are", shares, explained)
    page.html(time_plot(lambda axes: _paint_errors(axes, track, errors), time_span(track), 2.8, "Error, mm"))
    if errors.phase is not None:
        title = "Phase, estimate minus truth, % of the stride"
        page.html(time_plot(lambda axes: _paint_phase(axes, track, errors), time_span(track), 2.2, title))


def _paint_errors(axes: Axes, track: Track, errors: Comparison) -> None:
    tint(axes, track)
    axes.plot(errors.time, errors.abs_mm, color=BLUE, label="joints in space")
    axes.plot(errors.time, errors.root_mm, color=ORANGE, ls="--", label="pose, hips aligned")
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
