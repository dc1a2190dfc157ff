"""`gait learn --class`: one run for each class of motion, joined in one blob."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from operator import add
from pathlib import Path
from typing import Any

from gait.bindings.model import read_cyclic
from gait.errors import UsageError, UserError
from gait.io import blob
from gait.learn.classes import changes, standing
from gait.learn.classes.join import Change, MotionClass, join
from gait.learn.corpus.load import NothingLeft
from gait.learn.corpus.sources import find
from gait.learn.options import LearnOptions, SegmentOptions
from gait.learn.report.classes import figures as class_figures
from gait.learn.run import Note, check, run
from gait.learn.solve import readers
from gait.progress import progress

WALK, STAND, BACKWARDS, RUN = "walk", "stand", "backwards", "run"
DERIVED = STAND, BACKWARDS  # made from the walk
STEP_CONCENTRATION = 6.0  # concentration with an sd of about a twentieth of a stride
#: Rates of change from one class to another, per second at the most likely phase and pace, before recordings
#: of changes (``LearnOptions.changes``).  They are assumptions about people indoors and in streets:
#: they walk for a few seconds up to a minute, and stop with both feet on the ground.
CLASS_CHANGES: dict[str, dict[str, Change]] = {
    WALK: {
        STAND: Change(1.0, STEP_CONCENTRATION, 0.05),
        BACKWARDS: Change(0.002),
        RUN: Change(0.3, slope=1.0),
    },
    STAND: {
        WALK: Change(0.7, STEP_CONCENTRATION, 0.0),
        BACKWARDS: Change(0.3, STEP_CONCENTRATION, 0.0),
        RUN: Change(0.05),
    },
    BACKWARDS: {STAND: Change(1.0, STEP_CONCENTRATION, 0.05), WALK: Change(0.002)},
    RUN: {WALK: Change(0.5, slope=-1.0), STAND: Change(0.1)},
}
OTHER_CHANGE = Change(0.1)  # between a user's class and walking or standing


def learn(options: LearnOptions, note: Note) -> dict[str, Any]:
    """Learn each of ``options.classes`` that has recordings, then the walk, and write one blob.

    A class is ``stand`` or ``backwards``, derived from the walk; or ``NAME=SRC``, learnt from those
    recordings (``backwards`` in reversed time, as a walk whose phase decreases) or taken from a model
    (``.gait``); or ``run``, learnt from the runs among the sources.  Returns the figures of the walk, with
    those of the classes under ``classes``.  With ``options.changes``, changes between the classes are learnt
    from those recordings; without classes they are those of a model.  UsageError or UserError with one line
    if it cannot be done.
    """
    wanted, alone = _parsed(options), replace(options, classes=())
    if options.changes and not wanted:
        return _only_changes(options, note)
    if not adds_to_a_model(options):
        check(alone)
    learnt = {
        name: _learnt(name, source, options, note)
        for name, source in wanted.items()
        if source or name not in DERIVED
    }

    def with_classes(walk: Mapping[str, blob.Array]) -> dict[str, blob.Array]:
        walk = changes.without_numbers(walk)
        classes = [_counted(MotionClass(options.activity), walk)]
        for name in wanted:
            one = learnt[name] if name in learnt else _derived(name, walk, options.activity)
            classes += [one] if one is not None else []
        names = [one.name for one in classes]
        joined = join(walk, [replace(one, changes=_changes(one.name, names)) for one in classes])
        return changes.with_changes(joined, _observed(joined, options, note)) if options.changes else joined

    if adds_to_a_model(options):
        data = blob.write(options.output, with_classes(read_cyclic(options.sources[0])))
        figures: dict[str, Any] = {"bytes": len(data), "crc32": f"{blob.checksum(data):08x}"}
    else:
        figures = run(alone, note, with_classes)
        data = Path(options.output).read_bytes()
    return figures | {"classes": class_figures(blob.decode(data))}


def _only_changes(options: LearnOptions, note: Note) -> dict[str, Any]:
    """Learn only the changes between the classes of a model."""
    own = read_cyclic(options.sources[0]) if adds_to_a_model(options) else {}
    if "CLNM" not in own:
        raise UsageError("--changes: are between classes of motion; give --class, or a model that has some")
    check(options)
    data = blob.write(options.output, changes.with_changes(own, _observed(own, options, note)))
    figures = class_figures(blob.decode(data))
    return {"bytes": len(data), "crc32": f"{blob.checksum(data):08x}", "classes": figures}


def _observed(sections: Mapping[str, blob.Array], options: LearnOptions, note: Note) -> changes.Observed:
    """Count the changes in ``options.changes``."""
    files, closed = find(options.changes, options.exclude, note)
    observed = list[changes.Observed]()
    with progress("counting changes", len(files), options.quiet) as update:
        for k, (path, in_folder) in enumerate(files, 1):
            try:
                observed.append(changes.count(sections, changes.frames_of(path, readers.read(path, options))))
            except UserError as error:
                if not in_folder:
                    raise
                closed.append(str(error))
            update(k)
    for line in closed:
        note(f"left out: {line}")
    if not observed:
        raise UserError(f"--changes {' '.join(options.changes)}: none of the recordings can be used")
    return reduce(add, observed)


def adds_to_a_model(options: LearnOptions) -> bool:
    """Whether the walk is that of a model rather than learnt from recordings."""
    return len(options.sources) == 1 and Path(options.sources[0]).suffix == ".gait"


def _parsed(options: LearnOptions) -> dict[str, str]:
    """Parse the names of the classes and their sources."""
    wanted: dict[str, str] = {}
    for text in options.classes:
        name, _, source = text.partition("=")
        if not name or name in wanted or name == options.activity:
            raise UsageError(f"--class {text}: give each class its own name, not {options.activity}")
        if name == BACKWARDS and Path(source).suffix == ".gait":
            raise UsageError(f"--class {text}: give recordings, or nothing to derive it from the walk")
        if not source and (name not in (*DERIVED, RUN) or (name == RUN and adds_to_a_model(options))):
            raise UsageError(f"--class {text}: give recordings, --class {name}=FOLDER")
        wanted[name] = source
    if options.report and adds_to_a_model(options):
        raise UsageError("--report: draws what is learnt from recordings; leave it out, see gait info")
    if options.segments.source == "only":
        raise UsageError("--class: cannot be used with --segments only, which learns no cyclic model")
    return wanted


def _derived(name: str, walk: Mapping[str, blob.Array], activity: str) -> MotionClass:
    if name == STAND:
        return MotionClass(STAND, 0, own=standing.sections(walk))
    return MotionClass(BACKWARDS, -1, source=activity)


def _learnt(name: str, source: str, options: LearnOptions, note: Note) -> MotionClass | None:
    """Learn a class from recordings, or take it from a model; None if no source belongs to it."""
    if Path(source).suffix == ".gait":
        return _counted(MotionClass(name, own=read_cyclic(source)), None)
    with tempfile.TemporaryDirectory() as folder:
        own = replace(
            options,
            sources=(source,) if source else options.sources,
            output=str(Path(folder) / "class.gait"),
            activity=options.activity if name == BACKWARDS else name,
            reverse=name == BACKWARDS,
            report=None,
            segments=SegmentOptions(source="none"),
            classes=(),
        )
        try:
            run(own, lambda line: note(f"class {name}: {line}"))
        except NothingLeft as exc:
            if source:
                raise
            note(f"class {name}: skipped, none of the recordings is a {name} ({exc})")
            return None
        except UserError as exc:
            raise UserError(f"class {name}: {exc}") from None
        return _counted(MotionClass(name, -1 if own.reverse else 1, blob.read(own.output)), None)


def _counted(one: MotionClass, walk: Mapping[str, blob.Array] | None) -> MotionClass:
    """Return a class with the numbers of cycles and recordings in its META."""
    sections = one.own if one.own is not None else walk or {}
    meta = json.loads(sections["META"].tobytes()) if "META" in sections else {}
    recordings = meta.get("sequences", {}).get("count", 0)
    return replace(one, cycles=int(meta.get("cycles", 0)), recordings=int(recordings))


def _changes(name: str, names: list[str]) -> dict[str, Change]:
    known = CLASS_CHANGES.get(name)
    if known is None:
        return {other: OTHER_CHANGE for other in (names[0], STAND) if other in names and other != name}
    others = {
        other: OTHER_CHANGE for other in names if other not in CLASS_CHANGES and name in (names[0], STAND)
    }
    return {other: change for other, change in (known | others).items() if other in names}
