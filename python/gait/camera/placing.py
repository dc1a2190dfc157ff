"""Extrinsics of a camera, from points with known positions in the world and in the picture."""

from __future__ import annotations

import csv
import os
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.fields import table_rows
from gait.io.files import require_file

Array = NDArray[np.float64]

FEWEST_GROUND_POINTS = 4  # points on the ground needed to place a camera
_COLUMNS = ("u", "v", "x", "y")
_STRAIGHT = 0.02  # ratio of width to length below which points count as being on a line
_LARGEST_COORDINATE = 1e6  # pixels or metres; largest coordinate accepted


@dataclass(frozen=True)
class Points:
    """Points seen in one picture.

    Attributes
    ----------
    path : str
    line : ndarray of int, shape (n,)
        Line of the file, from 1.
    uv : ndarray of shape (n, 2)
        Pixels, with centres at integers.
    world : ndarray of shape (n, 3)
        Metres, z up, ground at z = 0.
    """

    path: str
    line: NDArray[np.int64]
    uv: Array
    world: Array


def read_points(path: str | os.PathLike[str]) -> Points:
    """Read CSV with the columns ``u v x y`` and, for points off the ground, ``z``.

    Raises
    ------
    UserError
        One line naming file, line and remedy.
    """
    require_file(path, "file of points")
    try:
        rows = [row for row in table_rows(Path(path).read_text(encoding="utf-8-sig")) if row[1]]
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; give a file with the columns u,v,x,y[,z]") from None
    except (UnicodeDecodeError, csv.Error):
        raise UserError(f"{path}: is not text; give CSV with the columns u,v,x,y[,z]") from None
    head = [cell.strip().lower() for cell in rows[0][1]] if rows else []
    if any(name not in head for name in _COLUMNS):
        raise UserError(f"{path}: the first line must name the columns u,v,x,y and, if need be, z")
    names = (*_COLUMNS, *(["z"] if "z" in head else []))
    where = [(name, head.index(name)) for name in names]
    values = np.array(
        [[_cell(path, line, cells, at, name) for name, at in where] for line, cells in rows[1:]]
    )
    if len(values) < FEWEST_GROUND_POINTS:
        raise UserError(f"{path}: has {len(values)} points; give {FEWEST_GROUND_POINTS} or more")
    world = values[:, 2:] if "z" in head else np.pad(values[:, 2:], ((0, 0), (0, 1)))
    return Points(
        str(path),
        np.array([line for line, _ in rows[1:]]),
        np.ascontiguousarray(values[:, :2]),
        np.ascontiguousarray(world),
    )


def _cell(path: str | os.PathLike[str], line: int, cells: list[str], at: int, name: str) -> float:
    text = cells[at].strip() if at < len(cells) else ""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= _LARGEST_COORDINATE:
        unit = "pixels" if name in "uv" else "metres"
        raise UserError(f"{path}: line {line}: {name} is {text[:20]!r}; give a number of {unit}")
    return value


def place(lens: Camera, points: Points) -> tuple[Camera, Array]:
    """Place a camera whose lens is known, by least squares of pixels (SQPnP, then Levenberg-Marquardt).

    Returns
    -------
    camera : Camera
    off : ndarray of shape (n,)
        Reprojection error of each point, pixels.

    Raises
    ------
    UserError
        If no camera pose above the ground fits the points.
    """
    _require_extent(points)
    K, dist = lens.matrix, lens.distortion
    _, turns, shifts, _ = cv2.solvePnPGeneric(points.world, points.uv, K, dist, flags=cv2.SOLVEPNP_SQPNP)
    found = []
    for turn, shift in zip(turns, shifts, strict=True):
        rvec, t = cv2.solvePnPRefineLM(points.world, points.uv, K, dist, turn.copy(), shift.copy())
        camera = replace(lens, R=np.asarray(cv2.Rodrigues(rvec)[0]), t=np.asarray(t, np.float64).ravel())
        if camera.centre[2] > 0 and (camera.depth(points.world) > 0).all():
            found.append((camera, np.hypot(*(camera.project(points.world) - points.uv).T)))
    if not found:
        raise UserError(
            f"{points.path}: no camera pose above the ground fits these points; check that z points up and "
            "that x, y, z are right-handed"
        )
    return min(found, key=lambda one: float((one[1] ** 2).sum()))


def _require_extent(points: Points) -> None:
    for what, values in (("u, v", points.uv), ("x, y, z", points.world)):
        size = np.linalg.svd(values - values.mean(axis=0), compute_uv=False)
        if not size[1] > _STRAIGHT * size[0]:
            raise UserError(f"{points.path}: {what} are on a line; add points off that line")
