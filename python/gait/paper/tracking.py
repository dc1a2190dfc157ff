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

FIGURE_FRAMES = 50  # of the paper's figure
FIGURE_SHOWN = tuple(range(0, FIGURE_FRAMES + 1, 10))
PAPER_PARTICLES = 10_000
FOLLOWED_ERROR = 0.1  # mean joint error in the picture, in statures, below which a person counts as followed
MARKED = 0.15  # the same if joints are marked by hand, which places them differently from the model
TAIL = 10  # last frames, which decide whether a person is followed to the end
CRITERION = (
    f"over the last {TAIL} frames, the median of the mean joint error in the picture is below "
    f"{FOLLOWED_ERROR:g} of the person's height from head to ankle; where joints are marked by hand, below "
    f"{MARKED:g} of the height at the start, over the frames with marks"
)
CUT_OUT = 1.35  # statures, side of a picture cut out around the person
PICTURE_PX = 250  # pixels of a picture
SEEDS = 10  # runs each way


@dataclass(frozen=True)
class Tracked:
    """Estimates of the frames from the start, and their errors."""

    model: Model
    estimates: list[Estimate]
    frames: list[int]  #: of the errors
    errors: Floats  #: (n,) mean distance from marked or true joints, pixels
    rooted: Floats  #: (n,) root-aligned distance from the true joints, mm; empty without the truth
    held: int  #: number of SEEDS runs, of which this is the first, that follow the person to the end
    unnoticed: int  #: number of the other runs with status tracking in all of the last TAIL frames


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
    frames = list(video.frames(first, first + FIGURE_FRAMES + 1))
    found = list[Tracked]()
    for learned, prior, mode in (
        (learning.literal, "paper", Mode.PAPER),
        (learning.ours, "people", Mode.DEFAULT),
    ):
        model = Model(blob_of(learned, prior))
        start = Start.read(clip.init, model)
        held, unnoticed, shown, errors = 0, 0, list[Estimate](), None
        for seed in range(1, SEEDS + 1):
            config = TrackerConfig.default(mode, particles=PAPER_PARTICLES, seed=seed)
            tracker = Tracker(model, camera, config, background=plate, tasks=tasks)
            tracker.start(start.mean, start.sd, frames[0].utime)
            estimates = [tracker.step(frame.image, frame.utime) for frame in frames]
            off = _errors(clip, video, camera, first, estimates)
            known = joints_of(estimates[:1]) if clip.real else _true(clip, first, len(estimates))
            stays = followed(_tail(*off[:2]), picture_height(camera, known), clip.real)
            held += stays
            unnoticed += not stays and all(e.status == TrackStatus.TRACKING for e in estimates[-TAIL:])
            shown, errors = shown or estimates, errors or off
            update(len(found) * SEEDS + seed)
        assert errors is not None
        found.append(Tracked(model, shown, *errors, held, unnoticed))
    images = [frames[k].image for k in FIGURE_SHOWN]
    return Both(clip, camera, first, images, found[0], found[1])


def checks(clip: Clip) -> list[Callable[[], object]]:
    """Return checks that raise UserError if a clip is too short, or a file of it is unreadable or unfit."""

    def long_enough() -> None:
        count, first = Video(clip.video).count, Start.read(clip.init, Model()).frame
        if count - first <= FIGURE_FRAMES:
            raise UserError(
                f"{clip.video}: has {count - first} frames from {first} on, figure 6 needs "
                f"{FIGURE_FRAMES + 1}; give a longer clip or an earlier frame in {clip.init}"
            )

    def corrections() -> None:
        if clip.corrections is not None:
            video = Video(clip.video)
            read_corrections(clip.corrections, SegmentPrior.load(), video.count, size=video.size)

    def plate() -> None:
        if clip.background not in ("auto", "none"):
            background(clip.background, Video(clip.video))

    return [
        lambda: clip.calibration(None),
        lambda: clip.calibration(Video(clip.video).size),
        long_enough,
        plate,
        corrections,
    ]


def _errors(
    clip: Clip, video: Video, camera: Camera, first: int, estimates: list[Estimate]
) -> tuple[list[int], Floats, Floats]:
    """Return frames counted from the start, errors there in the picture, and root-aligned errors."""
    nothing = np.zeros(0)
    if clip.truth is not None:
        true, found = _true(clip, first, len(estimates)), joints_of(estimates)
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


