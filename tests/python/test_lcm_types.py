"""Message types: frozen, and nothing is lost on the way."""

import subprocess
import sys
from pathlib import Path

import lcm_rig as rig
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gait.bindings.state import State
from gait.errors import UserError
from gait.lcm.link import gaitmsg
from gait.lcm.messages import (
    camera_message,
    camera_of,
    command_message,
    decode,
    estimate_of,
    image_message,
    picture,
    state_message,
    state_of,
)

# A published type is frozen: to change one, make another (estimate2_t) and leave this line alone.
FINGERPRINTS = {
    "angle_t": "70ec7fc36619a1e2",
    "camera_t": "be86d3ea284d3ddd",
    "classes_t": "cfd0566cd3864129",
    "command_t": "915eeb6f0356b2b8",
    "estimate_t": "15758dc69cf3c5a3",
    "image_metadata_t": "9a4b634d0577fb8e",
    "image_t": "14739ffe13d5f5f0",
    "joint_t": "fc582328f6d14f63",
    "particles_t": "80014263d1a51319",
    "state_t": "a5ac537a18c75c25",
    "stride_t": "2643e726b8fa972c",
    "status_t": "a0ea033100bad162",
    "track_t": "3bf4b97187897236",
    "tracks_t": "e04dceb9e672c2c6",
    "track2_t": "a63f4541a8505f8b",
    "tracks2_t": "b4e2e65a28009d71",
}


@pytest.mark.parametrize("name", FINGERPRINTS)
def test_published_types_are_frozen(name):
    assert getattr(gaitmsg, name)._get_packed_fingerprint().hex() == FINGERPRINTS[name]


def test_help_needs_no_generated_types():
    """In a fresh clone commands explain themselves, and name what is missing in one line when run."""
    code = """if True:
        import contextlib, io, pathlib, gait.lcm.link as types
        from gait.cli import main
        types._PLACES = (pathlib.Path("nowhere"),)
        for name in ("capture", "record", "view", "report", "demo"):
            with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()) as printed:
                main([name, "--help"])
            assert f"usage: gait {name}" in printed.getvalue()
        raise SystemExit(main(["record", "-o", "out.csv"]))
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    words = "gait record: gaitmsg: no generated LCM types in nowhere; run make tools\n"
    assert (done.returncode, done.stderr) == (1, words)


def test_every_type_is_listed():
    files = {f.stem.removeprefix("gaitmsg_") for f in (rig.ROOT / "lcm_types").glob("*.lcm")}
    assert files == set(FINGERPRINTS)


def test_image_is_bot_core_image_on_the_wire(tmp_path):
    """The fields of libbot2's types under their own package give the same fingerprint, so the same bytes."""
    (tmp_path / "a.lcm").write_text(
        "package bot_core; struct image_metadata_t { string key; int32_t n; byte value[n]; }"
    )
    (tmp_path / "b.lcm").write_text(
        "package bot_core; struct image_t { int64_t utime; int32_t width; int32_t height; "
        "int32_t row_stride; int32_t pixelformat; int32_t size; byte data[size]; int32_t nmetadata; "
        "image_metadata_t metadata[nmetadata]; }"
    )
    generator = Path(sys.executable).with_name("lcm-gen")
    subprocess.run(
        [generator, "-p", "--ppath", tmp_path, tmp_path / "a.lcm", tmp_path / "b.lcm"],
        check=True,
        cwd=tmp_path,
    )
    code = "import bot_core; print(bot_core.image_t._get_packed_fingerprint().hex())"
    found = subprocess.run(
        [sys.executable, "-c", code], check=True, cwd=tmp_path, capture_output=True, text=True
    )
    assert found.stdout.strip() == gaitmsg.image_t._get_packed_fingerprint().hex()


images = st.tuples(st.integers(1, 9), st.integers(1, 9), st.booleans()).map(
    lambda s: np.random.default_rng(s[0]).integers(0, 255, s[:2] if s[2] else (*s[:2], 3), np.uint8)
)


@given(images, st.integers(-(1 << 62), 1 << 62), st.integers(-1, 1 << 62))
def test_images_come_through(image, utime, frame):
    message = gaitmsg.image_t.decode(image_message(image, utime, frame).encode())
    assert message.utime == utime
    numbers = [(entry.key, int.from_bytes(entry.value, "big")) for entry in message.metadata]
    assert numbers == ([("frame", frame)] if frame >= 0 else [])
    np.testing.assert_array_equal(picture(message), image)


