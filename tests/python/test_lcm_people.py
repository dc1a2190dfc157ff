"""gait-trackd --people and --person: a tracker for each person, distinguished by their keypoints."""

from dataclasses import replace
from functools import cache

import cv2
import lcm
import lcm_rig as rig
import numpy as np
import pytest

from gait.bindings.abi import TrackStatus
from gait.cli import main
from gait.io.track_file import read_track
from gait.lcm.detect import Numbers
from gait.lcm.link import gaitmsg, private_url
from gait.lcm.messages import camera_message, command_message, image_message, tracks_message
from gait.lcm.record import read_run
from gait.live.feed import Feed

FPS, WALK, BACK = 12, 42, 12 * 12  # frames: both walk, the second one is away, and comes back
AHEAD = {1: 0.0, 2: np.pi}
NEXT, LOST = TrackStatus.TRACKING, TrackStatus.LOST


def state(person, frame):
    """Two people who cross in the middle of the picture; None: out of view."""
    if frame >= WALK and (person == 1 or frame < BACK):
        return None
    time = frame / FPS if frame < WALK else (frame - BACK) / FPS
    heading = AHEAD[person] if frame < WALK else 0.0
    mean, _ = rig.model().prior()
    found = replace(mean, phase=(0.3 * person + time) % 1, stride_hz=1.0, stature=1.75, heading=heading)
    found.pelvis = np.array([(-2.0 + 1.2 * time) * np.cos(heading), 0.9 if person == 1 else -0.4, 0.0])
    found.pelvis[2] = rig.model().pelvis_height(found)
    return found


@cache
def picture(frame):
    image = rig.plate().copy()
    for person, seed in ((1, 2), (2, 3)):  # the second is nearer
        if (one := state(person, frame)) is not None:
            ids = rig.model().render(rig.CAMERA, one)
            colours = np.random.default_rng(seed).integers(0, 255, (256, 3), np.uint8)
            image = np.where(ids[..., None] > 0, colours[ids], image)
    return image


def time_of(frame):
    return 1_000_000 + round(frame * 1e6 / FPS)


def image(frame):
    return image_message(picture(frame), time_of(frame), frame)


def joints(person, frame):
    return rig.model().pose(state(person, frame))[0]


def played(path, *options):
    """Estimates of both people from a log, and what is printed."""
    out = path.with_suffix(".out")
    out.unlink(missing_ok=True)
    words = ["--url", f"file://{path}?speed=0", "--out", f"file://{out}?mode=w", "--keypoints-term"]
    outcome = rig.run(*rig.command(*words, "-n", 300, *options)[1:])
    found = {person: rig.read_log(out, f"GAIT_ESTIMATE_{person}", gaitmsg.estimate_t) for person in (1, 2)}
    return found, outcome.printed + outcome.words


@pytest.fixture(scope="module")
def streams(tmp_path_factory):
    """Estimates of both people, and the log that was played."""
    rng, names = np.random.default_rng(1), list(rig.model().joint_names)
    camera = camera_message(rig.CAMERA, 1)
    log = [("GAIT_CAMERA_0", camera), ("GAIT_BACKGROUND_0", image_message(rig.plate(), 1, -1))]
    for frame in range(BACK + WALK):
        at = time_of(frame)
        log.append(("GAIT_IMAGE_0", image(frame)))
        for person in (1, 2):
            if state(person, frame) is not None and (person == 2 or not 17 < frame < 24):  # hidden
                uv = rig.CAMERA.project(joints(person, frame)) + 0.5 * rng.normal(size=(len(names), 2))
                log.append((f"GAIT_TRACKS_0_{person}", tracks_message(names, uv, at, frame)))
            elif person == 1 and frame >= WALK:  # a detector may send that there is no one
                log.append(("GAIT_TRACKS_0_1", tracks_message([], np.zeros((0, 2)), at, frame)))
    path = rig.write_log(tmp_path_factory.mktemp("people") / "a.log", log)
    found, printed = played(path, "--people", 2)
    assert "person 1 found" in printed and "person 2 found" in printed
    return found, path


def off(person, estimate):
    """Mean distance of the joints from a person's, metres."""
    found = np.array([joint.position for joint in estimate.joints])
    return np.linalg.norm(found - joints(person, estimate.frame), axis=1).mean()


