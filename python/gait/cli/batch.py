"""Track or lift the clips of a project file, several at a time, and summarise them.

PROJECT.toml lists the clips and the outputs of each; paths are relative to it:

  [defaults]                    # for all clips; each may have its own
  height = 1.75                 # metres; or camera = "camera.json"
  make = ["track", "report", "c3d"]

  [[clip]]
  video = "anna.mp4"            # name = "anna" (default: the file's), subject, keypoints, person, start, stop
  [[clip]]
  video = "group.mp4"
  people = "all"                # or how many: tracks several, each with files and a row of their own
  [[clip]]
  videos = ["left.mp4", "right.mp4"]  # films of one walk
  camera = "calibration.toml"         # of all of them; or cameras = ["left.json", "right.json"]
  [[clip]]
  keypoints = "ben.json"        # or ["left.csv", "right.csv"], of one walk, with cameras, to lift together
  make = ["lift", "mot"]
  options = ["--fps", "30"]     # further options of gait track or gait lift

make: track or lift; overlay and report of a track; trc c3d bvh mot parquet rrd mcap.

Every clip has its own folder in DIR and its own processes: one that is damaged or crashes becomes a failed
row of the summary, and the others continue.  Run the same command again to resume: it skips clips that are
done with the same settings, files (also those that options name) and version, and retries failed ones.
DIR/summary.csv (and .parquet, with PyArrow) has one row per clip and person, with verdict and warnings;
DIR/index.html shows them and links to all files.  The exit code is 1 if a clip failed.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait.cli import values
from gait.errors import UsageError
from gait.io.files import require_folder
from gait.progress import note, warning

if TYPE_CHECKING:
    from gait.batch.project import Clip
    from gait.batch.run import Runner

EXAMPLES = """\
examples:
  gait batch project.toml -o results
  gait batch project.toml -o results --jobs 8
  gait batch project.toml -o results --dask tcp://192.168.0.7:8786
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("project", metavar="PROJECT.toml", help="the clips")
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for all results")
    parser.add_argument(
        "--jobs", type=values.whole(1, 256), metavar="N", help=f"clips at a time (default: {_usual_jobs()})"
    )
    parser.add_argument(
        "--dask",
        metavar="SCHEDULER",
        help="run the clips on a Dask cluster, such as tcp://host:8786; its workers need all files, and DIR, "
        "under the same paths",
    )


def run(args: argparse.Namespace) -> int:
    """Run all clips and summarise."""
    from gait.batch import project

    # reports missing extras before any clip is run
    from gait.batch.run import FAILED, SEPARATOR, Runner, write_summary

    if args.dask and args.jobs:
        raise UsageError("--jobs is for this machine and --dask for a cluster; give one of them")
    clips = project.read(args.project)
    require_folder(args.output)
    output = Path(args.output)
    output.mkdir(parents=True, exist_ok=True)

    runner = Runner(output)
    before = {clip.name for clip in clips if _done(runner, clip)}

    def report(row: dict[str, Any]) -> None:
        name = f"{row['name']}, person {row['person']}" if row.get("person") else row["name"]
        error = f": {row['error']}" if row["error"] else ""
        skipped = ", by an earlier run; skipped" if row["name"] in before else ""
        verdict = f"; {row['verdict']}" if row.get("verdict") else ""
        note(f"{name}: {row['state']}{error}{skipped}{verdict}", args.quiet)
        for words in row.get("warnings", "").split(SEPARATOR):
            warning(f"{name}: {words}", args.quiet or not words)

    if args.dask:
        from gait.batch import cluster  # needs extra dask

        rows = cluster.run(output, clips, args.dask, report)
    else:
        rows = runner.run(clips, args.jobs or _usual_jobs(), report)
    names = write_summary(output, rows)
    failed = sum(row["state"] == FAILED for row in rows)  # with one row each
    if args.json:
        print(json.dumps({"clips": len(clips), "failed": failed, "rows": rows}))
    else:
        files = ", ".join(str(output / name) for name in names)
        skipped = f", {len(before)} skipped" if before else ""
        print(f"{len(clips)} clip{'s' * (len(clips) > 1)}, {failed} failed{skipped}; {files}")
    return int(failed > 0)


def _done(runner: Runner, clip: Clip) -> bool:
    """Whether an earlier run has done a clip."""
    try:
        return bool(runner.before(clip))
    except OSError:
        return False


def _usual_jobs() -> int:
    return max(1, (os.cpu_count() or 1) // 2)
