"""gait learn with its prior over segments, from end to end on toy walks; the shipped one."""

import json

import mocap_files as files
import numpy as np
import pytest
from marked_person import FULL, person
from segment_posterior import infer, place, uncertain_modes
from test_marker_files import write_trc
from toy_segments import FRONT

import gait.cli
from gait.bindings.model import Model
from gait.bindings.segment_prior import TAGS, SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS
from gait.errors import UserError
from gait.io import blob
from gait.lift.keypoints.observations import Observations
from gait.lift.segment.explain import share_along, share_rigid
from gait.lift.smooth.rows import orthographic


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Toy walks of three people, and a person who stands still, which is not a walk."""
    folder = tmp_path_factory.mktemp("walks")
    for i, (subject, trial) in enumerate([(1, 1), (1, 2), (2, 1), (3, 1)]):
        motion = {"period": 110.0 + 6 * i, "swing": 0.85 + 0.05 * i, "seed": i, "frames": 420}
        files.write_toy(folder / f"{subject:02}", f"{subject:02}_{trial:02}", speed=1.1 + 0.05 * i, **motion)
    files.write_toy(folder / "04", "04_01", swing=0.02, speed=0.0, frames=200)
    return folder


def run(*words):
    return gait.cli.main([str(w) for w in words])


def learn(walks, path, *words):
    return run("learn", walks, "-o", path, "--components", 2, "--jobs", 1, "--quiet", *words)


def cyclic(path):
    return {tag: array.tobytes() for tag, array in blob.read(path).items() if tag not in TAGS}


def differences(path, other):
    """Sections in which two models differ, with the largest difference; NaN if one lacks it."""
    one, two = blob.read(path), blob.read(other)
    shared = [tag for tag in one.keys() & two.keys() if one[tag].tobytes() != two[tag].tobytes()]
    found = {tag: float(np.abs(one[tag].astype(float) - two[tag]).max()) for tag in shared}
    return found | dict.fromkeys(one.keys() ^ two.keys(), np.nan)


@pytest.mark.long
def test_the_prior_is_learnt_beside_the_cyclic_model_which_stays_the_same(walks, tmp_path, capsys):
    both, without = tmp_path / "both.gait", tmp_path / "without.gait"
    assert learn(walks, both, "--json") == 0
    reported = json.loads(capsys.readouterr().out)["segments"]
    assert learn(walks, without, "--segments", "none") == 0
    assert cyclic(both) == cyclic(without) and not set(TAGS) & set(blob.read(without))
    prior = SegmentPrior.load(both)
    assert (prior.frames, prior.hop, prior.fps, prior.headings) == (10, 5, 20.0, 0)
    assert prior.recordings == reported["recordings"] == 4 and prior.segments == reported["segments"] > 20
    assert len(prior.names) == 37 and prior.names[:19] == tuple(JOINTS)
    assert run("info", both) == 0
    assert f"{prior.segments} segments of 10 frames at 20/s from 4 recordings" in capsys.readouterr().out
    assert run("info", both, "--json") == 0
    assert json.loads(capsys.readouterr().out)["segments"]["gamma"] == reported["gamma"]
    assert learn(walks, tmp_path / "again.gait") == 0
    assert differences(tmp_path / "again.gait", both) == {}


def test_options_set_what_a_segment_is(walks, tmp_path):
    path = tmp_path / "m.gait"
    words = "--segment-frames 8 --segment-hop 2 --segment-fps 25 --segment-modes 12 --segment-headings 2"
    assert learn(walks, path, "--segment-mixture", 2, *words.split()) == 0
    prior = SegmentPrior.load(path)
    assert (prior.frames, prior.hop, prior.fps, prior.size) == (8, 2, 25.0, 12)
    assert prior.headings == 2 and prior.components == 2


def test_eight_headings_are_of_the_world(walks, tmp_path):
    path = tmp_path / "m.gait"
    assert learn(walks, path, "--segments", "only", "--segment-headings", 8) == 0
    prior, free = SegmentPrior.load(path), tmp_path / "free.gait"
    assert learn(walks, free, "--segments", "only") == 0
    assert prior.headings == 8 and prior.segments == SegmentPrior.load(free).segments
    ahead = [p.mean[0, -1, 0, :2] for p in (prior, SegmentPrior.load(free))]  # where the pelvis goes
    assert np.linalg.norm(ahead[0]) < 1e-5 and ahead[1][0] > 0.1


def test_the_number_of_components_is_found_and_reported(walks, tmp_path, capsys):
    """Other tests of `segment_mixture` check which number it is."""
    path = tmp_path / "m.gait"
    assert learn(walks, path, "--segments", "only", "--segment-mixture", "auto", "--json") == 0
    reported = json.loads(capsys.readouterr().out)["segments"]
    prior = SegmentPrior.load(path)
    assert 1 <= prior.components == reported["components"] <= 6
    assert prior.weights.sum() == pytest.approx(1, abs=1e-6)


def test_recorded_markers_are_those_of_the_files(tmp_path, capsys):
    """One of three recordings lacks the head's markers: they are learnt, because most files have them."""
    folder = tmp_path / "marked"
    folder.mkdir()
    for k in range(3):
        names = FULL if k else [name for name in FULL if name[1:] not in ("FHD", "BHD")]
        write_trc(folder / f"{k}_1.trc", names, person(names, frames=420, seed=k)[0])
    path = tmp_path / "m.gait"
    assert (
        run("learn", folder, "-o", path, "--segments", "only", "--segment-markers", "recorded", "--jobs", 1)
        == 0
    )
    prior = SegmentPrior.load(path)
    assert {name.upper() for name in prior.names} == set(FULL)
    assert "37 markers" in capsys.readouterr().out
    knees = [prior.names.index(next(n for n in prior.names if n.upper() == f"{s}KNE")) for s in "LR"]
    assert np.all(np.abs(prior.mean[0, :, knees, 2] - 0.28) < 0.06)  # statures over the floor


