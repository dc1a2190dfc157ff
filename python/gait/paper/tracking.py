"""Figure 6 of Ormoneit and others (2000): a person tracked for 50 frames, overlaid and from another side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gait.bindings.abi import Mode, TrackStatus
from gait.bindings.config import TrackerConfig
from gait.bindings.estimate import Estimate
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.video import Image, Video, background
from gait.learn.arrays import Floats
from gait.lift.keypoints.corrections import read_corrections
from gait.motion.evaluate import root_errors
from gait.paper import verdicts
from gait.paper.clip import Clip
from gait.paper.entry import Entry, Picture
from gait.paper.ormoneit import Learning
from gait.paper.ormoneit_figures import blob_of
from gait.paper.pictures import image, labelled
from gait.report.drawing import Overlay, default_view, draw_standing
from gait.track.tracker import Tracker

FRAMES = 50  # of the paper's figure
SHOWN = tuple(range(0, FRAMES + 1, 10))
PARTICLES = 10_000
HELD = 0.1  # statures in the picture, mean of the true joints, within which a person counts as followed
MARKED = 0.15  # of joints marked by hand, which are not where the model has them
CUT_OUT = 1.35  # statures, side of a picture cut out about the person
SIZE = 250  # pixels of a picture
SEEDS = 10  # runs each way


@dataclass(frozen=True)
class Tracked:
    """Estimates of the frames from the start, and how far they are off."""

    model: Model
    estimates: list[Estimate]
    frames: list[int]  #: of the errors
    errors: Floats  #: (n,) pixels from marked or true joints, mean
    rooted: Floats  #: (n,) millimetres from the true joints, root-aligned; empty without the truth
    held: int  #: of SEEDS runs, of which this is the first, in which the person is followed to the end
    unnoticed: int  #: of the others, those of status tracking in the last fifth of the frames


@dataclass(frozen=True)
class Both:
    """The clip tracked by the paper's filter and by the package's."""

    clip: Clip
    camera: Camera
    first: int
    images: list[Image]
    literal: Tracked
    ours: Tracked


def track(clip: Clip, learning: Learning, tasks: int, update: Callable[[int], None]) -> Both:
    """Track the first frames both ways, from SEEDS seeds."""
    video = Video(clip.video)
    camera = clip.calibration(video.size)
    plate = background(clip.background, video)
    first = Start.read(clip.init, Model()).frame
    frames = list(video.frames(first, first + FRAMES + 1))
    found = list[Tracked]()
    for learned, prior, mode in (
        (learning.literal, "paper", Mode.PAPER),
        (learning.ours, "people", Mode.DEFAULT),
    ):
        model = Model(blob_of(learned, prior))
        start = Start.read(clip.init, model)
        held, unnoticed, shown, errors = 0, 0, list[Estimate](), None
        for seed in range(1, SEEDS + 1):
            config = TrackerConfig.default(mode, particles=PARTICLES, seed=seed)
            tracker = Tracker(model, camera, config, background=plate, tasks=tasks)
            tracker.start(start.mean, start.sd, frames[0].utime)
            estimates = [tracker.step(frame.image, frame.utime) for frame in frames]
            off = _errors(clip, video, camera, first, estimates)
            stays = len(off[1]) > 0 and followed(camera, estimates, off[1], MARKED if clip.real else HELD)
            held += stays
            last = estimates[-max(1, len(estimates) // 5) :]
            unnoticed += not stays and all(e.status == TrackStatus.TRACKING for e in last)
            shown, errors = shown or estimates, errors or off
            update(len(found) * SEEDS + seed)
        assert errors is not None
        found.append(Tracked(model, shown, *errors, held, unnoticed))
    images = [frames[k].image for k in SHOWN]
    return Both(clip, camera, first, images, found[0], found[1])


def require(clip: Clip) -> None:
    """Raise UserError if a clip's files cannot be read or do not fit, or the clip is too short."""
    video = Video(clip.video)
    clip.calibration(video.size)
    start = Start.read(clip.init, Model())
    if clip.background not in ("auto", "none"):
        background(clip.background, video)
    if clip.corrections is not None:
        read_corrections(clip.corrections, SegmentPrior.load(), video.count, size=video.size)
    if video.count - start.frame <= FRAMES:
        raise UserError(
            f"{clip.video}: has {video.count - start.frame} frames from {start.frame} on, figure 6 needs "
            f"{FRAMES + 1}; give a longer clip or an earlier frame in {clip.init}"
        )


