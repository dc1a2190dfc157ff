"""Commands that are interrupted leave nothing half-written behind."""

import json
import os
import signal
import subprocess
import sys
import time
from importlib import resources

import pytest
from drawn_person import camera, wall, write

from gait import Video
from gait.io.track_file import read_track
from gait.signals import Interruptible

PATIENCE = 120.0  # seconds for what takes a few, on a machine busy with other things
MODEL = resources.files("gait") / "data" / "walk.gait"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_that_end_a_command_interrupt_it(number):
    with pytest.raises(KeyboardInterrupt), Interruptible():
        signal.raise_signal(number)


@pytest.mark.long
def test_track_keeps_the_rows_that_are_finished(tmp_path):
    """A clip of a wall, long enough that no run tracks it to its end."""
    clip = tmp_path / "clip"
    clip.mkdir()
    write(clip / "video.mp4", [wall()] * 900)
    (clip / "camera.json").write_text(json.dumps(camera().to_dict()))
    (clip / "init.json").write_text(json.dumps({"frame": 0, "pelvis": [0, 0]}))
    output = tmp_path / "output"
    output.mkdir()
    words = ["track", clip / "video.mp4", "--camera", clip / "camera.json", "--init", clip / "init.json"]
    words += ["--background", "none", "--particles", "500"]
    words += ["-o", output / "t.csv", "--overlay", output / "o.mp4"]
    process = subprocess.Popen(
        [sys.executable, "-m", "gait", *map(str, words)], stderr=subprocess.PIPE, text=True
    )
    try:
        deadline = time.monotonic() + PATIENCE
        while sum(path.stat().st_size > 0 for path in output.iterdir()) < 2:  # both have been begun
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.01)
        process.send_signal(signal.SIGTERM)
        _, printed = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 1 and printed.endswith("gait track: interrupted\n")
    left = sorted(path.name for path in output.iterdir())
    assert left == ["o.unfinished.mp4", "t.unfinished.csv"]
    for name in left:
        assert f"; what was written is in {name}\n" in printed
    track = read_track(output / "t.unfinished.csv")
    rows = len(track.frame)
    assert track.frames == range(
        track.frame[-1] + 1
    )  # the others were not reached, which differs from not found
    assert 1 <= rows < 900 and abs(Video(output / "o.unfinished.mp4").count - rows) <= 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_after_the_work_changes_nothing(number):
    """As a second Ctrl-C, or the second signal that timeout sends, while Python unloads its modules."""
    buffered = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    words = [sys.executable, "-m", "gait", "info", MODEL, "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=buffered) as process:
        assert process.stdout.readline().startswith(b"{")
        while process.poll() is None:
            process.send_signal(number)
        assert (process.returncode, process.stderr.read()) == (0, b"")


def test_a_reader_that_leaves_is_no_error_of_ours():
    quiet = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    words = [sys.executable, "-m", "gait", "info", MODEL]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=quiet) as process:
        process.stdout.close()  # before anything is written
        assert process.stderr.read() == b""
