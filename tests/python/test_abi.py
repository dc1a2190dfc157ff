"""The handshake between Python and the library: it passes, and every kind of slip is caught."""

import ctypes
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from drawn_walker import camera

from gait import GaitError, LibraryError, Model, Tracker
from gait.bindings import abi
from gait.bindings import library as loader
from gait.track.config import TrackerConfig

INCLUDE = Path(__file__).resolve().parents[2] / "libgait/include"
HEADER = (INCLUDE / "gait.h").read_text()
REAL = loader.library()


def rows():
    """Copy of the library's table as (type, field, offset, size)."""
    count = ctypes.c_uint32()
    table = REAL.gait_abi_fields(ctypes.byref(count))
    return [(r.type, r.field, r.offset, r.size) for r in table[: count.value]]


def library_saying(table):
    """Stand-in for a library whose table is `table`."""
    array = (abi.AbiField * len(table))(*table)

    def fields(count):
        count._obj.value = len(table)
        return ctypes.cast(array, ctypes.POINTER(abi.AbiField))

    return SimpleNamespace(gait_abi_fields=fields)


def test_layout_of_the_real_library_matches():
    assert abi.verify(REAL) == []
    assert len(rows()) > 80


@pytest.mark.parametrize("column, name", [(2, "offset"), (3, "size")])
def test_a_wrong_offset_or_size_is_caught_in_every_row(column, name):
    for i, row in enumerate(rows()):
        wrong = list(row)
        wrong[column] += 4
        table = rows()
        table[i] = tuple(wrong)
        faults = abi.verify(library_saying(table))
        assert len(faults) == 1, name
        assert row[0].decode() in faults[0] and row[1].decode() in faults[0]


def test_a_missing_or_additional_field_is_caught():
    table = rows()
    assert len(abi.verify(library_saying(table[:-1]))) == 1
    assert "news" in abi.verify(library_saying([*table, (b"gait_state", b"news", 0, 4)]))[0]


def test_every_public_function_is_declared():
    headers = "".join(path.read_text(encoding="utf-8") for path in INCLUDE.glob("*.h"))
    public = set(re.findall(r"GAIT_API[^;(]*?\b(gait_\w+)\(", headers))
    assert public == {name for name, _, _ in abi.FUNCTIONS}


def test_enumerations_and_limits_equal_the_header():
    pairs = re.findall(r"\b(GAIT_\w+)\s*=?\s+(-?(?:0x[0-9a-fA-F]+|\d+))u?\b", HEADER)
    values = {name: int(value, 0) for name, value in pairs}
    ours = {f"GAIT_ERR_{s.name}": s for s in abi.Status if s} | {"GAIT_OK": abi.Status.OK}
    ours |= {f"GAIT_{p.name}": p for p in abi.PixelFormat}
    ours |= {f"GAIT_MODE_{m.name}": m for m in abi.Mode}
    ours |= {f"GAIT_TERM_{t.name}": t for t in abi.Term}
    ours |= {f"GAIT_TRACK_{s.name}": s for s in abi.TrackStatus}
    ours |= {f"GAIT_EST_{f.name}": f for f in abi.Flag}
    ours |= {"GAIT_ABI": abi.ABI, "GAIT_ALIGN": abi.ALIGN, "GAIT_MAX_JOINTS": abi.MAX_JOINTS}
    ours |= {"GAIT_MAX_ANGLES": abi.MAX_ANGLES, "GAIT_MAX_CAMERAS": abi.MAX_CAMERAS}
    ours |= {"GAIT_MAX_COMPONENTS": abi.MAX_COMPONENTS}
    assert {name: values.get(name) for name in ours} == ours
    families = r"GAIT_(ERR|MODE|TERM|STATUS|EST)_\w+"
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
        (abi, "ABI", 99, "ABI 7, this package needs 99"),
        (loader, "__version__", "9.9.9", "this package is 9.9.9"),
    ],
)
def test_version_and_abi_mismatch_name_the_file(monkeypatch, where, name, value, words):
    path = next(p for p in loader.candidates() if Path(p).is_file())
    monkeypatch.setattr(where, name, value)
    with pytest.raises(LibraryError, match=re.escape(path) + ".*" + re.escape(words)):
        loader.open_library(path)


def test_statuses_become_exceptions_with_name_and_index():
    error = abi.Error(status=-1, index=3, text=b"fx is not positive")
    with pytest.raises(ValueError, match="GAIT_ERR_ARG: fx is not positive") as caught:
        loader.check(-1, error)
    assert (caught.value.status, caught.value.name, caught.value.index) == (-1, "GAIT_ERR_ARG", 3)
    assert loader.check(0) == 0


@pytest.mark.parametrize("size", [1, 64, 1000])
def test_memory_is_aligned(size):
    memory = loader.aligned(size)
    assert memory.ctypes.data % abi.ALIGN == 0 and memory.nbytes == size


def told(text):
    """A number as the header writes it."""
    return pytest.approx(float(text), rel=1e-6)


CONFIG = HEADER[HEADER.index("typedef struct gait_tracker_config") : HEADER.index("} gait_tracker_config;")]
TOLD = re.findall(r"float +(\w+)(?:\[5\])?; +/\*(.*?)\*/", CONFIG, re.DOTALL)
SETTINGS = [(name, " ".join(words.replace("\n", " ").replace(" * ", " ").split())) for name, words in TOLD]


@pytest.mark.parametrize(("name", "words"), SETTINGS[1:], ids=[name for name, _ in SETTINGS[1:]])
def test_the_header_tells_range_and_default_of_every_setting(name, words):
    low, high, usual, paper = re.search(
        r"\[([\d.]+), ([\de.]+)\]; default ([\d.]+)(?: \(paper mode ([\d.]+)(?::.*)?\))?$", words
    ).groups()
    assert getattr(TrackerConfig.default(), name) == told(usual)
    assert getattr(TrackerConfig.default(abi.Mode.PAPER), name) == told(paper or usual)
    for past in (float(low) - 1, 1.01 * float(high)):
        with pytest.raises(GaitError, match="is outside") as refused:
            Tracker(Model(), camera(), TrackerConfig.default(**{name: past}))
        ends = re.search(r"outside \[(.*), (.*)\]", refused.value.text).groups()
        assert [told(end) for end in ends] == [float(low), float(high)]


def test_the_header_tells_the_weights_of_the_terms():
    name, words = SETTINGS[0]
    assert name == "term_weight" and words.endswith("each [0, 1e6]; default 0.2 (paper mode 1), 25, 40, 4, 8")
    assert list(TrackerConfig.default().term_weight) == [told(w) for w in (0.2, 25, 40, 4, 8)]
    assert list(TrackerConfig.default(abi.Mode.PAPER).term_weight) == [told(w) for w in (1, 25, 40, 4, 8)]
    assert len(SETTINGS) == len([f for f, kind in abi.TrackerConfigC._fields_ if kind is ctypes.c_float]) + 1
