"""Model: poses equal those of the numpy version, pictures agree with them, invalid blobs are rejected."""

import re
import struct

import numpy as np
import pytest
from drawn_person import camera
from hypothesis import given
from hypothesis import strategies as st

from gait import GaitArgumentError, GaitError, Model, State, UserError
from gait.bindings.model import read_blob
from gait.body import skeleton
from gait.body.model_curves import curves
from gait.io import blob

MODEL = Model()
SECTIONS = blob.decode(read_blob(None))


def finite(low, high):
    return st.floats(low, high)


STATES = st.builds(
    State,
    phase=finite(0, 0.999),
    stride_hz=finite(0.5, 1.5),
    stature=finite(1.0, 2.2),
    heading=finite(-3.1, 3.1),
    pitch=finite(-0.4, 0.4),
    roll=finite(-0.4, 0.4),
    pelvis=st.lists(finite(-20, 20), min_size=3, max_size=3).map(np.array),
    coef=st.lists(finite(-3, 3), min_size=MODEL.info.components, max_size=MODEL.info.components).map(
        np.array
    ),
)


def twin(state):
    joints, angles = skeleton.pose(
        SECTIONS,
        state.phase,
        state.coef,
        state.stature,
        state.heading,
        state.pitch,
        state.roll,
        state.pelvis,
        stride_hz=state.stride_hz,
    )
    return joints[0], angles[0]


def test_the_paper_model_has_19_angles_and_5_components(tmp_path, monkeypatch):
    paper, sections = Model("paper"), blob.decode(read_blob("paper"))
    assert (
        paper.info.components == 5 and paper.info.proportions == 0 and paper.joint_names == MODEL.joint_names
    )
    angles = sections["CURV"].reshape(6, paper.info.phases, -1)[:, :, : paper.info.angles]
    moving = np.ptp(angles, axis=1).max(axis=0) > 1e-6
    assert moving.sum() == len(skeleton.PAPER_ANGLES) == 19
    assert Model("walk").info.digest == MODEL.info.digest != paper.info.digest
    with pytest.raises(UserError, match="papers: no such model file"):
        Model("papers")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "paper").write_bytes(read_blob(None))  # a user's file takes precedence over a name
    assert Model("paper").info.digest == MODEL.info.digest


def test_names_and_sizes_are_those_of_the_blob():
    assert MODEL.joint_names == tuple(blob.unpack_names(SECTIONS["PTNM"])) == tuple(skeleton.JOINTS)
    assert MODEL.angle_names == tuple(skeleton.ANGLES)
    assert MODEL.limb_names == tuple(blob.unpack_names(SECTIONS["LBNM"]))
    info = MODEL.info
    assert SECTIONS["CURV"].shape == (1 + info.components, info.phases, info.angles + 6)
    assert info.stride_hz == pytest.approx(float(SECTIONS["GAIT"][0]))


@given(STATES)
def test_pose_equals_the_numpy_twin(state):
    joints, angles = MODEL.pose(state)
    expected_joints, expected_angles = twin(state)
    np.testing.assert_allclose(joints, expected_joints, atol=2e-5)
    np.testing.assert_allclose(angles, expected_angles, atol=2e-5)


@given(STATES)
def test_pelvis_height_is_the_height_channel(state):
    names = blob.unpack_names(SECTIONS["CHNM"])
    channels = curves(SECTIONS, [state.phase], [state.coef], state.stride_hz)[0]
    expected = state.stature * channels[names.index("root_height")]
    assert MODEL.pelvis_height(state) == pytest.approx(expected, abs=2e-5)


def test_missing_scores_are_zero():
    short, full = (
        State(coef=np.array([1.0])),
        State(coef=np.array([1.0] + [0.0] * (MODEL.info.components - 1))),
    )
    np.testing.assert_array_equal(MODEL.pose(short)[0], MODEL.pose(full)[0])


