"""Linear rows about a sequence: observations, feet that do not slide, bones of constant length.

All are rows of `A x = y`, each with a standard deviation.  A row contains frames of at most two neighbouring
blocks, so that A' W A is a block arrowhead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse

from gait.lift.smooth import rows as view_rows
from gait.lift.smooth.block_arrowhead import Information

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.intp]

FLOOR_JOINTS = ("l_toe", "r_toe", "l_heel", "r_heel")
TRUNK_JOINTS = ("pelvis", "neck")
CONTACT_SPEED = 0.2  # m/s; a foot on the ground is slower
CONTACT_RISE = 0.04  # metres; a foot on the ground is less than this above its lowest position
CONTACT_SD = 0.1  # m/s, of a foot on the ground
LIMB_BONES = (
    *(
        (f"{s}_{upper}", f"{s}_{lower}")
        for s in "lr"
        for upper, lower in (("hip", "knee"), ("knee", "ankle"))
    ),
    *((f"{s}_shoulder", f"{s}_elbow") for s in "lr"),
    *((f"{s}_elbow", f"{s}_wrist") for s in "lr"),
    *((f"{s}_ankle", f"{s}_toe") for s in "lr"),
    ("l_hip", "r_hip"),
    ("l_shoulder", "r_shoulder"),
)
WEAK = 10.0  # relative standard deviation of a scale about its guess; practically free
CONSTANT_SCALE_SD = 1e-4  # relative change of a scale that is constant
LEAST_SURE = 0.05  # least probability that a foot stands for which there is a row
LEAST_BONE_M = 0.02  # metres; least length of a bone
BONE_SD = 0.01  # relative change of a length from one frame to the next


@dataclass(frozen=True)
class Layout:
    """Order of a sequence's unknowns: blocks of b frames of J markers, then b lengths if scale is unknown.

    Attributes
    ----------
    blocks, frames, markers : int
        B, b, J.
    unit : float or None
        Metres in which the lengths of a unit of the picture are given, one per frame; None: there are none.
    errors : int
        Number of unknowns of the detector's lasting errors, which follow all blocks.
    """

    blocks: int
    frames: int
    markers: int
    unit: float | None
    errors: int = 0

    @property
    def size(self) -> int:
        """Number of unknowns of a block."""
        return self.frames * (3 * self.markers + (self.unit is not None))

    @property
    def grid(self) -> int:
        """Number of frames of the sequence."""
        return self.blocks * self.frames

    def place(self, frame: Ints, marker: Ints | int) -> Ints:
        """Index of a marker's x; y and z follow."""
        block, inside = np.divmod(frame, self.frames)
        return np.asarray(block * self.size + 3 * (inside * self.markers + marker))

    def length(self, frame: Ints) -> Ints:
        """Index of a frame's length of a unit of the picture."""
        block, inside = np.divmod(frame, self.frames)
        return np.asarray(block * self.size + 3 * self.frames * self.markers + inside)

    def error(self, number: Ints) -> Ints:
        """Index of an unknown of the detector's lasting errors."""
        return np.asarray(self.blocks * self.size + number)

    def places(self, values: Floats) -> Floats:
        """Extract positions (grid, J, 3) from values (B, size)."""
        used = 3 * self.frames * self.markers
        return values[:, :used].reshape(self.grid, self.markers, 3)

    def values(self, places: Floats, lengths: Floats) -> Floats:
        """Make values (B, size) from positions (grid, J, 3) and lengths (grid,)."""
        own = [places.reshape(self.blocks, -1)]
        if self.unit is not None:
            own.append(lengths.reshape(self.blocks, -1) / self.unit)
        return np.concatenate(own, axis=1)

    def lengths(self, values: Floats) -> Floats:
        """Extract lengths (grid,), metres, from values (B, size); `unit` must be set."""
        assert self.unit is not None
        return self.unit * values[:, 3 * self.frames * self.markers :].reshape(-1)


