"""What `make lib` needs on other machines: no Python, Eigen from anywhere, a cross compiler's own tools."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = "sh sed tr cat mkdir dirname uname printf test awk expr ls head cut realpath make mv"


@pytest.fixture
def checkout(tmp_path):
    """Copy of what the library is built from, and a folder of programs without Python and compilers."""
    for name in ("Makefile", "libgait", "python/lock.txt", "python/pyproject.toml"):
        target = tmp_path / "gait" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (ROOT / name).is_dir() else shutil.copy)(ROOT / name, target)
    programs = tmp_path / "bin"
    programs.mkdir()
    for name in TOOLS.split():
        if found := shutil.which(name):
            (programs / name).symlink_to(found)
    return tmp_path


def program(checkout, name: str, text: str) -> None:
    """Put a program there that only prints `text`."""
    path = checkout / "bin" / name
    path.write_text(f"#!/bin/sh\necho '{text}'\n")
    path.chmod(0o755)


def make(checkout, *words: str) -> subprocess.CompletedProcess[str]:
    env = {
        k: v for k, v in os.environ.items() if not k.startswith("MAKE") and k not in ("EIGEN", "CC", "CXX")
    }
    env["PATH"] = str(checkout / "bin")
    return subprocess.run(
        [checkout / "bin/make", *words],
        cwd=checkout / "gait",
        env=env,
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_the_library_needs_no_python(checkout):
    for name in ("gcc", "g++", "cc"):
        program(checkout, name, "x86_64-linux-gnu")
    done = make(checkout, "-n", "lib", "CC=gcc", "EIGEN=/opt/eigen")
    assert done.returncode == 0, done.stderr
    assert "isystem /opt/eigen" in done.stdout and "linalg.cpp" in done.stdout
    assert "pip" not in done.stdout and "python" not in done.stdout


def test_eigen_of_the_system_is_found(checkout):
    for name in ("gcc", "g++", "cc"):
        program(checkout, name, "x86_64-linux-gnu")
    program(checkout, "pkg-config", "-I/opt/from/pkgconfig/eigen3")
    assert "-isystem /opt/from/pkgconfig/eigen3" in make(checkout, "-n", "lib", "CC=gcc").stdout


def test_without_eigen_and_python_the_remedy_is_shown(checkout):
    done = make(checkout, ".venv/.ready")
    assert done.returncode != 0
    assert "install libeigen3-dev or set EIGEN=" in done.stderr


def test_a_cross_compiler_brings_its_tools_and_has_its_own_folder(checkout):
    program(checkout, "cc", "x86_64-linux-gnu")
    for name in ("gcc", "g++", "ar", "objcopy"):
        program(checkout, f"armv8x-none-linux-{name}", "armv8x-none-linux")
    done = make(checkout, "-n", "lib", "CC=armv8x-none-linux-gcc", "EIGEN=/opt/eigen")
    assert done.returncode == 0, done.stderr
    for name in ("gcc -std=c11", "g++ -std=c++14", "ar rcs", "objcopy --localize-hidden"):
        assert f"armv8x-none-linux-{name}" in done.stdout
    assert "build/armv8x-none-linux-release/libgait.so" in done.stdout and "build/release" not in done.stdout
    assert "avx" not in done.stdout


def test_a_library_without_threads_needs_none(tmp_path):
    """GAIT_NO_THREADS leaves out the pool: the object contains nothing of it and no threads of the system."""
    source = ROOT / "libgait/src/base/pool.c"
    options = ["-std=c11", "-Wpedantic", "-Werror", "-DGAIT_NO_THREADS", f"-I{ROOT}/libgait/include"]
    options += ["-iquote", f"{ROOT}/libgait/src", "-c"]
    subprocess.run(["cc", *options, source, "-o", tmp_path / "pool.o"], check=True)
    symbols = subprocess.run(["nm", tmp_path / "pool.o"], capture_output=True, text=True, check=True).stdout
    assert "pthread" not in symbols and "gait_pool" not in symbols


def test_the_bench_checks_all_options_before_it_measures(tmp_path):
    step = "build/release/bench/step"
    subprocess.run(["make", "-s", step], cwd=ROOT, timeout=600, check=True)
    for option, value in (
        *(("--particles", text) for text in ("2000,x", "0", "100,", "99999999999", "")),
        *(("--threads", text) for text in ("0", "1,257", "1,1,1,1,1,1,1,1,1")),
        *(("--csv", text) for text in (f"{tmp_path}/none/a.csv", f"{tmp_path}/none/")),
    ):
        words = [ROOT / step, option, value]
        done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
        assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
        assert value in done.stderr and (option in done.stderr or option == "--csv")


@pytest.mark.parametrize(
    ("words", "folder"), [((), "build/bench/"), (("ARGS=-s 9 --record",), "tests/bench/results/")]
)
def test_figures_of_a_machine_are_kept_only_if_asked(words, folder):
    done = subprocess.run(
        ["make", "-n", "bench", *words], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True
    )
    command = next(line for line in done.stdout.replace("\\\n", "").splitlines() if "bench/bench.py" in line)
    assert re.search(rf"--csv {folder}\S+\.csv \S+bench/step", command) and "--record" not in command
    assert ("--page tests/bench/results/bench.md" in command) == (folder == "tests/bench/results/")


def compile_one(checkout, *words: str) -> str:
    """What make does for one object, with this machine's compilers."""
    env = {
        k: v for k, v in os.environ.items() if not k.startswith("MAKE") and k not in ("CC", "CFLAGS", "OPT")
    }
    done = subprocess.run(
        ["make", "build/release/src/base/base.c.o", *words],
        cwd=checkout / "gait",
        env=env,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_objects_are_made_anew_for_other_options_only(checkout):
    made, kept = "CC   libgait/src/base/base.c", "is up to date"
    for options in ((), ("CFLAGS=-DX='\"it'\\''s\"'",), ("OPT=-O1",), ("CC=gcc", "CXX=g++"), ()):
        assert made in compile_one(checkout, *options), options
        assert kept in compile_one(checkout, *options), options
    assert "-DX" in compile_one(checkout, "-n", "CFLAGS=-DX") and kept in compile_one(checkout)


def test_a_source_with_flags_of_its_own_that_is_gone_is_named(checkout):
    for name in ("gcc", "g++", "cc"):
        program(checkout, name, "x86_64-linux-gnu")
    (checkout / "gait/libgait/src/base/fmath.c").unlink()
    done = make(checkout, "-n", "lib", "CC=gcc", "EIGEN=/opt/eigen")
    assert done.returncode != 0 and "flags.mk lists fmath.c, which libgait/src does not have" in done.stderr


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        (["CC=nocc"], "no C compiler 'nocc': install it or set CC="),
        (["CC=gcc", "CXX=nocxx"], "no C++ compiler 'nocxx': install it or set CXX="),
    ],
)
def test_a_missing_compiler_is_reported_before_anything_is_done(checkout, words, remedy):
    program(checkout, "gcc", "x86_64-linux-gnu")
    for target in ("lib", "test"):
        done = make(checkout, target, *words)
        assert done.returncode != 0 and done.stderr.count("\n") == 1 and remedy in done.stderr
    assert not (checkout / "gait/.venv").exists()


def test_a_folder_without_eigen_is_named(checkout):
    for name in ("gcc", "g++", "cc"):
        program(checkout, name, "x86_64-linux-gnu")
    done = make(checkout, "build/release/src/base/linalg.cpp.o", "CC=gcc", "EIGEN=/nonexistent")
    assert done.returncode != 0 and "no Eigen/Core in EIGEN=/nonexistent" in done.stderr


def test_another_cpu_is_built_for_but_not_tested(checkout):
    program(checkout, "cc", "x86_64-linux-gnu")
    for name in ("gcc", "g++", "ar", "objcopy"):
        program(checkout, f"armv8x-none-linux-{name}", "armv8x-none-linux")
    done = make(checkout, "test", "CC=armv8x-none-linux-gcc", "EIGEN=/opt/eigen")
    assert done.returncode != 0 and done.stderr.count("\n") == 1
    assert "`make lib tools CC=armv8x-none-linux-gcc` builds it" in done.stderr
