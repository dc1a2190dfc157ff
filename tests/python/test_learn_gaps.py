"""Scattered missing cells of joint positions: what is lost by them and what is not."""

from pathlib import Path

import marked_walker as mw
import mocap_files as files
import numpy as np
import pytest

import gait.cli
from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.learn.cycles import cycles, sequence
from gait.learn.mocap import marker_map, mocap_asf
from gait.learn.prior.fit import SAMPLES
from gait.learn.reading import Reading
from gait.learn.solve import body, gaps, joint_file, retarget

RATE = 120


@pytest.fixture(scope="module")
def walker(tmp_path_factory):
    return body.body(mocap_asf.read(files.write_toy(tmp_path_factory.mktemp("toy"), frames=480)))


def write(path, walker, share, seed=0, every=1, unseen=()):
    """Joint positions with a share of the cells empty, of every `every`-th frame, without the unseen."""
    rng = np.random.default_rng(seed)
    rows = [",".join(["time", *(f"{name}_{axis}" for name in joint_file.NEEDED for axis in "xyz")])]
    for t in sorted(set(range(0, walker.frames, every)) - set(unseen)):
        numbers = np.concatenate([walker.joints[name][t] for name in joint_file.NEEDED])
        cells = [f"{v:.5f}" if rng.random() >= share else "" for v in numbers]
        rows.append(",".join([f"{t / RATE:.6f}", *cells]))
    path.write_text("\n".join(rows) + "\n")
    return path


def sliced(found):
    return cycles.slice_cycles([found.channels], [found.period.frames], [0.0], SAMPLES)


@pytest.mark.parametrize("every", [1, 4])
def test_a_tenth_of_the_cells_costs_hardly_a_cycle(walker, tmp_path, every):
    rows = sliced(sequence.load(write(tmp_path / "a_1.csv", walker, 0.1, every=every)))
    assert len(rows.values) >= 3 and rows.mask.mean() > 0.85


def test_angles_of_bridged_positions_are_those_of_all(walker, tmp_path):
    whole, part = (joint_file.read_csv(write(tmp_path / "a.csv", walker, share)) for share in (0, 0.1))
    measures = retarget.measure(whole)
    error = np.degrees(retarget.angles(part, measures) - retarget.angles(whole, measures))
    assert np.isfinite(error).mean() > 0.98
    assert np.sqrt(np.nanmean(error**2, axis=0)).max() < 1.0


def test_long_gaps_and_ends_stay_missing():
    t = np.arange(120) / RATE
    places = np.stack([np.sin(6 * t), np.cos(6 * t), t], axis=1)
    holed = places.copy()
    holed[:3, 1], holed[20:30, 0], holed[50:70, 2] = np.nan, np.nan, np.nan
    result = gaps.bridged(holed, RATE)
    assert np.flatnonzero(np.isnan(result).all(axis=1)).tolist() == [0, 1, 2, *range(50, 70)]
    assert np.nanmax(np.abs(result - places)) < 3e-3


def test_a_recording_of_which_too_little_is_seen_is_refused(walker, tmp_path):
    unseen = [t for t in range(1, 479) if t % 40 > 12]
    with pytest.raises(UserError, match=r"a_1.csv: .*too little is seen"):
        sequence.load(write(tmp_path / "a_1.csv", walker, 0, unseen=unseen), Reading(activity="dance"))


@pytest.mark.parametrize("missing", [0.0, 0.5, 0.58, 0.65, 0.9])
def test_the_fewest_cycles_are_those_of_the_worst_beginning(missing):
    rng = np.random.default_rng(3)
    z = rng.normal(size=(250, 30))
    z[rng.random(250) < missing] = np.nan
    made = [len(cycles.slice_cycles([z], [100.0], [o], 50).values) for o in np.arange(0, 100, 2.0)]
    assert cycles.fewest(z, 100.0, 50) == min(made)


def test_what_no_recording_shows_is_said(tmp_path, capsys):
    legs = [k for k, name in enumerate(ANGLES) if "hip" in name or "knee" in name]
    rows = [",".join(["time", *(f"{ANGLES[k]}_deg" for k in legs)])]
    for t, pose in enumerate(np.degrees(mw.walk_angles(480, 100.0))):
        rows.append(",".join([f"{t / 100:.2f}", *(f"{pose[k]:.4f}" for k in legs)]))
    (tmp_path / "legs.csv").write_text("\n".join(rows) + "\n")
    model = tmp_path / "legs.gait"
    assert gait.cli.main(["learn", str(tmp_path / "legs.csv"), "-o", str(model)]) == 0
    lines = capsys.readouterr().err.splitlines()
    line = next(x for x in lines if x.endswith("these stay in the rest pose"))
    assert "l_shoulder" in line and "torso" in line and "l_hip" not in line
    assert gait.cli.main(["info", str(model)]) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("never observed"))
    assert "l_shoulder" in line and "l_hip" not in line


def test_the_example_of_a_mapping_is_read(tmp_path):
    page = Path(__file__).parents[2] / "libgait/doc/reference/files.md"
    text = page.read_text(encoding="utf-8").split("### Marker maps")[1]
    example = text.split("```json")[1].split("```")[0]
    (tmp_path / "map.json").write_text(example)
    table = marker_map.read(tmp_path / "map.json")
    assert table["clustera"].segment == "l_thigh" and "lwra" not in table
