"""The gain of each later addition, from the paper's tracker to the package's, step by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from gait.bindings.abi import Mode, Term
from gait.bindings.config import TrackerConfig
from gait.bindings.estimate import Estimate
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.body.skeleton import ANGLES, PAPER_ANGLES
from gait.io.blob import decode, encode, unpack_names
from gait.motion.evaluate import stature
from gait.paper import freeze, preference, tracking, verdicts
from gait.paper.entry import Entry, picture, table
from gait.paper.freeze import Freeze
from gait.paper.ormoneit import Learning
from gait.paper.ormoneit_figures import blob_of
from gait.paper.preference import Probe, Row
from gait.paper.scene import Run, Scene, follow, reported
from gait.report.figures import Drawing

RUNG_SEED, SEEDS = 1, 10  # of the rungs; runs of the paper's filter in each view
CAPTION = (
    "Root-aligned joint error in mm: the median over frames and views, with the range over the views. Each "
    "rung adds one thing to the rung above. Grey bars use no image. Dashed lines show the rung's own model "
    "running free, without images, from the exact true state; the rungs themselves start with some error."
)
STATIC_POSE = "static pose"
_FREE_RUNNING = tuple(
    f"free-running cycle, {whose}" for whose in ("the paper's model", "people, 19 angles", "people")
)
#: The free-running cycle that a rung is compared with, by `Rung.model`.
FREE = {
    "paper": _FREE_RUNNING[0],
    "rigid": _FREE_RUNNING[1],
    "plain": _FREE_RUNNING[2],
    "root": _FREE_RUNNING[2],
    "people": _FREE_RUNNING[2],
}
COMPARED_MODELS = "paper", "rigid", "people"  # models of these cycles
#: Settings of the default mode that later rungs add, switched off.
_WITHOUT: dict[str, Any] = {
    "evidence_time": 0.0,
    "rejuvenation_time": 0.0,
    "offset_angles": 0,
    "stature_noise": 0.0,
    "stature_noise_start": 0.0,
}
#: The paper's sigmas, p_occluded and sigma(alpha) as set by hand, before the search.
UNSEARCHED: dict[str, Any] = {
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
    "limb_points": 16,
}

#: Settings of the dynamics and of the initial spread that differ between the modes.
_RELAXING = (
    "phase_noise",
    "rate_noise",
    "rate_time",
    "forward_noise",
    "lateral_noise",
    "vertical_noise",
    "heading_noise",
    "tilt_noise",
    "tilt_time",
    "coef_noise",
    "coef_time",
    "coef_start",
)
_TURNING = "turn_sd", "turn_time"


@dataclass(frozen=True)
class Rung:
    """A way of tracking that adds one thing to the rung before."""

    name: str
    mode: Mode
    #: "paper"; "rigid": the package's prior, but with the paper's 19 angles and a pelvis that moves ahead at
    #: constant speed, as in the paper; "plain": all angles; "root": the pelvis also moves within a stride;
    #: "people": angles and pelvis also depend on the stride rate.
    model: str
    changes: dict[str, Any] = field(default_factory=dict)


def _default(terms: Term, *added: str) -> dict[str, Any]:
    """Return settings of the default mode with these terms; of the later additions only those in `added`."""
    return {"terms": terms} | {k: v for k, v in _WITHOUT.items() if k not in added}


def _usual(*names: str) -> dict[str, Any]:
    """Return the named settings as the default mode has them, and its number of components."""
    usual = TrackerConfig.default()
    return {"components": RUNG_COMPONENTS} | {name: getattr(usual, name) for name in names}


RUNG_COMPONENTS = 5  # of each model: those of the paper, the first of the default's
_FILTER = *_RELAXING, *_TURNING, "particles", "resample_ess"
_CUES = Term.TEXTURE | Term.SILHOUETTE, Term.TEXTURE | Term.SILHOUETTE | Term.EDGES
_ALL = Term.TEXTURE | Term.SILHOUETTE | Term.EDGES | Term.TEMPLATE
_LATER = "evidence_time", "rejuvenation_time", "offset_angles"
RUNGS = (
    Rung("paper, sigmas by hand", Mode.PAPER, "paper", UNSEARCHED),
    Rung("paper", Mode.PAPER, "paper"),
    Rung("+ prior over people", Mode.PAPER, "rigid", _usual()),
    Rung("+ trunk and ankles", Mode.PAPER, "plain", _usual()),
    Rung("+ dynamics that relax", Mode.PAPER, "plain", _usual(*_RELAXING)),
    Rung("+ turning", Mode.PAPER, "plain", _usual(*_RELAXING, *_TURNING)),
    Rung("+ only 2,000 particles", Mode.PAPER, "plain", _usual(*_FILTER[:-1])),
    Rung("+ resampling only when needed", Mode.PAPER, "plain", _usual(*_FILTER)),
    Rung("+ robust texture", Mode.DEFAULT, "plain", _default(Term.TEXTURE)),
    Rung("+ root motion", Mode.DEFAULT, "root", _default(Term.TEXTURE)),
    Rung("+ curves by stride rate", Mode.DEFAULT, "people", _default(Term.TEXTURE)),
    Rung("+ silhouette", Mode.DEFAULT, "people", _default(_CUES[0])),
    Rung("+ edges", Mode.DEFAULT, "people", _default(_CUES[1])),
    Rung("+ template", Mode.DEFAULT, "people", _default(_ALL)),
    Rung("+ errors that last (evidence_time)", Mode.DEFAULT, "people", _default(_ALL, *_LATER[:1])),
    Rung("+ rejuvenation", Mode.DEFAULT, "people", _default(_ALL, *_LATER[:2])),
    Rung("+ posture", Mode.DEFAULT, "people", _default(_ALL, *_LATER)),
    Rung("+ stature: the default", Mode.DEFAULT, "people"),
)
PAPER_RUNG = RUNGS[1]


def config_of(rung: Rung, seed: int) -> TrackerConfig:
    """Return the settings of a rung."""
    return TrackerConfig.default(rung.mode, seed=seed, **rung.changes)


def blobs(paper: bytes, people: bytes) -> dict[str, bytes]:
    """Return the models of the rungs, made from the paper's and from the package's."""
    root = dict(decode(people))
    root.pop("PACE", None)
    names, curves = unpack_names(root["CHNM"]), np.array(root["CURV"])

    def still(channels: Sequence[str]) -> bytes:
        for name in channels:
            curve = curves[:, :, names.index(name)]
            curve[1:] = 0.0
            curve[0] = curve[0].mean()
        return encode(root | {"CURV": curves})

    plain = still(("root_forward", "root_sway", "root_height"))
    rigid = still(ANGLES[len(PAPER_ANGLES) :])
    return {"paper": paper, "rigid": rigid, "plain": plain, "root": encode(root), "people": people}


@dataclass(frozen=True)
class Climbed:
    """What was found in the views: root-aligned errors, mm, and which runs of the paper's filter succeed."""

    scenes: list[Scene]
    rungs: dict[str, list[float]]  #: error in each view, by rung or by baseline without images
    held: list[int]  #: by view: how many of SEEDS runs in paper mode follow the person to the end
    paper: list[float]  #: their median error in each view
    lost: tuple[str, str]  #: how many runs are reported as lost: of those that leave the person, and the rest
    preferred: list[tuple[list[Row], list[Row]]]  #: by view: log-likelihoods of the paper and of the default
    frozen: list[Freeze]  #: by view: which term prefers a body at rest
    farthest: tuple[
        int, int, list[Estimate]
    ]  #: view, seed and estimates of the run with the largest last error

    @property
    def free(self) -> list[float]:
        """Error, by view, of the paper's mean cycle running free."""
        return self.rungs[FREE["paper"]]


