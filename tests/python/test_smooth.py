"""Smoothing: the dynamics in numpy, the exact linear case, two modes, new starts, the command."""

import json
import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from drawn_person import camera, clip, state_at, wall, write
from transitions import Step, Transitions

from gait import GaitError, Model, State, Tracker, TrackerConfig, UserError
from gait.bindings.abi import Flag, Mode, TrackStatus
from gait.bindings.library import struct_fields
from gait.bindings.model import read_blob
from gait.body.model_curves import ModelCurves
from gait.cli import main
from gait.io import blob
from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.motion.footfalls import Draws
from gait.track import smooth
from gait.track.class_changes import ClassChanges
from gait.track.smooth import Smoother, Spool, draw_motions, smoothed, with_later_checks

SECTIONS = blob.decode(read_blob(None))
if "PROP" not in SECTIONS:  # two ways in which limbs differ in length
    random = np.random.default_rng(0)
    SECTIONS["PROP"] = (0.03 * random.standard_normal((2, len(SECTIONS["FRMI"]) + 1))).astype(np.float32)
MODEL = Model(blob.encode(SECTIONS))
CURVES = ModelCurves(SECTIONS)


NOISE = [row.name for row in struct_fields("gait_tracker_config") if "_noise" in row.name]


def coasting(mode, count, **changes):
    """A tracker of 8000 particles that has only predicted, for `count` steps, and its numpy version.

    It settles early, because without a picture it is lost after a third of a second and then searches.
    """
    changes = {"particles": 8000, "resample_ess": 0.0, "settle_time": 0.15} | changes
    config = TrackerConfig.default(mode, proportions=-1 if mode is Mode.DEFAULT else 0, **changes)
    tracker = Tracker(MODEL, camera(), config, tasks=2)
    mean = state_at(MODEL, SECTIONS, 0.0)
    sd = State(phase=0.1, stride_hz=0.1, stature=0.05, heading=0.2, pitch=0.03, roll=0.03, turn_rate=0.2)
    sd.pelvis, sd.coef, sd.offset = np.full(3, 0.05), np.ones(MODEL.info.components), np.full(24, 0.05)
    sd.proportion = np.full(MODEL.info.proportions, 0.5)
    tracker.start(mean, sd, 0)
    for i in range(count):
        tracker.step(None, 33333 * i)
    return tracker, Transitions(CURVES, tracker.config)


@pytest.mark.parametrize("mode", list(Mode))
@pytest.mark.parametrize("reverse", [0.0, 1.0])
def test_states_move_as_the_twin_moves_them(mode, reverse):
    still = dict.fromkeys(NOISE, 0.0) | {"turn_time": 0.0, "reverse": reverse}
    tracker, twin = coasting(mode, 1, **still)
    before = tracker.particles()[0]
    moved = tracker.predict(before, 0.04)
    step = Step(0.04, True, False, tracker.start_stature_sd)
    theirs = twin.move(twin.table(before), step, np.random.default_rng(0))
    np.testing.assert_allclose(twin.difference(twin.table(moved), theirs), 0, atol=1e-6)
    assert np.abs(moved["pelvis"] - before["pelvis"]).max() > 0.02
    np.testing.assert_array_equal(tracker.predict(before, 0.0), before)


@pytest.mark.parametrize("mode", list(Mode))
@pytest.mark.parametrize("steps", [2, 7], ids=["settling", "settled"])
def test_states_vary_as_those_of_the_twin(mode, steps):
    changes = {"stature_noise": 0.3, "stature_noise_start": 0.6}
    if mode is Mode.DEFAULT:
        changes["turn_time"] = 0.2  # so that turn rates change in one step
    tracker, twin = coasting(mode, steps, **changes)
    particles = tracker.particles()[0]
    before, step = twin.table(particles), Step(0.033333, steps == 2, True, tracker.start_stature_sd)
    a = twin.difference(twin.move(before, step, np.random.default_rng(0)), before)
    b = twin.difference(twin.table(tracker.predict(particles, 0.033333)), before)
    tolerance = 5 * np.hypot(a.std(axis=0), b.std(axis=0)) / np.sqrt(len(a)) + 1e-6
    np.testing.assert_array_less(np.abs(a.mean(axis=0) - b.mean(axis=0)), tolerance)
    np.testing.assert_allclose(a.std(axis=0), b.std(axis=0), rtol=0.06, atol=1e-6)
    assert a[:, 2].std() > 0


