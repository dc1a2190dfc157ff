"""gait-trackd --lift: 2-D tracks from a log give 3-D joints, the same as from the library."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import lcm_rig as rig
import numpy as np
import pytest
from toy_segments import toy_blob, toy_prior

from gait.bindings.abi import LiftFlag, TrackStatus
from gait.bindings.lifter import LiftConfig, Lifter
from gait.camera.camera import Camera
from gait.lcm.link import gaitmsg, private_url
from gait.lcm.messages import camera_message, tracks_message

CAMERA = Camera.looking([0.0, -6.0, 1.4], [0.0, 0.0, 1.0], (640, 480), 700.0)
NAMES_SHOWN, FRAMES, LAG, SD = 15, 45, 4, 2.0
GROWTH_KB = 225  # of 900 frames: 256 bytes of each message kept would be seen


@cache
def model() -> tuple[bytes, tuple[str, ...]]:
    """A prior in which a pose moves along x forever."""
    prior = toy_prior(10, 19, 8, seed=2)
    drift = 0.03 * np.arange(10)[None, :, None, None] * np.array([1.0, 0, 0])
    steady = np.repeat(prior.modes[:, :, :1], 10, axis=2)
    prior = replace(prior, mean=prior.mean[:, :1] + drift, modes=steady, residual=prior.residual * 0.1)
    return toy_blob(prior), prior.names


def camera() -> Camera:
    """The camera as a message holds it, and as the daemon reads that: in float."""
    return replace(
        CAMERA, R=CAMERA.R.astype(np.float32).astype(float), t=CAMERA.t.astype(np.float32).astype(float)
    )


def observations() -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Capture time, uv and confidence of every frame."""
    rng = np.random.default_rng(8)
    prior = toy_prior(10, 19, 8, seed=2)
    found = []
    for i in range(FRAMES):
        points = 1.7 * prior.mean[0, 0] + np.array([1.02 * (i / rig.FPS - 0.7), 0, 0])
        uv = CAMERA.project(points)[:NAMES_SHOWN] + rng.normal(size=(NAMES_SHOWN, 2)) * SD
        uv[rng.random(NAMES_SHOWN) < 0.15] = np.nan
        found.append((rig.utime(i), uv, rng.uniform(0.4, 1.0, NAMES_SHOWN)))
    return found


def errors() -> np.ndarray:
    """Errors that a detector states: all and lasting, pixels, and correlation, seconds."""
    return np.random.default_rng(9).uniform([2, 1, 0], [3, 1.5, 0.1], (NAMES_SHOWN, 3)).astype(np.float32)


def independent_sd(since: float) -> np.ndarray:
    """Standard deviations of `errors`, `since` seconds after the frame before; 0: the first frame."""
    sd, lasting, correlation = errors().astype(float).T
    if not since:
        return sd
    return np.sqrt(lasting * lasting + np.maximum(correlation / since, 1.0) * (sd * sd - lasting * lasting))


def events(start: int = 0, stated: bool = False) -> list[rig.Event]:
    names = model()[1][:NAMES_SHOWN]
    known = errors() if stated else None
    tracks = [
        ("GAIT_TRACKS_0", tracks_message(names, uv, utime, 100 + i, confidence, errors=known))
        for i, (utime, uv, confidence) in enumerate(observations())
    ]
    return [("GAIT_CAMERA_0", camera_message(CAMERA, rig.utime(0))), *tracks[start:]]


def lift(tmp_path: Path, happenings: list[rig.Event], *options: object) -> tuple[rig.Outcome, list]:
    blob = tmp_path / "lift.gait"
    blob.write_bytes(model()[0])
    log = rig.write_log(tmp_path / "a.log", happenings)
    outcome = rig.play(log, "--lift", "--lift-model", blob, "--lift-lag", LAG, "--lift-sd", SD, *options)
    return outcome, rig.read_log(log.with_suffix(".out"), "GAIT_LIFT", gaitmsg.estimate_t)


