"""Tracker through Python: configuration, order of calls, callbacks, replay, and tracking of a drawn walk."""

import ctypes
import gc
import math
import pickle
import weakref
from dataclasses import replace

import numpy as np
import pytest
from drawn_person import FPS, camera, clip, wall

from gait import Flag, GaitArgumentError, GaitError, Mode, Model, State, Tracker, TrackerConfig, UserError
from gait.bindings import abi
from gait.bindings.config import LiftConfig, reference
from gait.bindings.library import library
from gait.bindings.model import read_blob
from gait.io import blob

MODEL = Model()
FRAMES, TRUE = clip(MODEL, blob.decode(read_blob(None)), 14)
VIEW, PLATE = camera(), wall()
SMALL = TrackerConfig.default(particles=200)


def uncertainty():
    """Small uncertainty about a known first state."""
    sd = State(phase=0.03, stride_hz=0.03, stature=0.02, heading=0.1, pitch=0.02, roll=0.02)
    sd.pelvis = np.full(3, 0.03)
    sd.coef = np.full(MODEL.info.components, 0.3)
    return sd


def started(config=SMALL, **options):
    tracker = Tracker(MODEL, VIEW, config, background=PLATE, **options)
    tracker.start(TRUE[0], uncertainty(), 0)
    return tracker


def utime(i):
    return round(1e6 * i / FPS)


def run(tracker, first=0, last=None):
    return [tracker.step(FRAMES[i], utime(i)) for i in range(len(FRAMES))[first:last]]


def test_the_config_has_the_settings_of_the_c_struct():
    ours = [name for name, _ in TrackerConfig.default()]
    theirs = [name for name, *_ in abi.TrackerConfigC._fields_]
    assert ours == [n for n in theirs if n not in ("struct_size", "cameras", "camera", "exec")]


@pytest.mark.parametrize("mode", Mode)
def test_defaults_come_from_the_library_and_survive_the_way_there(mode):
    c = abi.TrackerConfigC()
    library().gait_tracker_fill(ctypes.byref(c), ctypes.sizeof(c), mode)
    back = TrackerConfig.default(mode).to_c()
    for name, _ in TrackerConfig.default():
        assert getattr(back, name) == getattr(c, name), name
    assert back.struct_size == ctypes.sizeof(c) and back.cameras == 1 and not back.exec.run


def test_changes_reach_the_library_and_unknown_ones_fail():
    c = TrackerConfig.default(particles=77, girth=1.25, edges_weight=3).to_c()
    assert (c.particles, c.girth, c.edges_weight) == (77, 1.25, 3)
    with pytest.raises(TypeError, match=r"TrackerConfig has no setting 'particels'; it has mode, particles"):
        TrackerConfig.default(particels=77)
    with pytest.raises(AttributeError, match=r"use replace\(girth=...\)"):
        SMALL.girth = 2.0
    with pytest.raises(AttributeError, match="has no setting 'grith'"):
        _ = SMALL.grith
    same = pickle.loads(pickle.dumps(SMALL))
    assert same == SMALL and hash(same) == hash(SMALL) and same != SMALL.replace(girth=2.0)


def test_every_setting_is_described():
    settings = {item.name: item for item in TrackerConfig.settings()}
    assert list(settings) == [name for name, _ in TrackerConfig.default()]
    time = settings["rejuvenation_time"]
    assert time.text.startswith("Time constant") and time.unit == "seconds"
    assert (time.low, time.high, time.paper) == (0.0, 1e6, 0.0)
    assert time.default == TrackerConfig.default().to_c().rejuvenation_time > 0
    assert "| `girth` | " in reference(TrackerConfig) and "10, 10, 0.03" in reference(LiftConfig)
    for name, item in settings.items():
        if not math.isnan(item.low):
            with pytest.raises(GaitError, match=f"config: {name} = .* is outside") as refused:
                Tracker(MODEL, VIEW, SMALL.replace(**{name: type(item.default)(item.high * 1.01 + 1)}))
            assert refused.value.name in ("GAIT_ERR_ARG", "GAIT_ERR_LIMIT")


