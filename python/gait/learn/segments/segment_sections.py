"""A segment prior as sections of a blob (libgait/doc/model-format.md)."""

from __future__ import annotations

from gait.bindings.segment_prior import SegmentPrior
from gait.io import blob
from gait.learn.prior.rounded import rounded


def sections(prior: SegmentPrior) -> dict[str, blob.Array]:
    """Sections SGNM ... SGPS as a model holds them, rounded."""
    exact = prior.sections()
    modes = rounded(prior.modes).reshape(exact["SGMD"].shape)
    return exact | {"SGMN": rounded(prior.mean), "SGMD": modes}
