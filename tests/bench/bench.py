"""Run a bench, show what it prints, draw its figures; a record keeps all that with what made it."""

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
    """What a program prints, shown meanwhile; ends as it does where it fails."""
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
    """The record as Markdown: on what, by what and when it was made, and all that the last run printed."""
    date = datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")
    options = "--record" if len(runs) == 1 else f"'--record --runs {len(runs)}'"
    made = f"{facts(f'make {args.target} ARGS={options}')} {compiler(args.cc)}; {date}."
    figures = f" All figures: {args.csv.name}." if args.csv else ""
    note = "MISSED: wanted, and not reached in this run."
    text = f"# {args.title}\n\n{made}{figures} {note}\n"
    if len(runs) > 1:
        text += (
            f"\nBy the medians of the runs:\n\n```\n{bench_runs.summary(runs)}\n```\n\nThe last of them:\n"
        )
    return f"{text}\n```\n{runs[-1].strip()}\n```\n"


def count(text: str) -> int:
    """Number of runs, from 1 on."""
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a number from 1 on")
    return int(text)


def main() -> None:
    """Run it with the options that are not of this script."""
    parser = argparse.ArgumentParser(description=__doc__, allow_abbrev=False)
    parser.add_argument("--cc", default="cc", help="compiler that built the program")
    parser.add_argument("--page", type=Path, help="keep all that is printed there, as Markdown")
    parser.add_argument("--target", default="bench", help="of make, that the page names")
    parser.add_argument("--title", default="Speed of a step", help="of the page")
    parser.add_argument("--csv", type=Path, help="keep the program's figures there, and draw them")
    parser.add_argument(
        "--runs", type=count, default=1, help="one after the other; rows then by their medians"
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
