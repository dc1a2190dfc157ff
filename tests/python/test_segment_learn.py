"""The segment prior: markers, cutting, gaps, modes, held-out residual, mixture, sections."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mocap_files import write_toy
from toy_segments import toy_blob, toy_prior

from gait.bindings.segment_prior import TAGS, SegmentPrior
from gait.body.skeleton import ANGLES, CHANNELS, JOINTS, Proportions, default_skeleton, points
from gait.errors import UserError
from gait.io import blob
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import SegmentOptions
from gait.learn.segments import corpus as corpora
from gait.learn.segments import fit
from gait.learn.segments import motion as motions
from gait.learn.segments.corpus import Corpus, Recorded, segments, tabulate
from gait.learn.segments.fit import sections
from gait.learn.segments.virtual_markers import MARKERS, SKIN, marked_skeleton
from gait.learn.solve import readers

PLAIN = SegmentOptions(people=False)


@pytest.fixture(scope="module")
def motion(tmp_path_factory):
    """A toy walk along +x in the file's y-up axes, 120 frames a second."""
    path = write_toy(tmp_path_factory.mktemp("walk"), "01_01", frames=420, period=120.0, speed=1.3)
    return motions.of(path, readers.read(path), SegmentOptions())


def recorded(places, root, names=None, subject="a", name="a_1"):
    flat = places.reshape(len(places), -1)
    names = names or tuple(f"m{k}" for k in range(places.shape[1]))
    return Recorded(name, subject, None, names, 1.7, np.concatenate([flat, root], axis=1))


def test_joints_are_those_of_the_skeleton_and_skin_lies_on_the_limbs():
    plain, marked = default_skeleton(), marked_skeleton()
    assert len(MARKERS) == 37 and tuple(marked.points[:19]) == tuple(JOINTS)
    pose = np.random.default_rng(0).normal(scale=0.3, size=(4, len(CHANNELS)))
    joints = points(plain.sections(), pose)
    assert np.array_equal(points(marked.sections(), pose)[:, : len(JOINTS)], joints)
    for k, (name, (limb, _, direction)) in enumerate(SKIN.items(), len(JOINTS)):
        index = plain.limbs.index(limb)
        row, at = plain.limb_shapes[index], marked.point_positions[k]
        axis = row[3:6] - row[:3]
        share = (at - row[:3]) @ axis / (axis @ axis)
        away = at - row[:3] - share * axis
        assert 0 < share < 1 and np.hypot(*away[:2]) > 0.01, name
        assert np.all(away[:2] * direction >= 0) and marked.point_frames[k] == plain.limb_frames[index][0]


def test_a_walk_becomes_markers_over_a_floor_at_the_rate_of_segments(motion):
    assert motion.names == MARKERS and motion.places.shape == (70, 37, 3)
    head, toes = MARKERS.index("head_top"), [MARKERS.index(f"{s}_toe") for s in "lr"]
    assert np.median(motion.places[:, head, 2]) == pytest.approx(0.96, abs=0.05)
    assert motion.places[:, toes, 2].min(axis=1).mean() == pytest.approx(0.0235, abs=0.02)
    assert np.abs(motion.root[:, 2]).max() < 0.2  # the hips look along the walk
    speed = np.diff(motion.root[:, 0]).mean() * 20 * motion.stature
    assert speed == pytest.approx(1.3, rel=0.03)
    assert np.allclose(motion.places[:, 0, :2], motion.root[:, :2], atol=1e-9)


def test_people_who_were_not_recorded_come_in_opposite_pairs_on_the_same_floor(motion):
    assert len(motion.people) == 2 * motions.PAIRS
    apart = motion.people - motion.places
    pairs = apart.reshape(motions.PAIRS, 2, *apart.shape[1:])
    assert np.abs(pairs.sum(axis=1)).mean() < 0.2 * np.abs(apart).mean()
    assert 0.005 < np.sqrt(np.mean(apart**2)) < 0.06  # statures
    heights = [x[:, motions.FOOT_COLUMNS, 2].min(axis=1).mean() for x in (motion.places, *motion.people)]
    assert np.ptp(heights) < 1e-3


