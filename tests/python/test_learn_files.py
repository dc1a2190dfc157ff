"""Recordings with few frames, implausible values or scattered gaps."""

from pathlib import Path

import gait_generator as g
import marked_person as mw
import mocap_files as files
import numpy as np
import pytest
from test_learn_joint_file import write_csv
from test_marker_files import write_c3d, write_trc

import gait.cli
from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.learn.cycles import cutting, sequence
from gait.learn.cycles.sequence import load
from gait.learn.mocap import acclaim, markers, tables
from gait.learn.options import LearnOptions
from gait.learn.prior.fit import CYCLE_SAMPLES
from gait.learn.solve import body, joints, readers, retarget
from gait.learn.solve.body import from_bones

FEW = "too few frames ({}); a recording of a few seconds is needed"
LEGS = [f"{s}_{joint}_flexion" for s in "lr" for joint in ("hip", "knee")]


def amc(folder, frames):
    return files.write_toy(folder, "77_01", frames=frames)


def bvh(folder, frames):
    head, motion = files.bvh_from_amc(files.write_toy(folder, frames=10)).split("Frames: 10\n")
    path = folder / "77_01.bvh"
    path.write_text("\n".join([f"{head}Frames: {frames}", *motion.splitlines()[: 1 + frames], ""]))
    return path


def c3d(folder, frames):
    return write_c3d(folder / "a.c3d", mw.LOWER, mw.person(mw.LOWER, frames=10)[0][:frames])


def trc(folder, frames):
    return write_trc(folder / "a.trc", mw.LOWER, mw.person(mw.LOWER, frames=10)[0][:frames])


def joint_table(folder, frames):
    person = from_bones(acclaim.read(files.write_toy(folder, frames=10)))
    path = write_csv(folder / "a.csv", person)
    path.write_text("\n".join(path.read_text().splitlines()[: 1 + frames]) + "\n")
    return path


def angles(folder, frames):
    rows = [f"{t},{t / 100:.2f},{t},{2 * t},{-t},{5 + t}" for t in range(frames)]
    path = folder / "a.csv"
    path.write_text("\n".join([",".join(["frame", "time", *(f"{n}_deg" for n in LEGS)]), *rows]) + "\n")
    return path


KINDS = (amc, bvh, c3d, trc, joint_table, angles)
#: ezc3d writes no .c3d without frames.
CASES = [(kind, frames) for kind in KINDS for frames in range(5) if (kind, frames) != (c3d, 0)]


@pytest.mark.parametrize("trim", [True, False])
@pytest.mark.parametrize(("kind", "frames"), CASES, ids=lambda value: getattr(value, "__name__", str(value)))
def test_a_file_of_few_frames_is_refused_in_one_line(tmp_path, kind, frames, trim):
    path = kind(tmp_path, frames)
    with pytest.raises(UserError) as refused:
        load(path, LearnOptions(trim=trim))
    line = str(refused.value)
    assert line.startswith(str(path)) and "\n" not in line
    assert (FEW.format(frames) in line) == (frames < 3)
    assert frames < 3 or "no cycle found" in line


def test_among_good_walks_it_is_left_out(tmp_path, capsys):
    for k in range(2):
        files.write_toy(tmp_path, f"01_{k}", seed=k, frames=400)
    amc(tmp_path, 2)
    words = ["learn", str(tmp_path), "-o", str(tmp_path / "m.gait"), "--components", "1"]
    assert gait.cli.main(words) == 0
    out, err = capsys.readouterr()
    assert "2 sequences" in out and f"77_01.amc: {FEW.format(2)}" in err and err.count("\n") == 1


@pytest.mark.parametrize("fps", [10, 12, 15, 25])
def test_few_frames_per_second_are_enough(tmp_path, fps):
    """Whole cycles are used, and between the frames they are near the curves that were sampled."""
    period = 1.1 * fps
    path = files.write_toy(tmp_path, frames=8 * fps, period=period, offset=0.0, speed=1.2 * 120 / fps)
    sequence = load(path, LearnOptions(fps=fps))
    assert sequence.period.frames == pytest.approx(period, rel=0.02)
    cut = cutting.cut_cycles([sequence.channels], np.array([period]), np.zeros(1), 128)
    assert len(cut.values) >= 6 and cut.mask[1:-1].all()