def test_prediction_leaves_the_tracker_alone_and_refuses_what_cannot_move():
    tracker, _ = coasting(Mode.DEFAULT, 1, particles=64)
    states, digest = tracker.particles()[0], tracker.digest()
    np.testing.assert_array_equal(tracker.predict(states, 0.03), tracker.predict(states, 0.03))
    assert tracker.digest() == digest and len(tracker.predict(states[:0], 0.03)) == 0
    for seconds in (-0.1, 1e3, np.nan):
        with pytest.raises(GaitError, match="dt = .* is outside"):
            tracker.predict(states, seconds)
    states["turn_rate"][5] = np.nan
    with pytest.raises(GaitError, match="not finite"):
        tracker.predict(states, 0.03)


class Linear:
    """Four numbers that follow a linear rule with normal noise; the first and fourth are small angles."""

    rule = np.eye(4) * 0.9 + 0.05 * np.eye(4, k=1)
    noise = np.diag([0.01, 0.02, 0.015, 0.01])

    def move(self, before, random):
        return 0.5 + (before - 0.5) @ self.rule.T + random.standard_normal(before.shape) @ self.noise


class Pairs:
    """Replaces a spool: tables of equal weights, moved by a rule; a start at the frames in `starts`."""

    def __init__(self, frames, rule, starts=()):
        self.frames, self.rule, self.starts = frames, rule, {*starts, len(frames)}
        self.random = np.random.default_rng(3)

    def __len__(self):
        return len(self.frames)

    def read(self, index):
        before = self.frames[index][:: max(1, len(self.frames[index]) // 1000)]
        return before, None if index + 1 in self.starts else self.rule.move(before, self.random)


@pytest.mark.long
def test_linear_normal_dynamics_give_the_exact_smoother():
    """Against the recursion of Rauch, Tung and Striebel, from samples of the Kalman filter's posteriors."""
    rule, random = Linear.rule, np.random.default_rng(1)
    q, h, r = Linear.noise @ Linear.noise, np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 1.0]]), 0.02**2 * np.eye(2)
    x, mean, cov = np.zeros(4), np.zeros(4), 0.03**2 * np.eye(4)
    means, covs = [], []
    for _ in range(12):
        x = rule @ x + Linear.noise @ random.standard_normal(4)
        mean, cov = rule @ mean, rule @ cov @ rule.T + q
        gain = cov @ h.T @ np.linalg.inv(h @ cov @ h.T + r)
        mean = mean + gain @ (h @ x + 0.02 * random.standard_normal(2) - h @ mean)
        cov = cov - gain @ h @ cov
        means.append(mean)
        covs.append(cov)
    frames = [0.5 + random.multivariate_normal(m, c, 4000) for m, c in zip(means, covs, strict=True)]
    drawn = draw_motions(Pairs(frames, Linear()), 2000, 1) - 0.5
    smooth_mean, smooth_cov = means[-1], covs[-1]
    for i in range(10, -1, -1):
        ahead = rule @ covs[i] @ rule.T + q
        gain = covs[i] @ rule.T @ np.linalg.inv(ahead)
        smooth_mean = means[i] + gain @ (smooth_mean - rule @ means[i])
        smooth_cov = covs[i] + gain @ (smooth_cov - ahead) @ gain.T
        sd = np.sqrt(np.diag(smooth_cov))
        assert np.abs(drawn[:, i].mean(axis=0) - smooth_mean).max() < 0.25 * sd.max()
        np.testing.assert_allclose(drawn[:, i].std(axis=0), sd, rtol=0.12)
    assert drawn[:, 0].std(axis=0).sum() < 0.95 * frames[0].std(axis=0).sum()


