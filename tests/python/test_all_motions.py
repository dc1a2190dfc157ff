"""`gait track` without -m follows people who do anything but walk."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import drawn_person
import numpy as np
import pytest

from gait import Camera, Model, State, TrackStatus, Video
from gait.bindings.abi import Flag, Mode
from gait.bindings.estimate import Estimate
from gait.bindings.shipped import CLASSES
from gait.cli import main
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.track import clip, people
from gait.track.clip import track_all_motions
from gait.track.clip_output import HARDLY_TRACKED, Check
from gait.track.options import ClipOptions

NOISE = 0.2  # pixels


@dataclass(frozen=True)
class Stage:
    """What `track_all_motions` needs of a scene."""

    model: Model
    people: dict[int, Any]


def chosen(found: dict[str, Any], people: bool = True, quiet: bool = True, **options: Any) -> list[str]:
    """Return the models that are tracked with, and that of the figures.

    `found` states why each does not follow the person, or in how many frames it is `tracking` where the
    person is hardly tracked; None: no start.
    """
    tried = []

    def track(options: ClipOptions, scene: Any, check: Check) -> dict[str, Any]:
        tried.append(options.model_name)
        assert scene.model.classes == Model(options.model_name).classes
        assert bool(options.model_reason) == (options.model == CLASSES and len(tried) == 2)
        now = found[options.model_name]
        if now is None:
            raise UserError(f"walk.mp4: nothing with {options.model_name}")
        reason, tracking = (HARDLY_TRACKED, now) if isinstance(now, int) else (now, 50)
        check(SimpleNamespace(against_walk=lambda: reason, tracking=tracking))  # type: ignore[arg-type]
        return {"by": options.model_name}

    wanted = ClipOptions("walk.mp4", "camera.json", "track.csv", quiet=quiet, **options)
    scene = Stage(Model(wanted.model_name), {1: None} if people else {})
    figures = track_all_motions(wanted, scene, track)  # type: ignore[arg-type]
    return [*tried, figures["by"]]


def test_only_without_a_model_and_with_keypoints_another_one_is_tried():
    assert chosen({"walk": ""}) == ["walk", "walk"]
    assert chosen({"walk": "stands", "classes": "stands"}) == ["walk", "classes", "classes"]
    assert chosen({"walk": "stands"}, people=False) == ["walk", "walk"]
    assert chosen({"walk": "stands"}, model="walk") == ["walk", "walk"]
    assert chosen({"classes": "stands"}, model="classes") == ["classes", "classes"]
    assert chosen({"paper": "stands"}, mode=Mode.PAPER) == ["paper", "paper"]


def test_the_model_that_follows_the_person_more_is_kept(capsys):
    assert chosen({"walk": 10, "classes": 20}) == ["walk", "classes", "classes"]
    assert chosen({"walk": "stands", "classes": 10}) == ["walk", "classes", "classes"]
    assert not capsys.readouterr().err
    assert chosen({"walk": 20, "classes": 10}, quiet=False) == ["walk", "classes", "walk", "walk"]
    words = "track.csv: with the model classes 10 frames are tracking, 20 without it; tracking with the model"
    assert words in capsys.readouterr().err


def test_a_person_without_a_start_is_searched_for_with_the_other_model():
    assert chosen({"walk": "stands", "classes": None}) == ["walk", "classes", "walk", "walk"]
    assert chosen({"walk": None, "classes": ""}) == ["walk", "classes", "classes"]
    with pytest.raises(UserError, match="nothing with walk"):
        chosen({"walk": None, "classes": None})
    with pytest.raises(UserError, match="nothing with walk"):
        chosen({"walk": None}, people=False)


def filmed(folder: Path, view: Camera, states: list[State]) -> Path:
    """Write a clip of a person of the model of classes, and keypoints of their joints."""
    model, wall = Model("classes"), drawn_person.wall()
    pictures = [drawn_person.draw(model, view, state, wall, i) for i, state in enumerate(states)]
    drawn_person.write(folder / "clip.mp4", pictures)
    cv2.imwrite(str(folder / "plate.png"), wall)
    (folder / "camera.json").write_text(json.dumps(view.to_dict()))
    joints = np.array([view.project(model.pose(state)[0]) for state in states])
    uv = joints + np.random.default_rng(1).normal(0, NOISE, joints.shape)
    numbers = np.arange(len(states))
    names = tuple(model.joint_names)
    found = Keypoints(numbers, numbers / drawn_person.FPS, names, uv, np.ones(uv.shape[:2]))
    keypoints_file.write(folder / "keypoints.csv", found)
    return folder


def track(folder: Path, *more: str) -> int:
    words = ["track", folder / "clip.mp4", "--camera", folder / "camera.json", "-o", folder / "track.csv"]
    words += ["--background", folder / "plate.png", "--keypoints", folder / "keypoints.csv"]
    return main([str(word) for word in (*words, *more)])


@pytest.fixture(scope="module")
def stand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a clip of someone who stands, with a start."""
    folder, model = tmp_path_factory.mktemp("stand"), Model("classes")
    state = State(stature=1.75, motion_class=model.classes.index("stand"))
    state.pelvis[2] = model.pelvis_height(state)
    init = {"pelvis": [0.0, 0.0], "heading_rad": 0.0, "stature_m": 1.75}
    (folder / "init.json").write_text(json.dumps(init))
    return filmed(folder, drawn_person.camera(), [state] * 60)