def test_a_drawn_walk_is_followed():
    last = run(started(SMALL.replace(particles=600)))[-1]
    truth, _ = MODEL.pose(TRUE[-1])
    assert np.linalg.norm(last.joints - truth, axis=1).mean() < 0.06
    assert abs((last.mean.phase - TRUE[-1].phase + 0.5) % 1 - 0.5) < 0.03
    assert last.frame == len(FRAMES) - 1 and last.utime == utime(len(FRAMES) - 1)
    assert np.array_equal(last.joint("r_knee"), last.joints[MODEL.joint_names.index("r_knee")])
    with pytest.raises(ValueError, match="joint 'nose': unknown; give one of .* r_knee "):
        last.joint("nose")
    assert last.speed == pytest.approx(1.3, abs=0.35) and not last.flags & Flag.NO_IMAGE


def test_grey_frames_serve_too():
    tracker = Tracker(MODEL, VIEW, SMALL, background=PLATE.mean(axis=2).astype(np.uint8))
    tracker.start(TRUE[0], uncertainty(), 0)
    for i, frame in enumerate(FRAMES):
        last = tracker.step(frame.mean(axis=2).astype(np.uint8), utime(i))
    assert np.linalg.norm(last.mean.pelvis - TRUE[-1].pelvis) < 0.12


@pytest.mark.parametrize("missing", [None, [None]])
def test_a_missed_frame_is_predicted_and_widens(missing):
    tracker = started()
    before = run(tracker, 0, 6)[-1]
    after = tracker.step(missing, utime(9))
    assert after.flags & Flag.NO_IMAGE
    assert after.joint_sd.mean() > before.joint_sd.mean()


def test_angles_of_paper_mode_are_those_of_its_particles_which_walk_alike_at_any_rate():
    config = TrackerConfig.default(Mode.PAPER, particles=16)
    tracker = Tracker(MODEL, VIEW, config)
    fast = replace(TRUE[0], stride_hz=1.2)
    tracker.start(fast, State(), 0)
    now = tracker.step(None, 0)
    np.testing.assert_allclose(now.angles, MODEL.pose(replace(now.mean, stride_hz=0.0))[1], atol=1e-6)
    assert np.abs(now.angles - MODEL.pose(now.mean)[1]).max() > 0.01


def test_threads_and_any_task_order_give_the_same_bits():
    def backwards(task, count):
        for i in reversed(range(count)):
            task(i)

    digests = set()
    for tasks in (1, 2, 3, backwards):
        tracker = started(tasks=tasks)
        run(tracker, 0, 5)
        digests.add(tracker.digest())
    assert len(digests) == 1


def test_every_instruction_set_gives_the_same_bits_and_takes_up_the_others_snapshot():
    trackers = [started(SMALL.replace(cpu_mask=mask)) for mask in (0, 1, 2, 4, SMALL.cpu_mask)]
    assert [t.isa for t in trackers[:2]] == ["scalar", "base"]
    assert trackers[-1].isa in {t.isa for t in trackers[1:-1]}
    for tracker in trackers:
        run(tracker, 0, 5)
    assert len({t.digest() for t in trackers}) == 1
    trackers[0].restore(trackers[-1].save())
    for tracker in trackers:
        run(tracker, 5, 8)
    assert len({t.digest() for t in trackers}) == 1


def test_an_exception_in_a_task_runner_is_raised_after_the_call():
    fail = []

    def runner(task, count):
        if fail:
            raise KeyError(fail.pop())
        for i in range(count):
            task(i)

    tracker, calm = started(tasks=runner), started()
    fail.append("lost wire")
    with pytest.raises(KeyError, match="lost wire"):
        tracker.step(FRAMES[0], 0)
    calm.step(FRAMES[0], 0)
    run(tracker, 1, 4), run(calm, 1, 4)
    assert tracker.digest() == calm.digest()  # the tasks it left were completed anyway


def test_a_runner_that_forgets_tasks_is_reported():
    with pytest.raises(RuntimeError, match="without calling"):
        started(tasks=lambda task, count: task(0)).step(FRAMES[0], 0)


