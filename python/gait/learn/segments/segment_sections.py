"""A segment prior as sections of a blob (libgait/doc/model-format.md)."""

from __future__ import annotations

import numpy as np

from gait.bindings.segment_prior import SegmentPrior
from gait.io import blob
from gait.learn.prior.rounded import rounded


def sections(prior: SegmentPrior) -> dict[str, blob.Array]:
    """Sections SGNM ... SGPS, in the order of the file."""
    components, size, frames, markers = prior.modes.shape[:4]
    counts = [frames, prior.hop, prior.headings, components, size, prior.segments, prior.recordings, 0]
    return {
        "SGNM": blob.pack_names(list(prior.names)),
        "SGIN": np.array(counts, np.int32),
        "SGRT": np.array([prior.fps, prior.gamma, prior.stature, 0, 0, 0, 0, 0], np.float32),
        "SGWT": prior.weights.astype(np.float32),
        "SGMN": rounded(prior.mean),
        "SGMD": rounded(prior.modes.reshape(components, size, frames, 3 * markers)),
        "SGSD": prior.sd.astype(np.float32),
        "SGPS": prior.residual.astype(np.float32),
    }
