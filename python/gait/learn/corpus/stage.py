"""The per-file stage of learning: a file to a sequence and its markers, or to the reason why not.

Before it, files of markers are measured whose person has several (`gait.learn.corpus.shared_stretches`).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
from threadpoolctl import ThreadpoolController

from gait.errors import UserError
from gait.learn.cycles import sequence
from gait.learn.cycles.sequence import Sequence
from gait.learn.mocap.angle_file import AngleTable
from gait.learn.mocap.remarks import NOTHING, Remarks
from gait.learn.reading import DEFAULT, Reading
from gait.learn.segment_options import Segments
from gait.learn.segments import segment_motion
from gait.learn.segments.segment_motion import Motion
from gait.learn.solve import readers
from gait.learn.solve.body import Body
from gait.learn.solve.retarget import Measures
from gait.learn.solve.stretch_information import Information

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """A file to prepare, or only to measure; with the stretches of its person if others tell them too."""

    path: Path
    reading: Reading = DEFAULT
    stretch: Floats | None = None
    measuring: bool = False

    def done(self) -> Prepared:
        """Do it; what its user can mend comes back as a value, so that it can travel."""
        with one_thread():
            return _measured(self) if self.measuring else _prepared(self)


@dataclass(frozen=True)
class Prepared:
    """What a file gave: a sequence, or why none and whose body; and markers for the prior over segments."""

    sequence: Sequence | None = None
    refused: UserError | None = None
    motion: Motion | None = None
    body: Measures | None = None  #: of a file whose motion is refused
    stretches: Information | None = None  #: of a file that was only to be measured
    remarks: Remarks = NOTHING


def _measured(task: Task) -> Prepared:
    """Find what markers tell of the person; why they tell nothing is said when the file is prepared."""
    try:
        return Prepared(stretches=readers.information(task.path, task.reading))
    except UserError:
        return Prepared()


def _prepared(task: Task) -> Prepared:
    """Read and prepare one file."""
    path, reading = task.path, task.reading
    try:
        read = readers.read(path, reading, task.stretch)
    except UserError as error:
        return Prepared(refused=error)
    return replace(_used(path, read, reading), remarks=read.remarks)


def _used(path: Path, read: Body | AngleTable, reading: Reading) -> Prepared:
    """Prepare what was read of a file."""
    found, refused, body = None, None, None
    try:
        if reading.segments.source != "only":
            found = sequence.prepare(path, read, reading)
    except UserError as error:
        refused, body = error, sequence.measured(read)
    try:
        motion = _motion(path, read, reading.segments, found)
    except UserError as error:
        return Prepared(found, None if found else refused or error, body=body)
    return Prepared(found, refused, motion, body)


def _motion(path: Path, read: Body | AngleTable, wanted: Segments, found: Sequence | None) -> Motion | None:
    """Markers of what was read: of all of it, or of the part that the cyclic model learns from."""
    if wanted.whole:
        return segment_motion.of(path, read, wanted)
    if wanted.source == "learnt" and found is not None:
        return segment_motion.of(path, read, wanted, found.kept)
    return None


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the linear algebra of numpy use one thread.

    Its bits then do not depend on the number of cores, and its small matrices are faster for it.
    """
    with _algebra().limit(limits=1, user_api="blas"):
        yield


def one_thread_for_good() -> None:
    """Do so until the process ends: where files are prepared in threads, one would end the other's limit."""
    _algebra().limit(limits=1, user_api="blas")


@cache
def _algebra() -> ThreadpoolController:
    return ThreadpoolController()
