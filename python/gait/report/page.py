"""The frame of all reports: one self-contained HTML file for screens, phones and paper."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape

import cv2

from gait.io.video import Image
from gait.web import modules

Tips = Mapping[str, str]
"""Explanations, by the words that they explain."""


class Page:
    """Collects the parts of a page, then makes its text.

    Parameters
    ----------
    title : str
    lead : str
        First one or two sentences of the page.
    """

    def __init__(self, title: str, lead: str = "") -> None:
        self._title, self._parts = title, [f"<h1>{escape(title)}</h1>"]
        self.head = f"<style>\n{modules.own('style.css')}</style>"
        if lead:
            self._parts.append(f'<p class="lead">{escape(lead)}</p>')

    def heading(self, text: str) -> None:
        """Begin a section."""
        self._parts.append(f"<h2>{escape(text)}</h2>")

    def words(self, text: str, kind: str = "") -> None:
        """Add a paragraph; `kind`: ``warning``, ``faint``, ``screen-only``, or several of them."""
        self._parts.append(f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>")

    def points(self, lines: Sequence[str]) -> None:
        """Add a list."""
        self._parts.append("<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>")

    def table(self, heading: str, rows: Mapping[str, str], tips: Tips | None = None) -> None:
        """Add a heading and rows of name and value; names with a tip show it."""
        cells = "".join(
            f"<tr><th scope=row>{_explained(k, tips)}</th><td>{escape(v)}</td></tr>" for k, v in rows.items()
        )
        self._parts.append(f"<h2>{escape(heading)}</h2>{movable(f'<table class=pairs>{cells}</table>')}")
        self._explain(tips)

    def grid(
        self, heading: str, head: Sequence[str], rows: Sequence[Sequence[str]], tips: Tips | None = None
    ) -> None:
        """Add a heading and a table with several columns, the first of which names the rows."""
        top = "".join(
            f"<th scope=col>{_explained(cell, tips)}</th>" if cell else "<td></td>" for cell in head
        )
        body = "".join(
            f"<tr><th scope=row>{_explained(row[0], tips)}</th>"
            + "".join(f"<td>{_explained(cell, tips)}</td>" for cell in row[1:])
            + "</tr>"
            for row in rows
        )
        table = f"<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
        table = f'<table class="grid" style="--columns: {len(head) - 1}">{table}'
        self._parts.append(f"<h2>{escape(heading)}</h2>{movable(table)}")
        self._explain(tips)

    def figure(self, heading: str, drawing: str) -> None:
        """Add a heading and a drawing, HTML."""
        self._parts.append(f"<h2>{escape(heading)}</h2>{drawing}")

    def html(self, text: str) -> None:
        """Add HTML unchanged."""
        self._parts.append(text)

    def pictures(self, pictures: Sequence[tuple[int, Image]], kind: str = "") -> None:
        """Add a strip of frames with their numbers."""
        cells = "".join(f'<img alt="frame {number}" src="{jpeg(image)}">' for number, image in pictures)
        self._parts.append(f'<div class="strip {kind}">{cells}</div>')

    def text(self) -> str:
        """Return the file's text."""
        view = '<meta name="viewport" content="width=device-width, initial-scale=1">'
        style = f"<style>\n{modules.own('report.css')}</style>"
        head = f'<meta charset="utf-8">{view}<title>{escape(self._title)}</title>{self.head}{style}'
        body = f"<main>{''.join(self._parts)}</main>"
        return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>{body}</body></html>\n'

    def _explain(self, tips: Tips | None) -> None:
        """Add the explanations as text, for phones and paper, where there is no hovering."""
        if tips:
            terms = "".join(f"<dt>{escape(k)}</dt><dd>{escape(v)}</dd>" for k, v in tips.items())
            self._parts.append(
                f'<details class="terms"><summary>What these terms mean</summary><dl>{terms}</dl></details>'
            )


def _explained(words: str, tips: Tips | None) -> str:
    tip = (tips or {}).get(words)
    return f'<abbr title="{escape(tip)}">{escape(words)}</abbr>' if tip else escape(words)


def movable(table: str) -> str:
    """Make a table that is wider than the page scroll sideways, also by keyboard."""
    return f'<div class="movable" tabindex="0" role="group" aria-label="table">{table}</div>'


def jpeg(image: Image) -> str:
    """Return a picture as a data URL."""
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
    return "data:image/jpeg;base64," + base64.b64encode(data).decode("ascii")
