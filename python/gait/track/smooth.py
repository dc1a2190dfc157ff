"""Smoothing: sample motions from the posterior of a whole clip, from its last frame back to the first.

Plain backward simulation (Godsill, Doucet and West 2004, JASA 99:156) picks for each frame one of the
filter's particles, by its weight and by the probability that it moves to the state already drawn for the next
frame. A state has 16 numbers that change little between frames, so hardly any particle but the true parent
fits: of 100 motions only 8 differed.  Therefore particles are picked with a wide kernel, and the remaining
difference is corrected by linear regression (as in Beaumont, Zhang and Balding 2002, Genetics 162:2025): with
pairs (x, x') of a particle and its drawn successor, and J = cov(x, x') cov(x')^-1, the state before s is x +
J (s - x').  For linear dynamics with normal noise this is exact for any kernel: it samples from the smoother
of Rauch, Tung and Striebel (1965).  The class of motion is drawn first (`gait.track.class_changes`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.state import State
from gait.io.video import Frame
from gait.motion.footfalls import Draws
from gait.track.class_changes import ClassChanges, Part
from gait.track.tracker import Tracker

Array = NDArray[np.float64]
Table = NDArray[np.floating[Any]]

PHASE_FIELD, HEADING_FIELD = 0, 3  # columns of a table, which are the numbers of a ``gait_state``

_PAIRS = 1000  # particles with successors, per frame
_KERNEL_WIDTH = 1.5  # of the kernel, standard deviations of the successors
_FEWEST = 4  # pairs for each number that varies, from which its regression is taken
_GROUP = (0.25, 0.8)  # strides and radians within which motions and particles belong together
_SAME_HYPOTHESIS = (0.15, 0.5)  # strides and radians around a hypothesis, as in estimate.c
_SIZE_SD = 0.01  # relative sd of the size that pictures determine at best, as in estimate.c
#: Share of the variance of the filter's phase that more frames do not reduce, because errors of the images
#: return with every stride, and the greatest sd of that phase, strides, if there is one hypothesis.
_LASTING_PHASE, _ONE_PHASE = 0.3, 0.05
#: Least weight of the dominant hypothesis with status `tracking`: DOMINANT_WEIGHT of estimate.h.
_DOMINANT_WEIGHT = 0.7
_CHECKED_S = 0.7  # seconds before a frame on which its checks rest: AVERAGE_TIME of fit_check.c


class Spool:
    """Pairs of every frame in a temporary file, so that memory does not grow with the clip.

    A pair is a particle, chosen by weight, and its state after the dynamics have moved it to the next frame.
    Use it in a ``with`` block, at the end of which the file is deleted.

    Parameters
    ----------
    seed : int
        Seed of the choice.
    """

    def __init__(self, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._size = 0
        self._last: tuple[NDArray[np.void], Estimate] | None = None  # states and estimate of the last frame
        self._chosen: list[_Record] = []  # for each frame
        self._moved: list[_Record | None] = []  # successors of the previous frame's; None at a start
        self._seconds: list[float] = []  # since the previous frame

    def __enter__(self) -> Spool:
        self._file = tempfile.TemporaryFile(prefix="gait-")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, tracker: Tracker, estimate: Estimate) -> None:
        """Store pairs after a step."""
        moved, seconds = None, 0.0
        if self._last is not None:
            before, then = self._last
            if estimate.frame == then.frame + 1:
                seconds = 1e-6 * (estimate.utime - then.utime)
                moved = self._put(tracker.predict(before, seconds))
        states, weights = tracker.particles()
        chosen = states[_pick(weights, _PAIRS, self._random)]
        self._last = chosen, estimate
        self._moved.append(moved)
        self._seconds.append(seconds)
        self._chosen.append(self._put(chosen))

    def __len__(self) -> int:
        return len(self._chosen)

    def read(self, index: int) -> tuple[Table, Table | None]:
        """Read a frame's states (N, columns) and their successors, which are None if the next is a start."""
        moved = self._moved[index + 1] if index + 1 < len(self) else None
        return self._get(self._chosen[index]), None if moved is None else self._get(moved)

    def seconds(self, index: int) -> float:
        """Return the time from a frame to the next."""
        return self._seconds[index + 1]

    def _put(self, states: NDArray[np.void]) -> _Record:
        table = _table(states)
        varying = (table != table[0]).any(axis=0)
        record = _Record(self._size, table[0], varying)
        self._size += self._file.write(table[:, varying].tobytes())
        return record

    def _get(self, record: _Record) -> Table:
        count = int(record.varying.sum())
        self._file.seek(record.offset)
        values = np.frombuffer(self._file.read(4 * count * _PAIRS), np.float32)
        table = np.tile(record.first, (_PAIRS, 1))
        table[:, record.varying] = values.reshape(_PAIRS, count)
        return table


