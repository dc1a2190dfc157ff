"""Connections to LCM and its logs, and the message classes generated from lcm_types/."""

from __future__ import annotations

import contextlib
import functools
import os
import select
import socket
import struct
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext
from importlib import import_module
from io import BufferedWriter, FileIO
from ipaddress import ip_address
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.parse import urlsplit

from gait.errors import UsageError, UserError
from gait.io.files import flush, lock, replacing, require_file, require_unlocked

_HERE = Path(__file__).resolve().parent
_PLACES = (_HERE.parent / "lib", _HERE.parents[2] / "build" / "lcm" / "python")
"""Folders that may contain ``gaitmsg``: of an installed package, or of the source tree."""


@functools.cache
def generated() -> ModuleType:
    """Import the package of message classes.

    Raises
    ------
    UserError
        If it has not been generated.
    """
    for place in (None, *_PLACES):
        if place is not None:
            if not (place / "gaitmsg" / "__init__.py").is_file():
                continue
            sys.path.append(str(place))
        try:
            return import_module("gaitmsg")
        except ModuleNotFoundError:
            continue
    raise UserError(f"gaitmsg: no generated LCM types in {_PLACES[-1]}; run make tools")


class _OnUse:
    """The package of message classes, imported when a class is used, as ``--help`` does not need it."""

    def __getattr__(self, name: str) -> Any:
        return getattr(generated(), name)


gaitmsg = _OnUse()

PREFIX = "file://"
MULTICAST = "udpm://"
_FORM = "udpm://239.255.76.67:7667?ttl=0"
_SYNC = 0xEDA1DA01
_EVENT_HEADER = struct.Struct(">Iqqii")  # sync, number, time, lengths of channel and data
_LATEST = 2**63 // 1000  # microseconds; nanoseconds must fit 64 bits
_LONGEST_CHANNEL_BYTES = 1000  # bytes of a channel's name that LCM accepts


def log_of(url: str) -> tuple[str, str]:
    """Split a log's URL as LCM does into path and mode (``r``, ``w``, ``a``, or empty if it is another)."""
    path, _, options = url.removeprefix(PREFIX).partition("?")
    modes = [word.removeprefix("mode=") for word in options.split("&") if word.startswith("mode=")]
    mode = modes[-1] if modes else "r"
    return path, mode if mode in ("r", "w", "a") else ""


def break_of(path: str | os.PathLike[str]) -> str | None:
    """Describe where an incomplete log breaks off; None if the log is complete.

    UserError if liblcm cannot read it safely, as in `events_of`.
    """
    return _scan(path)


def silence(url: str) -> str:
    """Explain, for a message, why nothing arrived from `url`: the log is damaged, or no tracker publishes."""
    path = log_of(url)[0]
    fault = break_of(path) if is_log(url) else None
    return f"{path}: {fault}; record it again" if fault else "is gait-trackd tracking on this URL?"


def events_of(path: str | os.PathLike[str], whole: bool = True) -> Iterator[Any]:
    """Yield the events of a log; if it breaks off, those before, unless it has to be `whole`.

    UserError if it breaks off but has to be whole, if an event states more bytes than the file has, or if a
    channel's name or a time is invalid.
    """
    import lcm

    broken = _scan(path)
    if whole and broken:
        raise UserError(f"{path}: {broken}; record it again")
    try:
        for event in lcm.EventLog(os.fspath(path), "r"):
            if not 0 <= event.timestamp < _LATEST:
                raise UserError(
                    f"{path}: event {event.eventnum} has the time {event.timestamp}; record it again"
                )
            yield event
    except UnicodeDecodeError:
        raise UserError(f"{path}: the name of a channel is not UTF-8; record it again") from None


def _scan(path: str | os.PathLike[str]) -> str | None:
    """Describe where an incomplete log breaks off.

    UserError if liblcm would take more memory than the file has: it searches for the first event, and
    allocates what an event states.  gait-trackd has the same rule (lcm_link.c): neither can call the other.
    """
    size, (at, events, stated) = Path(path).stat().st_size, _whole_events(path)
    if at == size:
        return None
    fault = f"the log is damaged or ends at byte {at}, messages before: {events}"
    if events == 0 or stated > size:
        raise UserError(f"{path}: {fault}; record it again")
    return fault


def end_at_an_event(path: Path) -> bool:
    """Cut off an incomplete last event of a log; return whether it has any others."""
    at, events, _ = _whole_events(path)
    os.truncate(path, at)
    return events > 0


