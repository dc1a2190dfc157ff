"""gait demo: what it writes, what it leaves behind when it is stopped or fails, and what it rejects."""

import fcntl
import os
import signal
import subprocess
import time

import lcm_rig as rig
import pytest

from gait.bindings.model import model_file
from gait.cli import main
from gait.io.track_file import read_track
from gait.lcm.demo import Demo

COUNT = 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return rig.write_clip(tmp_path_factory.mktemp("clip"), COUNT)


@pytest.fixture(scope="module")
def long_video(tmp_path_factory):
    """Ten seconds, so that a demo that is stopped early is still running."""
    return rig.write_clip(tmp_path_factory.mktemp("long"), 10 * rig.FPS) / "video.mp4"


def leftovers(folder):
    """Processes that still have the folder on their command line."""
    found = subprocess.run(["ps", "-eo", "pid,args"], capture_output=True, text=True, check=True).stdout
    own = str(os.getpid())
    return [line for line in found.splitlines() if str(folder) in line and line.split()[0] != own]


def check_demo(done, out):
    assert done.returncode == 0, done.stderr
    assert {p.name for p in out.iterdir()} == {"track.csv", "estimates.log", "overlay.mp4", "report.html"}
    assert "frames" in done.stdout and str(out / "report.html") in done.stdout
    assert not leftovers(out)
    return read_track(out / "track.csv")


@pytest.mark.long
def test_the_demo_over_multicast(folder, tmp_path):
    rig.need_multicast()
    out = tmp_path / "out"
    done = rig.gait("demo", "--video", folder / "video.mp4", "--particles", rig.PARTICLES, "-o", out)
    track = check_demo(done, out)
    assert track.frame[-1] > COUNT / 2 and "latency ms: median" in done.stdout


@pytest.mark.long
def test_the_demo_without_multicast_goes_through_a_log(folder, tmp_path):
    out = tmp_path / "out"
    words = ["-m", "gait", "demo", "--video", folder / "video.mp4", "--particles", rig.PARTICLES, "-o", out]
    done = rig.without_network(str(rig.PYTHON), *map(str, words))
    track = check_demo(done, out)
    assert track.frame.tolist() == list(range(2, COUNT))
    assert "ip route add" in done.stderr and "latency" not in done.stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_demo_leaves_nothing_running(long_video, tmp_path, number):
    rig.need_multicast()
    out = tmp_path / "out"
    command = [str(rig.PYTHON), "-m", "gait", "demo", "--video", str(long_video), "-o", str(out)]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        for line in process.stderr:  # the tracker states its memory once it has the camera
            if "bytes" in line:
                break
        process.send_signal(number)
        _, words = process.communicate(timeout=rig.PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 1 and "interrupted" in words
    assert not leftovers(out)


def test_a_demo_whose_tracker_fails_reports_it_and_ends(folder, tmp_path):
    rig.need_multicast()
    out = tmp_path / "out"
    out.mkdir()
    for name in ("track.csv", "overlay.mp4", "report.html", "estimates.log"):
        (out / name).write_text("of an older run")
    for to in (out, tmp_path / "new" / "out"):
        done = rig.gait("demo", "--video", folder / "video.mp4", "--trackd", "/bin/false", "-o", to)
        assert done.returncode == 1 and "gait-trackd: ended too early" in done.stderr, done.stderr
        assert not leftovers(to)
    assert list(tmp_path.iterdir()) == [out] and not list(out.iterdir())


def test_what_was_recorded_until_the_tracker_died_is_unfinished(long_video, tmp_path):
    rig.need_multicast()
    out, tracker, number = tmp_path / "out", tmp_path / "tracker", tmp_path / "number"
    tracker.write_text(f'#!/bin/sh\necho $$ > {number}\nexec {rig.TRACKD} "$@"\n')
    tracker.chmod(0o755)
    command = [str(rig.PYTHON), "-m", "gait", "demo", "--video", str(long_video), "-o", str(out)]
    process = subprocess.Popen([*command, "--trackd", str(tracker)], stderr=subprocess.PIPE, text=True)
    try:
        end = time.monotonic() + rig.PATIENCE
        while not list(out.glob(".track.*.csv")) and time.monotonic() < end and process.poll() is None:
            time.sleep(0.02)
        os.kill(int(number.read_text()), signal.SIGKILL)
        _, words = process.communicate(timeout=rig.PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 1 and "gait-trackd: ended too early" in words
    assert {p.name for p in out.iterdir()} == {"track.unfinished.csv", "estimates.unfinished.log"}
    assert "track.csv: not finished; what was written is in track.unfinished.csv" in words
    assert not leftovers(out)


def test_the_demo_hands_the_daemon_the_file_of_a_shipped_model(tmp_path):
    command = Demo(tmp_path, "gait-trackd", "classes", 1)._trackd("memq://")
    file = model_file("classes")
    assert command[command.index("--model") + 1] == str(file) and file.is_file() and file.is_absolute()


def test_a_second_demo_in_the_same_folder_keeps_out(folder, tmp_path):
    holder = os.open(tmp_path, os.O_RDONLY)
    try:
        fcntl.flock(holder, fcntl.LOCK_EX)
        (tmp_path / "track.csv").write_text("of the other")
        done = rig.gait("demo", "--video", folder / "video.mp4", "-o", tmp_path)
    finally:
        os.close(holder)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "another demo is writing there" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["track.csv"]


@pytest.mark.parametrize(
    ("words", "printed", "code"),
    [
        (["--camera", "c.json"], "--camera: is for your own clip; also give --video", 2),
        (["--height", "17"], "17: is not a stature", 2),
        (["--particles", "5"], "5: give a whole number from 16 to 1048576", 2),
        (["--video", "{}/none.mp4"], "none.mp4: no such video file", 1),
        (["--video", "{}/video.mp4", "--camera", "{}/none.json"], "none.json: no such camera file", 1),
        (["--video", "{}/video.mp4", "--init", "{}/camera.json"], "camera.json: ", 1),
        (["--video", "{}/video.mp4", "--background", "{}/none.png"], "none.png: no such background", 1),
        (["--model", "{}/camera.json"], "camera.json: not a .gait model", 1),
        (["-o", "{}/camera.json"], "camera.json: is a file; give the name of a folder", 1),
    ],
)
def test_the_demo_checks_its_inputs_first(folder, tmp_path, capsys, words, printed, code):
    out = tmp_path / "out"
    try:
        ended = main(["demo", "-o", str(out), *(word.format(folder) for word in words)])
    except SystemExit as usage:
        ended = usage.code
    assert ended == code and printed in capsys.readouterr().err.splitlines()[-1] and not out.exists()
