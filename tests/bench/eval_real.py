#!/usr/bin/env python3
"""Score `gait track` on films of real people against 2-D reference joints, and fail if a bound is missed.

    make eval-real
    make eval-real ARGS='--arms auto known --only cane'
    make eval-real ARGS='--clips DIR --extra="--detector lite"'

DIR has a folder for each clip: video.* (the film), camera.json, meta.json (window, fps, stature_m,
stride_hz), reference2d.csv (frame, <joint>_u, <joint>_v, pixels) and, for the arm `known`, init.json.
Arms: auto: film and camera alone; nobg: without a background; known: from init.json; nocam: the stature
instead of a camera.  auto-none, nobg-none and known-none: the same with --detector none; auto-classes and
known-classes: the same with -m classes; both in tables of their own.
Contact sheets are written into build/eval-real; no picture of these people may enter the repository.
"""

from __future__ import annotations

import argparse
import resource
import shlex
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import table
from facts import facts
from real_clip import KINDS, Clip, Score, contact_sheet, read_cameras, read_clips, score

from gait import Camera, Video
from gait.io.track_file import read_estimates
from gait.progress import progress

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "build" / "eval-real"
#: Ends of the names of arms: without the detector, and with the model of classes.
WITHOUT, CLASSES = "-none", "-classes"
#: Page and title of the arms with each end.
PAGES = {
    "": ("eval_real", "Films of real people"),
    WITHOUT: ("eval_real_none", "Films of real people, without a detector"),
    CLASSES: ("eval_real_classes", "Films of real people, tracked with -m classes"),
}
ARMS = (
    *("auto", "nobg", "known", "nocam"),
    *(f"{arm}{WITHOUT}" for arm in ("auto", "nobg", "known")),
    *(f"{arm}{CLASSES}" for arm in ("auto", "known")),
)
MEAN = {"auto": 0.85, "nocam": 0.75, "known": 0.90}  # least mean share of good frames
LEAST = {"auto": 0.65}  # and the least of each clip
NEAR = {"nobg": ("auto", 0.05)}  # the mean may be this much lower than that of another arm
WRONG = 0.02  # most of the frames with status `tracking`
STRIDE = 0.03  # error of the stride rate, as a share, at most


_READING = """\
Films of real people, compared with joints of BlazePose (full) that a person checked; most cameras are
guessed. libgait's detector uses the same network: errors that both share do not show, so scores with the
detector are too good; those without it (eval_real_none) are not affected. good: knees and ankles within 9
% of the person's height on average, hips in place; swap: left and right swapped; legs: hips in place, legs
not; off: hips or legs elsewhere; none: frames not in the track.  wrong: frames with status
`tracking` that are not good.  Heel strikes: median distance of the track's heel strikes, from its phase,
from those counted in the pictures (tests/bench/real_strikes.json).  Stride rate: over the frames that have
a phase.  CPU s and frames/s are those of the whole command including the detector, in some rows with other
programs running."""


@dataclass(frozen=True)
class Result:
    """A clip in an arm: the score, CPU seconds, frames per second, and what was printed if it failed."""

    clip: str
    arm: str
    score: Score
    cpu: float
    fps: float
    failed: str = ""


def main() -> int:
    """Run the arms and print the table; 1 if a bound is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--clips", type=Path, default=ROOT.parent / "shared/data/real", metavar="DIR", help="folder of clips")
    add("--arms", nargs="+", choices=ARMS, default=list(ARMS), help="(all)")
    add("--only", nargs="+", metavar="NAME", help="names of clips (all)")
    add("--extra", default="", metavar="OPTIONS", help="further options of gait track")
    add("--record", action="store_true", help="also write the pages, eval_real*.md and .csv")
    args = parser.parse_args()
    clips = read_clips(args.clips, args.only)
    if not clips:
        print(f"eval-real: skipped: {args.clips} has no clip (a folder with meta.json each)")
        return 0
    jobs = [(clip, arm) for arm in args.arms for clip in clips if _has(clip, arm)]
    results = []
    with progress("eval-real", len(jobs)) as update:
        for done, (clip, arm) in enumerate(jobs, 1):
            results.append(run(clip, arm, shlex.split(args.extra)))
            update(done)
    missed = {arm: _missed([r for r in results if r.arm == arm], results) for arm in args.arms}
    for end in PAGES:
        shown = [r for r in results if _end(r.arm) == end]
        if shown:
            words = sum((missed[arm] for arm in dict.fromkeys(r.arm for r in shown)), [])
            _publish(end, shown, words, args.record)
    print(f"contact sheets: {OUT.relative_to(ROOT)}")
    return any(missed.values())


def _end(arm: str) -> str:
    """End of an arm's name, a key of `PAGES`."""
    return next((end for end in PAGES if end and arm.endswith(end)), "")


def _has(clip: Clip, arm: str) -> bool:
    """Whether a clip has the files of an arm."""
    return not arm.startswith("known") or (clip.folder / "init.json").exists()


