"""The best that a cyclic model can do on a recorded walk, with constant scores and one phase offset."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from gait.body.model_curves import curves
from gait.body.skeleton import ANGLES, CHANNELS, EVAL15, JOINTS, points
from gait.learn.cycles.sequence import Sequence
from gait.learn.prior.fit import channel_scale
from gait.learn.solve import readers, retarget

Floats = npt.NDArray[np.float64]
Indices = npt.NDArray[np.intp]
Sections = Mapping[str, Any]

COMPARED = [name for name in EVAL15 if name != "pelvis"]
COLUMNS = [JOINTS.index(name) for name in COMPARED]
TURNS = [CHANNELS.index(f"root_{axis}") for axis in ("roll", "pitch", "yaw")]
STARTS = 16  # phase offsets tried first, over one stride
EVERY = 12  # frames; a tenth of a second in CMU's recordings
STEP = 1e-4  # steps of the numerical derivatives: standard deviations and strides
PASSES = 12  # iterations of the nonlinear least squares
OFFSETS = "offsets"  # added to the sections of a model: channels (m, 30) moved by one sd of each offset


@dataclass
class Walk:
    """Some frames of a recorded walk.

    Attributes
    ----------
    subject : str
    at : (n,)
        Times of the frames, strides.
    joints : (n, 14, 3)
        COMPARED from the pelvis, along the pelvis's axes, metres.
    channels : (n, 30)
    measures : retarget.Measures
    stride_hz : float
        Strides per second, which the mean cycle of a model may follow.
    """

    subject: str
    at: Floats
    joints: Floats
    channels: Floats
    measures: retarget.Measures
    stride_hz: float


@dataclass
class Found:
    """Residuals of a walk.

    Attributes
    ----------
    joints_mm : float
        Mean distance of the joints after alignment of the pelvis, place and orientation.
    angles_deg : float
        Root mean square over the 24 angles.
    """

    joints_mm: float
    angles_deg: float


def walk(s: Sequence) -> Walk:
    """Take every EVERYth frame of a prepared recording with all of its joints and channels."""
    body, measures = retarget.levelled(readers.read(s.source).part(*s.kept)), s.measures
    if measures is None:
        raise ValueError(f"{s.source}: no joints")
    joints = dict(body.joints)
    way = joints["head"] - joints["neck"]
    way /= np.linalg.norm(way, axis=1)[:, None]
    joints["head_top"] = joints["neck"] + way * retarget.HEAD_LENGTH * measures.stature
    away = np.stack([joints[name] - joints["pelvis"] for name in COMPARED], axis=1)
    local = np.einsum("tji,tpj->tpi", body.pelvis, away)
    frames = np.arange(0, len(local), EVERY)
    visible = np.isfinite(local[frames]).all(axis=(1, 2)) & np.isfinite(s.channels[frames]).all(axis=1)
    frames = frames[visible]
    at, rate = frames / s.period.frames, s.fps / s.period.frames
    return Walk(s.subject, at, local[frames], s.channels[frames], measures, rate)


def sizes(sections: Sections) -> tuple[int, int, int]:
    """Numbers of components, of proportions and of static offsets."""
    return len(sections["CURV"]) - 1, len(sections.get("PROP", ())), len(sections.get(OFFSETS, ()))


def model_channels(w: Walk, sections: Sections, x: Floats) -> Floats:
    """Channels (k, n, 30) for k vectors of scores, proportions, offsets and a phase, x (k, q + p + m + 1)."""
    q, p, m = sizes(sections)
    scores = np.repeat(x[:, :q], len(w.at), axis=0)
    found = curves(sections, (w.at + x[:, -1:]).ravel(), scores, w.stride_hz).reshape(len(x), len(w.at), -1)
    return found + (x[:, q + p : -1] @ sections[OFFSETS])[:, None] if m else found


def model_joints(w: Walk, sections: Sections, x: Floats, channels: Floats) -> Floats:
    """Joints (k, n, 14, 3) as `Walk.joints`, for channels (k, n, 30)."""
    q, p, _ = sizes(sections)
    aligned = channels.reshape(-1, channels.shape[2]).copy()
    aligned[:, TURNS] = 0
    proportion = np.repeat(x[:, q : q + p], len(w.at), axis=0)
    found = points(sections, aligned, proportion)[:, COLUMNS]
    return found.reshape(*channels.shape[:2], len(COMPARED), 3) * w.measures.stature


def in_joints(w: Walk, sections: Sections, frames_alike: bool = False) -> Found:
    """Scores, proportions and phase by nonlinear least squares of the joints: no others do better.

    Then the most probable static offsets in addition.  Each offset has its standard deviation, and a
    coordinate of a joint has the standard deviation of this walk's residuals without offsets: one per frame,
    or one for the whole walk.
    """
    *others, m = sizes(sections)
    start = np.zeros((STARTS, sum(others) + m + 1))
    start[:, -1] = np.arange(STARTS) / STARTS
    squares = np.sum(_misses(w, sections, start) ** 2, axis=1)
    free = np.delete(np.arange(start.shape[1]), sum(others) + np.arange(m))
    x = _least(w, sections, start[int(np.argmin(squares))], free)
    if m:
        noise = float(np.sqrt(np.mean(_misses(w, sections, x[None]) ** 2)))
        x = _least(w, sections, x, np.arange(len(x)), noise * np.sqrt(len(w.at) if frames_alike else 1))
    return _found(w, sections, x)


def in_angles(w: Walk, sections: Sections) -> Found:
    """Scores and offset by least squares of the channels, as in the paper; then lengths from the joints.

    The sway does not count, and the other channels are divided by `channel_scale`.
    """
    q, p, _ = sizes(sections)
    tries = [_linear(w, sections, k / STARTS) for k in range(STARTS)]
    best, step = min(tries, key=lambda found: found[0]), 1 / STARTS
    while step > 0.003:
        step /= 2
        tries = [_linear(w, sections, best[1][-1] + d) for d in (-step, step)]
        best = min([best, *tries], key=lambda found: found[0])
    x = best[1]
    return _found(w, sections, _least(w, sections, x, np.arange(q, q + p)) if p else x)


def exact_angles(w: Walk, sections: Sections) -> Found:
    """Errors of the reduced skeleton with the recording's own angles."""
    x = np.zeros((1, sum(sizes(sections)) + 1))
    return Found(_distance(w, model_joints(w, sections, x, w.channels[None])), 0.0)


