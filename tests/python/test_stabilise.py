"""Films of a camera that turns: how it turned, and the pictures of a camera that stands still."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from gait import Camera, Video
from gait.io.keypoints_file import Keypoints
from gait.io.video import VideoWriter, sample_frames
from gait.track.camera_motion import View, map_pixels
from gait.track.stabilise import SteadyVideo, find_motion, moves

CAMERA = Camera.looking((0.0, -6.0, 1.5), (0.0, 0.0, 1.0), (320, 240), 270.0)
PANORAMA = replace(CAMERA, width=800, height=600, cx=400.0, cy=300.0)
FRAMES, PERSON = 10, 40


def scene(texture: float) -> np.ndarray:
    """Still picture of `PANORAMA`; `texture` in grey levels."""
    rng, picture = np.random.default_rng(3), np.full((600, 800), 120.0)
    for size in (6, 15, 40):
        coarse = rng.normal(size=(600 // size + 2, 800 // size + 2))
        picture += texture * cv2.resize(coarse, (800, 600), interpolation=cv2.INTER_CUBIC)
    return np.repeat(np.clip(picture, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def views(pan: float, shake: float) -> list[View]:
    """Views of a camera that pans and shakes, radians, and zooms a little."""
    turns = [(shake * np.sin(2 * k), pan * k / (FRAMES - 1), shake * np.cos(3 * k)) for k in range(FRAMES)]
    zooms = [1 + 0.002 * np.sin(k) * (shake > 0) for k in range(FRAMES)]
    return [View(cv2.Rodrigues(np.array(turn))[0], zoom) for turn, zoom in zip(turns, zooms, strict=True)]


def film(path, turned: list[View], texture: float = 25.0) -> Video:
    """Write what a camera sees: the scene, and a box that walks through it."""
    still, grid = scene(texture), np.stack(np.meshgrid(np.arange(320.0), np.arange(240.0)), axis=-1)
    with VideoWriter(path, 30, crf=6) as out:
        for k, view in enumerate(turned):
            places = map_pixels(grid, view.camera(CAMERA), PANORAMA).astype(np.float32)
            picture = cv2.remap(still, *cv2.split(places), cv2.INTER_LINEAR)
            picture[80:200, 20 * k : 20 * k + PERSON] = 30 + 10 * k
            out.write(picture)
    return Video(path)


def people() -> dict[int, Keypoints]:
    """Corners of the box in every frame."""
    uv = np.array([[(20 * k, 80), (20 * k + PERSON, 200)] for k in range(FRAMES)], float)
    return {0: Keypoints(np.arange(FRAMES), np.arange(FRAMES) / 30, ("a", "b"), uv, np.ones((FRAMES, 2)))}


@pytest.mark.parametrize(("pan", "shake"), [(0.0, 0.01), (0.3, 0.004)])
def test_the_turns_of_the_camera_are_found_and_undone(tmp_path, pan, shake):
    turned = views(pan, shake)
    video = film(tmp_path / "v.mp4", turned)
    samples = sample_frames(video)
    assert moves(CAMERA, samples, people())
    motion, why = find_motion(video, CAMERA, samples, people())
    assert motion is not None and why == ""
    back = turned[motion.reference].inverse()
    pixels = np.array([[40.0, 40.0], [270.0, 50.0], [160.0, 120.0], [60.0, 200.0], [280.0, 210.0]])
    for found, made in zip(motion.views, turned, strict=True):
        wanted = map_pixels(pixels, CAMERA, made.after(back).camera(CAMERA))
        assert np.hypot(*(map_pixels(pixels, CAMERA, found.camera(CAMERA)) - wanted).T).max() < 0.5
    steady = SteadyVideo(video, motion, samples)
    assert steady.width >= video.width + (60 if pan else 0)
    first, *others = list(steady.frames(grey=True))
    rows, columns = slice(25, 70), slice(steady.width // 2 - 60, steady.width // 2 + 60)  # over the box
    for frame in others:
        off = np.abs(frame.image[rows, columns].astype(float) - first.image[rows, columns])
        assert np.median(off) < 3
    for frame in range(FRAMES):
        view = steady.camera_at(frame, steady.camera)
        wanted = map_pixels(pixels, view, steady.camera)
        moved = replace(people()[0], frame=np.array([frame]), uv=pixels[None, :2])
        assert steady.keypoints(moved).uv[0] == pytest.approx(wanted[:2], abs=0.2)


def test_a_camera_that_stands_still_is_left_alone(tmp_path):
    video = film(tmp_path / "v.mp4", [View(np.eye(3))] * FRAMES)
    assert find_motion(video, CAMERA, sample_frames(video), people()) == (None, "")
    assert not moves(CAMERA, sample_frames(video), people())


def test_a_scene_without_texture_is_reported(tmp_path):
    video = film(tmp_path / "v.mp4", views(0.1, 0.01), texture=0.0)
    motion, why = find_motion(video, CAMERA, sample_frames(video), people())
    assert motion is None and "too little texture" in why
