"""Recognise keypoint files of other tools by their content, and choose the reader or reject the format."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

from gait.errors import UserError, unreadable
from gait.io import detector_json, detector_tables
from gait.io.detections import Detections

_HEADER_BYTES = 1 << 16  # bytes at the beginning from which the format is recognised
_CSV = "keypoints are CSV with one row per frame of one person: frame,time,<joint>_u,<joint>_v[,<joint>_c]"
#: Formats that are read, for messages about unknown ones.
KNOWN = (
    "keypoints are CSV frame,time,<joint>_u,<joint>_v[,<joint>_c], or files of OpenPose, COCO, AlphaPose, "
    "MMPose, MediaPipe, DeepLabCut, SLEAP, Sports2D or Pose2Sim"
)
#: Suffixes of data that are no videos.
DATA = (
    ".json",
    ".h5",
    ".hdf5",
    ".pkl",
    ".pickle",
    ".npy",
    ".npz",
    ".mat",
    ".parquet",
    ".xml",
    ".yaml",
    ".toml",
)
Reader = Callable[[str | os.PathLike[str]], Detections]

#: First bytes of binary files.
_BINARY = {
    b"\x80": "a Python pickle",
    b"PK\x03\x04": "an archive, such as .npz",
    b"\x93NUMPY": "a numpy array",
    b"MATLAB": "a MATLAB file",
    b"PAR1": "Parquet",
}
#: Text in JSON files that no reader supports.
_YOLO = re.compile(r'"class"[^\0]*"keypoints"|"keypoints"[^\0]*"class"')
#: First lines of supported tables, and their readers.
_TABLES: tuple[tuple[str, Reader], ...] = (
    (r"^(scorer|individuals|bodyparts)\b.*\n(.*\n){0,2}coords\b", detector_tables.read_dlc_csv),
    (r"^[^\n]*\bframe_idx\b[^\n]*\.x\b", detector_tables.read_sleap_csv),
)
#: First lines of tables that are not supported, and what they are.
_REFUSED = (
    (r"^scorer\b|^(individuals|bodyparts)\b", "DeepLabCut without its line coords"),
    (r"^[^\n]*\binstance\.score\b|^[^\n]*\bframe_idx\b", "SLEAP without columns frame_idx and NODE.x"),
    (r"^[^\n]*\b(landmark(_?id|_?name|_?index)?|visibility)\b", "MediaPipe, one row per point"),
    (
        r"^[^\n]*\b(joint|keypoint|bodypart|body_part|label|name|marker)(_?name|_?id)?\b[,;\t][^\n]*\b[xu]\b",
        "one row per point",
    ),
    (r"^[^\n]*\bx_?[01][,;\t] *y_?[01]\b", "numbered points"),
    (r"^[^\n]*\w_x[,;\t][^\n]*\w_y[,;\t][^\n]*\w_z\b", "3-D positions"),
    (r"^[^\n]*\w[_. ]x[,;\t][^\n]*\w[_. ]y\b", "columns <joint>_x,<joint>_y"),
    (r"^\d+( [-+.\de]+){10,}\s", "YOLO labels"),
)
#: First lines of files of 3-D motion, and what they are.
_MOTION = (
    (r"^HIERARCHY\b", "of a .bvh"),
    (r"^(#.*\n)*:(version|fully-specified)\b", "of an .asf or .amc"),
    (r"^(Trajectories|Joints|Model Outputs)\b", "of Vicon"),
    (r"^NO_OF_FRAMES\b", "of Qualisys"),
    (r"^Format Version,", "of Motive"),
    (r"^(.*\n){0,20}endheader\b", "of OpenSim"),
)
_C3D_SECOND, _C3D_FIRST = 80, range(2, 32)  # first bytes of a .c3d: its kind, the block of its parameters
_OWN = re.compile(r"^(?=[^\n]*\bframe\b)(?=[^\n]*\btime\b)[^\n]*\w_u\b")


def reader_of(path: str | os.PathLike[str]) -> Reader | None:
    """Find the reader for a file or folder of another tool; None for the package's CSV or an unknown file.

    UserError, with the remedy, if it cannot be read or has a format that is recognised but not supported.
    """
    if Path(path).is_dir():
        return detector_json.read_folder
    try:
        with Path(path).open("rb") as file:
            head = file.read(_HEADER_BYTES)
    except OSError as error:
        raise unreadable(path, error) from error
    if head.startswith(b"\x89HDF"):
        return detector_tables.read_h5
    if head[1:2] == bytes([_C3D_SECOND]) and head[0] in _C3D_FIRST:
        raise _motion(path, "of a .c3d")
    binary = next((what for magic, what in _BINARY.items() if head.startswith(magic)), "")
    if binary:
        raise UserError(f"{path}: is {binary}; {_CSV}")
    text = head.decode("utf-8", "replace").lstrip("\ufeff \t\r\n").replace("\r", "")
    if re.match(r"\{|\[\s*[\[{\"\d\]-]", text):
        if _YOLO.search(text):
            raise UserError(f"{path}: is JSON from Ultralytics YOLO; {_CSV}")
        return detector_json.read_json_file
    if "\0" in text or _OWN.match(text):
        return None
    if detector_tables.is_trc(text):
        return detector_tables.read_pixel_trc
    for pattern, reader in _TABLES:
        if re.search(pattern, text):
            return reader
    for pattern, what in _MOTION:
        if re.search(pattern, text, re.IGNORECASE):
            raise _motion(path, what)
    for pattern, what in _REFUSED:
        if re.search(pattern, text):
            raise UserError(f"{path}: is a table of {what}; {_CSV}")
    return None


def _motion(path: str | os.PathLike[str], what: str) -> UserError:
    """Return the error for a file of 3-D motion."""
    return UserError(
        f"{path}: is 3-D motion {what}, which has nothing to lift; gait learn takes .amc .bvh .c3d .trc "
        "and .csv, gait lift a video or 2-D keypoints"
    )