class _Record(NamedTuple):
    """A table in the file of a spool: its offset, its first row, and the columns stored."""

    offset: int
    first: NDArray[np.float32]
    varying: NDArray[np.bool_]


def _table(states: NDArray[np.void]) -> Table:
    """View an array (N,) of ``gait_state`` as a table of its numbers (N, columns)."""
    return states.view(np.float32).reshape(len(states), -1)


def draw_motions(
    spool: Spool,
    count: int,
    seed: int,
    update: Callable[[int], None] = lambda done: None,
    changes: ClassChanges | None = None,
) -> Table:
    """Draw motions from the posterior given all frames.

    Parameters
    ----------
    spool : Spool
    count : int
        Number of motions, M.
    seed : int
        Seed of the random numbers.
    update : callable, optional
        Called with the number of frames done.
    changes : ClassChanges, optional
        Changes between classes of motion, if the model has several.

    Returns
    -------
    ndarray of shape (M, n, columns)
        Numbers of the states.
    """
    random = np.random.default_rng(seed)
    frames: list[Table] = []
    for i in range(len(spool) - 1, -1, -1):
        before, after = spool.read(i)
        if after is None:
            frames.append(before[random.permutation(_pick(np.ones(len(before)), count, random))])
        else:
            s, parts = frames[-1], [Part(np.arange(count), np.arange(len(before)))]
            if changes is not None:
                parts = list(changes.parts(before, s, spool.seconds(i), random))
            drawn = np.empty_like(s)
            for part in parts:
                pairs = before[part.pairs], after[part.pairs]
                for group in _groups(s[part.motions]):
                    these = part.motions[group]
                    drawn[these] = _before(*pairs, s[these], random, part.columns)
            frames.append(drawn)
        update(len(frames))
    out = np.stack(frames[::-1], axis=1)
    out[..., PHASE_FIELD] %= 1.0
    return out


def _before(
    before: Table,
    after: Table,
    s: Table,
    random: np.random.Generator,
    continuing: NDArray[np.bool_] | None = None,
) -> Array:
    """Draw a predecessor for each state of `s` (M, columns) from pairs of states and successors.

    `continuing` (columns,): numbers that do not change with the class of motion; None: all.
    """
    varying = (after != after[0]).any(axis=0)
    if continuing is not None:
        varying &= continuing
    columns = int(varying.sum())
    close = _near(after, s[0], by_phase=continuing is None or bool(continuing[PHASE_FIELD]))
    if close.sum() > _FEWEST * columns:
        before, after = before[close], after[close]
    # relative to one of the states, since phase and heading are angles
    gain, scatter = _regression(_difference(before, s[0])[:, varying], _difference(after, s[0])[:, varying])
    if len(after) <= _FEWEST * columns:  # of a rare class: the regression would extrapolate
        gain = np.eye(columns)
    root = np.linalg.cholesky(scatter)
    gap = _difference(s[:, None], after)[..., varying]  # (M, N, columns)
    distance = np.sum(np.linalg.solve(root, gap.reshape(len(s) * len(after), columns).T) ** 2, axis=0)
    logs = -0.5 * distance.reshape(len(s), len(after)) / _KERNEL_WIDTH**2
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    sums = np.cumsum(weights, axis=1)
    chosen = np.sum(sums < random.random((len(s), 1)) * sums[:, -1:], axis=1)
    chosen = np.minimum(chosen, len(after) - 1)
    out = before[chosen].astype(float)
    out[:, varying] += gap[np.arange(len(s)), chosen] @ gain.T
    out[:, HEADING_FIELD] = wrap(out[:, HEADING_FIELD], 2 * np.pi)
    return out


