"""The automatic start: hypotheses of where a person is and how they walk, from one second of observations."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.bindings.frame import FrameKeypoints, image_view, keypoint_array
from gait.bindings.library import call, library, make
from gait.bindings.model import Model, pose_c
from gait.bindings.state import State
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.io.video import Image


@dataclass(frozen=True)
class Box:
    """A person who stands on the floor in full view, in pixels as captured.

    Attributes
    ----------
    foot, head : ndarray of shape (2,)
        Lowest point of the feet, and crown, both at the middle of the body.
    sd : float
        Standard deviation of each of these coordinates.
    """

    foot: NDArray[np.float64]
    head: NDArray[np.float64]
    sd: float

    @property
    def tall(self) -> float:
        """Height in the image, pixels."""
        return float(np.hypot(*(self.foot - self.head)))


@dataclass(frozen=True)
class Hypothesis:
    """One result of the automatic start.

    Attributes
    ----------
    mean, sd : State
        Normal distributions at the time asked for.
    speed, speed_sd : float
        In the direction of the class of motion (against the heading if it is backwards), metres per second.
    probability : float
        Relative to all hypotheses found.
    chi2_per_observation : float
        Robust squared error per coordinate, in standard deviations; about 1 if the model fits.
    in_place : bool
        The person stays in place, as on a treadmill.
    walks : bool
        The hypothesis is a walk and fits the observations well enough to start a track.
    correlation : ndarray of shape (6, 6)
        Of phase, stride rate, stature, heading, and the pelvis's x and y; other fields are independent.
    """

    mean: State
    sd: State
    speed: float
    speed_sd: float
    probability: float
    chi2_per_observation: float
    in_place: bool
    walks: bool
    correlation: NDArray[np.float64]

    def to_c(self) -> abi.HypothesisC:
        """Make a ``gait_hypothesis``."""
        c = abi.HypothesisC(
            mean=self.mean.to_c(),
            sd=self.sd.to_c(),
            speed=self.speed,
            speed_sd=self.speed_sd,
            probability=self.probability,
            chi2_per_observation=self.chi2_per_observation,
            in_place=self.in_place,
        )
        for row, values in zip(c.correlation, self.correlation.tolist(), strict=True):
            row[:] = values
        return c


class StartFit:
    """Fits a walk to keypoints of one person, or to boxes around people (``gait_start.h``).

    Parameters
    ----------
    model : Model
    camera : Camera
        Calibrated; if it moves, see `set_pose`.
    stature, stature_sd : float, optional
        Of the person, metres; by default those of the model's adults.
    box_time : float, optional
        Seconds that the boxes of a person must cover.

    Raises
    ------
    GaitError
        If the model has no cyclic part, or a number is out of range.
    """

    def __init__(
        self,
        model: Model,
        camera: Camera,
        *,
        stature: float | None = None,
        stature_sd: float | None = None,
        box_time: float | None = None,
    ) -> None:
        self._model, self._camera, config = model, camera, abi.StartConfigC()
        library().gait_start_fill(config, ctypes.sizeof(config))
        config.camera = camera.to_c()
        config.stature = config.stature if stature is None else stature
        config.stature_sd = config.stature_sd if stature_sd is None else stature_sd
        config.box_time = config.box_time if box_time is None else box_time
        self._handle, self._memory = make("start", model.handle, config)

    def set_pose(self, pose: CameraPose) -> None:
        """Set the camera's pose in the frames and boxes added from now on."""
        call("gait_start_set_pose", self._handle, pose_c(pose))

    def add(self, utime: int, keypoints: FrameKeypoints) -> None:
        """Add the keypoints of one frame; the time, microseconds, must increase."""
        call("gait_start_add", self._handle, utime, keypoint_array(keypoints, self._model.joint_names))

    def add_boxes(self, utime: int, boxes: Sequence[Box]) -> None:
        """Add boxes around the people in one frame, the most certain first; the time must increase.

        Boxes that make a person shorter than 1.2 m or taller than 2.4 m are left out.
        """
        call("gait_start_add_boxes", self._handle, utime, _boxes_c(boxes), len(boxes))

    def find_boxes(self, image: Image, background: Image) -> list[Box]:
        """Find people-sized regions that differ from the empty scene, the largest first."""
        found, count = (abi.BoxC * abi.MAX_PEOPLE)(), ctypes.c_int32()
        views = [image_view(picture, self._camera, "frame") for picture in (image, background)]
        call("gait_start_find_boxes", self._handle, *views, found, len(found), count)
        return [Box(np.array(c.foot), np.array(c.head), c.sd) for c in found[: count.value]]

    def other_scene(self, image: Image, background: Image) -> bool:
        """Whether half of an image differs from the background: another scene, or the camera has moved."""
        other = ctypes.c_int32()
        views = [image_view(picture, self._camera, "frame") for picture in (image, background)]
        call("gait_start_other_scene", self._handle, *views, other)
        return bool(other.value)

    def stature(self, box: Box) -> float:
        """Compute the stature of the person in a box, metres; NaN if the camera sees no floor at the feet."""
        found = ctypes.c_float()
        call("gait_start_box_stature", self._handle, _boxes_c([box]), found)
        return found.value

    def reset(self) -> None:
        """Forget all frames added."""
        library().gait_start_reset(self._handle)

    def solve(self, utime: int) -> list[Hypothesis]:
        """Fit the frames added; return hypotheses for a time, microseconds, the most probable first.

        Raises
        ------
        GaitError
            If too few frames show hips and ankles (at least four over 0.3 s are needed) or a box of one
            person (at least eight over `box_time`), or nothing fits.
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
            bool(library().gait_hypothesis_walks(c)),
            np.array(c.correlation, float),
        )


def _boxes_c(boxes: Sequence[Box]) -> ctypes.Array[abi.BoxC]:
    found = (abi.BoxC * max(len(boxes), 1))()
    for c, box in zip(found, boxes, strict=False):
        c.foot[:], c.head[:], c.sd = box.foot.tolist(), box.head.tolist(), box.sd
    return found
