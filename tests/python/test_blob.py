"""The container of models: round trip, layout, and rejection of anything damaged."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gait.errors import UserError
from gait.io import blob

TAGS = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789", min_size=4, max_size=4)
ARRAYS = st.one_of(
    [
        hnp.arrays(dtype, hnp.array_shapes(max_dims=4, max_side=5))
        for dtype in (np.uint8, np.int32, np.float32)
    ]
)


@given(st.dictionaries(TAGS, ARRAYS, max_size=6))
def test_round_trip(sections):
    data = blob.encode(sections)
    again = blob.decode(data)
    assert list(again) == list(sections)
    for tag, array in sections.items():
        assert again[tag].dtype == array.dtype and again[tag].shape == array.shape
        assert again[tag].tobytes() == array.tobytes()
    assert blob.encode(again) == data


@pytest.fixture
def data():
    return blob.encode(
        {"AAAA": np.arange(6, dtype=np.float32).reshape(2, 3), "BBBB": np.arange(3, dtype=np.uint8)}
    )


def resealed(data):
    """The same bytes with a right checksum."""
    fixed = bytearray(data)
    fixed[20:24] = bytes(4)
    fixed[20:24] = struct.pack("<I", zlib.crc32(fixed))
    return bytes(fixed)


def test_layout_is_the_documented_one(data):
    magic, major, minor, header, count, _, total = struct.unpack_from("<8sHHIIIQ", data)
    assert (magic, major, minor, header, count, total) == (b"GAITMDL\n", 1, 0, 64, 2, len(data))
    assert resealed(data) == data
    tag, code, rank, *dims, _, offset, size = struct.unpack_from("<4sII4IIQQ", data, 64)
    assert (tag, code, rank, dims, size) == (b"AAAA", 3, 2, [2, 3, 1, 1], 24)
    assert offset % 64 == 0 and len(data) % 64 == 0
    assert np.frombuffer(data, "<f4", 6, offset).tolist() == [0, 1, 2, 3, 4, 5]
    assert struct.unpack_from("<4sI", data, 112) == (b"BBBB", 1)


def test_every_cut_and_every_changed_byte_is_refused(data):
    for size in range(len(data)):
        with pytest.raises(UserError):
            blob.decode(data[:size])
    for at in range(len(data)):
        broken = bytearray(data)
        broken[at] ^= 0x40
        with pytest.raises(UserError):
            blob.decode(bytes(broken))


@settings(max_examples=300)
@given(at=st.integers(8, 159), value=st.integers(0, 255))
def test_a_wrong_table_under_a_right_checksum_never_crashes(at, value):
    data = bytearray(blob.encode({"AAAA": np.zeros((2, 3), np.float32), "BBBB": np.zeros(3, np.uint8)}))
    data[at] = value
    try:
        sections = blob.decode(resealed(bytes(data)))
    except UserError:
        return
    assert all(array.nbytes <= len(data) for array in sections.values())


@pytest.mark.parametrize(
    ("at", "value", "words"),
    [
        (0, b"G0", "not a .gait model"),
        (8, struct.pack("<H", 2), "format 2.0, this package reads 1.x"),
        (24, struct.pack("<Q", 10), "header states 10 bytes"),
        (64 + 4, struct.pack("<I", 9), "AAAA has an unknown type"),
        (64 + 8, struct.pack("<I", 1), "AAAA has an unknown type or shape"),
        (64 + 32, struct.pack("<Q", 1 << 40), "AAAA is outside"),
        (64 + 40, struct.pack("<Q", 28), "AAAA is outside"),
        (112, b"AAAA", "AAAA occurs twice"),
    ],
)
def test_faults_are_named(data, at, value, words):
    broken = bytearray(data)
    broken[at : at + len(value)] = value
    with pytest.raises(UserError, match=f"model.gait: .*{words}"):
        blob.decode(resealed(bytes(broken)), "model.gait")


def test_what_cannot_be_stored_is_refused():
    with pytest.raises(ValueError, match="float64"):
        blob.encode({"AAAA": np.zeros(3)})
    with pytest.raises(ValueError, match="TOOLONG"):
        blob.encode({"TOOLONG": np.zeros(3, np.float32)})
    with pytest.raises(ValueError, match="longer than 31"):
        blob.pack_names(["x" * 32])


def test_names_round_trip():
    names = ["pelvis", "", "größe", "x" * 31]
    assert blob.unpack_names(blob.pack_names(names)) == names


def test_files(tmp_path):
    path = tmp_path / "a.gait"
    data = blob.write(path, {"AAAA": np.ones(2, np.float32)})
    assert path.read_bytes() == data and list(tmp_path.iterdir()) == [path]
    assert blob.read(path)["AAAA"].tolist() == [1, 1]
    assert blob.HEADER.unpack(data[: blob.HEADER.size])[5] == blob.checksum(data)
    with pytest.raises(UserError, match=r"b\.gait: No such file"):
        blob.read(tmp_path / "b.gait")
