"""Run the clips of a project, several at a time, each in its own processes; skip those already done."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from gait.batch.project import Clip
from gait.io.files import replacing
from gait.progress import WARNING
from gait.report.page import Page, movable
from gait.signals import die_with_parent

DONE, FAILED = "done", "failed"
RECORD = "done.json"  #: written to the folder of a clip that is tracked or lifted
GAIT_COMMAND = (sys.executable, "-m", "gait")
_COUNTS = ("frames", "init", "tracking", "ambiguous", "lost")
#: First columns of the summary; the others follow by name, so that failures do not change the order.
_FIRST_COLUMNS = ("name", "subject", "person", "input", "state", "error", "seconds", *_COUNTS,
                  "verdict", "warnings", "offsets_s")  # fmt: skip
SEPARATOR = " | "  #: between the warnings of a clip
_GRACE = 5.0  # seconds that commands have to end after an interrupt

Row = dict[str, Any]


class Runner:
    """Runs clips in folders below `output`.

    Attributes
    ----------
    output : Path
    gait : sequence of str
        First words of each command line: the program.
    """

    def __init__(self, output: Path, gait: Sequence[str] = GAIT_COMMAND) -> None:
        self.output, self.gait = output, tuple(gait)
        self._running: set[subprocess.Popen[str]] = set()
        self._lock, self._ended = threading.Lock(), False

    def run(self, clips: Sequence[Clip], jobs: int, report: Callable[[Row], None]) -> list[Row]:
        """Run clips, at most `jobs` at a time; return their rows in the order of the project.

        A clip of several people has one row per person.  `report` is called with each row when its clip ends.
        An interrupt ends the running commands; finished clips are kept.
        """
        rows: dict[str, list[Row]] = {}
        with ThreadPoolExecutor(jobs) as pool:
            waiting = {pool.submit(self.one, clip): clip for clip in clips}
            try:
                for future in as_completed(waiting):
                    rows[waiting[future].name] = future.result()
                    for row in future.result():
                        report(row)
            except BaseException:
                self._end()
                pool.shutdown(wait=True, cancel_futures=True)
                raise
        return [row for clip in clips for row in rows[clip.name]]

    def one(self, clip: Clip) -> list[Row]:
        """Run one clip unless it is done already; return its row of the summary, or that of each person."""
        folder = self.output / clip.name
        try:
            if before := self.before(clip):
                return before
            key = clip.key()
            folder.mkdir(parents=True, exist_ok=True)
            began = time.monotonic()
            found = self._recorded(folder, key, "found") or self._command(clip.command(folder))
            people = {None: found} if clip.people is None else found["people"]
            shared = {"warnings": found.get("warnings", [])}
            rows = [self._row(clip, folder, person, own | shared) for person, own in people.items()]
            rows = [row | {"seconds": round(time.monotonic() - began, 1)} for row in rows]
            record = {"key": key, "found": found} | ({} if _failed(rows) else {"rows": rows})
            with replacing(folder / RECORD) as file:
                file.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
        except Exception as error:  # whatever it is, the other clips continue
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
            return [failed(clip, _reason(error, folder))]
        return rows

    def before(self, clip: Clip) -> list[Row]:
        """Return the rows of a clip that an earlier run has done, empty if none has.

        OSError if a file of the clip cannot be found.
        """
        return list(self._recorded(self.output / clip.name, clip.key(), "rows") or ())

    def _row(self, clip: Clip, folder: Path, person: str | None, found: Any) -> Row:
        """Make the files that follow from a track or a motion; return its row, with the first failure."""
        row, errors = _begun(clip) | ({} if person is None else {"person": int(person)}), []
        row |= _figures("lift" if clip.lifted else "track", found)
        warnings = [found["warning"]] if found.get("warning") else []
        warnings += found["warnings"]
        for target, command in clip.further(folder, person).items():
            try:
                made = self._command(command)
                row |= _figures(command[0], made)
                warnings += made["warnings"]
            except _Failed as error:
                errors.append(str(error))
                _remove(target)
        row["warnings"] = SEPARATOR.join(dict.fromkeys(warnings))  # each once
        return row | {"state": FAILED if errors else DONE, "error": errors[0] if errors else ""}

    def _recorded(self, folder: Path, key: str, what: str) -> Any:
        """Return what was recorded of a clip with the same settings, files and version; None if nothing was.

        `what`: ``rows``, if all its files were made, or ``found``, the figures of its track or motion.
        """
        try:
            record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return record.get(what) if isinstance(record, dict) and record.get("key") == key else None

    def _command(self, words: Sequence[str]) -> Any:
        """Run a command; return the JSON that it prints and, by the name ``warnings``, its warnings.

        _Failed, with its last line, if it fails.
        """
        with self._lock:
            if self._ended:
                raise _Failed("interrupted")
            process = subprocess.Popen(
                [*self.gait, *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
                preexec_fn=die_with_parent,
            )
            self._running.add(process)
        out, err = process.communicate()
        with self._lock:
            self._running.discard(process)
        if process.returncode:
            last = next((line for line in reversed(err.splitlines()) if line.strip()), "")
            raise _Failed(last.removeprefix(WARNING) or f"gait {words[0]} ended with {process.returncode}")
        try:
            found = json.loads(out)
        except ValueError:
            raise _Failed(f"gait {words[0]} printed no figures") from None
        lines = [line.removeprefix(WARNING) for line in err.splitlines() if line.startswith(WARNING)]
        return found | {"warnings": lines}

    def _end(self) -> None:
        """End the running commands, and start no more."""
        with self._lock:
            self._ended = True
            running = list(self._running)
        for process in running:
            process.terminate()
        for process in running:
            try:
                process.wait(_GRACE)
            except subprocess.TimeoutExpired:
                process.kill()


def _begun(clip: Clip) -> Row:
    return {"name": clip.name, "subject": clip.subject, "input": (*clip.videos, *clip.keypoints)[0]}


def failed(clip: Clip, error: str) -> Row:
    """Row of a clip that failed; `error` is the reason, in one line."""
    return _begun(clip) | {"state": FAILED, "error": error}


def _reason(error: Exception, folder: Path) -> str:
    """Name in one line why a clip failed."""
    if isinstance(error, _Failed):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or folder}: {error.strerror or error}"
    return f"{folder}: {type(error).__name__}: {' '.join(str(error).split())}"


def _remove(path: Path) -> None:
    """Remove a file or folder of an earlier run."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