def _true(clip: Clip, first: int, count: int) -> Floats:
    """Return the true joints EVAL15 (count, 15, 3), starting at a frame."""
    at, places = clip.joints()
    rows = [at.index(first + k) for k in range(count)]
    return np.asarray(np.stack([places[name] for name in EVAL15], axis=1)[rows])


def entry(both: Both) -> Entry:
    """Return figure 6: two rows of pictures for each filter."""
    literal, ours = (_words(t) for t in (both.literal, both.ours))
    verdict = f"no counterpart: no marks or truth in the last {TAIL} frames to judge by; see the pictures"
    if len(_tail(both.literal.frames, both.literal.errors)):
        median = [float(np.median(t.errors)) for t in (both.literal, both.ours)]
        held = both.literal.held, both.ours.held
        verdict = verdicts.tracking(
            held, SEEDS, median[0] / median[1], (both.literal.unnoticed, both.ours.unnoticed)
        )
    what = "a real clip" if both.clip.real else "rendered, as no clip was given"
    rows = []
    for title, tracked in (("Literal", both.literal), ("Ours", both.ours)):
        caption = f"{title}: the expected body drawn over frames 0, 10 ... 50 ({both.clip.name}, {what})."
        rows.append(Picture(caption, image(_overlays(both, tracked), "overlays")))
        rows.append(
            Picture(f"{title}: the same from another viewpoint.", image(_standing(tracked), "bodies"))
        )
    return Entry(
        "Fig. 6: tracking with 10,000 particles",
        "A walking person in frames 0 to 50: overlays and the expected configuration in 3-D, started by "
        "hand. The model drifts off at frame 30, where limbs hide each other, and recovers by frame 40.",
        literal,
        ours,
        verdict,
        (
            "The sigmas of psi, rho, tau and theta, epsilon, p_occluded, sigma(alpha) and n_s, the number of "
            "points on a limb, are those of paper mode. They were searched on simulated clips, n_s from 4 to "
            "16: tests/bench/results/search_paper.md.",
            "Sigmas are per square root of a second, so that they do not depend on the frame rate; the "
            "paper's may be per frame. The rate is in strides per second; in the paper it is a speed of the "
            "phase, without a unit.",
            "Eq. 5: lambda is the standard deviation of a score over people; the initial standard deviation "
            "is a fraction of it. Eq. 6: the phase advances by the rate, as in the text; it is missing in "
            "print. Eq. 7: the rate is reflected so that a stride takes 0.4 to 2.1 seconds.",
            "Eq. 8: the body moves along its own heading by the rate times the mean stride length (missing "
            "in print) times the stature. Eq. 9: heading, pitch and roll are independent random walks.",
            "Eq. 10: the n of the sum is n_s. The pixels are fixed points on the limb that face the camera "
            "in both frames, with equal weight; their place in the frame before is that of the particle's "
            "own ancestor. Points that are outside the image or hidden by a nearer limb in either frame are "
            "not used.",
            "Grey levels: the luma of the frame, 0 to 255, without brightness correction, in an image scaled "
            "so that the person is about 192 pixels tall.",
            "Eq. 11: the mean over the points, as printed, so that a limb counts as one observation. sigma "
            "squared is 2 * 3 squared (noise of both frames, grey levels) + s squared (1 + k tan squared "
            "alpha), where the tangent is limited to 3.",
            "Eq. 12: alpha is the angle between the limb and the plane across the line of sight; q is its "
            "cosine times the share of points that are visible, divided by 0.8 and at most 1. A limb with "
            "less than half of its n_s points visible in both frames counts as occluded. p_occluded is a "
            "constant.",
            "Eq. 13 is computed with logarithms, normalised over the particles. The first frame has no frame "
            "before it and does not change the weights. Resampling is multinomial, in every frame.",
            "Expected configuration: the weights sum to 1, so there is no 1/N_s; the means of phase and "
            "angles are circular.",
            "Limb sizes are the package's; the camera is the clip's.",
            "The start is the init file of the clip with its standard deviations, set by hand as in the "
            "paper.",
            f"Both filters use models learnt from the same walks. The first of {SEEDS} seeds is shown.",
            f"On the person: {CRITERION}.",
        ),
        tuple(rows),
    )


