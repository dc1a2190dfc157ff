"""The Python side: links, pacing, capture, recorder and report."""

import json
import re

import cv2
import lcm_rig as rig
import numpy as np
import pytest

from gait.errors import UserError
from gait.io.track_file import read_track
from gait.lcm import link
from gait.lcm.capture import FileSource, Pacer, parse_rate
from gait.lcm.link import gaitmsg
from gait.lcm.record import Recorder, read_run

COUNT = 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A clip as files: video, camera, empty scene, init."""
    return rig.write_clip(tmp_path_factory.mktemp("clip"), COUNT)


def capture_options(folder):
    files = ["--camera", folder / "camera.json", "--background", folder / "background.png"]
    return [folder / "video.mp4", *files, "--init", folder / "init.json"]


@pytest.fixture(scope="module")
def logged(folder):
    """The clip as gait capture writes it to a log."""
    log = folder / "capture.log"
    done = rig.gait(
        "capture", *capture_options(folder), "--rate", "max", "--url", f"file://{log}?mode=w", "--json"
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["frames"] == COUNT
    return log


# ---- links ----


def test_which_url_is_in_force(monkeypatch):
    monkeypatch.delenv("LCM_DEFAULT_URL", raising=False)
    assert link.lcm_url() == link.DEFAULT_URL == "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"
    monkeypatch.setenv("LCM_DEFAULT_URL", "memq://")
    assert link.lcm_url() == "memq://" and link.lcm_url("file://x") == "file://x"


@pytest.mark.parametrize(
    ("url", "words"), [("nonsense://", "cannot open"), ("file:///no/such/log?speed=0", "no such LCM log")]
)
def test_a_refused_url_is_one_error_and_nothing_on_stderr(url, words, capfd):
    with pytest.raises(UserError, match=words):
        link.open_lcm(url)
    assert capfd.readouterr().err == ""


def test_a_small_receive_buffer_is_reported(monkeypatch, tmp_path):
    limit = tmp_path / "rmem_max"
    monkeypatch.setattr(link, "_RMEM_MAX", limit)
    for granted, expected in (("212992\n", True), ("4194304\n", False)):
        limit.write_text(granted)
        printed = link.buffer_warning(link.DEFAULT_URL)
        assert bool(printed) == expected and (not printed or "sysctl" in printed)
    limit.write_text("1")
    assert link.buffer_warning("file://x") is None


def test_memq_is_a_network_of_one_object():
    one, got = link.open_lcm("memq://"), []
    one.subscribe("GAIT_STATUS", lambda channel, data: got.append(data))
    one.publish("GAIT_STATUS", gaitmsg.status_t().encode())
    assert one.handle_timeout(1000) == 1 and len(got) == 1


# ---- pacing ----


class Clock:
    """Time that passes only when slept or worked."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


def paced(rate, times, work):
    clock = Clock()
    pacer = Pacer(parse_rate(rate), times[0], clock=clock, sleep=clock.sleep)
    sent = []
    for time, busy in zip(times, work, strict=True):
        clock.now += busy
        pacer.wait(time)
        sent.append(clock.now - 100.0)
    return pacer, np.array(sent)


def test_delays_do_not_add_up():
    """Frames take a third of the interval to prepare, one takes two intervals: the others keep the grid."""
    times = np.arange(50) / 30 + 4.0
    work = np.full(50, 1 / 90)
    work[20] = 2 / 30
    pacer, sent = paced("true", times, work)
    on_grid = np.ones(50, bool)
    on_grid[[0, 20, 21]] = False
    np.testing.assert_allclose(sent[on_grid], (times - 4.0)[on_grid], atol=1e-9)
    assert pacer.late == pytest.approx(1 / 30, abs=1e-9)


def test_the_first_frame_is_due_at_its_time():
    """Whatever video time it has."""
    clock, at = Clock(), 1_800_000_000_250_000
    pacer = Pacer(None, 4.0, 5.0, at, clock=clock, sleep=clock.sleep)
    pacer.wait(4.0)
    assert pacer.utime(4.0) == at and pacer.utime(4.5) == at + 500_000 and clock.now == 105.0


def test_rates():
    times = np.arange(10) / 30
    np.testing.assert_allclose(paced("10", times, np.zeros(10))[1], np.arange(10) / 10, atol=1e-9)
    pacer, sent = paced("max", times, np.full(10, 1.0))
    np.testing.assert_allclose(sent, 1 + np.arange(10))
    assert pacer.late == 0
    assert [pacer.utime(t) - pacer.origin for t in (0, 0.1)] == [0, 100_000], "capture times are the video's"
    for bad in ("fast", "0", "-3", "1e9", "nan"):
        with pytest.raises(UserError, match="--rate"):
            parse_rate(bad)


# ---- capture ----


