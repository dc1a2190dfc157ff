"""Errors of the tracker on the development clips and the outdoor video, through the public Python API.

    make eval                                  everything that the table needs, default and paper mode
    make eval ARGS='--modes default --init truth --seeds 1'
    make eval ARGS='--all'                     also wrong stature, no background, 15 and 10 frames a second
    make eval ARGS='--particles 300 1000 3000 --modes default --init truth'
    make eval ARGS='--against old.json'        what changed since that results.json, with intervals
    make eval ARGS='--ablate --modes default --init truth'
    make eval ARGS='--folder DIR'              any folder of clips (video.mp4 camera.json truth.csv ...)
    make eval ARGS='--simulated DIR'           hard cases: made in DIR if absent, then evaluated

A development clip's subject is left out of learning.  A start from the truth has noise drawn with the seed;
auto is `gait track` with its own start, images is the same without the detector.
Writes results.json, results.csv and index.html (overlays, plots; failures first) into build/eval.
"""

from __future__ import annotations

import argparse
import csv
import json
import signal
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from pathlib import Path
from textwrap import fill
from typing import Any

import eval_ablate
import eval_clips
import eval_page
import eval_simulated
import eval_table
import eval_wanted
from eval_plan import INITS, Arm, Clip, Job, main_arms, varied_arms
from eval_run import Result, run
from facts import facts

from gait import TrackerConfig, UserError
from gait.io.files import replacing
from gait.progress import progress

OUT = eval_clips.ROOT / "build" / "eval"
RESULTS = Path(__file__).parent / "results"


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--modes", nargs="+", choices=("default", "paper"), default=["default", "paper"], help="(both)")
    add("--init", nargs="+", choices=INITS, default=INITS, help="(all)")
    add("--seeds", type=int, metavar="N", help="runs of a clip in each arm (3; default mode from auto 4)")
    add("--clips", nargs="+", metavar="NAME", help="names of clips (all, and outdoor)")
    add("--folder", type=Path, metavar="DIR", help="evaluate the clips in DIR instead")
    add("--simulated", type=Path, metavar="DIR", help="make the hard cases in DIR if need be, evaluate them")
    add(
        "--stature-error",
        type=float,
        metavar="SHARE",
        help="also with a stature in the start that is wrong by +-SHARE",
    )
    add(
        "--background",
        nargs="+",
        choices=("plate", "auto", "none"),
        default=[],
        help="also with these backgrounds",
    )
    add("--every", type=int, nargs="+", default=[], metavar="K", help="also with every K-th frame only")
    add("--particles", type=int, nargs="+", default=[], metavar="N", help="also with N particles")
    add(
        "--rejuvenation",
        type=float,
        nargs="+",
        default=[],
        metavar="S",
        help="--particles also with these times",
    )
    add("--ablate", action="store_true", help="also with each term and feature switched off in turn")
    add("--all", action="store_true", help="--stature-error 0.05 --background none --every 2 3")
    add("--against", type=Path, metavar="JSON", help="results.json of an earlier run: print what changed")
    add("--jobs", type=int, default=2, metavar="J", help="runs side by side; results do not depend on it (2)")
    add("--json", action="store_true", help="print the figures of every run as JSON instead of tables")
    add("--html", type=Path, default=OUT, metavar="DIR", help="folder of the results (build/eval)")
    add("--no-pictures", action="store_true", help="neither overlays nor a page")
    add("--record", metavar="NAME", help="also write tests/bench/results/NAME.md and NAME.csv")
    args = parser.parse_args()
    if args.record and args.against:
        parser.error("--record: leave --against out, kept figures stand for themselves")
    if args.all:
        args.stature_error = args.stature_error or 0.05
        args.background, args.every = args.background or ["none"], args.every or [2, 3]
    return args


def arms_of(args: argparse.Namespace) -> list[Arm]:
    """The main arms, then one arm for each thing that the command line varies."""
    switches = eval_ablate.switches(TrackerConfig.default()) if args.ablate else None
    return main_arms(args.modes, args.init, args.seeds) + varied_arms(
        seeds=args.seeds or 3,
        stature_error=args.stature_error,
        backgrounds=args.background,
        every=args.every,
        particles=args.particles,
        rejuvenation=args.rejuvenation,
        switches=switches,
    )


def clips_of(args: argparse.Namespace) -> list[Clip]:
    """The clips that the command line asks for."""
    if args.simulated:
        with progress("making clips", eval_simulated.count()) as update:
            eval_simulated.make(args.simulated, args.jobs, update)
    folder = args.folder or args.simulated
    if folder is None:
        return eval_clips.shared_clips(args.clips)
    return [clip for clip in eval_clips.folder_clips(folder) if not args.clips or clip.name in args.clips]


def run_all(jobs: list[Job], workers: int, update: Callable[[int], None]) -> list[Result]:
    """Run the jobs side by side, the long ones first; results in the order of `jobs`."""
    if workers < 2:
        return [_counted(job, number, update) for number, job in enumerate(jobs, 1)]
    order = sorted(
        range(len(jobs)), key=lambda i: (jobs[i].arm.mode == "paper", jobs[i].clip.name), reverse=True
    )
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        places = {pool.submit(run, jobs[i]): i for i in order}
        results: dict[int, Result] = {}
        try:
            for done, future in enumerate(as_completed(places), 1):
                results[places[future]] = future.result()
                update(done)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children():
                worker.terminate()
            raise
    return [results[i] for i in range(len(jobs))]


def _counted(job: Job, number: int, update: Callable[[int], None]) -> Result:
    result = run(job)
    update(number)
    return result


