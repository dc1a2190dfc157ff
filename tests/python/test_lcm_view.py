"""gait view: each frame shows its own estimate, in a file and in a browser."""

import asyncio
import contextlib
import json
import signal
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cv2
import lcm
import lcm_rig as rig
import numpy as np
import pytest

from gait.cli import main
from gait.errors import UserError
from gait.lcm.link import LogWriter, gaitmsg, private_url
from gait.lcm.messages import camera_message, estimate_of
from gait.live import feed as feeds
from gait.live import server
from gait.live.feed import PLOTTED, Drops, Feed
from gait.live.server import Page
from gait.report import drawing
from gait.report.drawing import Overlay
from gait.web import serve


@pytest.fixture
def log(tmp_path):
    """Frames and their estimates with classes in one log, the estimate of frame 3 before its frame.

    In frame 5 the person stands.
    """
    opening = rig.opening()
    estimates = rig.play(rig.write_log(tmp_path / "in.log", [*opening, *rig.frames(0, 6)])).estimates
    estimates[5].speed = 0.0
    events = [*opening]
    for i, (frame, estimate) in enumerate(zip(rig.frames(0, 6), estimates, strict=True)):
        pair = [frame, ("GAIT_ESTIMATE", estimate)]
        events += [("GAIT_CLASSES", classes_at(i))] if i != 4 else []  # one is lost
        events += pair if i != 3 else pair[::-1]
    return rig.write_log(tmp_path / "both.log", events), estimates


def classes_at(i):
    one = gaitmsg.classes_t()
    one.utime, one.frame, one.most_probable, one.nclasses = rig.utime(i), i, 1, 2
    one.name, one.probability = ["walk", "run"], [0.125, 0.875]
    return one


def follow(path, camera=None, watched=lambda: True):
    """The pictures of a log, what is reported with them, and the feed itself."""
    shown, reports = [], []
    cameras = {} if camera is None else {0: camera}
    feed = Feed(
        f"file://{path}?speed=0",
        [0],
        rig.model(),
        cameras,
        lambda _, image: shown.append(image),
        lambda topic, value: reports.append((topic, value)),
        watched=watched,
    )
    while feed.handle(1.0):
        pass
    return shown, reports, feed


def view(path, camera=None):
    return follow(path, camera)[0]


def test_each_estimate_is_drawn_into_its_own_frame(log):
    path, estimates = log
    shown, reports, _ = follow(path)
    motions = [found["motion"] for topic, found in reports if topic == "sample"]
    assert motions == [*["run 88 %"] * 4, "", "run 88 %"]
    assert len(shown) == 5, "an estimate without its frame is passed over"
    overlay = Overlay(rig.model(), rig.CAMERA)
    for picture, i in zip(shown, (0, 1, 2, 4, 5), strict=True):
        estimate = estimate_of(estimates[i], classes_at(i) if i != 4 else None)
        estimate = replace(estimate, utime=rig.utime(i) - rig.utime(0))
        np.testing.assert_array_equal(picture, overlay.draw(rig.picture(i), estimate, i))


