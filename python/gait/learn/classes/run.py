"""`gait learn --class`: one run for each class of motion, joined in one blob."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from operator import add
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gait.bindings.abi import MAX_CLASSES
from gait.bindings.model import is_model, read_cyclic
from gait.body.motion_classes import CLASS_TAGS, class_names, class_sections, first_class
from gait.counts import count_of
from gait.errors import UsageError, UserError
from gait.io import blob
from gait.io.files import require_writable
from gait.learn.arrays import Floats, column_means
from gait.learn.classes import changes, standing
from gait.learn.classes.join import Change, MotionClass, classes_of, join
from gait.learn.corpus.load import NothingLeft, static_trials
from gait.learn.corpus.sources import find, subjects
from gait.learn.cycles.sequence import AS_ACTIVITY, AS_BACKWARDS
from gait.learn.cycles.verdict import NAMES
from gait.learn.options import LearnOptions, SegmentOptions
from gait.learn.prior import model
from gait.learn.prior.level import level_components
from gait.learn.report.classes import figures as class_figures
from gait.learn.run import Note, check, require_other_output, run
from gait.learn.solve import readers
from gait.progress import progress

WALK, STAND, BACKWARDS, RUN = "walk", "stand", "backwards", "run"
DERIVED = STAND, BACKWARDS  # made from the walk, without recordings
UNFIT = ",\"'=/<>"  # for names of classes, which are in headers of track files, in paths and on pages
MOST_SHOWN = 60  # most characters of an unfit name in an error
MOST_NAMED = 8  # most recordings in a line
T = TypeVar("T")
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

    A class is ``run``, learnt from the runs among the sources; ``backwards`` or ``stand``, learnt from the
    walks backwards or the people who stand throughout among the sources, or derived from the walk if there
    are none; or ``NAME=SRC``, learnt from those recordings (``backwards`` in reversed time, as a walk whose
    phase decreases; ``stand`` from people who stand still) or taken from a model (`is_model`).  If
    the only source is a model, the classes are added to its own, or replace those of their names.  Returns
    the figures of the walk, with those of the classes under ``classes``.  With ``options.changes``, changes
    between the classes are learnt from those recordings; without classes they are those of a model.
    UsageError or UserError with one line if it cannot be done.
    """
    own = read_cyclic(options.sources[0]) if adds_to_a_model(options) else None
    first = options.activity if own is None else first_class(own)
    names = class_names(own or {}) or [first]
    wanted, alone = _parsed(options, names), replace(options, classes=(), several=True)
    if options.changes and not wanted:
        return _only_changes(own, options, note)
    _require(wanted, options)
    learnt = {name: _taken(name, source) for name, source in wanted.items() if is_model(source)}
    taken, posture, metas = set(learnt), None, dict[str, Mapping[str, Any]]()
    if own is None:
        check(alone)
    elif not class_names(own):
        note(
            f"{options.sources[0]}: was learnt alone, so its strides are as long at every rate, and slow "
            "walks are followed worse; learn it again from its recordings, together with the classes"
        )
    sorted_out = {name for name in DERIVED if wanted.get(name) == "" and own is None}
    sorter = _Sorter(options, note, sorted_out)
    for name, source in wanted.items():
        if name in taken:
            continue
        if name == STAND:
            posture = _recorded_posture(_postures(source, options, note), options, note) if source else None
        elif source or name != BACKWARDS:
            refused = None if source else sorter.not_runs
            learnt[name], files = _learnt(name, source, options, note, refused)
            sorter.runs |= set() if source else files

    def with_classes(walk: Mapping[str, blob.Array]) -> dict[str, blob.Array]:
        learnt.update(sorter.backward_walks())
        stands = posture or sorter.posture()
        classes = {one.name: one for one in classes_of(walk) or [_counted(MotionClass(first), walk)]}
        kept = classes.keys() - wanted.keys()
        for name in wanted:
            classes[name] = learnt[name] if name in learnt else _derived(name, walk, first, stands)
        names = list(classes)
        if others := [name for name in names[1:] if name in kept]:
            note(f"{options.sources[0]}: keeps its classes {' '.join(others)}")
        every = [replace(one, changes=_changes(one, names, kept)) for one in classes.values()]
        metas.update((one.name, one.meta) for one in every)
        credited = model.with_credits(
            walk, [{"credits": options.credit}, *(blob.read_meta(one.own or {}) for one in every)]
        )
        joined = join(changes.with_numbers_of(credited, kept), every)
        level = names if own is None else learnt.keys() - taken
        joined |= _level_curves(joined, [k for k, name in enumerate(names) if name in level])
        return changes.with_changes(joined, _observed(joined, options, note)) if options.changes else joined

    if own is not None:
        data = blob.write(options.output, with_classes(own))
        figures: dict[str, Any] = {"bytes": len(data), "crc32": f"{blob.checksum(data):08x}"}
    else:
        figures = run(alone, note, with_classes, sorter.left_out, metas=metas)
        data = Path(options.output).read_bytes()
    return figures | {"classes": class_figures(blob.decode(data), metas)}


