"""Convert a learnt model to the sections of a blob (libgait/doc/model-format.md)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gait._version import __version__
from gait.body.model_curves import series
from gait.body.skeleton import ANGLES, CHANNELS, SIDES, default_skeleton
from gait.io import blob
from gait.learn.arrays import Floats, Indices, Mask, by_rows, release
from gait.learn.options import LearnOptions
from gait.learn.prior.fit import Learned
from gait.learn.prior.people import ADULT_STATURE, RELATIVE_LENGTH_SD, RELATIVE_RATE_SD, TERMS, by_subject

#: Decimals stored: a millionth of a radian or stature is far below the accuracy of recordings, and far above
#: the last bits (1e-12) in which results of two machines may differ.
DIGITS = 6
#: Limits of META for a large corpus: rows of a table, and characters of a name as JSON.
MOST_ROWS, MOST_NAME = 12, 32
GENERATOR = f"gait {__version__}"
CMU = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)


SEQUENCE_COLUMNS = ("name", "period_ms", "cycles", "sharpness", "residual_deg")


def sections(learned: Learned, options: LearnOptions) -> dict[str, blob.Array]:
    """Return all sections of the blob, META first."""
    return {
        "META": meta_section(meta(learned, options)),
        "CHNM": blob.pack_names(CHANNELS),
        "CURV": rounded(learned.curves),
        "CHST": rounded(channel_statistics(learned)),
        "SCST": rounded(score_statistics(learned)),
        "GAIT": rounded(gait_statistics(learned)),
        **({"PACE": rounded(series(learned.pace_curve, TERMS))} if learned.pace_curve.any() else {}),
        **default_skeleton(learned.proportions).sections(),
        **({"PROP": rounded(learned.lengths)} if len(learned.lengths) else {}),
        **({"SHFT": rounded(learned.shifts)} if len(learned.lengths) else {}),
    }


def rounded(values: Floats) -> npt.NDArray[np.float32]:
    """Round values as they are stored; zeros are positive, as their sign would depend on a last bit."""
    return (np.round(values, DIGITS) + 0.0).astype(np.float32)


def meta_section(meta: Mapping[str, Any]) -> npt.NDArray[np.uint8]:
    """Encode META as it is stored."""
    return np.frombuffer(json.dumps(meta, separators=(",", ":")).encode(), np.uint8)


def origin(options: LearnOptions, sources: Iterable[Path]) -> dict[str, Any]:
    """Return the entries of META about the kind and origin of a blob."""
    made = {"activity": shortened(options.activity), "generator": GENERATOR, "seed": options.seed}
    credits = {"acknowledgement": CMU} if from_cmu(sources) else {}
    return made | credits | ({"credits": list(options.credit)} if options.credit else {})


def with_credits(sections: Mapping[str, blob.Array], others: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return a model's sections with the credits of other models too, whose METAs are given."""
    own = blob.read_meta(sections)
    credits = dict.fromkeys(own.get("credits", []))
    for meta in others:
        credits |= dict.fromkeys(meta.get("credits", []))
        own |= {key: meta[key] for key in ("acknowledgement",) if key in meta}
    own |= {"credits": list(credits)} if credits else {}
    return {**sections, **({"META": meta_section(own)} if own else {})}


def shortened(name: str) -> str:
    """Shorten a name to MOST_NAME characters of JSON."""
    if len(json.dumps(name)) <= MOST_NAME:
        return name
    end = len(name)
    while len(json.dumps(f"{name[:end]}...")) > MOST_NAME:
        end -= 1
    return f"{name[:end]}..."


def from_cmu(sources: Iterable[Path]) -> bool:
    """Whether any recording has the format of the CMU database, whose terms require an acknowledgement."""
    return any(source.suffix.lower() == ".amc" for source in sources)


def channel_statistics(learned: Learned) -> Floats:
    """Return CHST (M, 4): residual sd, least and largest value, sd of a held-out subject's static offset.

    It is 0 for channels that no recording has.
    """
    mask, values = learned.cycles.mask, learned.cycles.values
    count = mask.sum(axis=(0, 1))
    sd = np.sqrt(learned.residuals.squares.sum(axis=0) / np.maximum(count, 1))
    least, largest = np.full(len(count), np.inf), np.full(len(count), -np.inf)
    for part in by_rows(values):
        np.minimum(least, np.where(mask[part], values[part], np.inf).min(axis=(0, 1)), out=least)
        np.maximum(largest, np.where(mask[part], values[part], -np.inf).max(axis=(0, 1)), out=largest)
    return np.where(count[:, None] > 0, np.stack([sd, least, largest, learned.static], axis=1), 0.0)


def score_statistics(learned: Learned) -> Floats:
    """Return SCST (q, 3): sd of the score, then sd between and within subjects relative to it (ANOVA)."""
    c = learned.components
    between, within = anova(c.scores / np.maximum(c.sd, 1e-12), learned.row_subject)
    return np.stack([c.sd, between, within], axis=1)


