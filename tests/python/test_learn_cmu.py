"""Real recordings: periods and steady parts of the walks of CMU, and what is rejected."""

from pathlib import Path

import numpy as np
import pytest

from gait.body.skeleton import ANGLES, CHANNELS
from gait.errors import UserError
from gait.learn.cycles.sequence import load
from gait.learn.options import LearnOptions

pytestmark = pytest.mark.long

FPS = 120.0
MOCAP = Path(__file__).parents[2] / "../shared/data/mocap"


@pytest.fixture(scope="module")
def walks():
    """All walks, by name, and the reference for their periods, seconds."""
    table = MOCAP / "walk_periods.txt"
    if not table.is_file():
        pytest.skip(f"{table} is absent: the learning data are not part of the repository")
    lines = [line.split() for line in table.read_text().splitlines() if line[:2].isdigit()]
    reference = {words[0][:5]: float(words[words.index("period") + 1].rstrip("s")) for words in lines}
    return {name: load(MOCAP / f"cmu_walk/{name[:2]}/{name}.amc") for name in reference}, reference


def test_periods_agree_with_autocorrelation(walks):
    sequences, reference = walks
    assert len(sequences) == 51
    errors = {name: s.period.frames / FPS / reference[name] - 1 for name, s in sequences.items()}
    assert {name: error for name, error in errors.items() if abs(error) >= 0.02} == {}


def test_walks_that_speed_up_or_slow_down_lose_that_end_and_no_other_walk_a_frame(walks):
    sequences, _ = walks
    cut = {name: s.cut for name, s in sequences.items() if s.cut != ("", "")}
    assert cut == {
        "08_09": ("faster", ""),
        "16_31": ("slower", ""),
        "16_32": ("slower", ""),
        "38_01": ("slower", ""),
        "38_02": ("slower", ""),
    }
    for name in cut:
        assert 0 < sequences[name].kept[0] < 120 and sequences[name].cycles > 1.8


def test_every_walk_is_known_as_one(walks):
    sequences, _ = walks
    for s in sequences.values():
        assert s.verdict.accepted and s.verdict.activity == "walk" and s.verdict.reason == ""
        value = {e.name: e.value for e in s.verdict.evidence}
        assert value["flight"] < 0.01 and value["repeats"] > 0.85 and value["legs"] > 0.9
        assert 0.05 < value["lift"] < 0.15 and value["steps"] < 0.015


@pytest.mark.parametrize("root", [True, False])
def test_angles_alone_are_timed_and_judged_alike(walks, tmp_path, root):
    walk = walks[0]["16_16"]
    names = CHANNELS if root else ANGLES
    lengths = [name in ("root_forward", "root_sway", "root_height") for name in names]
    table = np.where(lengths, walk.channels[:, : len(names)], np.degrees(walk.channels[:, : len(names)]))
    head = [name if plain else f"{name}_deg" for name, plain in zip(names, lengths, strict=True)]
    rows = [f"{t},{t / FPS:.6f}," + ",".join(f"{v:.5f}" for v in row) for t, row in enumerate(table)]
    path = tmp_path / "16_angles.csv"
    path.write_text("\n".join([",".join(["frame", "time", *head]), *rows]) + "\n")
    again = load(path)
    assert again.measures is None and again.kept == walk.kept
    assert again.period.frames == pytest.approx(walk.period.frames, abs=0.01)
    assert again.strides.mean() == pytest.approx(walk.strides.mean(), rel=0.01)
    assert again.verdict.activity == ("walk" if root else "")
    assert np.isfinite(again.channels).all(axis=0).tolist() == [True] * len(names) + [False] * (
        30 - len(names)
    )