def test_resampling_keeps_what_is_slow_and_filters_what_is_fast():
    time = np.arange(240) / 120
    slow, fast = np.sin(2 * np.pi * 1.5 * time), np.sin(2 * np.pi * 35 * time)
    signal = np.stack([slow + fast, slow, np.ones(240)], axis=1)[:, None]
    found = motions.resample(signal, 120, 20)[:, 0]
    at = np.arange(len(found)) / 20
    inside = slice(4, -4)
    assert np.abs(found - np.sin(2 * np.pi * 1.5 * at)[:, None])[inside, :2].max() < 0.02
    assert np.allclose(found[:, 2], 1)
    signal[60:120, 0, 1] = np.nan
    gap = motions.resample(signal, 120, 20)[:, 0, 1]
    assert np.isnan(gap[10:20]).all() and np.isfinite(gap[:10]).all() and np.isfinite(gap[21:]).all()


def test_angles_alone_walk_over_the_floor_on_their_lower_foot():
    """Legs that swing forward in the air carry the body on by two steps a cycle; absent arms stay unknown."""
    phase = np.arange(400) / 100
    angles = np.full((400, len(ANGLES)), np.nan)
    for side, shift in (("l", 0.5), ("r", 0.0)):
        turn = 2 * np.pi * (phase + shift)
        angles[:, ANGLES.index(f"{side}_hip_flexion")] = 0.4 * np.cos(turn)
        angles[:, ANGLES.index(f"{side}_knee_flexion")] = np.maximum(0.05, -0.9 * np.sin(turn))
    table = AngleTable("legs", 100.0, angles)
    pose = motions._pose_of_angles(table)
    about = pose.places()
    path = motions.standing(about, Proportions())
    places = about + path[:, None]
    feet = [MARKERS.index(f"{s}_{part}") for s in "lr" for part in ("toe", "heel")]
    assert np.abs(places[:, feet, 2].min(axis=1)).max() < 0.05
    step = 2 * 0.49 * np.sin(0.4)  # statures between the feet at most
    assert path[-1, 0] / 4 == pytest.approx(2 * step, rel=0.25)
    assert np.isnan(places[:, MARKERS.index("l_wrist")]).all()
    assert np.isfinite(places[:, MARKERS.index("head_top")]).all()


def test_segments_begin_over_the_origin_looking_along_x():
    rng = np.random.default_rng(1)
    frames = 23
    shape = rng.normal(size=(1, 5, 3)) * 0.2
    heading = 0.7 + 0.02 * np.arange(frames)
    root = np.column_stack([3 + 0.1 * np.arange(frames), 2 - 0.05 * np.arange(frames), heading])
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    flat = np.einsum("abt,tjb->tja", turn, np.repeat(shape, frames, axis=0)[..., :2])
    places = np.concatenate([flat, np.repeat(shape, frames, axis=0)[..., 2:]], axis=2)
    places[..., :2] += root[:, None, :2]
    cut = segments(recorded(places, root), [f"m{k}" for k in range(5)], PLAIN)
    assert cut.shape == (3, 10, 5, 3)  # frames 0, 5, 10
    assert np.allclose(cut[:, 0], shape, atol=1e-12)
    for headings, angles in ((2, (0, 90)), (8, range(0, 360, 45))):
        turned = corpora._turned(cut, headings)
        assert len(turned) == len(list(angles))
        first = [np.degrees(np.arctan2(*(t[0, 0, 0, 1::-1]))) for t in turned]
        ahead = (np.array(first) - first[0]) % 360
        assert np.allclose(ahead, list(angles))


def test_markers_that_few_show_are_not_learnt_and_gappy_segments_are_left_out():
    rng = np.random.default_rng(2)
    root = np.zeros((40, 3))
    one, two, three = (rng.normal(size=(40, 4, 3)) for _ in range(3))
    one[:, 3] = np.nan
    two[:, 3] = np.nan
    three[20:30, :2] = np.nan
    recordings = [recorded(x, root) for x in (one, two, three)]
    table = tabulate(recordings, PLAIN)
    assert table.names == ("m0", "m1", "m2")
    assert np.bincount(table.recording).tolist() == [7, 7, 4]  # those at 15, 20, 25 have gaps


def toy_rows(rng, count=200, frames=4, markers=5, modes=3, noise=0.01):
    """Rows of a Gaussian with known modes, and the modes' (D, k) and standard deviations."""
    base = np.linalg.qr(rng.normal(size=(3 * frames * markers, modes)))[0]
    sd = np.array([0.5, 0.3, 0.2])[:modes]
    rows = 1 + (rng.normal(size=(count, modes)) * sd) @ base.T
    return rows + rng.normal(scale=noise, size=rows.shape), base, sd


