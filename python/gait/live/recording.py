"""All messages of a URL into an LCM log, from one press of a button to the next."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path

from gait.errors import UserError
from gait.lcm.link import LogWriter, now, open_lcm

_TURN_MS = 100
_WAITING = 1000  # messages
_OWN = "LCM_SELF_TEST"  # of LCM itself, when a program connects


class Recording:
    """A log that is being written, in a thread with a connection of its own.

    Parameters
    ----------
    url : str
    folder : path
        Gets ``gait-DATE-TIME.log``; a file that exists is not touched.
    failed : callable
        Called in the recording's thread when the log cannot be written; it has ended then.

    Attributes
    ----------
    path : Path
    fault : str or None
        Why the log is not complete.

    Raises
    ------
    UserError
        If the file cannot be made.
    """

    def __init__(self, url: str, folder: str | Path, failed: Callable[[], None]) -> None:
        self.path = _unused(Path(folder))
        self.fault: str | None = None
        self._failed = failed
        self._log = LogWriter(self.path, "w")
        self._lcm = open_lcm(url)
        self._lcm.subscribe(".*", self._write).set_queue_capacity(_WAITING)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.is_set() and self.fault is None:
            self._lcm.handle_timeout(_TURN_MS)
        if self.fault is not None:
            self._failed()

    def _write(self, channel: str, data: bytes) -> None:
        if channel == _OWN:
            return
        try:
            self._log.write(now(), channel, data)
        except UserError as error:
            self.fault = str(error)

    def end(self) -> None:
        """Write what waits, and close the log."""
        self._end.set()
        self._thread.join()
        try:
            self._log.close()
        except UserError as error:
            self.fault = self.fault or str(error)


def _unused(folder: Path) -> Path:
    """Make an empty file of a name that no file has."""
    stem = time.strftime("gait-%Y%m%d-%H%M%S")
    for k in range(100):
        path = folder / f"{stem}{f'-{k}' if k else ''}.log"
        try:
            path.open("xb").close()
        except FileExistsError:
            continue
        except OSError as error:
            raise UserError(f"{path}: cannot be made: {error.strerror}") from None
        return path
    raise UserError(f"{folder}: has all names of logs of this second")
