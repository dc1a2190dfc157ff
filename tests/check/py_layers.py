#!/usr/bin/env python3
"""py_layers.py LAYERS PACKAGE: each part of the package imports only itself and parts listed before it."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path


def read_layers(path: Path) -> dict[str, int]:
    """Part to its place, bottom first; parts on one line share theirs."""
    lines = [line.split("#")[0].split() for line in path.read_text(encoding="utf-8").splitlines()]
    order = {name: i for i, names in enumerate(lines) for name in names}
    if len(order) != sum(map(len, lines)):
        raise SystemExit(f"{path}: a part is listed twice")
    return order


def imported(source: Path, package: Path) -> Iterator[tuple[int, str]]:
    """Line and part of what a module imports of its own package, inside functions too."""
    parts = {p.stem for p in package.iterdir()}
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):  # a relative import counts as one of the package itself
            names = [package.name if node.level else f"{node.module}.{a.name}" for a in node.names]
        else:
            continue
        for name in names:
            top, _, rest = name.partition(".")
            part = rest.split(".")[0]
            if top == package.name:
                yield node.lineno, part if part in parts else "__init__"


def faults(source: Path, package: Path, order: dict[str, int]) -> list[str]:
    """What is wrong with the imports of one file."""
    own = Path(source.relative_to(package).parts[0]).stem
    if own not in order:
        return [f"{source}: {own} is not in LAYERS"]
    return [
        f"{source}:{line}: {part} is not below {own} in LAYERS"
        for line, part in imported(source, package)
        if part != own and order.get(part, len(order)) > order[own]
    ]


def main() -> int:
    layers, package = map(Path, sys.argv[1:])
    order = read_layers(layers)
    sources = sorted(package.rglob("*.py"))
    found = [f for source in sources for f in faults(source, package, order)]
    names = {source.relative_to(package).parts[0].removesuffix(".py") for source in sources}
    found += [f"{layers}: no source of {part}" for part in order if part not in names]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
