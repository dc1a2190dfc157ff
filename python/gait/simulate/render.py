"""Render frames: figures with sunlight, self-shadow, cast shadow and motion blur over the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import cv2
import numpy as np

from gait.camera.camera import Camera
from gait.simulate.body import Mesh
from gait.simulate.geometry import Floats, Ints, Picture
from gait.simulate.paint import AMBIENT, SUN
from gait.simulate.scene import Scene
from gait.simulate.walk import Walk
from gait.simulate.wardrobe import FACE, LEGS, TEXTURE_SIZE, TOP, Appearance


class Hits(NamedTuple):
    """The nearest surface at every covered pixel."""

    #: (n,) pixels, each once.
    row: Ints
    column: Ints
    face: Ints  #: (n,) triangle seen there
    weights: Floats  #: (n, 3) barycentric weights of its corners in the picture plane


def rasterise(xy: Floats, nearness: Floats, faces: Ints, width: int, height: int) -> Hits:
    """Find the visible triangle of every pixel.

    `xy` (n, 2): vertices in pixels, pixel centres at integers. `nearness` (n,): larger is nearer, linear in
    the picture (1 / depth for a perspective camera). `faces` (m, 3): triangles; those clockwise in a picture
    with v down (the back sides) are dropped. `width`, `height`: of the picture, pixels.
    """
    a, b, c = (xy[faces[:, k]] for k in range(3))
    area = _cross(b - a, c - a)
    front = np.flatnonzero(area < -1e-9)
    a, b, c, area = a[front], b[front], c[front], area[front]
    low = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c)), 0).astype(np.int32)
    edge = np.array([width - 1, height - 1], np.float32)
    high = np.floor(np.minimum(np.maximum(np.maximum(a, b), c), edge)).astype(np.int32)
    size = high - low + 1
    visible = np.flatnonzero((size[:, 0] > 0) & (size[:, 1] > 0))
    x, y, which = _candidates(low[visible], size[visible])
    which = visible[which]
    weights = _weights(a, (b - a) / area[:, None], (c - a) / area[:, None], x, y, which)
    inside = np.flatnonzero(weights.min(0) >= 0)
    return _nearest(x[inside], y[inside], front[which[inside]], weights[:, inside], nearness, faces, width)


def _cross(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _candidates(low: Ints, size: Ints) -> tuple[Ints, Ints, Ints]:
    """List the pixels of every bounding box: column, row and index of the box."""
    count = size[:, 0] * size[:, 1]
    which = np.repeat(np.arange(len(count), dtype=np.int32), count)
    start = np.cumsum(count, dtype=np.int32) - count
    local = np.arange(int(count.sum()), dtype=np.int32) - start[which]
    columns = size[which, 0]
    row = local // columns
    return low[which, 0] + (local - row * columns), low[which, 1] + row, which


def _weights(a: Floats, ab: Floats, ac: Floats, x: Ints, y: Ints, which: Ints) -> Floats:
    """Return the barycentric weights (3, n) of pixels in triangles `which`; edges are given over the area."""
    px, py = x - a[which, 0], y - a[which, 1]
    second = px * ac[which, 1] - py * ac[which, 0]
    third = py * ab[which, 0] - px * ab[which, 1]
    return np.stack([1 - second - third, second, third])


def _nearest(
    x: Ints, y: Ints, face: Ints, weights: Floats, nearness: Floats, faces: Ints, width: int
) -> Hits:
    """Keep the nearest candidate of each pixel."""
    depth = np.einsum("kn,nk->n", weights, nearness[faces[face]])
    pixel = y * np.int32(width) + x
    order = np.lexsort((depth, pixel))
    last = order[np.flatnonzero(np.diff(pixel[order], append=-1))]
    return Hits(y[last], x[last], face[last].astype(np.int32), np.ascontiguousarray(weights[:, last].T))


_CELL = 0.0125  # metres per pixel of the sun's view
_BIAS = 0.025  # metres
_PENUMBRA = 1.6  # cells
_FOOT_CELL, _FOOT_SIDE = 0.02, 96


class SunView:
    """Parallel projection along the sun's rays, updated for each frame."""

    def __init__(self, scene: Scene) -> None:
        z = scene.to_sun
        x = np.cross([0.0, 0.0, 1.0], z)
        x /= np.linalg.norm(x)
        self._axes = np.stack([x, np.cross(x, z), z]).astype(np.float32)  # right, down, towards the sun
        self._plate = scene.position @ self._axes.T
        self._nearest = np.zeros((1, 1), np.float32)
        self._corner = np.zeros(2, np.float32)
        self._centre = 0.0

    def update(self, vertices: Floats, faces: Ints) -> None:
        """Find what the sun sees of the figure."""
        turned = vertices @ self._axes.T
        self._corner = turned[:, :2].min(0) - np.float32(8 * _CELL)
        extent = turned[:, :2].max(0) - self._corner + 8 * _CELL
        width, height = (int(v) for v in np.ceil(extent / _CELL))
        hits = rasterise(
            (turned[:, :2] - self._corner) / np.float32(_CELL), turned[:, 2], faces, width, height
        )
        self._nearest = np.full((height, width), -np.inf, np.float32)
        self._nearest[hits.row, hits.column] = np.einsum(
            "nk,nk->n", hits.weights, turned[:, 2][faces[hits.face]]
        )
        self._centre = float(turned[:, 2].mean())

    def visible(self, places: Floats, normals: Floats, shift: Floats) -> Floats:
        """Return 1 where positions (n, 3) on the figure are sunlit, 0 in its own shade; `shift` softens."""
        turned = (places + np.float32(0.012) * normals) @ self._axes.T
        at = np.rint((turned[:, :2] - self._corner) / np.float32(_CELL) + 2.5 * shift).astype(np.int32)
        rows, columns = self._nearest.shape
        inside = (at >= 0).all(1) & (at[:, 0] < columns) & (at[:, 1] < rows)
        depth = self._nearest[np.clip(at[:, 1], 0, rows - 1), np.clip(at[:, 0], 0, columns - 1)]
        return np.where(inside & (depth > turned[:, 2] + _BIAS), 0, 1).astype(np.float32)

    def cast(self) -> Floats:
        """Return how much the figure shades each pixel of the empty scene from the sun, 0..1, (h, w)."""
        mask = cv2.GaussianBlur(np.isfinite(self._nearest).astype(np.float32), (0, 0), _PENUMBRA)
        x = (self._plate[..., 0] - self._corner[0]) / np.float32(_CELL)
        y = (self._plate[..., 1] - self._corner[1]) / np.float32(_CELL)
        shade = cv2.remap(mask, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return shade * (self._plate[..., 2] < self._centre)


class Contact:
    """Loss of sky light on the ground close to the feet."""

    def __init__(self, position: Floats) -> None:
        self._x, self._y = position[..., 0].copy(), position[..., 1].copy()
        self._ground = np.abs(position[..., 2]) < 0.01

    def dark(self, vertices: Floats) -> Floats:
        """Return the share of light lost at each pixel, (h, w), for figure vertices (n, 3)."""
        low = vertices[vertices[:, 2] < 0.25]
        if not len(low):
            return np.zeros_like(self._x)
        corner = 0.5 * (low[:, :2].min(0) + low[:, :2].max(0)) - np.float32(0.5 * _FOOT_SIDE * _FOOT_CELL)
        cell = np.clip(((low[:, :2] - corner) / np.float32(_FOOT_CELL)).astype(int), 0, _FOOT_SIDE - 1)
        near = np.exp(-np.maximum(low[:, 2], 0) / 0.07)
        grid = np.zeros((_FOOT_SIDE, _FOOT_SIDE), np.float32)
        np.maximum.at(grid, (cell[:, 1], cell[:, 0]), near)
        grid = np.minimum(cv2.GaussianBlur(grid, (0, 0), 2.2) * 2.2, 1) * 0.6
        x, y = (self._x - corner[0]) / np.float32(_FOOT_CELL), (self._y - corner[1]) / np.float32(_FOOT_CELL)
        dark = cv2.remap(grid, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return np.asarray(dark * self._ground, np.float32)


# sub-pixel shifts of the instants averaged over the open shutter, for both antialiasing and motion blur
_SHIFTS = np.array([(-5, 1), (3, -3), (-1, -5), (5, 3), (-3, 5), (1, -1)], np.float32) / 12
SHUTTER = 0.5  # share of the frame interval
DEFOCUS_PX = 0.6
_SLIP = 0.006  # metres by which cloth slides along the body, once per stride


@dataclass(frozen=True)
class _Instant:
    """The figure at one moment: vertices (n, 3) world, normals (n, 3)."""

    vertices: Floats
    normals: Floats


Shutter = tuple[_Instant, _Instant]
"""The figure when the shutter opens and when it closes."""


class Renderer:
    """Draws any frame of one walk."""

    def __init__(self, camera: Camera, scene: Scene, mesh: Mesh, appearance: Appearance, walk: Walk) -> None:
        self.camera, self.scene, self.mesh, self.appearance, self.walk = camera, scene, mesh, appearance, walk
        self._sun = SunView(scene)
        self._contact = Contact(scene.position)
        self._zero = int(np.argmin(np.abs(walk.timing.time)))
        self._cloth = np.zeros(len(mesh.rest), np.float32)
        for material in (TOP, LEGS):
            self._cloth[mesh.faces[mesh.material == material]] = _SLIP
        self._tile = (TEXTURE_SIZE / appearance.spans).astype(np.float32)

    def shadow(self, shutter: Shutter) -> tuple[Floats, Floats]:
        """Return the shares of the sun's and the sky's light left by the figure at each pixel, (h, w, 1)."""
        middle = _between(*shutter, 0.5)
        self._sun.update(middle.vertices, self.mesh.faces)
        behind = 1 - self.scene.front  # objects in front receive no shadow of the figure
        sunny = (1 - self._sun.cast() * behind)[..., None]
        return sunny, (1 - self._contact.dark(middle.vertices) * behind)[..., None]

    def depth(self, frame: int) -> float:
        """Distance of the pelvis along the optical axis, metres."""
        index = self._zero + frame * self.walk.timing.per_frame
        return float(self.camera.depth(self.walk.origins[index, 0]))

    def shutter(self, frame: int) -> Shutter:
        """Return the figure a quarter of a frame interval before and after the frame."""
        centre = self._zero + frame * self.walk.timing.per_frame
        half = self.walk.timing.per_frame // 4
        return self._pose(centre - half), self._pose(centre + half)

    def _pose(self, index: int) -> _Instant:
        origins, turns = self.walk.origins[index], self.walk.turns[index]
        vertices, normals = self.mesh.pose(origins, turns)
        return _Instant(vertices + origins[0].astype(np.float32), normals)

    def over(self, picture: Floats, shutter: Shutter, frame: int) -> Floats:
        """Draw the average of the instants over `picture`, behind objects in front."""
        opened, closed = shutter
        window = self._window(opened, closed)
        rows, columns = window
        shape = (rows.stop - rows.start, columns.stop - columns.start)
        if min(shape) <= 0:
            return picture
        colour, cover = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 1), np.float32)
        phase = self.walk.timing.phase[self._zero + frame * self.walk.timing.per_frame]
        uv = self.mesh.uv.copy()
        uv[:, 1] += self._cloth * np.float32(np.sin(2 * np.pi * phase))
        for k, shift in enumerate(_SHIFTS):
            now = _between(opened, closed, (k + 0.5) / len(_SHIFTS))
            self._splat(colour, cover, now, uv, window, shift)
        keep = (1 - self.scene.front[window])[..., None] / len(_SHIFTS)
        picture[window] = picture[window] * (1 - cover * keep) + colour * keep
        return picture

    def _window(self, opened: _Instant, closed: _Instant) -> tuple[slice, slice]:
        """Return the rows and columns that the figure can touch."""
        uv = np.concatenate([self._project(opened.vertices)[0], self._project(closed.vertices)[0]])
        low = np.maximum(np.floor(uv.min(0)).astype(int) - 1, 0)
        high = np.minimum(np.ceil(uv.max(0)).astype(int) + 2, self.camera.size)
        return slice(low[1], max(high[1], low[1])), slice(low[0], max(high[0], low[0]))

    def _project(self, vertices: Floats) -> tuple[Floats, Floats]:
        """Return pixels (n, 2) and 1 / depth (n,)."""
        camera = self.camera
        in_camera = vertices @ camera.R.T.astype(np.float32) + camera.t.astype(np.float32)
        near = 1 / in_camera[:, 2]
        focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
        uv = in_camera[:, :2] * near[:, None] * focal + centre
        return uv.astype(np.float32), near.astype(np.float32)

    def _splat(
        self,
        colour: Floats,
        cover: Floats,
        now: _Instant,
        uv: Floats,
        window: tuple[slice, slice],
        shift: Floats,
    ) -> None:
        """Add one instant, sampled at pixel centres moved by `shift`."""
        xy, near = self._project(now.vertices)
        xy = xy - np.array([window[1].start, window[0].start], np.float32) - shift
        hits = rasterise(xy, near, self.mesh.faces, cover.shape[1], cover.shape[0])
        corners = self.mesh.faces[hits.face]

        def mix(values: Floats) -> Floats:
            return np.einsum("nk,nkj->nj", hits.weights, values[corners])

        normal = mix(now.normals)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True) + 1e-9
        lit = self._sun.visible(mix(now.vertices), normal, shift)
        cosine = np.maximum(normal @ self.scene.to_sun.astype(np.float32), 0)
        sky = AMBIENT * (0.72 + 0.34 * normal[:, 2])
        albedo = self._albedo(mix(uv), self.mesh.material[hits.face])
        colour[hits.row, hits.column] += albedo * (sky + SUN * cosine * lit)[:, None]
        cover[hits.row, hits.column] += 1

    def _albedo(self, uv: Floats, material: Ints) -> Floats:
        texel = np.floor(uv * self._tile[material][:, None]).astype(np.int32)
        row = np.where(
            material == FACE, np.clip(texel[:, 1], 0, TEXTURE_SIZE - 1), texel[:, 1] % TEXTURE_SIZE
        )
        return self.appearance.tiles[material, row, texel[:, 0] % TEXTURE_SIZE]