def test_people_who_cross_keep_their_trackers(streams):
    for person, other in ((1, 2), (2, 1)):
        walk = [e for e in streams[0][person] if e.frame < WALK]
        assert len(walk) > 0.6 * WALK and {e.status for e in walk[6:]} <= {1, 2}
        assert max(off(person, e) for e in walk[6:]) < 0.35
        assert min(off(other, e) for e in walk[6:] if abs(e.frame - 21) > 8) > 0.6


def test_people_together_are_tracked_the_same_on_every_run_and_one_hides_the_other(streams, tmp_path):
    """The nearer one covers foreground too: both trackers differ from those of daemons of their own."""
    events = [(e.channel, e.data) for e in lcm.EventLog(str(streams[1]), "r")]
    last = next(k for k, (_, data) in enumerate(events) if data == image(WALK).encode())
    path = rig.write_log(tmp_path / "walk.log", events[:last])
    again = played(path, "--people", 2, "--threads", 2)[0]
    for person in (1, 2):
        together = [e.tracker_digest for e in streams[0][person] if e.frame < WALK]
        assert [e.tracker_digest for e in again[person]] == together
        alone = played(path, "--person", person)[0]
        apart = [e.tracker_digest for e in alone[person]]
        assert not alone[3 - person] and apart[0] == together[0] and apart[-1] != together[-1]


@pytest.mark.parametrize("more", [["--lift"], ["--person", "1"], ["--further-streams", "1"]])
def test_what_is_for_one_person_is_refused_for_several(more):
    outcome = rig.run(*rig.command("--keypoints-term", "--people", 2, *more)[1:])
    assert outcome.code == 2 and "needs" in outcome.words and outcome.words.count("\n") == 1


def followed(listener, first, stop):
    """Send frames with everyone's joints, each after the estimates of the one before; the last estimates."""
    names = list(rig.model().joint_names)
    for frame in range(first, stop):
        uv = {person: rig.CAMERA.project(joints(person, frame)) for person in (1, 2)}
        sent = [(f"GAIT_TRACKS_0_{k}", tracks_message(names, uv[k], time_of(frame), frame)) for k in uv]
        listener.send([*sent, ("GAIT_IMAGE_0", image(frame))])
        for heard in (listener.estimates, listener.second):
            listener.until(lambda h=heard, f=frame: h and h[-1].frame == f, f"estimates of frame {frame}")
    return listener.estimates[-1], listener.second[-1]


def test_capture_waits_for_trackers_of_several_people_and_starts_one_of_them(tmp_path):
    rig.need_multicast()
    url, clip = private_url(), rig.write_clip(tmp_path, 12)
    scene = ["--camera", clip / "camera.json", "--background", clip / "background.png", "--url", url]
    words = ["capture", clip / "video.mp4", *scene, "--init", clip / "init.json", "--quiet"]
    with rig.daemon(url, "--keypoints-term", "--people", 2) as (listener, _):
        done = rig.gait(*words, "--wait", 3)
        assert done.returncode == 1 and "one of several people answers on GAIT_STATUS_" in done.stderr
        done = rig.gait(*words, "--wait", 3, "--person", 3)
        assert done.returncode == 1 and "answers on GAIT_STATUS_" in done.stderr
        assert "none on GAIT_STATUS_3" in done.stderr and "start gait-trackd" not in done.stderr
        done = rig.gait(*words, "--wait", rig.PATIENCE, "--person", 2)
        assert done.returncode == 0, done.stderr
        listener.until(lambda: bool(listener.second), "an estimate of person 2")
        assert not listener.estimates


def test_after_a_kill_everyone_is_followed_by_number_as_if_nothing_had_happened(tmp_path):
    """They meet in frame 21."""
    rig.need_multicast()
    begin, killed, end = 15, 20, 26
    scene = [("GAIT_CAMERA_0", camera_message(rig.CAMERA, 1)), ("GAIT_BACKGROUND_0", image(BACK - 1))]
    starts = [
        (
            f"GAIT_COMMAND_{k}",
            command_message(gaitmsg.command_t.START, time_of(begin), state(k, begin), rig.SD),
        )
        for k in (2, 1)
    ]
    last = {}
    for kill in (False, True):
        url, snapshot = private_url(), tmp_path / f"state-{kill}"
        words = ["--keypoints-term", "--people", 2, "--snapshot", snapshot, "--snapshot-s", 0.1]
        with rig.daemon(url, *words) as (listener, finish):
            listener.ask(scene, lambda s: s.background_mask, "camera and background")
            listener.ask(starts, lambda s: s.state == s.ARMED, "a start")
            last[kill] = followed(listener, begin, killed if kill else end)
            if not kill:
                continue
            rig.kill(listener)
        with rig.daemon(url, *words) as (listener, finish):
            listener.ask(scene[1:], lambda s: s.background_mask, "the background")
            last[kill] = followed(listener, killed, end)
            printed = finish().words
            assert all(f"person {k} of frame {killed - 1}, captured" in printed for k in (1, 2))
        words[2] = 1
        with rig.daemon(url, *words) as (_, finish):
            assert "person 2 is not used: --people is less" in finish().words
    for person, one, other in zip((1, 2), last[True], last[False], strict=True):
        assert one.tracker_digest == other.tracker_digest and one.step == other.step
        assert off(person, one) < 0.35


