"""The report: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape

import cv2

from gait.io.video import Image

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #222; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; } td, th { padding: .15em .9em .15em 0; text-align: left; }
td { vertical-align: top; } td + td { font-variant-numeric: tabular-nums; }
svg { max-width: 100%; height: auto; } pre { background: #f5f5f3; padding: .8em; white-space: pre-wrap; }
.film { display: flex; flex-wrap: wrap; gap: .4em; } .film img { width: calc(33.3% - .3em); }
"""


class Page:
    """Collects parts, then gives the whole text."""

    def __init__(self, title: str) -> None:
        self._title, self._parts = title, [f"<h1>{escape(title)}</h1>"]

    def words(self, text: str) -> None:
        """Add a paragraph."""
        self._parts.append(f"<p>{escape(text)}</p>")

    def table(self, heading: str, rows: Mapping[str, str]) -> None:
        """Add a heading and rows of name and value."""
        cells = "".join(f"<tr><td>{escape(k)}</td><td>{escape(v)}</td></tr>" for k, v in rows.items())
        self._parts.append(f"<h2>{escape(heading)}</h2><table>{cells}</table>")

    def grid(self, heading: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Add a heading and a table of several columns."""
        top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
        body = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
        self._parts.append(f"<h2>{escape(heading)}</h2><table><tr>{top}</tr>{body}</table>")

    def block(self, heading: str, text: str) -> None:
        """Add text as it stands."""
        self._parts.append(f"<h2>{escape(heading)}</h2><pre>{escape(text)}</pre>")

    def figure(self, heading: str, svg: str) -> None:
        """Add a drawing."""
        self._parts.append(f"<h2>{escape(heading)}</h2>{svg}")

    def film(self, heading: str, pictures: Sequence[tuple[int, Image]]) -> None:
        """Add a strip of frames with their numbers."""
        cells = "".join(f'<img alt="frame {number}" src="{_data(image)}">' for number, image in pictures)
        self._parts.append(f'<h2>{escape(heading)}</h2><div class="film">{cells}</div>')

    def text(self) -> str:
        """Return the file's text."""
        head = f'<meta charset="utf-8"><title>{escape(self._title)}</title><style>{_STYLE}</style>'
        return f"<!DOCTYPE html>\n<html><head>{head}</head><body>{''.join(self._parts)}</body></html>\n"


def _data(image: Image) -> str:
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
    return "data:image/jpeg;base64," + base64.b64encode(jpeg).decode("ascii")
