"""Recordings of few frames, of every kind, and of few frames per second."""

import gait_generator as g
import marked_walker as mw
import mocap_files as files
import numpy as np
import pytest
from test_learn_joint_file import write_csv
from test_marker_files import write_c3d, write_trc

import gait.cli
from gait.errors import UserError
from gait.learn.cycles import cycles
from gait.learn.cycles.sequence import load
from gait.learn.mocap import mocap_asf
from gait.learn.reading import Reading
from gait.learn.solve.body import body

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
    return write_c3d(folder / "a.c3d", mw.LOWER, mw.walker(mw.LOWER, frames=10)[0][:frames])


def trc(folder, frames):
    return write_trc(folder / "a.trc", mw.LOWER, mw.walker(mw.LOWER, frames=10)[0][:frames])


def joints(folder, frames):
    walker = body(mocap_asf.read(files.write_toy(folder, frames=10)))
    path = write_csv(folder / "a.csv", walker)
    path.write_text("\n".join(path.read_text().splitlines()[: 1 + frames]) + "\n")
    return path


def angles(folder, frames):
    rows = [f"{t},{t / 100:.2f},{t},{2 * t},{-t},{5 + t}" for t in range(frames)]
    path = folder / "a.csv"
    path.write_text("\n".join([",".join(["frame", "time", *(f"{n}_deg" for n in LEGS)]), *rows]) + "\n")
    return path


KINDS = (amc, bvh, c3d, trc, joints, angles)
#: ezc3d writes no .c3d without frames.
CASES = [(kind, frames) for kind in KINDS for frames in range(5) if (kind, frames) != (c3d, 0)]


@pytest.mark.parametrize("trim", [True, False])
@pytest.mark.parametrize(("kind", "frames"), CASES, ids=lambda value: getattr(value, "__name__", str(value)))
def test_a_file_of_few_frames_is_refused_in_one_line(tmp_path, kind, frames, trim):
    path = kind(tmp_path, frames)
    with pytest.raises(UserError) as refused:
        load(path, Reading(trim=trim))
    line = str(refused.value)
    assert line.startswith(str(path)) and "\n" not in line
    assert (FEW.format(frames) in line) == (frames < 3)
    assert frames < 3 or "it holds no cycle" in line


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
    sequence = load(path, Reading(fps=fps))
    assert sequence.period.frames == pytest.approx(period, rel=0.02)
    cut = cycles.slice_cycles([sequence.channels], np.array([period]), np.zeros(1), 128)
    assert len(cut.values) >= 6 and cut.mask[1:-1].all()


@pytest.mark.parametrize("fps", [12, 15, 120])
def test_a_missing_frame_is_a_gap_at_every_rate(fps):
    period = 1.1 * fps
    u = np.arange(-0.2 * period, 1.3 * period) / period
    z = g.mean_curves(u)
    first = round(0.7 * period)
    last = first + max(1, round(0.1 * period))
    z[first:last] = np.nan
    values, mask = cycles.resample(u, z, 128, 1 / period)
    grid = np.arange(128) / 128
    hole = (grid > u[first - 1]) & (grid < u[last])
    assert not mask[hole].any() and mask[~hole].all()
    error = (values - g.mean_curves(grid))[~hole]
    assert np.sqrt(np.mean(error**2)) < 1.5  # degrees