def _difference(a: Table, b: Table) -> Array:
    """Return a - b, with phase and heading wrapped to the shorter way."""
    out = np.subtract(a, b, dtype=float)
    out[..., PHASE_FIELD] = wrap(out[..., PHASE_FIELD], 1.0)
    out[..., HEADING_FIELD] = wrap(out[..., HEADING_FIELD], 2 * np.pi)
    return out


def wrap(x: Array, turn: float) -> Array:
    """Wrap to [-turn / 2, turn / 2)."""
    return np.asarray((x + turn / 2) % turn - turn / 2)


def _regression(b: Array, a: Array) -> tuple[Array, Array]:
    """Regress b on a: gain J (columns, columns), and the regularised covariance of a."""
    b, a = b - b.mean(axis=0), a - a.mean(axis=0)
    scatter = a.T @ a / len(a)
    scatter[np.diag_indices_from(scatter)] += 1e-6 * np.diag(scatter) + 1e-14
    return np.linalg.solve(scatter, a.T @ b / len(a)).T, scatter


def _near(states: Table, one: Table, by_phase: bool = True) -> NDArray[np.bool_]:
    """Which states are similar to `one` in heading and, if wanted, in phase."""
    phase = (np.abs(wrap(states[:, PHASE_FIELD] - one[PHASE_FIELD], 1.0)) < _GROUP[0]) | (not by_phase)
    return np.asarray(
        phase & (np.abs(wrap(states[:, HEADING_FIELD] - one[HEADING_FIELD], 2 * np.pi)) < _GROUP[1])
    )


def _groups(states: Table) -> list[NDArray[np.int64]]:
    """Group the indices of similar states, each group around its first member."""
    left = np.arange(len(states))
    groups = []
    while len(left):
        near = _near(states[left], states[left[0]])
        groups.append(left[near])
        left = left[~near]
    return groups


def _pick(weights: Table, count: int, random: np.random.Generator) -> NDArray[np.int64]:
    """Choose `count` particles by weight (systematic sampling), in order."""
    at = (random.random() + np.arange(count)) / count * weights.sum()
    return np.minimum(np.searchsorted(np.cumsum(weights), at, side="right"), len(weights) - 1)


DRAWN_MOTIONS = 100
_NOTHING = np.empty((0, 0, 3), np.uint8)


