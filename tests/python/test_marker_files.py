"""Files of markers: .c3d and .trc, real ones and damaged ones, and mapping files."""

import json
import subprocess
from pathlib import Path

import ezc3d
import marked_person as mw
import numpy as np
import pytest

from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.io.trc import read_trc
from gait.learn.cycles.period import find
from gait.learn.mocap import markers
from gait.learn.mocap import points as point_files
from gait.learn.mocap.recording import Y_UP
from gait.learn.options import LearnOptions
from gait.learn.solve import readers, retarget
from gait.learn.solve.kinematics import SEGMENTS

DATA = Path(__file__).parents[2] / "../shared/data/mocap"


def real(name):
    path = DATA / name
    if not path.is_file():
        pytest.skip(f"{path} is absent: the recordings are not part of the repository")
    return path


def write_c3d(path, labels, points, unit="mm", scale=1000.0, rate=120.0):
    c3d = ezc3d.c3d()
    c3d["parameters"]["POINT"]["RATE"]["value"] = [rate]
    c3d["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    c3d["parameters"]["POINT"]["LABELS"]["value"] = tuple(labels)
    data = np.ones((4, len(labels), len(points)))
    data[:3] = scale * np.moveaxis(points, 2, 0).swapaxes(1, 2)
    c3d["data"]["points"] = data
    c3d.write(str(path))
    return path


def write_trc(path, labels, points):
    """Millimetres, y up, with empty cells for missing markers and none of them at the end of a line."""
    lines = [f"PathFileType  4\t(X/Y/Z) {path.name}", "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits"]
    lines += [f" 120.0\t\t 120.0\t\t {len(points)}\t {len(labels)}\t mm"]
    lines += ["Frame#\tTime\t" + "\t\t\t".join(labels), "\t\tX1\tY1\tZ1", ""]
    for t, frame in enumerate(1000 * points @ Y_UP):
        cells = ["" if np.isnan(v) else f"{v:.4f}" for v in frame.ravel()]
        lines.append("\t".join([str(t + 1), f"{t / 120:.5f}", *cells]).rstrip("\t"))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def marked():
    points, pose = mw.person(mw.LOWER, frames=240)
    points[30:40, -1] = np.nan
    return points, pose


def angles_of(body):
    straight = retarget.align_pelvis(retarget.level(body)[0])
    return retarget.angles(straight, retarget.measure(straight))


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1000.0), ("cm", 100.0), ("m", 1.0)])
def test_c3d_and_trc_of_one_walk_agree(marked, tmp_path, unit, scale):
    labels = [f"Anna:{label}" for label in mw.LOWER]
    first = readers.read(write_c3d(tmp_path / "a.c3d", labels, marked[0], unit, scale))
    second = readers.read(write_trc(tmp_path / "a.trc", [k.lower() for k in mw.LOWER], marked[0]))
    assert first.fps == second.fps == 120
    assert np.degrees(angles_of(first)) == pytest.approx(np.degrees(angles_of(second)), abs=0.1, nan_ok=True)
    knee = ANGLES.index("l_knee_flexion")
    assert np.degrees(angles_of(first)[:, knee]) == pytest.approx(
        np.degrees(marked[1].angles[:, knee]), abs=4
    )


def test_of_two_subjects_the_one_with_more_markers_is_taken(marked, tmp_path):
    points, labels = marked[0], [f"Anna:{k}" for k in mw.LOWER] + [f"Ben:{k}" for k in mw.LOWER[:9]]
    both = np.concatenate([points, points[:, :9] + 1.0], axis=1)
    alone = readers.read(write_c3d(tmp_path / "a.c3d", mw.LOWER, points))
    found = readers.read(write_c3d(tmp_path / "b.c3d", labels, both))
    assert found.joints["l_knee"] == pytest.approx(alone.joints["l_knee"], abs=1e-4)


def test_wrong_units_are_reported(marked, tmp_path):
    path = write_c3d(tmp_path / "a.c3d", mw.LOWER, marked[0][:20], "m", 100.0)
    with pytest.raises(UserError, match=r"a.c3d: the known markers lie within .*correct the unit"):
        readers.read(path)


def test_unknown_labels_are_named(marked, tmp_path):
    labels = [f"M{k}" for k in range(len(mw.LOWER))]
    with pytest.raises(UserError, match=r"a.c3d: 0 of 17 marker labels are known \(M0, M1.*--markers"):
        readers.read(write_c3d(tmp_path / "a.c3d", labels, marked[0]))


