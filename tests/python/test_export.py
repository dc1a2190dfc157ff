"""gait export: other programs read the same motion, to 0.1 mm and 0.1 degree."""

import json
import math
import os
import resource
import struct
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from walking_keypoints import walk_at

import gait.cli
from gait.body.skeleton import CHANNELS, JOINTS
from gait.export import angles, motion, opensim
from gait.io.track_file import write_lifted
from gait.io.trc import METRES, read_trc, read_trc_table
from gait.motion.footfalls import find_events

FPS = 30.0
TENTH = 1e-4  # metres


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A motion of 60 frames, of which frame 20 is left out, in a file."""
    time = 2.0 + np.arange(60) / FPS
    places = np.array([walk_at(t) for t in time])
    kept = np.arange(60) != 20
    path = tmp_path_factory.mktemp("walk") / "walk.csv"
    write_lifted(
        path, 5 + np.arange(60)[kept], time[kept], JOINTS, places[kept], np.full_like(places[kept], 0.01)
    )
    return SimpleNamespace(path=path, time=time, places=places, kept=kept)


def export(walk, tmp_path, suffix):
    out = tmp_path / f"out{suffix}"
    assert gait.cli.main(["export", str(walk.path), "-o", str(out)]) == 0
    return out


@pytest.mark.parametrize("fps", [None, FPS])
def test_trc_reads_back(walk, tmp_path, fps):
    path = export(walk, tmp_path, ".trc")
    names, points, rate = read_trc(path, fps)
    assert names == JOINTS and rate == FPS
    np.testing.assert_allclose(points[walk.kept][..., [2, 0, 1]], walk.places[walk.kept], atol=TENTH)
    assert len(points) == 60 and np.isnan(points[20]).all()
    rows = read_trc_table(path, METRES).rows
    np.testing.assert_allclose([row.time for row in rows], walk.time[walk.kept], atol=1e-6)
    assert [row.frame for row in rows] == (6 + np.flatnonzero(walk.kept)).tolist()  # the motion's, from 1


@pytest.mark.filterwarnings("ignore:No analog data found")
def test_c3d_is_read_alike_by_two_readers(walk, tmp_path):
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed: extra mocap")
    c3d = pytest.importorskip("c3d", reason="c3d is not installed: extra dev")
    path = export(walk, tmp_path, ".c3d")
    ours = ezc3d.c3d(str(path))
    with open(path, "rb") as file:
        reader = c3d.Reader(file)
        theirs = np.stack([points for _, points, _ in reader.read_frames()])
        labels = [label.strip() for label in reader.point_labels]
    assert ours["parameters"]["POINT"]["LABELS"]["value"] == JOINTS == labels
    assert reader.point_rate == ours["header"]["points"]["frame_rate"] == FPS
    points = ours["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(points[walk.kept] / 1000, walk.places[walk.kept], atol=TENTH)
    np.testing.assert_allclose(theirs[walk.kept][..., :3], points[walk.kept], atol=1e-3)
    assert np.isnan(points[20]).all() and (theirs[20, :, 3] == -1).all()
    assert ours["header"]["analogs"]["size"] == 0 and not reader.analog_used
    found = find_events(motion.read(walk.path).track)
    event = ours["parameters"]["EVENT"]
    assert event["USED"]["value"][0] == found.count >= 4
    got = sorted(
        zip(event["CONTEXTS"]["value"], event["LABELS"]["value"], event["TIMES"]["value"][1], strict=True)
    )
    wanted = sorted(
        (side.capitalize(), label, time - walk.time[0])
        for kind, label in (("strike", "Foot Strike"), ("off", "Foot Off"))
        for side, times in getattr(found, kind).items()
        for time in times
    )
    assert [row[:2] for row in got] == [row[:2] for row in wanted]
    np.testing.assert_allclose([row[2] for row in got], [row[2] for row in wanted], atol=1e-4)


def test_a_c3d_that_the_disk_has_no_space_for_leaves_the_old_file(walk, tmp_path, capsys):
    pytest.importorskip("ezc3d", reason="ezc3d is not installed: extra mocap")
    whole = export(walk, tmp_path, ".c3d").stat().st_size
    old = tmp_path / "old.c3d"
    old.write_text("old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in (0, 100, 512, 4096, 8192, whole - 512):
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
            assert gait.cli.main(["export", str(walk.path), "-o", str(old)]) == 1
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert "old.c3d: File too large; choose another place" in capsys.readouterr().err
        assert old.read_text() == "old" and len(list(tmp_path.iterdir())) == 2


def test_the_skeleton_of_constant_lengths_is_at_the_joints(walk):
    found = angles.fit(motion.read(walk.path).places)
    assert found.rms < 1e-3  # the model's own body, whose lengths are constant
    assert np.isnan(found.angles[20]).all() and np.isfinite(np.delete(found.angles, 20, axis=0)).all()
    for name in angles.FIXED_CHANNELS:
        assert not np.nan_to_num(found.angles[:, CHANNELS.index(name)]).any()
    knee = found.angles[walk.kept][:, CHANNELS.index("l_knee_flexion")]
    hip, joint, ankle = (walk.places[walk.kept][:, JOINTS.index(f"l_{n}")] for n in ("hip", "knee", "ankle"))
    above, below = joint - hip, ankle - joint
    cosine = (above * below).sum(axis=1) / np.linalg.norm(above, axis=1) / np.linalg.norm(below, axis=1)
    np.testing.assert_allclose(np.degrees(knee), np.degrees(np.arccos(cosine)), atol=0.5)


BONES = {
    "Hips": "pelvis", "LeftArm": "l_upper_arm", "RightForeArm": "r_forearm", "LeftFoot": "l_foot",
    "Head": "head",
}  # fmt: skip


def bones(walk):
    """Places of bones in some frames of the BVH file, metres, y up."""
    fitted = angles.fit(motion.read(walk.path).places)
    _, origins, _ = fitted.pose(walk.kept)
    return {
        (k if k < 20 else k + 1, bone): opensim.GROUND @ origins[k, fitted.frames.index(frame)]
        for k in (0, 19, 40)
        for bone, frame in BONES.items()
    }


def test_bvh_is_read_by_another_reader(walk, tmp_path, capsys):
    bvhio = pytest.importorskip("bvhio", reason="bvhio is not installed: extra dev")
    path = export(walk, tmp_path, ".bvh")
    assert "lacks 1 frames, which repeat the previous frame" in capsys.readouterr().err
    root = bvhio.readAsHierarchy(str(path))
    for (frame, bone), at in bones(walk).items():
        root.loadPose(frame)
        placed = {joint.Name: np.array(joint.PositionWorld) for joint, _, _ in root.layout()}
        np.testing.assert_allclose(placed[bone] / 100, at, atol=TENTH)
    assert float(path.read_text().split("Frame Time: ")[1].split()[0]) == pytest.approx(1 / FPS, rel=1e-6)


@pytest.mark.filterwarnings("ignore")
def test_bvh_is_read_by_blender(walk, tmp_path):
    """Its first frame is 1."""
    bpy = pytest.importorskip("bpy", reason="bpy is not installed")
    bpy.ops.import_anim.bvh(filepath=str(export(walk, tmp_path, ".bvh")), global_scale=0.01, frame_start=1)
    armature = bpy.context.object
    for (frame, bone), (x, y, z) in bones(walk).items():
        bpy.context.scene.frame_set(1 + frame)
        placed = armature.matrix_world @ armature.pose.bones[bone].head
        np.testing.assert_allclose(placed, (x, -z, y), atol=TENTH)  # z up


def test_parquet_has_every_number(walk, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: extra parquet")
    table = parquet.read_table(export(walk, tmp_path, ".parquet"))
    lines = walk.path.read_text().splitlines()
    assert table.column_names == lines[0].split(",") and table.num_rows == len(lines) - 1
    row = [column[3].as_py() for column in table.columns]
    assert row == [float(cell) for cell in lines[4].split(",")]
    assert str(table.schema.field("frame").type) == "int64"


def test_the_model_of_opensim_stands_where_the_joints_are(walk, tmp_path):
    """Forward kinematics of the two files, written out here as OpenSim defines them."""
    path = export(walk, tmp_path, ".mot")
    head, body = path.read_text().split("endheader\n")
    names, *rows = (line.split("\t") for line in body.splitlines())
    values = np.array(rows, float)
    assert f"nRows={len(values)}" in head and "inDegrees=yes" in head and len(values) == 59
    row = dict(zip(names, values[30], strict=True))
    markers = kinematics(ElementTree.parse(path.with_suffix(".osim")).getroot(), row)
    fitted = angles.fit(motion.read(walk.path).places).joints()[walk.kept][30]
    for name, place, near in zip(JOINTS, fitted, walk.places[walk.kept][30], strict=True):
        np.testing.assert_allclose(markers[name], opensim.GROUND @ place, atol=1e-5)
        np.testing.assert_allclose(place, near, atol=2e-3)


def test_the_page_of_angles_states_axes_order_and_factors(walk, tmp_path):
    """Each joint's rotations in the .osim are those of the page, and its factors follow from both axes."""
    lines = (
        Path(__file__)
        .parents[2]
        .joinpath("libgait/doc/reference/angles.md")
        .read_text(encoding="utf-8")
        .splitlines()
    )
    rows = [
        [cell.strip().strip("`") for cell in line.split("|")[1:-1]]
        for line in lines
        if line.startswith("| `")
    ]
    written = []
    for joint in ElementTree.parse(export(walk, tmp_path, ".mot").with_suffix(".osim")).iter("CustomJoint"):
        for axis in joint.iter("TransformAxis"):
            name = axis.findtext("coordinates")
            if name and axis.get("name").startswith("rotation") and not name.endswith("_l"):
                written.append((name, [float(x) for x in axis.findtext("axis").split()]))
    stated = {row[1]: [float(x) for x in row[4].split()] for row in rows}
    assert len(rows) == len(stated) == len(written)
    for name, axis in written:
        assert stated[name] == axis, name
        assert opensim.coordinate(CHANNELS.index(next(row[0] for row in rows if row[1] == name))) == name
    for joint in ("pelvis", "lumbar", "neck", "arm", "hip"):  # the order of the rotations
        order = [name for name, _ in written if name.startswith(joint)]
        assert [row[1] for row in rows if row[1].startswith(joint)] == order
    for _, _, _, _, axis, there, other, factor in rows:
        if there:
            assert float(factor) == np.dot(*([float(x) for x in a.split()] for a in (axis, other))), there