def _words(tracked: Tracked) -> str:
    """Return errors and status at the frames of the figure."""
    count = sum(e.status == TrackStatus.TRACKING for e in tracked.estimates)
    words = f"status tracking in {count} of {len(tracked.estimates)} frames"
    if len(tracked.errors):
        each = ", ".join(f"{tracked.errors[i]:.0f} at {k}" for i, k in _near(tracked))
        words += f"; joint error in the picture {np.median(tracked.errors):.0f} px (median), {each}"
    if len(tracked.rooted):
        words += f"; root-aligned error in space {np.median(tracked.rooted):.0f} mm (median)"
    return f"{words}."


def _near(tracked: Tracked) -> list[tuple[int, int]]:
    """Return index and frame of the errors nearest to the frames shown."""
    frames = np.array(tracked.frames)
    index = dict.fromkeys(int(np.argmin(np.abs(frames - k))) for k in FIGURE_SHOWN)
    return [(i, tracked.frames[i]) for i in index]


def joints_of(estimates: Sequence[Estimate]) -> Floats:
    """Return the joints EVAL15 (n, 15, 3) of estimates."""
    return np.array([[e.joint(name) for name in EVAL15] for e in estimates])


def picture_height(camera: Camera, joints: Floats) -> float:
    """Return the height from head to ankle in the picture of joints EVAL15 (n, 15, 3), pixels, median."""
    ends = camera.project(joints[:, [EVAL15.index("head_top"), EVAL15.index("l_ankle")]])
    return float(np.median(np.abs(np.diff(ends[..., 1], axis=1))))


def _tail(frames: list[int], errors: Floats) -> Floats:
    """Return the errors of the last TAIL frames."""
    return errors[np.array(frames, int) > FIGURE_FRAMES - TAIL]


def followed(tail: Floats, height: float, marked: bool) -> bool:
    """Whether a person is followed to the end: the criterion of the page and of the benches.

    tail : (n,) mean joint error in the picture, pixels, in those of the last TAIL frames where it is known.
    marked : whether the joints are marked by hand.
    """
    return len(tail) > 0 and bool(np.median(tail) < (MARKED if marked else FOLLOWED_ERROR) * height)


def _overlays(both: Both, tracked: Tracked) -> Image:
    """Draw the expected bodies over the frames, cut out around our estimate of the person."""
    overlay = Overlay(tracked.model, both.camera)
    cells = []
    for picture, k in zip(both.images, FIGURE_SHOWN, strict=True):
        estimate, about = tracked.estimates[k], both.ours.estimates[k].mean
        canvas = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture.copy()
        drawn = overlay.figure(np.asarray(canvas, np.uint8), estimate.mean)
        side = CUT_OUT * about.stature * both.camera.fy / float(both.camera.depth(about.pelvis))
        cells.append(labelled(cut(drawn, both.camera.project(about.pelvis), side), f"frame {k}"))
    return np.asarray(np.hstack(cells))


def cut(picture: Image, middle: Floats, side: float) -> Image:
    """Cut a square of `side` pixels out of a picture and scale it to PICTURE_PX pixels."""
    scale = PICTURE_PX / side
    matrix = np.array(
        [[scale, 0, PICTURE_PX / 2 - scale * middle[0]], [0, scale, PICTURE_PX / 2 - scale * middle[1]]]
    )
    return np.asarray(
        cv2.warpAffine(picture, matrix, (PICTURE_PX, PICTURE_PX), flags=cv2.INTER_AREA), np.uint8
    )


def _standing(tracked: Tracked) -> Image:
    """Draw the expected bodies, seen from the front left."""
    cells = []
    for k in FIGURE_SHOWN:
        mean = tracked.estimates[k].mean
        drawn = draw_standing(tracked.model, mean, default_view(mean))
        height, width = drawn.shape[:2]
        small = cv2.resize(
            drawn, (round(PICTURE_PX * width / height), PICTURE_PX), interpolation=cv2.INTER_AREA
        )
        cells.append(labelled(np.asarray(small, np.uint8), f"frame {k}"))
    return np.asarray(np.hstack(cells))
