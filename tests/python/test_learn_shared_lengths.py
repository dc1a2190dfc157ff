"""Lengths of limbs from all recordings of a person together: nearer to the truth, and those of one person."""

import json
from pathlib import Path

import marked_person as mw
import numpy as np
import pytest
from test_marker_files import real, write_c3d, write_trc

from gait import cli
from gait.learn.corpus import load, sources
from gait.learn.corpus.stage import Prepared, Task
from gait.learn.options import DEFAULT, LearnOptions
from gait.learn.prior import fit
from gait.learn.solve import kinematics, markers, retarget, skeleton_fit
from gait.learn.solve.kinematics import SCALES, SEGMENTS
from gait.learn.solve.skeleton_fit import (
    LENGTHS_OF_PEOPLE,
    NO_INFORMATION,
    LengthInformation,
    log_bayes_factor,
)
from gait.reproducible import one_thread

pytestmark = pytest.mark.long

FILE = Path("walk.c3d")
LIMBS = [k for k, name in enumerate(SCALES) if name in ("upper_arm", "forearm", "thigh", "shank", "foot")]


@pytest.fixture(autouse=True)
def single():
    """As `gait learn` does it."""
    with one_thread():
        yield


def places(labels):
    marks = mw.landmarks(labels)
    segment = np.array([SEGMENTS.index(m.segment) for m in marks])
    return skeleton_fit.Points(segment, np.array([m.at for m in marks]), np.array([m.sd for m in marks]))


def reported(points):
    return markers.length_information(FILE, mw.FULL, points)


def without(points, names, frames=slice(None)):
    left = points.copy()
    left[frames, [mw.FULL.index(name) for name in names]] = np.nan
    return left


def pooled(*found):
    return sum(found, LENGTHS_OF_PEOPLE).mean()


@pytest.fixture(scope="module")
def twice():
    """Two recordings of one person: the first shows no arms, the second hardly any of the legs."""
    arms = [side + name for side in "LR" for name in ("UPA", "ELB", "FRA", "WRA", "WRB")]
    legs = [side + name for side in "LR" for name in ("THI", "KNE", "ANK", "HEE", "TOE")]
    first, second = (mw.person(mw.FULL, seed=2, again=k)[0] for k in (1, 2))
    return without(first, arms), without(second, legs)


def test_one_recording_shows_what_its_own_fit_finds():
    points = mw.person(mw.FULL, frames=240)[0]
    own = skeleton_fit.fit(points, places(mw.FULL)).log_scales
    assert pooled(reported(points)) == pytest.approx(own, abs=1e-3)


def test_lengths_of_both_recordings_are_nearer_to_the_truth_than_those_of_either(twice):
    truth = mw.own_lengths(np.random.default_rng(2))
    found = [reported(points) for points in twice]

    def error(scales):
        return float(np.sqrt(np.mean((scales - truth)[LIMBS] ** 2)))

    assert error(pooled(*found)) < 0.7 * min(error(pooled(one)) for one in found)


def test_markers_put_on_anew_average_out():
    truth = mw.own_lengths(np.random.default_rng(4))
    found = [reported(mw.person(mw.FULL, frames=60, seed=4, again=k)[0]) for k in range(6)]
    away = [np.linalg.norm(pooled(one) - truth) for one in found]
    assert np.linalg.norm(pooled(*found) - truth) < min(away)


def test_what_adds_up_is_the_optimum_of_a_joint_fit(monkeypatch):
    """A fit of all frames in which each recording has markers of its own, with the same weights."""
    frames, marks = 40, len(mw.LOWER)
    each = [mw.person(mw.LOWER, frames=frames, seed=6, again=k)[0] for k in (1, 2)]
    found = [skeleton_fit.length_information(points, places(mw.LOWER))[0] for points in each]
    both = np.full((2 * frames, 2 * marks, 3), np.nan)
    both[:frames, :marks], both[frames:, marks:] = each
    monkeypatch.setattr(skeleton_fit, "SUBJECT_FRAMES", 2 * frames)
    monkeypatch.setattr(skeleton_fit, "EFFECTIVE", 2 * skeleton_fit.EFFECTIVE)
    together = skeleton_fit.fit(both, places(2 * mw.LOWER)).log_scales
    assert np.abs(pooled(*found) - together).max() < 2e-3
    assert min(np.abs(pooled(one) - together).max() for one in found) > 1e-2


def test_lengths_that_are_held_stay(twice):
    scales = mw.own_lengths(np.random.default_rng(2))
    body = markers.from_markers(FILE, mw.FULL, twice[0], 120.0, log_scales=scales)
    knee = kinematics.segment_origins(scales)[SEGMENTS.index("l_shank")]
    assert retarget.measure(body).thigh == pytest.approx(np.linalg.norm(knee), rel=1e-9)
    assert 0.002 < body.residual < 0.006


