"""The task for each file, in any process: from a file to a sequence and its markers, or to an error.

Before that, people with several files of markers are measured (`gait.learn.corpus.load.shared_lengths`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from gait.errors import UserError
from gait.learn.arrays import Floats
from gait.learn.cycles import sequence
from gait.learn.cycles.sequence import Sequence
from gait.learn.mocap.recording import NO_NOTES, FileNotes
from gait.learn.mocap.tables import AngleTable
from gait.learn.options import DEFAULT, LearnOptions
from gait.learn.segments import motion
from gait.learn.segments.motion import Motion
from gait.learn.solve import readers, retarget
from gait.learn.solve.body import Body
from gait.learn.solve.retarget import Measures
from gait.learn.solve.skeleton_fit import LengthInformation
from gait.reproducible import one_thread


@dataclass(frozen=True)
class Task:
    """A file to prepare, or only to measure."""

    path: Path
    options: LearnOptions = DEFAULT
    log_scales: Floats | None = None  #: length scales of the person, if several recordings show them
    measuring: bool = False

    def run(self) -> Prepared:
        """Do the task; a UserError is part of the result, so that it can travel between processes."""
        with one_thread():
            return _measured(self) if self.measuring else _prepared(self)


@dataclass(frozen=True)
class Prepared:
    """Result for a file."""

    sequence: Sequence | None = None
    refused: UserError | None = None  #: why there is no sequence
    motion: Motion | None = None  #: markers for the segment prior
    body: Measures | None = None  #: of a file whose motion cannot be used
    lengths: LengthInformation | None = None  #: of a file that was only measured
    #: Whether the lengths are its own, as it could not be used with those of the person's other recordings.
    alone: bool = False
    notes: FileNotes = NO_NOTES


def _measured(task: Task) -> Prepared:
    """Measure the person from markers; errors are reported when the file is prepared."""
    try:
        return Prepared(lengths=readers.length_information(task.path, task.options))
    except UserError:
        return Prepared()


def _prepared(task: Task) -> Prepared:
    """Read and prepare one file, with its own lengths if it cannot be used with those of the person."""
    together = _prepared_as(task)
    own = task.log_scales is None or bool(task.options.static)
    if together.sequence is not None or own or task.options.segments.source == "only":
        return together
    alone = _prepared_as(replace(task, log_scales=None))
    return together if alone.sequence is None else replace(alone, alone=True)


def _prepared_as(task: Task) -> Prepared:
    """Read and prepare one file as the task states."""
    path, options = task.path, task.options
    try:
        read = readers.read(path, options, task.log_scales)
    except UserError as error:
        return Prepared(refused=error)
    found, refused, body = None, None, None
    try:
        if options.segments.source != "only":
            found = sequence.prepare(path, read, options)
    except UserError as error:
        refused = error
        body = None if isinstance(read, AngleTable) else retarget.measure(retarget.levelled(read))
    try:
        markers = _markers(path, read, options, found)
    except UserError as error:
        return Prepared(found, None if found else refused or error, body=body, notes=read.notes)
    return Prepared(found, refused, markers, body, notes=read.notes)


def _markers(
    path: Path, read: Body | AngleTable, options: LearnOptions, found: Sequence | None
) -> Motion | None:
    """Return the markers of a whole recording, or of the part that the cyclic model learns from."""
    wanted = options.segments
    if wanted.whole:
        return motion.of(path, read, wanted)
    if wanted.source == "learnt" and found is not None:
        return motion.of(path, read, wanted, found.kept)
    return None