def save(folder: Path, results: list[Result], rows: list[dict[str, Any]]) -> None:
    """Write results.json and results.csv."""
    data = [row | {"measures": result.measures} for row, result in zip(rows, results, strict=True)]
    with replacing(folder / "results.json") as path:
        path.write_text(json.dumps(data), encoding="utf-8")
    write_csv(folder / "results.csv", rows)


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write a row for each run; numbers to four digits."""
    with replacing(path) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})


def tables(
    rows: list[dict[str, Any]],
    shape: Callable[[list[list[str]], int], str],
    before: list[dict[str, Any]],
    wanted: bool = True,
) -> list[tuple[str, str]]:
    """Headings and tables as made by `shape`; `before` has the rows of an earlier run or is empty."""
    summaries = eval_table.summaries(rows)
    parts = [("Clips", shape(eval_table.grid(summaries), 2))]
    parts.append(("Intervals and status", shape(eval_table.honesty(summaries), 2)))
    by_particles = eval_table.by_particles(rows, TrackerConfig.default().particles)
    if len(by_particles) > 1:
        parts.append(("Errors and time by number of particles", shape(by_particles, 1)))
        times = eval_table.time_to_error(rows, TrackerConfig.default().particles)
        parts.append(("Time of a step with which an error is reached", shape(times, 1)))
    costs = eval_ablate.costs(rows)
    if costs:
        parts.append(
            ("Switched off: change of each measure, 95 % interval", shape(eval_ablate.grid(costs), 2))
        )
    changes = eval_ablate.changes(before, rows)
    if changes:
        parts.append(
            ("Changed since: mean over the runs, 95 % interval", shape(eval_ablate.grid(changes), 2))
        )
    judged = eval_wanted.verdicts(rows)
    if wanted and any(verdict.passed is not None for verdict in judged):  # all are of the default mode
        parts.append(("Wanted and reached", shape(eval_wanted.grid(judged), 4)))
    return parts


def record(name: str, rows: list[dict[str, Any]], parts: list[tuple[str, str]], words: str) -> None:
    """Keep the figures of this run in the repository."""
    RESULTS.mkdir(exist_ok=True)
    write_csv(RESULTS / f"{name}.csv", rows)
    text = [f"# Evaluation of the tracker\n\n{facts(words)}  A row for each run is in {name}.csv.\n"]
    text += [f"## {heading}\n\n{table}\n" for heading, table in reversed(parts)]
    text += [f"- failed: {words}\n" for words in eval_table.failures(rows)]
    with replacing(RESULTS / f"{name}.md") as path:
        path.write_text("\n".join([*text, fill(eval_table.LEGEND, 110), ""]), encoding="utf-8")


def _model(models: dict[str, dict[str, Path]], clip: Clip, arm: Arm) -> Path | str:
    """Model without the clip's subject, of the arm's mode; else the shipped one."""
    paper = arm.mode == "paper"
    return models["paper" if paper else "people"].get(clip.subject or "", "paper" if paper else "walk")


def evaluate(args: argparse.Namespace) -> list[dict[str, Any]]:
    """Run, write, and return the rows of figures."""
    clips, arms = clips_of(args), arms_of(args)
    tracks = args.html / "tracks"
    tracks.mkdir(parents=True, exist_ok=True)
    with progress("learning", len({clip.subject for clip in clips})) as update:
        priors = {"paper" if arm.mode == "paper" else "people" for arm in arms}
        models = {p: eval_clips.models(clips, OUT / "models", args.jobs, update, p) for p in sorted(priors)}
    jobs = [
        Job(clip, arm, seed, _model(models, clip, arm), tracks, pictures=not args.no_pictures)
        for arm in arms
        for clip in clips
        for seed in range(1, arm.seeds + 1)
    ]
    with progress("runs", len(jobs)) as update:
        results = run_all(jobs, args.jobs, update)
    rows = [eval_table.figures(result) for result in results]
    save(args.html, results, rows)
    if not args.no_pictures:
        with progress("page", len(clips) * len(arms)) as update:
            eval_page.write(args.html / "index.html", "Evaluation of the tracker", results, rows, update)
    return rows


def earlier(path: Path) -> list[dict[str, Any]]:
    """Rows of another run's results.json."""
    if not path.is_file():
        raise UserError(f"--against {path}: no such file; keep the results.json of an earlier run")
    rows: list[dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return rows


def main() -> int:
    """Evaluate and report; exit code 1 if a target is not reached."""
    args = arguments()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends the workers as well
    if not eval_clips.DATA.is_dir() and not (args.folder or args.simulated):
        print("eval: ../shared/data is absent: nothing to evaluate on", file=sys.stderr)
        return 0
    try:
        before = [] if args.against is None else earlier(args.against)
        rows = evaluate(args)
    except UserError as exc:
        print(f"eval: {exc}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("eval: interrupted", file=sys.stderr)
        return 130
    if args.json:
        print(json.dumps(rows))
    else:
        for heading, table in tables(rows, eval_table.plain, before, not args.simulated):
            print(f"\n{heading}\n{table}")
        print("\n" + fill(eval_table.LEGEND, 110))
        for words in eval_table.failures(rows):
            print(f"failed: {words}")
    if args.record:
        parts = tables(rows, eval_table.markdown, [], not args.simulated)
        record(args.record, rows, parts, f"make eval ARGS='{' '.join(map(str, sys.argv[1:]))}'")
    if not args.no_pictures:
        print(f"pictures and plots: {args.html / 'index.html'}", file=sys.stderr)
    missed = [] if args.simulated else eval_wanted.missed(rows)
    if missed:
        print(f"eval: not reached: {'; '.join(missed)}", file=sys.stderr)
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())