def test_a_pause_of_the_stream_is_no_absence(tmp_path):
    """After one, or after a kill, a frame may come before its keypoints: no one has left."""
    names, end, pause = list(rig.model().joint_names), 20, 18  # frames
    log = [("GAIT_CAMERA_0", camera_message(rig.CAMERA, 1)), ("GAIT_BACKGROUND_0", image(BACK - 1))]
    for frame in range(end):
        uv = rig.CAMERA.project(joints(2, frame))
        log.append(("GAIT_TRACKS_0_2", tracks_message(names, uv, time_of(frame), frame)))
        log.append(("GAIT_IMAGE_0", image(frame)))
    empty = [k for k in range(end, end + 44) if not end + 7 <= k < end + 7 + pause]
    nothing = [("GAIT_IMAGE_0", image_message(rig.plate(), time_of(k), k)) for k in empty]
    for seen, left in ((9, False), (len(nothing), True)):
        found, printed = played(rig.write_log(tmp_path / "a.log", log + nothing[:seen]), "--people", 2)
        assert found[2][-1].status == LOST and found[2][-1].frame >= empty[7]
        assert ("person 2 is out of view" in printed) == left


def test_a_person_who_comes_back_has_the_same_number(streams):
    """Away for 8.5 s, during which no person is tracked."""
    for person in (1, 2):
        gone = range(WALK + FPS // 2 + 1, 1000 if person == 1 else BACK)
        away = [e for e in streams[0][person] if e.frame in gone]
        assert {e.status for e in away} == {LOST} and max(e.frame for e in away) < WALK + 2 * FPS
    back = [e for e in streams[0][2] if e.frame >= BACK + 2 * FPS]
    assert len(back) >= FPS and NEXT in {e.status for e in back} and max(off(2, e) for e in back) < 0.35
    numbers = Numbers(2)
    assert [numbers.number(id, 0.0) for id in (7, 9, 7)] == [1, 2, 1]
    assert numbers.number(7, 9.0) == 1 and numbers.number(12, 9.5) is None  # 9 may come back
    assert numbers.number(9, 9.9) == 2 and numbers.number(12, 19.5) == 1  # 7 did not


def test_the_page_and_the_recorder_take_people_by_number(streams, tmp_path):
    found, path = streams
    both = tmp_path / "both.log"
    frames = [("GAIT_CAMERA_0", camera_message(rig.CAMERA, 1))]
    for frame in range(20, 24):
        frames.append(("GAIT_IMAGE_0", image(frame)))
        frames += [(f"GAIT_ESTIMATE_{k}", e) for k in found for e in found[k] if e.frame == frame]
    rig.write_log(both, frames)
    shown, heard = [], []
    feed = Feed(
        f"file://{both}?speed=0", [0], rig.model(), {}, lambda _, image: shown.append(image),
        lambda topic, value: heard.append((topic, value)), people=("1", "2"),
    )  # fmt: skip
    while feed.handle(0.1):
        pass
    samples = [(value["person"], value["frame"]) for topic, value in heard if topic == "sample"]
    assert sorted(samples) == [(k, frame) for k in (0, 1) for frame in range(20, 24)] and shown
    assert cv2.absdiff(shown[-1], picture(23)).max() > 0 and feed.damage is None
    track = tmp_path / "track.csv"
    assert main(["record", "-o", str(track), "--url", f"file://{both}?speed=0", "--person", "2"]) == 0
    assert read_track(track).frame.tolist() == [20, 21, 22, 23]
    assert track.read_text().splitlines()[1].endswith(",2")
    assert read_run(str(both), 2).frame.tolist() == [20, 21, 22, 23]
