"""`make tools` for another CPU: the daemon runs there and gives the same bits."""

import os
import shutil
import subprocess
from pathlib import Path

import lcm_rig as rig
import pytest

MACHINE = "aarch64-linux-gnu"
DAEMON = rig.ROOT / f"build/{MACHINE}-release/bin/gait-trackd"
SYSROOT = os.environ.get("SYSROOT")


def test_the_daemon_for_another_cpu_gives_the_same_bits(tmp_path, monkeypatch):
    for program in (f"{MACHINE}-gcc", f"{MACHINE}-g++", "qemu-aarch64"):
        if not shutil.which(program):
            pytest.skip(f"no {program}")
    if SYSROOT is None:
        pytest.skip("set SYSROOT to a folder with GLib for that CPU")
    libraries = Path(SYSROOT) / "usr/lib" / MACHINE
    if not (libraries / "libglib-2.0.so.0").exists():
        pytest.skip(f"no {libraries}/libglib-2.0.so.0")
    env = {k: v for k, v in os.environ.items() if not k.startswith("MAKE") and k not in ("CC", "CXX")}
    make = ["make", "tools", f"CC={MACHINE}-gcc", f"SYSROOT={SYSROOT}"]
    done = subprocess.run(make, cwd=rig.ROOT, env=env, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr

    log = rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, 4)])
    here = rig.play(log)
    emulator = tmp_path / "gait-trackd"
    emulator.write_text(
        f'#!/bin/sh\nexec qemu-aarch64 -L /usr/{MACHINE} -E LD_LIBRARY_PATH={libraries} {DAEMON} "$@"\n'
    )
    emulator.chmod(0o755)
    monkeypatch.setattr(rig, "TRACKD", emulator)
    there = rig.play(log)
    assert (here.frames, here.digest) == (4, there.digest)
    for estimate in here.estimates + there.estimates:
        estimate.receive_utime = estimate.step_us = 0  # the only values that depend on time
    assert [e.encode() for e in here.estimates] == [e.encode() for e in there.estimates]
