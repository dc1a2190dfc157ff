"""gait-trackd on LCM logs: nothing is lost, everything is repeatable, no message does harm."""

import json
import struct

import lcm_rig as rig
import numpy as np
import pytest

from gait.errors import UserError
from gait.lcm.link import gaitmsg, open_lcm
from gait.lcm.messages import camera_message, command_message, image_message

STOP, RESET = gaitmsg.command_t.STOP, gaitmsg.command_t.RESET


def tracked(outcome):
    return [m.frame for m in outcome.estimates]


def track(tmp_path, events, *options):
    return rig.play(rig.write_log(tmp_path / "a.log", events), *options)


def test_same_log_same_digest_on_any_number_of_threads(tmp_path):
    log = rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, 12)])
    first = rig.play(log)
    assert (first.frames, first.dropped, first.rejected) == (12, 0, 0)
    assert tracked(first) == list(range(12))
    assert f"{first.estimates[-1].tracker_digest & (1 << 64) - 1:016x}" == first.digest
    for options in ((), ("--threads", 2), ("--threads", 7, "--tasks", 16)):
        assert rig.play(log, *options).digest == first.digest, options
    assert rig.play(log, "--seed", 2).digest != first.digest


def test_every_pixel_counts(tmp_path):
    events = [*rig.opening(), *rig.frames(0, 4)]
    before = track(tmp_path, events)
    events[-1] = ("GAIT_IMAGE_0", rig.frame_message(3, data=events[-2][1].data))
    assert track(tmp_path, events).digest != before.digest


def test_grey_rgb_bgr_and_padded_rows_are_read_alike(tmp_path):
    def variant(change):
        events = [*rig.opening(), *rig.frames(0, 3)]
        for channel, message in events:
            if channel in ("GAIT_IMAGE_0", "GAIT_BACKGROUND_0"):
                change(message)
        return track(tmp_path, events)

    def to_rgb(m):
        m.data = np.frombuffer(m.data, np.uint8).reshape(-1, 3)[:, ::-1].tobytes()
        m.pixelformat = m.PIXEL_FORMAT_RGB

    def to_padded(m):
        rows = np.frombuffer(m.data, np.uint8).reshape(m.height, -1)
        m.data = np.pad(rows, ((0, 0), (0, 7)), constant_values=9).tobytes()
        m.row_stride, m.size = m.row_stride + 7, len(m.data)

    plain = variant(lambda m: None)
    assert plain.frames == 3
    assert variant(to_rgb).digest == variant(to_padded).digest == plain.digest
    grey = [("GAIT_IMAGE_0", image_message(rig.picture(i)[..., 1], rig.utime(i), i)) for i in range(3)]
    assert track(tmp_path, [*rig.opening(), *grey]).frames == 3


