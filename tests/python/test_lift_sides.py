"""Left and right points that were swapped for some frames are put back; other points stay."""

from dataclasses import replace

import numpy as np
import pytest

from gait.body.skeleton import other_sides, side_pairs
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints import swaps
from gait.lift.keypoints.swaps import SWAP_EVIDENCE, Reading, undo_swaps

NAMES = ("pelvis", "l_knee", "r_knee", "l_ankle", "r_ankle")
LEFT, RIGHT = [1, 3], [2, 4]
FRAMES, NOISE = 90, 2.0


def walking(rate=30.0, gaps=0.0, noise=NOISE):
    """Legs that swing past each other once a second, seen from the side, while the body moves on."""
    rng = np.random.default_rng(6)
    time = np.arange(FRAMES) / rate
    uv = places(time) + noise * rng.normal(size=(FRAMES, 5, 2))
    uv[rng.random((FRAMES, 5)) < gaps] = np.nan
    return Keypoints(np.arange(FRAMES) + 7, time, NAMES, uv, rng.uniform(0.8, 1, (FRAMES, 5)))


def places(time):
    """Points (T, 5, 2) without noise."""
    swing = np.sin(2 * np.pi * (time + 0.13))
    u = 50 * time[:, None] + np.stack([0 * swing, 25 * swing, -25 * swing, 40 * swing, -40 * swing], axis=1)
    v = np.array([200, 260, 260, 310, 310]) + 8 * np.abs(swing)[:, None] * [0, 1, -1, 2, -2]
    return np.stack([u, v + np.zeros_like(u)], axis=2)


def model(keypoints, near=None):
    """Log density of keypoints for a model that knows how these legs swing, and where they are next."""
    expected = places(keypoints.time)
    square = ((keypoints.uv - expected) ** 2).sum(axis=2) / NOISE**2
    return Reading(-0.5 * float(np.nansum(np.minimum(square, 50))), expected)


def swapped(keypoints, first, last, left=LEFT, right=RIGHT):
    """Keypoints with sides swapped in rows `first` to `last`."""
    uv, confidence = keypoints.uv.copy(), keypoints.confidence.copy()
    for values in (uv, confidence):
        values[first : last + 1, left + right] = values[first : last + 1, right + left]
    return replace(keypoints, uv=uv, confidence=confidence)


@pytest.mark.parametrize("rate", [10, 25, 30, 60])
@pytest.mark.parametrize("gaps", [0.0, 0.1])
def test_what_is_right_stays(rate, gaps):
    keypoints = walking(rate, gaps)
    kept, found = undo_swaps(keypoints, NOISE, model)
    assert found == []
    np.testing.assert_array_equal(kept.uv, keypoints.uv)
    np.testing.assert_array_equal(kept.confidence, keypoints.confidence)


@pytest.mark.parametrize("rate", [10, 30, 60])
@pytest.mark.parametrize(("first", "last"), [(20, 20), (31, 36), (30, 50), (0, 9), (75, 89)])
def test_swapped_legs_are_put_back_and_named(rate, first, last):
    keypoints = walking(rate)
    back, found = undo_swaps(swapped(keypoints, first, last), NOISE, model)
    assert [each.joint for each in found] == ["knee", "ankle"]
    for each in found:
        assert abs(each.spans[0][0] - 7 - first) <= 1 and abs(each.spans[-1][1] - 7 - last) <= 1
    off = np.linalg.norm(back.uv - keypoints.uv, axis=2)
    assert off.max() < 20  # where the legs meet either reading may be right
    assert np.array_equal(back.confidence[off == 0], keypoints.confidence[off == 0])


def test_one_joint_alone_and_gaps():
    keypoints = walking(gaps=0.15)
    back, found = undo_swaps(swapped(keypoints, 40, 55, [3], [4]), NOISE, model)
    assert [each.joint for each in found] == ["ankle"]
    assert np.nanmax(np.linalg.norm(back.uv - keypoints.uv, axis=2)) < 20


def test_several_intervals():
    spoilt = swapped(swapped(walking(), 10, 14), 60, 70)
    _, found = undo_swaps(spoilt, NOISE, model)
    assert [len(each.spans) for each in found] == [2, 2]


def test_outliers_do_not_hide_a_swap():
    keypoints, rng = walking(), np.random.default_rng(3)
    outliers = rng.random(keypoints.uv.shape[:2]) < 0.05
    keypoints.uv[outliers] += 150 * rng.normal(size=(outliers.sum(), 2))
    back, found = undo_swaps(swapped(keypoints, 60, 80), NOISE, model)
    assert [each.joint for each in found] == ["knee", "ankle"]
    off = np.linalg.norm(back.uv - keypoints.uv, axis=2)
    assert off[~outliers].max() < 30
    assert undo_swaps(keypoints, NOISE, model)[1] == []


