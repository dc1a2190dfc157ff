"""Points that a detector misplaces for longer lose their weight; correct ones and other motions keep it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gait.bindings.estimate import TrackStatus
from gait.bindings.lifter import Lifter
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.io.keypoints_file import Keypoints
from gait.lift.keypoints import noise
from gait.lift.keypoints.observations import Observations
from gait.lift.segment.view import Perspective
from gait.lift.smooth import motion
from gait.lift.smooth.smoother import weighted

SD, FAR = 3.0, 4.0
CAMERA = Camera.looking((1.5, -6.0, 1.4), (1.0, 0, 0.9), (960, 720), 900)


def points(frames: int = 8, markers: int = 15):
    """Points as they are stated, with noise."""
    rng = np.random.default_rng(3)
    predicted = rng.uniform(0, 500, (frames, markers, 2))
    uv = predicted + SD * rng.normal(size=predicted.shape)
    return predicted, Observations(uv, np.full(uv.shape[:2], SD))


def test_right_points_are_left_as_they_are():
    predicted, observed = points()
    assert (weighted(observed, predicted).sd == observed.sd).all()


def test_a_wrong_point_loses_its_pull_the_further_the_more():
    predicted, observed = points()
    pulls = []
    for off in (5 * FAR * SD, 20 * FAR * SD):
        observed.uv[2, 4] = predicted[2, 4] + (off, 0)
        sd = weighted(observed, predicted).sd
        assert (np.delete(sd, 2 * 15 + 4) == SD).all()
        pulls.append(off / sd[2, 4] ** 2)
    assert pulls[1] < pulls[0] / 50 < FAR / SD


def test_of_another_motion_no_point_is_an_outlier():
    predicted, observed = points()
    assert (weighted(observed, predicted + (30.0, 40.0)).sd == observed.sd).all()


def test_missing_points_are_not_judged():
    predicted, observed = points()
    observed.uv[0], observed.sd[0] = np.nan, np.inf
    assert (weighted(observed, predicted).sd == observed.sd).all()


@pytest.fixture(scope="module")
def walk():
    """Shipped prior, its mean motion continued along x for two seconds, and its keypoints with noise."""
    prior = SegmentPrior.load()
    half = prior.frames // 2
    body = 1.7 * prior.mean[0][:, prior.index(EVAL15)]
    step = (body[half:] - body[:half]).mean(axis=(0, 1)) * (1.0, 1.0, 0.0)
    places = np.concatenate([body[:half] + k * step for k in range(8)])
    uv = CAMERA.project(places) + SD * np.random.default_rng(1).normal(size=(*places.shape[:2], 2))
    frames = np.arange(len(places))
    return prior, places, Keypoints(frames, frames / prior.fps, tuple(EVAL15), uv, np.ones(uv.shape[:2]))


def test_a_point_wrong_for_a_second_hardly_matters(walk):
    prior, places, keypoints = walk
    uv = keypoints.uv.copy()
    wrong = slice(10, 30), keypoints.names.index("r_wrist")
    uv[wrong] += (70.0, -50.0)
    names = motion.output_names(prior, keypoints)
    order = [names.index(name) for name in keypoints.names]
    errors, evidence = [], []
    for given in (keypoints, replace(keypoints, uv=uv)):
        found = motion.lift(prior, given, Perspective(CAMERA), motion.Options(pixel_sd=SD), names)
        assert found.settled and not found.alone and found.outliers is not None
        assert found.outliers[wrong].all() == (given is not keypoints)
        evidence.append(found.evidence)
        apart = found.places[:, order] - places
        errors.append(np.linalg.norm(apart - apart.mean(axis=1, keepdims=True), axis=2).mean())
    assert errors[1] < 1.5 * errors[0]
    assert evidence[1] < evidence[0] - 20  # each of the 20 frames pays at least one


def spoilt(keypoints, share, seed):
    """Keypoints of which a share is at random places."""
    rng = np.random.default_rng(seed)
    outliers = rng.random(keypoints.visible.shape) < share
    return replace(keypoints, uv=keypoints.uv + outliers[..., None] * rng.normal(0, 150, keypoints.uv.shape))


def test_a_person_is_found_among_outliers(walk):
    prior, places, keypoints = walk
    names = motion.output_names(prior, keypoints)
    steady, _ = noise.without_spikes(spoilt(keypoints, 0.15, 1), SD)
    found = motion.lift(prior, steady, Perspective(CAMERA), motion.Options(pixel_sd=SD), names)
    apart = found.places[:, [names.index(name) for name in keypoints.names]] - places
    assert found.settled and not found.alone
    assert np.linalg.norm(apart, axis=2).mean() < 0.1


def live(keypoints, share, seed):
    """Frames of a live lift of corrupted keypoints."""
    lifter = Lifter(view=CAMERA)
    uv = np.full((len(lifter.names), 2), np.nan)
    order = [lifter.names.index(name) for name in keypoints.names]
    for time, observed in zip(keypoints.time, spoilt(keypoints, share, seed).uv, strict=True):
        uv[order] = observed
        lifter.push(round(1e6 * time), uv)
        now = lifter.estimate()
        if now is not None and now.status != TrackStatus.INIT:
            yield now, now.markers[order], now.sd[order]


def test_a_live_start_finds_a_person_among_outliers(walk):
    _, places, keypoints = walk
    for seed in range(6):
        frames = list(live(keypoints, 0.15, seed))
        assert len(frames) == len(places) - 9
        for now, found, _ in frames:
            assert now.status == TrackStatus.TRACKING
            assert np.linalg.norm(found - places[now.frame], axis=1).mean() < 0.15


def test_what_a_live_start_gets_wrong_is_not_relied_on(walk):
    """Three points in ten are at random places: joints called tracked are near or within their intervals."""
    _, places, keypoints = walk
    wrong = 0
    for seed in range(12):
        for now, found, sd in live(keypoints, 0.3, seed):
            apart = np.abs(found - places[now.frame])
            near = apart.mean() < 0.3 or np.mean(apart < 1.645 * sd) > 0.8
            wrong += not near
            assert near or now.status == TrackStatus.AMBIGUOUS
    assert wrong
