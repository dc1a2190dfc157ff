"""gait view: the right estimate in the right frame, in a file and in a browser."""

import signal
import subprocess
import urllib.error
import urllib.request
from dataclasses import replace
from types import SimpleNamespace

import cv2
import lcm_rig as rig
import numpy as np
import pytest

from gait.errors import UserError
from gait.lcm.link import private_url
from gait.lcm.messages import estimate_of
from gait.lcm.viewer import Screen, Viewer
from gait.report.drawing import Overlay


@pytest.fixture
def log(tmp_path):
    """Frames and their estimates in one log, the estimate of frame 3 before its frame."""
    opening = rig.opening()
    estimates = rig.play(rig.write_log(tmp_path / "in.log", [*opening, *rig.frames(0, 6)])).estimates
    events = [*opening]
    for i, (frame, estimate) in enumerate(zip(rig.frames(0, 6), estimates, strict=True)):
        pair = [frame, ("GAIT_ESTIMATE", estimate)]
        events += pair if i != 3 else pair[::-1]
    return rig.write_log(tmp_path / "both.log", events), estimates


def view(path, camera=None):
    shown = []
    viewer = Viewer(f"file://{path}?speed=0", 0, rig.model(), camera, shown.append)
    while viewer.handle(1.0):
        pass
    return shown


def test_each_estimate_is_drawn_into_its_own_frame(log):
    path, estimates = log
    shown = view(path)
    assert len(shown) == 5, "an estimate without its frame is passed over"
    overlay = Overlay(rig.model(), rig.CAMERA)
    for picture, i in zip(shown, (0, 1, 2, 4, 5), strict=True):
        estimate = replace(estimate_of(estimates[i]), utime=rig.utime(i) - rig.utime(0))
        np.testing.assert_array_equal(picture, overlay.draw(rig.picture(i), estimate, i))


def test_damaged_messages_are_passed_over(log, tmp_path):
    frames, estimates = rig.frames(0, 3), log[1]
    cut = SimpleNamespace(encode=lambda: bytes(30))
    events = [*rig.opening()]
    for frame, estimate in zip(frames, estimates, strict=False):
        events += [(frame[0], cut), frame, ("GAIT_ESTIMATE", cut), ("GAIT_ESTIMATE", estimate)]
    path = rig.write_log(tmp_path / "spoilt.log", events)
    assert len(view(path)) == 3
    viewer = Viewer(f"file://{path}?speed=0", 0, rig.model(), None, lambda picture: None)
    while viewer.handle(1.0):
        pass
    assert "GAIT_IMAGE_0: not a gaitmsg.image_t" in viewer.damage


def test_without_a_camera_nothing_is_drawn(log, tmp_path):
    path, estimates = log
    events = [rig.frames(0, 1)[0], ("GAIT_ESTIMATE", estimates[0])]
    plain = rig.write_log(tmp_path / "plain.log", events)
    assert view(plain) == [] and len(view(plain, rig.CAMERA)) == 1


def test_save_writes_one_picture(log, tmp_path):
    png = tmp_path / "view.png"
    done = rig.gait("view", "--url", f"file://{log[0]}?speed=0", "--save", png)
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(cv2.imread(str(png)), view(log[0])[0])


def test_save_reports_when_nothing_came(tmp_path):
    empty = rig.write_log(tmp_path / "empty.log", [("OTHER", b"x")])
    done = rig.gait("view", "--url", f"file://{empty}?speed=0", "--save", tmp_path / "v.png", "--quiet")
    assert done.returncode == 1 and "no estimate" in done.stderr and done.stderr.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["empty.log"]


def test_browsers_get_the_page_and_the_moving_picture():
    screen = Screen(0)
    try:
        with urllib.request.urlopen(screen.address, timeout=rig.PATIENCE) as page:
            assert b'src="/stream"' in page.read()
        first, second = rig.picture(0), rig.picture(5)
        screen.show(first)
        with urllib.request.urlopen(f"{screen.address}stream", timeout=rig.PATIENCE) as stream:
            for image in (first, second):
                head = [stream.readline() for _ in range(4)]
                jpeg = stream.read(int(head[2].split(b":")[1]))
                assert stream.readline() == b"\r\n" and head[0] == b"--gait-frame\r\n"
                viewed = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
                assert np.abs(viewed.astype(int) - image).mean() < 12
                screen.show(second)
        with urllib.request.urlopen(f"{screen.address}frame.jpg", timeout=rig.PATIENCE) as frame:
            assert frame.headers["Content-Type"] == "image/jpeg" and frame.read()[:2] == b"\xff\xd8"
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(f"{screen.address}other", timeout=rig.PATIENCE)
        with pytest.raises(UserError, match="give another"):
            Screen(int(screen.address.split(":")[2].rstrip("/")))
    finally:
        screen.close()


@pytest.mark.parametrize(
    "words", [["--port", "70000"], ["--port", "-1"], ["--patience", "nan"], ["--stream", "-1"]], ids=" ".join
)
def test_options_out_of_their_range_are_usage_errors(words):
    done = rig.gait("view", *words)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and words[0] in done.stderr


def test_a_log_is_only_read(log):
    before = log[0].read_bytes()
    done = rig.gait("view", "--url", f"file://{log[0]}?mode=w", "--save", log[0].with_suffix(".png"))
    assert done.returncode == 2 and "only read; leave ?mode= out" in done.stderr
    assert log[0].read_bytes() == before


def test_a_job_of_a_script_ends_by_sigint():
    """Behind & a shell has it ignored."""
    rig.need_multicast()
    process = subprocess.Popen(
        [str(rig.PYTHON), "-m", "gait", "view", "--url", private_url()],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        assert process.stdout.readline().startswith("http://127.0.0.1:")
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.5)
        process.send_signal(signal.SIGINT)
        _, words = process.communicate(timeout=rig.PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert (process.returncode, words) == (0, "")


def test_the_command_shows_a_live_stream(tmp_path):
    rig.need_multicast()
    url = private_url()
    command = [str(rig.PYTHON), "-m", "gait", "view", "--url", url]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        address = process.stdout.readline().strip()
        with rig.daemon(url) as (listener, _):
            listener.ask(rig.opening(), lambda s: s.state == s.ARMED and s.background_mask == 1, "the START")
            for i, event in enumerate(rig.frames(0, 3)):
                listener.send([event])
                listener.until(lambda i=i: len(listener.estimates) > i, "an estimate")
            with urllib.request.urlopen(f"{address}frame.jpg", timeout=rig.PATIENCE) as frame:
                assert cv2.imdecode(np.frombuffer(frame.read(), np.uint8), cv2.IMREAD_COLOR).shape == (
                    120,
                    160,
                    3,
                )
    finally:
        process.kill()
        process.communicate()
