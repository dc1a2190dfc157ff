"""gait detect --lcm: receives frames over LCM and publishes the joints found in them."""

import re

import cv2
import lcm_rig as rig
import numpy as np
import pytest

from gait import Camera, Video, cli
from gait.bindings.initial import Start
from gait.detect import profile
from gait.detect.networks import LANDMARK_JOINTS, Crop, Person
from gait.detect.people import Followed
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lcm import detect
from gait.lcm.link import gaitmsg, private_url
from gait.lcm.messages import camera_message, command_message, image_message
from gait.track.keypoint_start import keypoint_noise

UV = np.random.default_rng(1).uniform(100, 300, (len(LANDMARK_JOINTS), 2))
CHANNELS = ["GAIT_TRACKS_3", *(f"GAIT_TRACKS_3_{n}" for n in range(1, 9))]
CONFIDENCE = np.linspace(0.3, 1, len(LANDMARK_JOINTS))


class FakePeople:
    """In every frame brighter than 10 finds a passer-by and, in those darker than 200, one found before."""

    def __init__(self, network, most, live):
        assert live
        self.one, self.times = Followed(1, count=1), []

    def step(self, frame):
        assert frame.image.ndim == 3
        self.times.append(frame.time)
        if frame.image.mean() < 10:
            return []
        person = Person(1.0, UV, CONFIDENCE, Crop(np.array([200.0, 200.0]), 200.0, 0.0))
        self.one.frames.append(frame.number)
        self.one.times.append(frame.time)
        self.one.keypoints.append(person)
        self.one.count += 1
        passer_by = Followed(2, [frame.number], [frame.time], [person._replace(uv=UV + 50)], count=1)
        both = [(passer_by, passer_by.keypoints[0]), (self.one, person)]
        return both if frame.image.mean() < 200 else both[:1]


@pytest.fixture
def rigged(monkeypatch):
    """A live detector without network or weights, and what it publishes."""
    sent = []

    class Link:
        def subscribe(self, channel, handler):
            self.channel, self.handler = channel, handler
            return self

        def set_queue_capacity(self, count):
            assert count == 1  # the newest frame

        def publish(self, channel, data):
            sent.append((channel, gaitmsg.tracks2_t.decode(data)))

    link = Link()
    monkeypatch.setattr(detect, "PeopleDetector", FakePeople)
    monkeypatch.setattr(detect, "open_lcm", lambda url: link)
    live = detect.LiveDetector(private_url(), 3, "full", 8)

    def send(level, utime, frame, jpeg=None, channels=3):
        shape = (48, 64, 3)[: 2 if channels == 1 else 3]
        link.handler(
            link.channel, image_message(np.full(shape, level, np.uint8), utime, frame, jpeg).encode()
        )

    return live, link, send, sent


def test_joints_carry_time_and_number_of_their_frame(rigged):
    live, link, send, sent = rigged
    assert link.channel == "GAIT_IMAGE_3"
    send(90, 5_000_000, 40)
    send(5, 5_040_000, 41)
    send(90, 5_080_000, -1, jpeg=90)
    send(90, 5_120_000, 43, channels=1)
    frames = (5_000_000, 40), (5_040_000, 41), (5_080_000, -1), (5_120_000, 43)
    for channel in CHANNELS:
        assert tuple((m.utime, m.frame) for to, m in sent if to == channel) == frames
    first = {to: m.tracks[0].u for to, m in sent[-9:-6]}
    assert first["GAIT_TRACKS_3"] == first["GAIT_TRACKS_3_2"] == pytest.approx(first["GAIT_TRACKS_3_1"] - 50)
    assert (live.frames, live.found) == (4, 3)
    assert live._detector.times == pytest.approx([0, 0.04, 0.08, 0.12])


def test_a_message_without_joints_means_that_the_person_is_not_in_view(rigged):
    """On every channel, so that no frame waits for a person who is not there."""
    _, _, send, sent = rigged
    for n, level in enumerate((5, 90, 250)):
        sent.clear()
        send(level, 40_000 * n, n)
        assert [channel for channel, _ in sent] == CHANNELS
        present = [channel for channel, message in sent if message.ntracks]
        assert present == [[], CHANNELS[:3], CHANNELS[1:2]][n]