@pytest.mark.parametrize("count", [40, 400])
def test_modes_are_those_of_the_singular_value_decomposition(count):
    """From the scatter of coordinates or, with few segments, of segments."""
    rows, *_ = toy_rows(np.random.default_rng(3), count)
    found = fit.basis(rows, 5)
    _, s, vt = np.linalg.svd(rows - rows.mean(axis=0), full_matrices=False)
    model = fit.fitted(found, np.ones(count, bool), 3)
    assert np.allclose(model.variance, s[:3] ** 2 / (count - 1))
    assert np.allclose(np.abs((found.directions @ model.vectors).T @ vt[:3].T), np.eye(3), atol=1e-8)
    rest = (s[3:] ** 2).sum() / (count - 1) / rows.shape[1]
    assert model.residual.mean() == pytest.approx(rest, rel=1e-8)


def test_rest_beyond_the_basis_is_counted_in_the_residual():
    rows, *_ = toy_rows(np.random.default_rng(3), 300)
    whole, few = (fit.basis(rows, 5, most) for most in (60, 10))
    a, b = (fit.fitted(x, np.ones(300, bool), 3) for x in (whole, few))
    assert few.scores.shape[1] == 10
    assert np.allclose(a.residual, b.residual, rtol=1e-6)


def test_gaps_are_filled_as_the_rest_of_the_segment_lets_expect():
    rng = np.random.default_rng(4)
    rows, *_ = toy_rows(rng, 300)
    gappy = rows.copy()
    for k in range(0, 300, 3):
        start = 15 * rng.integers(4)
        gappy[k, start : start + 9] = np.nan
    filled = fit.filled(gappy, 3)
    where = np.isnan(gappy)
    error, spread = (filled - rows)[where].std(), (rows - rows.mean(axis=0))[where].std()
    assert error < 0.02 < 0.5 * spread  # noise is 0.01
    assert np.array_equal(filled[~where], rows[~where])


def test_gamma_is_what_people_left_out_ask_for():
    """The residual of all other people is too small by the person's own share of it."""
    rng = np.random.default_rng(5)
    rows, *_ = toy_rows(rng, 600)
    subject = np.repeat(np.arange(6), 100)
    own = rng.normal(scale=0.03, size=(6, rows.shape[1]))
    folds = fit.groups(subject, subject)
    assert [int(f.sum()) for f in folds] == [100] * 6

    def gamma(basis):
        models = [(fit.fitted(basis, ~gone, 8), gone) for gone in folds]
        return fit.gamma([fit.fold(basis, m, gone) for m, gone in models])

    assert 1 < gamma(fit.basis(rows, 5)) < 1.4  # modes fit the noise of those learnt from
    assert gamma(fit.basis(rows + own[subject], 5)) > 3
    still = np.tile(own[:, None, :15], (1, 4, 1)).reshape(6, -1)  # the same in all four frames
    assert gamma(fit.basis(rows + still[subject], 5)) > 2 * gamma(fit.basis(rows + own[subject], 5))
    assert fit.gamma([]) == 1
    assert fit.groups(np.zeros(5, int), np.zeros(5, int)) == []


def test_fold_likelihood_is_the_density_of_the_segments():
    rng = np.random.default_rng(6)
    rows, *_ = toy_rows(rng, 120)
    found = fit.basis(rows, 5)
    gone = np.arange(120) < 20
    model = fit.fitted(found, ~gone, 3)
    fold = fit.fold(found, model, gone)
    mean = found.mean + found.directions @ model.mean
    modes = found.directions @ (model.vectors * np.sqrt(model.variance))
    differences = []
    for gamma in (1.0, 2.5):
        rest = np.tile(np.repeat(model.residual, 3), 4) * gamma
        covariance = modes @ modes.T + np.diag(rest)
        apart = rows[gone] - mean
        quadratic = np.mean(np.sum(apart.T * np.linalg.solve(covariance, apart.T), axis=0))
        differences.append(fold.deviance(gamma) - quadratic - np.linalg.slogdet(covariance)[1])
    assert np.allclose(differences, 0, atol=1e-6)