def climb(scenes: Sequence[tuple[Scene, str]], learning: Learning, update: Callable[[int], None]) -> Climbed:
    """Track every view on each rung, and in paper mode from several seeds.

    scenes : sequence of (Scene, str)
        Views with the init files of their starts.
    """
    learnt = blobs(blob_of(learning.literal, "paper"), blob_of(learning.ours, "people"))
    known = {name: Model(each) for name, each in learnt.items()}
    base = {p: [scene.baselines(decode(each)) for scene, _ in scenes] for p, each in learnt.items()}
    rungs = {STATIC_POSE: [each["static"] for each in base["people"]]}
    rungs |= {FREE[prior]: [each["free"] for each in base[prior]] for prior in COMPARED_MODELS}
    done = 0

    def followed(rung: Rung, scene: Scene, init: str, seed: int) -> list[Estimate]:
        nonlocal done
        model = known[rung.model]
        start = Start.read(init, model)
        found = follow(model, scene.camera, scene.plate, config_of(rung, seed), start, scene.frames)
        update(done := done + 1)
        return found

    for rung in RUNGS:
        rungs[rung.name] = [
            scene.judged(followed(rung, scene, init, RUNG_SEED)).root for scene, init in scenes
        ]
    held, paper, far = list[int](), list[float](), list[tuple[float, int, int, list[Estimate]]]()
    every = list[Run]()
    for k, (scene, init) in enumerate(scenes):
        found = [followed(PAPER_RUNG, scene, init, seed) for seed in range(1, SEEDS + 1)]
        runs = [scene.judged(each) for each in found]
        every += runs
        held.append(sum(r.held for r in runs))
        paper.append(float(np.median([r.root for r in runs])))
        worst = max(range(SEEDS), key=lambda i: runs[i].last)
        far.append((runs[worst].last / scene.height, k, worst + 1, found[worst]))
    sizes = {p: [stature(decode(learnt[p]), scene.truth) for scene, _ in scenes] for p in ("paper", "people")}

    def prefers(k: int, prior: str, mode: Mode) -> list[Row]:
        return Probe(scenes[k][0], known[prior], preference.config(mode), sizes[prior][k]).table()

    rungs[PAPER_RUNG.name] = paper
    views = range(len(scenes))
    preferred = [(prefers(k, "paper", Mode.PAPER), prefers(k, "people", Mode.DEFAULT)) for k in views]
    frozen = [freeze.examine(scenes[k][0], known["paper"], sizes["paper"][k], preferred[k][0]) for k in views]
    farthest = max(far, key=lambda each: each[0])[1:]
    lost = reported(every, held=False), reported(every, held=True)
    return Climbed([scene for scene, _ in scenes], rungs, held, paper, lost, preferred, frozen, farthest)


