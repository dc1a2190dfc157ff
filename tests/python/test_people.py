"""Several people in one clip: each has a track, although one hides the other."""

import csv
import json
import re
from types import SimpleNamespace

import accessibility
import cv2
import numpy as np
import pytest
from drawn_person import camera, clip, draw, wall, write

from gait import Model, Video
from gait.bindings.model import read_blob
from gait.cli import main
from gait.detect.people import by_size, main_person
from gait.io import blob
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.report.colours import OVER_PICTURES, PERSON_COLOURS
from gait.track import clip_keypoints, read_scene
from gait.track.first_state import who_starts
from gait.track.options import ClipOptions
from gait.track.other_people import OTHER, OtherPeople, Outline

MODEL = Model()
NAMES = (
    *("l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist"),
    *("l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle", "l_heel", "r_heel", "l_toe", "r_toe"),
)
FRAMES = 44


@pytest.fixture(scope="module")
def crossing():
    """Pictures of two people who cross, and the joints (people, frames, J, 3); the first is behind."""
    sections, plate = blob.decode(read_blob(None)), wall()
    ways = ({"start": (-0.85, 0.8)}, {"start": (0.85, -0.2), "heading": np.pi, "phase": 0.6, "stature": 1.65})
    states = [clip(MODEL, sections, FRAMES, plate=plate, **way)[1] for way in ways]
    pictures = [
        draw(MODEL, camera(), near, draw(MODEL, camera(), far, plate, k), k)
        for k, (far, near) in enumerate(zip(*states, strict=True))
    ]
    return pictures, np.array([[MODEL.pose(one)[0] for one in track] for track in states])


def detected(joints, hidden=()):
    """Keypoints of a person, none in the frames `hidden`."""
    order = [MODEL.joint_names.index(name) for name in NAMES]
    uv = camera().project(joints[:, order].reshape(-1, 3)).reshape(len(joints), -1, 2)
    uv[list(hidden)] = np.nan
    frame = np.arange(len(joints))
    return Keypoints(frame, frame / 30, NAMES, uv, np.isfinite(uv[..., 0]).astype(float))


@pytest.mark.long
def test_people_who_cross_keep_their_numbers(crossing, tmp_path, monkeypatch, capsys):
    pictures, joints = crossing
    apart = np.abs(joints[0, :, 0, 0] - joints[1, :, 0, 0])
    hidden = np.flatnonzero(apart < 0.3)
    assert 4 < len(hidden) < 15
    aside = np.repeat(joints[1][:1] + (1.2, 0, 0), FRAMES, axis=0)
    people = {4: detected(joints[0], hidden), 5: detected(aside), 7: detected(joints[1])}
    monkeypatch.setattr(read_scene, "require_detector", lambda _: None)
    monkeypatch.setattr(clip_keypoints, "_detect", lambda *_: (people, 7))
    write(tmp_path / "v.mp4", pictures)
    cv2.imwrite(str(tmp_path / "plate.png"), wall())
    (tmp_path / "camera.json").write_text(json.dumps(camera().to_dict()))
    words = ["track", "v.mp4", "--people", "all", "--camera", "camera.json", "--background", "plate.png"]
    words += ["-o", "t.csv", "--overlay", "o.mp4", "--particles", "400", "--report", "r.html"]
    monkeypatch.chdir(tmp_path)
    assert main(words) == 0
    printed, errors = capsys.readouterr()
    assert "person 1: Tracked" in printed and "person 2: Tracked" in printed and "t-2.csv" in printed
    u, v = people[5].uv[0].mean(axis=0)
    other = f"omeone in view from frame 0 to 43, at first near pixel ({u:.0f}, {v:.0f}), is not tracked"
    assert printed.count(f"\ns{other}") == 1 and other not in errors  # once
    assert Video("o.mp4").count == FRAMES
    page = (tmp_path / "r.html").read_text()
    accessibility.check_file(tmp_path / "r.html")
    assert 'href="r-1.html"' in page and f"S{other}" in page
    assert (tmp_path / "r-2.html").stat().st_size > 100_000
    order = [MODEL.joint_names.index(name) for name in ("l_knee", "r_knee", "l_ankle", "r_ankle")]
    for truth, number in zip(joints, (2, 1), strict=True):  # the nearer is 1
        rows = read_track(f"t-{number}.csv")
        assert rows.frame.tolist() == list(range(FRAMES)) and "lost" not in rows.status
        mine = np.stack([rows.places[MODEL.joint_names[k]] for k in order], axis=1)
        assert np.linalg.norm(mine - truth[:, order], axis=2).mean(axis=1).max() < 0.25
        with open(f"t-{number}.csv", newline="") as file:
            assert {row["person"] for row in csv.DictReader(file)} == {str(number)}


