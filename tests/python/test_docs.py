"""The commands and snippets of the README and the pages of libgait/doc work, in the order of each page.

Every fenced block of a page runs in one folder: `sh` and `python` are executed, `c` is compiled, `json`
parsed. A comment before a block changes that: `<!-- file: NAME -->` writes it to a file, `<!-- skip: REASON
-->` only checks its commands, targets and options. `gait simulate -o walk` gives a clip that is shorter and
smaller than the default.
"""

import contextlib
import csv
import io
import json
import os
import re
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import mocap_files
import numpy as np
import pytest
from example_scene import drawn_walk

import gait
import gait.cli
from gait.camera.camera import write_lens
from gait.cli import COMMANDS
from gait.report import plots
from gait.report.figures import Drawing

ROOT = Path(__file__).resolve().parents[2]
DOC = ROOT / "libgait/doc"
BIN = ROOT / ".venv/bin"
SHORT = ["--frames", "32", "--fps", "12", "--size", "400x300", "--quiet"]
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
RUN = [ROOT / "README.md", *sorted(DOC.rglob("*.md"))]
PAGES = [*RUN, ROOT / ".github/CONTRIBUTING.md"]  # the last has separate tests
ENV = {k: v for k, v in os.environ.items() if not k.startswith("MAKE")}
# The README's lines of C stand among declarations that their names speak for.
AMONG = """#include <gait.h>
#include <stdio.h>
void lines(void *blob, size_t blob_bytes, const gait_tracker_config *from, int (*next_frame)(gait_frame *));
void lines(void *blob, size_t blob_bytes, const gait_tracker_config *from, int (*next_frame)(gait_frame *))
{
    static _Alignas(GAIT_ALIGN) unsigned char model_memory[1 << 16], tracker_memory[8 << 20];
    gait_tracker_config config = *from;
    gait_model *model; gait_tracker *tracker; gait_error err;
    gait_state mean = {0}, sd = {0}; gait_frame frame = {0}; gait_estimate estimate;
%s}
"""


@dataclass(frozen=True)
class Block:
    """One fenced block of a page."""

    page: str
    line: int
    language: str
    text: str
    file: str = ""
    edit: str = ""
    skip: str = ""

    @property
    def commands(self) -> list[str]:
        """Commands of a shell block, one a line."""
        lines = self.text.replace("\\\n", " ").splitlines()
        return [re.sub(r"\s+#.*", "", line).strip() for line in lines if self.language == "sh" and line]


def blocks(page: Path) -> list[Block]:
    """Fenced blocks of a page with their directives."""
    text = page.read_text(encoding="utf-8")
    found = re.finditer(r"(?:^<!-- (\w+): ([^\n]*) -->\n)?^```(\w+)\n(.*?)^```$", text, re.M | re.S)
    return [
        Block(
            page.relative_to(ROOT).as_posix(),
            text.count("\n", 0, m.start(3)) + 1,
            m[3],
            m[4],
            **({m[1]: m[2]} if m[1] else {}),
        )
        for m in found
    ]


ALL = {page: blocks(page) for page in PAGES}


def run(*command, **options):
    """Run a command; show its output if it fails."""
    options = {"env": ENV, "timeout": 300} | options
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, **options)
    assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
    return done


@pytest.fixture(scope="session")
def clip(tmp_path_factory):
    """The clip of the pages."""
    folder = tmp_path_factory.mktemp("clip") / "walk"
    assert gait.cli.main(["simulate", "-o", str(folder), *SHORT]) == 0
    return folder


@pytest.fixture(scope="session")
def installed(tmp_path_factory):
    """Environment in which pkg-config finds the library, and a `gait` that copies the clip."""
    folder = tmp_path_factory.mktemp("installed")
    run("make", "-s", "install", f"DESTDIR={folder}", "PREFIX=/opt/gait", cwd=ROOT)
    return ENV | {
        "PKG_CONFIG_PATH": str(folder / "opt/gait/lib/pkgconfig"),
        "PKG_CONFIG_SYSROOT_DIR": str(folder),
        "LD_LIBRARY_PATH": str(folder / "opt/gait/lib"),
    }


@pytest.fixture
def folder(tmp_path, clip, installed):
    """Folder for the blocks of one page, in which the repository's folders can be named."""
    for name in ("libgait", "python", "build", ".venv"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "bin").mkdir()
    shim = tmp_path / "bin/gait"
    shim.write_text(
        f'#!/bin/sh\n[ "$*" = "simulate -o walk" ] && exec cp -r {clip} walk\nexec {BIN}/gait "$@"\n'
    )
    shim.chmod(0o755)
    return tmp_path


