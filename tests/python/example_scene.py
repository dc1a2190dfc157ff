"""The scene of the C examples in README and libgait/doc, drawn with the shipped model."""

import cv2
import numpy as np

import gait


def drawn_walk(frames: int) -> tuple[np.ndarray, list[np.ndarray], list[float]]:
    """Empty scene and grey frames of what the C examples describe, and the true x of the pelvis."""
    model = gait.Model()
    rotation = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], float)
    camera = gait.Camera(640, 480, 800.0, 800.0, 320.0, 240.0, rotation, np.array([0, 1.4, 8]))
    rng = np.random.default_rng(1)
    plate = cv2.resize(rng.integers(40, 200, (96, 128)).astype(np.uint8), (640, 480))
    cloth = cv2.resize(rng.integers(0, 40, (160, 213)).astype(np.uint8), (640, 480))
    person, _ = model.prior()
    person.phase, person.pelvis[0] = 0.3, -1.0
    pictures, places = [], []
    for _ in range(frames):
        person.pelvis[2] = model.pelvis_height(person)
        ids = model.render(camera, person)
        pictures.append(np.where(ids > 0, 30 + ids * 12 % 160 + cloth, plate).astype(np.uint8))
        places.append(float(person.pelvis[0]))
        person.phase = (person.phase + person.stride_hz / 30) % 1
        person.pelvis[0] += person.stature * person.stride_hz * model.info.stride_length / 30
    return plate, pictures, places
