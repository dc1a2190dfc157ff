"""Summarise a learnt model in figures and in words, with notes for its user."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import ANGLES
from gait.counts import count_of
from gait.errors import UserError
from gait.io import blob
from gait.learn.arrays import Floats
from gait.learn.cycles.sequence import Sequence
from gait.learn.options import DEFAULT_COMPONENTS, PAPER_COMPONENTS, LearnOptions
from gait.learn.prior import model, people
from gait.learn.prior.fit import Learned, made_up_channels
from gait.learn.report import classes
from gait.learn.segments import summary as segment_summary

MOST_NAMED_SUBJECTS = 8  # of subjects


def summary(
    learned: Learned, data: bytes, refused: list[str], prior: SegmentPrior | None, report: bool
) -> dict[str, Any]:
    """Return the figures of the model written, and, with a report, those of the subjects."""
    rate, rate_sd, variation, length, length_sd, fps = model.gait_statistics(learned)[:6].tolist()
    residual = learned.residuals.rms(columns=slice(len(ANGLES)))
    table = model.sequence_table(learned)
    return {
        "bytes": len(data),
        "crc32": f"{blob.checksum(data):08x}",
        "subjects": learned.subjects,
        "sequences": [
            dict(zip(model.SEQUENCE_COLUMNS, row, strict=True)) | _found(sequence)
            for row, sequence in zip(table, learned.sequences, strict=True)
        ],
        "left_out": refused,
        "cycles": len(learned.components.scores),
        "components": len(learned.components.sd),
        "variance_explained": np.cumsum(learned.components.spectrum)[: len(learned.components.sd)].tolist(),
        "residual_deg": float(np.degrees(residual)),
        "held_out": learned.held_out.tolist(),
        "stride_hz": [rate, rate_sd],
        "stride_time_cv": variation,
        "stride_length_statures": [length, length_sd],
        "fps": fps,
        "alignment": learned.alignment.objective,
        "imputation": learned.components.rmse,
        "imputation_objective": learned.components.objective,
        "segments": segment_summary.summary(prior) if prior else None,
        **({"by_subject": _by_subject(learned)} if report else {}),
    }


def _found(s: Sequence) -> dict[str, Any]:
    """Return where a sequence comes from and why it was accepted."""
    return {
        "subject": s.subject,
        "source": str(s.source),
        "fps": s.fps,
        "lengths_by": s.recordings,
        "kept": list(s.kept),
        "cut": list(s.cut),
        "snr": round(s.period.peak, 1),
        "activity": s.verdict.activity,
        "evidence": {e.name: round(e.value, 4) if np.isfinite(e.value) else None for e in s.verdict.evidence},
    }


def _by_subject(learned: Learned) -> list[dict[str, Any]]:
    """Return the residuals of each subject, learnt from and left out; empty if they were not computed."""
    if (found := learned.by_subject) is None:
        return []
    columns = {
        "subject": learned.subjects,
        "learnt_from_deg": _rounded(found.degrees[0]),
        "left_out_deg": _rounded(found.degrees[1]),
        "learnt_from_mm": _rounded(found.millimetres[0]),
        "left_out_mm": _rounded(found.millimetres[1]),
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _rounded(values: Floats) -> list[float | None]:
    return [round(v, 2) if np.isfinite(v) else None for v in values.tolist()]


def text(path: str, s: dict[str, Any]) -> str:
    """Format the figures for people; a segment prior alone, and classes alone, have fewer."""
    written = f"{path}: {s['bytes']} bytes, checksum {s['crc32']}"
    if "sequences" not in s and "classes" in s:  # added to a model
        names = " ".join(one["name"] for one in s["classes"])
        return "\n".join([*map(classes.line, s["classes"]), f"{path}: {s['bytes']} bytes, classes {names}"])
    if "sequences" not in s:
        return f"{segment_summary.text(s['segments'])}\n{written}"
    explained = " ".join(f"{100 * v:.0f}" for v in s["variance_explained"])
    left = f"; {count_of(len(s['left_out']), 'file')} left out" if s["left_out"] else ""
    lines = [
        f"{count_of(len(s['sequences']), 'sequence')} of {count_of(len(s['subjects']), 'subject')} "
        f"({_listed(s['subjects'])}), "
        f"{count_of(s['cycles'], 'cycle')}{left}",
        f"{s['stride_hz'][0]:.2f} strides/s, stride length {s['stride_length_statures'][0]:.2f} statures",
        f"{count_of(s['components'], 'component')}: {explained} % of the variance; "
        f"residual {s['residual_deg']:.1f} deg",
        *_left_out(s.get("by_subject", [])),
        *([segment_summary.text(s["segments"])] if s["segments"] else []),
        *map(classes.line, s.get("classes", [])),
        written,
    ]
    return "\n".join(lines)


def _left_out(rows: list[dict[str, Any]]) -> list[str]:
    """Return the median residuals of subjects left out; empty if some have none."""
    units = {"left_out_deg": "{:.1f} deg", "left_out_mm": "{:.0f} mm of joint position"}
    if not rows or any(row[name] is None for row in rows for name in units):
        return []
    found = [words.format(np.median([row[name] for row in rows])) for name, words in units.items()]
    return [f"residual of a subject left out: {', '.join(found)} (median)"]


def notes(learned: Learned, options: LearnOptions) -> Iterator[str]:
    """Yield facts about the model that a user should know and may not expect."""
    cycles, kept = len(learned.components.scores), len(learned.components.sd)
    usual = PAPER_COMPONENTS if learned.paper else DEFAULT_COMPONENTS
    if options.components is None and kept < usual:
        yield f"{cycles} cycles allow {count_of(kept, 'component')} instead of {usual}"
    if parts := model.unobserved(learned):
        yield f"no recording shows {_words(parts)}: they stay in the rest pose"
    if not learned.alignment.converged:
        passes = len(learned.alignment.objective)
        yield f"the alignment did not converge in {passes} passes; leave out recordings unlike the others"
    count, channels = people.never_shown(learned.cycles.mask, learned.row_subject)
    if names := model.parts(channels):
        shows = "person never shows" if count == 1 else "people never show"
        yield f"{count} {shows} {_words(names)}: estimated from the others"
    if made_up := made_up_channels(learned.cycles.visible):
        yield f"no recording shows {' or '.join(made_up)}: computed from the motion of the legs"


def require_filled(learned: Learned) -> None:
    """Raise UserError, with the remedy, if gaps were still changing when their filling ended."""
    if learned.components.converged:
        return
    count, channels = people.never_shown(learned.cycles.mask, learned.row_subject)
    passes, kept = len(learned.components.objective), len(learned.components.sd)
    if names := model.parts(channels):
        lacking = people.lacking(learned.cycles.mask, learned.row_subject)
        who = _listed([learned.subjects[k] for k in lacking])
        what = f"{count} of {len(learned.subjects)} people ({who}) never show {_words(names)}"
        remedy = "leave some of them out with --exclude, add people who do"
    else:
        what, remedy = "too little of the cycles is observed", "add recordings"
    raise UserError(
        f"the filling of gaps did not converge in {passes} passes: {what}; {remedy}, or ask for fewer than "
        f"{kept} --components"
    )


def _words(names: list[str]) -> str:
    """Join names as in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def _listed(names: list[str]) -> str:
    """Join the first few names."""
    return " ".join(names[:MOST_NAMED_SUBJECTS]) + (" ..." if len(names) > MOST_NAMED_SUBJECTS else "")