def test_rgb_and_padded_rows():
    image = rig.picture(0)
    message = image_message(image[..., ::-1], 1, 1)
    message.pixelformat = message.PIXEL_FORMAT_RGB
    np.testing.assert_array_equal(picture(message), image)
    rows = np.pad(image.reshape(120, 480), ((0, 0), (0, 32)))
    message = image_message(image, 1, 1)
    message.data, message.row_stride, message.size = rows.tobytes(), 512, rows.size
    np.testing.assert_array_equal(picture(message), image)


def test_jpeg_is_small_and_close():
    smooth = np.tile(np.linspace(0, 255, 160), (120, 1)).astype(np.uint8)
    for image in (smooth, np.dstack([smooth, smooth[:, ::-1], smooth])):
        message = gaitmsg.image_t.decode(image_message(image, 1, 1, jpeg=90).encode())
        assert message.size < image.size / 3
        assert np.abs(picture(message).astype(int) - image).max() <= 12


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"pixelformat": 5}, "0x00000005"), ({"row_stride": 10}, "row_stride"), ({"height": 121}, "row_stride")],
)
def test_unusable_images_are_named(changes, words):
    with pytest.raises(UserError, match=words):
        picture(rig.frame_message(0, **changes))


def test_another_type_is_refused():
    with pytest.raises(UserError, match=r"GAIT_X: .*status_t"):
        decode(gaitmsg.status_t, rig.frame_message(0).encode(), "GAIT_X")
    with pytest.raises(UserError, match="GAIT_X"):
        decode(gaitmsg.estimate_t, b"", "GAIT_X")


def test_cameras_come_through():
    message = gaitmsg.camera_t.decode(camera_message(rig.CAMERA, 7).encode())
    assert message.utime == 7
    assert camera_of(message).to_dict() == rig.CAMERA.to_dict()


def test_states_come_through_and_the_unknown_is_nan():
    state = State(0.25, 0.875, 1.75, -0.5, 0.125, 0.0625, np.array([1.0, 2.0, 3.0]), np.array([0.5, -0.25]))
    state.offset = np.array([0.125, 0, -1.0])
    back = state_of(gaitmsg.state_t.decode(state_message(state).encode()))
    assert vars(back).keys() == vars(state).keys()
    for name, value in vars(state).items():
        np.testing.assert_array_equal(getattr(back, name), value)
    partial = gaitmsg.state_t.decode(state_message({"stature": 1.5}).encode())
    assert partial.stature == 1.5 and np.isnan([partial.phase, partial.heading, *partial.pelvis]).all()


def test_commands_have_ids_of_their_own():
    one, two = (command_message(gaitmsg.command_t.STOP) for _ in range(2))
    assert one.id != two.id != 0


def test_estimates_of_the_daemon_are_those_of_the_library(tmp_path):
    """Encoded by C, decoded by Python, beside the binding's own estimate of the same frames."""
    from gait.bindings.config import TrackerConfig
    from gait.track.tracker import Tracker

    outcome = rig.play(rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, 6)]))
    config = TrackerConfig.default(particles=rig.PARTICLES, lag=5)
    tracker = Tracker(rig.model(), rig.CAMERA, config, background=rig.plate())
    tracker.start(rig.person(0), rig.SD, rig.utime(0))
    for i, message in enumerate(outcome.estimates):
        ours, theirs = estimate_of(message), tracker.step(rig.picture(i), rig.utime(i))
        assert message.tracker_digest & (1 << 64) - 1 == tracker.digest()
        assert (ours.utime, ours.frame, ours.status, ours.flags) == (
            rig.utime(i),
            i,
            theirs.status,
            theirs.flags,
        )
        for name in ("joints", "joint_sd", "angles", "ess", "phase_r", "speed", "log_evidence"):
            np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name), name)
        assert ours.joint_names == theirs.joint_names
        for part in ("mean", "sd", "best"):
            whole = vars(getattr(theirs, part)).items()
            for key, value in (
                (k, v) for k, v in whole if k not in ("proportion", "turn_rate")
            ):  # not of state_t
                np.testing.assert_array_equal(getattr(getattr(ours, part), key), value, f"{part} {key}")
    assert len(outcome.estimates) == 6
