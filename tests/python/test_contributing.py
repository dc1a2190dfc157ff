"""Each worked example of CONTRIBUTING.md, done in a copy of the sources."""

import os
import shutil
import subprocess
import sys

import pytest
from test_docs import FLAGS, ROOT, blocks

PAGE = ROOT / ".github/CONTRIBUTING.md"


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


def run_tests(copy, *tests):
    """Run tests on the package in the copy."""
    env = {"PYTHONPATH": str(copy / "python"), "GAIT_LIBRARY": str(ROOT / "build/release/libgait.so")}
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


def test_the_likelihood_term_compiles_and_python_knows_it(tmp_path):
    for folder in ("libgait/src", "libgait/include", "python/gait"):
        copied(folder, tmp_path)
    changed = follow([step for step in section("Add a likelihood term") if step.file or step.edit], tmp_path)
    include = [f"-I{tmp_path}/libgait/include", "-iquote", tmp_path / "libgait/src"]
    for path in {path for path in changed if path.suffix == ".c"}:
        ran("cc", *FLAGS, *include, "-fsyntax-only", path)
    (tmp_path / "tests/python").mkdir(parents=True)
    test = shutil.copy(ROOT / "tests/python/test_abi.py", tmp_path / "tests/python")
    run_tests(tmp_path, test, "-k", "enumerations")
