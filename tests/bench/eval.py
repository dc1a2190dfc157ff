"""Errors of the tracker on the development clips and the outdoor video, by the public commands alone.

    make eval ARGS='--seeds 3 --modes default paper'

Each clip's subject is left out of learning.  Every run starts from the truth plus noise drawn from the
start's own deviations by the seed.  Writes build/eval/results.json and results.csv and prints one table;
lost runs are in it.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
OUT = ROOT / "build" / "eval"
GAIT = [sys.executable, "-m", "gait"]
SPREAD = {"pelvis": 0.03, "heading_rad": 0.05, "phase": 0.03, "stride_hz": 0.03, "stature_m": 0.01}
NEAR = ("l_hip", "l_knee", "l_ankle")  # the near side of the outdoor clip


@dataclass(frozen=True)
class Run:
    """One clip, seed and mode."""

    clip: str
    seed: int
    mode: str

    @property
    def name(self) -> str:
        """Stem of the run's files."""
        return f"{self.clip}.{self.mode}.{self.seed}"


def call(*words: object) -> dict[str, Any]:
    """Run a gait command that prints JSON; the first line of its error ends the evaluation."""
    command = [*GAIT, *map(str, words), "--json", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        raise SystemExit(f"eval: gait {words[0]}: {done.stderr.strip()}")
    return dict(json.loads(done.stdout))


def model_without(subject: str) -> Path:
    """Walking model learned without one subject, made once."""
    path = OUT / f"without_{subject}.gait"
    newest = max(p.stat().st_mtime for p in (ROOT / "python/gait").rglob("*.py") if "learn" in p.parts)
    if not path.exists() or path.stat().st_mtime < newest:
        call("learn", DATA / "mocap/cmu_walk", "-o", path, "--exclude", f"cmu_walk/{subject}/*")
    return path


def noisy_start(folder: Path, seed: int) -> dict[str, Any]:
    """The truth at frame 0 plus noise, in the form of an --init file."""
    meta = json.loads((folder / "meta.json").read_text())
    with open(folder / "truth.csv", newline="") as file:
        first = next(csv.DictReader(file))
    strikes = np.array(meta["events_video_frames"]["r_heel_strike"])
    stride = float(np.median(np.diff(strikes)))
    noise = np.random.default_rng(seed).standard_normal(7)
    true = {
        "phase": -strikes[0] / stride,
        "stride_hz": meta["fps"] / stride,
        "stature_m": meta["stature_m"],
        "heading_rad": float(first["heading_rad"]),
    }
    start: dict[str, Any] = {
        key: value + SPREAD[key] * n for (key, value), n in zip(true.items(), noise, strict=False)
    }
    start["phase"] %= 1.0
    start["pelvis"] = [
        float(first[f"pelvis_{a}"]) + SPREAD["pelvis"] * n for a, n in zip("xyz", noise[4:], strict=True)
    ]
    return {"frame": 0, **start, "sd": SPREAD}


def dev_run(run: Run) -> dict[str, Any]:
    """Track and judge one development clip."""
    folder, track = DATA / "eval/dev" / run.clip, OUT / f"{run.name}.csv"
    init = OUT / f"{run.name}.init.json"
    init.write_text(json.dumps(noisy_start(folder, run.seed)))
    model = OUT / f"without_{run.clip[-2:]}.gait"
    common = ["--camera", folder / "camera.json", "-m", model]
    figures = call(
        *("track", folder / "video.mp4", *common, "--init", init, "--background", folder / "background.png"),
        *("-o", track, "--seed", run.seed, "--mode", run.mode),
    )
    return figures | call("eval", track, "--truth", folder / "truth.csv", *common)


def outdoor_run(run: Run) -> dict[str, Any]:
    """Track the outdoor clip and measure the distance to the near leg's joints marked by hand."""
    folder, track = DATA / "video/outdoor", OUT / f"{run.name}.csv"
    figures = call(
        *(
            "track",
            folder / "demo.mp4",
            "--camera",
            folder / "Calib_demo.toml",
            "--height",
            1.65,
            "-o",
            track,
        ),
        *("--init", folder / "init.json", "--background", folder / "background_median.png"),
        *("--start", 64, "--stop", 186, "--seed", run.seed, "--mode", run.mode),
    )
    return figures | {"px": {"median": float(np.median(marked_distances(folder, track)))}}


def marked_distances(folder: Path, track: Path) -> list[float]:
    """Pixels between estimated and marked joints of the near leg."""
    from gait.camera import Camera

    camera = Camera.read(str(folder / "Calib_demo.toml"))
    reference = json.loads((folder / "reference2d.json").read_text())
    with open(track, newline="") as file:
        rows = {int(row["frame"]): row for row in csv.DictReader(file)}
    distances = []
    for number, marks, clear in zip(
        reference["frame_numbers"], reference["uv"], reference["vis"], strict=True
    ):
        for joint in NEAR:
            k = reference["joints"].index(joint)
            if number in rows and clear[k]:
                place = [float(rows[number][f"{joint}_{axis}"]) for axis in "xyz"]
                distances.append(float(np.linalg.norm(camera.project(place) - marks[k])))
    return distances


def row_of(run: Run, r: dict[str, Any]) -> dict[str, Any]:
    """One line of the table; blanks where the outdoor clip has no 3-D truth."""
    phase = r.get("phase") or {}
    return {
        "clip": run.clip,
        "mode": run.mode,
        "seed": run.seed,
        "root_mm": r["root"]["median"] if "root" in r else None,
        "root_p90": r["root"]["p90"] if "root" in r else None,
        "abs_mm": r["abs"]["median"] if "abs" in r else None,
        "px": r["px"]["median"] if r.get("px") else None,
        "phase_pct": 100 * phase["median"] if phase else None,
        "flips_pct": 100 * phase["flips"] if phase else None,
        "cover90": r["coverage"]["90"] if r.get("coverage") else None,
        "lost_pct": 100 * (r["lost"] if "root" in r else r["lost"] / r["frames"]),
        "static_mm": r["static"]["root"]["median"] if "static" in r else None,
        "free_mm": r["free"]["root"]["median"] if r.get("free") else None,
        "step_ms": r["step_ms"]["median"],
    }


def show(rows: list[dict[str, Any]]) -> None:
    """Print the table, a run a line, then medians over all runs with truth."""
    keys = list(rows[0])
    print(" ".join(f"{k:>10}" for k in keys).replace("      clip", f"{'clip':18}", 1))
    for row in rows:
        cells = [
            "" if row[k] is None else f"{row[k]:.2f}" if isinstance(row[k], float) else str(row[k])
            for k in keys[1:]
        ]
        print(f"{row['clip']:18} " + " ".join(f"{c:>10}" for c in cells))
    for mode in dict.fromkeys(row["mode"] for row in rows):
        known = [row for row in rows if row["mode"] == mode and row["root_mm"] is not None]
        if known:
            lost = sum(row["lost_pct"] > 50 for row in known)
            root, place = (np.median([row[k] for row in known]) for k in ("root_mm", "abs_mm"))
            print(f"{mode}: median root {root:.1f} mm, abs {place:.1f} mm; {lost} of {len(known)} runs lost")


def main() -> int:
    """Evaluate and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1, help="runs per clip (1)")
    parser.add_argument("--modes", nargs="+", choices=("default", "paper"), default=["default"])
    parser.add_argument("--clips", nargs="+", help="names of clips (all, and outdoor)")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time (2)")
    args = parser.parse_args()
    if not DATA.is_dir():
        print("eval: ../shared/data is absent: nothing to evaluate on", file=sys.stderr)
        return 0
    OUT.mkdir(parents=True, exist_ok=True)
    clips = args.clips or [*sorted(p.name for p in (DATA / "eval/dev").iterdir()), "outdoor"]
    for subject in sorted({clip[-2:] for clip in clips if clip != "outdoor"}):
        model_without(subject)
    runs = [Run(c, s, m) for m in args.modes for c in clips for s in range(1, args.seeds + 1)]
    with ThreadPoolExecutor(args.jobs) as pool:
        results = list(pool.map(lambda run: (outdoor_run if run.clip == "outdoor" else dev_run)(run), runs))
    rows = [row_of(run, result) for run, result in zip(runs, results, strict=True)]
    (OUT / "results.json").write_text(
        json.dumps([vars(r) | {"figures": f} for r, f in zip(runs, results, strict=True)])
    )
    with open(OUT / "results.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    show(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
