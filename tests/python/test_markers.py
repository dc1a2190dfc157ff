"""Markers to bodies: derivatives, known people recovered, gaps, agreement with joints from motion capture."""

from pathlib import Path

import marked_person as mw
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gait.body.skeleton import ANGLES, Proportions
from gait.errors import UserError
from gait.learn.mocap.markers import LANDMARKS, SETS, known_landmarks, segment_axes
from gait.learn.mocap.recording import Y_UP
from gait.learn.solve import kinematics, markers, readers, retarget, skeleton_fit
from gait.learn.solve.body import Body
from gait.learn.solve.kinematics import SEGMENTS

WALKS = Path(__file__).parents[2] / "../shared/data/mocap/cmu_walk"
MORE = Path(__file__).resolve().parents[2] / "../shared/data/mocap/more"
FILE = Path("walk.c3d")
LEGS = [n for n in ANGLES if "hip" in n or "knee" in n or "ankle" in n]


def columns(names):
    return [ANGLES.index(name) for name in names]


def angles_of(body):
    straight = retarget.align_pelvis(retarget.level(body)[0])
    return retarget.angles(straight, retarget.measure(straight))


@pytest.fixture(scope="module")
def full():
    points, pose = mw.person(mw.FULL)
    return points, pose, markers.from_markers(FILE, mw.FULL, points, 120.0)


def test_derivatives_are_exact():
    rng, frames, marks = np.random.default_rng(0), 3, 40
    segment, at = rng.integers(0, len(SEGMENTS), marks), rng.normal(scale=0.1, size=(marks, 3))
    log_scales = rng.normal(scale=0.1, size=kinematics.SCALE_TABLE.shape[2])
    turn = Rotation.from_rotvec(rng.normal(size=(frames, 3))).as_matrix()
    pose = kinematics.Pose(rng.normal(size=(frames, 3)), turn, rng.normal(scale=0.5, size=(frames, 24)))

    def world(pose, log_scales):
        local = kinematics.segment_scales(log_scales)[segment] * at
        return kinematics.pose_skeleton(pose, kinematics.segment_origins(log_scales)).points(local, segment)

    body, small = kinematics.pose_skeleton(pose, kinematics.segment_origins(log_scales)), 1e-6
    by_pose = body.by_pose(world(pose, log_scales), segment)
    by_scales = body.by_scales(log_scales, at, segment)
    directions = body.rotations[:, segment][..., 1]
    by_turn = body.directions_by_pose(directions, segment)
    for k in range(kinematics.FREEDOMS):
        step = np.zeros((frames, kinematics.FREEDOMS))
        step[:, k] = small
        ahead, behind = pose.moved(step), pose.moved(-step)
        slope = (world(ahead, log_scales) - world(behind, log_scales)) / (2 * small)
        assert by_pose[..., k] == pytest.approx(slope, abs=1e-7)
        turns = [
            kinematics.pose_skeleton(p, kinematics.segment_origins(log_scales)).rotations[:, segment][..., 1]
            for p in (ahead, behind)
        ]
        assert by_turn[..., k] == pytest.approx((turns[0] - turns[1]) / (2 * small), abs=1e-7)
    for k in range(len(log_scales)):
        step = small * np.eye(len(log_scales))[k]
        slope = (world(pose, log_scales + step) - world(pose, log_scales - step)) / (2 * small)
        assert by_scales[..., k] == pytest.approx(slope, abs=1e-7)


def test_unusual_lengths_are_found_again(full):
    """Lengths 8 % off the generic ones, markers 6 mm off their places, 3 mm of noise."""
    _, pose, body = full
    error = np.degrees(angles_of(body) - pose.angles)
    offset = error.mean(axis=0)[:-2]  # without the ankles: these feet never stand flat, which gives the zero
    assert 0.002 < body.residual < 0.006
    assert error.std(axis=0)[columns(LEGS)].max() < 1.5 and error.std(axis=0).max() < 2.5
    assert np.abs(offset)[columns(LEGS[:-2])].max() < 2.5 and np.abs(offset).max() < 5.0