def kinematics(document, row):
    """Markers in the ground for coordinates in degrees and metres."""

    def numbers(element, name):
        return np.array(element.findtext(name).split(), float)

    bodies = {"ground": (np.eye(3), np.zeros(3))}
    for joint in document.iter("CustomJoint"):
        above, below = (frame for frame in joint.find("frames"))
        turn, place = bodies[above.findtext("socket_parent").split("/")[-1]]
        place = place + turn @ numbers(above, "translation")
        for axis, angle in zip(np.eye(3), numbers(above, "orientation"), strict=True):
            turn = turn @ about(axis, angle)
        moved, turned = np.zeros(3), np.eye(3)
        for axis in joint.find("SpatialTransform"):
            name = axis.findtext("coordinates")
            if not name:
                continue
            if axis.get("name").startswith("rotation"):
                turned = turned @ about(numbers(axis, "axis"), math.radians(row[name]))
            else:
                moved = moved + numbers(axis, "axis") * row[name]
        bodies[below.findtext("socket_parent").split("/")[-1]] = (turn @ turned, place + turn @ moved)
    markers = {}
    for marker in document.iter("Marker"):
        turn, place = bodies[marker.findtext("socket_parent_frame").split("/")[-1]]
        markers[marker.get("name")] = place + turn @ numbers(marker, "location")
    return markers