def test_bayes_factors_of_one_body_are_right():
    """Draws of the model, half of them of two people: the factors state how often they are of one person."""
    rng, size = np.random.default_rng(0), len(SCALES)
    same, unusual = rng.random(3000) < 0.5, []
    for one in same:
        people = [
            LENGTHS_OF_PEOPLE.mean() + rng.normal(size=size) / np.sqrt(np.diag(LENGTHS_OF_PEOPLE.matrix))
            for _ in range(2)
        ]
        found = []
        for body in (people[0], people[0] if one else people[1]):
            slope = rng.normal(scale=5, size=(size, 6))
            found.append(LengthInformation(slope @ slope.T, slope @ (slope.T @ body + rng.normal(size=6))))
        unusual.append(log_bayes_factor(*found))
    chance = 1 / (1 + np.exp(-np.array(unusual)))
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        there = (chance >= low) & (chance < low + 0.2)
        assert there.sum() > 100 and abs(np.mean(same[there]) - np.mean(chance[there])) < 0.08


def test_what_shows_nothing_separates_no_people():
    assert log_bayes_factor(NO_INFORMATION, body(1.1)) == pytest.approx(0)


def body(stature, error=0.0, precision=1e4):
    """Estimates of a person's stature with an error of the log stature."""
    matrix = np.zeros(LENGTHS_OF_PEOPLE.matrix.shape)
    matrix[0, 0] = precision
    return LengthInformation(matrix, matrix[0] * (np.log(stature) + error))


def share(files, persons=None):
    """Log length scales and lines by recordings: path to what it shows."""
    lines, counts = [], []
    paths = [Path(name) for name in files]

    def done(tasks):
        assert all(task.measuring for task in tasks)
        yield from (Prepared(lengths=files[str(task.path)]) for task in tasks)

    persons = persons or ["Anna"] * len(paths)
    monkeypatch = pytest.MonkeyPatch()
    with monkeypatch.context() as patch:
        patch.setattr(load, "_outcomes", lambda tasks, options: done(tasks))
        patch.setattr(sources, "subjects", lambda paths, rule: persons)
        found = load.shared_lengths([(p, True) for p in paths], DEFAULT, counts.append, lines.append)
    assert counts == list(range(1, len(counts) + 1))
    return found, lines


def test_only_people_with_several_recordings_of_markers_are_measured():
    files = {"a.c3d": body(1.7), "b.amc": None, "c.trc": body(1.7), "d.C3D": body(1.7, 0.004), "e.csv": None}
    found, lines = share(files, ["Anna", "Anna", "Ben", "Anna", "Ben"])
    assert [f.recordings if f else None for f in found] == [2, None, None, 2, None] and not lines
    assert np.exp(found[0].log_scales[0]) == pytest.approx(1.7 * np.exp(0.002), rel=1e-4)
    assert found[0] is found[3]


def test_what_is_known_of_people_counts_once():
    found, _ = share({"a.c3d": body(2.0, precision=8.0), "b.c3d": body(2.0, precision=8.0)})
    assert found[0].log_scales[0] == pytest.approx(np.log(1.7 * 2.0) / 2)  # people's precision of it is 16


def test_a_recording_that_shows_nothing_does_not_count():
    found, lines = share({"a.c3d": body(1.7), "b.c3d": None, "c.c3d": body(1.7)})
    assert [f.recordings if f else None for f in found] == [2, None, 2] and not lines
    assert share({"a.c3d": body(1.7), "b.c3d": None}) == ([None, None], [])


def test_a_stranger_is_reported_and_measured_apart():
    files = {"a.c3d": body(1.6), "b.c3d": body(1.8), "c.c3d": body(1.8, 0.001)}
    found, (line,) = share(files)
    assert [f.recordings if f else None for f in found] == [None, 2, 2]
    assert np.exp(found[1].log_scales[0]) == pytest.approx(1.8, rel=1e-3)
    assert line.startswith("a.c3d: limb lengths differ from b.c3d, which also counts as 'Anna'")
    assert "\n" not in line and "--subjects" in line


def test_two_people_by_one_name_have_a_body_each():
    files = {f"{k}.c3d": body(1.6 if k % 2 else 1.8, 0.001 * k) for k in range(12)}
    found, (line,) = share(files)
    assert [round(float(np.exp(f.log_scales[0])), 1) for f in found] == [1.8, 1.6] * 6
    assert line.startswith("1.c3d 11.c3d 3.c3d 5.c3d ...: limb lengths differ from 0.c3d")


def test_the_order_of_the_files_does_not_matter():
    rng = np.random.default_rng(0)
    files = {f"{k}.c3d": body(1.6 if k < 3 else 1.8, rng.normal(scale=0.01)) for k in range(8)}
    found, lines = share(files)
    other, others = share(dict(reversed(files.items())))
    assert [f.log_scales.tobytes() for f in found] == [f.log_scales.tobytes() for f in reversed(other)]
    assert lines == others


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """Anna twice, Ben once, Cleo twice with a stranger by her name."""
    folder = tmp_path_factory.mktemp("laboratory")
    for k, name in enumerate(["anna_1", "anna_2", "ben_1", "cleo_1", "cleo_2"]):
        seed = "abc".index(name[0])
        points = mw.person(mw.LOWER, frames=240, seed=seed, again=k)[0]
        (write_trc if k % 2 else write_c3d)(folder / f"{name}.{'trc' if k % 2 else 'c3d'}", mw.LOWER, points)
    child = 0.8 * mw.person(mw.LOWER, frames=240, seed=7)[0]
    write_c3d(folder / "cleo_0.c3d", mw.LOWER, child)
    (folder / "anna_3.c3d").write_bytes(b"broken")
    return folder


