"""`gait learn` restarts itself with the kernels that every CPU has, once and if it can."""

import os
import platform
import subprocess
import sys
from types import SimpleNamespace

import pytest

from gait import reproducible

PROGRAM = "from gait.cli import main; raise SystemExit(main())"
SHOW = """
from gait import reproducible
reproducible.settle()
print(reproducible.chosen() == reproducible.COMMON)
"""
NOWHERE = ["learn", "nowhere", "-o", "m.gait"]
PLAIN = {name: value for name, value in os.environ.items() if name not in reproducible.COMMON}


def python(*words, stdin="", **environment):
    return subprocess.run(
        [sys.executable, *words],
        input=stdin,
        env=PLAIN | environment,
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.skipif(
    platform.machine() != "x86_64" or os.name != "posix", reason="kernels are chosen elsewhere"
)
def test_a_program_starts_anew_with_its_command_line():
    assert python("-c", SHOW).stdout == "True\n"
    assert python("-c", SHOW, **reproducible.COMMON).stdout == "True\n"


def test_numpy_may_lack_features_where_warnings_are_errors():
    done = python("-c", f"{SHOW}import numpy", PYTHONWARNINGS="error")
    assert done.returncode == 0 and not done.stderr


@pytest.mark.parametrize("words", [["-m", "gait"], ["-c", PROGRAM]])
def test_the_command_is_the_same_afterwards(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = python(*words, *NOWHERE)
    assert done.returncode == 1 and done.stderr.startswith("gait learn: nowhere: no such file")


def test_a_program_on_stdin_is_not_lost(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = python("-", *NOWHERE, stdin=PROGRAM)
    assert done.returncode == 1 and done.stderr.startswith("gait learn: nowhere: no such file")


def test_an_environment_that_is_set_back_ends(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sitecustomize.py").write_text("import os; os.environ['OPENBLAS_CORETYPE'] = 'Haswell'\n")
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    done = python("-m", "gait", *NOWHERE, PYTHONPATH=path)
    assert done.returncode == 1 and done.stderr.startswith("gait learn: nowhere: no such file")


def test_workers_elsewhere_are_left_as_the_command_is(monkeypatch):
    """Both or neither: a cluster of other machines was rejected with the remedy that it had followed."""
    monkeypatch.setattr(os, "uname", lambda: SimpleNamespace(machine="aarch64"))
    for name in reproducible.COMMON:
        monkeypatch.delenv(name, raising=False)
    reproducible.dask_setup(None)
    reproducible.settle()
    assert reproducible.chosen() == {}
