"""Conversion between this package's objects and messages of ``gaitmsg``."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike

from gait.bindings.abi import MAX_ANGLES, MAX_COMPONENTS, MAX_PIXELS, Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.state import POSE_SCALARS, State
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.fields import LAST_FRAME
from gait.io.track_file import fault_of
from gait.io.video import Image
from gait.lcm.link import gaitmsg

_FRAME_KEY = "frame"
_UNKNOWN = math.nan
_LARGEST_CAMERA_NUMBER = 1e9  # largest magnitude of a camera's numbers
_ROTATION = 1e-3  # by which rows of a rotation may differ from orthonormal, as in the library


def decode(kind: Any, data: bytes, channel: str) -> Any:
    """Decode a message of a ``gaitmsg`` class.

    Raises
    ------
    UserError
        If the bytes are a message of another type or version.
    """
    try:
        return kind.decode(data)
    except (ValueError, IndexError, UnicodeDecodeError, MemoryError) as exc:
        raise UserError(f"{channel}: not a gaitmsg.{kind.__name__} of this version ({exc})") from None
    except Exception as exc:  # struct.error is a subclass of Exception only
        raise UserError(f"{channel}: damaged gaitmsg.{kind.__name__} ({exc})") from None


def estimate_after(
    data: bytes, channel: str, before: Any = None, classes: Any = None
) -> tuple[Any, Estimate]:
    """Decode an ``estimate_t`` of a stream, and read it.

    `before`: the stream's first estimate; `classes`: a ``classes_t``, used if it is of the same frame.

    Raises
    ------
    UserError
        If it is damaged, has other joints, angles or components than `before`, or an unknown status, or
        numbers that no track may have.
    """
    message = decode(gaitmsg.estimate_t, data, channel)
    if not message.joints:
        raise UserError(f"{channel}: an estimate without joints")
    if before is not None and _holds(message) != _holds(before):
        raise UserError(f"{channel}: an estimate with other joints than before")
    if not (-1 <= message.frame <= LAST_FRAME and 0 <= message.step <= LAST_FRAME):
        raise UserError(f"{channel}: an estimate of frame {message.frame}, step {message.step}")
    for state in (message.mean, message.sd, message.best):
        if not (0 <= state.ncoef <= len(state.coef) and 0 <= state.noffset <= len(state.offset)):
            raise UserError(
                f"{channel}: an estimate of {state.ncoef} components, {state.noffset} joint angles"
            )
    fits = classes is not None and classes.utime == message.utime
    estimate = estimate_of(message, classes if fits else None)
    if (fault := fault_of(estimate)) is not None:
        raise UserError(f"{channel}: an estimate that cannot be: {fault}")
    return message, estimate


def _holds(message: Any) -> tuple[list[str], list[str], int]:
    """List joints and angles, and the number of components, of an ``estimate_t``."""
    return (
        [joint.name for joint in message.joints],
        [angle.name for angle in message.angles],
        message.mean.ncoef,
    )


def image_message(image: Image, utime: int, frame: int, jpeg: int | None = None) -> Any:
    """Make an ``image_t``.

    Parameters
    ----------
    image : ndarray of uint8, shape (h, w) grey or (h, w, 3) BGR
    utime : int
        Capture time, microseconds.
    frame : int
        Frame number at the source; negative: none.
    jpeg : int, optional
        Compress with this quality, 1 to 100.
    """
    kind = gaitmsg.image_t
    message = kind()
    message.utime = utime
    message.height, message.width = image.shape[:2]
    if jpeg is None:
        pixels = np.ascontiguousarray(image)
        message.pixelformat = kind.PIXEL_FORMAT_GRAY if image.ndim == 2 else kind.PIXEL_FORMAT_BGR
        message.row_stride = pixels.strides[0]
        message.data = pixels.tobytes()
    else:
        message.pixelformat, message.row_stride = kind.PIXEL_FORMAT_MJPEG, 0
        message.data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1].tobytes()
    message.size = len(message.data)
    if frame >= 0:
        entry = gaitmsg.image_metadata_t()
        entry.key, entry.value, entry.n = _FRAME_KEY, frame.to_bytes(8, "big"), 8
        message.metadata, message.nmetadata = [entry], 1
    return message


def frame_number(image: Any) -> int:
    """Return the frame number of an ``image_t`` at its source; -1 if it has none."""
    for entry in image.metadata:
        if entry.key == _FRAME_KEY and entry.n == 8:
            return int.from_bytes(entry.value, "big")
    return -1


def tracks_message(
    names: Sequence[str],
    uv: ArrayLike,
    utime: int,
    frame: int = -1,
    confidence: ArrayLike = 1.0,
    *,
    errors: ArrayLike | None = None,
) -> Any:
    """Make a ``tracks_t``, with joints located in one picture, from any detector's points.

    With `errors` it is a ``tracks2_t``, which contains them.

    Parameters
    ----------
    names : sequence of str
        Names of the J joints, as in the model.
    uv : array_like of shape (J, 2)
        Pixels; NaN where a joint was not seen.
    utime : int
        Capture time of the picture, microseconds.
    frame : int
        Its frame number at the source; negative: none.
    confidence : array_like that broadcasts to (J,)
        From 0, where a joint was not seen, to 1.
    errors : array_like of shape (J, 3), optional
        Standard deviations of all errors in the picture, and of the lasting part, pixels; seconds for which
        the other part counts as one observation.
    """
    points = np.asarray(uv, float)
    visible = np.isfinite(points).all(axis=1)
    confidences = np.where(visible, np.broadcast_to(confidence, len(points)), 0.0)
    message = gaitmsg.tracks_t() if errors is None else gaitmsg.tracks2_t()
    message.utime, message.frame, message.ntracks = utime, frame, len(points)
    for name, (u, v), c in zip(names, np.where(visible[:, None], points, 0.0), confidences, strict=True):
        track = gaitmsg.track_t() if errors is None else gaitmsg.track2_t()
        track.name, track.u, track.v, track.confidence = name, float(u), float(v), float(c)
        message.tracks.append(track)
    if errors is not None:
        for track, (sd, lasting, correlation) in zip(message.tracks, np.asarray(errors, float), strict=True):
            track.sd, track.lasting_sd, track.correlation = float(sd), float(lasting), float(correlation)
    return message


def picture(message: Any) -> Image:
    """Read the pixels of an ``image_t``: (h, w) grey or (h, w, 3) BGR.

    Raises
    ------
    UserError
        If the format is not one of package ``gaitmsg``, or data are missing.
    """
    kind = type(message)
    if not all(1 <= side <= MAX_PIXELS for side in (message.width, message.height)):
        raise UserError(f"image: {message.width}x{message.height} pixels are not a picture")
    if message.pixelformat == kind.PIXEL_FORMAT_MJPEG:
        try:
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:  # empty, or more pixels than OpenCV allows
            image = None
        if image is None or image.dtype != np.uint8 or image.shape[2:] not in ((), (3,)):
            raise UserError("image: JPEG frame cannot be decoded")
        if image.shape[:2] != (message.height, message.width):
            raise UserError("image: JPEG frame with another size than its message states")
        return np.asarray(image, np.uint8)
    channels = {kind.PIXEL_FORMAT_GRAY: 1, kind.PIXEL_FORMAT_RGB: 3, kind.PIXEL_FORMAT_BGR: 3}
    depth = channels.get(message.pixelformat)
    if depth is None:
        raise UserError(f"image: pixelformat 0x{message.pixelformat:08x} is not grey, RGB, BGR or JPEG")
    row = message.width * depth
    if message.row_stride < row or len(message.data) < message.row_stride * message.height:
        raise UserError("image: row_stride or size too small for its width and height")
    rows = np.frombuffer(message.data, np.uint8, message.row_stride * message.height)
    image = rows.reshape(message.height, message.row_stride)[:, :row]
    if depth == 1:
        return np.ascontiguousarray(image)
    image = image.reshape(message.height, message.width, 3)
    return np.ascontiguousarray(image[..., ::-1] if message.pixelformat == kind.PIXEL_FORMAT_RGB else image)


def camera_message(camera: Camera, utime: int) -> Any:
    """Make a ``camera_t``."""
    message = gaitmsg.camera_t()
    message.utime = utime
    for name in ("width", "height", "fx", "fy", "cx", "cy"):
        setattr(message, name, getattr(camera, name))
    message.R = np.asarray(camera.R, float).ravel().tolist()
    message.t = np.asarray(camera.t, float).tolist()
    message.distortion = np.asarray(camera.distortion, float).tolist()
    return message


def camera_of(message: Any) -> Camera:
    """Read a ``camera_t``.

    Raises
    ------
    UserError
        If size, focal lengths or rotation are impossible, or numbers are not finite.
    """
    # Not gait_camera_check(), which also judges the pose: any pose is shown and exported, as of a moving
    # camera.
    plain = {name: getattr(message, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
    turn = np.reshape(message.R, (3, 3)).astype(float)
    numbers = np.array([*plain.values(), *message.R, *message.t, *message.distortion], float)
    sized = all(1 <= plain[side] <= MAX_PIXELS for side in ("width", "height"))
    if not (sized and (np.abs(numbers) < _LARGEST_CAMERA_NUMBER).all() and min(plain["fx"], plain["fy"]) > 0):
        raise UserError("camera: size, focal lengths or other numbers out of range; send pixels and metres")
    if np.abs(turn @ turn.T - np.eye(3)).max() > _ROTATION or np.linalg.det(turn) < 0:
        raise UserError("camera: R is not a rotation; send orthogonal rows of length 1")
    return Camera(
        **plain, R=turn, t=np.array(message.t, float), distortion=np.array(message.distortion, float)
    )


def state_message(values: State | Mapping[str, Any]) -> Any:
    """Make a ``state_t`` from a `State`, or from some of its fields; the others are NaN, which means unknown.

    The message does not contain the turn rate.
    """
    known = vars(values) if isinstance(values, State) else values
    message = gaitmsg.state_t()
    for name in POSE_SCALARS:
        setattr(message, name, float(known.get(name, _UNKNOWN)))
    message.pelvis = [float(x) for x in known.get("pelvis", [_UNKNOWN] * 3)]
    message.ncoef, message.coef = _padded(known.get("coef"), MAX_COMPONENTS)
    message.noffset, message.offset = _padded(known.get("offset"), MAX_ANGLES)
    return message


def _padded(values: Any, size: int) -> tuple[int, list[float]]:
    """Return count and values, padded with zeros to `size`; all unknown if `values` is None."""
    given = [_UNKNOWN] * size if values is None else [float(x) for x in values]
    return len(given), given + [0.0] * (size - len(given))


def state_of(message: Any) -> State:
    """Read a ``state_t``; as it has no proportions, these are those of the mean body."""
    state = State(pelvis=np.array(message.pelvis, float))
    for name in POSE_SCALARS:
        setattr(state, name, float(getattr(message, name)))
    state.coef = np.array(message.coef[: message.ncoef], float)
    state.offset = np.array(message.offset[: message.noffset], float)
    return state


def command_message(
    command: int,
    utime: int = 0,
    mean: State | Mapping[str, Any] | None = None,
    sd: State | Mapping[str, Any] | None = None,
) -> Any:
    """Make a ``command_t`` with a unique id; `mean` and `sd` are for START."""
    message = gaitmsg.command_t()
    message.utime, message.command, message.id = utime, command, time.monotonic_ns()
    message.mean, message.sd = state_message(mean or {}), state_message(sd or {})
    return message


def classes_message(data: bytes, channel: str) -> Any:
    """Decode a ``classes_t``.

    Raises
    ------
    UserError
        If it is damaged.
    """
    message = decode(gaitmsg.classes_t, data, channel)
    if not (0 <= message.most_probable < message.nclasses and np.isfinite(message.probability).all()):
        raise UserError(f"{channel}: probabilities of no class of motion")
    return message


def estimate_of(message: Any, classes: Any = None) -> Estimate:
    """Read an ``estimate_t``, and the ``classes_t`` of its frame if the model has several classes.

    Raises
    ------
    UserError
        If its status is unknown.
    """
    of_classes = (
        {}
        if classes is None
        else {
            "motion_class": classes.name[classes.most_probable],
            "class_probability": np.array(classes.probability, float),
        }
    )
    if message.status not in list(TrackStatus):
        raise UserError(f"estimate: status {message.status} is unknown")
    return Estimate(
        utime=message.utime,
        frame=message.step,
        status=TrackStatus(message.status),
        flags=Flag(message.flags),
        log_evidence=message.log_evidence,
        ess=message.ess,
        phase_r=message.phase_r,
        hypothesis_weight=message.mode_mass,
        speed=message.speed,
        mean=state_of(message.mean),
        sd=state_of(message.sd),
        best=state_of(message.best),
        joints=np.array([joint.position for joint in message.joints], float).reshape(-1, 3),
        joint_sd=np.array([joint.sd for joint in message.joints], float).reshape(-1, 3),
        angles=np.array([angle.angle for angle in message.angles], float),
        joint_names=tuple(joint.name for joint in message.joints),
        **of_classes,
    )
