"""Figure 7 of Leventon and Freeman (1998): a real sequence from sensors, clicks and the prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS, axis_rotation
from gait.io.video import Image, Video
from gait.learn.arrays import Floats, Indices
from gait.learn.segments.corpus import Recorded
from gait.lift.video.energy import EXTRA
from gait.lift.video.figure import draw_figure
from gait.lift.video.placement import read_placement
from gait.lift.video.run import LiftedVideo, Request, lift_video
from gait.lift.video.sensors import FlatView
from gait.motion.evaluate import root_errors
from gait.paper import leventon, verdicts
from gait.paper.clip import CHECK_INTERVAL, Clip
from gait.paper.entry import Entry, Picture, picture
from gait.paper.pictures import image, labelled
from gait.paper.tracking import FOLLOWED_ERROR
from gait.report.colours import BLUE, ORANGE
from gait.report.drawing import draw_bones
from gait.report.figures import Drawing, grid

LIFTED_FRAMES = 100
SHOWN_COUNT = 6
TURN_ANGLE = np.radians(30.0)
PICTURE_PX = 250  # pixels of a picture
CUT_OUT = 1.35  # statures, side of a picture
PAPER_COLOUR = (248, 247, 246)


@dataclass(frozen=True)
class Both:
    """The clip lifted by the paper's prior, one segment after the other, and by the package."""

    clip: Clip
    literal: LiftedVideo
    ours: LiftedVideo
    clicks: int  #: used
    left_out: tuple[dict[str, Any], ...]  #: clicks that were not used, as a corrections file has them

    def missed(self, lifted: LiftedVideo) -> Floats:
        """Distances (n,) in pixels of an estimate from the clicks that were left out."""
        rows = {int(frame): k for k, frame in enumerate(lifted.fit.frame)}
        prior, view = lifted.clip.prior, lifted.clip.view
        off = [
            view.project(lifted.fit.places[rows[c["frame"]], prior.index([c["joint"]])])[0][0] - c["uv"]
            for c in self.left_out
            if c["frame"] in rows
        ]
        return np.linalg.norm(np.reshape(off, (-1, 2)), axis=1)


def lift(clip: Clip, motions: Sequence[Recorded], folder: Path, quiet: bool) -> Both:
    """Lift the first frames of a clip both ways; `folder` is for files in between."""
    prior = SegmentPrior.load()
    video = Video(clip.video)
    calibrated = clip.calibration(video.size)
    placement = read_placement(clip.init, prior, calibrated is not None)
    stop = min(placement.frame + LIFTED_FRAMES, video.count)
    clicks, left_out = clip.clicks_within(range(placement.frame, stop), folder)
    turned = np.concatenate([leventon.cut(m, heading=placement.heading) for m in motions])
    literal = leventon.prior_of(leventon.learn(turned), prior.stature)

    def lifted(used: SegmentPrior, init: str, joined: bool) -> LiftedVideo:
        request = Request(
            clip.video,
            init,
            camera=clip.camera,
            scale_camera=clip.scale_camera,
            corrections=clicks,
            background=clip.background,
            start=placement.frame,
            stop=stop,
            joined=joined,
        )
        return lift_video(request, used, lambda line: None, quiet)

    by_paper = lifted(literal, clip.without_phase(folder), joined=False)
    by_ours = lifted(prior, clip.init, joined=True)
    return Both(clip, by_paper, by_ours, len(by_ours.clip.corrections), tuple(left_out))


