"""Errors against the truth in words: rows for the page of a run, and the same as text for the terminal."""

from __future__ import annotations

from gait.motion.evaluate import Measures
from gait.report import terms

ERROR_HEADER = ("", "median", "mean", "9 of 10 frames below")
"""Columns of `error_rows`."""
_LETTERS = 34  # width of a row's name in the terminal, letters

OTHER_WORLD = (
    "the track's camera was estimated from the walk, so its world is not the truth's: compare the pose, not "
    "positions, pixels or intervals"
)
"""Of a track with `gait.io.track_file.Track.camera_change`."""

Explained = dict[str, str]
"""Explanations by the words of rows."""


def error_rows(m: Measures) -> tuple[list[list[str]], Explained]:
    """Return the cells of the table of errors, under `ERROR_HEADER`, and explanations by name of row."""
    free = m["free"]
    parts = {
        "abs": (m["abs"], 1.0, 0),
        "root": (m["root"], 1.0, 0),
        "root12": (m["root12"], 1.0, 0),
        "proc": (m["proc"], 1.0, 0),
        "px": (m["px"], 1.0, 1),
        "phase": (m["phase"], 100.0, 1),
        "static": (m["static"]["root"], 1.0, 0),
        "free": (None if free is None else free["root"], 1.0, 0),
    }
    known = {name: part for name, part in parts.items() if part[0] is not None}
    rows = [
        [terms.ERRORS[name][0], *(f"{scale * values[key]:.{digits}f}" for key in ("median", "mean", "p90"))]
        for name, (values, scale, digits) in known.items()
    ]
    return rows, {terms.ERRORS[name][0]: terms.ERRORS[name][1] for name in known}


def share_rows(m: Measures) -> tuple[dict[str, str], Explained]:
    """Return single figures by name, and explanations by the same names."""
    found = {
        "within50": f"{m['coverage']['50']:.0%}",
        "within90": f"{m['coverage']['90']:.0%}",
        "width": f"{m['calibration']['width_mm']:.0f} mm",
        "score": f"{m['calibration']['crps_mm']:.1f} mm",
        "squared": f"{m['calibration']['z2']:.2f}",
        "lost": f"{m['lost']:.1%} of {m['frames']} frames",
        "wrong": f"{m['trust']['wrong_tracking']:.1%}",
    }
    if m["phase"] is not None:
        found["flips"] = f"{m['phase']['flips']:.1%}"
        found["bias"] = f"{100 * m['phase']['bias']:+.1f} %"
    words = {terms.SHARE_TERMS[name][0]: value for name, value in found.items()}
    return words, {terms.SHARE_TERMS[name][0]: terms.SHARE_TERMS[name][1] for name in found}


def as_text(m: Measures) -> str:
    """Format the measures for people, with the meaning of each."""
    (rows, errors), (shares, explained) = error_rows(m), share_rows(m)
    lines = [
        f"{words:{_LETTERS}}{median:>8}{mean:>8}{most:>22}"
        for words, median, mean, most in [ERROR_HEADER, *rows]
    ]
    lines += [f"{words:{_LETTERS}}{value:>8}" for words, value in shares.items()]
    status = ", ".join(f"{word} {share:.1%}" for word, share in m["status"].items() if share)
    lines += [f"{'Status':{_LETTERS}} {status}", "", "What these terms mean:"]
    return "\n".join([*lines, *(f"  {words}: {meaning}" for words, meaning in (errors | explained).items())])