def test_jpeg_frames_are_decoded_or_named(tmp_path):
    jpegs = [("GAIT_IMAGE_0", image_message(rig.picture(i), rig.utime(i), i, jpeg=95)) for i in range(3)]
    outcome = track(tmp_path, [*rig.opening(), *jpegs])
    if rig.run("--version").printed.endswith("jpeg no\n"):
        assert (outcome.frames, outcome.rejected) == (0, 3)
        assert outcome.words.count("without libjpeg") == 1, "one line per stream, not per frame"
        return
    assert (outcome.frames, outcome.rejected) == (3, 0)
    damaged = jpegs[1][1]
    damaged.data = damaged.data[: damaged.size // 2]
    damaged.size = len(damaged.data)
    outcome = track(tmp_path, [*rig.opening(), *jpegs])
    assert (outcome.frames, outcome.rejected) == (2, 1) and "JPEG" in outcome.words


def damaged_images():
    good = rig.frame_message(1).encode()
    header = struct.Struct(">qqiiiii")  # fingerprint, utime, width, height, row_stride, pixelformat, size
    fields = list(header.unpack_from(good))

    def altered(index, value):
        changed = fields.copy()
        changed[index] = value
        return header.pack(*changed) + good[header.size :]

    rest = good[header.size :]
    metadata = rest[fields[6] :]
    assert struct.unpack(">i", metadata[:4]) == (1,)
    yield "truncated", good[:1000]
    yield "empty", b""
    yield "header only", good[: header.size]
    yield "another type", camera_message(rig.CAMERA, 1).encode()
    yield "size negative", altered(6, -1)
    yield "size most negative", altered(6, -(1 << 31))
    yield "size huge", altered(6, (1 << 31) - 1)
    yield "stride negative", altered(4, -480)
    yield "stride huge", altered(4, 1 << 30)
    yield "width", altered(2, 161)
    yield "height zero", altered(3, 0)
    yield "height negative", altered(3, -120)
    yield "format", altered(5, 1)
    yield "metadata huge", good[: -len(metadata)] + struct.pack(">i", 1 << 30) + metadata[4:]
    yield "key length", good[: -len(metadata)] + struct.pack(">ii", 1, -5) + metadata[8:]
    yield (
        "value length",
        good[: -len(metadata)] + struct.pack(">ii", 1, 6) + b"frame\0" + struct.pack(">i", 1 << 30),
    )


@pytest.mark.parametrize("channel", ["GAIT_IMAGE_0", "GAIT_BACKGROUND_0"])
@pytest.mark.parametrize(
    ("name", "data"), list(damaged_images()), ids=lambda x: x if isinstance(x, str) else ""
)
def test_damaged_images_are_counted_and_passed_over(tmp_path, name, data, channel):
    frames = rig.frames(0, 4)
    outcome = track(tmp_path, [*rig.opening(), frames[0], (channel, data), *frames[2:]])
    assert (outcome.frames, outcome.rejected) == (3, 1), outcome.words
    assert tracked(outcome) == [0, 2, 3]
    expected = 0 if channel == "GAIT_BACKGROUND_0" else 1
    assert outcome.words.count("\n") == 2, f"one line about it: {outcome.words!r}"
    assert outcome.dropped in (expected, 1)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"row_stride": 479}, "row_stride 479 for 160 pixels of BGR; send at least 480"),
        (
            {"row_stride": 160, "pixelformat": gaitmsg.image_t.PIXEL_FORMAT_RGB},
            "row_stride 160 for 160 pixels of RGB; send at least 480",
        ),
        ({"row_stride": 490}, "size 57600 for an image of 120 rows of 490 bytes; send all of them"),
    ],
)
def test_rows_that_are_too_short_are_reported_with_the_least(tmp_path, change, words):
    events = [*rig.opening(), *rig.frames(0, 2), ("GAIT_IMAGE_0", rig.frame_message(2, **change))]
    assert words in track(tmp_path, events).words


@pytest.mark.parametrize("channel", ["GAIT_CAMERA_0", "GAIT_COMMAND"])
@pytest.mark.parametrize("cut", [0, 7, 8, 20, 60])
def test_damaged_cameras_and_commands_are_passed_over(tmp_path, channel, cut):
    message = camera_message(rig.CAMERA, 1) if channel == "GAIT_CAMERA_0" else rig.start(0)
    events = [(channel, message.encode()[:cut]), *rig.opening(), *rig.frames(0, 2)]
    outcome = track(tmp_path, events)
    assert outcome.frames == 2 and f"{channel}: damaged" in outcome.words


def test_a_wrong_camera_message_is_named(tmp_path):
    for change, words in (
        ({"fx": 0.0}, "focal"),
        ({"R": [0.0] * 9}, "not a rotation"),
        ({"width": 16001}, "camera with a size of 16001x120; send 1 to 16000"),
    ):
        message = camera_message(rig.CAMERA, 1)
        for name, value in change.items():
            setattr(message, name, value)
        outcome = track(tmp_path, [("GAIT_CAMERA_0", message), *rig.opening(), *rig.frames(0, 2)])
        assert words in outcome.words and outcome.frames == 2


