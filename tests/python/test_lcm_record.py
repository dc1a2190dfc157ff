"""gait record as a process: whatever ends it, the track so far is complete and the reason is reported."""

import json
import os
import resource
import signal
import struct
import subprocess
import threading
import time
from copy import copy

import lcm_rig as rig
import numpy as np
import pytest

from gait.io.track_file import read_track
from gait.lcm.link import LogWriter, break_of, events_of, gaitmsg, open_lcm, private_url
from gait.lcm.record import Figures, read_run

COUNT = 20
SECOND = 1_000_000  # microseconds


@pytest.fixture(scope="module")
def estimates(tmp_path_factory):
    """What gait-trackd states about the clip."""
    log = rig.write_log(tmp_path_factory.mktemp("e") / "in.log", [*rig.opening(), *rig.frames(0, COUNT)])
    return rig.play(log).estimates


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("flowing", [False, True], ids=["quiet", "flowing"])
def test_an_interrupted_recording_is_whole(estimates, tmp_path, number, flowing):
    """Estimates continue, or have stopped so that the signal comes while the command waits."""
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


def test_what_a_killed_recorder_had_written_is_kept_by_the_next(estimates, tmp_path):
    rig.need_multicast()
    url, out, log = private_url(), tmp_path / "track.csv", tmp_path / "e.log"
    words = ["-o", str(out), "--log", str(log)]
    with subprocess.Popen(
        [str(rig.PYTHON), "-m", "gait", "record", "--url", url, *words], stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stderr and process.stderr.readline().startswith("listening")
            link, sent = open_lcm(url), 0
            while sum(p.stat().st_size > 0 for p in tmp_path.glob(".*")) < 2:
                assert process.poll() is None
                at = {"frame": sent, "step": sent, "utime": SECOND + 1000 * sent}
                link.publish("GAIT_ESTIMATE", later(estimates[-1], sent, **at).encode())
                sent += 1
                time.sleep(0.002)  # let it read
        finally:
            process.kill()
    played = rig.write_log(tmp_path / "in.log", [("GAIT_ESTIMATE", e) for e in estimates])
    done = rig.gait("record", "--url", f"file://{played}?speed=0", *words)
    assert done.returncode == 0 and "was killed; what it wrote is in track.unfinished.csv" in done.stderr
    assert 0 < len(read_track(tmp_path / "track.unfinished.csv").frame) <= sent
    kept = list(events_of(tmp_path / "e.unfinished.log", whole=False))
    assert 0 < len(kept) <= sent and len(read_track(out).frame) == COUNT
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("option", ["-o", "--log"])
def test_a_missing_folder_is_named_before_listening(tmp_path, option):
    files = {"-o": tmp_path / "t.csv", "--log": tmp_path / "e.log"}
    files[option] = tmp_path / "none" / files[option].name
    words = [word for pair in files.items() for word in pair]
    done = rig.gait("record", "--url", f"file://{tmp_path}/absent.log", *words)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "none does not exist" in done.stderr and not list(tmp_path.iterdir())


def record(tmp_path, estimates, *options):
    """Record estimates sent one after the other; return the process and the frames of the track."""
    log, out = tmp_path / "in.log", tmp_path / "t.csv"
    rig.write_log(log, [("GAIT_ESTIMATE", e) for e in estimates])
    done = rig.gait("record", "--url", f"file://{log}?speed=0", "-o", out, *options)
    return done, read_track(out).frame.tolist() if out.exists() else None


def later(estimate, microseconds=0, **changes):
    """An estimate as another tracker, or the same one at another time, would have sent it."""
    other = copy(estimate)
    for name, value in changes.items():
        setattr(other, name, value)
    other.receive_utime += microseconds
    return other


@pytest.mark.parametrize("case", ["in turn", "one frame each", "one falls behind"])
def test_two_trackers_on_one_url_are_reported(estimates, tmp_path, case):
    """Both track the same frames; each receives them at its own time."""
    one, two = estimates, [later(e, 300) for e in estimates]
    order = [e for pair in zip(one, two, strict=True) for e in pair]
    if case == "one frame each":  # both too slow for every frame: numbers alone look like one stream
        order = [later((one, two)[i % 2][i], step=i // 2, dropped=i - i // 2) for i in range(COUNT)]
    if case == "one falls behind":
        order = [*one[:5], two[0], *one[5:]]
    done, frames = record(tmp_path, order)
    assert done.returncode == 1 and "two trackers publish on this URL" in done.stderr
    assert done.stderr.splitlines()[1:] == [done.stderr.splitlines()[-1]], done.stderr
    assert frames == list(range(len(frames))) and f"before this was noticed: {len(frames)})" in done.stderr


@pytest.mark.parametrize("case", ["killed once", "killed again at once", "killed again after a snapshot"])
def test_a_tracker_that_goes_on_from_a_snapshot_is_the_same_stream(estimates, tmp_path, case):
    """Its steps go back to those of the snapshot; the frames since then count as dropped, as they were."""

    def resumed(frames, step, snapshot):
        """Estimates of these frames, from this step on."""
        return [
            later(e, 2 * SECOND * (step > 3), step=step + k, dropped=frames[0] - snapshot - 1)
            for k, e in enumerate(estimates[i] for i in frames)
        ]

    sent = [*estimates[:6], *resumed(range(8, COUNT), 3, 2)]
    if case != "killed once":
        sent = [*estimates[:6], *resumed(range(8, 12), 3, 2)]
        again = 3 if case == "killed again at once" else 5
        sent += resumed(range(14, COUNT), again, again - 1)
    done, frames = record(tmp_path, sent)
    assert done.returncode == 0 and done.stderr.count("\n") == 1, done.stderr
    assert frames == [e.frame for e in sent]


def test_the_rate_of_a_live_stream_is_that_of_arrival(estimates):
    """Films may be sent slower than recorded; a log is read as fast as possible."""
    figures = Figures()
    for k, estimate in enumerate(estimates):
        figures.add(estimate, estimates[0].utime + 200_000 * k)
    assert figures.summary(live=True)["fps"] == pytest.approx(5)
    assert figures.summary(live=False)["fps"] == pytest.approx(rig.FPS, rel=1e-3)


def test_another_stream_that_begins_is_reported(estimates, tmp_path):
    again = [later(e, 60 * SECOND, utime=e.utime + 60 * SECOND) for e in estimates]
    done, frames = record(tmp_path, [*estimates, *again])
    assert done.returncode == 0 and frames == list(range(COUNT))
    assert f"ended, as another stream began (frame 0 after {COUNT - 1})" in done.stderr
    quiet, _ = record(tmp_path, [*estimates, *again], "--quiet")
    assert quiet.returncode == 0 and quiet.stderr == ""


def test_damaged_messages_are_left_out_and_reported(estimates, tmp_path):
    """Foreign bytes, a truncated estimate and one without joints do not end a recording."""
    plain = later(estimates[3], njoints=0, joints=[], nangles=0, angles=[])
    log = tmp_path / "in.log"
    writer = LogWriter(log)
    for e in estimates[:3]:
        writer.publish("GAIT_ESTIMATE", e.encode())
    for spoilt in (bytes(30), estimates[3].encode()[:-20], plain.encode()):
        writer.publish("GAIT_ESTIMATE", spoilt)
    for e in estimates[3:]:
        writer.publish("GAIT_ESTIMATE", e.encode())
    writer.close()
    done = rig.gait("record", "--url", f"file://{log}?speed=0", "-o", tmp_path / "t.csv", "--json")
    assert done.returncode == 0 and "messages skipped: 3, first: GAIT_ESTIMATE: not a" in done.stderr
    figures = json.loads(done.stdout)
    assert figures["damaged"] == 3 and len(read_track(tmp_path / "t.csv").frame) == COUNT
    run = read_run(str(log))
    assert len(run.frame) == COUNT and "a message is skipped" in run.remark


WRONG = (
    {"joints": lambda joints: joints[:10], "njoints": 10},
    {"joints": [], "njoints": 0},
    {"angles": [], "nangles": 0},
    {"status": 99},
    {"status": -1},
    {"log_evidence": float("nan")},
    {"speed": -1e38},
    {"ess": -5.0},
    {"mode_mass": float("inf")},
    {"mean": lambda mean: spoilt(mean, heading=float("nan"))},
    {"mean": lambda mean: spoilt(mean, ncoef=10**9)},
    {"mean": lambda mean: spoilt(mean, noffset=-1)},
    {"sd": lambda sd: spoilt(sd, ncoef=17)},
    {"sd": lambda sd: spoilt(sd, noffset=33)},
    {"best": lambda best: spoilt(best, ncoef=-1)},
    {"mean": lambda mean: spoilt(mean, coef=[3e38] * 16)},
    {"sd": lambda sd: spoilt(sd, stature=-1.0)},
    {"joints": lambda joints: [spoilt(joints[0], position=[3e38] * 3), *joints[1:]]},
    {"joints": lambda joints: [spoilt(joints[0], position=[float("nan")] * 3), *joints[1:]]},
    {"joints": lambda joints: [spoilt(joints[0], sd=[-1.0] * 3), *joints[1:]]},
    {"angles": lambda angles: [spoilt(angles[0], angle=float("inf")), *angles[1:]]},
    {"frame": 2**62},
    {"frame": -2},
    {"step": 2**62},
)


def spoilt(message, **changes):
    """A message with other fields; a function gets the old value."""
    other = copy(message)
    for name, value in changes.items():
        setattr(other, name, value(getattr(other, name)) if callable(value) else value)
    return other


def test_messages_that_no_track_may_contain_are_left_out(estimates, tmp_path):
    """Each could be decoded; any of them may be the first, or the last."""
    for k in range(0, len(WRONG), 10):
        events = list(estimates)
        for place, change in enumerate(WRONG[k : k + 10]):
            events.insert(2 * place, spoilt(estimates[place], **change))
        count = len(WRONG[k : k + 10]) + 1
        events.append(spoilt(estimates[-1], **WRONG[k]))
        log = rig.write_log(tmp_path / "in.log", [("GAIT_ESTIMATE", e) for e in events])
        words = ["--url", f"file://{log}?speed=0", "-o", tmp_path / "t.csv", "--log", tmp_path / "e.log"]
        done = rig.gait("record", *words, "--json")
        assert done.returncode == 0 and f"messages skipped: {count}, first: " in done.stderr
        assert json.loads(done.stdout)["damaged"] == count and json.loads(done.stdout)["lost"] == 0
        assert len(read_track(tmp_path / "t.csv").frame) == COUNT
        assert read_run(str(tmp_path / "e.log")).remark is None and len(read_run(str(log)).frame) == COUNT


@pytest.mark.parametrize("first", [0, 3])
def test_wrong_classes_are_left_out(first, estimates, tmp_path):
    """Also if they come first: names are those of two successive messages."""

    def classes(of, **changes):
        message = gaitmsg.classes_t()
        message.utime, message.nclasses, message.most_probable = of.utime, 2, 1
        message.name, message.probability = ["walk", "stand"], [0.25, 0.75]
        return spoilt(message, **changes)

    changes = [{"most_probable": 2}, {"probability": [float("nan"), 1.0]}, {"name": ["walk", "fly"]}]
    events = [(channel, e) for e in estimates for channel in ("GAIT_CLASSES", "GAIT_ESTIMATE")]
    events = [(channel, classes(e) if channel == "GAIT_CLASSES" else e) for channel, e in events]
    for k, change in enumerate(changes[:: -1 if first == 0 else 1], first):
        events[2 * k] = "GAIT_CLASSES", classes(estimates[k], **change)
    log = rig.write_log(tmp_path / "in.log", events)
    done = rig.gait("record", "--url", f"file://{log}?speed=0", "-o", tmp_path / "t.csv")
    assert done.returncode == 0 and "messages skipped: 3, first: GAIT_CLASSES: " in done.stderr
    wanted = [*["stand"] * first, *[""] * 3, *["stand"] * (17 - first)]
    assert read_track(tmp_path / "t.csv").motion_class == wanted
    run = read_run(str(log))
    found = ["stand" if len(one.class_probability) == 2 else "" for one in run.estimates]
    assert found == wanted and "a message is skipped" in run.remark


def test_a_log_played_again_is_another_stream(estimates, tmp_path):
    done, frames = record(tmp_path, [*estimates, *estimates])
    assert done.returncode == 0 and "another stream began" in done.stderr and len(frames) == COUNT


def test_a_start_in_the_middle_is_the_same_stream(estimates, tmp_path):
    """A person is found anew: steps count from 0 again, frames continue; the very first ones may be lost."""
    anew = [later(e, step=e.frame - 8, dropped=0) for e in estimates[8:]]
    for rest in (anew, anew[1:]):
        done, frames = record(tmp_path, [*estimates[:8], *rest], "--quiet")
        assert done.returncode == 0 and done.stderr == "" and len(frames) == 8 + len(rest)


def test_the_log_that_is_listened_to_stays_as_it_is(estimates, tmp_path):
    log = rig.write_log(tmp_path / "in.log", [("GAIT_ESTIMATE", e) for e in estimates])
    before = log.read_bytes()
    for words, code, error in (
        (["--url", f"file://{log}?mode=w", "-o", tmp_path / "t.csv"], 2, "only read here; leave out ?mode="),
        (["--url", f"file://{log}", "-o", tmp_path / "t.csv", "--log", log], 1, "is read by this command"),
    ):
        done = rig.gait("record", *words)
        assert done.returncode == code and error in done.stderr and done.stderr.count("\n") == 1, done.stderr
    assert log.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["in.log"]


def test_a_log_that_breaks_off_is_reported_and_recorded_as_far_as_it_goes(estimates, tmp_path):
    log = rig.write_log(tmp_path / "in.log", [("GAIT_ESTIMATE", e) for e in estimates])
    log.write_bytes(log.read_bytes()[:-100])
    done = rig.gait("record", "--url", f"file://{log}?speed=0", "-o", tmp_path / "t.csv", "--quiet")
    assert done.returncode == 1 and f"ends at byte {log_end(log, COUNT - 1)}, messages before" in done.stderr
    assert done.stderr.count("\n") == 1 and len(read_track(tmp_path / "t.csv").frame) == COUNT - 1


def log_end(log, count):
    """Bytes of the first `count` estimates of a log."""
    messages = rig.read_log(log, "GAIT_ESTIMATE", gaitmsg.estimate_t)[:count]
    return sum(28 + len("GAIT_ESTIMATE") + len(m.encode()) for m in messages)


def test_what_else_a_log_holds_is_remarked(estimates, tmp_path):
    events = [("GAIT_ESTIMATE", e) for e in estimates]
    assert read_run(str(rig.write_log(tmp_path / "whole.log", events))).remark is None
    twice = read_run(str(rig.write_log(tmp_path / "twice.log", events * 2)))
    assert len(twice.frame) == COUNT and twice.remark.startswith("another stream begins with frame 0;")
    cut = tmp_path / "cut.log"
    cut.write_bytes((tmp_path / "whole.log").read_bytes()[:-100])
    assert len(read_run(str(cut)).frame) == COUNT - 1
    assert f"messages before: {COUNT - 1}" in break_of(cut)


def test_logs_break_off_where_lcm_stops(tmp_path):
    whole = rig.write_log(tmp_path / "whole.log", [("GAIT_ESTIMATE", gaitmsg.estimate_t())] * 3)
    assert break_of(whole) is None
    contents = whole.read_bytes()
    for at, value in ((0, b"\0"), (20, b"\0\0\4\0"), (20, b"\0\0\0\0"), (24, b"\xff")):
        place = 2 * len(contents) // 3 + at
        whole.write_bytes(contents[:place] + value + contents[place + len(value) :])
        assert "messages before: 2" in break_of(whole)


def test_a_log_cut_in_its_first_message_is_called_damaged(tmp_path):
    whole = rig.write_log(tmp_path / "whole.log", [("GAIT_ESTIMATE", gaitmsg.estimate_t())])
    for size in (10, 60):
        cut = tmp_path / "cut.log"
        cut.write_bytes(whole.read_bytes()[:size])
        done = rig.gait("record", "--url", f"file://{cut}?speed=0", "-o", tmp_path / "t.csv", "--quiet")
        assert done.returncode == 1 and "cut.log" in done.stderr and done.stderr.count("\n") == 1
        assert "damaged or ends at byte 0" in done.stderr


@pytest.mark.parametrize("program", ["record", "view"])
def test_a_log_damaged_before_its_first_estimate_is_called_damaged(program, tmp_path):
    image = [message for _, message in rig.frames(0, 2)]
    path = rig.write_log(tmp_path / "in.log", [("GAIT_IMAGE_0", each) for each in image])
    second = path.stat().st_size // 2
    path.write_bytes(states_too_much(path.read_bytes(), second, -1))
    output = {"record": ["-o", tmp_path / "a.csv"], "view": ["--save", tmp_path / "a.png"]}
    done = rig.gait(program, "--url", f"file://{path}?speed=0", *output[program], "--quiet")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert f"in.log: the log is damaged or ends at byte {second}, messages before: 1" in done.stderr


@pytest.mark.parametrize("option", ["--frames", "--until-idle", "--patience"])
def test_ends_that_cannot_be_are_usage_errors(tmp_path, option):
    done = rig.gait("record", "-o", tmp_path / "t.csv", option, "-1")
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and option in done.stderr


def test_a_log_for_which_there_is_no_space_is_reported(estimates, tmp_path):
    """The last bytes are still in memory: only closing the file shows that they do not fit.

    The name, which some programs give to logs, is taken as well.
    """
    log = rig.write_log(tmp_path / "in.log", [("GAIT_ESTIMATE", e) for e in estimates])
    space = log.stat().st_size - 100
    words = [str(rig.PYTHON), "-m", "gait", "record", "--url", f"file://{log}?speed=0"]
    done = subprocess.run(
        [*words, "-o", tmp_path / "t.csv", "--log", tmp_path / "e.lcm"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (space, space)),
        capture_output=True,
        text=True,
        timeout=rig.PATIENCE,
        check=False,
    )
    assert done.returncode == 1 and "e.lcm: the log cannot be written: File too large" in done.stderr
    assert not (tmp_path / "e.lcm").exists()


def states_too_much(content, begin, length=2**31 - 1):
    """A log whose event at byte `begin` states so many bytes."""
    changed = bytearray(content)
    struct.pack_into(">i", changed, begin + 24, length)
    return bytes(changed)


@pytest.mark.parametrize("program", ["record", "view", "trackd", "report"])
def test_a_log_that_could_exhaust_memory_is_one_line(program, estimates, tmp_path, tmp_path_factory):
    """liblcm searches for the first event, and allocates what an event states."""
    path = rig.write_log(tmp_path / "in.log", [("GAIT_ESTIMATE", e) for e in estimates])
    whole, second = path.read_bytes(), log_end(path, 1)
    clip = rig.write_clip(tmp_path_factory.mktemp("clip"), 3)
    film = ["--video", clip / "video.mp4", "--camera", clip / "camera.json", "--track", "t.csv"]
    url = f"file://{path}?speed=0"
    contents = [states_too_much(whole, 0, length) for length in (2**31 - 1, 2**31 - 2, 1 << 30)]
    contents += [states_too_much(whole, second), b"x" + states_too_much(whole, 0), b"x" * 99]
    for content in contents:
        path.write_bytes(content)
        if program == "trackd":
            done = rig.run("-m", rig.MODEL, "--url", url)
            code, printed = done.code, done.words
        else:
            output = {"record": ["-o", tmp_path / "a.csv"], "view": ["--save", tmp_path / "a.png"]}
            words = [path, *film] if program == "report" else ["--url", url, *output[program]]
            done = rig.gait(program, *words)
            code, printed = done.returncode, done.stderr
        assert code == 1 and printed.count("\n") == 1, printed
        assert "damaged or" in printed or "is not an LCM log" in printed
        assert [p.name for p in tmp_path.iterdir()] == ["in.log"]


def test_a_pipe_is_not_a_log(tmp_path):
    """A check of a pipe would take the bytes that liblcm then lacks, or wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    done = rig.run("-m", rig.MODEL, "--url", f"file://{tmp_path}/pipe?speed=0")
    assert done.code == 1 and "pipe: cannot open this log" in done.words