def run(
    clip: Clip,
    arm: str,
    extra: list[str],
    program: tuple[str, str] = ("-m", "gait"),
) -> Result:
    """Track a clip with `gait track` and score it; `program` is Python's option that runs `gait`."""
    name = clip.folder.name
    OUT.mkdir(parents=True, exist_ok=True)
    out, found, turned = (OUT / f"{name}_{arm}{end}" for end in (".csv", "_camera.json", "_cameras.csv"))
    given = clip.folder / "camera.json"
    options = {
        "auto": ["--camera", given],
        "nobg": ["--camera", given, "--background", "none"],
        "known": ["--camera", given, "--init", clip.folder / "init.json"],
        "nocam": ["--height", clip.stature, "--camera-out", found],
    }[arm.removesuffix(_end(arm))]
    options += {WITHOUT: ["--detector", "none"], CLASSES: ["--model", "classes"]}.get(_end(arm), [])
    command = [sys.executable, *program, "track", clip.video, "-o", out]
    command += ["--quiet", *options, *extra]
    if "off" not in extra:  # of --stabilize: then there is one camera
        command += ["--cameras-out", turned]
    for path in (out, found, turned):
        path.unlink(missing_ok=True)
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    wall, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    video = Video(clip.video)
    if done.returncode or not out.exists():
        why = (done.stderr.strip().splitlines() or ["no message"])[-1]
        why = why.replace(f"{clip.folder}/", "")  # the page shows no paths of this machine
        return Result(name, arm, Score({kind: float(kind == "none") for kind in KINDS}), cpu, np.nan, why)
    camera, track = Camera.read(str(found if arm == "nocam" else given), video.size), read_estimates(out)
    still = dict.fromkeys(range(video.count), camera)
    cameras = read_cameras(turned, camera) if turned.exists() else still
    contact_sheet(clip, track, cameras, OUT / f"{name}_{arm}.png")
    return Result(name, arm, score(clip, track, cameras), cpu, video.count / wall)


def _missed(results: list[Result], everything: list[Result]) -> list[str]:
    """Bounds that an arm misses, in words."""
    if not results:
        return []
    arm = results[0].arm
    bounds = arm.removesuffix(CLASSES)
    without = _end(arm) == WITHOUT  # an error is acceptable if images do not suffice, a wrong track is not
    missed = [f"{r.clip} {r.arm}: {r.failed}" for r in results if r.failed and not without]
    mean = _mean(results)
    if mean < MEAN.get(bounds, 0):
        missed.append(f"{arm}: good {mean:.0%} on average, {MEAN[bounds]:.0%} wanted")
    missed += [
        f"{r.clip} {arm}: good {r.score.share['good']:.0%}, {LEAST[bounds]:.0%} wanted"
        for r in results
        if r.score.share["good"] < LEAST.get(bounds, 0)
    ]
    other, near = NEAR.get(arm, ("", 0.0))
    beside = [r for r in everything if r.arm == other]
    if beside and mean < _mean(beside) - near:
        missed.append(f"{arm}: good {mean:.0%} on average, {other} {_mean(beside):.0%}")
    tracking, wrong = (sum(getattr(r.score, key) for r in results) for key in ("tracking", "wrong"))
    if wrong > WRONG * tracking:
        missed.append(f"{arm}: {wrong} of {tracking} frames under tracking are wrong, {WRONG:.0%} allowed")
    return missed + [
        f"{r.clip} {arm}: stride rate {r.score.stride_error:+.1%}, {STRIDE:.0%} allowed"
        for r in results
        if not abs(r.score.stride_error) <= STRIDE and not (r.failed or without)  # also if it is not known
    ]


def _mean(results: list[Result]) -> float:
    """Mean share of good frames."""
    return float(np.mean([r.score.share["good"] for r in results]))


def _publish(end: str, results: list[Result], missed: list[str], record: bool) -> None:
    """Print the table of the arms with this end, and write it if asked to."""
    columns = ["arm", "clip", *(f"{kind} %" for kind in KINDS), "error % of height", "tracking", "wrong"]
    columns += ["stride rate %", "strikes: frames off", "CPU s", "frames/s", "failed"]
    rows = [
        [
            *(r.arm, r.clip, *(round(100 * r.score.share[kind]) for kind in KINDS), 100 * r.score.error),
            *(r.score.tracking, r.score.wrong, 100 * r.score.stride_error, r.score.strike_error),
            *(round(r.cpu, 1), round(r.fps, 1), r.failed),
        ]
        for r in results
    ]
    arms = dict.fromkeys(r.arm for r in results)
    means = [f"{arm} {_mean([r for r in results if r.arm == arm]):.0%}" for arm in arms]
    met = "The bound on wrong frames, the only one, is met." if end == WITHOUT else "All bounds are met."
    notes = [
        facts(),
        f"Good frames on average: {', '.join(means)}.  {_READING}",
        f"**Bounds missed:** {'; '.join(missed)}." if missed else met,
    ]
    name, title = PAGES[end]
    if record:
        table.publish(name, title, columns, rows, "\n\n".join(notes))
    else:
        table.show(title, columns, rows)
    print("\n".join([f"MISSED: {words}" for words in missed] or notes[2:]))


if __name__ == "__main__":
    sys.exit(main())