@pytest.mark.parametrize(
    "more, model, classes",
    [([], "classes, as the person seems to stand, run or walk backwards at times", {"stand"}),
     (["-m", "walk"], "walk", set())],
)  # fmt: skip
def test_a_person_who_stands(stand, more, model, classes, capsys):
    assert track(stand, "--init", str(stand / "init.json"), "--json", *more) == 0
    out, err = capsys.readouterr()
    figures = json.loads(out)
    assert figures["used"]["model"] == model
    assert ("tracking again with the model classes" in err) == bool(classes)
    assert any("to follow other motions than walking: -m classes" in one for one in figures["notes"]) == (
        not classes
    )
    assert set(read_track(stand / "track.csv").motion_class[-30:]) == classes


def test_an_interrupted_second_track_leaves_no_file(stand, tmp_path, monkeypatch):
    """The first one is not written, since it is not kept."""
    tried = []

    def interrupted(options: ClipOptions) -> Model:
        tried.append(options.model)
        raise KeyboardInterrupt

    monkeypatch.setattr(clip, "tracker_model", interrupted)
    files = [str(stand / name) for name in ("clip.mp4", "camera.json", "plate.png", "keypoints.csv")]
    options = dict(zip(("video", "camera", "background", "keypoints"), files, strict=True))
    with pytest.raises(KeyboardInterrupt):
        clip.track_clip(
            ClipOptions(**options, output=str(tmp_path / "o.csv"), init=str(stand / "init.json"), quiet=True)
        )
    assert tried == [CLASSES] and not list(tmp_path.iterdir())


@pytest.fixture(scope="module")
def retreat(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a clip of someone who walks backwards, away from the camera."""
    model, states = Model("classes"), []
    backwards = model.classes.index("backwards")
    info = model.class_info(backwards)
    for i in range(90):
        time = i / drawn_person.FPS
        state = State(phase=info.stride_hz * time % 1, stride_hz=info.stride_hz, motion_class=backwards)
        state.stature, state.heading = 1.75, np.pi
        state.pelvis[0] = 1.75 * info.stride_length * info.stride_hz * time
        state.pelvis[2] = model.pelvis_height(state)
        states.append(state)
    return filmed(tmp_path_factory.mktemp("retreat"), drawn_person.camera((-5.0, 0.4, 1.4)), states)


@pytest.mark.parametrize("more, least, most", [([], 0.0, 0.0), (["-m", "classes"], 0.8, 1.0)])
def test_who_walks_backwards_before_the_camera_is_only_sure_if_that_is_expected(retreat, more, least, most):
    assert track(retreat, "--quiet", *more) == 0
    found = read_track(retreat / "track.csv")
    assert set(found.motion_class[-60:]) == {"backwards"}
    assert least <= np.mean([status == "tracking" for status in found.status]) <= most


def test_each_person_is_drawn_with_the_model_that_tracked_them(tmp_path):
    """A person who stands beside one who walks: the model of walking has no such class."""
    view, walk, classes = drawn_person.camera(), Model("walk"), Model("classes")
    pictures = [Frame(0, 0.0, drawn_person.wall())]
    film = SimpleNamespace(fps=drawn_person.FPS, frames=lambda start, stop: iter(pictures[start:stop]))
    scene = SimpleNamespace(camera=view, frames=range(1), video=film)
    found, models = {}, {1: walk, 2: classes}
    for id, model in models.items():
        state = State(stature=1.75, phase=0.3, stride_hz=0.9, motion_class=len(model.classes) - 1)
        state.coef = np.zeros(model.info.components)
        state.pelvis[:] = id - 1.5, 0.0, model.pelvis_height(state)
        joints = model.pose(state)[0]
        found[id] = {
            0: Estimate(
                0, 0, TrackStatus.TRACKING, Flag(0), 0.0, 1.0, 1.0, 1.0, 1.0, state, state, state,
                joints, np.full_like(joints, 0.01), np.zeros(0), model.joint_names,
            )
        }  # fmt: skip
    options = ClipOptions("v.mp4", "c.json", "o.csv", overlay=str(tmp_path / "o.mp4"), quiet=True)
    people._draw(options, scene, found, models)  # type: ignore[arg-type]
    drawn = next(Video(tmp_path / "o.mp4").frames()).image.astype(int)
    changed = np.abs(drawn - pictures[0].image).max(axis=2) > 60
    left, right = changed[:, :160].mean(), changed[:, 160:].mean()
    assert min(left, right) > 0.01
