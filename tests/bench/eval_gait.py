#!/usr/bin/env python3
"""What a gait lab compares: footfalls, gait parameters and joint angles of tracks against the truth.

    make eval-gait                           the development clips
    make eval-gait ARGS='--from-truth'       started from the truth, without the detector
    make eval-gait ARGS='--simulated DIR'    slow, fast, asymmetric and aided walks by gait simulate instead

Each clip is tracked by `gait track --smooth --draws` with a model learnt without its subject, as users track,
with an automatic start and the detector; with --from-truth, from the truth with the noise of `eval_clips` and
without the detector.  The arm `track` is the same without --smooth.  For comparison there are two
baselines: a pose that does not move, and the mean cycle that continues from the true start.  Angles of all
motions come from the same fit of a skeleton to joints (`gait.export.angles`), so a constant error of an angle
is a difference of joint centres.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import eval_clips
import gait_cases
import numpy as np
import table
from eval_plan import Clip
from facts import facts
from gait_errors import EVENTS, Compared, gait_errors, true_events

from gait.bindings.model import read_blob
from gait.body.skeleton import CHANNELS, JOINTS
from gait.errors import UserError
from gait.export import angles
from gait.io import blob
from gait.io.track_file import Joints, Track, read_track, read_truth
from gait.motion.evaluate import free_run, static_pose
from gait.motion.footfalls import Draws, strikes_of
from gait.motion.parameters import MIRRORED_PARAMETERS, PARAMETER_LABELS, measured
from gait.progress import progress

OUT = eval_clips.ROOT / "build" / "eval-gait"
ARMS = ("track", "smooth", "free cycle", "static pose")

#: Columns of errors: heading, name in `gait_errors`, factor to the heading's unit; 0: relative.
ERRORS = (
    ("heel strike ms", "heel_strike_s", 1000.0),
    ("toe-off ms", "toe_off_s", 1000.0),
    ("stride time ms", "stride_time_s", 1000.0),
    ("step time ms", "step_time_s", 1000.0),
    ("stance pp", "stance_percent", 1.0),
    ("cadence %", "mean:cadence_spm", 0.0),
    ("step length mm", "step_length_m", 1000.0),
    ("stride length mm", "stride_length_m", 1000.0),
    ("the person's mm", "mean:stride_length_m", 1000.0),
    ("step width mm", "step_width_m", 1000.0),
    ("clearance mm", "foot_clearance_m", 1000.0),
    ("speed m/s", "mean:speed_m_s", 1.0),
    ("step time asym. pp", "asymmetry:step_time_s", 1.0),
    ("step length asym. pp", "asymmetry:step_length_m", 1.0),
)
#: Angles with OpenSim's names, as in libgait/doc/reference/angles.md: channels of both sides, or one.
ANGLES = {
    "hip_flexion": ("r_hip_flexion", "l_hip_flexion"),
    "hip_adduction": ("r_hip_abduction", "l_hip_abduction"),
    "knee_angle": ("r_knee_flexion", "l_knee_flexion"),
    "ankle_angle": ("r_ankle_flexion", "l_ankle_flexion"),
    "pelvis_list": ("root_roll",),
    "pelvis_rotation": ("root_yaw",),
    "lumbar_extension": ("torso_y",),
    "lumbar_bending": ("torso_x",),
    "lumbar_rotation": ("torso_z",),
}
#: Targets: heading, greatest pooled value.
WANTED = {"heel strike ms": 15.0, "the person's mm": 20.0, "speed m/s": 0.03, "cadence %": 1.0}
WANTED_ANGLES = {"hip_flexion": 3.5, "knee_angle": 3.5}  # degrees, after subtracting a constant
WANTED_COVERAGE = (85.0, 95.0)  # per cent

_LEG = ("hip_flexion", "knee_angle", "ankle_angle")
#: Author, views, measure, error; then our quantities of the same kind and their factor.
PUBLISHED: tuple[tuple[Any, ...], ...] = (
    (
        "Stenum 2021, OpenPose",
        "1 view, from the side",
        "heel strike, toe-off, ms",
        "20, 20",
        tuple(EVENTS),
        1e3,
    ),
    ("", "", "step length of a step, mm", "49", ("step_length_m",), 1e3),
    ("", "", "step length of a person, mm", "18", ("mean:step_length_m",), 1e3),
    ("", "", "speed, m/s", "0.10", ("mean:speed_m_s",), 1.0),
    ("", "", "hip, knee, degrees", "4.0, 5.6", ("hip_flexion", "knee_angle"), 1.0),
    ("Gilon 2026, OpenCap Monocular", "1 view", "angles (hip, knee, ankle here), degrees", "4.8", _LEG, 1.0),
    ("", "", "place of the pelvis, mm", "34", ("pelvis",), 1.0),
    (
        "Peiffer 2025, Portable Biomechanics Laboratory",
        "1 view",
        "the same angles, degrees",
        "below 3",
        _LEG,
        1.0,
    ),
    (
        "Keating 2026, OpenCap",
        "2 or more views",
        "stride length, mm",
        "bias +127",
        ("mean:stride_length_m",),
        1e3,
    ),
)
PUBLISHED_NOTE = """\
Stenum and others 2021, PLoS Computational Biology 17:e1008935 (32 people); Gilon and others 2026,
arXiv:2603.24733; Peiffer and others 2025, arXiv:2507.08268; Keating and others 2026, Sensors (39 people,
beside a walkway with light barriers).  The published figures come from other people, other clips and other
references, and mostly from films of real people; ours come from drawn or simulated films whose truth is
exact.  They show the order of magnitude that a laboratory sees, and do not rank anything.  Ours are pooled,
with angles as they are; `make eval` counts the pelvis among its joints."""


@dataclass(frozen=True)
class Run:
    """One arm on one clip with one seed."""

    clip: str
    arm: str
    seed: int
    compared: dict[str, Compared]  #: of `gait_errors`; empty if no whole stride was found
    asked: int  #: strides in the truth
    #: degrees by name of `ANGLES`: mean absolute error, then without the mean difference of each side
    raw: dict[str, float]
    shifted: dict[str, float]
    pelvis: float  #: mean distance of the pelvis from the true place, mm


def main() -> int:
    """Track what is missing, compare, print or record; exit code 1 if a target is not reached."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--seeds", type=int, default=3, help="runs of a clip, each from its own start (3)")
    add("--clips", nargs="+", metavar="NAME", help="names of clips (all with true joints)")
    add(
        "--simulated",
        type=Path,
        metavar="DIR",
        help="make walks in DIR unless they exist, and evaluate those",
    )
    add(
        "--first-seed",
        type=int,
        default=0,
        metavar="S",
        help="of the simulated people, for choices: not 0 (0)",
    )
    add("--from-truth", action="store_true", help="start from the truth with noise, without the detector")
    add("--jobs", type=int, default=2, metavar="J", help="clips side by side (2)")
    add("--record", metavar="NAME", help="write tests/bench/results/NAME.md and NAME.csv")
    args = parser.parse_args()
    try:
        clips = _clips(args)
        runs = _runs(clips, args)
    except UserError as exc:
        print(f"eval-gait: {exc}", file=sys.stderr)
        return 1
    missed = report(runs, args.record)
    if missed:
        print(f"eval-gait: not reached: {'; '.join(missed)}", file=sys.stderr)
    return bool(missed)


