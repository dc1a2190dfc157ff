"""A person's measured body: the model has its lengths, feet stay on the floor, faults are one line."""

import json

import numpy as np
import pytest

import gait
from gait import UserError
from gait.body.measured import MeasuredBody, model_of
from gait.cli import main

LENGTHS = {"leg_m": 0.88, "thigh_m": 0.42, "arm_m": 0.55, "hip_width_m": 0.19, "shoulder_width_m": 0.36}
ENDS = {
    "thigh": ("l_hip", "l_knee"),
    "shank": ("r_knee", "r_ankle"),
    "hip_width": ("l_hip", "r_hip"),
    "shoulder_width": ("l_shoulder", "r_shoulder"),
}


def read(tmp_path, **changes):
    path = tmp_path / "body.json"
    path.write_text(json.dumps({"stature_m": 1.7} | LENGTHS | changes))
    return MeasuredBody.read(path)


@pytest.mark.parametrize("source", ["walk", "classes"])
def test_the_model_has_the_lengths_and_feet_stay_on_the_floor(tmp_path, source):
    own, usual = gait.Model(model_of(read(tmp_path), source)), gait.Model(source)
    wanted = {"thigh": 0.42, "shank": 0.46, "hip_width": 0.19, "shoulder_width": 0.36}
    for phase in (0.0, 0.3, 0.7):
        places = []
        for model in (own, usual):
            state = model.prior()[0]
            state.phase, state.stature = phase, 1.7
            state.pelvis[2] = model.pelvis_height(state)
            places.append(dict(zip(model.joint_names, model.pose(state)[0], strict=True)))
        at, before = places
        found = {name: np.linalg.norm(at[a] - at[b]) for name, (a, b) in ENDS.items()}
        assert found == pytest.approx(wanted, abs=1e-5)
        arm = sum(
            np.linalg.norm(at[f"l_{a}"] - at[f"l_{b}"])
            for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))
        )
        assert arm == pytest.approx(0.55, abs=1e-5)
        soles = [min(one["l_toe"][2], one["r_toe"][2]) for one in places]
        assert soles[0] == pytest.approx(soles[1], abs=0.008)
        assert np.linalg.norm(at["neck"] - at["pelvis"]) == pytest.approx(
            np.linalg.norm(before["neck"] - before["pelvis"]), abs=1e-5
        )


def test_a_stature_alone_is_the_model_of_anyone(tmp_path):
    path = tmp_path / "body.json"
    path.write_text('{"stature_m": 1.7}')
    own, usual = gait.Model(model_of(MeasuredBody.read(path))), gait.Model()
    np.testing.assert_array_equal(own.pose(own.prior()[0])[0], usual.pose(usual.prior()[0])[0])


def test_faults_name_file_key_and_remedy(tmp_path, capsys):
    with pytest.raises(
        UserError, match=r"body.json: shank_m is 0.18, 0.4\d times .* between centres of joints"
    ):
        model_of(read(tmp_path, leg_m=0.60))
    with pytest.raises(UserError, match="body.json: leg_m is given together with both of its parts"):
        read(tmp_path, shank_m=0.46)
    with pytest.raises(UserError, match="body.json: tigh_m is not a known key; use stature_m leg_m"):
        read(tmp_path, tigh_m=0.4)
    words = ["track", "v.mp4", "--camera", "c.json", "-o", "o.csv", "--body", "b.json", "--height", "1.7"]
    assert main(words) == 2
    assert "--body has the stature" in capsys.readouterr().err
