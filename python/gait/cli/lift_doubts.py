"""Why a motion that `gait lift` estimated from keypoints may be wrong, in words."""

from __future__ import annotations

import numpy as np

from gait.cli import lift_tracks
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints import noise
from gait.lift.smooth import motion, size
from gait.lift.smooth.motion import Motion, Options

FAR = 4.0  # noise alone gives a median of 1.2
UNTOLD = (
    "hips and ankles are hardly seen, which tell the distance: the person may be metres nearer or further"
)
DOUBTED = 3  # frames in which a point is doubted; a right one is far off once in a few thousand
BORNE = 0.18  # share of wrong points; one in seven does little harm, one in five may
UNUSUAL = 2.5  # deviations of a stature; one of 80 people is as unusual


def of(found: Motion, keypoints: Keypoints, options: Options, usual: float, camera: bool, jumps: int) -> list[str]:
    """Say why the result may be wrong, a line each.

    Parameters
    ----------
    usual : float
        Stature of the people learnt from, metres.
    camera : bool
        Whether the view has one.
    jumps : int
        Points that were left out before.
    """
    far = float(np.nanmedian(found.error)) / options.pixel_sd
    doubted, shake = _doubted(found, keypoints.names), noise.shake(keypoints)
    lost = _lost(found, keypoints, jumps)
    shaky = shake > lift_tracks.SHAKY * options.pixel_sd and found.wider > 1
    doubts = {
        UNTOLD: camera and not size.tells_distance(keypoints),
        f"left with little say, far from where the rest has them: {doubted}": bool(doubted),
        f"{lost:.0%} of the points are wrong, as it seems, which is more than it bears: do not rely on it": (
            lost > BORNE
        ),
        f"the points shake by {shake:.2g} from frame to frame, not {options.pixel_sd:g}: "
        f"try --pixel-sd {shake:.2g}": shaky,
        f"not a motion like those learnt: the prior was widened {found.wider:g} times": found.wider > 1,
        "the smoother goes astray in such a motion: its segments are estimated alone, as by --method blend": (
            found.alone
        ),
        _unusual(found, options, usual, camera): _off(found, options, usual) > UNUSUAL,
        f"the motion's size was told by the bones ({found.resized:.2f} times the fit's): it is unlike those "
        "learnt, or the camera is wrong; deviations are wide, do not rely on the places": found.resized != 1,
        f"the estimate did not rest in {found.steps} iterations: do not rely on it": not found.settled,
        f"the estimate is {far:.0f} times --pixel-sd from what was seen: do not rely on it; check camera, "
        "the names of the points, that v points down, and --pixel-sd": far > FAR,
    }
    return [words for words, holds in doubts.items() if holds]


def _lost(found: Motion, keypoints: Keypoints, jumps: int) -> float:
    """Share of the points that were left out or doubted."""
    doubted = 0 if found.outliers is None else int(found.outliers.sum())
    return (jumps + doubted) / max(int(keypoints.seen.sum()) + jumps, 1)


def _doubted(found: Motion, names: tuple[str, ...]) -> str:
    """Points of the keypoints that were doubted, and in how many frames."""
    if found.outliers is None:
        return ""
    counts = zip(names, found.outliers.sum(axis=0).tolist(), strict=True)
    return ", ".join(f"{name} in {count} frames" for name, count in counts if count >= DOUBTED)


def _off(found: Motion, options: Options, usual: float) -> float:
    """How many deviations the stature came out from what was believed; segments alone have none of it."""
    believed, sd = motion.believed_stature(options, usual)
    return abs(found.stature - believed) / sd if found.steps else 0.0


def _unusual(found: Motion, options: Options, usual: float, camera: bool) -> str:
    """Name what makes a stature come out wrong."""
    believed, _ = motion.believed_stature(options, usual)
    lens = "the camera's focal length" if camera else "--metres-per-unit"
    return (
        f"the person came out {found.stature:.2f} m tall, where {believed:.2f} was believed: check {lens}, "
        "time (the frame rate) and --height"
    )
