"""Weights of the detector: files of two published packages, checked by their SHA-256.

The networks are those of BlazePose (Bazarevsky and others 2020), by Google, licence Apache-2.0.  They lie
inside the Python package ``mediapipe`` and the npm package ``@mediapipe/pose``, which are downloaded but not
installed.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from gait.errors import UserError
from gait.io.files import replacing

FETCH = "run gait detect --fetch once, with a network"
"""What a user does to get the weights."""


class Weights(NamedTuple):
    """A file of weights: where it lies in its package, and what it must contain."""

    file: str
    package: str
    member: str
    sha256: str


_WHEEL, _NPM = "mediapipe==0.10.21", "@mediapipe/pose@0.5.1675469404"
PERSON = Weights(
    "pose_detection.tflite",
    _WHEEL,
    "mediapipe/modules/pose_detection/pose_detection.tflite",
    "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
)
LANDMARKS = {
    "full": Weights(
        "pose_landmark_full.tflite",
        _WHEEL,
        "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
        "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    ),
    "lite": Weights(
        "pose_landmark_lite.tflite",
        _NPM,
        "package/pose_landmark_lite.tflite",
        "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61",
    ),
    "heavy": Weights(
        "pose_landmark_heavy.tflite",
        _NPM,
        "package/pose_landmark_heavy.tflite",
        "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe",
    ),
}
"""Landmark networks by name; `full` is the default, `lite` faster, `heavy` slower."""


def folders() -> list[Path]:
    """Folders that may hold weights, in the order they are searched: $GAIT_WEIGHTS alone if it is set."""
    if named := os.environ.get("GAIT_WEIGHTS"):
        return [Path(named)]
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return [Path(sys.prefix) / "share/gait/weights", cache / "gait/weights"]


def find(weights: Weights) -> Path | None:
    """Path of a file of weights on this machine, None if it was not fetched.

    Raises
    ------
    UserError
        If GAIT_WEIGHTS is set and no folder.
    """
    named = os.environ.get("GAIT_WEIGHTS")
    if named and not Path(named).is_dir():
        raise UserError(f"GAIT_WEIGHTS: {named} is no folder; unset it, or {FETCH}")
    return next((f / weights.file for f in folders() if (f / weights.file).is_file()), None)


def load(weights: Weights) -> bytes:
    """Read and check a file of weights.

    Raises
    ------
    UserError
        If it is absent, or not the file that was published.
    """
    path = find(weights)
    if path is None:
        searched = " or ".join(map(str, folders()))
        raise UserError(
            f"{weights.file}: the detector's weights are not in {searched}; {FETCH}, or set GAIT_WEIGHTS to "
            "the folder that has them"
        )
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != weights.sha256:
        raise UserError(f"{path}: is damaged or of another network; delete it and {FETCH}")
    return data


def fetch(report: Callable[[str], None]) -> Path:
    """Download the packages, check the weights and keep them with their licence.

    The npm package, which has the `lite` and `heavy` networks, is left out where there is no ``npm``.

    Parameters
    ----------
    report : callable
        Called with one line for each step.

    Returns
    -------
    folder : pathlib.Path
        Where the weights are now.

    Raises
    ------
    UserError
        If a package cannot be downloaded or does not hold what was published.
    """
    folder = _writable_folder()
    every = [PERSON, *LANDMARKS.values()]
    for package, download in ((_WHEEL, _download_wheel), (_NPM, _download_npm)):
        wanted = [w for w in every if w.package == package and not _is_whole(folder / w.file, w)]
        if not wanted:
            continue
        if package == _NPM and not shutil.which("npm"):
            report(f"no npm here: the networks {' and '.join(w.file for w in wanted)} are left out")
            continue
        report(f"downloading {package}")
        with tempfile.TemporaryDirectory() as temporary:
            _keep(download(package, Path(temporary)), wanted, folder)
    (folder / "SOURCE.txt").write_text(
        f"BlazePose networks by Google, licence Apache-2.0 (LICENSE), from {_WHEEL} and {_NPM}.\n"
    )
    return folder


def _writable_folder() -> Path:
    for folder in folders():
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    raise UserError(f"{folders()[-1]}: cannot be written; set GAIT_WEIGHTS to a folder that can")


def _is_whole(path: Path, weights: Weights) -> bool:
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == weights.sha256


def _download_wheel(package: str, folder: Path) -> Path:
    # The wheel of one platform serves all: only its data files are taken.
    platform = "--python-version 3.11 --implementation cp --abi cp311 --platform manylinux_2_28_x86_64"
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"]
    _run([*pip, "--no-deps", "--only-binary=:all:", *platform.split(), package], folder, package)
    return next(folder.glob("*.whl"))


def _download_npm(package: str, folder: Path) -> Path:
    _run(["npm", "pack", "--silent", package], folder, package)
    return next(folder.glob("*.tgz"))


def _run(command: list[str], folder: Path, package: str) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        raise UserError(
            f"{package}: cannot be downloaded ({lines[-1] if lines else 'no reason given'}); try again"
        )


def _keep(archive: Path, wanted: list[Weights], folder: Path) -> None:
    """Write the weights of a package, and its licence, to the folder."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            found = {w: wheel.read(w.member) for w in wanted}
            licence = next(n for n in wheel.namelist() if n.endswith("dist-info/LICENSE"))
            (folder / "LICENSE").write_bytes(wheel.read(licence))
    else:
        with tarfile.open(archive) as package:
            members = {w: package.extractfile(w.member) for w in wanted}
            found = {w: m.read() for w, m in members.items() if m is not None}
    for weights in wanted:
        data = found.get(weights, b"")
        if hashlib.sha256(data).hexdigest() != weights.sha256:
            raise UserError(
                f"{weights.package}: {weights.member} is not the file that was published; try again"
            )
        with replacing(folder / weights.file) as temporary:
            temporary.write_bytes(data)