def execute(block, folder, clip, env):
    """Do with a block what a reader does."""
    if block.file:
        (folder / block.file).parent.mkdir(parents=True, exist_ok=True)
        (folder / block.file).write_text(block.text, encoding="utf-8")
    if block.language == "python" and block.skip:
        compile(block.text, block.page, "exec")
    elif block.language == "json":
        json.loads(block.text)
    elif block.skip:
        pass
    elif block.language == "c":
        whole = "int main(" in block.text
        (folder / "block.c").write_text(block.text if whole else AMONG % block.text, encoding="utf-8")
        run("cc", *FLAGS, f"-I{ROOT}/libgait/include", "-fsyntax-only", "block.c", cwd=folder)
    elif block.language == "python":
        python_here(block.text)
    elif block.language == "sh" and all(re.match(r"gait [^$>|]*$", line) for line in block.commands):
        for line in block.commands:  # here, as importing takes longer than most of them
            gait_here(*shlex.split(line)[1:], clip=clip)
    elif block.language == "sh":
        run("sh", "-ec", block.text, cwd=folder, env=env)


def gait_here(*words, clip):
    """Run a gait command in this process."""
    if words == ("simulate", "-o", "walk"):
        shutil.copytree(clip, "walk")
        return
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        code = gait.cli.main(words)
    assert code == 0, f"gait {words}: {out.getvalue()}"


