"""The report of a tracked stream: the page of a run, with dropped frames, step times and latency."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from gait.io.video import Video
from gait.lcm.record import Run, read_run
from gait.motion.evaluate import Measures
from gait.motion.verdict import Verdict
from gait.progress import durations, note
from gait.report import run_files
from gait.report.colours import BLUE, GREY, ORANGE
from gait.report.plots import time_plot
from gait.report.run_files import RunFiles


def write_report(
    log: str, files: RunFiles, *, live: bool = True, person: int | None = None
) -> tuple[Verdict, Measures | None]:
    """Write the page and, if named, the overlay video; return the verdict, and errors if the truth is known.

    Parameters
    ----------
    log : str
        Log with estimates, from gait record --log or lcm-logger.
    files : RunFiles
        The track recorded with them, the clip, and the files to write.
    live : bool
        Whether the stream was tracked live, so that its latency is meaningful.
    person : int, optional
        Number of the person to report, of several in the log.

    Raises
    ------
    UserError
        If a file cannot be read or written.
    """
    run, times = read_run(log, person), Video(files.video).times
    if run.remark:
        note(f"{log}: {run.remark}", files.quiet)
    numbers = run.frame.tolist()
    estimates = {  # the film shows the time in the video, not the time of day
        number: replace(estimate, utime=round(1e6 * float(times[number])))
        for number, estimate in zip(numbers, run.estimates, strict=True)
        if number < len(times)
    }
    return run_files.write_report(
        files, estimates, {"Live": _figures(run, live)}, {"Times": times_plot(run, live)}
    )


def times_plot(run: Run, live: bool) -> str:
    """Draw the time of each step and, for a live stream, the latency."""

    def paint(axes: Axes) -> None:
        if live:
            axes.plot(run.seconds, run.latency_ms, color=ORANGE, label="capture to estimate received")
        axes.plot(run.seconds, run.step_ms, color=BLUE, label="step of the tracker")
        if len(run.seconds) > 1:
            interval = 1000 * float(np.median(np.diff(run.seconds)))
            axes.axhline(interval, color=GREY, ls="--", lw=0.8, label="frame interval")
        axes.set(ylim=(0, None))
        axes.legend(loc="best")

    span = float(run.seconds[0]), float(max(run.seconds[-1], run.seconds[0] + 1e-3))
    return time_plot(paint, span, 2.4, "Milliseconds by time since the first estimate")


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
