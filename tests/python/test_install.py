"""`make install` installs a library that programs can be built with, and `make uninstall` removes it."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gait.cli import COMMANDS, parser_of

ROOT = Path(__file__).resolve().parents[2]
HEADER = (ROOT / "libgait/include/gait.h").read_text(encoding="utf-8")
ABI = re.findall(r"^#define GAIT_ABI (\d+)", HEADER, re.M)[0]
PROGRAM = """#include <gait.h>
int main(void) { return gait_version() == GAIT_VERSION && gait_abi() == GAIT_ABI ? 0 : 1; }
"""


def make(target: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run an installation target of the Makefile."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
    command = ["make", "-s", target, *words]
    return subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=300)


@pytest.fixture
def installed(tmp_path):
    """Folder used in place of /, with the library installed in /opt/gait."""
    done = make("install", f"DESTDIR={tmp_path}", "PREFIX=/opt/gait")
    assert done.returncode == 0, done.stderr
    return tmp_path


def test_install_puts_everything_and_uninstall_removes_it(installed):
    names = {str(p.relative_to(installed / "opt/gait")) for p in installed.rglob("*") if not p.is_dir()}
    libraries = {"lib/libgait.so", f"lib/libgait.so.{ABI}", "lib/libgait.a"}
    described = {
        "lib/pkgconfig/gait.pc",
        *(f"lib/cmake/gait/gaitConfig{kind}.cmake" for kind in ("", "Version")),
    }
    headers = {f"include/{header.name}" for header in (ROOT / "libgait/include").glob("*.h")}
    types = {f"share/gait/lcm_types/{t.name}" for t in (ROOT / "lcm_types").glob("*.lcm")}
    daemon = {"bin/gait-trackd", "lib/gait/liblcm.so.1", "share/gait/walk.gait", "share/gait/trackd.toml"}
    daemon |= {"share/gait/paper.gait", "share/gait/classes.gait"}
    service = {"lib/systemd/system/gait-trackd.service"}
    notices = {f"share/doc/libgait/{name}" for name in ("LICENSE", "README.md", "notices.md", "lcm-COPYING")}
    commands = ["gait", "gait-trackd", *(f"gait-{name.replace(' ', '-')}" for name in COMMANDS)]
    service |= {f"share/man/man1/{name}.1" for name in commands}
    assert names == libraries | described | headers | types | daemon | service | notices
    listed = (installed / "opt/gait/share/doc/libgait/notices.md").read_text()
    for part in ("Eigen", "MPL-2.0", "LCM", "LGPL-2.1", "](README.md)"):
        assert part in listed
    licence = (installed / "opt/gait/share/doc/libgait/lcm-COPYING").read_text()
    assert "GNU LESSER GENERAL PUBLIC LICENSE" in licence.upper()
    assert make("uninstall", f"DESTDIR={installed}", "PREFIX=/opt/gait").returncode == 0
    assert not [p for p in installed.rglob("*") if not p.is_dir()]


def test_the_daemon_can_be_installed_alone(tmp_path):
    done = make("install-daemon", f"DESTDIR={tmp_path}", "PREFIX=/opt/gait")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "opt/gait/bin/gait-trackd").exists()
    assert (tmp_path / "opt/gait/share/doc/libgait/lcm-COPYING").exists()
    absent = make("install-daemon", f"DESTDIR={tmp_path}", f"SITE={tmp_path}")
    assert absent.returncode != 0 and "no licence of lcm in" in absent.stderr


def test_the_installed_daemon_runs_by_itself(installed):
    prefix = installed / "opt/gait"
    config = (prefix / "share/gait/trackd.toml").read_text().replace("/opt/gait", str(prefix))
    (installed / "trackd.toml").write_text(config)
    daemon = [prefix / "bin/gait-trackd"]
    done = subprocess.run([*daemon, "--version"], capture_output=True, text=True, check=True, env={})
    assert done.stdout.startswith("gait-trackd ")
    log = ["--config", installed / "trackd.toml", "--url", "file:///nothing?speed=0"]
    done = subprocess.run([*daemon, *log], capture_output=True, text=True, env={}, check=False)
    assert "--snapshot: a log is played from its start" in done.stderr
    several = re.sub("^snapshot = .*$", "keypoints-term = true\npeople = 2", config, flags=re.M)
    (installed / "trackd.toml").write_text(several)
    done = subprocess.run([*daemon, *log], capture_output=True, text=True, env={}, check=False)
    assert "cannot open this log" in done.stderr  # model and options are fine
    assert "--snapshot" not in (prefix / "lib/systemd/system/gait-trackd.service").read_text()


def test_the_unit_waits_for_the_network_and_never_gives_up(installed):
    unit = (installed / "opt/gait/lib/systemd/system/gait-trackd.service").read_text()
    head, service = unit.split("[Service]")
    for line in ("StartLimitIntervalSec=0", "Wants=network-online.target", "After=network-online.target"):
        assert f"\n{line}\n" in head
    assert "\nRestart=on-failure\nRestartSec=0\n" in service


def test_the_unit_is_one_that_systemd_accepts(installed):
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed")
    unit = installed / "opt/gait/lib/systemd/system/gait-trackd.service"
    text = unit.read_text().replace("/opt/gait", str(installed / "opt/gait"))
    unit.write_text(re.sub(r"^Documentation=.*\n", "", text, flags=re.M))
    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and not done.stderr, done.stderr


def test_the_manual_pages_have_every_option(installed):
    pages = installed / "opt/gait/share/man/man1"
    trackd = ROOT / "build/bin/gait-trackd"
    shown = subprocess.run([trackd, "--help"], capture_output=True, text=True, check=True).stdout
    options = {"gait-trackd": re.findall(r"^  ((?:-\w, )?--[a-z-]+.*)$", shown, re.M)}
    assert len(options["gait-trackd"]) > 30
    for name in COMMANDS:
        actions = parser_of(name)._actions
        options[f"gait-{name.replace(' ', '-')}"] = [
            a.option_strings[-1] for a in actions if a.option_strings
        ]
    for name, words in options.items():
        page = (pages / f"{name}.1").read_text().replace("\\-", "-")
        heads = re.findall(r"^\.B (.*)$", page, re.M)
        assert all(
            any(re.search(rf"(^|, ){re.escape(word)}( |$)", head) for head in heads) for word in words
        ), name
    if shutil.which("groff"):
        done = subprocess.run(
            ["groff", "-man", "-ww", "-z", *pages.iterdir()], capture_output=True, text=True, check=True
        )
        assert not done.stderr


@pytest.mark.parametrize("linked", [[], ["-static-libgcc", "-Wl,-Bstatic", "-lgait", "-Wl,-Bdynamic", "-lm"]])
def test_a_program_builds_and_runs_against_the_installed_library(installed, tmp_path, linked):
    if not shutil.which("pkg-config"):
        pytest.skip("pkg-config is not installed")
    (tmp_path / "a.c").write_text(PROGRAM)
    env = {
        "PATH": "/usr/bin:/bin",
        "PKG_CONFIG_PATH": str(installed / "opt/gait/lib/pkgconfig"),
        "PKG_CONFIG_SYSROOT_DIR": str(installed),
        "LD_LIBRARY_PATH": str(installed / "opt/gait/lib"),
    }
    flags = subprocess.run(
        ["pkg-config", "--cflags", "--libs", "gait"], env=env, check=True, capture_output=True, text=True
    ).stdout.split()
    if linked:
        flags = [f for f in flags if f != "-lgait"] + linked
    subprocess.run(["cc", tmp_path / "a.c", "-o", tmp_path / "a", *flags], check=True)
    assert subprocess.run([tmp_path / "a"], env=env).returncode == 0


@pytest.mark.parametrize("shared", ["ON", "OFF"])
def test_find_package_of_cmake_finds_the_installed_library(installed, tmp_path, shared):
    if not shutil.which("cmake"):
        pytest.skip("cmake is not installed")
    (tmp_path / "a.c").write_text(PROGRAM)
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.18)\nproject(a C)\nfind_package(gait 0.1 REQUIRED)\n"
        "add_executable(a a.c)\ntarget_link_libraries(a gait::gait)\n"
    )
    options = [f"-DCMAKE_PREFIX_PATH={installed}/opt/gait", f"-DBUILD_SHARED_LIBS={shared}"]
    for command in (["cmake", "-S", ".", "-B", "build", *options], ["cmake", "--build", "build"]):
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, timeout=120)
    assert subprocess.run([tmp_path / "build/a"]).returncode == 0
    needed = subprocess.run(["readelf", "-d", tmp_path / "build/a"], capture_output=True, text=True).stdout
    assert (f"libgait.so.{ABI}" in needed) == (shared == "ON")


def test_a_prefix_with_a_space(tmp_path):
    prefix = tmp_path / "my gait"
    assert make("install", f"PREFIX={prefix}").returncode == 0
    assert (prefix / "lib/libgait.so").exists() and (prefix / "include/gait.h").exists()
    if shutil.which("pkg-config"):
        (tmp_path / "a.c").write_text(PROGRAM)
        env = {"PATH": "/usr/bin:/bin", "PKG_CONFIG_PATH": str(prefix / "lib/pkgconfig")}
        flags = subprocess.run(
            ["pkg-config", "--cflags", "--libs", "gait"], env=env, check=True, capture_output=True, text=True
        ).stdout
        subprocess.run(["sh", "-c", f"cc '{tmp_path}/a.c' -o '{tmp_path}/a' {flags}"], check=True)
    assert make("uninstall", f"PREFIX={prefix}").returncode == 0
    assert not [p for p in prefix.rglob("*") if not p.is_dir()]


@pytest.mark.parametrize("words", [["PREFIX=here"], ["PREFIX="], ["PREFIX=/opt", "LIBDIR=lib"]])
def test_a_prefix_that_is_not_absolute_is_refused(tmp_path, words):
    done = make("install", f"DESTDIR={tmp_path}/", *words)
    assert done.returncode != 0 and "does not begin with /" in done.stderr
    assert not list(tmp_path.iterdir())
