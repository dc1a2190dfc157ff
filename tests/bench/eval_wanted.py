"""What the tracker must show: each measure with its target and the result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from eval_clips import OUTDOOR
from eval_plan import BASE
from eval_table import MEDIAPIPE

Rows = list[dict[str, Any]]
TOWARD = "toward300"
AUTO = "default/auto"
ROOT, ROOT_WORST, ABSOLUTE = 25, 40, 45  # mm
BELOW_FREE = 0.4  # of the error of the mean cycle that runs freely
STARTS = {AUTO: "auto", "default/images": "without the detector"}


@dataclass(frozen=True)
class Verdict:
    """One line; `passed` is None if no run shows it."""

    measure: str
    wanted: str
    reached: str
    passed: bool | None

    @property
    def word(self) -> str:
        """Word that is printed."""
        return {True: "pass", False: "FAIL", None: "-"}[self.passed]


def verdicts(rows: Rows) -> list[Verdict]:
    """All lines; those that no run shows state so."""
    return [check(rows) for check in _CHECKS]


def missed(rows: Rows) -> list[str]:
    """Measures of the lines that fail."""
    return [verdict.measure for verdict in verdicts(rows) if verdict.passed is False]


def grid(lines: list[Verdict]) -> list[list[str]]:
    """Head and lines for a table."""
    head = ["measure", "wanted", "reached", ""]
    return [head, *([v.measure, v.wanted, v.reached, v.word] for v in lines)]


def _of(rows: Rows, arm: str, outdoor: bool | None = False) -> Rows:
    chosen = [row for row in rows if row["arm"] == arm and not row["empty"]]
    return chosen if outdoor is None else [row for row in chosen if (row["clip"] == OUTDOOR) == outdoor]


def per_clip(rows: Rows, name: str) -> dict[str, float]:
    """Median over the seeds of each clip; infinite if a run failed."""
    out = {}
    for clip in dict.fromkeys(row["clip"] for row in rows):
        runs = [row for row in rows if row["clip"] == clip]
        values = [np.inf if row["failure"] else row[name] for row in runs]
        known = [value for value in values if value is not None]
        if known:
            out[clip] = float(np.median(known))
    return out


def _nothing(measure: str, wanted: str, how: str) -> Verdict:
    return Verdict(measure, wanted, f"not run: {how}", None)


def _root(rows: Rows) -> Verdict:
    measure, wanted = (
        "root-aligned median per clip, mm",
        f"median over clips <= {ROOT}, none above {ROOT_WORST}",
    )
    clips = per_clip(_of(rows, BASE), "root_mm")
    if not clips:
        return _nothing(measure, wanted, "--modes default --init truth")
    middle, worst = np.median(list(clips.values())), max(clips, key=lambda c: clips[c])
    reached = f"{middle:.1f}; worst {worst} {clips[worst]:.1f}"
    return Verdict(measure, wanted, reached, bool(middle <= ROOT and clips[worst] <= ROOT_WORST))


def _abs(rows: Rows) -> Verdict:
    measure, wanted = "absolute median per clip, mm", f"median over clips <= {ABSOLUTE}, toward300 <= 150"
    clips = per_clip(_of(rows, BASE), "abs_mm")
    if not clips:
        return _nothing(measure, wanted, "--modes default --init truth")
    middle = np.median(list(clips.values()))
    toward = [value for clip, value in clips.items() if clip.startswith(TOWARD)]
    reached = f"{middle:.0f}" + "".join(f"; {TOWARD} {value:.0f}" for value in toward)
    return Verdict(measure, wanted, reached, bool(middle <= ABSOLUTE and all(v <= 150 for v in toward)))


def _free(rows: Rows) -> Verdict:
    measure = "root-aligned error below that of the mean cycle that runs freely"
    wanted = f">= {100 * BELOW_FREE:.0f} % on every clip"
    runs = _of(rows, BASE)
    clips, free = per_clip(runs, "root_mm"), per_clip([r for r in runs if not r["failure"]], "free_mm")
    if not clips:
        return _nothing(measure, wanted, "--modes default --init truth")
    below = {clip: 1 - value / free.get(clip, 1) for clip, value in clips.items()}
    worst = min(below, key=lambda clip: below[clip])
    reached = f"{100 * below[worst]:.0f} to {100 * max(below.values()):.0f} %; worst {worst}"
    return Verdict(measure, wanted, reached, below[worst] >= BELOW_FREE)


def _stature(rows: Rows) -> Verdict:
    measure = "the same with a wrong stature in the start (standard deviation 30 mm instead of 3)"
    wanted = "<= 110 mm; px unchanged (within 10 %)"
    wrong = [row for row in rows if row["arm"].startswith("stature ")]
    if not wrong:
        return _nothing(measure, wanted, "--stature-error 0.05")
    far = float(np.median(list(per_clip(_dev(wrong), "abs_mm").values())))
    base, off = (np.median(list(per_clip(_dev(r), "px").values())) for r in (_of(rows, BASE), wrong))
    reached = f"{far:.0f} mm; {base:.2f} -> {off:.2f} px"
    return Verdict(measure, wanted, reached, bool(far <= 110 and off <= 1.1 * base))


def _lost(rows: Rows) -> Verdict:
    measure, wanted = "lost frames; lost runs", "<= 1 %; 0"
    runs = _of(rows, BASE)
    if not runs:
        return _nothing(measure, wanted, "--modes default --init truth")
    share, twice = (float(np.mean([row[key] for row in runs])) for key in ("lost_pct", "lost2_pct"))
    lost = sum(row["lost_run"] for row in runs)
    reached = f"{share:.1f} % ({twice:.1f} % with frames under tracking twice); {lost} of {len(runs)}"
    return Verdict(measure, wanted, reached, twice <= 1 and lost == 0)


def _phase(rows: Rows) -> Verdict:
    measure, wanted = "phase error median of every clip; half-cycle flips", "<= 1.5 %; 0"
    runs = _of(rows, BASE)
    if not runs:
        return _nothing(measure, wanted, "--modes default --init truth")
    clips = per_clip(runs, "phase_pct")
    middle, worst = np.median(list(clips.values())), max(clips, key=lambda c: clips[c])
    flipped = sum((row["flips_pct"] or 0) > 0 for row in runs)
    reached = f"{middle:.1f} %, worst {worst} {clips[worst]:.1f} %; {flipped} runs with flipped frames"
    return Verdict(measure, wanted, reached, bool(clips[worst] <= 1.5 and flipped == 0))


def _locked(rows: Rows, arm: str) -> Verdict:
    measure, wanted = f"{STARTS[arm]}: phase locked within 1 s", "all"
    runs = _of(rows, arm, None)
    if not runs:
        return _nothing(measure, wanted, "--modes default")
    good = sum(row["locked"] is True for row in runs)
    return Verdict(measure, wanted, f"{good} of {len(runs)}", good == len(runs))


def _side(rows: Rows, arm: str) -> Verdict:
    measure = (
        f"{STARTS[arm]}: left and right correct under tracking, or ambiguous, in most frames after the first "
        "second; wrong: over 5 % of them swapped under tracking"
    )
    wanted = ">= 95 %; wrong in <= 1 run of 28"
    runs = _of(rows, arm, None)
    if not runs:
        return _nothing(measure, wanted, "--modes default")
    counts = {side: sum(row["side"] == side for row in runs) for side in ("right", "open", "wrong")}
    silent = len(runs) - counts["right"] - counts["open"]
    reached = f"right {counts['right']}, ambiguous {counts['open']}, wrong or failed {silent} of {len(runs)}"
    return Verdict(measure, wanted, reached, silent <= 0.05 * len(runs) and silent <= max(1, len(runs) / 28))


def _coverage(rows: Rows) -> Verdict:
    measure, wanted = "coverage of the 90 % intervals", "0.80-0.95"
    clips = per_clip(_of(rows, BASE), "cover90")
    if not clips:
        return _nothing(measure, wanted, "--modes default --init truth")
    mean, low = float(np.mean(list(clips.values()))), min(clips, key=lambda c: clips[c])
    reached = f"{mean:.2f}; least {low} {clips[low]:.2f}"
    auto = [row["cover90"] for row in _of(rows, AUTO) if row["cover90"] is not None]
    if auto:
        reached += f" (auto: {np.mean(auto):.2f}, least run {min(auto):.2f})"
    return Verdict(measure, wanted, reached, 0.80 <= mean <= 0.95)


def _no_plate(rows: Rows) -> Verdict:
    measure, wanted = "no background plate", "root within 10 % of that with a plate, no run lost"
    verdict = _against_base(rows, "background none", measure, wanted, "--background none")
    extra = _beside(rows, "background none")
    return replace(verdict, reached="; ".join([verdict.reached, *extra]))


def _beside(rows: Rows, arm: str) -> list[str]:
    """Effect of an arm on errors that are not judged: absolute in the worst clip, pixels in the real one."""
    base, other = (per_clip(_of(rows, name), "abs_mm") for name in (BASE, arm))
    pairs = {clip: (base[clip], other[clip]) for clip in other if clip in base}
    reported = []
    if pairs:
        worst = max(pairs, key=lambda clip: pairs[clip][1] - pairs[clip][0])
        reported.append("absolute, worst change {} {:.0f} -> {:.0f} mm".format(worst, *pairs[worst]))
    before, after = (per_clip(_of(rows, name, True), "clear_px").get(OUTDOOR) for name in (BASE, arm))
    if before is not None and after is not None:
        reported.append(f"real clip {before:.1f} -> {after:.1f} px")
    return reported


def _slower(rows: Rows) -> Verdict:
    measure, wanted = "15 and 10 frames/s", "root within 10 %"
    found = [_against_base(rows, f"every {k}", measure, wanted, "--every 2 3") for k in (2, 3)]
    reported = [v for v in found if v.passed is not None]
    if not reported:
        return found[0]
    passed = all(v.passed for v in reported) if len(reported) == 2 else None
    return Verdict(measure, wanted, "; ".join(v.reached for v in reported), passed)


def _against_base(rows: Rows, arm: str, measure: str, wanted: str, how: str) -> Verdict:
    runs = _of(rows, arm)
    base, other = (per_clip(r, "root_mm") for r in (_of(rows, BASE), runs))
    if not base or not other:
        return _nothing(measure, wanted, how)
    before, after = (float(np.median([clips[c] for c in other if c in base])) for clips in (base, other))
    lost = sum(row["lost_run"] for row in _of(rows, arm, None))
    reached = f"{arm}: {before:.1f} -> {after:.1f} mm ({100 * (after / before - 1):+.0f} %), {lost} lost"
    return Verdict(measure, wanted, reached, after <= 1.1 * before and lost == 0)


def _outdoor(rows: Rows) -> Verdict:
    measure, wanted = "real clip: px to near hip, knee, ankle / clear joints", "<= 11 / <= 14"
    runs = _of(rows, BASE, True)
    if not runs:
        return _nothing(measure, wanted, "--clips outdoor")
    near, clear = (next(iter(per_clip(runs, key).values()), np.inf) for key in ("near_px", "clear_px"))
    return Verdict(measure, wanted, f"{near:.1f} / {clear:.1f}", near <= 11 and clear <= 14)


def _events(rows: Rows) -> Verdict:
    measure, wanted = "real clip: heel strikes within 2 frames; stride time", "all; <= 2 % off"
    runs = [row for row in _of(rows, BASE, True) if row["strikes_pct"] is not None]
    if not runs:
        return _nothing(measure, wanted, "--clips outdoor")
    met = [row["strikes_pct"] for row in runs]
    stride = [np.inf if row["stride_pct"] is None else row["stride_pct"] for row in runs]
    worst = max(row["strike_worst"] for row in runs)
    reached = f"{np.mean(met):.0f} %, worst {worst:.1f} frames; {np.median(stride):.1f} %"
    return Verdict(measure, wanted, reached, bool(min(met) == 100 and np.median(stride) <= 2))


def _mediapipe(rows: Rows) -> Verdict:
    measure, wanted = "12 joints root-aligned, mm, beside MediaPipe's", "(84-127)"
    clips = {c: v for c, v in per_clip(_of(rows, BASE), "root12_mm").items() if c in MEDIAPIPE}
    if not clips:
        return _nothing(measure, wanted, "--modes default --init truth")
    reached = ", ".join(f"{value:.0f} ({MEDIAPIPE[clip]})" for clip, value in clips.items())
    return Verdict(measure, wanted, reached, None)


def _dev(rows: Rows) -> Rows:
    return [row for row in rows if row["clip"] != OUTDOOR]


_CHECKS: list[Callable[[Rows], Verdict]] = [
    *(_root, _abs, _free, _stature, _lost, _phase),
    *(partial(check, arm=arm) for arm in STARTS for check in (_locked, _side)),
    *(_coverage, _no_plate, _outdoor, _events, _slower, _mediapipe),
]
