"""Proportions: how limbs differ in length among people of one stature, learnt and posed."""

from dataclasses import replace

import numpy as np
import pytest

from gait import Model, State
from gait.bindings.model import read_blob
from gait.body import skeleton
from gait.body.model_curves import curves
from gait.body.skeleton import CHANNELS, JOINTS, Proportions, default_skeleton, points
from gait.io import blob
from gait.learn.prior import lengths
from gait.learn.solve import retarget
from gait.learn.solve.retarget import Measures

MEAN = Proportions()
FRAMES = default_skeleton(MEAN).frames
GROUP = {name: k for k, name in enumerate(lengths.GROUPS)}
POSE = np.zeros((8, len(CHANNELS)))
POSE[:, CHANNELS.index("l_hip_flexion")] = 0.4 * np.sin(2 * np.pi * np.arange(8) / 8)
POSE[:, CHANNELS.index("r_hip_flexion")] = -POSE[:, CHANNELS.index("l_hip_flexion")]
FEET = [JOINTS.index(f"{s}_{p}") for s in "lr" for p in ("heel", "toe")]
SHIPPED = blob.decode(read_blob(None))


def body(stature=1.7, shoulder=(0, 0, 0), **factor):
    """A person with lengths of groups multiplied and, in addition, the left shoulder moved, statures."""
    f = {name: factor.get(name, 1.0) for name in lengths.GROUPS}
    both = np.ones(2)
    toe = np.array([MEAN.toe[0], MEAN.toe[2]])
    return Measures(
        stature=stature,
        hip=stature * f["pelvis"] * np.array([MEAN.hip, np.array(MEAN.hip) * (1, -1, 1)]),
        shoulder=stature * (f["torso"] * np.array(MEAN.shoulder) + shoulder) * [(1, 1, 1), (1, -1, 1)],
        neck=stature * f["torso"] * MEAN.neck,
        upper_arm=stature * f["upper_arm"] * MEAN.upper_arm * both,
        forearm=stature * f["forearm"] * MEAN.forearm * both,
        thigh=stature * f["thigh"] * MEAN.thigh * both,
        shank=stature * f["shank"] * MEAN.shank * both,
        foot=stature * f["foot"] * np.hypot(*toe) * both,
        slope=np.arctan2(-toe[1], toe[0]) * both,
        sole=stature * MEAN.sole,
    )


def people(count, rng, sd):
    """Bodies whose groups' factors less 1, and shoulders, are scores @ sd, (k, 7 or 10)."""
    changes = rng.normal(size=(count, len(sd))) @ sd
    changes -= changes.mean(axis=0)
    changes = np.pad(changes, ((0, 0), (0, lengths.CHANGE_COUNT - len(sd[0]))))
    groups, shoulders = np.split(changes, [len(lengths.GROUPS)], axis=1)
    return [
        body(rng.uniform(1.5, 1.9), shoulder, **dict(zip(lengths.GROUPS, 1 + f, strict=True)))
        for f, shoulder in zip(groups, shoulders, strict=True)
    ]


def test_spans_are_the_lengths_of_the_groups():
    np.testing.assert_allclose(
        lengths.spans(retarget.own_proportions(body(thigh=1.1, foot=0.9))) / lengths.spans(MEAN),
        [1, 1, 1, 1, 1.1, 1, 0.9],
    )


def test_planted_components_of_lengths_are_found():
    """Legs with long thighs and short shanks, and long arms: two components span what was planted."""
    planted = np.zeros((2, len(lengths.GROUPS)))
    planted[0, [GROUP["thigh"], GROUP["shank"]]] = 0.05, -0.05
    planted[1, [GROUP["upper_arm"], GROUP["forearm"]]] = 0.06, 0.04
    table, shift = lengths.learn(people(40, np.random.default_rng(1), planted), MEAN, POSE, count=3)
    assert table.shape == (3, len(FRAMES) + 1) and shift.shape == (3, len(FRAMES), 3)
    assert np.abs(table[2]).max() < 1e-6 and np.abs(shift).max() < 1e-6
    each = np.array([[name.endswith(group) for name in FRAMES] for group in lengths.GROUPS], float)
    group_rows = table[:2, :-1] @ each.T / each.sum(axis=1)
    left = group_rows - group_rows @ np.linalg.pinv(planted) @ planted
    assert np.abs(left).max() < 1e-6
    covariance, wanted = group_rows.T @ group_rows, planted.T @ planted
    assert np.trace(covariance) == pytest.approx(np.trace(wanted), rel=0.35)  # forty people


