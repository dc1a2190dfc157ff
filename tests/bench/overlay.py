#!/usr/bin/env python3
"""What drawing costs `gait track`: each development clip without an overlay, then with one.

    overlay.py [--record] [CLIP...]

Both runs are given camera, background and keypoints, so that only tracking remains.  Processor time is
compared, because other programs hardly change it and drawing and encoding run in parallel.  Exit code 1 if
they take more processor time than tracking.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import eval_clips
import table

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
    head = ["clip", "frames", "tracking ms", "drawing ms", "share"]
    note = (
        "Milliseconds of processor time per frame: of the command without an overlay (decoding, "
        "tracking, its start), and what `--overlay` adds (drawing and encoding). Share: the addition "
        "relative to the former. Target: drawing takes no more than tracking."
    )
    table.publish("overlay", "Drawing beside tracking", head, rows, note, record=args.record)
    return int(any(row[3] > row[2] for row in rows))


def _row(clip: Path) -> list[Any]:
    """Name, frames and processor time of both runs of a clip."""
    stature = json.loads((clip / "meta.json").read_text())["limb_lengths_m"]["stature"]
    words = [*GAIT, "track", str(clip / "video.mp4"), "--camera", str(clip / "camera.json")]
    words += ["--background", str(clip / "background.png"), "--keypoints", str(clip / "truth.csv")]
    words += ["--height", f"{stature:.3f}", "--json", "--quiet"]
    with tempfile.TemporaryDirectory() as tmp:
        words += ["-o", str(Path(tmp) / "track.csv")]
        frames, tracking = _run(words)
        _, both = _run([*words, "--overlay", str(Path(tmp) / "overlay.mp4")])
    return [
        clip.name,
        frames,
        1000 * tracking / frames,
        1000 * (both - tracking) / frames,
        both / tracking - 1,
    ]


def _run(words: list[str]) -> tuple[int, float]:
    """Frames that a command tracked, and its processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return int(found["frames"]), seconds


if __name__ == "__main__":
    sys.exit(main())
