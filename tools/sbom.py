#!/usr/bin/env python3
"""Add to a bill of materials of Python packages (CycloneDX, JSON) what no package declares.

    sbom.py PACKAGES.json -o SBOM.json

Adds the version of libgait, the hashes of python/lock.txt, licences that packages do not declare, the shared
libraries inside the packages, Eigen in the C library, the system's libjpeg in the daemon, and the files that
`--fetch` downloads: the detector's weights and the parts of pages.  `make sbom` calls this.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path
from typing import Any

from gait._version import __version__
from gait.detect import weights
from gait.io.files import replacing
from gait.io.published import Published
from gait.web import parts

LOCK = Path(__file__).resolve().parents[1] / "python/lock.txt"
UNDECLARED = {  # SPDX identifiers of packages whose metadata names none; from the licence files inside them
    "ezc3d": "MIT",
    "lcm": "LGPL-2.1-only",
    "partd": "BSD-3-Clause",
    "protobuf": "BSD-3-Clause",
}
LICENCES = {  # SPDX identifiers of downloaded files
    **dict.fromkeys(weights.STORE.files, "Apache-2.0"),
    parts.THREE: "MIT",
    parts.ORBIT: "MIT",
    parts.ECHARTS: "Apache-2.0",
}


def main() -> int:
    """Read the bill, complete it and write it."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("packages", type=Path)
    options.add_argument("-o", "--output", type=Path, required=True)
    args = options.parse_args()
    document = complete(json.loads(args.packages.read_text()))
    with replacing(args.output) as temporary:
        temporary.write_text(json.dumps(document, indent=1) + "\n")
    print(f"{args.output}: {len(document['components'])} parts")
    return 0


def complete(document: dict[str, Any]) -> dict[str, Any]:
    """Add to the bill what packages contain, what is compiled into libgait, and what is downloaded."""
    locked = hashes_of(LOCK.read_text())
    packages = [described(one, locked) | within(one["name"]) for one in document["components"]]
    eigen = described({"name": "cmeel-eigen", "version": version("cmeel-eigen")}, locked) | {
        "type": "library",
        "name": "Eigen",
        "description": "headers, compiled into libgait (libgait/src/base/linalg.cpp)",
        "licenses": [{"license": {"id": "MPL-2.0"}}],
    }
    metadata = document.get("metadata", {})
    own = metadata.get("component", {"type": "library", "name": "libgait"}) | {"version": __version__}
    return document | {
        "metadata": metadata | {"component": own},
        "components": [*packages, eigen, *system_jpeg(), *map(fetched, LICENCES)],
    }


def system_jpeg() -> list[dict[str, Any]]:
    """Describe the system's libjpeg, which gait-trackd links if it is there."""
    try:
        asked = subprocess.run(["pkg-config", "--modversion", "libjpeg"], capture_output=True, text=True)
    except FileNotFoundError:
        return []
    found = {
        "type": "library",
        "name": "libjpeg",
        "version": asked.stdout.strip(),
        "description": "of the system, linked by gait-trackd; the system's package manager has its hash",
        "licenses": [{"expression": "IJG AND BSD-3-Clause"}],
    }
    return [found] if asked.returncode == 0 else []


def hashes_of(lock: str) -> dict[tuple[str, str], list[str]]:
    """SHA-256 of the files of each release in lock.txt, by the package's name and its version."""
    entries = re.findall(r"^([\w.-]+)==(\S+)((?:.*\\\n)*.*)", lock, re.MULTILINE)
    return {
        (normal(name), number): re.findall(r"--hash=sha256:(\w+)", rest) for name, number, rest in entries
    }


def normal(name: str) -> str:
    """Name of a package as in lock.txt."""
    return re.sub(r"[-_.]+", "-", name).lower()


def described(package: dict[str, Any], locked: dict[tuple[str, str], list[str]]) -> dict[str, Any]:
    """Add to a package its licence, if it declares none, and the hashes of the files of its release."""
    name, number = normal(package["name"]), package.get("version", "")
    found = dict(package)
    if not found.get("licenses") and name in UNDECLARED:
        found["licenses"] = [{"license": {"id": UNDECLARED[name]}}]
    if (name, number) in locked:
        files = release(name, number, locked)
        found["externalReferences"] = [*found.get("externalReferences", ()), files]
    return found


def release(name: str, number: str, locked: dict[tuple[str, str], list[str]]) -> dict[str, Any]:
    """Refer to the files of a release, with their hashes."""
    return {
        "type": "distribution",
        "url": f"pkg:pypi/{name}@{number}",
        "comment": "the files of the release, of which one is installed",
        "hashes": [{"alg": "SHA-256", "content": one} for one in locked[name, number]],
    }


def fetched(file: Published) -> dict[str, Any]:
    """Describe a file that `--fetch` downloads."""
    return {
        "type": "machine-learning-model" if file in weights.STORE.files else "file",
        "name": file.file,
        "version": re.split("==|@", file.package)[-1],
        "description": f"{file.member} of {file.package}, downloaded by --fetch",
        "hashes": [{"alg": "SHA-256", "content": file.sha256}],
        "licenses": [{"license": {"id": LICENCES[file]}}],
    }


def within(package: str) -> dict[str, Any]:
    """List the shared libraries of other projects that an installed package contains."""
    try:
        held = [file for file in files(package) or () if any(".libs" in part for part in file.parts[:-1])]
    except PackageNotFoundError:
        return {}
    libraries = [
        {
            "type": "library",
            "name": file.name,
            "hashes": [{"alg": "SHA-256", "content": sha256(Path(str(file.locate())))}],
        }
        for file in sorted(held, key=str)
    ]
    return {"components": libraries} if libraries else {}


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    sys.exit(main())
