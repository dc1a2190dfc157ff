"""Error measures compared with numbers worked out by hand, and the baselines with what they should reach."""

import json
from dataclasses import replace

import numpy as np
import pytest
from drawn_person import DATA
from scipy.spatial.transform import Rotation
from scipy.special import ndtr
from toy_segments import toy_prior

from gait import Camera, UserError
from gait.bindings.model import read_blob, read_cyclic
from gait.body import skeleton
from gait.body.skeleton import EVAL15, JOINTS
from gait.cli import main
from gait.io import blob
from gait.io.track_file import Joints, Track, read_estimates, read_true_phase, read_truth, write_lifted
from gait.learn.segments import fit as segment_fit
from gait.motion.evaluate import (
    LIMB_COLUMNS,
    calibration,
    coverage,
    crps,
    evaluate,
    free_run,
    phase_errors,
    picture_errors,
    pose_errors,
    procrustes_errors,
    root_errors,
    root_path,
    static_pose,
    stature,
    trust,
)
from gait.motion.footfalls import (
    Strikes,
    meta_of,
    strikes_by_zeni,
    strikes_from_meta,
    strikes_of,
    walking_direction,
)
from gait.report.comparison import compare

SECTIONS = blob.decode(read_blob(None))
RATE, FIRST_PHASE, HEIGHT = 0.9, 0.3, 1.7


def mean_walk(frames=100, fps=30, heading=0.7, start=(1.0, -2.0)):
    """Truth that is the model's mean cycle, walking on."""
    frame = np.arange(frames)
    cycles = FIRST_PHASE + RATE * frame / fps
    path = HEIGHT * root_path(SECTIONS, cycles, RATE)
    turn = np.array(
        [[np.cos(heading), -np.sin(heading), 0], [np.sin(heading), np.cos(heading), 0], [0, 0, 1]]
    )
    joints, _ = skeleton.pose(SECTIONS, cycles, np.zeros(0), HEIGHT, 0.0, 0.0, 0.0, path, stride_hz=RATE)
    joints = joints @ turn.T + [*start, 0.0]
    names = blob.unpack_names(SECTIONS["PTNM"])
    places = {name: joints[:, names.index(name)] for name in JOINTS}
    return Joints(frame, frame / fps, places)


TRUTH = mean_walk()
# phase 0 is a right heel strike, so they come where the cycles are whole
STRIKES = Strikes(
    right=(np.arange(1, 4) - FIRST_PHASE) / RATE * 30, left=(np.arange(1, 4) - 0.5 - FIRST_PHASE) / RATE * 30
)


def track(truth=TRUTH, move=0.0, sd=0.02, **changes):
    """Track that is the truth moved by `move` metres along x."""
    shift = np.array([move, 0.0, 0.0])
    made = Track(
        frame=truth.frame,
        time=truth.time,
        places={name: at + shift for name, at in truth.places.items()},
        status=["tracking"] * len(truth.frame),
        phase=(FIRST_PHASE + RATE * truth.frame / 30) % 1,
        sd={name: np.full_like(at, sd) for name, at in truth.places.items()},
    )
    return replace(made, **changes)


def test_a_shift_counts_in_abs_and_not_in_root():
    found = TRUTH.eval15() + [0.06, 0.0, 0.08]
    errors = pose_errors(found, TRUTH.eval15())
    assert errors["abs"] == pytest.approx({"median": 100, "mean": 100, "p90": 100})
    assert errors["root"]["mean"] == pytest.approx(0, abs=1e-9) and errors["lost"] == 0


def test_one_joint_off_is_shared_among_15_and_14():
    found = TRUTH.eval15()
    found[:, EVAL15.index("l_wrist")] += [0.0, 0.21, 0.0]
    errors = pose_errors(found, TRUTH.eval15())
    assert errors["abs"]["median"] == pytest.approx(210 / 15)
    assert errors["root"]["median"] == pytest.approx(210 / 14)


