"""Inputs and outputs of ``gait track``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gait.bindings.abi import Mode
from gait.bindings.shipped import PAPER, WALK

if TYPE_CHECKING:
    from gait.body.measured import MeasuredBody

KEYPOINTS_SD = 4.0  # pixels


@dataclass(frozen=True)
class ClipOptions:
    """What to track and what to write; see ``gait track --help``.

    Attributes
    ----------
    video, output : str
        The clip, and the track to write.
    camera : str, optional
        Its camera file; without one the camera is estimated from the walk, which needs `height` and
        keypoints.
    further : tuple of (str, str)
        Film and camera file of each further camera, in the world of the first.
    offsets : tuple of float, optional
        Start of each further film, seconds after that of `video`; by default estimated from the motion.
    scale_camera : bool
        Whether to resize a camera to the clip's size if its pictures have the same aspect but another size.
    camera_path : str, optional
        File with the poses of a moving camera; `camera` is then its lens.
    camera_out : str, optional
        File to write the camera to.
    cameras_out : str, optional
        File to write the camera of each frame to; they differ if the camera turns.
    fov : float, optional
        Horizontal field of view, degrees, if the camera is estimated.
    model : str, optional
        By default the package's: in paper mode ``paper``, otherwise ``walk``, or ``classes`` if that does not
        follow the person.
    model_reason : str
        Why `model` was chosen instead of the default one; empty if it was not.
    init, background : str
        A file, ``auto``, or for the background ``none``.
    height : float, optional
        The person's stature, metres.
    body : MeasuredBody, optional
        The person's measured body, with the stature of `height`.
    own_body : bool
        Whether the person's body is estimated, from a first pass if there are further films; needs keypoints.
    mode : Mode
    particles : int, optional
    seed, threads : int
    start, stop : int, optional
        Frames to track: start <= frame < stop.
    detector : str
        Network that finds keypoints, for the start and for the likelihood: ``full``, ``lite``, ``heavy``,
        ``none``, or ``auto``: ``full`` if its weights are on this machine.  It is not used in paper mode.
    keypoints : str, optional
        File of 2-D keypoints in the frames, instead of a detector.
    person : str, optional
        Which of several people in a keypoint file of another tool; by default the one who is seen most.
    people : int, optional
        Track everyone who walks, at most this many, with `track_people`; None for one person.
    keypoints_sd : float
        Standard deviation of keypoints at full confidence, pixels.
    stabilize : str
        Which motion of the camera is estimated: ``pans``, where it turns by more than a tenth of the
        picture's width; ``auto``, any; ``off``, none: it counts as still, or its poses are given.
    overlay, draws, trc, report : str, optional
        Further files to write.
    smooth : bool
        Estimate every frame from the whole clip.
    quiet : bool
        Suppress notes and progress.
    """

    video: str
    camera: str | None
    output: str
    model: str | None = None
    model_reason: str = ""
    init: str = "auto"
    background: str = "auto"
    height: float | None = None
    body: MeasuredBody | None = None
    own_body: bool = False
    further: tuple[tuple[str, str], ...] = ()
    offsets: tuple[float, ...] | None = None
    scale_camera: bool = False
    camera_path: str | None = None
    camera_out: str | None = None
    cameras_out: str | None = None
    fov: float | None = None
    mode: Mode = Mode.DEFAULT
    particles: int | None = None
    seed: int = 1
    threads: int = 1
    start: int | None = None
    stop: int | None = None
    detector: str = "auto"
    keypoints: str | None = None
    person: str | None = None
    people: int | None = None
    keypoints_sd: float = KEYPOINTS_SD
    stabilize: str = "pans"
    overlay: str | None = None
    smooth: bool = False
    draws: str | None = None
    trc: str | None = None
    report: str | None = None
    quiet: bool = False

    @property
    def model_name(self) -> str:
        """Model to track with, at first if none is given."""
        return self.model or (PAPER if self.mode == Mode.PAPER else WALK)

    @property
    def network(self) -> str:
        """Name of the landmark network to use; ``none`` for no detector."""
        return "full" if self.detector == "auto" else self.detector