def about(axis, angle):
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def test_inverse_kinematics_of_opensim_find_the_same_angles(walk, tmp_path):
    osim = pytest.importorskip("opensim", reason="opensim is not installed")
    mot, trc = export(walk, tmp_path, ".mot"), export(walk, tmp_path, ".trc")
    model = osim.Model(str(mot.with_suffix(".osim")))
    tool = osim.InverseKinematicsTool()
    tool.setModel(model)
    tool.setMarkerDataFileName(str(trc))
    tool.setOutputMotionFileName(str(tmp_path / "ik.mot"))
    tool.setResultsDir(str(tmp_path))
    for name in JOINTS:
        task = osim.IKMarkerTask()
        task.setName(name)
        task.setWeight(1)
        tool.getIKTaskSet().cloneAndAppend(task)
    tool.setStartTime(walk.time[0])
    tool.setEndTime(walk.time[-1])
    tool.set_accuracy(1e-9)  # at the default 1e-5 the rotation of nearly straight arms has not settled
    tool.run()
    ours, theirs = osim.TimeSeriesTable(str(mot)), osim.TimeSeriesTable(str(tmp_path / "ik.mot"))
    for name in ours.getColumnLabels():
        a, b = (np.array(table.getDependentColumn(name).to_numpy()) for table in (ours, theirs))
        assert np.abs(a - b).max() < (1.0 if not name.startswith("pelvis_t") else 1e-3), name


