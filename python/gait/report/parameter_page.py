"""The page of ``gait report track``: gait parameters with their uncertainty, and angles over the norm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from gait.io.track_file import Track
from gait.motion.footfalls import SIDES, contacts, stride_time
from gait.motion.parameters import PERCENT, QUANTITIES, AngleCycle, Parameters
from gait.report.colours import DARK, GREY, ON_PAPER, STATUS_TINTS
from gait.report.page import Page
from gait.report.plots import Painter, svg_figure

_WIDTH = 7.6  # inches
_STRIDE_ROWS = (
    ("stride_time_s", "stride_length_m", "speed_m_s"),
    ("step_length_m", "step_width_m", "stance_percent"),
)
_GROUPS = (
    ("hip_flexion", "knee_flexion", "ankle_flexion"),
    ("hip_abduction", "hip_rotation", "shoulder_flexion"),
    ("shoulder_abduction", "shoulder_rotation", "elbow_flexion"),
)
_TRUNK = (("torso_x", "torso_y", "torso_z"), ("neck_x", "neck_y", "neck_z"))


def footfall_plot(track: Track, parameters: Parameters) -> str:
    """Draw the contacts of both feet over time; ticks: strikes and toe-offs with two standard deviations."""
    stride = stride_time(parameters.events)

    def paint(axes: Axes) -> None:
        _tint(axes, track)
        for row, side in enumerate(SIDES):
            foot = contacts(track, parameters.events, side, stride)
            begin, ends = foot.strike, np.where(np.isfinite(foot.off), foot.off, track.time[-1])
            first = parameters.events.off[side][:1]
            if len(first) and (not len(begin) or first[0] < begin[0]):  # on the ground from the start
                begin, ends = np.append(track.time[0], begin), np.append(first, ends)
            axes.barh(np.full(len(ends), row), ends - begin, left=begin, height=0.5, color=ON_PAPER[side])
            for times, sds, bottom in (
                (parameters.events.strike[side], parameters.event_sd.strike[side], 0.32),
                (parameters.events.off[side], parameters.event_sd.off[side], -0.32),
            ):
                at = np.full(len(times), row + bottom)
                axes.errorbar(times, at, xerr=2 * sds, fmt="|", color=DARK, capsize=2, lw=1)
        axes.set(yticks=[0, 1], yticklabels=SIDES, xlabel="time, s", ylim=(-0.6, 1.6))
        axes.set_xlim(track.time[0], track.time[-1])
        axes.grid(axis="y", visible=False)

    return svg_figure([[paint]], (_WIDTH, 1.7))


def stride_plot(track: Track, parameters: Parameters) -> str:
    """Draw quantities stride by stride with two standard deviations; uncertain strides are hollow."""

    def painter(name: str, title: str) -> Painter:
        def paint(axes: Axes) -> None:
            for side in SIDES:
                s = parameters.strides[side]
                middle = (s.start + s.end) / 2
                seen = np.isfinite(s.values[name])
                for sure in (True, False):
                    use = seen & (s.sure == sure)
                    filling, label = (ON_PAPER[side], side) if sure else ("white", None)
                    axes.errorbar(
                        middle[use], s.values[name][use], yerr=2 * s.sd[name][use],
                        fmt="o", ms=4, lw=1, color=ON_PAPER[side], mfc=filling, label=label,
                    )  # fmt: skip
            axes.set(title=title, xlabel="time, s")
            axes.set_xlim(track.time[0], track.time[-1])
            axes.margins(y=0.25)

        return paint

    rows = [[painter(name, QUANTITIES[name]) for name in names] for names in _STRIDE_ROWS]
    return svg_figure(rows, (_WIDTH, 4.2), legend=True)


def angle_plot(cycles: Mapping[str, AngleCycle], trunk: bool = False) -> str | None:
    """Draw the angles of the limbs, right and left, or of the trunk, with bands, over the norm in grey.

    None if there is no such angle.
    """
    rows = []
    for group in _TRUNK if trunk else _GROUPS:
        known = [n for n in group if n in cycles or f"r_{n}" in cycles or f"l_{n}" in cycles]
        if known:
            rows.append([_angle_painter(name, cycles) for name in known])
    return svg_figure(rows, (_WIDTH, 2.1 * len(rows)), legend=not trunk) if rows else None


def _angle_painter(name: str, cycles: Mapping[str, AngleCycle]) -> Painter:
    def paint(axes: Axes) -> None:
        first = cycles.get(f"r_{name}") or cycles.get(f"l_{name}") or cycles[name]
        low, high = first.norm_mean - 2 * first.norm_sd, first.norm_mean + 2 * first.norm_sd
        axes.fill_between(PERCENT, low, high, color=GREY, alpha=0.25, lw=0, label="norm, 2 sd")
        for side, key in (("right", f"r_{name}"), ("left", f"l_{name}"), ("right", name)):
            if key not in cycles:
                continue
            c, colour = cycles[key], ON_PAPER[side if key != name else "middle"]
            axes.plot(PERCENT, c.strides.T, color=colour, lw=0.5, alpha=0.5)
            axes.fill_between(PERCENT, c.mean - 2 * c.sd, c.mean + 2 * c.sd, color=colour, alpha=0.25, lw=0)
            axes.plot(PERCENT, c.mean, color=colour, label=side if key != name else None)
        axes.set(title=name.replace("_", " ") + ", °", xlabel="% of the stride", xlim=(0, 100))

    return paint


def departure_plot(cycles: Mapping[str, AngleCycle]) -> str:
    """Draw the departure of every angle from the norm over the cycle."""
    names = list(cycles)

    def paint(axes: Axes) -> None:
        values = np.array([cycles[name].z for name in names])
        image = axes.imshow(
            values, aspect="auto", cmap="RdBu_r", vmin=-3, vmax=3, extent=(0, 100, len(names) - 0.5, -0.5)
        )
        axes.set(yticks=range(len(names)), xlabel="% of the stride")
        axes.set_yticklabels([name.replace("_", " ") for name in names], fontsize=7)
        axes.grid(visible=False)
        axes.figure.colorbar(image, ax=axes, label="sd from the mean of the norm", extend="both")

    return svg_figure([[paint]], (_WIDTH, 0.6 + 0.17 * len(names)))


def path_plot(track: Track, parameters: Parameters) -> str:
    """Draw the path of the pelvis and where the feet stood, seen from above."""
    stride = stride_time(parameters.events)

    def paint(axes: Axes) -> None:
        axes.plot(*track.places["pelvis"][:, :2].T, color=GREY, lw=1, label="pelvis")
        for side in SIDES:
            places = contacts(track, parameters.events, side, stride).place
            axes.plot(*places[:, :2].T, "o", ms=5, color=ON_PAPER[side], label=f"{side} heel")
        axes.set(xlabel="x, m", ylabel="y, m")
        axes.set_aspect("equal", adjustable="datalim")
        axes.legend(fontsize=7)

    return svg_figure([[paint]], (_WIDTH, 3.0))


def _tint(axes: Axes, track: Track) -> None:
    """Tint the background of frames that are lost or ambiguous."""
    half = 0.5 * float(np.median(np.diff(track.time)))
    for time, status in zip(track.time, track.status, strict=True):
        if status in ("lost", "ambiguous"):
            axes.axvspan(time - half, time + half, color=STATUS_TINTS[status], alpha=0.5, lw=0)


HEAD = ("", "right", "left", "both", "asymmetry, %")
"""Columns of `parameter_rows`."""


def parameter_page(name: str, track: Track, parameters: Parameters, cycles: Mapping[str, AngleCycle]) -> str:
    """Return the HTML page of the track called `name`."""
    page = Page(f"{name}: gait parameters")
    page.words(
        f"Frames {track.frame[0]} to {track.frame[-1]}. Each value is the mean over the strides without lost "
        "or ambiguous frames, plus or minus the standard deviation of that mean; the one between strides "
        f"is in brackets. Source of the uncertainty: {parameters.source}. "
        "Asymmetry is 200 (right - left) / (right + left)."
    )
    page.grid("Parameters", HEAD, parameter_rows(parameters))
    page.figure("Foot contacts", footfall_plot(track, parameters))
    page.words(
        "Ticks mark heel strikes (above) and toe-offs (below) with two standard deviations. "
        "The track was lost where the background is red, and ambiguous where it is yellow."
    )
    page.figure("Strides", stride_plot(track, parameters))
    page.words(
        "Bars span two standard deviations each way. "
        "Hollow markers are strides with lost or ambiguous frames."
    )
    for trunk, heading in ((False, "Angles of the limbs"), (True, "Angles of trunk and neck")):
        drawing = angle_plot(cycles, trunk)
        if drawing is not None:
            page.figure(heading, drawing)
    if cycles:
        page.figure("Departure from the norm", departure_plot(cycles))
        page.words(
            "The norm is the people the model was learned from. Where the image does not show a limb, the "
            "tracker fills it in from the same people, so the true departure is larger than shown, most of "
            "all for small or hidden limbs."
        )
    page.figure("Seen from above", path_plot(track, parameters))
    return page.text()


def parameter_rows(parameters: Parameters) -> list[list[str]]:
    """Return the cells of the table of parameters, under `HEAD`."""
    rows = []
    for name, row in parameters.summary().items():
        cells = [_cell(row[side], name) for side in ("right", "left", "both")]
        rows.append([QUANTITIES[name], *cells, _cell(row.get("asymmetry_percent"), "percent")])
    return rows


def _cell(value: dict[str, Any] | None, name: str) -> str:
    if value is None:
        return ""
    digits = 1 if name.endswith(("percent", "spm")) else 3
    text = f"{value['mean']:.{digits}f}"
    if np.isfinite(value["sd"]):
        text += f" ± {value['sd']:.{digits}f}"
    between = value.get("between", np.nan)
    return text + (f" ({between:.{digits}f})" if np.isfinite(between) else "")
