"""Frames of the clip: the figure with sun, self-shadow, cast shadow and motion blur laid over the scene."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gait.camera.camera import Camera
from gait.simulate.arrays import Floats, Ints, Picture
from gait.simulate.mesh import Mesh
from gait.simulate.paint import AMBIENT, SUN
from gait.simulate.raster import rasterise
from gait.simulate.scene import Scene
from gait.simulate.shadow import Contact, SunView
from gait.simulate.walk import Walk
from gait.simulate.wardrobe import FACE, LEGS, SIZE, TOP, Look

# sub-pixel shifts of the instants averaged over the open shutter: antialiasing and motion blur at once
_SHIFTS = np.array([(-5, 1), (3, -3), (-1, -5), (5, 3), (-3, 5), (1, -1)], np.float32) / 12
SHUTTER = 0.5  # share of the frame interval
DEFOCUS_PX = 0.6
_SLIP = 0.006  # metres by which cloth drifts along the body, once per stride


@dataclass(frozen=True)
class _Instant:
    """The figure at one moment: vertices (n, 3) world, normals (n, 3)."""

    vertices: Floats
    normals: Floats


class Renderer:
    """Draws any frame of one walk.

    Parameters
    ----------
    camera, scene, mesh, look, walk
        What is seen.
    """

    def __init__(self, camera: Camera, scene: Scene, mesh: Mesh, look: Look, walk: Walk) -> None:
        self.camera, self.scene, self.mesh, self.look, self.walk = camera, scene, mesh, look, walk
        self._sun = SunView(scene)
        self._contact = Contact(scene.position)
        self._zero = int(np.argmin(np.abs(walk.timing.time)))
        self._cloth = np.zeros(len(mesh.rest), np.float32)
        for material in (TOP, LEGS):
            self._cloth[mesh.faces[mesh.material == material]] = _SLIP
        self._tile = (SIZE / look.spans).astype(np.float32)

    def light(self, frame: int) -> Floats:
        """Return linear light (h, w, 3), RGB, before the lens and the sensor."""
        opened, closed = self._shutter(frame)
        middle = _between(opened, closed, 0.5)
        self._sun.look(middle.vertices, self.mesh.faces)
        behind = 1 - self.scene.front  # what stands in front takes no shadow of the figure
        sunny = (1 - self._sun.cast() * behind)[..., None]
        touch = (1 - self._contact.dark(middle.vertices) * behind)[..., None]
        picture = self.scene.ambient * touch + self.scene.direct * (sunny * (0.4 + 0.6 * touch))
        return self._over(picture, opened, closed, frame)

    def _shutter(self, frame: int) -> tuple[_Instant, _Instant]:
        """Return the figure as the shutter opens and closes, a quarter interval either side of the frame."""
        centre = self._zero + frame * self.walk.timing.per_frame
        half = self.walk.timing.per_frame // 4
        return self._pose(centre - half), self._pose(centre + half)

    def _pose(self, index: int) -> _Instant:
        origins, turns = self.walk.origins[index], self.walk.turns[index]
        vertices, normals = self.mesh.pose(origins, turns)
        return _Instant(vertices + origins[0].astype(np.float32), normals)

    def _over(self, picture: Floats, opened: _Instant, closed: _Instant, frame: int) -> Floats:
        """Lay the average of the instants over `picture`, behind what stands in front."""
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
        seen = vertices @ camera.R.T.astype(np.float32) + camera.t.astype(np.float32)
        near = 1 / seen[:, 2]
        focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
        uv = seen[:, :2] * near[:, None] * focal + centre
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
        facing = np.maximum(normal @ self.scene.to_sun.astype(np.float32), 0)
        sky = AMBIENT * (0.72 + 0.34 * normal[:, 2])
        albedo = self._albedo(mix(uv), self.mesh.material[hits.face])
        colour[hits.row, hits.column] += albedo * (sky + SUN * facing * lit)[:, None]
        cover[hits.row, hits.column] += 1

    def _albedo(self, uv: Floats, material: Ints) -> Floats:
        texel = np.floor(uv * self._tile[material][:, None]).astype(np.int32)
        row = np.where(material == FACE, np.clip(texel[:, 1], 0, SIZE - 1), texel[:, 1] % SIZE)
        return self.look.tiles[material, row, texel[:, 0] % SIZE]


def _between(a: _Instant, b: _Instant, share: float) -> _Instant:
    s = np.float32(share)
    return _Instant(a.vertices + s * (b.vertices - a.vertices), a.normals + s * (b.normals - a.normals))


def develop(light: Floats, gain: float, noise: float, rng: np.random.Generator | None) -> Picture:
    """Turn linear light (h, w, 3) RGB into an 8-bit BGR picture: lens blur, exposure, sensor noise."""
    soft = cv2.GaussianBlur(light, (0, 0), DEFOCUS_PX)
    shown = np.sqrt(np.maximum(soft, 0)) * np.float32(255 * gain)
    if noise > 0 and rng is not None:
        shown += np.float32(noise) * rng.standard_normal(shown.shape, np.float32)
    return np.ascontiguousarray(np.clip(np.rint(shown), 0, 255).astype(np.uint8)[..., ::-1])
