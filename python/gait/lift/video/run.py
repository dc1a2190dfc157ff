"""Lift the images of a video: sensors, corrections, cylinder figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.bindings.model import read_blob, read_cyclic
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.blob import decode
from gait.io.video import Video, background, reporting_damage
from gait.lift.keypoints.corrections import Correction, read_corrections
from gait.lift.video.clip_segments import ClipSegments, Settings
from gait.lift.video.figure import Figure, write_overlay
from gait.lift.video.fit_clip import (
    FOLLOWING_CORRELATION,
    KNOWN_JOINT_SD,
    POOR_CORRELATION,
    ClipFit,
    fit_clip,
    suggestions,
    work,
)
from gait.lift.video.placement import PhasePrior, Placement, read_placement
from gait.lift.video.sensors import CameraView, Film, FlatView, View
from gait.progress import progress
from gait.reproducible import one_thread
from gait.track.from_walk import Calibration

Floats = npt.NDArray[np.float64]

SMALLEST_PERSON_PX = 20.0  # pixels; in a smaller person limbs cannot be distinguished
LARGEST_PERSON_HEIGHTS = 4.0  # largest height of a person, in heights of the picture

Warn = Callable[[str], None]


@dataclass(frozen=True)
class Request:
    """What to lift and how.

    Attributes
    ----------
    video, placement : str
        Files.
    model, camera, corrections : str, optional
        Files; by default the shipped model, a view without a camera, and no corrections.
    scale_camera : bool
        Whether to resize a camera of another resolution to the video's.
    calibration : Calibration, optional
        Camera estimated from the walk instead; its uncertainty is added to the standard deviations.
    height : float, optional
        Stature with which it was estimated, metres.
    background : str
        An image, ``auto`` (median of the clip) or ``none``.
    start, stop : int, optional
        First frame to use, and the first not to use.
    joined : bool
        Whether segments are solved together, or one after the other, as in the paper.
    """

    video: str
    placement: str
    model: str | None = None
    camera: str | None = None
    scale_camera: bool = False
    calibration: Calibration | None = None
    height: float | None = None
    corrections: str | None = None
    background: str = "auto"
    start: int | None = None
    stop: int | None = None
    joined: bool = True


@dataclass(frozen=True)
class LiftedVideo:
    """Estimates without and with corrections, and the cylinder figure of the latter."""

    video: Video
    clip: ClipSegments
    free: ClipFit
    fit: ClipFit
    figure: Figure

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the markers that are estimated."""
        return self.clip.prior.names


def lift_video(request: Request, prior: SegmentPrior, warn: Warn, quiet: bool) -> LiftedVideo:
    """Estimate the motion in a video.

    Raises
    ------
    UserError
        One line that names the file at fault.
    """
    video, clip = open_clip(request, prior, warn, quiet)
    free, fit = _fits(clip, quiet)
    if fit.fit_correlation < POOR_CORRELATION:
        warn(poor_correlation(request, fit.fit_correlation))
    free, fit = (widened(request, one) for one in (free, fit))
    return LiftedVideo(video, clip, free, fit, Figure.fit(fit.places, prior.names))


def open_clip(request: Request, prior: SegmentPrior, warn: Warn, quiet: bool) -> tuple[Video, ClipSegments]:
    """Read the files and compute the sensors, as `lift_video` does before it estimates."""
    video = Video(request.video)
    camera = Camera.read(request.camera, video.size, request.scale_camera) if request.camera else None
    placement = read_placement(request.placement, prior, camera is not None)
    if request.calibration is not None:
        camera = request.calibration.camera
        placement = _on_floor(request, placement, prior)
    if placement.unused:
        keys = " and ".join(placement.unused)
        warn(f"{request.placement}: not used {'with' if camera else 'without'} --camera: {keys}")
    first, stop = _frames(request, video, placement)
    corrections = []
    if request.corrections:
        corrections = read_corrections(request.corrections, prior, stop, first, video.size)
    view = CameraView(camera) if camera else _flat(placement, prior)
    with reporting_damage(video, warn):
        film = _film(request, video, view, placement, prior, (first, stop), quiet)
    used = [c for c in corrections if first <= c.frame < first + len(film.times)]
    if len(used) < len(corrections):
        warn(f"{len(corrections) - len(used)} corrections are in frames that are not used")
    phase_prior = PhasePrior.of(prior, _cycle(request.model), placement)
    settings = Settings(joined=request.joined)
    return video, ClipSegments(prior, view, film, placement, used, settings, phase_prior)


