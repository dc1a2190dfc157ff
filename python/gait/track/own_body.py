"""The person's own body: where its joints are, from the keypoints of several cameras and a first track.

Curves of a stride never fit a person exactly, so a fit of the body to all frames would explain the rest by
lengths.  Here only means count: of the differences between keypoints and the projected joints of the
first track over all its frames, one for each camera, joint and axis of the picture.  They are explained by

    joints of the body that are elsewhere in the limb before them, the same on both sides
    an error of place, heading and size of the whole track
    lasting errors of the detector: one that is fixed to the body, and one of each camera

with Gaussian priors, so what the cameras cannot show stays as in the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model, read_cyclic
from gait.body import skeleton
from gait.body.displaced import PARTS, displaced, effects
from gait.body.model_curves import curves
from gait.body.skeleton import mistaken_sides, other_sides
from gait.camera.camera import Camera
from gait.detect.profile import load, picture_height
from gait.errors import UserError
from gait.io import blob
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame
from gait.track.measured_joints import STUDENT_DEGREES
from gait.track.options import ClipOptions
from gait.track.scene import Scene

Array = NDArray[np.float64]

_SD = 0.012  # statures: between people and between conventions of where a joint is
_TRACK_SD = (0.1, 0.1, 0.03, 0.05, 0.03)  # of the whole track: forward, left, up, metres; heading; size
_SHARED = _OWN = 0.5  # of the detector's lasting sd: fixed to the body, and of each camera
_LEAST = 15  # frames that are `tracking`
_ROUNDS = 3  # of robust weights


@dataclass(frozen=True)
class _View:
    """Keypoints of one camera in the frames of the track, of J joints."""

    camera: Camera
    uv: Array  #: (T, J, 2) pixels; NaN where not found
    sd: Array  #: (T, J) pixels
    lasting: Array  #: (J,) shares of the person's height in the picture
    tall: Array  #: (T,) the latter, pixels


class FirstPass:
    """The frames of a track in which the person was followed; add each with `add`."""

    def __init__(self) -> None:
        self.estimates: list[Estimate] = []
        self.numbers: list[list[int]] = []  # of the frame in each film; -1: none

    def add(self, frame: Frame, estimate: Estimate) -> None:
        """Take in an estimate, unless it is uncertain or of a person who takes no strides."""
        if estimate.status == TrackStatus.TRACKING and estimate.takes_strides:
            self.estimates.append(estimate)
            others = [-1 if view is None else view.number for view in frame.others]
            self.numbers.append([frame.number, *others])


def own_model(options: ClipOptions, scene: Scene, first: FirstPass) -> Model:
    """Return the model whose body is the person's.

    Raises
    ------
    UserError
        If too few frames were tracked.
    """
    if len(first.estimates) < _LEAST:
        raise UserError(
            f"{options.video}: --body auto: {len(first.estimates)} frames are tracked, {_LEAST} are needed; "
            "leave it out"
        )
    sections = read_cyclic(options.model_name)
    return Model(blob.encode(displaced(sections, _displacements(sections, scene, first))))


def _displacements(sections: dict[str, blob.Array], scene: Scene, first: FirstPass) -> Array:
    """Estimate how far the joints `PARTS` (n, 3) are displaced, statures in the axes of their parents."""
    known = first.estimates[0].joint_names
    names = [name for name in scene.people[scene.person].names if name in known]
    joints, J, sd = _linear(sections, first.estimates, names)
    numbers = np.array(first.numbers)
    views = [
        _view(one.camera, one.people[one.person], names, numbers[:, k], joints)
        for k, one in enumerate((scene, *scene.further))
    ]
    found = np.zeros(len(sd))
    for _ in range(_ROUNDS):
        normal, right = np.diag(sd**-2.0), -found / sd**2
        for view in views:
            rows, errors, variance = _means(view, joints + J @ found, J)
            normal += (rows / variance[:, None]).T @ rows
            right += rows.T @ (errors / variance)
        found = found + np.linalg.solve(normal, right)
    return np.asarray(found[: 3 * len(PARTS)].reshape(-1, 3))


def _linear(
    sections: dict[str, blob.Array], estimates: list[Estimate], names: list[str]
) -> tuple[Array, Array, Array]:
    """Joints (T, J, 3), their change (T, J, 3, n) by each unknown, and its standard deviation (n,)."""
    states = [one.mean for one in estimates]
    known = list(estimates[0].joint_names)
    columns = [known.index(name) for name in names]
    joints = np.array([one.joints for one in estimates])[:, columns]
    pelvis = np.array([state.pelvis for state in states])
    heading, stature = (
        np.array([getattr(state, name) for state in states]) for name in ("heading", "stature")
    )
    channels = curves(
        sections,
        np.array([state.phase for state in states]),
        np.array([state.coef for state in states]),
        np.array([state.stride_hz for state in states]),
    )
    channels[:, : len(skeleton.ANGLES)] += [state.offset[: len(skeleton.ANGLES)] for state in states]
    turns = np.array([(state.heading, state.pitch, state.roll) for state in states])
    channels[:, skeleton.root_columns(sections)] += turns
    moved = effects(sections, channels)[:, columns] * stature[:, None, None, None]
    c, s, o = np.cos(heading), np.sin(heading), np.zeros(len(states))
    axes = np.stack([np.stack([c, s, o], 1), np.stack([-s, c, o], 1), np.stack([o, o, o + 1], 1)], axis=2)
    whole = np.empty((*joints.shape, 5))
    whole[..., :3] = axes[:, None]
    arm = joints - pelvis[:, None]
    whole[..., 3] = np.cross([0.0, 0.0, 1.0], arm)
    whole[..., 4] = arm
    kinds = sorted({name.partition("_")[2] for name in names})
    detector = np.zeros((*joints.shape, len(kinds), 3))
    for j, name in enumerate(names):
        mirror = np.array([1.0, -1.0 if name.startswith("r_") else 1.0, 1.0])
        detector[:, j, :, kinds.index(name.partition("_")[2])] = axes * mirror * stature[:, None, None]
    lasting = [_SHARED * load("full").joint(f"l_{kind}").lasting_sd for kind in kinds]
    sd = np.concatenate([np.full(moved.shape[-1], _SD), _TRACK_SD, np.repeat(lasting, 3)])
    return joints, np.concatenate([moved, whole, detector.reshape(*joints.shape, -1)], axis=-1), sd


def _view(camera: Camera, found: Keypoints, names: list[str], numbers: Array, joints: Array) -> _View:
    """Keypoints in the frames with these `numbers`, with their sides as they fit the track better."""
    assert found.sd is not None and found.lasting_sd is not None
    at = np.searchsorted(found.frame, numbers).clip(0, len(found.frame) - 1)
    visible = found.frame[at] == numbers
    columns = [found.names.index(name) for name in names]
    tall = np.maximum(picture_height(found)[at], 1.0)
    uv = np.where(visible[:, None, None], found.uv[at][:, columns], np.nan)
    mistaken = mistaken_sides(uv, camera.project(joints), names, tall)
    uv = np.where(mistaken[:, None, None], uv[:, other_sides(names)], uv)
    lasting = np.nanmean(found.lasting_sd[at][:, columns] / tall[:, None], axis=0)
    return _View(camera, uv, found.sd[at][:, columns], _OWN * lasting, tall)


def _means(view: _View, joints: Array, J: Array) -> tuple[Array, Array, Array]:
    """Mean errors of each joint's keypoints (2 J,), change by each unknown (2 J, n), and variance (2 J,).

    In shares of the person's height in the picture.
    """
    expected = view.camera.project(joints)
    rows = np.einsum("tjab,tjbn->tjan", view.camera.linearised(joints)[1], J)
    errors = view.uv - expected
    square = np.sum(errors**2, axis=2) / (view.sd**2 + (view.lasting * view.tall[:, None]) ** 2)
    weight = np.nan_to_num(1.0 / (view.sd**2 * (1.0 + square / STUDENT_DEGREES))) * view.tall[:, None]
    total = (weight * view.tall[:, None]).sum(axis=0)
    used = total > 0
    mean = weight[:, used] / total[used]
    return (
        np.einsum("tj,tjan->jan", mean, rows[:, used]).reshape(-1, J.shape[-1]),
        np.einsum("tj,tja->ja", mean, np.nan_to_num(errors[:, used])).ravel(),
        np.repeat(view.lasting[used] ** 2 + 1.0 / total[used], 2),
    )