def python_here(text):
    """What a program prints, run in this process because importing takes longer than most programs."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(text, "block", "exec"), {"__name__": "__main__"})
    return out.getvalue()


def stand_in(clip, folder):
    """The clip and its camera for the video, lens and tape marks of a reader of the tutorial."""
    shutil.copy(clip / "video.mp4", folder / "phone.mp4")
    camera = gait.Camera.read(clip / "camera.json")
    write_lens(folder / "lens.json", camera, "stands in")
    marks = np.array([[-1, -0.5, 0], [1, -0.5, 0], [-1.5, 1, 0], [1.5, 1, 0], [0, 0, 0]])
    at = (camera.R @ marks.T).T + camera.t
    u, v = camera.fx * at[:, 0] / at[:, 2] + camera.cx, camera.fy * at[:, 1] / at[:, 2] + camera.cy
    rows = [f"{a:.2f},{b:.2f},{x},{y}" for a, b, (x, y, _) in zip(u, v, marks, strict=True)]
    (folder / "points.csv").write_text("\n".join(["u,v,x,y", *rows, ""]))


@pytest.mark.long
@pytest.mark.parametrize("page", [p for p in RUN if ALL[p]], ids=lambda p: p.relative_to(ROOT).as_posix())
def test_the_blocks_of_a_page_work(page, folder, clip, installed, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(Drawing, "png", lambda self: b"PNG")  # figures take most of the time of a page
    monkeypatch.setattr(plots, "_text", lambda figure, label: "<svg></svg>")  # and have separate tests
    todo = ALL[page]
    if any("pkg-config" in block.text for block in todo) and not shutil.which("pkg-config"):
        pytest.skip("pkg-config is not installed")
    if page.name == "README.md":
        shutil.copytree(clip, folder / "walk")
    if page.name == "learn.md":
        mocap_files.write_trials(folder / "my_mocap", 2)
    if page.name == "tutorial.md":
        stand_in(clip, folder)
    env = installed | {"PATH": f"{folder}/bin:{BIN}:{os.environ['PATH']}"}
    for block in todo:
        try:
            execute(block, folder, clip, env)
        except (AssertionError, ValueError) as fault:
            pytest.fail(f"{block.page}:{block.line}: {fault}")


COMMANDS_SHOWN = sorted({c for page in PAGES for block in ALL[page] for c in block.commands})


@pytest.mark.parametrize("command", [c for c in COMMANDS_SHOWN if c.startswith("make ")])
def test_make_targets_exist(command):
    shown = run("make", "help", cwd=ROOT).stdout
    targets = [word for word in command.split("&&")[0].split()[1:] if not re.search("[=/]", word)]
    assert [t for t in targets if f" {t} " not in shown] == []


def helped(words, shown={}):  # noqa: B006 - kept from call to call
    """Help text of the program that the words begin with."""
    if words[0] == "gait":
        program = ["gait", *words[1 : 3 if " ".join(words[1:3]) in COMMANDS else 2]]
    else:
        program = words[:1]
    key = " ".join(program)
    if key not in shown and words[0] == "gait":
        text = io.StringIO()
        with contextlib.redirect_stdout(text), pytest.raises(SystemExit):
            gait.cli.main([*program[1:], "--help"])
        shown[key] = text.getvalue()
    elif key not in shown:
        shown[key] = run(ROOT / words[0], "--help").stdout
    return shown[key]


OPTION = r"(?<![\w-])--?[a-z][\w-]*"


def test_options_exist():
    unknown = []
    for command in COMMANDS_SHOWN:
        words = command.split()
        if words[0] in ("gait", "build/bin/gait-trackd"):
            known = {*re.findall(OPTION, helped(words)), "--version"}
            unknown += [(command, o) for o in re.findall(OPTION, command) if o not in known]
    assert unknown == []


def test_options_named_in_the_text_exist():
    """`--option` in prose is an option of some command."""
    texts = [helped(["gait", *name.split()]) for name in COMMANDS] + [helped(["build/bin/gait-trackd"])]
    known = set(re.findall(OPTION, " ".join(texts)))
    known |= {
        "--version",
        "--record",
        "--runs",
        "--seeds",
        "--only",
        "--preload-nanny",
        "--static",
        "--strict",
        "--clips",
        "--arms",
        "--add-architecture",
        "--keep",
        "--add",
        "--seconds",
        "--real-time",
    }  # of others
    unknown = []
    for page in PAGES:
        if page.name == "changelog.md":  # which lists old names
            continue
        text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        quoted = re.findall(r"`([^`\n]+)`", text)
        options = [o for words in quoted for o in re.findall(r"(?<![\w-])--[a-z][\w-]*", words)]
        unknown += [(page.name, o) for o in options if o not in known]
    assert unknown == []


def test_files_named_in_the_text_exist():
    """Paths from the top of the repository, and test programs."""
    missing = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        made = {block.file for block in ALL[page]}
        names = re.findall(r"`((?:libgait|python|tests|tools|lcm_types|\.github)/[\w./-]*\w)`", text)
        names += [f"tests/unit/{name}.c" for name in re.findall(r"build/release/unit/(test_\w+)", text)]
        missing += [
            (page.name, name)
            for name in names
            if name not in made and "NAME" not in name and not (ROOT / name).exists()
        ]
    assert missing == []


def test_the_architecture_shows_every_folder():
    text = (DOC / "architecture.md").read_text(encoding="utf-8")
    layers = [(ROOT / f"{part}/LAYERS").read_text(encoding="utf-8") for part in ("libgait", "python")]
    names = [[word for line in lines.splitlines() for word in line.split("#")[0].split()] for lines in layers]
    folders = [name for name in names[1] if (ROOT / "python/gait" / name).is_dir() and "/" not in name]
    assert [name for name in names[0] if f"### {name}\n" not in text] == []
    assert [name for name in folders if f"| `{name}` | " not in text] == []


def test_every_command_has_a_place_in_the_docs():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [name for name in COMMANDS if f"`gait {name}" not in text and f"gait {name} " not in text] == []


def test_every_public_name_has_a_place_in_the_reference():
    text = (DOC / "reference/python-api.md").read_text(encoding="utf-8")
    names = re.findall(r"^::: gait\.(\w+)$", text, re.M)
    assert set(names) == set(gait.__all__) - {"__version__"}


def output_of(page, start, folder):
    """Output of a page's first Python block that begins with these words, with the clip in the folder."""
    (block,) = (b for b in ALL[DOC / page] if b.language == "python" and start in b.text)
    with (folder / "walk/truth.csv").open(encoding="utf-8", newline="") as f:
        return python_here(block.text).splitlines(), list(csv.DictReader(f))


@pytest.fixture
def beside(tmp_path, clip, monkeypatch):
    """The working folder, which has the clip."""
    shutil.copytree(clip, tmp_path / "walk")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_tracker_of_the_python_page_follows_the_person(beside):
    (*rows, last), truth = output_of("howto/python.md", "tracker.start", beside)
    found = {int(row.split()[0]): float(row.split()[1]) for row in rows}
    assert sorted(found) == [int(row["frame"]) for row in truth]
    assert np.median([abs(found[int(row["frame"])] - float(row["pelvis_x"])) for row in truth]) < 0.1
    assert re.fullmatch(r"\d+ bytes, digest [0-9a-f]{16}", last)


