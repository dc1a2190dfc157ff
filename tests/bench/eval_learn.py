#!/usr/bin/env python3
"""All evaluations of learning, one after another; their tables joined in tests/bench/results/learn.md.

make eval-learn
"""

from __future__ import annotations

import sys

import parts

PARTS = (
    "learn_period.py",
    "learn_impute.py",
    "learn_floor.py",
    "learn_lengths.py",
    "learn_size.py",
    "learn_speed.py",
)
WITH_MOCAP = PARTS[1:]  # parts that take the folder of walks as argument


def main() -> int:
    parser = parts.options(__doc__, PARTS)
    parser.add_argument("mocap", help="folder of .amc walks")
    args = parser.parse_args()
    arguments = {part: [args.mocap] if part in WITH_MOCAP else [] for part in PARTS}
    return parts.Evaluation("eval-learn", "learn", "Evaluation of learning", arguments).main(args.only)


if __name__ == "__main__":
    sys.exit(main())
