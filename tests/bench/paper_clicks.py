"""Write the joints marked by hand in the outdoor clip as corrections for `gait paper`, about one per frame.

    paper_clicks.py reference2d.json corrections.json

The joints that are clear in the picture take turns from one marked frame to the next.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from gait.body.skeleton import JOINTS

CLEAR = 2
SD = 3.0  # pixels; sd of marking by hand


def clicks(marked: dict[str, Any]) -> list[dict[str, Any]]:
    """Return corrections: as many in a marked frame as there are frames until the next one."""
    numbers, names = list(marked["frame_numbers"]), list(marked["joints"])
    found, turn = list[dict[str, Any]](), 0
    for k, frame in enumerate(numbers):
        clear = [j for j, name in enumerate(names) if name in JOINTS and marked["vis"][k][j] == CLEAR]
        step = (numbers[k + 1] if k + 1 < len(numbers) else frame + 1) - frame
        for j in sorted({clear[(turn + i) % len(clear)] for i in range(step)}):
            found.append({"frame": frame, "joint": names[j], "uv": marked["uv"][k][j], "sd_px": SD})
        turn += step
    return found


def main() -> None:
    source, target = map(Path, sys.argv[1:])
    target.parent.mkdir(parents=True, exist_ok=True)
    listed = clicks(json.loads(source.read_text(encoding="utf-8")))
    target.write_text(json.dumps({"corrections": listed}), encoding="utf-8")


if __name__ == "__main__":
    main()
