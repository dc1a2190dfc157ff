"""Check that this machine has what the package needs, with a remedy for every fault.

Checks the C library and its ABI, the shipped model, the CPU, the detector's weights, optional packages, LCM's
multicast route and receive buffer, the daemon, cameras, and the disk.  ok is fine, note is missing but not
always needed, fault must be fixed.  The exit code is 1 if there is a fault.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

EXAMPLES = """\
examples:
  gait doctor
  gait doctor --json
"""

_DEVICES = Path("/dev")
_DAEMON = Path(__file__).resolve().parents[3] / "build" / "bin" / "gait-trackd"
_LEAST_FREE = 1 << 30  # bytes; enough for a track of an hour or an overlay of some minutes
_MESSAGE = b"gait doctor"
_SECONDS = 1.0  # seconds that a message may take to come back


class Finding(NamedTuple):
    """Result of one check."""

    name: str
    state: str
    """ok, note or fault."""
    text: str
    remedy: str = ""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add nothing, as the command has only the common options."""


def run(args: argparse.Namespace) -> int:
    """Run all checks and print the results."""
    found = [finding for check in CHECKS for finding in check()]
    if args.json:
        print(json.dumps([finding._asdict() for finding in found]))
    else:
        print("\n".join(_line(finding) for finding in found if not args.quiet or finding.state == "fault"))
    return int(any(finding.state == "fault" for finding in found))


def _line(finding: Finding) -> str:
    remedy = f"; {finding.remedy}" * bool(finding.remedy)
    return f"{finding.state:5} {finding.name}: {finding.text}{remedy}"


def check_library() -> Iterator[Finding]:
    """Check the library's version and layout, and report the instruction set that it uses."""
    from gait.bindings.library import library, version_text
    from gait.errors import LibraryError

    try:
        loaded = library()
    except LibraryError as error:
        text, _, remedy = str(error).rpartition(" - ")
        yield Finding("library", "fault", text, remedy)
        return
    yield Finding("library", "ok", f"libgait {version_text(loaded.gait_version())}, ABI {loaded.gait_abi()}")
    kernels = loaded.gait_cpu_name(0xFFFFFFFF).decode()
    text = f"{os.cpu_count()} cores, kernels {kernels}"
    if kernels in ("scalar", "base"):
        slow = "no AVX2: a step takes two to four times as long; give fewer --particles if frames are late"
        yield Finding("cpu", "note", text, slow)
    else:
        yield Finding("cpu", "ok", text)


def check_model() -> Iterator[Finding]:
    """Check the package's model."""
    from gait.bindings.model import Model
    from gait.errors import GaitError, UserError

    try:
        model = Model()
    except (UserError, GaitError) as error:
        yield Finding("model", "fault", " ".join(str(error).split()), "install the package again")
        return
    yield Finding("model", "ok", f"{len(model.joint_names)} joints")


def check_extras() -> Iterator[Finding]:
    """Check the packages of every extra."""
    from gait import extras

    for extra in extras.EXTRAS:
        missing = extras.remedy("it", (extra,))
        if missing:
            text, _, remedy = missing.removeprefix("it needs ").partition(": ")
            yield Finding(f"extra {extra}", "note", f"lacks {text}", remedy)
        else:
            yield Finding(f"extra {extra}", "ok", "installed")


def check_weights() -> Iterator[Finding]:
    """Check that the detector's weights are present and undamaged."""
    from gait import extras
    from gait.detect import weights
    from gait.errors import UserError

    unused = bool(extras.remedy("it", ("video",)))  # nothing can run the detector
    for name, file in {"people": weights.PERSON, **weights.LANDMARK_NETWORKS}.items():
        what = f"detector weights ({name})"
        try:
            if weights.find(file):
                weights.load(file)
                yield Finding(what, "ok", "installed")
            else:
                state = "note" if unused or name in ("lite", "heavy") else "fault"
                yield Finding(what, state, "not installed", weights.FETCH)
        except UserError as error:
            text, _, remedy = str(error).rpartition("; ")
            yield Finding(what, "fault", text, remedy)


def check_network() -> Iterator[Finding]:
    """Check LCM's multicast and receive buffer on this host."""
    from gait.errors import UserError

    try:
        from gait.lcm import link
    except ModuleNotFoundError:
        yield Finding("lcm", "note", "is not installed", "pip install 'libgait[video,lcm]'")
        return
    except UserError as error:  # the system's GLib is missing
        text, _, remedy = str(error).partition("; ")
        yield Finding("lcm", "fault", text, remedy)
        return
    if not _comes_back(link):
        yield Finding("lcm route", "fault", "a multicast message does not return", link.ROUTE_REMEDY)
    else:
        yield Finding("lcm route", "ok", "a multicast message returns")
    url = link.lcm_url()
    if os.environ.get("LCM_DEFAULT_URL"):
        yield _given_network(link, url)
    granted = link.receive_buffer()
    if warning := link.buffer_warning(url):
        text, _, remedy = warning.partition(": some will be lost; ")
        yield Finding("lcm buffer", "fault", text, remedy)
    else:
        yield Finding("lcm buffer", "ok", f"{granted} bytes")