def learn(folder, out, capsys, *words):
    words = ("--components", "2", "--json", *words)
    assert cli.main(["learn", str(folder), "-o", str(out), "--activity", "any", *words]) == 0
    printed = capsys.readouterr()
    return out.read_bytes(), json.loads(printed.out), printed.err


def test_the_command_shares_lengths_and_names_the_stranger(laboratory, tmp_path, capsys):
    model, figures, reported = learn(laboratory, tmp_path / "a.gait", capsys, "--jobs", "1")
    by = {Path(row["source"]).stem: row["lengths_by"] for row in figures["sequences"]}
    assert by == {"anna_1": 2, "anna_2": 2, "ben_1": 1, "cleo_1": 2, "cleo_2": 2, "cleo_0": 1}
    (line,) = [line for line in reported.splitlines() if "limb lengths differ" in line]
    assert "cleo_0.c3d" in line and "cleo_1.trc" in line
    assert reported.count("anna_3.c3d") == 1
    again = learn(laboratory, tmp_path / "b.gait", capsys, "--jobs", "2", "--quiet")
    assert again[0] == model and "limb" not in again[2]


def alike(one, other):
    """Whether two sequences have the same angles, but for last bits: kernels differ by memory alignment."""
    return np.allclose(one.channels, other.channels, rtol=0, atol=1e-9, equal_nan=True)


def test_recordings_of_one_person_have_one_body(laboratory):
    files, _ = sources.find([str(laboratory)])
    options = LearnOptions(activity="any")
    read = load.load_all(files, options, shared=load.shared_lengths(files)).sequences
    alone = load.load_all(files, options).sequences
    thigh = {s.source.stem: s.measures.thigh for s in read}
    own = {s.source.stem: s.measures.thigh for s in alone}
    assert thigh["anna_1"] == pytest.approx(thigh["anna_2"], rel=1e-9)
    assert own["anna_1"] != pytest.approx(own["anna_2"], rel=1e-3)
    for one, other in zip(read, alone, strict=True):
        same = alike(one, other)
        assert same == (one.source.stem in ("ben_1", "cleo_0"))


def test_of_a_person_counts_the_body_that_most_recordings_have(laboratory):
    files = [(path, True) for path in sorted(laboratory.glob("cleo*"))]
    options = LearnOptions(activity="any", components=1)
    read = load.load_all(files, options, shared=load.shared_lengths(files)).sequences
    shanks = [retarget.own_proportions(s.measures).shank for s in read]
    assert fit.fit(read, options).proportions.shank == pytest.approx(shanks[1]) != pytest.approx(shanks[0])


def test_a_walk_and_a_run_of_one_person_share_their_lengths():
    files = [(real(f"trc/motion_capture_{name}.trc"), True) for name in ("walk", "run")]
    lines = []
    bodies = load.shared_lengths(files, warn=lines.append)
    assert [b.recordings for b in bodies] == [2, 2] and not lines
    assert 1.7 < np.exp(bodies[0].log_scales[0]) < 1.9


def test_real_strangers_in_one_folder_are_reported():
    names = ("FunctionalWalk", "PlugInC3D", "ADemo1_rewrite_c3d_pc_float")
    files = [(real(f"c3d/{name}.c3d"), True) for name in names]
    lines = []
    assert load.shared_lengths(files, LearnOptions(subjects="folder"), warn=lines.append) == [None] * 3
    assert len(lines) == 2 and all("ADemo1_rewrite_c3d_pc_float.c3d, which" in line for line in lines)


def test_a_file_refused_with_the_lengths_of_the_others_has_its_own(tmp_path):
    """Lengths that are 30 % off, as from weak recordings, do not fit the markers."""
    points = mw.person(mw.FULL, seed=2)[0]
    path = write_trc(tmp_path / "Anna_01.trc", mw.FULL, points)
    wrong = mw.own_lengths(np.random.default_rng(2)) + 0.3
    options = LearnOptions(activity="any")
    together, alone = Task(path, options, wrong).run(), Task(path, options).run()
    assert together.alone and together.refused is None and not alone.alone
    assert alike(together.sequence, alone.sequence)
    shared = [load.SharedLengths(wrong, 3)]
    assert load.load_all([(path, True)], options, shared=shared).sequences[0].recordings == 1


MORE = Path(__file__).resolve().parents[2] / "../shared/data/mocap/more/c3dorg"


@pytest.mark.skipif(not MORE.is_dir(), reason="needs recordings of further people beside the repository")
def test_recordings_accepted_alone_are_accepted_together():
    files, _ = sources.find([str(MORE / name) for name in ("o11", "o12/o12_01.trc", "o12/o12_05.trc")])
    options = LearnOptions(jobs=1)
    loaded = load.load_all(files, options, shared=load.shared_lengths(files, options))
    assert len(loaded.sequences) == 4 and not loaded.refused
