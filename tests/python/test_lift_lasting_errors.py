"""Lasting errors of a detector, estimated as numbers beside the motion."""

import numpy as np
import pytest
from test_lift_sequence import BLOCKS, FREEDOM, MARKERS, observed
from toy_segments import toy_prior

from gait.lift.segment.view import Parallel, looking_along
from gait.lift.smooth.lasting_errors import LastingErrors
from gait.lift.smooth.smoother import Observed, Start, smooth


def test_errors_last_as_long_as_stated():
    time, sd = np.arange(0.0, 40.0, 0.1), np.full((400, 2), 3.0)
    errors = LastingErrors(time, sd, 10.0)
    drawn = np.random.default_rng(0).normal(size=(4000, errors.count))
    paths = np.stack([errors.in_picture(numbers)[:, 1, 0] for numbers in drawn])
    assert paths[:, 0].std() == pytest.approx(3.0, rel=0.05)
    assert np.corrcoef(paths[:, 0], paths[:, 100])[0, 1] == pytest.approx(np.exp(-1), abs=0.1)
    assert errors.in_picture(drawn[0]).shape == (400, 2, 2)


def test_errors_of_a_short_sequence_are_constant_and_rows_make_the_picture():
    sd = np.random.default_rng(1).uniform(1, 2, (30, 3))
    errors = LastingErrors(np.arange(30) / 30.0, sd, 10.0)
    assert errors.count == 6
    numbers = np.random.default_rng(2).normal(size=6)
    frame, point = np.nonzero(sd)
    columns, factors = errors.factors(frame, point)
    for axis in range(2):
        made = (factors * numbers[columns + axis]).sum(axis=1)
        np.testing.assert_allclose(made, errors.in_picture(numbers)[frame, point, axis])
    np.testing.assert_allclose(np.diff(errors.in_picture(numbers) / sd[..., None], axis=0), 0, atol=1e-12)


def test_without_such_errors_there_are_no_numbers():
    errors = LastingErrors(np.arange(5.0), np.full((5, 2), np.nan), np.inf)
    assert errors.count == 0 and not errors.in_picture(np.zeros(0)).any()


def test_a_point_that_is_always_off_moves_the_motion_less_and_is_covered_if_that_is_known():
    segments = toy_prior(6, MARKERS, 5, headings=2)
    view = Parallel(looking_along("y"), 1.0, np.zeros(2), steady=True)
    places = np.concatenate([1.7 * segments.mean[0], *[1.7 * segments.mean[0, 3:]] * (BLOCKS - 2)])
    truth, film = observed(segments, places, view, 0.003, np.random.default_rng(3), missing=0.0)
    film.points.uv[:, 2, 0] += 0.009  # as far as no point is an outlier
    start = Start(np.zeros(BLOCKS - 1), np.zeros(BLOCKS - 1, int), 1.7, places, np.ones(len(places)))
    off, covered = [], []
    for sd in (0.0, 0.009):
        lasting = np.zeros(film.points.sd.shape)
        lasting[:, 2] = sd
        given = Observed(film.time, film.points, film.markers, lasting)
        found = smooth(segments, given, view, FREEDOM, start, contact=False, bones=False)
        off.append(abs(float((found.places - truth)[:, 2, 0].mean())))
        inside = np.abs(found.places - truth)[:, 2, 0] < 1.645 * found.sd[:, 2, 0]
        covered.append(inside.mean())
    assert off[1] < 0.95 * off[0]
    assert covered[0] < 0.3 and covered[1] > 0.7
