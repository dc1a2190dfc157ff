"""What is cyclic, and what is walking or running."""

from pathlib import Path

import gait_generator as g
import numpy as np
import pytest

import gait
from gait.body import skeleton
from gait.body.skeleton import ANGLES
from gait.io import blob
from gait.learn.cycles import activity, period, verdict

FPS, PERIOD = 100, 110.0
SHIPPED = Path(gait.__file__).parent / "data/walk.gait"
PLACE = {"hip_flexion": 4, "knee_flexion": 7, "shoulder_flexion": 0, "elbow_flexion": 3}


def gait(frames=400, noise=1.0, lag=0.5, seed=0):
    """Angles (T, 24), radians, of a walk whose left side follows the right by `lag` cycles."""
    rng = np.random.default_rng(seed)
    angles = np.full((frames, len(ANGLES)), np.nan)
    for side, shift in (("r", 0.0), ("l", lag)):
        curve = g.mean_curves(np.arange(frames) / PERIOD + shift)[:, 3:11]
        for name, k in PLACE.items():
            angles[:, ANGLES.index(f"{side}_{name}")] = curve[:, k] + rng.normal(scale=noise, size=frames)
    return np.radians(angles)


def feet(duty, bob, cycles=4, lift=0.08, step=0.0):
    """Feet that are on the ground for the share `duty` of each cycle; halfway the ground rises by `step`."""
    phase = np.arange(round(cycles * PERIOD)) / PERIOD
    rise = step * (phase > cycles / 2)
    swing = [np.clip((np.mod(phase + s, 1) - duty) / (1 - duty), 0, 1) for s in (0.5, 0.0)]
    height = np.stack([0.04 + lift * np.sin(np.pi * s) + rise for s in swing], axis=1)
    apart = np.abs(np.cos(2 * np.pi * phase)) * 0.4
    pelvis = 0.53 + rise + bob * np.cos(4 * np.pi * phase)
    return activity.Feet(height, height - 0.02, pelvis, apart)


def judge(angles, footing=None, wanted="walk"):
    return verdict.judge(angles, period.find(angles, FPS), footing, wanted)


@pytest.mark.parametrize("duty", [0.58, 0.65, 0.75])
def test_who_always_has_a_foot_on_the_ground_walks(duty):
    footing = activity.footing(feet(duty, -0.01), PERIOD)
    assert not footing.running and footing.flight < 0.01 and footing.bob < -0.8
    assert judge(gait(), footing).accepted and judge(gait(), footing).activity == "walk"
    refused = judge(gait(), footing, "Running")
    assert not refused.accepted and "not running" in refused.reason


def test_a_walk_goes_where_the_pelvis_faces():
    angles = gait()
    found = period.find(angles, FPS)
    for degrees, accepted in ((0, True), (30, True), (90, False), (180, False)):
        yaw = np.radians(degrees) + 0.1 * np.sin(np.arange(len(angles)) / 20)
        yaw[:50] = np.nan
        assert verdict.judge(angles, found, None, "walk", yaw).accepted == accepted
        assert verdict.judge(angles, found, None, "sidestep", yaw).accepted
    assert "goes backwards" in verdict.judge(angles, found, None, "walk", yaw).reason
    assert verdict.judge(angles, found, None, "walk", np.full(len(angles), np.nan)).accepted


@pytest.mark.parametrize("duty", [0.25, 0.32, 0.37])
def test_who_flies_runs(duty):
    footing = activity.footing(feet(duty, 0.02), PERIOD)
    assert footing.running and judge(gait(), footing, "jog").accepted
    assert judge(gait(), footing, "treadmill").activity == "run"
    assert "this is running" in judge(gait(), footing).reason


def test_a_slow_run_is_known_by_the_pelvis():
    slow, lame = (activity.footing(feet(0.4, bob), PERIOD) for bob in (0.02, -0.01))
    assert 0.01 < slow.flight < 0.05 and slow.running and not lame.running


def test_uneven_ground_and_feet_that_stay_are_no_walk():
    assert "ground is not level" in judge(gait(), activity.footing(feet(0.65, 0, step=0.06), PERIOD)).reason
    still = judge(gait(), activity.footing(feet(0.65, 0, lift=0.005), PERIOD))
    assert "a foot stays on the ground" in still.reason and still.activity == ""
    assert judge(gait(), activity.footing(feet(0.65, 0, lift=0.005), PERIOD), "knee raises").accepted


def test_hopping_is_no_walk_but_cyclic():
    assert judge(gait(lag=0.5)).accepted
    assert "take turns" in judge(gait(lag=0.0)).reason
    assert judge(gait(lag=0.0), wanted="hop").accepted


@pytest.mark.parametrize("lag", [0.42, 0.5, 0.58])
def test_who_limps_takes_turns_though_the_legs_are_not_alike(lag):
    angles = gait(frames=440, lag=lag)
    stiff = [ANGLES.index(f"l_{name}") for name in ("hip_flexion", "knee_flexion")]
    angles[:, stiff] *= (0.2, 0.5)
    angles[:, stiff[0]] += 0.1 * np.sin(4 * np.pi * np.arange(len(angles)) / PERIOD)
    assert verdict.legs(angles, PERIOD) == pytest.approx(-np.cos(2 * np.pi * lag), abs=0.03)
    assert judge(angles).accepted


def test_legs_that_are_not_seen_say_nothing():
    angles = gait()
    angles[:, [ANGLES.index(f"l_{name}") for name in ("hip_flexion", "knee_flexion")]] = np.nan
    assert np.isnan(verdict.legs(angles, PERIOD))


def test_noise_and_wandering_are_not_cyclic():
    rng = np.random.default_rng(1)
    for angles in (rng.normal(size=(500, 24)), np.cumsum(rng.normal(size=(500, 24)), axis=0)):
        refused = judge(angles, wanted="dance")
        assert not refused.accepted
        assert "no period stands out" in refused.reason or "not like the next" in refused.reason


def test_no_period_is_no_verdict_on_the_rest():
    refused = judge(np.zeros((300, 24)))
    assert [e.name for e in refused.evidence] == ["cycles"] and "no cycle" in refused.reason


def test_repeats_is_the_share_that_noise_leaves():
    clean, noisy = gait(noise=0.0), gait(noise=5.0)
    assert verdict.repeats(clean, PERIOD) == pytest.approx(1, abs=1e-3)
    known = np.isfinite(clean).all(axis=0)
    signal = np.var(np.degrees(clean[:, known]), axis=0)
    expected = signal.sum() / np.sum(signal + 25.0)
    assert verdict.repeats(noisy, PERIOD) == pytest.approx(expected, abs=0.02)


def test_feet_that_are_not_seen_do_not_count():
    seen = feet(0.65, -0.01)
    gone = activity.Feet(seen.ankle * np.nan, seen.ball, seen.pelvis, seen.apart)
    assert activity.footing(gone, PERIOD) is None
    some = np.where(np.arange(len(seen.pelvis))[:, None] % 50 < 15, np.nan, seen.ankle)
    partly = activity.footing(activity.Feet(some, seen.ball, seen.pelvis, seen.apart), PERIOD)
    assert partly is not None and not partly.running


def test_the_shipped_walk_is_a_walk_by_its_angles_and_root():
    sections = blob.read(SHIPPED)
    curve = skeleton.curves(sections, np.arange(400) / 128, np.zeros((400, 1)))
    footing = activity.footing(activity.of_channels(curve), 128)
    assert not footing.running and footing.bob < -0.5 and 0.05 < footing.lift < 0.15 and footing.steps < 0.01
