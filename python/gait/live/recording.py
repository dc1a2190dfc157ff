"""Record all messages of some URLs in LCM logs, between two presses of a button."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from gait.errors import UserError
from gait.lcm.link import LogWriter, is_log, now, open_lcm, waiting

_TURN = 0.1  # seconds between polls
_WAITING = 1000  # messages that may wait
_OWN = "LCM_SELF_TEST"  # channel of LCM itself, used when a program connects


class Recording:
    """Writes logs, one for each URL, in a thread with its own connections.

    Parameters
    ----------
    url : str
        URL on which frames arrive.
    people : sequence of str
        URLs on which trackers publish, one for each person; `url` itself has only one log.
    folder : path
        Folder for ``gait-DATE-TIME.log`` and, for each further URL, ``gait-DATE-TIME-person-2.log``; existing
        files are not changed.
    failed : callable
        Called in the recording's thread when a log cannot be written; all logs have then ended.

    Attributes
    ----------
    paths : list of Path
    fault : str or None
        Why the logs are not complete.

    Raises
    ------
    UserError
        If a file cannot be created, or the URL is already a log.
    """

    def __init__(
        self, url: str, people: Sequence[str], folder: str | Path, failed: Callable[[], None]
    ) -> None:
        if is_log(url):
            raise UserError(f"{url}: is already a log; copy the file")
        further = {name: f"-person-{k}" for k, name in enumerate(people, 1) if name != url}
        self.paths = _unused(Path(folder), ["", *further.values()])
        self.fault: str | None = None
        self._failed = failed
        self._links, self._logs = [], [LogWriter(path, "w") for path in self.paths]
        for name, log in zip([url, *further], self._logs, strict=True):
            self._links.append(open_lcm(name))
            self._links[-1].subscribe(".*", partial(self._write, log)).set_queue_capacity(_WAITING)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._end.is_set() and self.fault is None:
            for link in waiting(self._links, _TURN):
                link.handle()
        if self.fault is not None:
            self._failed()

    def _write(self, log: LogWriter, channel: str, data: bytes) -> None:
        if channel == _OWN:
            return
        try:
            log.write(now(), channel, data)
        except UserError as error:
            self.fault = str(error)

    def end(self) -> None:
        """Write waiting messages, and close the logs."""
        self._end.set()
        self._thread.join()
        for log in self._logs:
            try:
                log.close()
            except UserError as error:
                self.fault = self.fault or str(error)


def _unused(folder: Path, endings: Sequence[str]) -> list[Path]:
    """Create empty files with unused names, one for each ending."""
    stem = time.strftime("gait-%Y%m%d-%H%M%S")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made: {error.strerror}") from None
    for k in range(100):
        paths = [folder / f"{stem}{f'-{k}' if k else ''}{ending}.log" for ending in endings]
        try:
            for path in paths:
                path.open("xb").close()
        except FileExistsError:
            continue
        except OSError as error:
            raise UserError(f"{path}: cannot be created: {error.strerror}") from None
        return paths
    raise UserError(f"{folder}: has logs of every possible name for this second")
