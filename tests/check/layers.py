#!/usr/bin/env python3
"""layers.py LAYERS FOLDER OBJECT...: includes and calls stay in their folder or go to one listed before it.

The calls of an object are its undefined symbols.  Files must not include or call each other in a circle
either; a source, the header of its name and their objects count as one file.
"""

import re
import subprocess
import sys
from pathlib import Path

from circles import circles

PUBLIC = {"gait.h", "gait_lift.h", "gait_pool.h", "gait_start.h"}
SYSTEM = {
    "arm_neon.h", "assert.h", "cpuid.h", "float.h", "immintrin.h", "limits.h", "math.h", "stdarg.h",
    "stdbool.h", "stddef.h", "stdint.h", "stdio.h", "string.h", "sanitizer/asan_interface.h",
}  # fmt: skip
THREADS = {"pool.c": {"pthread.h", "signal.h", "stdatomic.h"}, "task.c": {"stdatomic.h"}}


def read_layers(path: Path) -> dict[str, int]:
    """Folder name to its place, bottom first."""
    lines = (line.split("#")[0].strip() for line in path.read_text(encoding="utf-8").splitlines())
    names = [line for line in lines if line]
    order = {name: i for i, name in enumerate(names)}
    if len(order) != len(names):
        raise SystemExit(f"{path}: a folder is listed twice")
    return order


def include_faults(source: Path, folder: Path, order: dict[str, int]) -> list[str]:
    """Faults in the includes of one file."""
    own = order.get(source.relative_to(folder).parts[0])
    if own is None:
        return [f"{source}: folder {source.parent.name} is not in LAYERS"]
    found = []
    for kind, name in includes(source):
        below = order.get(name.split("/")[0])
        if kind == "<":
            eigen = name.startswith("Eigen/") and source.suffix == ".cpp"
            threads = name in THREADS.get(source.name, ())
            if name not in SYSTEM and not eigen and not threads:
                found.append(f"{source}: <{name}> is not for the library")
        elif name not in PUBLIC and (below is None or below > own):
            found.append(f'{source}: "{name}" is not in its folder or one below it in LAYERS')
    return found


def includes(source: Path) -> list[tuple[str, str]]:
    """Delimiter and name of each include of a file."""
    text = source.read_text(encoding="utf-8")
    return re.findall(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', text, re.M)


def unit(path: Path) -> str:
    """Folder and name of a file, the same for a source, its header and its objects."""
    return f"{path.parent.name}/{path.name.split('.')[0]}"


def calls(objects: list[str]) -> dict[str, dict[str, str]]:
    """For each file the files that it calls, each with one of the symbols."""
    if not objects:
        return {}
    out = subprocess.run(["nm", "-g", "-A", *objects], check=True, capture_output=True, text=True).stdout
    rows = [(unit(Path(line.partition(":")[0])), *line.split()[-2:]) for line in out.splitlines()]
    defined = {name: file for file, kind, name in rows if kind not in "Uw"}
    found: dict[str, dict[str, str]] = {}
    for file, kind, name in rows:
        if kind in "Uw" and defined.get(name, file) != file:
            found.setdefault(file, {})[defined[name]] = name
    return found


def main() -> int:
    layers, folder = map(Path, sys.argv[1:3])
    order = read_layers(layers)
    sources = sorted(p for p in folder.rglob("*") if p.suffix in {".c", ".cpp", ".h"})
    found = [f for source in sources for f in include_faults(source, folder, order)]
    names = {s.relative_to(folder).parts[0] for s in sources}
    found += [f"{layers}: no folder {name}" for name in order if name not in names]
    graph: dict[str, set[str]] = {}
    for source in sources:
        inner = {unit(Path(name)) for kind, name in includes(source) if kind == '"' and "/" in name}
        graph.setdefault(unit(source), set()).update(inner)
    objects = [
        o for o in sys.argv[3:] if unit(Path(o)) in graph
    ]  # a file that moved may have left its old one
    if not objects:
        found.append("no objects: was the library built?")
    for caller, called in calls(objects).items():
        graph[caller] |= called.keys()
        own = order.get(caller.split("/")[0], len(order))
        for file, symbol in sorted(called.items()):
            if order.get(file.split("/")[0], 0) > own:
                found.append(f"{caller}: calls {symbol} of {file}, whose folder is above it in LAYERS")
    for node in graph:
        graph[node].discard(node)
    found += [f"circle of files: {' '.join(c)}" for c in circles(graph)]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
