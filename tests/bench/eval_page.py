"""The page of an evaluation: tables first, then failures with pictures, then every clip; one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any

import eval_ablate
import eval_plots
import eval_table
import eval_wanted
from eval_run import Result

from gait.io.files import replacing

STYLE = """
body{font:14px/1.45 system-ui,sans-serif;max-width:88em;margin:2em auto;padding:0 1em;color:#222}
h1{font-size:1.5em}h2{font-size:1.2em;margin-top:2em}h3{font-size:1em;margin:1.4em 0 .3em}
.scroll{overflow-x:auto}table{border-collapse:collapse;font-size:12.5px;white-space:nowrap}
td,th{padding:.15em .6em;text-align:right;border-bottom:1px solid #e4e4e4;font-variant-numeric:tabular-nums}
td:nth-child(-n+2),th:nth-child(-n+2){text-align:left}.words td{text-align:left}
.FAIL{background:#fbe3e3}.pass{background:#e8f4e4}
.film{display:flex;flex-wrap:wrap;gap:.5em}.film figure{margin:0;width:calc(33.3% - .4em);min-width:16em}
.film img{width:100%}figcaption,.dim{color:#666;font-size:12px}svg{max-width:100%;height:auto}
summary{cursor:pointer;font-weight:600;margin:.6em 0}
"""
FAR = 65.0  # mm root: a clip with a larger error is listed among the failures


def write(
    path: Path, title: str, results: list[Result], rows: list[dict[str, Any]], update: Callable[[int], None]
) -> None:
    """Write the page for `results` and their `rows` of figures."""
    groups: dict[tuple[str, str], list[tuple[Result, dict[str, Any]]]] = {}
    for result, row in zip(results, rows, strict=True):
        groups.setdefault((row["arm"], row["clip"]), []).append((result, row))
    verdicts = eval_wanted.verdicts(rows)
    parts = [f"<h1>{escape(title)}</h1>", "<h2>Wanted and reached</h2>"]
    parts.append(_table(eval_wanted.grid(verdicts), "words", [v.word for v in verdicts]))
    costs = eval_ablate.costs(rows)
    if costs:
        parts += ["<h2>What each feature is worth (change when off; positive is worse)</h2>"]
        parts.append(_table(eval_ablate.grid(costs)))
    summaries = eval_table.summaries(rows)
    parts += ["<h2>Clips</h2>", _table(eval_table.grid(summaries))]
    parts += ["<h2>Intervals and status</h2>", _table(eval_table.honesty(summaries))]
    parts.append(f'<p class="dim">{escape(eval_table.LEGEND)}</p>')
    failed = {key: group for key, group in groups.items() if any(map(faults, (row for _, row in group)))}
    parts.append(f"<h2>Failures ({len(failed)})</h2>")
    parts.append('<p class="dim">Violet in the pictures: truth, or marks. Left blue, right orange.</p>')
    parts += [_section(key, group, True) for key, group in failed.items()]
    parts.append("<h2>Every clip</h2>")
    for done, (key, group) in enumerate(groups.items(), 1):
        parts.append(_details(key, group, pictures=key not in failed))
        update(done)
    head = f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(title)}</title>"
    with replacing(path) as temporary:
        temporary.write_text(f"{head}<style>{STYLE}</style><body>{''.join(parts)}</body></html>\n", "utf-8")


def faults(row: dict[str, Any]) -> list[str]:
    """What is wrong with a run, worst first; paper mode is a baseline, of which only losses count."""
    found = [row["failure"]] if row["failure"] and not row["empty"] else []
    if row["lost_run"]:
        found.append("lost")
    if row["arm"].startswith("paper"):
        return found
    if row["empty"]:
        return [f"states tracking in {row['track_pct']:.0f} % of the frames"] if row["track_pct"] else []
    if row["side"] == "wrong":
        found.append("left and right swapped under tracking")
    if row["locked"] is False:
        found.append("phase not locked after 1 s")
    if (row["silent_pct"] or 0) > 1:
        found.append(f"{row['silent_pct']:.0f} % of the frames far off under tracking")
    if (row["flips_pct"] or 0) > 1 and row["side"] != "wrong":
        found.append(f"{row['flips_pct']:.0f} % of the frames half a cycle off")
    if (row["root_mm"] or 0) > FAR:
        found.append(f"root {row['root_mm']:.0f} mm")
    return found


def _section(key: tuple[str, str], group: list[tuple[Result, dict[str, Any]]], pictures: bool) -> str:
    words = [f"seed {row['seed']}: {', '.join(faults(row))}" for _, row in group if faults(row)]
    parts = [f"<h3>{escape(key[1])}, {escape(key[0])}</h3><p>{escape('; '.join(words))}</p>"]
    if pictures:
        parts.append(_film(_worst(group)))
    return "".join(parts)


def _details(key: tuple[str, str], group: list[tuple[Result, dict[str, Any]]], pictures: bool) -> str:
    parts = [f"<details><summary>{escape(key[1])}, {escape(key[0])}</summary>"]
    if any(not result.failure for result, _ in group):
        parts.append(eval_plots.draw([result for result, _ in group]))
    if pictures:
        parts.append(_film(_worst(group)))
    return "".join([*parts, "</details>"])


def _worst(group: list[tuple[Result, dict[str, Any]]]) -> Result:
    """Run of the group with the most faults, then the largest error."""
    return max(group, key=lambda g: (len(faults(g[1])), g[1]["root_mm"] or g[1]["any_px"] or 0.0))[0]


def _film(result: Result) -> str:
    cells = "".join(
        f'<figure><img alt="" src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}">'
        f"<figcaption>seed {result.job.seed}, {escape(words)}</figcaption></figure>"
        for words, jpeg in result.pictures
    )
    return f'<div class="film">{cells}</div>'


def _table(lines: list[list[str]], kind: str = "", classes: list[str] | None = None) -> str:
    kept = eval_table.filled(lines)
    head = "".join(f"<th>{escape(lines[0][k])}</th>" for k in kept)
    body = ""
    for i, line in enumerate(lines[1:]):
        name = f' class="{classes[i]}"' if classes else ""
        body += f"<tr{name}>" + "".join(f"<td>{escape(line[k])}</td>" for k in kept) + "</tr>"
    return f'<div class="scroll"><table class="{kind}"><tr>{head}</tr>{body}</table></div>'
