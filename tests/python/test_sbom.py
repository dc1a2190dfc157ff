"""The bill of materials lists what no Python package states."""

import importlib.util
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gait._version import __version__
from gait.detect import weights
from gait.web import parts

SCRIPT = Path(__file__).resolve().parents[2] / "tools/sbom.py"


@pytest.fixture
def sbom():
    """The script as a module."""
    spec = importlib.util.spec_from_file_location("sbom", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_bill_has_what_is_compiled_in_inside_wheels_and_fetched(sbom):
    packages = [{"name": "av", "type": "library"}, {"name": "no-such-package", "type": "library"}]
    lock = sbom.LOCK.read_text()
    number = re.search(r"^lcm==(\S+)", lock, re.MULTILINE)[1]
    packages.append({"name": "LCM", "version": number, "type": "library"})
    own = {"metadata": {"component": {"name": "libgait"}, "tools": []}}
    bill = sbom.complete({"components": packages, "bomFormat": "CycloneDX"} | own)
    assert bill["metadata"] == {"component": {"name": "libgait", "version": __version__}, "tools": []}
    assert bill["bomFormat"] == "CycloneDX"
    found = {one["name"]: one for one in bill["components"]}
    inside = {one["name"].split("-")[0]: one for one in found["av"]["components"]}
    assert {"libavcodec", "libx264"} <= inside.keys()
    assert len(inside["libavcodec"]["hashes"][0]["content"]) == 64
    assert found["no-such-package"] == packages[1]
    assert found["LCM"]["licenses"] == [{"license": {"id": "LGPL-2.1-only"}}]
    files = found["LCM"]["externalReferences"][0]["hashes"]
    (entry,) = re.findall(r"^lcm==(?:.*\\\n)+.*", lock, re.MULTILINE)
    assert len(files) == entry.count("--hash") > 10
    assert all(f"--hash=sha256:{one['content']}" in entry for one in files)
    assert found["Eigen"]["licenses"] == [{"license": {"id": "MPL-2.0"}}]
    assert found["Eigen"]["externalReferences"][0]["hashes"]
    asked = (
        subprocess.run(["pkg-config", "--exists", "libjpeg"], check=False)
        if shutil.which("pkg-config")
        else None
    )
    assert ("libjpeg" in found) == (asked is not None and asked.returncode == 0)
    for file in (*weights.STORE.files, *parts.STORE.files):
        assert file.package.endswith(found[file.file]["version"]) and found[file.file]["version"][0].isdigit()
        assert found[file.file]["hashes"] == [{"alg": "SHA-256", "content": file.sha256}]


def test_an_eigen_other_than_the_locked_one_has_no_hashes(sbom, monkeypatch):
    monkeypatch.setattr(sbom, "version", lambda _: "0.1")
    found = {one["name"]: one for one in sbom.complete({"components": []})["components"]}
    assert found["Eigen"]["version"] == "0.1" and "externalReferences" not in found["Eigen"]