def entry(both: Both) -> Entry:
    """Return figure 7."""
    energies = [energy_by_part(lifted) for lifted in (both.literal, both.ours)]
    drawing = Drawing("", "energy", "Energy of eq. 7 by part, segment after segment.", _energy(energies))
    rows = [picture(drawing)]
    for title, lifted in (("Literal", both.literal), ("Ours", both.ours)):
        rows.append(
            Picture(
                f"{title}: the stick figure over the frames; below, the 37 markers and the cylinder figure, "
                "seen from 30 degrees to the side.",
                image(_film(both, lifted), "frames"),
            )
        )
    frames = len(both.ours.fit.frame)
    each = both.clicks / frames
    errors = [_error(both, lifted) for lifted in (both.literal, both.ours)]
    what = "a real clip" if both.clip.real else "a rendered clip, as none was given"
    return Entry(
        "Fig. 7: a sequence of 100 frames",
        "A dancer in 100 frames with about one click per frame: overlays, markers, and a cylinder figure "
        "seen from 30 degrees to the side. 10 by 8 sensors.",
        f"{frames} frames of {what}, {each:.1f} clicks per frame, {len(both.literal.clip.starts)} segments "
        f"one after the other: {errors[0]}; correlation between sensors and figure "
        f"{both.literal.fit.fit_correlation:.2f}.",
        f"The same clicks, segments solved together: {errors[1]}; correlation "
        f"{both.ours.fit.fit_correlation:.2f}.",
        _verdict(both),
        (
            "The sensors' filter (gradients over local contrast, blurred) and the weights lambda are found "
            "from the clip, as in gait lift.",
            "Eq. 7 is minimised by Levenberg-Marquardt with exact derivatives. The first segment starts from "
            "the mean of the prior and from 1.5 sd to either side of it along its first 3 modes; later ones "
            "start from the prediction of the segment before and, with clicks, also from the clicks alone. "
            "The lowest minimum is used.",
            "The prior has 20 frames per second, which are interpolated at the frames of the clip. The "
            "motion is that of the clip, mostly walking; the paper's is a dance.",
            "10 by 8 sensors are 10 rows of 8, as a standing person is tall. They follow the person.",
            "The training motions are turned to the heading of the placement, and by 90 degrees from it.",
            "The camera is calibrated and the floor is known; the paper has an orthographic view.",
            "At the start, position, heading and stature are given by hand.",
            f"Every {CHECK_INTERVAL}th click is left out, to judge the result. The person counts as followed "
            "if the error there is below a tenth of the stature in the picture.",
            "The clicks are the joints marked in the clip's corrections." if both.clip.real
            else "The clicks: one joint per frame, with an error of 3 pixels.",
        ),
        tuple(rows),
    )  # fmt: skip


def _verdict(both: Both) -> str:
    off = [both.missed(lifted) for lifted in (both.literal, both.ours)]
    if not len(off[0]):
        return "no counterpart: no clicks to judge by; see the pictures"
    height = both.ours.clip.placement.stature * _pixels(both.ours)
    return verdicts.sequence([float(np.median(each)) for each in off], height, FOLLOWED_ERROR)


def _pixels(lifted: LiftedVideo) -> float:
    """Return the pixels per metre, the median over the frames."""
    clip = lifted.clip
    return float(np.median([clip.view.scale(body.mean(axis=0)) for body in lifted.fit.places]))


def _error(both: Both, lifted: LiftedVideo) -> str:
    """Return the errors of an estimate in words."""
    words = ""
    if len(off := both.missed(lifted)):
        words = f"median error {np.median(off):.0f} px at {len(off)} clicks that were left out"
    if both.clip.truth is not None:
        at, places = both.clip.joints()
        rows = [at.index(k) for k in lifted.fit.frame.tolist()]
        true = np.stack([places[name] for name in EVAL15], axis=1)[rows]
        off = root_errors(lifted.fit.places[:, lifted.clip.prior.index(EVAL15)], true)
        words += f"{', ' if words else ''}median root-aligned error {np.median(off):.0f} mm"
    return words or "no clicks"


def energy_by_part(lifted: LiftedVideo) -> Floats:
    """Return the energy (B, 3) of each segment: squared residuals of sensors, prior (sd) and clicks (sd)."""
    clip, found = lifted.clip, lifted.fit.sequence
    rows = []
    for b, (component, state) in enumerate(zip(found.components.tolist(), found.states, strict=True)):
        energy = clip.energy(b, component, state)
        prior = ((state - energy.mean) / energy.sd)[:-EXTRA]
        rows.append([
            float(np.sum(energy.residuals(state) ** 2)),
            float(prior @ prior),
            float(np.sum(energy.correction_rows(state)[0] ** 2)),
        ])  # fmt: skip
    return np.array(rows)


def _energy(energies: Sequence[Floats]) -> Figure:
    figure, panels = grid(1, 3, 10, 2.8)
    names = ("sensors: |R - f|²", "prior: α' Λ⁻¹ α", "clicks: squared sd")
    for k, (axes, name) in enumerate(zip(panels, names, strict=True)):
        for energy, colour, words in zip(energies, (ORANGE, BLUE), ("literal", "ours"), strict=True):
            axes.plot(np.arange(1, len(energy) + 1), energy[:, k], "o-", ms=3, color=colour, label=words)
        axes.set(xlabel="segment", ylim=(0, None))
        axes.set_title(name, fontsize=10)
    panels[0].legend(fontsize=8, frameon=False)
    return figure


