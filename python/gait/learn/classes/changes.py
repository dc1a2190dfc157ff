"""Changes between classes of motion in recordings: how often they happen, and at which phases.

A hidden Markov model whose states are a class and a phase explains the legs' angles and the forward speed of
each frame by the learnt curves and speeds; its most likely path (Viterbi) gives the class and phase of every
frame.  Assumed changes (`gait.learn.classes.run`) count as `PRIOR_CHANGES` of each kind.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.special import i0e, i1e, ndtr

from gait.body.model_curves import MOST_PACE_SDS
from gait.body.motion_classes import class_sections
from gait.body.skeleton import ANGLES, SIDES
from gait.io import blob
from gait.learn.arrays import Floats, Indices
from gait.learn.classes import standing
from gait.learn.classes.join import Change, Sections
from gait.learn.mocap.tables import AngleTable
from gait.learn.prior import model
from gait.learn.solve import retarget
from gait.learn.solve.body import Body

PRIOR_CHANGES = 2.0
"""Number of changes that an assumed rate, and an assumed phase, are worth."""
RATE = 30.0  # frames per second that are classified
PHASES = 60  # of a class that moves
JOINTS = tuple(ANGLES.index(f"{s}_{j}_flexion") for s in SIDES for j in ("hip", "knee", "ankle"))
INDEPENDENT = 1 / 6  # share of the frames that count, as errors persist for 0.2 s
FARTHEST = 9.0  # largest squared error in variances of one number, as people differ
ANGLE_SD = np.radians(5.0)  # of a person's joint from the learnt people, added to their own statistics
SPEED_SD = 0.35, 0.1  # relative, and statures per second
ADVANCES = np.arange(7)  # phases per frame; the usual is about 2
ADVANCE_SD = 0.35  # relative
SPEED_WINDOW_S = 0.2  # over which the pelvis's speed is averaged
LEAST_S = 0.3  # shorter stays in a class do not count
MOST_RATE, MOST_CONCENTRATION = 100.0, 50.0  # of the blob


@dataclass(frozen=True)
class Observed:
    """What recordings show about C classes."""

    seconds: Floats  #: (C,) in each class
    counts: Indices  #: (C, C) changes from class to class
    #: (C, C) sum of exp(4 pi i phase) over them, of the moving class; phases count modulo half a stride.
    phasors: npt.NDArray[np.complex128]

    def __add__(self, other: Observed) -> Observed:
        """Return what both show."""
        return Observed(
            self.seconds + other.seconds, self.counts + other.counts, self.phasors + other.phasors
        )


@dataclass(frozen=True)
class _Class:
    direction: int
    advance: float  #: usual phases per frame
    mean: Floats  #: (phases, 7) angles of `JOINTS` and speed
    sd: Floats  #: (phases, 7)


def frames_of(path: Path, read: Body | AngleTable) -> Floats:
    """Return angles of `JOINTS` and forward speed (statures/s), (T, 7) at `RATE`, NaN where missing.

    UserError if it has only angles, which show no speed.
    """
    body = standing.body_of(path, read)
    measures = retarget.measure(body)
    angles = retarget.observed_angles(body, measures)[:, JOINTS]
    ahead = body.pelvis[:, :2, 0] / np.linalg.norm(body.pelvis[:, :2, 0], axis=1, keepdims=True)
    half = max(1, round(0.5 * SPEED_WINDOW_S * read.fps))
    place = np.pad(body.joints["pelvis"][:, :2], ((half, half), (0, 0)), mode="edge")
    moved = place[2 * half :] - place[: -2 * half]
    span = np.minimum(np.arange(body.frames) + half, body.frames - 1)
    span = (span - np.maximum(np.arange(body.frames) - half, 0)) / read.fps
    speed = np.einsum("ti,ti->t", moved, ahead) / span / measures.stature
    at = np.arange(0, body.frames - 1, read.fps / RATE).round().astype(int)
    return np.column_stack([angles, speed])[at]


def _classes(sections: Sections) -> list[_Class]:
    found = []
    names = blob.unpack_names(sections["CHNM"])
    columns = [names.index(ANGLES[joint]) for joint in JOINTS]
    for k, direction in enumerate(np.asarray(sections["CLIN"], int)[:, 0]):
        own = class_sections(sections, k)
        curves = np.asarray(own["CURV"], float)[..., columns]
        statistics = np.asarray(own["CHST"], float)[columns]
        gait = np.asarray(own["GAIT"], float)
        variance = (curves[1:] ** 2).sum(axis=0) + statistics[:, 0] ** 2 + statistics[:, 3] ** 2 + ANGLE_SD**2
        at = np.arange(PHASES if direction else 1) * len(curves[0]) // (PHASES if direction else 1)
        speed = direction * gait[0] * gait[3]
        sd = np.hypot(SPEED_SD[0] * speed, SPEED_SD[1])
        mean = np.column_stack([curves[0][at], np.full(len(at), speed)])
        sds = np.column_stack([np.sqrt(variance[at]), np.full(len(at), sd)])
        found.append(_Class(int(direction), PHASES * gait[0] / RATE, mean, sds))
    return found


def _likelihood(one: _Class, frames: Floats) -> Floats:
    """Return the log-likelihood of each frame at each phase, (T, phases)."""
    total = np.zeros((len(frames), len(one.mean)))
    for column in range(frames.shape[1]):
        error = (frames[:, column, None] - one.mean[:, column]) / one.sd[:, column]
        each = -0.5 * np.minimum(error**2, FARTHEST) - np.log(one.sd[:, column])
        total += np.where(np.isfinite(error), each, 0.0)
    return INDEPENDENT * total


def _decoded(sections: Sections, frames: Floats) -> tuple[Indices, Floats]:
    """Return class and phase of each frame, (T,) each, on the most likely path.

    States are all phases of the first class, then those of the second, and so on.
    """
    classes = _classes(sections)
    first = np.cumsum([0, *(len(one.mean) for one in classes)])
    own = [slice(a, b) for a, b in pairwise(first)]
    emitted = np.concatenate([_likelihood(one, frames) for one in classes], axis=1)
    rates = np.array([
        [_mean_rate(_change(row), one.direction) for row in rows]
        for one, rows in zip(classes, sections["CLSW"], strict=True)
    ])  # fmt: skip
    with np.errstate(divide="ignore"):
        change = np.log(rates / RATE)
    score, back = emitted[0], np.zeros(emitted.shape, np.int32)
    for t in range(1, len(frames)):
        best = np.array([first[k] + score[part].argmax() for k, part in enumerate(own)])  # state by class
        after = np.empty_like(score)
        for k, part in enumerate(own):
            stay, source = _staying(classes[k], score[part])
            entries = score[best] + change[:, k] - np.log(len(stay))
            enters = entries.max() > stay
            after[part] = np.where(enters, entries.max(), stay)
            back[t, part] = np.where(enters, best[entries.argmax()], first[k] + source)
        score = after + emitted[t]
    path = np.empty(len(frames), int)
    path[-1] = score.argmax()
    for t in range(len(frames) - 1, 0, -1):
        path[t - 1] = back[t, path[t]]
    found = np.searchsorted(first, path, side="right") - 1
    return found, (path - first[found]) / PHASES


def _staying(one: _Class, score: Floats) -> tuple[Floats, Indices]:
    """Return the best score (phases,) of each phase after a frame in the same class, and the phase before."""
    here = np.arange(len(score))
    if not one.direction:
        return score, here
    sources = (here - one.direction * ADVANCES[:, None]) % PHASES
    pace = -0.5 * ((ADVANCES - one.advance) / (ADVANCE_SD * one.advance)) ** 2
    offers = score[sources] + INDEPENDENT * pace[:, None]
    chosen = offers.argmax(axis=0)
    return offers[chosen, here], sources[chosen, here]


def count(sections: Sections, frames: Floats) -> Observed:
    """Count the changes in one recording, which `frames_of` returned."""
    classes = len(sections["CLIN"])
    found, phase = _decoded(sections, frames)
    moves = np.asarray(sections["CLIN"])[:, 0] != 0
    starts = np.flatnonzero(np.diff(found, prepend=-1))
    lengths = np.diff([*starts, len(found)])
    stays = starts[lengths >= LEAST_S * RATE]
    result = Observed(
        np.bincount(found, minlength=classes) / RATE,
        np.zeros((classes, classes), int),
        np.zeros((classes, classes), complex),
    )
    for before, after in zip(stays, stays[1:], strict=False):
        i, j = found[before], found[after]
        if i != j:
            left = before + lengths[np.searchsorted(starts, before)] - 1
            result.counts[i, j] += 1
            result.phasors[i, j] += np.exp(4j * np.pi * phase[left if moves[i] else after])
    return result


def learnt(assumed: Change, direction: int, seconds: float, count: int, phasor: complex) -> Change:
    """Return a change as assumed and as observed together; `direction`: of the class that is left.

    The mean rate has a Gamma prior of `PRIOR_CHANGES` changes at the assumed mean rate; the phase adds to as
    many at the assumed phases.  The slope with the pace stays as assumed.
    """
    together = PRIOR_CHANGES * _sharpness(assumed.concentration) * np.exp(4j * np.pi * assumed.phase) + phasor
    length = min(abs(together) / (PRIOR_CHANGES + count), _sharpness(MOST_CONCENTRATION))
    concentration, phase = _concentration(length), (np.angle(together) / (4 * np.pi)) % 0.5
    change = Change(1.0, concentration, float(phase), assumed.slope)
    mean = (PRIOR_CHANGES + count) / (PRIOR_CHANGES / _mean_rate(assumed, direction) + seconds)
    return Change(
        min(mean / _mean_rate(change, direction), MOST_RATE), concentration, float(phase), assumed.slope
    )


def _change(row: Floats) -> Change:
    return Change(*(float(value) for value in row))


def _mean_rate(change: Change, direction: int) -> float:
    """Return the mean of the rate over phases and people's paces; the rate itself in a class without them."""
    if not direction:
        return change.rate
    return change.rate * float(i0e(change.concentration)) * _mean_of_paces(change.slope)


