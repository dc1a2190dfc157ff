"""Components of generated and recorded cycles against their wanted bounds (L8-L12), for learn_impute.py."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import table

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))
import learn_cases as cases

from gait.learn import fit, fpca, rank
from gait.learn.model import anova
from gait.learn.sequence import load
from gait.progress import progress

COLUMNS = ("", "case", "measure", "value", "wanted", "")
SEEDS = 5
Row = tuple[str, str, str, float | int, str, str]


def components(mocap: Path) -> bool:
    """Publish the table; False if a bound is missed."""
    parts = (_limbs, _seams, _angles, _scores, _passes, _numbers)
    rows: list[Row] = []
    with progress("components", len(parts) + 1, False) as update:
        for done, part in enumerate(parts):
            rows += part()
            update(done + 1)
        rows += _recorded(mocap)
    table.publish(
        "learn_components",
        "Components (L8-L12)",
        COLUMNS,
        rows,
        f"Generator G1, 80 cycles, 1 degree of noise; the worst of {SEEDS} sets. L8: half of the cycles lack "
        "a whole limb for half the cycle, or one of eight people lacks an angle or both arms in all cycles. "
        "L9: step across the seam over the usual step, for the curves and their first two differences. L11: "
        "eight people. auto: chosen is the smallest number within one standard error of the least error.",
    )
    return all(row[5] != "NO" for row in rows)


def _row(
    code: str, case: str, measure: str, value: float | int, most: float, least: float | None = None
) -> Row:
    good = value <= most and (least is None or value >= least)
    wanted = f"<= {most:g}" if least is None else f"{least:g} to {most:g}"
    return code, case, measure, value, wanted, "yes" if good else "NO"


def _rng(code: int, seed: int) -> np.random.Generator:
    return np.random.default_rng([code, seed])


def _limbs() -> Iterator[Row]:
    """L8: error where whole limbs or channels are missing, over the oracle's."""
    ratios: dict[str, list[float]] = {"limbs for half a cycle": [], "one person without an angle": []}
    ratios["one person without arms"] = []
    for seed in range(SEEDS):
        for name, ratio in ratios.items():
            rng = _rng(8, seed)
            case = cases.people(rng, missing=0.1)
            if name.startswith("limbs"):
                taken = cases.without_limbs(case, rng)
            else:
                angles = [10] if name.endswith("angle") else [3, 4, 5, 6, 11, 12, 13, 14]
                taken = cases.without_channel(case, angles, np.flatnonzero(case.subject == 3))
            found = fpca.fit(case.values, case.mask, 5).filled
            ratio.append(case.error(found, taken) / case.error(case.oracle(), taken))
    for name, ratio in ratios.items():
        yield _row("L8", name, "RMSE / oracle", max(ratio), 1.3)


def _seams() -> Iterator[Row]:
    """L9: curves of closing cycles and of some that creep by 6 degrees close."""
    for rise in (0.0, 6.0):
        mean, curves = [], []
        for seed in range(SEEDS):
            rows = cases.drifting(_rng(9, seed), rise=rise)
            found = fpca.fit(rows.values, rows.mask, 5)
            mean.append(cases.seam(found.mean))
            curves += [cases.seam(curve) for curve in found.curves]
        name = f"cycles that rise by {rise:g} degrees"
        yield _row("L9", name, "seam of the mean", max(mean), 2)
        yield _row("L9", name, "seam of components", max(curves), 2)


def _angles() -> Iterator[Row]:
    """L10: angles between the components and the generator's modes."""
    angles = []
    for seed in range(SEEDS):
        case = cases.walks(_rng(10, seed))
        angles.append(cases.principal_angles(case.modes, fpca.fit(case.values, case.mask, 5).curves))
    worst = np.sort(np.array(angles), axis=1).max(axis=0)
    yield _row("L10", "20 % missing", "largest principal angle, degrees", worst[-1], 5)
    yield _row("L10", "20 % missing", "third principal angle, degrees", worst[2], 2)


