"""Estimate of a tracker after a frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gait.bindings import abi
from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.model import Model, pose_arrays
from gait.bindings.state import Array, State


@dataclass(frozen=True)
class Estimate:
    """Estimate of the tracker after a frame.

    Attributes
    ----------
    utime : int
        Capture time, microseconds.
    frame : int
        Steps since start.
    status : TrackStatus
    flags : Flag
    log_evidence : float
        log p(frame | past), up to a constant.
    ess : float
        Effective number of particles.
    phase_r : float
        Certainty of the phase: length of the mean of unit vectors at the particles' phases, [0, 1].
    hypothesis_weight : float
        Weight of the dominant left/right hypothesis, [0, 1].
    speed : float
        Metres per second along the ground; 0 if the most probable class stands.
    mean, sd, best : State
        Mean of the dominant hypothesis; standard deviations over all particles; the heaviest particle.
    joints : ndarray of shape (P, 3)
        Posterior mean of the joints in the world, metres.
    joint_sd : ndarray of shape (P, 3)
        Posterior standard deviation, metres.
    angles : ndarray of shape (A,)
        Radians, of the dominant hypothesis.
    joint_names : tuple of str
        Names of the P joints.
    reason : str
        Why whole-clip checks made this estimate ambiguous, in words; empty if the tracker itself decided.
    motion_class : str
        Name of the most probable class of motion, to which `mean` belongs.
    class_probability : ndarray of shape (C,)
        Probability of each of `Model.classes`.
    """

    utime: int
    frame: int
    status: TrackStatus
    flags: Flag
    log_evidence: float
    ess: float
    phase_r: float
    hypothesis_weight: float
    speed: float
    mean: State
    sd: State
    best: State
    joints: Array
    joint_sd: Array
    angles: Array
    joint_names: tuple[str, ...]
    reason: str = ""
    motion_class: str = "walk"
    class_probability: Array = field(default_factory=lambda: np.ones(1))

    @property
    def takes_strides(self) -> bool:
        """Whether phase and stride rate mean anything: not in a class that stands, nor if they are NaN."""
        return self.speed != 0 and not np.isnan(self.mean.phase)  # only a class that stands has no speed

    def joint(self, name: str) -> Array:
        """Position of one joint in the world, shape (3,), metres; ValueError unless the model has it."""
        if name not in self.joint_names:
            raise ValueError(f"joint {name!r}: unknown; give one of {' '.join(self.joint_names)}")
        return np.asarray(self.joints[self.joint_names.index(name)])

    @staticmethod
    def from_c(c: abi.EstimateC, model: Model) -> Estimate:
        """Copy a ``gait_estimate``."""
        info = model.info
        joints, angles = pose_arrays(c.pose, info.joints, info.angles)
        return Estimate(
            utime=c.utime,
            frame=c.frame,
            status=TrackStatus(c.status),
            flags=Flag(c.flags),
            log_evidence=c.log_evidence,
            ess=c.ess,
            phase_r=c.phase_r,
            hypothesis_weight=c.hypothesis_weight,
            speed=c.speed,
            mean=State.from_c(c.mean, info.components, info.angles),
            sd=State.from_c(c.sd, info.components, info.angles),
            best=State.from_c(c.best, info.components, info.angles),
            joints=joints,
            joint_sd=np.array(c.joint_sd, float)[: info.joints],
            angles=angles,
            joint_names=model.joint_names,
            motion_class=model.classes[c.motion_class],
            class_probability=np.array(c.class_probability, float)[: info.classes],
        )