def _whole_events(path: str | os.PathLike[str]) -> tuple[int, int, int]:
    """Return the byte at which a log's whole events end, their number, and the length of the last event."""
    size, at, events, stated = Path(path).stat().st_size, 0, 0, 0
    with open(path, "rb") as file:
        while at < size:
            head = file.read(_EVENT_HEADER.size)
            if len(head) < _EVENT_HEADER.size:
                break
            sync, _, _, channel, data = _EVENT_HEADER.unpack(head)
            if sync != _SYNC or not 0 < channel < _LONGEST_CHANNEL_BYTES or data < 0:
                break
            stated = _EVENT_HEADER.size + channel + data
            if at + stated > size:
                break
            at, events = at + stated, events + 1
            file.seek(at)
    return at, events, stated


class LogWriter:
    """Writes a log event by event.

    Parameters
    ----------
    path : path
    mode : str
        ``w``: new file; ``a``: append.
    name : str, optional
        Name that the file will have, if it is written under another one; it is the name in messages.

    Raises
    ------
    UserError
        If the log cannot be written, which all methods raise, or another program is writing it.
    """

    def __init__(self, path: str | os.PathLike[str], mode: str = "w", name: str | None = None) -> None:
        self._name, self._events = name or path, 0
        if name is not None:
            require_unlocked(name)
        try:
            self._file = BufferedWriter(FileIO(path, mode))
        except OSError as error:
            raise self._fault(error) from error
        if mode == "a":
            with ExitStack() as refused:
                refused.callback(self._file.close)
                lock(self._file.fileno(), path)
                refused.pop_all()

    def write(self, utime: int, channel: str, data: bytes) -> None:
        """Append an event with time `utime`, microseconds since the Unix epoch."""
        name = channel.encode("utf-8")
        try:
            self._file.write(_EVENT_HEADER.pack(_SYNC, self._events, utime, len(name), len(data)) + name)
            self._file.write(data)
        except OSError as error:
            raise self._fault(error) from error
        self._events += 1

    def publish(self, channel: str, data: bytes) -> None:
        """Append a message with the present time, as LCM does when it publishes to a log."""
        self.write(now(), channel, data)

    def close(self) -> None:
        """Write everything to the disk and close the file."""
        try:
            with self._file:
                self._file.flush()
                flush(self._file.fileno())
        except OSError as error:
            raise self._fault(error) from error

    def _fault(self, error: OSError) -> UserError:
        return UserError(f"{self._name}: the log cannot be written: {error.strerror}")


try:
    import lcm
except ImportError as exc:  # lcm hides the reason: liblcm needs the system's GLib
    if exc.name == "lcm":
        raise
    raise UserError(f"lcm: cannot be loaded ({exc}); install libglib2.0-0 and the lcm wheel") from None

DEFAULT_URL = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304"
"""The URL sets the receive buffer, as with the system's default 9 of 10 colour frames are lost."""

ROUTE_REMEDY = "if this machine has no multicast route: ip route add 224.0.0.0/4 dev lo (as root)"
_RMEM_MAX = Path("/proc/sys/net/core/rmem_max")
_RMEM_ENOUGH = 1 << 20


def now() -> int:
    """Return the wall-clock time, microseconds since the Unix epoch."""
    return time.time_ns() // 1000


def lcm_url(url: str | None = None) -> str:
    """Return `url` if given, else ``LCM_DEFAULT_URL`` from the environment, else `DEFAULT_URL`."""
    return url or os.environ.get("LCM_DEFAULT_URL") or DEFAULT_URL


def open_lcm(url: str | None = None) -> lcm.LCM:
    """Connect to LCM.

    Raises
    ------
    UserError
        If LCM cannot connect, with the remedy: a multicast route is missing, or a log cannot be opened; or if
        the message classes have not been generated.
    """
    generated()
    wanted = lcm_url(url)
    (path, mode), damage = log_of(wanted), None
    if is_log(wanted) and mode == "r":
        require_log(path)
        damage = _scan(path)
    _require_group(wanted)
    try:
        with muted_stderr():
            return lcm.LCM(wanted)
    except RuntimeError:
        if is_log(wanted):
            why = damage or "cannot open this log; give file:///PATH?speed=0 (mode=w to write)"
            raise UserError(f"{wanted}: {why}") from None
        remedy = (
            ROUTE_REMEDY
            if wanted.startswith(MULTICAST)
            else "give udpm://ADDRESS:PORT or file:///PATH?speed=0"
        )
        raise UserError(f"{wanted}: cannot open LCM; {remedy}") from None


