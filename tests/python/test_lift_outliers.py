"""Spikes are removed from 2-D keypoints, fast motion is not; noise is distinguished from motion."""

from dataclasses import replace

import numpy as np
import pytest
import robust

from gait.bindings.lifter import remove_spikes, weight_outliers
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints.noise import shake, without_spikes


def swinging(rate: float, frames: int = 60, seed: int = 4) -> Keypoints:
    """A foot and a wrist that swing by 60 and 40 pixels once a second, 3 px of noise."""
    time = np.arange(frames) / rate
    turn = 2 * np.pi * time[:, None]
    u = 300 + 30 * time[:, None] + np.array([60, 40]) * np.sin(turn)
    v = 200 + np.array([20, 10]) * np.cos(turn) + np.zeros((1, 2))
    uv = np.stack([u, v], axis=2) + np.random.default_rng(seed).normal(0, 3, (frames, 2, 2))
    return Keypoints(np.arange(frames), time, ("l_ankle", "r_wrist"), uv, np.ones((frames, 2)))


@pytest.mark.parametrize("rate", [10, 30, 60])
def test_quick_motion_stays(rate):
    keypoints = swinging(rate)
    kept, spikes = without_spikes(keypoints, 3.0)
    assert spikes == []
    np.testing.assert_array_equal(kept.uv, keypoints.uv)


@pytest.mark.parametrize("off", [(80, 0), (0, -150), (-1000, 1000)])
def test_a_spike_is_taken_out_and_named(off):
    keypoints = swinging(30)
    keypoints.uv[20, 1] += off
    kept, spikes = without_spikes(keypoints, 3.0)
    assert spikes == [(20, "r_wrist")]
    assert np.isnan(kept.uv[20, 1]).all() and kept.visible.sum() == keypoints.visible.sum() - 1


def test_many_spikes_beside_gaps():
    keypoints = swinging(30)
    keypoints.uv[[5, 17, 18, 40], 0] = 0.0
    keypoints.uv[30:36, 1] = np.nan
    _, spikes = without_spikes(keypoints, 3.0)
    assert spikes == [(5, "l_ankle"), (17, "l_ankle"), (18, "l_ankle"), (40, "l_ankle")]


@pytest.mark.parametrize("seed", range(5))
def test_spikes_are_those_of_the_numpy_version(seed):
    """Spikes beside gaps and at the ends are found: the noise is measured again after each removal."""
    rng = np.random.default_rng(seed)
    keypoints = swinging(30, frames=120)
    keypoints.uv[rng.random((120, 2)) < 0.1] = np.nan
    outliers = rng.random((120, 2)) < 0.08
    keypoints.uv[outliers] += rng.normal(0, 200, (outliers.sum(), 2))
    keypoints.uv[[0, 1, 118, 119], 0] += (300, 0)
    sd = rng.uniform(2, 4, (120, 2))
    kept = remove_spikes(keypoints.time, keypoints.uv, sd)
    for j in range(2):
        gone = robust.spikes(keypoints.time, keypoints.uv[:, j], sd[:, j])
        assert len(gone) > 3
        np.testing.assert_array_equal(np.flatnonzero(kept[:, j] < 0), sorted(gone))
    np.testing.assert_array_equal(kept[kept > 0], sd[kept > 0])


@pytest.mark.parametrize("count", [1, 2, 15])
def test_outliers_are_weighted_as_by_the_numpy_version(count):
    rng = np.random.default_rng(count)
    for far in (1.0, 30.0, 3000.0):
        square, sd = far * rng.chisquare(2, count), rng.uniform(1, 3, count)
        np.testing.assert_allclose(weight_outliers(square, sd), robust.weighted(square, sd), rtol=1e-12)


def test_few_points_are_left_alone():
    keypoints = swinging(30, frames=4)
    keypoints.uv[1] += 500
    assert without_spikes(keypoints, 3.0)[1] == []


@pytest.mark.parametrize("noise", [0.0, 4.0, 12.0])
def test_noise_is_distinguished_from_motion(noise):
    """The keypoints themselves have 3 px."""
    keypoints = swinging(30, frames=300)
    more = noise * np.random.default_rng(7).standard_normal(keypoints.uv.shape)
    assert shake(replace(keypoints, uv=keypoints.uv + more)) == pytest.approx(np.hypot(3, noise), rel=0.12)


def test_noise_is_not_measured_in_slow_pictures_or_single_frames():
    keypoints = swinging(10)
    assert np.isnan(shake(keypoints))
    gaps = keypoints.uv.copy()
    gaps[::3] = np.nan
    assert np.isnan(shake(replace(keypoints, time=keypoints.time / 10, uv=gaps)))
