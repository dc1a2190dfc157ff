#!/usr/bin/env python3
"""All evaluations of lifting, one after another; their tables joined in tests/bench/results/lift.md.

    make eval-lift

The exact identities (F1-F3, F5-F7) are tests, which decisions.md lists; `make bench-lift` measures speeds.
"""

from __future__ import annotations

import sys

import parts

PARTS = (
    "lift_mocap.py",
    "lift_modes.py",
    "lift_mixture.py",
    "lift_volume.py",
    "lift_directions.py",
    "lift_tracks.py",
    "lift_parts.py",
    "lift_sides.py",
    "lift_stream.py",
    "lift_people.py",
    "lift_balance.py",
    "lift_detector.py",
    "lift_images.py",
    "tracks_term.py",
)


def main() -> int:
    only = parts.options(__doc__, PARTS).parse_args().only
    return parts.Evaluation("eval-lift", "lift", "Evaluation of lifting", {p: [] for p in PARTS}).main(only)


if __name__ == "__main__":
    sys.exit(main())