def test_the_motion_decides():
    """Points that continue better when swapped stay if the motion does not then fit better."""
    spoilt = swapped(walking(), 30, 50)
    back, found = undo_swaps(spoilt, NOISE, lambda keypoints, near: Reading(0.0, keypoints.uv))
    assert found == []
    np.testing.assert_array_equal(back.uv, spoilt.uv)


def test_what_the_motion_explains_no_better_is_not_tried():
    """The motion is fitted with and without the proposal; nothing else may gain."""
    tried = []

    def counted(keypoints, near):
        tried.append(keypoints)
        return model(keypoints)

    undo_swaps(swapped(walking(), 30, 50), NOISE, counted)
    assert len(tried) == 2


def test_what_fits_hardly_better_stays():
    """Each pair has to gain `SWAP_EVIDENCE` nats: two here."""
    right = walking()
    spoilt = swapped(right, 30, 50)
    gain = model(right)[0] - model(spoilt)[0]
    for nats, put in ((0.7 * 2 * SWAP_EVIDENCE, False), (1.5 * 2 * SWAP_EVIDENCE, True)):
        share = nats / gain

        def scaled(keypoints, near, share=share):
            found = model(keypoints)
            return found._replace(density=share * found.density)

        _, found = undo_swaps(spoilt, NOISE, scaled)
        assert bool(found) == put


@pytest.mark.parametrize("first", [40, 50])
def test_more_than_few_frames_are_left_alone(first):
    """Which of the two is right is then undetermined."""
    spoilt = swapped(walking(), first, 89)
    back, found = undo_swaps(spoilt, NOISE, model)
    assert found == []
    np.testing.assert_array_equal(back.uv, spoilt.uv)


def test_slow_pictures_and_few_frames_are_left_alone():
    spoilt = swapped(walking(8), 30, 40)
    assert undo_swaps(spoilt, NOISE, model) == (spoilt, [])
    few = swapped(walking(), 1, 1)
    few = replace(few, frame=few.frame[:2], time=few.time[:2], uv=few.uv[:2], confidence=few.confidence[:2])
    assert undo_swaps(few, NOISE, model) == (few, [])
    alone = replace(walking(), names=("pelvis", "l_knee", "r_hip", "neck", "r_ankle"))
    assert undo_swaps(alone, NOISE, model)[1] == []
    never = replace(walking(), uv=np.full((FRAMES, 5, 2), np.nan))
    assert undo_swaps(never, NOISE, model)[1] == []


def test_an_outlier_is_no_swap():
    keypoints = walking()
    keypoints.uv[33, 3] += [150, -60]
    assert undo_swaps(keypoints, NOISE, model)[1] == []


@pytest.mark.parametrize(
    ("right", "wrong"), [((45, 60), (15, 26)), ((60, 61), (22, 41)), ((50, 65), (28, 31))]
)
def test_a_false_proposal_beside_a_true_one_falls_alone(monkeypatch, right, wrong):
    flags = np.zeros((FRAMES, 2), bool)
    for first, last in (right, wrong):
        flags[first : last + 1] = True
    monkeypatch.setattr(swaps, "suspected", lambda *_: flags)
    _, found = undo_swaps(swapped(walking(), *right), NOISE, model)
    assert [each.spans for each in found] == [[(right[0] + 7, right[1] + 7)]] * 2


def test_a_point_whose_partner_is_missing_goes_with_its_limb():
    keypoints = walking()
    keypoints.uv[45:48, 3] = np.nan
    back, _ = undo_swaps(swapped(keypoints, 40, 55), NOISE, model)
    assert np.array_equal(back.visible, keypoints.visible)


def test_an_interval_is_judged_by_its_surroundings_without_outliers():
    keypoints, parts = walking(), []
    keypoints.uv[33, 0] += 300
    undo_swaps(swapped(keypoints, 30, 40), NOISE, lambda part, near: parts.append(part) or model(part))
    assert parts
    for part in parts:
        assert part.frame[0] == 7 and abs(int(part.frame[-1]) - (40 + 30 + 7)) <= 1  # a second more
        assert np.isnan(part.uv[33, 0]).all() and np.isfinite(part.uv[32, 0]).all()


def test_points_without_another_side_are_their_own():
    names = ("r_hip", "neck", "l_hip", "l_knee", "l_ankle", "r_ankle")
    assert other_sides(names) == [2, 1, 0, 3, 5, 4]
    assert side_pairs(names) == [(2, 0), (4, 5)]
