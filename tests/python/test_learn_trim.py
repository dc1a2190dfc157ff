"""Starts, stops and turns cut off the ends of recordings."""

import gait_generator as g
import numpy as np
import pytest

from gait.learn.cycles import trim

FPS, PERIOD = 100, 110


def stretch(o, place=True, yaw=True):
    track = trim.Track(o.place if place else None, o.yaw if yaw else None)
    return trim.stretch(o.angles, FPS, "refined", track)


@pytest.mark.parametrize("strides", [2, 4, 8])
@pytest.mark.parametrize("stand", [0.0, 1.0, 3.0])
def test_the_steady_stretch_is_kept(strides, stand):
    o = g.outing(np.random.default_rng(1), FPS, PERIOD, strides, stand=stand, stop=stand)
    kept, found = stretch(o)
    assert abs(kept.start - o.begin) < PERIOD / 3 and abs(kept.stop - o.end) < PERIOD / 3
    assert found.frames == pytest.approx(PERIOD, rel=0.02)
    assert "slower" in kept.before and kept.after


def test_why_is_said_in_words():
    kept, _ = stretch(g.outing(np.random.default_rng(1), FPS, PERIOD))
    assert kept.before == "standing and slower"
    assert "turning" in kept.after and "slower" in kept.after and "standing" in kept.after


@pytest.mark.parametrize(("place", "yaw"), [(False, False), (False, True), (True, False)])
def test_what_is_unknown_is_not_needed(place, yaw):
    """Angles alone show standing; the pace of the joints shows the rest roughly."""
    o = g.outing(np.random.default_rng(2), FPS, PERIOD)
    kept, found = stretch(o, place, yaw)
    assert abs(kept.start - o.begin) < PERIOD and abs(kept.stop - o.end) < PERIOD
    assert found.frames == pytest.approx(PERIOD, rel=0.02)


def test_a_treadmill_stays_in_place():
    o = g.outing(np.random.default_rng(3), FPS, PERIOD)
    o.place = np.random.default_rng(3).normal(scale=0.01, size=o.place.shape)
    kept, found = stretch(o)
    assert abs(kept.start - o.begin) < PERIOD and found.frames == pytest.approx(PERIOD, rel=0.02)


@pytest.mark.parametrize("missing", [0.1, 0.3])
def test_gaps_do_not_look_like_standing(missing):
    rng = np.random.default_rng(4)
    o = g.outing(rng, FPS, PERIOD, strides=5)
    o.angles = g.remove_blocks(rng, o.angles, missing)
    o.place[180:200] = np.nan
    o.angles[300:320] = np.nan
    kept, found = stretch(o)
    assert abs(kept.start - o.begin) < PERIOD / 2 and abs(kept.stop - o.end) < PERIOD / 2
    assert found.frames == pytest.approx(PERIOD, rel=0.02)


@pytest.mark.parametrize("noise", [0.0, 0.5, 2.0])
def test_a_steady_walk_loses_nothing(noise):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        frames = int(rng.integers(190, 500))
        o = g.outing(rng, FPS, PERIOD, frames / PERIOD, stand=0, start=0, turn=0, stop=0, noise=noise)
        kept, _ = stretch(o)
        assert (kept.start, kept.stop, kept.before, kept.after) == (0, len(o.angles), "", "")


def test_a_walk_round_a_circle_is_steady():
    o = g.outing(np.random.default_rng(5), FPS, PERIOD, 6, stand=0, start=0, turn=0, stop=0)
    bend = np.linspace(0, 2 * np.pi, len(o.yaw))
    o.yaw = o.yaw + bend
    o.place = 1.2 * np.stack([np.sin(bend), -np.cos(bend)], axis=1)
    assert stretch(o)[0] == trim.Kept(0, len(o.yaw))


def test_of_two_walks_with_a_turn_between_the_longer_is_kept():
    first = g.outing(np.random.default_rng(6), FPS, PERIOD, 3, stop=0)
    second = g.outing(np.random.default_rng(7), FPS, PERIOD, 5, stand=0, turn=0, stop=0)
    angles = np.concatenate([first.angles, second.angles])
    back = first.place[-1] - second.place
    track = trim.Track(np.concatenate([first.place, back]), np.concatenate([first.yaw, second.yaw + np.pi]))
    kept, found = trim.stretch(angles, FPS, "refined", track)
    begin = len(first.angles) + second.begin
    assert abs(kept.start - begin) < PERIOD / 2 and kept.stop == len(angles) and kept.after == ""
    assert found.frames == pytest.approx(PERIOD, rel=0.01)


def test_unseen_ends_are_cut():
    o = g.outing(np.random.default_rng(8), FPS, PERIOD, 4, stand=0, start=0, turn=0, stop=0)
    o.angles[:60], o.angles[-45:] = np.nan, np.nan
    o.place[:60], o.place[-45:] = np.nan, np.nan
    kept, found = stretch(o)
    assert abs(kept.start - 60) < 30 and abs(kept.stop - (len(o.yaw) - 45)) < 30
    assert found.frames == pytest.approx(PERIOD, rel=0.01)


@pytest.mark.parametrize("frames", [3, 12, 60, 200])
def test_short_noise_still_and_unseen_recordings_do_not_fail(frames):
    rng = np.random.default_rng(9)
    for angles in (rng.normal(size=(frames, 24)), np.zeros((frames, 24)), np.full((frames, 24), np.nan)):
        kept, _ = trim.stretch(angles, FPS, "refined", trim.Track(np.zeros((frames, 2)), np.zeros(frames)))
        assert 0 <= kept.start <= kept.stop <= frames
