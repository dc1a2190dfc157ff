"""Processes that belong together: started, watched, and ended whatever happens."""

from __future__ import annotations

import ctypes
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from types import TracebackType

from gait.errors import UserError

_GRACE = 5.0  # seconds that a process may take to end when asked
_TURN = 0.05  # seconds between two looks
_PR_SET_PDEATHSIG = 1


class Child:
    """One process and its name for messages."""

    def __init__(self, name: str, process: subprocess.Popen[str]) -> None:
        self.name, self.process = name, process

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self.process.poll() is None

    def interrupt(self) -> None:
        """Ask it to end in good order."""
        if self.running:
            self.process.send_signal(signal.SIGINT)

    def wait_for_word(self, word: str) -> None:
        """Return when a line on its piped stderr begins with `word`.

        Raises
        ------
        UserError
            If it ends without.
        """
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if line.startswith(word):
                return
            print(line, end="", file=sys.stderr)
        raise UserError(f"{self.name}: ended before it was ready; see its words above")

    def result(self, patience: float) -> str:
        """Wait for its end and return what it printed.

        Raises
        ------
        UserError
            If it failed or did not end; its own words are on stderr already.
        """
        try:
            printed, words = self.process.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            raise UserError(f"{self.name}: did not end within {patience:g} s; see its words above") from None
        if words:
            print(words, end="", file=sys.stderr)
        if self.process.returncode != 0:
            raise UserError(
                f"{self.name}: failed with exit code {self.process.returncode}; see its words above"
            )
        return printed


class Session:
    """Start processes that end with this one: at the end of the block, however it ends, even by SIGKILL.

    Ends nothing that it did not start.
    """

    def __init__(self) -> None:
        self._children: list[Child] = []

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        for child in self._children:
            child.interrupt()
        deadline = time.monotonic() + _GRACE
        for child in self._children:
            _end(child.process, deadline)

    def start(self, name: str, command: Sequence[str], *, pipe_errors: bool = False) -> Child:
        """Start a process whose stdout is kept, and whose stderr is kept too if `pipe_errors`.

        It gets a session of its own, so that Ctrl-C reaches this process alone, which then ends the others.
        """
        try:
            process = subprocess.Popen(
                list(command),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE if pipe_errors else None,
                text=True,
                start_new_session=True,
                preexec_fn=_die_with_parent,
            )
        except OSError as exc:
            raise UserError(f"{command[0]}: cannot be started ({exc.strerror}); run make tools") from None
        self._children.append(Child(name, process))
        return self._children[-1]

    def wait(self, awaited: Child, needed: Sequence[Child]) -> None:
        """Return when `awaited` has ended; fail at once if one of the `needed` ends before it."""
        while awaited.running:
            for child in needed:
                if not child.running:
                    raise UserError(f"{child.name}: ended too early; see its words above")
            time.sleep(_TURN)


def _end(process: subprocess.Popen[str], deadline: float) -> None:
    """Wait until `deadline` (monotonic clock), then kill."""
    try:
        process.wait(max(0.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


def _die_with_parent() -> None:
    """Ask Linux to end this process when its parent dies, however that happens."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
