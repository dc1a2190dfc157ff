"""Changes between classes of motion, counted in recordings whose changes are known."""

from __future__ import annotations

import csv
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from scipy.special import i0e, i1e

import gait
from gait.bindings.model import read_cyclic
from gait.body.skeleton import JOINTS
from gait.cli import main
from gait.learn.classes import changes
from gait.learn.classes.join import Change
from gait.learn.report.classes import figures, words
from gait.learn.solve.joints import from_joints
from gait.simulate.scenario import PRESETS
from gait.simulate.stage import set_stage

CLASSES = Path(gait.__file__).parent / "data/classes.gait"
MODEL = gait.Model("classes")
NAMES = MODEL.classes
FPS = 30.0
#: (rate per second, phases modulo half a stride) of the recordings below.
KNOWN = {
    ("walk", "stand"): (0.15, 0.2), ("stand", "walk"): (0.4, 0.3), ("walk", "run"): (0.15, 0.1),
    ("run", "walk"): (0.3, 0.4), ("stand", "backwards"): (0.4, 0.05), ("backwards", "stand"): (0.4, 0.15),
}  # fmt: skip
PHASE_SD, SHORTEST_S = 0.02, 0.5


def recording(seconds: float, rng: np.random.Generator) -> tuple[np.ndarray, list[str]]:
    """Joints (T, P, 3) of a person of the model who changes class at the rates and phases of `KNOWN`."""
    name, phase, place, joints, classes = "walk", 0.0, 0.0, [], []
    leave: dict[str, float] = {}
    for _ in range(round(seconds * FPS)):
        info = MODEL.class_info(NAMES.index(name))
        if not leave:
            after = [to for before, to in KNOWN if before == name]
            leave = {to: SHORTEST_S + rng.exponential(1 / KNOWN[name, to][0]) for to in after}
        phase = (phase + info.direction * info.stride_hz / FPS) % 1
        place += info.direction * info.stride_hz * info.stride_length * 1.75 / FPS
        state = gait.State(phase=phase, stature=1.75, stride_hz=info.stride_hz)
        state.motion_class, state.pelvis = NAMES.index(name), np.array([place, 0, 0])
        state.pelvis[2] = MODEL.pelvis_height(state)
        joints.append(MODEL.pose(state)[0])
        classes.append(name)
        leave = {to: left - 1 / FPS for to, left in leave.items()}
        to = min(leave, key=lambda one: leave[one])
        at = KNOWN[name, to][1] + rng.normal(0, PHASE_SD)
        near = abs((phase - at + 0.25) % 0.5 - 0.25) < 0.03
        if leave[to] <= 0 and (near or info.direction == 0):
            phase = phase if info.direction else at
            name, leave = to, {}
    return np.array(joints), classes


def write(path: Path, joints: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "time", *(f"{name}_{axis}" for name in JOINTS for axis in "xyz")])
        order = [MODEL.joint_names.index(name) for name in JOINTS]
        for frame, places in enumerate(joints):
            rows.writerow([frame, f"{frame / FPS:.6f}", *(f"{x:.4f}" for x in places[order].ravel())])


