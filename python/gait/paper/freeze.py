"""Why the paper's likelihood prefers a motionless body on the background: eqs. 10 to 13 term by term.

The terms are isolated with the tracker's own log-likelihood.  In uniformly grey images no limb changes
(E = 0), so that q, p_occluded and sigma(alpha) remain; with tilt 0 all limbs have the same sigma.  E of a
limb is what is added when the pixels of that limb are revealed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gait.bindings.abi import Mode
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.io.video import Image
from gait.learn.arrays import Floats
from gait.paper import preference
from gait.paper.entry import Picture, table
from gait.paper.pictures import image, labelled
from gait.paper.preference import PLACES, Place, Probe
from gait.paper.scene import Scene
from gait.paper.tracking import CUT_OUT, FIGURE_SHOWN, cut
from gait.report.drawing import Overlay, draw_bones

GREY_LEVEL = 128
PIXEL_VARIANCE = 9.0  # grey levels squared, of either frame
HIDDEN_DENSITIES = (
    2.0**-20,
    2.0**-19,
)  # densities of an occluded limb, so small that only hidden limbs use them
Q = "q: turned from the image, or seen in part"
OCCLUDED = "p_occluded: limbs that are hidden"
WIDTHS = "sigma(alpha): widths"
TRUTH = (60, 230, 250)  # BGR
RIM = 3  # pixels around a limb that are shown with it, since points at its edge are interpolated
LAST_CASE = "E, beyond the edges of limbs"
FULL_RED_NATS = 0.6  # nats that a limb drawn in full red costs


@dataclass(frozen=True)
class Body:
    """Log-likelihood of a body by term: nats, means over the frames.

    Everything is relative to ideal limbs, which face the camera, are fully visible and do not change.
    """

    terms: dict[str, float]  #: what q, p_occluded, the widths and E of each limb add
    total: float  #: log-likelihood of a frame given the one before

    @property
    def differences(self) -> float:
        """Sum of the terms E of all limbs, from differences of grey levels."""
        return sum(value for name, value in self.terms.items() if name.startswith("E"))


@dataclass(frozen=True)
class Freeze:
    """The true, walking body and the best motionless one on the background, in one scene."""

    scene: Scene
    model: Model
    place: str  #: place of the motionless body, a name of `preference.PLACES`
    walks: Body
    rests: Body

    def gains(self) -> dict[str, float]:
        """By how many nats each term prefers the motionless body."""
        return {name: value - self.walks.terms[name] for name, value in self.rests.terms.items()}

    def causes(self) -> tuple[float, float]:
        """By how many nats E of all limbs prefers the motionless body, and all other terms do."""
        of_e = self.rests.differences - self.walks.differences
        return of_e, sum(self.gains().values()) - of_e


def examine(scene: Scene, model: Model, stature: float, rows: Sequence[preference.Row]) -> Freeze:
    """Split the log-likelihoods of the true body and of the best motionless one of `Probe.table`."""
    place = preference.best_at_rest(rows)
    probes = _Probes(scene, model, stature)
    walks = probes.split(PLACES["on the person"], 1.0)
    return Freeze(scene, model, place, walks, probes.split(PLACES[place], 0.0))


class _Probes:
    """Probes of the same body whose settings leave out different terms."""

    def __init__(self, scene: Scene, model: Model, stature: float) -> None:
        def probe(**changes: float) -> Probe:
            return Probe(scene, model, preference.config(Mode.PAPER, **changes), stature)

        self.model, self.scene = model, scene
        usual = preference.config(Mode.PAPER)
        self.density, self.whole = usual.occluded_density, probe()
        self.even = probe(surface_tilt=0.0)
        self.hidden = [probe(surface_tilt=0.0, occluded_density=few) for few in HIDDEN_DENSITIES]
        self.ideal = -0.5 * float(np.log(2 * np.pi * (2 * PIXEL_VARIANCE + usual.surface_sd**2)))

    def split(self, place: Place, speed: float) -> Body:
        """Split the log-likelihood of a body, the mean over the frames."""
        found = [self._frame(k, place, speed) for k in self.whole.picked]
        terms = {name: float(np.mean([each[name] for each, _ in found])) for name in found[0][0]}
        return Body(terms, float(np.mean([total for _, total in found])))

    def _frame(self, k: int, place: Place, speed: float) -> tuple[dict[str, float], float]:
        blank = np.full_like(self.scene.frames[k].image, GREY_LEVEL)
        total, after = self.whole.step(k, place, speed)

        def on_grey(probe: Probe) -> float:
            return probe.step(k, place, speed, (blank, blank))[0]

        less, more = (on_grey(probe) for probe in self.hidden)
        limbs, hidden = (
            len(self.model.limb_names),
            round((more - less) / float(np.log(HIDDEN_DENSITIES[1] / HIDDEN_DENSITIES[0]))),
        )
        seen = (limbs - hidden) * self.ideal
        one, each = on_grey(self.even), on_grey(self.whole)
        q = less - hidden * float(np.log(HIDDEN_DENSITIES[0])) - seen
        terms = {Q: q, OCCLUDED: one - limbs * self.ideal - q, WIDTHS: each - one}
        bodies = self.whole.state(k, *place), after
        ids = [self.model.render(self.scene.camera, state) for state in bodies]
        frames = self.scene.frames[k].image, self.scene.frames[k + 1].image
        shown, before = [blank.copy(), blank.copy()], each
        for limb, name in enumerate(self.model.limb_names, 1):
            for part, frame, drawn in zip(shown, frames, ids, strict=True):
                where = _widened(drawn == limb)
                part[where] = frame[where]
            after_it = self.whole.step(k, place, speed, (shown[0], shown[1]))[0]
            terms[f"E, {name.replace('_', ' ')}"], before = after_it - before, after_it
        return terms | {LAST_CASE: total - before}, total - limbs * self.ideal


def _widened(where: np.ndarray) -> np.ndarray:
    """Return a mask widened by `RIM` pixels."""
    size = 2 * RIM + 1
    return np.asarray(cv2.dilate(where.astype(np.uint8), np.ones((size, size), np.uint8)), bool)


def split_table(found: Sequence[Freeze]) -> Picture:
    """Return the terms by view: of the true body, of the motionless one, and their difference."""
    head = ["nats a frame"]
    for each in found:
        head += [f"{each.scene.name}: walks", f"rests {each.place}", "prefers rest by"]
    shown = {name: [(f.walks.terms[name], f.rests.terms[name]) for f in found] for name in found[0].gains()}
    shown["log-likelihood, their sum"] = [(f.walks.total, f.rests.total) for f in found]
    rows = [
        (name, *(f"{x:+.1f}" for walks, rests in each for x in (walks, rests, rests - walks)))
        for name, each in shown.items()
    ]
    return table(
        "Which term prefers rest: what each term costs, relative to limbs that face the camera, are fully "
        "visible and do not change, for the true, walking body and for the best body at rest on the "
        "background. Terms are added in the order of the rows, E limb by limb; p_occluded limits the cost of "
        "each limb.",
        head,
        rows,
    )


def pictures(found: Freeze, estimates: Sequence[Estimate], seed: int) -> list[Picture]:
    """Draw the estimates of a run that leaves the person over the frames, and the bodies of the table."""
    overlay = Overlay(found.model, found.scene.camera)
    cells = []
    for k in (k for k in FIGURE_SHOWN if k < len(estimates)):
        drawn = overlay.body(_colour(found.scene.frames[k].image), estimates[k].mean)
        _truth(found.scene, drawn, k)
        cells.append(_about(found.scene, drawn, k, f"frame {k}"))
    return [
        Picture(
            f"Literal, {found.scene.name}, seed {seed}, the run with the largest error at the end: the "
            "expected body (tinted) and the truth (yellow) drawn over the frames.",
            image(np.asarray(np.hstack(cells)), "the filter's body and the true one"),
        ),
        Picture(
            f"What eq. 11 compares in one step, {found.scene.name}: the true, walking body and the "
            f"motionless one {found.place}. The redder a limb, the more the image under it has changed since "
            f"the frame before (E; saturated at {FULL_RED_NATS:g} nats). On the background hardly anything "
            "changes.",
            image(_costs(found), "limbs of the walking and of the motionless body by their cost"),
        ),
    ]


def _costs(found: Freeze) -> Image:
    """Draw the walking and the motionless body, each limb coloured by its mean cost."""
    cells = []
    k = preference.EVERY * (len(found.scene.frames) // (2 * preference.EVERY))
    probe = Probe(found.scene, found.model, preference.config(Mode.PAPER), stature=_stature(found))
    for body, place, words in (
        (found.walks, "on the person", "walks"),
        (found.rests, found.place, f"rests {found.place}"),
    ):
        drawn = _colour(found.scene.frames[k].image)
        ids = found.model.render(found.scene.camera, probe.state(k, *PLACES[place]))
        for limb, name in enumerate(found.model.limb_names, 1):
            cost = -body.terms[f"E, {name.replace('_', ' ')}"]
            pale = 235 * (1 - float(np.clip(cost / FULL_RED_NATS, 0, 1)))
            colour = np.array([pale, pale, 235])
            where = ids == limb
            drawn[where] = np.rint(0.25 * drawn[where] + 0.75 * colour).astype(np.uint8)
        _truth(found.scene, drawn, k)
        cells.append(_about(found.scene, drawn, k, f"{words}: E {body.differences:.1f} nats"))
    return np.asarray(np.hstack(cells))


def _stature(found: Freeze) -> float:
    places = found.scene.truth.places
    ends = places["head_top"][found.scene.rows] - places["l_heel"][found.scene.rows]
    return float(np.median(np.abs(ends[:, 2])))


def _truth(scene: Scene, canvas: Image, k: int) -> None:
    """Draw the true bones in place."""
    at = {name: scene.camera.project(place[scene.rows[k]]) for name, place in scene.truth.places.items()}
    draw_bones(canvas, at, 1, TRUTH)


def _colour(frame: Image) -> Image:
    return np.array(cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR) if frame.ndim == 2 else frame, np.uint8)


def _about(scene: Scene, drawn: Image, k: int, words: str) -> Image:
    """Cut out the true person with some space for a body beside."""
    pelvis: Floats = scene.truth.places["pelvis"][scene.rows[k]]
    side = 1.3 * CUT_OUT * scene.height
    return labelled(cut(drawn, scene.camera.project(pelvis), side), words)
