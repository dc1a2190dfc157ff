#!/usr/bin/env python3
"""calls.py LIMIT FILE.o...: no recursion, and no path of calls needs more than LIMIT bytes of stack.

Beside each object is gcc's call graph, FILE.ci (-fcallgraph-info=su), read in the folder where gcc ran.  A
call through a pointer reaches the kernels of that name or the functions in POINTERS, otherwise every function
whose address is taken.  The stack of functions outside the graphs is not counted: that of libc and of a
caller's threads.
"""

import re
import sys
from pathlib import Path
from typing import NamedTuple

NODE = re.compile(r'^node: \{ title: "([^"]+)" label: "[^"]*\\n([^"]*?):\d+:\d+\\n(\d+) bytes \(', re.M)
EDGE = re.compile(r'^edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"(?: label: "([^"]*)")?', re.M)
UNIT = re.compile(r'^graph: \{ title: "([^"]+)"', re.M)
NO_CODE = re.compile(r"""/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])+'""", re.S)
VALUE = re.compile(r"(?:[,(){=&?:]|\breturn\b)\s*(?!return\b)(\w+)\b(?!\s*\()")
ISA = r"_(scalar|base|sse4|avx2|avx512)"
POINTER = "__indirect_call"
POINTERS = {  # file and name of a pointer: functions it may point to
    "task.c:run": "run",
    "pool.c:fn": "run_one",
    "task.c:fn": r"\w+_range",
    "task.c:beside": r"inherit_\w+",
    "likelihood.c:log_likelihood": "log_likelihood",
    "likelihood.c:support": "support",
}
THREADS = {"pool.c:helper"}  # on their own stacks


class Function(NamedTuple):
    """Name without gcc's additions, frame in bytes, sources from which it is compiled."""

    name: str
    stack: int
    files: frozenset[str]
    static: bool


class Graph(NamedTuple):
    """Functions by title, the functions that they call, and the places where they call through pointers."""

    functions: dict[str, Function]
    calls: dict[str, set[str]]
    places: dict[str, set[str]]


def read(paths: list[Path]) -> Graph:
    """All graphs as one; static functions also have their object file in the title."""
    graph = Graph({}, {}, {})
    for path in paths:
        text = path.read_text(encoding="utf-8")
        unit = UNIT.findall(text)[0]
        if not Path(unit).exists():  # the graph of a source that moved may have remained
            continue

        def unique(title: str, path: Path = path) -> str:
            return f"{path.stem}:{title.rsplit(':', 1)[1]}" if ":" in title else title

        for title, file, size in NODE.findall(text):
            name = title.rsplit(":", 1)[-1].split(".")[0]
            graph.functions[unique(title)] = Function(name, int(size), frozenset({unit, file}), ":" in title)
        for source, target, place in EDGE.findall(text):
            into = graph.places if target == POINTER else graph.calls
            into.setdefault(unique(source), set()).add(place if target == POINTER else unique(target))
    return graph


def taken(graph: Graph) -> set[str]:
    """Functions whose names are used as values in the sources; static ones only in their own source."""
    files = {f for function in graph.functions.values() for f in function.files}
    values = {f: set(VALUE.findall(NO_CODE.sub(" ", Path(f).read_text(encoding="utf-8")))) for f in files}
    return {
        title
        for title, function in graph.functions.items()
        if any(function.name in values[f] for f in (function.files if function.static else files))
    }


def pointer(place: str) -> str:
    """File and name of what is called at file:line:column."""
    file, line, column = place.rsplit(":", 2)
    code = Path(file).read_text(encoding="utf-8").splitlines()[int(line) - 1][int(column) - 1 :]
    name = re.match(r"[^(]*?(\w+)\s*\(", code)
    return f"{Path(file).name}:{name[1] if name else '?'}"


def reached(graph: Graph, values: set[str], name: str) -> set[str]:
    """Functions that a call through a pointer may reach."""
    kernels = re.compile(name.rsplit(":", 1)[1] + ISA)
    found = {title for title in graph.functions if kernels.fullmatch(title)}
    wanted = POINTERS.get(name, ".*")
    return found or {t for t in values if re.fullmatch(wanted, graph.functions[t].name)}


def resolve(graph: Graph) -> set[str]:
    """Add what pointers reach to the calls; return functions that no pointer can hold."""
    values = taken(graph)
    left = values - THREADS
    for source, places in graph.places.items():
        for name in map(pointer, places):
            to = reached(graph, values, name)
            graph.calls.setdefault(source, set()).update(to)
            left -= to
    return left


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


def deepest(graph: Graph) -> tuple[int, list[str]]:
    """Bytes of the deepest path and the functions on it; there are no circles."""
    known: dict[str, tuple[int, list[str]]] = {}
    nothing: tuple[int, list[str]] = (0, [])

    def depth(title: str) -> tuple[int, list[str]]:
        if title not in known:
            below = max((depth(t) for t in graph.calls.get(title, ())), default=nothing)
            own = graph.functions[title].stack if title in graph.functions else 0
            known[title] = (own + below[0], [title, *below[1]])
        return known[title]

    return max(map(depth, graph.functions), default=nothing)


def main() -> int:
    limit, graphs = int(sys.argv[1]), [Path(name).with_suffix(".ci") for name in sys.argv[2:]]
    if absent := [path for path in graphs if not path.is_file()]:
        where = absent[0].parent
        print(f"no {absent[0]}: ccache may lose call graphs; remove {where} and make with CCACHE_DISABLE=1")
        return 1
    graph = read(graphs)
    if not graph.functions:
        print("no call graphs: build with gcc")
        return 1
    if left := resolve(graph):
        print(f"called through a pointer that POINTERS does not name: {' '.join(sorted(left))}")
        return 1
    if circle := cycle(graph.calls):
        print(f"recursion: {' -> '.join(circle)}")
        return 1
    size, path = deepest(graph)
    print(f"{size} bytes of stack at most, libc's own not counted: {' > '.join(path)}")
    return size > limit


if __name__ == "__main__":
    sys.exit(main())