def test_whole_recordings_alone_give_a_blob_that_tracks_nothing(walks, tmp_path, capsys):
    path = tmp_path / "only.gait"
    assert learn(walks, path, "--segments", "only", "--json") == 0
    reported = json.loads(capsys.readouterr().out)
    assert reported["segments"]["recordings"] == 5 and not reported["left_out"]
    assert set(blob.read(path)) == {"META", *TAGS}
    assert run("info", path) == 0 and "segment prior" in capsys.readouterr().out
    with pytest.raises(
        UserError, match=r"only.gait: contains no cyclic model; learn it without --segments only"
    ):
        Model(path)


def test_all_also_learns_from_what_is_no_walk(walks, tmp_path, capsys):
    path = tmp_path / "all.gait"
    assert learn(walks, path, "--segments", "all", "--json") == 0
    reported = json.loads(capsys.readouterr().out)
    assert len(reported["sequences"]) == 4 and reported["segments"]["recordings"] == 5
    (line,) = (line for line in reported["left_out"] if "04_01" in line)
    assert line.endswith("(its segments are used nevertheless)")
    assert learn(walks, path, "--segments", "learnt", "--json") == 0
    assert not any("used" in line for line in json.loads(capsys.readouterr().out)["left_out"])


def test_all_needs_a_cyclic_model_and_names_what_does_not(walks, tmp_path, capsys):
    """Then nothing is written: no segment is used anyway."""
    path = tmp_path / "all.gait"
    words = ("learn", walks / "04", "-o", path, "--jobs", 1, "--segment-hop", 1, "--segments")
    assert run(*words, "all") == 1 and not path.exists()
    printed = capsys.readouterr().err.rstrip()
    assert "04_01.amc: not learnt as 'walk'" in printed and "used nevertheless" not in printed
    assert printed.endswith(
        "; for gait lift only, give --segments only: all also needs recordings for a cyclic model"
    )
    assert run(*words, "only") == 0 and path.exists()
    assert run(*words, "learnt") == 1
    assert "--segments only" not in capsys.readouterr().err


def test_recorded_markers_need_files_that_have_them(walks, tmp_path, capsys):
    path = tmp_path / "m.gait"
    words = ("learn", walks, "-o", path, "--segment-markers", "recorded", "--segments")
    assert run(*words, "only", "--jobs", 1) == 1
    assert "has no recorded markers; leave out --segment-markers" in capsys.readouterr().err
    assert not path.exists()
    assert run(*words, "learnt", "--components", 2, "--jobs", 1) == 0
    assert "no segment prior: the recordings contain 0 segments" in capsys.readouterr().err
    assert not set(TAGS) & set(blob.read(path))


@pytest.mark.parametrize(
    "words",
    [
        ["--segment-frames", "3"],
        ["--segments", "none", "--segment-modes", "5"],
        ["--segment-mixture", "many"],
        ["--segment-headings", "4"],
        ["--segments", "only", "--report", "r"],
        ["--segment-hop", "11"],
        ["--segment-hop", "5", "--segment-frames", "4"],
    ],
)
def test_bad_options_are_usage_errors(walks, tmp_path, words, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        status = run("learn", walks, "-o", tmp_path / "m.gait", *words)
    except SystemExit as stop:
        status = stop.code
    assert status == 2


def test_the_shipped_prior_is_of_its_walks():
    prior = SegmentPrior.load()
    assert prior.recordings == 51 and prior.segments > 500 and prior.size == 50
    assert set(EVAL15) <= set(prior.names) and len(prior.names) == 37
    share = np.cumsum(prior.sd[0] ** 2)
    assert share[-1] / (share[-1] + 30 * prior.residual.sum()) > 0.99
    assert 1 < prior.gamma < 20 and 1.5 < prior.stature < 1.9
    pelvis = prior.index(["pelvis"])[0]
    assert np.abs(prior.mean[0, 0, pelvis, :2]).max() < 0.01  # over the origin
    assert prior.mean[0, -1, pelvis, 0] > 0.2  # and off along +x


def test_of_a_person_in_a_flat_view_depth_is_least_certain():
    """F6: the five least certain modes are along depth, the first moves the whole body."""
    prior, axes, depth = SegmentPrior.load(), FRONT, np.array([0.0, 1, 0])
    gaussian = place(prior)
    visible = Observations(gaussian.mean @ axes.T, np.full(gaussian.mean.shape[:2], 0.02))
    sd, modes = uncertain_modes(infer(gaussian, orthographic(visible, axes)), 5)
    assert share_along(modes[0], depth) >= 0.99 and share_rigid(modes[0]) >= 0.98
    assert all(share_along(mode, depth) >= 0.95 for mode in modes)
    assert sd[0] > 5 > 0.5 > sd[1]
