"""The purpose of the smoother's soft constraints: feet slide less, bones change less, bodies are balanced."""

import numpy as np
import pytest

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS
from gait.io.keypoints_file import Keypoints
from gait.lift.segment.view import Perspective
from gait.lift.smooth import balance, motion
from gait.lift.smooth.options import Options
from gait.lift.smooth.soft_constraints import FLOOR_JOINTS, LIMB_BONES, Layout, Rows
from gait.reproducible import one_thread
from gait.simulate.scenario import Scenario
from gait.simulate.stage import set_stage

FRAMES, FPS, NOISE = 40, 25.0, 6.0  # pixels: less noise leaves less to mend
STANDING = 0.05  # m/s
RATE = 20.0  # frames per second of the prior


@pytest.fixture(scope="module")
def stage():
    """A person with a normative gait, which the prior does not contain."""
    return set_stage(Scenario(frames=FRAMES, fps=FPS, seed=301))


@pytest.fixture(scope="module")
def figures(stage):
    """Sliding speed of standing feet (m/s), variation of bones (m), and the grid, by the constraints used."""
    points = stage.walk.points(stage.frames)
    truth = np.stack([points[name] for name in EVAL15], axis=1)
    uv = stage.camera.project(truth) + NOISE * np.random.default_rng(5).standard_normal((FRAMES, 15, 2))
    number = np.arange(FRAMES)
    keypoints = Keypoints(number, number / FPS, tuple(EVAL15), uv, np.ones(uv.shape[:2]))
    smooth, grids = motion.smoother.smooth, []

    def watched(*arguments, **options):
        grids.append(smooth(*arguments, **options))
        return grids[-1]

    def of(contact, bones, balanced=False):
        options = Options("smooth", stage.body.stature, NOISE, Options.floor_sd, contact, bones, balanced)
        with one_thread():
            found = motion.lift(
                SegmentPrior.load(), keypoints, Perspective(stage.camera), options, tuple(JOINTS)
            )
        places = dict(zip(found.names, np.moveaxis(found.places, 1, 0), strict=True))
        slide = [speed(places[f])[speed(points[f]) < STANDING] for f in FLOOR_JOINTS if f in places]
        lengths = [np.linalg.norm(places[a] - places[b], axis=1).std() for a, b in LIMB_BONES]
        order = [found.names.index(name) for name in JOINTS]
        out = out_of_polygon(grids[-1].grid[:, order], grids[-1].contact)
        return (
            float(np.median(np.concatenate(slide))),
            float(np.mean(lengths)),
            np.nanmean(out) if contact else np.nan,
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motion.smoother, "smooth", watched)
        found = {arms: of(*arms) for arms in ((True, True), (False, True), (True, False))}
        patch.setattr(balance, "BALANCE_SD", 0.01)  # surer than usual, to be seen beside all else
        return found | {"balance": of(True, True, True)}


def speed(places):
    """Metres per second between frames."""
    return FPS * np.linalg.norm(np.diff(places, axis=0), axis=1)


def test_feet_slide_less_with_contact(figures):
    assert figures[True, True][0] < 0.9 * figures[False, True][0]


def test_bones_vary_less_where_their_lengths_are_kept(figures):
    assert figures[True, True][1] < 0.6 * figures[True, False][1]


def test_the_mass_is_where_people_have_it(stage):
    """At 55 to 58 % of the height of those who stand upright (Hay 1973, and the same from other tables)."""
    points = {name: place[0] for name, place in stage.walk.points(stage.frames).items()}
    share = balance.masses(JOINTS)
    assert share.sum() == pytest.approx(1) and balance.masses(EVAL15) is None
    for name in JOINTS:
        if name.startswith("l_"):
            assert share[JOINTS.index(name)] == pytest.approx(share[JOINTS.index("r" + name[1:])])
    height = share @ [points[name][2] for name in JOINTS] / points["head_top"][2]
    assert 0.54 < height < 0.59


@pytest.mark.parametrize(
    "point, place",
    [
        ((0.5, 0.25), (0.5, 0.25)),
        ((0.5, -1.0), (0.5, 0.0)),
        ((2.0, 2.0), (1.0, 1.0)),
        ((-0.5, 0.4), (0.0, 0.4)),
    ],
)
def test_the_nearest_place_of_a_polygon(point, place):
    square = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])  # in any order
    weights = balance.nearest(square, np.array(point))
    assert weights @ square == pytest.approx(place) and weights.min() >= 0
    assert balance.nearest(square[:2], np.array([1.0, 0.0])) @ square[:2] == pytest.approx((0.5, 0.5))
    assert balance.nearest(square[:1], np.array(point)) == [1.0]


def out_of_polygon(places, sure):
    """Distance of the ground's force from the polygon in the middle frames, in lengths of the trunk."""
    share, feet = balance.masses(JOINTS), [JOINTS.index(name) for name in FLOOR_JOINTS]
    middle = places.swapaxes(1, 2) @ share
    off = []
    for t in range(1, len(places) - 1):
        corners = places[t, feet][np.maximum(sure[t - 1], sure[t]) > balance.STANDS]
        if not len(corners):
            off.append(np.nan)
            continue
        lag = (middle[t, 2] - corners[:, 2].mean()) / balance.GRAVITY * RATE**2
        force = (middle[t] - lag * (middle[t - 1] - 2 * middle[t] + middle[t + 1]))[:2]
        trunk = places[t, JOINTS.index("neck")] - places[t, JOINTS.index("pelvis")]
        away = force - balance.nearest(corners[:, :2], force) @ corners[:, :2]
        off.append(np.hypot(*away) / np.linalg.norm(trunk))
    return np.array(off)


def test_balance_has_the_slope_of_the_distance_from_the_polygon(stage):
    """The squared distance is in lengths of the trunk, so that a smaller body is not better balanced."""
    points = stage.walk.points(stage.frames)
    places = np.stack([points[name] for name in JOINTS], axis=1)[:4] + 0.0
    places[:, : JOINTS.index("l_knee"), 0] += np.array([0.2, 0.25, 0.21, 0.3])[:, None]  # leaning
    sure = np.zeros((3, 4))
    sure[:, [0, 2]] = 1.0  # the left foot
    rows = Rows(Layout(2, 2, len(JOINTS), None))
    balance.balance(rows, JOINTS, places, sure, RATE)
    normal, _ = rows.normal()
    x = places.reshape(2, -1)
    slope = np.einsum("bij,bj->bi", normal.diagonal, x) - normal.vector
    slope[1] += normal.below[0] @ x[0]
    slope[0] += normal.below[0].T @ x[1]
    trunk = np.linalg.norm(
        (places[:, JOINTS.index("neck")] - places[:, JOINTS.index("pelvis")])[1:-1], axis=1
    )
    before = out_of_polygon(places, sure)
    sd = balance.BALANCE_SD * np.hypot(1, balance.EDGE / (before * trunk))
    assert (before * trunk > 0.05).all()
    rng, small = np.random.default_rng(1), 1e-5
    for _ in range(10):
        change = rng.normal(size=places.shape) * (1, 1, 0)
        costs = [
            0.5 * np.sum((out_of_polygon(places + step * change, sure) * trunk / sd) ** 2)
            for step in (-small, small)
        ]
        found = (costs[1] - costs[0]) / (2 * small)
        assert float(np.sum(slope * change.reshape(2, -1))) == pytest.approx(found, rel=0.02)


def test_the_ground_pushes_nearer_to_the_feet_with_balance(figures):
    assert figures["balance"][2] < 0.95 * figures[True, True][2]
