"""The page of a run: verdict, film and 3-D figure, gait, path, uncertainty, errors, settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gait.body.model_curves import ModelCurves
from gait.body.skeleton import BONES, JOINTS
from gait.camera.camera import Camera
from gait.io.track_file import Track
from gait.motion.footfalls import STRIKE_SIDES, Draws, contacts, stride_time
from gait.motion.norms import Compared
from gait.motion.parameters import AngleCycle, Parameters, angle_cycles, norm_model, without_norm
from gait.motion.verdict import Verdict
from gait.report import terms
from gait.report.colours import BLUE, DARK, GREY, ON_PAPER, ORANGE
from gait.report.comparison import Comparison, add_errors
from gait.report.film import PageFilm, runs
from gait.report.gait_parts import add_gait, add_norms, norm_people, time_span, tint
from gait.report.page import Page
from gait.report.plots import for_screen_and_telephone, time_plot
from gait.web import modules, parts
from gait.web.motion_data import curve, motion_data

Array = NDArray[np.float64]

_OVER_TIME = (
    *("hip_flexion", "knee_flexion", "ankle_flexion", "elbow_flexion", "shoulder_flexion"),
    *("torso_y", "torso_x", "torso_z"),
)
_VAGUE = 0.15  # metres; with larger standard deviations, ellipsoids would hide the figure
_LEAST_WAY = 1.0  # metres; least extent of the plot of the path
_BROAD = 500.0  # pixels; on wider axes a legend fits in one row


@dataclass(frozen=True)
class Run:
    """What the page of a run shows.

    Attributes
    ----------
    title : str
    track : Track
    verdict : Verdict
    parameters : Parameters or None
        None if the track has no whole stride.
    cycles : mapping of str to AngleCycle
        Empty without strides.
    norms : sequence of Compared
        Parameters compared with norms.
    without_norm : str
        Why there is no norm, nor angles over the stride.
    model : str or None
        The model whose people are the norm; None: the package's.
    film : PageFilm or None
    times : ndarray of shape (frames of the film,)
        Seconds; empty without a film.
    camera : Camera or None
    errors : Comparison or None
        Errors, if the truth is known.
    notes : list of str
        Remarks about the inputs.
    facts : dict of str to dict of str to str
        Tables of names and values by heading: camera and settings, files, figures of a live run.
    drawings : dict of str to str
        Further drawings, HTML, by heading.
    """

    title: str
    track: Track
    verdict: Verdict
    parameters: Parameters | None = None
    cycles: Mapping[str, AngleCycle] = field(default_factory=dict)
    norms: Sequence[Compared] = ()
    without_norm: str = ""
    model: str | None = None
    film: PageFilm | None = None
    times: Array = field(default_factory=lambda: np.zeros(0))
    camera: Camera | None = None
    errors: Comparison | None = None
    notes: list[str] = field(default_factory=list)
    facts: dict[str, dict[str, str]] = field(default_factory=dict)
    drawings: dict[str, str] = field(default_factory=dict)


def cycles_of(
    track: Track, parameters: Parameters | None, model: Mapping[str, Any], draws: Draws | None = None
) -> dict[str, AngleCycle]:
    """Compute the angles over the stride; empty without strides, or without a norm for their class."""
    if parameters is None or without_norm(parameters, model):
        return {}
    return angle_cycles(track, parameters, ModelCurves(norm_model(parameters, model)), draws)


def run_page(run: Run) -> str:
    """Return the text of the page."""
    page = Page(run.title, run.verdict.sentence() + ".")
    page.words(run.verdict.statuses(lambda status: terms.STATUS_TERMS[status][0]) + ".", "faint")
    if warning := run.verdict.warning():
        page.words(f"{warning[0].upper()}{warning[1:]}.", "warning")
    if run.film is not None:
        _add_film(page, run, run.film)
    if run.parameters is None:
        page.heading("Gait")
        page.words(
            "No whole stride was tracked, so there are no gait parameters and no curves over the stride."
        )
    else:
        add_gait(page, run.track, run.parameters, run.cycles)
        add_norms(page, run.norms)
        if run.without_norm:
            page.words(f"No norm, and no angles over the stride: {run.without_norm}.", "faint")
        elif run.norms or run.cycles:
            people = norm_people(run.model, run.parameters)
            page.words(f"{people[0].upper()}{people[1:]}.", "faint")
    if run.film is not None and modules.available():
        drawing = '<h2>Angles over time</h2><div id="run-curves"></div>'
        page.html(f'<section class="screen-only">{drawing}</section>')
    page.figure("Path over the floor", way_plot(run.track, run.parameters, run.errors))
    page.heading("Pace")
    page.html(_number_plot(run.track, "stride_hz", 120.0, "Cadence, steps per minute"))
    page.html(_number_plot(run.track, "speed_m_s", 1.0, "Speed, m/s"))
    if run.track.motion_class:
        page.heading("Motion")
        page.html(_class_plot(run.track))
    page.figure("Uncertainty", uncertainty_plot(run.track))
    page.words(
        "Standard deviation of positions in the world, mean over the three axes. It includes the "
        "uncertainty of a camera that was estimated from the walk.",
        "faint",
    )
    if run.errors is not None:
        add_errors(page, run.track, run.errors)
    for heading, drawing in run.drawings.items():
        page.figure(heading, drawing)
    for heading, rows in run.facts.items():
        page.table(heading, rows)
    if run.notes:
        page.points([f"{note[0].upper()}{note[1:]}." for note in run.notes])
    page.heading("Conventions")
    page.points(terms.CONVENTIONS)
    return page.text()


def _add_film(page: Page, run: Run, film: PageFilm) -> None:
    """Add film and figure with their data and script, and pictures for printing."""
    whole = modules.available()
    page.head = modules.inlined_head(whole)
    shape = film.size[0] / film.size[1]
    figure = '<div id="run-figure"></div>' if whole else ""
    kind = "stage-pair screen-only" + ("" if whole else " alone")
    page.html(f'<div class="{kind}" style="--shape: {shape:.4f}"><div id="run-video"></div>{figure}</div>')
    page.pictures(film.pictures, "print-only")
    statuses = _statuses(run.track, film)
    page.html(_strip(statuses))
    page.words(_LEGEND, "faint")
    page.words(
        f"Drag the figure to turn it; space plays, arrow keys step. {film.note()}", "faint screen-only"
    )
    if not whole:
        page.words(f"The 3-D figure is not in this page: {parts.FETCH}, then make the page again", "faint")
    page.html(modules.inlined_json("run-data", _data(run, film, statuses, whole)))
    page.html(f'<script type="text/plain" id="run-film">{film.data}</script>')
    page.html(f'<script type="module">\n{modules.own("run.js")}</script>')


_LEGEND = (
    "In the film: the dial is the phase of the stride, with the right heel strike at the top and a coloured "
    "arc for its 95 % interval; ellipses are 90 % regions of wrists and ankles; left is blue, right is "
    "orange; the figure is faded where the person was lost."
)


def _statuses(track: Track, film: PageFilm) -> list[str]:
    """List the status of every frame of the film, empty where the track has no row."""
    known = dict(zip(track.frame.tolist(), track.status, strict=True))
    return [known.get(number, "") for number in film.frames]


def _strip(statuses: list[str]) -> str:
    """Draw the statuses along the film, with a legend of those that occur."""
    count = len(statuses)
    bars = "".join(
        f'<i class="s-{status or "absent"}" title="{escape(terms.STATUS_TERMS[status][0])}" '
        f'style="left: {100 * a / count:.3f}%; width: {100 * (b - a) / count:.3f}%"></i>'
        for status, a, b in runs(statuses)
    )
    key = "".join(
        f'<li><i class="s-{status or "absent"}"></i>{escape(words)}: {escape(meaning)}</li>'
        for status, (words, meaning) in terms.STATUS_TERMS.items()
        if status in statuses
    )
    return f'<div class="statuses" id="run-statuses">{bars}</div><ul class="key">{key}</ul>'


def _data(run: Run, film: PageFilm, statuses: list[str], whole: bool) -> dict[str, object]:
    """Make the object that the page's script reads, with an entry for each frame of the film."""
    track, count = run.track, len(film.frames)
    rows = track.frame - film.frames[0]
    use = (rows >= 0) & (rows < count)
    rows = rows[use]
    points, sd = np.full((count, len(JOINTS), 3), np.nan), np.full((count, len(JOINTS), 3), np.nan)
    points[rows] = np.stack([track.places[name] for name in JOINTS], axis=1)[use]
    sd[rows] = np.stack([track.sd[name] for name in JOINTS], axis=1)[use]
    begin = int(rows[0]) if len(rows) else 0

    def over_film(values: Array) -> Array:
        out = np.full(count, np.nan)
        out[rows] = values[use]
        return out

    curves = []
    for name in _OVER_TIME if whole else ():
        words = terms.angle(name)[0]
        for side, key in (("left", f"l_{name}"), ("right", f"r_{name}"), ("", name)):
            if f"{key}_deg" in track.numbers:
                curves.append(curve(words, "°", over_film(track.numbers[f"{key}_deg"]), side=side))
    return motion_data(
        film.rate,
        run.times,
        JOINTS,
        [(JOINTS.index(a), JOINTS.index(b)) for a, b in BONES],
        points,
        sd,
        first=film.frames[0],
        begin=begin,
        size=list(film.size),
        camera=None if run.camera is None else run.camera.centre,
        status=[terms.STATUS_TERMS[status][0] for status in statuses],
        curves=curves,
        events=_events(run.parameters),
        parts=whole,
        vague=_is_vague(track),
    )