def messages(path):
    reading = pytest.importorskip("mcap.reader", reason="mcap is not installed: extra mcap")
    with open(path, "rb") as file:
        return [(s and s.name, c, m) for s, c, m in reading.make_reader(file).iter_messages()]


def test_mcap_of_a_motion(walk, tmp_path):
    found = messages(export(walk, tmp_path, ".mcap"))
    assert Counter((schema, channel.topic) for schema, channel, _ in found) == {
        ("foxglove.SceneUpdate", "/person"): 59,
        ("gait.State", "/state"): 59,
    }
    scenes = [message for schema, _, message in found if schema == "foxglove.SceneUpdate"]
    assert [m.log_time for m in scenes] == [round(t * 1e9) for t in np.round(walk.time[walk.kept], 6)]
    entity = json.loads(scenes[7].data)["entities"][0]
    position = entity["spheres"][JOINTS.index("l_knee")]["pose"]["position"]
    np.testing.assert_allclose(list(position.values()), walk.places[7, JOINTS.index("l_knee")], atol=TENTH)


def test_mcap_of_a_log_keeps_every_message_and_its_time(tmp_path):
    pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")
    from gait.camera.camera import Camera
    from gait.lcm.link import LogWriter, gaitmsg
    from gait.lcm.messages import camera_message, image_message

    log, stamps = tmp_path / "session.lcm", Counter()
    camera = Camera.looking((0, -4, 1.5), (0, 0, 1), (32, 24), 30.0)
    estimate = gaitmsg.estimate_t()
    joint = gaitmsg.joint_t()
    joint.name, joint.position = "l_knee", [1.0, 2.0, 0.5]
    estimate.njoints, estimate.joints, estimate.speed = 1, [joint], float("nan")
    unknown = gaitmsg.estimate_t()
    nowhere = gaitmsg.joint_t()
    nowhere.name, nowhere.position = "l_knee", [1.0, float("inf"), float("nan")]
    unknown.njoints, unknown.joints = 1, [nowhere]
    picture = np.arange(32 * 24, dtype=np.uint8).reshape(24, 32)
    writer, wanted = LogWriter(log), []
    for k in range(12):
        at = 1_700_000_000_000_000 + 33_333 * k
        estimate.utime = at
        for channel, message in (
            ("GAIT_CAMERA_0", camera_message(camera, at)),
            ("GAIT_IMAGE_0", image_message(picture, at, k)),
            ("GAIT_IMAGE_1", image_message(picture, at, k, jpeg=90)),
            ("GAIT_ESTIMATE", estimate),
            ("GAIT_ESTIMATE_2", unknown),
        ):
            writer.write(at + 7, channel, message.encode())
            wanted.append((channel, (at + 7) * 1000))
        writer.write(at + 9, "OTHER", b"\x00\x01")
        wanted.append(("OTHER", (at + 9) * 1000))
    writer.close()
    out = tmp_path / "session.mcap"
    assert gait.cli.main(["export", str(log), "-o", str(out)]) == 0
    found = messages(out)
    assert [(c.topic, m.log_time) for _, c, m in found if not c.topic.endswith("/scene")] == wanted
    stamps.update(f"{schema} {c.topic}" for schema, c, _ in found)
    assert stamps == {
        "foxglove.CameraCalibration GAIT_CAMERA_0": 12,
        "foxglove.RawImage GAIT_IMAGE_0": 12,
        "foxglove.CompressedImage GAIT_IMAGE_1": 12,
        "gaitmsg.estimate_t GAIT_ESTIMATE": 12,
        "foxglove.SceneUpdate GAIT_ESTIMATE/scene": 12,
        "gaitmsg.estimate_t GAIT_ESTIMATE_2": 12,
        "None OTHER": 12,
    }
    last = json.loads(next(m.data for _, c, m in reversed(found) if c.topic == "GAIT_ESTIMATE"))
    assert last["joints"][0]["position"] == [1.0, 2.0, 0.5] and last["speed"] is None
    os.truncate(log, log.stat().st_size - 3)
    assert gait.cli.main(["export", str(log), "-o", str(tmp_path / "b.mcap")]) == 1
    assert not (tmp_path / "b.mcap").exists()