def light(people: Sequence[Renderer], frame: int) -> Floats:
    """Return linear light (h, w, 3), RGB, without effects of lens and sensor; all `people` share a scene."""
    scene = people[0].scene
    shutters = [one.shutter(frame) for one in people]
    shadows = [one.shadow(shutter) for one, shutter in zip(people, shutters, strict=True)]
    sunny, touch = (reduce(np.multiply, parts) for parts in zip(*shadows, strict=True))
    picture: Floats = scene.ambient * touch + scene.direct * (sunny * (0.4 + 0.6 * touch))
    for k in sorted(range(len(people)), key=lambda k: -people[k].depth(frame)):
        picture = people[k].over(picture, shutters[k], frame)
    return picture


def _between(a: _Instant, b: _Instant, share: float) -> _Instant:
    s = np.float32(share)
    return _Instant(a.vertices + s * (b.vertices - a.vertices), a.normals + s * (b.normals - a.normals))


def develop(light: Floats, gain: float, noise: float, rng: np.random.Generator | None) -> Picture:
    """Turn linear light (h, w, 3) RGB into an 8-bit BGR picture: lens blur, exposure, sensor noise."""
    defocused = cv2.GaussianBlur(light, (0, 0), DEFOCUS_PX)
    shown = np.sqrt(np.maximum(defocused, 0)) * np.float32(255 * gain)
    if noise > 0 and rng is not None:
        shown += np.float32(noise) * rng.standard_normal(shown.shape, np.float32)
    return np.ascontiguousarray(np.clip(np.rint(shown), 0, 255).astype(np.uint8)[..., ::-1])
