"""The handshake between Python and the library: it passes, and every kind of mismatch is detected."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from gait import LibraryError
from gait.bindings import abi
from gait.bindings import library as loader

INCLUDE = Path(__file__).resolve().parents[2] / "libgait/include"
HEADERS = "".join(path.read_text(encoding="utf-8") for path in sorted(INCLUDE.glob("*.h")))
REAL = loader.library()


def test_layout_of_the_real_library_matches():
    rows = abi.fields(REAL)
    assert abi.verify(rows) == [] and len(rows) > 150


@pytest.mark.parametrize("column", ["offset", "size"])
def test_a_wrong_offset_or_size_is_caught_in_every_row(column):
    rows = abi.fields(REAL)
    for i, row in enumerate(rows):
        wrong = [*rows[:i], row._replace(**{column: getattr(row, column) + 4}), *rows[i + 1 :]]
        faults = abi.verify(wrong)
        assert len(faults) == 1
        assert row.of in faults[0] and row.name in faults[0]


def test_a_missing_or_additional_field_is_caught():
    rows = abi.fields(REAL)
    assert len(abi.verify(rows[:-1])) == 1
    assert "news" in abi.verify([*rows, rows[-1]._replace(of="gait_state", name="news")])[0]


def test_structures_are_those_of_the_headers():
    """The description equals what the compiler made of the same tables: structs, fields, types, bounds."""
    for row in abi.fields(REAL):
        if row.name:
            assert re.search(rf"^\s+{re.escape(row.type)}, {row.name}, ", HEADERS, re.M), row
            assert row.text.split(".")[0][:40] in HEADERS, row
        else:
            assert f"typedef struct {row.of} " in HEADERS


def test_every_public_function_is_declared():
    public = set(re.findall(r"GAIT_API[^;(]*?\b(gait_\w+)\(", HEADERS))
    assert public == {name for name, _, _ in abi.FUNCTIONS}


def test_enumerations_and_limits_equal_the_header():
    pairs = re.findall(r"\b(GAIT_\w+)\s*=?\s+(-?(?:0x[0-9a-fA-F]+|\d+))u?\b", HEADERS)
    values = {name: int(value, 0) for name, value in pairs}
    ours = {f"GAIT_ERR_{s.name}": s for s in abi.Result if s} | {"GAIT_OK": abi.Result.OK}
    ours |= {f"GAIT_{p.name}": p for p in abi.PixelFormat}
    ours |= {f"GAIT_MODE_{m.name}": m for m in abi.Mode}
    ours |= {f"GAIT_TERM_{t.name}": t for t in abi.Term}
    ours |= {f"GAIT_TRACK_{s.name}": s for s in abi.TrackStatus}
    ours |= {f"GAIT_EST_{f.name}": f for f in abi.Flag}
    ours |= {"GAIT_ABI": abi.ABI, "GAIT_ALIGN": abi.ALIGN}
    limits = "JOINTS ANGLES COMPONENTS PROPORTIONS CAMERAS CLASSES PIXELS"
    ours |= {f"GAIT_MAX_{limit}": getattr(abi, f"MAX_{limit}") for limit in limits.split()}
    ours |= {"GAIT_START_MAX_HYPOTHESES": abi.MAX_HYPOTHESES, "GAIT_START_MAX_PEOPLE": abi.MAX_PEOPLE}
    assert {name: values.get(name) for name in ours} == ours
    families = r"GAIT_(ERR|MODE|TERM|TRACK|EST)_\w+"
    assert {name for name in values if re.fullmatch(families, name)} <= ours.keys()


def test_missing_library_lists_every_candidate_with_its_reason(monkeypatch, tmp_path):
    text = tmp_path / "libgait.so"
    text.write_text("no library")
    monkeypatch.setattr(loader, "candidates", lambda: iter([str(tmp_path / "none.so"), str(text)]))
    with pytest.raises(LibraryError) as caught:
        loader.library.__wrapped__()
    words = str(caught.value)
    assert "none.so: no such file" in words and f"{text}: " in words and "make lib" in words
    assert "\n" not in words


def test_environment_names_the_only_candidate(monkeypatch):
    monkeypatch.setenv("GAIT_LIBRARY", "/nowhere/libgait.so")
    assert list(loader.candidates()) == ["/nowhere/libgait.so"]


def test_another_library_is_refused():
    path = next(p for p in loader.candidates() if Path(p).is_file())
    with pytest.raises(LibraryError, match="not this version of libgait"):
        loader.open_library("libc.so.6")
    assert loader.open_library(path)


@pytest.mark.parametrize(
    "where, name, value, words",
    [
        (abi, "ABI", 99, "ABI 10, this package needs 99"),
        (loader, "__version__", "9.9.9", "this package is 9.9.9"),
        (abi, "NEWEST_FIELD", ("gait_frame", "next"), "older than this package, without gait_frame.next"),
    ],
)
def test_version_and_abi_mismatch_name_the_file(monkeypatch, where, name, value, words):
    path = next(p for p in loader.candidates() if Path(p).is_file())
    monkeypatch.setattr(where, name, value)
    with pytest.raises(LibraryError, match=re.escape(path) + ".*" + re.escape(words)):
        loader.open_library(path)


def test_statuses_become_exceptions_with_name_and_index():
    error = abi.Error(result=-1, index=3, text=b"fx is not positive")
    with pytest.raises(ValueError, match="GAIT_ERR_ARG: fx is not positive") as caught:
        loader.check(-1, error)
    assert (caught.value.status, caught.value.name, caught.value.index) == (-1, "GAIT_ERR_ARG", 3)
    assert loader.check(0) == 0


@pytest.mark.parametrize("size", [1, 64, 1000])
def test_memory_is_aligned(size):
    memory = loader.aligned(size)
    assert memory.ctypes.data % abi.ALIGN == 0 and memory.nbytes == size


def test_the_library_is_loaded_before_a_structure_is_made():
    """A structure has no fields until its first use, which may be a model or a pool in a fresh process."""
    for first in (
        "from gait.bindings.model import load; load(None)",
        "from gait.track.tasks import threads; threads(2)",
    ):
        subprocess.run([sys.executable, "-c", first], check=True, timeout=60)