@pytest.mark.parametrize("stated", [False, True], ids=["by confidence", "stated errors"])
def test_joints_are_those_of_the_library(tmp_path: Path, stated: bool) -> None:
    outcome, lifted = lift(tmp_path, events(stated=stated))
    lifter = Lifter(model()[0], camera(), LiftConfig.default(lag=LAG, sd=SD))
    assert len(lifted) == FRAMES - LAG
    assert f"lift_frames {FRAMES} lifted {FRAMES - LAG} lift_rejected 0" in outcome.printed
    tracking = waiting = 0
    messages = iter(lifted)
    for i, (utime, uv, confidence) in enumerate(observations()):
        pixels, sd = np.full((19, 2), np.nan), np.full(19, np.inf)
        pixels[:NAMES_SHOWN] = uv.astype(np.float32)
        sd[:NAMES_SHOWN] = SD / confidence.astype(np.float32).astype(float)
        if stated:
            sd[:NAMES_SHOWN] = independent_sd(1e-6 * (rig.utime(i) - rig.utime(i - 1)) if i else 0.0)
        lifter.push(utime, pixels, sd)
        want = lifter.estimate()
        assert (want is None) == (i < LAG)
        if want is None:
            continue
        got = next(messages)
        assert (got.utime, got.frame, got.status) == (rig.utime(i - LAG), 100 + i - LAG, want.status)
        if want.status == got.INIT:
            waiting += 1
            assert got.njoints == 0 and not got.joints
            continue
        assert tuple(j.name for j in got.joints) == lifter.names
        np.testing.assert_array_equal([j.position for j in got.joints], want.markers.astype(np.float32))
        np.testing.assert_array_equal([j.sd for j in got.joints], want.sd.astype(np.float32))
        tracking += got.status == got.TRACKING
    assert tracking > FRAMES - 20 and waiting > 0


def test_the_lifter_alone_costs_the_tracker_nothing(tmp_path: Path) -> None:
    """With frames and tracks in one log, the tracker's digest is the same as without the tracks."""
    film = [*rig.opening(), *rig.frames(0, 6)]
    plain = rig.play(rig.write_log(tmp_path / "b.log", film))
    names = model()[1][:NAMES_SHOWN]
    tracks = [("GAIT_TRACKS_0", tracks_message(names, uv, t)) for t, uv, _ in observations()[:6]]
    both, lifted = lift(tmp_path, [*film, *tracks])
    assert both.digest == plain.digest and both.frames == 6
    assert len(lifted) == 6 - LAG


def test_memory_does_not_grow_with_the_stream(tmp_path: Path) -> None:
    """Resident memory: once every segment has been used, 900 further frames add nothing."""
    rig.need_multicast()
    blob = tmp_path / "lift.gait"
    blob.write_bytes(model()[0])
    shown, names, peaks = observations(), model()[1][:NAMES_SHOWN], []
    with rig.daemon(private_url(), "--lift", "--lift-model", blob, "--lift-lag", LAG) as (listener, finish):
        listener.ask(events()[:1], lambda s: s.state != s.WAITING, "the camera")
        for first, stop in ((0, 100), (100, 1000)):
            for i in range(first, stop):
                _, uv, confidence = shown[i % FRAMES]
                listener.send([("GAIT_TRACKS_0", tracks_message(names, uv, rig.utime(i), i, confidence))])
                listener.until(lambda i=i: len(listener.lifted) > i - LAG, f"frame {i} lifted")
            peaks.append(rig.peak_kb(listener.pid))
        outcome = finish()
    assert "lift_frames 1000 " in outcome.printed
    assert peaks[1] - peaks[0] < GROWTH_KB, f"{peaks} kB after 100 and 1,000 frames"


def damaged() -> list[tuple[str, bytes, str]]:
    good = events()[3][1].encode()
    count = struct.calcsize(">qqq")
    return [
        ("cut", good[:-5], "shorter"),
        ("empty", b"", "another type"),
        ("other", camera_message(CAMERA, 1).encode(), "another type"),
        ("count", good[:count] + struct.pack(">i", 1 << 30) + good[count + 4 :], "shorter"),
        ("negative", good[:count] + struct.pack(">i", -2) + good[count + 4 :], "shorter"),
        ("name", good[: count + 4] + struct.pack(">i", -9) + good[count + 8 :], "shorter"),
    ]


@pytest.mark.parametrize(("name", "data", "words"), damaged(), ids=lambda x: x if isinstance(x, str) else "")
def test_damaged_tracks_are_named_and_passed_over(tmp_path: Path, name: str, data: bytes, words: str) -> None:
    happenings = events()
    happenings[5] = ("GAIT_TRACKS_0", data)
    outcome, lifted = lift(tmp_path, happenings)
    assert words in outcome.words and "GAIT_TRACKS_0" in outcome.words
    assert len(lifted) == FRAMES - 1 - LAG


def test_tracks_out_of_order_or_of_strangers_are_named(tmp_path: Path) -> None:
    happenings = events()
    happenings[20:20] = happenings[10:14]
    outcome, lifted = lift(tmp_path, happenings)
    assert outcome.words.count("keypoints: capture time did not advance") == 1
    assert "lift_rejected 4" in outcome.printed and len(lifted) == FRAMES - LAG
    happenings = events()
    happenings.insert(20, ("GAIT_TRACKS_0", tracks_message(["tail"], [[1.0, 2.0]], rig.utime(3))))
    outcome, _ = lift(tmp_path, happenings)
    assert "the model knows none of these keypoints" in outcome.words


