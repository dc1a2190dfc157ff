"""Boards for calibrating a lens: print them true to size, and find their corners in a picture."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Grey = NDArray[np.uint8]

PAPERS = {"a4": (297.0, 210.0), "letter": (279.4, 215.9), "a3": (420.0, 297.0)}  #: millimetres, landscape
_MARGIN, _FOOT = 8.0, 18.0  # millimetres: margin that printers leave blank; space below the board for a line
_BAR = 100.0  # millimetres of the bar that shows whether the scale is right
_DPI = 300
_MARKERS = cv2.aruco.DICT_5X5_100
_CELLS = 7  # along a marker's side, including its border
_MARKER = 0.75  # side of a marker, in squares
_COARSE = 1600  # pixels along the longer side of the reduced picture in which a board is searched for
_USUAL = ((11, 8), (10, 7), (9, 7), (9, 6), (8, 6), (8, 5), (7, 6), (7, 5), (6, 5), (5, 4))
"""Chessboards in use, the larger first, as they hold smaller ones."""
_LEAST_CORNERS = 8  # visible corners needed of a board with markers


@dataclass(frozen=True)
class Board:
    """Chessboard of `columns` x `rows` inner corners, with or without markers in its white squares."""

    columns: int
    rows: int
    markers: bool

    def __str__(self) -> str:
        return (
            f"ChArUco board of {self.squares[0]}x{self.squares[1]} squares"
            if self.markers
            else (f"chessboard of {self.columns}x{self.rows} inner corners")
        )

    @property
    def squares(self) -> tuple[int, int]:
        """Number of squares across and down."""
        return self.columns + 1, self.rows + 1

    @property
    def corners(self) -> Array:
        """Positions of the inner corners, shape (n, 3), in squares, row by row."""
        row, column = np.divmod(np.arange(self.columns * self.rows), self.columns)
        return np.column_stack([column, row, np.zeros(len(row))]).astype(np.float64)

    def rectangles(self) -> Array:
        """Black rectangles (n, 4) as x, y, width, height in squares, y down."""
        across, down = self.squares
        found = [(x, y, 1.0, 1.0) for y in range(down) for x in range(across) if (x + y) % 2 == 0]
        if self.markers:
            dictionary, gap = cv2.aruco.getPredefinedDictionary(_MARKERS), 0.5 * (1 - _MARKER)
            white = [(x, y) for y in range(down) for x in range(across) if (x + y) % 2]
            for number, (x, y) in enumerate(white):
                cells = cv2.aruco.generateImageMarker(dictionary, number, _CELLS)
                side = _MARKER / _CELLS
                found += [
                    (x + gap + c * side, y + gap + r * side, side, side) for r, c in np.argwhere(cells == 0)
                ]
        return np.array(found)

    def find(self, grey: Grey) -> tuple[NDArray[np.int64], Array] | None:
        """Find the inner corners in a picture: numbers (n,), pixels (n, 2); None if there is no board."""
        small, scale = _coarse(grey)
        found = self._find_marked(small) if self.markers else self._find_plain(small)
        if found is None or scale == 1:
            return found
        numbers, uv = found
        uv = (uv + 0.5) / scale - 0.5
        half = int(np.clip(0.2 * _spacing(uv), 3, 15))
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-3)
        near = np.ascontiguousarray(uv[:, None], np.float32)
        fine = cv2.cornerSubPix(grey, near, (half, half), (-1, -1), stop)
        return numbers, np.asarray(fine[:, 0], np.float64)

    def _find_marked(self, grey: Grey) -> tuple[NDArray[np.int64], Array] | None:
        uv, numbers, _, _ = cv2.aruco.CharucoDetector(self._charuco()).detectBoard(grey)
        if numbers is None or len(numbers) < _LEAST_CORNERS:
            return None
        found = np.asarray(numbers, np.int64).ravel()
        column, row = found % self.columns, found // self.columns
        if min(len(set(column)), len(set(row))) < 2:
            return None  # corners on one line determine no plane
        return found, np.asarray(uv[:, 0], np.float64)

    def _find_plain(self, grey: Grey) -> tuple[NDArray[np.int64], Array] | None:
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        there, uv = cv2.findChessboardCornersSB(grey, (self.columns, self.rows), flags=flags)
        return (np.arange(len(uv)), uv[:, 0].astype(np.float64)) if there else None

    def _charuco(self) -> cv2.aruco.CharucoBoard:
        return cv2.aruco.CharucoBoard(self.squares, 1.0, _MARKER, cv2.aruco.getPredefinedDictionary(_MARKERS))


OURS = Board(6, 4, True)
"""What ``gait calibrate --print-board`` prints."""


def _coarse(grey: Grey) -> tuple[Grey, float]:
    """Reduce a picture for the search for a board; return it and its scale."""
    scale = min(1.0, _COARSE / max(grey.shape))
    if scale == 1:
        return grey, scale
    small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(small).astype(np.uint8), scale


def read_board(text: str) -> Board:
    """Parse ``charuco``, or a chessboard's inner corners such as ``9x6``; ValueError otherwise."""
    if text == "charuco":
        return OURS
    columns, cross, rows = text.lower().partition("x")
    if not (cross and columns.isdigit() and rows.isdigit() and 3 <= min(int(columns), int(rows)) <= 40):
        raise ValueError(f"{text}: give charuco, or a chessboard's inner corners (3 or more) such as 9x6")
    return Board(int(columns), int(rows), False)