def test_another_camera_during_the_run_is_refused(tmp_path):
    other = camera_message(rig.CAMERA, 1)
    other.fx += 5
    events = [*rig.opening(), *rig.frames(0, 2), ("GAIT_CAMERA_0", other), *rig.frames(2, 4)]
    plain = track(tmp_path, [*rig.opening(), *rig.frames(0, 4)])
    outcome = track(tmp_path, events)
    assert "a different camera" in outcome.words and outcome.digest == plain.digest


def wrong_camera():
    """Half the size of the camera of the frames."""
    return camera_message(rig.CAMERA.scaled(0.5), 1)


def announced(tmp_path, seconds, *options):
    """A wrong camera first, then for that long the right one repeatedly, then the stream."""
    right = [
        ("GAIT_CAMERA_0", camera_message(rig.CAMERA, 1_000_000 + 2_000_000 * k))
        for k in range(seconds // 2 + 1)
    ]
    events = [("GAIT_CAMERA_0", wrong_camera()), *right, *rig.opening()[1:], *rig.frames(0, 4)]
    log = rig.write_log(tmp_path / "a.log", events)
    return rig.play(log, "--init", "auto", *options)


def test_a_camera_announced_alone_for_ten_seconds_replaces_the_first(tmp_path):
    plain = track(tmp_path, [*rig.opening(), *rig.frames(0, 4)], "--init", "auto")
    replaced = announced(tmp_path, 10)
    assert replaced.digest == plain.digest and replaced.frames == 4
    assert "camera 80x60" in replaced.words and "camera 160x120" in replaced.words
    early = announced(tmp_path, 8)
    assert early.frames == 0 and "after 10 seconds in which only it is announced" in early.words


def test_a_camera_of_a_file_is_not_replaced(tmp_path):
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(rig.CAMERA.scaled(0.5).to_dict()))
    outcome = announced(tmp_path, 20, "--camera", file)
    assert outcome.frames == 0 and "that of --camera was announced; it is ignored" in outcome.words


def test_a_camera_with_too_many_pixels_is_refused_before_it_takes_memory(tmp_path):
    huge = camera_message(rig.CAMERA, 1)
    huge.width = huge.height = 16000
    plain = track(tmp_path, [*rig.opening(), *rig.frames(0, 2)])
    outcome = track(tmp_path, [("GAIT_CAMERA_0", huge), *rig.opening(), *rig.frames(0, 2)])
    assert "16000x16000 pixels, more than the 8388608 that --max-pixels leaves" in outcome.words
    assert outcome.digest == plain.digest
    small = track(tmp_path, [*rig.opening(), *rig.frames(0, 2)], "--max-pixels", 160 * 120 - 1)
    assert "160x120 pixels, more than the 19199 that --max-pixels leaves" in small.words and small.frames == 0


def test_a_frame_number_far_away_begins_another_count(tmp_path):
    numbers = [0, 1, 2**63 - 1, 104, 105, 108, 109]
    events = [
        ("GAIT_IMAGE_0", image_message(rig.picture(i), rig.utime(i), number))
        for i, number in enumerate(numbers)
    ]
    outcome = track(tmp_path, [*rig.opening(), *events])
    assert outcome.dropped == 2  # 106 and 107


@pytest.mark.parametrize("time", [-(2**63), -1, 2**63 - 1])
def test_a_time_that_is_none_stops_nothing(time, tmp_path):
    start = rig.start(0)
    start.utime = time
    strangers = [
        ("GAIT_IMAGE_0", image_message(rig.picture(1), time, 1)),
        ("GAIT_COMMAND", start),
    ]
    plain = track(tmp_path, [*rig.opening(), *rig.frames(0, 4)])
    outcome = track(tmp_path, [*rig.opening(), *rig.frames(0, 2), *strangers, *rig.frames(2, 4)])
    for channel in ("GAIT_IMAGE_0", "GAIT_COMMAND"):
        assert f"{channel}: time {time} is out of range; send microseconds since 1970" in outcome.words
    assert (outcome.digest, outcome.rejected) == (plain.digest, 1)