def _on_floor(request: Request, placement: Placement, prior: SegmentPrior) -> Placement:
    """Convert a placement in the picture to the world of an estimated camera, by the pelvis's height."""
    assert request.calibration is not None and request.height is not None
    pelvis = request.height * prior.mean[0, 0, prior.index(["pelvis"])[0], 2]
    ground = request.calibration.camera.on_plane(np.array(placement.pelvis_px), pelvis)[:2]
    if not np.isfinite(ground).all():
        raise UserError(
            f"{request.placement}: pelvis_px is above the horizon of the camera estimated from the walk; "
            "give the pelvis in the picture"
        )
    return replace(placement, ground=ground, stature=request.height)


def widened(request: Request, fit: ClipFit) -> ClipFit:
    """Add the uncertainty of an estimated camera to the standard deviations."""
    if request.calibration is None:
        return fit
    return replace(fit, sd=request.calibration.joint_sd(fit.time, fit.places, fit.sd))


def poor_correlation(request: Request, fit_correlation: float) -> str:
    """Return a warning if the figure explains little of the sensors' readings."""
    remedy = "--background or --corrections" if request.background == "none" else "--corrections"
    return (
        f"{request.video}: the sensors hardly show the person (correlation with the stick figure "
        f"{fit_correlation:.2f}, {FOLLOWING_CORRELATION:g} before a known background): the figure may have "
        f"lost the person, so standard deviations are widened; check with --overlay and give {remedy}"
    )


def _frames(request: Request, video: Video, placement: Placement) -> tuple[int, int]:
    """Return the first frame, and the first frame not to use."""
    first = placement.frame if request.start is None else request.start
    stop = video.count if request.stop is None else min(request.stop, video.count)
    if first >= stop:
        raise UserError(
            f"{request.video}: has no frame from {first} to before {stop}; its frames are 0 to "
            f"{video.count - 1}, give other --start and --stop, or another frame in the placement"
        )
    if not first <= placement.frame < stop:
        raise UserError(
            f"{request.placement}: frame {placement.frame} is not among the frames {first} to {stop - 1}; "
            "place the person in one of them"
        )
    return first, stop


def _flat(placement: Placement, prior: SegmentPrior) -> FlatView:
    """Make a view without a camera, with pixels per metre from the placement."""
    assert placement.pelvis_px is not None and placement.height_px is not None
    pixels = placement.height_px / placement.stature
    pelvis = placement.stature * prior.mean[0, 0, prior.index(["pelvis"])[0], 2]
    return FlatView(pixels, (placement.pelvis_px[0], placement.pelvis_px[1] + pixels * pelvis))


def _cycle(model: str | None) -> Mapping[str, Any]:
    """Return the sections of a cyclic model: the given one, or else the shipped one."""
    sections = decode(read_blob(model))
    return sections if "CURV" in sections else read_cyclic(None)


def _film(
    request: Request,
    video: Video,
    view: View,
    placement: Placement,
    prior: SegmentPrior,
    frames: tuple[int, int],
    quiet: bool,
) -> Film:
    """Compute the sensors of the frames used."""
    pelvis = np.append(placement.ground, placement.stature * prior.mean[0, 0, prior.index(["pelvis"])[0], 2])
    if not view.visible(pelvis):
        raise UserError(
            f"{request.placement}: pelvis is behind the camera; give its position in the camera's world"
        )
    height = placement.stature * view.scale(pelvis)
    _require_in_picture(request.placement, video, view.project(pelvis)[0], height)
    with progress("background", video.count, quiet) as update:
        plate = background(request.background, video, update)
    with progress("sensors", frames[1] - frames[0], quiet) as update:
        shown = video.frames(*frames)
        first = next(shown, None)
        if first is None:
            raise video.no_frame(frames[0])
        film = Film.make(chain([first], shown), height, plate, update)
    if placement.frame >= frames[0] + len(film.times):
        raise video.no_frame(frames[0] + len(film.times))
    return film


