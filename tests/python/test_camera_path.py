"""Poses of a camera that moves: their files, the poses between them, and a track from such a clip."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gait import Camera, UserError
from gait.bindings import abi
from gait.camera.path import CameraPath, CameraPose, one_place, stand_still, write_path
from gait.cli import main

ROOT = Path(__file__).resolve().parents[2]
LEVEL = Camera.looking((0.0, -4.0, 1.5), (0.0, 0.0, 1.0), (320, 240), 300.0)
TIMES = np.arange(6) / 10


def poses() -> list[CameraPose]:
    """A camera that drives 1 m/s along x and turns to the left by 0.2 rad/s."""
    made = []
    for time in TIMES:
        R = LEVEL.R @ Rotation.from_rotvec([0, 0, -0.2 * time]).as_matrix()
        made.append(CameraPose(R, -R @ (LEVEL.centre + [time, 0, 0]), 0.01, 0.02))
    return made


def test_poses_are_written_and_read_with_all_their_digits(tmp_path):
    write_path(tmp_path / "p.csv", TIMES.tolist(), poses(), by_frame=False)
    for read, made in zip(CameraPath.read(str(tmp_path / "p.csv")).at_times(TIMES), poses(), strict=True):
        assert np.array_equal(read.R, made.R) and np.array_equal(read.t, made.t)
        assert (read.turn_sd, read.place_sd) == pytest.approx((0.01, 0.02))


def test_a_camera_between_two_poses_is_on_the_way(tmp_path):
    write_path(tmp_path / "p.csv", TIMES.tolist(), poses(), by_frame=False)
    (found,) = CameraPath.read(str(tmp_path / "p.csv")).at_times([0.234])
    assert found.centre == pytest.approx(LEVEL.centre + [0.234, 0, 0])
    assert pytest.approx(LEVEL.R @ Rotation.from_rotvec([0, 0, -0.2 * 0.234]).as_matrix()) == found.R


DAEMON = """
#include "pose_path.c"
bool message_set(message *m, const char *format, ...) { (void)m, (void)format; return false; }
bool clock_check(int64_t utime, message *why) { (void)why; return utime >= 0; }
bool at(const gait_camera *a, const gait_camera *b, int64_t apart, int64_t utime, gait_camera_pose *out)
{
    static pose_path path;
    message why;
    path = (pose_path){.count = 0};
    return pose_path_add(&path, 0, a, &why) && pose_path_add(&path, apart, b, &why) &&
           pose_path_at(&path, utime, out, &why) == POSE_KNOWN;
}
"""


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    """The daemon's pose at `utime`, between `a` at 0 and `b` at `apart`, microseconds; None: unknown."""
    made = tmp_path_factory.mktemp("daemon") / "path.so"
    words = ["cc", "-shared", "-fPIC", f"-I{ROOT}/tools/trackd", f"-I{ROOT}/libgait/include", "-o", made]
    subprocess.run([*words, "-xc", "-", "-lm"], input=DAEMON, text=True, check=True)
    at, lens = ctypes.CDLL(str(made)).at, LEVEL
    at.restype = ctypes.c_bool

    def pose(a: CameraPose, b: CameraPose, apart: int, utime: int) -> CameraPose | None:
        ends = [
            ctypes.byref(one.camera(lens).to_c()) for one in (a, b)
        ]  # before CameraPoseC: loads the library
        out = abi.CameraPoseC()
        if not at(*ends, ctypes.c_int64(apart), ctypes.c_int64(utime), ctypes.byref(out)):
            return None
        return CameraPose(np.reshape(out.R, (3, 3)), np.array(out.t))

    return pose