def two_modes(count=600):
    """A third of the particles half a stride ahead of the others, for five frames."""
    random, frames = np.random.default_rng(2), []
    for _ in range(5):
        states = 0.5 + 0.01 * random.standard_normal((count, 4))
        states[: count // 3, 0] -= 0.4
        frames.append(states)
    return frames


class Still(Linear):
    rule = np.eye(4)


def test_a_motion_stays_in_its_mode():
    motions = draw_motions(Pairs(two_modes(), Still()), 300, 1)
    ahead = motions[:, :, 0] < 0.3
    assert (ahead == ahead[:, :1]).all() and ahead[:, 0].mean() == pytest.approx(1 / 3, abs=0.01)
    assert (np.abs(motions[:, :, 0] - np.where(ahead, 0.1, 0.5)) < 0.06).all()


def test_a_new_start_begins_motions_of_its_own():
    frames = two_modes()
    joined, apart = (draw_motions(Pairs(frames, Still(), s), 300, 1) for s in ((), (3,)))
    together = np.corrcoef(joined[:, 2, 3], joined[:, 3, 3])[0, 1]
    assert abs(np.corrcoef(apart[:, 2, 3], apart[:, 3, 3])[0, 1]) < 0.2 < together


FOUR = Model("classes")
WALK, STAND = (FOUR.classes.index(name) for name in ("walk", "stand"))


def of_classes(which):
    """States (N,) of these classes of a person at the origin, with stride rates and scores of their own."""
    state = FOUR.prior()[0]
    state.pelvis = np.array([0.0, 0.0, 0.95])
    states = np.tile(np.ctypeslib.as_array(state.to_c()), len(which))
    states["motion_class"] = which
    states["stride_hz"][which == STAND] = 0.5
    states["coef"][which == STAND, 0] = 1.0
    return states


def test_classes_are_drawn_as_the_exact_smoother_of_a_markov_chain_has_them():
    """Against the forward-backward algorithm; the person stops, and is shown badly while doing so."""
    sections, random, seconds = dict(FOUR.sections()), np.random.default_rng(4), 0.1
    sections["CLSW"] = np.zeros((4, 4, 4), np.float32)
    sections["CLSW"][WALK, STAND, 0], sections["CLSW"][STAND, WALK, 0] = 1.0, 0.5
    to = np.array([[0.9, 0.1], [0.05, 0.95]])
    shown = np.array([[0.9, 0.1]] * 4 + [[0.6, 0.4]] * 6 + [[0.3, 0.7]] * 6)
    ahead, now = [], np.array([0.9, 0.1])
    for row in shown:
        now = row * (now @ to)
        now /= now.sum()
        ahead.append(now)
    wanted, later = [], np.ones(2)
    for row, forward in zip(shown[::-1], ahead[::-1], strict=True):
        both = forward * later
        wanted.insert(0, both[1] / both.sum())
        later = to @ (row * later)

    class Spooled:
        frames = [of_classes(np.where(random.random(1000) < p[1], STAND, WALK)) for p in ahead]

        def __len__(self):
            return len(self.frames)

        def read(self, index):
            table = self.frames[index].view(np.float32).reshape(1000, -1)
            return table, table if index + 1 < len(self) else None

        def seconds(self, index):
            return seconds

    drawn = draw_motions(Spooled(), 1000, 1, changes=ClassChanges(sections))
    which = np.stack([ClassChanges.of(motion) for motion in drawn])
    assert set(np.unique(which)) == {WALK, STAND}
    assert np.abs((which == STAND).mean(axis=0) - wanted).max() < 0.06
    assert np.abs(np.array(wanted) - [p[1] for p in ahead]).max() > 0.2  # the filter differs
    rates = drawn[..., 1]
    assert (rates[which == STAND] == 0.5).all() and (rates[which == WALK] > 0.6).all()


def test_an_estimate_is_that_of_the_most_frequent_class():
    states = of_classes(np.repeat([STAND, WALK], [60, 40]))
    joints, angles = FOUR.poses(states)
    tracker = Tracker(FOUR, camera(), TrackerConfig.default(particles=64))
    tracker.start(FOUR.prior()[0], State(phase=0.05), 0)
    then = tracker.step(None, 0)
    assert then.motion_class == "walk"
    now = smoothed(then, FOUR, states, joints, angles)
    assert now.motion_class == "stand" and now.mean.motion_class == STAND and now.speed == 0
    assert now.class_probability[[WALK, STAND]].tolist() == [0.4, 0.6]
    assert now.mean.stride_hz == pytest.approx(0.5) and now.mean.coef[0] == pytest.approx(1.0)
    np.testing.assert_allclose(FOUR.pose(now.mean)[0], joints[0], atol=1e-4)
    np.testing.assert_allclose(now.angles, angles[0], atol=1e-5)


def test_a_frame_that_others_fit_stays_ambiguous():
    states = of_classes(np.repeat(WALK, 100))
    joints, angles = FOUR.poses(states)
    tracker = Tracker(FOUR, camera(), TrackerConfig.default(particles=64))
    tracker.start(FOUR.prior()[0], State(phase=0.05), 0)
    then = replace(tracker.step(None, 0), status=TrackStatus.AMBIGUOUS)
    halves = states.copy()
    halves["phase"][50:] += 0.5
    for flags, drawn, status in (
        (0, states, TrackStatus.TRACKING),
        (0, halves, TrackStatus.AMBIGUOUS),
        (Flag.OTHERS_FIT, states, TrackStatus.AMBIGUOUS),
    ):
        assert smoothed(replace(then, flags=flags), FOUR, drawn, joints, angles).status == status


def test_the_frames_that_a_check_averages_over_are_flagged_up_to_a_start():
    tracker = Tracker(FOUR, camera(), TrackerConfig.default(particles=64))
    tracker.start(FOUR.prior()[0], State(phase=0.05), 0)
    estimate = tracker.step(None, 0)
    filtered = [
        (
            Frame(i, 0.125 * i, wall()),
            replace(estimate, frame=i % 20, flags=Flag.OTHERS_FIT * (i in (15, 22))),
        )
        for i in range(30)
    ]
    flagged = [bool(found.flags & Flag.OTHERS_FIT) for _, found in with_later_checks(filtered)]
    assert [i for i, one in enumerate(flagged) if one] == [*range(10, 16), 20, 21, 22]


@pytest.mark.parametrize(
    ("file", "name", "ours"),
    [
        ("fit_check.c", "AVERAGE_TIME =", smooth._CHECKED_S),
        ("estimate.h", "DOMINANT_WEIGHT", smooth._DOMINANT_WEIGHT),
    ],
)
def test_numbers_of_the_library_are_the_same_here(file, name, ours):
    text = (Path(__file__).resolve().parents[2] / "libgait/src/tracker" / file).read_text()
    assert [float(found) for found in re.findall(rf"{name} ([\d.]+)f", text)] == [ours]


def test_a_clip_of_a_model_with_classes_is_smoothed():
    tracker = Tracker(FOUR, camera(), TrackerConfig.default(particles=400))
    mean, sd = FOUR.prior()
    mean.pelvis, sd.phase, sd.heading = state_at(MODEL, SECTIONS, 0.0).pelvis, 0.02, 0.02
    tracker.start(mean, sd, 0)
    with Smoother(tracker) as smoother:
        for i in range(12):
            smoother.add(Frame(i, i / 30, wall()), tracker.step(None, 33333 * i))
        rows, _ = smoother.finish(40)
    for _, now in rows:
        assert now.class_probability.sum() == pytest.approx(1)
        assert now.motion_class == FOUR.classes[now.mean.motion_class]
        assert now.class_probability[now.mean.motion_class] == now.class_probability.max()


def test_the_spool_gives_back_pairs_and_knows_the_starts():
    tracker = Tracker(MODEL, camera(), TrackerConfig.default(particles=64))
    with Spool(1) as spool:
        for begin in (0, 4):
            tracker.start(state_at(MODEL, SECTIONS, 0.0), State(turn_rate=0.1), 33333 * begin)
            for i in range(begin, begin + 4):
                spool.add(tracker, tracker.step(None, 33333 * i))
        last = tracker.particles()[0]
        assert len(spool) == 8
        assert [spool.read(i)[1] is None for i in range(8)] == [i in (3, 7) for i in range(8)]
        states, moved = spool.read(0)
        assert np.abs(moved[:, 0] - states[:, 0] - 0.033333 * states[:, 1]).max() < 0.05
        rows = {row.tobytes() for row in last.view(np.float32).reshape(len(last), -1)}
        chosen = spool.read(7)[0]
        assert {row.tobytes() for row in chosen} <= rows and len(chosen) == 1000


def test_what_no_number_of_frames_makes_less_is_added_as_the_library_does():
    tracker = Tracker(MODEL, camera(), TrackerConfig.default(particles=2000))
    uncertainty = State(stature=0.1, phase=0.02, pelvis=np.full(3, 0.05))
    tracker.start(state_at(MODEL, SECTIONS, 0.0), uncertainty, 0)
    theirs = tracker.step(None, 0)
    states, _ = tracker.particles()
    with Smoother(tracker) as smoother:
        smoother.add(Frame(0, 0.0, wall()), theirs)
        ours = smoother._widened(0, smoothed(theirs, MODEL, states, *MODEL.poses(states)))
    assert tracker.start_stature_sd > 0.05
    np.testing.assert_allclose(ours.joint_sd, theirs.joint_sd, rtol=0.02)
    np.testing.assert_allclose(ours.sd.stature, theirs.sd.stature, rtol=0.02)
    # Three tenths of the variance of the filter's phase are errors that return with every stride.
    np.testing.assert_allclose(ours.sd.phase, np.sqrt(1.3) * theirs.sd.phase, rtol=0.05)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Drawn clip of 24 frames with all that gait track asks for."""
    here = tmp_path_factory.mktemp("smooth")
    pictures, _ = clip(MODEL, SECTIONS, 24)
    write(here / "walk.mp4", pictures)
    cv2.imwrite(str(here / "plate.png"), wall())
    (here / "camera.json").write_text(json.dumps(camera().to_dict()))
    first = state_at(MODEL, SECTIONS, 0.0)
    init = {"frame": 0, "pelvis": first.pelvis.tolist(), "heading_rad": 0.0, "phase": 0.2, "stride_hz": 0.9}
    (here / "init.json").write_text(json.dumps(init | {"stature_m": 1.75}))
    return here


def track(folder, output, *more):
    here = [str(folder / name) for name in ("walk.mp4", "camera.json", "init.json", "plate.png")]
    command = ["track", here[0], "--camera", here[1], "--init", here[2], "--background", here[3]]
    return main([*command, "-o", str(folder / output), "--particles", "300", "--quiet", *more])


@pytest.mark.long
def test_the_command_smooths_and_repeats_itself(folder):
    for output, more in (("f.csv", ()), ("s.csv", ("--smooth", "--draws", str(folder / "d.npz")))):
        assert track(folder, output, *more) == 0
    assert track(folder, "again.csv", "--smooth", "--overlay", str(folder / "o.mp4")) == 0
    assert (folder / "s.csv").read_bytes() == (folder / "again.csv").read_bytes()
    filtered, smooth = read_track(folder / "f.csv"), read_track(folder / "s.csv")
    np.testing.assert_array_equal(smooth.frame, filtered.frame)
    assert smooth.eval15_sd().mean() < filtered.eval15_sd().mean()
    assert smooth.eval15_sd().min() > 0.015 * 1.7  # what the model cannot express stays
    assert np.abs(smooth.eval15() - filtered.eval15()).mean() < 0.03
    draws = Draws.read(folder / "d.npz", smooth)
    for i, name in enumerate(draws.joint_names):
        np.testing.assert_allclose(draws.joints[:, :, i].mean(axis=0), smooth.places[name], atol=2e-5)


@pytest.mark.long  # reads the draws of the test above
def test_draws_need_smoothing_and_their_own_track(folder, capsys):
    assert track(folder, "x.csv", "--draws", str(folder / "x.npz")) == 2
    assert "--smooth" in capsys.readouterr().err and not (folder / "x.csv").exists()
    assert track(folder, "short.csv", "--stop", "20") == 0
    with pytest.raises(UserError, match="frames are not those"):
        Draws.read(folder / "d.npz", read_track(folder / "short.csv"))
    (folder / "bad.npz").write_bytes(b"no")
    with pytest.raises(UserError, match="not a file of draws"):
        Draws.read(folder / "bad.npz", read_track(folder / "short.csv"))