class Rows:
    """Collects rows; `normal` forms A' W A and A' W y in blocks, with the lasting errors as border."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self._entries: list[tuple[Ints, Ints, Floats]] = []
        self._right: list[Floats] = []
        self._weight: list[Floats] = []
        self._count = 0

    def add(self, columns: Ints, factors: Floats, right: Floats, sd: Floats) -> None:
        """Add R rows: columns and factors (R, c), right-hand sides and standard deviations (R,)."""
        rows = self._count + np.repeat(np.arange(len(columns)), columns.shape[1])
        self._entries.append((rows, columns.ravel(), factors.ravel()))
        self._right.append(right)
        self._weight.append(1 / sd**2)
        self._count += len(columns)

    def normal(self) -> tuple[Information, float]:
        """Return A' W A and A' W y in blocks, and y' W y."""
        layout = self.layout
        shape, total = (layout.blocks, layout.size), layout.blocks * layout.size
        diagonal = np.zeros((*shape, layout.size))
        below = np.zeros((layout.blocks - 1, layout.size, layout.size))
        if not self._count:
            border, corner = np.zeros((*shape, layout.errors)), np.zeros((layout.errors, layout.errors))
            return Information(diagonal, below, border, corner, np.zeros(shape), np.zeros(layout.errors)), 0.0
        rows, columns, factors = (np.concatenate(part) for part in zip(*self._entries, strict=True))
        right, weight = np.concatenate(self._right), np.concatenate(self._weight)
        matrix = sparse.csr_matrix((factors, (rows, columns)), shape=(self._count, total + layout.errors))
        inner, errors = matrix[:, :total], matrix[:, total:]
        weighted = sparse.diags(weight) @ inner
        normal = sparse.coo_matrix(inner.T @ weighted)
        (at, inside), (other, across) = (np.divmod(i, layout.size) for i in (normal.row, normal.col))
        same, next_ = at == other, at == other + 1
        diagonal[at[same], inside[same], across[same]] = normal.data[same]
        below[other[next_], inside[next_], across[next_]] = normal.data[next_]
        border = (weighted.T @ errors).toarray().reshape(*shape, layout.errors)
        corner = (errors.T @ sparse.diags(weight) @ errors).toarray()
        vector, edge = (weighted.T @ right).reshape(shape), errors.T @ (weight * right)
        return Information(diagonal, below, border, corner, vector, edge), float(right @ (weight * right))


def observe(
    rows: Rows,
    observed: view_rows.Rows,
    markers: Ints,
    at: tuple[Ints, Floats],
    scale: Floats | None,
    lasting: tuple[Ints, Floats],
) -> None:
    """Add the observations.

    Parameters
    ----------
    observed : gait.lift.smooth.rows.Rows
        Rows of P points in T frames.
    markers : (P,)
        Index of each point's marker.
    at : (T, w) and (T, w)
        Frames of the grid and weights that interpolate positions in the frames of the video.
    scale : (n, 2) or None
        Factors of the length of a unit of the picture, if that is unknown.
    lasting : (n, K) and (n, 2, K)
        Indices of the unknowns of the detector's lasting errors along the first axis (those of the second
        follow), and factors.
    """
    frames, weights = at[0][observed.frame], at[1][observed.frame]
    columns = rows.layout.place(frames, markers[observed.marker][:, None])[..., None] + np.arange(3)
    columns = columns.reshape(len(frames), -1)
    if scale is not None:
        columns = np.hstack([columns, rows.layout.length(frames)])
    for k in range(2):
        factors = (weights[..., None] * observed.direction[:, k, None]).reshape(len(frames), -1)
        if scale is not None:
            factors = np.hstack([factors, weights * scale[:, k, None] * (rows.layout.unit or 1.0)])
        rows.add(
            np.hstack([columns, rows.layout.error(lasting[0] + k)]),
            np.hstack([factors, lasting[1][:, k]]),
            observed.value[:, k],
            np.sqrt(observed.variance[:, k]),
        )


@dataclass(frozen=True)
class Pins:
    """Markers at known positions in frames of the video: rows, markers (n,); positions, sd (n, 3), metres."""

    row: Ints
    marker: Ints
    place: Floats
    sd: Floats

    def part(self, rows: Ints) -> Pins:
        """Return the pins in some frames, which are renumbered."""
        own = np.flatnonzero(np.isin(self.row, rows))
        return Pins(np.searchsorted(rows, self.row[own]), self.marker[own], self.place[own], self.sd[own])


def pin(rows: Rows, pins: Pins, at: tuple[Ints, Floats]) -> None:
    """Add rows that hold markers at known positions; `at` as in `observe`."""
    frames, weights = at[0][pins.row], at[1][pins.row]
    columns = rows.layout.place(frames, pins.marker[:, None])
    for axis in range(3):
        rows.add(columns + axis, weights, pins.place[:, axis], pins.sd[:, axis])