def _linear(w: Walk, sections: Sections, offset: float) -> tuple[float, Floats]:
    """Sum of squares, and scores with zero proportions and the offset (q + p + 1,)."""
    q, p, _ = sizes(sections)
    x = np.zeros((q + 1, q + p + 1))
    x[1:, :q], x[:, -1] = np.eye(q), offset
    use = channel_scale() * (np.arange(len(CHANNELS)) != CHANNELS.index("root_sway"))
    base, *moved = model_channels(w, sections, x)
    design = np.array([((m - base) * use).ravel() for m in moved]).reshape(q, base.size)
    goal = ((w.channels - base) * use).ravel()
    x[0, :q] = np.linalg.solve(design @ design.T, design @ goal)
    return float(np.sum((goal - x[0, :q] @ design) ** 2)), x[0]


def _least(w: Walk, sections: Sections, start: Floats, free: Indices, noise: float = 0.0) -> Floats:
    """Least squares of the joints, and of the offsets times `noise`, over the `free` entries of x."""

    def full(part: Floats) -> Floats:
        x = start.copy()
        x[free] = part
        return x

    def slopes(part: Floats) -> Floats:
        x = np.array([full(part), *(full(part + STEP * e) for e in np.eye(len(part)))])
        misses = _misses(w, sections, x, noise)
        return np.asarray((misses[1:] - misses[0]).T / STEP)

    result = least_squares(
        lambda part: _misses(w, sections, full(part)[None], noise)[0],
        start[free],
        jac=slopes,
        method="lm",
        ftol=1e-4,
        xtol=1e-4,
        max_nfev=PASSES,
    )
    return full(result.x)


def _misses(w: Walk, sections: Sections, x: Floats, noise: float = 0.0) -> Floats:
    """Model minus recording (k, n * 14 * 3), metres, and the m offsets times `noise`."""
    q, p, _ = sizes(sections)
    joints = model_joints(w, sections, x, model_channels(w, sections, x))
    return np.hstack([(joints - w.joints).reshape(len(x), -1), noise * x[:, q + p : -1]])


def _found(w: Walk, sections: Sections, x: Floats) -> Found:
    channels = model_channels(w, sections, x[None])
    angles = (channels[0] - w.channels)[:, : len(ANGLES)]
    return Found(
        _distance(w, model_joints(w, sections, x[None], channels)),
        float(np.degrees(np.sqrt(np.mean(angles**2)))),
    )


def _distance(w: Walk, joints: Floats) -> float:
    return float(1000 * np.linalg.norm(joints[0] - w.joints, axis=2).mean())
