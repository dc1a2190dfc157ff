"""How the numbers of an evaluation were made."""

from __future__ import annotations

import os
import platform
import shlex
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGES = ("libgait", "numpy", "scipy")


def facts(command: str | None = None) -> str:
    """Command (default: the one that runs), commit, machine and versions that made the numbers."""
    command = command or shlex.join([f"tests/bench/{Path(sys.argv[0]).name}", *sys.argv[1:]])
    versions = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return (
        f"`{command}` at commit {commit()}; {_processor()}, {os.cpu_count()} cores, "
        f"{platform.system()} {platform.machine()}; Python {platform.python_version()}, {versions}."
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown processor"


def commit() -> str:
    """Short name of the commit, and whether sources differ from it."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", "-C", str(HERE), *words], capture_output=True, text=True, check=False)
        return done.stdout.strip()

    sources = (":/python", ":/libgait", ":/tests/bench/*.py", ":/tests/bench/*.[ch]")
    dirty = git("status", "--porcelain", "--untracked-files=no", "--", *sources)
    return (git("rev-parse", "--short", "HEAD") or "unknown") + (" with changes" if dirty else "")
