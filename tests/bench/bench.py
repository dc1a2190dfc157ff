"""Run a benchmark, show what it prints, draw its figures; `--page` keeps all that with its circumstances."""

from __future__ import annotations

import argparse
import subprocess
import sys
from datetime import datetime, timezone
from pathlib import Path

import bench_plot
import bench_runs
from facts import facts

from gait.io.files import replacing

PLOT = Path("build/bench/speed.png")


def run(command: list[str]) -> str:
    """Show what a program prints and return it; exit as the program does if it fails."""
    lines = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            lines.append(line)
    if process.returncode:
        sys.exit(process.returncode)
    return "".join(lines)


def compiler(command: str) -> str:
    """First line that a compiler prints about itself."""
    done = subprocess.run([*command.split(), "--version"], capture_output=True, text=True, check=False)
    return (done.stdout.splitlines() or [f"{command}, version unknown"])[0]


def page(runs: list[str], args: argparse.Namespace) -> str:
    """The record as Markdown: machine, command, date, and all that the last run printed."""
    date = datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    options = "--record" if len(runs) == 1 else f"'--record --runs {len(runs)}'"
    made = f"{facts(f'make {args.target} ARGS={options}')} {compiler(args.cc)}; {date}."
    figures = f" All figures: {args.csv.name}." if args.csv else ""
    note = "MISSED: a target that this run did not reach."
    text = f"# {args.title}\n\n{made}{figures} {note}\n"
    if len(runs) > 1:
        text += f"\nBy the medians of the runs:\n\n```\n{bench_runs.summary(runs)}\n```\n\nThe last run:\n"
    return f"{text}\n```\n{runs[-1].strip()}\n```\n"


def count(text: str) -> int:
    """Number of runs, at least 1."""
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number of at least 1")
    return int(text)


def main() -> None:
    """Run it; options that this script does not know go to the program."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--cc", default="cc", help="compiler that built the program")
    parser.add_argument("--page", type=Path, help="keep all that is printed in this file, as Markdown")
    parser.add_argument("--target", default="bench", help="target of make, which the page names")
    parser.add_argument("--title", default="Speed of a step", help="of the page")
    parser.add_argument("--csv", type=Path, help="keep the program's figures in this file, and draw them")
    parser.add_argument(
        "--runs", type=count, default=1, help="runs, one after the other; the table then has their medians"
    )
    parser.add_argument("program")
    args, others = parser.parse_known_args()
    if args.csv:
        args.csv.parent.mkdir(parents=True, exist_ok=True)
        others += ["--csv", str(args.csv)]
    runs = [run([args.program, *others]) for _ in range(args.runs)]
    if args.runs > 1:
        print(f"\n{bench_runs.summary(runs)}")
    if args.csv:
        bench_plot.draw(args.csv, PLOT)
    if args.page:
        with replacing(args.page) as temporary:
            temporary.write_text(page(runs, args), encoding="utf-8")


if __name__ == "__main__":
    main()