def _clips(args: argparse.Namespace) -> list[Clip]:
    """The clips with true joints that were asked for."""
    if args.simulated:
        with progress("making clips", len(gait_cases.CASES)) as update:
            gait_cases.make(args.simulated, args.first_seed, args.jobs, update)
        clips = eval_clips.folder_clips(args.simulated)
    else:
        clips = [clip for clip in eval_clips.folder_clips(eval_clips.DATA / "eval" / "dev") if clip.truth]
    names = [clip.name for clip in clips]
    unknown = [name for name in args.clips or () if name not in names]
    if unknown:
        raise UserError(f"--clips {unknown[0]}: unknown; use {' '.join(names)}")
    return [clip for clip in clips if not args.clips or clip.name in args.clips]


def _runs(clips: list[Clip], args: argparse.Namespace) -> list[Run]:
    with progress("learning", None) as update:
        models = eval_clips.models(clips, eval_clips.ROOT / "build" / "eval" / "models", args.jobs, update)
    tasks = [
        (clip, _folder(clip, model := models.get(clip.subject or ""), seed, args.from_truth), model, seed)
        for seed in range(1, args.seeds + 1)
        for clip in clips
    ]
    runs: list[Run] = []
    with progress("tracking", len(tasks)) as update, ThreadPoolExecutor(args.jobs) as pool:
        for done, _ in enumerate(pool.map(lambda task: _track(*task, args.from_truth), tasks), 1):
            update(done)
    for task in tasks:
        runs += _judged(*task)
    return runs


def _folder(clip: Clip, model: Path | None, seed: int, from_truth: bool) -> Path:
    """Folder of a run's files; another one for every state of what was learnt."""
    start = "truth" if from_truth else "auto"
    return OUT / clip.folder.parent.name / f"{clip.name}.{model.stem if model else 'walk'}.{start}.{seed}"


