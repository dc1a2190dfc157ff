"""gait record as a process that is interrupted: the track so far must be whole."""

import signal
import subprocess
import threading

import lcm_rig as rig
import numpy as np
import pytest

from gait.lcm.link import open_lcm, private_url
from gait.motion.trackfile import read_track

COUNT = 20


@pytest.fixture(scope="module")
def estimates(tmp_path_factory):
    """What gait-trackd says about the clip."""
    log = rig.write_log(tmp_path_factory.mktemp("e") / "in.log", [*rig.opening(), *rig.frames(0, COUNT)])
    return rig.play(log).estimates


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("flowing", [False, True], ids=["quiet", "flowing"])
def test_an_interrupted_recording_is_whole(estimates, tmp_path, number, flowing):
    """Estimates flow on, or have ceased so that the signal comes while it waits."""
    rig.need_multicast()
    url, out = private_url(), tmp_path / "track.csv"
    process = subprocess.Popen(
        [str(rig.PYTHON), "-m", "gait", "record", "--url", url, "-o", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    link, ended = open_lcm(url), threading.Event()

    def send():
        for estimate in estimates:
            link.publish("GAIT_ESTIMATE", estimate.encode())
            if flowing and ended.wait(0.05):
                return

    try:
        assert process.stderr.readline().startswith("listening")
        sender = threading.Thread(target=send)
        sender.start()
        while not list(tmp_path.glob(".track.*")):  # it opens the file with the second estimate
            assert process.poll() is None
        if not flowing:
            sender.join()
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.3)  # it has taken in all and waits for more
        process.send_signal(number)
        printed, words = process.communicate(timeout=rig.PATIENCE)
        ended.set()
        sender.join()
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 0, words
    track = read_track(out)
    assert len(track.frame) >= 2 and (np.diff(track.frame) == 1).all()
    assert printed.startswith(f"{len(track.frame)} frames")
    if not flowing:
        assert track.frame.tolist() == [e.frame for e in estimates]
    assert [path.name for path in tmp_path.iterdir()] == ["track.csv"]


@pytest.mark.parametrize("option", ["-o", "--log"])
def test_a_missing_folder_is_named_before_anybody_listens(tmp_path, option):
    files = {"-o": tmp_path / "t.csv", "--log": tmp_path / "e.log"} | {option: tmp_path / "none" / "x"}
    words = [word for pair in files.items() for word in pair]
    done = rig.gait("record", "--url", f"file://{tmp_path}/absent.log", *words)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "none does not exist" in done.stderr and not list(tmp_path.iterdir())
