"""Estimate every segment of a sequence separately with the C library, and choose the most probable sequence.

A segment seen from far away fits nearly as well when it is mirrored in depth.  Therefore all distinct
headings that explain a segment are kept, and its neighbours decide among them (Viterbi over the
explanations).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gait.bindings.lifter import Fit, LiftConfig, Lifter
from gait.bindings.segment_prior import SegmentPrior
from gait.errors import UserError
from gait.io import blob
from gait.lift.keypoints.observations import Observations
from gait.lift.segment.view import Perspective, View

Floats = npt.NDArray[np.float64]

FEWEST_VISIBLE = 4  # fewest visible points of a segment that is estimated by itself
HEADING_STARTS = 8  # headings from which the search for an unknown one starts, as LIFT_HEADINGS of fit.h
HEADING_START_SD = round(np.pi / HEADING_STARTS, 1)  # radians from a start: half the distance between two
SAME_HEADING = 0.2  # radians; explanations with closer headings are the same
TURN_SD = 0.7  # radians; sd of the change of heading in half a segment
GROUND_SD = 10.0  # metres, of the position on the ground
#: Metres, of the floor's height, on which a single segment depends less than a sequence.
SEGMENT_FLOOR_SD_M = 0.05
ANY_HEIGHT = 10.0  # metres, of the floor's height without a camera
MOST_SEARCHES = 5  # most searches while the position found is far from the expected one
FLAT_PRIOR = 100.0  # factor of the modes' standard deviations that leaves almost no prior


@dataclass(frozen=True)
class Explanation:
    """A heading that explains a segment.

    Attributes
    ----------
    heading : float
        Heading of the prior's axes in the world, radians.
    component : int
        Index in the prior's mixture.
    place : (3,)
        Position on the ground, metres.
    share : float
        Probability among the explanations of the same segment.
    visible : Observations
        The segment's points, outliers down-weighted.
    """

    heading: float
    component: int
    place: Floats
    share: float
    visible: Observations


@dataclass(frozen=True)
class SegmentFit:
    """Posterior of a segment.

    Attributes
    ----------
    heading : float
    component : int
    places, sd : (F, J, 3)
        Mean and standard deviations, metres.
    log10_volume : float
        log10 of posterior over prior volume.
    mode_sd : (n,)
        Standard deviations of the n least certain displacements over all markers and frames, metres, largest
        first.
    modes : (n, F, J, 3)
        These displacements, one standard deviation long.
    """

    heading: float
    component: int
    places: Floats
    sd: Floats
    log10_volume: float
    mode_sd: Floats
    modes: Floats

    def rooted_sd(self, ends: npt.NDArray[np.intp]) -> Floats:
        """Return standard deviations (F, J, 3) relative to the middle of two markers."""
        apart = self.modes - self.modes[:, :, ends].mean(axis=2, keepdims=True)
        outside = np.maximum(self.sd**2 - (self.modes**2).sum(axis=0), 0.0)
        middle = outside[:, ends].sum(axis=1, keepdims=True) / 4
        own = outside + middle
        own[:, ends] -= outside[:, ends]  # half of each of them is in the middle
        return np.asarray(np.sqrt((apart**2).sum(axis=0) + own))


class SegmentLifter:
    """Explains segments of a prior (`SegmentPrior.restricted`) in a view, with the C library.

    Parameters
    ----------
    stature, stature_sd : float
        Stature and its standard deviation, metres.
    """

    def __init__(self, prior: SegmentPrior, view: View, stature: float, stature_sd: float) -> None:
        height_sd = SEGMENT_FLOOR_SD_M if view.grounded else ANY_HEIGHT
        config = LiftConfig.default(
            stature=stature, stature_sd=stature_sd, place_sd=(GROUND_SD, GROUND_SD, height_sd), lag=-1
        )
        viewed_by = view.camera if isinstance(view, Perspective) else view.axes[:2]
        self._prior, self._latent, self._place = prior, prior.headings == 0, np.zeros(3)
        self._lifter = Lifter(blob.encode(prior.sections()), viewed_by, config)
        self._known: dict[bytes, tuple[list[Explanation], Floats]] = {}

    def explanations(self, observed: Observations) -> list[Explanation]:
        """Find all explanations of a segment, the most probable first; none if too little is visible.

        Results are cached, so that the same segment is not explained twice.
        """
        shown = observed.uv.tobytes() + observed.sd.tobytes()
        if shown not in self._known:
            self._known[shown] = self._explanations(observed), self._place
        found, self._place = self._known[shown]
        return found

    def _explanations(self, observed: Observations) -> list[Explanation]:
        if observed.visible.sum() < FEWEST_VISIBLE:
            return []
        fit, weighted = self._robust(observed)
        points = Observations(observed.uv, np.where(weighted > 0, weighted, np.inf))
        if not self._latent:
            return [Explanation(fit.heading, fit.component, fit.place, 1.0, points)]
        fits = [
            self._fit(points, start, self._place)
            for start in 2 * np.pi / HEADING_STARTS * np.arange(HEADING_STARTS)
        ]
        score = np.array([f.log_evidence + np.log(self._prior.weights[f.component]) for f in fits])
        shares = np.exp(score - score.max())
        shares /= shares.sum()
        found: list[Explanation] = []
        for k in np.argsort(-score, kind="stable"):
            one = Explanation(fits[k].heading, fits[k].component, fits[k].place, float(shares[k]), points)
            same = next((i for i, other in enumerate(found) if _same(one, other)), None)
            if same is None:
                found.append(one)
            else:
                found[same] = replace(found[same], share=found[same].share + one.share)
        return sorted(found, key=lambda e: -e.share)

    def solve(self, chosen: Explanation, displacements: int | None = None) -> SegmentFit:
        """Compute the posterior of an explanation, with this many displacements (slow); None: with all."""
        fit = self._fit(chosen.visible, chosen.heading, chosen.place)
        places, sd = self._lifter.positions()
        mode_sd, modes = np.empty(0), np.empty((0, *places.shape))
        if displacements != 0:
            mode_sd, modes = self._lifter.uncertain(displacements or len(self._lifter.posterior()[0]))
        return SegmentFit(fit.heading, fit.component, places, sd, fit.log10_volume, mode_sd, modes)

    def open_modes(self, chosen: Explanation) -> float:
        """Count the modes that an explanation's points do not determine: the sum of their variances."""
        fit = self._fit(chosen.visible, chosen.heading, chosen.place)
        used = self._prior.sd[fit.component] > 0
        return float(np.diag(self._lifter.posterior()[1])[: len(used)][used].sum())

    def _fit(self, observed: Observations, heading: float, place: Floats) -> Fit:
        """Fit a segment near a heading and a position."""
        if self._latent:
            self._lifter.expect((place[0], place[1], 0.0), heading, HEADING_START_SD)
        return self._lifter.segment(observed.uv, observed.sd)

    def _robust(self, observed: Observations) -> tuple[Fit, Floats]:
        """Search all headings, down-weighting outliers, near the position of the segment before."""
        if not self._latent:
            return self._lifter.segment_robust(observed.uv, observed.sd)
        for _ in range(MOST_SEARCHES):
            before = self._place
            self._lifter.expect((before[0], before[1], 0.0))
            fit, weighted = self._lifter.segment_robust(observed.uv, observed.sd)
            self._place = fit.place
            if np.linalg.norm((fit.place - before)[:2]) < GROUND_SD / 2:
                break
        return fit, weighted


