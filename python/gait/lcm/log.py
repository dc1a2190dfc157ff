"""LCM logs: what a URL says of them, and their writing, as LCM's own does not tell of a full disk."""

from __future__ import annotations

import os
import struct
from io import BufferedWriter, FileIO
from pathlib import Path

from gait.errors import UserError
from gait.lcm.messages import now

PREFIX = "file://"
_SYNC = 0xEDA1DA01
_HEAD = struct.Struct(">Iqqii")  # sync, number, time, lengths of channel and data
_LONGEST = 1000  # bytes of a channel's name at which LCM stops


def log_of(url: str) -> tuple[str, str]:
    """Path and mode (``r``, ``w``, ``a``, or empty if it is none of them) of a log's URL, as LCM reads it."""
    path, _, options = url.removeprefix(PREFIX).partition("?")
    modes = [word.removeprefix("mode=") for word in options.split("&") if word.startswith("mode=")]
    mode = modes[-1] if modes else "r"
    return path, mode if mode in ("r", "w", "a") else ""


def break_of(path: str | os.PathLike[str]) -> str | None:
    """Say where a log that is not whole breaks off, None of one that is."""
    size, at, events = Path(path).stat().st_size, 0, 0
    with open(path, "rb") as file:
        while at < size:
            head = file.read(_HEAD.size)
            if len(head) < _HEAD.size:
                break
            sync, _, _, channel, data = _HEAD.unpack(head)
            end = at + _HEAD.size + channel + data
            if sync != _SYNC or not 0 < channel < _LONGEST or data < 0 or end > size:
                break
            file.seek(end)
            at, events = end, events + 1
    return None if at == size else f"the log is damaged or breaks off at byte {at}, messages before: {events}"


class LogWriter:
    """A log, event by event.

    Parameters
    ----------
    path : path
    mode : str
        ``w``: new, ``a``: at its end.
    name : str, optional
        Of the file for messages, where it is written under another one.

    Raises
    ------
    UserError
        As all methods do, if the log cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], mode: str = "w", name: str | None = None) -> None:
        self._name, self._events = name or path, 0
        try:
            self._file = BufferedWriter(FileIO(path, mode))
        except OSError as error:
            raise self._fault(error) from None

    def write(self, utime: int, channel: str, data: bytes) -> None:
        """Append an event of time `utime`, microseconds since the Unix epoch."""
        name = channel.encode("utf-8")
        try:
            self._file.write(_HEAD.pack(_SYNC, self._events, utime, len(name), len(data)) + name)
            self._file.write(data)
        except OSError as error:
            raise self._fault(error) from None
        self._events += 1

    def publish(self, channel: str, data: bytes) -> None:
        """Append a message, dated now, as LCM publishes into a log."""
        self.write(now(), channel, data)

    def close(self) -> None:
        """Write what waits, and close."""
        try:
            self._file.close()
        except OSError as error:
            raise self._fault(error) from None

    def _fault(self, error: OSError) -> UserError:
        return UserError(f"{self._name}: the log cannot be written: {error.strerror}")
