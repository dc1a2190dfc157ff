"""Left and right in several views come from the motion lifted from all of them."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import walking_keypoints as walking

from gait.bindings.segment_prior import SegmentPrior
from gait.camera import synchronise
from gait.camera.camera import Camera, write_camera
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lift import run
from gait.lift.keypoints.joined import joined
from gait.lift.run import FilmedView, Lifted, Request
from gait.lift.segment.view import Several
from gait.lift.smooth.options import Options
from gait.lift.view_sides import best_sides

CAMERAS = (walking.view(), Camera.looking((6.0, 5.0, 1.6), (0.3, 5.5, 0.9), walking.SIZE, 1000.0))
LEGS = ("hip", "knee", "ankle", "heel", "toe")
SIDES = ("l_", "r_")
LATE = 0.4  # seconds by which the second film began later


def swapped(keypoints, rows):
    """Keypoints with the legs swapped in some rows."""
    uv, names = keypoints.uv.copy(), keypoints.names
    left, right = (
        [k for k, name in enumerate(names) if name in {side + leg for leg in LEGS}] for side in SIDES
    )
    uv[rows, left], uv[rows, right] = keypoints.uv[rows, right], keypoints.uv[rows, left]
    return replace(keypoints, uv=uv)


@pytest.fixture(scope="module")
def views():
    return [walking.keypoints(camera, seed=seed) for seed, camera in enumerate(CAMERAS)]


@dataclass
class Result:
    keypoints: Keypoints
    motion: SimpleNamespace


class Lift:
    """Finds the true motion, but refuses keypoints in some calls."""

    def __init__(self, right, refuses=lambda keypoints, call: False):
        self.calls, self._right, self._refuses = 0, right, refuses

    def __call__(self, keypoints):
        self.calls += 1
        if self._refuses(keypoints, self.calls):
            raise UserError("the person is behind the camera")
        places = np.array([walking.walk_at(t) for t in keypoints.time])
        evidence = -float((keypoints.uv != self._right.uv).sum())
        names = tuple(walking.MODEL.joint_names)
        return Result(
            keypoints,
            SimpleNamespace(places=places, names=names, evidence=evidence, chi2_per_observation=1.0),
        )


def best(keypoints, of_point, lift):
    several = Several(CAMERAS, of_point)
    return best_sides(SegmentPrior.load(), keypoints, several, Options(), [Options.pixel_sd] * 2, lift, True)


def test_limbs_that_do_not_fit_the_motion_are_swapped(views):
    right, of_point = joined(views, [0.0])
    spoilt, _ = joined([views[0], swapped(views[1], slice(5, 25))], [0.0])
    found = best(spoilt, of_point, Lift(right)).keypoints
    off = np.linalg.norm(found.uv - right.uv, axis=2)
    assert (off > 0).mean() < 0.02 < (spoilt.uv != right.uv).mean()  # where the legs meet, either may be


def test_a_motion_that_is_refused_after_a_swap_leaves_the_one_before(views):
    right, of_point = joined(views, [0.0])
    spoilt, _ = joined([views[0], swapped(views[1], slice(5, 25))], [0.0])
    lift = Lift(right, lambda _, call: call > 1)
    assert best(spoilt, of_point, lift).keypoints is spoilt and lift.calls > 1
    with pytest.raises(UserError, match="behind the camera"):
        best(spoilt, of_point, Lift(right, lambda *_: True))


def test_one_view_shows_the_sides_if_all_together_are_refused(views):
    """Also if only another view has a marker that is no joint."""
    names = (*views[1].names, "pelvis_back_l")
    extra = replace(
        views[1],
        names=names,
        uv=np.concatenate([views[1].uv, views[1].uv[:, :1]], axis=1),
        confidence=np.hstack([views[1].confidence, views[1].confidence[:, :1]]),
    )
    right, of_point = joined([views[0], extra], [0.0])
    spoilt, _ = joined([views[0], swapped(extra, slice(5, 25))], [0.0])
    lift = Lift(right, lambda keypoints, _: (keypoints.uv != right.uv).mean() > 0.1)
    found = best(spoilt, of_point, lift).keypoints
    assert (found.uv != right.uv).mean() < 0.1 < (spoilt.uv != right.uv).mean()


def test_offsets_come_from_repaired_sides_and_a_swapped_frame_is_no_spike(views, tmp_path, monkeypatch):
    files = []
    for name, camera in zip("ab", CAMERAS, strict=True):
        write_camera(tmp_path / f"{name}.json", camera)
        files.append(str(tmp_path / f"{name}.json"))
    late = views[1].part(slice(6, None))
    late = replace(late, frame=late.frame - 6, time=late.time - LATE)
    spoilt = swapped(swapped(late, [4]), slice(15, 24))
    spoilt.uv[30, 0] += 200
    observed = []

    def as_joined(prior, keypoints, *_):
        observed.append(keypoints)
        return Lifted(keypoints, None, None, None)

    found_of = synchronise.find_offset
    monkeypatch.setattr(
        synchronise, "find_offset", lambda *given: observed.append(given[2]) or found_of(*given)
    )
    monkeypatch.setattr(run, "best_sides", as_joined)
    films = [FilmedView("a.csv", files[0], {"0": views[0]}), FilmedView("b.csv", files[1], {"0": spoilt})]
    lifted = run.lift_views(films, None, SegmentPrior.load(), Request(Options()), lambda _: None, True)
    alone, together = observed
    np.testing.assert_array_equal(alone.uv[15:24], late.uv[15:24])
    b = together.names.index(late.names[0]) + len(views[0].names)
    assert np.isfinite(together.uv[10, b:]).all()
    assert lifted.repairs["left_out"] == [{"film": "b.csv", "frame": 30, "point": late.names[0]}]
    assert lifted.repairs["offsets_s"][0] == pytest.approx(LATE, abs=0.04)
