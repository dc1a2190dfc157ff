"""Instructions of a particle of the default mode in a step, under QEMU: what 1,000 more take in three.

The count compares versions of the code where there is no board; it does not include the effects of caches
or the time of an instruction.  It depends on the compiler.  The exit code is 1 if the target is missed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from bench import compiler
from facts import facts

PAGE = Path(__file__).parent / "results" / "instructions.md"
MODEL = Path(__file__).resolve().parents[2] / "python" / "gait" / "data" / "walk.gait"
FEW, MANY, STEPS = 200, 1200, 3
#: Of a particle before kernels were written for NEON (the parent of commit 7b2e93e7); half of it is wanted.
BEFORE = {"aarch64-linux-gnu": 69167}


def count(qemu: str, plugin: str, program: str, particles: int) -> int:
    """Instructions of the whole program with this many particles."""
    words = [*qemu.split(), "-plugin", plugin, program, str(MODEL), str(particles)]
    return int(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def verdict(machine: str, each: int) -> str:
    """The count beside the one of before and the target, if there are any for this machine."""
    before = BEFORE.get(machine)
    if before is None:
        return ""
    reached = "reached" if each <= before / 2 else "MISSED"
    return f"\nbefore {before}, wanted <= {before // 2}, this run {each}: {reached}"


def main() -> None:
    """Count, print and, with --record, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machine", help="name of the program's machine")
    parser.add_argument("qemu", help="emulator and its options")
    parser.add_argument("plugin", help="instructions_plugin.so")
    parser.add_argument("program", help="instructions, built for the machine")
    parser.add_argument("--cc", default="cc", help="compiler that built the program")
    parser.add_argument("--flags", default="", help="its options for all files")
    parser.add_argument("--record", action="store_true", help=f"write {PAGE.name}")
    args = parser.parse_args()
    few, many = (count(args.qemu, args.plugin, args.program, n) for n in (FEW, MANY))
    each = (many - few) // ((MANY - FEW) * STEPS)
    line = f"{args.machine}: {each} instructions of a particle{verdict(args.machine, each)}"
    print(line)
    if args.record:
        command = f"make bench-instructions CC={args.machine}-gcc ARGS=--record"
        made = (
            f"{facts(command)} {compiler(args.cc)}, {args.flags} and libgait/flags.mk; {compiler(args.qemu)}."
        )
        PAGE.write_text(f"# Instructions of a particle\n\n{made}\n\n```\n{line}\n```\n", encoding="utf-8")
    sys.exit("MISSED" in line)


if __name__ == "__main__":
    main()