def test_a_log_holds_the_clip_in_order(folder, logged):
    images = rig.read_log(logged, "GAIT_IMAGE_0", gaitmsg.image_t)
    source = FileSource(str(folder / "video.mp4"))
    frames = list(source.frames())
    assert len(images) == len(frames) == COUNT
    starts = rig.read_log(logged, "GAIT_COMMAND", gaitmsg.command_t)
    assert len(starts) == 1 and starts[0].utime == images[2].utime, "START is for the very frame of --init"
    for image, frame in zip(images, frames, strict=True):
        assert image.data == frame.image.tobytes()
        assert int.from_bytes(image.metadata[0].value, "big") == frame.number
        assert image.utime - images[0].utime == pytest.approx(frame.time * 1e6, abs=2)


def test_a_log_is_tracked_from_the_frame_of_the_start(logged):
    outcome = rig.play(logged)
    assert [e.frame for e in outcome.estimates] == list(range(2, COUNT)) and outcome.dropped == 0
    assert rig.play(logged, "--threads", 2).digest == outcome.digest


def test_repetition_goes_on_counting(folder):
    source = FileSource(str(folder / "video.mp4"), 3, 7, loop=True)
    shown = [frame for frame, _ in zip(source.frames(), range(10), strict=False)]
    assert [f.number for f in shown] == list(range(3, 13))
    np.testing.assert_allclose(np.diff([f.time for f in shown]), 1 / rig.FPS, atol=1e-6)
    np.testing.assert_array_equal(shown[0].image, shown[4].image)


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (["--jpeg", "0"], 2, "--jpeg: 0: give a whole number from 1 to 100"),
        (["--rate", "slow"], 2, "--rate slow"),
        (["--rate", "0"], 2, "--rate 0"),
        (["--stream", "-1"], 2, "-1: give a whole number from 0 to 30"),
        (["--start", "9", "--stop", "5"], 2, "--stop 5: must be greater than --start 9"),
        (["--start", "99"], 1, "has no frame 99"),
        (["--start", "5"], 1, "frame 2 comes before --start 5"),
        (["--stop", "2"], 1, "frame 2 is not sent with --stop 2"),
        (["--init", "auto", "--start", "2", "--stop", "5"], 1, "only 3 frames to track"),
        (["--camera", "nothing.json"], 1, "nothing.json"),
        (["--wait", "0.6"], 1, "no tracker knows the camera after 0.6 s"),
        (["--begin-at", "1e9", "--url", "udpm://239.255.76.67:7701?ttl=0"], 1, "--begin-at: passed "),
        (["--begin-at", "1.8e12"], 2, "--begin-at 1.8e+12: give seconds since 1970"),
        (["--begin-at", "-1"], 2, "-1: give seconds from 0 up"),
        (["--wait", "nan"], 2, "nan: give seconds from 0 up"),
        (["--wait", "1", "--url", "file://x.log?mode=w"], 2, "--wait: no tracker listens to the log"),
    ],
)
def test_faults_of_capture_are_one_line(folder, options, code, words):
    if {"0.6", "1e9"} & set(options):
        rig.need_multicast()
        options = [*options, "--url", link.private_url()]
    done = rig.gait("capture", *capture_options(folder), "--quiet", *options)
    assert done.returncode == code and words in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_a_person_without_a_start_or_an_answer_is_refused(folder):
    done = rig.gait("capture", folder / "video.mp4", "--person", 1)
    assert done.returncode == 2 and "--person: is for --init and --wait" in done.stderr


def test_the_start_of_a_person_in_a_log_is_on_that_persons_channel(folder, tmp_path):
    log = tmp_path / "a.log"
    words = [*capture_options(folder), "--person", 2, "--url", f"file://{log}?mode=w"]
    assert rig.gait("capture", *words, "--rate", "max").returncode == 0
    assert len(rig.read_log(log, "GAIT_COMMAND_2", gaitmsg.command_t)) == 1
    assert not rig.read_log(log, "GAIT_COMMAND", gaitmsg.command_t)


def test_a_start_outside_of_the_picture_is_reported(folder, tmp_path):
    init = json.loads((folder / "init.json").read_text())
    (tmp_path / "far.json").write_text(json.dumps(init | {"pelvis": [100, 100, 1]}))
    words = [*capture_options(folder)[:-1], tmp_path / "far.json", "--rate", "max"]
    done = rig.gait("capture", *words, "--url", f"file://{tmp_path / 'far.log'}?mode=w")
    assert done.returncode == 0 and "far.json: the start is outside the picture; check" in done.stderr


# ---- record and report ----


