"""Joint positions in .csv and .trc as a source of learning."""

from dataclasses import replace

import mocap_files as files
import numpy as np
import pytest
from test_marker_files import write_c3d

from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.learn.cycles.sequence import load
from gait.learn.mocap import acclaim, tables
from gait.learn.mocap.recording import Y_UP
from gait.learn.options import LearnOptions
from gait.learn.solve import body, joints, readers, retarget

TRC_NAMES = {"neck": "Neck", "head": "Head", "l_toe": "LBigToe", "r_toe": "RBigToe"}


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return body.from_bones(acclaim.read(files.write_toy(tmp_path_factory.mktemp("toy"), frames=400)))


def write_csv(path, person):
    names = {n: "head_top" if n == "head" else n for n in tables.TABLE_JOINTS}
    header = ["frame", "time", "status"] + [f"{names[n]}_{axis}" for n in names for axis in "xyz"]
    rows = [",".join(header)]
    for t in range(person.frames):
        cells = [f"{v:.5f}" for n in names for v in person.joints[n][t]]
        rows.append(",".join([str(t), f"{t / person.fps:.6f}", "tracking", *cells]))
    path.write_text("\n".join(rows) + "\n")
    return path


def write_trc(path, person):
    names = {n: TRC_NAMES.get(n, n[0].upper() + n[2:].title()) for n in tables.TABLE_JOINTS}
    head = "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits"
    lines = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}", head]
    lines += [
        f"120\t120\t{person.frames}\t{len(names)}\tmm",
        "Frame#\tTime\t" + "\t\t\t".join(names.values()),
    ]
    lines.append("\t\t" + "\t".join(f"{axis}{i}" for i in range(1, len(names) + 1) for axis in "XYZ"))
    for t in range(person.frames):
        cells = [f"{v:.3f}" for n in names for v in 1000 * (person.joints[n][t] @ Y_UP)]
        lines.append("\t".join([str(t + 1), f"{t / 120:.5f}", *cells]))
    path.write_text("\n".join(lines) + "\n")
    return path


def test_csv_and_trc_hold_the_same_joints(person, tmp_path):
    first = joints.from_table(write_csv(tmp_path / "a.csv", person))
    second = readers.read(write_trc(tmp_path / "a.trc", person))
    assert first.fps == pytest.approx(120, rel=1e-3) and second.fps == 120
    for name in tables.TABLE_JOINTS:
        assert first.joints[name] == pytest.approx(person.joints[name], abs=1e-4), name
        assert second.joints[name] == pytest.approx(person.joints[name], abs=1e-4), name


def test_flexions_agree_with_the_recording_that_has_orientations(person, tmp_path):
    again = joints.from_table(write_csv(tmp_path / "a.csv", person))
    true, found = (np.degrees(retarget.angles(b, retarget.measure(b))) for b in (person, again))
    for name in ("l_knee_flexion", "r_knee_flexion", "l_elbow_flexion", "r_hip_flexion", "l_hip_flexion"):
        k = ANGLES.index(name)
        assert np.ptp(found[:, k]) == pytest.approx(np.ptp(true[:, k]), abs=4), name
        assert np.std((found - true)[:, k]) < 3, name


def test_a_csv_is_learnt_from(person, tmp_path):
    sequence = load(write_csv(tmp_path / "p1_a.csv", person))
    assert sequence.period.frames == pytest.approx(120, abs=0.5)
    assert sequence.subject == "p1" and np.isfinite(sequence.channels).all()


def without_wrist(person):
    """The same person with zeros where the left wrist was hidden for 20 frames."""
    wrist = person.joints["l_wrist"].copy()
    wrist[50:70] = 0
    return replace(person, joints={**person.joints, "l_wrist": wrist})


