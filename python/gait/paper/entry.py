"""Entry of the page for one figure or experiment, and the page itself."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from gait.paper import verdicts
from gait.report.figures import Drawing, address
from gait.report.page import Page, movable

ENTRY_HEADER = ("", "theirs", "literal", "ours", "verdict")


@dataclass(frozen=True)
class Picture:
    """A picture of an entry: HTML under a caption."""

    caption: str
    html: str


@dataclass(frozen=True)
class Entry:
    """One figure, table or experiment of a paper."""

    heading: str  #: such as "Fig. 2: length of a cycle"
    theirs: str  #: what the paper reports
    literal: str  #: result of its algorithm as printed on these recordings
    ours: str  #: result of the package
    verdict: str
    left_open: tuple[str, ...]  #: choices that the paper leaves open, as made here
    pictures: tuple[Picture, ...]

    def statements(self) -> dict[str, str]:
        """Return the results of each side and the verdict, by column of the page."""
        return dict(zip(ENTRY_HEADER[1:], (self.theirs, self.literal, self.ours, self.verdict), strict=True))


def picture(drawing: Drawing) -> Picture:
    """Return a figure as a picture of an entry."""
    alt = escape(drawing.heading)
    return Picture(
        drawing.caption, f'<img style="max-width: 100%" alt="{alt}" src="{address(drawing.png())}">'
    )


def table(caption: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Picture:
    """Return a table as a picture of an entry; the first column names the rows."""
    top = "".join(f"<th scope=col>{escape(name)}</th>" if name else "<td></td>" for name in head)
    body = "".join(
        f"<tr><th scope=row>{escape(row[0])}</th>"
        + "".join(f"<td>{escape(x)}</td>" for x in row[1:])
        + "</tr>"
        for row in rows
    )
    table = f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
    return Picture(caption, movable(table))


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
    made.html(_counts(papers))
    for paper in papers:
        rows = [(e.heading, *e.statements().values()) for e in paper.entries]
        made.grid(f"{paper.short}: {paper.title}", ENTRY_HEADER, rows)
    for paper in papers:
        for entry in paper.entries:
            heading = escape(f"{paper.short}, {entry.heading}")
            made.html(f'<h2 id="{_anchor(paper, entry)}">{heading}</h2>{_body(entry)}')
    return made.text()


def _anchor(paper: Paper, entry: Entry) -> str:
    return re.sub(r"\W+", "-", f"{paper.short} {entry.heading}".lower())


def _counts(papers: Sequence[Paper]) -> str:
    """Return how many verdicts there are of each kind, with links to their figures."""
    links = {kind: list[str]() for kind in verdicts.KINDS}
    for paper in papers:
        author = paper.short.split()[0]
        for entry in paper.entries:
            words = escape(f"{author}, {entry.heading.split(':')[0]}")
            links[verdicts.kind(entry.verdict)].append(f'<a href="#{_anchor(paper, entry)}">{words}</a>')
    items = (f"<li>{len(each)} {kind}: {'; '.join(each)}</li>" for kind, each in links.items() if each)
    return f"<p>Verdicts:</p><ul>{''.join(items)}</ul>"


def _body(entry: Entry) -> str:
    """Return the statements and pictures of an entry."""
    cells = entry.statements().items()
    rows = "".join(f"<tr><td><b>{k}</b></td><td>{escape(v)}</td></tr>" for k, v in cells)
    items = "".join(f"<li>{escape(choice)}</li>" for choice in entry.left_open)
    choices = f"<p>Choices made here that the paper leaves open:</p><ul>{items}</ul>" if items else ""
    pictures = "".join(f"<p>{escape(p.caption)}</p>{p.html}" for p in entry.pictures)
    return f"{movable(f'<table>{rows}</table>')}{choices}{pictures}"
