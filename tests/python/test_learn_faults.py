"""Motion files that contradict themselves or gave a wrong model: rejected in one line, or learnt."""

import struct
from pathlib import Path

import marked_person as mw
import numpy as np
import pytest
from mocap_files import bvh_from_amc, write_toy
from scipy.spatial.transform import Rotation
from test_marker_files import write_c3d, write_trc

from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.io.trc import read_trc
from gait.learn.cycles import sequence
from gait.learn.mocap import bvh, points
from gait.learn.mocap.markers import read_map
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import LearnOptions
from gait.learn.solve import readers, retarget
from gait.learn.solve.kinematics import SEGMENTS, pose_skeleton, segment_origins

FAULTS = Path(__file__).resolve().parents[2] / "../shared/data/faults"


@pytest.fixture(scope="module")
def marked():
    return mw.person(mw.LOWER, frames=240)[0]


def edited(path, *changes):
    text = path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path.write_text(text)
    return path


# ---- .trc: rate and times ----


@pytest.mark.parametrize(
    ("rate", "fits"), [("120", True), ("119.88", True), ("60", False), ("240", False), ("125", False)]
)
def test_the_rate_of_a_trc_is_that_of_its_times(rate, fits, marked, tmp_path):
    path = edited(write_trc(tmp_path / "a.trc", mw.LOWER, marked), ("\n 120.0\t", f"\n {rate}\t"))
    if fits:
        assert read_trc(path)[2] == float(rate)
        return
    with pytest.raises(UserError, match=rf"DataRate is {rate} .* by 0.00833\d s, 120 per second"):
        read_trc(path)
    assert points.read(path, 120.0)[2] == 120.0  # --fps decides


def test_rows_that_are_missing_from_a_trc_are_named_unless_frames_are_numbered(marked, tmp_path):
    path = write_trc(tmp_path / "a.trc", mw.LOWER, marked)
    whole, lines = read_trc(path)[1], path.read_text().replace("\t 240\t", "\t 237\t").split("\n")
    del lines[106:109]
    path.write_text("\n".join(lines))
    _, points, _ = read_trc(path)
    assert np.isnan(points[100:103]).all()
    np.testing.assert_array_equal(
        np.delete(points, [100, 101, 102], axis=0), np.delete(whole, [100, 101, 102], axis=0)
    )
    path.write_text("\n".join([*lines[:6], *("\t" + line.partition("\t")[2] for line in lines[6:-1]), ""]))
    with pytest.raises(UserError, match=r"a.trc:107: 0.0333 s after the row before"):
        read_trc(path)


@pytest.mark.parametrize(
    ("number", "original", "words"),
    [
        (lambda t: t + 481, 120, ""),
        (lambda t: 2 * t + 1, 240, ""),
        (
            lambda t: 2 * t + 1,
            120,
            "a.trc:8: Frame# is 3 after 1, but no frame is missing by DataRate and col",
        ),
        (lambda t: t + 11 * (t > 99), 120, "a.trc:107: Frame# is 111 after 99, but no frame is missing"),
        (lambda t: t - (t > 99), 120, "a.trc:107: Frame# is 99 after 99"),
        (lambda t: 1, 120, "a.trc:8: Frame# is 1 after 1"),
    ],
)
def test_frame_numbers_agree_with_times(number, original, words, marked, tmp_path):
    path = edited(
        write_trc(tmp_path / "a.trc", mw.LOWER, marked),
        ("\tUnits\n", "\tUnits\tOrigDataRate\n"),
        ("\t mm\n", f"\t mm\t{original}\n"),
    )
    lines = path.read_text().split("\n")
    head, rows = lines[:6], [line.split("\t") for line in lines[6:-1]]
    text = ["\t".join([str(number(t)), *row[1:]]) for t, row in enumerate(rows)]
    path.write_text("\n".join([*head, *text]) + "\n")
    if not words:
        assert read_trc(path)[2] == 120
        return
    with pytest.raises(UserError, match=words):
        read_trc(path)
    assert points.read(path, 120.0)[2] == 120.0  # --fps decides


