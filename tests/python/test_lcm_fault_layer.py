"""gait-trackd when memory, disk or clock fail, simulated by a layer under its calls."""

import json
import re
import resource
import subprocess
from functools import partial
from pathlib import Path

import lcm_rig as rig
import pytest

from gait.lcm.link import now, private_url
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
    """Run with one fault, without the outputs of earlier runs; the process, and whether the fault came."""
    for left in [done, *done.parent.glob("out.*")]:
        left.unlink(missing_ok=True)
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
    assert came is False and at > {"malloc": 8, "fwrite": 20, "fsync": 2}[fault]
    assert ended.returncode == 0, ended


@pytest.mark.parametrize("mode", ["w", "a"])
def test_a_log_and_then_its_name_are_on_the_disk_before_the_end(layer, words, tmp_path, mode):
    words = [f"file://{tmp_path}/out.log?mode={mode}" if "out.log" in str(word) else word for word in words]
    ended, _ = run(words, layer, tmp_path / "done", "order")
    assert ended.returncode == 0, ended
    assert re.fullmatch("w{20,}sD", (tmp_path / "done").read_text())


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
    assert all("not enough memory" in line for line in ended.stderr.splitlines()), ended


def test_at_every_size_of_the_address_space_a_start_without_memory_is_one_line():
    """Whether the memory of the daemon, of its threads or of LCM's library is missing."""
    rig.need_multicast()
    words, reasons = rig.command("--url", private_url(), "--threads", 2), set()
    for size in range(8 << 20, 200 << 20, 1 << 20):
        limits = partial(resource.setrlimit, resource.RLIMIT_AS, (size, size))
        process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, preexec_fn=limits)
        line = process.stderr.readline()
        if "listening" in line:
            process.kill()
            process.communicate()
            break
        rest = process.communicate(timeout=rig.PATIENCE)[1]
        if "shared librar" in line:  # the loader's own
            continue
        assert process.returncode == 1 and not rest and ("memory" in line or "threads" in line), (size, line)
        reasons.add(line.split()[1])
    assert "listening" in line and {"--threads", "LCM"} <= reasons


def test_a_wall_clock_set_to_and_fro_changes_no_result(layer, words, tmp_path):
    still, moved = (run(words, layer, tmp_path / "done", fault)[0] for fault in ("none", "clock"))
    assert still.returncode == moved.returncode == 0 and moved.stderr == still.stderr
    digest = rig.SUMMARY.search(still.stdout).group(4)
    assert rig.SUMMARY.search(moved.stdout).group(4) == digest


def test_live_a_wall_clock_set_to_and_fro_changes_no_result(layer, tmp_path, monkeypatch):
    """As an NTP server does at any moment: between arrival and step, between statuses and snapshots."""
    rig.need_multicast()
    count = 8
    whole = rig.play(rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, count)]))
    monkeypatch.setenv("LD_PRELOAD", str(layer))
    monkeypatch.setenv("GAIT_FAULT", "clock")
    options = ("--snapshot", tmp_path / "state", "--snapshot-s", 0.1)
    with rig.daemon(private_url(), *options) as (listener, finish):
        listener.ask(rig.opening()[:2], lambda s: s.background_mask, "camera and background")
        listener.ask(rig.opening()[2:], lambda s: s.state == s.ARMED, "a start")
        for i in range(count):
            listener.send(rig.frames(i, i + 1))
            listener.until(lambda i=i: any(e.frame == i for e in listener.estimates), f"estimate {i}")
        off = [abs(e.receive_utime - now()) for e in listener.estimates]
        ended = finish()
    assert min(off) > 86000e6, "the clock was not set"
    assert (ended.code, ended.digest, ended.dropped) == (0, whole.digest, 0)
    assert ended.words.count("\n") == 2 and (tmp_path / "state").exists(), ended.words
