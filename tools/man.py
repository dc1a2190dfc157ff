"""Write the manual pages of programs from their ``--help``: ``man.py FOLDER VERSION PROGRAM...``.

A program whose help lists commands also gets a page for each command, PROGRAM-COMMAND.1.  The help must begin
with the usage and paragraphs.  Entries of a list are indented by two to four spaces, their meaning by more.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path


def _escaped(text: str) -> str:
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.M)


def _section(title: str) -> str:
    return f".SH {_escaped(title.upper())}"


def _as_it_is(lines: str) -> str:
    return f".PP\n.nf\n{_escaped(lines)}\n.fi"


def _entries(text: str) -> list[str]:
    entries = []
    for entry in re.split(r"\n {2,4}(?=\S)", f"\n{text}")[1:]:
        head, *meaning = re.split(r"\s{2,}", entry.strip(), maxsplit=1)
        entries.append(f".TP\n.B {_escaped(head)}\n{_escaped(' '.join(' '.join(meaning).split()))}".rstrip())
    return entries


def manual(name: str, version: str, text: str) -> str:
    """Convert the text of ``--help`` to a page in the language of man(7)."""
    usage, *paragraphs = re.split(r"\n\s*\n", text.rstrip())
    first = re.split(r"[.:](?:\s|$)", " ".join(paragraphs[0].split()))[0]
    usage = " ".join(usage.removeprefix("usage: ").split())
    page = [
        f'.TH {name.upper()} 1 "" "libgait {version}"',
        f".SH NAME\n{_escaped(name)} \\- {_escaped(first[0].lower() + first[1:])}",
        f".SH SYNOPSIS\n{_escaped(usage)}",
        ".SH DESCRIPTION",
    ]
    in_options = False
    for paragraph in paragraphs:
        title, _, rest = paragraph.partition("\n")
        if not title.endswith(":") or not rest.startswith("  "):
            title, rest = "", paragraph
        if rest.startswith("  -") and not (title or in_options):
            title = "options"
        if title:
            in_options = title != "examples:"
            page.append(_section(title.removesuffix(":")))
        if not rest.startswith("  "):
            page.append(f".PP\n{_escaped(' '.join(rest.split()))}")
        elif in_options and re.match(r" {2,4}(-|\S+(\s{2,}|\n))", rest):
            page += _entries(rest)
        elif in_options:
            page.append(f".PP\n{_escaped(' '.join(rest.split()))}")
        else:
            page.append(_as_it_is(rest))
    return "\n".join(page) + "\n"


def _help(*words: str) -> str:
    columns = {**os.environ, "COLUMNS": "100"}
    return subprocess.run([*words, "--help"], capture_output=True, text=True, check=True, env=columns).stdout


def main(folder: Path, version: str, *programs: str) -> None:
    """Write the pages."""
    for program in programs:
        name, shown = Path(program).name, _help(program)
        (folder / f"{name}.1").write_text(manual(name, version, shown), encoding="utf-8")
        commands = shown.partition("\n  COMMAND\n")[2].partition("\n\n")[0]
        for command in re.findall(r"^    (\S+(?: \S+)?)(?:  |\n|$)", commands, re.M):
            page = f"{name}-{command.replace(' ', '-')}"
            text = manual(page, version, _help(program, *command.split()))
            (folder / f"{page}.1").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:])
