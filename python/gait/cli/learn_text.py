"""What is said of a model that was learnt, in figures and in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import ANGLES
from gait.cli import segment_text
from gait.bindings.segment_prior import SegmentPrior
from gait.io import blob
from gait.learn.cycles.sequence import Sequence
from gait.learn.model_options import DEFAULT_COMPONENTS
from gait.learn.prior import fit, ground, model, unseen

Floats = npt.NDArray[np.float64]

MOST_NAMES = 8  # of subjects


def summary(
    learned: fit.Learned, data: bytes, refused: list[str], prior: SegmentPrior | None, report: bool
) -> dict[str, Any]:
    """Figures of what was learnt and written; beside a report those of the subjects too."""
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
        "segments": segment_text.summary(prior) if prior else None,
        **({"by_subject": _by_subject(learned)} if report else {}),
    }


def _found(s: Sequence) -> dict[str, Any]:
    """Where a sequence comes from and why it was taken."""
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


def _by_subject(learned: fit.Learned) -> list[dict[str, Any]]:
    """Residuals with each subject among those learnt from and left out; nobody if they were not computed."""
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
    """Lay the figures out for people."""
    explained = " ".join(f"{100 * v:.0f}" for v in s["variance_explained"])
    left = f"; {_count(len(s['left_out']), 'file')} left out" if s["left_out"] else ""
    lines = [
        f"{_count(len(s['sequences']), 'sequence')} of {_count(len(s['subjects']), 'subject')} "
        f"({_listed(s['subjects'])}), "
        f"{_count(s['cycles'], 'cycle')}{left}",
        f"{s['stride_hz'][0]:.2f} strides/s, stride length {s['stride_length_statures'][0]:.2f} statures",
        f"{_count(s['components'], 'component')}: {explained} % of the variance; "
        f"residual {s['residual_deg']:.1f} deg",
        *_left_out(s.get("by_subject", [])),
        *([segment_text.text(s["segments"])] if s["segments"] else []),
        f"{path}: {s['bytes']} bytes, checksum {s['crc32']}",
    ]
    return "\n".join(lines)


def _left_out(rows: list[dict[str, Any]]) -> list[str]:
    """Medians of the residuals of subjects left out; nothing if some have none."""
    units = {"left_out_deg": "{:.1f} deg", "left_out_mm": "{:.0f} mm of joint position"}
    if not rows or any(row[name] is None for row in rows for name in units):
        return []
    found = [words.format(np.median([row[name] for row in rows])) for name, words in units.items()]
    return [f"residual of a subject left out: {', '.join(found)} (median)"]


def notes(learned: fit.Learned, wanted: int | str | None) -> Iterator[str]:
    """Say what a user should know of what was learnt and might not expect; `wanted` are the components."""
    if wanted is None and len(learned.components.sd) < DEFAULT_COMPONENTS:
        yield _few(learned)
    if parts := model.unobserved(learned):
        yield f"no recording shows {_words(parts)}: these stay in the rest pose"
    yield from _unsettled(learned)
    yield from _never_shown(learned)
    if made_up := ground.unseen(learned.cycles.seen):
        yield f"no recording shows {' or '.join(made_up)}: taken from the motion of the legs"


def _few(learned: fit.Learned) -> str:
    """Say why there are fewer components than usual."""
    cycles, kept = len(learned.components.scores), len(learned.components.sd)
    return f"{cycles} cycles allow {_count(kept, 'component')} instead of {DEFAULT_COMPONENTS}"


def _unsettled(learned: fit.Learned) -> Iterator[str]:
    """Say what stopped before nothing was left to gain."""
    stages = (
        ("alignment", learned.alignment, "leave out recordings unlike the others"),
        ("filling of gaps", learned.components, "add recordings or ask for fewer --components"),
    )
    for name, part, remedy in stages:
        if not part.converged:
            yield f"the {name} did not converge in {len(part.objective)} passes; {remedy}"


def _never_shown(learned: fit.Learned) -> Iterator[str]:
    """Say how many people lack parts that others show; nothing if nobody does."""
    people, channels = unseen.never_shown(learned.cycles.mask, learned.row_subject)
    if names := model.parts(channels):
        shows = "person never shows" if people == 1 else "people never show"
        yield f"{people} {shows} {_words(names)}: filled in from the others"


def _words(names: list[str]) -> str:
    """Join names as in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def _listed(names: list[str]) -> str:
    """Name the first few."""
    return " ".join(names[:MOST_NAMES]) + (" ..." if len(names) > MOST_NAMES else "")


def _count(number: int, what: str) -> str:
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