def test_strange_messages_of_a_log_are_kept_and_a_strange_log_is_one_line(tmp_path, capsys):
    pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")
    from gait.camera.camera import Camera
    from gait.lcm.link import LogWriter
    from gait.lcm.messages import camera_message

    strange = camera_message(Camera.looking((0, -4, 1.5), (0, 0, 1), (32, 24), 30.0), -5)
    good, strange.fx = strange.encode(), float("nan")
    log, out = tmp_path / "a.lcm", tmp_path / "a.mcap"
    writer = LogWriter(log)
    writer.write(1, "GAIT_CAMERA_0", good)
    writer.write(2, "GAIT_CAMERA_0", strange.encode())
    writer.close()
    assert gait.cli.main(["export", str(log), "-o", str(out)]) == 0
    assert [c.message_encoding for _, c, _ in messages(out)] == ["json", "lcm"]
    whole = log.read_bytes()
    for right, wrong in ((b"CAMERA", b"\xffAMERA"), (struct.pack(">q", 2), struct.pack(">q", -2))):
        log.write_bytes(whole.replace(right, wrong, 1))
        assert gait.cli.main(["export", str(log), "-o", str(tmp_path / "b.mcap")]) == 1
        assert "record it again" in capsys.readouterr().err
        assert not (tmp_path / "b.mcap").exists()


def test_rerun_reads_back(walk, tmp_path):
    pytest.importorskip("rerun", reason="rerun-sdk is not installed: extra rerun")
    reader = pytest.importorskip("rerun.chunk", reason="rerun-sdk before 0.41 does not read files")
    path = export(walk, tmp_path, ".rrd")
    chunks = [chunk for chunk in reader.RrdReader(path).stream() if chunk.entity_path == "/person/joints"]
    columns = "frame", "time", "Points3D:positions"
    frames, times, places = (
        np.concatenate([chunk.to_record_batch().column(name).to_numpy(False) for chunk in chunks])
        for name in columns
    )
    assert frames.tolist() == (5 + np.flatnonzero(walk.kept)).tolist()
    np.testing.assert_allclose(times.astype(np.int64) * 1e-9, walk.time[walk.kept], atol=1e-6)
    found = np.array([np.stack(row) for row in places])
    np.testing.assert_allclose(found, walk.places[walk.kept], atol=TENTH)


@pytest.mark.parametrize(
    ("name", "out", "words"),
    [
        ("walk.csv", "a.fbx", "not a supported format; use one of .trc .c3d"),
        ("none.csv", "a.trc", "no such"),
        ("short.csv", "a.c3d", "has one frame"),
        ("uneven.csv", "a.bvh", "rate is not constant"),
        ("text.csv", "a.parquet", "rows of different lengths"),
    ],
)
def test_faults_end_in_one_line_and_leave_nothing(name, out, words, walk, tmp_path, capsys):
    lines = walk.path.read_text().splitlines()
    (tmp_path / "walk.csv").write_text(walk.path.read_text())
    (tmp_path / "short.csv").write_text("\n".join(lines[:2]) + "\n")
    late = lines[9].split(",")
    late[1] = "2.31"
    (tmp_path / "uneven.csv").write_text("\n".join([*lines[:9], ",".join(late), *lines[10:]]) + "\n")
    (tmp_path / "text.csv").write_text("frame,time\n1\n")
    before = sorted(Path(tmp_path).iterdir())
    assert gait.cli.main(["export", str(tmp_path / name), "-o", str(tmp_path / out)]) == 1
    printed = capsys.readouterr().err
    assert words in printed and printed.count("\n") == 1
    assert sorted(Path(tmp_path).iterdir()) == before
