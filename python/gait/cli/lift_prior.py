"""The segment prior of `gait lift`, and what a user should know of it."""

from __future__ import annotations

import sys

from gait.bindings.segment_prior import SegmentPrior

FEW = 4  # recordings; by two of one person, intervals of other people's walks held as little as 70 %


def load(model: str | None, quiet: bool) -> SegmentPrior:
    """Load the prior of a model (the shipped one: None), and tell where it was learnt from few recordings."""
    prior = SegmentPrior.load(model)
    if 0 < prior.recordings < FEW and not quiet:
        count = "one recording" if prior.recordings == 1 else f"{prior.recordings} recordings"
        print(
            f"{model}: learnt from {count}, which hardly tell how people differ: deviations may come out too "
            "small; learn it from more",
            file=sys.stderr,
        )
    return prior