def test_angles_have_no_offset_where_markers_sit_in_their_places():
    log_scales = np.zeros(kinematics.SCALE_TABLE.shape[2])
    log_scales[0] = np.log(1.6)
    angles = mw.walk_angles(240, 120.0)
    place = np.stack([1.2 * np.arange(240) / 120, np.zeros(240), np.full(240, 0.85)], axis=1)
    pose = kinematics.Pose(place, np.tile(np.eye(3), (240, 1, 1)), angles)
    marks = mw.landmarks(mw.FULL)
    segment = np.array([SEGMENTS.index(m.segment) for m in marks])
    local = kinematics.segment_scales(log_scales)[segment] * np.array([m.at for m in marks])
    points = kinematics.pose_skeleton(pose, kinematics.segment_origins(log_scales)).points(local, segment)
    body = markers.from_markers(FILE, mw.FULL, points, 120.0)
    assert body.residual < 1e-3
    offset = np.degrees(angles_of(body) - angles).mean(axis=0)
    assert (
        np.abs(offset)[:-2].max() < 1.0
    )  # the feet never stand flat here, which would give the ankles' zero


def test_a_segment_without_markers_is_missing_there_and_only_there(full):
    points, _, whole = full
    gone = points.copy()
    gone[100:160, [mw.FULL.index(k) for k in ("LTIB", "LANK", "LHEE", "LTOE")]] = np.nan
    gone[200:220, [mw.FULL.index(k) for k in ("RELB", "RUPA", "RFRA", "RWRA", "RWRB")]] = np.nan
    found = angles_of(markers.from_markers(FILE, mw.FULL, gone, 120.0))
    missing = np.isnan(found)
    expected = np.zeros_like(missing)
    expected[100:160, columns(["l_knee_flexion", "l_ankle_flexion"])] = True
    arm = [f"r_shoulder_{a}" for a in ("flexion", "abduction", "rotation")] + ["r_elbow_flexion"]
    expected[200:220, columns(arm)] = True
    assert (missing == expected).all()
    apart = np.degrees(np.abs(found - angles_of(whole)))[~expected]
    assert np.sqrt((apart**2).mean()) < 1.0


def test_one_missing_marker_of_many_leaves_no_gap(full):
    points, _, _ = full
    gone = points.copy()
    gone[:, mw.FULL.index("LTIB")] = np.nan
    gone[40:90, mw.FULL.index("RTHI")] = np.nan
    found = angles_of(markers.from_markers(FILE, mw.FULL, gone, 120.0))
    assert np.isfinite(found[:, columns(LEGS)]).all()


def test_outliers_do_not_pull(full):
    points, _, whole = full
    outliers = points.copy()
    outliers[50:120, mw.FULL.index("LKNE")] += (0.3, 0.2, 0.1)
    found = angles_of(markers.from_markers(FILE, mw.FULL, outliers, 120.0))
    apart = np.degrees(found - angles_of(whole))[50:120, columns(LEGS)]
    assert np.sqrt((apart**2).mean()) < 2.0


def test_a_few_frames_that_do_not_fit_do_not_count_against_the_others(full):
    """In 15 % of the frames only six markers are visible, and these belong to another person."""
    points, _, whole = full
    strange = points.copy()
    strange[40:94] = np.nan
    six = [mw.FULL.index(name) for name in ("LASI", "RASI", "LKNE", "RKNE", "LANK", "RANK")]
    strange[40:94, six] = points[40:94, six][:, [5, 2, 0, 4, 1, 3]] * [1.0, 1.0, 1.9]
    body = markers.from_markers(FILE, mw.FULL, strange, 120.0)
    assert body.residual < 0.01
    found = angles_of(body)
    assert np.isnan(found[40:94]).all() and np.isnan(body.joints["l_knee"][40:94]).all()
    rest = np.r_[0:40, 94 : len(points)]
    apart = np.degrees(found - angles_of(whole))[rest][:, columns(LEGS)]
    assert np.sqrt((apart**2).mean()) < 3.0