def test_save_and_restore_continue_to_the_same_digest():
    tracker = started()
    run(tracker, 0, 5)
    saved, at_save = tracker.save(), tracker.digest()
    run(tracker, 5, 9)
    end = tracker.digest()
    other = Tracker(MODEL, VIEW, SMALL, background=PLATE)
    other.restore(saved)
    assert other.digest() == at_save != end
    run(other, 5, 9)
    assert other.digest() == end


@pytest.mark.parametrize("spoil", [lambda s: s[:-1], lambda s: s[:100], lambda s: b"x" + s[1:]])
def test_a_bad_snapshot_is_refused_and_changes_nothing(spoil):
    tracker = started()
    run(tracker, 0, 3)
    before = tracker.digest()
    with pytest.raises(GaitError):
        tracker.restore(spoil(tracker.save()))
    assert tracker.digest() == before


def test_seeds_differ():
    one, two = started(), started(SMALL.replace(seed=2))
    run(one, 0, 3), run(two, 0, 3)
    assert one.digest() != two.digest()


def test_another_time_of_day_gives_the_same_digest():
    digests = []
    for epoch in (0, 1_760_000_000_000_000, -5):
        tracker = Tracker(MODEL, VIEW, SMALL, background=PLATE)
        tracker.start(TRUE[0], uncertainty(), epoch)
        for i in range(3):
            tracker.step(FRAMES[i], epoch + utime(i))
        digests.append(tracker.digest())
    assert len(set(digests)) == 1


def test_particles_carry_weights():
    tracker = started()
    estimate = run(tracker, 0, 3)[-1]
    states, weights = tracker.particles()
    assert states.shape == weights.shape == (200,) and weights.sum() == pytest.approx(1, abs=1e-4)
    assert states["pelvis"].shape == (200, 3) and states["coef"].shape == (200, 16)
    best = states[np.argmax(weights)]
    assert best["stature"] == pytest.approx(estimate.best.stature, abs=1e-5)
    assert 1 / np.square(weights, dtype=float).sum() == pytest.approx(estimate.ess, rel=0.01)


def test_the_model_lives_as_long_as_the_tracker():
    model = Model()
    held = weakref.ref(model)
    tracker = Tracker(model, VIEW, SMALL)
    del model
    gc.collect()
    assert held() is not None
    del tracker
    gc.collect()
    assert held() is None


def test_memory_is_fixed_and_grows_with_particles():
    small, large = Tracker(MODEL, VIEW, SMALL), Tracker(MODEL, VIEW, SMALL.replace(particles=2000))
    assert 0 < small.memory_bytes < large.memory_bytes


@pytest.mark.parametrize(("threads", "megabytes"), [(1, 11.8), (2, 11.8), (4, 12), (8, 12.5)])
def test_ten_thousand_particles_fit_into_twelve_megabytes(threads, megabytes):
    config = TrackerConfig.default(particles=10_000)
    assert Tracker(MODEL, VIEW, config, tasks=threads).memory_bytes < 1e6 * megabytes


def test_calls_out_of_order_are_refused():
    tracker = Tracker(MODEL, VIEW, SMALL)
    with pytest.raises(GaitError) as caught:
        tracker.step(FRAMES[0], 0)
    assert caught.value.name == "GAIT_ERR_STATE" and "call Tracker.start() first" in str(caught.value)
    tracker.start(TRUE[0], uncertainty(), 0)
    tracker.step(FRAMES[0], 0)
    tracker.step(FRAMES[1], 33333)
    with pytest.raises(GaitError) as caught:
        tracker.step(FRAMES[1], 33333)
    assert caught.value.name == "GAIT_ERR_STATE"


@pytest.mark.parametrize(
    "frame, words",
    [
        (FRAMES[0][:-1], "320x239, the camera is 320x240"),
        (FRAMES[0].astype(float), "give uint8"),
        (FRAMES[0][..., :2], "give uint8"),
        ([FRAMES[0], FRAMES[0]], "2 images for 1 cameras"),
    ],
)
def test_frames_that_do_not_fit_are_refused(frame, words):
    with pytest.raises(ValueError, match=words):
        started().step(frame, 0)


