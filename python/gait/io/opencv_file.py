"""Read files of OpenCV's FileStorage (.yaml, .yml, .xml) into a mapping."""

from __future__ import annotations

from codecs import BOM_UTF8
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gait import extras
from gait.errors import UserError

if TYPE_CHECKING:
    import cv2  # otherwise imported where it is used, so that other files can be read without OpenCV


def read_storage(path: str) -> dict[str, Any]:
    """Read the top-level nodes by name: numbers, strings, lists, matrices as nested lists, maps as dicts.

    UserError if the file is not a FileStorage file, is damaged, or has a name twice or an incomplete matrix.
    """
    with extras.importing(f"reading {path}", "video"):
        import cv2

    broken = UserError(f"{path}: not an OpenCV FileStorage file; write it with cv2.FileStorage")
    text = Path(path).read_bytes().removeprefix(BOM_UTF8).decode("latin-1")  # only ASCII matters
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        if not storage.isOpened():
            raise broken
        names = storage.root().keys()
    except (cv2.error, SystemError):  # the constructor's binding turns the former into the latter
        raise broken from None
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UserError(f"{path}: {twice} appears twice; remove one")
    data = {name: _value(path, name, storage.getNode(name)) for name in names}
    storage.release()
    return data


def _value(path: str, name: str, node: cv2.FileNode) -> Any:
    if node.isSeq():
        return [_value(path, name, node.at(i)) for i in range(node.size())]
    if node.isMap():
        content = {key: _value(path, name, node.getNode(key)) for key in node.keys()}  # noqa: SIM118
        return _matrix(path, name, content) if {"rows", "cols"} <= set(content) else content
    return node.string() if node.isString() else node.real()


def _matrix(path: str, name: str, content: dict[str, Any]) -> Any:
    """Convert a matrix to a list of rows."""
    values = content.get("data", [])
    try:
        rows, columns = int(content["rows"]), int(content["cols"])
        return np.asarray(values, float).reshape(rows, columns).tolist()
    except (TypeError, ValueError, OverflowError):
        count = len(values) if isinstance(values, list) else 0
        raise UserError(
            f"{path}: {name} has {count} numbers, other than its rows and columns; the file is damaged, "
            "write it again"
        ) from None