@pytest.mark.parametrize("fps", [12, 15, 120])
def test_a_missing_frame_is_a_gap_at_every_rate(fps):
    period = 1.1 * fps
    u = np.arange(-0.2 * period, 1.3 * period) / period
    z = g.mean_curves(u)
    first = round(0.7 * period)
    last = first + max(1, round(0.1 * period))
    z[first:last] = np.nan
    values, mask = cutting.resample(u, z, 128, 1 / period)
    grid = np.arange(128) / 128
    hole = (grid > u[first - 1]) & (grid < u[last])
    assert not mask[hole].any() and mask[~hole].all()
    error = (values - g.mean_curves(grid))[~hole]
    assert np.sqrt(np.mean(error**2)) < 1.5  # degrees


def damaged(path, change):
    """Change a file's lines."""
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    return path


def put(row, column, value, separator=None):
    """Return a change that sets one word of one line."""

    def change(lines):
        cells = lines[row].split(separator)
        cells[column] = value
        return [*lines[:row], (separator or " ").join(cells), *lines[row + 1 :]]

    return change


def table(path, columns, rows=40):
    """Write a table of ones over time."""
    lines = [",".join(["time", *columns])]
    lines += [",".join([f"{t / 100:.2f}", *["1"] * len(columns)]) for t in range(rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("value", ["1e300", "-99999"])
@pytest.mark.parametrize(
    "column", ["l_hip_flexion_deg", "l_hip_flexion_rad", "l_hip_flexion", "root_forward", "l_hip_x"]
)
def test_tables(tmp_path, column, value):
    legs = [f"{s}_{joint}_flexion_deg" for s in "lr" for joint in ("hip", "knee")]
    path = table(tmp_path / "a.csv", [column, *(name for name in legs if not name.startswith(column))])
    words = rf"a\.csv(:21|: frame 20): {column} .* at most \d+ (\w+ )?(is|are) plausible"
    with pytest.raises(UserError, match=words):
        readers.read(damaged(path, put(20, 1, value, ",")))


@pytest.mark.parametrize("word", ["abc", "inf", "-Infinity", "1e999", "1.2.3"])
def test_words_are_no_numbers(tmp_path, word):
    path = table(tmp_path / "a.csv", ["l_knee_flexion_deg"])
    with pytest.raises(UserError, match=f"a.csv:8: l_knee_flexion_deg: '{word}' is not a number"):
        readers.read(damaged(path, put(7, 1, word, ",")))


@pytest.mark.parametrize(
    ("bone", "words"), [("root", "frame 3: root tx .* metres"), ("lfemur", "frame 3: lfemur rx .* degrees")]
)
def test_amc(tmp_path, bone, words):
    path = files.write_toy(tmp_path, frames=5)
    row = [i for i, line in enumerate(path.read_text().splitlines()) if line.startswith(f"{bone} ")][2]
    with pytest.raises(UserError, match=words):
        readers.read(damaged(path, put(row, 1, "1e300")))


def test_amc_in_radians_is_reported(tmp_path):
    path = files.write_toy(tmp_path, frames=5)
    path.write_text(path.read_text().replace(":DEGREES", ":RADIANS"))
    with pytest.raises(UserError, match=r"degrees \(radians in the file\); at most"):
        readers.read(path)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [(0, "1e300", "frame 5: root .position .* metres"), (4, "1e308", "frame 5: root .rotation .* degrees")],
)
def test_bvh(tmp_path, column, value, words):
    path = tmp_path / "a.bvh"
    path.write_text(files.bvh_from_amc(files.write_toy(tmp_path, frames=5)))
    with pytest.raises(UserError, match=words):
        readers.read(damaged(path, put(-1, column, value)))


RATE = 120


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    return body.from_bones(acclaim.read(files.write_toy(tmp_path_factory.mktemp("toy"), frames=480)))


def write(path, person, share, seed=0, every=1, unseen=()):
    """Joint positions of every `every`-th frame with a share of empty cells, without the joints `unseen`."""
    rng = np.random.default_rng(seed)
    rows = [",".join(["time", *(f"{name}_{axis}" for name in tables.TABLE_JOINTS for axis in "xyz")])]
    for t in sorted(set(range(0, person.frames, every)) - set(unseen)):
        numbers = np.concatenate([person.joints[name][t] for name in tables.TABLE_JOINTS])
        cells = [f"{v:.5f}" if rng.random() >= share else "" for v in numbers]
        rows.append(",".join([f"{t / RATE:.6f}", *cells]))
    path.write_text("\n".join(rows) + "\n")
    return path


def sliced(found):
    return cutting.cut_cycles([found.channels], [found.period.frames], [0.0], CYCLE_SAMPLES)


@pytest.mark.parametrize("every", [1, 4])
def test_a_tenth_of_the_cells_costs_hardly_a_cycle(person, tmp_path, every):
    rows = sliced(sequence.load(write(tmp_path / "a_1.csv", person, 0.1, every=every)))
    assert len(rows.values) >= 3 and rows.mask.mean() > 0.85


def test_angles_of_bridged_positions_are_those_of_all(person, tmp_path):
    whole, part = (joints.from_table(write(tmp_path / "a.csv", person, share)) for share in (0, 0.1))
    measures = retarget.measure(whole)
    error = np.degrees(retarget.angles(part, measures) - retarget.angles(whole, measures))
    assert np.isfinite(error).mean() > 0.98
    assert np.sqrt(np.nanmean(error**2, axis=0)).max() < 1.0


def test_long_gaps_and_ends_stay_missing():
    t = np.arange(120) / RATE
    places = np.stack([np.sin(6 * t), np.cos(6 * t), t], axis=1)
    holed = places.copy()
    holed[:3, 1], holed[20:30, 0], holed[50:70, 2] = np.nan, np.nan, np.nan
    result = joints.bridged(holed, RATE)
    assert np.flatnonzero(np.isnan(result).all(axis=1)).tolist() == [0, 1, 2, *range(50, 70)]
    assert np.nanmax(np.abs(result - places)) < 3e-3


def test_a_recording_with_too_few_observations_is_refused(person, tmp_path):
    unseen = [t for t in range(1, 479) if t % 40 > 12]
    with pytest.raises(UserError, match=r"a_1.csv: .*too little of each cycle"):
        sequence.load(write(tmp_path / "a_1.csv", person, 0, unseen=unseen), LearnOptions(activity="dance"))


@pytest.mark.parametrize("missing", [0.0, 0.5, 0.58, 0.65, 0.9])
def test_the_fewest_cycles_are_those_of_the_worst_start(missing):
    rng = np.random.default_rng(3)
    z = rng.normal(size=(250, 30))
    z[rng.random(250) < missing] = np.nan
    made = [len(cutting.cut_cycles([z], [100.0], [o], 50).values) for o in np.arange(0, 100, 2.0)]
    assert cutting.fewest_cycles(z, 100.0, 50) == min(made)


def test_what_no_recording_shows_is_reported(tmp_path, capsys):
    legs = [k for k, name in enumerate(ANGLES) if "hip" in name or "knee" in name]
    rows = [",".join(["time", *(f"{ANGLES[k]}_deg" for k in legs)])]
    for t, pose in enumerate(np.degrees(mw.walk_angles(480, 100.0))):
        rows.append(",".join([f"{t / 100:.2f}", *(f"{pose[k]:.4f}" for k in legs)]))
    (tmp_path / "legs.csv").write_text("\n".join(rows) + "\n")
    model = tmp_path / "legs.gait"
    assert gait.cli.main(["learn", str(tmp_path / "legs.csv"), "-o", str(model)]) == 0
    lines = capsys.readouterr().err.splitlines()
    line = next(x for x in lines if x.endswith("they stay in the rest pose"))
    assert "l_shoulder" in line and "torso" in line and "l_hip" not in line
    assert gait.cli.main(["info", str(model)]) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("never observed"))
    assert "l_shoulder" in line and "l_hip" not in line


def test_the_example_of_a_mapping_is_read(tmp_path):
    page = Path(__file__).parents[2] / "libgait/doc/reference/files.md"
    text = page.read_text(encoding="utf-8").split("### Marker maps")[1]
    example = text.split("```json")[1].split("```")[0]
    (tmp_path / "map.json").write_text(example)
    table = markers.read_map(tmp_path / "map.json").landmarks
    assert table["clustera"].segment == "l_thigh" and "lwra" not in table