def test_zeros_in_a_row_are_missing_if_asked_for(person, tmp_path):
    path = write_csv(tmp_path / "a.csv", without_wrist(person))
    assert not readers.read(path).joints["l_wrist"][50:70, 2].any()
    found = readers.read(path, LearnOptions(zeros_missing=True)).joints
    assert np.flatnonzero(np.isnan(found["l_wrist"]).any(axis=1)).tolist() == list(range(50, 70))
    assert all(np.isfinite(place).all() for name, place in found.items() if name != "l_wrist")


@pytest.mark.parametrize("kind", ["trc", "c3d"])
def test_joint_centres_at_the_origin_are_missing(person, tmp_path, kind):
    hidden, path = without_wrist(person), tmp_path / f"a.{kind}"
    if kind == "trc":
        write_trc(path, hidden)
    else:
        places = np.stack([hidden.joints[n] for n in tables.TABLE_JOINTS], axis=1)
        write_c3d(path, tables.TABLE_JOINTS, places @ Y_UP)
    sequence = load(path)
    assert np.flatnonzero(np.isnan(sequence.channels).any(axis=1)).tolist() == list(range(50, 70))


def test_empty_cells_are_missing(person, tmp_path):
    path = write_csv(tmp_path / "a.csv", person)
    lines = path.read_text().splitlines()
    column = lines[0].split(",").index("l_wrist_x")
    for t in range(50, 70):
        cells = lines[t + 1].split(",")
        cells[column : column + 3] = ["", "", ""]
        lines[t + 1] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    sequence = load(path)
    gone = np.isnan(sequence.channels).any(axis=1)
    assert list(np.flatnonzero(gone)) == list(range(50, 70))
    assert np.isfinite(sequence.channels[:, ANGLES.index("r_knee_flexion")]).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace("l_knee_y", "l_knie_y", 1), "a.csv:1: column 'l_knee_y' is missing"),
        (lambda s: s.replace("l_knee", "left_knie"), "a.csv: no joint 'l_knee'"),
        (lambda s: s.replace("time", "zeit", 1), "a.csv:1: no column 'time'"),
        (lambda s: s[:-20] + "\n", r"a.csv:401: \d+ cells instead"),
        (lambda s: s.rsplit(",", 1)[0] + ",1.2.3\n", r"a.csv:401: r_toe_z: '1.2.3' is not a number"),
        (lambda s: s.split("\n")[0] + "\n", r"a.csv: too few frames \(0\)"),
        (lambda s: "", "a.csv: the file is empty"),
    ],
)
def test_malformed_csv_is_named(person, tmp_path, change, words):
    path = write_csv(tmp_path / "a.csv", person)
    path.write_text(change(path.read_text()))
    with pytest.raises(UserError, match=words):
        joints.from_table(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace("Units", "Unit"), "not a .trc header"),
        (lambda s: s[:40], "not a .trc header"),
        (lambda s: s.replace("\tmm", "\tfurlong"), "a.trc:3: Units is 'furlong'; write one of m mm cm"),
    ],
)
def test_malformed_trc_is_named(person, tmp_path, change, words):
    path = write_trc(tmp_path / "a.trc", person)
    path.write_text(change(path.read_text()))
    with pytest.raises(UserError, match=words):
        readers.read(path)


@pytest.mark.parametrize("scale", [100, 39.37, 3.28, 0.01])
def test_positions_in_other_units_are_named(person, tmp_path, scale):
    path = write_csv(tmp_path / "a.csv", turned(person, scale * np.eye(3)))
    with pytest.raises(UserError, match=r"a.csv: legs of .* m; 0.25 to 1.5 m are plausible"):
        readers.read(path)


def test_left_and_right_swapped_are_refused(person, tmp_path):
    path = write_csv(tmp_path / "a.csv", turned(person, np.diag([1.0, -1, 1])))
    with pytest.raises(UserError, match="axes are left-handed, or left and right are swapped"):
        load(path)


def turned(person, turn):
    return replace(person, joints={name: place @ turn.T for name, place in person.joints.items()})


