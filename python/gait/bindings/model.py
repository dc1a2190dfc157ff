"""A learned walking model: poses of the body at any phase, and pictures of them."""

from __future__ import annotations

import ctypes
import os
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings import abi
from gait.bindings.library import aligned, call, check, library, make
from gait.bindings.shipped import SHIPPED, WALK
from gait.bindings.state import State
from gait.body.model_curves import slope_of
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.errors import GaitError, UserError
from gait.io.blob import decode
from gait.io.files import require_file

Array = NDArray[np.float64]

NOT_CYCLIC = "contains no cyclic model; learn it without --segments only"


@dataclass(frozen=True)
class LoadedModel:
    """A ``gait_model`` and the memory that contains it."""

    handle: ctypes.c_void_p
    blob: NDArray[np.uint8]
    memory: NDArray[np.uint8]


def load(source: str | os.PathLike[str] | bytes | None) -> LoadedModel:
    """Check and load a blob: a file, its contents, or one of the package (`SHIPPED`; None: ``walk``).

    Raises
    ------
    UserError
        If the file cannot be read or is refused.
    GaitError
        If a blob given as bytes is refused.
    """
    contents = source if isinstance(source, bytes) else read_blob(source)
    blob = aligned(len(contents))
    blob[:] = np.frombuffer(contents, np.uint8)
    try:
        handle, memory = make("model", blob, len(contents))
    except GaitError as exc:
        if isinstance(source, bytes):
            raise
        raise UserError(f"{source or 'walk.gait'}: {exc.text}; copy or learn it again") from exc
    return LoadedModel(handle, blob, memory)


@dataclass(frozen=True)
class ModelInfo:
    """Contents of a model.

    Attributes
    ----------
    joints, angles : int
        Reported points and joint angles.
    components : int
        Principal components of the cyclic motion.
    proportions : int
        Components of the variation of limb lengths between people of the same stature.
    phases : int
        Samples per stride of the curves.
    limbs : int
        Drawn body parts.
    stride_hz, stride_hz_sd : float
        Strides per second: mean of the training set, and standard deviation between subjects.
    stride_length, stride_length_sd : float
        Stride length as a fraction of stature: mean and standard deviation, likewise.
    cyclic : int
        1 if the blob has a cyclic model, 0 if only a segment prior.
    posture_angles : int
        Bit i: angle i belongs to the trunk or an arm, where posture varies most.
    classes : int
        Classes of motion.
    direction : int
        Direction of the phase: 1 forwards, -1 backwards, 0 standing.
    digest : int
        Hash of the blob.
    """

    joints: int
    angles: int
    components: int
    proportions: int
    phases: int
    limbs: int
    stride_hz: float
    stride_hz_sd: float
    stride_length: float
    stride_length_sd: float
    cyclic: int
    posture_angles: int
    classes: int
    direction: int
    digest: int


