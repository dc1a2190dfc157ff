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
TAIL = 10  # last frames, by which it is judged whether a person is followed to the end
CRITERION = (
    f"in the last {TAIL} frames (median of those that can be judged) the joints are, on average, within "
    f"{HELD:g} of the person's height in the picture from head to ankle; within {MARKED:g} where they are "
    "marked by hand, and the height is then that at the start"
)
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
            known = joints_of(estimates[:1]) if clip.real else _true(clip, first, len(estimates))
            stays = followed(_tail(*off[:2]), picture_height(camera, known), clip.real)
            held += stays
            unnoticed += not stays and all(e.status == TrackStatus.TRACKING for e in estimates[-TAIL:])
            shown, errors = shown or estimates, errors or off
            update(len(found) * SEEDS + seed)
        assert errors is not None
        found.append(Tracked(model, shown, *errors, held, unnoticed))
    images = [frames[k].image for k in SHOWN]
    return Both(clip, camera, first, images, found[0], found[1])


def checks(clip: Clip) -> list[Callable[[], object]]:
    """Return what raises UserError if a file of a clip cannot be read or does not fit, or it is too short."""

    def long_enough() -> None:
        count, first = Video(clip.video).count, Start.read(clip.init, Model()).frame
        if count - first <= FRAMES:
            raise UserError(
                f"{clip.video}: has {count - first} frames from {first} on, figure 6 needs "
                f"{FRAMES + 1}; give a longer clip or an earlier frame in {clip.init}"
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
    """Return frames from the start, errors there in the picture, and root-aligned ones by the truth."""
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
    """Return the true joints EVAL15 (count, 15, 3) from a frame on."""
    at, places = clip.joints()
    rows = [at.index(first + k) for k in range(count)]
    return np.asarray(np.stack([places[name] for name in EVAL15], axis=1)[rows])


def entry(both: Both) -> Entry:
    """Return figure 6 with both rows of both ways."""
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
        words += f"; joints {np.median(tracked.errors):.0f} px off in the picture (median), {each}"
    if len(tracked.rooted):
        words += f"; root-aligned {np.median(tracked.rooted):.0f} mm in space (median)"
    return f"{words}."


def _near(tracked: Tracked) -> list[tuple[int, int]]:
    """Return index and frame of the errors nearest to the frames shown."""
    frames = np.array(tracked.frames)
    index = dict.fromkeys(int(np.argmin(np.abs(frames - k))) for k in SHOWN)
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
    return errors[np.array(frames, int) > FRAMES - TAIL]


def followed(tail: Floats, height: float, marked: bool) -> bool:
    """Whether a person is followed to the end: the one criterion of the page and of the benches.

    tail : (n,) mean distance of the joints in the picture, in each of the last TAIL frames for which it is
        known, pixels; its median decides.
    marked : whether the joints are marked by hand.
    """
    return len(tail) > 0 and bool(np.median(tail) < (MARKED if marked else HELD) * height)


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
