"""gait doctor names the remedy of each planted fault, and of nothing else."""

import errno
import json
import os
from collections import namedtuple
from pathlib import Path

import pytest

import gait.cli
from gait.bindings import abi
from gait.bindings import library as bindings
from gait.cli import doctor


def findings(capsys):
    code = gait.cli.main(["doctor", "--json"])
    return code, {row["name"]: row for row in json.loads(capsys.readouterr().out)}


def lines(check):
    return [doctor._line(finding) for finding in check()]


def test_this_machine(capsys):
    code, found = findings(capsys)
    assert found["library"]["state"] == found["model"]["state"] == "ok"
    assert code == int(any(row["state"] == "fault" for row in found.values()))
    assert all(row["remedy"] for row in found.values() if row["state"] != "ok")
    assert {row["state"] for row in found.values()} <= {"ok", "note", "fault"}


def test_a_library_that_is_none(monkeypatch, tmp_path, capsys):
    (tmp_path / "libgait.so").write_bytes(b"no library")
    monkeypatch.setenv("GAIT_LIBRARY", str(tmp_path / "libgait.so"))
    bindings.library.cache_clear()
    try:
        (line,) = lines(doctor.check_library)
        assert line.startswith("fault library: cannot load") and "make lib, or set GAIT_LIBRARY" in line
        (line,) = lines(doctor.check_model)
        assert line.startswith("fault model: ")
        assert gait.cli.main(["doctor", "--quiet"]) == 1
        assert all(row.startswith("fault") for row in capsys.readouterr().out.splitlines())
    finally:
        bindings.library.cache_clear()


@pytest.mark.parametrize(
    ("where", "name", "words"),
    [
        (abi, "ABI", "ABI 10, this package needs 99"),
        (bindings, "__version__", "this package is 99"),
        (abi, "NEWEST_FIELD", "older than this package"),
    ],
)
def test_a_library_of_another_version(where, name, words, monkeypatch):
    monkeypatch.setattr(where, name, {"ABI": 99, "__version__": "99"}.get(name, ("gait_state", "none")))
    monkeypatch.setenv("GAIT_LIBRARY", next(path for path in bindings.candidates() if Path(path).is_file()))
    bindings.library.cache_clear()
    try:
        (line,) = lines(doctor.check_library)
        assert line.startswith("fault library: cannot load") and words in line
        assert os.environ["GAIT_LIBRARY"] in line and "make lib, or set GAIT_LIBRARY" in line
    finally:
        bindings.library.cache_clear()


def test_a_cpu_without_vectors(monkeypatch):
    class Library:
        gait_version = staticmethod(lambda: 0x010203)
        gait_abi = staticmethod(lambda: 1)
        gait_cpu_name = staticmethod(lambda mask: b"scalar")

    monkeypatch.setattr(bindings, "library", lambda: Library)
    assert (
        "note  cpu: " in lines(doctor.check_library)[1]
        and "fewer --particles" in lines(doctor.check_library)[1]
    )


def test_a_missing_package(monkeypatch):
    from gait import extras

    monkeypatch.setattr(extras, "find_spec", lambda module: None if module == "h5py" else object())
    (line,) = [line for line in lines(doctor.check_extras) if not line.startswith("ok")]
    assert line == "note  extra h5: lacks h5py; pip install 'libgait[h5]'"


def test_weights_that_are_missing_or_damaged(monkeypatch, tmp_path):
    monkeypatch.setenv("GAIT_WEIGHTS", str(tmp_path))
    found = lines(doctor.check_weights)
    remedy = "run gait detect --fetch once, with a network connection"
    assert found[0] == f"fault detector weights (people): not installed; {remedy}"
    assert [line.split()[0] for line in found] == ["fault", "fault", "note", "note"]
    with monkeypatch.context() as only_numpy:  # which cannot run the detector
        only_numpy.setattr("gait.extras.find_spec", lambda module: None)
        assert {line.split()[0] for line in lines(doctor.check_weights)} == {"note"}
    (tmp_path / "pose_detection.tflite").write_bytes(b"damaged")
    first = lines(doctor.check_weights)[0]
    assert first.startswith("fault detector weights (people): ") and first.endswith(remedy)
    monkeypatch.setenv("GAIT_WEIGHTS", str(tmp_path / "none"))
    assert all(
        line.startswith("fault") and "none is not a folder; unset it" in line
        for line in lines(doctor.check_weights)
    )


def test_no_multicast_route_and_a_small_buffer(monkeypatch, tmp_path):
    pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")
    from gait.errors import UserError
    from gait.lcm import link

    def refuse(url=None):
        raise UserError("no route")

    monkeypatch.setattr(link, "open_lcm", refuse)
    (tmp_path / "rmem_max").write_text("212992\n")
    monkeypatch.setattr(link, "_RMEM_MAX", tmp_path / "rmem_max")
    route, buffer = lines(doctor.check_network)
    assert route.startswith("fault lcm route: ") and "ip route add 224.0.0.0/4 dev lo" in route
    assert (
        buffer.startswith("fault lcm buffer: the kernel grants")
        and "sysctl -w net.core.rmem_max=4194304" in buffer
    )


