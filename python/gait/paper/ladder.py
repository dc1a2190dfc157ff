"""What each later addition buys: from the paper's tracker to the package's, one step after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from gait.bindings.abi import Mode, Term
from gait.bindings.config import TrackerConfig
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.io.blob import decode
from gait.io.track_file import read_truth
from gait.io.video import Frame, Image, Video, background
from gait.learn.arrays import Floats
from gait.motion.evaluate import free_run, root_errors, static_pose
from gait.motion.footfalls import strikes_of
from gait.paper import tracking
from gait.paper.clip import Clip
from gait.paper.entry import Entry, picture
from gait.paper.ormoneit import Learning
from gait.paper.ormoneit_figures import blob_of
from gait.report.figures import Drawing
from gait.track.tracker import Tracker

SEED = 1
CAPTION = (
    "Root-aligned error of the joints, mm, median over the frames: each rung adds to the one above it.  "
    "Grey and dashed: without any image."
)
STATIC, FREE = "static pose", "free-running cycle"
#: What is added in later steps, off: settings of the default mode.
_WITHOUT: dict[str, Any] = {
    "evidence_time": 0.0,
    "rejuvenation_time": 0.0,
    "offset_angles": 0,
    "stature_noise": 0.0,
    "stature_noise_start": 0.0,
    "acquisition_particles": 0,
}
#: The paper's sigmas, p_occluded and sigma(alpha) before they were searched.
_UNSEARCHED: dict[str, Any] = {
    "phase_noise": 0.022,
    "rate_noise": 0.055,
    "forward_noise": 0.044,
    "lateral_noise": 0.044,
    "vertical_noise": 0.022,
    "heading_noise": 0.11,
    "tilt_noise": 0.055,
    "coef_noise": 0.5,
    "coef_start": 1.0,
    "occluded_density": 0.0018,
    "surface_sd": 8.0,
    "surface_tilt": 1.0,
}


@dataclass(frozen=True)
class Rung:
    """A way of tracking: one addition to the one before."""

    name: str
    mode: Mode
    people: bool  #: the model is of people, not the paper's
    changes: dict[str, Any] = field(default_factory=dict)


def _default(terms: Term, *added: str) -> dict[str, Any]:
    """Return settings of the default mode with these terms and without what is not in `added`."""
    return {"terms": terms} | {k: v for k, v in _WITHOUT.items() if k not in added}


_ALL = Term.TEXTURE | Term.SILHOUETTE | Term.EDGES | Term.TEMPLATE
RUNGS = (
    Rung("paper, sigmas by hand", Mode.PAPER, False, _UNSEARCHED),
    Rung("paper", Mode.PAPER, False),
    Rung("+ prior over people", Mode.PAPER, True),
    Rung("+ robust texture, dynamics that relax, root motion", Mode.DEFAULT, True, _default(Term.TEXTURE)),
    Rung("+ silhouette", Mode.DEFAULT, True, _default(Term.TEXTURE | Term.SILHOUETTE)),
    Rung("+ edges", Mode.DEFAULT, True, _default(Term.TEXTURE | Term.SILHOUETTE | Term.EDGES)),
    Rung("+ template", Mode.DEFAULT, True, _default(_ALL)),
    Rung("+ errors that last (evidence_time)", Mode.DEFAULT, True, _default(_ALL, "evidence_time")),
    Rung(
        "+ rejuvenation, posture, stature: the default",
        Mode.DEFAULT,
        True,
    ),
)


def follow(
    rung: Rung,
    model: Model,
    camera: Camera,
    plate: Image | None,
    start: Start,
    frames: Sequence[Frame],
    seed: int,
) -> Floats:
    """Track the frames; return the joints, EVAL15 (n, 15, 3)."""
    config = TrackerConfig.default(rung.mode, seed=seed, **rung.changes)
    tracker = Tracker(model, camera, config, background=plate)
    tracker.start(start.mean, start.sd, frames[0].utime)
    found = [tracker.step(frame.image, frame.utime) for frame in frames]
    return np.array([[e.joint(name) for name in EVAL15] for e in found])


def entry(clip: Clip, learning: Learning, update: Callable[[int], None]) -> Entry | None:
    """Climb on a clip whose truth is known; None for others."""
    if clip.truth is None:
        return None
    video = Video(clip.video)
    camera, plate, truth = (
        clip.calibration(video.size),
        background(clip.background, video),
        read_truth(clip.truth),
    )
    models = {p: Model(blob_of(m, p)) for p, m in (("paper", learning.literal), ("people", learning.ours))}
    start = Start.read(clip.init, models["people"])
    frames = list(video.frames(start.frame, start.frame + tracking.FRAMES + 1))
    rows = [truth.frame.tolist().index(frame.number) for frame in frames]
    true = np.stack([truth.places[name] for name in EVAL15], axis=1)[rows]
    sections = decode(blob_of(learning.ours, "people"))
    free = free_run(sections, truth, strikes_of(truth, Path(clip.truth).with_name("meta.json")), rows[0])
    errors = {STATIC: float(np.median(root_errors(static_pose(sections, truth)[rows], true)))}
    if free is not None:
        errors[FREE] = float(np.median(root_errors(free[rows], true)))

    def run(rung: Rung) -> Floats:
        model = models["people" if rung.people else "paper"]
        own = Start.read(clip.init, model)
        return follow(rung, model, camera, plate, own, frames, SEED)

    errors |= climb(run, true, update)
    drawing = Drawing("ladder", "From the paper to the default", CAPTION, plot(errors))
    paper, ours, none = errors[RUNGS[1].name], errors[RUNGS[-1].name], errors.get(FREE, errors[STATIC])
    return Entry(
        "Ladder: what each later addition buys",
        "Nothing of the kind; tracking is shown on one clip.",
        f"{paper:.0f} mm root-aligned over frames 0 to {tracking.FRAMES} (median); "
        f"{errors[RUNGS[0].name]:.0f} mm with sigmas set by hand.",
        f"{ours:.0f} mm.",
        f"the mean cycle running on from the true start without any image is {none:.0f} mm off: the paper's "
        f"likelihood {'gains' if paper < none else 'loses'} {abs(none - paper):.0f} mm on it, the default "
        f"{'gains' if ours < none else 'loses'} {abs(none - ours):.0f} mm",
        (
            "The paper compares a limb only with what it covered in the frame before.  A static background "
            "predicts itself better than a walking person does, so that eqs. 10-13 prefer a body that has "
            "come to rest on the wall; only small sigmas keep it from going there.",
        ),
        (picture(drawing),),
    )


def climb(run: Callable[[Rung], Floats], true: Floats, update: Callable[[int], None]) -> dict[str, float]:
    """Return the median root-aligned error of each rung, mm; `run` gives its joints."""
    errors = {}
    for k, rung in enumerate(RUNGS):
        errors[rung.name] = float(np.median(root_errors(run(rung), true)))
        update(k + 1)
    return errors


def plot(errors: dict[str, float], spread: dict[str, tuple[float, float]] | None = None) -> Figure:
    """Draw the ladder: bars of the errors, mm, with lines at what needs no image.

    spread : smallest and largest error of each rung.
    """
    with matplotlib.rc_context({"font.size": 9}):
        figure = Figure(figsize=(8.0, 0.32 * len(errors) + 1.0), layout="constrained")
        axes = figure.subplots()
        names = list(errors)
        values = [errors[name] for name in names]
        colours = ["#b8b8b8" if name in (STATIC, FREE) else "#2a6f97" for name in names]
        axes.barh(range(len(names)), values, color=colours)
        for k, name in enumerate(names):
            low, high = (spread or {}).get(name, (values[k], values[k]))
            if high > low:
                axes.plot([low, high], [k, k], color="black", lw=1)
            axes.text(max(high, values[k]), k, f" {values[k]:.0f}", va="center")
        if FREE in errors:
            axes.axvline(errors[FREE], color="#d9722e", lw=1, ls="--")
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel("root-aligned error, mm (dashed: without any image)")
        axes.spines[["top", "right"]].set_visible(False)
    return figure
