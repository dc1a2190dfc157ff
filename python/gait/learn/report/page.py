"""The report of `gait learn`: figures as PNG, and one page with all of them."""

from __future__ import annotations

import html
from collections.abc import Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait.errors import UserError
from gait.io import blob
from gait.io.files import filling
from gait.learn.cycles.sequence import Sequence
from gait.learn.options import LearnOptions
from gait.learn.prior import model
from gait.learn.prior.fit import Learned
from gait.learn.report import classes as motion_classes
from gait.progress import progress
from gait.web import modules

if TYPE_CHECKING:
    from gait.report.figures import Drawing

PAGE = "index.html"
MARK = ": gait learn</title>"  # end of the title of our pages
TITLE_BYTES = 4096  # bytes that include the title of our pages

_STYLE = """
figure { margin: 0; } figcaption { color: var(--faint); margin: 0 0 .5em; }
.n { text-align: right; } td.w { font-size: 85%; color: var(--faint); }
"""
#: Columns of numbers.
NUMBER_COLUMNS = ("period, ms", "cycles", "SNR", "sharpness", "residual, °")
_OF_CLASSES = (
    *("strides/s", "period, s", "stride length, statures", "statures/s", "components", "variance, %"),
)


def require_own(folder: Path) -> None:
    """Raise UserError if the folder has a page that is not from `gait learn`; call it before long work."""
    page = folder / PAGE
    if not page.exists():
        return
    try:
        with page.open("rb") as file:
            own = MARK.encode() in file.read(TITLE_BYTES)
    except OSError as error:
        raise UserError(f"--report {folder}: {PAGE}: {error.strerror}; choose another folder") from error
    if not own:
        raise UserError(
            f"--report {folder}: {PAGE} there was not made by gait learn; choose another folder, or remove it"
        )


def write(
    folder: Path,
    learned: Learned,
    options: LearnOptions,
    refused: list[str],
    classes: list[dict[str, Any]],
    sections: Mapping[str, blob.Array],
    quiet: bool = True,
) -> None:
    """Write `folder`/*.png and `folder`/index.html, which needs no other file; all of them or none.

    `classes`: `gait.learn.report.classes.figures` of the model, which has the `sections`.
    UserError if the folder cannot be made or written.
    """
    try:
        with filling(folder) as new:
            stems = _write_all(new, learned, options.activity, refused, classes, sections, quiet)
        for old in folder.glob("strip-*.png"):  # of a run with more components
            if old.stem not in stems:
                old.unlink()
    except OSError as error:
        raise UserError(f"--report {folder}: {error.strerror}; choose another folder") from error


def _write_all(
    folder: Path,
    learned: Learned,
    activity: str,
    refused: list[str],
    classes: list[dict[str, Any]],
    sections: Mapping[str, blob.Array],
    quiet: bool,
) -> set[str]:
    """Write the files into an empty folder and return the stems of the figures."""
    from gait.learn.report.figures import drawings, of_classes  # Matplotlib is slow to import

    parts, links = [], []
    with progress("drawing the report", None, quiet) as update:
        for number, drawing in enumerate(chain(drawings(learned), of_classes(learned, sections))):
            update(number)
            parts.append(_figure(folder, drawing))
            links.append((drawing.stem, drawing.heading))
    stems = {stem for stem, _ in links}
    links += [("classes", "Classes of motion")] if classes else []
    links += [("sequences", "Sequences"), *([("left-out", "Left out")] if refused else [])]
    body = [
        f"<h1>Cyclic model of {html.escape(activity)}</h1>",
        _summary(learned, refused),
        "<nav>" + " ".join(f'<a href="#{to}">{html.escape(words)}</a>' for to, words in links) + "</nav>",
        *parts,
        _classes(classes),
        _sequences(learned),
        _left_out(refused),
        f"<p>{model.CMU}</p>" if model.from_cmu(s.source for s in learned.sequences) else "",
    ]
    view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
    style = modules.own("style.css") + modules.own("report.css") + _STYLE
    head = f"<meta charset=utf-8><title>{html.escape(activity)}{MARK}{view}<style>{style}</style>"
    main = f"<body><main>{''.join(body)}</main></body>"
    page = f"<!doctype html><html lang=en><head>{head}</head>{main}</html>\n"
    (folder / PAGE).write_text(page, encoding="utf-8")
    return stems


def _figure(folder: Path, drawing: Drawing) -> str:
    """Write the PNG of a figure and return its part of the page."""
    heading = html.escape(drawing.heading)
    return (
        f'<h2 id="{drawing.stem}">{heading}</h2>'
        f"<figure><figcaption>{html.escape(drawing.caption)}</figcaption>"
        f'<img alt="{heading}" src="{drawing.write(folder)}"></figure>'
    )