def contacts(rows: Rows, names: Sequence[str], places: Floats, rate: float) -> Floats:
    """Add rows that stop feet that are low and slow in `places` (grid, J, 3).

    Speeds are in lengths of the trunk per second; in metres, a smaller body would have slower feet, and the
    fit would shrink it.

    Returns
    -------
    sure : (grid - 1, feet)
        Probability that a foot stands from each frame to the next.
    """
    feet = np.array([names.index(name) for name in FLOOR_JOINTS if name in names], np.intp)
    if not len(feet):
        return np.zeros((len(places) - 1, 0))
    sure = _contact(places[:, feet], rate)
    frame, foot = np.nonzero(sure > LEAST_SURE)
    first = rows.layout.place(frame, feet[foot])
    then = rows.layout.place(frame + 1, feet[foot])
    sd = CONTACT_SD / rate / np.sqrt(sure[frame, foot])
    moved = places[frame + 1, feet[foot]] - places[frame, feet[foot]]
    size, across = trunk(rows.layout, names, places, frame)
    for axis in range(3):
        columns = np.column_stack([first + axis, then + axis, size])
        factors = np.column_stack([np.tile([-1.0, 1.0], (len(frame), 1)), -moved[:, [axis]] * across])
        rows.add(columns, factors, -moved[:, axis] * bool(size.size), sd)
    return sure


def _contact(feet: Floats, rate: float) -> Floats:
    """Probability that feet (grid, P, 3) stand from each frame to the next."""
    speed = np.linalg.norm(np.diff(feet, axis=0), axis=2) * rate
    lowest = np.quantile(feet[..., 2], 0.05, axis=0)
    rise = np.maximum(feet[:-1, :, 2], feet[1:, :, 2]) - lowest
    return np.asarray(1 / (1 + (speed / CONTACT_SPEED) ** 4) / (1 + (rise / CONTACT_RISE) ** 4))


def trunk(layout: Layout, names: Sequence[str], places: Floats, frame: Ints) -> tuple[Ints, Floats]:
    """Columns and factors (n, 6) of the trunk's length over its present one; empty without a trunk."""
    if not set(TRUNK_JOINTS) <= set(names):
        return np.zeros((len(frame), 0), np.intp), np.zeros((len(frame), 0))
    ends = [names.index(name) for name in TRUNK_JOINTS]
    along = places[frame, ends[1]] - places[frame, ends[0]]
    along /= np.sum(along**2, axis=1, keepdims=True)
    columns = [layout.place(frame, end)[:, None] + np.arange(3) for end in ends]
    return np.hstack(columns), np.hstack([-along, along])


def bones(rows: Rows, names: Sequence[str], places: Floats) -> None:
    """Add rows that keep the logarithms of bones' lengths, linearised at `places` (grid, J, 3)."""
    pairs = np.array(
        [[names.index(n) for n in bone] for bone in LIMB_BONES if set(bone) <= set(names)], np.intp
    )
    if not len(pairs):
        return
    along = places[:, pairs[:, 1]] - places[:, pairs[:, 0]]
    length = np.maximum(np.linalg.norm(along, axis=2), LEAST_BONE_M)
    slope = along / length[..., None] ** 2
    frame, bone = (part.ravel() for part in np.indices((len(places) - 1, len(pairs))))
    columns, factors = [], []
    for step, sign in ((0, -1.0), (1, 1.0)):
        for end in (0, 1):
            start = rows.layout.place(frame + step, pairs[bone, end])
            columns.append(start[:, None] + np.arange(3))
            factors.append(sign * (1.0 if end else -1.0) * slope[frame + step, bone])
    # each side is log L linearised at L': log L' + slope (D - D'), with slope D' = 1, which cancels
    right = np.log(length[frame, bone] / length[frame + 1, bone])
    rows.add(np.hstack(columns), np.hstack(factors), right, np.full(len(frame), BONE_SD))


def steady_lengths(rows: Rows, lengths: Floats, drift: float | None) -> None:
    """Add rows that couple the lengths (grid,) of a unit of the picture.

    Parameters
    ----------
    drift : float or None
        Relative standard deviation of their second differences over frames; None: all are equal.
    """
    grid, guess = rows.layout.grid, lengths / (rows.layout.unit or 1.0)
    at = rows.layout.length(np.arange(grid))
    rows.add(at[:, None], np.ones((grid, 1)), guess, np.full(grid, WEAK))
    factors, sd = ([-1.0, 1.0], CONSTANT_SCALE_SD) if drift is None else ([1.0, -2.0, 1.0], drift)
    count = grid - len(factors) + 1
    columns = np.stack([at[i : i + count] for i in range(len(factors))], axis=1)
    rows.add(columns, np.tile(factors, (count, 1)), np.zeros(count), np.full(count, sd))