def test_render_draws_each_limb_over_its_bones():
    view = camera()
    state = State(phase=0.05, pelvis=np.array([0.0, 0.0, 0.9]))
    ids = MODEL.render(view, state)
    assert ids.shape == (view.height, view.width) and ids.max() <= MODEL.info.limbs
    assert set(np.unique(ids)) >= {0, 1 + MODEL.limb_names.index("head"), 1 + MODEL.limb_names.index("torso")}
    joints, _ = MODEL.pose(state)
    for upper, lower, limb in (("r_hip", "r_knee", "r_thigh"), ("r_knee", "r_ankle", "r_shank")):
        middle = 0.5 * (joints[MODEL.joint_names.index(upper)] + joints[MODEL.joint_names.index(lower)])
        u, v = np.rint(view.project(middle)).astype(int)
        assert MODEL.limb_names[ids[v, u] - 1] == limb


def test_render_of_a_person_out_of_view_is_empty():
    assert not MODEL.render(camera(), State(pelvis=np.array([0.0, -20.0, 0.9]))).any()


def test_prior_is_broad_and_sound():
    mean, sd = MODEL.prior()
    assert mean.stride_hz == pytest.approx(MODEL.info.stride_hz) and sd.phase >= 0.5 and sd.heading >= 3.14
    assert 1.5 < mean.stature < 1.9 and mean.pelvis[2] == pytest.approx(0.5 * mean.stature, rel=0.1)


@pytest.mark.parametrize("field", ["phase", "stature", "heading"])
def test_a_state_that_is_not_finite_is_refused(field):
    with pytest.raises(GaitArgumentError) as caught:
        MODEL.pose(State(**{field: float("nan")}))
    assert isinstance(caught.value, ValueError) and caught.value.name == "GAIT_ERR_ARG"


def test_a_state_of_wrong_shape_is_refused():
    with pytest.raises(ValueError, match="pelvis has 3 numbers"):
        MODEL.pose(State(pelvis=np.zeros(2)))
    with pytest.raises(ValueError, match="at most 16"):
        MODEL.pose(State(coef=np.zeros(17)))


def damaged(change):
    blob_bytes = bytearray(read_blob(None))
    change(blob_bytes)
    return bytes(blob_bytes)


BAD = {
    "not a .gait model": damaged(lambda b: b.__setitem__(0, 0)),
    "format 2.0, this package reads 1.x": damaged(lambda b: struct.pack_into("<H", b, 8, 2)),
    "checksum differs, the file is damaged": damaged(lambda b: b.__setitem__(2000, b[2000] ^ 1)),
    "header states .* bytes, the file has 500": read_blob(None)[:500],
    "not a .gait model; make one with": b"model",
    "CHNM: missing": blob.encode({"MEAN": np.zeros((1, 1), np.float32)}),
}


@pytest.mark.parametrize("words", BAD)
def test_bad_files_are_refused_in_one_line_naming_file_and_remedy(words, tmp_path):
    path = tmp_path / "bad.gait"
    path.write_bytes(BAD[words])
    with pytest.raises(UserError, match=f"bad.gait: .*{words}") as caught:
        Model(path)
    assert "GAIT_ERR" not in str(caught.value)
    assert re.search("; (make|copy|learn) ", str(caught.value))


@pytest.mark.parametrize("size", [0, 1, 63, 64, 500, 20000])
def test_truncated_blobs_are_refused(size):
    with pytest.raises(GaitError):
        Model(read_blob(None)[:size])


def test_missing_model_file_is_one_clear_line(tmp_path):
    with pytest.raises(UserError, match="none.gait: no such model file; make one with gait learn"):
        Model(tmp_path / "none.gait")


def test_names_that_are_no_utf8_are_escaped(tmp_path):
    sections = blob.decode(read_blob(None))
    name = next(
        key for key, rows in sections.items() if b"l_knee" in rows.tobytes() and rows.dtype == np.uint8
    )
    rows = sections[name].copy()
    flat = rows.reshape(-1)
    at = rows.tobytes().index(b"l_knee")
    flat[at + 2] = 0xFF
    path = tmp_path / "m.gait"
    blob.write(path, sections | {name: rows})
    model = Model(str(path))
    names = (*model.joint_names, *model.angle_names, *model.limb_names)
    assert any("l_\\xffnee" in one for one in names)