def test_the_pelvis_counts_in_abs_alone_and_the_hips_move_the_root():
    found = TRUTH.eval15()
    found[:, EVAL15.index("pelvis")] += [0.15, 0.0, 0.0]
    errors = pose_errors(found, TRUTH.eval15())
    assert errors["abs"]["mean"] == pytest.approx(10) and errors["root"]["mean"] == pytest.approx(0, abs=1e-9)
    found = TRUTH.eval15()
    found[:, EVAL15.index("l_hip")] += [0.0, 0.0, 0.28]
    # the midpoint rises by 140 mm: the hip itself is then 140 off and so are the 13 others
    assert pose_errors(found, TRUTH.eval15())["root"]["mean"] == pytest.approx(140)


def test_median_mean_and_90th_percentile_are_over_frames():
    found = TRUTH.eval15()
    found[:, :, 0] += np.arange(100)[:, None] / 1000  # 0, 1, ... 99 mm
    assert pose_errors(found, TRUTH.eval15())["abs"] == pytest.approx(
        {"median": 49.5, "mean": 49.5, "p90": 89.1}
    )


def test_lost_is_far_off_or_reported():
    found = TRUTH.eval15()
    found[:10, EVAL15.index("head_top")] += [0.0, 0.0, 14 * 0.151]
    found[10:20, EVAL15.index("head_top")] += [0.0, 0.0, 14 * 0.149]
    given_up = np.zeros(100, bool)
    given_up[5:25] = True
    assert pose_errors(found, TRUTH.eval15())["lost"] == pytest.approx(0.10)
    assert pose_errors(found, TRUTH.eval15(), given_up)["lost"] == pytest.approx(0.25)


def test_phase_errors_wrap_and_flips_are_counted_apart():
    true = np.array([0.98, 0.02, 0.50, 0.10, 0.60])
    found = np.array([0.01, 0.99, 0.52, 0.62, 0.09])  # +.03 -.03 +.02 then flipped: +.02, -.01
    errors = phase_errors(found, true)
    assert errors["flips"] == pytest.approx(0.4)
    assert errors["median"] == pytest.approx(0.02) and errors["mean"] == pytest.approx(0.022)
    assert errors["bias"] == pytest.approx((0.03 - 0.03 + 0.02 + 0.02 - 0.01) / 5)


def test_coverage_is_the_share_inside_the_normal_intervals():
    true = np.zeros((4, 15, 3))
    found, sd = np.full((4, 15, 3), 0.01), np.full((4, 15, 3), 0.01)
    assert coverage(found, sd, true) == {"50": 0.0, "90": 1.0}  # one standard deviation off
    sd[:1] = 0.02  # half a standard deviation off in a quarter of them
    sd[1:2] = 0.005  # two standard deviations
    assert coverage(found, sd, true) == {"50": 0.25, "90": 0.75}


def test_the_12_limb_joints_leave_trunk_and_head_out():
    found = TRUTH.eval15()
    for name in ("neck", "head_top", "pelvis"):
        found[:, EVAL15.index(name)] += [0.3, 0.0, 0.0]
    assert root_errors(found, TRUTH.eval15(), LIMB_COLUMNS).max() == pytest.approx(0, abs=1e-9)
    found[:, EVAL15.index("r_ankle")] += [0.0, 0.12, 0.0]
    assert root_errors(found, TRUTH.eval15(), LIMB_COLUMNS) == pytest.approx(np.full(100, 10.0))


def test_procrustes_takes_off_any_similarity_but_no_mirror():
    true = TRUTH.eval15()
    turn = Rotation.from_euler("xyz", [0.3, -1.1, 2.0]).as_matrix()
    assert procrustes_errors(1.3 * true @ turn.T + [4.0, -1.0, 0.5], true).max() < 1e-6
    assert procrustes_errors(true * [1, -1, 1], true).min() > 10
    # it can only be better than the root error laid on the mean of the same joints
    found = true + np.random.default_rng(0).normal(0, 0.03, true.shape)
    centred = [at - at.mean(axis=1, keepdims=True) for at in (found, true)]
    plain = 1000 * np.sqrt(((centred[0] - centred[1]) ** 2).sum(axis=(1, 2)) / 15)
    assert (procrustes_errors(found, true) <= plain + 1e-9).all()


