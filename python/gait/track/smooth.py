"""Smoothing: sample motions from the posterior of a whole clip, from its last frame back to the first.

Plain backward simulation (Godsill, Doucet and West 2004, JASA 99:156) picks for each frame one of the
filter's particles, by its weight and by how well the state already drawn for the next frame follows from it.
A state has 16 numbers that change little between frames, so hardly any particle but the true parent fits: of
100 motions only 8 differed.  Therefore particles are picked by a wide kernel, and the remaining difference
is corrected by linear regression (as in Beaumont, Zhang and Balding 2002, Genetics 162:2025): with pairs (x,
x') of a particle and its drawn successor and J = cov(x, x') cov(x')^-1, the state before s is x + J (s -
x').  For linear dynamics with normal noise this is exact for any kernel: it samples from the smoother of
Rauch, Tung and Striebel (1965).
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import Mode, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model
from gait.bindings.state import State
from gait.body.model_curves import ModelCurves
from gait.io.video import Frame
from gait.motion.footfalls import Draws
from gait.track.tracker import Tracker
from gait.track.transitions import HEADING, PHASE, Step, Transitions, wrap

Array = NDArray[np.float64]

_PAIRS = 1000  # particles with successors, per frame
_WIDTH = 1.5  # of the kernel, in standard deviations of the successors
_GROUP = (0.25, 0.8)  # strides and radians within which motions and particles belong together
_NEAR = (0.15, 0.5)  # strides and radians around a hypothesis, as in estimate.c
_SIZE_SD = 0.01  # share to which pictures determine the size, as in estimate.c
_SURE = 0.7  # least mass of the hypothesis under `tracking`


class Spool:
    """Particles of every frame in a temporary file, so that memory does not grow with the clip.

    Use it in a ``with`` block; the file goes with it.

    Parameters
    ----------
    transitions : Transitions

    Attributes
    ----------
    utime, step : list of int
        Capture time and steps since start of each frame.
    stature_sd : list of float
        Standard deviation of the stature at the start that each frame follows, as a fraction of it.
    """

    def __init__(self, transitions: Transitions) -> None:
        self._transitions = transitions
        self._rows: list[tuple[int, int]] = []  # offset and count of each frame
        self._size = 0
        self.utime: list[int] = []
        self.step: list[int] = []
        self._known: list[int] = []
        self.stature_sd: list[float] = []

    def __enter__(self) -> Spool:
        self._file = tempfile.TemporaryFile(prefix="gait-")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, tracker: Tracker, estimate: Estimate) -> None:
        """Keep the particles after a step."""
        states, weights = tracker.particles()
        table = np.column_stack([self._transitions.table(states), weights]).astype(np.float32)
        self._rows.append((self._size, len(table)))
        self._size += self._file.write(table.tobytes())
        self.utime.append(estimate.utime)
        self._known.append(self._known_since(estimate))
        self.stature_sd.append(tracker.start_stature_sd)
        self.step.append(estimate.frame)

    def _known_since(self, estimate: Estimate) -> int:
        """Index of the frame from which on phase, left and right are known; -1 if they are not.

        A track that becomes ambiguous later is still known: a new start would have status ``init``.
        """
        now = len(self._known)
        goes_on = now > 0 and estimate.frame == self.step[now - 1] + 1
        before = self._known[-1] if goes_on else -1
        paper = self._transitions.config.mode == Mode.PAPER
        if estimate.status == TrackStatus.INIT and not paper:
            return -1
        settled = estimate.status == TrackStatus.TRACKING or paper and estimate.status != TrackStatus.LOST
        return now if before < 0 and settled else before

    def __len__(self) -> int:
        return len(self._rows)

    def read(self, index: int) -> tuple[Array, Array]:
        """States (N, columns) and weights (N,) of a frame."""
        offset, count = self._rows[index]
        columns = self._transitions.columns + 1
        self._file.seek(offset)
        table = np.frombuffer(self._file.read(4 * count * columns), np.float32).reshape(count, columns)
        return table[:, :-1].astype(float), table[:, -1].astype(float)

    def step_to(self, index: int) -> Step | None:
        """Return the interval that ends at a frame; None at a start."""
        since = self.step[index]
        if index == 0 or since != self.step[index - 1] + 1:
            return None
        known = self._known[index - 1]
        settle_time = 1e6 * self._transitions.config.settle_time
        age = self.utime[index] - self.utime[known] if known >= 0 else 0
        return Step(
            1e-6 * (self.utime[index] - self.utime[index - 1]),
            age < settle_time,
            age > 0,
            self.stature_sd[index],
        )


def draw_motions(
    spool: Spool,
    transitions: Transitions,
    count: int,
    seed: int,
    update: Callable[[int], None] = lambda done: None,
) -> Array:
    """Draw motions from the posterior given all frames.

    Parameters
    ----------
    spool : Spool
        Filled by a tracker from its start on; a new start within it begins motions of its own.
    transitions : Transitions
    count : int
        How many motions, M.
    seed : int
        Of the random numbers.
    update : callable, optional
        Called with the number of frames done.

    Returns
    -------
    ndarray of shape (M, n, columns)
        Tables of states, see `Transitions.states`.
    """
    frames = len(spool)
    random = np.random.default_rng(seed)
    out = np.empty((count, frames, transitions.columns))
    for i in range(frames - 1, -1, -1):
        states, weights = spool.read(i)
        step = spool.step_to(i + 1) if i + 1 < frames else None
        if step is None:
            out[:, i] = states[_pick(weights, count, random)]
        else:
            before = states[_pick(weights, _PAIRS, random)]
            after = transitions.move(before, step, random)
            for these in _groups(out[:, i + 1]):
                out[these, i] = _before(transitions, before, after, out[these, i + 1], random)
        update(frames - i)
    out[..., PHASE] %= 1.0
    return out


def _before(t: Transitions, before: Array, after: Array, s: Array, random: np.random.Generator) -> Array:
    """Draw a predecessor of each state of `s` (M, columns) from pairs of states and successors."""
    close = _near(after, s[0])
    if close.sum() > 4 * t.columns:
        before, after = before[close], after[close]
    a = t.difference(after, s[0])  # all relative to one of the states: phase and heading are angles
    b = t.difference(before, s[0])
    gain, scatter = _regression(b, a)
    root = np.linalg.cholesky(scatter)
    gap = t.difference(s[:, None], after)  # (M, N, columns)
    distance = np.sum(np.linalg.solve(root, gap.reshape(-1, t.columns).T) ** 2, axis=0)
    logs = -0.5 * distance.reshape(len(s), -1) / _WIDTH**2
    weights = np.exp(logs - logs.max(axis=1, keepdims=True))
    sums = np.cumsum(weights, axis=1)
    chosen = np.sum(sums < random.random((len(s), 1)) * sums[:, -1:], axis=1)
    chosen = np.minimum(chosen, len(after) - 1)
    out = before[chosen] + gap[np.arange(len(s)), chosen] @ gain.T
    out[:, HEADING] = wrap(out[:, HEADING], 2 * np.pi)
    return np.asarray(out)


def _regression(b: Array, a: Array) -> tuple[Array, Array]:
    """Gain J (columns, columns) of b on a, and the covariance of a, made regular."""
    b, a = b - b.mean(axis=0), a - a.mean(axis=0)
    scatter = a.T @ a / len(a)
    scatter[np.diag_indices_from(scatter)] += 1e-6 * np.diag(scatter) + 1e-14
    return np.linalg.solve(scatter, a.T @ b / len(a)).T, scatter


def _near(states: Array, one: Array) -> NDArray[np.bool_]:
    """Which states are similar to `one` in phase and heading."""
    phase = np.abs(wrap(states[:, PHASE] - one[PHASE], 1.0)) < _GROUP[0]
    return np.asarray(phase & (np.abs(wrap(states[:, HEADING] - one[HEADING], 2 * np.pi)) < _GROUP[1]))


def _groups(states: Array) -> list[NDArray[np.int64]]:
    """Group the indices of similar states, each group around its first."""
    left = np.arange(len(states))
    groups = []
    while len(left):
        near = _near(states[left], states[left[0]])
        groups.append(left[near])
        left = left[~near]
    return groups


def _pick(weights: Array, count: int, random: np.random.Generator) -> NDArray[np.int64]:
    """Choose `count` particles by weight (systematic), in random order."""
    at = (random.random() + np.arange(count)) / count * weights.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), at, side="right"), len(weights) - 1)
    return random.permutation(chosen)


MOTIONS = 100
_NOTHING = np.empty((0, 0, 3), np.uint8)


class Smoother:
    """Keeps the particles of a tracker after each frame; at the end estimates each frame from all of them.

    Use it in a ``with`` block; it keeps a temporary file.

    Parameters
    ----------
    tracker : Tracker
    curves : ModelCurves
        Of its model.
    """

    def __init__(self, tracker: Tracker, curves: ModelCurves) -> None:
        self._tracker = tracker
        self._transitions = Transitions(curves, tracker.config)
        self._spool = Spool(self._transitions)
        self._filtered: list[tuple[Frame, Estimate]] = []

    def __enter__(self) -> Smoother:
        self._spool.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        self._spool.__exit__(None, None, None)

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Take in a frame, whose picture is not kept, after the tracker's step."""
        self._filtered.append((frame._replace(image=_NOTHING), estimate))
        self._spool.add(self._tracker, estimate)

    def __len__(self) -> int:
        return len(self._filtered)

    def finish(
        self, count: int = MOTIONS, update: Callable[[int], None] = lambda done: None
    ) -> tuple[list[tuple[Frame, Estimate]], Draws]:
        """Draw `count` motions; return the frames with smoothed estimates, and the motions."""
        model, seed = self._tracker.model, self._tracker.config.seed
        tables = draw_motions(self._spool, self._transitions, count, seed, update)
        shape = tables.shape[:2]
        states = self._transitions.states(tables.reshape(-1, tables.shape[2])).reshape(shape)
        joints, angles = model.poses(states)
        frames = [frame for frame, _ in self._filtered]
        rows = [
            (frame, self._widened(i, smoothed(estimate, model, states[:, i], joints[:, i], angles[:, i])))
            for i, (frame, estimate) in enumerate(self._filtered)
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
        """Add to a frame's standard deviations what no number of frames reduces, as estimate.c does.

        That is what the model cannot express and, with one camera, the uncertain size of the person.
        """
        tracker, start_sd = self._tracker, self._spool.stature_sd[index]
        share, one_view = tracker.config.joint_sd_model, len(tracker.cameras) == 1
        size = _SIZE_SD * start_sd / np.hypot(_SIZE_SD, start_sd) if one_view and share > 0 else 0.0
        rays = size * (now.joints - tracker.cameras[0].centre)
        joint_sd = np.sqrt(now.joint_sd**2 + (share * now.mean.stature) ** 2 + rays**2)
        stature = float(np.hypot(now.sd.stature, size * now.mean.stature))
        return replace(now, joint_sd=joint_sd, sd=replace(now.sd, stature=stature, pelvis=joint_sd[0]))


def smoothed(
    then: Estimate,
    model: Model,
    states: NDArray[np.void],
    joints: NDArray[np.float32],
    angles: NDArray[np.float32],
) -> Estimate:
    """Estimate a frame from the motions, as the filter does from its particles.

    Parameters
    ----------
    then : Estimate
        Of the filter; its evidence and, where it was lost, its status stay.
    model : Model
    states : ndarray of ``gait_state``, shape (M,)
    joints : ndarray of shape (M, P, 3)
    angles : ndarray of shape (M, A)
    """
    use, mass = _dominant(states)
    mean, sd = State(coef=np.zeros(model.info.components), offset=np.zeros(model.info.angles)), State()
    for name in ("stride_hz", "stature", "pitch", "roll", "turn_rate"):
        setattr(mean, name, float(states[name][use].mean()))
        setattr(sd, name, float(states[name].std()))
    mean.phase, sd.phase = _circular(states["phase"], use, 1.0)
    mean.heading, sd.heading = _circular(states["heading"], use, 2 * np.pi)
    mean.heading = float(wrap(np.array(mean.heading), 2 * np.pi))
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
        status=_status(then.status, mass),
        ess=float(len(states)),
        phase_r=phase_r,
        hypothesis_weight=mass,
        speed=then.speed * _pace(then.mean, mean),
        mean=mean,
        sd=sd,
        best=mean,
        joints=joints.mean(axis=0, dtype=float),
        joint_sd=joints.std(axis=0, dtype=float),
        angles=angles[use].mean(axis=0, dtype=float),
    )