def _is_vague(track: Track) -> bool:
    """Whether positions are too uncertain for ellipsoids, for example with an estimated camera."""
    sd = np.stack(list(track.sd.values()))
    return bool(np.median(sd.max(axis=2)) > _VAGUE)


def _events(parameters: Parameters | None) -> list[dict[str, object]]:
    """List heel strikes, for the film's timeline."""
    if parameters is None:
        return []
    return [
        {"time": round(float(time), 4), "name": f"{side} heel strike", "side": side}
        for side in STRIKE_SIDES
        for time in parameters.events.strike[side]
    ]


def way_plot(track: Track, parameters: Parameters | None, errors: Comparison | None = None) -> str:
    """Draw the path of the pelvis and the positions of the feet, from above, with the longer side across."""
    pelvis = track.places["pelvis"][:, :2]
    feet = {}
    if parameters is not None:
        stride = stride_time(parameters.events)
        places = {
            side: contacts(track, parameters.events, side, stride).place[:, :2] for side in STRIKE_SIDES
        }
        feet = {side: place[np.isfinite(place).all(axis=1)] for side, place in places.items()}
    every = np.concatenate([pelvis, *feet.values()])
    low, high = every.min(axis=0), every.max(axis=0)
    grow = np.maximum(_LEAST_WAY - (high - low), 0.3) / 2
    low, high = low - grow, high + grow
    turned = bool(np.diff(high - low)[0] > 0)  # longer along y than along x
    across, up = (1, 0) if turned else (0, 1)

    def paint(axes: Axes) -> None:
        if errors is not None:
            axes.plot(*errors.true_path[:, [across, up]].T, color=GREY, lw=4, alpha=0.5, label="truth")
        axes.plot(*pelvis[:, [across, up]].T, color=DARK, lw=1, label="pelvis")
        axes.plot(*pelvis[0, [across, up]], "D", color=DARK, ms=6, label="begins here")
        for side, places in feet.items():
            mark = "o" if side == "right" else "s"
            axes.plot(*places[:, [across, up]].T, mark, ms=5, color=ON_PAPER[side], label=f"{side} foot")
        axes.set(xlim=(low[across], high[across]), ylim=(low[up], high[up]))
        if turned:
            axes.invert_yaxis()  # a turn by 90 degrees, not a mirror image
        axes.set(xlabel=f"{'xy'[across]}, m", ylabel=f"{'xy'[up]}, m", aspect="equal")
        columns = 5 if axes.bbox.width > _BROAD else 3
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=columns, fontsize=8, columnspacing=1)

    share = float((high - low)[up] / (high - low)[across])
    heights = (min(9.4 * share + 1.2, 7.0), min(3.0 * share + 1.3, 4.5))
    return for_screen_and_telephone(paint, heights[0], "The path over the floor, seen from above", heights[1])