class _Failed(Exception):
    """A command of a clip failed; its text is one line."""


def _figures(command: str, found: Any) -> Row:
    """Choose the figures for the summary from a command's JSON."""
    if command == "track":
        return {name: found[name] for name in (*_COUNTS, "verdict") if name in found} | _offsets(found)
    if command == "lift":
        names = ("frames", "sd_mm", "stature_m")
        return {name: found[name] for name in names if found.get(name) is not None} | _offsets(found)
    if command == "report":
        # null: too few strides
        both = {name: own["both"] for name, own in found["summary"].items() if own.get("both") is not None}
        return {f"{name}{end}": value[part] for name, value in both.items()
                for end, part in (("", "mean"), ("_sd", "sd"))}  # fmt: skip
    return {}


def _offsets(found: Any) -> Row:
    """Return when further films began, seconds after the first, separated by spaces; nothing for one film."""
    offsets = found.get("offsets_s", ())
    return {"offsets_s": " ".join(f"{seconds:.3f}" for seconds in offsets)} if offsets else {}


def write_summary(output: Path, rows: Sequence[Row]) -> list[str]:
    """Write summary.csv, summary.parquet if PyArrow is installed, and index.html; return their names."""
    known = {name for row in rows for name in row}
    head = [name for name in _FIRST_COLUMNS if name in known] + sorted(known - set(_FIRST_COLUMNS))
    table = output / "summary.csv"
    with replacing(table) as temporary, open(temporary, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, head, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    names = [table.name]
    if find_spec("pyarrow") is not None:
        import pyarrow as pa
        from pyarrow import parquet

        columns = {name: pa.array([row.get(name) for row in rows]) for name in head}
        with replacing(output / "summary.parquet") as temporary:
            parquet.write_table(pa.table(columns), temporary)
        names.append("summary.parquet")
    with replacing(output / "index.html") as temporary:
        temporary.write_text(_page(output, rows), encoding="utf-8")
    return [*names, "index.html"]


_SHOWN = {
    **{"subject": "subject", "state": "state", "frames": "frames", "status": "status of frames"},
    **{"warnings": "warnings", "speed_m_s": "speed, m/s", "cadence_spm": "steps a minute"},
    **{"stride_length_m": "stride, m", "sd_mm": "sd, mm", "offsets_s": "further films began, s"},
}


def _page(output: Path, rows: Sequence[Row]) -> str:
    """Page with a row for each clip and links to its files."""
    clips, failed = (len({row["name"] for row in found}) for found in (rows, _failed(rows)))
    page = Page("Clips", f"{clips} clip{'s' * (clips > 1)}, {f'{failed} failed' if failed else 'all done'}.")
    cells = [{name: _shown(row, name) for name in _SHOWN} for row in rows]
    shown = [name for name in _SHOWN if any(row[name] for row in cells)]
    head = "".join(
        f"<th scope=col>{escape(text)}</th>" for text in ("clip", *(_SHOWN[name] for name in shown))
    )
    body = "".join(
        f"<tr><th scope=row>{escape(_called(row))}</th>"
        + "".join(f"<td>{escape(own[name])}</td>" for name in shown)
        + f"<td class=links>{_links(output, row)}</td></tr>"
        for row, own in zip(rows, cells, strict=True)
    )
    table = f"<thead><tr>{head}<th scope=col class=links>files</th></tr></thead><tbody>{body}</tbody></table>"
    page.html(movable(f'<table class="grid" style="--columns: {len(shown)}">{table}'))
    for row in rows:
        if row.get("verdict"):
            page.words(f"{_called(row)}: {row['verdict']}.")
        for words in filter(None, (row.get("error"), *_warnings(row))):
            page.words(f"{_called(row)}: {words}", "warning")
    return page.text()


def _called(row: Mapping[str, Any]) -> str:
    return f"{row['name']}, person {row['person']}" if row.get("person") else str(row["name"])


def _warnings(row: Mapping[str, Any]) -> list[str]:
    return [words for words in row.get("warnings", "").split(SEPARATOR) if words]


def _failed(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["state"] == FAILED]


def _shown(row: Mapping[str, Any], name: str) -> str:
    if name == "warnings":
        return str(len(_warnings(row)) or "")
    if name == "status":
        counts = {status: row[status] for status in _COUNTS[1:] if row.get(status)}
        return ", ".join(f"{status} {count / row['frames']:.0%}" for status, count in counts.items())
    value = row.get(name)
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def _links(output: Path, row: Mapping[str, Any]) -> str:
    """Links to the files of a clip that was tracked or lifted, without those of other people."""
    if "frames" not in row:
        return ""
    folder, person = output / row["name"], str(row.get("person", ""))
    files = [folder / (f"report-{person}" if person else "report") / "report.html", *sorted(folder.iterdir())]
    numbers = [file.stem.rpartition("-")[2] for file in files]
    shown = [
        os.path.relpath(file, output)
        for file, number in zip(files, numbers, strict=True)
        if file.is_file() and file.name != RECORD and not (person and number.isdigit() and number != person)
    ]
    return " ".join(f'<a href="{escape(name)}">{escape(Path(name).name)}</a>' for name in shown)
