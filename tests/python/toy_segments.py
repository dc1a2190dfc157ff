"""Small priors over segments with known parameters, for tests of code that uses priors."""

from __future__ import annotations

import numpy as np

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import JOINTS
from gait.io import blob
from gait.learn.segments.fit import sections

#: Axes of a picture taken along +y: to the right and up.
FRONT = np.array([[1.0, 0, 0], [0, 0, 1]])


def toy_prior(
    frames: int = 4, markers: int = 6, size: int = 5, seed: int = 0, components: int = 1, headings: int = 0
) -> SegmentPrior:
    """Random prior: markers of a stature's extent, modes smooth in time, a small residual.

    The markers are the first of gait.body.skeleton.JOINTS (19 at most), then m19, m20 ...
    """
    rng = np.random.default_rng(seed)
    names = tuple(JOINTS[:markers]) + tuple(f"m{i}" for i in range(len(JOINTS), markers))
    body = rng.normal(size=(components, 1, markers, 3)) * (0.2, 0.2, 0.3) + (0, 0, 0.5)
    drift = np.linspace(0, 0.1, frames)[None, :, None, None] * np.array([1.0, 0, 0])
    waves = np.cos(np.pi * np.arange(4)[:, None] * (np.arange(frames) + 0.5) / frames)
    shapes = np.einsum("cksmi,sf->ckfmi", rng.normal(size=(components, size, 4, markers, 3)), waves)
    flat = shapes.reshape(components, size, -1)
    base = np.stack([np.linalg.qr(rows.T)[0].T for rows in flat])
    sd = 0.5 * np.sort(rng.uniform(0.1, 1, (components, size)), axis=1)[:, ::-1]
    weights = rng.uniform(0.5, 1.5, components)
    return SegmentPrior(
        names=names,
        hop=max(1, frames // 2),
        fps=20.0,
        headings=headings,
        weights=weights / weights.sum(),
        mean=body + drift,
        modes=(base * sd[:, :, None]).reshape(components, size, frames, markers, 3),
        sd=sd.copy(),
        residual=rng.uniform(0.5, 2, (components, markers)) * 1e-5,
        gamma=1.5,
        stature=1.7,
        segments=100,
        recordings=7,
    )


def toy_blob(prior: SegmentPrior) -> bytes:
    """Blob that contains only the prior."""
    return blob.encode(sections(prior))