def test_frames_without_a_person_are_missing(full):
    points, _, _ = full
    gone = points.copy()
    gone[:50] = gone[300:] = np.nan
    body = markers.from_markers(FILE, mw.FULL, gone, 120.0)
    straight = retarget.align_pelvis(retarget.level(body)[0])
    channels, heading = retarget.root_channels(straight, retarget.measure(straight), 120.0)
    everything = np.concatenate([angles_of(body), channels], axis=1)
    assert np.isnan(everything[:50]).all() and np.isnan(everything[300:]).all()
    assert np.isfinite(everything[50:300]).all() and np.isfinite(heading).all()


def test_legs_alone_have_legs_alone():
    points, pose = mw.person(mw.LOWER, seed=3)
    body = markers.from_markers(FILE, mw.LOWER, points, 120.0)
    straight = retarget.align_pelvis(retarget.level(body)[0])
    measures = retarget.measure(straight)
    found = retarget.angles(straight, measures)
    assert np.isfinite(found[:, columns(LEGS)]).all()
    assert np.isnan(np.delete(found, columns(LEGS), axis=1)).all()
    assert (
        np.isnan(measures.neck) and np.isnan(measures.upper_arm).all() and np.isfinite(measures.thigh).all()
    )
    assert measures.stature == pytest.approx(1.82, rel=0.1)
    own, generic = retarget.own_proportions(measures), Proportions()
    assert (own.neck, own.shoulder, own.forearm) == (generic.neck, generic.shoulder, generic.forearm)
    assert own.thigh != generic.thigh
    error = np.degrees(found - pose.angles)[:, columns(LEGS)]
    assert (error - error.mean(axis=0)).std(axis=0).max() < 1.6


def test_the_mean_body_takes_parts_from_those_who_have_them():
    points, _ = mw.person(mw.LOWER, frames=240)
    legs = retarget.measure(markers.from_markers(FILE, mw.LOWER, points, 120.0))
    points, _ = mw.person(mw.FULL, frames=240, seed=5)
    whole = retarget.measure(markers.from_markers(FILE, mw.FULL, points, 120.0))
    both = retarget.mean_proportions([legs, whole, None])
    assert both.neck == retarget.own_proportions(whole).neck
    assert both.thigh == pytest.approx(np.mean([retarget.own_proportions(m).thigh for m in (legs, whole)]))
    assert retarget.mean_proportions([None]).thigh == Proportions().thigh


@pytest.mark.parametrize("turn", [np.eye(3), Y_UP.T, np.diag([1.0, -1, -1])], ids=["z-up", "y-up", "z-down"])
def test_any_axis_may_be_up(full, turn):
    points, _, body = full
    turned = markers.from_markers(FILE, mw.FULL, points @ turn.T, 120.0)
    assert turned.pelvis[:, 2, 2].mean() > 0.95
    assert np.degrees(angles_of(turned)) == pytest.approx(np.degrees(angles_of(body)), abs=0.5)


def test_a_treadmill_becomes_ground():
    points, _ = mw.person(mw.FULL)
    body = markers.from_markers(FILE, mw.FULL, points, 120.0)
    sliding = np.array([0.0, -1.5, 0.0]) * np.arange(360)[:, None] / 120
    still = body.joints["pelvis"][:, :2] - body.joints["pelvis"][:1, :2]
    on_the_spot = np.concatenate([still, np.zeros((360, 1))], axis=1)
    joints = {n: p - on_the_spot for n, p in body.joints.items()}
    foot = sliding + [0.0, 0.0, 0.01] * np.abs(np.sin(np.arange(360) / 19))[:, None]
    joints |= {f"{s}_{name}": foot for s in "lr" for name in ("ankle", "toe")}
    belt = retarget.overground(Body("belt", 120.0, joints, body.pelvis, body.lateral))
    travel = belt.joints["pelvis"][-1] - belt.joints["pelvis"][0]
    assert travel[:2] == pytest.approx([0, 1.5 * 359 / 120], abs=0.1)
    assert retarget.overground(body) is body