def test_the_detector_of_the_python_page_finds_a_knee(beside, fetched):
    rows, truth = output_of("howto/python.md", "PeopleDetector", beside)
    assert {row.split()[0] for row in rows} == {"1"} and len(rows) > len(truth) / 2
    knee = [[float(row[f"l_knee_{axis}"]) for axis in "uv"] for row in truth]
    off = [np.hypot(*np.array(row.split()[2:], float) - knee[int(row.split()[1])]) for row in rows]
    assert np.nanmedian(off) < 8  # of a person about 150 pixels tall
    assert Path("keypoints.csv").stat().st_size > 1000


def test_the_lifter_of_the_python_page_follows_a_knee(beside):
    rows, truth = output_of("howto/python.md", "lifter.push", beside)
    knee = [[float(row[f"l_knee_{axis}"]) for axis in "xyz"] for row in truth]
    off = [np.linalg.norm(np.array(row.split()[1:4], float) - knee[int(row.split()[0])]) for row in rows]
    assert len(off) > len(truth) - 20
    assert np.median(off) < 0.4  # the distance of a person of unknown stature


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The whole program of the C page."""
    folder = tmp_path_factory.mktemp("example")
    (block,) = (b for b in ALL[DOC / "howto/c.md"] if b.file == "example.c")
    (folder / "example.c").write_text(block.text, encoding="utf-8")
    library = ROOT / "build/release/libgait.a"
    run(
        "cc",
        *FLAGS,
        f"-I{ROOT}/libgait/include",
        folder / "example.c",
        library,
        "-lm",
        "-o",
        folder / "example",
    )
    return folder / "example"


def test_the_c_program_follows_a_drawn_person(example):
    _, pictures, places = drawn_walk(60)
    shipped = ROOT / "python/gait/data/walk.gait"
    frames = b"".join(p.tobytes() for p in pictures)
    done = subprocess.run([example, shipped], input=frames, capture_output=True, timeout=300)
    assert done.returncode == 0, done.stdout
    found = [float(line.split()[0]) for line in done.stdout.decode().splitlines()]
    assert len(found) == 60
    assert np.abs(np.array(found) - places)[30:].max() < 0.15


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([ROOT / "README.md"], ""),
        (["/nonexistent"], "/nonexistent: cannot be read\n"),
        (["/dev/null"], "/dev/null: is empty or too large for a model\n"),
        ([], "usage: example MODEL.gait < 640x480 grey frames\n"),
    ],
)
def test_the_c_program_reports_a_wrong_argument(example, words, message):
    done = subprocess.run([example, *words], input=b"", capture_output=True, timeout=60)
    assert done.returncode == 1 and done.stdout.strip()
    assert not message or done.stdout.decode() == message


def json_of(page, name):
    """A JSON file that a page shows."""
    (block,) = (b for b in ALL[DOC / page] if b.file == name)
    return block.text


def test_the_camera_and_the_start_of_the_camera_page_are_as_described(tmp_path):
    (tmp_path / "camera.json").write_text(json_of("howto/camera.md", "by_hand.json"))
    (tmp_path / "init.json").write_text(json_of("howto/camera.md", "by_hand_init.json"))
    camera = gait.Camera.read(str(tmp_path / "camera.json"))
    camera.check_place("camera.json")
    np.testing.assert_allclose(camera.centre, [0, 0, 1.4], atol=1e-9)
    assert 2 * np.degrees(np.arctan(960 / camera.fx)) == pytest.approx(65, abs=0.05)
    np.testing.assert_allclose(camera.project([0, 7, 0]), [959.5, 840.9], atol=0.05)
    start = gait.Start.read(tmp_path / "init.json", gait.Model())
    assert start.frame == 30 and start.mean.pelvis[2] > 0.8 and start.mean.heading == 3.14
    u, v = camera.project(start.mean.pelvis)
    assert 960 < u < 1920 and 540 < v < 1080


def test_the_page_of_commands_has_a_row_for_each_and_options_that_all_share():
    text = (DOC / "reference/commands.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(gait[^`]*)` \| (.+) \| (.+) \|$", text, re.M)
    assert sorted(name for name, *_ in rows) == sorted(
        ["gait-trackd", *(f"gait {name}" for name in COMMANDS)]
    )
    for name, *cells in rows:
        if name != "gait-trackd":  # `--option` in a row is one of its command
            wanted = re.findall(r"(?<![\w-])--[a-z][\w-]*", " ".join(cells))
            assert [o for o in wanted if o not in helped(name.split())] == [], name
    for option in ("--help", "--quiet"):
        assert all(option in helped(["gait", *name.split()]) for name in COMMANDS)
