"""The options of a learning run, created once by the command and passed down unchanged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gait.bindings import abi

if TYPE_CHECKING:
    from gait.learn.mocap.markers import MarkerMap

DEFAULT_COMPONENTS = 8
PAPER_COMPONENTS = 5
MOST_READ_COMPONENTS = 16  # the most that the library reads
PRIORS = ("people", "paper")
PERIOD_MODES = ("refined", "literal")
#: Rules by which files belong to one person (`gait.learn.corpus.subjects`).
SUBJECT_RULES = ("auto", "prefix", "folder", "file")
#: Which joint centres of recorded skeletons to use (`gait.learn.solve.anatomy`).
JOINT_CENTRES = ("recorded", "anatomical")
SEGMENT_SOURCES = ("learnt", "all", "none", "only")
SEGMENT_MARKERS = ("virtual", "recorded")
#: Rotated copies of each segment, as the command names them and as the blob stores them.
HEADINGS_BY_NAME = {"free" if count == 0 else str(count): count for count in abi.SEGMENT_HEADINGS}


@dataclass(frozen=True)
class SegmentOptions:
    """Options of the segment prior."""

    #: learnt: the steady parts of the recordings in the cyclic model; all: whole recordings, also those the
    #: cyclic model refuses; only: the same without a cyclic model; none: no segment prior.
    source: str = SEGMENT_SOURCES[0]
    frames: int = 10  #: of a segment
    hop: int = 5  #: frames from one segment to the next
    fps: float = 20.0  #: frames per second of the segments
    modes: int = 50  #: most modes; a quarter of the segments if that is fewer
    headings: int = 0  #: 0, 2 or 8 (`gait.bindings.segment_prior.SegmentPrior`)
    mixture: int | None = 1  #: number of Gaussians; None: the number that predicts held-out people best
    markers: str = SEGMENT_MARKERS[0]  #: virtual: of the default skeleton; recorded: those of the files
    people: bool = True  #: also learn from people who were not recorded (`gait.learn.segments.motion`)

    @property
    def whole(self) -> bool:
        """Whether whole recordings are used, even if the cyclic model does not accept them."""
        return self.source in ("all", "only")


@dataclass(frozen=True)
class LearnOptions:
    """All options of `gait learn`."""

    sources: tuple[str, ...] = ()  #: motion files and folders of them
    exclude: tuple[str, ...] = ()  #: globs of files to leave out
    generic_lengths: tuple[str, ...] = ()  #: globs of files whose limb lengths are not the person's
    output: str = ""  #: path of the model
    report: str | None = None  #: folder of the report
    quiet: bool = False  #: no progress and no notes on stderr
    activity: str = "walk"  #: recordings of another known activity are rejected
    subjects: str = SUBJECT_RULES[0]
    components: int | str | None = None  #: a number, "auto", or None for DEFAULT_COMPONENTS
    #: people: also of people who were not recorded; paper: the 19 angles of Ormoneit 2000 by its algorithm.
    prior: str = PRIORS[0]
    period_mode: str = PERIOD_MODES[0]
    fps: float | None = None  #: frames per second; None: from the file
    markers: MarkerMap | None = None  #: for unknown marker sets
    joints: str = JOINT_CENTRES[0]  #: where the joints of CMU's skeletons are
    static: tuple[str, ...] = ()  #: static trials of the people (`gait.learn.solve.static_trial`)
    zeros_missing: bool = False  #: three or more exact zeros in a row are missing data
    trim: bool = True  #: cut starts, stops and turns off the ends of recordings
    seed: int = 1  #: of the choice of held-out data
    credit: tuple[str, ...] = ()  #: origins and licences of the recordings, stored in the model
    segments: SegmentOptions = SegmentOptions(source="none")
    jobs: int = 1  #: processes that read files
    dask: str | None = None  #: scheduler of a Dask cluster that reads them instead
    reverse: bool = False  #: learn recordings in reversed time
    classes: tuple[str, ...] = ()  #: further classes of motion, NAME or NAME=SOURCE
    several: bool = False  #: the model is one class of several, so its strides are longer at higher rates
    changes: tuple[str, ...] = ()  #: recordings of changes between classes, and folders of them


DEFAULT = LearnOptions()
