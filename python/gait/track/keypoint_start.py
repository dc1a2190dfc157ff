"""The start of a track from the keypoints of a clip: the first second in which a person walks.

Windows of one second are fitted in turn (`gait.bindings.start_fit`), so a person who stands at first, or
comes into view late, is found as soon as they walk.  Among other people, the best second soon after is used.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gait.bindings.frame import FrameKeypoints
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.bindings.start_fit import Hypothesis, StartFit
from gait.camera.camera import Camera
from gait.camera.path import CameraPose
from gait.detect.profile import frame_sd
from gait.errors import GaitError
from gait.io.keypoints_file import Keypoints

_KEYPOINT_WINDOW_S = 1.0  # seconds of keypoints that are fitted
_WHOLE = 0.8  # share of the most frames of a window from which one counts as whole
_WINDOW_STEP_S = 0.2  # seconds from one window to the next
_CHOICE_S = 5.0  # seconds, from the first whole window that shows a walk, in which a better one is looked for
_CHOICE_STEP_S = 0.4  # seconds between the windows among which it is looked for
_BEST_WINDOW_CHI2 = (
    4.0  # chi-square per coordinate up to which the best window is used if no window shows a walk
)
#: Metres, of a stature given by the user; a detector's skeleton may have another size.
_GIVEN_STATURE_SD_M = 0.05


def keypoint_noise(keypoints: Keypoints) -> dict[int, FrameKeypoints]:
    """Split keypoints by frame, and add the standard deviation of each joint.

    Parameters
    ----------
    keypoints : Keypoints
        Keypoints of one person.

    Returns
    -------
    keypoints : dict of int to FrameKeypoints
        Keypoints by frame number, pixels.  Joints that were not found have a negative standard deviation.
    """
    sd = frame_sd(keypoints) if keypoints.frame_sd is None else keypoints.frame_sd
    sd = np.where(keypoints.visible, sd, -1.0)
    rows = zip(keypoints.frame.tolist(), keypoints.uv, sd, strict=True)
    return {frame: FrameKeypoints(keypoints.names, uv, noise) for frame, uv, noise in rows}


def find_keypoint_start(
    keypoints: Keypoints,
    camera: Camera,
    model: Model,
    *,
    first: int = 0,
    stop: int | None = None,
    height: float | None = None,
    poses: Mapping[int, CameraPose] | None = None,
    best_second: bool = False,
) -> Start | None:
    """Find the first state of a person from their keypoints.

    Parameters
    ----------
    keypoints : Keypoints
        Keypoints of one person, in pixels of the camera.
    camera : Camera
    model : Model
    first, stop : int
        Frames to use, first <= number < stop.
    height : float, optional
        Known stature, metres.
    poses : mapping of int to CameraPose, optional
        Pose of the camera in each frame, if it moves.
    best_second : bool
        Choose the second with the best fit within 5 s, of those with most frames, instead of the first; for
        people who may be hidden.

    Returns
    -------
    start : Start or None
        None if no second of the keypoints fits a walk.
    """
    if not {"l_hip", "r_hip", "l_ankle", "r_ankle"} <= set(keypoints.names):
        return None
    known = {} if height is None else {"stature": height, "stature_sd": _GIVEN_STATURE_SD_M}
    fit = StartFit(model, camera, **known)
    by_frame = keypoint_noise(keypoints)
    chosen = (keypoints.frame >= first) & (keypoints.frame < (np.inf if stop is None else stop))
    chosen &= keypoints.visible.any(axis=1)
    frames, times = keypoints.frame[chosen], keypoints.time[chosen]
    count = np.searchsorted(times, times + _KEYPOINT_WINDOW_S) - np.arange(len(times))
    walks: list[tuple[bool, float, Start]] = []
    best: tuple[Start, Hypothesis] | None = None
    begin, end = -np.inf, np.inf
    step = _CHOICE_STEP_S if best_second else _WINDOW_STEP_S
    for at, time in enumerate(times):
        if time < begin + step:
            continue
        if time > end:
            break
        begin = time
        found = _fit_window(fit, by_frame, frames, times, at, poses or {})
        if found is None:
            continue
        start, hypothesis = found
        if hypothesis.walks:
            if not best_second:
                return start
            part = bool(count[at] < _WHOLE * count.max())
            walks.append((part, hypothesis.chi2_per_observation, start))
            end = end if part else min(end, time + _CHOICE_S)
        if best is None or hypothesis.chi2_per_observation < best[1].chi2_per_observation:
            best = found
    if walks:
        return min(walks, key=lambda walk: walk[:2])[2]
    return best[0] if best is not None and best[1].chi2_per_observation < _BEST_WINDOW_CHI2 else None


def _fit_window(
    fit: StartFit,
    by_frame: dict[int, FrameKeypoints],
    frames: np.ndarray[tuple[int], np.dtype[np.int64]],
    times: np.ndarray[tuple[int], np.dtype[np.float64]],
    at: int,
    poses: Mapping[int, CameraPose],
) -> tuple[Start, Hypothesis] | None:
    """Fit the second from ``frames[at]``; None if no walk fits or hips and ankles are not in view.

    `frames` (T,): frame numbers; `times` (T,): their times, seconds.
    """
    fit.reset()
    for frame, time in zip(frames[at:], times[at:], strict=True):
        if time > times[at] + _KEYPOINT_WINDOW_S:
            break
        if int(frame) in poses:
            fit.set_pose(poses[int(frame)])
        fit.add(round(1e6 * time), by_frame[int(frame)])
    try:
        found = fit.solve(round(1e6 * times[at]))
    except GaitError:
        return None
    best = found[0]
    start = Start(int(frames[at]), best.mean, best.sd, in_place=best.in_place, hypotheses=tuple(found))
    return start, best
