"""One run of `gait learn`: read, solve, cycle, fit, write."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from gait.bindings.model import is_model, model_file
from gait.bindings.segment_prior import SegmentPrior
from gait.errors import UsageError, UserError
from gait.io import blob
from gait.io.files import require_folder, require_writable
from gait.learn.corpus import load, sources
from gait.learn.corpus.load import RunNotes
from gait.learn.cycles import verdict
from gait.learn.mocap import points
from gait.learn.mocap.markers import plain
from gait.learn.options import LearnOptions
from gait.learn.prior import fit, model
from gait.learn.report import classes, page, summary
from gait.learn.segments import fit as segment_fit
from gait.learn.segments import summary as segment_summary
from gait.learn.segments.corpus import Corpus
from gait.learn.solve.readers import SUFFIXES
from gait.progress import progress
from gait.reproducible import one_thread

MOST_LINES = 20  # most lines about files left out
MOST_NAMED_LABELS = 6  # most labels in a line

Note = Callable[[str], None]
Sections = dict[str, blob.Array]


def run(
    options: LearnOptions,
    note: Note = lambda line: None,
    complete: Callable[[Sections], Sections] = lambda sections: sections,
    left_out: Callable[[str], str] = lambda line: line,
    only: Collection[Path] = (),
    metas: Mapping[str, Mapping[str, Any]] = classes.NO_METAS,
) -> dict[str, Any]:
    """Learn a model, write it and its report, and return the figures of `report.summary`.

    `note` gets lines that a user should know.  `complete` adds to the sections of the model before they are
    written.  `left_out` returns what to report about a file that was left out, from the line about it; '' if
    it belongs to another class.  ``only``: files of the sources to learn from, if not all.  ``metas``: META
    of the classes that `complete` adds, for the report.  UsageError or UserError with one line if it cannot
    be done.
    """
    check(options, note)
    with one_thread(), Corpus() as corpus:
        loaded = _load(options, corpus, note, left_out, only)
        if options.segments.source == "only":
            return _segments_alone(options, corpus, loaded.refused)
        learned = fit.fit(loaded.sequences, options, loaded.others)
        summary.require_filled(learned)
        _note_all(summary.notes(learned, options), note)
        prior = _segment_prior(options, corpus, note)
        sections = model.sections(learned, options) | (segment_fit.sections(prior) if prior else {})
        sections = complete(sections)
        data = blob.write(options.output, sections)
        if options.report:
            try:
                found = classes.figures(sections, metas)
                page.write(
                    Path(options.report), learned, options, loaded.refused, found, sections, options.quiet
                )
            except BaseException:
                print(f"{options.output}: the model is written; the report is not", file=sys.stderr)
                raise
        return summary.summary(learned, data, loaded.refused, prior, bool(options.report))


def check(options: LearnOptions, note: Note = lambda line: None) -> None:
    """Raise errors, before the work, for what would fail after it."""
    if options.report and options.segments.source == "only":
        raise UsageError("--report draws the cyclic model; leave it out, or --segments only")
    if options.activity.lower() not in verdict.NAMES:
        activity = repr(options.activity)
        note(f"any motion that repeats is learnt as {activity}, which is no name of walking or running")
    require_other_output(options)
    output, report = Path(os.path.realpath(options.output)), options.report
    if report and output in ((folder := Path(os.path.realpath(report))), *folder.parents):
        raise UsageError(f"--report {report}: the model goes to {options.output}; name another folder")
    require_writable(options.output)
    if report:
        require_folder(report)
        page.require_own(Path(report))


def require_other_output(options: LearnOptions) -> None:
    """Raise UsageError if the model would replace a file that is read, or has the name of a recording."""
    output = Path(os.path.realpath(options.output))
    if output.suffix.lower() in (*SUFFIXES, ".asf"):
        raise UsageError(
            f"-o {options.output}: has the name of a recording; name the model M.gait, and sources before -o"
        )
    read = [
        *options.sources,
        *options.static,
        *options.changes,
        *(text.partition("=")[2] for text in options.classes),
        *([str(options.markers.path)] if options.markers else []),
    ]
    files = (model_file(path) if is_model(path) else path for path in read if path)
    if any(os.path.realpath(file) == str(output) for file in files):
        raise UsageError(f"-o {options.output}: is also an input; give the model another name")


def _load(
    options: LearnOptions,
    corpus: Corpus,
    note: Note,
    left_out: Callable[[str], str],
    only: Collection[Path],
) -> load.Loaded:
    """Find and prepare the files; report files that were left out, and the readers' observations."""
    files, closed = sources.find(options.sources, options.exclude, note)
    files = [file for file in files if not only or file[0] in only]
    trials = {os.path.realpath(name) for name in options.static}
    files = [file for file in files if os.path.realpath(file[0]) not in trials]
    if not files:
        raise UserError("--static: names all files; give the recordings of motion as sources")
    markers, notes = options.markers, RunNotes()
    if markers and not any(path.suffix.lower() in points.SUFFIXES for path, _ in files):
        note(f"--markers {markers.path}: not used: no file is a {' or '.join(points.SUFFIXES)}")
    different: list[str] = []
    with progress("measuring people", None, options.quiet) as update:
        shared = load.shared_lengths(files, options, update, different.append)
    _note_all(different, note)
    with progress("reading motion", len(files), options.quiet) as update:
        try:
            loaded = load.load_all(files, options, update, corpus=corpus, shared=shared, notes=notes)
        except UserError as error:
            if isinstance(error, load.NothingLeft):
                _note_left_out(_reported(closed + error.refused[1:], left_out), "", note)
            _note_all(_hints(options, notes), note)  # they may be the reason
            raise
    refused = _reported(closed + loaded.refused, left_out)
    _note_left_out(refused, " (see --json or --report)", note)
    _note_all(_hints(options, notes), note)
    return loaded._replace(refused=refused)


