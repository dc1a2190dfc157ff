"""gait learn on little or partial data: few cycles, one subject, legs alone, angles alone."""

import json
import warnings
from dataclasses import replace

import gait_generator as g
import mocap_files as files
import numpy as np
import pytest

import gait.cli
from gait import Model
from gait.body.skeleton import ANGLES, CHANNELS, PAPER_ANGLES, default_skeleton
from gait.errors import UserError
from gait.io import blob
from gait.learn.corpus import load, sources
from gait.learn.cycles.fourier import decode, fourier_basis
from gait.learn.options import PAPER_COMPONENTS, PRIORS, LearnOptions
from gait.learn.prior import components, fit, iterated_svd, model

LEGS = np.array([any(joint in name for joint in ("hip", "knee", "ankle")) for name in ANGLES])


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Folder of six toy walks of three subjects."""
    return files.write_people(tmp_path_factory.mktemp("walks"))


@pytest.fixture(scope="module")
def sequences(walks):
    return load.load_all(sources.find([str(walks)])[0]).sequences


def sections(learned):
    """Sections of the blob, made without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = model.sections(learned, LearnOptions())
    for tag, values in made.items():
        assert values.dtype.kind != "f" or np.isfinite(values).all(), tag
    return made


def run(*words):
    return gait.cli.main([str(w) for w in words])


@pytest.mark.parametrize(
    ("cycles", "wanted", "count"),
    [(3, None, 1), (6, None, 4), (10, None, 8), (90, None, 8), (6, 4, 4), (90, 16, 16), (6, "auto", 4)],
)
def test_components_are_no_more_than_cycles_allow(cycles, wanted, count):
    assert fit.most_components(cycles, wanted) == count


@pytest.mark.parametrize(
    ("cycles", "wanted", "message"),
    [
        (6, 5, "6 cycles are too few for 5 components; add recordings or ask for 4 at most"),
        (2, None, "2 cycles are too few for 1 component; add recordings, 3 cycles at least"),
        (0, "auto", "0 cycles are too few for 1 component; add recordings, 3 cycles at least"),
    ],
)
def test_more_components_than_cycles_allow_are_an_error(cycles, wanted, message):
    with pytest.raises(UserError, match=f"^{message}$"):
        fit.most_components(cycles, wanted)
    with pytest.raises(UserError, match=f"^a.csv b.csv: {message}$"):
        fit.most_components(cycles, wanted, ["a.csv", "b.csv"])


def test_few_cycles_give_fewer_components_and_a_line_is_reported(walks, tmp_path, capsys):
    output = tmp_path / "m.gait"
    assert run("learn", walks / "01", "-o", output, "--json") == 0
    out, err = capsys.readouterr()
    cycles = json.loads(out)["cycles"]
    assert cycles < 10 and blob.read(output)["CURV"].shape[0] == cycles - 1
    assert err == f"{cycles} cycles allow {cycles - 2} components instead of 8\n"
    assert run("learn", walks / "01", "-o", output, "--components", 3) == 0
    assert capsys.readouterr().err == ""


def test_one_subject_has_neither_proportions_nor_a_static_offset(sequences):
    made = sections(fit.fit([s for s in sequences if s.subject == "01"], LearnOptions(components=2)))
    assert "PROP" not in made and not made["CHST"][:, 3].any() and not made["SCST"][:, 1].any()
    assert Model(blob.encode(made)).info.proportions == 0


def test_three_subjects_have_proportions(sequences):
    """Toy people share one skeleton: lengths hardly change, only by the effect of swing on the stature."""
    made = sections(fit.fit(sequences, LearnOptions(components=2)))
    assert made["PROP"].shape == (1, len(made["FRMI"]) + 1)
    assert made["SHFT"].shape == (1, len(made["FRMI"]), 3) and np.abs(made["SHFT"]).max() < 2e-3
    assert np.abs(made["PROP"]).max() < 2e-3 and made["CHST"][:, 3].max() > 0


def test_bodies_of_others_show_how_people_differ(sequences):
    """Of two people there are no proportions; a third, with long forearms, gives one."""
    two = [s for s in sequences if s.subject in ("01", "02")]
    long = replace(two[0].measures, forearm=1.2 * two[0].measures.forearm)
    assert not len(fit.fit(two, LearnOptions(components=2)).lengths)
    learned = fit.fit(two, LearnOptions(components=2), others=[long])
    frames = default_skeleton().frames
    assert learned.lengths.shape == (1, len(frames) + 1)
    assert int(np.argmax(learned.lengths[0])) == frames.index("l_forearm") and learned.lengths.max() > 0.05
    plain = fit.fit(two, LearnOptions(components=2, prior="paper"), others=[long])
    assert not len(plain.lengths) and not len(plain.shifts)


def test_the_body_of_a_person_is_of_the_recording_that_shows_most(sequences):
    """Angles alone and a body without arms come first: arms are learnt from the third recording."""
    own = [s for s in sequences if s.subject == "01"]
    unseen = np.full(2, np.nan)
    armless = replace(own[0].measures, upper_arm=unseen, forearm=unseen)
    mixed = [replace(own[0], measures=None), replace(own[0], measures=armless), own[1]]
    arms = [
        fit.fit(some, LearnOptions(components=1)).proportions.forearm for some in (mixed, own[1:], mixed[:2])
    ]
    assert arms[0] == pytest.approx(arms[1], rel=1e-9)
    assert arms[0] != pytest.approx(arms[2], rel=1e-3)  # no person has them, so those of the default body


