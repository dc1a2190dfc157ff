"""What `gait learn` does with its options: read, learn, write, report."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterable
from pathlib import Path

from gait.cli import learn_hints, learn_prior, learn_segments, learn_text
from gait.errors import UsageError, UserError
from gait.io import blob
from gait.io.files import require_folder, require_writable
from gait.learn.corpus import fork_server, sources
from gait.learn.corpus.shared_stretches import Shared
from gait.learn.corpus.stage import one_thread
from gait.learn.cycles import activity
from gait.learn.cycles.sequence import Sequence
from gait.learn.mocap import marker_map
from gait.learn.mocap.remarks import Noticed
from gait.learn.prior import fit, model
from gait.learn.reading import Reading
from gait.learn.report import report_place
from gait.learn.segments import segment_sections
from gait.learn.segments.segment_corpus import Corpus
from gait.learn.solve.readers import KINDS
from gait.learn.solve.retarget import Measures
from gait.progress import progress

MOST_LINES = 20  # about files left out


def run(args: argparse.Namespace) -> int:
    """Read, learn, write, report."""
    _check(args)
    wanted = learn_segments.options(args)
    with one_thread(), Corpus() as corpus:
        sequences, refused, others = _read(args, corpus)
        if wanted.source == "only":
            return learn_prior.write_alone(args, corpus, wanted, refused)
        learned = fit.fit(sequences, args.components, args.seed, args.prior, others)
        _say(learn_text.notes(learned, args.components), args.quiet)
        prior = learn_prior.learn(corpus, wanted, args.quiet)
        sections = model.sections(learned, args.activity, args.seed)
        data = blob.write(args.output, sections | (segment_sections.sections(prior) if prior else {}))
        if args.report:
            from gait.learn.report import report

            try:
                report.write(Path(args.report), learned, args.activity, refused, args.quiet)
            except BaseException:
                print(f"{args.output}: the model is written; the report is not", file=sys.stderr)
                raise
    figures = learn_text.summary(learned, data, refused, prior, bool(args.report))
    print(json.dumps(figures) if args.json else learn_text.text(args.output, figures))
    return 0


def _check(args: argparse.Namespace) -> None:
    """Refuse before the work what would fail after it."""
    if args.dask and args.jobs:
        raise UsageError("--jobs is for this machine and --dask for a cluster; give one of them")
    if args.markers:
        marker_map.read(args.markers)
    if args.report and args.segments == "only":
        raise UsageError("--report draws the cyclic model; leave it out, or --segments only")
    if args.activity.lower() not in activity.NAMES and not args.quiet:
        names = ", ".join(activity.NAMES)
        print(f"--activity {args.activity}: none of {names}: any cyclic motion is learnt", file=sys.stderr)
    _check_output(args)
    require_writable(args.output)
    if args.report:
        require_folder(args.report)
        report_place.require_own(Path(args.report))


def _check_output(args: argparse.Namespace) -> None:
    """Refuse to write the model over what is read, or where the report shall be."""
    output = Path(os.path.realpath(args.output))
    if output.suffix.lower() in (*KINDS, ".asf"):
        raise UsageError(
            f"-o {args.output}: is named like a recording; name the model M.gait, and sources before -o"
        )
    if any(os.path.realpath(p) == str(output) for p in (*args.sources, args.markers) if p):
        raise UsageError(f"-o {args.output}: is also read; name the model otherwise")
    if args.report:
        folder = Path(os.path.realpath(args.report))
        if output in (folder, *folder.parents):
            raise UsageError(
                f"--report {args.report}: the model is to be at {args.output}; name another folder"
            )


def _read(args: argparse.Namespace, corpus: Corpus) -> tuple[list[Sequence], list[str], list[Measures]]:
    """Find and prepare the files; say which were left out; bodies are of people who are in these alone."""
    others: list[Measures] = []
    idle: list[str] = []
    closed: list[str] = []
    files = sources.find(args.sources, args.exclude, idle.append, closed.append)
    noticed = Noticed()
    _say((f"--exclude {glob}: no file's path ends like this" for glob in idle), args.quiet)
    _say(learn_hints.idle_map(args.markers, [path for path, _ in files]), args.quiet)
    reading = Reading(
        args.period_mode,
        args.fps,
        args.zeros_missing,
        args.activity,
        args.markers,
        not args.no_trim,
        learn_segments.options(args),
    )
    jobs = args.jobs or fork_server.cores()
    bodies = _measured(args, files, reading, jobs)
    with progress("reading motion", len(files), args.quiet) as update:
        try:
            sequences, refused = sources.load_all(
                files,
                reading,
                update,
                jobs=jobs,
                dask=args.dask,
                people=args.subjects,
                corpus=corpus,
                others=others,
                bodies=bodies,
                noticed=noticed,
            )
        except UserError as error:
            if isinstance(error, sources.NothingLeft):
                _tell(closed + error.refused[1:], args.quiet, "")
            _say(learn_hints.hints(args.markers, noticed), args.quiet)  # what is noticed may be the reason
            raise
    refused = closed + refused
    _tell(refused, args.quiet, " (see --json or --report)")
    _say(learn_hints.hints(args.markers, noticed), args.quiet)
    return sequences, refused, others


def _measured(
    args: argparse.Namespace, files: list[tuple[Path, bool]], reading: Reading, jobs: int
) -> list[Shared | None]:
    """Measure people with several recordings of markers; say which cannot be of one body."""
    apart: list[str] = []
    with progress("measuring people", None, args.quiet) as update:
        bodies = sources.measured(
            files, reading, update, jobs=jobs, dask=args.dask, people=args.subjects, tell=apart.append
        )
    _say(apart, args.quiet)
    return bodies


def _say(lines: Iterable[str], quiet: bool) -> None:
    """Say what a user should know, one line each."""
    for line in lines if not quiet else ():
        print(line, file=sys.stderr)


def _tell(refused: list[str], quiet: bool, more: str) -> None:
    """Say which files were left out."""
    if quiet:
        return
    for line in refused[:MOST_LINES]:
        print(f"left out: {line}", file=sys.stderr)
    if len(refused) > MOST_LINES:
        print(f"left out: {len(refused) - MOST_LINES} more{more}", file=sys.stderr)
