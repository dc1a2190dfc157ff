"""Solve the whole motion in a separate process, so that the page never waits.

Only the newest corrections count: of requests that arrive during a solution, only the last is solved next.
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
LAST_ANSWER = -1
"""Number of the last answer, which reports that the process has ended."""
ENDED = "the process that solves the whole motion has died; corrections are saved, start gait studio again"


def _serve(pipe: Connection, lift: Lift) -> None:
    """Solve the newest request each time, until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this process
    os.nice(10)  # the interactive part has priority
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
    """Process that lifts with the latest corrections.

    Parameters
    ----------
    lift : Lift
    answer : callable
        Called in a thread with the number of a request, and the motion or an error text.
    """

    def __init__(self, lift: Lift, answer: Answer) -> None:
        context = multiprocessing.get_context("spawn")  # a copied process would share the server's threads
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other, lift), daemon=True)
        self._process.start()
        other.close()
        self._answer = answer
        threading.Thread(target=self._listen, daemon=True).start()

    def ask(self, number: int, edits: Edits) -> bool:
        """Request the motion with corrections, answered later; return False if the process has ended."""
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
                self._answer(LAST_ANSWER, ENDED)
                return
            self._answer(number, found)
