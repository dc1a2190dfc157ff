"""Every check of tests/check passes on a clean example and fails on a planted fault."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CHECK = ROOT / "tests" / "check"
CC = os.environ.get("CC", "cc")
CLEAN = "int gait_twice(int x); int gait_twice(int x) { return x + x; }\n"


def run(script: str, *args: object) -> subprocess.CompletedProcess[str]:
    """Run a check as make does."""
    command = [sys.executable] if script.endswith(".py") else ["sh"]
    return subprocess.run(
        [*command, CHECK / script, *map(str, args)], capture_output=True, text=True, timeout=120
    )


def fails(done: subprocess.CompletedProcess[str], *words: str) -> bool:
    """The check failed and its output contains the words."""
    return done.returncode == 1 and all(w in done.stdout + done.stderr for w in words)


def build(tmp_path: Path, code: str, *options: str, suffix: str = ".c", out: str = "a.o") -> Path:
    """Compile a text to an object, or to what the options say."""
    source, target = tmp_path / f"a{suffix}", tmp_path / out
    source.write_text(code)
    subprocess.run([CC, "-O0", *(options or ("-c",)), source, "-o", target], check=True)
    return target


def shared(tmp_path: Path, code: str, *libs: str) -> Path:
    """A shared library of a text."""
    return build(tmp_path, code, "-shared", "-fPIC", "-Wl,--no-as-needed", *libs, out="liba.so")


@pytest.mark.parametrize(
    ("call", "suffix"),
    [
        ("#include <stdlib.h>\nvoid *f(void) { return malloc(9); }", ".c"),
        ("#include <stdlib.h>\nvoid f(void *p) { free(p); }", ".c"),
        ("#include <string.h>\nchar *f(const char *s) { return strdup(s); }", ".c"),
        ("int *f() { return new int; }", ".cpp"),
        ("void f(int *p) { delete[] p; }", ".cpp"),
    ],
)
def test_no_heap_sees_an_allocator(tmp_path, call, suffix):
    assert run("no_heap.sh", build(tmp_path, CLEAN)).returncode == 0
    assert fails(run("no_heap.sh", build(tmp_path, call, suffix=suffix)), "heap")


def test_deps_sees_a_library_and_an_inexact_function(tmp_path):
    assert run("deps.sh", shared(tmp_path, CLEAN)).returncode == 0
    assert fails(run("deps.sh", shared(tmp_path, CLEAN, "-lpthread", "-lstdc++")), "libstdc++")
    sine = "double sin(double); double f(double x) { return sin(x); }"
    assert fails(run("deps.sh", shared(tmp_path, sine, "-lm")), "sin")


@pytest.mark.parametrize(
    "code",
    ["int hits;", "int hits = 3;", "int f(void) { static int n; return ++n; }", "_Thread_local int hits;"],
)
def test_static_init_sees_a_writable_global(tmp_path, code):
    table = CLEAN + 'const char *const names[] = {"a", "b"};'
    clean = build(tmp_path, table, "-c", "-fPIC")
    assert run("static_init.sh", clean, clean).returncode == 0
    writes = build(tmp_path, code)
    assert fails(run("static_init.sh", writes, writes), "a.o")


def test_static_init_sees_a_constructor(tmp_path):
    code = "int g(); const int hits = g();"
    runs = build(tmp_path, code, suffix=".cpp")
    assert fails(run("static_init.sh", runs, runs), "a.o")


def test_size_sees_a_large_library(tmp_path):
    (tmp_path / "release").mkdir()
    library = build(tmp_path, CLEAN, "-shared", "-fPIC", out="release/liba.so")
    assert run("size.sh", library, 100_000).returncode == 0
    about = subprocess.run(
        ["readelf", "-h", "-p", ".comment", library], capture_output=True, text=True
    ).stdout
    if "X86-64" in about and "clang" not in about:
        assert fails(run("size.sh", library, 1000), "bytes when stripped")


@pytest.mark.parametrize("script", ["no_heap.sh", "deps.sh", "threads.sh", "size.sh", "static_init.sh"])
def test_a_file_that_is_not_there_proves_nothing(tmp_path, script):
    there = build(tmp_path, CLEAN)
    for files in [tmp_path / "absent.o", there], [there, tmp_path / "absent.o"]:
        if script not in {"deps.sh", "size.sh"} or files[1] == there:
            assert fails(run(script, *files), "absent.o")


def library_pair(tmp_path: Path, code: str) -> tuple[Path, Path]:
    """A shared and a static library of the same text."""
    obj, archive = build(tmp_path, code, "-c", "-fPIC", "-fvisibility=hidden"), tmp_path / "liba.a"
    library = build(tmp_path, code, "-shared", "-fPIC", "-fvisibility=hidden", out="liba.so")
    subprocess.run(["ar", "rcs", archive, obj], check=True)
    return library, archive


def test_symbols_sees_what_is_missing_or_unprefixed(tmp_path):
    header = tmp_path / "a.h"
    header.write_text(
        "#define GAIT_API\n/* GAIT_API int gait_not(int); */\nGAIT_API int\ngait_twice(int x);\n"
    )
    visible = '__attribute__((visibility("default"))) '
    clean = f"{visible}int gait_twice(int x) {{ return x + x; }}\n"
    assert run("symbols.py", header, *library_pair(tmp_path, clean)).returncode == 0
    extra = clean + visible + "int helper(int x) { return x; }\n"
    assert fails(run("symbols.py", header, *library_pair(tmp_path, extra)), "not declared: helper")
    assert fails(
        run("symbols.py", header, *library_pair(tmp_path, "int x(void);")), "not defined: gait_twice"
    )
    leak = clean + "int helper(int x) { return x; }\n"
    assert fails(run("symbols.py", header, *library_pair(tmp_path, leak)), "liba.a", "helper")


@pytest.mark.parametrize(
    "code",
    [
        "struct gait_a { char c; double d; };\n",
        "int gait_f();\n",
        "size_t gait_f(void);\n",
        "void gait_f(int class);\n",
    ],
)
def test_headers_sees_padding_old_declarations_and_missing_includes(tmp_path, code):
    header = tmp_path / "a.h"
    header.write_text("#ifndef A_H\n#define A_H\n#include <stdint.h>\nint32_t gait_g(int32_t x);\n#endif\n")
    assert run("headers.sh", header).returncode == 0
    header.write_text(code)
    assert run("headers.sh", header).returncode == 1


def test_headers_sees_enumerations_that_need_casts(tmp_path):
    header = tmp_path / "gait.h"
    header.write_text("#ifndef A_H\n#define A_H\n#include <stdint.h>\ntypedef int32_t gait_mode;\n#endif\n")
    assert fails(run("headers.sh", header), "gait_image")


def objects(src: Path) -> list[Path]:
    """Compile every source below a folder to build/FOLDER/NAME.c.o beside it."""
    made = []
    for source in sorted(src.rglob("*.c")):
        made.append(src.parent / "build" / source.parent.name / f"{source.name}.o")
        made[-1].parent.mkdir(parents=True, exist_ok=True)
        subprocess.run([CC, "-O0", "-w", "-c", "-iquote", src, source, "-o", made[-1]], check=True)
    return made


@pytest.fixture
def folders(tmp_path):
    """Two folders of C, low and high, that pass; LAYERS beside them."""
    layers, src = tmp_path / "LAYERS", tmp_path / "src"
    layers.write_text("# comment\nlow\nhigh\n")
    for name, text in {
        "low/low.h": "#include <stdint.h>\nint low(int x);\n",
        "low/low.c": '#include "low/low.h"\nint low(int x) { return x; }\n',
        "low/other.c": '#include "low/low.h"\nint other(int x) { return low(x); }\n',
        "high/high.h": "int high(int x);\n",
        "high/high.c": '#include "high/high.h"\n#include "low/low.h"\nint high(int x) { return low(x); }\n',
    }.items():
        (src / name).parent.mkdir(parents=True, exist_ok=True)
        (src / name).write_text(text)
    assert run("layers.py", layers, src, *objects(src)).returncode == 0
    return layers, src


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("low/low.h", '#include "high/high.h"\n', '"high/high.h" is not in its folder or one below it'),
        ("high/high.h", '#include "high.h"\n', '"high.h" is not in its folder or one below it'),
        ("high/high.h", "#include <stdlib.h>\n", "<stdlib.h> is not for the library"),
        ("new/new.h", "", "folder new is not in LAYERS"),
        (
            "low/up.c",
            "int high(int x); int up(int x) { return high(x); }\n",
            "low/up: calls high of high/high",
        ),
        (
            "low/low.c",
            "int other(int x); int low(int x) { return other(x); }\n",
            "circle of files: low/low low/other",
        ),
        ("low/low.h", '#include "low/b.h"\nint low(int x);\n', "circle of files: low/b low/low"),
    ],
)
def test_layers_sees_an_upward_include_or_call_and_a_circle(folders, name, text, words):
    layers, src = folders
    (src / "low" / "b.h").write_text('#ifndef B_H\n#define B_H\n#include "low/low.h"\n#endif\n')
    (src / name).parent.mkdir(exist_ok=True)
    (src / name).write_text(f"#ifndef A_H\n#define A_H\n{text}#endif\n" if name.endswith(".h") else text)
    made = [] if "not" in words else objects(src)
    assert fails(run("layers.py", layers, src, *made), words)


def test_layers_sees_a_folder_that_is_not_there_and_no_objects(folders):
    layers, src = folders
    assert fails(run("layers.py", layers, src), "was the library built")
    layers.write_text("low\nghost\nhigh\n")
    assert fails(run("layers.py", layers, src, *objects(src)), "no folder ghost")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("low.py", "from walk.high import a", "low.py:1: high is not below low"),
        ("low.py", "def f():\n    from walk import high", "low.py:2: high is not below low"),
        ("low.py", "import walk.high.a", "high is not below low"),
        ("low.py", "from walk import Name", "__init__ is not below low"),
        ("high/b.py", "from . import a", "__init__ is not below high"),
        ("new.py", "import os", "new is not in LAYERS"),
        ("high/sub/c.py", "from walk.high.a import x", "high is not below high/sub"),
        ("high/b.py", "import walk.high.a", "circle of modules: high/a high/b"),
        ("high/b.py", "def f():\n    from walk.high import a", "circle of modules: high/a high/b"),
    ],
)
def test_py_layers_sees_an_upward_import_and_a_circle(tmp_path, name, text, words):
    layers, package = tmp_path / "LAYERS", tmp_path / "walk"
    (package / "high" / "sub").mkdir(parents=True)
    layers.write_text("# comment\nlow\nhigh/sub\nhigh\n__init__\n")
    (package / "__init__.py").write_text("from walk.high.a import x")
    (package / "low.py").write_text("import numpy as np")
    (package / "high" / "a.py").write_text("from walk.high import b\nfrom walk.low import y")
    (package / "high" / "b.py").write_text("import walk.low")
    (package / "high" / "sub" / "c.py").write_text("import walk.low")
    assert run("py_layers.py", layers, package).returncode == 0
    (package / name).write_text(text)
    assert fails(run("py_layers.py", layers, package), words)


def test_py_layers_sees_a_part_without_source(tmp_path):
    (tmp_path / "LAYERS").write_text("ghost\n")
    (tmp_path / "walk").mkdir()
    assert fails(run("py_layers.py", tmp_path / "LAYERS", tmp_path / "walk"), "no source of ghost")


@pytest.mark.parametrize(
    "code",
    [
        "void g(char *); void f(void) { char b[20000]; g(b); }",
        "void g(char *); void f(int n) { char b[n]; g(b); }",
    ],
)
def test_stack_sees_a_large_frame_and_a_variable_one(tmp_path, code):
    build(tmp_path, CLEAN, "-c", "-fstack-usage")
    assert run("stack.py", 16384, tmp_path / "a.su").returncode == 0
    build(tmp_path, code, "-c", "-fstack-usage")
    assert fails(run("stack.py", 16384, tmp_path / "a.su"), "bytes of stack")
    assert fails(run("stack.py", 16384), "was the library built")


GRAPH = ("-c", "-O0", "-fcallgraph-info=su")
DEEP = "void g(char *); static void k(void) { char b[9000]; g(b); } "


def graphs() -> bool:
    """Does the compiler write call graphs?"""
    return subprocess.run([CC, *GRAPH[2:], "-E", "-xc", "/dev/null"], capture_output=True).returncode == 0


@pytest.mark.skipif(not graphs(), reason="call graphs are gcc's")
@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("int f(int n) { return n ? 1 + f(n - 1) : 0; }", "recursion: f -> f"),
        (
            "static int b(int); int a(int n) { return b(n); } int b(int n) { return n ? a(n - 1) : 0; }",
            "recursion: a -> a:b -> a",
        ),
        (DEEP + "void f(void) { char b[9000]; g(b); k(); }", "f > a:k"),
        (
            DEEP + "void *p(void) { return k; } void gait_f(void (*h)(void)) { char b[9000]; g(b); h(); }",
            "> a:k",
        ),
        (
            "static int b(int); int gait_a(int n) { int (*p)(int) = b; return p(n); } "
            "int b(int n) { return gait_a(n); }",
            "recursion: a:b -> gait_a -> a:b",
        ),
        (DEEP + "void *p(void) { return k; }", "POINTERS does not name: a:k"),
    ],
)
def test_calls_sees_recursion_and_a_deep_path(tmp_path, code, words):
    made = build(tmp_path, CLEAN, *GRAPH)
    assert run("calls.py", 16384, made).returncode == 0
    build(tmp_path, code, *GRAPH)
    assert fails(run("calls.py", 16384, made), words)
    assert fails(run("calls.py", 16384), "no call graphs")
    made.with_suffix(".ci").unlink()
    assert fails(run("calls.py", 16384, made), "ccache may lose call graphs")


def test_threads_sees_a_lock_outside_the_pool(tmp_path):
    code = "#include <pthread.h>\nvoid f(pthread_mutex_t *m) { pthread_mutex_lock(m); }"
    assert run("threads.sh", build(tmp_path, CLEAN), build(tmp_path, code, out="pool.c.o")).returncode == 0
    assert fails(run("threads.sh", build(tmp_path, code)), "a.o:", "pthread_mutex_lock")


@pytest.fixture
def checkout(tmp_path):
    """A git checkout that passes."""
    for name, text in {
        "libgait/include/gait.h": "".join(
            f"#define GAIT_{p} 1\n" for p in ("VERSION_MAJOR", "VERSION_MINOR", "VERSION_PATCH", "ABI")
        ),
        "libgait/doc/changelog.md": "| 1 | first |\n",
        "python/gait/_version.py": '__version__ = "1.1.1"\n',
        "libgait/src/a.c": "int gait_a;\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    subprocess.run(["git", "-C", tmp_path, "add", "."], check=True)
    assert run("hygiene.py", tmp_path).returncode == 0
    return tmp_path


STRAY = (
    ("build/a.c", b"int x;\n", "made by the build"),
    ("python/gait/a.so", b"x", "made by the build"),
    ("clip.mp4", b"x", "data"),
    ("tests/truth.csv", b"frame,time\n", "data"),
    ("a.bin", b"a\0b", "binary"),
    ("large.txt", b"x\n" * 200_000, "over 300000"),
    ("lcm_types/a.h", b"/* THIS IS AN AUTOMATICALLY" + b" GENERATED FILE */\n", "generated"),
    ("a.md", b"look into /ho" + b"me/alice/gait\n", "a.md:1: path"),
    ("a.h", b"/* as in spe" + b"c 1.6 */\n", "a.h:1: refers to"),
    ("b.md", b"see interfaces" + b".md\n", "b.md:1: refers to"),
    ("c.md", b"by issue" + b" 3\n", "c.md:1: refers to"),
    ("d.md", b"# D\n[a](libgait/src/a.c) [b](b.c)\n", "d.md: link to b.c"),
    ("e.md", b"# E\n## The [O 3], of `e`\n[a](#the-o-3-of-e) [b](#f)\n", "e.md: link to #f"),
    ("a.py", b"x = 1 \n", "blank at the end"),
    ("b.py", b"x = 1", "no newline"),
    ("errors.sto", b"x = 1\n", "data does not belong"),
    ("python/gait/_version.py", b'__version__ = "1.1.2"\n', "gait.h has 1.1.1"),
    ("libgait/doc/changelog.md", b"| 0 | first |\n", "no row for ABI 1"),
)


def test_hygiene_sees_what_does_not_belong(checkout):
    for name, content, _ in STRAY:
        (checkout / name).parent.mkdir(parents=True, exist_ok=True)
        (checkout / name).write_bytes(content)
    subprocess.run(["git", "-C", checkout, "add", "-f", *(name for name, *_ in STRAY)], check=True)
    done = run("hygiene.py", checkout)
    found = done.stdout.splitlines()
    for name, _, words in STRAY:
        assert any(line.startswith(name) and words in line for line in found), name
    assert done.returncode == 1 and {line.split(":")[0] for line in found} == {name for name, *_ in STRAY}


def test_hygiene_warns_of_a_long_source(checkout):
    for name in "libgait/src/long.c", "libgait/include/long.h":
        (checkout / name).write_text("int x;\n" * 701)
        subprocess.run(["git", "-C", checkout, "add", name], check=True)
    done = run("hygiene.py", checkout)
    assert done.returncode == 0
    assert done.stdout == "\nwarning: libgait/src/long.c has 701 lines, more than 700\n".lstrip()


def test_hygiene_warns_of_results_whose_commit_is_lost(checkout):
    git = ["git", "-C", checkout, "-c", "user.name=a", "-c", "user.email=a@b.c"]
    subprocess.run([*git, "commit", "-qm", "a"], check=True)
    head = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True)
    results = checkout / "tests/bench/results"
    results.mkdir(parents=True)
    (results / "a.md").write_text(f"made at commit {head.stdout.strip()}, once at commit 0123456.\n")
    subprocess.run([*git, "add", "."], check=True)
    done = run("hygiene.py", checkout)
    assert done.returncode == 0
    assert (
        done.stdout
        == "warning: tests/bench/results/a.md names commit 0123456, which is not in this history\n"
    )


@pytest.mark.parametrize(
    ("script", "want"),
    [
        ("echo 'a  3 passed, 0 failed'", (0, "3 passed, 0 failed")),
        ("echo 'a  3 passed, 2 failed'; exit 1", (1, "3 passed, 2 failed")),
        ("echo 'a  3 passed, 0 failed'; kill -SEGV $$", (1, "3 passed, 1 failed")),
        ("kill -ABRT $$", (1, "0 passed, 1 failed")),
        ("exit 0", (1, "0 passed, 1 failed")),
    ],
)
def test_unit_runner_counts_a_crash_and_a_silent_exit(tmp_path, script, want):
    test = tmp_path / "test_a"
    test.write_text(f"#!/bin/sh\n{script}\n")
    test.chmod(0o755)
    done = subprocess.run([ROOT / "tests/unit/run.sh", test], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (want[0], f"C tests: {want[1]}")


PRIVATE = (
    ("b.c", "int add_mingle(void);\n", "b.c:1: 'mingle': write rejuvenate"),
    ("a.py", "x = 1\n\n\nclass OldWalkers:\n    pass\n", "a.py:4: 'walkers'"),
    ("a.md", "The points say that nobody is there.\n", "a.md:1: 'nobody'"),
    ("b.md", "Its deviation is 2 m.\n", "standard deviation"),
    ("a.h", "extern int seen_area;\n", "a.h:1: 'seen'"),
    ("spotter.c", "int x;\n", "spotter.c:0: 'spotter'"),
    ("c.md", "The search is given up.\n", "'given up'"),
)


def test_words_sees_a_private_word(checkout):
    clean = "/* as seen from a standard\n * deviation; np.eye(3), odd number */\nint track_loss;\n"
    (checkout / "a.c").write_text(clean)
    subprocess.run(["git", "-C", checkout, "add", "a.c"], check=True)
    assert run("words.py", checkout).returncode == 0
    for name, text, _ in PRIVATE:
        (checkout / name).write_text(text)
    subprocess.run(["git", "-C", checkout, "add", "."], check=True)
    found = run("words.py", checkout)
    for name, _, words in PRIVATE:
        assert any(line.startswith(name) and words in line for line in found.stdout.splitlines()), name
    assert fails(found) and fails(run("words.py", checkout, "a.md"), "a.md:1")
    assert run("words.py", checkout, "libgait").returncode == 0
