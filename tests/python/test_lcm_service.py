"""gait-trackd as a long-running service: snapshots, a service manager, settings that are read again."""

import json
import os
import re
import signal
import socket
import subprocess
import threading
import time
from contextlib import suppress
from queue import SimpleQueue

import lcm_rig as rig
import pytest

from gait.lcm.link import gaitmsg, private_url
from gait.lcm.messages import camera_message

COUNT, KILLED = 10, 6


@pytest.fixture(autouse=True)
def multicast():
    rig.need_multicast()


def feed(listener, first, stop):
    """Send frames one by one, each after the estimate of the one before."""
    for i in range(first, stop):
        listener.estimates.clear()
        listener.send(rig.frames(i, i + 1))
        listener.until(lambda i=i: any(e.frame == i for e in listener.estimates), f"an estimate of frame {i}")
    return listener.estimates[-1]


def begin(listener):
    listener.ask(rig.opening()[:2], lambda s: s.background_mask, "camera and background")
    listener.ask(rig.opening()[2:], lambda s: s.state == s.ARMED, "a start")


def options(tmp_path, *more):
    return ["--init", "auto", "--snapshot", tmp_path / "state", "--snapshot-s", 0.1, *more]


def followed(tmp_path, *more):
    """A daemon that followed a person and was killed."""
    url = private_url()
    with rig.daemon(url, *options(tmp_path, *more)) as (listener, _):
        begin(listener)
        feed(listener, 0, KILLED)
        rig.kill(listener)
    return url


def test_a_daemon_that_was_killed_goes_on_bit_for_bit(tmp_path):
    url = followed(tmp_path)
    with rig.daemon(url, *options(tmp_path)) as (listener, finish):
        listener.ask(rig.opening()[1:2], lambda s: s.background_mask, "the background")
        resumed = feed(listener, KILLED, COUNT)
        words = finish().words
        assert re.search(rf"the person of frame {KILLED - 1}, captured [0-9.]+ s ago, is followed if ", words)
        assert "the next frame was captured at most 2 s later; otherwise the search begins again" in words
    whole = rig.play(rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, COUNT)]))
    assert resumed.tracker_digest == whole.estimates[-1].tracker_digest
    assert (tmp_path / "state").exists()  # written once more at the end
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith("state")] == ["state"]