def _require_in_picture(path: str, video: Video, pelvis: Floats, height: float) -> None:
    """Raise UserError if a placement is not in the picture: `pelvis` (2,) and `height` in pixels."""
    wide, high = video.size
    if not SMALLEST_PERSON_PX <= height <= LARGEST_PERSON_HEIGHTS * high:
        raise UserError(
            f"{path}: the person would be {height:.3g} px tall in a picture of {wide}x{high}; give position "
            f"and stature, or height_px, of a person of {SMALLEST_PERSON_PX:g} to "
            f"{LARGEST_PERSON_HEIGHTS * high:g} px"
        )
    if (np.maximum(-pelvis, pelvis - (wide - 1, high - 1)) > height / 2).any():
        raise UserError(
            f"{path}: the pelvis falls at pixel ({pelvis[0]:.0f}, {pelvis[1]:.0f}) of a picture of "
            f"{wide}x{high}; place the person where the picture shows some of it"
        )


def _fits(clip: ClipSegments, quiet: bool) -> tuple[ClipFit, ClipFit]:
    """Fit the clip without and with the corrections."""
    with one_thread(), progress("segments", work(clip), quiet) as update:
        free = fit_clip(replace(clip, corrections=()), update=update)
    if not clip.corrections:
        return free, free
    with one_thread(), progress("corrections", work(clip), quiet) as update:
        return free, fit_clip(clip, update=update)


def _marker(clip: ClipSegments, fit: ClipFit, correction: Correction) -> Floats:
    """Return the position (3,) of a correction's marker in an estimate."""
    found = fit.places[correction.frame - clip.film.first, clip.prior.index([correction.joint])[0]]
    return np.asarray(found)


def draw_overlay(path: str, lifted: LiftedVideo, quiet: bool) -> None:
    """Write the video with the cylinder figure and the corrections drawn into it."""
    clip, fit = lifted.clip, lifted.fit
    corrections = [(c, _marker(clip, fit, c)) for c in clip.corrections]
    write_overlay(
        path, lifted.video, fit.frame, [clip.view] * len(fit.frame), lifted.figure, corrections, quiet
    )


def correction_errors(clip: ClipSegments, fit: ClipFit) -> Floats:
    """Distances (C,) between corrections and their markers, pixels."""
    observed = [clip.view.project(_marker(clip, fit, c)[None])[0][0] - c.uv for c in clip.corrections]
    return np.linalg.norm(np.reshape(observed, (-1, 2)), axis=1)


def summary(lifted: LiftedVideo, most: int) -> dict[str, Any]:
    """Return the figures of ``--json``, with at most `most` of the most useful corrections."""
    clip, free, fit, figure = lifted.clip, lifted.free, lifted.fit, lifted.figure
    frames, given = len(fit.frame), len(clip.corrections)
    pixels = float(np.median([clip.view.scale(body.mean(axis=0)) for body in fit.places]))
    enough = KNOWN_JOINT_SD * clip.placement.stature * pixels
    before, after = correction_errors(clip, free), correction_errors(clip, fit)
    wanted = suggestions(clip, fit)
    joints = clip.prior.index([j for j in JOINTS if j in clip.prior.names])
    return {
        "frames": frames,
        "segments": len(clip.starts),
        "corrections": {
            "given": given,
            "per_frame": given / frames,
            "needed": int((before > enough).sum()),
            "within_px": float(enough),
            "miss_px": {
                "without": float(np.median(before)) if given else None,
                "with": float(np.median(after)) if given else None,
            },
            "wanted": len(wanted),
            "wanted_per_frame": len(wanted) / frames,
        },
        "fit_correlation": fit.fit_correlation if np.isfinite(fit.fit_correlation) else None,
        "sd_mm": 1000 * float(np.median(fit.sd[:, joints])),
        "figure": {
            "stature_m": figure.stature,
            "residual_mm": 1000 * float(np.nanmedian(figure.residual)),
            "bones_m": figure.lengths(),
        },
        "suggest": [{"frame": s.frame, "joint": s.joint, "sd_px": s.sd_px} for s in wanted[:most]],
    }