def test_paper_prior_moves_nineteen_angles_and_has_one_body(sequences):
    learned = fit.fit(sequences, LearnOptions(prior="paper"))
    assert "PROP" not in sections(learned)
    assert len(learned.components.sd) == PAPER_COMPONENTS
    assert (np.ptp(learned.curves[0], axis=0) > 0).sum() == len(PAPER_ANGLES)
    angles = len(PAPER_ANGLES)
    assert not learned.curves[1:, :, angles:].any()
    k = CHANNELS.index("root_forward")
    forward = learned.cycles.values[:, :, k][learned.cycles.mask[:, :, k]]
    assert learned.curves[0, 0, k] == pytest.approx(forward.mean())


def test_the_iterated_svd_recovers_planted_components_and_its_error_falls():
    """Cycles of two components with a fifth of their entries missing in blocks."""
    rng = np.random.default_rng(3)
    rows, samples, channels, count = 30, 60, 4, 2
    basis = fourier_basis(samples, 19)
    planted, _ = np.linalg.qr(rng.normal(size=(9 * channels, count)))
    coded = np.zeros((rows, len(basis) * channels))
    coded[:, : 9 * channels] = 5 * rng.normal(size=(rows, count)) @ planted.T
    truth = decode(coded, basis, channels)
    values, mask = (truth + 0.01 * rng.normal(size=truth.shape), np.ones(truth.shape, bool))
    for row in mask:
        row[(int(rng.integers(samples)) + np.arange(12)) % samples, :] = False
    found = components.fit(np.where(mask, values, 0.0), mask, count, fill=iterated_svd.complete)
    assert found.converged and len(found.rmse) > 2
    assert np.all(np.diff(found.rmse) <= 1e-12)
    assert found.rmse[-1] < 0.02 < 5 * found.rmse[-1] < found.rmse[0]
    assert np.sqrt(np.mean((found.filled - truth)[~mask] ** 2)) < 0.02
    flat = found.curves.reshape(count, -1)
    angles = np.linalg.svd(flat @ decode(np.pad(planted.T, ((0, 0), (0, coded.shape[1] - 9 * channels))),
                                         basis, channels).reshape(count, -1).T)[1]  # fmt: skip
    assert angles.min() > 0.9999


@pytest.mark.parametrize("kind", PRIORS)
def test_legs_alone_leave_the_rest_at_rest(sequences, kind):
    cut = [replace(s, channels=s.channels.copy()) for s in sequences]
    for s in cut:
        s.channels[:, : len(ANGLES)][:, ~LEGS] = np.nan
    made = sections(fit.fit(cut, LearnOptions(components=2, prior=kind)))
    unseen = np.flatnonzero(~LEGS)
    assert not made["CHST"][unseen].any() and np.abs(made["CURV"][:, :, unseen]).max() < 1e-6
    visible = np.flatnonzero(LEGS)
    assert np.all(made["CHST"][visible, 1] < made["CHST"][visible, 2])
    assert np.ptp(made["CURV"][0][:, visible]) > 0.5


@pytest.mark.parametrize("kind", PRIORS)
def test_angles_of_the_legs_alone_are_learnt(tmp_path, kind):
    """The least that a .csv of angles may hold: no joints, no root, hips and knees."""
    names = [f"{s}_{a}_flexion" for s in "rl" for a in ("hip", "knee")]
    columns = [3 + g.SIDE.index("hip_flexion"), 3 + g.SIDE.index("knee")]
    columns += [c + len(g.SIDE) for c in columns]
    for k in range(4):
        angles = (1 + 0.1 * k) * g.mean_curves(np.arange(400) / (105.0 + 4 * k))[:, columns]
        angles += np.random.default_rng(k).normal(scale=0.5, size=angles.shape)
        lines = [",".join(["frame", "time", *(f"{n}_deg" for n in names)])]
        lines += [f"{t},{t / 100:.2f}," + ",".join(f"{v:.3f}" for v in row) for t, row in enumerate(angles)]
        (tmp_path / f"{k:02}_01.csv").write_text("\n".join(lines) + "\n")
    read, refused, _ = load.load_all(sources.find([str(tmp_path)])[0])
    assert len(read) == 4 and not refused and all(s.measures is None for s in read)
    made = sections(fit.fit(read, LearnOptions(components=2, prior=kind)))
    assert "PROP" not in made and 0.3 < made["GAIT"][3] < 1.6
    assert made["GAIT"][0] == pytest.approx(np.mean([100 / (105 + 4 * k) for k in range(4)]), rel=0.01)
    knee = np.degrees(made["CURV"][0, :, CHANNELS.index("r_knee_flexion")])
    assert np.ptp(knee) == pytest.approx(1.15 * 58, rel=0.1)
    assert json.loads(made["META"].tobytes())["statures_m"] == [None] * 4
    assert Model(blob.encode(made)).info.components == 2