def _scores() -> Iterator[Row]:
    """L11: scores and their standard deviations between and within people."""
    correlation, spread, parts = [], [], []
    for seed in range(SEEDS):
        case = cases.people(_rng(11, seed))
        found = fpca.fit(case.values, case.mask, 5)
        scores = cases.mode_scores(case, found)
        correlation += [np.corrcoef(scores[:, k], case.scores[:, k])[0, 1] for k in range(5)]
        centred = case.scores - case.scores.mean(axis=0)
        true = np.linalg.svd(centred, compute_uv=False) / np.sqrt(len(centred) - 1)
        spread.append(np.abs(found.sd / np.sqrt(found.mean.size) / true - 1).max())
        pairs = zip(anova(scores, case.subject), anova(case.scores, case.subject), strict=True)
        parts.append([np.abs(a / b - 1).max() for a, b in pairs])
    between, within = np.max(parts, axis=0)
    yield _row("L11", "20 % missing", "least correlation of scores", min(correlation), 1, 0.99)
    yield _row("L11", "20 % missing", "error of sd, relative", max(spread), 0.05)
    yield _row("L11", "20 % missing", "error of sd between people, relative", between, 0.15)
    yield _row("L11", "20 % missing", "error of sd within people, relative", within, 0.15)


def _passes() -> Iterator[Row]:
    """L12: passes descend, stop and do not depend on where they began."""
    for share in (0.05, 0.2, 0.4):
        passes, rise, difference = [], [], []
        for seed in range(SEEDS):
            case = cases.walks(_rng(12, seed), missing=share)
            found = fpca.fit(case.values, case.mask, 5)
            other = fpca.fit(case.values, case.mask, 5, start=np.zeros(case.values.shape[1:]))
            passes += [len(found.objective), len(other.objective)]
            rise.append(max(np.diff(found.objective).max(), np.diff(other.objective).max()))
            difference.append(np.abs(found.filled - other.filled).max())
        name = f"{share:.0%} missing"
        yield _row("L12", name, "passes", max(passes), 99)
        yield _row("L12", name, "largest rise of the objective", max(0.0, *rise), 0)
        yield _row("L12", name, "mean or zero as start, degrees", max(difference), 1e-3)


def _numbers() -> Iterator[Row]:
    """The number of components found on generated walks."""
    by_blocks, by_people = [], []
    for seed in range(SEEDS):
        case = cases.people(_rng(13, seed))
        by_blocks.append(rank.choose(case.values, case.mask, _rng(14, seed))[0])
        by_people.append(rank.choose(case.values, case.mask, _rng(14, seed), case.subject)[0])
    for name, counts in (("blocks held out", by_blocks), ("people held out", by_people)):
        yield _row("auto", f"5 modes, {name}", "fewest components", min(counts), 6, 4)
        yield _row("auto", f"5 modes, {name}", "most components", max(counts), 6, 4)


def _recorded(mocap: Path) -> list[Row]:
    """The number of components found on recorded walks."""
    files = sorted(mocap.rglob("*.amc"))
    if not files:
        print(f"{mocap}: no .amc files; recorded walks are left out", file=sys.stderr)
        return []
    learned = fit.fit([load(path) for path in files])
    values, mask = learned.cycles.values * learned.scale, learned.cycles.mask
    rows: list[Any] = []
    for name, groups in (("blocks held out", None), ("people held out", learned.row_subject)):
        count, errors = rank.choose(values, mask, np.random.default_rng(1), groups)
        where = f"{len(files)} walks of CMU, {name}"
        rows.append(("auto", where, "components", count, "", ""))
        for q in (0, 2, 5, 8, rank.LARGEST):
            rows.append(("auto", where, f"RMSE with {q}, degrees", float(np.degrees(errors[q])), "", ""))
    return rows
