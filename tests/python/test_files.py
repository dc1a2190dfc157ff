"""Outputs are written completely or not at all, and places where none may be written are rejected."""

import errno
import os
import resource
import signal
import subprocess
import sys
from contextlib import closing
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from test_trackfile import write as write_track

from gait.errors import UserError
from gait.io import blob
from gait.io.files import filling, making, replacing, require_file, require_folder, require_writable
from gait.lcm.link import LogWriter


def test_files_to_read_are_files_that_hold_something(tmp_path):
    (tmp_path / "empty").touch()
    (tmp_path / "full").write_text("x")
    require_file(tmp_path / "full", "video file")
    for path, words in (
        (tmp_path, "is a folder; give the video file itself"),
        (tmp_path / "none", "no such video file; check the name"),
        ("/dev/null", "is a device or a pipe, not a file; write the video file to a file first"),
        (tmp_path / "empty", "is empty; copy or make the video file again"),
    ):
        with pytest.raises(UserError, match=f"{path}: {words}"):
            require_file(path, "video file")


def test_a_link_stays_and_its_file_is_written(tmp_path):
    (tmp_path / "deep").mkdir()
    link = tmp_path / "link.csv"
    link.symlink_to("deep/real.csv")
    for text in ("new", "again"):
        with replacing(link) as temporary:
            temporary.write_text(text)
        assert link.is_symlink() and (tmp_path / "deep/real.csv").read_text() == text
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["deep", "link.csv", "real.csv"]


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), replacing(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG])
def test_a_full_disk_is_named_with_its_file(tmp_path, number):
    with (
        pytest.raises(UserError, match=r"out\.gait: .*; choose another place"),
        replacing(tmp_path / "out.gait"),
    ):
        raise OSError(number, os.strerror(number))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "end", [KeyboardInterrupt(), OSError(errno.ENOSPC, "full"), UserError("b.mp4: full"), ValueError()]
)
def test_what_is_worth_keeping_is_kept_if_the_command_is_ended(tmp_path, capsys, end):
    path = tmp_path / "a.csv"
    path.write_text("old")
    if isinstance(end, UserError):  # the disk was full for another file
        end.__cause__ = OSError(errno.ENOSPC, "full")
    for worth in (False, True):
        with (
            pytest.raises((type(end), UserError)),
            replacing(path, partial=lambda _, w=worth: w) as temporary,
        ):
            temporary.write_text("half")
            raise end
        kept = [] if not worth or isinstance(end, ValueError) else ["a.unfinished.csv"]
        assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", *kept] and path.read_text() == "old"
        assert ("not finished; what was written is in" in capsys.readouterr().err) == bool(kept)


def test_what_else_fails_beside_a_file_keeps_its_name(tmp_path):
    with pytest.raises(FileNotFoundError, match="other"), replacing(tmp_path / "out.gait"):
        (tmp_path / "other").read_text()


def test_pipes_and_devices_are_refused(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, os.devnull):
        with pytest.raises(UserError, match="not a file"), replacing(path):
            pass
    assert pipe.is_fifo() and not os.path.isfile(os.devnull)


def test_what_cannot_be_written_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text("mine")
    path.chmod(0o444)
    if os.geteuid() == 0:  # permissions do not stop root: look at the bits instead
        monkeypatch.setattr(os, "access", lambda p, mode: bool(os.stat(p).st_mode & 0o200))
    with pytest.raises(UserError, match=r"a\.csv: is read-only; choose"):
        require_writable(path)
    with pytest.raises(UserError, match="does not exist"):
        require_writable(tmp_path / "no" / "b.csv")
    with pytest.raises(UserError, match="is a folder"):
        require_writable(tmp_path)


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="no /proc")
def test_a_folder_that_takes_no_files_is_refused_before_the_work():
    for check in (require_writable, require_folder):
        with pytest.raises(
            UserError, match=r"^/proc/x: folder /proc cannot be written; choose another place"
        ):
            check("/proc/x")


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path):
    path = tmp_path / "new" / "deep"
    with pytest.raises(KeyboardInterrupt), filling(path) as folder:
        (folder / "half.png").write_text("half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
    for text in ("new", "again"):
        with filling(path) as folder:
            (folder / "report.html").write_text(text)
            (folder / "a.png").write_text(text)
        assert sorted(p.name for p in path.iterdir()) == ["a.png", "report.html"]
        assert (path / "report.html").read_text() == text
        (path / "a.png").chmod(0o640)
    assert (path / "a.png").stat().st_mode & 0o777 == 0o640
    with filling(path) as folder:
        (folder / "a.png").write_text("keeps its mode")
    assert (path / "a.png").stat().st_mode & 0o777 == 0o640


def test_folders_of_a_command_that_fails_go_unless_there_is_something_in_them(tmp_path):
    for name, left in (("", []), ("a.csv", ["new", "new/a.csv"])):
        with pytest.raises(KeyboardInterrupt), making(tmp_path / "new" / "deep"):
            if name:
                (tmp_path / "new" / name).write_text("of another")
            raise KeyboardInterrupt
        assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*")) == left
    with pytest.raises(KeyboardInterrupt), making(tmp_path):
        raise KeyboardInterrupt
    assert tmp_path.is_dir()


def test_a_folder_for_which_there_is_no_space_is_named(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10, limits[1]))
        words = f"{tmp_path / 'new'}: File too large; choose another place"
        with pytest.raises(UserError, match=words), filling(tmp_path / "new") as folder:
            (folder / "a.html").write_text("x" * 100)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert not list(tmp_path.rglob("*.html"))


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "a").write_text("")
    for path in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(UserError, match="is a file; give the name of a folder"), filling(path):
            pass