def _number_plot(track: Track, name: str, scale: float, title: str) -> str:
    """Draw a column of the track over time."""

    def paint(axes: Axes) -> None:
        tint(axes, track)
        values = scale * track.numbers.get(name, np.full(len(track.time), np.nan))
        axes.plot(track.time, values, color=BLUE)
        if f"{name}_sd" in track.numbers:
            band = 2 * scale * track.numbers[f"{name}_sd"]
            words = "two standard deviations each way"
            low, high = values - band, values + band
            axes.fill_between(track.time, low, high, color=BLUE, alpha=0.2, lw=0, label=words)
            axes.legend(loc="best")
        axes.margins(y=0.2)

    return time_plot(paint, time_span(track), 1.9, title)


def _class_plot(track: Track) -> str:
    """Draw the probability of each class of motion over time, one above the other."""
    shares = {name[2:]: values for name, values in track.numbers.items() if name.startswith("p_")}

    def paint(axes: Axes) -> None:
        tint(axes, track)
        axes.stackplot(track.time, *shares.values(), labels=list(shares), alpha=0.7, lw=0)
        axes.set(ylim=(0, 1))
        axes.legend(loc="lower left", ncols=len(shares))

    return time_plot(paint, time_span(track), 1.9, "Probability of each class of motion")


def uncertainty_plot(track: Track) -> str:
    """Draw the standard deviations of pelvis and feet over time."""

    def paint(axes: Axes) -> None:
        tint(axes, track)
        for name, words, colour, dash in (
            ("pelvis", "pelvis", DARK, "-"),
            ("l_ankle", "left ankle", BLUE, "-"),
            ("r_ankle", "right ankle", ORANGE, "--"),
        ):
            sd = 1000 * np.sqrt((track.sd[name] ** 2).mean(axis=1))
            axes.plot(track.time, sd, color=colour, ls=dash, label=words)
        axes.set(ylim=(0, None))
        axes.legend(loc="best")

    return time_plot(paint, time_span(track), 2.4, "Standard deviation of positions, mm")
