"""The clips: those of ../shared/data, and any folder of clips in the same layout; their models and starts."""

from __future__ import annotations

import csv
import hashlib
import json
import subprocess
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from eval_plan import Clip

from gait.bindings.initial import DEFAULT_SD
from gait.errors import UserError
from gait.io.track_file import Joints, read_truth
from gait.motion.footfalls import strikes_of
from gait.progress import progress

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT.parent / "shared" / "data"
MOCAP = DATA / "mocap" / "cmu_walk"
OUTDOOR = "outdoor"
OUTDOOR_FRAMES = (64, 187)  # the first frame in which she is in full view
OUTDOOR_HEIGHT = 1.65  # metres
_PRIORS = {"people": "", "paper": "paper."}  # in the names of models
SD = {"pelvis": 0.03, "heading_rad": 0.05, "phase": 0.03, "stride_hz": 0.03, "stature_m": 0.003}
"""Standard deviations of a start, and of its noise about the truth; the stature is known to 3 mm."""


def shared_clips(names: list[str] | None) -> list[Clip]:
    """The development clips and the outdoor clip, or those called `names`."""
    known = {clip.name: clip for clip in folder_clips(DATA / "eval" / "dev")} | {OUTDOOR: outdoor_clip()}
    unknown = [name for name in names or () if name not in known]
    if unknown:
        raise UserError(f"--clips {unknown[0]}: unknown; use {' '.join(known)}")
    return [known[name] for name in names or known]


def folder_clips(folder: Path) -> list[Clip]:
    """Every sub-folder with video.mp4 and camera.json (or the folder itself).

    background.png, truth.csv, meta.json and init.json are used if they exist.
    """
    places = [p for p in [folder, *sorted(folder.iterdir())] if (p / "video.mp4").is_file()]
    if not places:
        raise UserError(f"{folder}: holds no clip; a clip is a folder with video.mp4 and camera.json")
    return [_clip(place) for place in places]


def _clip(folder: Path) -> Clip:
    def known(name: str) -> Path | None:
        return folder / name if (folder / name).is_file() else None

    meta = meta_of(folder)
    subject = meta.get("mocap_subject")
    return Clip(
        name=folder.name,
        folder=folder,
        video=folder / "video.mp4",
        camera=folder / "camera.json",
        plate=known("background.png"),
        truth=known("truth.csv"),
        init=None if known("truth.csv") else known("init.json"),
        subject=str(subject) if subject and (MOCAP / str(subject)).is_dir() else None,
        steady=meta.get("steady", True),
        empty=not meta.get("person", True),
    )


def outdoor_clip() -> Clip:
    """The real clip, judged by joints marked in the picture."""
    folder = DATA / "video" / "outdoor"
    return Clip(
        name=OUTDOOR,
        folder=folder,
        video=folder / "demo.mp4",
        camera=folder / "Calib_demo.toml",
        plate=folder / "background_median.png",
        marks=folder / "reference2d.json",
        init=folder / "init.json",
        first=OUTDOOR_FRAMES[0],
        stop=OUTDOOR_FRAMES[1],
        height=OUTDOOR_HEIGHT,
    )


def meta_of(folder: Path) -> dict[str, Any]:
    """Contents of a clip's meta.json, empty if there is none."""
    path = folder / "meta.json"
    return dict(json.loads(path.read_text())) if path.is_file() else {}


def chosen(clips: Iterable[Path]) -> list[Path]:
    """Of the folders of clips, those that the command line names, or all; SystemExit for an unknown name."""
    all_of_them, names = sorted(clips), sys.argv[1:]
    unknown = set(names) - {clip.name for clip in all_of_them}
    if unknown:
        known = " ".join(clip.name for clip in all_of_them)
        raise SystemExit(f"{Path(sys.argv[0]).stem}: no clip {' '.join(sorted(unknown))}; there are {known}")
    return [clip for clip in all_of_them if not names or clip.name in names]


def absent() -> bool:
    """Print a message and return True if the shared data are absent."""
    if not DATA.is_dir():
        print(f"{Path(sys.argv[0]).stem}: {DATA} is not there, left out", file=sys.stderr)
    return not DATA.is_dir()


