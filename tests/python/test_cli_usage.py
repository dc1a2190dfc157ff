"""The command line itself: help, versions, options out of their range, exit codes."""

import argparse
import errno
import io
import json
import os
import re
import resource
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import gait
from gait.batch import project
from gait.bindings import abi
from gait.bindings.config import TrackerConfig
from gait.body.skeleton import JOINTS
from gait.cli import COMMANDS, _joined, _parser, main, parser_of, values
from gait.errors import UserError
from gait.io import keypoints_file


@pytest.mark.parametrize(
    "words",
    [[], ["dance"], ["track"], ["track", "v.mp4", "--camera", "c.json", "-o", "o.csv", "--threads", "0"]]
    + [["eval", "o.csv"], ["track", "v", "--camera", "c", "-o", "o", "--start", "-1"], ["render"]]
    + [["render", "t.csv", "-o", "o.png"], ["demo", "walk.mp4"]],
)
def test_usage_errors_exit_2(words, capsys):
    with pytest.raises(SystemExit) as caught:
        main(words)
    err = capsys.readouterr().err
    assert caught.value.code == 2 and err.count("\n") == 1 and (words or "see gait --help" in err)
    assert re.match(rf"gait{' ' + words[0] if words and words[0] in COMMANDS else ''}: error: ", err)


OUTPUTS = {"output", "overlay", "camera_out", "cameras_out", "trc", "log", "print_board", "save"}


def test_outputs_of_another_kind_are_refused_before_anything_is_read():
    """A page in a .pdf, or a camera in a .txt, would be written and could then not be read by anything."""
    elsewhere = ("learn", "export")  # with all that they are given, and by the kinds that are written
    outputs = [
        (command, action)
        for command in COMMANDS
        for action in parser_of(command)._actions
        if action.dest in OUTPUTS and action.metavar != "DIR" and command not in elsewhere
    ]
    assert len(outputs) > 15
    for command, output in outputs:
        with pytest.raises(argparse.ArgumentTypeError, match="a.xyz: has the wrong suffix"):
            assert output.type, f"gait {command} --{output.dest} takes any name"
            output.type("a.xyz")


