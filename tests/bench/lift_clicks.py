"""A simulated user who corrects the estimate of a clip, the worst joints first, with some noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gait.body.skeleton import EVAL15
from gait.lift.keypoints.corrections import Correction
from gait.lift.video.clip_segments import ClipSegments
from gait.lift.video.fit_clip import ClipFit, fit_clip
from gait.motion.evaluate import root_errors

Array = NDArray[np.float64]

WIDTH90 = 1.645  # standard deviations in half a 90 % interval
POINTING = 3.0  # pixels, standard deviation of a click


@dataclass(frozen=True)
class Score:
    """Errors of an estimate: root and absolute (mm), in the picture (px); coverage of 90 % intervals."""

    corrections: int
    root: float
    absolute: float
    pixels: float
    coverage: float


def score(clip: ClipSegments, fit: ClipFit, truth: Array, joints: list[str]) -> Score:
    """Medians over frames; truth: (T, P, 3) of `joints`, which hold EVAL15."""
    body = [joints.index(name) for name in EVAL15]
    markers = clip.prior.index(EVAL15)
    found, true = fit.places[:, markers], truth[:, body]
    off = np.linalg.norm(clip.view.project(found)[0] - clip.view.project(true)[0], axis=2)
    return Score(
        len(clip.corrections),
        float(np.median(root_errors(found, true))),
        float(np.median(1000 * np.linalg.norm(found - true, axis=2).mean(axis=1))),
        float(np.median(off.mean(axis=1))),
        float(np.mean(np.abs(found - true) < WIDTH90 * fit.sd[:, markers])),
    )


def corrected(
    clip: ClipSegments, truth: Array, joints: list[str], most: int, share: float = 0.1, seed: int = 0
) -> Iterator[tuple[ClipSegments, ClipFit]]:
    """Yield the clip with its estimate after each round of corrections, first without any.

    Parameters
    ----------
    clip : ClipSegments
    truth : (T, P, 3)
        Of `joints`, metres.
    most : int
        Corrections altogether.
    share : float
        Share of the frames that are corrected before the user sees a new estimate.
    """
    rng = np.random.default_rng(seed)
    uv = clip.view.project(truth)[0]
    markers = clip.prior.index(joints)
    fit = fit_clip(clip)
    yield clip, fit
    while len(clip.corrections) < most:
        off = np.linalg.norm(clip.view.project(fit.places[:, markers])[0] - uv, axis=2)
        for old in clip.corrections:
            off[old.frame - clip.film.first, joints.index(old.joint)] = -1.0
        count = min(max(1, round(share * len(off))), most - len(clip.corrections))
        worst = np.argmax(off, axis=1)
        new = []
        for frame in _apart(off.max(axis=1), count):
            joint = int(worst[frame])
            at = uv[frame, joint] + POINTING * rng.standard_normal(2)
            new.append(
                Correction(clip.film.first + frame, joints[joint], (float(at[0]), float(at[1])), POINTING)
            )
        clip = replace(clip, corrections=(*clip.corrections, *new))
        fit = fit_clip(clip, fit.sequence)
        yield clip, fit


def _apart(off: Array, count: int) -> list[int]:
    """Frames of the largest errors, each the worst of its interval of the clip."""
    intervals = np.array_split(np.arange(len(off)), count)
    return [int(part[np.argmax(off[part])]) for part in intervals if len(part)]
