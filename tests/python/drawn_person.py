"""A person drawn by the library's own rasteriser on a noisy wall: a small clip of exactly known states."""

from pathlib import Path

import cv2
import numpy as np

from gait import Camera, State, VideoWriter
from gait.motion.evaluate import root_path

DATA = Path(__file__).resolve().parents[2] / "../shared/data"
FPS = 30
SIZE = (320, 240)


def camera(place=(0.0, -6.0, 1.4), focal=330.0):
    """Level view along +y of a walk along +x."""
    return Camera.looking(place, (0.0, 0.0, 0.9), SIZE, focal)


def wall(seed=0):
    """Smooth random texture, (240, 320, 3)."""
    noise = np.random.default_rng(seed).normal(0, 1, (SIZE[1], SIZE[0], 3))
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.0)
    return np.clip(150 + 90 * smooth / smooth.std() * 0.3, 0, 255).astype(np.uint8)


def state_at(model, sections, time, heading=0.0, start=(-0.6, 0.0), rate=0.9, phase=0.2, stature=1.75):
    """State of the mean person after `time` seconds."""
    path = stature * root_path(sections, np.array([phase, phase + rate * time]), rate)
    move = path[1] - path[0]
    way = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    state = State(phase=(phase + rate * time) % 1, stride_hz=rate, stature=stature, heading=heading)
    state.coef = np.zeros(model.info.components)
    state.pelvis[:2] = np.array(start) + way @ move[:2]
    state.pelvis[2] = model.pelvis_height(state)
    return state


def draw(model, view, state, plate, seed=0):
    """Picture of a state: every limb in its own colour, shaded along its texture."""
    ids = model.render(view, state)
    colours = np.random.default_rng(3).integers(10, 90, (model.info.limbs + 1, 3))
    picture = np.where(ids[..., None] > 0, colours[ids], plate).astype(float)
    picture = cv2.GaussianBlur(picture, (0, 0), 0.6)
    picture += np.random.default_rng(seed).normal(0, 1.5, picture.shape)
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def clip(model, sections, frames, view=None, plate=None, **motion):
    """Pictures and states of a walk."""
    view, plate = view or camera(), wall() if plate is None else plate
    states = [state_at(model, sections, i / FPS, **motion) for i in range(frames)]
    return [draw(model, view, state, plate, i) for i, state in enumerate(states)], states


def write(path, pictures):
    """Put pictures into a video file, nearly without loss."""
    with VideoWriter(path, FPS, crf=5) as film:
        for picture in pictures:
            film.write(picture)
