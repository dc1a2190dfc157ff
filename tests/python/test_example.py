"""The C example tracks a drawn person, built with pkg-config."""

import csv
import os
import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from example_scene import drawn_walk

from gait.cli import main

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "libgait/doc/example.c"
MODEL = ROOT / "python/gait/data/walk.gait"
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
FRAMES = 60


def make(*words: str) -> None:
    """Run make on its own, not as part of the make that may run these tests."""
    env = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
    subprocess.run(
        ["make", "-s", *words], cwd=ROOT, env=env, check=True, stdout=subprocess.DEVNULL, timeout=600
    )


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Folder of PGM pictures, and the true x of the pelvis in each."""
    folder = tmp_path_factory.mktemp("pgm")
    plate, pictures, places = drawn_walk(FRAMES)
    cv2.imwrite(str(folder / "empty.pgm"), plate)
    (folder / "scene.txt").write_text("800 800 320 240\n1 0 0  0 0 -1  0 1 0\n0 1.4 8\n-1 0 0\n")
    for i, picture in enumerate(pictures):
        cv2.imwrite(str(folder / f"frame{i:02d}.pgm"), picture)
    return folder, places


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Start of the command that runs the example, built against an installed library."""
    if not shutil.which("pkg-config"):
        pytest.skip("pkg-config is not installed")
    there = tmp_path_factory.mktemp("root")
    make("install", f"DESTDIR={there}", "PREFIX=/opt/gait")
    env = {
        "PATH": "/usr/bin:/bin",
        "PKG_CONFIG_PATH": str(there / "opt/gait/lib/pkgconfig"),
        "PKG_CONFIG_SYSROOT_DIR": str(there),
    }
    command = ["pkg-config", "--cflags", "--libs", "gait"]
    flags = subprocess.run(command, env=env, check=True, capture_output=True, text=True).stdout.split()
    rpath = f"-Wl,-rpath,{there}/opt/gait/lib"
    subprocess.run(["cc", *FLAGS, SOURCE, "-o", there / "example", *flags, rpath], check=True)
    return [there / "example"]


def track(program, folder) -> str:
    """What the example prints."""
    pictures = sorted(folder.glob("frame*.pgm"))
    done = subprocess.run(
        [*program, MODEL, folder / "scene.txt", folder / "empty.pgm", *pictures],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_example_follows_a_drawn_person(program, walk):
    folder, places = walk
    *rows, digest = track(program, folder).splitlines()
    found = np.array([float(row.split()[2]) for row in rows])
    assert len(found) == FRAMES and digest.startswith("digest ")
    assert np.abs(found - places)[30:].max() < 0.1
    assert rows[-1].endswith("status 1")


def test_the_example_follows_the_person_of_a_clip(program, tmp_path):
    """As in the C how-to: a clip of gait simulate, made into pictures and numbers by example_clip.py."""
    clip = tmp_path / "walk"
    simulate = ["simulate", "-o", str(clip), "--quiet", "--size", "640x480", "--frames", "24"]
    assert main(simulate) == 0
    python = ROOT / ".venv/bin/python"
    subprocess.run([python, ROOT / "libgait/doc/example_clip.py", clip], check=True, timeout=300)
    pictures = sorted(clip.glob("frame*.pgm"))
    command = [*program, MODEL, clip / "scene.txt", clip / "empty.pgm", *pictures]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    found = [float(row.split()[2]) for row in done.stdout.splitlines()[:-1]]
    with open(clip / "truth.csv", encoding="utf-8") as truth:
        places = [float(row["pelvis_x"]) for row in csv.DictReader(truth)]
    assert len(found) == len(pictures) == 24
    assert np.abs(np.array(found) - places)[15:].max() < 0.2


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        ([], 2, "usage: example MODEL.gait SCENE.txt EMPTY.pgm FRAME.pgm..."),
        (["/nonexistent", "a", "b", "c"], 1, "/nonexistent: cannot be read\n"),
        ([MODEL, "/dev/null", "b", "c"], 1, "/dev/null: not 19 numbers"),
    ],
)
def test_the_example_reports_what_is_wrong(program, words, code, message):
    done = subprocess.run([*program, *words], capture_output=True, text=True, timeout=60)
    assert done.returncode == code and done.stderr.startswith(message)
