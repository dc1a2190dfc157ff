"""Keypoint files of other tools, recognised by their content, so that errors can name what they are."""

from __future__ import annotations

import os
import re
from pathlib import Path

from gait.errors import unreadable

_HEAD = 1 << 16  # bytes that show what a file is
_CSV = "keypoints are CSV with one row per frame of one person: frame,time,<joint>_u,<joint>_v[,<joint>_c]"

#: First bytes of files that are no text.
_BINARY = {
    b"\x89HDF": "HDF5, as DeepLabCut and SLEAP write it",
    b"\x80": "a Python pickle",
    b"PK\x03\x04": "an archive, such as .npz",
    b"\x93NUMPY": "a numpy array",
    b"MATLAB": "a MATLAB file",
    b"PAR1": "Parquet",
}
#: What text of JSON holds, and whose it is; the first that is found counts.
_JSON = (
    (r'"(pose|face|hand_left)_keypoints(_2d|_3d)?"', "OpenPose"),
    (r'"instance_info"|"meta_info"|"keypoint_scores"', "MMPose"),
    (r'"annotations"|"categories"', "COCO"),
    (r'"image_id"[^{}]*"keypoints"|"keypoints"[^{}]*"image_id"', "AlphaPose or COCO results"),
    (r'"class"[^\0]*"keypoints"|"keypoints"[^\0]*"class"', "Ultralytics YOLO"),
    (r'"(pose_?)?(world_?)?landmarks?"|"visibility"', "MediaPipe"),
    (r'"keypoints"', "a pose detector"),
)
_THREE_LINES = "DeepLabCut, whose header has {lines} lines (scorer, bodyparts, coords)"
#: The same of the first lines of a table.
_TABLES = (
    (r"^scorer\b.*\n(individuals\b.*\n)?bodyparts\b", _THREE_LINES),
    (r"^(individuals\b.*\n)?bodyparts\b.*\ncoords\b", _THREE_LINES),
    (r"^[^\n]*\binstance\.score\b|^[^\n]*\bframe_idx\b", "SLEAP"),
    (r"^[^\n]*\b(landmark(_?id|_?name|_?index)?|visibility)\b", "MediaPipe"),
    (
        r"^[^\n]*\b(joint|keypoint|bodypart|body_part|label|name|marker)(_?name|_?id)?\b[,;\t][^\n]*\b[xu]\b",
        "one row per point",
    ),
    (r"^[^\n]*\bx_?[01][,;\t] *y_?[01]\b", "numbered points"),
    (r"^[^\n]*\w_x[,;\t][^\n]*\w_y[,;\t][^\n]*\w_z\b", "3-D positions"),
    (r"^[^\n]*\w[_. ]x[,;\t][^\n]*\w[_. ]y\b", "columns <joint>_x,<joint>_y"),
    (r"^\d+( [-+.\de]+){10,}\s", "YOLO labels"),
)
_OWN = re.compile(r"^(?=[^\n]*\bframe\b)(?=[^\n]*\btime\b)[^\n]*\w_u\b")


def foreign_format(path: str | os.PathLike[str]) -> str:
    """Describe a keypoint file that is not the package's CSV, with the remedy; '' if it is not recognised.

    UserError if the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise unreadable(path, error) from error
    binary = next((what for magic, what in _BINARY.items() if head.startswith(magic)), "")
    if binary:
        return f"is {binary}; {_CSV}"
    text = head.decode("utf-8", "replace").lstrip("\ufeff \t\r\n").replace("\r", "")
    if re.match(r"\{|\[\s*[\[{\"\d\]-]", text):
        tool = next((tool for pattern, tool in _JSON if re.search(pattern, text)), "")
        return f"is JSON{f' of {tool}' * bool(tool)}; {_CSV}"
    if "\0" in text or _OWN.match(text):
        return ""
    for pattern, what in _TABLES:
        if re.search(pattern, text):
            lines = text[: max(0, text.find("coords"))].count("\n")
            named = what.format(lines=("one", "two", "three", "four")[min(lines, 3)])
            return f"is a table of {named}; {_CSV}"
    return ""
