"""Smoothing: the dynamics' twin, the exact linear case, two modes, new starts, the command."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_person import camera, clip, state_at, wall, write

from gait import Model, State, Tracker, TrackerConfig, UserError
from gait.bindings.abi import Mode, TrackStatus
from gait.bindings.model import read_blob
from gait.body.model_curves import ModelCurves
from gait.cli import main
from gait.io import blob
from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.motion.footfalls import Draws
from gait.track.smooth import Smoother, Spool, draw_motions, smoothed
from gait.track.transitions import Step, Transitions

SECTIONS = blob.decode(read_blob(None))
if "PROP" not in SECTIONS:  # two ways in which limbs differ in length
    random = np.random.default_rng(0)
    SECTIONS["PROP"] = (0.03 * random.standard_normal((2, len(SECTIONS["FRMI"]) + 1))).astype(np.float32)
MODEL = Model(blob.encode(SECTIONS))
CURVES = ModelCurves(SECTIONS)


def coasting(mode, count):
    """A tracker that only predicts, with the table of its particles before and after each step.

    It settles soon, because without a picture it is lost after a third of a second and searches then.
    """
    noise = {"stature_noise": 0.3, "stature_noise_start": 0.6}
    if mode is Mode.DEFAULT:
        noise["turn_time"] = 0.2  # so that turn rates change in the few steps looked at
    changes = {"particles": 8000, "resample_ess": 0.0, "settle_time": 0.15} | noise
    config = TrackerConfig.default(mode, proportions=-1 if mode is Mode.DEFAULT else 0, **changes)
    tracker = Tracker(MODEL, camera(), config, tasks=2)
    moves = Transitions(CURVES, tracker.config)
    mean = state_at(MODEL, SECTIONS, 0.0)
    sd = State(phase=0.1, stride_hz=0.1, stature=0.05, heading=0.2, pitch=0.03, roll=0.03)
    sd.pelvis, sd.coef, sd.offset = np.full(3, 0.05), np.ones(MODEL.info.components), np.full(24, 0.05)
    sd.proportion = np.full(MODEL.info.proportions, 0.5)
    tracker.start(mean, sd, 0)
    tables = []
    for i in range(count):
        tracker.step(None, 33333 * i)
        tables.append(moves.table(tracker.particles()[0]))
    return tracker, moves, tables


@pytest.mark.parametrize("mode", list(Mode))
def test_the_twin_moves_states_as_the_library_does(mode):
    tracker, moves, tables = coasting(mode, 9)
    for i, settling in ((1, True), (7, False)):
        before, theirs = tables[i], tables[i + 1]
        ours = moves.move(
            before, Step(0.033333, settling, True, tracker.start_stature_sd), np.random.default_rng(0)
        )
        a, b = moves.difference(ours, before), moves.difference(theirs, before)
        tolerance = 5 * np.hypot(a.std(axis=0), b.std(axis=0)) / np.sqrt(len(a)) + 1e-7
        np.testing.assert_array_less(np.abs(a.mean(axis=0) - b.mean(axis=0)), tolerance)
        np.testing.assert_allclose(a.std(axis=0), b.std(axis=0), rtol=0.06, atol=1e-7)
        assert a[:, 2].std() > 0


def test_tables_turn_back_into_the_states():
    tracker, moves, tables = coasting(Mode.DEFAULT, 2)
    states, particles = moves.states(tables[-1]), tracker.particles()[0]
    for name in particles.dtype.names:
        np.testing.assert_allclose(states[name], particles[name], atol=2e-6)


class Linear:
    """Four numbers that follow a linear rule with normal noise; the first and fourth are small angles."""

    columns = 4
    rule = np.eye(4) * 0.9 + 0.05 * np.eye(4, k=1)
    noise = np.diag([0.01, 0.02, 0.015, 0.01])

    def move(self, before, step, random):
        return 0.5 + (before - 0.5) @ self.rule.T + random.standard_normal(before.shape) @ self.noise

    def difference(self, a, b):
        return a - b


class Particles:
    """In place of a spool: given tables and weights; a start at the frames in `starts`."""

    def __init__(self, frames, starts=(0,)):
        self.frames, self.starts = frames, starts

    def __len__(self):
        return len(self.frames)

    def read(self, index):
        return self.frames[index]

    def step_to(self, index):
        return None if index in self.starts else Step(1.0, False, False, 0.0)


def test_linear_normal_dynamics_give_the_exact_smoother():
    """Against Rauch, Tung and Striebel's recursion, from samples of the Kalman filter's posteriors."""
    rule, random, linear = Linear.rule, np.random.default_rng(1), Linear()
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
    frames = [
        (0.5 + random.multivariate_normal(m, c, 4000), np.full(4000, 1 / 4000))
        for m, c in zip(means, covs, strict=True)
    ]
    drawn = draw_motions(Particles(frames), linear, 2000, 1) - 0.5
    smooth_mean, smooth_cov = means[-1], covs[-1]
    for i in range(10, -1, -1):
        ahead = rule @ covs[i] @ rule.T + q
        gain = covs[i] @ rule.T @ np.linalg.inv(ahead)
        smooth_mean = means[i] + gain @ (smooth_mean - rule @ means[i])
        smooth_cov = covs[i] + gain @ (smooth_cov - ahead) @ gain.T
        sd = np.sqrt(np.diag(smooth_cov))
        assert np.abs(drawn[:, i].mean(axis=0) - smooth_mean).max() < 0.25 * sd.max()
        np.testing.assert_allclose(drawn[:, i].std(axis=0), sd, rtol=0.12)
    assert drawn[:, 0].std(axis=0).sum() < 0.95 * frames[0][0].std(axis=0).sum()


def two_modes(count=600):
    """A third of the particles half a stride ahead of the others, for five frames; the weights even out."""
    random, frames = np.random.default_rng(2), []
    for _ in range(5):
        states = 0.5 + 0.01 * random.standard_normal((count, 4))
        states[: count // 3, 0] -= 0.4
        frames.append((states, np.full(count, 1 / count)))
    return frames


class Still(Linear):
    rule = np.eye(4)


def test_a_motion_stays_in_its_mode():
    motions = draw_motions(Particles(two_modes()), Still(), 300, 1)
    ahead = motions[:, :, 0] < 0.3
    assert (ahead == ahead[:, :1]).all() and ahead[:, 0].mean() == pytest.approx(1 / 3, abs=0.01)
    assert (np.abs(motions[:, :, 0] - np.where(ahead, 0.1, 0.5)) < 0.06).all()


def test_a_new_start_begins_motions_of_its_own():
    frames = two_modes()
    joined, apart = (draw_motions(Particles(frames, s), Still(), 300, 1) for s in ((0,), (0, 3)))
    together = np.corrcoef(joined[:, 2, 1], joined[:, 3, 1])[0, 1]
    assert abs(np.corrcoef(apart[:, 2, 1], apart[:, 3, 1])[0, 1]) < 0.2 < together


def test_the_spool_gives_back_what_it_took_and_knows_the_starts():
    config = TrackerConfig.default(particles=64)
    tracker = Tracker(MODEL, camera(), config)
    moves, kept = Transitions(CURVES, tracker.config), []
    with Spool(moves) as spool:
        for begin in (0, 40):
            tracker.start(state_at(MODEL, SECTIONS, 0.0), State(), 33333 * begin)
            for i in range(begin, begin + 35):
                known = TrackStatus.INIT if i < begin + 2 else TrackStatus.TRACKING
                spool.add(tracker, replace(tracker.step(None, 33333 * i), status=known))
                kept.append(tracker.particles())
        assert len(spool) == 70
        for i in (0, 34, 35, 69):
            states, weights = spool.read(i)
            np.testing.assert_allclose(states, moves.table(kept[i][0]), atol=1e-5)
            np.testing.assert_array_equal(weights.astype(np.float32), kept[i][1])
        assert spool.step_to(0) is None and spool.step_to(35) is None
        assert spool.step_to(1) == Step(pytest.approx(0.033333), True, False, tracker.start_stature_sd)
        assert spool.step_to(31).settling and not spool.step_to(34).settling  # a second after frame 2
        assert spool.step_to(36).settling and not spool.step_to(69).settling


def test_who_becomes_ambiguous_has_settled_all_the_same():
    config = TrackerConfig.default(particles=64)
    tracker = Tracker(MODEL, camera(), config)
    tracker.start(state_at(MODEL, SECTIONS, 0.0), State(), 0)
    printed = [TrackStatus.AMBIGUOUS] * 2 + [TrackStatus.TRACKING] * 40 + [TrackStatus.AMBIGUOUS] * 5
    with Spool(Transitions(CURVES, tracker.config)) as spool:
        for i, status in enumerate([*printed, TrackStatus.INIT, TrackStatus.AMBIGUOUS, TrackStatus.TRACKING]):
            spool.add(tracker, replace(tracker.step(None, 33333 * i), status=status))
        reported = [spool.step_to(i).settling for i in range(1, len(spool))]
        assert reported[:32] == [True] * 32 and not any(reported[33:47]) and all(reported[48:])


def test_what_no_number_of_frames_makes_less_is_added_as_the_library_does():
    tracker = Tracker(MODEL, camera(), TrackerConfig.default(particles=2000))
    uncertainty = State(stature=0.1, phase=0.02, pelvis=np.full(3, 0.05))
    tracker.start(state_at(MODEL, SECTIONS, 0.0), uncertainty, 0)
    theirs = tracker.step(None, 0)
    states, _ = tracker.particles()
    with Smoother(tracker, CURVES) as smoother:
        smoother.add(Frame(0, 0.0, wall()), theirs)
        ours = smoother._widened(0, smoothed(theirs, MODEL, states, *MODEL.poses(states)))
    assert tracker.start_stature_sd > 0.05
    np.testing.assert_allclose(ours.joint_sd, theirs.joint_sd, rtol=0.02)
    np.testing.assert_allclose(ours.sd.stature, theirs.sd.stature, rtol=0.02)


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


def test_draws_need_smoothing_and_their_own_track(folder, capsys):
    assert track(folder, "x.csv", "--draws", str(folder / "x.npz")) == 2
    assert "--smooth" in capsys.readouterr().err and not (folder / "x.csv").exists()
    assert track(folder, "short.csv", "--stop", "20") == 0
    with pytest.raises(UserError, match="frames are not those"):
        Draws.read(folder / "d.npz", read_track(folder / "short.csv"))
    (folder / "bad.npz").write_bytes(b"no")
    with pytest.raises(UserError, match="not a file of draws"):
        Draws.read(folder / "bad.npz", read_track(folder / "short.csv"))
