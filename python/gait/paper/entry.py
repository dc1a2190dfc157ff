"""What the page states about one figure or experiment, and the page itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from gait.report.figures import Drawing, address
from gait.report.page import Page

HEAD = ("", "theirs", "literal", "ours", "verdict")


@dataclass(frozen=True)
class Picture:
    """A picture of an entry: HTML under a caption."""

    caption: str
    html: str


@dataclass(frozen=True)
class Entry:
    """One figure, table or experiment of a paper."""

    heading: str  #: such as "Fig. 2: length of a cycle"
    theirs: str  #: what the paper states
    literal: str  #: what its algorithm gives on these recordings
    ours: str  #: what the package gives
    verdict: str
    left_open: tuple[str, ...]  #: what the paper does not state, and what is done here
    pictures: tuple[Picture, ...]


def picture(drawing: Drawing) -> Picture:
    """Return a figure as a picture of an entry."""
    alt = escape(drawing.heading)
    return Picture(
        drawing.caption, f'<img style="max-width: 100%" alt="{alt}" src="{address(drawing.png())}">'
    )


@dataclass(frozen=True)
class Paper:
    """One of the papers with all of its entries."""

    short: str  #: authors and year
    title: str
    entries: Sequence[Entry]


def page(title: str, about: Sequence[str], papers: Sequence[Paper]) -> str:
    """Return the text of a page: a table of all entries, then each with its pictures."""
    made = Page(title)
    for words in about:
        made.words(words)
    for paper in papers:
        rows = [(e.heading, e.theirs, e.literal, e.ours, e.verdict) for e in paper.entries]
        made.grid(f"{paper.short}: {paper.title}", HEAD, rows)
    for paper in papers:
        for entry in paper.entries:
            made.figure(f"{paper.short}, {entry.heading}", _body(entry))
    return made.text()


def _body(entry: Entry) -> str:
    """Return the statements and pictures of an entry."""
    cells = zip(HEAD[1:], (entry.theirs, entry.literal, entry.ours, entry.verdict), strict=True)
    rows = "".join(f"<tr><td><b>{k}</b></td><td>{escape(v)}</td></tr>" for k, v in cells)
    items = "".join(f"<li>{escape(choice)}</li>" for choice in entry.left_open)
    choices = f"<p>Left open by the paper, and chosen here:</p><ul>{items}</ul>" if items else ""
    pictures = "".join(f"<p>{escape(p.caption)}</p>{p.html}" for p in entry.pictures)
    return f"<table>{rows}</table>{choices}{pictures}"