def anova(values: Floats, group: Indices) -> tuple[Floats, Floats]:
    """Return the standard deviations of columns (n, k) between and within groups, which may differ in size.

    The first is 0 with one group, the second with one member each.
    """
    labels, counts = np.unique(group, return_counts=True)
    n, k = len(values), len(labels)
    means = np.array([values[group == g].mean(axis=0) for g in labels])
    grand = values.mean(axis=0)
    inside = sum(((values[group == g] - m) ** 2).sum(axis=0) for g, m in zip(labels, means, strict=True))
    within = inside / max(n - k, 1)
    if k < 2:
        return np.zeros(values.shape[1]), np.sqrt(within)
    mean_square = (counts[:, None] * (means - grand) ** 2).sum(axis=0) / (k - 1)
    size = (n - (counts**2).sum() / n) / (k - 1)
    return np.sqrt(np.maximum(mean_square - within, 0) / size), np.sqrt(within)


def gait_statistics(learned: Learned) -> Floats:
    """Return GAIT (8,): stride rate, stride length, sample rate and stature.

    If no recording shows the path of the pelvis, the stride length is that of the mean curves
    (`fit.grounded`).
    """
    rates = np.array([s.fps / s.period.frames for s in learned.sequences])
    column = CHANNELS.index("root_forward")
    speeds = [_observed(s.channels, column) for s in learned.sequences]
    lengths = np.array([speed.mean() if len(speed) else np.nan for speed in speeds])
    fps = float(np.median([s.fps for s in learned.sequences]))
    rate = by_subject(rates, learned.subject_index, RELATIVE_RATE_SD)
    length = by_subject(lengths, learned.subject_index, RELATIVE_LENGTH_SD)
    if not np.isfinite(lengths).any():
        made_up = float(learned.components.mean[:, column].mean())
        length = made_up, 2 * RELATIVE_LENGTH_SD * made_up
    return np.array([*rate, stride_variation(learned), *length, fps, *ADULT_STATURE])


def _observed(channels: Floats, column: int) -> Floats:
    """Return the observed values of one of the channels (T, M) of a sequence, which is on disk."""
    values = channels[np.isfinite(channels[:, column]), column]
    release(channels)
    return values


def stride_variation(learned: Learned) -> float:
    """Return the pooled coefficient of variation of the stride time within a sequence."""
    parts = [s.strides / s.strides.mean() for s in learned.sequences if len(s.strides) > 1]
    squares = sum(float(np.sum((p - 1) ** 2)) for p in parts)
    return float(np.sqrt(squares / max(sum(len(p) - 1 for p in parts), 1)))


def meta(learned: Learned, options: LearnOptions) -> dict[str, Any]:
    """Return META: information for people and tools; degrees, metres, seconds."""
    c = learned.components
    statures = [_stature(learned, name) for name in learned.subjects[:MOST_ROWS]]
    return {
        **origin(options, [s.source for s in learned.sequences]),
        "subject_count": len(learned.subjects),
        "subjects": [shortened(name) for name in learned.subjects[:MOST_ROWS]],
        "statures_m": [None if h is None else round(h, 3) for h in statures],
        "sequences": {
            "count": len(learned.sequences),
            "columns": list(SEQUENCE_COLUMNS),
            "rows": [[shortened(name), *row] for name, *row in sequence_table(learned)[:MOST_ROWS]],
        },
        **({"unobserved": missing} if (missing := unobserved(learned)) else {}),
        **({"sides_alike": round(alike, 2)} if (alike := sides_alike(learned.lasting)) is not None else {}),
        "cycles": len(c.scores),
        "missing": round(float(1 - learned.cycles.mask.mean()), 3),
        "variance_explained": [round(float(v), 3) for v in np.cumsum(c.spectrum)[: len(c.sd)]],
        "iterations": {"alignment": len(learned.alignment.objective), "imputation": len(c.rmse)},
    }


def sides_alike(lasting: Floats) -> float | None:
    """Return the correlation of left and right over people's lasting angles of the legs; None if unknown."""
    legs = [name[2:] for name in ANGLES if name.startswith(("l_hip", "l_knee", "l_ankle"))]
    left, right = (lasting[:, [CHANNELS.index(f"{s}_{name}") for name in legs]] for s in SIDES)
    total = float(np.mean(left**2 + right**2))
    return float(np.mean(left * right)) / (0.5 * total) if total > 0 else None


def unobserved(learned: Learned) -> list[str]:
    """Return the parts of the body, such as 'l_shoulder', of which no recording has any angle."""
    visible = parts(np.asarray(learned.cycles.mask.any(axis=(0, 1))))
    return [part for part in parts(np.ones(len(ANGLES), bool)) if part not in visible]


def parts(which: Mask) -> list[str]:
    """Return the parts of the body that have any of the channels (>= A,), angles first."""
    return list(
        dict.fromkeys(name.rsplit("_", 1)[0] for name, one in zip(ANGLES, which, strict=False) if one)
    )


def _stature(learned: Learned, subject: str) -> float | None:
    """Return the mean stature of a subject, metres; None if no recording shows it."""
    bodies = [s.measures for s in learned.sequences if s.subject == subject and s.measures is not None]
    return float(np.mean([b.stature for b in bodies])) if bodies else None


def sequence_table(learned: Learned) -> list[list[Any]]:
    """Return rows of SEQUENCE_COLUMNS; sharpness: peak over median SNR; residual: rms of all angles."""
    table = []
    for i, s in enumerate(learned.sequences):
        rms = learned.residuals.rms(learned.cycles.sequence == i, slice(len(ANGLES)))
        row = [round(1000 * s.period.frames / s.fps), round(s.cycles, 1), round(s.period.sharpness)]
        table.append([s.name, *row, round(float(np.degrees(rms)), 1) if np.isfinite(rms) else None])
    return table