def test_the_class_has_a_line_in_the_picture_if_there_are_several(log, monkeypatch):
    written, write = [], drawing._write

    def note(region, words, *style):
        written.append(words)
        write(region, words, *style)

    monkeypatch.setattr(drawing, "_write", note)
    overlay = Overlay(rig.model(), rig.CAMERA)
    estimates = estimate_of(log[1][0]), estimate_of(log[1][0], classes_at(0))
    pictures = [overlay.draw(rig.picture(0), estimate, 0) for estimate in estimates]
    one, two = np.split(written, [len(written) // 2])
    assert [words for words in two if words not in one] == ["run 88 %"] and len(two) == len(one) + 1
    rows = np.flatnonzero((pictures[0] != pictures[1]).any((1, 2)))
    panel = round(0.6 * (8 + 92)), round(0.6 * (8 + 92 + 18))  # its foot with one class and with several
    assert rows[0] < panel[0] < rows[-1] <= panel[1]


def test_a_person_who_stands_has_a_class_but_no_hand_arc_or_cadence(log, monkeypatch):
    written = []
    monkeypatch.setattr(drawing, "_write", lambda region, words, *style: written.append(words))
    overlay, walks, stands = Overlay(rig.model(), rig.CAMERA), log[1][0], log[1][5]
    for estimate in (walks, stands):
        overlay.draw(rig.picture(0), estimate_of(estimate, classes_at(0)), 0)
    walking, standing = written[: len(written) // 2 + 1], written[len(written) // 2 + 1 :]
    assert {"R", "L"} < set(walking) and walking[-2] == standing[-2] == "run 88 %"
    assert standing[1:3] == ["no strides", " 0.00 m/s"] and len(standing) == 5


@pytest.mark.parametrize(
    "width, height, beside", [(720, 1280, True), (320, 240, True), (1280, 720, True), (240, 320, False)]
)
def test_a_legend_fits_films_of_any_aspect_and_leaves_the_panel(width, height, beside):
    overlay = Overlay(rig.model(), replace(rig.CAMERA, width=width, height=height))
    plain, explained = (
        overlay.draw_absent(np.zeros((height, width, 3), np.uint8), 0.0, 0, legend=legend)
        for legend in (False, True)
    )
    changed, panel = ((plain != explained).any(2), plain.any(2))
    assert not (changed & panel).any() and changed.sum() > 0.7 * panel.sum()
    assert not changed[-1].any() and not changed[:, -1].any()
    rows, of_panel = (np.flatnonzero(one.any(1)) for one in (changed, panel))
    assert (rows[-1] <= of_panel[-1]) == beside  # then it covers no further rows, where people are


def test_nothing_is_drawn_until_a_browser_is_there_and_then_the_newest(log):
    open_pages = []
    shown, reports, feed = follow(log[0], watched=lambda: bool(open_pages))
    assert not shown and len([topic for topic, _ in reports if topic == "sample"]) == 6
    open_pages.append(True)
    feed.handle(0.0)
    assert len(shown) == 1
    np.testing.assert_array_equal(shown[0], view(log[0])[-1])


def test_several_people_are_drawn_into_one_frame(log, monkeypatch):
    """A frame is drawn when all running trackers have answered it."""
    rig.need_multicast()
    monkeypatch.setattr(feeds, "_LONGEST_PAUSE_S", 1e6)
    shown, heard, urls = [], [], [private_url(), private_url()]
    feed = Feed(
        private_url(), [0], rig.model(), {0: rig.CAMERA}, lambda _, image: shown.append(image),
        lambda _, value: heard.append(value.get("person", "frames")), people=urls,
    )  # fmt: skip
    assert [one["url"] for one in feed.page_data()["people"]] == urls
    apart = [estimate_of(estimate) for estimate in log[1]]
    for k, answers in ((0, (0, 1)), (1, (0,)), (2, (0, 1))):
        feed._on_image(
            0, *(part.encode() if part != "GAIT_IMAGE_0" else part for part in rig.frames(k, k + 1)[0])
        )
        for person in answers:
            feed._on_estimate(person, "GAIT_ESTIMATE", log[1][k].encode())
            feed.handle(0.0)
    assert heard == ["frames", 0, 1, 0, 0, 1] and len(shown) == 2  # the first tracker by itself, then both
    people = {name: replace(apart[2], utime=rig.utime(2) - rig.utime(0)) for name in ("1", "2")}
    np.testing.assert_array_equal(
        shown[-1], Overlay(rig.model(), rig.CAMERA).draw_people(rig.picture(2), people)
    )


def test_cameras_that_run_by_themselves_are_drawn_with_the_frame_nearest_in_time(log, tmp_path):
    """A second camera that is 9 ms late and misses a frame, with a first one of 33 ms per frame."""
    events = [*rig.opening(), ("GAIT_CAMERA_1", camera_message(rig.CAMERA, rig.utime(0)))]
    for i, (frame, estimate) in enumerate(zip(rig.frames(0, 6), log[1], strict=True)):
        late = deepcopy(frame[1])
        late.utime += 9000
        events += [frame, *([("GAIT_IMAGE_1", late)] if i != 3 else []), ("GAIT_ESTIMATE", estimate)]
    path, shown = rig.write_log(tmp_path / "two.log", events), []
    feed = Feed(f"file://{path}?speed=0", [0, 1], rig.model(), {}, lambda k, image: shown.append((k, image)))
    while feed.handle(1.0):
        pass
    second = [image for k, image in shown if k == 1]
    assert [k for k, _ in shown].count(0) == 6 and len(second) == 4  # the first shows no interval yet
    overlay = Overlay(rig.model(), rig.CAMERA)
    estimate = replace(estimate_of(log[1][5]), utime=rig.utime(5) - rig.utime(0))
    np.testing.assert_array_equal(second[-1], overlay.draw(rig.picture(5), estimate, 5))


def test_damaged_messages_are_passed_over(log, tmp_path):
    frames, estimates = rig.frames(0, 3), log[1]
    cut = SimpleNamespace(encode=lambda: bytes(30))
    events = [*rig.opening()]
    for frame, estimate in zip(frames, estimates, strict=False):
        events += [(frame[0], cut), frame, ("GAIT_ESTIMATE", cut), ("GAIT_ESTIMATE", estimate)]
    path = rig.write_log(tmp_path / "spoilt.log", events)
    assert len(view(path)) == 3
    assert "GAIT_IMAGE_0: not a gaitmsg.image_t" in follow(path)[2].damage


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


@pytest.mark.parametrize(
    "words, code, message",
    [
        (["--save", "{}/v.txt"], 2, "v.txt: has the wrong suffix; give a name that ends in .jpg"),
        (["--save", "{}/none/v.png"], 1, "none does not exist"),
        (["--record-to", "{}/a.file"], 1, "a.file: is a file; give the name of a folder"),
        (["--stream", "2", "--stream", "2"], 2, "--stream 2: is given twice; give each once"),
    ],
)
def test_wrong_names_are_refused_before_listening(words, code, message, tmp_path, capsys):
    (tmp_path / "a.file").touch()
    try:
        found = main(["view", *(word.format(tmp_path) for word in words)])
    except SystemExit as stop:
        found = stop.code
    printed = capsys.readouterr()
    assert found == code and message in printed.err and not printed.out


PHASE = [name for *_, name in PLOTTED].index("phase")


def test_a_page_gets_each_estimate_and_the_state_of_the_tracker(log):
    path, estimates = log
    reports = follow(path)[1]
    samples = [value for topic, value in reports if topic == "sample"]
    assert [one["frame"] for one in samples] == list(range(6))
    for one, estimate in zip(samples, estimates, strict=True):
        angles = {angle.name: angle.angle for angle in estimate.angles}
        assert one["status"] == ("init", "tracking", "ambiguous", "lost")[estimate.status]
        assert one["time"] == pytest.approx(1e-6 * (estimate.utime - estimates[0].utime))
        np.testing.assert_allclose(one["points"], [j.position for j in estimate.joints], atol=1e-4)
        assert one["values"][0] == pytest.approx(np.degrees(angles["l_knee_flexion"]), abs=1e-3)
        if one["frame"] == 5:
            assert one["cadence"] is None and one["phase"] is None and one["values"][PHASE] is None
        else:
            assert one["cadence"] == pytest.approx(120 * estimate.mean.stride_hz, abs=0.1)
            assert one["phase"] == pytest.approx(estimate.mean.phase, abs=1e-4)


def test_drops_are_counted_over_restarts():
    drops = Drops()
    reports = [(1, 10), (3, 20), (3, 30), (0, 2), (2, 12), (100, 300), (1, 5), (5, 4)]
    assert [drops.add(*report) for report in reports] == [1, 3, 3, 3, 5, 103, 104, 109]


@pytest.fixture
def page(monkeypatch, tmp_path):
    monkeypatch.setattr(server, "_ALIVE_S", 0.05)
    found = Page(0, [0], private_url(), tmp_path)
    yield found
    found.close()


def get(page, path="", **headers):
    request = urllib.request.Request(f"{page.address}{path}", headers=headers)
    return urllib.request.urlopen(request, timeout=rig.PATIENCE)


def test_browsers_get_the_page_and_the_newest_picture(page):
    with get(page) as answer:
        assert b"/live/live.js" in answer.read()
    for image in (rig.picture(0), rig.picture(5)):
        page.show(0, image)
        with get(page, "frame/0.jpg") as frame:
            assert frame.headers["Content-Type"] == "image/jpeg"
            viewed = cv2.imdecode(np.frombuffer(frame.read(), np.uint8), cv2.IMREAD_COLOR)
        assert np.abs(viewed.astype(int) - image).mean() < 12
    for path in ("other", "frame/1.jpg", "live/server.py"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            get(page, path)
    with pytest.raises(UserError, match="give another"):
        Page(int(page.address.split(":")[2].rstrip("/")), [0], private_url(), ".")


def test_events_reach_a_browser(page):
    page.report("health", {"person": 0, "dropped": 0, "text": "tracking"})
    with get(page, "events") as events:
        assert [events.readline() for _ in range(2)] == [
            b"event: health\n",
            b'data: {"person":0,"dropped":0,"text":"tracking"}\n',
        ]
        page.report("sample", {"person": 0, "frame": 7})
        page.show(0, rig.picture(0))
        lines = set()
        while not {b"event: sample\n", b'data: {"person":0,"frame":7}\n', b"event: picture\n"} <= lines:
            lines.add(events.readline())
            assert b"" not in lines


def test_a_recording_holds_what_the_url_carries(page, tmp_path):
    rig.need_multicast()
    own = {"Origin": page.address.rstrip("/")}

    def press(on, **headers):
        request = urllib.request.Request(f"{page.address}record?on={on}", method="POST", headers=headers)
        return json.load(urllib.request.urlopen(request, timeout=rig.PATIENCE))

    for headers in ({}, {"Origin": "http://evil.example"}):
        with pytest.raises(urllib.error.HTTPError, match="403"):
            press(1, **headers)
    assert press(0, **own) == {}
    begun = press(1, **own)
    assert press(1, **own) == begun and begun["path"].startswith(str(tmp_path))
    sender, frames = rig.Listener(page._url), rig.frames(0, 3)
    path, deadline = Path(begun["path"]), time.monotonic() + rig.PATIENCE
    sender.send(frames)
    while not rig.written(path) and time.monotonic() < deadline:
        sender.listen(50)
    assert not path.exists()
    assert press(0, **own) == begun | {"fault": None} and press(0, **own) == {}
    recorded = list(lcm.EventLog(str(path), "r"))
    assert recorded and {e.channel for e in recorded} == {"GAIT_IMAGE_0"}
    assert recorded[0].data in [message.encode() for _, message in frames]


@pytest.mark.parametrize(
    "words",
    [
        ["--port", "70000"],
        ["--port", "-1"],
        ["--patience", "nan"],
        ["--stream", "-1"],
        ["--person", "0"],
        ["--person", "9"],
        ["--person", "one"],
    ],
    ids=" ".join,
)
def test_options_out_of_their_range_are_usage_errors(words):
    done = rig.gait("view", *words)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and words[0] in done.stderr


def test_a_log_is_only_read(log):
    before = log[0].read_bytes()
    done = rig.gait("view", "--url", f"file://{log[0]}?mode=w", "--save", log[0].with_suffix(".png"))
    assert done.returncode == 2 and "only read here; leave out ?mode=" in done.stderr
    assert log[0].read_bytes() == before


def test_a_job_of_a_script_ends_by_sigint():
    """A shell ignores it for commands behind &."""
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
        asking = urllib.request.urlopen(f"{address}events", timeout=rig.PATIENCE)
        with rig.daemon(url) as (listener, _), asking as events:
            listener.ask(rig.opening(), lambda s: s.state == s.ARMED and s.background_mask == 1, "the START")
            for i, event in enumerate(rig.frames(0, 3)):
                listener.send([event])
                listener.until(lambda i=i: len(listener.estimates) > i, "an estimate")
            while b"event: picture" not in events.readline():
                pass
            with urllib.request.urlopen(f"{address}frame/0.jpg", timeout=rig.PATIENCE) as frame:
                assert cv2.imdecode(np.frombuffer(frame.read(), np.uint8), cv2.IMREAD_COLOR).shape == (
                    120,
                    160,
                    3,
                )
    finally:
        process.kill()
        process.communicate()


def test_the_newest_camera_counts(log, tmp_path):
    path, estimates = log
    wrong = camera_message(rig.CAMERA, 0)
    wrong.width, wrong.height, wrong.cx, wrong.cy = 16000, 16000, 7999.5, 7999.5
    events = [("GAIT_CAMERA_0", wrong), rig.frames(0, 1)[0], ("GAIT_ESTIMATE", estimates[0])]
    events += [
        ("GAIT_CAMERA_0", camera_message(rig.CAMERA, 0)),
        rig.frames(0, 2)[1],
        ("GAIT_ESTIMATE", estimates[1]),
    ]
    assert len(view(rig.write_log(tmp_path / "a.log", events))) == 1


def spoilt(message, **changes):
    """A message with other fields; a function gets the old value."""
    other = type(message).decode(message.encode())
    for name, value in changes.items():
        setattr(other, name, value(getattr(other, name)) if callable(value) else value)
    return other


@pytest.mark.parametrize(
    ("estimate", "image", "words"),
    [
        ({"joints": [], "njoints": 0}, {}, "without joints"),
        ({"joints": lambda joints: joints[:10], "njoints": 10}, {}, "other joints"),
        ({"status": 77}, {}, "status 77 is unknown"),
        ({"speed": float("nan")}, {}, "speed_m_s is nan"),
        ({"ess": float("inf")}, {}, "ess is inf"),
        ({}, {"width": 0, "height": 0}, "0x0 pixels are not a picture"),
        ({}, {"width": -160}, "-160x120 pixels are not a picture"),
        ({}, {"height": -1}, "160x-1 pixels are not a picture"),
        ({}, {"width": 80}, "a picture of 80x120, the camera's is 160x120"),
        ({}, {"height": 60}, "a picture of 160x60"),
        ({}, {"row_stride": 0}, "row_stride or size too small"),
        ({}, {"pixelformat": 5}, "pixelformat"),
        ({}, {"pixelformat": 1196444237, "data": b"", "size": 0}, "JPEG frame cannot be decoded"),
    ],
)
def test_one_wrong_message_is_left_out(estimate, image, words, log, tmp_path):
    estimates, frames = log[1], [message for _, message in rig.frames(0, 3)]
    events = [*rig.opening()]
    for i, (frame, found) in enumerate(zip(frames, estimates, strict=False)):
        wrong = i == 1
        events.append(("GAIT_IMAGE_0", spoilt(frame, **image) if wrong else frame))
        events.append(("GAIT_ESTIMATE", spoilt(found, **estimate) if wrong else found))
    shown, _, feed = follow(rig.write_log(tmp_path / "wrong.log", events))
    assert len(shown) == 2 and words in feed.damage


@pytest.mark.parametrize(
    "change",
    [{"width": 0}, {"height": -3}, {"fx": 0.0}, {"cx": 3e38}, {"t": [float("nan")] * 3}, {"R": [1.0] * 9}],
)
def test_cameras_that_cannot_be_are_left_out(change, log, tmp_path):
    events = [("GAIT_CAMERA_0", spoilt(camera_message(rig.CAMERA, 0), **change)), rig.frames(0, 1)[0]]
    path = rig.write_log(tmp_path / "a.log", [*events, ("GAIT_ESTIMATE", log[1][0])])
    assert view(path) == []


def test_a_recording_that_fails_ends_and_is_reported(page, monkeypatch):
    rig.need_multicast()

    def full(*_):
        raise UserError("the disk is full")

    monkeypatch.setattr(LogWriter, "write", full)
    own = {"Origin": page.address.rstrip("/")}
    request = urllib.request.Request(f"{page.address}record?on=1", method="POST", headers=own)
    urllib.request.urlopen(request, timeout=rig.PATIENCE).close()
    sender, deadline = rig.Listener(page._url), time.monotonic() + rig.PATIENCE
    with get(page, "events") as events:
        while b"the disk is full" not in (line := events.readline()):
            assert time.monotonic() < deadline
            if line == b": here\n":
                sender.send(rig.frames(0, 1))


def test_without_a_picture_browsers_get_an_answer(page):
    with pytest.raises(urllib.error.HTTPError, match="503"):
        get(page, "frame/0.jpg")


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", ""])
def test_other_hosts_are_refused(host, page):
    page.show(0, rig.picture(0))
    with pytest.raises(urllib.error.HTTPError, match="403"):
        get(page, "frame/0.jpg", Host=host)
    local = urllib.request.Request(page.address.replace("127.0.0.1", "localhost"))
    assert urllib.request.urlopen(local, timeout=rig.PATIENCE).status == 200


def test_simultaneous_browsers_are_bounded(page, monkeypatch):
    monkeypatch.setattr(server, "_MOST_BROWSERS", 3)

    async def ask():
        return [(await page._events(None)).status_code for _ in range(5)]  # none is answered meanwhile

    assert asyncio.run(ask()) == [200, 200, 200, 503, 503]


HALF = b"GET /state HTTP/1.1\r\nHost: "


def connected(page):
    return socket.create_connection(("127.0.0.1", port_of(page)), timeout=rig.PATIENCE)


def port_of(page):
    return int(page.address.rstrip("/").rpartition(":")[2])


def has_ended(connection):
    """Wait until the server has ended a connection."""
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


@pytest.mark.parametrize("sent", [b"", HALF])
def test_half_sent_requests_shut_no_one_out(sent, page):
    count = serve.MOST_CONNECTIONS + 2
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(connected(page)) for _ in range(count)]
        for one in silent[-serve.MOST_WAITING :]:
            one.sendall(sent)
        assert get(page, "state").status == 200
        assert all(has_ended(one) for one in silent[: -serve.MOST_WAITING])


@pytest.mark.parametrize(
    "sent",
    [b"", HALF, b"POST /record?on=0 HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nContent-Length: 9\r\n\r\nhalf"],
)
def test_a_request_has_to_come_in_time(sent, page, monkeypatch):
    monkeypatch.setattr(serve, "REQUEST_S", 0.1)
    with connected(page) as one:
        one.sendall(sent % port_of(page) if b"%d" in sent else sent)
        while not has_ended(one):
            pass
    assert get(page, "state").status == 200


class Clock:
    """An event loop whose time is set."""

    def __init__(self):
        self.now, self.due = 0.0, {}

    def time(self):
        return self.now

    def call_at(self, when, function):
        timer = SimpleNamespace(when=lambda: when, cancel=lambda: self.due.pop(id(timer)))
        self.due[id(timer)] = when
        return timer

    def create_task(self, coroutine, **_):
        coroutine.close()
        return asyncio.Future(loop=self)

    def get_debug(self):
        return False


def test_each_part_of_a_body_has_its_time_and_all_have_a_limit():
    async def nothing(scope, receive, send):
        """Handle no request."""

    clock = Clock()
    server = serve._server(nothing, lambda: None)
    server.config.load()
    one = server.config.http_protocol_class(server.config, server.server_state, {}, clock)
    one.connection_made(SimpleNamespace(get_extra_info=lambda _: None, abort=lambda: None))

    def received(now, data):
        clock.now = now
        one.data_received(data)
        return list(clock.due.values())

    assert received(1.0, b"POST / HTTP/1.1\r\n") == [serve.REQUEST_S]  # of the head as a whole
    assert received(3.0, b"Host: x\r\nContent-Length: 100\r\n\r\n") == [3.0 + serve.REQUEST_S]
    for now in (7.0, 11.0):
        assert received(now, b"part") == [now + serve.REQUEST_S]
    assert received(serve.BODY_S - 1.0, b"part") == [serve.BODY_S]
    assert received(serve.BODY_S - 0.5, b"rest" * 22) == []


def test_an_answer_has_to_be_read_in_time(monkeypatch):
    monkeypatch.setattr(serve, "ANSWER_S", 0.1)
    ended = threading.Event()

    async def endless(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": bytes(1 << 25), "more_body": True})
        while (await receive())["type"] != "http.disconnect":
            pass
        ended.set()

    own = serve.listen(0)
    running, thread = serve.background(endless, own)
    try:
        with socket.create_connection(own.getsockname()) as one:
            one.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
            assert ended.wait(rig.PATIENCE)
    finally:
        running.should_exit = True
        thread.join()


def test_connections_are_bounded(monkeypatch):
    monkeypatch.setattr(serve, "MOST_CONNECTIONS", 3)
    begun, over = threading.Semaphore(0), threading.Event()

    async def slow(scope, receive, send):
        begun.release()
        while not over.is_set():
            await asyncio.sleep(0.01)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b""})

    own = serve.listen(0)
    running, thread = serve.background(slow, own)
    try:
        with contextlib.ExitStack() as stack:
            for _ in range(2):
                one = stack.enter_context(socket.create_connection(own.getsockname()))
                one.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
                assert begun.acquire(timeout=rig.PATIENCE)
            with pytest.raises(urllib.error.HTTPError, match="503"):
                urllib.request.urlopen(serve.address(own), timeout=rig.PATIENCE)
            over.set()
            assert one.recv(12) == b"HTTP/1.1 200"
    finally:
        running.should_exit = True
        thread.join()


def test_browsers_are_bounded_and_their_places_come_free(page, monkeypatch):
    monkeypatch.setattr(server, "_MOST_BROWSERS", 3)
    page.report("health", {"person": 0, "dropped": 0})
    open_now = [get(page, "events") for _ in range(3)]
    for stream in open_now:
        stream.readline()
    with pytest.raises(urllib.error.HTTPError, match="503"):
        get(page, "events")
    for stream in open_now:
        stream.close()
    deadline = time.monotonic() + rig.PATIENCE
    while True:
        page.report("health", {"person": 0, "dropped": 0})  # a server finds out when it sends
        try:
            get(page, "events").close()
            break
        except urllib.error.HTTPError:
            assert time.monotonic() < deadline
