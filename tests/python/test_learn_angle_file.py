"""Angles in .csv: units, gaps, tracks as input, and arbitrary text."""

from pathlib import Path

import marked_person as mw
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gait.body.skeleton import ANGLES, JOINTS, ROOTS, default_skeleton
from gait.errors import UserError
from gait.io.track_file import header
from gait.learn.mocap import tables
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import LearnOptions
from gait.learn.solve import readers, retarget
from gait.learn.solve.body import Body
from gait.learn.solve.kinematics import pose_skeleton

TABLE = mw.walk_angles(240, 100.0)
DEGREES = np.degrees(1)
LEGS = [n for n in ANGLES if "hip" in n or "knee" in n]


def write(path, suffix="_deg", names=ANGLES, scale=DEGREES, rate=100.0, extra=None, digits=6):
    extra = extra or {}
    rows = [",".join(["frame", "time", *(n + suffix for n in names), *extra])]
    for t, row in enumerate(TABLE):
        cells = [f"{scale * row[ANGLES.index(n)]:.{digits}f}" for n in names] + [
            f"{v[t]}" for v in extra.values()
        ]
        rows.append(",".join([str(t), f"{t / rate:.4f}", *cells]))
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize(
    ("suffix", "scale"), [("_deg", np.degrees(1)), ("_rad", 1.0), ("", np.degrees(1)), ("", 1.0)]
)
def test_units_by_suffix_or_range(tmp_path, suffix, scale):
    table = readers.read(write(tmp_path / "p1_a.csv", suffix, scale=scale))
    assert isinstance(table, AngleTable)
    assert table.angles == pytest.approx(TABLE, abs=1e-5)
    assert table.fps == pytest.approx(100) and table.name == "p1_a" and table.frames == 240
    assert table.root is None and table.stature is None


def test_legs_that_turn_round_are_refused(tmp_path):
    with pytest.raises(UserError, match=r"l_hip_flexion_rad .* \d{4} degrees; if it is in degrees, name "):
        readers.read(write(tmp_path / "a.csv", "_rad", scale=DEGREES))
    with pytest.raises(UserError, match=r"l_hip_flexion_deg has a range of \d{4} degrees; repair it"):
        readers.read(write(tmp_path / "a.csv", scale=20 * DEGREES))


def test_columns_that_are_not_there_are_missing(tmp_path):
    table = readers.read(write(tmp_path / "a.csv", names=LEGS))
    visible = np.isfinite(table.angles).all(axis=0)
    assert [n for n, s in zip(ANGLES, visible, strict=True) if s] == LEGS
    assert np.isnan(table.angles[:, ~visible]).all()


def test_a_position_is_no_speed(tmp_path):
    """A walk at 0.8 statures per stride whose position is given instead of its speed."""
    path = write(tmp_path / "a.csv", extra={"root_forward": 3 * np.arange(240) / 100})
    with pytest.raises(UserError, match=r"a.csv: root_forward reaches 6\.5 statures .* like a position"):
        readers.read(path)
    sprint = np.full(240, 2.6)
    sprint[:20] = 9.0  # errors of recording
    assert readers.read(write(tmp_path / "a.csv", extra={"root_forward": sprint})).root is not None


def test_root_channels_and_stature(tmp_path):
    extra = {"root_forward": np.full(240, 0.8), "root_pitch_deg": np.full(240, 3.0), "stature_m": [1.7] * 240}
    table = readers.read(write(tmp_path / "a.csv", extra=extra))
    assert table.stature == pytest.approx(1.7)
    assert table.root[:, ROOTS.index("root_forward")] == pytest.approx(0.8)
    assert table.root[:, ROOTS.index("root_pitch")] == pytest.approx(np.radians(3))
    assert np.isnan(table.root[:, ROOTS.index("root_sway")]).all()
    for stature in (0.0, 170.0):
        extra["stature_m"] = [stature] * 240
        with pytest.raises(UserError, match="a.csv: stature_m is not from 0.5 to 2.5; write metres"):
            readers.read(write(tmp_path / "a.csv", extra=extra))


def test_empty_cells_and_dropped_rows_are_missing(tmp_path):
    path = write(tmp_path / "a.csv")
    lines = path.read_text().splitlines()
    cells = lines[11].split(",")
    cells[2 + ANGLES.index("l_knee_flexion")] = ""
    lines[11] = ",".join(cells)
    path.write_text("\n".join(lines[:51] + lines[61:]) + "\n")
    table = readers.read(path)
    gone = np.isnan(table.angles)
    assert table.frames == 240 and gone[50:60].all() and gone[10, ANGLES.index("l_knee_flexion")]
    assert gone.sum() == 10 * len(ANGLES) + 1
    assert table.angles[60:] == pytest.approx(TABLE[60:], abs=1e-5)


def test_zeros_in_a_row_are_missing_if_asked_for(tmp_path):
    path, knee, fixed = tmp_path / "a.csv", ANGLES.index("l_knee_flexion"), ANGLES.index("neck_x")
    rows = [line.split(",") for line in write(path).read_text().splitlines()]
    for t, row in enumerate(rows[1:]):
        row[2 + fixed] = "0"  # in all rows: a joint that the file does not move
        if 100 <= t < 140 or t in (20, 21):
            row[2 + knee] = "0.0"
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    assert np.isfinite(readers.read(path).angles).all()
    gone = np.isnan(readers.read(path, LearnOptions(zeros_missing=True)).angles)
    assert gone[100:140, knee].all() and gone.sum() == 40


def test_semicolons_with_decimal_commas_and_a_byte_order_mark(tmp_path):
    path = write(tmp_path / "a.csv")
    text = path.read_text().replace(",", ";").replace(".", ",")
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert readers.read(path).angles == pytest.approx(TABLE, abs=1e-5)


