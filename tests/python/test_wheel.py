"""The wheel and the source package in fresh environments without a compiler: run by `make wheel-check`."""

import os
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest

from gait.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
if "GAIT_WHEEL" not in os.environ:
    pytest.skip("needs the packages: run make wheel-check", allow_module_level=True)
WHEEL, SDIST = Path(os.environ["GAIT_WHEEL"]), Path(os.environ["GAIT_SDIST"])
PIP = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]

WITH_NUMPY_ALONE = """
import sys
import numpy as np
import gait

model = gait.Model()
mean, sd = model.prior()
joints, angles = model.pose(mean)
assert joints.shape == (19, 3) and angles.shape == (24,)
view = gait.Camera.looking([0, -5, 1.2], [0, 0, 1], (320, 240), 300.0)
picture = model.render(view, mean)
assert picture.any()
empty = np.zeros((240, 320), np.uint8)
tracker = gait.Tracker(model, view, gait.TrackerConfig.default(particles=100), background=empty)
tracker.start(mean, sd, 0)
for i in range(5):
    estimate = tracker.step(np.where(picture > 0, 200, empty).astype(np.uint8), i * 40_000)
assert np.isfinite(estimate.joints).all()
optional = {"cv2", "av", "scipy", "lcm", "matplotlib", "ezc3d", "threadpoolctl"}
assert not optional & {name.partition(".")[0] for name in sys.modules}
"""
DIGEST = """
import numpy as np
import gait

model = gait.Model()
mean, sd = model.prior()
view = gait.Camera.looking([0, -5, 1.2], [0, 0, 1], (320, 240), 300.0)
empty = np.zeros((240, 320), np.uint8)
for mask in (0, 1, 9, 11, 15):  # GAIT_CPU_*: scalar, base, SSE4, AVX2, AVX-512
    config = gait.TrackerConfig.default(particles=500, seed=5, cpu_mask=mask)
    tracker = gait.Tracker(model, view, config, background=empty)
    tracker.start(mean, sd, 0)
    noise = np.random.default_rng(1)
    for i in range(10):
        shade = noise.integers(100, 250, (240, 320))
        tracker.step(np.where(model.render(view, mean) > 0, shade, empty).astype(np.uint8), i * 40_000)
    print(tracker.isa, tracker.digest())
"""
LCM_MESSAGES = "from gait.lcm.link import generated; generated().estimate_t().encode()"


def run(command, folder, **environment):
    """Run a program that sees only the part of this environment that is given here."""
    return subprocess.run(
        [str(word) for word in command],
        cwd=folder,
        env={"HOME": str(folder), "LC_ALL": "C.UTF-8"} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )


def site_packages(environment):
    return next(environment.glob("lib/python3*/site-packages"))


@pytest.fixture(scope="module")
def numpy_alone(tmp_path_factory):
    """Environment with the wheel and NumPy."""
    made = tmp_path_factory.mktemp("numpy") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", made], check=True)
    for found in site_packages(Path(sys.prefix)).glob("numpy*"):
        (site_packages(made) / found.name).symlink_to(found)
    subprocess.run(
        [*PIP, "--python", made / "bin/python", "install", "--no-deps", "--no-index", WHEEL], check=True
    )
    return made