def _track(clip: Clip, folder: Path, model: Path | None, seed: int, from_truth: bool) -> None:
    """Track with and without --smooth, unless that has been done."""
    folder.mkdir(parents=True, exist_ok=True)
    words = ["track", clip.video, "--camera", clip.camera, "--seed", seed, "--quiet"]
    if from_truth:
        init = folder / "init.json"
        init.write_text(json.dumps(eval_clips.noisy_start(clip, seed, 0.0)))
        words += ["--init", init, "--detector", "none"]
    words += ["--background", clip.plate] if clip.plate else []
    words += ["--model", model] if model else []
    for name, more in (("smooth", ["--smooth", "--draws", folder / "draws.npz"]), ("track", [])):
        target = folder / f"{name}.csv"
        if target.is_file():
            continue
        line = [sys.executable, "-m", "gait", *map(str, [*words, "-o", target, *more])]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        if done.returncode:
            raise UserError(f"gait track of {clip.name}, seed {seed}: {done.stderr.strip()}")


def _judged(clip: Clip, folder: Path, model: Path | None, seed: int) -> Iterator[Run]:
    """Compare the arms with the truth; baselines do not depend on the seed."""
    truth = read_truth(clip.truth)
    events = true_events(truth, clip.folder / "meta.json")
    for arm in ARMS[:2]:
        track = read_track(folder / f"{arm}.csv")
        draws = Draws.read(folder / "draws.npz", track) if arm == "smooth" else None
        yield _run(clip, arm, seed, track, draws, truth, events)
    if seed == 1:
        sections = blob.decode(read_blob(str(model) if model else None), clip.name)
        strikes = strikes_of(truth, clip.folder / "meta.json")
        still = static_pose(sections, truth, JOINTS)
        running = free_run(sections, truth, strikes, 0, JOINTS)
        for arm, places in (("free cycle", running), ("static pose", still)):
            if places is not None:
                yield _run(clip, arm, seed, _as_track(truth, places), None, truth, events)


def _as_track(truth: Joints, places: np.ndarray) -> Track:
    """A motion of `JOINTS` (n, P, 3) as a track that states no uncertainty."""
    n = len(truth.frame)
    by_name = dict(zip(JOINTS, np.moveaxis(places, 1, 0), strict=True))
    return Track(truth.frame, truth.time, by_name, ["tracking"] * n, np.full(n, np.nan), {}, {})


def _run(
    clip: Clip, arm: str, seed: int, track: Track, draws: Draws | None, truth: Joints, events: Any
) -> Run:
    parameters = measured(track, draws)
    compared = {} if parameters is None else gait_errors(parameters, truth, events)
    inside = [(t >= track.time[0]) & (t <= track.time[-1]) for t in events.strike.values()]
    asked = int(sum(max(0, each.sum() - 1) for each in inside))
    return Run(
        clip.name, arm, seed, compared, asked, *_angle_errors(track, truth), _pelvis_error(track, truth)
    )


def _pelvis_error(track: Joints, truth: Joints) -> float:
    """Mean distance of the pelvis from the true place, mm."""
    _, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    off = track.places["pelvis"][ours] - truth.places["pelvis"][theirs]
    return 1e3 * float(np.linalg.norm(off, axis=1).mean())


def _angle_errors(track: Joints, truth: Joints) -> tuple[dict[str, float], dict[str, float]]:
    """Mean absolute errors by name of `ANGLES`, degrees: raw, and after subtracting the mean of each side."""
    _, ours, theirs = np.intersect1d(track.frame, truth.frame, return_indices=True)
    found, true = (_fitted(motion, rows) for motion, rows in ((track, ours), (truth, theirs)))
    raw, shifted = {}, {}
    for name, channels in ANGLES.items():
        columns = [CHANNELS.index(channel) for channel in channels]
        off = np.degrees(np.angle(np.exp(1j * (found - true)[:, columns])))
        raw[name] = float(np.abs(off).mean())
        shifted[name] = float(np.abs(off - off.mean(axis=0)).mean())
    return raw, shifted


def _fitted(motion: Joints, rows: np.ndarray) -> np.ndarray:
    """Angles (n, channels) of a skeleton fitted to a motion's joints, radians."""
    places = np.stack([motion.places[name][rows] for name in JOINTS], axis=1)
    return angles.fit(places).angles