def test_a_start_takes_the_person_who_walks(crossing):
    joints = crossing[1]
    stands, walks = detected(np.repeat(joints[1][:1], FRAMES, axis=0)), detected(joints[0])
    assert by_size({1: walks, 2: stands})[0] == 2  # nearer
    options = ClipOptions("v.mp4", "camera.json", "t.csv")

    def chosen(people):
        place = {"camera": camera(), "model": MODEL, "frames": range(FRAMES), "poses": {}}
        return who_starts(options, SimpleNamespace(people=people, person=main_person(people), **place))

    assert chosen({1: walks, 2: stands}) == 1
    assert chosen({2: stands}) == 2
    assert chosen({1: walks, 2: detected(joints[1])}) == 2  # both walk


def test_another_person_hides_and_is_not_missed(crossing):
    pictures, joints = crossing
    number = int(np.argmin(np.abs(joints[0, :, 0, 0] - joints[1, :, 0, 0])))
    behind, before = (Outline(detected(one), 30, camera()) for one in joints)
    frame = Frame(number, number / 30, pictures[number])
    other = [
        OtherPeople(camera(), own, [other]).nearest(frame) == OTHER
        for own, other in ((behind, before), (before, behind))
    ]
    chest = camera().project(joints[1, number, MODEL.joint_names.index("neck")] - (0, 0, 0.25))
    u, v = np.rint(chest).astype(int)
    assert other[0][v, u] and not other[1][v, u]  # hidden there, and in front there
    assert other[0].sum() > 3 * other[1].sum()
    away = frame._replace(number=FRAMES)
    assert OtherPeople(camera(), behind, [before]).nearest(away) is None


@pytest.mark.parametrize("more", [["--init", "i.json"], ["--detector", "none"], ["--mode", "paper"]])
def test_everyone_is_found_by_the_detector_alone(more, capsys):
    assert main(["track", "v.mp4", "--camera", "c.json", "-o", "t.csv", "--people", "2", *more]) == 2
    assert "--people" in capsys.readouterr().err


def test_several_people_need_the_detectors_weights(tmp_path, capsys):
    write(tmp_path / "v.mp4", [wall()] * 4)
    (tmp_path / "c.json").write_text(json.dumps(camera().to_dict()))
    words = ["track", "v.mp4", "--camera", "c.json", "-o", "t.csv", "--people", "all"]
    assert main([str(tmp_path / word) if "." in word else word for word in words]) == 1
    assert re.search("pose_detection.tflite: .*gait detect --fetch", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--camera-path", "t-2.csv"], "t-2.csv: is read by this command"),
        (["--cameras-out", "t-1.csv"], "t-1.csv: two outputs have this name"),
        (["--trc", "full/o.trc"], "o-2.trc: is a folder"),
    ],
)
def test_files_of_each_person_are_checked_before_long_work(more, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "full" / "o-2.trc").mkdir(parents=True)
    (tmp_path / "t-2.csv").touch()
    assert main(["track", "v.mp4", "--camera", "c.json", "-o", "t.csv", "--people", "2", *more]) == 1
    assert words in capsys.readouterr().err


def test_the_first_people_do_not_have_the_colours_of_sides():
    assert not set(PERSON_COLOURS[:6]) & set(OVER_PICTURES.values())
