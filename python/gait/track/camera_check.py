"""Check whether a given camera fits the walk in the picture, and what would fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.track.from_walk import calibrate
from gait.track.keypoint_start import find_keypoint_start
from gait.track.walk_start import CameraPrior, choose_frames

Array = NDArray[np.float64]

_TALLER = 0.12  # relative error of the apparent stature that contradicts a camera
_STATURE_RANGE_M = (1.4, 2.1)  # metres; apparent statures accepted if the person's is unknown
_PARTS = ("focal length", "tilt", "roll")
_GIVEN_SD = np.array([0.1, np.radians(2.0), np.radians(1.5), 0.1])  # of the given camera, as in CameraPrior
_REPORTED_DIFFERENCES = np.array(
    [0.25, np.radians(6.0), np.radians(5.0)]
)  # differences of `_PARTS` that are reported
_CERTAIN = 2.0  # standard deviations of the estimate that a difference must exceed as well
_CHECKED_FIT_CHI2 = (
    1.4  # squared robust error per coordinate; worse fits, as with moving cameras, prove nothing
)
_UPRIGHT_DEG = 35.0  # degrees by which a walking body may lean in the picture


def contradiction(given: Camera, keypoints: Keypoints, model: Model, height: float | None) -> str | None:
    """Report how a given camera contradicts a walk, and what would fit; None if it does not.

    A camera contradicts a walk if no walk on its floor fits, if the person appears too tall or too short, or
    if an estimate of the camera, with the given one as prior, differs clearly from it.  A path straight
    across the view does not determine the focal length, so that a wrong one is not noticed.

    Parameters
    ----------
    given : Camera
    keypoints : Keypoints
        Keypoints of one person, pixels.
    model : Model
        Its cyclic part is used.
    height : float or None
        The person's stature, metres, if known.
    """
    walk = _walk(keypoints, model)
    if walk is None:
        return None
    start = find_keypoint_start(walk, given, model)
    if start is None:
        if words := _turned_frames(given, walk, model):
            return words
        what: str | None = "no walk on its floor, z = 0, fits the picture"
    else:
        appears = start.mean.stature
        what = _wrong_size(appears, height) or _wrong_part(given, walk, model, appears)
    if what is None:
        return None
    try:
        fits = calibrate(walk, given.size, model, model.prior()[0].stature if height is None else height)
    except UserError:
        return None
    return (
        f"{what}; check its focal length ({given.fx:.0f} px) and position ({given.centre[2]:.2f} m high): "
        f"{fits.describe()[0]}"
    )


def _walk(keypoints: Keypoints, model: Model) -> Keypoints | None:
    """Choose the model's joints in some seconds of a walk; None if shoulders, hips or ankles are missing."""
    needed = {f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "hip", "ankle")}
    if not needed <= set(keypoints.names):
        return None
    known = [j for j, name in enumerate(keypoints.names) if name in model.joint_names]
    names = tuple(keypoints.names[j] for j in known)
    uv, confidence = keypoints.uv[:, known], keypoints.confidence[:, known]
    chosen = choose_frames(Keypoints(keypoints.frame, keypoints.time, names, uv, confidence))
    return chosen if len(chosen.frame) > 1 else None


def _wrong_size(appears: float, height: float | None) -> str | None:
    """Report a person who appears too tall or too short."""
    low, high = _STATURE_RANGE_M if height is None else (height * (1 - _TALLER), height * (1 + _TALLER))
    if low < appears < high:
        return None
    known = "give --height if that is right" if height is None else f"--height is {height:g}"
    return f"the person appears {appears:.2f} m tall by it, {known}"


def _wrong_part(given: Camera, walk: Keypoints, model: Model, stature: float) -> str | None:
    """Report the focal length, tilt or roll if an estimate with the given ones as prior differs from it."""
    expected = _parameters(given)
    try:
        found = calibrate(walk, given.size, model, stature, near=CameraPrior(expected, _GIVEN_SD))
    except UserError:
        return None
    if found.chi2_per_observation > _CHECKED_FIT_CHI2:
        return None
    off = np.abs(_parameters(found.camera) - expected)[:3]
    wrong = (off > _REPORTED_DIFFERENCES) & (off > _CERTAIN * found.sd[:3])
    return f"the walk contradicts its {_PARTS[int(wrong.argmax())]}" if wrong.any() else None


def _parameters(camera: Camera) -> Array:
    """Compute log focal length [px], tilt, roll [rad], log height [m] of a camera, at mid-picture."""
    middle = (np.array(camera.size) - 1) / 2
    ahead, right, left, down, up = camera.rays(middle + [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    across, upwards = (right - left) / 2, (up - down) / 2
    focal = 1 / np.sqrt(np.linalg.norm(across) * np.linalg.norm(upwards))
    roll = np.arctan2(-across[2], upwards[2])
    return np.array([np.log(focal), -np.arcsin(ahead[2]), roll, np.log(camera.centre[2])])


def _turned_frames(given: Camera, walk: Keypoints, model: Model) -> str | None:
    """Report frames that are rotated relative to the camera, if the walk fits when they are turned back."""
    quarters = round(_lean(given, walk) / 90) % 4
    if quarters and _fits(given, _turned(walk, given.size, -quarters), model):
        turn = {1: "90 degrees clockwise", 2: "180 degrees", 3: "90 degrees counter-clockwise"}[quarters]
        return f"the frames are turned by {turn} against it; turn the video back, or calibrate it as it is"
    return None


def _fits(camera: Camera, walk: Keypoints, model: Model) -> bool:
    """Whether bodies are upright and a walk fits."""
    if camera.centre[2] <= 0 or abs(_lean(camera, walk)) > _UPRIGHT_DEG:
        return False
    start = find_keypoint_start(walk, camera, model)
    return start is not None and _STATURE_RANGE_M[0] < start.mean.stature < _STATURE_RANGE_M[1]


def _lean(camera: Camera, walk: Keypoints) -> float:
    """Angle of bodies from the vertical in the picture, degrees, clockwise."""
    top, foot = (
        np.mean([walk.uv[:, walk.names.index(f"{side}_{joint}")] for side in "lr"], axis=0)
        for joint in ("shoulder", "ankle")
    )
    place = camera.centre + 5.0 * camera.rays(foot)  # the vertical is the same at any distance
    observed, vertical = foot - top, camera.project(place) - camera.project(place + [0.0, 0.0, 0.3])
    ratio = (observed @ [1, 1j]) * np.conj(vertical @ [1, 1j])
    ratio = ratio[np.isfinite(ratio) & (ratio != 0)]
    return float(np.degrees(np.angle((ratio / np.abs(ratio)).sum())))


def _turned(walk: Keypoints, size: tuple[int, int], quarters: int) -> Keypoints:
    """Rotate keypoints clockwise about the middle of the picture by quarters of a turn."""
    middle = (np.array(size) - 1) / 2
    turn = np.linalg.matrix_power(np.array([[0, 1], [-1, 0]]), quarters % 4)
    return replace(walk, uv=(walk.uv - middle) @ turn + middle)
