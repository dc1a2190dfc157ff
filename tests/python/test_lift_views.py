"""gait lift with keypoints of several cameras: they determine the distance, not the person's size."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import walking_keypoints as walking

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera, write_camera
from gait.cli import lift as command
from gait.cli import main
from gait.errors import UserError
from gait.io.keypoints_file import read, write
from gait.io.layouts import joint_named, points_of
from gait.io.track_file import read_estimates
from gait.lift import run
from gait.lift.keypoints.observations import Grid
from gait.lift.segment.view import Perspective, Several
from gait.lift.smooth import motion
from gait.lift.smooth.options import Options

SIDE = Camera.looking((6.0, 5.0, 1.6), (0.3, 5.5, 0.9), walking.SIZE, 1000.0)
LEGS, ARMS = ("hip", "knee", "ankle", "heel", "toe"), ("shoulder", "elbow", "wrist")
LATE = 0.4  # seconds by which the second film began later


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Keypoints of a tall person who walks towards a camera, in its view and in another from the side."""
    folder = tmp_path_factory.mktemp("views")
    for name, camera, seed in (("a", walking.view(), 1), ("b", SIDE, 2)):
        write_camera(folder / f"{name}.json", camera)
        found = walking.keypoints(camera, stature=1.95, noise=3.0, seed=seed)
        write(folder / f"{name}.csv", found)
        late = found.part(slice(6, None))
        write(folder / f"{name}_late.csv", type(found)(late.frame - 6, late.time - LATE, *found_rest(late)))
    return folder


def found_rest(keypoints):
    return keypoints.names, keypoints.uv, keypoints.confidence


def lift(place, *views, options=()):
    """Lift; errors of the joints, mm: in the world, and with the midpoints of the hips aligned."""
    files = [str(place / f"{name}.csv") for name in views]
    cameras = [word for name in views for word in ("--camera", str(place / f"{name[0]}.json"))]
    out = place / "out.csv"
    assert main(["lift", *files, *cameras, "-o", str(out), "--quiet", *options]) == 0
    found = read_estimates(out)
    truth = np.array([walking.walk_at(t, stature=1.95) for t in found.time])
    names = list(walking.MODEL.joint_names)
    joints = [name for name in walking.NAMES if name in found.places]
    places = np.stack([found.places[name] for name in joints], axis=1)
    right = truth[:, [names.index(name) for name in joints]]
    hips = [joints.index(f"{side}_hip") for side in "lr"]
    off = [places - right, places - right - (places - right)[:, hips].mean(axis=1, keepdims=True)]
    sd = np.stack([found.sd[name] for name in joints], axis=1)
    inside = float((np.abs(off[0]) < 1.645 * sd).mean())
    return *(1000 * np.median(np.linalg.norm(one, axis=2)) for one in off), inside


@pytest.mark.long
def test_two_views_are_nearer_than_one(place, capsys):
    alone, rooted, _ = lift(place, "a")
    both, both_rooted, inside = lift(place, "a", "b")
    assert both < 0.3 * alone and both < 25 and both_rooted < rooted
    assert 0.8 < inside < 0.99
    capsys.readouterr()
    lift(place, "a", "b_late", options=["--json"])
    (began,) = json.loads(capsys.readouterr().out)["offsets_s"]
    assert began == pytest.approx(LATE, abs=0.04)
    late, _, _ = lift(place, "a", "b_late", options=["--offsets", f"{LATE}"])
    assert late < 1.3 * both


@pytest.mark.long
def test_limbs_that_a_view_swaps_in_half_of_the_frames_are_put_back(place, capsys):
    """Also if so many are wrong that the motion of both views follows them: one view then shows the sides."""
    right, _, _ = lift(place, "a", "b")
    found = read(str(place / "b.csv"), walking.NAMES)[0]
    uv = found.uv.copy()
    for part, rows in ((LEGS, slice(4, 24)), (ARMS, slice(20, 38))):
        left, other = ([found.names.index(f"{side}_{joint}") for joint in part] for side in "lr")
        uv[rows, left], uv[rows, other] = found.uv[rows, other], found.uv[rows, left]
    write(place / "b_swapped.csv", replace(found, uv=uv))
    swapped, _, _ = lift(place, "a", "b_swapped")
    kept, _, _ = lift(place, "a", "b_swapped", options=["--keep-sides"])
    assert swapped < 1.1 * right and kept > 1.5 * right