class Model:
    """Cyclic model read from a ``.gait`` blob.

    Parameters
    ----------
    source : path or bytes, optional
        File or contents of a blob, or, if there is no such file, the name of a model in the package:
        ``walk`` (the default), or ``paper``, with 19 angles and 5 components, which `gait track` uses in
        paper mode.

    Attributes
    ----------
    info : ModelInfo
    joint_names, angle_names, limb_names : tuple of str
    classes : tuple of str
        Names of the classes of motion; "walk" alone if the blob names none.
    directions : dict of str to int
        Direction in which the phase of each class runs: 1, -1 (backwards) or 0 (a class that stands).

    Raises
    ------
    UserError
        If the file cannot be read, or is not a valid model: another kind of file, damaged, or of another
        version.
    GaitError
        If the library refuses a blob given as bytes.
    """

    def __init__(self, source: str | os.PathLike[str] | bytes | None = None) -> None:
        self._lib = library()
        name = "the blob" if isinstance(source, bytes) else str(source or "walk.gait")
        self._loaded = load(source)
        self.handle = self._loaded.handle
        self.info = info = self._read_info(self.handle)
        if not info.cyclic:
            raise UserError(f"{name}: {NOT_CYCLIC}")
        self.joint_names = self._names("joint", info.joints)
        self.angle_names = self._names("angle", info.angles)
        self.limb_names = self._names("limb", info.limbs)
        self.classes = self._names("class", info.classes)
        self.directions = {name: self.class_info(k).direction for k, name in enumerate(self.classes)}

    def _names(self, kind: str, count: int) -> tuple[str, ...]:
        """List names of joints, angles or limbs; bytes that are not UTF-8 are escaped."""
        name = getattr(self._lib, f"gait_model_{kind}_name")
        return tuple(name(self.handle, i).decode(errors="backslashreplace") for i in range(count))

    def sections(self) -> dict[str, NDArray[np.generic]]:
        """Return the arrays of the blob by tag (model-format.md)."""
        return decode(self._loaded.blob.tobytes())

    def class_info(self, motion_class: int) -> ModelInfo:
        """Return the contents of the model for one class of motion; IndexError if it has no such class."""
        handle = self._lib.gait_model_of_class(self.handle, motion_class)
        if not handle:
            raise IndexError(f"class {motion_class}: the model has {self.info.classes}")
        return self._read_info(handle)

    def __repr__(self) -> str:
        return f"<gait.Model of {self.info.components} components, digest {self.info.digest:016x}>"

    def pose(self, state: State) -> tuple[Array, Array]:
        """Compute joints (P, 3) in the world, metres, and joint angles (A,), radians, of one state."""
        c = abi.PoseC()
        call("gait_model_pose", self.handle, state.to_c(), c)
        return pose_arrays(c, self.info.joints, self.info.angles)

    def poses(self, states: NDArray[np.void]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Compute joints (..., P, 3), metres, and angles (..., A), radians, of an array of ``gait_state``."""
        flat = np.ascontiguousarray(states).reshape(-1)
        pose, error, pointer = abi.PoseC(), abi.Error(), ctypes.POINTER(abi.StateC)
        joint, angle = np.ctypeslib.as_array(pose.joint), np.ctypeslib.as_array(pose.angle)
        joints = np.empty((len(flat), self.info.joints, 3), np.float32)
        angles = np.empty((len(flat), self.info.angles), np.float32)
        begin, size, pose_of = flat.ctypes.data, flat.dtype.itemsize, self._lib.gait_model_pose
        for i in range(len(flat)):
            state = ctypes.cast(begin + i * size, pointer)
            check(pose_of(self.handle, state, ctypes.byref(pose), ctypes.byref(error)), error)
            joints[i], angles[i] = joint[: self.info.joints], angle[: self.info.angles]
        shape = states.shape
        return joints.reshape(*shape, *joints.shape[1:]), angles.reshape(*shape, *angles.shape[1:])

    def pelvis_height(self, state: State) -> float:
        """Predict the height of the pelvis above the ground, metres; ``state.pelvis`` does not matter."""
        height = ctypes.c_float()
        call("gait_model_pelvis_height", self.handle, state.to_c(), height)
        return height.value

    def angle_mask(self, names: str) -> int:
        """Set bit i for each angle i in `names`, separated by spaces; see config `offset_angles`."""
        mask = ctypes.c_uint32()
        call("gait_model_angle_mask", self.handle, names.encode(), mask)
        return mask.value

    def prior(self) -> tuple[State, State]:
        """Return mean and standard deviation of an unknown person's state, with the pelvis at the origin."""
        mean, sd = abi.StateC(), abi.StateC()
        call("gait_tracker_prior", self.handle, mean, sd)
        sizes = (self.info.components, self.info.angles)
        return State.from_c(mean, *sizes), State.from_c(sd, *sizes)

    def render(self, camera: Camera, state: State) -> NDArray[np.uint8]:
        """Draw a state through an ideal lens: (height, width) of limb index + 1, or 0 for none."""
        ids = np.zeros((camera.height, camera.width), np.uint8)
        call("gait_render", self.handle, camera.to_c(), state.to_c(), ids, camera.width)
        return ids

    def _read_info(self, handle: object) -> ModelInfo:
        c = abi.ModelInfoC()
        call("gait_model_get_info", handle, c)
        return ModelInfo(**{name: getattr(c, name) for name, *_ in c._fields_ if name != "reserved"})


def pose_arrays(c: abi.PoseC, joints: int, angles: int) -> tuple[Array, Array]:
    """Copy a ``gait_pose`` to arrays (joints, 3) and (angles,)."""
    return np.array(c.joint, float)[:joints], np.array(c.angle[:angles], float)


def pose_c(pose: CameraPose) -> abi.CameraPoseC:
    """Make a ``gait_camera_pose``."""
    library()  # loading it defines the structures
    c = abi.CameraPoseC(turn_sd=pose.turn_sd, place_sd=pose.place_sd)
    c.R[:], c.t[:] = pose.R.ravel().tolist(), pose.t.tolist()
    return c


def model_file(path: str | os.PathLike[str] | None) -> Path:
    """Return the path of a blob file, or of a blob of the package by its name; a file comes first."""
    name = WALK if path is None else str(path)
    if path is not None and (name not in SHIPPED or Path(path).is_file()):
        return Path(path)
    shipped = Path(str(resources.files("gait") / "data" / f"{name}.gait"))
    if not shipped.is_file():
        raise UserError(f"gait/data/{name}.gait: the package was built without its model; run make model")
    return shipped


def is_model(source: str) -> bool:
    """Whether a source is a blob by its suffix, or by its name in the package unless a path has that name."""
    return Path(source).suffix.lower() == ".gait" or (source in SHIPPED and not Path(source).exists())


def read_blob(path: str | os.PathLike[str] | None) -> bytes:
    """Read a blob file, or a blob of the package by its name, and check its container."""
    file = model_file(path)
    require_file(file, "model file", "make one with gait learn")
    contents = file.read_bytes()
    decode(contents, str(path or file))
    return contents


def read_cyclic(path: str | os.PathLike[str] | None) -> dict[str, Any]:
    """Read the sections of a blob, of a file or of the package; UserError if it has no cyclic model."""
    sections = decode(read_blob(path), str(path))
    if "CURV" not in sections:
        raise UserError(f"{path}: {NOT_CYCLIC}")
    slope_of(sections, str(path))
    return sections


def walking_model(path: str | os.PathLike[str] | None) -> Model:
    """Load a model with walking curves: the given one, or the shipped one if it has only a segment prior."""
    own = path is not None and "CURV" in decode(read_blob(path))
    return Model(path if own else None)
