"""Figures 1 to 5 of Ormoneit and others (2000), and the components."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from gait.bindings.model import Model
from gait.bindings.state import State
from gait.body.skeleton import ANGLES, PAPER_ANGLES, default_skeleton, frames
from gait.io import blob
from gait.io.video import Image
from gait.learn.arrays import Floats
from gait.learn.cycles.align import TABLE
from gait.learn.options import PAPER_COMPONENTS, LearnOptions
from gait.learn.prior import model as model_sections
from gait.learn.prior.fit import Learned
from gait.learn.report import figures as learn_figures
from gait.learn.report import figures_model
from gait.paper import ormoneit, verdicts
from gait.paper.entry import Entry, Picture, picture
from gait.paper.moving import Moving, strip
from gait.paper.ormoneit import Aligned, Learning
from gait.report.colours import BLUE, DARK, GREY, ORANGE
from gait.report.drawing import default_view, draw_standing
from gait.report.figures import Drawing, address, grid

NOTED = (
    "neck_z",
    "l_shoulder_flexion",
    "l_elbow_flexion",
    "l_hip_flexion",
    "l_hip_abduction",
    "l_knee_flexion",
)
SHOWN_ANGLES = ("l_hip_flexion", "l_knee_flexion")  # of figures 3 and 4
COURSES = "Error after each pass, relative to the last."
REPEATED = (
    "The walks before and after, each repeated over two cycles, with one colour per walk. Black: the fitted "
    "periodic spline."
)
MODE_SDS = 2.0  # standard deviations
CURVES = f"The paper's components as curves: mean and {MODE_SDS:g} sd."
AXIS = 0.10  # metres
AXIS_COLOURS = {0: (60, 60, 220), 1: (70, 160, 60), 2: (220, 120, 40)}  # BGR of x, y, z
JOINTED = {"head": 3, "upper_arm": 3, "forearm": 1, "thigh": 3, "shank": 1}  # angles of a joint by its frame
MOVING_PHASES = 24  # of moving figures
STIFF = 1e-6  # radians over a cycle, below which an angle does not move
NOISE_FLAT = 0.25  # change of the ratio of white noise below which it is flat


def entries(learning: Learning) -> Iterator[Entry]:
    """Yield the entries in the paper's order."""
    yield _body(learning.literal)
    yield _periods(learning)
    yield _offsets(learning)
    yield _passes(learning)
    yield _components(learning)


def blob_of(learned: Learned, prior: str) -> bytes:
    """Return a model as a blob."""
    return blob.encode(model_sections.sections(learned, LearnOptions(prior=prior)))


def _body(literal: Learned) -> Entry:
    model = Model(blob_of(literal, "paper"))
    image = _articulated(model, literal)
    ok, data = cv2.imencode(".png", image)
    assert ok
    turning = np.ptp(literal.curves[:, :, : len(ANGLES)], axis=1).max(axis=0) > STIFF
    moving = [name for name, moves in zip(ANGLES, turning, strict=True) if moves]
    picture = Picture(
        "The limbs are tapered cylinders. Each joint is shown with its axes (x red, y green, z blue along "
        "the limb) and the number of its relative angles.",
        f'<img style="max-width: 60%" alt="body" src="{address(data.tobytes())}">',
    )
    return Entry(
        "Fig. 1: the body",
        "Articulated cylinders: 25 degrees of freedom, 19 relative angles, 3 of translation and 3 of "
        "rotation.",
        f"{len(moving)} relative angles move, + 3 + 3"
        + ("; trunk and ankles are rigid." if set(moving) <= set(PAPER_ANGLES) else "."),
        f"{len(ANGLES)} relative angles (trunk 3 and ankles 2 more) + 3 + 3.",
        verdicts.body(len(moving)),
        (
            "Which 19 angles: neck 3, shoulders 3 each, elbows 1 each, hips 3 each, knees 1 each.",
            "Order and signs of the three angles of a joint: flexion, abduction, rotation about the limb, in "
            "the frame of the limb above; mirrored on the left.",
            "Limb sizes and shapes are the package's, tapered and elliptic. Trunk and ankles have their mean "
            "angles.",
        ),
        (picture,),
    )


