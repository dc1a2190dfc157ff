"""What `gait learn` makes its prior over segments from."""

from __future__ import annotations

from dataclasses import dataclass

from gait.bindings.segment_prior import HEADINGS

SOURCES = ("learnt", "all", "none", "only")
MARKERS = ("virtual", "recorded")
FREE = "free"
#: Turned copies as the command names them, to what the blob says.
TURNS = {FREE if count == 0 else str(count): count for count in HEADINGS}


@dataclass(frozen=True)
class Segments:
    """Options of the segment prior.

    Attributes
    ----------
    source : one of SOURCES
        learnt: the steady part of the recordings that the cyclic model learns from; all: whole recordings,
        also those it refuses; only: the same, without a cyclic model; none: no prior.
    frames, hop : int
        Of a segment, and from one to the next.
    fps : float
        Frames per second of the segments.
    modes : int
        At most so many; a quarter of the segments if that is fewer.
    headings : 0, 2 or 8
        See `gait.bindings.segment_prior.SegmentPrior`.
    mixture : int or None
        Components; None: as many as describe held-out recordings best.
    markers : one of MARKERS
        virtual: of the default skeleton; recorded: those of the files.
    people : bool
        Also learn from people who were not recorded (`segment_people`).
    """

    source: str = SOURCES[0]
    frames: int = 10
    hop: int = 5
    fps: float = 20.0
    modes: int = 50
    headings: int = 0
    mixture: int | None = 1
    markers: str = MARKERS[0]
    people: bool = True

    @property
    def whole(self) -> bool:
        """Whether whole recordings are used, whatever the cyclic model makes of them."""
        return self.source in ("all", "only")
