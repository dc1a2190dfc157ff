"""The report of `gait learn`: figures as PNG and one page that holds them all."""

from __future__ import annotations

import base64
import html
import io
from pathlib import Path

from gait.errors import UserError
from gait.files import replacing
from gait.learn import model
from gait.learn.figures import FIGURES
from gait.learn.fit import Learned

STYLE = (
    "body{font:15px/1.5 sans-serif;max-width:62em;margin:2em auto;padding:0 1em;color:#222}"
    "img{max-width:100%}figure{margin:2em 0}figcaption{color:#555}"
    "table{border-collapse:collapse}td,th{padding:.15em .8em;text-align:right;border-bottom:1px solid #ddd}"
    "td:first-child,th:first-child{text-align:left}"
)


def write(folder: Path, learned: Learned, activity: str, refused: list[str], quiet: bool = True) -> None:
    """Write `folder`/*.png and `folder`/index.html, which needs no other file.

    Raises
    ------
    UserError
        If the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--report {folder}: {error.strerror}; choose another folder") from error
    parts = [f"<h1>Cyclic model of {html.escape(activity)}</h1>", _summary(learned)]
    for stem, caption, draw in FIGURES:
        buffer = io.BytesIO()
        draw(learned).savefig(buffer, format="png", dpi=110, metadata={"Software": None})
        with replacing(folder / f"{stem}.png") as path:
            path.write_bytes(buffer.getvalue())
        data = base64.b64encode(buffer.getvalue()).decode()
        parts.append(
            f'<figure><img alt="{stem}" src="data:image/png;base64,{data}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
        )
    parts += [_table(learned), _left_out(refused), f"<p>{model.CMU}</p>" if model.from_cmu(learned) else ""]
    page = f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(activity)}</title>"
    with replacing(folder / "index.html") as path:
        path.write_text(
            f"{page}<style>{STYLE}</style><body>{''.join(parts)}</body></html>\n", encoding="utf-8"
        )


def _summary(learned: Learned) -> str:
    rate, rate_sd, variation, length, length_sd, *_ = model.gait_statistics(learned)
    return (
        f"<p>{len(learned.sequences)} sequences of {len(learned.subjects)} subjects, "
        f"{len(learned.components.scores)} cycles, {len(learned.components.sd)} components. "
        f"{rate:.3f} &plusmn; {rate_sd:.3f} strides/s of {length:.3f} &plusmn; {length_sd:.3f} statures; "
        f"stride time varies by {100 * variation:.1f} % within a sequence.</p>"
    )


def _table(learned: Learned) -> str:
    head = "".join(f"<th>{name.replace('_', ' ')}</th>" for name in model.SEQUENCE_COLUMNS)
    rows = model.sequence_table(learned)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(str(v))}</td>" for v in row) + "</tr>" for row in rows)
    return f"<h2>Sequences</h2><table><tr>{head}</tr>{body}</table>"


def _left_out(refused: list[str]) -> str:
    items = "".join(f"<li>{html.escape(line)}</li>" for line in refused)
    return f"<h2>Left out</h2><ul>{items}</ul>" if refused else ""