@pytest.mark.parametrize("field, value", [("phase", np.nan), ("stature", np.inf), ("stride_hz", -np.inf)])
def test_a_start_that_is_not_finite_is_refused(field, value):
    tracker = Tracker(MODEL, VIEW, SMALL)
    with pytest.raises(GaitArgumentError):
        tracker.start(replace(TRUE[0], **{field: value}), uncertainty(), 0)


@pytest.mark.parametrize(
    "change", [{"particles": 3}, {"girth": float("nan")}, {"tasks": 0}, {"components": 99}]
)
def test_settings_out_of_range_are_refused(change):
    with pytest.raises(ValueError, match="GAIT_ERR"):
        Tracker(MODEL, VIEW, SMALL.replace(**change))


def test_number_of_cameras_and_threads_is_checked():
    with pytest.raises(UserError, match="0 given"):
        Tracker(MODEL, [], SMALL)
    with pytest.raises(ValueError, match="threads"):
        Tracker(MODEL, VIEW, SMALL, tasks=0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"particles": 1.5}, "config particles = 1.5: give a whole number"),
        ({"particles": 1 << 40}, "config particles = 1099511627776 is negative or too large"),
        ({"seed": -1}, "config seed = -1 is negative or too large"),
        ({"girth": "wide"}, "config girth = 'wide': give a number"),
    ],
)
def test_settings_beyond_the_capacity_of_the_library_are_named(change, words):
    with pytest.raises(ValueError, match=words):
        Tracker(MODEL, VIEW, SMALL.replace(**change))
    assert SMALL.replace(particles=np.int64(300)).to_c().particles == 300


@pytest.mark.parametrize(
    ("words", "options", "printed"),
    [
        (("x.gait", VIEW), {}, r"model: 'x.gait' is not a gait.Model; give gait.Model\(FILE\)"),
        ((MODEL, None), {}, "cameras: None; give a gait.Camera or a list of them"),
        ((VIEW, MODEL), {}, "^model: a Camera is not a gait.Model"),
        ((MODEL, [VIEW, "c.json"]), {}, "give a gait.Camera or a list"),
        ((MODEL, VIEW), {"tasks": 1.5}, "tasks: 1.5; give a number of threads, a callable or a pool"),
    ],
)
def test_arguments_of_another_kind_are_named(words, options, printed):
    with pytest.raises(ValueError, match=printed):
        Tracker(*words, **options)


@pytest.mark.parametrize("wrong", [1 << 63, -(1 << 63) - 1, 0.5, "now"])
def test_a_capture_time_that_is_none_is_named(wrong):
    tracker = started()
    with pytest.raises(ValueError, match=f"utime = {wrong!r}: give"):
        tracker.step(FRAMES[0], wrong)
    with pytest.raises(ValueError, match="utime"):
        tracker.start(TRUE[0], uncertainty(), wrong)


def test_the_empty_scene_is_copied_and_not_part_of_a_snapshot():
    plate = PLATE.copy()
    tracker = Tracker(MODEL, VIEW, SMALL, background=plate)
    plate[:] = 0
    tracker.start(TRUE[0], uncertainty(), 0)
    run(tracker, 0, 4)
    same, other = Tracker(MODEL, VIEW, SMALL, background=PLATE), Tracker(MODEL, VIEW, SMALL)
    for one in (same, other):
        one.restore(tracker.save())
    for one in (tracker, same, other):
        run(one, 4, 8)
    assert same.digest() == tracker.digest() != other.digest()


def test_two_cameras_are_better_than_one():
    side = camera(place=(-5.0, 0.01, 1.5))
    second, _ = clip(MODEL, blob.decode(read_blob(None)), len(FRAMES), view=side)
    both = Tracker(MODEL, [VIEW, side], SMALL, background=[PLATE, PLATE])
    both.start(TRUE[0], uncertainty(), 0)
    for i, pair in enumerate(zip(FRAMES, second, strict=True)):
        last = both.step(list(pair), utime(i))
    assert np.linalg.norm(last.mean.pelvis - TRUE[-1].pelvis) < 0.06