def _require_group(url: str) -> None:
    """Raise UserError for a network that LCM cannot use: without a multicast address, or without a port."""
    if not url.startswith(MULTICAST) or not url.removeprefix(MULTICAST).partition("?")[0]:
        return  # liblcm uses its default network if none is named
    try:
        parts = urlsplit(url)
        sound = ip_address(parts.hostname or "").is_multicast and bool(parts.port)
    except ValueError:
        sound = False
    if not sound:
        why = "needs a multicast address, 224.0.0.0 to 239.255.255.255, and a port"
        raise UserError(f"{url}: LCM {why}; give {_FORM}")


def require_log(path: str | os.PathLike[str]) -> None:
    """Raise UserError unless a file begins like LCM's logs."""
    remedy = "make one with gait record --log or lcm-logger"
    require_file(path, "LCM log", remedy)
    with open(path, "rb") as file:
        if file.read(4) != _SYNC.to_bytes(4, "big"):
            raise UserError(f"{path}: is not an LCM log; {remedy}")


def listener(url: str) -> lcm.LCM:
    """Connect to receive; a log is never changed."""
    if is_log(url) and log_of(url)[1] != "r":
        raise UsageError(f"--url {url}: a log is only read here; leave out ?mode=")
    return open_lcm(url)


@contextmanager
def publisher(url: str) -> Iterator[lcm.LCM | LogWriter]:
    """Connect to send to a network or a log; a new log gets its name when the block has succeeded."""
    if not is_log(url):
        yield open_lcm(url)
        return
    generated()
    path, mode = log_of(url)
    if mode not in ("w", "a"):
        raise UsageError(f"--url {url}: names no log to write; add ?mode=w (new) or ?mode=a (at its end)")
    named = nullcontext(path) if mode == "a" else replacing(path, cut=end_at_an_event)
    with named as file, closing(LogWriter(file, mode, path)) as log:
        yield log


def waiting(links: Sequence[lcm.LCM], seconds: float = 0.0) -> list[lcm.LCM]:
    """Return those of live links that have a message, waiting at most this long for one."""
    ready = select.select([link.fileno() for link in links], [], [], seconds)[0]
    return [link for link in links if link.fileno() in ready]


def handle(link: lcm.LCM, seconds: float, log: bool) -> bool:
    """Handle a message, waiting at most this long; False at the end of a `log`.

    A live link waits in `select`, which signals may interrupt; liblcm's own wait would then fail.
    """
    if not log:
        if waiting([link], seconds):
            link.handle()
        return True
    try:
        link.handle_timeout(max(1, round(1000 * seconds)))
    except OSError:
        return False
    return True


def is_log(url: str) -> bool:
    """Whether a URL is a log file, which loses no messages, rather than a network."""
    return url.startswith(PREFIX)


def private_url() -> str:
    """Make the URL of a private network: multicast with a port that is free on this machine."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    return DEFAULT_URL.replace(":7667", f":{port}")


def multicast_works() -> bool:
    """Whether LCM can open its default network on this machine."""
    try:
        open_lcm(DEFAULT_URL)
    except UserError:
        return False
    return True


def receive_buffer() -> int:
    """Size of the receive buffer, bytes, granted on this machine to a receiver with `DEFAULT_URL`."""
    asked = int(DEFAULT_URL.rpartition("=")[2])
    return min(asked, int(_RMEM_MAX.read_text(encoding="ascii"))) if _RMEM_MAX.is_file() else asked


def buffer_warning(url: str) -> str | None:
    """Return a warning if the kernel does not grant the receive buffer that `url` asks for."""
    granted = receive_buffer()
    if not url.startswith(MULTICAST) or granted >= _RMEM_ENOUGH:
        return None
    return (
        f"the kernel grants a receiver {granted} bytes, too few for uncompressed frames: some will be lost; "
        f"sysctl -w net.core.rmem_max=4194304 (as root), or send --jpeg 90"
    )


@contextlib.contextmanager
def muted_stderr() -> Iterator[None]:
    """Silence file descriptor 2, to which liblcm writes pages of text if a route is missing."""
    sys.stderr.flush()
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