def on_belt(speed, slope, stance, frames=480, fps=120.0, period=100.0):
    """Joints of a person who stays in place: feet move back with a sloping belt, then forward in the air."""
    rng, joints = np.random.default_rng(3), {"pelvis": np.tile([0.0, 0.0, 1.0], (frames, 1))}
    for s, lag in (("l", 0.0), ("r", 0.5)):
        phase = np.mod(np.arange(frames) / period + lag, 1)
        reach = speed * stance * period / fps
        swing = np.clip((phase - stance) / (1 - stance), 0, 1)
        ahead = reach * np.where(phase < stance, 0.5 - phase / stance, -0.5 * np.cos(np.pi * swing))
        height = slope * ahead + 0.12 * np.sin(np.pi * swing)
        for name, above in (("ankle", 0.09), ("toe", 0.02)):
            place = np.stack([ahead, np.full(frames, 0.1 if s == "l" else -0.1), above + height], axis=1)
            joints[f"{s}_{name}"] = place + rng.normal(scale=0.001, size=place.shape)
    return Body("belt", fps, joints, np.tile(np.eye(3), (frames, 1, 1)))


@pytest.mark.parametrize("slope", [-0.1, 0.0, 0.15])
@pytest.mark.parametrize(("speed", "stance"), [(1.2, 0.62), (2.5, 0.36), (3.5, 0.28)])
def test_belts_of_walks_and_runs_are_found_whatever_their_slope(speed, stance, slope):
    body = on_belt(speed, slope, stance)
    ground = retarget.overground(body)
    assert ground.notes.belt == pytest.approx(speed, rel=0.02)
    assert ground.joints["pelvis"][-1, 0] == pytest.approx(speed * 479 / 120, rel=0.02)


def test_feet_that_do_not_slide_show_no_belt():
    body = on_belt(0.0, 0.0, 0.6)
    still = retarget.overground(body)
    assert still.notes.belt == 0 and np.array_equal(still.joints["pelvis"], body.joints["pelvis"])
    rng = np.random.default_rng(0)
    for name in ("l_ankle", "r_ankle", "l_toe", "r_toe"):
        body.joints[name] = np.cumsum(rng.normal(scale=0.01, size=(480, 3)), axis=0)
    assert retarget.overground(body).notes.belt == 0


@pytest.mark.skipif(not MORE.is_dir(), reason="needs recordings of further people beside the repository")
@pytest.mark.parametrize(("name", "speed"), [("s02/s02_01", 2.5), ("s09/s09_02", 3.5)])
def test_belts_of_recorded_runs(name, speed):
    body = readers.read(MORE / f"run_rbds/{name}.trc")
    assert body.notes.belt == pytest.approx(speed, rel=0.02)


@pytest.mark.parametrize("name", ["02/02_01", "35/35_01"])
def test_markers_and_skeleton_of_one_recording_agree(name):
    """Markers put on the bones of a CMU subject give the angles of that subject's skeleton."""
    if not WALKS.is_dir():
        pytest.skip(f"{WALKS} is absent: the learning data are not part of the repository")
    body = retarget.align_pelvis(retarget.level(readers.read(WALKS / f"{name}.amc"))[0])
    measures = retarget.measure(body)
    points = mw.on_body(body, measures, mw.FULL)
    points += np.random.default_rng(0).normal(scale=0.002, size=points.shape)
    found = markers.from_markers(FILE, mw.FULL, points, body.fps)
    apart = np.degrees(angles_of(found) - retarget.angles(body, measures))
    assert found.residual < 0.005
    assert np.abs(apart.mean(axis=0))[columns(LEGS)].max() < 2.0
    assert apart.std(axis=0)[columns(LEGS)].max() < 1.2
    trunk = [f"torso_{axis}" for axis in "xyz"]
    assert np.abs(apart[:, columns(trunk)].mean(axis=0)).max() < 2.0
    assert np.abs(apart.mean(axis=0)).max() < 6.0  # shoulders: a clavicle moves, the model's does not