def _reported(lines: list[str], left_out: Callable[[str], str]) -> list[str]:
    return [reported for line in lines if (reported := left_out(line))]


def _hints(options: LearnOptions, notes: RunNotes) -> Iterator[str]:
    """Yield the readers' observations; a marker map may have labels of several sets, but no misspelt ones."""
    if options.markers and notes.labels:
        absent = [repr(name) for name in options.markers.named if plain(name) not in notes.labels]
        if absent:
            names = ", ".join(absent[:MOST_NAMED_LABELS]) + (
                " ..." if len(absent) > MOST_NAMED_LABELS else ""
            )
            yield f"--markers {options.markers.path}: no file has the marker {names}; check the spelling"
    if notes.zeros:
        path, zeros = notes.zeros[0]
        yield f"{path}: exactly 0: {zeros}{_more(notes.zeros)}; if that is missing data, give --zeros-missing"
    if notes.lacking:
        path, parts = notes.lacking[0]
        names = ", ".join(parts[:MOST_NAMED_LABELS]) + (" ..." if len(parts) > MOST_NAMED_LABELS else "")
        yield f"{path}: has no {names}{_more(notes.lacking)}: learnt without; rename them if they are there"
    if notes.parts:
        path, part = notes.parts[0]
        yield f"{path}: not one steady motion{_more(notes.parts)}: learnt from {part}"
    belts = [(path, speed) for path, speed in notes.belts if speed]
    if belts:
        path, speed = belts[0]
        yield f"{path}: on a treadmill{_more(belts)}: shifted at the belt's {speed:.2f} m/s, by the feet"
    if still := [path for path, speed in notes.belts if not speed]:
        words = "stays in place, and the feet do not slide at one speed"
        yield f"{still[0]}: {words}{_more(still)}: learnt without the speed of a belt"


def _more(files: list[Any]) -> str:
    """Describe the files after the first."""
    others = len(files) - 1
    return f" (and similar in {others} more file{'s' * (others > 1)})" if others else ""


def _segment_prior(options: LearnOptions, corpus: Corpus, note: Note) -> SegmentPrior | None:
    """Learn a segment prior in addition to a cyclic model; if there are too few segments, only note why."""
    if options.segments.source == "none":
        return None
    try:
        return segment_fit.fit(corpus.recordings(), options.segments)
    except UserError as error:
        note(f"no segment prior: {error}")
        return None


def _segments_alone(options: LearnOptions, corpus: Corpus, refused: list[str]) -> dict[str, Any]:
    """Learn and write a segment prior without a cyclic model."""
    recordings = corpus.recordings()
    prior = segment_fit.fit(recordings, options.segments)
    names = [model.shortened(r.name) for r in recordings[: model.MOST_ROWS]]
    origin = model.origin(options, [r.source for r in recordings])
    meta = model.meta_section(origin | {"recordings": names})
    data = blob.write(options.output, {"META": meta, **segment_fit.sections(prior)})
    figures = segment_summary.summary(prior)
    crc = f"{blob.checksum(data):08x}"
    return {"bytes": len(data), "crc32": crc, "left_out": refused, "segments": figures}


def _note_all(lines: Iterable[str], note: Note) -> None:
    for line in lines:
        note(line)


def _note_left_out(refused: list[str], more: str, note: Note) -> None:
    """Report which files were left out."""
    _note_all((f"left out: {line}" for line in refused[:MOST_LINES]), note)
    if len(refused) > MOST_LINES:
        note(f"left out: {len(refused) - MOST_LINES} more{more}")