def test_one_stamp_far_ahead_does_not_end_the_lift(tmp_path: Path) -> None:
    """It starts again with the next tracks; before, all of them were rejected until a restart."""
    happenings, names = events(), model()[1][:NAMES_SHOWN]
    ahead = tracks_message(names, observations()[9][1], rig.utime(9) + 3_600_000_000, 7777)
    happenings[10:11] = [("GAIT_TRACKS_0", ahead)]
    outcome, lifted = lift(tmp_path, happenings)
    assert "lift_rejected 0" in outcome.printed
    assert outcome.words.count("keypoints: capture time went back by") == 1
    assert [m.frame for m in lifted[-(FRAMES - 10 - LAG) :]] == list(range(110, 100 + FRAMES - LAG))
    assert lifted[-1].status == lifted[-1].TRACKING


def test_who_is_suddenly_elsewhere_is_ambiguous(tmp_path: Path) -> None:
    """While the library reports that the observations did not fit and were searched anew."""
    blob, names = model()
    lifter = Lifter(blob, camera(), LiftConfig.default(lag=LAG, sd=SD))
    happenings, want = events()[:1], []
    for i, (utime, uv, _) in enumerate(observations()):
        uv = (uv + (0 if i < 22 else 60)).astype(np.float32)
        happenings.append(("GAIT_TRACKS_0", tracks_message(names[:NAMES_SHOWN], uv, utime, i)))
        pixels = np.full((19, 2), np.nan)
        pixels[:NAMES_SHOWN] = uv
        lifter.push(utime, pixels)
        now = lifter.estimate()
        if now is not None:
            want.append(TrackStatus.AMBIGUOUS if now.flags & LiftFlag.POOR_FIT else now.status)
    _, lifted = lift(tmp_path, happenings)
    assert [m.status for m in lifted] == want and want.count(TrackStatus.AMBIGUOUS) > 3
    assert want[-1] == TrackStatus.TRACKING


def test_what_is_published_of_an_absurd_camera_is_finite(tmp_path: Path) -> None:
    far = Camera.looking([0.0, -9e3, 2.0], [0.0, 0.0, 0.9], (640, 480), 1e6)
    outcome, lifted = lift(tmp_path, [("GAIT_CAMERA_0", camera_message(far, rig.utime(0))), *events()[1:]])
    assert all(np.isfinite([[*j.position, *j.sd] for j in m.joints]).all() for m in lifted)
    assert f"lift_frames {FRAMES} lifted {len(lifted)} " in outcome.printed


def spoilt(message: Any) -> Any:
    """Points that cannot be used: an unknown one, a duplicate, three invalid confidences."""
    names = model()[1]
    message.tracks += [point("nose", 0.9), point(message.tracks[0].name, 0.9)]
    message.tracks += [point(names[NAMES_SHOWN + k], c) for k, c in enumerate((1.5, -0.5, math.nan))]
    message.ntracks = len(message.tracks)
    return message


def point(name: str, confidence: float) -> Any:
    track = gaitmsg.track_t()
    track.name, track.u, track.v, track.confidence = name, 5.0, 5.0, confidence
    return track


def test_points_of_no_use_are_left_out_counted_and_reported_once(tmp_path: Path) -> None:
    _, clean = lift(tmp_path, events())
    first, *tracks = events()
    outcome, lifted = lift(tmp_path, [first, *((channel, spoilt(m)) for channel, m in tracks)])
    assert f" lift_keypoints_left_out {5 * FRAMES} " in outcome.printed
    assert "lift_rejected 0 lift_keypoints" in outcome.printed
    assert [outcome.words.count(w) for w in ("not know it", "names it twice", "not from 0 to 1")] == [1, 1, 1]
    assert "'nose'" in outcome.words
    for a, b in zip(clean, lifted, strict=True):
        assert [j.position for j in a.joints] == [j.position for j in b.joints]


def test_a_model_without_the_prior_is_refused_with_the_remedy(tmp_path: Path) -> None:
    prior_less = tmp_path / "cyclic.gait"
    prior_less.write_bytes(_cyclic_only())
    outcome = rig.run(
        "-m", rig.MODEL, "--lift", "--lift-model", prior_less, "--url", "file:///dev/null?speed=0"
    )
    assert outcome.code == 1
    assert "--lift" in outcome.words and "gait learn" in outcome.words


def _cyclic_only() -> bytes:
    from gait.io import blob

    sections = blob.decode(rig.MODEL.read_bytes(), "walk.gait")
    return blob.encode({k: v for k, v in sections.items() if not k.startswith("SG")})
