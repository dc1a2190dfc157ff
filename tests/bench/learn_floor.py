#!/usr/bin/env python3
"""How well the cyclic model can describe a walker it has not seen: leave one subject out.

    .venv/bin/python tests/bench/learn_floor.py ../shared/data/mocap/cmu_walk [--json]

Mean distance of 14 joints after alignment of the pelvis (place and orientation), mm, with one constant vector
of scores and one phase offset per sequence, the sequence's own period.  `true` uses the walker's own limb
lengths, `generic` the model's times the walker's stature, `upright` generic lengths and also the model's own
pelvis orientation along the true heading.  `skeleton` is the floor below all: exact angles on the walker's
own lengths.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.learn import fit, model, retarget
from gait.learn.sequence import Sequence, level_body, load
from gait.skeleton import ANGLES, CHANNELS, EVAL15, curves, default_skeleton, points

Floats = npt.NDArray[np.float64]

QS = (0, 3, 5, 8)
JOINTS = [name for name in EVAL15 if name != "pelvis"]
PHASES = 16  # offsets tried first, over a stride


def true_joints(s: Sequence) -> Floats:
    """Joints (T, 14, 3) from the pelvis, metres, along the world's axes."""
    j = dict(level_body(s.source, kept=s.kept).joints)
    way = j["head"] - j["neck"]
    way /= np.linalg.norm(way, axis=1)[:, None]
    j["head_top"] = j["neck"] + way * retarget.HEAD * s.measures.stature
    return np.stack([j[name] - j["pelvis"] for name in JOINTS], axis=1)


def model_joints(sections: dict[str, Any], channels: Floats, stature: float) -> Floats:
    """Joints (T, 14, 3) from the pelvis, metres."""
    names = default_skeleton().points
    return points(sections, channels)[:, [names.index(n) for n in JOINTS]] * stature


def error(s: Sequence, sections: dict[str, Any], channels: Floats, upright: bool = False) -> Floats:
    """Mean distance per joint (14,), mm, for channel values (T, 30) of the model."""
    channels = channels.copy()
    if upright:
        channels[:, CHANNELS.index("root_yaw")] += s.heading
        turn = np.broadcast_to(np.eye(3), (len(channels), 3, 3))
    else:
        channels[:, [CHANNELS.index(f"root_{n}") for n in ("roll", "pitch", "yaw")]] = 0
        turn = level_body(s.source, kept=s.kept).pelvis
    found = np.einsum("tij,tpj->tpi", turn, model_joints(sections, channels, s.measures.stature))
    return 1000 * np.asarray(np.linalg.norm(found - true_joints(s), axis=2)).mean(axis=0)


def own_sections(s: Sequence) -> dict[str, Any]:
    return default_skeleton(retarget.own_proportions(s.measures)).sections()


def best_channels(
    s: Sequence, sections: dict[str, Any], q: int, scale: Floats, start: float | None
) -> tuple[float, Floats]:
    """Phase offset near `start` (None: anywhere) and channels (T, 30) of the best constant scores."""
    starts = np.arange(PHASES) / PHASES if start is None else [start]
    best = min((fit_at(s, sections, q, scale, o) for o in starts), key=lambda r: r[0])
    step = 1 / PHASES
    while step > 0.003:
        step /= 2
        tries = [fit_at(s, sections, q, scale, best[1] + d) for d in (-step, step)]
        best = min([best, *tries], key=lambda r: r[0])
    return best[1], best[2]


def fit_at(
    s: Sequence, sections: dict[str, Any], q: int, scale: Floats, start: float
) -> tuple[float, float, Floats]:
    """Sum of squares, the offset and the channels (T, 30) of the best scores at a phase offset."""
    use = scale * (np.arange(len(CHANNELS)) != CHANNELS.index("root_sway"))
    at = (np.arange(len(s.channels)) / s.period.frames + start) % 1.0
    base = curves(sections, at, np.zeros((len(at), 0)))
    parts = np.array([curves(sections, at, np.eye(q)[[k] * len(at)]) - base for k in range(q)]).reshape(
        q, *base.shape
    )
    design, goal = (parts * use).reshape(q, base.size), ((s.channels - base) * use).ravel()
    weight = np.linalg.solve(design @ design.T, design @ goal)
    return float(np.sum((goal - weight @ design) ** 2)), start, base + np.einsum("k,ktm->tm", weight, parts)


def evaluate(sequences: list[Sequence]) -> dict[str, Any]:
    """Errors by q and by subject."""
    subjects = sorted({s.subject for s in sequences})
    scale, rows = fit.channel_scale(), []
    for subject in subjects:
        learned = fit.fit([s for s in sequences if s.subject != subject], max(QS))
        sections = model.sections(learned, "walk", 1)
        for s in (s for s in sequences if s.subject == subject):
            own = {**sections, **own_sections(s)}
            floor = error(s, own, s.channels)
            start = None
            for q in QS:
                start, channels = best_channels(s, sections, q, scale, start)
                angle = np.sqrt(np.mean((channels - s.channels)[:, : len(ANGLES)] ** 2))
                kinds = {
                    "true": error(s, own, channels),
                    "generic": error(s, sections, channels),
                    "upright": error(s, sections, channels, upright=True),
                }
                rows.append({"subject": subject, "name": s.name, "q": q, "skeleton": floor, **kinds})
                rows[-1]["angle_deg"] = np.degrees(angle)
    return summary(rows, subjects)


def summary(rows: list[dict[str, Any]], subjects: list[str]) -> dict[str, Any]:
    """Means over sequences, by q; by subject for the generic lengths."""

    def mean(key: str, q: int, subject: str | None = None, joints: tuple[str, ...] = ()) -> float:
        use = [i for i, n in enumerate(JOINTS) if not joints or n.split("_")[-1] in joints]
        picked = [r[key] for r in rows if r["q"] == q and subject in (None, r["subject"])]
        return round(float(np.mean([np.mean(np.atleast_1d(v)[use if np.ndim(v) else 0]) for v in picked])), 1)

    table = [
        {
            "q": q,
            **{k: mean(k, q) for k in ("true", "generic", "upright", "angle_deg")},
            "elbow_wrist": mean("generic", q, joints=("elbow", "wrist")),
            "knee_ankle": mean("generic", q, joints=("knee", "ankle")),
            "subjects_true": {n: mean("true", q, n) for n in subjects},
            "subjects_generic": {n: mean("generic", q, n) for n in subjects},
        }
        for q in QS
    ]
    return {"skeleton_mm": mean("skeleton", QS[0]), "sequences": len(rows) // len(QS), "table": table}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", type=Path, help="folder of .amc files")
    parser.add_argument("--json", action="store_true", help="print JSON")
    args = parser.parse_args()
    result = evaluate([load(p) for p in sorted(args.source.rglob("*.amc"))])
    if args.json:
        print(json.dumps(result))
        return 0
    print(f"{result['sequences']} sequences; reduced skeleton with exact angles {result['skeleton_mm']} mm")
    for row in result["table"]:
        print(
            "q={q}: true {true} generic {generic} upright {upright} mm, angles {angle_deg} deg, "
            "elbow+wrist {elbow_wrist}, knee+ankle {knee_ankle} mm".format(**row)
        )
        for kind in ("true", "generic"):
            print(
                f"   by subject, {kind}: "
                + " ".join(f"{k}:{v:.0f}" for k, v in row[f"subjects_{kind}"].items())
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