def _articulated(model: Model, literal: Learned) -> Image:
    """Draw the mean body at mid-stance with the axes of its joints."""
    state = State(phase=0.3, stride_hz=model.info.stride_hz, coef=np.zeros(model.info.components))
    state.pelvis[2] = model.pelvis_height(state)
    camera = default_view(state)
    image = draw_standing(model, state, camera)
    skeleton = default_skeleton(literal.proportions)
    cycle = literal.curves[0]
    rotations, origins, _ = frames(skeleton.sections(), cycle[[round(state.phase * len(cycle))]])
    for name, turn, origin in zip(skeleton.frames, rotations[0], origins[0], strict=True):
        count = next((n for part, n in JOINTED.items() if name.endswith(part)), 0)
        if not count and name != "pelvis":
            continue
        at = state.pelvis + state.stature * origin
        ends = at + AXIS * turn.T
        start, *tips = np.rint(camera.project(np.vstack([at, ends]))).astype(int).tolist()
        for axis, tip in enumerate(tips):
            cv2.arrowedLine(image, start, tip, AXIS_COLOURS[axis], 2, cv2.LINE_AA, tipLength=0.25)
        words = str(count) if count else "6"
        aside, down = (10, 20) if name.startswith("l_") else (-22, 4) if count else (-5, 24)
        place = start[0] + aside, start[1] + down
        cv2.putText(image, words, place, cv2.FONT_HERSHEY_DUPLEX, 0.5, (20, 20, 20), 1, cv2.LINE_AA)
    return image


def _periods(learning: Learning) -> Entry:
    shown = learning.shown
    refined = learning.refined(shown).period
    mean, rise = ormoneit.noise_row(shown)
    flat = abs(rise) < NOISE_FLAT
    long_literal, long_refined = learning.long
    total, same = len(learning.walks), learning.agreeing
    off = np.array(
        [abs(w.period.frames - learning.refined(w).period.frames) for w in learning.literal.sequences]
    )
    return Entry(
        "Fig. 2: length of the cycle",
        "The ratio of each angle for periods of 50 to 250 frames. That of white noise is flat; the sum has "
        "its peak at 126 frames (898.65).",
        f"{shown.name}: {shown.period.frames:.0f} frames, sum {shown.period.peak:.0f}; white noise "
        f"{mean:.2f} on average, changing by {rise:+.2f} over the range. The cycle is found in {same} of "
        f"{total} walks. In a walk of {ormoneit.LONG_FRAMES} frames with a cycle of {ormoneit.LONG_PERIOD} "
        f"frames it finds {long_literal:.0f}.",
        f"{shown.name}: {refined.frames:.2f} frames; the median difference from whole frames is "
        f"{np.median(off):.2f}. Found in all {total} walks; in the long walk {long_refined:.2f}.",
        verdicts.periods(flat, same / total, total - same, abs(long_literal - ormoneit.LONG_PERIOD) > 1),
        (
            "Eq. 1 as printed gives the number of the cycle; here it folds modulo p, as in the text.",
            "The frame rate is 120 frames per second, at which 126 frames are a usual stride.",
            "The ratio is the F statistic of an analysis of variance. With missing data, groups are weighted "
            "by their size.",
            "The peak grows with the length of the recording, so 898.65 is not a target.",
            "The paper has eight sequences of four people, and n = 20; here all walks given are used.",
            "The paper marks a missing angle by zero. Zero is also an angle, so gaps are marked separately "
            "here.",
        ),
        (
            picture(Drawing("", "ratio", learn_figures.SNR, learn_figures.ratios(shown, len(PAPER_ANGLES)))),
        ),
    )  # fmt: skip


def _offsets(learning: Learning) -> Entry:
    literal, ours = learning.eight, learning.eight_ours
    passes, errors = len(literal.found.objective), np.degrees(1) ** 2 * np.array(literal.found.objective)
    apart = np.angle(np.exp(2j * np.pi * (literal.phases - ours.phases))) / (2 * np.pi)
    falling = bool(np.all(np.diff(errors) <= 1e-9 * errors[0]))
    return Entry(
        "Figs. 3 and 4: offsets of the sequences",
        "Eight walking sequences. Starting from zero offsets, a periodic spline and the offsets are fitted "
        "in turn; after five passes the error (6.2536e+04) changes by less than 1e-6.",
        f"{len(literal.walks)} walks of {len({w.subject for w in literal.walks})} people; {passes} passes, "
        f"error {errors[0]:.3g} to {errors[-1]:.3g} square degrees, "
        f"{'falling throughout' if falling else 'not falling'}.",
        f"{len(ours.found.objective)} passes, starting from circular correlation and weighting angles by "
        f"their noise. Offsets differ by {100 * np.median(np.abs(apart)):.1f} % of a cycle (median), at most "
        f"{100 * np.abs(apart).max():.1f} %.",
        verdicts.offsets(falling, float(np.abs(apart).max())),
        (
            "The spline: periodic, cubic, 20 uniform knots.",
            "The change of 1e-6 is taken relative to the error; at most 100 passes.",
            "All angles are weighted equally in square degrees, so the knees dominate. Offsets are found to "
            "0.01 frame; the paper tries whole frames.",
            "A common shift of all offsets has no effect on the error. The hips determine it, so that both "
            "results can be compared.",
        ),
        (
            picture(Drawing("", "passes", COURSES, _courses(learning))),
            picture(Drawing("", "aligned", REPEATED, _repeated(literal))),
        ),
    )  # fmt: skip


