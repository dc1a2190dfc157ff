"""What soft constraints of the smoother are for: standing feet slide less, bones change less."""

import numpy as np
import pytest

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS
from gait.io.keypoints_file import Keypoints
from gait.lift.segment.view import Perspective
from gait.lift.smooth import motion
from gait.lift.smooth.soft_constraints import BONES, FEET
from gait.simulate.scenario import Scenario
from gait.simulate.stage import set_stage

FRAMES, FPS, NOISE = 40, 25.0, 6.0  # pixels: less noise leaves less to mend
STANDING = 0.05  # m/s


@pytest.fixture(scope="module")
def stage():
    """A person of a normative gait, unknown to the prior."""
    return set_stage(Scenario(frames=FRAMES, fps=FPS, seed=301))


@pytest.fixture(scope="module")
def figures(stage):
    """Sliding speed of standing feet (m/s), and variation of bones (m), by what is asked for."""
    points = stage.walk.points(stage.frames)
    truth = np.stack([points[name] for name in EVAL15], axis=1)
    uv = stage.camera.project(truth) + NOISE * np.random.default_rng(5).standard_normal((FRAMES, 15, 2))
    number = np.arange(FRAMES)
    keypoints = Keypoints(number, number / FPS, tuple(EVAL15), uv, np.ones(uv.shape[:2]))

    def of(contact, bones):
        options = motion.Options(pixel_sd=NOISE, stature=stage.body.stature, contact=contact, bones=bones)
        found = motion.lift(SegmentPrior.load(), keypoints, Perspective(stage.camera), options, tuple(JOINTS))
        places = dict(zip(found.names, np.moveaxis(found.places, 1, 0), strict=True))
        slide = [speed(places[f])[speed(points[f]) < STANDING] for f in FEET if f in places]
        lengths = [np.linalg.norm(places[a] - places[b], axis=1).std() for a, b in BONES]
        return float(np.median(np.concatenate(slide))), float(np.mean(lengths))

    return {arms: of(*arms) for arms in ((True, True), (False, True), (True, False))}


def speed(places):
    """Metres per second between frames."""
    return FPS * np.linalg.norm(np.diff(places, axis=0), axis=1)


def test_feet_slide_less_with_contact(figures):
    assert figures[True, True][0] < 0.9 * figures[False, True][0]


def test_bones_vary_less_where_their_lengths_are_kept(figures):
    assert figures[True, True][1] < 0.6 * figures[True, False][1]
