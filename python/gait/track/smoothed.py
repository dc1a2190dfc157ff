"""What `gait.track.smooth` draws, as estimates and as motions of joints."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.library import check, library
from gait.bindings.model import Model
from gait.bindings.state import Array, State
from gait.body.model_curves import ModelCurves
from gait.io.video import Frame
from gait.motion.footfall_draws import Draws
from gait.track.smooth import Spool, draw_motions
from gait.track.tracker import Tracker
from gait.track.transitions import Transitions, wrap

MOTIONS = 100
_NOTHING = np.empty((0, 0, 3), np.uint8)

_NEAR = (0.15, 0.5)  # strides and radians around a mode, as in estimate.c
_TOLD = 0.01  # share of the size to which pictures tell it, as in estimate.c
_SURE = 0.7  # least mass of the mode under `tracking`


class Smoother:
    """Keeps what a tracker believes after each frame; at the end gives estimates that know all frames.

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
        self._seen: list[tuple[Frame, Estimate]] = []

    def __enter__(self) -> Smoother:
        self._spool.__enter__()
        return self

    def __exit__(self, *exc: object) -> None:
        self._spool.__exit__(None, None, None)

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Take in a frame, whose picture is not kept, after the tracker's step."""
        self._seen.append((frame._replace(image=_NOTHING), estimate))
        self._spool.add(self._tracker, estimate)

    def __len__(self) -> int:
        return len(self._seen)

    def finish(
        self, count: int = MOTIONS, update: Callable[[int], None] = lambda done: None
    ) -> tuple[list[tuple[Frame, Estimate]], Draws]:
        """Draw `count` motions; return the frames with smoothed estimates, and the motions."""
        model, seed = self._tracker.model, self._tracker.config.seed
        tables = draw_motions(self._spool, self._transitions, count, seed, update)
        shape = tables.shape[:2]
        states = self._transitions.states(tables.reshape(-1, tables.shape[2])).reshape(shape)
        joints, angles = pose_all(model, states)
        frames = [frame for frame, _ in self._seen]
        rows = [
            (frame, self._widened(i, smoothed(estimate, model, states[:, i], joints[:, i], angles[:, i])))
            for i, (frame, estimate) in enumerate(self._seen)
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
        """Add to a frame's deviations what no number of frames makes less, as estimate.c does.

        That is what the model cannot express and, of one camera, the size that its pictures leave in doubt.
        """
        tracker, doubt = self._tracker, self._spool.doubt[index]
        share, one_view = tracker.config.joint_sd_model, len(tracker.cameras) == 1
        size = _TOLD * doubt / np.hypot(_TOLD, doubt) if one_view and share > 0 else 0.0
        rays = size * (now.joints - tracker.cameras[0].centre)
        joint_sd = np.sqrt(now.joint_sd**2 + (share * now.mean.stature) ** 2 + rays**2)
        stature = float(np.hypot(now.sd.stature, size * now.mean.stature))
        return replace(now, joint_sd=joint_sd, sd=replace(now.sd, stature=stature, pelvis=joint_sd[0]))


def pose_all(model: Model, states: NDArray[np.void]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Joints (..., P, 3), metres, and angles (..., A), radians, of an array (...) of ``gait_state``."""
    flat = np.ascontiguousarray(states).reshape(-1)
    pose, pointer = abi.PoseC(), ctypes.POINTER(abi.StateC)
    joint, angle = np.ctypeslib.as_array(pose.joint), np.ctypeslib.as_array(pose.angle)
    joints = np.empty((len(flat), model.info.joints, 3), np.float32)
    angles = np.empty((len(flat), model.info.angles), np.float32)
    begin, size, call = flat.ctypes.data, flat.dtype.itemsize, library().gait_model_pose
    for i in range(len(flat)):
        check(call(model.handle, ctypes.cast(begin + i * size, pointer), ctypes.byref(pose)))
        joints[i], angles[i] = joint[: model.info.joints], angle[: model.info.angles]
    shape = states.shape
    return joints.reshape(*shape, *joints.shape[1:]), angles.reshape(*shape, *angles.shape[1:])


def smoothed(
    then: Estimate,
    model: Model,
    states: NDArray[np.void],
    joints: NDArray[np.float32],
    angles: NDArray[np.float32],
) -> Estimate:
    """One frame's estimate from the motions there: as the filter's, over motions in place of particles.

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
        mode_mass=mass,
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
    """Which states belong to the mode with most of them, and their share."""
    phase, heading = states["phase"].astype(float), states["heading"].astype(float)
    near = np.abs(wrap(phase[:, None] - phase, 1.0)) < _NEAR[0]
    near &= np.abs(wrap(heading[:, None] - heading, 2 * np.pi)) < _NEAR[1]
    use = near[np.argmax(near.sum(axis=1))]
    return use, float(use.mean())


def _circular(values: Array, use: NDArray[np.bool_], turn: float) -> tuple[float, float]:
    """Mean over the mode, and standard deviation over all, of values that repeat after `turn`."""
    unit = np.exp(2j * np.pi * values.astype(float) / turn)
    mean = (np.angle(unit[use].mean()) / (2 * np.pi)) % 1.0
    sd = np.sqrt(max(0.0, -2 * np.log(max(abs(unit.mean()), 1e-6)))) / (2 * np.pi)
    return float(mean * turn), float(sd * turn)


def _status(then: TrackStatus, mass: float) -> TrackStatus:
    """Leave what was lost lost; whether the modes are told apart is known better now."""
    if then == TrackStatus.LOST or (mass < _SURE and then == TrackStatus.INIT):
        return then
    return TrackStatus.TRACKING if mass >= _SURE else TrackStatus.AMBIGUOUS