def test_two_writers_of_one_file_do_not_disturb_each_other(tmp_path):
    path = tmp_path / "a.csv"
    with replacing(path) as one:
        one.write_text("one, begun first, ends last")
        with replacing(path) as two:
            assert two != one
            two.write_text("two")
        assert path.read_text() == "two"
    assert path.read_text() == "one, begun first, ends last" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664])
def test_the_mode_of_the_old_file_is_kept(mode, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("old")
    path.chmod(mode)
    with replacing(path) as temporary:
        assert temporary.stat().st_mode & 0o777 == mode  # also while it is written
        temporary.write_text("new")
    assert path.stat().st_mode & 0o777 == mode
    umask = os.umask(0o027)
    try:
        with replacing(tmp_path / "b.csv") as temporary:
            temporary.write_text("new")
    finally:
        os.umask(umask)
    assert (tmp_path / "b.csv").stat().st_mode & 0o777 == 0o640


def test_nothing_is_written_through_a_link_laid_in_the_way(tmp_path, monkeypatch):
    victim = tmp_path / "victim"
    victim.write_text("mine")
    monkeypatch.setattr("secrets.token_hex", lambda count: "00" * count)
    (tmp_path / f".a.{'00' * 8}.csv").symlink_to(victim)
    with pytest.raises(UserError, match="File exists"), replacing(tmp_path / "a.csv") as temporary:
        temporary.write_text("theirs")
    assert victim.read_text() == "mine"


@pytest.fixture
def recorded(tmp_path, monkeypatch):
    """Calls that bring something to the disk, each with the file's suffix or the folder's name."""
    calls = []
    rename = os.replace

    def note(call, path):
        calls.append(f"{call} {Path(path).suffix or Path(path).relative_to(tmp_path)}")

    monkeypatch.setattr(os, "fsync", lambda fd: note("flush", os.readlink(f"/proc/self/fd/{fd}")))
    monkeypatch.setattr(os, "replace", lambda old, new: (note("rename", new), rename(old, new)))
    return calls


def test_data_are_on_the_disk_before_the_name_and_the_name_before_the_end(tmp_path, recorded):
    with replacing(tmp_path / "a.csv") as temporary:
        temporary.write_text("new")
    assert recorded == ["flush .csv", "rename .csv", "flush ."]


def test_pictures_are_on_the_disk_before_their_page_and_all_before_the_end(tmp_path, recorded):
    names = ["flush .png", "rename .png", "flush new/deep", "flush .html", "rename .html", "flush new/deep"]
    for folders in (["flush new", "flush ."], []):  # made by the first
        with filling(tmp_path / "new" / "deep") as folder:
            (folder / "a.html").write_text("page")
            (folder / "b.png").write_text("picture")
        assert recorded == [*folders, *names]
        recorded.clear()


def write_log(path):
    with replacing(path) as temporary, closing(LogWriter(temporary, name=str(path))) as log:
        for utime in range(3):
            log.write(utime, "GAIT_ESTIMATE", bytes(40))


WRITERS = {
    "model": lambda path: blob.write(path, {"AAAA": np.arange(40, dtype=np.float32)}),
    "log": write_log,
    "track": partial(write_track, count=2),
}


@pytest.fixture(params=WRITERS.values(), ids=WRITERS)
def written(request, tmp_path):
    """A writer, its file, and what it writes there."""
    path = tmp_path / "a.csv"
    request.param(path)
    return request.param, path, path.read_bytes()


class Layer:
    """Lets call number `at` of open, fsync and replace fail, but none that removes a temporary folder."""

    at = calls = 0

    def __init__(self, monkeypatch):
        for name in ("open", "fsync", "replace"):
            monkeypatch.setattr(os, name, partial(self.fails_once, getattr(os, name)))

    def fails_once(self, call, *words, **options):
        self.calls += "dir_fd" not in options
        if self.calls == self.at and "dir_fd" not in options:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return call(*words, **options)

    def runs(self):
        """Each run with another call that fails, the last with none."""
        for self.at in range(1, 50):
            self.calls = 0
            yield
            if self.calls < self.at:
                return
        raise AssertionError("more than 50 calls")


def test_whichever_call_fails_a_page_shows_pictures_that_are_there(tmp_path, monkeypatch):
    path, layer, failed = tmp_path / "report", Layer(monkeypatch), []
    names = ("a.html", "b.png", "c.png")
    for _ in layer.runs():
        at, layer.at = layer.at, 0
        with filling(path) as folder:
            for name in names:
                (folder / name).write_text("old")
        layer.at, layer.calls = at, 0
        try:
            with filling(path) as folder:
                for name in names:
                    (folder / name).write_text("new")
        except (OSError, UserError):
            failed.append("".join((path / name).read_text()[0] for name in names))
        assert [p.name for p in tmp_path.iterdir()] == ["report"]
        assert sorted(p.name for p in path.iterdir()) == sorted(names)
    assert failed == sorted(failed, reverse=True) and set(failed) == {"ooo", "ono", "onn", "nnn"}
    assert all((path / name).read_text() == "new" for name in names)


def test_whichever_call_fails_the_file_is_the_old_or_the_new_one(written, monkeypatch):
    write, path, whole = written
    layer = Layer(monkeypatch)
    failures = []
    for _ in layer.runs():
        path.write_text("old")
        try:
            write(path)
        except UserError as error:
            assert str(error).startswith(str(path)) and "\n" not in str(error)
            failures.append(path.read_bytes())
            (path.parent / "a.unfinished.csv").unlink(missing_ok=True)
        else:
            assert path.read_bytes() == whole
        assert list(path.parent.iterdir()) == [path]
    new = failures.count(whole)  # its folder could not be flushed
    assert 0 < new <= 2 and failures == [b"old"] * (len(failures) - new) + [whole] * new


def test_a_disk_that_is_full_at_any_byte_leaves_the_old_file(written, capsys):  # capsys: no limit on stderr
    write, path, whole = written
    path.write_text("old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    for size in range(0, len(whole), 1 + len(whole) // 200):
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
            with pytest.raises(UserError, match="a.csv: .*File too large"):
                write(path)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert path.read_text() == "old"
        (path.parent / "a.unfinished.csv").unlink(missing_ok=True)
        assert list(path.parent.iterdir()) == [path]


def test_what_a_killed_command_left_is_named_and_kept(tmp_path, capsys):
    program = (
        "import os, sys; from gait.io.files import replacing\n"
        "with replacing(sys.argv[1]) as path: path.write_text(sys.argv[2]); os.kill(os.getpid(), 9)"
    )
    path = tmp_path / "a.csv"
    for text in ("head\nan hour of work\ncut of", "head\n", "", "head\nanother\n"):
        subprocess.run([sys.executable, "-c", program, str(path), text], check=False)
    empty, last = sorted(
        tmp_path.glob(".a.*"), key=os.path.getsize
    )  # each command found what was left before
    with replacing(path) as temporary:  # an empty one may be of a command that has just begun
        temporary.write_text("new")
    assert empty.exists() and not last.exists()
    os.utime(empty, (0, 0))
    with replacing(path) as open_now, replacing(path) as temporary:
        os.utime(open_now, (0, 0))  # old, but its writer is alive
        open_now.write_text("first")
        temporary.write_text("second")
    assert path.read_text() == "first"
    kept = [tmp_path / "a.unfinished.csv", tmp_path / "a.unfinished-2.csv"]  # neither replaces the other
    assert {p.read_text() for p in kept} == {"head\nan hour of work\n", "head\nanother\n"}
    assert set(tmp_path.iterdir()) == {path, *kept}
    assert "was killed; what it wrote is in a.unfinished-2.csv" in capsys.readouterr().err


def test_leftovers_that_are_not_ours_or_cannot_be_renamed_stay(tmp_path, monkeypatch):
    path, left = tmp_path / "a.csv", tmp_path / f".a.{'0' * 16}.csv"
    left.write_text("head\ntheirs\n")
    os.utime(left, (0, 0))

    def refuse(*names):
        raise PermissionError(1, "Operation not permitted")

    def write(text):
        with replacing(path) as temporary:
            temporary.write_text(text)
        assert path.read_text() == text and left.read_text() == "head\ntheirs\n"

    with monkeypatch.context() as other:
        other.setattr("os.geteuid", lambda: os.getuid() + 1)
        write("of another user")
    with monkeypatch.context() as sticky:
        sticky.setattr("gait.io.files.keep_unfinished", refuse)
        write("in a folder in which only the owner may rename")
    with monkeypatch.context() as hidden:
        hidden.setattr("os.listdir", refuse)
        write("in a folder that cannot be listed")


def test_what_was_reported_as_written_outlives_a_kill():
    """A few of the kills of tests/bench/kills.py."""
    bench = Path(__file__).resolve().parents[1] / "bench" / "kills.py"
    ended = subprocess.run(
        [sys.executable, bench, "--kills", "3"], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 0, ended.stderr