def _given_network(link: Any, url: str) -> Finding:
    """Check that the network or the log of ``LCM_DEFAULT_URL`` can be opened, without changing the log."""
    from gait.errors import UserError
    from gait.io.files import require_writable

    try:
        path, mode = link.log_of(url)
        if not link.is_log(url):
            link.open_lcm(url)
        elif mode == "r":
            link.require_log(path)
        elif mode:
            require_writable(path)
        else:
            raise UserError(f"{url}: LCM has no such mode; give ?mode=r, ?mode=w or ?mode=a")
    except UserError as error:
        text, _, remedy = str(error).rpartition("; ")
        return Finding("lcm url", "fault", f"LCM_DEFAULT_URL: {text}", f"{remedy}, or unset LCM_DEFAULT_URL")
    text = f"LCM_DEFAULT_URL is {url}"
    hops = [int(each) for each in re.findall(r"[?&]ttl=0*([0-9]+)", url)]
    if url.startswith(link.MULTICAST) and hops and hops[-1] > 0:
        reach = "messages leave this machine, unencrypted; with ttl=0 they stay"
        return Finding("lcm url", "note", text, reach)
    return Finding("lcm url", "ok", text)


def _comes_back(link: Any) -> bool:
    """Whether a message sent over LCM, on a private port, is received."""
    from gait.errors import UserError

    received: list[bytes] = []
    try:
        network = link.open_lcm(link.private_url())
        network.subscribe("GAIT_DOCTOR", lambda _, data: received.append(data))
        network.publish("GAIT_DOCTOR", _MESSAGE)
        network.handle_timeout(int(1000 * _SECONDS))
    except (UserError, OSError):
        return False
    return received == [_MESSAGE]


def check_daemon() -> Iterator[Finding]:
    """Check that a daemon of this version is in the source tree or on the PATH."""
    import subprocess

    from gait._version import __version__

    place = shutil.which("gait-trackd") or (str(_DAEMON) if _DAEMON.is_file() else None)
    if place is None:
        yield Finding(
            "gait-trackd", "note", "is not here", "for live tracking, run make tools in the sources"
        )
        return
    try:
        done = subprocess.run([place, "--version"], capture_output=True, text=True, timeout=10, check=False)
        text = done.stdout.strip()
    except (OSError, subprocess.TimeoutExpired) as error:
        text = str(error)
    if __version__ in text:
        yield Finding("gait-trackd", "ok", f"{place}: {text.splitlines()[0]}")
    else:
        yield Finding(
            "gait-trackd",
            "fault",
            f"{place}: {text or 'no answer'} is not {__version__}",
            "run make tools again",
        )


def check_cameras() -> Iterator[Finding]:
    """Check for cameras on this machine, and that they can be opened."""
    cameras = sorted(_DEVICES.glob("video*"))
    if not cameras:
        yield Finding(
            "camera", "note", "no camera at /dev/video*", "gait capture also takes files and streams"
        )
    for camera in cameras:
        try:
            os.close(os.open(camera, os.O_RDWR | os.O_NONBLOCK))
            yield Finding("camera", "ok", str(camera))
        except OSError as error:
            remedy = "connect it again, or see dmesg"
            if isinstance(error, PermissionError):
                remedy = "add yourself to its group: sudo usermod -aG video $USER, then log in again"
            yield Finding("camera", "fault", f"{camera} cannot be opened: {error.strerror}", remedy)


def check_disk() -> Iterator[Finding]:
    """Check space and permissions where outputs and temporary files are written."""
    import tempfile

    for what, folder in (("folder", Path.cwd()), ("temporary folder", Path(tempfile.gettempdir()))):
        try:
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(b"1")
        except OSError as error:
            yield Finding(
                "disk", "fault", f"{what} {folder}: {error.strerror}", "choose another, or set TMPDIR"
            )
            continue
        free = shutil.disk_usage(folder).free
        text = f"{what} {folder}: {free / 2**30:.1f} GB free"
        if free < _LEAST_FREE:
            yield Finding("disk", "fault", text, "free some space: videos and logs need gigabytes")
        else:
            yield Finding("disk", "ok", text)


CHECKS: tuple[Callable[[], Iterator[Finding]], ...] = (
    *(check_library, check_model, check_extras, check_weights, check_network),
    *(check_daemon, check_cameras, check_disk),
)