def test_points_of_no_body_are_refused():
    rng = np.random.default_rng(0)
    points = rng.normal(scale=0.5, size=(100, len(mw.LOWER), 3))
    with pytest.raises(
        UserError, match=r"walk.c3d: the markers do not fit a body \(rms \d+ mm, worst '\w+'\)"
    ):
        markers.from_markers(FILE, mw.LOWER, points, 120.0)


def test_the_core_needs_three_points():
    points = skeleton_fit.Points(np.zeros(2, np.intp), np.zeros((2, 3)), np.ones(2))
    with pytest.raises(ValueError, match="three points"):
        skeleton_fit.fit(np.zeros((4, 2, 3)), points)


# ---- labels ----


def with_axes(points, ends, at=0):
    """Points (T, M, 3) and four more: a turning segment's origin on the clavicle, and points on its axes."""
    turn = Rotation.from_rotvec(np.linspace(0, 1, len(points))[:, None] * [0.0, 0, 1]).as_matrix()
    origin = points[:, mw.FULL.index("LSHO")] + [0.0, 0.0, -0.1]
    four = [origin, *(origin + 0.15 * turn[:, :, k] for k in range(3))]
    return np.concatenate([points, np.stack(four, axis=1)], axis=1), [f"LCL{end}" for end in ends]


@pytest.mark.parametrize("ends", ["OALP", "OXYZ", "0123"])
def test_axes_of_segments_are_no_markers(ends):
    points, axes = with_axes(mw.person(mw.FULL, frames=60)[0], ends)
    labels = [*mw.FULL, *axes]
    assert segment_axes(labels, points) == set(range(len(mw.FULL), len(labels)))
    assert set(markers.assign(FILE, labels, points, None)) == set(range(len(mw.FULL)))


def test_a_marker_named_like_an_axis_is_a_marker():
    """LCLA alone is a marker on the clavicle; so are four of such names that are not at right angles."""
    points = mw.person(mw.FULL, frames=60)[0]
    four = [mw.FULL.index(name) for name in ("LSHO", "CLAV", "STRN", "C7")]
    labels = [*mw.FULL, "LCLO", "LCLA", "LCLL", "LCLP"]
    assert segment_axes(labels, np.concatenate([points, points[:, four]], axis=1)) == set()
    assert segment_axes([*mw.FULL, "LCLA"], points[:, [*range(len(mw.FULL)), four[0]]]) == set()


def test_anatomical_abbreviations_are_known():
    pig = {
        "ASI": "IAS", "PSI": "IPS", "KNE": "FLE", "TIB": "FAX", "ANK": "FAL", "HEE": "FCC", "TOE": "FM2",
    }  # fmt: skip
    labels = [f"{s}_{name}" for s in "LR" for name in pig.values()]
    places = known_landmarks([*labels, "CV7", "SJN", "L_FME", "R_TAM"])
    for s in "LR":
        for old, new in pig.items():
            assert places[f"{s}{new}".lower()] == LANDMARKS[SETS["plug-in-gait"][f"{s}{old}".lower()]]
    clusters = known_landmarks(
        [f"{s}_{part}_{k}" for s in "RL" for part in ("THIGH", "SHANK") for k in (1, 4)]
    )
    assert len(clusters) == 8 and clusters["rthigh1"] == LANDMARKS["r_thigh_side"]
    assert places["cv7"] == LANDMARKS["c7"] and places["rtam"] == LANDMARKS["r_ankle_medial"]