def test_y_up_is_recognised(person, tmp_path):
    found = joints.from_table(write_csv(tmp_path / "a.csv", turned(person, Y_UP.T)))
    assert found.joints["r_knee"] == pytest.approx(person.joints["r_knee"], abs=1e-4)


@pytest.mark.parametrize(
    ("turn", "words"), [(np.diag([1.0, -1, -1]), "-z is up; z must be"), (Y_UP, "x is up; z must be")]
)
def test_any_other_up_is_named(person, tmp_path, turn, words):
    with pytest.raises(UserError, match=f"a.csv: {words}"):
        joints.from_table(write_csv(tmp_path / "a.csv", turned(person, turn)))


def moved(person, joint, by, frames=(50,)):
    """The same person with a joint elsewhere in some frames."""
    place = person.joints[joint].copy()
    place[list(frames)] += by
    return replace(person, joints={**person.joints, joint: place})


@pytest.mark.parametrize("joint", tables.TABLE_JOINTS)
@pytest.mark.parametrize("by", [(900, 0, 0), (0, 3, 0), (-0.8, 0.8, 0)])
def test_the_joint_that_is_off_the_body_is_named(person, joint, by):
    places = {
        name: place for name, place in moved(person, joint, by).joints.items() if name in tables.TABLE_JOINTS
    }
    with pytest.raises(UserError, match=rf"^50: {joint} is \S+ m from .*, usually \S+ m; .* or empty it$"):
        joints.require_whole(places, str)


@pytest.mark.parametrize("by", [3, 20, 900])
def test_it_is_reported_with_its_line_before_the_axis_that_is_up(person, tmp_path, by):
    path = write_csv(tmp_path / "a.csv", moved(person, "head", (by, 0, 0)))
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:21] + lines[26:]))  # five rows are left out
    with pytest.raises(UserError, match="a.csv:47: head_top is"):
        readers.read(path)
    path = write_csv(tmp_path / "a.csv", moved(person, "r_ankle", (by, 0, 0)))
    with pytest.raises(UserError, match="a.csv:52: r_ankle is"):
        readers.read(path)


def test_centres_in_trc_off_the_body_are_named_with_their_frame(person, tmp_path):
    path = write_trc(tmp_path / "a.trc", moved(person, "r_ankle", (3, 0, 0), range(50, 54)))
    with pytest.raises(UserError, match=r"a.trc: frame 51: RAnkle is .* \(4 such frames\)$"):
        readers.read(path)


def test_an_emptied_place_is_bridged(person, tmp_path):
    path = write_csv(tmp_path / "a.csv", moved(person, "r_ankle", np.nan))
    assert readers.read(path).joints["r_ankle"][50] == pytest.approx(person.joints["r_ankle"][50], abs=0.01)


def test_a_bone_half_as_long_again_is_left(person, tmp_path):
    foot = person.joints["r_toe"][50] - person.joints["r_ankle"][50]
    path = write_csv(tmp_path / "a.csv", moved(person, "r_toe", foot / 2))
    expected = person.joints["r_toe"][50] + foot / 2
    assert joints.from_table(path).joints["r_toe"][50] == pytest.approx(expected, abs=1e-4)


def test_few_zeros_are_off_the_body_unless_they_are_missing(person, tmp_path):
    wrist = person.joints["l_wrist"][50:54]
    path = write_csv(tmp_path / "a.csv", moved(person, "l_wrist", -wrist, range(50, 54)))
    with pytest.raises(UserError, match="a.csv:52: l_wrist is"):
        readers.read(path)
    assert readers.read(path, LearnOptions(zeros_missing=True)).joints["l_wrist"][50] == pytest.approx(
        wrist[0], abs=0.05
    )


@pytest.mark.parametrize("value", [0, np.nan])
def test_joints_without_places_are_not_judged(value):
    places = {name: np.full((5, 3), float(value)) for name in tables.TABLE_JOINTS}
    joints.require_whole(places, str)
    joints.require_whole({"hat": places["head"]}, str)
