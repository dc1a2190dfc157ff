"""Solve the whole motion in a separate process, so that the page never waits.

The newest corrections win: while one is solved, those that arrive are kept until the last of them is taken.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection

from gait.errors import UserError
from gait.lift.keypoints.corrections import Edits
from gait.studio.shown import Lift, Solved

Answer = Callable[[int, "Solved | str"], None]
LAST = -1
"""Number of the answer that no other follows, because the process has ended."""
ENDED = "the process that solves the whole motion has died; corrections are saved, start gait studio again"


def _serve(pipe: Connection, lift: Lift) -> None:
    """Solve the newest of what arrives, until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this process
    os.nice(10)  # what moves while the user looks on comes first
    while True:
        try:
            number, edits = pipe.recv()
            while pipe.poll():
                number, edits = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            found: Solved | str = lift.whole(edits)
        except UserError as error:
            found = str(error)
        except Exception:
            found = traceback.format_exc(limit=1).strip().splitlines()[-1]
        try:
            pipe.send((number, found))
        except OSError:
            return


class Refiner:
    """Process that lifts with the corrections that it was given last.

    Parameters
    ----------
    lift : Lift
    answer : callable
        Called in a thread with the number of a request, and the motion or what is wrong with it.
    """

    def __init__(self, lift: Lift, answer: Answer) -> None:
        context = multiprocessing.get_context("spawn")  # a copy would share the threads of the server
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other, lift), daemon=True)
        self._process.start()
        other.close()
        self._answer = answer
        threading.Thread(target=self._listen, daemon=True).start()

    def ask(self, number: int, edits: Edits) -> bool:
        """Ask for the motion with corrections; the answer comes later. False: the process has ended."""
        try:
            self._pipe.send((number, edits))
        except OSError:
            return False
        return True

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join()

    def _listen(self) -> None:
        while True:
            try:
                number, found = self._pipe.recv()
            except (EOFError, OSError):
                self._answer(LAST, ENDED)
                return
            self._answer(number, found)