def test_one_person_is_sent_until_out_of_view_for_a_second(rigged):
    """A crossing hides the person for a while; the other one's joints would take the tracker along."""
    _, _, send, sent = rigged
    who = []
    for n in range(30):
        sent.clear()
        send(250 if 5 <= n < 10 or 12 <= n < 26 else 90, 100_000 * n, n)
        u = {channel: message.tracks[0].u for channel, message in sent if message.ntracks}
        one, other = u.get("GAIT_TRACKS_3_2"), u["GAIT_TRACKS_3_1"]
        who.append({one: "one", other: "other", None: "none"}[u.get("GAIT_TRACKS_3")])
    # Hidden from frame 12 on: frame 21 is a second after the last one that shows the person.
    assert who == ["one"] * 5 + ["none"] * 5 + ["one"] * 2 + ["none"] * 9 + ["other"] * 9


def test_joints_are_the_models_of_the_person_in_view_longest(rigged):
    _, _, send, sent = rigged
    for n in range(3):
        send(90, 40_000 * n, n)
    raw = Keypoints(np.zeros(1, int), np.zeros(1), tuple(LANDMARK_JOINTS), UV[None], CONFIDENCE[None])
    tracks = next(message for channel, message in reversed(sent) if channel == "GAIT_TRACKS_3").tracks
    assert [t.name for t in tracks] == list(LANDMARK_JOINTS)
    found = profile.corrected(raw, "full")
    np.testing.assert_allclose([(t.u, t.v) for t in tracks], found.uv[0], atol=1e-3)
    np.testing.assert_allclose([t.confidence for t in tracks], CONFIDENCE, atol=1e-6)
    # Errors as in gait track and gait lift, which read the same keypoints from a film.
    np.testing.assert_allclose([t.sd for t in tracks], keypoint_noise(found)[0].sd, rtol=1e-6)
    np.testing.assert_allclose([t.lasting_sd for t in tracks], found.lasting_sd[0], rtol=1e-6)
    of_joint = [profile.load("full").joint(name).correlation_s for name in LANDMARK_JOINTS]
    np.testing.assert_allclose([t.correlation for t in tracks], of_joint, rtol=1e-6)


def test_the_tracker_uses_the_joints_of_every_second_frame(tmp_path, monkeypatch, fetched):
    """A simulated walk through the networks, and both streams through gait-trackd."""
    clip = tmp_path / "clip"
    assert cli.main(["simulate", "-o", str(clip), "--frames", "8", "--size", "480x360", "--quiet"]) == 0
    video = Video(clip / "video.mp4")
    start = Start.read(str(clip / "init.json"), rig.model())
    log = [
        ("GAIT_CAMERA_0", camera_message(Camera.read(str(clip / "camera.json"), video.size), rig.utime(0))),
        ("GAIT_BACKGROUND_0", image_message(cv2.imread(str(clip / "background.png")), rig.utime(0), -1)),
        ("GAIT_COMMAND", command_message(gaitmsg.command_t.START, rig.utime(0), start.mean, start.sd)),
    ]

    class Link:
        """Copies what is published into the log."""

        def subscribe(self, channel, handler):
            self.handler = handler
            return self

        def set_queue_capacity(self, count):
            pass

        def publish(self, channel, data):
            log.append((channel, data))

    link = Link()
    monkeypatch.setattr(detect, "open_lcm", lambda url: link)
    live = detect.LiveDetector(private_url(), 0, "lite", 8)
    for frame in video.frames():
        message = image_message(frame.image, rig.utime(frame.number), frame.number)
        log.append(("GAIT_IMAGE_0", message))
        if frame.number % 2 == 0:
            link.handler("GAIT_IMAGE_0", message.encode())
    assert live.found == live.frames == 4
    written = rig.write_log(tmp_path / "a.log", log)
    with_joints, alone = rig.play(written, "--keypoints-term"), rig.play(written)
    assert re.search(r"keypoint_messages 4 keypoints_used 4 keypoints_late 0", with_joints.printed)
    assert with_joints.frames == alone.frames == 8 and with_joints.digest != alone.digest


def test_a_log_cannot_be_answered(tmp_path):
    with pytest.raises(UserError, match="needs a network, not a log"):
        detect.LiveDetector(f"file://{tmp_path}/x.log", 0, "full", 8)


def test_options_of_a_file_do_not_go_with_it():
    done = rig.gait("detect", "--lcm", "walk.mp4")
    assert done.returncode == 2 and "--lcm takes no VIDEO" in done.stderr
    done = rig.gait("detect", "walk.mp4", "-o", "k.csv", "--stream", 1)
    assert done.returncode == 2 and "go with --lcm" in done.stderr