def test_far_off_under_tracking_counts_twice():
    status = np.array(["tracking", "tracking", "ambiguous", "lost", "init"])
    root = np.array([10.0, 200.0, 200.0, 20.0, 20.0])
    assert trust(root, status) == pytest.approx({"wrong_tracking": 0.2, "weighted_lost": 4 / 5})


def test_calibration_knows_right_sd_from_wrong_ones():
    rng = np.random.default_rng(1)
    true, sd = np.zeros((600, 15, 3)), np.full((600, 15, 3), 0.02)
    found = rng.normal(0, 0.02, true.shape)
    right, narrow, broad = (calibration(found, k * sd, true) for k in (1.0, 0.4, 2.5))
    assert right["z2"] == pytest.approx(1, abs=0.03) and right["pit_p"] > 0.01
    assert sum(right["pit"]) == pytest.approx(1)
    assert narrow["z2"] > 5 and narrow["pit"][0] > 0.2 and narrow["pit_p"] < 1e-6  # piles up at both ends
    assert broad["z2"] < 0.2 and broad["pit"][4] > 0.18 and broad["pit_p"] < 1e-6  # heaps in the middle
    assert right["crps_mm"] < narrow["crps_mm"] and right["crps_mm"] < broad["crps_mm"]
    assert right["width_mm"] == pytest.approx(2 * 1.6448536 * 20)


def test_crps_against_its_definition():
    # the integral of (cdf - step)^2 over the line
    x = np.linspace(-8, 8, 160001)
    for z in (-1.7, 0.0, 0.6):
        integral = np.sum((ndtr(x) - (x >= z)) ** 2) * (x[1] - x[0])
        assert 3.0 * integral == pytest.approx(crps(np.array(z), np.array(3.0)), rel=1e-3)


def test_picture_errors_are_pixels():
    view = Camera.looking((0.0, -5.0, 1.0), (0.0, 0.0, 1.0), (640, 480), 500.0)
    true = np.zeros((2, 15, 3)) + [0.0, 0.0, 1.0]
    found = true.copy()
    found[1] += [0.03, 0.0, 0.04]  # at 5 m and f = 500 px: 100 px per metre
    assert picture_errors(found, true, view) == pytest.approx({"median": 2.5, "mean": 2.5, "p90": 4.5})
    found[1, 3:] = [0.0, -9.0, 1.0]  # behind the camera: left out
    assert picture_errors(found, true, view) == pytest.approx({"median": 2.5, "mean": 2.5, "p90": 4.5})
    assert picture_errors(found * 0 + [0.0, -9.0, 1.0], true, view) is None


def test_phase_of_the_truth_is_linear_between_strikes_and_goes_on_outside():
    strikes = Strikes(right=np.array([10.0, 40.0, 60.0]), left=np.array([26.0]))
    np.testing.assert_allclose(strikes.phase([10, 25, 40, 50, 60, 70, 4]), [0, 0.5, 0, 0.5, 0, 0.5, 0.8])
    few = Strikes(right=np.array([30.0]), left=np.array([15.0, 46.0]))
    np.testing.assert_allclose(few.phase([15, 30, 46, 22.5]), [0.5, 0, 0.5, 0.75])
    assert Strikes(np.array([30.0]), np.zeros(0)).phase([1]) is None


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_stand_has_no_phase(mirrored):
    """The person walks, stands from frame 80 to 200, and walks on."""
    feet = [np.array([20.0, 50.0, 80.0, 215.0, 245.0]), np.array([5.0, 35.0, 65.0, 200.0, 230.0])]
    strikes, late = Strikes(*feet[:: -1 if mirrored else 1]), 0.5 * mirrored
    nan = np.nan
    found = strikes.phase([5, 35, 50, 79, 81, 140, 199, 201, 214, 230, 250])
    wanted = np.array([0.5, 0.5, 0, 29 / 30, nan, nan, nan, 0.5 + 1 / 30, 29 / 30, 0.5, 1 / 6])
    np.testing.assert_allclose(found, (wanted + late) % 1.0, atol=1e-12)
    # before the first strike and after the last the phase goes on for less than a stride
    frames = np.arange(-100, 400)
    known = frames[np.isfinite(strikes.phase(frames))]
    assert 5 - 25 < known[0] < 5 - 15 and 245 + 15 < known[-1] < 245 + 25
    rate = np.diff(strikes.cycles(frames[np.isfinite(strikes.phase(frames))]))
    assert np.sum(np.abs(rate - 1 / 30) > 1e-9) == 1  # across the stand