def test_import_gait_needs_numpy_alone(numpy_alone, tmp_path):
    done = run([numpy_alone / "bin/python", "-c", WITH_NUMPY_ALONE], tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_missing_extra_is_one_line(numpy_alone, tmp_path):
    words = {
        "learn": "learn walks -o model.gait",
        "track": "track walk.mp4 --height 1.7 -o track.csv",
        "eval": "eval track.csv --truth truth.csv",
        "detect": "detect walk.mp4 -o keypoints.csv",
        "lift": "lift walk.mp4 --height 1.7 -o motion.csv",
        "studio": "studio walk.mp4",
        "render": "render -o pose.png",
        "camera": "camera --walk walk.mp4 --height 1.7 -o camera.json",
        "simulate": "simulate -o walk",
        "capture": "capture walk.mp4",
        "record": "record -o track.csv",
        "demo": "demo walk.mp4 -o out",
        "report": "report walk.mp4 --video walk.mp4 --track track.csv -o out.html",
        "report track": "report track track.csv",
        "report lift": "report lift -o out",
        "paper": "paper --mocap walks -o paper.html",
        "doctor": "doctor --no-such-option",
        "batch": "batch project.toml -o out",
    }
    (tmp_path / "walk.mp4").touch()
    for name, command in COMMANDS.items():
        done = run([numpy_alone / "bin/gait", *words.get(name, name).split()], tmp_path)
        assert done.stderr.count("\n") == 1
        if command.extras and name != "studio":  # which asks for the parts of its page first
            assert done.stderr.startswith(f"gait {name} needs ") and done.returncode == 1, done.stderr
            assert f"pip install 'libgait[{','.join(command.extras)}]'" in done.stderr
    done = run([numpy_alone / "bin/python", "-c", "import gait; gait.Video"], tmp_path)
    lacking = "OpenCV, PyAV, SciPy, threadpoolctl and PyYAML: pip install 'libgait[video]'"
    assert done.stderr.splitlines()[-1] == f"ImportError: gait.Video needs {lacking}"


def test_help_is_quick(numpy_alone, tmp_path):
    times = []
    for _ in range(3):
        start = time.monotonic()
        assert run([numpy_alone / "bin/gait", "--help"], tmp_path).returncode == 0
        times.append(time.monotonic() - start)
    assert min(times) < 0.3


def test_the_wheel_makes_a_clip_and_tracks_it(tmp_path):
    """The commands of the README with fewer and smaller frames, with only the environment on the PATH."""
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True)
    pins = ["--no-compile", "--constraint", ROOT / "python/constraints.txt"]
    wheel = f"{WHEEL}[video,detect,lcm]"
    subprocess.run([*PIP, "--python", venv / "bin/python", "install", *pins, wheel], check=True)
    simulate = "gait simulate -o walk --frames 40 --fps 15 --size 400x300"
    for command in (simulate, "gait track walk/video.mp4 --camera walk/camera.json -o t.csv"):
        name, *words = command.split()
        done = run([venv / "bin" / name, *words], tmp_path, PATH=str(venv / "bin"))
        assert done.returncode == 0, done.stderr
    assert run([venv / "bin/python", "-c", LCM_MESSAGES], tmp_path).returncode == 0
    assert len((tmp_path / "t.csv").read_text().splitlines()) > 40


def test_cmake_and_make_build_libraries_of_the_same_bits(tmp_path):
    with zipfile.ZipFile(WHEEL) as wheel:
        by_cmake = wheel.extract("gait/lib/libgait.so", tmp_path)
    digests = [
        run([sys.executable, "-c", DIGEST], tmp_path, GAIT_LIBRARY=str(library))
        for library in (by_cmake, ROOT / "build/release/libgait.so")
    ]
    assert digests[0].stdout and digests[0].stdout == digests[1].stdout, digests


def test_the_source_package_builds_the_same_wheel_without_a_network(tmp_path):
    words = ["wheel", "--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", tmp_path, SDIST]
    quickly = "--config-settings=cmake.build-type=Debug"
    subprocess.run([*PIP, *words, quickly], check=True)
    (built,) = tmp_path.glob("*.whl")
    contents = [set(zipfile.ZipFile(file).namelist()) for file in (built, WHEEL)]
    assert contents[0] == contents[1]


def test_cmake_projects_build_with_the_library_as_a_folder(tmp_path):
    """add_subdirectory of the source package; FetchContent does the same after a download."""
    shutil.unpack_archive(SDIST, tmp_path)  # our own archive; extractall() has no filter before Python 3.11.4
    (source,) = tmp_path.glob("libgait-*/libgait")
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.18)\nproject(a C CXX)\nadd_subdirectory({source} gait)\n"
        "add_executable(a a.c)\ntarget_link_libraries(a gait::gait)\n"
    )
    (tmp_path / "a.c").write_text("#include <gait.h>\nint main(void) { return gait_abi() != GAIT_ABI; }\n")
    build = tmp_path / "build"
    subprocess.run(
        ["cmake", "-G", "Unix Makefiles", "-S", tmp_path, "-B", build, "-DCMAKE_BUILD_TYPE=Debug"],
        check=True,
        capture_output=True,
    )
    subprocess.run(["cmake", "--build", build, "--parallel", "2"], check=True, capture_output=True)
    assert subprocess.run([build / "a"]).returncode == 0
