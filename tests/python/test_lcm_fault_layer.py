"""gait-trackd when memory, disk or clock fail, simulated by a layer under its calls."""

import json
import re
import resource
import subprocess
from pathlib import Path

import lcm_rig as rig
import pytest

from gait.lcm.messages import camera_message

LAYER = Path(__file__).with_name("fault_layer.c")
LONGEST = 200  # calls that may fail in one run


@pytest.fixture(scope="module")
def layer(tmp_path_factory):
    made = tmp_path_factory.mktemp("layer") / "fault_layer.so"
    words = ["cc", "-shared", "-fPIC", "-O1", "-o", made, LAYER, "-ldl"]
    subprocess.run(words, check=True)
    return made


@pytest.fixture
def words(tmp_path):
    """Everything for which the daemon takes memory or writes: lift, keypoints, particles, its own log."""
    log = rig.write_log(tmp_path / "in.log", [*rig.opening(), *rig.frames(0, 3)])
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(rig.CAMERA.to_dict()))
    options = ("--lift", "--keypoints-term", "--particles-channel", "--camera", camera)
    return rig.command(
        "--url", f"file://{log}?speed=0", "--out", f"file://{tmp_path}/out.log?mode=w", *options
    )


def run(words, layer, done, fault, at=0):
    """Run with one fault; the process, and whether the fault came."""
    done.unlink(missing_ok=True)
    ended = subprocess.run(
        words,
        capture_output=True,
        text=True,
        timeout=rig.PATIENCE,
        check=False,
        env={
            "LD_PRELOAD": str(layer),
            "GAIT_FAULT": fault,
            "GAIT_FAULT_AT": str(at),
            "GAIT_FAULT_DONE": str(done),
        },
    )
    return ended, done.exists()


@pytest.mark.parametrize(("fault", "reason"), [("malloc", "memory"), ("fwrite", "error"), ("fsync", "error")])
def test_every_call_that_fails_is_one_line_and_exit_1(layer, words, tmp_path, fault, reason):
    for at in range(1, LONGEST):
        ended, came = run(words, layer, tmp_path / "done", fault, at)
        if not came:
            break
        lines = [line for line in ended.stderr.splitlines() if " particles, " not in line]
        assert ended.returncode == 1 and len(lines) == 1 and reason in lines[0], (at, ended)
    assert came is False and at > {"malloc": 8, "fwrite": 20, "fsync": 1}[fault]
    assert ended.returncode == 0, ended


@pytest.mark.parametrize(
    "options", [("--further-streams", 3), ("--people", 2, "--keypoints-term")], ids=["cameras", "people"]
)
def test_further_cameras_and_people_without_memory_are_reported_and_left_out(layer, tmp_path, options):
    cameras = [("GAIT_CAMERA_3", camera_message(rig.CAMERA, rig.utime(0))), *rig.opening()]
    log = rig.write_log(tmp_path / "in.log", [*cameras, *rig.frames(0, 3)])
    words = rig.command(
        "--url", f"file://{log}?speed=0", "--out", f"file://{tmp_path}/out.log?mode=w", *options
    )
    for at in range(1, LONGEST):
        ended, came = run(words, layer, tmp_path / "done", "malloc", at)
        if not came:
            break
        lines = ended.stderr.splitlines()
        assert ended.returncode in (0, 1) and "not enough memory for" in lines[0], (at, ended)
        assert all(line.startswith("gait-trackd: ") for line in lines), (at, ended)
    assert came is False and at > 6


def test_a_limit_of_memory_is_one_clear_line(tmp_path):
    """Nothing fails but the largest request: 200,000 particles take 207 MB."""

    def little():
        resource.setrlimit(resource.RLIMIT_AS, (100 << 20, 100 << 20))

    log = rig.write_log(tmp_path / "in.log", [*rig.opening(), *rig.frames(0, 3)])
    words = rig.command("--url", f"file://{log}?speed=0", "-n", 200_000)
    ended = subprocess.run(
        words, capture_output=True, text=True, timeout=rig.PATIENCE, check=False, preexec_fn=little
    )
    assert ended.returncode == 1 and "frames 0 " in ended.stdout, ended
    assert re.match("gait-trackd: tracker: not enough memory for 2[0-9]{8} bytes\n", ended.stderr), ended


def test_a_wall_clock_set_to_and_fro_changes_no_result(layer, words, tmp_path):
    still, moved = (run(words, layer, tmp_path / "done", fault)[0] for fault in ("none", "clock"))
    assert still.returncode == moved.returncode == 0 and moved.stderr == still.stderr
    digest = rig.SUMMARY.search(still.stdout).group(4)
    assert rig.SUMMARY.search(moved.stdout).group(4) == digest