def test_a_stand_between_the_only_strikes_of_the_right_foot_leaves_the_cycles_of_the_left():
    strikes = Strikes(right=np.array([19.6, 138.6]), left=np.array([3.3, 38.2]))
    found = strikes.phase([3.3, 19.6, 28.9, 38.3, 60, 130, 143.6])
    np.testing.assert_allclose(found, [0.5, 0, 0.25, np.nan, np.nan, np.nan, 5 / 34.9])


def test_a_stand_counts_neither_in_the_phase_error_nor_as_swapped():
    at = np.array([10.0, 20.0, 30.0, 75.0, 85.0, 95.0])
    strikes = Strikes(right=at, left=at[:2] + 5)
    true = np.nan_to_num(strikes.phase(TRUTH.frame))
    still = (TRUTH.frame > 30) & (TRUTH.frame < 75)
    swapped = track(phase=np.where(still, 0.45, true))
    phase = evaluate(swapped, TRUTH, strikes=strikes, model=SECTIONS)["phase"]
    assert phase["flips"] == 0 and phase["p90"] == pytest.approx(0, abs=1e-9)
    nowhere = track(phase=np.where(still, 0.45, np.nan))
    assert evaluate(nowhere, TRUTH, strikes=strikes, model=SECTIONS)["phase"] is None
    assert free_run(SECTIONS, TRUTH, strikes, first=50) is None


def test_zeni_finds_the_models_own_strikes():
    found = strikes_by_zeni(TRUTH)
    for side in ("right", "left"):
        expected, strikes = getattr(STRIKES, side), getattr(found, side)
        inside = expected[(expected > 2) & (expected < 97)]
        assert len(strikes) == len(inside)
        # phase 0 of the model is its own heel strike; half a cycle later need not be the other's to the frame
        np.testing.assert_allclose(strikes, inside, atol=1.5)
    np.testing.assert_allclose(walking_direction(TRUTH)[50], [np.cos(0.7), np.sin(0.7), 0], atol=0.005)


def test_stature_is_that_of_the_limbs():
    assert stature(SECTIONS, TRUTH) == pytest.approx(HEIGHT, rel=1e-5)


def test_free_run_of_the_mean_cycle_reproduces_it():
    free = free_run(SECTIONS, TRUTH, STRIKES, first=20)
    errors = pose_errors(free, TRUTH.eval15())
    assert errors["root"]["p90"] < 1 and errors["abs"]["p90"] < 5
    np.testing.assert_allclose(free[20, [9, 10]].mean(0), TRUTH.eval15()[20, [9, 10]].mean(0), atol=1e-9)
    assert free_run(SECTIONS, TRUTH, Strikes(np.zeros(0), np.zeros(0)), first=0) is None


def test_static_pose_stands_at_the_true_hips_and_is_worse_than_the_cycle():
    still = static_pose(SECTIONS, TRUTH)
    np.testing.assert_allclose(still[:, [9, 10]].mean(1), TRUTH.eval15()[:, [9, 10]].mean(1), atol=1e-9)
    spans = np.linalg.norm(still[:, 0] - still[:, 1], axis=1)
    assert np.ptp(spans) < 1e-9  # it is one pose
    assert 50 < pose_errors(still, TRUTH.eval15())["root"]["median"] < 150