def test_outliers_are_named_with_their_view(place, monkeypatch, capsys):
    monkeypatch.chdir(place)
    found = read("b.csv", walking.NAMES)[0]
    uv = found.uv.copy()
    uv[5:12, found.names.index("l_ankle")] += 60
    write("b_wrong.csv", replace(found, uv=uv))
    words = ["lift", "a.csv", "b_wrong.csv", *VIEWS, "--offsets", "0", "--keep-sides", "--keep-spikes"]
    assert main([*words, "-o", "out.csv"]) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "outliers" in line]
    assert "l_ankle in 7 frames of b_wrong.csv" in line and "of a.csv" not in line


def test_enlarged_errors_do_not_hide_a_motion_unlike_the_priors():
    """Chi2 is compared with that of a motion that fits, which is smaller the more the errors are enlarged."""
    prior, observed = SegmentPrior.load(), walking.keypoints(SIDE)
    shape = observed.uv.shape[:2]
    errors = {"sd": np.full(shape, 9.0), "lasting_sd": np.full(shape, 4.0), "frame_sd": np.full(shape, 5.0)}
    observed = replace(observed, **errors, confidence=np.ones(shape))
    options = Options(pixel_sd=1e-3)
    for view, usual in ((Several((SIDE, SIDE), np.zeros(shape[1], int)), 1 / 9), (Perspective(SIDE), 1.0)):
        of = motion._Sequence(prior, observed, view, options, Grid.over(observed.time, prior))
        assert motion._usual_chi2(of) == pytest.approx(usual, rel=1e-3)
    plain = replace(observed, sd=None, lasting_sd=None, frame_sd=None)
    several = Several((SIDE, SIDE), np.zeros(shape[1], int))
    assert motion._usual_chi2(motion._Sequence(prior, plain, several, options, of.grid)) == 1.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--camera", "a.json"], "--camera: 1 for 2 films"),
        (["--method", "blend"], "--method blend: is for one view"),
        (["--orthographic", "x"], "--orthographic: is for one view"),
        (["--offsets", "0.1,0.2"], "--offsets: 2 for 1 further films"),
    ],
)
def test_what_does_not_go_with_several_views_is_a_usage_error(place, options, words, monkeypatch, capsys):
    monkeypatch.chdir(place)
    cameras = [] if "--camera" in options else ["--camera", "a.json", "--camera", "b.json"]
    assert main(["lift", "a.csv", "b.csv", *cameras, *options, "-o", "x.csv"]) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1 and not (place / "x.csv").exists()


@pytest.fixture
def joined_of(monkeypatch):
    """Function that lifts views up to joining them, and returns the keypoints and offsets to be joined."""

    def call(*words):
        found = []

        def note(*given):
            found.extend(given)
            raise UserError("enough")

        monkeypatch.setattr(run, "joined", note)
        assert main(["lift", *map(str, words), "--keep-sides", "-o", "x.csv"]) == 1
        return found

    return call


def mediapipe(path, keypoints, size):
    """Write keypoints as MediaPipe does, as fractions of the picture."""
    joints = [joint_named(name) for name in points_of(33)]
    frames = []
    for time, uv in zip(keypoints.time.tolist(), keypoints.uv, strict=True):
        shares = (uv + 0.5) / size
        points = [{"x": 0.0, "y": 0.0, "z": 0.0, "visibility": 0.0} for _ in joints]
        for point, joint in zip(points, joints, strict=True):
            if joint in keypoints.names:
                x, y = shares[keypoints.names.index(joint)].tolist()
                point |= {"x": x, "y": y, "visibility": 1.0}
        frames.append({"timestamp_ms": 1000 * time, "landmarks": points})
    path.write_text(json.dumps({"frames": frames}))