def test_known_changes_are_learnt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The rates and phases of the model are those of the recordings and the assumed ones together."""
    rng, count, seconds = np.random.default_rng(5), Counter[tuple[str, str]](), Counter[str]()
    for k in range(3):
        joints, classes = recording(70.0, rng)
        write(tmp_path / "in" / f"{k}_01.csv", joints)
        count.update((a, b) for a, b in pairwise(classes) if a != b)
        seconds.update(classes)
    out = tmp_path / "m.gait"
    assert main(["learn", str(CLASSES), "-o", str(out), "--changes", str(tmp_path / "in")]) == 0
    line = next(line for line in capsys.readouterr().err.splitlines() if "--changes: " in line)
    shown = re.search(r"--changes: (\d+) changes in 3 recordings: walk to stand (\d+), ", line)
    assert shown and abs(int(shown[1]) - count.total()) <= 0.2 * count.total()
    assert int(shown[1]) == sum(map(int, re.findall(r"[a-z] (\d+)", line.split("recordings: ")[1])))
    assumed, learnt = (read_cyclic(path)["CLSW"] for path in (CLASSES, out))
    assert min(count.values()) >= 3
    for (before, to), (_, phase) in KNOWN.items():
        at = NAMES.index(before), NAMES.index(to)
        prior, change = (Change(*map(float, one[at])) for one in (assumed, learnt))
        usual, found = (mean_rate(one) if before != "stand" else one.rate for one in (prior, change))
        mean = (2 + count[before, to]) / (2 / usual + seconds[before] / FPS)
        assert found == pytest.approx(mean, rel=0.12), (before, to)
        # the assumed phases count as two changes
        both = 2 * _vector(prior.phase, i1e(prior.concentration) / i0e(prior.concentration))
        both += count[before, to] * _vector(phase, np.exp(-0.5 * (4 * np.pi * PHASE_SD) ** 2))
        wanted = np.angle(both) / (4 * np.pi)
        assert (change.phase - wanted + 0.25) % 0.5 - 0.25 == pytest.approx(0, abs=0.03), (before, to)
        assert change.concentration > prior.concentration or prior.concentration > 0
    capsys.readouterr()
    assert main(["info", str(out)]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"class stand: .* walk [0-9.]+ \(\d+ changes\).* run [0-9.]+ \(0 changes\)", printed)
    assert gait.Model(out).classes == NAMES
    # a class that is made again has assumed changes again; others keep theirs
    made = tmp_path / "again.gait"
    assert main(["learn", str(out), "-o", str(made), "--class", "stand"]) == 0
    assert f"{out}: keeps its classes backwards run" in capsys.readouterr().err
    assert gait.Model(made).classes == NAMES
    again = read_cyclic(made)["CLSW"]
    stand = np.isin(np.arange(len(NAMES)), NAMES.index("stand"))
    stand = stand[:, None] | stand
    assert np.array_equal(again[stand], assumed[stand]) and np.array_equal(again[~stand], learnt[~stand])
    assert main(["info", str(made)]) == 0
    printed = capsys.readouterr().out
    assert "stand 1 (prior)" in printed and re.search(r"class walk: .* run [0-9.]+ \(\d+ changes\)", printed)


def mean_rate(change: Change) -> float:
    """The rate of `Change` over all phases and the paces of people, by quadrature."""
    phase = np.arange(1000) / 1000
    pace = np.clip(np.array([NormalDist().inv_cdf(p) for p in phase + 5e-4]), -2, 2)
    by_phase = np.exp(change.concentration * (np.cos(4 * np.pi * (phase - change.phase)) - 1))
    return float(change.rate * by_phase.mean() * np.exp(change.slope * pace).mean())


def test_a_learnt_rate_that_depends_on_the_pace_is_that_of_all_paces() -> None:
    """Of 30 changes in 100 s, with the pace and phase at which they are most likely assumed."""
    assumed = Change(0.3, 2.0, 0.1, slope=1.0)
    found = changes.learnt(assumed, 1, seconds=100.0, count=30, phasor=30 * _vector(0.1, 0.7))
    assert found.slope == 1.0 and found.phase == pytest.approx(0.1, abs=0.01)
    assert mean_rate(found) == pytest.approx((2 + 30) / (2 / mean_rate(assumed) + 100), rel=0.002)


def _vector(phase: float, length: float) -> complex:
    return length * np.exp(4j * np.pi * phase)


def test_a_simulated_stop_is_one_change_each_way() -> None:
    """The person of `gait simulate` has other curves than the model; the walk slows down over 0.8 s."""
    stage = set_stage(PRESETS["stopping"])
    body = from_joints(Path("stop"), stage.walk.points(stage.frames), FPS)
    observed = changes.count(read_cyclic(CLASSES), changes.frames_of(Path("a.csv"), body))
    assert observed.counts.tolist() == [[0, 1, 0, 0], [1, 0, 0, 0], [0] * 4, [0] * 4]


def test_a_rate_learnt_from_no_change_is_not_called_prior() -> None:
    sections = read_cyclic(CLASSES)
    none = np.zeros((len(NAMES), len(NAMES)))
    observed = changes.Observed(np.full(len(NAMES), 60.0), none.astype(int), none.astype(complex))
    learnt = figures(changes.with_changes(sections, observed))
    assert learnt[0]["changes_per_s"]["run"] < figures(sections)[0]["changes_per_s"]["run"]
    assert re.search(r"run [0-9.]+ \(0 changes\)", words(learnt[0])["changes per second"])
    assert "run 0.3 (prior)" in words(figures(sections)[0])["changes per second"]


def test_changes_need_classes_and_places(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["-o", str(tmp_path / "m.gait"), "--changes", str(tmp_path / "a.csv")]
    assert main(["learn", str(CLASSES.parent / "walk.gait"), *words]) == 2
    assert "--changes: are between classes of motion; give --class" in capsys.readouterr().err
    columns = ",".join(f"{s}_{j}_flexion_deg" for s in "lr" for j in ("hip", "knee"))
    angles = [[f"{20 * np.sin(0.2 * k + j):.2f}" for j in range(4)] for k in range(90)]
    rows = [",".join([f"{k},{k / 30:.4f}", *row]) for k, row in enumerate(angles)]
    (tmp_path / "a.csv").write_text("\n".join([f"frame,time,{columns}", *rows]))
    assert main(["learn", str(CLASSES), *words]) == 1
    assert "a.csv: has only angles; give recordings of places" in capsys.readouterr().err
    assert not (tmp_path / "m.gait").exists()
