"""gait export --ros2: another library reads the bodies and the tree of frames that the estimates contain."""

from collections import Counter

import numpy as np
import pytest
from walking_keypoints import walk_at

import gait.cli
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.io.track_file import write_lifted

FIRST = 1_700_000_000_000_000  # microseconds


def read(path):
    """Messages of a bag as (time, topic, message), read by rosbags, which shares no code with our writer."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed: extra dev")
    from rosbags.typesys import Stores, get_typestore
    from rosbags.typesys.msg import get_types_from_msg

    types = get_typestore(Stores.ROS2_JAZZY)
    with rosbag2.Reader(path) as bag:
        for connection in bag.connections:
            stated = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            own = {name: fields for name, fields in stated.items() if name in types.fielddefs}
            assert own == {name: types.fielddefs[name] for name in own}  # ROS's own types are as in ROS
            types.register({name: fields for name, fields in stated.items() if name not in own})
        return [(at, c.topic, types.deserialize_cdr(raw, c.msgtype)) for c, at, raw in bag.messages()]


def vector(v):
    return np.array([v.x, v.y, v.z])


def turned(q, v):
    """A vector turned by a quaternion."""
    axis = vector(q)
    return v + 2 * np.cross(axis, np.cross(axis, v) + q.w * v)


def places(message, frame="world"):
    """Frames of a TFMessage in the world."""
    found = {frame: (np.zeros(3), None)}
    for one in message.transforms:
        origin, turn = found[one.header.frame_id]
        at = vector(one.transform.translation)
        at = origin + (at if turn is None else turned(turn, at))
        found[one.child_frame_id] = at, one.transform.rotation
    return {name: at for name, (at, _) in found.items()}


def test_two_people_of_a_log(tmp_path):
    pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")
    from gait.lcm.link import LogWriter, gaitmsg
    from gait.lcm.messages import camera_message

    camera = Camera.looking((0, -6, 1.5), (0, 0, 1), (640, 480), 500.0)
    writer, log = LogWriter(tmp_path / "a.log"), tmp_path / "a.log"
    writer.write(FIRST, "GAIT_CAMERA_0", camera_message(camera, FIRST).encode())
    body = {name: 0.3 * walk_at(k / 10)[:, [0, 1, 2]] for k, name in enumerate("ab")}
    for k in range(3):
        for channel, joints, status in (
            ("GAIT_ESTIMATE", body["a"], gaitmsg.estimate_t.TRACKING),
            ("GAIT_ESTIMATE_2", body["b"], (1, 3, 2)[k]),
        ):
            estimate = gaitmsg.estimate_t()
            estimate.utime, estimate.status, estimate.njoints = FIRST + 40_000 * k, status, len(JOINTS)
            estimate.mean.heading, estimate.sd.heading, estimate.sd.pelvis = 2.0, 0.1, [0.01, 0.02, 0.03]
            for name, at in zip(JOINTS, joints, strict=True):
                joint = gaitmsg.joint_t()
                joint.name, joint.position = name, at.tolist()
                estimate.joints.append(joint)
            writer.write(estimate.utime + 5000, channel, estimate.encode())
    writer.close()
    out = tmp_path / "a.mcap"
    assert gait.cli.main(["export", str(log), "-o", str(out), "--ros2"]) == 0

    found = read(out)
    assert Counter(topic for _, topic, _ in found) == {
        **{"/tf": 6, "/humans/bodies/tracked": 6, "/gait/1/status": 3, "/gait/2/status": 3},
        **{"/gait/1/pose": 3, "/gait/2/pose": 2},
        **{"/humans/bodies/1/skeleton2d": 3, "/humans/bodies/2/skeleton2d": 2},
    }
    assert {at for at, _, _ in found} == {1000 * (FIRST + 40_000 * k) for k in range(3)}
    lists = [message.ids for _, topic, message in found if topic == "/humans/bodies/tracked"]
    assert lists == [["1"], ["1", "2"], ["1", "2"], ["1"], ["1"], ["1", "2"]]
    assert [m.data for _, t, m in found if t == "/gait/2/status"] == ["tracking", "lost", "ambiguous"]

    trees = [message for _, topic, message in found if topic == "/tf"]
    np.testing.assert_allclose(places(trees[0])["camera_0"], camera.centre, atol=1e-6)
    view = turned(trees[0].transforms[0].transform.rotation, np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(view, camera.R[2], atol=1e-6)
    for tree, person, joints in ((trees[1], 1, body["a"]), (trees[2], 2, body["b"])):
        at = places(tree)
        for name, place in zip(JOINTS, joints, strict=True):
            np.testing.assert_allclose(at[f"{name}_{person}"], place, atol=1e-6)
        hips = [joints[JOINTS.index(f"{side}_hip")] for side in "lr"]
        np.testing.assert_allclose(at[f"body_{person}"], np.mean(hips, axis=0), atol=1e-6)
        ahead = turned(tree.transforms[0].transform.rotation, np.array([1.0, 0.0, 0.0]))
        np.testing.assert_allclose(ahead, [np.cos(2), np.sin(2), 0], atol=1e-6)
        assert tree.transforms[0].header.stamp.sec * 10**6 == FIRST

    pose = next(message for _, topic, message in found if topic == "/gait/1/pose").pose
    np.testing.assert_allclose(np.sqrt(np.diag(pose.covariance.reshape(6, 6))), [0.01, 0.02, 0.03, 0, 0, 0.1])
    skeleton = next(message for _, topic, message in found if topic == "/humans/bodies/1/skeleton2d").skeleton
    knee = camera.project(body["a"][JOINTS.index("r_knee")])
    np.testing.assert_allclose([skeleton[9].x * 639, skeleton[9].y * 479], knee, atol=1e-3)
    assert len(skeleton) == 18 and [p.c for p in skeleton] == [0] + [1] * 13 + [0] * 4


def test_a_lifted_motion(tmp_path):
    places_in = np.array([walk_at(k / 30) for k in range(4)])
    source = tmp_path / "walk.csv"
    write_lifted(source, np.arange(4), np.arange(4) / 30, JOINTS, places_in, np.full_like(places_in, 0.01))
    assert gait.cli.main(["export", str(source), "-o", str(tmp_path / "a.mcap"), "--ros2"]) == 0
    trees = [message for _, topic, message in read(tmp_path / "a.mcap") if topic == "/tf"]
    at = places(trees[3])
    np.testing.assert_allclose(at["l_wrist_1"], places_in[3][JOINTS.index("l_wrist")], atol=1e-4)
    ahead = turned(trees[3].transforms[0].transform.rotation, np.array([1.0, 0.0, 0.0]))
    assert ahead @ (places_in[3] - places_in[0])[JOINTS.index("pelvis")] > 0  # from the hips

    head, *rows = source.read_text().splitlines()
    source.write_text("".join(f"{row}\n" for row in [f"{head},person", *(f"{row},2" for row in rows)]))
    for name, more in (("b", ["--ros2"]), ("c", [])):
        assert gait.cli.main(["export", str(source), "-o", str(tmp_path / f"{name}.mcap"), *more]) == 0
    topics = Counter(topic for _, topic, _ in read(tmp_path / "b.mcap"))
    assert topics == {"/tf": 4, "/humans/bodies/tracked": 4, "/gait/2/status": 4}
    written = (tmp_path / "c.mcap").read_bytes()
    assert b"/person_2" in written and b"/state_2" in written


def test_faults_end_in_one_line(tmp_path, capsys):
    (tmp_path / "a.log").write_bytes(b"\xed\xa1\xda\x01")
    assert gait.cli.main(["export", str(tmp_path / "a.log"), "-o", str(tmp_path / "a.mcap"), "--ros2"]) == 1
    assert gait.cli.main(["export", str(tmp_path / "a.log"), "-o", str(tmp_path / "a.trc"), "--ros2"]) == 2
    words = capsys.readouterr().err.splitlines()
    assert len(words) == 2 and "record it again" in words[0] and "--ros2: is for .mcap" in words[1]
    assert not list(tmp_path.glob("a.[mt]*"))
