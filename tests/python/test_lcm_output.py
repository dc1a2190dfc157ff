"""Logs that gait-trackd reads and writes: none is destroyed, and every loss is noticed."""

import itertools
import json
import resource
import subprocess
from dataclasses import replace

import lcm_rig as rig
import pytest

from gait.bindings.state import State
from gait.errors import UserError
from gait.lcm.link import gaitmsg, private_url, publisher
from gait.lcm.messages import command_message


def log(tmp_path, count=3, name="in.log"):
    return rig.write_log(tmp_path / name, [*rig.opening(), *rig.frames(0, count)])


def run(source, out, *more, **how):
    """Play a log, estimates to the URL `out`; stdout, stderr and the code."""
    words = rig.command("--url", f"file://{source}?speed=0", "--out", out, *more)
    return subprocess.run(words, capture_output=True, text=True, timeout=rig.PATIENCE, check=False, **how)


def one_line(done, code, *expected):
    lines = [line for line in done.stderr.splitlines() if " particles, " not in line]
    assert done.returncode == code and len(lines) == 1, done
    for words in expected:
        assert words in lines[0], lines[0]


@pytest.mark.parametrize("link", ["same", "symbolic", "hard"])
def test_the_log_that_is_played_is_never_overwritten(tmp_path, link):
    source, out = log(tmp_path), tmp_path / "other.log"
    before = source.read_bytes()
    if link == "symbolic":
        out.symlink_to(source)
    elif link == "hard":
        out.hardlink_to(source)
    else:
        out = source
    done = run(source, f"file://{out}?mode=w")
    one_line(done, 2, "would overwrite the log of --url", "another name")
    assert source.read_bytes() == before


def test_an_unfinished_log_that_is_played_is_not_overwritten(tmp_path):
    source = log(tmp_path, name="out.unfinished.log")
    before = source.read_bytes()
    done = run(source, f"file://{tmp_path / 'out.log'}?mode=w")
    one_line(done, 2, "would overwrite the log of --url", "another name")
    assert source.read_bytes() == before


def test_an_unfinished_log_of_a_daemon_that_was_killed_is_kept(tmp_path):
    source, out = log(tmp_path), tmp_path / "out.log"
    for number in (2, 3):
        (tmp_path / "out.unfinished.log").write_text(f"before {number}")
        one_line(
            run(source, f"file://{out}?mode=w"),
            0,
            f"{out}: ",
            f"is now in {out.stem}.unfinished-{number}.log",
        )
        assert (tmp_path / f"out.unfinished-{number}.log").read_text() == f"before {number}"
    assert {path.name for path in tmp_path.glob("*.unfinished.*")} == set()