def report(runs: list[Run], record: str | None) -> list[str]:
    """Print the tables, keep them if asked for, and return the targets that are missed."""
    names = list(dict.fromkeys(run.clip for run in runs))
    errors = [row for clip in (*names, None) for arm in ARMS if (row := _error_row(runs, clip, arm))]
    angle = [row for clip in (*names, None) for arm in ARMS if (row := _angle_row(runs, clip, arm))]
    intervals = list(_coverage_rows(runs))
    heads = (
        ["clip", "arm", "strides", *(head for head, _, _ in ERRORS)],
        ["clip", "arm", *(f"{name} {kind}" for name in ANGLES for kind in ("raw", "shifted"))],
        ["parameter", *(f"{arm}: {what}" for arm in ARMS[:2] for what in ("values", "in 90 %", "z rms"))],
        ["published by", "of", "what", "error", *(f"ours, {arm}" for arm in ARMS[:2])],
    )
    errors += [_median_row(errors, arm) for arm in ARMS if any(row[1] == arm for row in errors)]
    wanted, missed = _verdicts(errors, angle, intervals)
    parts = [
        ("Wanted and reached", ["measure", "wanted", "track", "smooth", "smooth reaches it"], wanted, ""),
        ("Footfalls and parameters, mean absolute errors", heads[0], errors, _READING),
        ("Joint angles, mean absolute errors in degrees", heads[1], angle, _ANGLE_READING),
        ("Intervals of parameters", heads[2], intervals, _INTERVAL_READING),
        ("Beside others", heads[3], list(_beside_others(runs)), PUBLISHED_NOTE),
    ]
    text = [f"# What a gait lab compares\n\n{facts()}\n"]
    for title, head, rows, note in parts:
        shown, cells, numbers = table.show(title, head, rows)
        text.append(
            "\n\n".join(filter(None, [f"## {title}", note, table.markdown(shown, cells, numbers)])) + "\n"
        )
    if record:
        table.RESULTS.mkdir(parents=True, exist_ok=True)
        (table.RESULTS / f"{record}.md").write_text("\n".join(text), encoding="utf-8")
        _write_values(table.RESULTS / f"{record}.csv", runs)
    return missed


_READING = """\
Errors are over strides without unsure frames that the truth also has (column strides: found / in the truth).
Heel strike and toe-off are compared with the events of meta.json.  A row `all` pools the values of all clips
and seeds.  The person's stride length, cadence (relative) and speed are means over a clip; asymmetry is
200 (right - left) / (right + left), in percentage points.  Foot clearance is the least height of the toe
joint in the middle of the swing."""
_ANGLE_READING = """\
Names and signs are those of libgait/doc/reference/angles.md.  raw: the angles as they are; shifted: after
subtracting the mean difference of each side over the clip.  Joints do not show pelvic tilt, so in both
motions hip_flexion is relative to a pelvis that does not tilt."""
_INTERVAL_READING = """\
Share of the true values inside the 90 % intervals (mean +- 1.645 standard deviations), over clips and
seeds. z rms: root mean square error in standard deviations, which is 1 if they are right.  track: standard
deviations of each frame; smooth: draws from the posterior of the whole clip."""


def _chosen(runs: list[Run], clip: str | None, arm: str) -> list[Run]:
    return [run for run in runs if run.arm == arm and clip in (None, run.clip)]


def _error_row(runs: list[Run], clip: str | None, arm: str) -> list[Any] | None:
    chosen = _chosen(runs, clip, arm)
    if not chosen:
        return None
    found = sum(len(run.compared["stride_time_s"].found) for run in chosen if run.compared)
    row: list[Any] = [clip or "all", arm, f"{found}/{sum(run.asked for run in chosen)}"]
    for _, name, factor in ERRORS:
        parts = [run.compared[name] for run in chosen if name in run.compared]
        off = [np.abs(c.error) * factor if factor else 100 * np.abs(c.error / c.true) for c in parts]
        values = np.concatenate(off) if off else np.zeros(0)
        row.append(float(values.mean()) if len(values) else None)
    return row


def _median_row(errors: list[list[Any]], arm: str) -> list[Any]:
    """Medians over the clips of an arm."""
    rows = [row[3:] for row in errors if row[1] == arm and row[0] != "all"]
    columns = [[value for value in column if value is not None] for column in zip(*rows, strict=True)]
    return ["median", arm, "", *(float(np.median(column)) if column else None for column in columns)]


