"""The walker's whole surface: parts joined, clothes creased."""

from __future__ import annotations

import numpy as np

from gait.simulate.anatomy import Anatomy
from gait.simulate.limbs import limb_parts
from gait.simulate.mesh import Mesh, Part, merge, vertex_normals
from gait.simulate.trunk import trunk_parts
from gait.simulate.wardrobe import LEGS, TOP, Look


def build_figure(body: Anatomy, look: Look, rng: np.random.Generator) -> Mesh:
    """Return the mesh of a person in clothes."""
    parts = trunk_parts(body, look) + limb_parts(body, look)
    for part in parts:
        if part.material in (TOP, LEGS):
            _crease(part, 0.0016 * (1 + look.loose), rng)
    return merge(parts, body)


def _crease(part: Part, depth: float, rng: np.random.Generator) -> None:
    """Push the cloth in and out by smooth waves of 6 to 20 cm, `depth` metres rms."""
    waves = rng.standard_normal((10, 3)) * [28, 28, 40]
    phase = rng.uniform(0, 2 * np.pi, 10)
    height = np.cos(part.vertices @ waves.T + phase).sum(1) * depth / np.sqrt(5)
    part.vertices += height[:, None] * vertex_normals(part.vertices, part.faces)
