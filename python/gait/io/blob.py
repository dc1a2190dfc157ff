"""Read and write model blobs (`.gait`, format 1.0): a container of named arrays (model-format.md).

The container knows nothing about walking; `gait.body.skeleton` and `gait.learn` define the sections.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.errors import UserError
from gait.io.fields import json_of
from gait.io.files import replacing

MAGIC = b"GAITMDL\n"
FORMAT = (1, 0)
HEADER = struct.Struct("<8sHHIIIQ32x")
ENTRY = struct.Struct("<4sII4IIQQ")
ALIGN = 64
NAME_BYTES = 32
CRC_OFFSET = 20
DTYPES: dict[int, np.dtype[Any]] = {1: np.dtype("<u1"), 2: np.dtype("<i4"), 3: np.dtype("<f4")}
CODES = {dtype: code for code, dtype in DTYPES.items()}

Array = npt.NDArray[np.generic]


def encode(sections: Mapping[str, Array]) -> bytes:
    """Pack arrays into the bytes of a blob.

    `sections`: four-letter ASCII tag to an array of uint8, int32 or float32 with 1 to 4 axes, in file order.
    ValueError if a tag, element type or number of axes cannot be stored.
    """
    arrays = {tag: _storable(tag, array) for tag, array in sections.items()}
    offset = _aligned(HEADER.size + ENTRY.size * len(arrays))
    table, data = b"", bytearray()
    start = offset
    for tag, array in arrays.items():
        dims = array.shape + (1,) * (4 - array.ndim)
        table += ENTRY.pack(tag.encode(), CODES[array.dtype], array.ndim, *dims, 0, offset, array.nbytes)
        data += array.tobytes()
        data += bytes(_aligned(len(data)) - len(data))
        offset = start + len(data)
    header = HEADER.pack(MAGIC, *FORMAT, HEADER.size, len(arrays), 0, offset)
    blob = bytearray((header + table).ljust(start, b"\0") + data)
    struct.pack_into("<I", blob, CRC_OFFSET, zlib.crc32(blob))
    return bytes(blob)


def decode(blob: bytes, name: str = "blob") -> dict[str, Array]:
    """Unpack a blob into read-only arrays, checking every bound and the checksum.

    `blob`: the whole file; `name`: what to call it in errors. UserError if it is not a blob, of another major
    version, truncated or damaged.
    """
    if len(blob) < HEADER.size or blob[:8] != MAGIC:
        raise UserError(f"{name}: not a .gait model; make one with gait learn")
    _, major, minor, header_bytes, count, crc, total = HEADER.unpack_from(blob)
    if major != FORMAT[0]:
        raise UserError(
            f"{name}: format {major}.{minor}, this package reads {FORMAT[0]}.x; learn the model again"
        )
    if header_bytes != HEADER.size or total != len(blob) or HEADER.size + count * ENTRY.size > len(blob):
        raise UserError(
            f"{name}: header states {total} bytes, the file has {len(blob)}; copy or learn it again"
        )
    if crc != checksum(blob):
        raise UserError(f"{name}: checksum differs, the file is damaged; copy or learn it again")
    sections: dict[str, Array] = {}
    for i in range(count):
        tag, array = _section(blob, HEADER.size + i * ENTRY.size, name)
        if tag in sections:
            raise UserError(f"{name}: section {tag} occurs twice; learn the model again")
        sections[tag] = array
    return sections


def checksum(blob: bytes) -> int:
    """Compute the CRC-32 of a blob, with its checksum field taken as 0."""
    return zlib.crc32(blob[CRC_OFFSET + 4 :], zlib.crc32(bytes(4), zlib.crc32(blob[:CRC_OFFSET])))


def write(path: str | os.PathLike[str], sections: Mapping[str, Array]) -> bytes:
    """Write a blob, completely or not at all; return its bytes."""
    blob = encode(sections)
    with replacing(path) as temporary:
        temporary.write_bytes(blob)
    return blob


def read(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Read a blob from a file. UserError if the file cannot be read or is not a valid blob."""
    try:
        with open(path, "rb") as file:
            blob = file.read()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; give the name of a .gait model") from error
    return decode(blob, os.fspath(path))


def pack_names(names: list[str]) -> npt.NDArray[np.uint8]:
    """Encode names as NUL-padded UTF-8, uint8 (len(names), 32)."""
    rows = np.zeros((len(names), NAME_BYTES), np.uint8)
    for row, name in zip(rows, names, strict=True):
        text = name.encode()
        if len(text) >= NAME_BYTES:
            raise ValueError(f"name {name!r} is longer than {NAME_BYTES - 1} bytes")
        row[: len(text)] = np.frombuffer(text, np.uint8)
    return rows


def unpack_names(rows: Array) -> list[str]:
    """Decode the names of a section, the inverse of `pack_names`."""
    return [row.tobytes().split(b"\0")[0].decode(errors="backslashreplace") for row in rows]


def read_meta(sections: Mapping[str, Array], name: str = "model") -> dict[str, Any]:
    """Decode META; empty if a model has none. UserError, naming `name`, if it is not a JSON object."""
    if "META" not in sections:
        return {}
    remedy = "learn the model again"
    return json_of(f"{name}: section META", np.asarray(sections["META"]).tobytes(), remedy, remedy)


def _aligned(n: int) -> int:
    return -(-n // ALIGN) * ALIGN


def _storable(tag: str, array: Array) -> Array:
    """Check an array and convert it to the memory layout and byte order of the file."""
    stored = np.ascontiguousarray(array, np.asarray(array).dtype.newbyteorder("<"))
    if len(tag.encode("ascii")) != 4 or stored.dtype not in CODES or not 1 <= stored.ndim <= 4:
        raise ValueError(f"section {tag!r}: {stored.dtype} with {stored.ndim} axes cannot be stored")
    return stored


def _section(blob: bytes, at: int, name: str) -> tuple[str, Array]:
    """Read the section whose table entry is at byte `at`."""
    raw, code, rank, d0, d1, d2, d3, _, offset, size = ENTRY.unpack_from(blob, at)
    tag = raw.decode("ascii", "replace")
    dims = (d0, d1, d2, d3)
    if code not in DTYPES or not 1 <= rank <= 4 or any(d != 1 for d in dims[rank:]):
        raise UserError(f"{name}: section {tag} has an unknown type or shape; learn the model again")
    dtype, items = DTYPES[code], d0 * d1 * d2 * d3
    if offset % ALIGN or offset + size > len(blob) or size != items * dtype.itemsize:
        raise UserError(f"{name}: section {tag} is outside the file; learn the model again")
    array = np.frombuffer(blob, dtype, items, offset).reshape(dims[:rank])
    return tag, array
