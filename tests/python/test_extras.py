"""Extras: pyproject.toml, constraints.txt and the table of gait.extras name the same packages."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from gait import extras
from gait.cli import COMMANDS, main

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PYTHON = Path(__file__).resolve().parents[2] / "python"
BENCH = PYTHON.parent / "tests/bench"
PROJECT = tomllib.loads((PYTHON / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OPTIONAL = PROJECT["optional-dependencies"]
IMPORTED = {
    "opencv-python-headless": "cv2",
    "PyYAML": "yaml",
    "rerun-sdk": "rerun",
    "ai-edge-litert": "ai_edge_litert",
    "mcap-ros2-support": "mcap_ros2",
}  # by another name than installed


def packages(requirements):
    """Names of required packages, without those of this project's own extras."""
    names = [re.match(r"[\w.-]+", one)[0] for one in requirements]
    return {name for name in names if name != "libgait"}


@pytest.mark.parametrize("extra", extras.EXTRAS)
def test_an_extra_brings_what_its_table_has(extra):
    installed = {IMPORTED.get(name, name) for name in packages(OPTIONAL[extra])} - {"dask"}
    assert installed == set(extras.EXTRAS[extra])


def test_all_has_every_extra_that_a_command_needs():
    needed = {extra for command in COMMANDS.values() for extra in command.extras}
    assert needed <= set(re.findall(r"\w+", OPTIONAL["all"][0])) & set(extras.EXTRAS)


def test_every_package_has_an_exact_version_for_development():
    lines = (PYTHON / "constraints.txt").read_text(encoding="utf-8").splitlines()
    exact = {line.partition("==")[0] for line in lines if "==" in line}
    required = packages([*PROJECT["dependencies"], *(one for group in OPTIONAL.values() for one in group)])
    assert required <= exact


def locked(path):
    """Versions in a lock file, each with the hashes of its files."""
    versions = set()
    for entry in re.split(r"\n(?=\S)", path.read_text(encoding="utf-8").strip()):
        version, *hashes = re.split(r"\s*\\\n\s*", entry)
        assert hashes and all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", h) for h in hashes), version
        versions.add(version.partition(" ;")[0].lower())
    return versions


def exact_versions(path):
    """Lines PACKAGE==VERSION of a file of requirements."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return {line.partition(";")[0].strip().lower() for line in lines if "==" in line}


def test_the_lock_has_these_versions_with_the_hashes_of_their_files():
    """`make lock` was run after the last change of constraints.txt."""
    exact = exact_versions(PYTHON / "constraints.txt")
    apart = tuple(name.lower() + "==" for name in packages(OPTIONAL["rerun"]))  # not among those of `dev`
    there = locked(PYTHON / "lock.txt") | locked(PYTHON / "lock-docs.txt")
    assert {version for version in exact if not version.startswith(apart)} <= there


def test_what_other_targets_install_is_locked_too():
    """`make lock` was run after the last change of these versions."""
    text = (PYTHON / "pyproject.toml").read_text(encoding="utf-8")
    stated = re.findall(r'"(numpy|scipy)>=([0-9.]+)', text)
    lowest = {f"{name}=={version}{'.0' * (2 - version.count('.'))}" for name, version in stated}
    assert locked(PYTHON / "lock-lowest.txt") == lowest
    peers = BENCH / "requirements-peers.txt"
    assert exact_versions(peers) <= locked(BENCH / "lock-peers.txt")
    recipe = (PYTHON.parent / "Makefile").read_text(encoding="utf-8")
    programs = set(re.findall(r"(?:uv|cyclonedx-bom)==[0-9.]+", recipe))
    assert len(programs) == 2 and programs <= locked(PYTHON / "lock-packaging.txt")


def test_whatever_the_makefile_installs_has_hashes_or_needs_no_packages():
    recipe = (PYTHON.parent / "Makefile").read_text(encoding="utf-8").replace("\\\n", "")
    installing = re.findall(r"^\t.*(?:\$\(PIP_INSTALL\)|pip install).*$", recipe, re.MULTILINE)
    assert len(installing) >= 5
    for line in installing:
        assert "--require-hashes" in line or "--no-deps --no-build-isolation -e ./python" in line, line


def test_missing_packages_are_named_with_their_extras(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda module: None)
    assert extras.remedy("gait x", ["lcm"]) == "gait x needs LCM: pip install 'libgait[lcm]'"
    lacking = "OpenCV, PyAV, SciPy, threadpoolctl and PyYAML: pip install 'libgait[video]'"
    assert extras.remedy("gait x", [], "cv2").endswith(lacking)
    assert extras.remedy("gait x", [], "elsewhere") == ""
    monkeypatch.undo()
    assert extras.remedy("gait x", ["video"]) == ""


def test_a_command_without_its_extra_ends_with_one_line(monkeypatch, capsys):
    def absent(name):
        raise ModuleNotFoundError(f"No module named {name!r}", name="av")

    monkeypatch.setattr("gait.cli.import_module", absent)
    monkeypatch.setattr(extras, "find_spec", lambda module: None if module in ("av", "cv2") else object())
    assert main(["track"]) == 1
    assert capsys.readouterr().err == "gait track needs OpenCV and PyAV: pip install 'libgait[video]'\n"


def alone(tmp_path, code, *lacking):
    """Lines that Python code writes to stderr without these modules, weights and parts of pages."""
    gone = f"import sys; sys.modules.update(dict.fromkeys({lacking!r}))\n"
    env = {"GAIT_WEIGHTS": str(tmp_path), "GAIT_WEB": str(tmp_path), "PYTHONPATH": str(PYTHON)}
    command = [sys.executable, "-c", gone + code]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    return done.stderr.splitlines()


@pytest.mark.parametrize(
    "call",
    [
        "import gait; gait.Camera.read('cam.yaml')",
        "import gait; gait.Camera.looking((0, -4, 1), (0, 0, 1), (640, 480), 500).project((0, 0, 1))",
        "from gait.cli import main; sys.exit(main(['studio', 'x.mp4']))",
    ],
)
def test_with_numpy_alone_the_extra_is_named_first(call, tmp_path):
    (tmp_path / "cam.yaml").write_text("%YAML:1.0\n---\nimage_width: 640\n")
    modules = {module for extra in extras.EXTRAS.values() for module in extra}
    last = alone(tmp_path, call, *modules)[-1]
    assert " needs OpenCV, PyAV, SciPy" in last and "pip install 'libgait[video" in last


@pytest.mark.parametrize("words", [["info", "x.gait"], ["doctor"]])
def test_a_command_without_numpy_ends_with_one_line(words, tmp_path):
    call = f"from gait.cli import main; sys.exit(main({words!r}))"
    assert alone(tmp_path, call, "numpy") == [f"gait {words[0]} needs NumPy: pip install numpy"]