def _beside_others(runs: list[Run]) -> Iterator[list[Any]]:
    """Published figures with ours of the same kind, pooled."""
    for *cells, names, factor in PUBLISHED:
        row: list[Any] = list(cells)
        for arm in ARMS[:2]:
            values = []
            for name in names:
                if name == "pelvis":
                    values.append(float(np.mean([run.pelvis for run in _chosen(runs, None, arm)])))
                    continue
                if name in ANGLES:
                    values.append(float(np.mean([run.raw[name] for run in _chosen(runs, None, arm)])))
                    continue
                parts = [run.compared[name].error for run in _chosen(runs, None, arm) if name in run.compared]
                error = factor * np.concatenate(parts)
                values.append(float(error.mean() if "bias" in cells[-1] else np.abs(error).mean()))
            row.append(", ".join(f"{value:.3g}" for value in values) if values else None)
        yield row


def _angle_row(runs: list[Run], clip: str | None, arm: str) -> list[Any] | None:
    chosen = _chosen(runs, clip, arm)
    if not chosen:
        return None
    values = [
        float(np.mean([getattr(run, kind)[name] for run in chosen]))
        for name in ANGLES
        for kind in ("raw", "shifted")
    ]
    return [clip or "all", arm, *(f"{value:.1f}" for value in values)]


def _coverage_rows(runs: list[Run]) -> Iterator[list[Any]]:
    names = [
        *EVENTS,
        *PARAMETER_LABELS,
        *(f"mean:{n}" for n in PARAMETER_LABELS),
        *(f"asymmetry:{n}" for n in MIRRORED_PARAMETERS),
    ]
    groups = [(name, [name]) for name in names]
    groups += [("all events", list(EVENTS)), ("all strides", list(PARAMETER_LABELS))]
    groups.append(
        (
            "all means",
            [f"mean:{n}" for n in PARAMETER_LABELS] + [f"asymmetry:{n}" for n in MIRRORED_PARAMETERS],
        )
    )
    groups.append(("all", names))
    for title, members in groups:
        row: list[Any] = [title]
        for arm in ARMS[:2]:
            parts = [
                run.compared[n] for run in _chosen(runs, None, arm) for n in members if n in run.compared
            ]
            covered = np.concatenate([c.covered for c in parts]) if parts else np.zeros(0)
            z = np.concatenate(
                [(c.error / np.maximum(c.sd, 1e-9))[np.isfinite(c.sd)] for c in parts] or [np.zeros(0)]
            )
            row += [len(covered), round(100 * float(covered.mean())) if len(covered) else None]
            row.append(float(np.sqrt(np.mean(z**2))) if len(z) else None)
        yield row


def _verdicts(
    errors: list[list[Any]], angle: list[list[Any]], intervals: list[list[Any]]
) -> tuple[list[list[Any]], list[str]]:
    """Rows of targets and results, judged with the arm smooth, and the targets missed."""
    head = [name for name, _, _ in ERRORS]
    rows: list[list[Any]] = []
    for name, most in WANTED.items():
        at = 3 + head.index(name)
        values = [next((r[at] for r in errors if r[:2] == ["all", arm]), None) for arm in ARMS[:2]]
        rows.append([name, f"<= {most:g}", *values, values[1] is not None and values[1] <= most])
    for name, most in WANTED_ANGLES.items():
        at = 3 + 2 * list(ANGLES).index(name)
        values = [float(next(r[at] for r in angle if r[:2] == ["all", arm])) for arm in ARMS[:2]]
        rows.append([f"{name}, degrees after a constant", f"<= {most:g}", *values, values[1] <= most])
    low, high = WANTED_COVERAGE
    for title in ("all events", "all strides", "all means", "all"):
        _, _, track, _, _, smooth, _ = next(row for row in intervals if row[0] == title)
        met = smooth is not None and low <= smooth <= high
        rows.append([f"90 % intervals, {title}", f"{low:g}-{high:g} %", track, smooth, met])
    missed = [row[0] for row in rows if not row[-1]]
    return [[*row[:-1], "yes" if row[-1] else "no"] for row in rows], missed


def _write_values(path: Path, runs: list[Run]) -> None:
    """Every compared value of every run."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["clip", "arm", "seed", "quantity", "found", "true", "sd"])
        for run in runs:
            start = [run.clip, run.arm, run.seed]
            for name, c in run.compared.items():
                for values in zip(c.found, c.true, c.sd, strict=True):
                    writer.writerow([*start, name, *(f"{v:.5g}" if np.isfinite(v) else "" for v in values)])
            writer.writerow([*start, "pelvis_error_m", f"{1e-3 * run.pelvis:.5f}", "0", ""])
            for name in ANGLES:
                writer.writerow([*start, f"{name}_error_deg", f"{run.raw[name]:.3f}", "0", ""])
                writer.writerow([*start, f"{name}_error_shifted_deg", f"{run.shifted[name]:.3f}", "0", ""])


if __name__ == "__main__":
    sys.exit(main())