def test_shoulders_move_apart_from_the_neck():
    """Shoulders forward and wide on a trunk of any length: SHFT contains them, and PROP the trunk alone."""
    planted = np.zeros((2, lengths.CHANGE_COUNT))
    planted[0, 7:] = 0.02, 0.01, -0.015
    planted[1, GROUP["torso"]] = 0.02
    bodies = people(40, np.random.default_rng(7), planted)
    table, shift = lengths.learn(bodies, MEAN, POSE, count=2)
    left, right = (shift[:, FRAMES.index(f"{s}_upper_arm")] for s in "lr")
    np.testing.assert_array_equal(left, right * (1, -1, 1))
    np.testing.assert_allclose(np.cross(left, planted[0, 7:]), 0, atol=1e-9)
    assert not np.delete(shift, [FRAMES.index(f"{s}_upper_arm") for s in "lr"], axis=1).any()
    # every person is the mean and some multiple of the components
    want = np.array([[m.neck / m.stature, *(m.shoulder[0] / m.stature)] for m in bodies])
    torso = table[:, FRAMES.index("torso")]
    ways = np.column_stack([torso * MEAN.neck, left + torso[:, None] * np.array(MEAN.shoulder)])
    want -= want.mean(axis=0)
    assert np.abs(want).max() > 0.02
    np.testing.assert_allclose(want @ np.linalg.pinv(ways) @ ways, want, atol=1e-6)


def test_left_and_right_change_together_and_the_sign_is_fixed():
    table, _ = lengths.learn(people(9, np.random.default_rng(2), 0.03 * np.eye(7)), MEAN, POSE)
    assert table.shape == (lengths.MOST_LENGTH_COMPONENTS, len(FRAMES) + 1)
    for name in FRAMES:
        if name.startswith("l_"):
            twin = FRAMES.index("r_" + name[2:])
            np.testing.assert_array_equal(table[:, FRAMES.index(name)], table[:, twin])
    assert np.all(table[np.arange(len(table)), np.abs(table).argmax(axis=1)] > 0)
    assert not table[:, FRAMES.index("head")].any()


def test_changes_are_bounded():
    table, shift = lengths.learn(people(5, np.random.default_rng(3), 0.3 * np.eye(10)), MEAN, POSE)
    assert np.abs(table).max() == lengths.LARGEST_CHANGE and np.abs(shift).max() == lengths.LARGEST_CHANGE


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_whole_bodies_give_no_components(count):
    unseen = replace(body(), forearm=np.full(2, np.nan))
    given = [body(1.5 + 0.1 * k, thigh=1 + 0.05 * k) for k in range(count)]
    table, shift = lengths.learn([*given, None, unseen, unseen], MEAN, POSE)
    assert table.shape == (0, len(FRAMES) + 1) and shift.shape == (0, len(FRAMES), 3)


def test_incomplete_bodies_are_left_out():
    whole = people(5, np.random.default_rng(4), 0.03 * np.eye(7))
    unseen = replace(body(thigh=1.4), forearm=np.full(2, np.nan))
    pairs = zip(
        lengths.learn([*whole, None, unseen], MEAN, POSE), lengths.learn(whole, MEAN, POSE), strict=True
    )
    for more, alone in pairs:
        np.testing.assert_array_equal(more, alone)