def _mean_of_paces(slope: float) -> float:
    """Return the mean of exp(slope u) over paces u, which are N(0, 1) clipped at `MOST_PACE_SDS`."""
    most = MOST_PACE_SDS
    inside = np.exp(0.5 * slope**2) * (ndtr(most - slope) - ndtr(-most - slope))
    return float(inside + ndtr(-most) * 2 * np.cosh(most * slope))


def _sharpness(concentration: float) -> float:
    """Length of the mean of unit vectors with this concentration (von Mises)."""
    return float(i1e(concentration) / i0e(concentration))


def _concentration(length: float) -> float:
    """Return the concentration whose `_sharpness` is `length`."""
    if length <= 0:
        return 0.0
    most = MOST_CONCENTRATION
    return (
        float(brentq(lambda k: _sharpness(k) - length, 0.0, most + 1)) if length < _sharpness(most) else most
    )


def with_numbers_of(sections: Sections, names: Collection[str]) -> Sections:
    """Return a model's sections with the numbers of changes between these classes only."""
    meta = blob.read_meta(sections)
    if "changes" not in meta:
        return sections
    kept = {
        name: one | {"to": {to: count for to, count in one["to"].items() if to in names}}
        for name, one in meta.pop("changes").items()
        if name in names
    }
    return {**sections, "META": model.meta_section(meta | ({"changes": kept} if kept else {}))}


def with_changes(sections: Sections, observed: Observed) -> dict[str, blob.Array]:
    """Return a model's sections with the changes of its classes as assumed and as observed together.

    `META` gets the numbers of changes and the seconds in each class.
    """
    changes = np.array(sections["CLSW"], np.float32)
    for i, (direction, *_) in enumerate(np.asarray(sections["CLIN"], int)):
        for j in np.flatnonzero(changes[i, :, 0]):
            one = learnt(
                _change(changes[i, j]),
                direction,
                observed.seconds[i],
                int(observed.counts[i, j]),
                observed.phasors[i, j],
            )
            changes[i, j] = one.rate, one.concentration, one.phase, one.slope
    names = blob.unpack_names(sections["CLNM"])
    meta = blob.read_meta(sections)
    counts = [
        {to: int(n) for to, n, rate in zip(names, row, rates, strict=True) if n or rate}
        for row, rates in zip(observed.counts, changes[:, :, 0], strict=True)
    ]
    meta["changes"] = {
        name: {"seconds": round(float(seconds), 1), "to": to}
        for name, seconds, to in zip(names, observed.seconds, counts, strict=True)
    }
    return {**sections, "CLSW": changes, "META": model.meta_section(meta)}