class _Posture(NamedTuple):
    """The mean posture of people who stand."""

    angles: Floats  #: (24,)
    recordings: int
    people: int


@dataclass
class _Sorter:
    """Sorts recordings among the sources that are not learnt as the first class into other classes."""

    options: LearnOptions
    note: Note
    names: Collection[str]  #: classes, of `DERIVED`, whose recordings to find
    runs: set[str] = field(default_factory=set)  #: files that are learnt as runs
    not_runs: list[str] = field(default_factory=list)  #: a line about each of the others
    backwards: set[Path] = field(default_factory=set)
    stands: dict[Path, Floats] = field(default_factory=dict)  #: postures

    @cached_property
    def files(self) -> list[Path]:
        """Return the files of the sources."""
        return [path for path, _ in find(self.options.sources, self.options.exclude)[0]]

    def left_out(self, line: str) -> str:
        """Return what to report about a file left out, from the line about it; '' if a class takes it."""
        path = next((path for path in self.files if line.startswith(f"{path}: ")), None)
        if path is None:
            return line
        if str(path) in self.runs:
            return ""
        if BACKWARDS in self.names and AS_BACKWARDS in line:
            self.backwards.add(path)
        elif STAND in self.names:
            with suppress(UserError):
                self.stands[path] = standing.posture_of(
                    path, readers.read(path, self.options), throughout=True
                )
        if path in self.backwards or path in self.stands:
            return ""
        if f"{AS_ACTIVITY}{RUN}" in line:
            return next((other for other in self.not_runs if other.startswith(f"{path}: ")), line)
        return line

    def backward_walks(self) -> dict[str, MotionClass]:
        """Learn the walks backwards; empty if there are none, or too few."""
        if BACKWARDS not in self.names:
            return {}
        why = "none of the recordings is a walk backwards"
        if self.backwards:
            trials = zip(self.files, static_trials(self.files, self.options), strict=True)
            own = {str(trial): None for path, trial in trials if trial and path in self.backwards}
            options = replace(self.options, static=tuple(own))  # those of others would be unused
            try:
                learnt, files = _learnt(BACKWARDS, "", options, self.note, only=self.backwards)
            except UserError as exc:
                why = str(exc)
            else:
                self.note(f"--class {BACKWARDS}: recorded: {count_of(len(files), 'recording')}")
                return {BACKWARDS: learnt}
        self.note(f"--class {BACKWARDS}: derived, as the walk in reverse: {why}")
        return {}

    def posture(self) -> _Posture | None:
        """Return the posture of people who stand; None if there are none."""
        if self.stands:
            return _recorded_posture(self.stands, self.options, self.note)
        if STAND in self.names:
            why = "derived from the walk: in none of the recordings a person stands still throughout"
            self.note(f"--class {STAND}: {why}")
        return None


def _level_curves(joined: Mapping[str, blob.Array], learnt: Sequence[int]) -> dict[str, blob.Array]:
    """Return the curves, of those classes that take strides and have their own, with level components."""
    own = [k for k in learnt if joined["CLIN"][k][0] != 0 and joined["CLIN"][k][1] == k]
    return {
        CLASS_TAGS["CURV"].format(k) if k else "CURV": level_components(class_sections(joined, k), joined)
        for k in own
    }


def _only_changes(own: Mapping[str, blob.Array] | None, options: LearnOptions, note: Note) -> dict[str, Any]:
    """Learn only the changes between the classes of a model."""
    if own is None or not class_names(own):
        raise UsageError("--changes: are between classes of motion; give --class, or a model that has some")
    check(options)
    data = blob.write(options.output, changes.with_changes(own, _observed(own, options, note)))
    figures = class_figures(blob.decode(data))
    return {"bytes": len(data), "crc32": f"{blob.checksum(data):08x}", "classes": figures}