def test_a_mixture_finds_its_components_and_how_many():
    rng = np.random.default_rng(7)
    centres = np.array([[3.0, 0], [-3, 0], [0, 4]])
    label = rng.integers(3, size=600)
    scores = centres[label] + rng.normal(size=(600, 2)) * 0.3
    found = fit.fit_mixture(scores, 3)
    order = np.argmin(np.linalg.norm(found.means[:, None] - centres, axis=2), axis=1)
    assert sorted(order) == [0, 1, 2]
    assert np.abs(found.means - centres[order]).max() < 0.1
    assert np.allclose(found.weights, np.bincount(label)[order] / 600, atol=0.01)
    one = fit.fit_mixture(scores, 1)
    assert np.allclose(one.covariances[0], np.cov(scores.T)) and one.weights.tolist() == [1.0]
    basis = fit.Basis(np.zeros(6), np.eye(6)[:, :2], scores, np.zeros((600, 2)))
    model = fit.Fitted(np.zeros(2), scores.var(axis=0), np.eye(2), np.ones(2))
    folds, real = [np.arange(600) % 5 == k for k in range(5)], np.ones(600, bool)
    assert len(fit.choose_mixture(basis, model, folds, real, None).weights) == 3
    single = replace(basis, scores=rng.normal(size=(600, 2)))
    assert len(fit.choose_mixture(single, model, folds, real, None).weights) == 1


def test_people_made_up_of_those_left_out_do_not_help_a_mixture():
    """Every person moves differently: a separate component for each does not help with the next person."""
    rng = np.random.default_rng(8)
    person, real = np.repeat(np.arange(6), 100), np.tile(np.arange(100) < 20, 6)
    scores = rng.normal(size=(6, 2))[person] + 0.02 * rng.normal(size=(600, 2))
    basis = fit.Basis(np.zeros(6), np.eye(6)[:, :2], scores, np.zeros((600, 2)))
    model = fit.Fitted(np.zeros(2), scores.var(axis=0), np.eye(2), np.ones(2))
    folds = [person == k for k in range(6)]
    assert len(fit.choose_mixture(basis, model, folds, real, None).weights) == 1
    leaky = [one & real for one in folds]
    assert len(fit.choose_mixture(basis, model, leaky, real, None).weights) > 1


def test_a_prior_of_motions_has_their_mean_and_unit(motion):
    with Corpus() as corpus:
        for k in range(4):
            places = motion.places + 0.002 * k
            corpus.put(f"{k}_1", str(k), None, replace(motion, places=places))
        recordings = corpus.recordings()
    prior = fit.fit(recordings, SegmentOptions(modes=12))
    assert prior.segments == 4 * 13 and prior.recordings == 4 and prior.size == 12
    assert prior.stature == pytest.approx(motion.stature) and prior.names == MARKERS
    assert np.all(np.diff(prior.sd[0]) <= 0) and (prior.residual > 0).all()
    norm = np.linalg.norm(prior.modes[0].reshape(12, -1), axis=1)
    assert np.allclose(norm, prior.sd[0])
    flat = prior.modes[0].reshape(12, -1)
    assert (flat[np.arange(12), np.abs(flat).argmax(axis=1)] > 0).all()
    cut = segments(recordings[0], MARKERS, SegmentOptions())
    assert np.abs(cut.mean(axis=0) - prior.mean[0]).max() < 0.05
    copies = fit.fit(recordings, SegmentOptions(modes=12, headings=8))
    assert copies.segments == prior.segments
    assert np.abs(copies.mean[0, 0, :, :2]).max() < 1e-9  # all round: there is no direction
    mixed = fit.fit(recordings, SegmentOptions(modes=10, mixture=2))
    assert mixed.components == 2 and mixed.weights.sum() == pytest.approx(1)


def test_too_few_segments_are_an_error(motion):
    short = replace(motion, places=motion.places[:14], root=motion.root[:14], people=motion.people[:, :14])
    with Corpus() as corpus:
        corpus.put("a_1", "a", None, short)
        recordings = corpus.recordings()
    with pytest.raises(UserError, match="contain 1 segments of 0.5 s, fewer than 8; add recordings"):
        fit.fit(recordings, SegmentOptions())


MOCAP = Path(__file__).parents[3] / "shared" / "data" / "mocap" / "cmu_misc"
FOUR = ("01/01_14.amc", "02/02_04.amc", "02/02_05.amc", "02/02_07.amc")
ALL = tuple(sorted(str(path.relative_to(MOCAP)) for path in MOCAP.glob("*/*.amc")))
MODES = 50