@pytest.fixture(scope="module")
def recorded(folder, logged):
    """The log tracked and recorded: track.csv and e.log."""
    rig.play(logged)
    url = f"file://{logged.with_suffix('.out')}?speed=0"
    done = rig.gait("record", "--url", url, "-o", folder / "track.csv", "--log", folder / "e.log", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_a_recording_is_a_track_file(folder, logged, recorded):
    track = read_track(folder / "track.csv")
    assert track.frame.tolist() == list(range(2, COUNT))
    np.testing.assert_allclose(track.time, track.frame / rig.FPS, atol=2e-5)
    estimates = rig.read_log(logged.with_suffix(".out"), "GAIT_ESTIMATE", gaitmsg.estimate_t)
    np.testing.assert_allclose(track.phase, [e.mean.phase for e in estimates], atol=1e-6)
    knee = next(i for i, joint in enumerate(estimates[0].joints) if joint.name == "l_knee")
    np.testing.assert_allclose(
        track.places["l_knee"], [e.joints[knee].position for e in estimates], atol=1e-5
    )
    np.testing.assert_allclose(track.sd["l_knee"], [e.joints[knee].sd for e in estimates], atol=1e-5)
    assert recorded["frames"] == COUNT - 2 and recorded["dropped"] == recorded["lost"] == 0
    assert recorded["latency_ms"] is None, "a log has no latency"
    assert recorded["fps"] == pytest.approx(rig.FPS, rel=1e-3)
    assert recorded["digest"] == f"{estimates[-1].tracker_digest & (1 << 64) - 1:016x}"


def test_a_recorded_log_is_read_back(folder, recorded):
    run = read_run(str(folder / "e.log"))
    assert run.frame.tolist() == list(range(2, COUNT)) and run.dropped == 0
    assert f"{run.tracker_digest:016x}" == recorded["digest"]
    assert (run.step_ms > 0).all()


def test_lost_estimates_are_counted(logged, tmp_path):
    rig.play(logged)
    estimates = rig.read_log(logged.with_suffix(".out"), "GAIT_ESTIMATE", gaitmsg.estimate_t)
    kept = [("GAIT_ESTIMATE", e) for i, e in enumerate(estimates) if i not in (3, 4, 9)]
    log = rig.write_log(tmp_path / "gaps.log", kept)
    recorder = Recorder(f"file://{log}?speed=0", str(tmp_path / "t.csv"))
    recorder.run()
    assert recorder.summary()["lost"] == 3 and len(read_track(tmp_path / "t.csv").frame) == COUNT - 5


def test_one_file_holds_one_stream(logged, recorded, tmp_path):
    estimates = rig.read_log(logged.with_suffix(".out"), "GAIT_ESTIMATE", gaitmsg.estimate_t)
    log = rig.write_log(tmp_path / "two.log", [("GAIT_ESTIMATE", e) for e in estimates + estimates[:5]])
    recorder = Recorder(f"file://{log}?speed=0", str(tmp_path / "t.csv"))
    recorder.run()
    assert len(read_track(tmp_path / "t.csv").frame) == len(estimates)


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_a_recording_ends_after_its_frames(logged, recorded, tmp_path, frames):
    recorder = Recorder(f"file://{logged.with_suffix('.out')}?speed=0", str(tmp_path / "t.csv"))
    recorder.run(frames=frames)
    assert len(read_track(tmp_path / "t.csv").frame) == frames


def test_nothing_received_is_an_error_and_leaves_no_file(tmp_path):
    log = rig.write_log(tmp_path / "empty.log", [("OTHER", b"x")])
    done = rig.gait("record", "--url", f"file://{log}?speed=0", "-o", tmp_path / "t.csv", "--quiet")
    assert done.returncode == 1 and "no estimate was received" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["empty.log"]


def test_a_report_of_a_log_that_breaks_off_shows_what_came_before(folder, recorded, tmp_path):
    cut, page = tmp_path / "cut.log", tmp_path / "r.html"
    cut.write_bytes((folder / "e.log").read_bytes()[:-100])
    files = ["--track", folder / "track.csv", "--video", folder / "video.mp4"]
    files += ["--camera", folder / "camera.json"]
    done = rig.gait("report", cut, *files, "-o", page, "--quiet")
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert "ends at byte" in done.stderr and f"{page} shows the part before" in done.stderr
    assert "<svg" in page.read_text()


def test_a_report_stands_alone(folder, recorded, tmp_path):
    page, film = tmp_path / "r.html", tmp_path / "o.mp4"
    files = [
        "--track",
        folder / "track.csv",
        "--video",
        folder / "video.mp4",
        "--camera",
        folder / "camera.json",
    ]
    done = rig.gait("report", folder / "e.log", *files, "-o", page, "--overlay", film, "--replayed")
    assert done.returncode == 0, done.stderr
    text = page.read_text()
    assert recorded["digest"] in text and "<h2>Times</h2>" in text and text.count("data:image/jpeg") == 6
    markup = re.sub("<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r'(src|href)="(?!data:|#)', markup) and "<script src" not in text
    assert "latency" not in text
    capture = cv2.VideoCapture(str(film))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == COUNT  # frames without an estimate too
