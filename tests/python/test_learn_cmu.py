"""Real recordings: periods and steady parts of the walks of CMU, and what is refused."""

from pathlib import Path

import pytest

from gait.errors import UserError
from gait.learn.reading import Reading
from gait.learn.sequence import load

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


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        ("01/01_14", "no steady motion"),  # climbing
        ("02/02_04", "no steady motion"),  # a jump, then balance
        ("02/02_05", r"a foot stays on the ground \(lift 0.0"),  # punching
        ("02/02_07", r"one cycle is not like the next \(repeats 0.4"),  # swordplay
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


@pytest.mark.parametrize(
    ("activity", "reason"), [("punch", "one cycle is not like the next"), ("jump", "steady")]
)
def test_other_activities_must_be_cyclic_too(activity, reason):
    path = MOCAP / {"punch": "cmu_misc/02/02_05.amc", "jump": "cmu_misc/02/02_04.amc"}[activity]
    if not path.is_file():
        pytest.skip(f"{path} is absent: the learning data are not part of the repository")
    with pytest.raises(UserError, match=reason):
        load(path, Reading(activity=activity))


def test_a_run_is_no_walk_and_a_walk_no_run():
    run, walk = (MOCAP / f"trc/motion_capture_{kind}.trc" for kind in ("run", "walk"))
    if not run.is_file():
        pytest.skip(f"{run} is absent: the learning data are not part of the repository")
    with pytest.raises(UserError, match="'walk': this is running: both feet leave the ground"):
        load(run)
    with pytest.raises(UserError, match="'running': this is not running"):
        load(walk, Reading(activity="running"))
    sequence = load(run, Reading(activity="jogging"))
    assert sequence.verdict.activity == "run" and sequence.period.frames == pytest.approx(69, abs=1)
    assert load(run, Reading(activity="treadmill")).verdict.activity == "run"