def other_board(grey: Grey, wanted: Board) -> str:
    """Describe the board that a picture shows instead of the one wanted; empty if none."""
    small, _ = _coarse(grey)
    if not wanted.markers and OURS.find(small) is not None:
        return f"shows the {OURS} of gait calibrate --print-board; leave out --board"
    for columns, rows in _USUAL:
        other = Board(columns, rows, False)
        if other != wanted and other._find_plain(small) is not None:
            return f"shows a {other}; give --board {columns}x{rows}"
    return ""


def blur(grey: Grey, board: Board, number: NDArray[np.int64], uv: Array) -> float:
    """Width of the edges at a board's corners, pixels: about 2 in a sharp picture.

    It is the larger width of the edges along rows and along columns, since motion may blur only one of them.
    """
    half = int(np.clip(0.3 * _spacing(uv), 3, 25))
    normals = _edge_normals(board, number, uv)
    widths = []
    for u, v in np.rint(uv).astype(int):
        if half < u < grey.shape[1] - half - 1 and half < v < grey.shape[0] - half - 1:
            patch = grey[v - half : v + half + 1, u - half : u + half + 1].astype(np.float64)
            low, high = np.percentile(patch, (5, 95))
            gv, gu = np.gradient(patch)
            steepest = [np.percentile(np.abs(n[0] * gu + n[1] * gv), 99) for n in normals]
            widths.append((high - low) / max(min(steepest), 1e-3))
    return float(np.median(widths)) if widths else np.inf


def _edge_normals(board: Board, number: NDArray[np.int64], uv: Array) -> Array:
    """Return unit normals (2, 2) of the edges along the board's rows and columns in a picture."""
    place = dict(zip(number.tolist(), uv, strict=True))
    found = []
    for step, in_line in ((1, board.columns), (board.columns, len(board.corners))):
        pairs = [
            place[n + step] - at
            for n, at in place.items()
            if n + step in place and n % in_line + step < in_line
        ]
        along = np.median(pairs, axis=0)
        found.append(np.array([-along[1], along[0]]) / np.linalg.norm(along))
    return np.array(found)


def _spacing(uv: Array) -> float:
    """Median distance of the corners' nearest neighbours, pixels."""
    apart = np.linalg.norm(uv[:, None] - uv[None], axis=2)
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))


def print_board(path: Path, kind: str, board: Board, paper: str) -> float:
    """Write the board true to size; return the side of a square, millimetres.

    Parameters
    ----------
    path : pathlib.Path
    kind : str
        ``.pdf`` or ``.png``.
    board : Board
    paper : str
        One of `PAPERS`.
    """
    width, height = PAPERS[paper]
    across, down = board.squares
    side = float(np.floor(min((width - 2 * _MARGIN) / across, (height - _MARGIN - _FOOT) / down)))
    left = 0.5 * (width - side * across)
    black = board.rectangles() * side + [left, _MARGIN, 0, 0]
    foot = _MARGIN + side * down + 6.0
    bar = np.array([[left, foot, _BAR, 1.2]])
    text = (
        f"gait calibrate: {board}. Print at 100 %: the bar must be {_BAR:g} mm long, a square {side:g} mm. "
        "Mount it flat."
    )
    every, at = np.vstack([black, bar]), (left, foot + 6.0)
    if kind == ".pdf":
        path.write_bytes(_pdf(every, (width, height), at, text))
    else:
        path.write_bytes(_png(every, (width, height), at, text))
    return side


def _pdf(black: Array, size: tuple[float, float], at: tuple[float, float], text: str) -> bytes:
    """Make a page with rectangles and a line of text; millimetres from the upper left."""
    point = 72 / 25.4
    lines = [f"{point:.9f} 0 0 {-point:.9f} 0 {size[1] * point:.4f} cm"]
    lines += ["{:.4f} {:.4f} {:.4f} {:.4f} re".format(*row) for row in black]
    lines += ["f", f"BT /F1 3.2 Tf 1 0 0 -1 {at[0]:.3f} {at[1]:.3f} Tm ({text}) Tj ET"]
    content = "\n".join(lines).encode("ascii")
    box = f"[0 0 {size[0] * point:.4f} {size[1] * point:.4f}]"
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        (
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 4 0 R "
            "/Resources << /Font << /F1 5 0 R >> >> >>"
        ).encode("ascii"),
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    out, places = bytearray(b"%PDF-1.4\n"), []
    for number, body in enumerate(objects, 1):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, body)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    out += b"xref\n0 %d\n0000000000 65535 f \n%s" % (len(objects) + 1, table)
    out += b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (
        len(objects) + 1,
        out.rindex(b"xref\n0"),
    )
    return bytes(out)


def _png(black: Array, size: tuple[float, float], at: tuple[float, float], text: str) -> bytes:
    """Draw the same as a PNG file that states its resolution."""
    dot = _DPI / 25.4
    page = np.full((round(size[1] * dot), round(size[0] * dot)), 255, np.uint8)
    for x, y, width, height in np.asarray(black) * dot:
        page[round(y) : round(y + height), round(x) : round(x + width)] = 0
    origin = round(at[0] * dot), round(at[1] * dot)
    cv2.putText(page, text, origin, cv2.FONT_HERSHEY_SIMPLEX, 1.1, 0, 2, cv2.LINE_AA)
    data = cv2.imencode(".png", page)[1].tobytes()
    body = b"pHYs" + struct.pack(">IIB", *(2 * [round(1000 * dot)]), 1)  # dots per metre
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return data[:33] + chunk + data[33:]  # after the header