def _pace(then: State, now: State) -> float:
    """How the speed changes with stature and stride rate."""
    return now.stature * now.stride_hz / (then.stature * then.stride_hz)


def _dominant(states: NDArray[np.void]) -> tuple[NDArray[np.bool_], float]:
    """Which states belong to the largest hypothesis, and their share."""
    phase, heading = states["phase"].astype(float), states["heading"].astype(float)
    near = np.abs(wrap(phase[:, None] - phase, 1.0)) < _NEAR[0]
    near &= np.abs(wrap(heading[:, None] - heading, 2 * np.pi)) < _NEAR[1]
    use = near[np.argmax(near.sum(axis=1))]
    return use, float(use.mean())


def _circular(values: Array, use: NDArray[np.bool_], turn: float) -> tuple[float, float]:
    """Mean over the hypothesis, and standard deviation over all, of values that repeat after `turn`."""
    unit = np.exp(2j * np.pi * values.astype(float) / turn)
    mean = (np.angle(unit[use].mean()) / (2 * np.pi)) % 1.0
    sd = np.sqrt(max(0.0, -2 * np.log(max(abs(unit.mean()), 1e-6)))) / (2 * np.pi)
    return float(mean * turn), float(sd * turn)


def _status(then: TrackStatus, mass: float) -> TrackStatus:
    """Status of a smoothed frame: lost frames stay lost, ambiguity is judged anew from the motions."""
    if then == TrackStatus.LOST or (mass < _SURE and then == TrackStatus.INIT):
        return then
    return TrackStatus.TRACKING if mass >= _SURE else TrackStatus.AMBIGUOUS
