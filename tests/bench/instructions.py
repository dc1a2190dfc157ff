"""Instructions of a particle of the default mode in a step, under QEMU: what 1,000 more take in three.

The count compares versions of the code where there is no board; it does not include the effects of caches
or the time of an instruction.
"""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

from facts import facts

PAGE = Path(__file__).parent / "results" / "instructions.md"
MODEL = Path(__file__).resolve().parents[2] / "python" / "gait" / "data" / "walk.gait"
FEW, MANY, STEPS = 200, 1200, 3


def count(qemu: str, plugin: str, program: str, particles: int) -> int:
    """Instructions of the whole program with this many particles."""
    words = [*qemu.split(), "-plugin", plugin, program, str(MODEL), str(particles)]
    return int(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def main() -> None:
    """Count, print and, with --record, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("machine", help="name of the program's machine")
    parser.add_argument("qemu", help="emulator and its options")
    parser.add_argument("plugin", help="instructions_plugin.so")
    parser.add_argument("program", help="instructions, built for the machine")
    parser.add_argument("--record", action="store_true", help=f"write {PAGE.name}")
    args = parser.parse_args()
    few, many = (count(args.qemu, args.plugin, args.program, n) for n in (FEW, MANY))
    line = f"{args.machine}: {(many - few) // ((MANY - FEW) * STEPS)} instructions of a particle"
    print(line)
    if args.record:
        command = f"make bench-instructions CC={args.machine}-gcc ARGS=--record"
        PAGE.write_text(
            f"# Instructions of a particle\n\n{facts(command)}\n\n```\n{line}\n```\n", encoding="utf-8"
        )


if __name__ == "__main__":
    main()