def _errors(
    clip: Clip, video: Video, camera: Camera, first: int, estimates: list[Estimate]
) -> tuple[list[int], Floats, Floats]:
    """Return frames from the start, errors there in the picture, and root-aligned ones by the truth."""
    nothing = np.zeros(0)
    if clip.truth is not None:
        at, places = clip.joints()
        rows = [at.index(first + k) for k in range(len(estimates))]
        true = np.stack([places[name] for name in EVAL15], axis=1)[rows]
        found = np.array([[e.joint(name) for name in EVAL15] for e in estimates])
        off = np.linalg.norm(camera.project(found) - camera.project(true), axis=2).mean(axis=1)
        return list(range(len(estimates))), off, root_errors(found, true)
    if clip.corrections is None:
        return [], nothing, nothing
    by_frame: dict[int, list[float]] = {}
    for mark in read_corrections(clip.corrections, SegmentPrior.load(), video.count, size=video.size):
        k = mark.frame - first
        if 0 <= k < len(estimates) and mark.joint in estimates[k].joint_names:
            uv = camera.project(estimates[k].joint(mark.joint))
            by_frame.setdefault(k, []).append(float(np.linalg.norm(uv - np.asarray(mark.uv))))
    return sorted(by_frame), np.array([np.mean(by_frame[k]) for k in sorted(by_frame)]), nothing


def entry(both: Both) -> Entry:
    """Return figure 6 with both rows of both ways."""
    literal, ours = (_words(t) for t in (both.literal, both.ours))
    verdict = "no counterpart: no marks or truth to judge by; see the pictures"
    if len(both.literal.errors):
        median = [float(np.median(t.errors)) for t in (both.literal, both.ours)]
        held = both.literal.held, both.ours.held
        verdict = verdicts.tracking(
            held, SEEDS, median[0] / median[1], (both.literal.unnoticed, both.ours.unnoticed)
        )
    what = "a real clip" if both.clip.real else "rendered, as no clip was given"
    rows = []
    for title, tracked in (("Literal", both.literal), ("Ours", both.ours)):
        caption = f"{title}: the expected body over frames 0, 10 ... 50 ({both.clip.name}, {what})."
        rows.append(Picture(caption, image(_overlays(both, tracked), "overlays")))
        rows.append(
            Picture(f"{title}: the same from another viewpoint.", image(_standing(tracked), "bodies"))
        )
    return Entry(
        "Fig. 6: tracking with 10,000 particles",
        "A person walking, frames 0 to 50: overlays and the expected configuration in 3-D. The model "
        "drifts off at frame 30, where limbs hide each other, and recovers by frame 40. Started by hand.",
        literal,
        ours,
        verdict,
        (
            "Sigma of psi, rho, tau and theta, epsilon, p_occluded, sigma(alpha), the points on a limb n_s: "
            "paper mode's, searched on simulated clips; tests/bench/results/search_paper.md has them. The "
            "search lets n_s be 4 to 16.",
            "Sigmas: per square root of a second, so that they mean the same at any frame rate; the paper's "
            "may be per frame. The rate: strides per second, its sigma in those; in the paper a speed of "
            "the phase in no stated unit.",
            "Eq. 5: lambda is the standard deviation of a score over people; at the start the scores spread "
            "by a share of it. Eq. 6: the phase advances by the rate, as the text has it; in print the rate "
            "is missing. Eq. 7: the rate is reflected into 0.4 to 2.1 seconds a stride.",
            "Eq. 8: the body goes ahead along its own heading by the rate times the mean length of a "
            "stride, which is missing in print, times the stature. Eq. 9: heading, pitch and roll each walk "
            "at random.",
            "Eq. 10: the sum's n is n_s. The pixels are points fixed on the limb that face the camera in "
            "both frames, all counting alike; the frame before is seen with the particle's own ancestor. "
            "Points that a nearer limb hides or that lie outside the image, in either frame, do not count.",
            "Grey levels: 0 to 255 of the luma of the frame, as it is, without a correction of brightness, "
            "in a picture scaled so that the person is about 192 pixels tall.",
            "Eq. 11: the mean over the points, as printed, so that a limb counts as one observation. "
            "sigma squared is 2 * 3 squared (both frames' noise, grey levels) + s squared (1 + k tan squared "
            "alpha), the tangent 3 at most.",
            "Eq. 12: alpha is the angle to the plane across the line of sight; q is its cosine times the "
            "share of the points that are seen, full at 0.8 of them; a limb of which less than half of n_s "
            "are seen in both frames counts as occluded. "
            "p_occluded is a constant.",
            "Eq. 13: logarithms, normalised over the particles. The first frame has none before it and "
            "changes no weights. Resampling: multinomial, in every frame.",
            "Expected configuration: weights that sum to 1, so without 1/N_s; the phase's and the "
            "directions' means are circular.",
            "Limb sizes and camera: the package's, and the clip's.",
            "The start: the init file of the clip, by hand as in the paper, with its standard deviations.",
            f"Both filters have a model learnt from the same walks. Shown is the first of {SEEDS} seeds.",
            "On the person: in the last fifth of the frames that can be judged the joints are, on average, "
            f"within {MARKED if both.clip.real else HELD:g} of the stature.",
        ),
        tuple(rows),
    )