def test_fractions_are_of_the_picture_of_the_views_own_camera(tmp_path, monkeypatch, joined_of):
    monkeypatch.chdir(tmp_path)
    cameras = {"a": walking.view(), "b": SIDE.scaled(0.5)}
    assert cameras["a"].size != cameras["b"].size
    words = []
    for name, camera in cameras.items():
        mediapipe(tmp_path / f"{name}.json", walking.keypoints(camera, noise=0.0), camera.size)
        write_camera(tmp_path / f"{name}_camera.json", camera)
        words += ["--camera", f"{name}_camera.json"]
    views, _ = joined_of("a.json", "b.json", *words, "--offsets", "0")
    for view, camera in zip(views, cameras.values(), strict=True):
        right = walking.keypoints(camera, noise=0.0)
        columns = [right.names.index(name) for name in view.names]
        assert len(columns) > 10
        np.testing.assert_allclose(view.uv, right.uv[:, columns], atol=1e-6)


VIEWS = ("--camera", "a.json", "--camera", "b.json")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("b.csv", *VIEWS, "--offsets", "100"),
            "b.csv: no frame is at the time of one of a.csv: it begins 100.00 s after that, which takes "
            "2.93 s; correct --offsets",
        ),
        (
            ("b.csv", *VIEWS, "--offsets", "-100"),
            "it begins 100.00 s before that, which takes 2.93 s; correct --offsets",
        ),
        (
            ("b.csv", "--camera", "a.json", "--camera", "a.json", "--offsets", "0"),
            "b.csv: its camera is at the same place as that of a.csv; give each film and camera once",
        ),
        (
            ("b.csv", "b_late.csv", *VIEWS, "--camera", "b.json", "--offsets", "0,0.4"),
            "b_late.csv: its camera is at the same place as that of b.csv; give each film and camera once",
        ),
        (
            ("slow.csv", *VIEWS, "--offsets", "0"),
            "slow.csv: its frames are 0.2 s apart; of several views only the first may have fewer than 7 a "
            "second",
        ),
        (
            ("still.csv", *VIEWS),
            "still.csv: its time offset from a.csv cannot be estimated from the person's motion, which both "
            "must show for over 1 s; give --offsets",
        ),
    ],
)
def test_a_view_that_adds_nothing_is_refused(place, words, message, monkeypatch, capsys):
    monkeypatch.chdir(place)
    write("still.csv", walking.keypoints(SIDE, standing=True))
    write("slow.csv", walking.keypoints(SIDE).part(slice(None, None, 3)))
    assert main(["lift", "a.csv", *words, "--keep-sides", "-o", "x.csv"]) == 1
    assert message in capsys.readouterr().err and not (place / "x.csv").exists()


def test_start_and_stop_are_of_the_first_film(tmp_path, monkeypatch, capsys):
    asked = {}

    def detect(args, prior, video, camera):
        asked[video] = args.start, args.stop
        if len(asked) == 2:
            raise UserError("both seen")
        return SimpleNamespace(people={}, still=None, calibration=None)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "_detect", detect)
    for name, camera in (("a", walking.view()), ("b", SIDE)):
        Path(f"{name}.mp4").touch()
        write_camera(tmp_path / f"{name}.json", camera)
    words = ["lift", "a.mp4", "b.mp4", "--camera", "a.json", "--camera", "b.json", "-o", "out.csv"]
    assert main([*words, "--start", "5", "--stop", "40"]) == 1
    assert "both seen" in capsys.readouterr().err
    assert asked == {"a.mp4": (5, 40), "b.mp4": (None, None)}


def test_whether_an_offset_was_estimated_or_given_is_reported(place, joined_of, monkeypatch, capsys):
    monkeypatch.chdir(place)
    _, (given,) = joined_of("b_late.csv", "a.csv", *VIEWS[2:], *VIEWS[:2], "--offsets", f"{-LATE}")
    words = capsys.readouterr().err
    assert given == -LATE
    assert "a.csv: began 0.400 s before the first film, as given (joints fit to 0." in words
    _, (found,) = joined_of("a.csv", "b_late.csv", *VIEWS)
    words = capsys.readouterr().err
    assert found == pytest.approx(LATE, abs=0.04)
    assert (
        f"b_late.csv: began {found:.3f} s after the first film, estimated from the person's motion" in words
    )