def _film(both: Both, lifted: LiftedVideo) -> Image:
    """Draw overlays, markers and cylinder figures of some frames, one row each."""
    clip, fit = lifted.clip, lifted.fit
    picked = np.linspace(0, len(fit.frame) - 1, SHOWN_COUNT).round().astype(int)
    surfaces, joints = lifted.figure.surfaces(), lifted.figure.joints()
    markers = clip.prior.index(JOINTS)
    frames = {f.number: f.image for f in lifted.video.pick(fit.frame[picked].tolist())}
    rows: list[list[Image]] = [[], [], []]
    for k in picked.tolist():
        number = int(fit.frame[k])
        rows[0].append(labelled(_overlay(lifted, frames[number], k, markers), f"frame {number}"))
        turn = _turned(lifted, k)
        middle = fit.places[k].mean(axis=0)
        rows[1].append(_dots((fit.places[k] - middle) @ turn.T, clip.placement.stature))
        rows[2].append(_cylinders((surfaces[k] - middle) @ turn.T, (joints[k] - middle) @ turn.T,
                                  clip.placement.stature))  # fmt: skip
    return np.asarray(np.vstack([np.hstack(row) for row in rows]))


def _overlay(lifted: LiftedVideo, picture: Image, k: int, markers: Indices) -> Image:
    """Draw the stick figure over a frame, cut out about the person."""
    view, body = lifted.clip.view, lifted.fit.places[k]
    grey = picture.ndim == 2
    canvas = np.array(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if grey else picture, np.uint8)
    uv = dict(zip(JOINTS, view.project(body[markers])[0], strict=True))
    scale = view.scale(body.mean(axis=0))
    width = max(2, round(0.012 * scale))
    draw_bones(canvas, uv, width + 2, (30, 30, 30))
    draw_bones(canvas, uv, width)
    for correction in lifted.clip.corrections:
        if correction.frame == int(lifted.fit.frame[k]):
            at = np.rint(correction.uv).astype(int).tolist()
            cv2.circle(canvas, at, 3 * width, (90, 240, 255), width, cv2.LINE_AA)
    middle = view.project(body.mean(axis=0)[None])[0][0]
    zoom = PICTURE_PX / (CUT_OUT * lifted.clip.placement.stature * scale)
    matrix = np.array(
        [[zoom, 0, PICTURE_PX / 2 - zoom * middle[0]], [0, zoom, PICTURE_PX / 2 - zoom * middle[1]]]
    )
    return np.asarray(
        cv2.warpAffine(canvas, matrix, (PICTURE_PX, PICTURE_PX), flags=cv2.INTER_AREA), np.uint8
    )


def _turned(lifted: LiftedVideo, k: int) -> Floats:
    """Return the axes (3, 3) of a level view from 30 degrees beside the camera: right, away, up."""
    away = lifted.clip.view.away(lifted.fit.places[k].mean(axis=0)) * (1, 1, 0)
    away = axis_rotation(2, TURN_ANGLE) @ (away / np.linalg.norm(away))
    return np.stack([np.cross(away, [0.0, 0.0, 1.0]), away, [0.0, 0.0, 1.0]])


def _blank() -> Image:
    return np.full((PICTURE_PX, PICTURE_PX, 3), PAPER_COLOUR, np.uint8)


def _dots(body: Floats, stature: float) -> Image:
    """Draw markers (J, 3) in the axes of a view."""
    canvas = _blank()
    zoom = PICTURE_PX / (CUT_OUT * stature)
    for x, _, z in body[np.argsort(-body[:, 1])]:
        at = round(PICTURE_PX / 2 + zoom * x), round(PICTURE_PX / 2 - zoom * z)
        cv2.circle(canvas, at, 3, (40, 40, 40), -1, cv2.LINE_AA)
    return canvas


def _cylinders(surfaces: Floats, joints: Floats, stature: float) -> Image:
    """Draw the cylinder figure in the axes of a view."""
    view = FlatView(PICTURE_PX / (CUT_OUT * stature), (PICTURE_PX / 2, PICTURE_PX / 2))
    return draw_figure(_blank(), view, surfaces, joints)