def people(names: list[str] | None = None) -> tuple[list[Clip], dict[str, Path]]:
    """Clips with true joints (of these names, or all), and models learnt without each clip's subject."""
    clips = [clip for clip in shared_clips(names) if clip.truth]
    with progress("learning", None) as update:
        return clips, models(clips, ROOT / "build" / "eval" / "models", 1, update)


def models(
    clips: list[Clip], folder: Path, jobs: int, update: Callable[[int], None], prior: str = "people"
) -> dict[str, Path]:
    """Models without each clip's subject, learnt once for each state of the learning code and the data."""
    folder.mkdir(parents=True, exist_ok=True)
    key = _learning_key()
    subjects = sorted({clip.subject for clip in clips if clip.subject})
    paths = {subject: folder / f"without_{subject}.{_PRIORS[prior]}{key}.gait" for subject in subjects}
    missing = [subject for subject in subjects if not paths[subject].is_file()]
    with ThreadPoolExecutor(jobs) as pool:
        for done, _ in enumerate(pool.map(lambda s: _learn(s, paths[s], prior), missing), 1):
            update(done)
    return paths


def _learning_key() -> str:
    """Digest of the sources that learning uses and of the names and sizes of the data."""
    package = ROOT / "python" / "gait"
    patterns = ("body/*.py", "io/*.py", "learn/**/*.py", "cli/learn*.py")
    digest = hashlib.sha256()
    for path in sorted(path for pattern in patterns for path in package.glob(pattern)):
        digest.update(path.read_bytes())
    for path in sorted(p for p in MOCAP.rglob("*") if p.is_file()):
        digest.update(f"{path.relative_to(MOCAP)} {path.stat().st_size}".encode())
    return digest.hexdigest()[:12]


def _learn(subject: str, path: Path, prior: str) -> None:
    words = ["learn", MOCAP, "-o", path, "--exclude", f"cmu_walk/{subject}/*", "--json", "--quiet"]
    words += ["--prior", "paper", "--segments", "none"] if prior == "paper" else []
    done = subprocess.run(
        [sys.executable, "-m", "gait", *map(str, words)], capture_output=True, text=True, cwd=ROOT
    )
    if done.returncode:
        raise UserError(f"gait learn without {subject}: {done.stderr.strip()}")


def noisy_start(clip: Clip, seed: int, stature_error: float) -> dict[str, Any]:
    """First state in the form of an ``--init`` file: the clip's own, or the truth plus noise from the seed.

    A wrong stature gets the sd that a start without a stature has: the user believes the number.
    """
    start = json.loads(clip.init.read_text()) if clip.init else _noisy_truth(clip, seed)
    if stature_error:
        start["stature_m"] *= 1 + stature_error
        start["sd"] = start["sd"] | {"stature_m": DEFAULT_SD["stature_m"]}
    return start


def _noisy_truth(clip: Clip, seed: int) -> dict[str, Any]:
    truth = read_truth(clip.truth)
    with open(clip.truth, newline="", encoding="utf-8") as file:
        heading = float(next(csv.DictReader(file))["heading_rad"])
    noise = np.random.default_rng(seed).standard_normal(7)
    true = _cadence(clip, truth) | {"stature_m": meta_of(clip.folder)["stature_m"], "heading_rad": heading}
    drawn = {"phase": noise[0], "stride_hz": noise[1], "stature_m": 0.0, "heading_rad": noise[3]}
    start = {key: float(value + SD[key] * drawn[key]) for key, value in true.items()}
    if "phase" in start:
        start["phase"] %= 1.0
    pelvis = truth.places["pelvis"][0] + SD["pelvis"] * noise[4:]
    sd = {key: SD[key] for key in (*start, "pelvis")}
    return {"frame": int(truth.frame[0]), **start, "pelvis": pelvis.tolist(), "sd": sd}


def _cadence(clip: Clip, truth: Joints) -> dict[str, float]:
    """Phase and stride rate at the first frame; empty if no person walks or there are too few steps."""
    cycles = strikes_of(truth, clip.folder / "meta.json").cycles(truth.frame[:2])
    if cycles is None or not clip.steady:
        return {}
    return {"phase": cycles[0], "stride_hz": (cycles[1] - cycles[0]) / (truth.time[1] - truth.time[0])}
