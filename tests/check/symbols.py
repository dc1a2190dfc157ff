#!/usr/bin/env python3
"""symbols.py HEADER... LIBRARY ARCHIVE: both export exactly the functions that the headers mark GAIT_API."""

import re
import subprocess
import sys


def declared(header: str) -> set[str]:
    """Names of the functions that the header marks GAIT_API."""
    with open(header, encoding="utf-8") as f:
        text = re.sub(r"/\*.*?\*/|^\s*#.*?$", " ", f.read(), flags=re.S | re.M)
    return set(re.findall(r"\bGAIT_API\b[^;(]*?\b(\w+)\s*\(", text))


def defined(path: str, *options: str) -> set[str]:
    """Global symbols that a library defines."""
    out = subprocess.run(
        ["nm", "--defined-only", *options, path], check=True, capture_output=True, text=True
    ).stdout
    rows = [line.split() for line in out.splitlines()]
    return {row[2].split("@")[0] for row in rows if len(row) == 3}


def main() -> int:
    *headers, library, archive = sys.argv[1:]
    want: set[str] = set()
    failed = False
    for header in headers:
        names = declared(header)
        if not names:
            print(f"{header}: no GAIT_API function found")
            failed = True
        want |= names
    for path, have in ((library, defined(library, "-D")), (archive, defined(archive, "-g"))):
        for what, names in (
            ("declared but not defined", want - have),
            ("defined but not declared", have - want),
        ):
            if names:
                print(f"{path}: {what}: {' '.join(sorted(names))}")
                failed = True
    return failed


if __name__ == "__main__":
    sys.exit(main())