def test_standing_before_and_after_a_walk_is_cut(tmp_path):
    """The first and the last frame of 35_01 held for a second."""
    source = MOCAP / "cmu_walk/35"
    if not source.is_dir():
        pytest.skip(f"{source} is absent: the learning data are not part of the repository")
    lines = (source / "35_01.amc").read_text().splitlines()
    first, second = [i for i, line in enumerate(lines) if line.strip().isdigit()][:2]
    size = second - first
    frames = [lines[i + 1 : i + size] for i in range(first, len(lines), size)]
    held = [frames[0]] * 120 + frames + [frames[-1]] * 120
    numbered = [line for t, frame in enumerate(held, 1) for line in [str(t), *frame]]
    (tmp_path / "35.asf").write_text((source / "35.asf").read_text())
    path = tmp_path / "35_01.amc"
    path.write_text("\n".join([*lines[:first], *numbered]) + "\n")
    walk, whole = load(path), load(source / "35_01.amc")
    assert abs(walk.kept[0] - 120) < 30 and abs(walk.kept[1] - (120 + len(frames))) < 30
    assert "standing" in walk.cut[0] and "standing" in walk.cut[1]
    assert walk.period.frames == pytest.approx(whole.period.frames, rel=0.03)


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("01/01_14", "no steady motion"),  # climbing
        ("02/02_04", "no steady motion"),  # a jump, then balance
        ("02/02_05", r"a foot stays on the ground \(lift 0.0"),  # punching
        ("02/02_07", r"the cycles do not repeat \(repeats 0.4"),  # swordplay
        ("03/03_01", "no steady motion"),  # a walk up and down over uneven ground
        ("mjackson/131_01", "no steady motion"),  # dances
        ("mjackson/131_03", "no steady motion"),
        ("moderndance/md_02", "no steady motion"),
        ("moderndance/md_04", "no steady motion"),
    ],
)
def test_what_is_not_walking_is_refused_with_the_reason(file, reason):
    path = MOCAP / f"cmu_misc/{file}.amc"
    if not path.is_file():
        pytest.skip(f"{path} is absent: the learning data are not part of the repository")
    with pytest.raises(UserError, match=rf"{path.name}: not learnt as 'walk': .*{reason}"):
        load(path)


@pytest.mark.parametrize(("activity", "reason"), [("punch", "the cycles do not repeat"), ("jump", "steady")])
def test_other_activities_must_be_cyclic_too(activity, reason):
    path = MOCAP / {"punch": "cmu_misc/02/02_05.amc", "jump": "cmu_misc/02/02_04.amc"}[activity]
    if not path.is_file():
        pytest.skip(f"{path} is absent: the learning data are not part of the repository")
    with pytest.raises(UserError, match=reason):
        load(path, LearnOptions(activity=activity))


def test_a_lame_walk_with_gaps_is_a_walk():
    """The right hip swings over 55 degrees and the left over 11; both ends and some markers are not seen."""
    path = MOCAP / "c3d/PlugInC3D.c3d"
    if not path.is_file():
        pytest.skip(f"{path} is absent: the learning data are not part of the repository")
    sequence = load(path)
    assert sequence.verdict.activity == "walk" and sequence.cycles > 3
    assert sequence.period.frames / sequence.fps == pytest.approx(1.19, rel=0.01)
    evidence = {e.name: e.value for e in sequence.verdict.evidence}
    assert evidence["legs"] == pytest.approx(0.86, abs=0.05) and evidence["repeats"] > 0.9


def test_a_run_is_no_walk_and_a_walk_no_run():
    run, walk = (MOCAP / f"trc/motion_capture_{kind}.trc" for kind in ("run", "walk"))
    if not run.is_file():
        pytest.skip(f"{run} is absent: the learning data are not part of the repository")
    with pytest.raises(UserError, match="'walk': this is running: both feet leave the ground"):
        load(run)
    with pytest.raises(UserError, match="'running': this is not running"):
        load(walk, LearnOptions(activity="running"))
    sequence = load(run, LearnOptions(activity="jogging"))
    assert sequence.verdict.activity == "run" and sequence.period.frames == pytest.approx(69, abs=1)
    assert load(run, LearnOptions(activity="treadmill")).verdict.activity == "run"
