#!/usr/bin/env python3
"""Tracks with several weights of the keypoint term, on rendered and on real films, with detected joints.

    keypoints_weight.py [--only NAME...] [--record]

The detector runs on each film once, as in `gait track`; the film is then tracked from the automatic start
with each weight.  The development clips are judged by the true joints, with models that leave out the
person's subject; films of real people by heel strikes counted in the pictures, and by joints that a person
checked.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

import eval_clips
import numpy as np
import table
from real_clip import Clip, errors_in_space, from_truth, read_clips, score

from gait.bindings.config import TrackerConfig
from gait.io.track_file import read_estimates
from gait.progress import progress
from gait.track.clip import ClipOptions, track_scene
from gait.track.first_state import first_state
from gait.track.read_scene import read_scene

ROOT = Path(__file__).resolve().parents[2]
WEIGHTS = (0.0, 2.0, 8.0, 32.0)
_READING = """\
`gait track` with all defaults except the weight; 0: images only, except for the start. Keypoints are those of
the detector (full), with the errors of its profile. Rendered clips: root-aligned and absolute error of 15
joints, median over the frames, mm. All films: good frames, and wrong ones with status `tracking`, as in
`make eval-real`, compared with true joints or, for real films, with joints that a person checked, which come
from such a detector as well; heel strikes: median distance from the true ones or from those counted in the
pictures. Default: {default:g}."""


def main() -> int:
    """Track and print; publish if asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="names of clips (all)")
    parser.add_argument("--record", action="store_true")
    args = parser.parse_args()
    if eval_clips.absent():
        return 0
    wanted = [(clip, "real") for clip in read_clips(ROOT.parent / "shared/data/real", args.only)]
    folders = sorted((eval_clips.DATA / "eval" / "dev").iterdir())
    rendered = [folder.name for folder in folders if not args.only or folder.name in args.only]
    models: dict[str, str] = {}
    if rendered:
        clips, paths = eval_clips.people(rendered)
        models = {one.name: str(paths[one.subject]) for one in clips if one.subject}
        wanted = [(from_truth(one.folder), "rendered") for one in clips] + wanted
    rows: list[list[object]] = []
    with progress("keypoints-weight", len(wanted)) as update:
        for done, (clip, kind) in enumerate(wanted, 1):
            rows += _rows(clip, kind, models.get(clip.folder.name))
            update(done)
    for kind in dict.fromkeys(kind for _, kind in wanted):
        for weight in WEIGHTS:
            same = [row[3:] for row in rows if row[1:3] == [kind, weight]]
            rows.append(["mean", kind, weight, *np.mean(np.array(same, float), axis=0).tolist()])
    head = ["clip", "film", "weight", "root mm", "abs mm", "good %", "wrong", "strikes: frames off",
            "stride rate %"]  # fmt: skip
    default = TrackerConfig.default().keypoints_weight
    note = _READING.format(default=default)
    table.publish("keypoints_weight", "Weight of the keypoint term", head, rows, note, record=args.record)
    return 0


def _rows(clip: Clip, kind: str, model: str | None) -> list[list[object]]:
    """Row of each weight."""
    plain, rows = TrackerConfig.default, []
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "track.csv")
        options = ClipOptions(str(clip.video), str(clip.folder / "camera.json"), out, model, quiet=True)
        scene = read_scene(options)
        start = first_state(options, scene)
        for weight in WEIGHTS:

            def weighted(*words: object, weight: float = weight, **more: object) -> TrackerConfig:
                return plain(*words, **more).replace(keypoints_weight=weight)  # type: ignore[arg-type]

            with patch.object(TrackerConfig, "default", weighted):
                track_scene(options, scene, start)
            track = read_estimates(out)
            cameras = dict.fromkeys(track.frame.tolist(), scene.camera)
            found = score(clip, track, cameras)
            known = np.isin(track.frame, list(clip.reference))
            errors = errors_in_space(clip, track, known) if kind == "rendered" else [np.nan] * 2
            rows.append([clip.folder.name, kind, weight, *errors, 100 * found.share["good"], found.wrong,
                         found.strike_error, 100 * found.stride_error])  # fmt: skip
    return rows


if __name__ == "__main__":
    sys.exit(main())