def test_times_rounded_to_milliseconds_or_left_out_are_accepted(marked, tmp_path):
    path = write_trc(tmp_path / "a.trc", mw.LOWER, marked)
    head, rows = path.read_text().split("\n")[:6], path.read_text().split("\n")[6:-1]
    for form in ("{:.3f}", ""):
        cells = [row.split("\t") for row in rows]
        text = ["\t".join([c[0], form.format(float(c[1])), *c[2:]]) for c in cells]
        path.write_text("\n".join([*head, *text]) + "\n")
        assert read_trc(path)[2] == 120


# ---- .c3d: header and parameters ----


def header(path, at, value, form="<H"):
    """Change a value of the header, at a byte, or of the parameter with a name."""
    content = bytearray(path.read_bytes())
    at = content.index(at) + len(at) + 4 if isinstance(at, bytes) else at
    struct.pack_into(form, content, at, value)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("at", "value", "form", "words"),
    [
        (2, 16, "<H", "the header states 16 points, POINT:USED 17"),
        (2, 18, "<H", "the header states 18 points, POINT:USED 17"),
        (4, 6, "<H", r"6 analog values per frame, ANALOG:USED and ANALOG:RATE 0 \(0 channels"),
        (20, 60.0, "<f", "60 frames per second, POINT:RATE 120; .* give --fps"),
        (8, 180, "<H", "180 frames, POINT:FRAMES 240"),
        (6, 50, "<H", "191 frames, POINT:FRAMES 240"),
        (16, 9, "<H", "points from block 9 on, POINT:DATA_START 4"),
        (12, 0.5, "<f", "a scale of 0.5, POINT:SCALE -1"),
        (b"FRAMES", 800, "<H", "240 frames, POINT:FRAMES 800"),
        (b"DATA_START", 5, "<H", "points from block 4 on, POINT:DATA_START 5"),
        (b"SCALE", 0.1, "<f", "a scale of -1, POINT:SCALE 0.1"),
    ],
)
def test_a_header_that_differs_from_the_parameters_is_named(at, value, form, words, marked, tmp_path):
    path = header(write_c3d(tmp_path / "a.c3d", mw.LOWER, marked), at, value, form)
    with pytest.raises(UserError, match=f"a.c3d: header and parameters differ: .*{words}"):
        points.read(path)


def test_of_two_rates_the_user_may_choose(marked, tmp_path):
    path = header(write_c3d(tmp_path / "a.c3d", mw.LOWER, marked), 20, 60.0, "<f")
    assert points.read(path, 120.0)[2] == 120


# ---- .bvh: rest poses and joints ----


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    return bvh_from_amc(write_toy(tmp_path_factory.mktemp("toy"), frames=240))


def aligned(path):
    """The same motion with another rest pose: each bone lies along its own x axis."""
    words = bvh._Words(path, path.read_text().splitlines())
    joints = bvh._hierarchy(words)
    values, fps = bvh._motion(words, path.read_text().splitlines(), sum(len(j.channels) for j in joints))
    ends = bvh._ends(joints)
    turns = []  # from the new axes of each joint to its old ones
    for offset in ends:
        if not offset.any():
            turns.append(np.eye(3))
            continue
        x = offset / np.linalg.norm(offset)
        other = np.eye(3)[int(np.argmin(np.abs(x)))]
        y = np.cross(other, x) / np.linalg.norm(np.cross(other, x))
        turns.append(np.stack([x, y, np.cross(x, y)], axis=1))
    column, out = 0, np.empty_like(values)
    for i, joint in enumerate(joints):
        own = values[:, column : column + len(joint.channels)].copy()
        rotation = Rotation.from_euler("ZYX", own[:, -3:], degrees=True).as_matrix()
        above = turns[joint.parent] if joint.parent >= 0 else np.eye(3)
        own[:, -3:] = Rotation.from_matrix(above.T @ rotation @ turns[i]).as_euler("ZYX", degrees=True)
        out[:, column : column + len(joint.channels)] = own
        column += len(joint.channels)
        if joint.parent >= 0:
            joint.offset = above.T @ joint.offset
        if joint.end is not None:
            joint.end = turns[i].T @ joint.end
    return bvh.assemble(path, joints, out, fps)


