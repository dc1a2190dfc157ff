import numpy as np
import pytest

from gait import Camera, Model, State
from gait.bindings.frame import FrameKeypoints
from gait.bindings.start_fit import StartFit
from gait.detect.networks import LANDMARK_JOINTS
from gait.errors import GaitError
from gait.io.keypoints_file import Keypoints
from gait.track.keypoint_start import find_keypoint_start, keypoint_noise

FPS = 25


@pytest.fixture(scope="module")
def model():
    return Model()


@pytest.fixture(scope="module")
def camera():
    rotation = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    return Camera(1280, 720, 1000, 1000, 639.5, 359.5, R=np.array(rotation, float), t=np.array([0, 1.5, 0]))


def walk(model, camera, frames, *, heading=0.3, speed=1.3, stands=0, noise=2.0, motion="walk"):
    """Keypoints of a person who stands for some frames and then walks, in a class of motion."""
    motion_class, direction = model.classes.index(motion), model.directions[motion]
    rate = model.class_info(motion_class).stride_hz
    rng, uv = np.random.default_rng(3), []
    for n in range(frames):
        t = max(n - stands, 0) / FPS
        phase = (0.1 + direction * rate * t) % 1
        state = State(phase=phase, stride_hz=rate, heading=heading, motion_class=motion_class)
        way = direction * speed * t * np.array([np.cos(heading), np.sin(heading)])
        state.pelvis[:] = *(np.array([-1.0, 5.0]) + way), model.pelvis_height(state)
        joints = dict(zip(model.joint_names, model.pose(state)[0], strict=True))
        uv.append(camera.project(np.array([joints[name] for name in LANDMARK_JOINTS])))
    uv = np.array(uv) + noise * rng.standard_normal((frames, len(LANDMARK_JOINTS), 2))
    number = np.arange(frames)
    return Keypoints(
        number, number / FPS, tuple(LANDMARK_JOINTS), uv, np.ones((frames, len(LANDMARK_JOINTS)))
    )


def test_a_walk_is_found_at_its_first_frame(model, camera):
    start = find_keypoint_start(walk(model, camera, 40), camera, model, height=1.75)
    assert start.frame == 0
    assert start.mean.heading == pytest.approx(0.3, abs=0.1)
    assert start.mean.phase == pytest.approx(0.1, abs=0.04)
    assert np.allclose(start.mean.pelvis[:2], [-1, 5], atol=0.4)


@pytest.mark.parametrize(("motion", "speed"), [("walk", 1.3), ("backwards", 1.1), ("run", 3.0)])
@pytest.mark.parametrize("heading", [0.3, 1.6, 4.0])
def test_a_start_is_in_the_class_of_the_motion(camera, motion, speed, heading):
    model = Model("classes")
    keypoints = walk(model, camera, 26, heading=heading, speed=speed, motion=motion)
    start = find_keypoint_start(keypoints, camera, model, height=1.75)
    assert model.classes[start.mean.motion_class] == motion
    assert np.cos(start.mean.heading - heading) > 0.98
    assert abs((start.mean.phase - 0.1 + 0.5) % 1 - 0.5) < 0.06
    assert start.hypotheses[0].speed == pytest.approx(speed, rel=0.2)


def test_a_person_who_stands_first_is_found_walking(model, camera):
    start = find_keypoint_start(walk(model, camera, 90, stands=50), camera, model, height=1.75)
    assert start.frame > 30
    assert start.mean.heading == pytest.approx(0.3, abs=0.15)


def test_the_best_second_is_chosen_if_wanted(model, camera):
    keypoints = walk(model, camera, 75)
    keypoints.uv[:20] += np.random.default_rng(1).normal(0, 12, (20, *keypoints.uv.shape[1:]))
    assert find_keypoint_start(keypoints, camera, model, height=1.75).frame == 0
    start = find_keypoint_start(keypoints, camera, model, height=1.75, best_second=True)
    assert 15 <= start.frame <= 55
    assert start.mean.heading == pytest.approx(0.3, abs=0.1)


def test_a_whole_second_is_preferred_to_part_of_one(model, camera):
    keypoints = walk(model, camera, 75)
    keypoints.uv[25:] += np.random.default_rng(1).normal(0, 4, (50, *keypoints.uv.shape[1:]))
    visible = np.ones(75, bool)
    visible[1:25:2] = False  # the first second has the better points, and half of the frames
    part = Keypoints(*(values[visible] for values in (keypoints.frame, keypoints.time)), keypoints.names,
                     keypoints.uv[visible], keypoints.confidence[visible])  # fmt: skip
    assert find_keypoint_start(part, camera, model, height=1.75).frame == 0
    assert find_keypoint_start(part, camera, model, height=1.75, best_second=True).frame >= 14


def test_the_best_second_is_soon_after_the_first_walk(model, camera, monkeypatch):
    keypoints = walk(model, camera, 75)
    keypoints.uv[:50] += np.random.default_rng(1).normal(0, 12, (50, *keypoints.uv.shape[1:]))
    monkeypatch.setattr("gait.track.keypoint_start._CHOICE_S", 0.5)
    start = find_keypoint_start(keypoints, camera, model, height=1.75, best_second=True)
    assert start.frame <= 15


def test_points_that_are_no_walk_start_nothing(model, camera):
    keypoints = walk(model, camera, 40, noise=150.0)
    assert find_keypoint_start(keypoints, camera, model) is None


def test_frames_before_the_first_are_not_used(model, camera):
    start = find_keypoint_start(walk(model, camera, 60), camera, model, first=20, height=1.75)
    assert start.frame == 20


def test_noise_grows_as_the_confidence_falls(model, camera):
    keypoints = walk(model, camera, 5)
    keypoints.confidence[:, 0] = 0.5
    keypoints.uv[2, 3] = np.nan
    noise = keypoint_noise(keypoints)
    assert noise[0].sd[0] == pytest.approx(2 * noise[0].sd[1], rel=1e-6)
    assert noise[2].sd[3] == -1


def test_keypoints_without_ankles_start_nothing(model, camera):
    all_joints = walk(model, camera, 40)
    arms = Keypoints(
        *(getattr(all_joints, n) for n in ("frame", "time")),
        ("l_wrist",),
        all_joints.uv[:, 4:5],
        all_joints.confidence[:, 4:5],
    )
    assert find_keypoint_start(arms, camera, model) is None


def test_too_few_frames_name_the_remedy(model, camera):
    fit = StartFit(model, camera)
    fit.add(0, FrameKeypoints(("l_hip",), np.zeros((1, 2)), 1.0))
    with pytest.raises(GaitError, match="four or more over 0.3 s"):
        fit.solve(0)


def test_bad_settings_are_refused(model, camera):
    with pytest.raises(GaitError, match="stature"):
        StartFit(model, camera, stature=3.0)