def test_a_mapping_file_names_them(marked, tmp_path):
    labels = [f"M{k}" for k in range(len(mw.LOWER))]
    names = [markers.SETS["plug-in-gait"][label.lower()] for label in mw.LOWER]
    table = dict(zip(labels, names, strict=True))
    mark = markers.LANDMARKS[table["M3"]]
    table["M3"] = {"segment": mark.segment, "at": mark.at, "sd": mark.sd}
    (tmp_path / "map.json").write_text(json.dumps({"markers": table}))
    path = write_c3d(tmp_path / "a.c3d", labels, marked[0])
    known = readers.read(write_c3d(tmp_path / "b.c3d", mw.LOWER, marked[0]))
    found = readers.read(path, LearnOptions(markers=markers.read_map(tmp_path / "map.json")))
    assert found.joints["r_ankle"] == pytest.approx(known.joints["r_ankle"], abs=1e-6)


def test_a_mapping_may_start_from_a_set_and_drop_markers(tmp_path):
    path = tmp_path / "map.json"
    path.write_text(
        '{"set": "plug-in-gait", "markers": {"Sub:L KNE": null, "Plate_1": {"segment": "l_thigh"}}}'
    )
    table = markers.read_map(path).landmarks
    assert "lkne" not in table and table["rkne"] == markers.LANDMARKS["r_knee_lateral"]
    assert table["plate1"].segment == "l_thigh" and table["plate1"].sd == markers.LOOSE_SD_M


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", r"map.json: not valid JSON"),
        ("[1]", r"map.json: contains no JSON object"),
        pytest.param(
            '{"markers": ' + "[" * 100_000,
            r"map.json: not valid JSON \(brackets nested .*; correct it",
            id="deep",
        ),
        ('{"marker": {}}', r"map.json: unknown key 'marker'; the keys are set and markers"),
        ('{"set": "plugin-gait"}', r"map.json: set: 'plugin-gait' is not known; did you mean plug-in-gait"),
        ('{"markers": []}', r"map.json: markers is not an object"),
        ("{}", r"map.json: no markers"),
        ('{"markers": {"A": "l_kneelateral"}}', r"map.json: A: .* did you mean l_knee_lateral"),
        ('{"markers": {"A": {"segment": "left_thigh"}}}', r"map.json: A: 'left_thigh'.*l_thigh"),
        ('{"markers": {"A": {"at": [0, 0, 0]}}}', r"map.json: A: None is not known; did you mean pelvis"),
        ('{"markers": {"A": {"segment": "head", "place": 1}}}', r"map.json: A: unknown key 'place'"),
        ('{"markers": {"A": {"segment": "head", "at": [0, 0]}}}', r"A: at is \[0, 0\]; write 3 numbers"),
        ('{"markers": {"A": {"segment": "head", "at": [0, 0, 40]}}}', r"A: at is .*in statures"),
        ('{"markers": {"A": {"segment": "head", "sd": NaN}}}', r"A: sd is \[NaN\]"),
        ('{"markers": {"A": {"segment": "head", "sd": true}}}', r"A: sd is \[true\]"),
        ('{"markers": {"A": "c7", "A": "t10"}}', r"map.json: 'A' appears twice"),
    ],
)
def test_malformed_mappings_are_one_line(tmp_path, text, words):
    path = tmp_path / "map.json"
    path.write_text(text)
    with pytest.raises(UserError, match=words) as caught:
        markers.read_map(path)
    assert "\n" not in str(caught.value)


def test_a_mapping_that_is_not_there_is_named(tmp_path):
    with pytest.raises(UserError, match="map.json: No such file"):
        markers.read_map(tmp_path / "map.json")


@pytest.mark.parametrize("name", markers.SETS)
def test_sets_name_known_landmarks_on_known_segments(name):
    for landmark in markers.SETS[name].values():
        assert markers.LANDMARKS[landmark].segment in SEGMENTS


def test_left_and_right_landmarks_mirror_each_other():
    for name, left in markers.LANDMARKS.items():
        if name.startswith("l_"):
            right = markers.LANDMARKS[f"r_{name[2:]}"]
            assert right.at == (left.at[0], -left.at[1], left.at[2]) and right.sd == left.sd


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda b: b[:100], "not a readable .c3d"),
        (lambda b: b"\0" * len(b), "not a readable .c3d"),
        (lambda b: b"", "not a readable .c3d"),
        (lambda b: b[: len(b) // 2], r"\d+ of 240 frames are there"),
        (lambda b: b.replace(b"UNITS", b"UNITZ"), None),
        (lambda b: b.replace(b"LABELS", b"LABELZ"), "17 points but 0 labels"),
    ],
)
def test_damaged_c3d_is_one_line(marked, tmp_path, damage, words):
    path = write_c3d(tmp_path / "a.c3d", mw.LOWER, marked[0])
    path.write_bytes(damage(path.read_bytes()))
    if words is None:
        assert point_files.read_c3d(path)[1].shape == (240, 17, 3)
        return
    with pytest.raises(UserError, match=f"a.c3d: {words}") as caught:
        point_files.read_c3d(path)
    assert "\n" not in str(caught.value)


