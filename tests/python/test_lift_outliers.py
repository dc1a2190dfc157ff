"""Points that jump are taken out of 2-D tracks, quick motion is not; noise is told from motion."""

from dataclasses import replace

import numpy as np
import pytest

from gait.lift.outliers import shake, without_jumps
from gait.io.keypoints_file import Tracks


def swinging(rate: float, frames: int = 60, seed: int = 4) -> Tracks:
    """A foot and a wrist that swing by 60 and 40 pixels once a second, 3 px of noise."""
    time = np.arange(frames) / rate
    turn = 2 * np.pi * time[:, None]
    u = 300 + 30 * time[:, None] + np.array([60, 40]) * np.sin(turn)
    v = 200 + np.array([20, 10]) * np.cos(turn) + np.zeros((1, 2))
    uv = np.stack([u, v], axis=2) + np.random.default_rng(seed).normal(0, 3, (frames, 2, 2))
    return Tracks(np.arange(frames), time, ("l_ankle", "r_wrist"), uv, np.ones((frames, 2)))


@pytest.mark.parametrize("rate", [10, 30, 60])
def test_quick_motion_stays(rate):
    tracks = swinging(rate)
    kept, jumps = without_jumps(tracks, 3.0)
    assert jumps == []
    np.testing.assert_array_equal(kept.uv, tracks.uv)


@pytest.mark.parametrize("off", [(80, 0), (0, -150), (-1000, 1000)])
def test_a_jump_is_taken_out_and_named(off):
    tracks = swinging(30)
    tracks.uv[20, 1] += off
    kept, jumps = without_jumps(tracks, 3.0)
    assert jumps == [(20, "r_wrist")]
    assert np.isnan(kept.uv[20, 1]).all() and kept.seen.sum() == tracks.seen.sum() - 1


def test_many_jumps_beside_gaps():
    tracks = swinging(30)
    tracks.uv[[5, 17, 18, 40], 0] = 0.0
    tracks.uv[30:36, 1] = np.nan
    _, jumps = without_jumps(tracks, 3.0)
    assert jumps == [(5, "l_ankle"), (17, "l_ankle"), (18, "l_ankle"), (40, "l_ankle")]


def test_the_furthest_goes_first_whatever_it_bends():
    """As measured anew after each, at the ends too."""
    rng = np.random.default_rng(3)
    tracks = swinging(30, frames=200)
    tracks.uv[rng.random((200, 2)) < 0.1] = np.nan
    wild = rng.random((200, 2)) < 0.08
    tracks.uv[wild] += rng.normal(0, 200, (wild.sum(), 2))
    tracks.uv[[0, 1, 198, 199], 0] += (300, 0)
    uv, gone = tracks.uv.copy(), []
    for j, name in enumerate(tracks.names):
        while True:
            rows = np.flatnonzero(np.isfinite(uv[:, j, 0]))
            on = [
                [np.interp(tracks.time[b], tracks.time[[a, c]], uv[[a, c], j, i]) for i in range(2)]
                for a, b, c in zip(rows, rows[1:], rows[2:], strict=False)
            ]
            apart = np.pad(np.linalg.norm(uv[rows[1:-1], j] - on, axis=1), 1)
            if apart.max() <= 8 * max(np.sqrt(1.5) * 3.0, 1.4826 * np.median(apart)):
                break
            gone.append((int(rows[apart.argmax()]), name))
            uv[rows[apart.argmax()], j] = np.nan
    assert len(gone) > 15 and without_jumps(tracks, 3.0)[1] == sorted(gone)


def test_few_points_are_left_alone():
    tracks = swinging(30, frames=4)
    tracks.uv[1] += 500
    assert without_jumps(tracks, 3.0)[1] == []


@pytest.mark.parametrize("noise", [0.0, 4.0, 12.0])
def test_noise_is_told_from_motion(noise):
    """The tracks have 3 px of their own."""
    tracks = swinging(30, frames=300)
    more = noise * np.random.default_rng(7).standard_normal(tracks.uv.shape)
    assert shake(replace(tracks, uv=tracks.uv + more)) == pytest.approx(np.hypot(3, noise), rel=0.12)


def test_noise_is_not_told_of_slow_pictures_or_single_frames():
    tracks = swinging(10)
    assert np.isnan(shake(tracks))
    gaps = tracks.uv.copy()
    gaps[::3] = np.nan
    assert np.isnan(shake(replace(tracks, time=tracks.time / 10, uv=gaps)))