def lowest(sections, coef, proportion):
    """Height (n,) of the lowest foot point over the ground at phases of a stride, statures."""
    phase = np.arange(32) / 32
    channels = curves(sections, phase, np.tile(coef, (32, 1)))
    height = channels[:, CHANNELS.index("root_height")]
    height = height * skeleton.length_change(sections, proportion)[0, -1]
    return (points(sections, channels, proportion)[:, FEET, 2] + height[:, None]).min(axis=1)


@pytest.mark.parametrize("score", [-2, 2])
def test_feet_stay_on_the_ground_with_longer_and_shorter_legs(score):
    """The shipped walk on legs a twentieth longer or shorter stays within 3 mm of the mean body's ground."""
    legs = np.zeros((1, len(lengths.GROUPS)))
    legs[0, [GROUP["thigh"], GROUP["shank"]]] = 0.025
    table, _ = lengths.learn(people(6, np.random.default_rng(5), legs), MEAN, POSE, count=1)
    sections = {**SHIPPED, **default_skeleton(MEAN).sections(), "PROP": table}
    own, changed = (lowest(sections, np.zeros(1), [s]) for s in (0, score))
    reach = points(sections, POSE, [score])[:, FEET, 2] - points(sections, POSE)[:, FEET, 2]
    assert np.abs(reach).max() > 0.01  # 17 mm: the legs do differ
    assert np.abs(changed - own).max() * 1.7 < 0.003


def test_feet_of_the_shipped_model_stay_on_the_ground():
    if "PROP" not in SHIPPED:
        pytest.fail("the shipped model has no proportions; make model")
    zero = np.zeros(len(SHIPPED["CURV"]) - 1)
    own = lowest(SHIPPED, zero, [])
    for score in 2 * np.concatenate([np.eye(len(SHIPPED["PROP"])), -np.eye(len(SHIPPED["PROP"]))]):
        assert np.abs(lowest(SHIPPED, zero, score) - own).max() * 1.7 < 0.008


def with_shoulders(sections):
    """The sections with random shifts of the shoulders and the head after PROP."""
    shift = np.zeros((len(sections["PROP"]), len(FRAMES), 3), np.float32)
    moved = [FRAMES.index(name) for name in ("l_upper_arm", "r_upper_arm", "head")]
    shift[:, moved] = np.random.default_rng(8).uniform(-0.02, 0.02, (len(shift), 3, 3))
    rest = {tag: values for tag, values in sections.items() if tag != "SHFT"}
    at = list(rest).index("PROP") + 1
    return dict([*list(rest.items())[:at], ("SHFT", shift), *list(rest.items())[at:]])


@pytest.mark.parametrize("made", [SHIPPED, with_shoulders(SHIPPED)], ids=["shipped", "shoulders"])
def test_c_and_numpy_agree_on_poses_with_proportions(made):
    model, rng = Model(blob.encode(made)), np.random.default_rng(6)
    info = model.info
    assert info.proportions == len(made["PROP"])
    for _ in range(50):
        state = State(
            phase=rng.uniform(),
            stature=rng.uniform(1.5, 2.0),
            heading=rng.uniform(-3, 3),
            coef=rng.normal(size=info.components),
            proportion=rng.normal(size=info.proportions),
        )
        joints, angles = model.pose(state)
        expected, expected_angles = skeleton.pose(
            made,
            state.phase,
            state.coef,
            state.stature,
            state.heading,
            0.0,
            0.0,
            np.zeros(3),
            state.proportion,
            state.stride_hz,
        )
        assert joints == pytest.approx(expected[0], abs=1e-5)
        assert angles == pytest.approx(expected_angles[0], abs=1e-5)
        height = curves(SHIPPED, [state.phase], [state.coef], state.stride_hz)[0]
        height = height[CHANNELS.index("root_height")]
        height *= skeleton.length_change(SHIPPED, state.proportion)[0, -1] * state.stature
        assert model.pelvis_height(state) == pytest.approx(height, abs=1e-5)