def test_the_target_of_a_link_with_the_name_of_an_unfinished_log_stays(tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("keep")
    (tmp_path / "out.unfinished.log").symlink_to(precious)
    one_line(
        run(log(tmp_path), f"file://{tmp_path}/out.log?mode=w"), 1, "out.unfinished.log is not a regular file"
    )
    assert precious.read_text() == "keep" and not (tmp_path / "out.log").exists()


def test_a_daemon_that_cannot_start_leaves_the_old_log(tmp_path):
    out = log(tmp_path, name="out.log")
    before = out.read_bytes()
    for wrong in (["-m", tmp_path], ["--camera", tmp_path / "none.json"]):
        done = run(log(tmp_path), f"file://{out}?mode=w", *wrong)
        assert done.returncode == 1 and out.read_bytes() == before


def test_a_file_that_is_read_is_never_overwritten(tmp_path):
    camera = tmp_path / "camera.json"
    camera.write_text("{}")
    one_line(run(log(tmp_path), f"file://{camera}?mode=w", "--camera", camera), 2, "would overwrite a file")
    assert camera.read_text() == "{}"


def test_the_log_that_is_played_is_not_opened_for_writing(tmp_path):
    source = log(tmp_path)
    before = source.read_bytes()
    outcome = rig.run(*rig.command("--url", f"file://{source}?mode=w")[1:])
    assert outcome.code == 2 and "leave out ?mode=" in outcome.words and source.read_bytes() == before


@pytest.mark.parametrize("mode", ["", "?mode=r", "?speed=0", "?mode=", "?mode=write"])
def test_a_log_without_the_mode_of_writing_is_refused(tmp_path, mode):
    old = log(tmp_path, name="old.log")
    before = old.read_bytes()
    one_line(run(log(tmp_path), f"file://{old}{mode}"), 2, "add ?mode=w")
    assert old.read_bytes() == before


@pytest.mark.parametrize("mode", ["w", "a"])
def test_a_log_has_one_writer(tmp_path, mode):
    """Until it ends, also if it is killed."""
    rig.need_multicast()
    source, out = log(tmp_path), tmp_path / "out.log"
    written = out if mode == "a" else tmp_path / "out.unfinished.log"
    (tmp_path / "link.log").symlink_to(out)
    words = rig.command("--url", private_url(), "--out", f"file://{out}?mode={mode}")
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as first:
        try:
            assert first.stderr and "listening" in first.stderr.readline()
            number = written.stat().st_ino
            for name, other in itertools.product(("out.log", "link.log"), "wa"):
                done = run(source, f"file://{tmp_path / name}?mode={other}")
                one_line(done, 1, f"{name}: another program is writing this log; give another name")
                with (
                    pytest.raises(UserError, match="another program is writing this file; give another name"),
                    publisher(f"file://{tmp_path / name}?mode={other}"),
                ):
                    pass
            assert written.stat().st_ino == number and (mode == "a" or not out.exists())
        finally:
            first.kill()
    assert run(source, f"file://{out}?mode={mode}").returncode == 0
    with publisher(f"file://{out}?mode=a"):  # the command that adds to it, too
        one_line(run(source, f"file://{out}?mode={mode}"), 1, "another program is writing this log")


def test_a_log_can_be_added_to(tmp_path):
    source, out = log(tmp_path), tmp_path / "out.log"
    assert run(source, f"file://{out}?mode=w").returncode == 0
    assert run(source, f"file://{out}?speed=0&mode=a").returncode == 0
    assert [m.frame for m in rig.read_log(out, "GAIT_ESTIMATE", gaitmsg.estimate_t)] == [0, 1, 2, 0, 1, 2]


def test_a_full_disk_is_noticed(tmp_path):
    one_line(run(log(tmp_path), "file:///dev/full?mode=w"), 1, "cannot be written: No space left")


def test_a_log_that_may_not_grow_is_noticed(tmp_path):
    def small():
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

    old = log(tmp_path, name="out.log")
    before = old.read_bytes()
    done = run(log(tmp_path, 12), f"file://{old}?mode=w", preexec_fn=small)
    one_line(done, 1, "cannot be written: File too large; what was written is in out.unfinished.log")
    assert old.read_bytes() == before and (tmp_path / "out.unfinished.log").stat().st_size == 8192


def test_a_log_of_which_nothing_could_be_written_is_removed(tmp_path):
    def none():
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))

    done = run(log(tmp_path), f"file://{tmp_path}/out.log?mode=w", preexec_fn=none)
    one_line(done, 1, "cannot be written: File too large")
    assert [path.name for path in tmp_path.iterdir()] == ["in.log"]


def test_a_log_in_no_folder_is_refused_with_the_reason(tmp_path):
    done = run(log(tmp_path), f"file://{tmp_path}/no/x.log?mode=w")
    one_line(done, 1, "no/x.log", "cannot be written: No such file or directory")