def _courses(learning: Learning) -> Figure:
    figure, (axes,) = grid(1, 1, 6, 2.8)
    for aligned, colour, name in (
        (learning.eight, ORANGE, "literal: from 0, equal weights"),
        (learning.eight_ours, BLUE, "ours: from correlation, weighted"),
    ):
        course = np.array(aligned.found.objective)
        axes.plot(np.arange(1, len(course) + 1), course / course[-1], "o-", ms=4, color=colour, label=name)
    axes.set(xlabel="pass", ylabel="error / its last")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.legend(fontsize=8, frameon=False)
    return figure


def _repeated(aligned: Aligned) -> Figure:
    """Draw walks on two cycles with offsets 0 and with those found, and the spline."""
    figure, panels = grid(len(SHOWN_ANGLES), 2, 9, 4.6, sharex=True, sharey="row")
    curve = aligned.curve()
    for row, name in enumerate(SHOWN_ANGLES):
        k = PAPER_ANGLES.index(name)
        for axes, after in zip(panels[2 * row : 2 * row + 2], (False, True), strict=True):
            for i, walk in enumerate(aligned.walks):
                start = aligned.phases[i] if after else 0.0
                phase = np.arange(len(walk.channels)) / walk.period.frames - start
                phase -= np.floor(phase[0])
                values = np.degrees(walk.channels[:, k])
                for turn in range(-4, 3):
                    axes.plot(phase + turn, values, color=f"C{i}", lw=0.6, alpha=0.7)
            if after:
                axes.plot(np.arange(2 * TABLE) / TABLE, np.tile(curve[:, k], 2), color="k", lw=2)
            axes.set(xlim=(0, 2))
        panels[2 * row].set_ylabel(f"{figures_model.words(name)}\ndegrees", fontsize=9)
    panels[0].set_title("before", fontsize=10)
    panels[1].set_title("after", fontsize=10)
    for axes in panels[-2:]:
        axes.set_xlabel("cycles")
    return figure


def _passes(learning: Learning) -> Entry:
    literal, removal = learning.literal, learning.removal
    errors = np.degrees(literal.components.rmse)
    missing = 100 * float(1 - literal.cycles.mask[:, :, : ormoneit.PAPER_ANGLE_COUNT].mean())
    falling = bool(np.all(np.diff(errors) <= 1e-9) and np.all(np.diff(removal.passes) <= 1e-9))
    figure, panels = grid(1, 2, 9, 2.9)
    for axes, course, title in (
        (panels[0], errors, f"as recorded, {missing:.0f} % missing"),
        (panels[1], removal.passes, f"with {100 * removal.share:.0f} % removed"),
    ):
        axes.semilogx(np.arange(1, len(course) + 1), course, "o-", ms=3, color=ORANGE)
        axes.set(xlabel="pass", ylabel="error on observed entries, degrees")
        axes.set_title(title, fontsize=10)
    return Entry(
        "Fig. 5: missing data by the iterated SVD",
        "Cycles are cut and resampled. Missing entries are replaced from the mean and SVD of the first 20 "
        "Fourier coefficients until the error falls by less than 1e-6.",
        f"{len(literal.cycles.values)} cycles, {missing:.0f} % of the entries missing: {len(errors)} "
        f"passes, {errors[0]:.3f} to {errors[-1]:.3f} degrees. With {100 * removal.share:.0f} % removed in "
        f"blocks, the error there is {removal.literal:.1f} degrees ({removal.mean:.1f} with the mean of the "
        "column).",
        f"Variational Bayes with as many components: error {removal.ours:.1f} degrees in the same blocks.",
        verdicts.passes(falling, removal.literal, removal.mean),
        (
            "The 20 coefficients are complex, 0 to 19. They are computed in a real orthonormal basis of 39 "
            "functions, so that distances are those of the curves.",
            "The mean is also in this basis (as printed it is not); otherwise it jumps where cycles join.",
            "Cycles are resampled at 120 phases by penalised cubic splines, since unconstrained splines "
            "diverge in gaps. Phases more than 0.75 knots from a sample are missing.",
            "Incomplete cycles before the first whole one and after the last are used, with missing entries.",
            "Samples are at j = 0 ... T - 1; the printed j = T is the next cycle's 0. The row mean of step 3 "
            "is one value per column, and 1' mu is 1 mu'.",
            "Missing entries start at the mean of their column. Cycles with less than 40 % observed are left "
            "out.",
            "The change of 1e-6 is relative to the error on observed entries, with at most 500 passes.",
            "Entries are filled in with the 5 components that are kept.",
        ),
        (picture(Drawing("", "passes", "Error of each pass.", figure)),),
    )


