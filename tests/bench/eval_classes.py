"""Classes of motion: people who stop, stand, turn, walk backwards or run, tracked with and without classes.

    make eval-classes, or eval_classes.py [--seeds 3] [--only stopping backwards] [--record]

The clips are presets of `gait simulate`, with further seeds of the person; the slow walks and runs of
`eval_simulated`; and the development clips.  The models are those of the package: walk; classes, which walks,
stands, walks backwards and runs; and, where people only walk, the walk of classes alone, which is learnt from
people of seven sources instead of CMU's.  A start is the truth with the noise of `eval_clips`; it does not
state the class.  Clips of `gait simulate` are also tracked as users do it, by `gait track` with the detector
and an automatic start, without -m, with `-m classes`, and with --smooth.  The outdoor film is judged by
joints marked in the picture.  The time of a step is compared between the package's walk, the same walk with
standing and walking backwards added, and classes.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from importlib import resources
from multiprocessing import get_context
from pathlib import Path

import eval_clips
import eval_run
import eval_simulated
import gait_cases
import numpy as np
import table
from eval_plan import Arm, Clip, Job
from numpy.typing import NDArray

from gait import Camera, Model, Start, Tracker, TrackerConfig, Video
from gait.bindings.abi import TrackStatus
from gait.bindings.model import read_cyclic
from gait.body.motion_classes import STANDING, WALKING, of_class
from gait.body.skeleton import EVAL15, SIDES
from gait.io import blob
from gait.io.track_file import Joints, read_estimates, read_true_phase, read_truth
from gait.io.video import read_plate
from gait.motion.evaluate import coverage, phase_errors
from gait.motion.footfalls import strikes_of
from gait.progress import progress
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS, Scenario

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "build" / "eval-classes"
MODELS = "walk", "classes"  # of the package
ALONE = "walk of classes"
USERS: dict[str, tuple[str, ...]] = {
    "default, users": (),
    "classes, users": ("-m", "classes"),
    "classes, --smooth": ("-m", "classes", "--smooth"),
}  # further options of `gait track`
RUNNING = "running"  # clip of eval_simulated
TIMED = "walk"  # a clip that all models follow: a tracker that searches for a person has twice the particles
HIPS = [EVAL15.index("l_hip"), EVAL15.index("r_hip")]
ANKLES = [EVAL15.index("l_ankle"), EVAL15.index("r_ankle")]
STANCE = 0.2  # m/s: the ankle of a foot that stands is slower
FAR = 0.15  # metres, root-aligned: a wrong frame
DELAY = 0.5  # seconds for which the class before a change may be reported
WANTED = {
    "stopping": 50,
    "standing": 60,
    "backwards": 70,
    "turning": 55,
    "slow": 45,
    "running": 60,
    "limping": 60,
}  # mm, root-aligned, of clips whose names begin so
WANTED_PLACE = {"turning": 150}  # mm, without alignment
COVERED = 0.80, 0.97  # of the coordinates of joints, in 90 % intervals
DEARER = 1.35  # a step with three classes, as a multiple of one with one
WRONG = 0.03  # of the frames with status `tracking`: in another class, longer than DELAY after a change

TITLE = "Classes of motion"
COLUMNS = (
    "clip",
    "model",
    "root mm",
    "least-most",
    "wanted",
    "verdict",
    "abs mm",
    "in 90 %",
    "tracking %",
    "far %",
    "wrong class %",
    "a foot lifted %",
    "half a cycle off %",
    "foot m/s",
)
_READING = f"""\
Clips of `gait simulate`, and the development clips (names with a number), whose people are among those that
all models were learnt from.  The start is the truth with noise and does not state the class, so people who
stand or walk backwards are tracked as walking for the first frames.  {ALONE}: the same model without its
other classes.  {", ".join(USERS)}: as users track, with `gait track`, the camera, the
detector and an automatic start, one seed: without -m, which tracks with walk and, if that does not follow
the person, again with classes, as the row names; with `-m classes`; and with --smooth too.  Errors are those
of frames in the track.

- root: error with the hips aligned, median over frames, then over seeds; abs: error without alignment
- verdict, of the clips of `gait simulate`: reached, or what misses its target
- in 90 %: share of the joints' coordinates in their 90 % intervals, target {COVERED[0]} to {COVERED[1]}
- far: share of the frames with status `tracking` that are more than {1000 * FAR:.0f} mm off (root)
- wrong class: share of the same frames with another class, later than {DELAY} s after a change, target below
  {100 * WRONG:.0f} %; - : the model has one class