def steps(views: int) -> int:
    """Return the number of runs that `climb` makes."""
    return views * (len(RUNGS) + SEEDS)


def entries(found: Climbed) -> Iterator[Entry]:
    """Yield the entry on the paper's likelihood, and the ladder."""
    yield _reach(found)
    yield _ladder(found)


def _reach(found: Climbed) -> Entry:
    names = [scene.name for scene in found.scenes]
    wanted = round(verdicts.MOSTLY * SEEDS)
    runs = zip(names, found.held, found.paper, found.free, strict=True)
    each = "; ".join(
        f"{name}: on the person in {held} of {SEEDS} runs (target: {wanted}), error {root:.0f} mm (target: "
        f"below {free:.0f}, the error without any image)"
        for name, held, root, free in runs
    )
    rows = [
        (view, name, *(f"{x:.1f}" for x in (*one, *other)))
        for view, both in zip(names, found.preferred, strict=True)
        for (name, *one), (_, *other) in zip(*both, strict=True)
    ]
    gains = [[preference.gain_at_rest(each) for each in side] for side in zip(*found.preferred, strict=True)]
    terms = [
        f"{f.scene.name}: E {e:+.1f}, all other terms {rest:+.1f}"
        for f in found.frozen
        for e, rest in (f.causes(),)
    ]
    view, seed, run = found.farthest
    head = "view", "the body is", "literal: walks", "rests", "ours: walks", "rests"
    caption = (
        "How much better the best motionless body on the background scores than the true one, in nats per "
        f"frame: {'; '.join(terms)}. Below: mean log-likelihood, in nats, of a frame given the one before. "
        "The body has the mean cycle, at the true state or displaced from it, and between the two frames it "
        "either walks on with the person or stands still. The two likelihoods have different units."
    )
    return Entry(
        "Eqs. 10 to 13: what the likelihood achieves",
        "A walking person is tracked for 50 frames; the model drifts where limbs hide each other, and "
        "recovers.",
        "The paper's likelihood does not keep track of a person in every view. It compares a limb only with "
        "what it covered in the frame before. A static background always looks like itself, so a motionless "
        f"body on the background fits best. Median root-aligned errors of rendered walks, by view, frames 0 "
        f"to {tracking.FIGURE_FRAMES}. {each}. Reported as lost: {found.lost[0]} runs that leave the person, "
        f"and {found.lost[1]} that stay on the person.",
        "Silhouette, edges and template also compare with the background. The ladder shows the errors.",
        f"{verdicts.held(found.held, SEEDS, found.paper, found.free)}; {verdicts.at_rest(gains)}",
        (
            "The clips: walks with a normative gait, which differs from that of every person recorded, "
            f"rendered from several sides and started near the truth. The target in every view: {wanted} of "
            f"{SEEDS} runs on the person, and an error below that of the mean cycle running free from the "
            "exact truth. Results on seven clips of real motion, one of them filmed outdoors, are in "
            "tests/bench/results/paper_mode.md of the sources.",
            "Lost means that for a third of a second the image under the body did not move along with it. "
            "The threshold was chosen on simulated clips: tests/bench/results/search_paper_lost.md.",
            f"On the person: {tracking.CRITERION}.",
            "Terms: q, p_occluded and sigma(alpha) are what remains when the two images are equal. E of a "
            "limb is what its pixels add when the images are revealed limb by limb.",
        ),
        (
            *freeze.pictures(found.frozen[view], run, seed),
            freeze.split_table(found.frozen),
            table(caption, head, rows),
        ),
    )


