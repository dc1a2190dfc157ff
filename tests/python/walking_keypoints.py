"""Keypoints of a person with the shipped model who walks straight on, as seen by a camera."""

from dataclasses import replace

import numpy as np

from gait.bindings.model import Model
from gait.io.keypoints_file import Keypoints
from gait.track.walk_start import make_camera

MODEL = Model()
SIZE = (1280, 720)
NAMES = tuple(name for name in MODEL.joint_names if name not in ("pelvis", "neck", "head_top"))
TOWARDS, ACROSS = ((-1.3, (0.3, 7.5)), (0.0, (-1.8, 5.0)))  # heading from -y to the right, and first place


def walk_at(time, walk=TOWARDS, *, speed=1.25, stature=1.75, standing=False, belt=0.0):
    """Joints of the model (J, 3) at a time."""
    prior, _ = MODEL.prior()
    heading, place = walk
    rate = speed / (MODEL.info.stride_length * stature)
    way = 0.0 if standing else (speed - belt) * time
    state = replace(prior, phase=0.3 if standing else (0.3 + rate * time) % 1.0, stature=stature)
    state.heading, state.stride_hz = heading, rate
    x, y = place[0] + way * np.cos(heading), place[1] + way * np.sin(heading)
    state.pelvis = np.array([x, y, 0.0])
    state.pelvis[2] = MODEL.pelvis_height(state)
    return MODEL.pose(state)[0]


def keypoints(camera, walk=TOWARDS, *, seconds=3.0, noise=1.5, seed=0, **how):
    """Keypoints at 15 frames per second; `how` as for `walk_at`."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1 / 15)
    shown = [MODEL.joint_names.index(name) for name in NAMES]
    uv = np.array([camera.project(walk_at(t, walk, **how))[shown] for t in time])
    uv += noise * rng.standard_normal(uv.shape)
    return Keypoints(np.arange(len(time)), time, NAMES, uv, np.ones(uv.shape[:2]))


def view(focal=1000.0, tilt=0.08, roll=0.0, height=1.4):
    """Camera of a phone on a tripod."""
    return make_camera(np.array([np.log(focal), tilt, roll, np.log(height)]), SIZE)
