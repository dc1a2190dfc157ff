"""Rows of figures: one for each run (CSV), and one for each clip and arm with medians over the seeds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import table
from eval_measures import lost_at_end
from eval_plan import BASE
from eval_run import Result

MEDIAPIPE = {  # MediaPipe Pose 0.10.21, 12 joints root-aligned, mm: ../shared/data/README.md
    "side_lr_35": 127, "side_rl_16": 89, "oblique45_07": 84, "oblique45_pole_05": 93, "toward300_08": 113,
}  # fmt: skip

_FROM = {  # column: path in the measures, factor
    "root_mm": ("root.median", 1),
    "root_p90": ("root.p90", 1),
    "abs_mm": ("abs.median", 1),
    "proc_mm": ("proc.median", 1),
    "root12_mm": ("root12.median", 1),
    "px": ("px.median", 1),
    "near_px": ("near_px", 1),
    "clear_px": ("clear_px", 1),
    "phase_pct": ("phase.median", 100),
    "flips_pct": ("phase.flips", 100),
    "lost_pct": ("lost", 100),
    "lost2_pct": ("trust.weighted_lost", 100),
    "silent_pct": ("trust.wrong_tracking", 100),
    "swapped_pct": ("start.flipped_silently", 100),
    "reported_lost_pct": ("status.lost", 100),
    "ambig_pct": ("status.ambiguous", 100),
    "init_pct": ("status.init", 100),
    "track_pct": ("status.tracking", 100),
    "cover50": ("coverage.50", 1),
    "cover90": ("coverage.90", 1),
    "phase90": ("phase90", 1),
    "pit_chi2": ("calibration.pit_chi2", 1),
    "z2": ("calibration.z2", 1),
    "nees": ("nees", 1),
    "crps_mm": ("calibration.crps_mm", 1),
    "width_mm": ("calibration.width_mm", 1),
    "strikes_pct": ("events.within", 100),
    "strike_worst": ("events.worst", 1),
    "stride_pct": ("events.stride", 100),
    "static_mm": ("static.root.median", 1),
    "free_mm": ("free.root.median", 1),
    "free_abs_mm": ("free.abs.median", 1),
    "step_ms": ("step_ms.median", 1),
    "frames": ("frames", 1),
    "first": ("first", 1),
}

SHOWN = {  # column of the printed table: figure, decimals
    "root": ("root_mm", 1),
    "p90": ("root_p90", 0),
    "abs": ("abs_mm", 0),
    "proc": ("proc_mm", 0),
    "12j": ("root12_mm", 0),
    "MPipe": ("mediapipe_mm", 0),
    "static": ("static_mm", 0),
    "free": ("free_mm", 0),
    "px": ("any_px", 1),
    "clear": ("clear_px", 1),
    "phase%": ("phase_pct", 1),
    "flip%": ("flips_pct", 0),
    "far%": ("lost_pct", 1),
    "twice%": ("lost2_pct", 1),
    "ambig%": ("ambig_pct", 0),
    "c90": ("cover90", 2),
    "HS%": ("strikes_pct", 0),
    "from": ("first", 0),
    "ms": ("step_ms", 1),
}
HONESTY = {  # of the second table
    "in 50 %": ("cover50", 2),
    "in 90 %": ("cover90", 2),
    "phase in 90 %": ("phase90", 2),
    "PIT chi2": ("pit_chi2", 0),
    "z2": ("z2", 1),
    "NEES": ("nees", 1),
    "CRPS mm": ("crps_mm", 1),
    "width mm": ("width_mm", 0),
    "init %": ("init_pct", 0),
    "tracking %": ("track_pct", 0),
    "ambiguous %": ("ambig_pct", 0),
    "lost %": ("reported_lost_pct", 0),
    "silent %": ("silent_pct", 1),
    "swapped %": ("swapped_pct", 1),
}
_SD = ("root", "abs", "px")  # columns that also show the range over the seeds

LEGEND = (
    "Each figure is the median over the seeds of a clip's median over frames, with the range over the "
    "seeds in brackets. root, abs, proc: errors in mm, with the hips aligned, without alignment, and "
    "after the best similarity transform of each frame (only for comparison with the literature); 12j: "
    "root error of 12 limb joints; MPipe: MediaPipe Pose, measured as 12j; static: root error of the "
    "mean pose at the true place; free: root error of the mean cycle that runs freely from the true "
    "start; px: distance in the image, outdoors of the near leg; clear: distance of all clear marks; "
    "phase%: error of the phase; flip%: frames half a cycle off; far%: frames with a root error above "
    "150 mm or reported as lost; twice%: the same, with frames under tracking counted twice; c90: share "
    "of joint coordinates inside the 90 % intervals; HS%: heel strikes within 2 frames; from: first "
    "frame tracked; ms: time of a step, that of its thread if the start is the truth. "
    "Table of intervals and status: lost: frames reported as lost; "
    "PIT chi2: distance of the probability integral transform from a flat histogram of 10 bins; z2: "
    "squared error divided by the variance, 1 is right; NEES: error of all joints in units of the "
    "particles' covariance, per dimension, 1 is right; CRPS: score of the intervals, lower is better; "
    "width: of the 90 % intervals; silent: frames more than 150 mm off under tracking; swapped: frames "
    "half a cycle off under tracking, of those after the first second. Starts from the truth have the "
    "right stature with a standard deviation of 3 mm; starts with a wrong stature have one of 30 mm."
)


def figures(result: Result) -> dict[str, Any]:
    """All figures of one run; None if the clip has no such truth."""
    job = result.job
    row: dict[str, Any] = {"clip": job.clip.name, "arm": job.arm.name, "seed": job.seed}
    for name, (path, factor) in _FROM.items():
        value = _dig(result.measures, path.split("."))
        row[name] = None if value is None else factor * value
    row["any_px"] = row["near_px"] if row["px"] is None else row["px"]
    start = result.measures.get("start") or {}
    row["locked"], row["side"] = start.get("locked"), start.get("side")
    row["lost_run"] = True if result.failure else lost_at_end(result.series)
    row["mediapipe_mm"] = MEDIAPIPE.get(job.clip.name)
    row["failure"] = result.failure.replace(f"{job.clip.folder}/", "")
    row["empty"] = job.clip.empty
    if job.clip.empty:  # if no person is there, a track that finds none is right
        row["lost_run"] = False
    elif result.failure:  # a run that failed counts as lost in every frame
        row["lost_pct"] = row["lost2_pct"] = 100.0
    return row


def _dig(tree: Any, path: Iterable[str]) -> Any:
    for key in path:
        if not isinstance(tree, dict) or tree.get(key) is None:
            return None
        tree = tree[key]
    return tree


def summaries(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each clip and arm: medians of numbers, with ``<name>_range`` over the seeds."""
    out = []
    for key in dict.fromkeys((row["arm"], row["clip"]) for row in rows):
        group = [row for row in rows if (row["arm"], row["clip"]) == key]
        summary: dict[str, Any] = {"arm": key[0], "clip": key[1], "runs": len(group)}
        for name in [*_FROM, "any_px", "mediapipe_mm"]:
            values = [row[name] for row in group if row[name] is not None]
            summary[name] = float(np.median(values)) if values else None
            summary[f"{name}_range"] = (min(values), max(values)) if values else None
        summary["lost_runs"] = sum(row["lost_run"] for row in group)
        summary["failures"] = [row["failure"] for row in group if row["failure"]]
        out.append(summary)
    return out


