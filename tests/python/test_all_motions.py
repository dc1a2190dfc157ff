"""`gait track` without -m follows people who do anything but walk."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import drawn_person
import numpy as np
import pytest

from gait import Model, State
from gait.bindings.abi import Mode
from gait.cli import main
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_track
from gait.track.clip import track_all_motions
from gait.track.options import ClipOptions

FRAMES = 60
NOISE = 0.2  # pixels


@dataclass(frozen=True)
class Stage:
    """What `track_all_motions` needs of a scene."""

    model: Model
    people: dict[int, Any]


def chosen(walks: dict[str, bool | None], people: bool = True, **options: Any) -> list[str]:
    """Return the models that are tracked with, where `walks` states what each finds; None: no start."""
    tried = []

    def track(options: ClipOptions, scene: Any) -> dict[str, Any]:
        tried.append(options.model_name)
        assert scene.model.classes == Model(options.model_name).classes
        found = walks[options.model_name]
        if found is None:
            raise UserError("walk.mp4: no person")
        return {"walks": found, "by": options.model_name}

    wanted = ClipOptions("walk.mp4", "camera.json", "track.csv", quiet=True, **options)
    scene = Stage(Model(wanted.model_name), {1: None} if people else {})
    figures = track_all_motions(wanted, scene, track)  # type: ignore[arg-type]
    return [*tried, figures["by"]]


def test_only_without_a_model_and_with_keypoints_another_one_is_tried():
    assert chosen({"walk": True}) == ["walk", "walk"]
    assert chosen({"walk": False, "classes": False}) == ["walk", "classes", "classes"]
    assert chosen({"walk": False}, people=False) == ["walk", "walk"]
    assert chosen({"walk": False}, model="walk") == ["walk", "walk"]
    assert chosen({"classes": False}, model="classes") == ["classes", "classes"]
    assert chosen({"paper": False}, mode=Mode.PAPER) == ["paper", "paper"]


def test_a_person_who_cannot_be_found_again_keeps_the_first_track(capsys):
    assert chosen({"walk": False, "classes": None}) == ["walk", "classes", "walk"]


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a clip of someone who stands, with a start and keypoints."""
    folder, model, view = tmp_path_factory.mktemp("stand"), Model("classes"), drawn_person.camera()
    state = State(stature=1.75, motion_class=model.classes.index("stand"))
    state.pelvis[2] = model.pelvis_height(state)
    wall = drawn_person.wall()
    pictures = [drawn_person.draw(model, view, state, wall, i) for i in range(FRAMES)]
    drawn_person.write(folder / "stand.mp4", pictures)
    cv2.imwrite(str(folder / "plate.png"), wall)
    (folder / "camera.json").write_text(json.dumps(view.to_dict()))
    init = {"pelvis": [0.0, 0.0], "heading_rad": 0.0, "stature_m": 1.75}
    (folder / "init.json").write_text(json.dumps(init))
    joints = view.project(model.pose(state)[0])
    uv = joints + np.random.default_rng(1).normal(0, NOISE, (FRAMES, *joints.shape))
    numbers = np.arange(FRAMES)
    names = tuple(model.joint_names)
    found = Keypoints(numbers, numbers / drawn_person.FPS, names, uv, np.ones(uv.shape[:2]))
    keypoints_file.write(folder / "keypoints.csv", found)
    return folder


@pytest.mark.parametrize(
    "more, words, classes",
    [
        ([], "tracking again with -m classes", {"stand"}),
        (["-m", "walk"], "track with -m classes", set()),
    ],
)
def test_a_person_who_stands(stand, more, words, classes, capsys):
    line = ["track", stand / "stand.mp4", "--camera", stand / "camera.json", "-o", stand / "track.csv", *more]
    line += ["--init", stand / "init.json", "--background", stand / "plate.png"]
    line += ["--keypoints", stand / "keypoints.csv"]
    assert main([str(word) for word in line]) == 0
    out, err = capsys.readouterr()
    assert words in err and f"model: {'classes' if classes else 'walk'}\n" in out
    track = read_track(stand / "track.csv")
    assert set(track.motion_class[-30:]) == classes