def test_a_snapshot_that_does_not_fit_is_not_used(tmp_path):
    url = followed(tmp_path)
    good = (tmp_path / "state").read_bytes()
    torn = [good[:n] for n in (0, 1, 4, 7, 100, len(good) // 2, len(good) - 1)]
    flipped = [
        good[:k] + bytes([good[k] ^ 1]) + good[k + 1 :] for k in (7, 8, 12, len(good) // 2, len(good) - 9)
    ]
    cases = [((), b, "") for b in (*torn, *flipped)]
    cases += [
        (("--seed", 9), good, "snapshot of a tracker with another model or configuration"),
        (("--stream", 1), good, "for --stream 0"),
    ]
    for more, content, why in cases:
        (tmp_path / "state").write_bytes(content)
        with rig.daemon(url, *options(tmp_path, *more)) as (listener, finish):
            assert listener.last.state != listener.last.RUNNING
            words = finish().words
        assert words.count("is not used: " + why) == 1 and "is followed" not in words, (more, len(content))
        assert (tmp_path / "state").read_bytes() == content  # it stays for the daemon that it fits


def test_a_snapshot_of_another_camera_is_not_used(tmp_path):
    url = followed(tmp_path)
    (tmp_path / "camera.json").write_text(json.dumps(rig.CAMERA.scaled(0.5).to_dict()))
    with rig.daemon(url, *options(tmp_path, "--camera", tmp_path / "camera.json")) as (_, finish):
        assert "for a camera other than --camera" in finish().words


def test_a_camera_that_is_announced_replaces_that_of_a_snapshot(tmp_path):
    url = followed(tmp_path)
    with rig.daemon(url, *options(tmp_path)) as (listener, finish):
        other = camera_message(rig.CAMERA.scaled(0.5), 1)
        listener.ask([("GAIT_CAMERA_0", other)], lambda s: s.state == s.READY, "the other camera")
        assert "is followed if" in finish().words


def test_a_folder_that_can_no_longer_be_written_is_reported_once(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    with rig.daemon(private_url(), *options(folder)) as (listener, finish):
        folder.rmdir()
        begin(listener)
        feed(listener, 0, KILLED)
        before = len(listener.statuses)
        listener.until(lambda: len(listener.statuses) > before + 2, "more statuses")
        outcome = finish()
    assert outcome.code == 0 and outcome.words.count("cannot be written: No such file") == 1


def test_only_a_snapshot_is_replaced_and_only_a_folder_that_takes_it_accepted(tmp_path):
    notes, link = tmp_path / "notes.txt", tmp_path / "link"
    notes.write_text("of a summer")
    link.symlink_to(notes)
    for path, words in (
        (notes, "is not a snapshot; give another name"),
        (link, "is not a snapshot; give another name"),
        (tmp_path, "is not a snapshot; give another name"),
        (tmp_path / "no" / "state", "cannot be written: No such file"),
    ):
        outcome = rig.run(*rig.command("--init", "auto", "--snapshot", path)[1:])
        assert outcome.code == 1 and f"{path}: {words}" in outcome.words and outcome.words.count("\n") == 1
    assert notes.read_text() == "of a summer" and set(tmp_path.iterdir()) == {notes, link}


@pytest.fixture
def manager(monkeypatch):
    """What a service manager receives, in order: each call returns the next line that is not WATCHDOG=1."""
    sock, lines = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM), SimpleQueue()
    name = f"gait-trackd-test-{os.getpid()}"  # abstract: the paths of tests may be too long for a socket
    sock.bind(f"\0{name}")
    monkeypatch.setenv("NOTIFY_SOCKET", f"@{name}")

    def listen():
        while line := sock.recv(256):
            lines.put(line.decode())

    thread = threading.Thread(target=listen)
    thread.start()

    def reported(beside="WATCHDOG=1"):
        while (line := lines.get(timeout=rig.PATIENCE)) == beside:
            pass
        return line

    yield reported
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.sendto(b"", f"\0{name}")
    thread.join()
    sock.close()


def test_a_service_manager_is_reported_and_settings_are_read_again(tmp_path, manager):
    config = tmp_path / "trackd.toml"
    config.write_text("particles = 64\n")
    with rig.daemon(private_url(), "--config", config, *options(tmp_path)) as (listener, finish):
        assert manager() == "READY=1" and manager(None) == "WATCHDOG=1"
        begin(listener)
        feed(listener, 0, 3)
        os.kill(listener.pid, signal.SIGHUP)
        assert manager() == "RELOADING=1" and manager() == "READY=1"
        listener.ask(rig.opening()[1:2], lambda s: s.background_mask, "the background")
        feed(listener, 3, 5)  # the same person, without a start
        listener.until(lambda: "no frames arrive" in listener.last.text, "that the stream has ended")
        config.write_text("particles = many\n")
        os.kill(listener.pid, signal.SIGHUP)
        assert manager() == "RELOADING=1" and manager() == "READY=1"
        feed(listener, 5, 7)
        listener.until(lambda: listener.last.text == "tracking", "that it is tracked again")
        outcome = finish()
        assert manager() == "STOPPING=1"
    assert outcome.code == 0 and "settings were not reloaded" in outcome.words
    assert outcome.printed.count("frames ") == 2  # a summary before the reload and at the end
    assert "--particles many: give a whole number" in outcome.words


def test_settings_with_which_the_program_could_not_start_are_not_reloaded(tmp_path, manager, monkeypatch):
    """Each fault is one line, and the same tracker goes on."""
    config, torn, log, no = (tmp_path / name for name in ("trackd.toml", "torn", "a.log", "no"))
    torn.write_bytes(b"{")
    rig.write_log(log, rig.frames(0, 1))
    model = f'model = "{rig.MODEL}"\n'
    url = private_url()
    monkeypatch.setenv("LCM_DEFAULT_URL", url)
    wrong = {
        f'model = "{no}.gait"': "cannot open the model file",
        f'model = "{torn}"': "not a usable model",
        f'{model}camera = "{no}"': "cannot open the camera file",
        f'{model}camera = "{torn}"': f"{torn}: ",
        f'{model}init = "{torn}"': f"{torn}: ",
        f'{model}snapshot = "{no}/state"': "cannot be written: No such file",
        f'{model}url = "nonsense://"': "nonsense://: cannot open LCM",
        f'{model}url = "file://{log}?speed=0"': "a log is played only from the start",
        f'{model}lift = true\nlift-model = "{no}.gait"': "cannot open the model file",
        f'{model}out = "file://{no}/out.log?mode=w"': "cannot be written: No such file",
        f'{model}out = "file://{tmp_path}?mode=w"': "cannot be written: Is a directory",
        f'{model}out = "nonsense://"': "nonsense://: cannot open LCM",
        f"{model}version = true": "version is allowed on the command line only",
    }
    config.write_text(model)
    words = [str(rig.TRACKD), "--config", str(config), "-n", str(rig.PARTICLES)]
    with rig.started(words, url) as (listener, finish):
        assert manager() == "READY=1"
        begin(listener)
        for i, content in enumerate(wrong):
            feed(listener, i, i + 1)
            config.write_text(content + "\n")
            os.kill(listener.pid, signal.SIGHUP)
            assert manager() == "RELOADING=1" and manager() == "READY=1"
        last = feed(listener, len(wrong), len(wrong) + 1)
        assert last.step == len(wrong)  # of one tracker
        outcome = finish()
    shown = outcome.words.splitlines()
    lines = [line for line in shown if " particles, " not in line and "listening" not in line]
    assert outcome.code == 0 and len(lines) == len(wrong), outcome.words
    for line, reason in zip(lines, wrong.values(), strict=True):
        assert line.startswith("gait-trackd: settings were not reloaded: ") and reason in line


def test_a_stop_during_a_reload_is_not_lost(tmp_path, manager):
    """The summary before the new start waits for its reader, so the stop always comes during the reload."""
    source, drain = os.pipe()
    os.set_blocking(drain, False)
    with suppress(BlockingIOError):
        while os.write(drain, b"x" * 4096):
            pass
    os.set_blocking(drain, True)
    words = rig.command("--url", private_url())
    with subprocess.Popen(words, stdout=drain, stderr=subprocess.DEVNULL) as daemon:
        try:
            os.close(drain)
            assert manager() == "READY=1"
            daemon.send_signal(signal.SIGHUP)
            assert manager() == "RELOADING=1"
            daemon.terminate()
            with open(source, "rb") as summary:
                summary.read(1 << 16)
                assert manager() == "STOPPING=1"
                assert daemon.wait(rig.PATIENCE) == 0 and b"frames 0 " in summary.read()
        finally:
            daemon.kill()


@pytest.mark.parametrize("mode", ["w", "a"])
def test_the_log_in_use_can_be_kept_in_a_reload(tmp_path, manager, mode):
    """By any of its names: a new one begins, or it continues.  Each part has the status at its end."""
    config, out, link = (tmp_path / name for name in ("trackd.toml", "out.log", "link.log"))
    link.symlink_to(out)
    config.write_text(f'out = "file://{out}?mode={mode}"\n')
    with subprocess.Popen(rig.command("--url", private_url(), "--config", config)) as daemon:
        try:
            assert manager() == "READY=1"
            parts = []
            for name in (f"{tmp_path}/./out.log", link, out):
                config.write_text(f'out = "file://{name}?mode={mode}"\n')
                daemon.send_signal(signal.SIGHUP)
                assert manager() == "RELOADING=1" and manager() == "READY=1"
                parts.append(out.stat())
            daemon.terminate()
            assert manager() == "STOPPING=1" and daemon.wait(rig.PATIENCE) == 0
            parts.append(out.stat())
        finally:
            daemon.kill()
    assert len({part.st_ino for part in parts}) == 1 or mode == "w"
    sizes = [part.st_size for part in parts]
    assert min(sizes) > 0 and (mode == "w" or sizes == sorted(set(sizes)))
    assert len(rig.read_log(out, "GAIT_STATUS", gaitmsg.status_t)) >= (len(parts) if mode == "a" else 1)
    assert not list(tmp_path.glob("*.unfinished*"))


@pytest.mark.parametrize("words", [["--url", "nonsense://"], ["--particles", "many"]])
def test_under_a_service_manager_a_daemon_that_cannot_start_ends_after_a_second(words, manager):
    """The manager starts it again at once, however often."""
    begun = time.monotonic()
    assert rig.run(*rig.command(*words)[1:]).code != 0 and time.monotonic() - begun >= 1.0


def test_a_configuration_is_toml(tmp_path):
    config = tmp_path / "trackd.toml"
    good = f'model = "{rig.MODEL}"  # the # of a comment\nquiet = true\nparticles-channel = false\nseed = 3\n'
    log = rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, 2)])
    config.write_text(good)
    outcome = rig.run("--config", config, "--particles", 64, "--url", f"file://{log}?speed=0")
    assert outcome.code == 0, outcome.words
    for value in ('"open', '"a\\tb"', '"a" "b"'):
        config.write_text(f"model = {value}\n")
        outcome = rig.run("--config", config)
        assert outcome.code == 2 and "line 1: model: give a string in plain quotes" in outcome.words