def _summary(learned: Learned, refused: list[str]) -> str:
    rate, rate_sd, variation, length, length_sd, *_ = model.gait_statistics(learned)
    share = 100 * sum(learned.components.spectrum[: len(learned.components.sd)])
    return (
        f"<p>Sequences: {len(learned.sequences)}. Subjects: {len(learned.subjects)}. Files left out: "
        f"{len(refused)}. Cycles: {len(learned.cycles.values)}, {100 - 100 * learned.cycles.mask.mean():.1f} "
        f"% of their entries missing. Components kept: {len(learned.components.sd)}, with {share:.0f} % of "
        "the variance.</p>"
        f"<p>{rate:.3f} &plusmn; {rate_sd:.3f} strides/s, stride length {length:.3f} "
        f"&plusmn; {length_sd:.3f} statures; "
        f"stride time varies by {100 * variation:.1f} % within a sequence.</p>"
    )


def _sequences(learned: Learned) -> str:
    """Return the table of the sequences: what was found and cut off, residuals, and evidence."""
    names = ("sequence", "subject", *NUMBER_COLUMNS, "frames kept", "taken as", "evidence")
    rows = [
        dict(zip(names, _row(s, found), strict=True))
        for s, found in zip(learned.sequences, model.sequence_table(learned), strict=True)
    ]
    return (
        '<h2 id="sequences">Sequences</h2><p>'
        "SNR: best signal-to-noise ratio of all periods tried, summed over the angles that move; it grows "
        "with the number of cycles and angles, so compare it only with other periods of the same recording, "
        "and not with the figure, whose bins are single frames. Sharpness: SNR over the median of all "
        "periods tried. Residual: rms over all angles of what the components do not explain. Evidence: "
        "repeats: correlation with the next cycle; legs: cosine of the lag beyond half a cycle between left "
        "and right leg; flight: share of the time with both feet off the ground; lift and steps: rise of the "
        "feet and of the ground, statures; ahead: cosine of the angle between where the pelvis faces and "
        "where it goes.</p>" + _table(rows)
    )


def _classes(classes: list[dict[str, Any]]) -> str:
    """Return the table of the classes of motion; empty if the model has one."""
    if not classes:
        return ""
    return (
        '<h2 id="classes">Classes of motion</h2>'
        "<p>Stride rate and stride length, mean &plusmn; sd between people; variance that the components "
        "explain; rms over all angles of what they do not; and how often a person changes to another class, "
        "where in the stride that is most likely. Empty cells are not known.</p>"
        + _table([motion_classes.words(one, "±") for one in classes])
        + "".join(_sequences_of_class(one["name"], one["sequences"]) for one in classes if one["sequences"])
    )


def _sequences_of_class(name: str, found: dict[str, Any]) -> str:
    """Return the table of a class's first sequences, from META of its model."""
    columns = ("sequence", "period, ms", "cycles", "sharpness", "residual, °")
    rows = [["-" if cell is None else str(cell) for cell in row] for row in found["rows"]]
    more = f"<p>and {rest} more</p>" if (rest := found["count"] - len(rows)) > 0 else ""
    table = _table([dict(zip(columns, row, strict=True)) for row in rows])
    return f"<h3>Sequences of class {html.escape(name)}</h3>{table}{more}"


def _table(rows: list[dict[str, str]]) -> str:
    """Return a table of rows with the same columns."""
    head = "".join(f"<th{_class(n)}>{n}</th>" for n in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td{_class(n)}>{html.escape(cell)}</td>" for n, cell in row.items()) + "</tr>"
        for row in rows
    )
    return (
        '<div class="movable" tabindex="0" role="group" aria-label="table">'
        f"<table><tr>{head}</tr>{body}</table></div>"
    )


def _class(column: str) -> str:
    return (
        ' class="n"'
        if column in (*NUMBER_COLUMNS, *_OF_CLASSES)
        else ' class="w"'
        if column == "evidence"
        else ""
    )


def _row(s: Sequence, found: list[object]) -> list[str]:
    """Return the cells of one sequence; `found` is its row of `model.sequence_table`."""
    _, period, cycles, sharpness, residual = found
    cut = "; ".join(f"{side}: {why}" for side, why in zip(("before", "after"), s.cut, strict=True) if why)
    evidence = [
        f"{e.name} {e.value:.2g}" for e in s.verdict.evidence if e.name not in ("cycles", "sharpness")
    ]
    return [
        s.name,
        s.subject + (f" (lengths from {s.recordings} recordings)" if s.recordings > 1 else ""),
        str(period),
        str(cycles),
        f"{s.period.peak:.0f}",
        str(sharpness),
        "-" if residual is None else str(residual),
        f"{s.kept[0]} to {s.kept[1] - 1}" + (f" ({cut})" if cut else ""),
        s.verdict.activity or "cyclic",
        ", ".join(evidence),
    ]


def _left_out(refused: list[str]) -> str:
    items = "".join(f"<li>{html.escape(line)}</li>" for line in refused)
    return f'<h2 id="left-out">Left out</h2><ul>{items}</ul>' if refused else ""
