"""Record all messages of some URLs in LCM logs, between two presses of a button."""

from __future__ import annotations

import fcntl
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from types import MappingProxyType

from gait.errors import UserError
from gait.io.files import UnfinishedError, recover, replacing
from gait.lcm.link import LogWriter, end_at_an_event, is_log, now, open_lcm, waiting
from gait.progress import note

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
        files are not changed.  They get their names when they are complete; if one cannot be written, all
        are named ``gait-DATE-TIME.unfinished.log``, and so on.
    failed : callable
        Called in the recording's thread when it cannot go on; all logs have then ended.
    scene : mapping of str to bytes
        Encoded messages by channel with which the log of `url` begins: its cameras and backgrounds, without
        which it could not be tracked.

    Attributes
    ----------
    paths : list of Path
    fault : str or None
        Why the logs are not complete, and which files have what was recorded.

    Raises
    ------
    UserError
        If a file cannot be written, or the URL is already a log.
    """

    def __init__(
        self,
        url: str,
        people: Sequence[str],
        folder: str | Path,
        failed: Callable[[], None],
        scene: Mapping[str, bytes] = MappingProxyType({}),
    ) -> None:
        if is_log(url):
            raise UserError(f"{url}: is already a log; copy the file")
        further = {name: f"-person-{k}" for k, name in enumerate(people, 1) if name != url}
        self.fault: str | None = None
        self._failed = failed
        self._links = []
        with ExitStack() as stack, _alone_in(Path(folder)):
            self.paths = _unused(Path(folder), ["", *further.values()])
            for name, path in zip([url, *further], self.paths, strict=True):
                temporary = stack.enter_context(replacing(path, end_at_an_event))
                log = stack.enter_context(closing(LogWriter(temporary, name=str(path))))
                if name == url:
                    for channel, data in dict(scene).items():
                        log.write(now(), channel, data)
                self._links.append(open_lcm(name))
                self._links[-1].subscribe(".*", partial(_write, log)).set_queue_capacity(_WAITING)
            self._logs = stack.pop_all()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            with self._logs:
                self._record()
        except Exception as error:  # whatever it is, the page must not call the logs complete
            kept = [n.name for path in self.paths for n in path.parent.glob(f"{path.stem}.unfinished*")]
            where = f"; what was recorded is in {', '.join(kept)}" if kept else ""
            self.fault = f"{_reason(error)}{where}"
            note(f"gait view: the recording has ended: {self.fault}")
            self._failed()

    def _record(self) -> None:
        """Write messages until the end; UnfinishedError if no more can be received or written."""
        try:
            while not self._end.is_set():
                for link in waiting(self._links, _TURN):
                    link.handle()
        except Exception as error:
            raise UnfinishedError(_reason(error)) from error

    def end(self) -> None:
        """Complete the logs."""
        self._end.set()
        self._thread.join()


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _write(log: LogWriter, channel: str, data: bytes) -> None:
    if channel != _OWN:
        log.write(now(), channel, data)


def recover_recordings(folder: str | Path) -> None:
    """Rename logs left by killed commands to ``gait-DATE-TIME.unfinished.log``, and report them."""
    recover(Path(folder), r"gait-\d{8}-\d{6}(-\d+)?(-person-\d+)?", ".log", end_at_an_event)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Make a folder, and let no other page choose names there until the block has created its files."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise UserError(f"{folder}: cannot be made: {error.strerror}") from None
    try:
        with suppress(OSError):  # some file systems lock no folders
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _unused(folder: Path, endings: Sequence[str]) -> list[Path]:
    """Return names of no files, complete or not, one for each ending."""
    stem = time.strftime("gait-%Y%m%d-%H%M%S")
    for k in range(100):
        paths = [folder / f"{stem}{f'-{k}' if k else ''}{ending}.log" for ending in endings]
        if not any([*folder.glob(f".{path.stem}.*"), *folder.glob(f"{path.stem}.*")] for path in paths):
            return paths
    raise UserError(f"{folder}: has logs of every possible name for this second")