def moved(metres: float, radians: float) -> CameraPose:
    """The camera after a straight move and a rotation about an oblique axis."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    R = Rotation.from_rotvec(radians * axis).as_matrix() @ LEVEL.R
    return CameraPose(R, -R @ (LEVEL.centre + metres * axis))


@pytest.mark.parametrize("metres", [0.0, 0.3, 9.0])
@pytest.mark.parametrize("radians", [0.0, 1e-4, 0.5, 3.1])
def test_poses_between_are_those_of_the_daemon(daemon, metres, radians):
    still, then = CameraPose.of(LEVEL), moved(metres, radians)
    for utime in (1, 123_456, 249_999, 499_999):
        (mine,) = CameraPath("p.csv", np.array([0.0, 0.5]), False, (still, then)).at_times([utime / 1e6])
        its = daemon(still, then, 500_000, utime)
        np.testing.assert_allclose(its.R, mine.R, atol=2e-6)
        np.testing.assert_allclose(its.t, mine.t, atol=2e-5)


@pytest.mark.parametrize(
    ("seconds", "metres", "radians", "known"),
    [
        (0.499, 0, 0, True),
        (0.501, 0, 0, False),
        (0.1, 1.99, 0, True),
        (0.1, 2.01, 0, False),
        (0.1, 0, 1.99, True),
        (0.1, 0, 2.01, False),
    ],
)
def test_gaps_and_sudden_moves_are_those_of_the_daemon(daemon, seconds, metres, radians, known):
    still, then = CameraPose.of(LEVEL), moved(metres, radians)
    assert (daemon(still, then, round(1e6 * seconds), 50_000) is not None) == known
    path = CameraPath("p.csv", np.array([0.0, seconds]), False, (still, then))
    if known:
        assert path.at_times([0.05])
    else:
        with pytest.raises(UserError, match="apart|jumps"):
            path.at_times([0.05])


def test_quaternions_of_a_robot_are_the_turn_from_camera_to_world(tmp_path):
    rows = ["frame,x,y,z,qx,qy,qz,qw"]
    for number, pose in enumerate(poses()):
        numbers = [*pose.centre, *Rotation.from_matrix(pose.R.T).as_quat()]
        rows.append(",".join([str(number), *map(repr, map(float, numbers))]))
    (tmp_path / "p.csv").write_text("\n".join(rows) + "\n")
    found = CameraPath.read(str(tmp_path / "p.csv")).at_times(TIMES[2:4], first=2)
    assert [one.R for one in found] == [pytest.approx(one.R) for one in poses()[2:4]]
    assert [one.centre for one in found] == [pytest.approx(one.centre) for one in poses()[2:4]]


def test_a_camera_that_stands_still_or_only_turns_is_recognised():
    still, turned = CameraPose.of(LEVEL), replace(poses()[0], R=LEVEL.R @ np.diag([-1, -1, 1]))
    assert stand_still([still, still]) and not stand_still([still, replace(still, turn_sd=0.01)])
    turned = replace(turned, t=-turned.R @ LEVEL.centre)
    assert one_place([still, turned]) and not one_place(poses())


LINE = "{time},1,0,0,0,0,-1,0,1,0,{x},0,5"
HEAD = "time,r11,r12,r13,r21,r22,r23,r31,r32,r33,tx,ty,tz"


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (["time,x,y,z"], "first line must name time or frame, and r11 to r33"),
        ([HEAD], "has no pose"),
        ([HEAD, "0,1,0,0,0,0,-1,0,1,0,x,0,5"], "line 2: tx is 'x'; give a number"),
        ([HEAD, "0,1,0,0,0,0,-1,0,0.5,0,0,0,5"], "line 2: r11 to r33 are not a rotation"),
        ([HEAD, LINE.format(time=0, x=0), LINE.format(time=0, x=0)], "line 3: time does not increase"),
        (
            [HEAD, LINE.format(time=0, x=0), LINE.format(time=0.1, x=0)],
            "from 0 to 0.1 s, but frame 1 is at 0.3",
        ),
        ([HEAD, LINE.format(time=0, x=0), LINE.format(time=1, x=0)], "poses are 1.00 s apart"),
        ([HEAD, LINE.format(time=0, x=0), LINE.format(time=0.4, x=9)], "jumps 9 m"),
        (
            [HEAD + ",turn_sd_deg", LINE.format(time=0, x=0) + ",-1"],
            "turn_sd_deg is '-1'; give a number of 0",
        ),
        ([HEAD + ",fx", LINE.format(time=0, x=0) + ",9", LINE.format(time=1, x=0) + ",8"], "fx changes"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, rows, words):
    (tmp_path / "p.csv").write_text("\n".join(rows) + "\n")
    with pytest.raises(UserError, match=words) as caught:
        CameraPath.read(str(tmp_path / "p.csv")).at_times([0.0, 0.3])
    assert str(caught.value).startswith(f"{tmp_path / 'p.csv'}: ") and "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """A clip of a robot that follows a person, with its poses."""
    folder = tmp_path_factory.mktemp("follow")
    words = ["--frames", "30", "--size", "240x180", "--fps", "20", "--quiet"]
    assert main(["simulate", "-o", str(folder), "--moving", "follow", *words]) == 0
    return folder


def track(folder, *words: str) -> int:
    """Track the clip without a detector, from its init file."""
    given = ["--camera", "camera.json", "--init", "init.json"]
    files = [str(folder / one) if one.endswith(".json") else one for one in given]
    to = ["-o", str(folder / "out.csv"), "--detector", "none", "--particles", "500", "--quiet"]
    return main(["track", str(folder / "video.mp4"), *files, *to, *words])


@pytest.mark.long
def test_a_person_before_a_robot_is_followed_in_the_world(clip):
    assert track(clip, "--camera-path", str(clip / "poses.csv"), "--cameras-out", str(clip / "c.csv")) == 0
    found, truth = (
        np.genfromtxt(clip / name, delimiter=",", names=True) for name in ("out.csv", "truth.csv")
    )
    off = [found[f"pelvis_{axis}"] - truth[f"pelvis_{axis}"] for axis in "xy"]
    assert np.ptp(truth["pelvis_x"]) > 1.5 and np.hypot(*off).max() < 0.15


def test_the_cameras_that_a_track_writes_give_the_same_track(clip):
    """Also the standard deviations of their poses."""
    made = CameraPath.read(str(clip / "poses.csv"))
    unsure = [replace(pose, turn_sd=0.01, place_sd=0.02) for pose in made.poses]
    write_path(clip / "unsure.csv", made.at.tolist(), unsure, by_frame=False)
    given, outputs = "unsure.csv", []
    for name in ("c.csv", "d.csv"):
        words = ["--camera-path", str(clip / given), "--cameras-out", str(clip / name), "--stop", "8"]
        assert track(clip, *words) == 0
        outputs.append((clip / "out.csv").read_bytes())
        given = name
    assert outputs[0] == outputs[1]
    assert (clip / "c.csv").read_bytes() == (clip / "d.csv").read_bytes()
    one = CameraPath.read(str(clip / "d.csv")).poses[3]
    assert one.turn_sd == pytest.approx(0.01) and one.place_sd == 0.02


def test_a_path_of_equal_poses_gives_the_bits_of_a_still_camera(clip):
    still = Camera.read(str(clip / "camera.json"))
    write_path(clip / "equal.csv", [0.0, 0.4, 0.8], [CameraPose.of(still)] * 3, by_frame=False)
    outputs = []
    for words in ([], ["--camera-path", str(clip / "equal.csv")]):
        assert track(clip, "--stop", "8", *words) == 0
        outputs.append((clip / "out.csv").read_bytes())
    assert outputs[0] == outputs[1]


def test_options_that_contradict_a_path_are_refused(clip, capsys):
    path = ["--camera-path", str(clip / "poses.csv")]
    assert track(clip, *path, "--stabilize", "auto") == 2
    assert track(clip, *path, "--background", str(clip / "contact.jpg")) == 2
    assert track(clip, "--camera-path", str(clip / "none.csv")) == 1
    words = capsys.readouterr().err
    assert "leave out one of them" in words and "static camera" in words and "no such file" in words
