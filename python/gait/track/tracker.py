"""Track a person through frames: a particle filter over the states of a walking model (Ormoneit 2000)."""

from __future__ import annotations

import ctypes
import re
import time
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.bindings.config import TrackerConfig
from gait.bindings.estimate import Estimate
from gait.bindings.frame import FrameKeypoints, capture_time, image_view, keypoint_array, per_camera
from gait.bindings.library import aligned, call, library, make
from gait.bindings.model import Model, pose_c
from gait.bindings.start_fit import Hypothesis
from gait.bindings.state import LEAST_STATURE, State
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.errors import GaitError, UserError
from gait.io.video import Image
from gait.track.tasks import PythonTasks, Runner, TaskSource, threads


class Tracker:
    """Particle filter with fixed memory.

    Parameters
    ----------
    model : Model
    cameras : Camera or sequence of Camera
    config : TrackerConfig, optional
        By default the library's defaults.
    background : image, or sequence of image or None, optional
        Empty scene seen by each camera; copied.
    tasks : int, callable or TaskSource
        Number of threads; or a callable that runs tasks (see `gait.track.tasks.Runner`); or a pool.

    Attributes
    ----------
    memory_bytes, isa : int, str
        Size of the memory that the filter uses; the instruction set: scalar, base, sse4, avx2 or avx512.
    step_seconds : float
        Time that the last `step` spent in the C library.
    start_stature_sd : float
        Standard deviation of the stature at the last start, as a fraction of it.

    Notes
    -----
    The same input, configuration and seed give the same bits for any `tasks`.
    """

    def __init__(
        self,
        model: Model,
        cameras: Camera | Sequence[Camera],
        config: TrackerConfig | None = None,
        *,
        background: Image | Sequence[Image | None] | None = None,
        tasks: int | Runner | TaskSource = 1,
    ) -> None:
        if not isinstance(model, Model):
            raise ValueError(f"model: {_brief(model)} is not a gait.Model; give gait.Model(FILE)")
        self.model = model
        self.cameras = _camera_list(cameras)
        self._tasks, config = _task_source(tasks), config or TrackerConfig.default()
        if config.offset_angles < 0:
            config = config.replace(offset_angles=model.info.posture_angles)
        self.config = config.replace(tasks=tasks) if isinstance(tasks, int) and tasks > 1 else config
        c = self._c_config()
        self._handle, self._memory = make("tracker", model.handle, c)
        self.memory_bytes = self._memory.nbytes
        self.isa: str = library().gait_cpu_name(c.cpu_mask).decode()
        self._plates: dict[int, Image] = {}
        self.start_stature_sd = 0.0
        self.step_seconds = 0.0
        for i, plate in enumerate(per_camera(background)):
            self.set_background(plate, i)

    def like(self, config: TrackerConfig) -> Tracker:
        """Make a tracker with the same model, cameras, background and threads but another configuration."""
        plates = [self._plates.get(i) for i in range(len(self.cameras))]
        return Tracker(self.model, self.cameras, config, background=plates, tasks=self._tasks or 1)

    def set_background(self, plate: Image | None, camera: int = 0) -> None:
        """Set the empty scene of one camera as captured, (h, w) or (h, w, 3) BGR; copied; None removes it."""
        view = None
        if plate is not None:
            plate = np.array(plate, order="C")
            view = image_view(plate, self.cameras[camera], "background")
        self._call("set_background", camera, view)
        if plate is None:
            self._plates.pop(camera, None)
        else:
            self._plates[camera] = plate  # the library borrows the pixels

    def start(self, mean: State, sd: State, utime: int = 0) -> None:
        """Draw the particles from independent normal distributions.

        Parameters
        ----------
        mean, sd : State
            A phase or heading whose sd is half a turn or more is uniform.
        utime : int
            Time of the first frame, microseconds.
        """
        self._call("start", mean.to_c(), sd.to_c(), capture_time(utime))
        self.start_stature_sd = sd.stature / max(mean.stature, LEAST_STATURE)

    def start_hypotheses(self, hypotheses: Sequence[Hypothesis], utime: int = 0) -> None:
        """Draw the particles from hypotheses of an automatic start, in proportion to their probabilities.

        Until images have decided between them and confirmed a person, the status is ``INIT``.

        Parameters
        ----------
        hypotheses : sequence of Hypothesis
            The most probable first.  Those elsewhere in the image, or that differ from the first in whether
            the person walks in place, are ignored.
        utime : int
            Time of the first frame, microseconds.
        """
        array = (abi.HypothesisC * len(hypotheses))(*(one.to_c() for one in hypotheses))
        self._call("start_hypotheses", array, len(array), capture_time(utime))
        first = hypotheses[0]
        self.start_stature_sd = first.sd.stature / max(first.mean.stature, LEAST_STATURE)

    def step(
        self,
        frames: Image | Sequence[Image | None] | None,
        utime: int,
        keypoints: FrameKeypoints | Sequence[FrameKeypoints | None] | None = None,
        *,
        poses: CameraPose | Sequence[CameraPose | None] | None = None,
        backgrounds: Image | Sequence[Image | None] | None = None,
        people: Image | Sequence[Image | None] | None = None,
        person: int = 1,
    ) -> Estimate:
        """Process one frame and return the estimate.

        Parameters
        ----------
        frames : image, or sequence of image or None
            (h, w) grey or (h, w, 3) BGR uint8 of each camera; None where a camera missed this frame.
        utime : int
            Capture time, microseconds; must increase.
        keypoints : FrameKeypoints, or sequence of FrameKeypoints or None, optional
            Keypoints found in each camera's image; used if ``config.terms`` has ``Term.KEYPOINTS``.
        poses : CameraPose, or sequence of CameraPose or None, optional
            Pose of each camera in this frame, if it moves; otherwise the pose of its `Camera`.
        backgrounds : image, or sequence of image or None, optional
            The empty scene seen by each camera in this frame.  The one from `set_background` is only used
            with the camera's original pose.
        people : image, or sequence of image or None, optional
            Number, 1 to 255, of the nearest person in each pixel of each camera's image (h, w) without lens
            distortion; 0 where there is none.  The silhouette is not compared where others are.
        person : int
            Number of the tracked one.
        """
        images, plates, nearest = (
            [None if image is None else np.ascontiguousarray(image) for image in per_camera(pictures)]
            for pictures in (frames, backgrounds, people)
        )
        placed = per_camera(poses)
        if max(len(images), len(plates), len(placed), len(nearest)) > len(self.cameras):
            raise ValueError(f"{len(images)} images for {len(self.cameras)} cameras")
        size = ctypes.sizeof(abi.FrameC)
        frame = abi.FrameC(utime=capture_time(utime), struct_size=size, person=person)
        pictures = ("frame", frame.image, images), ("background", frame.background, plates)
        for what, field, views in (*pictures, ("people", frame.people, nearest)):
            for i, image in enumerate(views):
                if image is not None:
                    field[i] = image_view(image, self.cameras[i], what)
        for i, pose in enumerate(placed):
            if pose is not None:
                frame.pose[i] = ctypes.pointer(pose_c(pose))
        found = [one and keypoint_array(one, self.model.joint_names) for one in per_camera(keypoints)]
        for i, array in enumerate(found[: len(self.cameras)]):
            if array is not None:
                frame.keypoints[i] = array
        out = abi.EstimateC()
        begun = time.perf_counter()
        self._call("step", frame, out)
        self.step_seconds = time.perf_counter() - begun
        return Estimate.from_c(out, self.model)

    def lagged(self, back: int | None = None) -> Estimate | None:
        """Estimate the frame `back` steps ago from all frames up to now, by tracing ancestors.

        Parameters
        ----------
        back : int, optional
            At most ``config.lag``, which is also the default.  Configure a lag: without one, nothing is kept.

        Returns
        -------
        Estimate or None
            None if there have been fewer steps since the start.
        """
        out = abi.EstimateC()
        try:
            self._call("lagged", self.config.lag if back is None else back, out)
        except GaitError as exc:
            if exc.status == abi.Result.STATE:
                return None
            raise
        return Estimate.from_c(out, self.model)

    def particles(self) -> tuple[NDArray[np.void], NDArray[np.float32]]:
        """Return all particles, an array (N,) with the fields of ``gait_state``, and their weights (N,)."""
        count = self._call("particles", None, None, 0)
        states, weights = (abi.StateC * count)(), np.zeros(count, np.float32)
        self._call("particles", states, weights, count)
        return np.ctypeslib.as_array(states), weights

    def predict(self, states: NDArray[np.void], seconds: float) -> NDArray[np.void]:
        """Predict states over an interval without images: one draw of the dynamics for each.

        Parameters
        ----------
        states : ndarray of ``gait_state``, shape (N,)
            As `particles` returns them.
        seconds : float
            In [0, ``config.max_dt``].

        Notes
        -----
        The dynamics are the present ones: soon after a start the stature varies more.  The same call between
        the same steps gives the same result.
        """
        out = states.copy()
        self._call("predict", out, len(out), seconds)
        return out

    def digest(self) -> int:
        """Hash of the whole state: the same after the same input, with any threads and on any machine."""
        return int(library().gait_tracker_digest(self._handle))

    def save(self) -> bytes:
        """Copy the whole state, for `restore` in a tracker with the same model and configuration.

        Empty scenes are not included; set those of the other tracker with `set_background`.
        """
        size = ctypes.c_size_t()
        self._call("save", None, 0, size)
        memory = aligned(size.value)
        self._call("save", memory, size.value, size)
        return memory[: size.value].tobytes()

    def restore(self, snapshot: bytes) -> None:
        """Restore a state from `save`; a failure leaves the tracker unchanged."""
        memory = aligned(len(snapshot))
        memory[:] = np.frombuffer(snapshot, np.uint8)
        self._call("restore", memory, len(snapshot))

    def _call(self, name: str, *arguments: object) -> int:
        """Call a function of the tracker; raise the exception of a callback, or else the function's error."""
        try:
            return call(f"gait_tracker_{name}", self._handle, *arguments)
        except GaitError as error:
            text = re.sub(r"gait_tracker_(\w+)", r"Tracker.\1", error.text)
            raise type(error)(error.status, error.name, text, error.index) from None
        finally:
            if self._tasks is not None:
                self._tasks.reraise()

    def _c_config(self) -> abi.TrackerConfigC:
        c = self.config.to_c()
        if not 1 <= len(self.cameras) <= abi.MAX_CAMERAS:
            raise UserError(f"cameras: {len(self.cameras)} given; use 1 to {abi.MAX_CAMERAS}")
        c.cameras = len(self.cameras)
        for i, camera in enumerate(self.cameras):
            c.camera[i] = camera.to_c()
        if self._tasks is not None:
            c.exec = self._tasks.struct
        return c


def _brief(value: object) -> str:
    """Short words for an argument of the wrong kind: plain values as they are, others by their class."""
    if value is None or isinstance(value, str | int | float):
        return repr(value)
    return f"a {type(value).__name__}"


def _camera_list(cameras: Camera | Sequence[Camera]) -> list[Camera]:
    if isinstance(cameras, Camera):
        return [cameras]
    if not isinstance(cameras, Sequence) or not all(isinstance(c, Camera) for c in cameras):
        raise ValueError(f"cameras: {_brief(cameras)}; give a gait.Camera or a list of them")
    return list(cameras)


def _task_source(tasks: int | Runner | TaskSource) -> TaskSource | None:
    if isinstance(tasks, int):
        return threads(tasks)
    if callable(tasks):
        return PythonTasks(tasks)
    if not hasattr(tasks, "struct"):
        raise ValueError(f"tasks: {tasks!r}; give a number of threads, a callable or a pool")
    return tasks
