"""Write the manual page of a program from its ``--help``: ``man.py PROGRAM VERSION``.

The text has paragraphs, first of which is the usage, and options: a line that begins with two spaces and a
dash, its meaning below it, further in.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path


def _escaped(text: str) -> str:
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"^([.'])", r"\\&\1", text, flags=re.M)


def manual(name: str, version: str, text: str) -> str:
    """Page in the language of man(7), of the text of ``--help``."""
    introduction, _, options = text.partition("\n  -")
    usage, *paragraphs = re.split(r"\n\s*\n", introduction.strip())
    first = paragraphs[0].split(".")[0].replace("\n", " ")
    page = [
        f'.TH {name.upper()} 1 "" "libgait {version}"',
        f".SH NAME\n{_escaped(name)} \\- {_escaped(first[0].lower() + first[1:])}",
        f".SH SYNOPSIS\n{_escaped(usage.removeprefix('usage: '))}",
        ".SH DESCRIPTION",
        "\n.PP\n".join(_escaped(" ".join(p.split())) for p in paragraphs),
        ".SH OPTIONS",
    ]
    for option in re.split(r"\n  (?=-)", "-" + options):
        head, _, meaning = option.partition("\n")
        page.append(f".TP\n.B {_escaped(head.strip())}\n{_escaped(' '.join(meaning.split()))}")
    return "\n".join(page) + "\n"


if __name__ == "__main__":
    program, release = sys.argv[1:]
    shown = subprocess.run([program, "--help"], capture_output=True, text=True, check=True).stdout
    print(manual(Path(program).name, release, shown), end="")
