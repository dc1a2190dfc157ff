"""Size and depth: the fit does not pull them to the lens, and bones set them where it has no influence."""

from __future__ import annotations

import numpy as np
import pytest
from toy_segments import toy_prior

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints.observations import Grid, Observations
from gait.lift.segment.view import Perspective
from gait.lift.smooth import chain, motion, size
from gait.lift.smooth.chain import Around, Freedom, overlapping
from gait.lift.smooth.motion import Options
from gait.lift.smooth.smoother import Observed, Start, smooth

STATURE, SECONDS, EXACT = 1.7, 2, 0.3  # metres, s, pixels
SHAKY, FARTHEST_OFF = 40.0, 0.03  # pixels; share of the distance
SHRUNK = 0.92  # of the true size
VIEWS = {"from the side": (0.5, -6.0, 1.4), "towards": (12.0, 0.3, 1.5)}


@pytest.fixture(scope="module")
def walk():
    """The shipped prior of joints, and its mean motion walking on along x, on a grid."""
    shipped = SegmentPrior.load()
    prior = shipped.restricted(tuple(n for n in shipped.names if n in JOINTS))
    half = prior.frames // 2
    mean = STATURE * prior.mean[0]
    step = (mean[half:] - mean[:half]).mean(axis=(0, 1)) * (1.0, 1.0, 0.0)
    blocks = [mean[:half] + k * step for k in range(SECONDS * int(prior.fps) // half)]
    places = np.concatenate(blocks)
    return prior, places - places.mean(axis=(0, 1)) * (1.0, 1.0, 0.0)


def drawn(prior, around, rng):
    """Motion drawn from the chain for a person of known stature on a known floor, (grid, J, 3)."""
    found = chain.chain(chain.Prior(prior), around, Freedom(STATURE, 1e-4, 1e-4))
    information = found.information
    count, size_ = information.vector.shape
    full = np.zeros((count, size_, count, size_))
    for b in range(count):
        full[b, :, b] = information.diagonal[b]
    for b in range(count - 1):
        full[b + 1, :, b], full[b, :, b + 1] = (
            information.below[b],
            information.below[b].T,
        )
    lasting = rng.normal(size=len(information.edge))
    vector = information.vector - information.border @ lasting
    lower = np.linalg.cholesky(full.reshape(count * size_, -1))
    mean = np.linalg.solve(lower.T, np.linalg.solve(lower, vector.ravel()))
    x = mean + np.linalg.solve(lower.T, rng.normal(size=len(mean)))
    return x.reshape(-1, len(prior.names), 3)


@pytest.mark.long
@pytest.mark.parametrize("view", VIEWS)
def test_exact_pixels_of_the_prior_are_lifted_to_their_depth(walk, monkeypatch, view):
    """Draws of the prior itself: linearised at places fitted to noise too, all came out 4 to 5 % nearer."""
    prior, mean = walk
    half = prior.frames // 2
    segments = len(mean) // half - 1
    headings, components = np.zeros(segments), np.zeros(segments, int)
    with monkeypatch.context() as near:  # draws that stay in the picture
        near.setattr(chain, "GROUND_SD", 0.5)
        near.setattr(chain, "UNKNOWN_HEADING_SD", 0.02)
        shapes = overlapping(mean, half)
        around = Around(headings, components, STATURE, shapes, shapes)
        motions = [drawn(prior, around, np.random.default_rng(seed)) for seed in range(4)]
    camera = Camera.looking(VIEWS[view], (0, 0, 0.9), (640, 480), 900)
    markers, ahead = prior.index(EVAL15), camera.R[2]
    off = []
    for places in motions:
        places = places - places.mean(axis=(0, 1)) * (1.0, 1.0, 0.0)
        uv = camera.project(places[:, markers])
        points = Observations(uv, np.full(uv.shape[:2], EXACT))
        observed = Observed(np.arange(len(places)) / prior.fps, points, markers)
        start = Start(headings, components, STATURE, places, np.ones(len(places)))
        freedom = Freedom(STATURE, 0.04, 0.03)
        found = smooth(prior, observed, Perspective(camera), freedom, start, contact=False, bones=False)
        sds = np.median(np.sqrt(found.sd**2 @ ahead**2))
        off.append(float((found.places - places).mean(axis=(0, 1)) @ ahead) / sds)
    assert abs(np.mean(off)) < 1.25


def test_noise_of_any_size_leaves_the_distance(walk):
    """Points half a metre off by noise were projected along their rays, and pulled everything to the lens."""
    prior, places = walk
    camera = Camera.looking(VIEWS["from the side"], (0, 0, 0.9), (640, 480), 900)
    uv = camera.project(places[:, prior.index(EVAL15)])
    uv = uv + SHAKY * np.random.default_rng(1).normal(size=uv.shape)
    time = np.arange(len(places)) / prior.fps
    keypoints = Keypoints(np.arange(len(places)), time, tuple(EVAL15), uv, np.ones(uv.shape[:2]))
    found = motion.lift(prior, keypoints, Perspective(camera), Options(pixel_sd=SHAKY), prior.names)
    away = (found.places - places).mean(axis=(0, 1)) @ camera.R[2]
    assert abs(away) < FARTHEST_OFF * 6.0


BODY = Camera.looking((0, -4, 1.5), (0, 0, 0.9), (640, 480), 600)


def person(prior, factor):
    """Mean body in a row of frames, scaled about the lens, and standard deviations."""
    places = np.repeat(STATURE * prior.mean[0][:1], 4, axis=0)
    lens = -BODY.R.T @ BODY.t
    return places, lens + factor * (places - lens), np.full(places.shape, 0.01)


def test_bones_give_the_size():
    prior = toy_prior(6, 19, 4)
    places, small, _ = person(prior, 0.6)
    ratio = size.bones_ratio(prior, small, STATURE) / size.bones_ratio(prior, places, STATURE)
    assert ratio == pytest.approx(0.6)
    nameless = prior.restricted(prior.names[:2])
    assert size.bones_ratio(nameless, places[:, :2], STATURE) == 1.0


def test_a_short_person_who_walks_as_learnt_is_left_short(walk):
    """A short person became a sixth larger and too far away, although floor and motion showed the size."""
    prior, mean = walk
    places = 1.45 / STATURE * mean
    camera = Camera.looking(VIEWS["from the side"], (0, 0, 0.9), (640, 480), 600)
    uv = camera.project(places[:, prior.index(EVAL15)])
    time = np.arange(len(places)) / prior.fps
    keypoints = Keypoints(np.arange(len(places)), time, tuple(EVAL15), uv, np.ones(uv.shape[:2]))
    options = Options(pixel_sd=1.0, floor_sd=0.01)
    found = motion.lift(prior, keypoints, Perspective(camera), options, prior.names)
    assert found.chi2_per_observation < motion.POOR_FIT and found.wider == 1
    assert size.bones_ratio(prior, found.places, prior.stature) < 0.87  # an unlikely size
    assert found.resized == 1
    assert np.linalg.norm(found.places - places, axis=2).mean() < 0.1


def test_people_of_the_prior_have_its_bones(walk):
    """Bones of any motion have the same mean length over the prior as in motions drawn from it."""
    prior, _ = walk
    rng = np.random.default_rng(0)
    squares = 0.0
    for _ in range(200):
        scores = rng.normal(size=prior.size)
        drawn = STATURE * (prior.mean[0] + np.tensordot(scores, prior.modes[0], 1))
        squares += size.bones_ratio(prior, drawn, STATURE) ** 2 / 200
    assert squares == pytest.approx(1, abs=0.06)


def test_an_unlikely_size_is_put_right_and_its_sd_cover_the_truth():
    prior = toy_prior(6, 19, 4)
    places, small, sd = person(prior, 0.6)
    found = size.resized(size.Resized(small, sd, sd), BODY, 0.6, 0.05, 1.0)
    np.testing.assert_allclose(found.places, places, atol=1e-9)
    np.testing.assert_allclose(BODY.project(found.places), BODY.project(small))
    assert found.factor == pytest.approx(1 / 0.6)
    assert found.sd.min() > 5 * sd.max()  # eight standard deviations off
    assert found.rooted_sd.min() > 5 * sd.max()
    depth = BODY.R[2]
    assert (found.sd @ abs(depth)).mean() > (found.rooted_sd @ abs(depth)).mean()


def test_a_likely_size_is_left_alone_and_its_sd_follow_chi2():
    prior = toy_prior(6, 19, 4)
    _, small, sd = person(prior, 0.95)
    for chi2, grown in ((4.0, 2.0), (0.5, 1.0)):
        found = size.resized(size.Resized(small, sd, sd), BODY, 0.95, 0.05, chi2)
        np.testing.assert_array_equal(found.places, small)
        np.testing.assert_allclose(found.sd, grown * sd)
        np.testing.assert_allclose(found.rooted_sd, grown * sd)
        assert found.factor == 1


def test_parts_that_hardly_show_the_distance():
    def keypoints(*names, share=1.0):
        uv = np.zeros((10, len(names), 2))
        uv[round(10 * share) :] = np.nan
        return Keypoints(np.arange(10), np.arange(10) / 30, names, uv, np.ones(uv.shape[:2]))

    assert size.shows_distance(keypoints("r_hip", "l_ankle"))
    assert size.shows_distance(keypoints("pelvis", "r_ankle", "head_top"))
    assert not size.shows_distance(keypoints("l_hip", "r_hip", "l_shoulder"))
    assert not size.shows_distance(keypoints("r_ankle"))
    assert not size.shows_distance(keypoints("r_hip", "l_ankle", share=0.4))


@pytest.mark.parametrize(
    ("observed", "sure"), [(EVAL15, True), ([n for n in EVAL15 if "ankle" not in n], False)]
)
def test_without_ankles_the_distance_is_as_open_as_the_size(walk, observed, sure):
    """Legs that are never visible stand on the floor only in the prior, which seemed to fix the distance."""
    prior, places = walk
    camera = Camera.looking(VIEWS["towards"], (0, 0, 0.9), (640, 480), 900)
    uv = camera.project(places[:, prior.index(observed)])
    time = np.arange(len(places)) / prior.fps
    keypoints = Keypoints(np.arange(len(places)), time, tuple(observed), uv, np.ones(uv.shape[:2]))
    found = motion.lift(prior, keypoints, Perspective(camera), Options(pixel_sd=1.0), prior.names)
    distance = float(np.linalg.norm(places - (-camera.R.T @ camera.t), axis=2).mean())
    sds = float(np.median(np.sqrt(found.sd**2 @ camera.R[2] ** 2))) / distance
    assert (sds < size.PROPORTION_SD) == sure


@pytest.mark.parametrize("floats", [True, False])
def test_one_who_fits_but_floats_is_as_large_as_the_bones(walk, floats):
    """A person in a circle came out small and near the lens, 0.3 m above the floor."""
    prior, places = walk
    camera = Camera.looking(VIEWS["from the side"], (0, 0, 0.9), (640, 480), 600)
    lens = -camera.R.T @ camera.t
    small = lens + SHRUNK * (places - lens)
    if not floats:
        small = small - [0.0, 0.0, motion._height(small, prior)]
    time = np.arange(len(small)) / prior.fps
    observed = np.ones(small.shape[:2])
    keypoints = Keypoints(np.arange(len(small)), time, prior.names, camera.project(small), observed)
    sd = np.full_like(small, 0.01)
    options = Options(stature=STATURE, floor_sd=0.02)
    sequence = motion._Sequence(prior, keypoints, Perspective(camera), options, Grid.over(time, prior))
    found = motion._sized(sequence, size.Resized(small, sd, sd), chi2=0.5)
    ratio = size.bones_ratio(prior, small, STATURE)
    assert found.factor == (pytest.approx(1 / ratio) if floats else 1)
