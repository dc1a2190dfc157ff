"""Parts of a report about how a person walks: parameters, footfalls, strides, angles with the norm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from gait.bindings.shipped import WALK
from gait.io.track_file import Track
from gait.motion.footfalls import STRIKE_SIDES, Events
from gait.motion.norms import Compared
from gait.motion.parameters import PARAMETER_LABELS, PERCENT, AngleCycle, Parameters
from gait.report import terms
from gait.report.colours import DARK, GREY, ON_PAPER, STATUS_TINTS
from gait.report.film import runs
from gait.report.page import Page
from gait.report.plots import Painter, for_screen_and_telephone, panels, time_plot

Array = NDArray[np.float64]

_GROUPS = {
    "Pelvis and trunk": ("root_pitch", "root_roll", "root_yaw", "torso_y", "torso_x", "torso_z"),
    "Legs": ("hip_flexion", "knee_flexion", "ankle_flexion", "hip_abduction", "hip_rotation"),
    "Arms": ("shoulder_flexion", "elbow_flexion", "shoulder_abduction", "shoulder_rotation"),
    "Head": ("neck_y", "neck_x", "neck_z"),
}
_BY_STRIDE = (
    *("stride_time_s", "stride_length_m", "speed_m_s", "step_length_m", "step_width_m", "stance_percent"),
)


def add_gait(page: Page, track: Track, parameters: Parameters, cycles: Mapping[str, AngleCycle]) -> None:
    """Add all parts for a track with whole strides."""
    tips = {
        PARAMETER_LABELS[name]: words for name, words in terms.QUANTITY_TERMS.items()
    } | terms.COLUMN_TERMS
    if parameters.counting:
        page.grid("Gait", PARAMETER_HEADER, parameter_rows(parameters), tips)
    else:
        page.heading("Gait")
    if warning := parameters.warning():
        page.words(warning, "warning")
    source = f"Source of the uncertainty: {parameters.source}."
    if parameters.counting:
        means = f"Mean over {parameters.counted()} ± its standard deviation"
        source = f"{means}; in brackets the standard deviation between strides. {source}"
    page.words(source, "faint")
    page.figure("Footfalls", footfall_plot(track, parameters))
    page.words(
        "Bars: the foot is on the floor. Ticks: heel strikes (above) and toe-offs (below), two sd to each "
        "side. Tinted: uncertain (yellow) or lost (red).",
        "faint",
    )
    page.figure("Stride by stride", stride_plot(track, parameters))
    page.words("Bars span two standard deviations each way. Hollow: strides that do not count.", "faint")
    add_angles(page, cycles)


def norm_people(model: str | None, parameters: Parameters) -> str:
    """Name the people who are the norm: of a model (None: the package's), of a class if it has several."""
    of_class = f", class {parameters.motion_class}" if parameters.motion_class else ""
    return f"norm: the people of the model {model or WALK}{of_class}"


def add_norms(page: Page, norms: Sequence[Compared]) -> None:
    """Add the parameters beside their norms, with a summary of those outside and how certain that is."""
    if not norms:
        return
    tips = {words: terms.NORMS[source] for source, words in _SOURCES.items()}
    page.grid("Beside norms", NORM_HEAD, norm_rows(norms), tips)
    page.words(
        "Mean ± standard deviation. A value is outside if it is more than two standard deviations from the "
        "norm; the percentage is the probability of that, given the uncertainty of this track.",
        "faint",
    )


NORM_HEAD = ("", "this track", "norm", "of people", "this track is")
"""Columns of `norm_rows`."""
_SOURCES = {"pace": "at this cadence", "speed": "at this speed", "age": "of this age"}


def norm_rows(norms: Sequence[Compared]) -> list[list[str]]:
    """Return the cells of the table of norms, under `NORM_HEAD`."""
    rows = []
    for c in norms:
        plain = c.name.removeprefix("asymmetry:")
        uneven = plain != c.name
        name = (
            f"asymmetry of {PARAMETER_LABELS[plain].split(',')[0]}, %" if uneven else PARAMETER_LABELS[plain]
        )
        unit = "percent" if uneven else plain
        pairs = ({"mean": c.value, "sd": c.sd}, {"mean": c.norm, "sd": c.norm_sd})
        rows.append([name, *(_cell(pair, unit) for pair in pairs), _SOURCES[c.source], c.words])
    return rows


def add_angles(page: Page, cycles: Mapping[str, AngleCycle]) -> None:
    """Add the angles over the stride and their differences from the norm."""
    if not cycles:
        return
    page.heading("Angles over the stride")
    page.html(_KEY)
    for heading, names in _GROUPS.items():
        known = [n for n in names if {n, f"r_{n}", f"l_{n}"} & cycles.keys()]
        if known:
            drawing = panels([angle_painter(name, cycles) for name in known], f"Angles: {heading.lower()}")
            page.html(f"<h3>{heading}</h3>{drawing}")
            page.html(_meaning(known))
    page.figure("Departure from the norm", departure_plot(cycles))
    page.words("Blue: less, red: more than the mean of the norm, in its standard deviations.", "faint")


_KEY = (
    '<ul class="key"><li><i style="background: var(--right)"></i>right, dashed</li>'
    '<li><i style="background: var(--left)"></i>left</li>'
    '<li><i style="background: var(--middle)"></i>middle</li>'
    '<li><i style="background: var(--line)"></i>norm, two standard deviations</li>'
    "<li>thin: single strides; band: two standard deviations of the mean</li></ul>"
)


def _meaning(names: list[str]) -> str:
    rows = [terms.angle(name) for name in names]
    items = "".join(f"<dt>{name} ({positive})</dt><dd>{words}</dd>" for name, positive, words in rows)
    return f'<details class="terms"><summary>What the quantities mean</summary><dl>{items}</dl></details>'


def floor_contacts(track: Track, events: Events, side: str) -> tuple[Array, Array]:
    """Return when a foot came to the floor and left it, (n,) each, seconds.

    A contact lasts until the next toe-off, but not beyond the next strike. While the person stands, however
    long, both feet are on the floor. Contacts in runs, whose ends are unknown, are left out.
    """
    strike, off = np.sort(np.append(events.strike[side], events.stands[:, 0])), events.off[side]
    on_floor_first = len(off) > 0 and (not len(strike) or off[0] < strike[0])
    begin = np.append(track.time[0], strike) if on_floor_first else strike
    latest = np.append(begin[1:], track.time[-1])
    end = np.minimum(np.append(off, np.inf)[np.searchsorted(off, begin, side="right")], latest)
    runs = np.interp([begin, end], track.time, track.runs).max(axis=0) >= 0.5
    return begin[~runs], end[~runs]


def footfall_plot(track: Track, parameters: Parameters) -> str:
    """Draw the contacts of both feet over time; ticks: strikes and toe-offs with two standard deviations."""

    def paint(axes: Axes) -> None:
        tint(axes, track)
        for row, side in enumerate(STRIKE_SIDES):
            begin, ends = floor_contacts(track, parameters.events, side)
            axes.barh(np.full(len(ends), row), ends - begin, left=begin, height=0.5, color=ON_PAPER[side])
            for times, sds, bottom in (
                (parameters.events.strike[side], parameters.event_sd.strike[side], 0.32),
                (parameters.events.off[side], parameters.event_sd.off[side], -0.32),
            ):
                at = np.full(len(times), row + bottom)
                axes.errorbar(times, at, xerr=2 * sds, fmt="|", color=DARK, capsize=2, lw=1)
        axes.set(yticks=[0, 1], yticklabels=STRIKE_SIDES, ylim=(-0.6, 1.6))
        axes.grid(axis="y", visible=False)

    return time_plot(paint, time_span(track), 1.9, "Feet on the floor")


def stride_plot(track: Track, parameters: Parameters) -> str:
    """Draw quantities stride by stride with two standard deviations; hollow: strides that do not count."""

    def painter(name: str) -> Painter:
        def paint(axes: Axes) -> None:
            for side in STRIKE_SIDES:
                s = parameters.strides[side]
                middle = (s.start + s.end) / 2
                seen = np.isfinite(s.values[name])
                for counts in (True, False):
                    use = seen & (s.counts == counts)
                    axes.errorbar(
                        middle[use], s.values[name][use], yerr=2 * s.sd[name][use],
                        fmt="o" if side == "right" else "s", ms=4, lw=1, color=ON_PAPER[side],
                        mfc=ON_PAPER[side] if counts else "none",
                    )  # fmt: skip
            axes.set(title=PARAMETER_LABELS[name], xlabel="time, s")
            axes.set_xlim(*time_span(track))
            axes.margins(y=0.25)

        return paint

    known = [
        n for n in _BY_STRIDE if any(np.isfinite(s.values[n]).any() for s in parameters.strides.values())
    ]
    return panels([painter(name) for name in known], "Quantities stride by stride")


def angle_painter(name: str, cycles: Mapping[str, AngleCycle]) -> Painter:
    """Make a painter of an angle over the stride, on both sides if it has two, with the norm in grey."""

    def paint(axes: Axes) -> None:
        first = cycles.get(f"r_{name}") or cycles.get(f"l_{name}") or cycles[name]
        low, high = first.norm_mean - 2 * first.norm_sd, first.norm_mean + 2 * first.norm_sd
        axes.fill_between(PERCENT, low, high, color=GREY, alpha=0.25, lw=0)
        for side, key in (("right", f"r_{name}"), ("left", f"l_{name}"), ("middle", name)):
            if key not in cycles:
                continue
            c, colour = cycles[key], ON_PAPER[side]
            axes.plot(PERCENT, c.strides.T, color=colour, lw=0.5, alpha=0.5)
            axes.fill_between(PERCENT, c.mean - 2 * c.sd, c.mean + 2 * c.sd, color=colour, alpha=0.25, lw=0)
            axes.plot(PERCENT, c.mean, color=colour, ls="--" if side == "right" else "-")
        words, positive, _ = terms.angle(name)
        axes.set(title=f"{words}, ° ({positive})" if positive else f"{words}, °", xlim=(0, 100))
        axes.set_xlabel("% of the stride")

    return paint


def departure_plot(cycles: Mapping[str, AngleCycle]) -> str:
    """Draw the difference of every angle from the norm over the cycle."""
    order = [n for group in _GROUPS.values() for name in group for n in (f"r_{name}", f"l_{name}", name)]
    names = [name for name in order if name in cycles] + [name for name in cycles if name not in order]

    def paint(axes: Axes) -> None:
        values = np.array([cycles[name].z for name in names])
        edges = np.arange(len(names) + 1) - 0.5
        percent = np.linspace(0, 100, len(PERCENT) + 1)
        image = axes.pcolormesh(percent, edges, values, cmap="RdBu_r", vmin=-3, vmax=3, rasterized=True)
        axes.invert_yaxis()
        axes.set(yticks=range(len(names)), xlabel="% of the stride")
        axes.set_yticklabels([terms.sided(name) for name in names], fontsize=8)
        axes.grid(visible=False)
        axes.figure.colorbar(image, ax=axes, label="sd of the norm", extend="both")

    return for_screen_and_telephone(paint, 0.8 + 0.19 * len(names), "Departure of every angle from the norm")


def time_span(track: Track) -> tuple[float, float]:
    """First and last second of a track."""
    return float(track.time[0]), float(track.time[-1])


def tint(axes: Axes, track: Track) -> None:
    """Tint the background of runs of frames that are lost or ambiguous."""
    half = 0.5 * float(np.median(np.diff(track.time))) if len(track.time) > 1 else 0.0
    for status, first, after in runs(track.status):
        if status in ("lost", "ambiguous"):
            span = track.time[first] - half, track.time[after - 1] + half
            axes.axvspan(*span, color=STATUS_TINTS[status], alpha=0.5, lw=0)


_MEANINGLESS_SD = 100.0  # standard deviation from which an asymmetry, which is at most 200, is meaningless
PARAMETER_HEADER = ("", "right", "left", "both", "asymmetry, %")
"""Columns of `parameter_rows`."""


def parameter_rows(parameters: Parameters) -> list[list[str]]:
    """Return the cells of the table of parameters, under `PARAMETER_HEADER`."""
    rows = []
    for name, row in parameters.summary().items():
        cells = [_cell(row[side], name) for side in ("right", "left", "both")]
        rows.append([PARAMETER_LABELS[name], *cells, _cell(row.get("asymmetry_percent"), "percent")])
    return rows


def _cell(value: dict[str, Any] | None, name: str) -> str:
    if value is None:
        return ""
    digits = 1 if name.endswith(("percent", "spm")) else 3 if name.endswith("time_s") else 2
    if name == "percent" and value["sd"] > _MEANINGLESS_SD:
        return "not determined"
    text = f"{round(value['mean'], digits) + 0.0:.{digits}f}"  # avoids -0.0
    if np.isfinite(value["sd"]):
        text += f"\N{NO-BREAK SPACE}±\N{NO-BREAK SPACE}{value['sd']:.{digits}f}"
    between = value.get("between", np.nan)
    return text + (f" ({between:.{digits}f})" if np.isfinite(between) else "")
