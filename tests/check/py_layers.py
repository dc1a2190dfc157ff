#!/usr/bin/env python3
"""py_layers.py LAYERS PACKAGE: each part of the package imports only itself and parts listed before it.

A part is a module or folder of the package, or FOLDER/NAME of one of its folders; a module belongs to the
longest part that contains it.  Modules must not import each other in a circle, even inside functions.
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from circles import circles


def read_layers(path: Path) -> dict[str, int]:
    """Part to its place, bottom first; parts on one line share theirs."""
    lines = [line.split("#")[0].split() for line in path.read_text(encoding="utf-8").splitlines()]
    order = {name: i for i, names in enumerate(lines) for name in names}
    if len(order) != sum(map(len, lines)):
        raise SystemExit(f"{path}: a part is listed twice")
    return order


def module_of(source: Path, package: Path) -> str:
    """Name of a module in the package, with slashes; for a folder's __init__ the folder's name."""
    name = source.relative_to(package).with_suffix("").as_posix()
    return name.removesuffix("/__init__")


def imported(source: Path, package: Path, modules: set[str]) -> Iterator[tuple[int, str]]:
    """Line and module of each import from the own package, including those inside functions."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):  # a relative import counts as one of the package itself
            names = [package.name if node.level else f"{node.module}.{a.name}" for a in node.names]
        else:
            continue
        for name in names:
            top, _, rest = name.partition(".")
            if top != package.name:
                continue
            parts = rest.split(".") if rest else []
            tried = ("/".join(parts[:n]) for n in range(len(parts), 0, -1))
            yield node.lineno, next((module for module in tried if module in modules), "__init__")


def part_of(module: str, order: dict[str, int]) -> str | None:
    """The longest part that contains a module."""
    names = module.split("/")
    tried = ("/".join(names[:n]) for n in range(len(names), 0, -1))
    return next((part for part in tried if part in order), None)


def main() -> int:
    layers, package = map(Path, sys.argv[1:])
    order = read_layers(layers)
    sources = {module_of(source, package): source for source in sorted(package.rglob("*.py"))}
    found = []
    graph: dict[str, set[str]] = {}
    folders = {folder.as_posix() for module in sources for folder in Path(module).parents}
    for module, source in sources.items():
        own = part_of(module, order)
        if own is None:
            found.append(f"{source}: {module.split('/')[0]} is not in LAYERS")
            continue
        for line, target in imported(source, package, sources.keys() | folders):
            part = part_of(target, order) or target
            if part != own and order.get(part, len(order)) > order[own]:
                found.append(f"{source}:{line}: {part} is not below {own} in LAYERS")
            if target != module:
                graph.setdefault(module, set()).add(target)
    held = {part_of(module, order) for module in sources}
    found += [f"{layers}: no source of {part}" for part in order if part not in held]
    found += [f"circle of modules: {' '.join(c)}" for c in circles(graph)]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
