#!/usr/bin/env python3
"""layers.py LAYERS FOLDER: each source includes only files of its own folder and of folders listed before it."""

import re
import sys
from pathlib import Path

PUBLIC = {"gait.h", "gait_pool.h"}
SYSTEM = {
    "assert.h", "cpuid.h", "float.h", "immintrin.h", "limits.h", "math.h", "stdarg.h", "stdbool.h",
    "stddef.h", "stdint.h", "stdio.h", "string.h", "sanitizer/asan_interface.h",
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


def faults(source: Path, folder: Path, order: dict[str, int]) -> list[str]:
    """What is wrong with the includes of one file."""
    own = order.get(source.relative_to(folder).parts[0])
    if own is None:
        return [f"{source}: folder {source.parent.name} is not in LAYERS"]
    found = []
    text = source.read_text(encoding="utf-8")
    for kind, name in re.findall(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', text, re.M):
        below = order.get(name.split("/")[0])
        if kind == "<":
            eigen = name.startswith("Eigen/") and source.suffix == ".cpp"
            threads = name in THREADS.get(source.name, ())
            if name not in SYSTEM and not eigen and not threads:
                found.append(f"{source}: <{name}> is not for the library")
        elif name not in PUBLIC and (below is None or below > own):
            found.append(f'{source}: "{name}" is not in its folder or one below it in LAYERS')
    return found


def main() -> int:
    layers, folder = map(Path, sys.argv[1:])
    order = read_layers(layers)
    sources = sorted(p for p in folder.rglob("*") if p.suffix in {".c", ".cpp", ".h"})
    found = [f for source in sources for f in faults(source, folder, order)]
    names = {s.relative_to(folder).parts[0] for s in sources}
    found += [f"{layers}: no folder {name}" for name in order if name not in names]
    print("\n".join(found), end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
