"""What README.md tells people to type works."""

import csv
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from example_scene import drawn_walk

from gait.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / ".venv" / "bin"
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
ENV = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")} | {
    "PATH": f"{BIN}:{os.environ['PATH']}"
}


def blocks(language: str) -> list[str]:
    """Fenced blocks of one language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", TEXT, re.M | re.S)


def commands(program: str) -> list[str]:
    """Shell commands that begin with the program."""
    lines = "".join(blocks("sh")).replace("\\\n", " ").splitlines()
    return [line.split("#")[0].strip() for line in lines if re.match(rf"{re.escape(program)}\b", line)]


def run(*command: object, **options: object) -> subprocess.CompletedProcess[str]:
    """Run and show what it said if it fails."""
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, env=ENV, timeout=300, **options
    )
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done


@pytest.mark.parametrize("command", commands("make"))
def test_make_targets_exist(command):
    run(*command.split(), "--dry-run", cwd=ROOT)
    target = command.split()[1]
    assert f" {target} " in run("make", "help", cwd=ROOT).stdout


@pytest.mark.parametrize("command", [*commands("gait"), *commands("build/bin/gait-trackd")])
def test_options_exist(command):
    words = command.split()
    long = " ".join(words[1:3]) in COMMANDS  # such as gait report lift
    program = words[: 3 if long else 2] if words[0] == "gait" else words[:1]
    text = run(*program, "--help", cwd=ROOT).stdout
    options = [w.split("=")[0] for w in words if re.match(r"--?[a-z]", w)]
    assert [o for o in options if not re.search(rf"(^|[\s,\[]){re.escape(o)}\b", text, re.M)] == []


def test_every_command_is_named():
    text = run("gait", "--help").stdout
    names = re.findall(r"^    (\w+)  ", text, re.M)
    assert names
    assert [n for n in names if f"`gait {n}`" not in TEXT] == []


def test_every_file_and_folder_named_is_there():
    links = re.findall(r"\]\(([^)#:]+)\)", TEXT)
    assert links
    assert [p for p in links if not (ROOT / p).exists()] == []


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Folder in which the commands of "From a video to a track" were run."""
    folder = tmp_path_factory.mktemp("readme")
    (block,) = (b for b in blocks("sh") if "gait simulate" in b and "gait track" in b)
    run("sh", "-e", "-c", block, cwd=folder)
    return folder


def test_the_commands_track_the_clip(walk):
    rows = (walk / "track.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) > 30
    assert rows[0].startswith("frame,time,status,phase")


def test_the_python_example_follows_the_walker(walk):
    code, _ = blocks("python")
    done = run(BIN / "python", "-c", code, cwd=walk)
    *rows, last = done.stdout.splitlines()
    found = {int(row.split()[0]): float(row.split()[1]) for row in rows}
    with (walk / "walk/truth.csv").open(encoding="utf-8", newline="") as f:
        truth = {int(row["frame"]): float(row["pelvis_x"]) for row in csv.DictReader(f)}
    assert sorted(found) == sorted(truth)
    assert np.median([abs(found[k] - truth[k]) for k in truth]) < 0.1
    assert re.fullmatch(r"\d+ bytes, digest [0-9a-f]{16}", last)


def test_the_lifter_example_follows_a_knee(walk):
    _, code = blocks("python")
    rows = [row.split() for row in run(BIN / "python", "-c", code, cwd=walk).stdout.splitlines()]
    with (walk / "walk/truth.csv").open(encoding="utf-8", newline="") as f:
        truth = [[float(row[f"l_knee_{axis}"]) for axis in "xyz"] for row in csv.DictReader(f)]
    off = [np.linalg.norm(np.array(row[1:4], float) - truth[int(row[0])]) for row in rows]
    assert len(off) > len(truth) - 20
    assert np.median(off) < 0.4  # how far away somebody of unknown stature is


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The C example, built against the library."""
    folder = tmp_path_factory.mktemp("example")
    (code,) = blocks("c")
    (folder / "example.c").write_text(code, encoding="utf-8")
    flags = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", f"-I{ROOT}/libgait/include"]
    library = ROOT / "build/release/libgait.a"
    run("cc", *flags, folder / "example.c", library, "-lm", "-o", folder / "example")
    return folder / "example"


def test_the_c_example_follows_a_drawn_walker(example):
    _, pictures, places = drawn_walk(60)
    shipped = ROOT / "python/gait/data/walk.gait"
    done = subprocess.run(
        [example, shipped], input=b"".join(p.tobytes() for p in pictures), capture_output=True, timeout=300
    )
    assert done.returncode == 0, done.stdout
    found = [float(line.split()[0]) for line in done.stdout.decode().splitlines()]
    assert len(found) == 60
    assert np.abs(np.array(found) - places)[30:].max() < 0.15


def test_the_c_example_refuses_a_file_that_is_no_model(example):
    done = subprocess.run([example, ROOT / "README.md"], input=b"", capture_output=True, timeout=60)
    assert done.returncode == 1
    assert done.stdout.strip()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["/nonexistent"], "/nonexistent: cannot be read\n"),
        (["/dev/null"], "/dev/null: is empty or too large for a model\n"),
        ([], "usage: example MODEL.gait < 640x480 grey frames\n"),
    ],
)
def test_the_c_example_says_what_is_wrong_with_its_argument(example, words, said):
    done = subprocess.run([example, *words], input=b"", capture_output=True, timeout=60)
    assert (done.returncode, done.stdout.decode()) == (1, said)
