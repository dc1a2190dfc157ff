"""Read the 35 mm equivalent focal length that a phone or camera wrote into a film.

Sources, in this order: the key ``com.apple.quicktime.camera.focal_length.35mm_equivalent`` in the metadata of
the film or of a track (QuickTime File Format, "Metadata"; FFmpeg reads only the film's), a tag of another
container with that name or the EXIF name, and the EXIF data of the first picture of a film of JPEGs (CIPA
DC-008, tag 0xA405).
"""

from __future__ import annotations

import math
import os
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_KEY = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
_NAMES = (_KEY, "focallengthin35mmfilm", "focallengthin35mmformat")
_DIAGONAL = math.hypot(36.0, 24.0)  # millimetres, of a picture on 35 mm film
_SHORTEST, _LONGEST_FOCAL_MM = 5.0, 1000.0  # millimetres; other values are mistakes
_FOLDERS = (b"moov", b"trak", b"udta")  # boxes that may contain metadata
_MOST_METADATA_BYTES = 1 << 20  # most bytes of metadata
_NUMBERS = {21: ">i", 22: ">I", 23: ">f", 24: ">d"}  # well-known types of QuickTime: signed, unsigned, floats
_EXIF_IFD, _EXIF_35MM = 0x8769, 0xA405


def lens_tag(path: str | os.PathLike[str]) -> str | None:
    """Read the text that states a film's focal length; None if there is none.

    Damaged metadata count as none, since the film may still be readable.
    """
    return _quicktime(Path(path)) or _container(Path(path))


def equivalent_mm(tag: str) -> float | None:
    """Parse a tag such as ``26.00mm`` to millimetres; None if it is not a plausible focal length."""
    number = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(?:mm)?\s*", tag)
    mm = float(number[1]) if number else 0.0
    return mm if _SHORTEST <= mm <= _LONGEST_FOCAL_MM else None


def view_across(mm: float, size: tuple[int, int]) -> float:
    """Horizontal field of view, degrees, of a picture of `size` pixels; `mm` applies to its diagonal."""
    focal = mm * math.hypot(*size) / _DIAGONAL
    return math.degrees(2 * math.atan(0.5 * size[0] / focal))


def _quicktime(path: Path) -> str | None:
    """Read the key from the metadata of an MP4 or QuickTime film and of its tracks."""
    with path.open("rb") as file:
        try:
            for meta in _metadata(file, 0, path.stat().st_size, len(_FOLDERS)):
                if text := _item(meta):
                    return text
        except (struct.error, OSError, OverflowError):
            pass
    return None


def _metadata(file: BinaryIO, begin: int, end: int, depth: int) -> Iterator[bytes]:
    """Yield the contents of the ``meta`` boxes between two positions of a file."""
    while begin + 8 <= end:
        file.seek(begin)
        size, kind = struct.unpack(">I4s", file.read(8))
        head = 8
        if size == 1:
            size, head = struct.unpack(">Q", file.read(8))[0], 16
        after = end if size == 0 else begin + size
        if after > end or after < begin + head:
            return
        if kind == b"meta" and after - begin <= _MOST_METADATA_BYTES:
            yield file.read(after - begin - head)
        elif kind in _FOLDERS and depth:
            yield from _metadata(file, begin + head, after, depth - 1)
        begin = after


def _boxes(data: bytes, begin: int = 0) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and contents of the boxes in `data`."""
    while begin + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, begin)
        if size < 8:
            return
        yield kind, data[begin + 8 : begin + size]
        begin += size


def _item(meta: bytes) -> str | None:
    """Read the key's value in a ``meta`` box, which has a table of names and a list of numbered values."""
    boxes = dict(_boxes(meta, 0 if meta[4:8] == b"hdlr" else 4))  # MP4 has a version before the boxes
    keys, values = boxes.get(b"keys", b""), boxes.get(b"ilst", b"")
    names = [name for _, name in _boxes(keys, 8)]
    for number, item in _boxes(values):
        at = int.from_bytes(number, "big") - 1
        if not (0 <= at < len(names) and names[at].decode("utf-8", "replace").lower() == _KEY):
            continue
        value = dict(_boxes(item)).get(b"data", b"")
        (kind,) = struct.unpack_from(">I", value)
        if kind in _NUMBERS:
            return f"{struct.unpack_from(_NUMBERS[kind], value, 8)[0]:g}"
        return value[8:].decode("utf-8", "replace").strip("\0 ")
    return None


def _container(path: Path) -> str | None:
    """Read a tag that FFmpeg knows, or the EXIF of a JPEG."""
    import av

    with av.open(str(path)) as container:
        streams = container.streams.video
        tags = [container.metadata, *(stream.metadata for stream in streams)]
        for name, text in (pair for each in tags for pair in each.items()):
            if name.lower() in _NAMES:
                return str(text)
        if streams and streams[0].codec_context.name == "mjpeg":
            for packet in container.demux(streams[0]):
                return _exif(bytes(packet))
    return None


def _exif(jpeg: bytes) -> str | None:
    """Read the 35 mm equivalent from the EXIF segment of a JPEG."""
    at = 2
    try:
        while jpeg[at] == 0xFF and jpeg[at + 1] != 0xDA:  # until the picture's data begin
            (size,) = struct.unpack_from(">H", jpeg, at + 2)
            if jpeg[at + 1] == 0xE1 and jpeg[at + 4 : at + 10] == b"Exif\0\0":
                tiff = jpeg[at + 10 : at + 2 + size]
                order = "<" if tiff[:2] == b"II" else ">"
                first = _entry(tiff, order, struct.unpack_from(order + "I", tiff, 4)[0], _EXIF_IFD)
                value = None if first is None else _entry(tiff, order, first, _EXIF_35MM)
                return None if value is None else str(value)
            at += 2 + size
    except (struct.error, IndexError):
        pass
    return None


def _entry(tiff: bytes, order: str, folder: int, tag: int) -> int | None:
    """Read a tag of type SHORT or LONG in a TIFF directory."""
    (count,) = struct.unpack_from(order + "H", tiff, folder)
    for k in range(count):
        at = folder + 2 + 12 * k
        name, kind = struct.unpack_from(order + "HH", tiff, at)
        if name == tag and kind in (3, 4):
            return int(struct.unpack_from(order + ("H" if kind == 3 else "I"), tiff, at + 8)[0])
    return None
