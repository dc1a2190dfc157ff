"""gait detect --lcm: frames come in over LCM, and the joints found in them go out."""

import lcm_rig as rig
import numpy as np
import pytest

from gait.detect import profile
from gait.detect.networks import JOINTS, Crop, Person
from gait.detect.people import Followed
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.lcm import detect
from gait.lcm.link import gaitmsg, private_url
from gait.lcm.messages import image_message

UV = np.random.default_rng(1).uniform(100, 300, (len(JOINTS), 2))
CONFIDENCE = np.linspace(0.3, 1, len(JOINTS))


class FakePeople:
    """Finds in every frame brighter than 10 a passer-by and a person who was seen before."""

    def __init__(self, network, most):
        self.one, self.times = Followed(1), []

    def step(self, frame):
        assert frame.image.ndim == 3
        self.times.append(frame.time)
        if frame.image.mean() < 10:
            return []
        person = Person(1.0, UV, CONFIDENCE, Crop(np.array([200.0, 200.0]), 200.0, 0.0))
        self.one.frames.append(frame.number)
        self.one.times.append(frame.time)
        self.one.keypoints.append(person)
        passer_by = Followed(2, [frame.number], [frame.time], [person._replace(uv=UV + 50)])
        return [(passer_by, passer_by.keypoints[0]), (self.one, person)]


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
            sent.append((channel, gaitmsg.tracks_t.decode(data)))

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
    assert [(channel, m.utime, m.frame) for channel, m in sent] == [
        ("GAIT_TRACKS_3", 5_000_000, 40),
        ("GAIT_TRACKS_3", 5_080_000, -1),
        ("GAIT_TRACKS_3", 5_120_000, 43),
    ]
    assert (live.frames, live.found) == (4, 3)
    assert live._detector.times == pytest.approx([0, 0.04, 0.08, 0.12])


def test_joints_are_the_models_of_the_person_in_view_longest(rigged):
    _, _, send, sent = rigged
    for n in range(3):
        send(90, 40_000 * n, n)
    raw = Keypoints(np.zeros(1, int), np.zeros(1), tuple(JOINTS), UV[None], CONFIDENCE[None])
    tracks = sent[-1][1].tracks
    assert [t.name for t in tracks] == list(JOINTS)
    np.testing.assert_allclose([(t.u, t.v) for t in tracks], profile.corrected(raw, "full").uv[0], atol=1e-3)
    np.testing.assert_allclose([t.confidence for t in tracks], CONFIDENCE, atol=1e-6)


def test_a_log_cannot_be_answered(tmp_path):
    with pytest.raises(UserError, match="answers on a network, not in a log"):
        detect.LiveDetector(f"file://{tmp_path}/x.log", 0, "full", 8)


def test_options_of_a_file_do_not_go_with_it():
    done = rig.gait("detect", "--lcm", "walk.mp4")
    assert done.returncode == 2 and "--lcm takes no VIDEO" in done.stderr
    done = rig.gait("detect", "walk.mp4", "-o", "k.csv", "--stream", 1)
    assert done.returncode == 2 and "go with --lcm" in done.stderr
