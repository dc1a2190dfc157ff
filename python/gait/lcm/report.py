"""The report of a tracked stream: an overlay video, and a page with figures and plots."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike, NDArray

from gait.bindings.model import Model, read_cyclic
from gait.camera.camera import Camera
from gait.io.files import replacing
from gait.io.track_file import Joints, Track, read_track, read_truth
from gait.io.video import FAST, Image, Video, VideoWriter
from gait.lcm.record import Run, read_run
from gait.motion.evaluate import Measures, as_text, evaluate, root_errors
from gait.motion.footfalls import Strikes, strikes_of
from gait.progress import durations, note, progress
from gait.report.colours import BLUE, GREY, ORANGE, STATUS_TINTS
from gait.report.drawing import Overlay
from gait.report.page import Page
from gait.report.plots import Painter, svg_figure

_PICTURES = 6  # frames on the page

Array = NDArray[np.float64]

_SIZE = (7.2, 2.6)  # inches of one plot


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
    """Draw the phase with its standard deviation or, where the truth is known, its error."""
    sd = np.array([e.sd.phase for e in run.estimates])
    phase = np.array([e.mean.phase for e in run.estimates])

    def paint(axes: Axes) -> None:
        if errors is None or errors.phase is None:
            axes.scatter(run.frame, phase, s=6, color=BLUE)
            axes.set(xlabel="frame", ylabel="phase, strides", ylim=(0, 1))
            return
        axes.plot(errors.frame, errors.phase, color=BLUE, label="estimate minus truth")
        axes.fill_between(
            run.frame, -2 * sd, 2 * sd, color=BLUE, alpha=0.15, lw=0, label="two standard deviations"
        )
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
    """Draw the path of the pelvis over the ground, seen from above."""
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
    """Draw one pair of axes; frames whose status is not tracking get a tinted background."""

    def tinted(axes: Axes) -> None:
        paint(axes)
        for number, estimate in zip(run.frame, run.estimates, strict=True) if frames else ():
            tint = STATUS_TINTS.get(estimate.status.name.lower())
            if tint:
                axes.axvspan(number - 0.5, number + 0.5, color=tint, alpha=0.35, lw=0)

    return svg_figure([[tinted]], _SIZE, font=9)


def write_report(
    log: str,
    track: str,
    video: str,
    camera: str,
    page: str,
    *,
    overlay: str | None = None,
    truth: str | None = None,
    model: str | None = None,
    live: bool = True,
    quiet: bool = False,
) -> Measures | None:
    """Write the page and, if named, the overlay video; return the errors if there is a truth.

    Parameters
    ----------
    log, track, video, camera : str
        Files to read: estimates, the track recorded with them, the clip and its camera.
    page : str
        HTML file to write.
    overlay : str, optional
        Video to write.
    truth, model : str, optional
        Files to read; the model of the package if left out.
    live : bool
        Whether the stream was tracked as it was taken, so that its latency means something.
    quiet : bool
        Print no notes and no progress.

    Raises
    ------
    UserError
        If a file cannot be read or written.
    """
    clip = Video(video)
    lens, body = Camera.read(camera, clip.size), Model(model)
    run, found = read_run(log), read_track(track)
    if run.remark:
        note(f"{log}: {run.remark}", quiet)
    measures: Measures | None = None
    errors: Comparison | None = None
    if truth is not None:
        true = read_truth(truth)
        strikes = strikes_of(true, Path(truth).parent / "meta.json")
        measures = evaluate(found, true, strikes=strikes, model=read_cyclic(model), camera=lens)
        errors = compare(found, true, strikes)
    pictures = _film(overlay, clip, Overlay(body, lens), run, quiet)
    html = Page(f"{clip.path.name}: {len(run.frame)} frames tracked")
    html.table("Figures", _figures(run, live))
    if measures is not None:
        html.block("Error against the truth", as_text(measures))
    html.film("Frames", pictures)
    html.words(
        "The plots are tinted where the tracker was still starting (grey), ambiguous (yellow) or lost (red)."
    )
    for heading, svg in _plots(run, errors, live):
        html.figure(heading, svg)
    with replacing(page) as path:
        path.write_text(html.text(), encoding="utf-8")
    return measures


def _figures(run: Run, live: bool) -> dict[str, str]:
    rows = {
        "frames": f"{run.frame[0]} to {run.frame[-1]}, {len(run.frame)} tracked",
        "dropped": f"{run.dropped}",
        "step of the tracker": _times(run.step_ms),
        "digest": f"{run.tracker_digest:016x}",
    }
    if live:
        rows["latency, capture to estimate received"] = _times(run.latency_ms)
    if len(run.seconds) > 1:
        rows["frame rate"] = f"{(len(run.seconds) - 1) / run.seconds[-1]:.2f} per second"
    return rows


def _times(values: ArrayLike) -> str:
    s = durations(values)
    return f"median {s['median']:.1f} ms, 99th percentile {s['p99']:.1f} ms, longest {s['max']:.1f} ms"


def _plots(run: Run, errors: Comparison | None, live: bool) -> Iterator[tuple[str, str]]:
    if errors is not None:
        yield "Error", error_plot(run, errors)
    yield "Phase", phase_plot(run, errors)
    yield "Times", time_plot(run, live)
    yield "Cadence and speed", gait_plot(run)
    yield "Path over the ground", path_plot(run, errors)


def _film(path: str | None, video: Video, overlay: Overlay, run: Run, quiet: bool) -> list[tuple[int, Image]]:
    """Draw every tracked frame into the overlay video; return a few of them."""
    last = int(run.frame[-1])
    known = dict(zip(run.frame.tolist(), run.estimates, strict=True))
    wanted = set(run.frame[np.linspace(0, len(run.frame) - 1, _PICTURES).round().astype(int)].tolist())
    kept = []
    with ExitStack() as stack:
        film = stack.enter_context(VideoWriter(path, video.fps, preset=FAST)) if path else None
        update = stack.enter_context(progress("overlay", last + 1, quiet))
        for frame in video.frames(int(run.frame[0]), last + 1):
            estimate = known.get(frame.number)
            if film is None and frame.number not in wanted:
                continue
            picture = frame.image
            if estimate is not None:  # the panel shows the time of the video, not of the day
                picture = overlay.draw(picture, replace(estimate, utime=frame.utime), frame.number)
            if film is not None:
                film.write(picture)
            if frame.number in wanted:
                kept.append((frame.number, picture))
            update(frame.number)
    return kept
