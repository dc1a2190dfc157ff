"""What mkdocs needs to know of the repository.

Pages in libgait/doc link to files outside of it as GitHub shows them. The site gets copies of these files
(`files/...`; Markdown as pages), CONTRIBUTING.md as a page, equations as MathML, and the two pages that are
made from the code: the commands from `--help`, the C API from the headers.
"""

from __future__ import annotations

import os
import posixpath
import re
import subprocess
import sys
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import get_plugin_logger
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

LOG = get_plugin_logger(__name__)
ROOT = Path(__file__).resolve().parents[3]
DOC = "libgait/doc/"
PLACES = {".github/CONTRIBUTING.md": "contributing.md"}
"""Files outside of libgait/doc that have a place in the menu."""
LINK = re.compile(r"(\]\()(?!\w+:|#)([^)#\s]+)(#[^)\s]*)?(\))")
FENCED = re.compile(r"^( *)(`{3,}).*?^\1\2", re.M | re.S)


def _place(path: str) -> str:
    """Where a file of the repository is in the site."""
    if path.startswith(DOC):
        return path.removeprefix(DOC)
    return PLACES.get(path, f"files/{path}")


def _source(place: str) -> str:
    """Path in the repository of a page of the site."""
    named = {there: path for path, there in PLACES.items()}
    return named.get(place) or (place.removeprefix("files/") if place.startswith("files/") else DOC + place)


def _targets(path: str, text: str) -> set[str]:
    """Files of the repository that a page links to."""
    folder = posixpath.dirname(path)
    found = {posixpath.normpath(posixpath.join(folder, m[2])) for m in LINK.finditer(FENCED.sub("", text))}
    return {target for target in found if (ROOT / target).is_file()}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files that pages link to, and those that these link to."""
    waiting = [(DOC + file.src_uri, file.content_string) for file in files.documentation_pages()]
    waiting += [(path, (ROOT / path).read_text(encoding="utf-8")) for path in PLACES]
    added = set()
    for path in PLACES:
        files.append(File.generated(config, _place(path), abs_src_path=str(ROOT / path)))
    while waiting:
        path, text = waiting.pop()
        for target in _targets(path, text) - added:
            added.add(target)
            if target.startswith(DOC) or target in PLACES:
                continue
            files.append(File.generated(config, _place(target), abs_src_path=str(ROOT / target)))
            if target.endswith(".md"):
                waiting.append((target, (ROOT / target).read_text(encoding="utf-8")))
    for file in files.documentation_pages():
        if file.src_uri.startswith("files/"):
            file.inclusion = type(file.inclusion).NOT_IN_NAV
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links at the site, fill in what is made from the code, and set the mathematics."""
    here = page.file.src_uri
    if here == "reference/commands.md":
        markdown += _commands()
    if here == "reference/c-api.md":
        markdown += "".join(_header(path) for path in sorted((ROOT / "libgait/include").glob("gait*.h")))
    parts, at = [], 0
    for fence in FENCED.finditer(markdown):
        parts += [_prose(markdown[at : fence.start()], here), _fence(fence[0])]
        at = fence.end()
    return "".join([*parts, _prose(markdown[at:], here)])


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Warn of what a page would load from the network."""
    for loaded in re.findall(r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=\"?(https?:[^\"> ]+)", output):
        LOG.warning("%s loads %s", page.file.src_uri, loaded)
    return output


def _prose(text: str, here: str) -> str:
    folder = posixpath.dirname(_source(here))

    def link(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, match[2]))
        if not (ROOT / target).exists() and not target.startswith(DOC):
            return match[0]  # mkdocs warns of it
        there = posixpath.relpath(_place(target), posixpath.dirname(here) or ".")
        return f"{match[1]}{there}{match[3] or ''}{match[4]}"

    text = re.sub(r"\$`(.+?)`\$", lambda m: convert(m[1]), text)
    return LINK.sub(link, text)


def _fence(text: str) -> str:
    """Return a fenced block; one of mathematics as MathML."""
    first, *lines, _ = text.splitlines()
    if first.strip() != "```math":
        return text
    return f"\n{convert(' '.join(lines), display='block')}\n"


def _commands() -> str:
    """Return the help of every command."""
    from gait.cli import COMMANDS

    env = os.environ | {"COLUMNS": "100"}
    words = [["gait", *name.split()] for name in COMMANDS]
    out = []
    for command in words:
        run = [sys.executable, "-m", *command, "--help"]
        shown = subprocess.run(run, check=True, capture_output=True, text=True, env=env).stdout
        out.append(f"\n## {' '.join(command)}\n\n```text\n{shown}```\n")
    daemon = ROOT / "build/bin/gait-trackd"
    shown = subprocess.run([daemon, "--help"], check=True, capture_output=True, text=True).stdout
    out.append(f"\n## gait-trackd\n\n```text\n{shown}```\n")
    return "".join(out)


STRUCT = re.compile(
    r"(?:/\* ((?:(?!\*/).)*?) \*/\n)?#define GAIT_\w+_FIELDS\((?:[^\n]*\\\n)*[^\n]*\n\n?"
    r"typedef struct (\w+) \{[^;]*\} \2;\n",
    re.S,
)
"""A struct whose fields are a table in the header, with the comment before it."""


def _header(path: Path) -> str:
    """Return a header by its sections, each under its title, with structs as tables."""
    text = path.read_text(encoding="utf-8")
    pieces = re.split(r"^/\* -{2,} (.+?)[. ]*-{2,} \*/\n", text, flags=re.M)
    out = [f"\n## {path.name}\n{_code(pieces[0])}"]
    for title, body in zip(pieces[1::2], pieces[2::2], strict=True):
        out.append(f"\n### {title[0].upper()}{title[1:]}\n")
        at = 0
        for struct in STRUCT.finditer(body):
            about = " ".join((struct[1] or "").replace("\n *", " ").split())
            out += [_code(body[at : struct.start()]), f"\n**`{struct[2]}`** {about}\n\n{_fields(struct[2])}"]
            at = struct.end()
        out.append(_code(body[at:]))
    return "".join(out)


def _code(text: str) -> str:
    return f"\n```c\n{text.strip()}\n```\n" if text.strip() else ""


def _fields(struct: str) -> str:
    """Return the fields of a struct as a table, made from what the library reports."""
    import gait
    from gait.bindings.library import struct_fields

    configs = {"gait_tracker_config": gait.TrackerConfig, "gait_lift_config": gait.LiftConfig}
    known = {s.name: s for s in configs[struct].settings()} if struct in configs else {}
    head = ["field", "type", "unit", "meaning"] + (["range", "default", "paper mode"] if known else [])
    rows = [head, ["---"] * len(head)]
    for row in struct_fields(struct):
        if not row.name:
            continue
        cells = [f"`{row.name}`", f"`{row.type}{row.array}`", row.unit, " ".join(row.text.split())]
        if known:
            setting = known.get(row.name)
            ranged = setting is not None and setting.low == setting.low
            cells += [f"{setting.low:.10g} to {setting.high:.10g}" if setting and ranged else ""]
            cells += [_number(setting.default), _number(setting.paper)] if setting else ["", ""]
        rows.append([cell.replace("|", "\\|") for cell in cells])
    return "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def _number(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
