"""Outputs that appear whole or not at all, and places where none may be put."""

import errno
import os

import pytest

from gait.errors import UserError
from gait.io.files import filling, replacing, require_folder, require_writable


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
    assert not [p for p in tmp_path.rglob("*") if p.is_file()] and not path.exists()
    for text in ("new", "again"):
        with filling(path) as folder:
            (folder / "report.html").write_text(text)
            (folder / "a.png").write_text(text)
        assert sorted(p.name for p in path.iterdir()) == ["a.png", "report.html"]
        assert (path / "report.html").read_text() == text


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "a").write_text("")
    for path in (tmp_path / "a", tmp_path / "a" / "b"):
        with pytest.raises(UserError, match="is a file; give the name of a folder"), filling(path):
            pass