def test_a_camera_that_differs_by_rounding_is_the_same(tmp_path):
    again = camera_message(rig.CAMERA, 1)
    again.R = [x + 3e-8 for x in again.R]
    outcome = track(
        tmp_path, [*rig.opening(), *rig.frames(0, 2), ("GAIT_CAMERA_0", again), *rig.frames(2, 4)]
    )
    assert "another camera" not in outcome.words and outcome.frames == 4


def test_a_repeated_announcement_changes_nothing(tmp_path):
    opening = rig.opening()
    plain = track(tmp_path, [*opening, *rig.frames(0, 4)])
    repeated = track(tmp_path, [*opening, *rig.frames(0, 2), *opening, *rig.frames(2, 4)])
    assert repeated.digest == plain.digest and repeated.rejected == 0


def test_the_empty_scene_matters(tmp_path):
    opening = rig.opening()
    with_plate = track(tmp_path, [*opening, *rig.frames(0, 4)])
    without = track(tmp_path, [opening[0], opening[2], *rig.frames(0, 4)])
    assert without.frames == with_plate.frames == 4 and without.digest != with_plate.digest


def test_stop_ends_and_a_new_start_begins_anew(tmp_path):
    stop = ("GAIT_COMMAND", command_message(STOP))
    again = ("GAIT_COMMAND", rig.start(6))
    events = [*rig.opening(), *rig.frames(0, 3), stop, *rig.frames(3, 6), again, *rig.frames(6, 9)]
    outcome = track(tmp_path, events)
    assert tracked(outcome) == [0, 1, 2, 6, 7, 8]
    assert [m.step for m in outcome.estimates] == [0, 1, 2, 0, 1, 2]
    fresh = track(tmp_path, [*rig.opening()[:2], again, *rig.frames(6, 9)])
    assert fresh.digest == outcome.digest, "nothing of the first walk is left"
    assert outcome.frames == 6 and fresh.frames == 3


def test_a_command_sent_again_is_carried_out_once(tmp_path):
    start = rig.opening()[2]
    once = track(tmp_path, [*rig.opening()[:2], start, *rig.frames(0, 5)])
    twice = track(tmp_path, [*rig.opening()[:2], start, start, *rig.frames(0, 2), start, *rig.frames(2, 5)])
    assert tracked(twice) == tracked(once) and twice.digest == once.digest


def test_reset_forgets_the_person_and_the_counts(tmp_path):
    reset = ("GAIT_COMMAND", command_message(RESET))
    outcome = track(tmp_path, [*rig.opening(), *rig.frames(0, 4), reset, *rig.frames(4, 8)])
    assert tracked(outcome) == [0, 1, 2, 3] and (outcome.frames, outcome.dropped) == (0, 0)


def test_an_unknown_command_is_named(tmp_path):
    outcome = track(tmp_path, [*rig.opening(), ("GAIT_COMMAND", command_message(77)), *rig.frames(0, 2)])
    assert "unknown command 77" in outcome.words and outcome.frames == 2


def test_lost_frames_are_counted_by_their_numbers(tmp_path):
    frames = rig.frames(0, 10)
    outcome = track(tmp_path, [*rig.opening(), *frames[:3], *frames[5:6], *frames[8:]])
    assert (outcome.frames, outcome.dropped) == (6, 4)
    assert [m.dropped for m in outcome.estimates] == [0, 0, 0, 2, 4, 4]


