#!/usr/bin/env python3
"""What drawing costs `gait track`: each development clip without an overlay, then with one.

    overlay.py [--record] [CLIP...]

Both runs are given the same camera, the same height and one thread, and find the start by themselves.  The
seconds are those of the loop over the frames, as `gait track --json` counts them; the joints are found before
it.  Exit code 1 if drawing and encoding take longer than tracking.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import eval_clips
import table
from facts import facts

GAIT = [sys.executable, "-m", "gait"]


def main() -> int:
    """Run, print, and record if asked to."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--record", action="store_true")
    options.add_argument("clips", nargs="*", metavar="CLIP")
    args = options.parse_args()
    folder = eval_clips.DATA / "eval" / "dev"
    if not folder.is_dir():
        print(f"overlay: {folder} is not there, left out", file=sys.stderr)
        return 0
    clips = [c for c in sorted(folder.iterdir()) if not args.clips or c.name in args.clips]
    rows = [_row(clip) for clip in clips]
    head = ["clip", "frames", "tracking ms", "drawing ms", "share", "cpu s", "cpu s with overlay"]
    note = (
        f"{facts('tests/bench/overlay.py --record')}\n\nMilliseconds a frame of the loop over the frames: "
        "without an overlay (tracking), and what an overlay adds (drawing, encoding included, which runs "
        "beside it in a thread of its own). Share: of the tracking. Processor seconds of the whole command, "
        "detector included. Wanted: drawing takes no longer than tracking."
    )
    if args.record:
        table.publish("overlay", "Drawing beside tracking", head, rows, note)
    else:
        table.show("Drawing beside tracking", head, rows)
    return int(any(row[3] > row[2] for row in rows))


def _row(clip: Path) -> list[Any]:
    """Frames, milliseconds and processor seconds of both runs of a clip."""
    stature = json.loads((clip / "meta.json").read_text())["limb_lengths_m"]["stature"]
    words = [*GAIT, "track", str(clip / "video.mp4"), "--camera", str(clip / "camera.json")]
    words += ["--height", f"{stature:.3f}", "--json", "--quiet"]
    with tempfile.TemporaryDirectory() as tmp:
        words += ["-o", str(Path(tmp) / "track.csv")]
        plain, used = _run(words)
        drawn, with_overlay = _run([*words, "--overlay", str(Path(tmp) / "overlay.mp4")])
    tracking, both = (1000 / figures["wall_fps"] for figures in (plain, drawn))
    return [clip.name, plain["frames"], tracking, both - tracking, both / tracking - 1, used, with_overlay]


def _run(words: list[str]) -> tuple[dict[str, Any], float]:
    """Figures of a command, and its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begun = time.perf_counter()
    found = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = sum(getattr(after, name) - getattr(before, name) for name in ("ru_utime", "ru_stime"))
    print(f"{time.perf_counter() - begun:.0f} s {' '.join(words[3:4])}", file=sys.stderr)
    return found, seconds


if __name__ == "__main__":
    sys.exit(main())