def shares(files: Iterable[str]) -> tuple[np.ndarray, np.ndarray]:
    """Cumulative shares of the variance (MODES,) in the prior's modes, and from singular values."""
    wanted = SegmentOptions(source="only", people=False, modes=MODES)
    with Corpus() as corpus:
        for file in files:
            path = MOCAP / file
            corpus.put(path.stem, path.parent.name, path, motions.of(path, readers.read(path), wanted))
        recordings = corpus.recordings()
        prior = fit.fit(recordings, wanted)
        rows = np.concatenate([segments(r, prior.names, wanted) for r in recordings])
    flat = rows.reshape(len(rows), -1)
    values = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False) ** 2
    variance = prior.sd[0] ** 2
    outside = 3 * prior.frames * prior.residual[0].sum()
    have = np.cumsum(variance / (variance.sum() + outside))
    return have, np.cumsum(values / values.sum())[:MODES]


@pytest.mark.skipif(not MOCAP.is_dir(), reason="no motion capture here")
@pytest.mark.parametrize(
    ("files", "held", "count"),
    [(FOUR, (0.9948, 0.9972), 10), (ALL, (0.9886, 0.9933), 13)],
    ids=["four", "all"],
)
def test_modes_hold_as_much_variance_as_singular_values_do(
    files: tuple[str, ...], held: tuple[float, float], count: int
) -> None:
    have, want = shares(files)
    assert np.abs(have - want).max() < 1e-3
    assert have[[39, 49]] == pytest.approx(held, abs=1e-3)
    assert np.searchsorted(have, 0.91) + 1 == count


@pytest.mark.parametrize("components", [1, 3])
def test_prior_survives_the_file(tmp_path, components):
    """What was written is read back, to the rounding of the file."""
    prior = toy_prior(5, 8, 6, seed=2, components=components)
    path = tmp_path / "toy.gait"
    path.write_bytes(toy_blob(prior))
    read = SegmentPrior.load(path)
    assert read.names == prior.names
    whole = ("frames", "hop", "headings", "components", "size", "segments", "recordings", "fps", "gamma")
    assert [getattr(read, name) for name in whole] == [getattr(prior, name) for name in whole]
    for name in ("weights", "mean", "modes", "sd", "residual", "stature"):
        np.testing.assert_allclose(getattr(read, name), getattr(prior, name), rtol=1e-6, atol=1e-6)


def test_markers_are_found_by_name():
    """Places are in the requested order; an unknown name is an error that lists the known ones."""
    prior = toy_prior(3, 4, 2)
    assert prior.index(["head_top", "pelvis"]).tolist() == [2, 0]
    with pytest.raises(UserError, match="'nose' is not in the prior; it knows pelvis neck"):
        prior.index(["nose"])


def test_blob_without_prior_explains_how_to_learn_it(tmp_path):
    """A cyclic model without the sections, or with a part of them."""
    with pytest.raises(UserError, match=r"x.gait: contains no segment prior; learn it with gait learn"):
        SegmentPrior.from_sections({}, "x.gait")
    parts = {k: v for k, v in sections(toy_prior()).items() if k != "SGSD"}
    with pytest.raises(UserError, match="contains no section SGSD"):
        SegmentPrior.from_sections(parts, "x.gait")


def _changed(tag: str, change) -> dict:
    parts = {k: v.copy() for k, v in sections(toy_prior()).items()}
    parts[tag] = change(parts[tag])
    return parts


@pytest.mark.parametrize(
    ("tag", "change"),
    [
        ("SGIN", lambda a: a[:5]),
        ("SGIN", lambda a: a * np.array([1, 9, 1, 1, 1, 1, 1, 1], np.int32)),
        ("SGIN", lambda a: a + np.array([0, 0, 3, 0, 0, 0, 0, 0], np.int32)),
        ("SGRT", lambda a: a * np.float32(0)),
        ("SGWT", lambda a: a * np.float32(2)),
        ("SGMN", lambda a: a[:, 1:]),
        ("SGMD", lambda a: a * np.float32(np.nan)),
        ("SGSD", lambda a: -a),
        ("SGPS", lambda a: a[:, :3]),
    ],
)
def test_contradictions_are_refused(tag, change):
    """Shapes, counts, signs and values are checked before use."""
    with pytest.raises(UserError, match=r"bad.gait: .*; learn the model again"):
        SegmentPrior.from_sections(_changed(tag, change), "bad.gait")


def test_the_group_is_complete_and_ordered():
    """The sections are those of the format, and none is missing."""
    assert tuple(blob.decode(toy_blob(toy_prior()))) == TAGS