def test_repeats_are_not_dropped_frames(tmp_path):
    """`dropped` counts frames that were never tracked: by number and time, by time alone, by number alone."""
    twice = [event for event in rig.frames(0, 8) for _ in range(2)]
    plain = [("GAIT_IMAGE_0", rig.frame_message(i // 2, metadata=[], nmetadata=0)) for i in range(16)]
    late = [("GAIT_IMAGE_0", rig.frame_message(i // 2, utime=rig.utime(i))) for i in range(16)]
    for frames, count in ((twice, 8), (plain, 8), (late, 16)):
        outcome = track(tmp_path, [*rig.opening(), *frames])
        assert (outcome.frames, outcome.dropped) == (count, 0)
        assert not any(m.dropped for m in outcome.estimates)


def test_a_frame_sent_again_because_it_was_damaged_is_not_dropped(tmp_path):
    frames, bad = rig.frames(0, 6), ("GAIT_IMAGE_0", rig.frame_message(3, width=8))
    outcome = track(tmp_path, [*rig.opening(), *frames[:3], bad, bad, *frames[3:]])
    assert [m.dropped for m in outcome.estimates] == [0] * 6 and outcome.dropped == 0
    outcome = track(tmp_path, [*rig.opening(), *frames[:3], bad, bad, *frames[4:]])
    assert [m.dropped for m in outcome.estimates] == [0, 0, 0, 1, 1]


def test_a_frame_that_comes_after_a_later_one_is_dropped_once(tmp_path):
    frames = rig.frames(0, 6)
    outcome = track(tmp_path, [*rig.opening(), *frames[:2], frames[3], frames[2], *frames[4:]])
    assert tracked(outcome) == [0, 1, 3, 4, 5] and [m.dropped for m in outcome.estimates] == [0, 0, 1, 1, 1]


def test_frames_of_a_source_that_does_not_count(tmp_path):
    """A bot_core publisher sends no frame numbers: nothing counts as lost, and estimates have number -1."""
    events = [("GAIT_IMAGE_0", rig.frame_message(i, metadata=[], nmetadata=0)) for i in range(4)]
    outcome = track(tmp_path, [*rig.opening(), *events])
    assert tracked(outcome) == [-1] * 4 and outcome.dropped == 0


def test_time_that_runs_backwards_is_refused_frame_by_frame(tmp_path):
    late = ("GAIT_IMAGE_0", rig.frame_message(3, utime=rig.utime(1)))
    frames = rig.frames(0, 6)
    outcome = track(tmp_path, [*rig.opening(), *frames[:3], late, frames[2], *frames[4:]])
    assert (outcome.frames, outcome.rejected) == (5, 2) and outcome.words.count("did not advance") == 1


def test_a_clock_set_back_a_little_is_waited_for_and_reported_once(tmp_path):
    back = [("GAIT_IMAGE_0", rig.frame_message(i, utime=rig.utime(i) - 300_000)) for i in range(6, 20)]
    outcome = track(tmp_path, [*rig.opening(), *rig.frames(0, 6), *back])
    assert tracked(outcome) == [*range(6), *range(15, 20)]
    assert outcome.rejected == 9 and outcome.words.count("did not advance") == 1


def test_a_clock_set_back_far_stops_the_tracker_which_reports_it_once(tmp_path):
    """As after a long pause, when every later frame was rejected forever, each with its own log line."""
    back = [("GAIT_IMAGE_0", rig.frame_message(i, utime=rig.utime(i) - 900_000)) for i in range(3, 9)]
    again = ("GAIT_COMMAND", rig.start(6, at=0))
    init = tmp_path / "i.json"
    init.write_text(json.dumps({"pelvis": rig.person(0).pelvis.tolist(), "phase": 0.1, "heading_rad": 0}))
    outcome = track(
        tmp_path,
        [*rig.opening()[:2], *rig.frames(0, 3), *back[:3], again, *back[3:]],
        *("--init", init, "--max-gap", 0.8),
    )
    assert tracked(outcome) == [0, 1, 2, 6, 7, 8] and outcome.rejected == 0
    assert outcome.words.count("went back by 0.867 s (at most 0.800): stopped; send START") == 1
    assert outcome.words.count("\n") == 2


def test_a_long_pause_stops_the_tracker_which_reports_it(tmp_path):
    pause = [("GAIT_IMAGE_0", rig.frame_message(i, utime=rig.utime(i) + 2_000_000)) for i in range(3, 6)]
    events = [*rig.opening(), *rig.frames(0, 3), *pause]
    outcome = track(tmp_path, events)
    assert outcome.frames == 3 and "no frame for 2.033 s (at most 2.000)" in outcome.words


def test_a_shorter_pause_is_bridged_by_prediction(tmp_path):
    """As the library does when it is stepped without an image in between."""
    from gait.bindings.config import TrackerConfig
    from gait.track.tracker import Tracker

    late = [rig.frame_message(i, utime=rig.utime(i) + 1_200_000) for i in range(3, 5)]
    events = [*rig.opening(), *rig.frames(0, 3), *(("GAIT_IMAGE_0", m) for m in late)]
    outcome = track(tmp_path, events)
    assert [m.step for m in outcome.estimates] == [0, 1, 2, 3, 4] and outcome.dropped == 0
    assert not any(m.flags & m.FLAG_NO_IMAGE for m in outcome.estimates)
    tracker = Tracker(
        rig.model(), rig.CAMERA, TrackerConfig.default(particles=rig.PARTICLES, lag=5), background=rig.plate()
    )
    tracker.start(rig.person(0), rig.SD, rig.utime(0))
    for i in range(3):
        tracker.step(rig.picture(i), rig.utime(i))
    gap = late[0].utime - rig.utime(2)
    for i in (1, 2):
        tracker.step(None, rig.utime(2) + gap * i // 3)
    for i, message in enumerate(late, 3):
        tracker.step(rig.picture(i), message.utime)
    assert outcome.digest == f"{tracker.digest():016x}"


def test_the_cloud_is_the_posterior(tmp_path):
    outcome = track(tmp_path, [*rig.opening(), *rig.frames(0, 3)], "--particles-channel")
    assert [p.n for p in outcome.particles] == [rig.PARTICLES] * 3
    for cloud, estimate in zip(outcome.particles, outcome.estimates, strict=True):
        weight = np.array(cloud.weight)
        assert (cloud.utime, cloud.frame) == (estimate.utime, estimate.frame)
        assert weight.min() >= 0 and weight.sum() == pytest.approx(1, abs=1e-5)
        best = cloud.state[int(weight.argmax())]
        assert best.encode() == estimate.best.encode()
        assert 1 / np.square(weight).sum() == pytest.approx(estimate.ess, rel=1e-3)


def test_reset_puts_the_init_file_in_force_again(tmp_path):
    init = tmp_path / "i.json"
    init.write_text(json.dumps({"pelvis": rig.person(0).pelvis.tolist(), "phase": 0.1, "heading_rad": 0}))
    reset = ("GAIT_COMMAND", command_message(RESET))
    outcome = track(
        tmp_path, [*rig.opening()[:2], *rig.frames(0, 3), reset, *rig.frames(3, 6)], "--init", init
    )
    assert [m.step for m in outcome.estimates] == [0, 1, 2, 0, 1, 2] and outcome.frames == 3


@pytest.mark.parametrize(
    "url, words",
    [
        ("file://{}/notes.txt", "notes.txt: is not an LCM log; make one with gait record"),
        ("file://{}/none.log", "none.log: no such LCM log; make one with gait record"),
        ("file://{}", "is a folder; give the LCM log itself"),
        ("udpm://10.0.0.1:7667", "10.0.0.1:7667: LCM needs a multicast address, .*; give udpm://239"),
        ("udpm://239.255.76.67", "needs a multicast address, .*, and a port; give udpm://239"),
        ("udpm://239.255.76.67:99999?ttl=0", "and a port; give udpm://239"),
    ],
)
def test_what_is_no_network_and_no_log_is_refused_with_what_works(url, words, tmp_path):
    (tmp_path / "notes.txt").write_text("of no messages\n")
    with pytest.raises(UserError, match=words):
        open_lcm(url.format(tmp_path))