class Smoother:
    """Stores a tracker's particles after each frame, and at the end estimates each frame from all of them.

    Use it in a ``with`` block; it has a temporary file.

    Parameters
    ----------
    tracker : Tracker
    """

    def __init__(self, tracker: Tracker) -> None:
        self._tracker = tracker
        self._spool = Spool(tracker.config.seed)
        self._filtered: list[tuple[Frame, Estimate]] = []
        self._stature_sd: list[float] = []  # for each frame, at the start before it, as a fraction

    def __enter__(self) -> Smoother:
        self._spool.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        self._spool.__exit__(None, None, None)

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Add a frame after the tracker's step; its pictures are not kept."""
        others = tuple(view and view._replace(image=_NOTHING) for view in frame.others)
        self._filtered.append((frame._replace(image=_NOTHING, plate=None, others=others), estimate))
        self._stature_sd.append(self._tracker.start_stature_sd)
        self._spool.add(self._tracker, estimate)

    def __len__(self) -> int:
        return len(self._filtered)

    def finish(
        self, count: int = DRAWN_MOTIONS, update: Callable[[int], None] = lambda done: None
    ) -> tuple[list[tuple[Frame, Estimate]], Draws]:
        """Draw `count` motions; return the frames with smoothed estimates, and the motions."""
        model = self._tracker.model
        changes = ClassChanges(model.sections()) if model.info.classes > 1 else None
        tables = draw_motions(self._spool, count, self._tracker.config.seed, update, changes)
        states = tables.view(np.ctypeslib.as_array(abi.StateC()).dtype)[..., 0]
        joints, angles = model.poses(states)
        frames = [frame for frame, _ in self._filtered]
        rows = [
            (frame, self._widened(i, smoothed(estimate, model, states[:, i], joints[:, i], angles[:, i])))
            for i, (frame, estimate) in enumerate(with_later_checks(self._filtered))
        ]
        return rows, Draws(
            np.array([frame.number for frame in frames], np.int64),
            np.array([frame.time for frame in frames]),
            model.joint_names,
            model.angle_names,
            joints,
            angles,
            states["phase"].copy(),
        )

    def _widened(self, index: int, now: Estimate) -> Estimate:
        """Add to a frame's standard deviations the errors that more frames do not reduce, as estimate.c does.

        These are what the model cannot express, a part of the error of the phase and, with one camera, the
        uncertain size of the person.
        """
        tracker, start_sd = self._tracker, self._stature_sd[index]
        share, one_view = tracker.config.joint_sd_model, len(tracker.cameras) == 1
        size = _SIZE_SD * start_sd / np.hypot(_SIZE_SD, start_sd) if one_view and share > 0 else 0.0
        frame, then = self._filtered[index]
        ways = now.joints - frame.camera(tracker.cameras[0]).centre
        pose_variance = np.zeros((len(ways), 1))
        if frame.pose is not None:
            pose_variance = (
                frame.pose.turn_sd**2 * (ways**2).sum(axis=1, keepdims=True) + frame.pose.place_sd**2
            )
        joint_sd = np.sqrt(
            now.joint_sd**2 + (share * now.mean.stature) ** 2 + (size * ways) ** 2 + pose_variance
        )
        stature = float(np.hypot(now.sd.stature, size * now.mean.stature))
        lasting = np.sqrt(_LASTING_PHASE) * min(then.sd.phase, _ONE_PHASE) if share > 0 else 0.0
        phase = float(np.hypot(now.sd.phase, lasting))
        sd = replace(now.sd, phase=phase, stature=stature, pelvis=joint_sd[0])
        return replace(now, joint_sd=joint_sd, sd=sd)


def with_later_checks(filtered: Sequence[tuple[Frame, Estimate]]) -> list[tuple[Frame, Estimate]]:
    """Flag also the estimates before one that other bodies fit, as its checks rest on these frames.

    Parameters
    ----------
    filtered : sequence of (Frame, Estimate)
        Frames in order; an estimate with `frame` 0 is a start.

    Returns
    -------
    list of (Frame, Estimate)
    """
    out, flagged = [], np.inf  # time of the next frame that others fit
    for frame, estimate in reversed(filtered):
        flagged = frame.time if estimate.flags & Flag.OTHERS_FIT else flagged
        within = flagged - frame.time <= _CHECKED_S
        flags = estimate.flags | (Flag.OTHERS_FIT if within else 0)
        out.append((frame, replace(estimate, flags=flags)))
        flagged = np.inf if estimate.frame == 0 else flagged
    return out[::-1]


