"""Files from published packages, which are downloaded but not installed, and checked by SHA-256.

The detector's weights and components of web pages are such files; the repository contains none of them.
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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from gait.errors import UserError
from gait.io.files import replacing
from gait.progress import note


class Published(NamedTuple):
    """A file: its path in its package, and its checksum.

    `package` is ``name==version`` for a Python package, ``name@version`` for an npm package.
    """

    file: str
    package: str
    member: str
    sha256: str


@dataclass(frozen=True)
class Store:
    """A folder of published files.

    Attributes
    ----------
    folder : str
        Its name below ``share/gait`` of the environment or ``gait`` of the cache.
    variable : str
        Environment variable that names another folder.
    what : str
        What the files are, for messages.
    remedy : str
        How a user gets them, for messages.
    files : tuple of Published
        All files of the folder.
    source : str
        Content of SOURCE.txt: where the files come from, and their licences.
    """

    folder: str
    variable: str
    what: str
    remedy: str
    files: tuple[Published, ...]
    source: str

    def folders(self) -> list[Path]:
        """List folders that may contain the files, in search order; only the variable's if it is set."""
        if named := os.environ.get(self.variable):
            return [Path(named)]
        cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        return [Path(sys.prefix) / "share/gait" / self.folder, cache / "gait" / self.folder]

    def find(self, wanted: Published) -> Path | None:
        """Find a file on this machine; None if it was not downloaded.

        Raises
        ------
        UserError
            If the variable is set and names no folder.
        """
        named = os.environ.get(self.variable)
        if named and not Path(named).is_dir():
            raise UserError(f"{self.variable}: {named} is not a folder; unset it, or {self.remedy}")
        return next((f / wanted.file for f in self.folders() if (f / wanted.file).is_file()), None)

    def load(self, wanted: Published) -> bytes:
        """Read and check a file.

        Raises
        ------
        UserError
            If it is missing, or is not the file that was published.
        """
        path = self.find(wanted)
        if path is None:
            searched = " or ".join(map(str, self.folders()))
            raise UserError(
                f"{wanted.file}: {self.what} are not in {searched}; {self.remedy}, or set {self.variable} to "
                "the folder that has them"
            )
        data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != wanted.sha256:
            raise UserError(f"{path}: is damaged or has another version; delete it and {self.remedy}")
        return data

    def fetch(self, report: Callable[[str], None]) -> Path:
        """Download the packages, check their files, and store them with the licence of their package.

        npm packages are skipped, with a line on stderr, if ``npm`` is not installed.

        Parameters
        ----------
        report : callable
            Called with a line for each step.

        Returns
        -------
        folder : pathlib.Path
            Where the files are now.

        Raises
        ------
        UserError
            If a package cannot be downloaded or its files are not those that were published.
        """
        folder = self._writable_folder()
        if all(_is_whole(folder / each.file, each) for each in self.files):
            report(f"already there: {', '.join(each.file for each in self.files)}")
        for package in dict.fromkeys(each.package for each in self.files):
            wanted = [w for w in self.files if w.package == package and not _is_whole(folder / w.file, w)]
            if not wanted:
                continue
            npm = "==" not in package
            if npm and not shutil.which("npm"):
                note(f"npm is not installed: {' and '.join(w.file for w in wanted)} skipped")
                continue
            report(f"downloading {package}")
            with tempfile.TemporaryDirectory() as temporary:
                download = _download_npm if npm else _download_wheel
                _keep(download(package, Path(temporary)), wanted, folder)
        (folder / "SOURCE.txt").write_text(self.source)
        return folder

    def _writable_folder(self) -> Path:
        for folder in self.folders():
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError:
                continue
            if os.access(folder, os.W_OK):
                return folder
        raise UserError(f"{self.folders()[-1]}: is not writable; set {self.variable} to a folder that is")


def _is_whole(path: Path, wanted: Published) -> bool:
    return path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == wanted.sha256


def _download_wheel(package: str, folder: Path) -> Path:
    # The wheel of any platform will do, since only its data files are used.
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


def _keep(archive: Path, wanted: Sequence[Published], folder: Path) -> None:
    """Write the files of a package, and its licence, to the folder."""
    if archive.suffix == ".whl":
        with zipfile.ZipFile(archive) as wheel:
            found = {w: wheel.read(w.member) for w in wanted}
            licence = next(n for n in wheel.namelist() if "dist-info/" in n and n.endswith("/LICENSE"))
            (folder / "LICENSE").write_bytes(wheel.read(licence))
    else:
        with tarfile.open(archive) as package:
            members = {w: package.extractfile(w.member) for w in wanted}
            found = {w: m.read() for w, m in members.items() if m is not None}
    for each in wanted:
        data = found.get(each, b"")
        if hashlib.sha256(data).hexdigest() != each.sha256:
            raise UserError(f"{each.package}: {each.member} is not the file that was published; try again")
        with replacing(folder / each.file) as temporary:
            temporary.write_bytes(data)