def _observed(sections: Mapping[str, blob.Array], options: LearnOptions, note: Note) -> changes.Observed:
    """Count the changes in ``options.changes``."""

    def counted(path: Path) -> changes.Observed:
        return changes.count(sections, changes.frames_of(path, readers.read(path, options)))

    found = _each("--changes", options.changes, counted, options, note)
    observed, names = reduce(add, found.values()), class_names(sections)
    kinds = [
        f"{names[i]} to {names[j]} {observed.counts[i, j]}" for i, j in np.argwhere(observed.counts).tolist()
    ]
    total = count_of(int(observed.counts.sum()), "change")
    note(
        f"--changes: {total} in {count_of(len(found), 'recording')}"
        + (f": {', '.join(kinds)}" if kinds else "")
    )
    return observed


def _postures(source: str, options: LearnOptions, note: Note) -> dict[Path, Floats]:
    """Return the angles (24,) of the person who stands in each recording."""

    def angles(path: Path) -> Floats:
        return standing.posture_of(path, readers.read(path, options))

    return _each(f"--class {STAND}", (source,), angles, options, note)


def _recorded_posture(found: Mapping[Path, Floats], options: LearnOptions, note: Note) -> _Posture:
    """Return the mean over people of the postures in recordings, and report which these are."""
    names = [str(path) for path in found]
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    count = count_of(len(names), "recording")
    note(f"--class {STAND}: recorded: {count}: {', '.join(names[:MOST_NAMED])}{more}")
    people: dict[str, list[Floats]] = {}
    for person, one in zip(subjects(list(found), options.subjects), found.values(), strict=True):
        people.setdefault(person, []).append(one)
    mean = column_means(np.array([column_means(np.array(each)) for each in people.values()]))
    return _Posture(mean, len(found), len(people))


def _each(
    option: str, sources: Sequence[str], use: Callable[[Path], T], options: LearnOptions, note: Note
) -> dict[Path, T]:
    """Return what `use` makes of each recording; those in folders that it refuses are left out."""
    files, closed = find(sources, options.exclude, note)
    found: dict[Path, T] = {}
    with progress(f"recordings of {option}", len(files), options.quiet) as update:
        for k, (path, in_folder) in enumerate(files, 1):
            try:
                found[path] = use(path)
            except UserError as error:
                if not in_folder:
                    raise
                closed.append(str(error))
            update(k)
    if not found:
        raise UserError(f"{option} {' '.join(sources)}: none of the recordings can be used ({closed[0]})")
    for line in closed:
        note(f"left out: {line}")
    return found


def adds_to_a_model(options: LearnOptions) -> bool:
    """Whether the walk is that of a model rather than learnt from recordings."""
    return len(options.sources) == 1 and is_model(options.sources[0])


def _parsed(options: LearnOptions, names: Sequence[str]) -> dict[str, str]:
    """Parse the names of the classes and their sources; `names`: of the existing classes, the walk first."""
    wanted, first = dict[str, str](), names[0]
    if options.classes:
        given = f"{options.sources[0]}: class" if adds_to_a_model(options) else "--activity"
        _require_name(f"{given} {first!a}"[:MOST_SHOWN], first)
    for text in options.classes:
        name, _, source = text.partition("=")
        _require_name(f"--class {text!a}"[:MOST_SHOWN], name)
        if name in wanted:
            raise UsageError(f"--class {text}: {name} is given twice; give each class its own name")
        if name == first:
            raise UsageError(f"--class {text}: give each class its own name, not {first}")
        if like := [
            other for other in (*names, *wanted) if other.casefold() == name.casefold() and other != name
        ]:
            raise UsageError(f"--class {text}: differs from the class {like[0]} only by case; rename it")
        if not source and (name not in (*DERIVED, RUN) or (name == RUN and adds_to_a_model(options))):
            why = "only run, backwards and stand are sorted out of the sources"
            why = "the source is a model, which has no recordings" if name == RUN else why
            raise UsageError(f"--class {text}: {why}; give a folder of recordings, --class {name}=FOLDER")
        wanted[name] = source
    if (count := len({*names, *wanted})) > MAX_CLASSES:
        most = f"a model has at most {MAX_CLASSES}; leave some out"
        raise UsageError(f"--class: with {' '.join(names)} these are {count} classes, but {most}")
    if options.report and adds_to_a_model(options):
        raise UsageError("--report: draws what is learnt from recordings; leave it out, see gait info")
    if options.segments.source == "only":
        raise UsageError("--class: cannot be used with --segments only, which learns no cyclic model")
    return wanted


def _require(wanted: Mapping[str, str], options: LearnOptions) -> None:
    """Raise errors about sources and the model's file before any recording is read."""
    require_other_output(options)
    require_writable(options.output)
    recordings = () if adds_to_a_model(options) else options.sources
    for sources in filter(None, (recordings, options.changes)):
        find(sources, options.exclude)
    for name, source in wanted.items():
        try:
            if source and not is_model(source):
                find([source], options.exclude)
        except UserError as exc:
            raise UserError(f"--class {name}: {exc}") from None


