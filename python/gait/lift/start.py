"""Where the sequence estimate starts: every segment alone, and the most probable course of their headings.

A segment seen from far away fits nearly as well when it is mirrored in depth; its neighbours tell which it is
(Viterbi over the explanations of all segments).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.lift import robust_weights as doubt
from gait.lift.equations import View
from gait.lift.heading import Explanation, Person, explain
from gait.lift.observe import Observations, Rows

Floats = npt.NDArray[np.float64]

ASTRAY = 4.0  # squared deviations per number, 1 of noise alone: a search may have gone to wild points
ROUGH = 8.0  # times the points' deviations: nobody is so far from everybody's mean motion
MANY = 0.1  # share of doubted points from which it is asked whether those are right
DOUBTS = 3  # times at most that a segment is explained anew without the points that are far off
FEWEST = 4  # points that must be seen of a segment for an estimate of its own
TURN_SD = 0.7  # radians by which the heading changes in half a segment


def explanations(
    prior: SegmentPrior,
    seen: Observations,
    view: View,
    lengths: Floats,
    person: Person,
    update: Callable[[int], None] = lambda done: None,
) -> list[list[Explanation]]:
    """Explain every segment of a grid alone; none where next to nothing is seen.

    Parameters
    ----------
    seen : Observations
        Of the prior's markers on whole blocks of half a segment.
    lengths : (grid,)
        Metres of a unit of the picture.
    """
    half = prior.frames // 2
    found: list[list[Explanation]] = []
    for s in range(len(seen.uv) // half - 1):
        begin, end = s * half, s * half + prior.frames
        part = seen.part(begin, end)
        if part.seen.sum() < FEWEST:
            found.append([])
        else:
            found.append(_Segment(prior, part, view, lengths[begin:end], person).trusted())
        update(s + 1)
    return found


@dataclass(frozen=True)
class _Segment:
    """What is seen of a segment, and how."""

    prior: SegmentPrior
    seen: Observations
    view: View
    lengths: Floats
    person: Person

    def trusted(self) -> list[Explanation]:
        """Explain it by all points, then without those far from where the rest has them (`doubt`).

        Where wild points may have led the search astray it is made again, first while all points say less;
        the more probable explanation counts.
        """
        found, astray = self._doubting(self.seen)
        if not astray:
            return found
        other, _ = self._doubting(replace(self.seen, sd=ROUGH * self.seen.sd))
        return max(found, other, key=lambda each: each[0].posterior.log_evidence)

    def _doubting(self, points: Observations) -> tuple[list[Explanation], bool]:
        """Explain it by points, and again while that leaves others in doubt; and whether it went astray."""
        found, said = self._explained(points)
        for _ in range(DOUBTS):
            before, points = points, doubt.doubted(self.seen, said)
            if np.array_equal(points.sd > self.seen.sd, before.sd > self.seen.sd):
                break
            found, said = self._explained(points)
        return found, _astray(self.seen, points, said)

    def _explained(self, points: Observations) -> tuple[list[Explanation], Floats]:
        """Explanations by points, and where the first has them in the picture."""
        found = explain(self.prior, partial(self._rows, points), self.person)
        said = self.view.project(found[0].posterior.points, self.lengths)
        if not self.view.grounded:
            said = said + np.nanmedian(self.seen.uv - said, axis=(0, 1))
        return found, said

    def _rows(self, points: Observations, places: Floats) -> Rows:
        rows = self.view.rows(points, places, self.lengths)
        return rows if self.view.grounded else _centred(rows, places)


def _astray(seen: Observations, trusted: Observations, said: Floats) -> bool:
    """Whether an explanation leaves the points that it trusts far, or trusts too few."""
    misfit = np.mean(doubt.distances(trusted, said)[seen.seen] ** 2) / 2
    return bool(misfit > ASTRAY or np.mean((trusted.sd > seen.sd)[seen.seen]) > MANY)


def _centred(rows: Rows, places: Floats) -> Rows:
    """Rows of a picture shifted to where places (F, J, 3) are, as its height over the floor is not known."""
    return replace(rows, value=rows.value - rows.shifted(places).value.mean(axis=0))


def course(found: Sequence[Sequence[Explanation]]) -> list[Explanation]:
    """Choose one explanation of every segment: probable, and with headings that change little.

    Segments without any take that of the nearest one before or after.
    """
    known = [s for s, choices in enumerate(found) if choices]
    chosen = dict(zip(known, _course([found[s] for s in known]), strict=True))
    return [chosen[min(known, key=lambda k: abs(k - s))] for s in range(len(found))]


def _course(found: Sequence[Sequence[Explanation]]) -> list[Explanation]:
    """Choose among explanations of segments that all have some."""
    score = _evidence(found[0])
    back = []
    for before, now in zip(found, found[1:], strict=False):
        turn = np.subtract.outer([e.heading for e in now], [e.heading for e in before])
        turn = (turn + np.pi) % (2 * np.pi) - np.pi
        table = score - 0.5 * (turn / TURN_SD) ** 2
        back.append(table.argmax(axis=1))
        # segments overlap by half: what one says is half known from its neighbour
        score = table.max(axis=1) + 0.5 * _evidence(now)
    chosen = [int(score.argmax())]
    for best in reversed(back):
        chosen.append(int(best[chosen[-1]]))
    return [choices[i] for choices, i in zip(found, reversed(chosen), strict=True)]


def _evidence(choices: Sequence[Explanation]) -> Floats:
    return np.log(np.maximum([e.share for e in choices], 1e-300))