def failures(rows: list[dict[str, Any]]) -> list[str]:
    """Runs that failed with their error messages; runs with the same message share a line."""
    lines: dict[str, list[str]] = {}
    for row in rows:
        if row["failure"]:
            lines.setdefault(row["failure"], []).append(f"{row['clip']} {row['arm']} seed {row['seed']}")
    return [f"{', '.join(runs)}: {words}" for words, runs in lines.items()]


def cells(summary: dict[str, Any], shown: dict[str, tuple[str, int]]) -> list[str]:
    """Cells of one line of the table, without clip and arm."""
    out = []
    for column, (name, decimals) in shown.items():
        value = summary[name]
        if value is None:
            out.append("")
            continue
        text = f"{value:.{decimals}f}"
        if column in _SD and summary["runs"] > 1:
            low, high = summary[f"{name}_range"]
            text += f" ({low:.{min(decimals, 1)}f}-{high:.{min(decimals, 1)}f})"
        out.append(text)
    return out


def grid(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Head and lines of the table for rows of `summaries`."""
    head = ["clip", "arm", "runs", *SHOWN, "lost runs"]
    lines = [
        [s["clip"], s["arm"], str(s["runs"]), *cells(s, SHOWN), str(s["lost_runs"]) if s["lost_runs"] else ""]
        for s in rows
    ]
    return [head, *lines]


def by_particles(rows: list[dict[str, Any]], default: int) -> list[list[str]]:
    """Head and lines of errors and time by number of particles; only the head if that was not varied.

    Means over the clips with true joints of the means over their seeds, with standard errors over the seeds.
    """
    shown = {"root mm": ("root_mm", 1), "abs mm": ("abs_mm", 0), "in 90 %": ("cover90", 3)}
    shown |= {"CRPS mm": ("crps_mm", 1), "px": ("px", 2), "ms": ("step_ms", 1)}
    lines = [["particles", "runs", *shown]]
    for name, runs in _runs_by_particles(rows, default).items():
        means = [_over_clips(runs, name, decimals) for name, decimals in shown.values()]
        lines.append([name, str(len(runs)), *means])
    return lines


def time_to_error(rows: list[dict[str, Any]], default: int) -> list[list[str]]:
    """Head and lines of the least time of a step, and its particles, with which an error is reached.

    Errors and times are means as in `by_particles`.
    """
    lines = [["error", "at most mm", "ms", "particles"]]
    arms = _runs_by_particles(rows, default)
    for what, measure, step in (("root", "root_mm", 1), ("abs", "abs_mm", 5)):
        errors = {name: _mean(runs, measure) for name, runs in arms.items()}
        times = {name: _mean(runs, "step_ms") for name, runs in arms.items()}
        if errors:
            least, most = (step * math.ceil(of(errors.values()) / step) for of in (min, max))
            for bound in range(least, most + 1, step):
                name = min((name for name in arms if errors[name] <= bound), key=times.__getitem__)
                lines.append([what, str(bound), f"{times[name]:.1f}", name])
    return lines


def _runs_by_particles(rows: list[dict[str, Any]], default: int) -> dict[str, list[dict[str, Any]]]:
    """Runs on clips with true joints by number of particles; empty if that was not varied."""
    names = {arm: arm[2:] for arm in dict.fromkeys(row["arm"] for row in rows) if arm.startswith("N ")}
    if names:
        names[BASE] = str(default)
    found = {
        name: [row for row in rows if row["arm"] == arm and row["root_mm"] is not None]
        for arm, name in sorted(names.items(), key=lambda item: int(item[1].split(",")[0]))
    }
    return {name: runs for name, runs in found.items() if runs}


def _over_clips(runs: list[dict[str, Any]], name: str, decimals: int) -> str:
    clips, mean = _by_clip(runs, name), _mean(runs, name)
    if any(len(values) < 2 for values in clips):
        return f"{mean:.{decimals}f}"
    error = np.sqrt(sum(np.var(values, ddof=1) / len(values) for values in clips)) / len(clips)
    return f"{mean:.{decimals}f} +- {error:.{decimals}f}"


def _mean(runs: list[dict[str, Any]], name: str) -> float:
    """Mean over the clips of the means over their seeds."""
    return float(np.mean([np.mean(values) for values in _by_clip(runs, name)]))


def _by_clip(runs: list[dict[str, Any]], name: str) -> list[list[float]]:
    return [
        [row[name] for row in runs if row["clip"] == clip]
        for clip in dict.fromkeys(row["clip"] for row in runs)
    ]


def honesty(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Head and lines of the table of intervals and status."""
    return [["clip", "arm", *HONESTY], *([s["clip"], s["arm"], *cells(s, HONESTY)] for s in rows)]


def plain(lines: list[list[str]], words: int = 2) -> str:
    """Lay the table out for a terminal; the first `words` columns are text, empty columns are left out."""
    return table.aligned(*_filled(lines, words))


def markdown(lines: list[list[str]], words: int = 2) -> str:
    """Return the same in Markdown."""
    return table.markdown(*_filled(lines, words))


def filled(lines: list[list[str]]) -> list[int]:
    """Columns that are not entirely empty."""
    return [k for k in range(len(lines[0])) if any(line[k] for line in lines[1:])]


def _filled(lines: list[list[str]], words: int) -> tuple[list[str], list[list[str]], list[bool]]:
    kept = filled(lines)
    head, *cells = ([line[k] for k in kept] for line in lines)
    return head, cells, [k >= words for k in kept]