def smoothed(
    then: Estimate,
    model: Model,
    states: NDArray[np.void],
    joints: NDArray[np.float32],
    angles: NDArray[np.float32],
) -> Estimate:
    """Estimate a frame from the motions as the filter does from its particles.

    Parameters
    ----------
    then : Estimate
        The filter's estimate; its evidence and, if it is `lost`, its status are kept.
    model : Model
    states : ndarray of ``gait_state``, shape (M,)
    joints : ndarray of shape (M, P, 3)
    angles : ndarray of shape (M, A)
    """
    found = np.bincount(states["motion_class"], minlength=model.info.classes)
    same = states["motion_class"] == found.argmax()
    use, weight = _dominant(states, same)
    mean, sd = State(motion_class=int(found.argmax())), State()
    for name in ("stride_hz", "stature", "pitch", "roll", "turn_rate"):
        setattr(mean, name, float(states[name][use].mean()))
        setattr(sd, name, float(states[name].std()))
    mean.phase, sd.phase = _circular(states["phase"], use, 1.0)
    mean.heading, sd.heading = _circular(states["heading"], use, 2 * np.pi)
    mean.heading = float(wrap(np.array(mean.heading), 2 * np.pi))
    of_class = model.class_info(mean.motion_class)
    if of_class.direction == 0:
        mean.phase, sd.phase = then.mean.phase, then.sd.phase
    mean.pelvis, sd.pelvis = states["pelvis"][use].mean(axis=0), states["pelvis"].std(axis=0)
    for name, count in (
        ("coef", model.info.components),
        ("offset", model.info.angles),
        ("proportion", states["proportion"].shape[1]),
    ):
        values = states[name][:, :count].astype(float)
        setattr(mean, name, values[use].mean(axis=0))
        setattr(sd, name, values.std(axis=0))
    phase_r = float(np.abs(np.exp(2j * np.pi * states["phase"]).mean()))
    return replace(
        then,
        status=_status(then, weight),
        ess=float(len(states)),
        phase_r=phase_r,
        hypothesis_weight=weight,
        speed=_speed(then, model, mean),
        mean=mean,
        sd=sd,
        best=mean,
        joints=joints.mean(axis=0, dtype=float),
        joint_sd=joints.std(axis=0, dtype=float),
        angles=angles[use].mean(axis=0, dtype=float),
        motion_class=model.classes[mean.motion_class],
        class_probability=found / len(states),
    )


def _speed(then: Estimate, model: Model, now: State) -> float:
    """Speed along the ground, metres per second: that of the filter at another stature, rate or class."""
    pace = now.stature * now.stride_hz
    if now.motion_class == then.mean.motion_class:
        return then.speed * pace / (then.mean.stature * then.mean.stride_hz)
    info = model.class_info(now.motion_class)
    return abs(info.direction) * info.stride_length * pace


def _dominant(states: NDArray[np.void], same: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], float]:
    """Which states belong to the largest hypothesis of those that count, and its share of these."""
    phase, heading = states["phase"].astype(float), states["heading"].astype(float)
    near = np.abs(wrap(phase[:, None] - phase, 1.0)) < _SAME_HYPOTHESIS[0]
    near &= np.abs(wrap(heading[:, None] - heading, 2 * np.pi)) < _SAME_HYPOTHESIS[1]
    near &= same & same[:, None]
    use = near[np.argmax(near.sum(axis=1))]
    return use, float(use.sum() / same.sum())


def _circular(values: Array, use: NDArray[np.bool_], turn: float) -> tuple[float, float]:
    """Mean over the hypothesis, and standard deviation over all, of values with period `turn`."""
    unit = np.exp(2j * np.pi * values.astype(float) / turn)
    mean = (np.angle(unit[use].mean()) / (2 * np.pi)) % 1.0
    sd = np.sqrt(max(0.0, -2 * np.log(max(abs(unit.mean()), 1e-6)))) / (2 * np.pi)
    return float(mean * turn), float(sd * turn)


def _status(then: Estimate, weight: float) -> TrackStatus:
    """Decide the status of a smoothed frame from the filter's estimate and the dominant motions' weight.

    Lost frames stay lost.  The motions decide whether left and right are known, but all are of the filter's
    particles: if another body fitted the pictures as well, it still does.
    """
    sure = weight >= _DOMINANT_WEIGHT
    if then.status == TrackStatus.LOST or (not sure and then.status == TrackStatus.INIT):
        return then.status
    return TrackStatus.TRACKING if sure and not then.flags & Flag.OTHERS_FIT else TrackStatus.AMBIGUOUS