def _same(a: Explanation, b: Explanation) -> bool:
    apart = (a.heading - b.heading + np.pi) % (2 * np.pi) - np.pi
    return a.component == b.component and bool(abs(apart) < SAME_HEADING)


def explanations(
    lifter: SegmentLifter,
    prior: SegmentPrior,
    observed: Observations,
    update: Callable[[int], None] = lambda done: None,
) -> list[list[Explanation]]:
    """Explain every segment of a grid by itself; no explanations where almost nothing is visible.

    Parameters
    ----------
    observed : Observations
        Observations of the prior's markers in whole blocks of half a segment, in the lifter's units.
    """
    half = prior.frames // 2
    found = []
    for s in range(len(observed.uv) // half - 1):
        found.append(lifter.explanations(observed.part(s * half, s * half + prior.frames)))
        update(s + 1)
    return found


def without_prior(
    prior: SegmentPrior, view: View, stature: float, stature_sd: float, chosen: Sequence[Explanation]
) -> list[SegmentFit]:
    """Estimate segments from the observations alone: the limit of large standard deviations of the modes.

    Motions of the whole body keep their prior, since an orthographic view does not show distance.

    Raises
    ------
    UserError
        If the observations of a segment do not determine all modes.
    """
    flat = SegmentLifter(replace(prior, modes=FLAT_PRIOR * prior.modes), view, stature, stature_sd)
    for each in chosen:
        count, left = prior.size, round(flat.open_modes(each))
        if left:
            raise UserError(
                f"the points seen in a segment determine {count - left} of {count} modes, and the likelihood "
                "alone does not determine the others; give more points, or use --method blend"
            )
    return [flat.solve(each) for each in chosen]


def course(found: Sequence[Sequence[Explanation]]) -> list[Explanation]:
    """Choose one explanation of every segment, so that they are probable and headings change little.

    Segments without explanations get that of the nearest segment before or after.
    """
    known = [s for s, choices in enumerate(found) if choices]
    chosen = dict(zip(known, _course([found[s] for s in known]), strict=True))
    return [chosen[min(known, key=lambda k: abs(k - s))] for s in range(len(found))]


def _course(found: Sequence[Sequence[Explanation]]) -> list[Explanation]:
    """Choose among the explanations of segments that all have some."""
    score = _log_shares(found[0])
    back = []
    for before, now in zip(found, found[1:], strict=False):
        turn = np.subtract.outer([e.heading for e in now], [e.heading for e in before])
        turn = (turn + np.pi) % (2 * np.pi) - np.pi
        table = score - 0.5 * (turn / TURN_SD) ** 2
        back.append(table.argmax(axis=1))
        # segments overlap by half, so half of the evidence is their neighbour's
        score = table.max(axis=1) + 0.5 * _log_shares(now)
    chosen = [int(score.argmax())]
    for best in reversed(back):
        chosen.append(int(best[chosen[-1]]))
    return [choices[i] for choices, i in zip(found, reversed(chosen), strict=True)]


def _log_shares(choices: Sequence[Explanation]) -> Floats:
    return np.log(np.maximum([e.share for e in choices], 1e-300))


@dataclass(frozen=True)
class Uncertain:
    """Uncertainty of single segments, as medians over them (Leventon and Freeman 1998, fig. 6).

    Attributes
    ----------
    log10_volume : float
        log10 of posterior over prior volume.
    sd : (DISPLACEMENTS,)
        Standard deviations of the least certain displacements, rms per marker, metres, largest first.
    along, rigid : (DISPLACEMENTS,)
        Shares of their energy that are along the line of sight, and that move the whole body rigidly.
    shares : (DISPLACEMENTS, J)
        Shares of their energy by marker.
    """

    log10_volume: float
    sd: Floats
    along: Floats
    rigid: Floats
    shares: Floats


DISPLACEMENTS = 3  # displacements, as in the paper's fig. 6


def summarise(segments: Sequence[SegmentFit], view: View) -> Uncertain:
    """Summarise the uncertainty of the segments of a sequence."""
    each = np.median([_least_certain(found, view) for found in segments], axis=0)
    volume = float(np.median([found.log10_volume for found in segments]))
    return Uncertain(volume, each[:, 0], each[:, 1], each[:, 2], each[:, 3:])


def _least_certain(found: SegmentFit, view: View) -> Floats:
    """Return sd, share along the line of sight, rigid share, and shares by marker, (DISPLACEMENTS, 3 + J)."""
    ahead, size = view.direction(found.places), np.sqrt(found.places[..., 0].size)
    rows = zip(found.mode_sd[:DISPLACEMENTS].tolist(), found.modes[:DISPLACEMENTS], strict=True)
    return np.array(
        [
            [s / size, share_along(m, ahead), share_rigid(m), *np.sum(m**2, axis=(0, 2)) / np.sum(m**2)]
            for s, m in rows
        ]
    )


def share_along(mode: Floats, axis: Floats) -> float:
    """Share of the energy of a mode (F, J, 3) that is along a unit vector (3,)."""
    return float(np.sum((mode @ axis) ** 2) / np.sum(mode**2))


def share_rigid(mode: Floats) -> float:
    """Share of the energy of a mode (F, J, 3) that displaces all markers alike in all frames."""
    points = mode.reshape(-1, 3)
    return float(len(points) * np.sum(points.mean(axis=0) ** 2) / np.sum(points**2))