class Deaf:
    """A network on which nothing arrives."""

    subscribe = publish = staticmethod(lambda *_: None)
    handle_timeout = staticmethod(lambda _: 0)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("bogus://x", "fault lcm url: LCM_DEFAULT_URL: bogus://x"),
        ("file:///none/a.log", "fault lcm url: LCM_DEFAULT_URL: /none/a.log: no such LCM log; "),
        ("file:///none/a.log?mode=w", "fault lcm url: LCM_DEFAULT_URL: /none/a.log: folder /none does not "),
        (
            "file:///dev/shm/a.log?mode=bad",
            "fault lcm url: LCM_DEFAULT_URL: file:///dev/shm/a.log?mode=bad: ",
        ),
        ("udpm://239.255.76.67:7667?ttl=5", "note  lcm url: "),
        ("udpm://239.255.76.67:7667?recv_buf_size=4194304&ttl=1", "note  lcm url: "),
        ("udpm://239.255.76.67:7667?ttl=0", "ok    lcm url: "),
        ("memq://", "ok    lcm url: "),
        (None, ""),
    ],
)
def test_the_network_of_the_environment_is_checked(url, words, monkeypatch):
    pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")
    if url is None:
        monkeypatch.delenv("LCM_DEFAULT_URL", raising=False)
    else:
        monkeypatch.setenv("LCM_DEFAULT_URL", url)
    if url is not None and url.startswith("udpm"):
        monkeypatch.setattr("gait.lcm.link.open_lcm", lambda url: Deaf)
    found = [line for line in lines(doctor.check_network) if "lcm url" in line]
    assert len(found) == (url is not None) and all(line.startswith(words) for line in found)
    assert "fault" not in words or "; " in found[0]


def test_a_log_of_the_environment_is_left_alone(monkeypatch, tmp_path):
    pytest.importorskip("lcm", reason="lcm is not installed: extra lcm")
    (tmp_path / "a.lcm").write_bytes(b"kept")
    monkeypatch.setenv("LCM_DEFAULT_URL", f"file://{tmp_path}/a.lcm?mode=w")
    assert any(line.startswith("ok    lcm url") for line in lines(doctor.check_network))
    assert (tmp_path / "a.lcm").read_bytes() == b"kept"


def test_a_message_that_is_lost(monkeypatch):
    link = pytest.importorskip("gait.lcm.link", reason="lcm is not installed: extra lcm")
    monkeypatch.setattr(link, "open_lcm", lambda url: Deaf)
    assert lines(doctor.check_network)[0].startswith("fault lcm route: a multicast message does not return")


@pytest.mark.parametrize(
    ("script", "state"), [("echo gait-trackd 0.0.1", "fault"), ("exit 3", "fault"), (None, "note")]
)
def test_a_daemon_that_is_old_broken_or_missing(script, state, monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "_DAEMON", tmp_path / "gait-trackd")
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    if script:
        (tmp_path / "gait-trackd").write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / "gait-trackd").chmod(0o755)
    (line,) = lines(doctor.check_daemon)
    assert line.startswith(f"{state:5} gait-trackd: ") and "make tools" in line


def test_a_camera_that_may_not_be_read_or_is_gone(monkeypatch, tmp_path):
    (tmp_path / "video0").write_bytes(b"")
    monkeypatch.setattr(doctor, "_DEVICES", tmp_path)
    assert lines(doctor.check_cameras) == [f"ok    camera: {tmp_path / 'video0'}"]
    (tmp_path / "video0").unlink()
    assert lines(doctor.check_cameras)[0].startswith("note  camera: no camera")
    for error, remedy in ((errno.EACCES, "usermod -aG video"), (errno.ENODEV, "connect it again")):
        (tmp_path / "video0").write_bytes(b"")

        def refuse(*_, error=error):
            raise OSError(error, os.strerror(error))

        with monkeypatch.context() as here:
            here.setattr(doctor.os, "open", refuse)
            (line,) = lines(doctor.check_cameras)
        assert line.startswith("fault camera: ") and os.strerror(error) in line and remedy in line


def test_a_full_disk_and_a_folder_that_takes_no_files(monkeypatch, tmp_path):
    import tempfile

    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(doctor.shutil, "disk_usage", lambda _: usage(10, 9, 1 << 20))
    assert all("0.0 GB free; free some space" in line for line in lines(doctor.check_disk))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    assert (
        lines(doctor.check_disk)[1].startswith("fault disk: temporary folder ")
        and "TMPDIR" in lines(doctor.check_disk)[1]
    )
