"""Ablation: what each likelihood term and feature is worth, by switching it off with the public settings."""

from __future__ import annotations

from typing import Any

import numpy as np
from eval_plan import BASE

from gait import Term, TrackerConfig

Rows = list[dict[str, Any]]
Runs = dict[tuple[str, int], dict[str, Any]]

# feature: settings that switch it off; skipped if this version lacks them or has the feature off already
_FEATURES: dict[str, dict[str, Any]] = {
    "components": {"components": 0},
    "score noise": {"coef_noise": 0.0},
    "score return": {"coef_time": 0.0},
    "posture": {"offset_angles": 0},
    "limb proportions": {"proportions": 0},
    "stature search": {"stature_noise": 0.0, "stature_noise_start": 0.0},
    "turning": {"turn_time": 0.0},
    "tilt": {"tilt_noise": 0.0},
    "frames alike": {"evidence_time": 0.0},
    "rejuvenation": {"rejuvenation_time": 0.0},
    "rate return": {"rate_time": 0.0},
    "missed foreground": {"missed_weight": 0.0},
}
MEASURES = {
    "root_mm": "root mm",
    "abs_mm": "abs mm",
    "any_px": "px",
    "lost_pct": "lost %",
    "crps_mm": "crps mm",
}
_DRAWS = 4000


def switches(config: TrackerConfig) -> dict[str, dict[str, Any]]:
    """Name of each feature that is on in `config`: the settings that switch it off."""
    out: dict[str, dict[str, Any]] = {}
    for term in Term:
        if term in config.terms and config.terms != term:
            out[f"{term.name.lower()}"] = {"terms": config.terms & ~term}
    for name, off in _FEATURES.items():
        if all(hasattr(config, key) for key in off) and any(getattr(config, k) != v for k, v in off.items()):
            out[name] = off
    return out


def costs(rows: Rows) -> list[dict[str, Any]]:
    """For each arm that is not the base: mean change with a 95 % interval, worst first."""
    base = _by_run(rows, BASE)
    arms = dict.fromkeys(r["arm"] for r in rows if r["arm"].startswith("no "))
    out = [_line(arm[3:], base, _by_run(rows, arm)) for arm in arms]
    return sorted(out, key=lambda line: -(line["root_mm"] or (-np.inf,))[0])


def changes(before: Rows, after: Rows) -> list[dict[str, Any]]:
    """For each arm in both evaluations: what changed from one to the other, paired by clip and seed."""
    arms = [a for a in dict.fromkeys(r["arm"] for r in after) if any(r["arm"] == a for r in before)]
    return [_line(arm, _by_run(before, arm), _by_run(after, arm)) for arm in arms]


def _by_run(rows: Rows, arm: str) -> Runs:
    return {(r["clip"], r["seed"]): r for r in rows if r["arm"] == arm}


def _line(name: str, base: Runs, runs: Runs) -> dict[str, Any]:
    line: dict[str, Any] = {"name": name}
    line["refused"] = next((r["failure"] for r in runs.values() if r["failure"]), "")
    for measure in MEASURES:
        table = _differences(base, runs, measure)
        line[measure] = None if table is None else interval(table)
    return line


def _differences(base: Runs, runs: Runs, name: str) -> np.ndarray | None:
    """Run minus base (clips, seeds), for clips where both are known with every seed."""
    clips: dict[str, list[float]] = {}
    for (clip, seed), row in runs.items():
        before = base.get((clip, seed))
        if before is not None and before[name] is not None and row[name] is not None:
            clips.setdefault(clip, []).append(row[name] - before[name])
    most = max((len(v) for v in clips.values()), default=0)
    whole = [v for v in clips.values() if len(v) == most]
    return np.array(whole) if whole else None


def interval(differences: np.ndarray) -> tuple[float, float, float]:
    """Mean and 95 % bootstrap interval: clips are drawn with replacement, then seeds within each.

    Parameters
    ----------
    differences : ndarray of shape (clips, seeds)
        Paired: the same clip and seed with and without.
    """
    rng = np.random.default_rng(1)
    clips, seeds = differences.shape
    which = rng.integers(clips, size=(_DRAWS, clips, 1))
    draws = differences[which, rng.integers(seeds, size=(_DRAWS, clips, seeds))].mean(axis=(1, 2))
    low, high = np.percentile(draws, [2.5, 97.5])
    return float(differences.mean()), float(low), float(high)


def grid(lines: list[dict[str, Any]]) -> list[list[str]]:
    """Head and lines: positive is an increase; a star where the interval excludes 0."""
    head = ["", "failed", *MEASURES.values()]
    return [head, *([line["name"], line["refused"], *map(_cell, _values(line))] for line in lines)]


def _values(line: dict[str, Any]) -> list[tuple[float, float, float] | None]:
    return [line[name] for name in MEASURES]


def _cell(value: tuple[float, float, float] | None) -> str:
    if value is None:
        return ""
    mean, low, high = value
    return f"{mean:+.1f} [{low:+.1f}, {high:+.1f}]" + ("*" if low > 0 or high < 0 else " ")