def test_a_rest_pose_that_does_not_stand_gives_the_same_motion(walking, tmp_path, monkeypatch):
    path = tmp_path / "a.bvh"
    path.write_text(walking)
    standing, other = bvh.read(path), aligned(path)
    np.testing.assert_allclose(other.start, standing.start, atol=1e-6)
    assert np.abs(other.rest_start - standing.rest_start).max() > 0.5
    both = []
    for recording in (standing, other):
        monkeypatch.setitem(readers.READERS, ".bvh", lambda *_, found=recording: found)
        body = readers.read(path)
        both.append(np.degrees(retarget.angles(body, retarget.measure(body))))
    difference = np.abs(both[1] - both[0]).mean(axis=0)
    legs = [ANGLES.index(f"{s}_{joint}_flexion") for s in "lr" for joint in ("hip", "knee")]
    assert difference[legs].max() < 3  # the pelvis is level on average, where the standing pose may tilt it
    assert sequence.prepare(path, readers.read(path)).period.frames / 120 == pytest.approx(1.0, rel=0.02)


def test_a_missing_neck_begins_where_the_head_does(walking, tmp_path):
    text = walking
    for bone in ("upperneck", "lowerneck"):
        text = text.replace(f"JOINT {bone}", f"JOINT spine_{bone[:2]}")
    path = tmp_path / "a.bvh"
    path.write_text(text)
    body, recording = readers.read(path), bvh.read(path)
    head, left, right = (recording.start[:, recording.bones.index(k)] for k in ("head", "lfemur", "rfemur"))
    height = body.joints["neck"][:, 2] - body.joints["pelvis"][:, 2]
    np.testing.assert_allclose(height, (head - (left + right) / 2)[:, 2], atol=1e-6)
    assert body.notes.lacking == ()


