"""The automatic start: hypotheses of where a person is and how they walk, from a second of keypoints."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

from gait.bindings import abi
from gait.bindings.frame import FrameKeypoints, keypoint_array
from gait.bindings.library import call, library, make
from gait.bindings.model import Model, camera_c
from gait.bindings.state import State
from gait.camera.camera import Camera


@dataclass(frozen=True)
class Hypothesis:
    """One answer of the automatic start.

    Attributes
    ----------
    mean, sd : State
        Independent normals at the time asked for.
    speed, speed_sd : float
        Along the heading, metres per second.
    probability : float
        Among the hypotheses found.
    chi2_per_observation : float
        Robust squared error per coordinate, in standard deviations; about 1 if the model fits.
    in_place : bool
        The person walks in place, as on a treadmill.
    """

    mean: State
    sd: State
    speed: float
    speed_sd: float
    probability: float
    chi2_per_observation: float
    in_place: bool


class StartFit:
    """Fits the cyclic model to keypoints of one person, in memory of fixed size (``gait_start.h``).

    Parameters
    ----------
    model : Model
    camera : Camera
        Calibrated; it must not move.
    stature, stature_sd : float, optional
        Of the person, metres; the model's adults if left out.

    Raises
    ------
    GaitError
        If the model has no cyclic part, or a number is out of its range.
    """

    def __init__(
        self, model: Model, camera: Camera, *, stature: float | None = None, stature_sd: float | None = None
    ) -> None:
        self._model, config = model, abi.StartConfigC()
        library().gait_start_fill(config, ctypes.sizeof(config))
        config.camera = camera_c(camera)
        config.stature = config.stature if stature is None else stature
        config.stature_sd = config.stature_sd if stature_sd is None else stature_sd
        self._handle, self._memory = make("start", model.handle, config)

    def add(self, utime: int, keypoints: FrameKeypoints) -> None:
        """Add the keypoints of one frame; the time, microseconds, must increase."""
        call("gait_start_add", self._handle, utime, keypoint_array(keypoints, self._model.joint_names))

    def reset(self) -> None:
        """Forget the frames."""
        library().gait_start_reset(self._handle)

    def solve(self, utime: int) -> list[Hypothesis]:
        """Fit the frames added and give hypotheses for a time, microseconds, the most probable first.

        Raises
        ------
        GaitError
            If too few frames show hips and ankles (four or more over 0.3 s are needed), or nothing fits.
        """
        found, count = (abi.HypothesisC * abi.MAX_HYPOTHESES)(), ctypes.c_int32()
        call("gait_start_solve", self._handle, utime, found, abi.MAX_HYPOTHESES, count)
        return [self._hypothesis(c) for c in found[: count.value]]

    def _hypothesis(self, c: abi.HypothesisC) -> Hypothesis:
        sizes = self._model.info.components, self._model.info.angles
        return Hypothesis(
            State.from_c(c.mean, *sizes),
            State.from_c(c.sd, *sizes),
            c.speed,
            c.speed_sd,
            c.probability,
            c.chi2_per_observation,
            bool(c.in_place),
        )
