#!/usr/bin/env python3
"""calls.py [-v] LIMIT FILE.ci...: no function calls itself, and no path takes more than LIMIT bytes of stack.

The files are gcc's call graphs (-fcallgraph-info=su).  A call through a pointer can reach every function that
nothing calls by name and that is not exported: `NESTED` of them (pool, piece, range, term), then one kernel.
-v: say the deepest.
"""

import re
import sys
from pathlib import Path

NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "[^"]*\\n(\d+) bytes \(', re.M)
EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"', re.M)
ISA = re.compile(r"_(scalar|base|avx2|avx512)$")
POINTER, NESTED = "__indirect_call", 4


def read(paths: list[str]) -> tuple[dict[str, int], dict[str, set[str]]]:
    """Stack of each function in bytes and whom it calls; statics are named by their object file as well."""
    stack: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    for path in paths:
        text = Path(path).read_text(encoding="utf-8")

        def unique(name: str, path: str = path) -> str:
            return f"{Path(path).stem}:{name.rsplit(':', 1)[1]}" if ":" in name else name

        for name, size in NODE.findall(text):
            stack[unique(name)] = int(size)
        for source, target in EDGE.findall(text):
            calls.setdefault(unique(source), set()).add(unique(target))
    return stack, calls


def cycle(calls: dict[str, set[str]]) -> list[str] | None:
    """Functions that call each other in a circle."""
    done: set[str] = set()

    def visit(name: str, path: list[str]) -> list[str] | None:
        if name in path:
            return [*path[path.index(name) :], name]
        if name in done:
            return None
        for target in sorted(calls.get(name, ())):
            if found := visit(target, [*path, name]):
                return found
        done.add(name)
        return None

    return next((found for name in sorted(calls) if (found := visit(name, []))), None)


def deepest(stack: dict[str, int], calls: dict[str, set[str]]) -> tuple[int, list[str]]:
    """Bytes of the deepest path and the functions on it; no function is on it twice (`cycle`)."""
    known: dict[str, tuple[int, list[str]]] = {POINTER: (0, [])}
    nothing: tuple[int, list[str]] = (0, [])

    def depth(name: str) -> tuple[int, list[str]]:
        if name not in known:
            below = max((depth(t) for t in calls.get(name, ())), default=nothing)
            known[name] = (stack.get(name, 0) + below[0], [name, *below[1]])
        return known[name]

    named = {target for targets in calls.values() for target in targets}
    pointed = [n for n in stack if n not in named and not n.startswith("gait_")]
    kernel = max((depth(n) for n in pointed if ISA.search(n)), default=nothing)  # they call no others
    others = sorted(depth(n) for n in pointed if not ISA.search(n))
    exported = (depth(n) for n in stack if n.startswith("gait_"))
    path = [max(exported, default=nothing), *others[: -NESTED - 1 : -1], kernel]
    if not any(POINTER in targets for targets in calls.values()):
        path = [max(map(depth, stack), default=nothing)]
    return sum(size for size, _ in path), [name for _, names in path for name in names]


def main() -> int:
    words = [word for word in sys.argv[1:] if word != "-v"]
    limit, files = int(words[0]), words[1:]
    stack, calls = read(files)
    if not stack:
        print("no call graphs: build with gcc")
        return 1
    if circle := cycle(calls):
        print(f"recursion: {' -> '.join(circle)}")
        return 1
    size, path = deepest(stack, calls)
    if size > limit or "-v" in sys.argv:
        print(f"{size} bytes of stack: {' > '.join(path)}")
    return size > limit


if __name__ == "__main__":
    sys.exit(main())