@pytest.mark.parametrize("part", ["head", "humerus", "radius"])
def test_other_parts_may_be_missing_and_are_noted(part, walking, tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(walking.replace(part, "prop"))
    read = readers.read(path)
    assert read.notes.lacking
    assert np.isfinite(sequence.prepare(path, read).channels[:, ANGLES.index("l_knee_flexion")]).all()


def test_legs_may_not(walking, tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(walking.replace("ltibia", "prop"))
    with pytest.raises(UserError, match="no bone for 'l_shank'"):
        readers.read(path)


@pytest.mark.parametrize("frames", [100, 300])
def test_a_bvh_has_as_many_rows_as_it_states(frames, walking, tmp_path):
    path = tmp_path / "a.bvh"
    path.write_text(walking.replace("Frames: 240", f"Frames: {frames}"))
    with pytest.raises(UserError, match=f"240 rows for {frames} frames"):
        bvh.read(path)


# ---- mirrored worlds, undetermined pelvis, strides out of range ----


@pytest.mark.parametrize("axis", [0, 2])
def test_mirrored_markers_are_refused_whatever_the_activity(axis, marked, tmp_path):
    sign = np.ones(3)
    sign[axis] = -1
    path = write_trc(tmp_path / "a.trc", mw.LOWER, sign * marked[::8])
    with pytest.raises(UserError, match="a.trc: axes are left-handed, or left and right are swapped"):
        readers.read(path, LearnOptions(activity="stairs"))


def test_swapped_labels_are_refused(marked, tmp_path):
    labels = [{"L": "R", "R": "L"}.get(k[0], k[0]) + k[1:] for k in mw.LOWER]
    with pytest.raises(UserError, match="left and right are swapped"):
        readers.read(write_trc(tmp_path / "a.trc", labels, marked[::8]))


def test_a_mirrored_skeleton_is_refused(walking, tmp_path):
    path = tmp_path / "a.bvh"
    text = walking
    for left, right in (("JOINT l", "JOINT ?"), ("JOINT r", "JOINT l"), ("JOINT ?", "JOINT r")):
        text = text.replace(left, right)
    path.write_text(
        text.replace("JOINT rowerback", "JOINT lowerback").replace("JOINT rowerneck", "JOINT lowerneck")
    )
    with pytest.raises(UserError, match="left and right are swapped"):
        readers.read(path)


def test_without_pelvis_markers_it_is_level_across_the_hips(tmp_path):
    labels = [k for k in mw.LOWER if k[1:] not in ("ASI", "PSI") and k != "SACR"] + ["LHIP", "RHIP"]
    kept = [k for k in labels if "HIP" not in k]
    found, pose = mw.person(kept, frames=120)
    origins = segment_origins(mw.own_lengths(np.random.default_rng(0)))
    hips = pose_skeleton(pose, origins).points(
        np.zeros((2, 3)), np.array([SEGMENTS.index(f"{s}_thigh") for s in "lr"])
    )
    path = write_trc(tmp_path / "a.trc", labels, np.concatenate([found, hips], axis=1))
    map_path = tmp_path / "map.json"
    map_path.write_text('{"set": "plug-in-gait", "markers": {"LHIP": "l_hip", "RHIP": "r_hip"}}')
    body = readers.read(path, LearnOptions(markers=read_map(map_path)))
    assert np.isfinite(body.pelvis).all() and body.pelvis[:, 2, 2] == pytest.approx(1, abs=0.02)


def test_markers_of_legs_in_another_unit_are_named_by_their_size(tmp_path):
    labels = ["RHip", "RKnee", "RAnkle", "LHip", "LKnee", "LAnkle"]
    legs = [[0.0, side, height] for side in (0.1, -0.1) for height in (0.9, 0.5, 0.1)]
    path = write_trc(tmp_path / "a.trc", labels, 1e-3 * np.array([legs] * 60))
    with pytest.raises(UserError, match="the known markers lie within 0.0008 m: correct the unit"):
        readers.read(path)


def test_too_few_markers_do_not_lack_names(tmp_path):
    path = write_trc(tmp_path / "a.trc", ["RHip", "RKnee", "RAnkle", "RHeel"], np.ones((60, 4, 3)))
    with pytest.raises(UserError, match=r"4 markers \(RHip, RKnee, RAnkle, RHeel\) do not show a body: 6"):
        readers.read(path)


@pytest.mark.parametrize("stride", [0.2, 0.3, 0.33, 0.37, 0.395, 2.11, 2.15, 2.25, 2.4, 4.4])
def test_strides_outside_the_search_are_named_and_never_learnt_as_others(stride):
    fps, angles = 60 / stride, mw.walk_angles(240, 60.0)
    limit = "longer than 2.1 s" if stride > 1 else "shorter than 0.4 s"
    with pytest.raises(UserError, match=f"a.csv: not .*strides of {stride:.2f} s are {limit}.*see --fps"):
        sequence.prepare(Path("a.csv"), AngleTable("a", fps, angles))


@pytest.mark.parametrize("stride", [0.405, 2.095])
def test_strides_just_inside_the_search_are_learnt(stride):
    found = sequence.prepare(Path("a.csv"), AngleTable("a", 60 / stride, mw.walk_angles(240, 60.0)))
    assert found.period.frames / found.fps == pytest.approx(stride, rel=0.002)


def test_noise_is_not_blamed_on_the_search():
    angles = np.cumsum(np.random.default_rng(0).normal(size=(600, 24)), axis=0) / 50
    with pytest.raises(UserError, match="a.csv: not learnt as 'walk'") as caught:
        sequence.prepare(Path("a.csv"), AngleTable("a", 50.0, angles))
    assert "looked for" not in str(caught.value)


@pytest.mark.skipif(not FAULTS.is_dir(), reason="../shared/data/faults is absent")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("c3d_header/no_analog_rate.c3d", "ANALOG:RATE"),
        ("c3d_header/used_17_header_16.c3d", "16 points, POINT:USED 17"),
        ("left_handed/left_handed.trc", "left-handed"),
        ("slow_walk/stride_2.4s.trc", "longer than 2.1 s"),
        ("trc_rate/header60_time120.trc", "DataRate is 60 per second, but column Time"),
    ],
)
def test_public_files_are_refused(name, words):
    with pytest.raises(UserError, match=words):
        sequence.load(FAULTS / name)


@pytest.mark.skipif(not FAULTS.is_dir(), reason="../shared/data/faults is absent")
@pytest.mark.parametrize(
    "name", ["bvh_aligned/bone_aligned.bvh", "bvh_no_neck/no_neck.bvh", "no_pelvis/legs.trc"]
)
def test_public_files_are_learnt(name):
    found = sequence.load(FAULTS / name)
    assert found.fps / found.period.frames == pytest.approx(0.9, rel=0.02)