def test_the_rate_of_a_file_without_times(tmp_path):
    path = write(tmp_path / "a.csv")
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join([row[0], *row[2:]]) for row in rows))
    with pytest.raises(UserError, match=r"a.csv:1: no column 'time'.*--fps"):
        readers.read(path)
    assert tables.read_angles(path, 50.0).fps == 50


def test_what_a_track_writes_has_its_joints_and_its_angles_but_not_what_was_lost(tmp_path):
    _, pose = mw.person(mw.LOWER, frames=60)
    names = header(2, tuple(ANGLES))
    skeleton = default_skeleton()
    body = pose_skeleton(pose, 1.7 * skeleton.origins)
    joints = body.points(1.7 * skeleton.point_positions, skeleton.point_frames)
    rows = [",".join(names)]
    for t in range(60):
        row = dict.fromkeys(names, "0.1")
        row |= {"frame": str(t), "time": f"{t / 30:.5f}", "status": "lost" if t >= 50 else "tracking"}
        for k, joint in enumerate(JOINTS):
            row |= {f"{joint}_{axis}": f"{v:.6f}" for axis, v in zip("xyz", joints[t, k], strict=True)}
        row |= {f"{n}_deg": f"{v:.4f}" for n, v in zip(ANGLES, np.degrees(pose.angles[t]), strict=True)}
        rows.append(",".join(row.values()))
    (tmp_path / "track.csv").write_text("\n".join(rows) + "\n")
    found = readers.read(tmp_path / "track.csv")
    assert isinstance(found, Body) and found.fps == pytest.approx(30, rel=1e-3)
    assert found.joints["l_knee"][:50] == pytest.approx(joints[:50, JOINTS.index("l_knee")], abs=1e-5)
    assert np.isnan(found.joints["l_knee"][50:]).all()
    angles = retarget.angles(found, retarget.measure(found))
    assert np.isnan(angles[50:]).all()
    error = np.degrees(angles - pose.angles)[
        :50, :-2
    ]  # these feet never stand flat, which gives the ankles' zero
    assert np.abs(error).max() < 0.05


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda s: s.replace("l_knee_flexion_deg", "l_knee"),
            "a.csv:1: no column l_knee_flexion_deg or l_knee",
        ),
        (
            lambda s: s.replace("neck_y_deg", "neck_x_rad"),
            "a.csv:1: neck_x appears as neck_x_deg and neck_x_rad",
        ),
        (lambda s: s.replace("neck_y_deg", "neck_x_deg"), "a.csv:1: column 'neck_x_deg' appears twice"),
        (lambda s: s.replace("\n50,", "\n50,,"), "a.csv:52: 27 cells instead of 26"),
        (lambda s: s.replace("\n50,0.5000", "\n50,0.4"), "a.csv:52: the times do not increase"),
        (lambda s: s.replace("\n50,0.5000", "\n\n50,0.4"), "a.csv:53: the times do not increase"),
        (lambda s: s.replace("\n40,", "\n\n\n40,").replace("\n50,", "\n50,,"), "a.csv:54: 27 cells instead"),
        (lambda s: s.replace("\n239,2.3900", "\n239,99.0"), r"a.csv:241: 96.6 s after the row before; cut"),
        (lambda s: s.replace("\n50,0.5000", "\n50,"), "a.csv:52: the times do not increase"),
        (lambda s: "\n".join(s.split("\n")[:3]), r"a.csv: too few frames \(2\)"),
        (lambda s: s[:-30], r"a.csv:241: \d+ cells instead of 26"),
        (lambda s: s.replace("\n7,0.0700,", "\n7,0.0700,1e"), "a.csv:9: neck_x_deg: '1e.*' is not a number"),
        (lambda s: "", "a.csv: the file is empty"),
    ],
)
def test_malformed_files_are_named(tmp_path, change, words):
    path = write(tmp_path / "a.csv")
    path.write_text(change(path.read_text()))
    with pytest.raises(UserError, match=words):
        readers.read(path)


def test_an_empty_column_of_the_legs_is_named(tmp_path):
    path = write(
        tmp_path / "a.csv",
        names=[n for n in LEGS if n != "r_hip_flexion"],
        extra={"r_hip_flexion": [""] * 240},
    )
    with pytest.raises(UserError, match="a.csv: column r_hip_flexion is empty"):
        readers.read(path)


CELLS = st.one_of(
    st.floats(allow_nan=True).map(str), st.integers().map(str), st.text(max_size=6),
    st.sampled_from(["", "nan", "lost", "-", '"', "1e999"]),
)  # fmt: skip
NAMES = st.sampled_from(
    ["frame", "time", "status", "stature_m", "l_hip_x", "root_yaw", *(n + "_deg" for n in LEGS)]
)


@settings(max_examples=300)
@given(
    st.lists(NAMES, max_size=14), st.lists(st.lists(CELLS, max_size=14), max_size=8), st.sampled_from(",;\t")
)
def test_any_table_is_read_or_refused_in_one_line(tmp_path_factory, names, rows, comma):
    path = tmp_path_factory.mktemp("any") / "a.csv"
    path.write_text("\n".join(comma.join(row) for row in [names, *rows]), encoding="utf-8", errors="replace")
    check_read_or_refused(path)


@settings(max_examples=200)
@given(st.binary(max_size=400))
def test_any_bytes_are_read_or_refused_in_one_line(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("any") / "a.csv"
    path.write_bytes(content)
    check_read_or_refused(path)


def check_read_or_refused(path: Path):
    try:
        found = readers.read(path)
    except UserError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error)
    else:
        assert isinstance(found, AngleTable) and found.fps > 0 and not np.isinf(found.angles).any()