def own_cycle(name: str) -> str:
    """Name the free-running cycle that a rung is compared with; names beyond the ladder have "people"."""
    return FREE[next((rung.model for rung in RUNGS if rung.name == name), "people")]


def gain(errors: Mapping[str, Sequence[float]], name: str) -> float:
    """Return the error of a rung's own cycle less that of the rung, mm, median over the views."""
    return float(np.median(np.subtract(errors[own_cycle(name)], errors[name])))


def _ladder(found: Climbed) -> Entry:
    names = [scene.name for scene in found.scenes]
    median = {name: float(np.median(errors)) for name, errors in found.rungs.items()}
    ranges = {name: (min(errors), max(errors)) for name, errors in found.rungs.items()}
    drawing = Drawing("ladder", "From the paper to the default", CAPTION, plot(median, ranges))
    gains = {rung.name: f"{gain(found.rungs, rung.name):+.0f}" for rung in RUNGS}
    rows = [
        (name, f"{median[name]:.0f}", gains.get(name, "-"), *(f"{x:.0f}" for x in errors))
        for name, errors in found.rungs.items()
    ]
    return Entry(
        "Ladder: what each later addition gains",
        "Not in the paper, which shows tracking on one clip.",
        f"{median[PAPER_RUNG.name]:.0f} mm root-aligned over frames 0 to {tracking.FIGURE_FRAMES}, the "
        f"median of {len(names)} views; {median[RUNGS[0].name]:.0f} mm with sigmas set by hand.",
        f"{median[RUNGS[-1].name]:.0f} mm.",
        verdicts.without_image(*(gain(found.rungs, rung.name) for rung in (PAPER_RUNG, RUNGS[-1]))),
        (
            "Sigmas, epsilon, p_occluded, sigma(alpha) and n_s were searched on simulated clips. Here each "
            f"rung has one seed ({RUNG_SEED}) and the paper's filter {SEEDS}, so differences of a few "
            "millimetres may be chance. tests/bench/results/paper_ladder.md of the sources has the same "
            "table for clips of real motion, with further rungs for a detector's keypoints and automatic "
            "starts.",
            "Each rung adds one thing and keeps the rest. Robust texture is that of the default mode, which "
            "resamples systematically. All rungs have 5 components.",
            "The baselines without images start from the exact truth, but the rungs from the clip's init "
            "file and its standard deviations, so the comparison favours the baselines.",
        ),
        (
            picture(drawing),
            table(
                "Root-aligned error in mm, by view. Gain: how much smaller the error is than that of the "
                "rung's own model running free, median of the views.",
                ("", "median", "gain", *names),
                rows,
            ),
        ),
    )


def plot(errors: dict[str, float], spread: dict[str, tuple[float, float]] | None = None) -> Figure:
    """Draw the ladder: bars of the errors, mm, and over each rung its own model's free-running cycle.

    spread : smallest and largest error of each rung.
    """
    with matplotlib.rc_context({"font.size": 9}):
        figure = Figure(figsize=(8.0, 0.32 * len(errors) + 1.0), layout="constrained")
        axes = figure.subplots()
        names = list(errors)
        values = [errors[name] for name in names]
        blind = STATIC_POSE, *_FREE_RUNNING
        colours = ["#b8b8b8" if name in blind else "#2a6f97" for name in names]
        axes.barh(range(len(names)), values, color=colours)
        for k, name in enumerate(names):
            low, high = (spread or {}).get(name, (values[k], values[k]))
            if high > low:
                axes.plot([low, high], [k, k], color="black", lw=1)
            axes.text(max(high, values[k]), k, f" {values[k]:.0f}", va="center")
            if name not in blind:
                axes.plot([errors[own_cycle(name)]] * 2, [k - 0.5, k + 0.5], color="#d9722e", lw=1.5, ls="--")
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel("root-aligned error, mm (dashed: own free-running cycle, without any image)")
        axes.spines[["top", "right"]].set_visible(False)
    return figure
