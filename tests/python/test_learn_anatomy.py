"""Joint centres of CMU's skeletons: as recorded, or where markers put them."""

from pathlib import Path

import mocap_files as files
import numpy as np
import pytest
from test_mocap import MIXAMO

from gait.body.skeleton import ANGLES
from gait.learn.mocap import acclaim, bvh
from gait.learn.options import LearnOptions
from gait.learn.solve import anatomy, readers, retarget
from gait.learn.solve.body import from_bones

WALKS = Path(__file__).parents[2] / "../shared/data/mocap/cmu_walk"
ANATOMICAL = LearnOptions(joints="anatomical")


@pytest.fixture(scope="module")
def amc(tmp_path_factory):
    return files.write_toy(tmp_path_factory.mktemp("toy"), frames=300)


def flexions(body, joint):
    """Angles (T, 2) of left and right, degrees."""
    table = retarget.angles(body, retarget.measure(body))
    return np.degrees(table[:, [ANGLES.index(f"{s}_{joint}_flexion") for s in "lr"]])


def test_recorded_joints_are_those_of_the_file(amc):
    plain, own = readers.read(amc), from_bones(acclaim.read(amc))
    assert all(np.array_equal(plain.joints[name], own.joints[name]) for name in own.joints)


def test_knees_go_back_shoulders_down_and_wrists_in(amc):
    before, after = readers.read(amc), readers.read(amc, ANATOMICAL)
    first, second = retarget.measure(before), retarget.measure(after)
    share = second.thigh / (second.thigh + second.shank)
    assert share == pytest.approx(anatomy.THIGH, abs=0.008)
    lower = (first.shoulder - second.shoulder)[:, 2] / first.stature
    assert lower == pytest.approx(anatomy.SHOULDER, abs=2e-3)
    assert first.forearm - second.forearm == pytest.approx(anatomy.WRIST * first.stature, rel=0.02)
    assert second.upper_arm == pytest.approx(first.upper_arm, rel=1e-6)


@pytest.mark.parametrize(("joint", "least", "most"), [("hip", 2, 6), ("knee", 4, 10), ("ankle", 0, 6)])
def test_angles_lose_a_constant_and_no_motion(amc, joint, least, most):
    before, after = (flexions(read, joint) for read in (readers.read(amc), readers.read(amc, ANATOMICAL)))
    change = before - after
    assert least < change.mean() < most
    assert change.std() < 0.1 * before.std() + 1


def test_copies_as_bvh_are_known_and_other_skeletons_are_not(amc, tmp_path):
    copy, other = tmp_path / "copy.bvh", tmp_path / "other.bvh"
    copy.write_text(files.bvh_from_amc(amc))
    other.write_text(files.bvh_from_amc(amc, MIXAMO))
    assert anatomy.is_acclaim(bvh.read(copy)) and not anatomy.is_acclaim(bvh.read(other))
    knees = [flexions(readers.read(path, ANATOMICAL), "knee").mean() for path in (amc, copy, other)]
    assert knees[0] == pytest.approx(knees[1], abs=0.05) and knees[2] > knees[0] + 3


@pytest.mark.parametrize("name", ["02/02_01", "16/16_15", "35/35_01"])
def test_knees_of_recorded_walks_come_near_to_those_of_markers(name):
    path = WALKS / f"{name}.amc"
    if not path.is_file():
        pytest.skip(f"{path} is absent: the learning data are not part of the repository")
    before, after = (retarget.levelled(readers.read(path, o)) for o in (LearnOptions(), ANATOMICAL))
    assert 4 < (flexions(before, "knee") - flexions(after, "knee")).mean() < 10
    m = retarget.measure(after)
    assert m.shoulder[:, 2] / m.stature == pytest.approx(0.283, abs=0.025)