def _components(learning: Learning) -> Entry:
    literal, ours = learning.literal, learning.ours
    shares = [100 * np.cumsum(m.components.spectrum)[len(m.components.sd) - 1] for m in (literal, ours)]
    printed, closed = (
        ormoneit.closure(c)
        for c in (ormoneit.printed_mean(literal), literal.curves[0][:, : ormoneit.PAPER_ANGLE_COUNT])
    )
    steps = [ormoneit.closure(c[:, : ormoneit.PAPER_ANGLE_COUNT]) for c in literal.curves]
    out = [_left_out(m) for m in (literal, ours)]
    return Entry(
        "Components",
        "Five components (eigen-cycles) of the 19 angles.",
        f"{len(literal.components.sd)} components with {shares[0]:.0f} % of the variance{out[0]}. The step "
        "where cycles join, over the largest step elsewhere: of the mean "
        f"{printed:.1f} as printed and {closed:.1f} in the Fourier basis, of the components at most "
        f"{max(steps):.1f}.",
        f"{len(ours.components.sd)} components of 24 angles and the root's 6 channels, with mirrored cycles, "
        f"equal weight for each person and distances of joints; {shares[1]:.0f} % of that variance{out[1]}.",
        verdicts.components(max(steps), _served(learning)),
        (
            "The sign of a component makes its entry of largest magnitude positive.",
            "Cycles are not closed; the package closes them with a linear correction.",
            "v(psi) of eq. 3 is a row of a table of T by 19, not a column, interpolated linearly between "
            "rows.",
            "The standard deviation lambda of a score is the singular value over the square root of the "
            "number of cycles less one. The singular value itself grows with the number of cycles.",
        ),
        (
            Picture(
                f"The paper's components as moving figures: the mean (grey) and {MODE_SDS:g} sd to either "
                "side of it (orange +, blue -), seen from the right and from the front. Right limbs are "
                "bold.",
                _moving(literal),
            ),
            picture(Drawing("", "curves", CURVES, figures_model.curves(literal, NOTED))),
            Picture(f"The package's first {PAPER_COMPONENTS} components.", _moving(ours)),
        ),
    )  # fmt: skip


def _left_out(learned: Learned) -> str:
    """Return the error of people left out in words; empty if there are too few people or too many."""
    found = learned.by_subject
    if found is None:
        return ""
    return (
        f"; a person left out is reproduced to within {np.nanmedian(found.degrees[1]):.1f} degrees, "
        f"{np.nanmedian(found.millimetres[1]):.0f} mm (median)"
    )


def _served(learning: Learning) -> tuple[float, float] | None:
    """Return the median errors of people left out, degrees, with the components and with the mean alone."""
    found = learning.literal.by_subject
    if found is None:
        return None
    return float(np.nanmedian(found.degrees[1])), ormoneit.left_by_mean(learning.literal)


def _moving(learned: Learned) -> str:
    seconds = float(np.median([w.period.frames / w.fps for w in learned.sequences]))
    mean, *turns = learned.curves[: 1 + PAPER_COMPONENTS]
    cells = []
    for across, view in ((0, ""), (1, ", ahead")):
        cells.append((f"mean{view}", [_flat(learned, mean, across, DARK)]))
        for k, turn in enumerate(turns, 1):
            bodies = [
                _flat(learned, mean + sign * MODE_SDS * turn, across, colour)
                for sign, colour in ((0, GREY), (1, ORANGE), (-1, BLUE))
            ]
            cells.append((f"component {k}{view}", bodies))
    return strip(cells, seconds)


def _flat(learned: Learned, cycle: Floats, across: int, colour: str) -> Moving:
    return Moving(figures_model.bodies(learned, cycle, MOVING_PHASES)[:, :, [across, 2]], colour)
