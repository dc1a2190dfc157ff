"""The page for several people in one film: the film with everyone, and links to the page of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import NamedTuple
from urllib.parse import quote

from gait.report.film import PageFilm
from gait.report.page import Page, movable


class Person(NamedTuple):
    """A person on the page."""

    verdict: str
    """One sentence."""
    page: str
    """Name of their page, in the same folder."""
    colour: tuple[int, int, int]
    """BGR colour in the film."""


def people_page(title: str, people: Mapping[str, Person], others: Sequence[str], film: PageFilm) -> str:
    """Make the page's text; `people`: by their numbers in the film; `others`: sentences on the others."""
    page = Page(title, f"{len(people)} people tracked" if len(people) != 1 else "1 person tracked")
    page.html(
        f'<video controls playsinline style="width:100%" aria-label="the film with everyone" '
        f'src="data:video/mp4;base64,{film.data}"></video>'
    )
    page.words(film.note(), "faint screen-only")
    page.pictures(film.pictures, "print-only")
    rows = "".join(
        f'<tr><th scope=row><a href="{quote(one.page)}">Person {escape(number)}</a></th>'
        f'<td><span aria-hidden="true" style="color:{_paper(one.colour)}">&#9632;</span></td>'
        f"<td>{escape(one.verdict)}.</td></tr>"
        for number, one in people.items()
    )
    page.figure("Everyone", movable(f"<table>{rows}</table>"))
    for words in others:
        page.words(f"{words[0].upper()}{words[1:]}.", "faint")
    return page.text()


def _paper(colour: tuple[int, int, int]) -> str:
    return "#" + "".join(f"{part:02x}" for part in reversed(colour))