def _words(tracked: Tracked) -> str:
    """Return errors and status at the frames of the figure."""
    count = sum(e.status == TrackStatus.TRACKING for e in tracked.estimates)
    words = f"status tracking in {count} of {len(tracked.estimates)} frames"
    if len(tracked.errors):
        each = ", ".join(f"{tracked.errors[i]:.0f} at {k}" for i, k in _near(tracked))
        words += f"; joints {np.median(tracked.errors):.0f} px off in the picture (median), {each}"
    if len(tracked.rooted):
        words += f"; root-aligned {np.median(tracked.rooted):.0f} mm in space (median)"
    return f"{words}."


def _near(tracked: Tracked) -> list[tuple[int, int]]:
    """Return index and frame of the errors nearest to the frames shown."""
    frames = np.array(tracked.frames)
    index = dict.fromkeys(int(np.argmin(np.abs(frames - k))) for k in SHOWN)
    return [(i, tracked.frames[i]) for i in index]


def followed(camera: Camera, estimates: Sequence[Estimate], errors: Floats, share: float) -> bool:
    """Whether the last fifth of errors in the picture (n,) is within a share of the stature."""
    mean = estimates[0].mean
    height = mean.stature * camera.fy / float(camera.depth(mean.pelvis))
    return bool(np.median(errors[-max(1, len(errors) // 5) :]) < share * height)


def _overlays(both: Both, tracked: Tracked) -> Image:
    """Draw the expected bodies over the frames, cut out about where ours has the person."""
    overlay = Overlay(tracked.model, both.camera)
    cells = []
    for picture, k in zip(both.images, SHOWN, strict=True):
        estimate, about = tracked.estimates[k], both.ours.estimates[k].mean
        canvas = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture.copy()
        drawn = overlay.figure(np.asarray(canvas, np.uint8), estimate.mean)
        side = CUT_OUT * about.stature * both.camera.fy / float(both.camera.depth(about.pelvis))
        cells.append(labelled(cut(drawn, both.camera.project(about.pelvis), side), f"frame {k}"))
    return np.asarray(np.hstack(cells))


def cut(picture: Image, middle: Floats, side: float) -> Image:
    """Cut a square of SIZE pixels out of a picture, `side` of its own."""
    scale = SIZE / side
    matrix = np.array([[scale, 0, SIZE / 2 - scale * middle[0]], [0, scale, SIZE / 2 - scale * middle[1]]])
    return np.asarray(cv2.warpAffine(picture, matrix, (SIZE, SIZE), flags=cv2.INTER_AREA), np.uint8)


def _standing(tracked: Tracked) -> Image:
    """Draw the expected bodies from in front and the left."""
    cells = []
    for k in SHOWN:
        mean = tracked.estimates[k].mean
        drawn = draw_standing(tracked.model, mean, default_view(mean))
        height, width = drawn.shape[:2]
        small = cv2.resize(drawn, (round(SIZE * width / height), SIZE), interpolation=cv2.INTER_AREA)
        cells.append(labelled(np.asarray(small, np.uint8), f"frame {k}"))
    return np.asarray(np.hstack(cells))