def test_the_version_is_that_of_package_and_library(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f"gait {gait.__version__} libgait {gait.__version__} abi {abi.ABI}\n"


def test_threads_end_where_the_pool_does():
    header = Path(__file__).parents[2] / "libgait/include/gait_pool.h"
    assert f"#define GAIT_POOL_MAX {values.THREADS[1]} " in header.read_text(encoding="utf-8")


RANGES = [
    *((f"--particles {n}", f"{n}: give a whole number from 16 to 1048576") for n in ("5", "0", "-3", "1e8")),
    *((f"--threads {n}", f"{n}: give a whole number from 1 to 256") for n in ("0", "9999")),
    *((f"--seed {n}", f"from 0 to {2**64 - 1}") for n in ("-1", str(2**64))),
    *((f"--height {m}", f"{m}: is not a stature; give metres from 0.5 to 2.5") for m in ("17", "nan", "x")),
    ("--start 50 --stop 20", "--stop 20: must be greater than --start 50"),
    ("--keypoints-sd 0", "0: give a number above 0"),
    ("--keypoints-sd 3", "--keypoints-sd: needs --keypoints"),
    ("--stop 0", "--stop 0: must be greater than --start 0"),
]


@pytest.mark.parametrize("options, words", RANGES, ids=[r[0] for r in RANGES])
def test_values_out_of_range_are_usage_errors(options, words, capsys):
    name, value = options.split(" ", 1)
    try:
        code = main(["track", "v.mp4", "--camera", "c.json", "-o", "o.csv", *f"{name}={value}".split(" ")])
    except SystemExit as exc:
        code = exc.code
    assert code == 2 and words in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    text = capsys.readouterr().out
    assert caught.value.code == 0 and f"usage: gait {command}" in text and "--quiet" in text


@pytest.mark.parametrize("command", ["track", "demo"])
def test_the_help_names_the_defaults_of_the_library(command, capsys):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    assert f"(default: {TrackerConfig.default().particles}, in" in " ".join(capsys.readouterr().out.split())


def test_help_without_a_library(tmp_path):
    words = [sys.executable, "-m", "gait", "track", "--help"]
    nowhere = os.environ | {"GAIT_LIBRARY": str(tmp_path / "none.so")}
    done = subprocess.run(words, env=nowhere, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "particle set" in done.stdout, done.stderr


def test_the_list_of_commands(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    assert all(re.search(rf"^    {command}\s", text, re.MULTILINE) for command in COMMANDS)


def test_the_module_runs_and_passes_the_exit_code(tmp_path):
    words = [sys.executable, "-m", "gait", "eval", "track.csv", "--truth", "none.csv"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "gait eval: none.csv: no such truth file; check the name\n"


def test_too_little_memory_is_one_line(tmp_path):
    """Only as much memory as loading takes: a picture needs more than that."""
    limited = "import resource, gait.cli.simulate, gait.simulate.clip, numpy as np\n" + (
        "used = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 28),) * 2)\n"
        f"raise SystemExit(gait.cli.main(['simulate', '--size', '4096x4096', '-o', {str(tmp_path / 'o')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", limited], capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1 and done.stderr.startswith("gait simulate: not enough memory")


def test_an_error_without_a_text_still_states_the_remedy(monkeypatch, capsys):
    def fail(_):
        raise MemoryError

    monkeypatch.setattr("gait.cli.info.run", fail)
    assert main(["info", "walk"]) == 1
    assert capsys.readouterr().err == "gait info: not enough memory: close other programs or give less\n"


def test_a_full_disk_is_not_blamed_on_the_standard_output(monkeypatch, capsys):
    def fail(args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("gait.cli.info.run", fail)
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BytesIO()))
    assert main(["info", "walk"]) == 1
    assert capsys.readouterr().err == "gait info: file: No space left on device\n"


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_standard_output_is_named(unbuffered):
    """The error comes at the end, or where a command prints."""
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "gait", "info", "walk"],
            stdout=full, stderr=subprocess.PIPE, text=True, env=environment, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, "gait info: standard output: No space left on device\n")


@pytest.mark.parametrize(
    ("read", "what"),
    [(project.read, "project"), (lambda path: keypoints_file.read(path, JOINTS), "file of keypoints")],
)
def test_a_device_which_may_never_end_is_refused(read, what):
    words = f"/dev/null: is a device or a pipe, not a file; write the {what} to a file first"
    with pytest.raises(UserError, match=words):
        read("/dev/null")


HELP = """
import contextlib, io, json, sys
from gait import extras
from gait.cli import COMMANDS, main
heavy = {"numpy", *(m for brought in extras.EXTRAS.values() for m in brought)} - {"lcm"}  # which is small
found = {}
for command in COMMANDS:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
        main([*command.split(), "--help"])
    found[command] = sorted(heavy & set(sys.modules))
    if found[command]:
        break  # the others would be blamed for it too
print(json.dumps(found))
"""


def test_help_loads_nothing_heavy():
    done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, check=True)
    assert {command: modules for command, modules in json.loads(done.stdout).items() if modules} == {}


@pytest.mark.parametrize("command", ["", "track", "lift", "report lift"])
def test_help_answers_in_three_tenths_of_a_second(command):
    """CPU time, because other programs may keep this machine busy; the best of three."""

    def spent():
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    times = []
    for _ in range(3):
        before = spent()
        words = [sys.executable, "-m", "gait", *command.split(), "--help"]
        subprocess.run(words, capture_output=True, check=True)
        times.append(spent() - before)
    assert min(times) < 0.3, times


def examples(command):
    """Commands that the help of a command ends with, as words."""
    text = getattr(import_module(f"gait.cli.{COMMANDS[command].module}"), "EXAMPLES", "")
    lines = text.replace("\\\n", " ").splitlines()
    return [shlex.split(line, comments=True) for line in lines if "gait " in line]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_help_has_examples_that_parse(command):
    found = examples(command)
    assert len(found) >= 2 and found[0][: len(command.split()) + 1] == ["gait", *command.split()]
    for _, *words in found:
        if " ".join(words[:2]) in COMMANDS:
            words[:2] = [" ".join(words[:2])]
        assert _parser(words).parse_args(list(_joined(words))).command in COMMANDS