def _require_name(given: str, name: str) -> None:
    """Raise UsageError, about the words `given`, for a name that models or track files cannot have."""
    if not name.strip() or not name.isprintable() or set(name) & set(UNFIT):
        words = "the name is blank, or has a comma, quote, '=', '/', '<', '>' or control character"
        raise UsageError(f"{given}: {words}; use letters and digits")
    if len(name.encode()) >= blob.NAME_BYTES:
        raise UsageError(f"{given}: the name is longer than {blob.NAME_BYTES - 1} bytes; shorten it")


def _derived(name: str, walk: Mapping[str, blob.Array], first: str, posture: _Posture | None) -> MotionClass:
    """Return a class derived from the first; `posture`: for standing."""
    if name == BACKWARDS:
        return MotionClass(BACKWARDS, -1, source=first)
    if posture is None:
        return MotionClass(STAND, 0, own=standing.sections(walk))
    own, meta = standing.sections(walk, posture.angles), {"subject_count": posture.people}
    return MotionClass(STAND, 0, own=own, recordings=posture.recordings, meta=meta)


def _taken(name: str, source: str) -> MotionClass:
    """Return the class of this name of a model, or the only class of a model, under this name."""
    own = read_cyclic(source)
    names = class_names(own)
    if name in names:
        k = names.index(name)
        return replace(classes_of(own)[k], own=class_sections(own, k))
    if names:
        raise UserError(
            f"--class {name}={source}: has no class {name}; name one of its classes, {' '.join(names)}"
        )
    activity = first_class(own)
    kinds = {NAMES.get(activity.lower()), NAMES.get(name)} - {None}
    if name in DERIVED or len(kinds) > 1:
        raise UserError(
            f"--class {name}={source}: is a model of {activity!r}; give recordings, or a model of {name}"
        )
    return _counted(MotionClass(name, own=own), own)


def _learnt(
    name: str,
    source: str,
    options: LearnOptions,
    note: Note,
    refused: list[str] | None = None,
    only: Collection[Path] = (),
) -> tuple[MotionClass, set[str]]:
    """Learn a class from recordings; return also the files that were used.

    Without a source, they are among the sources of the first class: those of `only`, or those that are
    accepted.  Lines about others are added to `refused` if it is given, and reported otherwise.
    """

    def left_out(line: str) -> str:
        if refused is None:
            return line
        refused.append(line)
        return ""

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
            several=True,
        )
        try:
            figures = run(own, lambda line: note(f"class {name}: {line}"), left_out=left_out, only=only)
        except NothingLeft as exc:
            if source or only:
                raise
            why = next((line for line in exc.refused if f"{AS_ACTIVITY}{WALK}" not in line), exc.refused[0])
            remedy = f"give --class {name}=FOLDER, or leave it out"
            raise UserError(f"--class {name}: none of the recordings is a {name} ({why}); {remedy}") from None
        except UserError as exc:
            raise UserError(f"class {name}: {exc}") from None
        found = blob.read(own.output)
        files = {one["source"] for one in figures["sequences"]}
        return _counted(MotionClass(name, -1 if own.reverse else 1, found), found), files


def _counted(one: MotionClass, own: Mapping[str, blob.Array]) -> MotionClass:
    """Return a class with the META of its model, and the numbers of cycles and recordings in it."""
    meta = blob.read_meta(own)
    recordings = meta.get("sequences", {}).get("count", 0)
    return replace(one, cycles=int(meta.get("cycles", 0)), recordings=int(recordings), meta=meta)


def _changes(one: MotionClass, names: list[str], kept: Collection[str]) -> dict[str, Change]:
    """Return a class's changes: between kept classes as they were, others as assumed."""
    assumed = _assumed(one.name, names)
    if one.name not in kept:
        return assumed
    others = {to: change for to, change in assumed.items() if to not in kept}
    return others | {to: change for to, change in one.changes.items() if to in kept}


def _assumed(name: str, names: list[str]) -> dict[str, Change]:
    known = CLASS_CHANGES.get(name)
    if known is None:
        return {other: OTHER_CHANGE for other in (names[0], STAND) if other in names and other != name}
    others = {
        other: OTHER_CHANGE for other in names if other not in CLASS_CHANGES and name in (names[0], STAND)
    }
    return {other: change for other, change in (known | others).items() if other in names}