def test_a_perfect_track_is_perfect():
    view = Camera.looking((0.0, -9.0, 1.5), (0.0, 0.0, 1.0), (640, 480), 500.0)
    measures = evaluate(track(), TRUTH, strikes=STRIKES, model=SECTIONS, camera=view)
    contract = ["frames", "abs", "root", "lost", "phase", "px", "coverage", "static", "free"]
    assert list(measures)[: len(contract)] == contract
    for key in ("abs", "root", "px"):
        assert measures[key] == pytest.approx({"median": 0, "mean": 0, "p90": 0}, abs=1e-9)
    assert measures["phase"]["p90"] < 1e-9 and measures["phase"]["flips"] == 0
    assert measures["coverage"] == {"50": 1.0, "90": 1.0} and measures["frames"] == 100
    json.dumps(measures)


def test_only_common_frames_count():
    late = Joints(TRUTH.frame[60:], TRUTH.time[60:], {name: at[60:] for name, at in TRUTH.places.items()})
    measures = evaluate(track(late, move=0.05), TRUTH, strikes=STRIKES, model=SECTIONS)
    assert measures["frames"] == 40 and measures["px"] is None
    assert measures["abs"]["p90"] == pytest.approx(50) and measures["phase"]["p90"] < 1e-9
    assert measures["free"]["abs"]["p90"] < 5  # it starts at the first common frame
    with pytest.raises(UserError, match="frames 500-599 and the truth's 0-99 have none in common"):
        evaluate(track(frame=TRUTH.frame + 500), TRUTH, strikes=STRIKES, model=SECTIONS)


@pytest.mark.parametrize(
    ("truth", "meta"), [("truth.csv", "meta.json"), ("truth_2.csv", "meta_2.json"), ("mine.csv", "meta.json")]
)
def test_each_person_has_a_meta_file(tmp_path, truth, meta):
    assert meta_of(tmp_path / truth) == tmp_path / meta


def test_strikes_of_a_meta_file(tmp_path):
    path = tmp_path / "meta.json"
    path.write_text(
        json.dumps({"events_video_frames": {"r_heel_strike": [8.2, 41.4], "l_heel_strike": [25.2]}})
    )
    strikes = strikes_from_meta(path)
    assert strikes.right.tolist() == [8.2, 41.4] and strikes.left.tolist() == [25.2]
    assert strikes_of(TRUTH, path).right.tolist() == [8.2, 41.4]
    path.write_text("{}")
    assert strikes_from_meta(path) is None
    for meta in (path, tmp_path / "absent.json"):  # found in the truth instead
        assert strikes_of(TRUTH, meta).right.tolist() == strikes_by_zeni(TRUTH).right.tolist()
    path.write_text(json.dumps({"events_video_frames": {"r_heel_strike": [9, 3], "l_heel_strike": []}}))
    with pytest.raises(UserError, match="meta.json: events_video_frames: r_heel_strike does not increase"):
        strikes_from_meta(path)


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is absent")
@pytest.mark.parametrize("clip", ["side_lr_35", "oblique45_07"])
def test_zeni_on_a_dev_clip_agrees_with_its_meta_file(clip):
    folder = DATA / "eval/dev" / clip
    found, known = strikes_by_zeni(read_truth(folder / "truth.csv")), strikes_from_meta(folder / "meta.json")
    for side in ("right", "left"):
        strikes = getattr(known, side)
        inner = strikes[(strikes > 5) & (strikes < 95)]
        assert len(inner) >= 2
        assert max(np.abs(getattr(found, side) - at).min() for at in inner) < 2


def test_lifted_motion_is_compared_without_status_and_phase(tmp_path):
    names = [*EVAL15, *(name for name in JOINTS if name not in EVAL15)]
    places = np.random.default_rng(3).normal(size=(4, len(names), 3))
    path = tmp_path / "lifted.csv"
    write_lifted(path, np.arange(4), np.arange(4) / 30, names, places, np.full_like(places, 0.1))
    read = read_estimates(path)
    assert read.status == ["tracking"] * 4 and np.isnan(read.phase).all()
    np.testing.assert_allclose(read.eval15(), places[:, :15], atol=1e-5)