def test_each_view_keeps_its_own_noise(tmp_path, monkeypatch, joined_of):
    monkeypatch.chdir(tmp_path)
    words = []
    for name, camera, noise in (("a", walking.view(), 1.0), ("b", SIDE, 12.0)):
        found = walking.keypoints(camera, speed=0.6, noise=noise)  # at 15 frames per second
        found = replace(found, time=found.time / 2, confidence=0.5 * found.confidence)
        write(f"{name}.csv", found)
        write_camera(tmp_path / f"{name}.json", camera)
        words += ["--camera", f"{name}.json"]
    (calm, noisy), _ = joined_of("a.csv", "b.csv", *words, "--offsets", "0")
    least = Options.pixel_sd
    np.testing.assert_array_equal(calm.changing(least), least / 0.5)
    np.testing.assert_allclose(noisy.changing(least), 12.0, rtol=0.15)


def openpose(folder, *people, step=1):
    """Write people as OpenPose does, in every `step`-th frame; none where all points of a row are missing."""
    folder.mkdir()
    joints = [joint_named(name) for name in points_of(25)]
    for t in range(len(people[0].time)):
        shown = []
        for one in people:
            points = np.zeros((25, 3))
            for k, joint in enumerate(joints):
                if joint in one.names and np.isfinite(one.uv[t, one.names.index(joint)]).all():
                    points[k] = *one.uv[t, one.names.index(joint)], 1.0
            if points.any():
                shown.append({"person_id": [-1], "pose_keypoints_2d": points.ravel().tolist()})
        (folder / f"f_{step * t:012d}_keypoints.json").write_text(json.dumps({"people": shown}))


@pytest.fixture
def crowd(tmp_path, monkeypatch):
    """Views of OpenPose: the person, and by another camera the person in fewer frames, and another person."""
    monkeypatch.chdir(tmp_path)
    openpose(tmp_path / "a", walking.keypoints(walking.view(), noise=0.5))
    person, other = (walking.keypoints(SIDE, walk, noise=0.5) for walk in (walking.TOWARDS, walking.ACROSS))
    person.uv[30:] = np.nan
    openpose(tmp_path / "b", other, person, step=2)
    for name, camera in (("a", walking.view()), ("b", SIDE)):
        write_camera(tmp_path / f"{name}.json", camera)
    return person


def test_the_person_of_a_further_view_is_the_one_of_the_first(crowd, joined_of, capsys):
    words = ("a", "b", *VIEWS, "--fps", 15, "--fps", 30)
    (first, further), (offset,) = joined_of(*words)
    assert "b: has 2 people: 0 (45 frames), 1 (30 frames); took 1, whose joints fit a best (" in (
        capsys.readouterr().err
    )
    assert offset == 0 and further.time == pytest.approx(first.time[:30])
    shared = [name for name in crowd.names if name in further.names]
    right, found = ([of.names.index(name) for name in shared] for of in (crowd, further))
    np.testing.assert_allclose(further.uv[:, found], crowd.uv[:30, right], atol=1e-6)
    (_, other), _ = joined_of(*words, "--person", "0", "--offsets", "0")
    assert len(other.time) == 45
    (_, chosen), _ = joined_of(*words, "--person", "0", "--person", "1", "--offsets", "0")
    np.testing.assert_array_equal(chosen.uv, further.uv)


def test_one_rate_is_for_the_files_that_have_no_times(crowd, joined_of, capsys):
    for name in ("a.csv", "c.csv"):
        write(name, walking.keypoints(walking.view()))
    (own, foreign), _ = joined_of("a.csv", "b", *VIEWS, "--fps", 30, "--offsets", "0")
    assert own.time[1] == pytest.approx(1 / 15, abs=1e-6) and foreign.time[1] == pytest.approx(1 / 15)
    for files, message in (
        (("a.csv", "b"), "--fps: 2 for 1 file of other tools; give one for each, or one for all"),
        (("a.csv", "c.csv"), "--fps: is for files of other tools, and no view has one"),
    ):
        assert main(["lift", *files, *VIEWS, "--fps", "30", "--fps", "15", "-o", "x.csv"]) == 2
        assert message in capsys.readouterr().err