def test_a_log_that_breaks_off_is_reported_and_tracked_as_far_as_it_goes(tmp_path):
    source = log(tmp_path)
    whole = source.read_bytes()
    source.write_bytes(whole[:-1000])
    done = run(source, f"file://{tmp_path}/out.log?mode=w")
    one_line(done, 1, "truncated at byte", "after 5 messages; what was written is in out.unfinished.log")
    assert "frames 2 " in done.stdout and not (tmp_path / "out.log").exists()
    written = rig.read_log(tmp_path / "out.unfinished.log", "GAIT_ESTIMATE", gaitmsg.estimate_t)
    assert [message.frame for message in written] == [0, 1]


def test_a_log_replaces_what_its_name_stands_for_only_when_it_is_complete(tmp_path):
    """The file that a chain of links points to, there or not, with its mode."""
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "second").symlink_to("folder/out")
    (folder / "first").symlink_to(tmp_path / "second")
    for mode in (0o600, 0o640):
        assert run(log(tmp_path), f"file://{folder / 'first'}?mode=w").returncode == 0
        assert len(rig.read_log(folder / "out", "GAIT_ESTIMATE", gaitmsg.estimate_t)) == 3
        assert {path.name for path in folder.iterdir()} == {"first", "out"} and (
            folder / "first"
        ).is_symlink()
        assert mode == 0o600 or (folder / "out").stat().st_mode & 0o777 == 0o600
        (folder / "out").chmod(mode)


@pytest.mark.parametrize(("content", "words"), [(b"", "is empty"), (b"x" * 100, "damaged or truncated")])
def test_a_log_with_nothing_in_it_is_reported(tmp_path, content, words):
    source = tmp_path / "in.log"
    source.write_bytes(content)
    one_line(run(source, f"file://{tmp_path}/out.log?mode=w"), 1, "in.log", words)


def test_a_log_of_which_no_frame_fits_the_camera_is_reported(tmp_path):
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(replace(rig.CAMERA, width=320, height=240, cx=159.5, cy=119.5).to_dict()))
    events = [("GAIT_COMMAND", rig.start(0)), *rig.frames(0, 3)]
    source = rig.write_log(tmp_path / "in.log", events)
    done = run(source, f"file://{tmp_path}/out.log?mode=w", "--camera", camera)
    assert done.returncode == 1
    printed = "in.log: none of its 3 frames was tracked: image of 160x120, but the camera has 320x240"
    assert printed in done.stderr.splitlines()[-1]


CAMERA, SCENE, START = rig.opening()
STOP = ("GAIT_COMMAND", command_message(gaitmsg.command_t.STOP, rig.utime(0), State(), State()))


@pytest.mark.parametrize(
    ("events", "options", "words"),
    [
        ([("GAIT_ESTIMATE", b"x")], [], "no frames on GAIT_IMAGE_0; --stream"),
        ([CAMERA, START], [], "no frames on GAIT_IMAGE_0; --stream"),
        ([*rig.opening(), *rig.frames(0, 3)], ["--stream", 1], "no frames on GAIT_IMAGE_1; --stream"),
        ([START, *rig.frames(0, 3)], [], "none of its 3 frames was tracked: no camera: give --camera"),
        ([CAMERA, SCENE, STOP, *rig.frames(0, 3)], [], "was tracked: no START: send it on GAIT_COMMAND"),
        ([CAMERA, *rig.frames(0, 3)], [], "was tracked: --init auto needs the background"),
        ([CAMERA, SCENE, *rig.frames(0, 3)], [], "was tracked: no person walks in full view"),
        ([*rig.opening(9), *rig.frames(0, 3)], [], "was tracked: the frame of the start did not arrive"),
        ([CAMERA], ["--lift"], "no frames on GAIT_IMAGE_0 and no keypoints of a known camera"),
    ],
)
def test_a_log_of_which_nothing_is_tracked_ends_with_1_and_the_reason(tmp_path, events, options, words):
    source = rig.write_log(tmp_path / "in.log", events)
    done = run(source, f"file://{tmp_path}/out.log?mode=w", *options)
    assert done.returncode == 1, done
    assert words in done.stderr.splitlines()[-1] and "in.log: " in done.stderr.splitlines()[-1]
