"""Each worked example of CONTRIBUTING.md, done in a copy of the sources."""

import os
import shutil
import subprocess
import sys

import pytest
from test_docs import ROOT, blocks

PAGE = ROOT / ".github/CONTRIBUTING.md"
BESIDE = ["test_abi", "drawn_person"]  # the copy needs these files of the tests as well


def section(title):
    """Blocks below a heading, in order."""
    text = PAGE.read_text(encoding="utf-8")
    first = text.count("\n", 0, text.index(f"## {title}\n"))
    last = first + text[text.index(f"## {title}\n") + 1 :].partition("\n## ")[0].count("\n")
    return [block for block in blocks(PAGE) if first < block.line <= last + 1]


def follow(steps, copy):
    """Write the files and make the edits of a section; the files that changed."""
    changed = []
    for step in steps:
        path = copy / (step.file or step.edit)
        changed.append(path)
        if step.file:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(step.text, encoding="utf-8")
            continue
        lines = step.text.splitlines()
        before = "\n".join(line[1:] for line in lines if line[:1] != "+")
        after = "\n".join(line[1:] for line in lines if line[:1] != "-")
        text = path.read_text(encoding="utf-8")
        assert text.count(before) == 1, f"{step.page}:{step.line}: not once in {step.edit}:\n{before}"
        path.write_text(text.replace(before, after), encoding="utf-8")
    return changed


def ran(*command, **options):
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, timeout=300, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def run_tests(copy, *tests, library=ROOT / "build/release/libgait.so"):
    """Run tests on the package in the copy."""
    env = {"PYTHONPATH": str(copy / "python"), "GAIT_LIBRARY": str(library)}
    command = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    ran(*command, *tests, cwd=copy, env=os.environ | env)


def copied(folder, copy):
    """Copy a folder of the sources."""
    shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))


@pytest.mark.parametrize("title", ["Add a command", "Add a file format"])
def test_the_python_examples_pass_their_tests(title, tmp_path):
    copied("python/gait", tmp_path)
    changed = follow([step for step in section(title) if step.file or step.edit], tmp_path)
    tests = [path for path in changed if path.name.startswith("test_")]
    run_tests(tmp_path, *tests)
    config = ["--config", ROOT / "python/pyproject.toml"]
    ran(ROOT / ".venv/bin/ruff", "check", *config, *[p for p in changed if p not in tests], cwd=tmp_path)


@pytest.mark.long
def test_the_likelihood_term_is_built_and_passes_its_test(tmp_path):
    for folder in ("libgait", "python/gait"):
        copied(folder, tmp_path)
    shutil.copy(ROOT / "Makefile", tmp_path)
    eigen = ROOT / ".venv/site/cmeel.prefix/include/eigen3"
    (tmp_path / "tests/python").mkdir(parents=True)
    tests = [shutil.copy(ROOT / f"tests/python/{name}.py", tmp_path / "tests/python") for name in BESIDE]
    changed = follow([step for step in section("Add a likelihood term") if step.file or step.edit], tmp_path)
    ran("make", "-j2", "lib", "OPT=-O1", "werror=", f"EIGEN={eigen}", cwd=tmp_path)
    tests = [tests[0], *[path for path in changed if path.name.startswith("test_")]]
    run_tests(tmp_path, *tests, "-k", "enumerations or term", library=tmp_path / "build/release/libgait.so")