- a foot lifted: those of them in which a foot is truly off the floor (neither its heel nor its ball is slower
  than {STANCE} m/s).  In the others a person who stops or starts is on both feet; the clips call this walking
  as long as the stride rate is above a quarter of the usual one
- half a cycle off: share of the same frames whose phase is nearer to half a cycle from the truth than to the
  truth, so that left and right are swapped; of those in which neither the person nor the estimate stands
- foot: speed over the ground of the ankle of a foot that truly stands (slower than {STANCE} m/s), from frame
  to frame, median over the frames in which the person moves"""

CLIPS: dict[str, Scenario] = {
    **{name: PRESETS[name] for name in ("stopping", "standing", "backwards", "turning")},
    "stopping_side": Scenario(motion="stop", frames=150, seed=71),
    "stopping_toward": Scenario(motion="stop", view="toward", frames=150, seed=72),
    "standing_side": Scenario(motion="stand", frames=100, seed=73),
    "backwards_side": Scenario(motion="backwards", direction="rl", frames=120, seed=74),
    "backwards_away": Scenario(motion="backwards", view="away", frames=120, seed=75),
    "accelerating": PRESETS["accelerating"],
    "slow": eval_simulated.CASES["slow"],
    "slow_04": Scenario(speed=0.4, frames=180, seed=76),
    "circle": eval_simulated.CASES["turning"],
    "walk": eval_simulated.CASES["walk"],
    "fast": PRESETS["fast"],
    "limping": PRESETS["limping"],
    "limping_side": gait_cases.CASES["limping_side"],
}


@dataclass(frozen=True)
class Run:
    """Errors of one clip with one model and seed."""

    clip: str
    model: str
    seed: int
    root: float  #: mm, median over frames, hips aligned
    absolute: float  #: mm
    covered: float  #: share of the coordinates in their 90 % intervals
    tracking: float  #: share of the frames
    far: float  #: share of the frames with status `tracking` whose error exceeds FAR
    wrong: float | None  #: share of the frames with status `tracking` in a wrong class; None: one class
    lifted: float | None  #: share of the same frames in a wrong class while a foot is off the floor
    swapped: float | None  #: share of those, if both move, that are half a cycle off; None: there are none
    foot: float | None  #: m/s, median, of the ankle of a foot that stands; None: the person does not move


def main() -> int:
    """Make the clips that are missing, track and print; exit code 1 if a clip misses a target."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3, help="runs of a clip from the truth (3)")
    parser.add_argument(
        "--jobs", type=int, default=2, help="runs side by side; results do not depend on it (2)"
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", help="names of clips")
    parser.add_argument("--record", action="store_true", help="write results/eval_classes.md and .csv")
    args = parser.parse_args()
    clips = _clips(args.only)
    runs: list[Run] = []
    with progress("tracking", len(_each(clips, args.seeds))) as update:
        for run in _runs(clips, args.seeds, args.jobs):
            runs.append(run)
            update(len(runs))
    rows, notes = list(_rows(runs)), [_time_of_classes(clip) for clip in clips if clip.name == TIMED]
    if not args.only and not eval_clips.absent():
        notes.append(_outdoor(args.seeds))
    note = "\n\n".join([_READING, *notes])
    table.publish("eval_classes", TITLE, COLUMNS, rows, note, record=args.record)
    return int(any(str(row[COLUMNS.index("verdict")]).startswith("missed") for row in rows))


def _clips(only: list[str] | None) -> list[Clip]:
    """Clips of the scenarios, made if they are missing, and the runner."""
    wanted = {name: case for name, case in CLIPS.items() if not only or name in only}
    if not only or RUNNING in only:
        OUT.mkdir(parents=True, exist_ok=True)
        wanted |= {name: replace(case, motion="run") for name, case in eval_simulated.running(OUT).items()}
    for name, scenario in wanted.items():
        if not (OUT / name / "meta.json").is_file():
            with progress(f"making {name}", scenario.frames) as update:
                simulate(scenario, OUT / name, update)
    clips = [clip for clip in eval_clips.folder_clips(OUT) if clip.name in wanted]
    if not eval_clips.absent():
        clips += [
            clip for clip in eval_clips.shared_clips(None) if clip.truth and (not only or clip.name in only)
        ]
    return [replace(clip, steady=False) for clip in clips]


def _runs(clips: list[Clip], seeds: int, jobs: int) -> Iterator[Run]:
    """Track every clip with every model, side by side."""
    alone = OUT / f"{ALONE}.gait"
    blob.write(alone, {tag: of for tag, of in read_cyclic("classes").items() if not of_class(tag)})
    each = _each(clips, seeds)
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(_run, *zip(*each, strict=True))


def _each(clips: list[Clip], seeds: int) -> list[tuple[Clip, str, int]]:
    """Clip, source and seed of every run; as users with one seed, since a detector's start has none."""
    return [
        (clip, source, seed)
        for clip in clips
        for source in _sources(clip)
        for seed in range(1, 2 if source in USERS else seeds + 1)
    ]


def _sources(clip: Clip) -> list[str]:
    """What a clip is tracked with: names or paths of models, and keys of `USERS`."""
    walks = clip.name != RUNNING and (clip.name not in CLIPS or CLIPS[clip.name].motion in ("walk", "turn"))
    alone = [str(OUT / f"{ALONE}.gait")] if walks else []
    return [*MODELS, *alone, *(USERS if _simulated(clip.name) else ())]


def _simulated(clip: str) -> bool:
    """Whether `gait simulate` made the clip of a name."""
    return clip == RUNNING or clip in CLIPS


@dataclass(frozen=True)
class Followed:
    """What a tracker reported, for n frames of a clip."""

    frame: NDArray[np.int64]  #: (n,)
    places: NDArray[np.float64]  #: (n, 15, 3) EVAL15, metres
    sd: NDArray[np.float64]  #: (n, 15, 3)
    tracking: NDArray[np.bool_]  #: (n,) status
    motion_class: list[str]
    phase: NDArray[np.float64]  #: (n,) NaN where a track file has none
    model: str = ""  #: that tracked, if none was given


def _run(clip: Clip, source: str, seed: int) -> Run:
    """Track a clip and measure the errors."""
    followed = _as_users(clip, source, seed) if source in USERS else _from_truth(clip, source, seed)
    truth = read_truth(clip.truth)
    count, shown = len(truth.frame), followed.frame
    every = np.array(_classes(clip.truth, count))
    changed = np.maximum.accumulate(np.where(np.append(True, every[1:] != every[:-1]), np.arange(count), 0))
    since, classes = (np.arange(count) - changed)[shown], every[shown]
    late = (changed[shown] > 0) & (since * np.median(np.diff(truth.time)) < DELAY)
    reported = np.array(followed.motion_class)
    wrong = (reported != classes) & ~late
    one_class = Path(source).stem in (MODELS[0], ALONE)
    off = followed.places - truth.eval15()[shown]
    absolute = np.linalg.norm(off, axis=2).mean(axis=1)
    root = np.linalg.norm(off - off[:, HIPS].mean(axis=1, keepdims=True), axis=2).mean(axis=1)
    under = followed.tracking
    frames = max(int(under.sum()), 1)
    judged = under & (classes != STANDING) & (reported != STANDING) & np.isfinite(followed.phase)
    return Run(
        clip.name,
        f"{source}: {followed.model}" if source in USERS and not USERS[source] else Path(source).stem,
        seed,
        1000 * float(np.median(root)),
        1000 * float(np.median(absolute)),
        coverage(followed.places, followed.sd, truth.eval15()[shown])["90"],
        float(under.sum() / count),
        float((root > FAR)[under].sum() / frames),
        None if one_class else float(wrong[under].sum() / frames),
        None if one_class else float((wrong & lifted(truth)[shown])[under].sum() / frames),
        phase_errors(followed.phase[judged], _phases(clip, truth)[shown][judged])["flips"]
        if judged.any()
        else None,
        foot_speed(followed, truth, every != STANDING),
    )


def _from_truth(clip: Clip, source: str, seed: int) -> Followed:
    """Track a clip from the truth with noise."""
    model, name = Model(source), Path(source).stem
    video = Video(clip.video)
    camera = Camera.read(str(clip.camera), video.size)
    plate = read_plate(clip.plate, video.size) if clip.plate else None
    tracker = Tracker(model, camera, TrackerConfig.default(seed=seed), background=plate)
    init = OUT / f"{clip.name}.{name}.{seed}.json"
    init.write_text(json.dumps(eval_clips.noisy_start(clip, seed, 0.0)))
    start = Start.read(init, model)
    at = [model.joint_names.index(joint) for joint in EVAL15]
    rows = []
    for i, frame in enumerate(video.frames()):
        if i == 0:
            tracker.start(start.mean, start.sd, frame.utime)
        estimate = tracker.step(frame.image, frame.utime)
        rows.append(
            (
                [estimate.joint(joint) for joint in EVAL15],
                estimate.joint_sd[at],
                estimate.status == TrackStatus.TRACKING,
                estimate.motion_class,
                estimate.mean.phase,
            )
        )
    places, sd, tracking, classes, phase = zip(*rows, strict=True)
    return Followed(
        np.arange(len(rows)),
        np.array(places),
        np.array(sd),
        np.array(tracking),
        list(classes),
        np.array(phase),
    )


def _as_users(clip: Clip, source: str, seed: int) -> Followed:
    """Track a clip with `gait track`, as in `USERS`."""
    out = OUT / f"{clip.name}.{source.replace(', ', '.')}.{seed}.csv"
    words = ["track", clip.video, "--camera", clip.camera, "--seed", seed, "-o", out]
    subprocess.run(
        [sys.executable, "-m", "gait", *map(str, words), *USERS[source]], check=True, capture_output=True
    )
    track = read_estimates(out)
    under = np.array([status == "tracking" for status in track.status])
    model = MODELS[bool(track.motion_class)]
    classes = list(track.motion_class) or [WALKING] * len(track.frame)
    return Followed(track.frame, track.eval15(), track.eval15_sd(), under, classes, track.phase, model)


def lifted(truth: Joints) -> NDArray[np.bool_]:
    """Whether a foot is off the floor (n,): neither its heel nor its ball is slower than STANCE."""
    slowest = []
    for side in SIDES:
        parts = [truth.places[f"{side}_{part}"] for part in ("heel", "toe")]
        speeds = [np.linalg.norm(np.gradient(part, truth.time, axis=0), axis=1) for part in parts]
        slowest.append(np.minimum(*speeds))
    return np.asarray(np.maximum(*slowest) > STANCE)


def foot_speed(followed: Followed, truth: Joints, moves: NDArray[np.bool_]) -> float | None:
    """Median speed over the ground (m/s) of the ankle of the foot that stands.

    `moves`: frames of the truth (n,) that count.  None: no foot stands in any.
    """
    shown = followed.frame
    seconds = np.diff(truth.time[shown])[:, None]
    tracked, true = (
        np.linalg.norm(np.diff(ankles[:, ANKLES, :2], axis=0), axis=2) / seconds
        for ankles in (followed.places, truth.eval15()[shown])
    )
    stands = (true < STANCE) & moves[shown][1:, None]
    return float(np.median(tracked[stands])) if stands.any() else None


def _phases(clip: Clip, truth: Joints) -> NDArray[np.float64]:
    """True phase of every frame: as simulated, or between the recorded heel strikes."""
    assert clip.truth is not None
    simulated = read_true_phase(clip.truth)
    if simulated is not None:
        return simulated
    between = strikes_of(truth, clip.folder / "meta.json").phase(truth.frame)
    assert between is not None
    return between


def _classes(path: Path | None, count: int) -> list[str]:
    """True class of every frame."""
    assert path is not None
    with path.open(newline="", encoding="utf-8") as file:
        return [row.get("motion_class", "walk") for row in csv.DictReader(file)][:count]


def _outdoor(seeds: int) -> str:
    """Track the outdoor film from its given start; return a line with the distances from its marks."""
    sources = {name: Path(str(resources.files("gait") / "data" / f"{name}.gait")) for name in MODELS}
    sources[ALONE] = OUT / f"{ALONE}.gait"
    found = []
    for name, model in sources.items():
        arm = Arm(f"outdoor/{name}", seeds=seeds)
        results = [
            eval_run.run(Job(eval_clips.outdoor_clip(), arm, seed, model, OUT))
            for seed in range(1, seeds + 1)
        ]
        px = [float(np.median([one.measures[which] for one in results])) for which in ("near_px", "clear_px")]
        found.append(f"{name} {px[0]:.1f} and {px[1]:.1f}")
    return (
        "Outdoor film, from its given start: distance from the marked hip, knee and ankle of the near side, "
        "and from\nall joints that are clearly visible, px, medians: " + "; ".join(found) + "."
    )


def _time_of_classes(clip: Clip) -> str:
    """Time steps of the models alternately; return lines with the ratios."""
    shipped, three = resources.files("gait") / "data" / "walk.gait", OUT / "three.gait"
    words = ["learn", shipped, "-o", three, "--class", "stand", "--class", "backwards"]
    subprocess.run([sys.executable, "-m", "gait", *map(str, words)], check=True, capture_output=True)
    video = Video(clip.video)
    camera, plate = Camera.read(str(clip.camera), video.size), read_plate(str(clip.plate), video.size)
    trackers = []
    models = Model("walk"), Model(three), Model("classes")
    for model in models:
        tracker = Tracker(model, camera, TrackerConfig.default(seed=1), background=plate)
        start = Start.read(OUT / f"{clip.name}.walk.1.json", model)
        tracker.start(start.mean, start.sd, 0)
        trackers.append(tracker)
    spent: list[list[float]] = [[] for _ in models]
    for frame in video.frames():
        for tracker, times in zip(trackers, spent, strict=True):
            before = time.thread_time()
            tracker.step(frame.image, frame.utime)
            times.append(time.thread_time() - before)
    ratio, of_four = (float(np.median(np.array(times) / np.array(spent[0]))) for times in spent[1:])
    verdict = "reached" if ratio <= DEARER else "missed"
    three_names, four_names = (", ".join(model.classes) for model in models[1:])
    return (
        f"A step with three classes ({three_names}) takes {ratio:.2f} times as long as a step with the walk "
        "alone: processor\n"
        f"time, median over the frames of {clip.name}; target at most {DEARER}: {verdict}.  With the four of "
        f"classes ({four_names})\nit takes {of_four:.2f} times as long."
    )


def _rows(runs: list[Run]) -> Iterator[tuple[object, ...]]:
    """Medians over the seeds, with the models side by side."""
    for clip in dict.fromkeys(run.clip for run in runs):
        for model in dict.fromkeys(run.model for run in runs):
            these = [run for run in runs if run.clip == clip and run.model == model]
            if not these:
                continue
            wrong = [run.wrong for run in these if run.wrong is not None]
            lifts = [run.lifted for run in these if run.lifted is not None]
            swapped = [run.swapped for run in these if run.swapped is not None]
            feet = [run.foot for run in these if run.foot is not None]
            roots = [run.root for run in these]
            yield (
                clip,
                model,
                round(float(np.median(roots)), 1),
                f"{min(roots):.0f}-{max(roots):.0f}",
                WANTED.get(clip.split("_")[0]),
                _verdict(clip, these),
                round(float(np.median([run.absolute for run in these]))),
                round(float(np.mean([run.covered for run in these])), 2),
                round(100 * float(np.mean([run.tracking for run in these]))),
                round(100 * float(np.mean([run.far for run in these])), 1),
                round(100 * float(np.mean(wrong)), 1) if wrong else None,
                round(100 * float(np.mean(lifts)), 1) if lifts else None,
                round(100 * float(np.mean(swapped)), 1) if swapped else None,
                round(float(np.median(feet)), 2) if feet else None,
            )


def _verdict(clip: str, runs: list[Run]) -> str | None:
    """Name the targets that the runs of a clip with one model miss; None: the clip has no target."""
    if not _simulated(clip):
        return None
    wrong = [run.wrong for run in runs if run.wrong is not None]
    covered = float(np.mean([run.covered for run in runs]))
    kind = clip.split("_")[0]
    missed = {
        "root": float(np.median([run.root for run in runs])) > WANTED.get(kind, np.inf),
        "abs": float(np.median([run.absolute for run in runs])) > WANTED_PLACE.get(kind, np.inf),
        "in 90 %": not COVERED[0] <= covered <= COVERED[1],
        "wrong class": bool(wrong) and float(np.mean(wrong)) >= WRONG,
    }
    names = [name for name, misses in missed.items() if misses]
    return f"missed: {', '.join(names)}" if names else "reached"


if __name__ == "__main__":
    sys.exit(main())