def test_a_model_of_segments_alone_is_refused_by_name(tmp_path):
    path = tmp_path / "segments.gait"
    blob.write(path, segment_fit.sections(toy_prior(4, 3, 2, 1)))
    with pytest.raises(UserError, match="segments.gait: contains no cyclic model; learn it without"):
        read_cyclic(path)


def cut(truth, first):
    """Return the truth from row `first`."""
    return Joints(truth.frame[first:], truth.time[first:], {n: at[first:] for n, at in truth.places.items()})


def written_truth(folder, **columns):
    """Write TRUTH to truth.csv, with further columns (n,) of text; return its path."""
    head = [f"{name}_{axis}" for name in JOINTS for axis in "xyz"]
    values = np.concatenate([TRUTH.places[name] for name in JOINTS], axis=1)
    lines = [",".join(["frame", "time", *columns, *head])]
    for i, row in enumerate(values):
        cells = [str(i), f"{TRUTH.time[i]:.6f}", *(column[i] for column in columns.values())]
        lines.append(",".join(cells + [f"{value:.6f}" for value in row]))
    path = folder / "truth.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_phase_that_the_truth_states_is_the_true_one_also_if_it_falls(tmp_path):
    """Between the strikes of the joints it would rise."""
    count = len(TRUTH.frame)
    falling = (0.9 - np.arange(count) / 33) % 1.0
    classes = ["stand" if i < 20 else "backwards" for i in range(count)]
    path = written_truth(tmp_path, phase=[f"{value:.6f}" for value in falling], motion_class=classes)
    stated = read_true_phase(path)
    assert np.isnan(stated[:20]).all()
    np.testing.assert_allclose(stated[20:], falling[20:], atol=1e-6)
    late = track(cut(TRUTH, 5), phase=(falling[5:] + 0.04) % 1.0)
    found = evaluate(late, TRUTH, strikes=STRIKES, model=SECTIONS, phase=stated)["phase"]
    assert found["flips"] == 0 and found["bias"] == pytest.approx(0.04, abs=1e-5)
    assert evaluate(late, TRUTH, strikes=STRIKES, model=SECTIONS)["phase"]["flips"] > 0.3
    compared = compare(replace(track(), phase=falling), str(path), None, None)
    assert np.abs(compared.phase[20:]).max() < 1e-6 and np.isnan(compared.phase[:20]).all()


def test_a_truth_need_not_state_a_phase_but_not_in_per_cent(tmp_path, capsys):
    assert read_true_phase(written_truth(tmp_path)) is None
    path = written_truth(tmp_path, phase=["0.5", *["37"] * (len(TRUTH.frame) - 1)])
    with pytest.raises(UserError, match="truth.csv: line 3: phase is 37; give it in strides, from 0 to 1"):
        read_true_phase(path)
    places = np.stack([TRUTH.places[name] for name in JOINTS], axis=1)
    write_lifted(tmp_path / "found.csv", TRUTH.frame, TRUTH.time, JOINTS, places, np.full_like(places, 0.1))
    assert main(["eval", str(tmp_path / "found.csv"), "--truth", str(path)]) != 0
    assert "line 3: phase is 37" in capsys.readouterr().err


@pytest.mark.parametrize(("rate", "reported"), [(30, False), (10, True)])
def test_frames_of_other_times_are_reported(tmp_path, capsys, rate, reported):
    """Every third frame of a truth with its own numbering is paired with other moments."""
    places = np.stack([TRUTH.places[name] for name in JOINTS], axis=1)
    sd, frames = np.full_like(places, 0.1), np.arange(len(places))
    write_lifted(tmp_path / "truth.csv", frames, frames / 30, JOINTS, places, sd)
    write_lifted(tmp_path / "found.csv", frames, 7 + frames / rate, JOINTS, places, sd)
    assert main(["eval", str(tmp_path / "found.csv"), "--truth", str(tmp_path / "truth.csv")]) == 0
    assert ("their times run apart by 6.60 s" in capsys.readouterr().err) == reported