def test_a_crash_of_the_reader_is_one_line(tmp_path, monkeypatch):
    child = tmp_path / "child.py"
    child.write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(point_files, "CHILD", child)
    (tmp_path / "a.c3d").write_bytes(b"x")
    with pytest.raises(UserError, match=r"a.c3d: not a readable .c3d \(the reader crashed on it\)"):
        point_files.read_c3d(tmp_path / "a.c3d")


def test_a_reader_that_hangs_is_ended(tmp_path, monkeypatch):
    def hang(*args, **options):
        raise subprocess.TimeoutExpired("child", options["timeout"])

    monkeypatch.setattr(subprocess, "run", hang)
    (tmp_path / "a.c3d").write_bytes(b"x")
    with pytest.raises(UserError, match="a.c3d: not read after 120 s"):
        point_files.read_c3d(tmp_path / "a.c3d")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace("mm", "inch"), "a.trc:3: Units is 'inch'; write one of m mm cm"),
        (lambda s: s.replace("\tRANK", "\tRANK\t\t\tMORE"), "a.trc:4: 18 labels where NumMarkers is '17'"),
        (lambda s: s.replace("DataRate\t", "Rate\t", 1), "a.trc: not a .trc header of five lines"),
        (lambda s: s.replace("\n 120.0", "\n 0", 1), "a.trc:3: DataRate is '0'; write the frames per second"),
        (lambda s: "\n".join(s.split("\n")[:7]), r"a.trc: too few frames \(1\)"),
        (lambda s: s.replace("\tRANK", "\tLANK"), "a.trc:4: label 'LANK' appears twice"),
        (lambda s: s.replace(" 240\t", " 999\t"), "a.trc:3: NumFrames is 999 but 240 frames are there"),
        (lambda s: s.replace("\n100\t", "\n100\t-"), "a.trc:106: the times do not increase"),
        (lambda s: s.rstrip("\n") + "\t1\t2\n", r"a.trc:246: \d+ cells where 53 belong"),
        (lambda s: s.replace("\n100\t", "\n100\tx"), r"a.trc:106: '.*x.*' is not a number"),
    ],
)
def test_malformed_trc_is_named(marked, tmp_path, change, words):
    path = write_trc(tmp_path / "a.trc", mw.LOWER, marked[0])
    path.write_text(change(path.read_text()))
    with pytest.raises(UserError, match=words):
        read_trc(path)


def test_the_real_file_with_a_wrong_header_is_one_line():
    with pytest.raises(
        UserError, match=r"Dance.c3d: not a readable .c3d \(OFFSET parameter is not an INT\); export it again"
    ):
        point_files.read_c3d(real("c3d/Dance.c3d"))


@pytest.mark.parametrize(
    ("name", "rms", "knee", "stride"),
    [
        ("c3d/FunctionalWalk.c3d", 7, 70, None),
        ("c3d/ADemo1_rewrite_c3d_pc_float.c3d", 9, 70, None),
        ("trc/motion_capture_walk.trc", 7, 70, None),
        ("trc/motion_capture_run.trc", 8, 115, 0.69),
    ],
)
def test_real_markers_fit(name, rms, knee, stride):
    body = readers.read(real(name))
    angles = np.degrees(angles_of(body))
    assert 1000 * body.residual < rms
    for s in "lr":
        flexion = angles[:, ANGLES.index(f"{s}_knee_flexion")]
        assert -10 < np.nanmin(flexion) < 25 and 45 < np.nanmax(flexion) < knee
    period = find(np.radians(angles), body.fps).frames / body.fps
    assert period == pytest.approx(stride, rel=0.02) if stride else 0.9 < period < 1.3


def test_a_person_entering_and_leaving_is_missing_outside():
    """Compared with the knees that the laboratory's own software computed and stored in the file."""
    path = real("c3d/PlugInC3D.c3d")
    body = readers.read(path)
    angles = np.degrees(angles_of(body))
    assert np.isnan(angles[:10, ANGLES.index("l_knee_flexion")]).all() and np.isnan(angles[-30:]).all()
    labels, points, _ = point_files.read_c3d(path)
    for s in "lr":
        theirs = 1000 * points[:, labels.index(f"{s.upper()}KneeAngles"), 0]  # read as if they were mm
        ours = angles[:, ANGLES.index(f"{s}_knee_flexion")]
        both = np.isfinite(ours + theirs) & (theirs != 0)
        assert both.sum() > 120
        assert np.abs(np.mean((ours - theirs)[both])) < 5 and np.std((ours - theirs)[both]) < 3
    arms = [k for k, n in enumerate(ANGLES) if "shoulder" in n or "elbow" in n or "neck" in n]
    assert np.isnan(angles[:, arms]).all()
    visible = np.isfinite(body.joints["l_knee"][:, 0])
    assert 0.7 < visible.mean() < 0.85
