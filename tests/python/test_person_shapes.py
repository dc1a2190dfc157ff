"""Without a detector a person's shape confirms the track, which starts where a person certainly walks."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from drawn_person import DATA, camera, clip, wall, write

from gait import Camera, Model, TrackStatus, Video
from gait.bindings.initial import Start
from gait.bindings.model import read_blob
from gait.bindings.start_fit import Box, StartFit
from gait.detect import networks, shapes
from gait.detect.shapes import find_near
from gait.errors import UserError
from gait.io import blob
from gait.io.video import Frame
from gait.track import clip_background, person_shapes
from gait.track.box_start import find_start
from gait.track.follow import Decided, Follower
from gait.track.person_shapes import PersonShapes

MODEL = Model()
SECTIONS = blob.decode(read_blob(None))
FRAMES, TRUE = clip(MODEL, SECTIONS, 24)
JOINTS = MODEL.pose(TRUE[0])[0]
UV = camera().project(JOINTS)
CROWN, FOOT = UV[MODEL.joint_names.index("head_top")], UV[np.argmax(UV[:, 1])]
ESTIMATE = SimpleNamespace(joints=JOINTS, joint_names=MODEL.joint_names, status=TrackStatus.TRACKING)


def box(head=0.0, foot=0.0, aside=0.0):
    """Box of the person, with head and feet lower by so many heights."""
    tall = FOOT[1] - CROWN[1]
    return Box(
        np.array([CROWN[0] + aside * tall, FOOT[1] + foot * tall]),
        np.array([CROWN[0] + aside * tall, CROWN[1] + head * tall]),
        1.0,
    )


def verdict(monkeypatch, shape, seconds=1.0):
    """Verdict on the estimate after frames that show a shape, and the keypoints of each frame."""
    monkeypatch.setattr(person_shapes, "find_near", lambda *_: shape)
    shapes, keypoints = PersonShapes(camera(), lambda _: 1.7), []
    for i in range(round(30 * seconds)):
        frame = Frame(i, i / 30, FRAMES[0])
        keypoints.append(shapes.choose(frame, ESTIMATE))
        agree = shapes.agree(frame, ESTIMATE)
    return agree, keypoints


@pytest.mark.parametrize(
    "shape, agree",
    [
        (box(), None),
        (box(head=0.02, foot=0.02), None),
        (box(foot=-0.1), False),
        (box(foot=0.12), False),
        (box(head=0.1), False),
        (box(aside=0.15), False),
        (None, False),
    ],
)
def test_a_shape_elsewhere_or_none_objects(monkeypatch, shape, agree):
    assert verdict(monkeypatch, shape)[0] is agree


@pytest.mark.parametrize(("aside", "taller", "found", "expected"), [
    (0.0, 1.05, 1, True),  # towards the camera
    (0.4, 1.0, 1, False),  # across the view
    (0.0, 1.05, 4, False),  # seen in every fourth frame alone: perhaps elsewhere in the others
])  # fmt: skip
def test_a_median_is_judged_by_shapes_too(monkeypatch, aside, taller, found, expected):
    tall = FOOT[1] - CROWN[1]
    boxes = []
    for k in range(16):
        foot = FOOT + [k * aside * tall, 0.02 * k * tall]
        boxes.append([] if k % found else [Box(foot, foot - [0, tall * taller**k], 1.0)])
    monkeypatch.setattr(clip_background, "find_people", lambda image, stature: boxes[image])
    monkeypatch.setattr(
        clip_background, "sample_frames", lambda video, count: [Frame(k, k / 30, k) for k in range(count)]
    )
    one = SimpleNamespace(people={}, model=MODEL, camera=camera(), video=None)
    assert clip_background.stays(one) is expected


def test_one_frame_without_a_shape_is_no_objection(monkeypatch):
    assert verdict(monkeypatch, None, seconds=0.3)[0] is None


def test_a_shape_is_three_keypoints_ten_times_a_second(monkeypatch):
    _, keypoints = verdict(monkeypatch, box())
    found = [one for one in keypoints if one is not None]
    assert 9 <= len(found) <= 11
    assert found[0].names[:2] == ("head_top", "pelvis") and found[0].names[2][2:] in ("heel", "toe")
    tall = FOOT[1] - CROWN[1]
    pelvis = UV[MODEL.joint_names.index("pelvis")]
    assert np.abs(np.asarray(found[0].uv)[:2] - [CROWN, pelvis]).max() < 0.08 * tall


def test_a_lost_person_is_not_searched_where_they_were(monkeypatch):
    monkeypatch.setattr(person_shapes, "find_near", lambda *_: box())
    lost = SimpleNamespace(**{**vars(ESTIMATE), "status": TrackStatus.LOST})
    assert PersonShapes(camera(), lambda _: 1.7).choose(Frame(0, 0.0, FRAMES[0]), lost) is None


UPRIGHT = 23  # frame in which the drawn person looks most like the detector's people


def box_in(frame):
    """Box of the drawn person in a frame."""
    uv = camera().project(MODEL.pose(TRUE[frame])[0])
    crown = uv[MODEL.joint_names.index("head_top")]
    return Box(np.array([crown[0], uv[:, 1].max()]), crown, 1.0)


@pytest.mark.parametrize("edge", ["none", "left", "right", "top", "bottom"])
@pytest.mark.parametrize("scale", [0.5, 1.0, 4.0])
def test_a_person_of_any_size_is_found_also_at_the_edge_of_the_picture(scale, edge):
    true, picture, corner = box_in(UPRIGHT), FRAMES[UPRIGHT], np.zeros(2)
    if edge != "none":  # cut the picture where the person ends
        aside = 0.22 * true.tall
        left, top = (true.head - (aside, 2)).astype(int)
        right, bottom = (true.foot + (aside, 3)).astype(int)
        corner = np.array([left * (edge == "left"), top * (edge == "top")])
        stop = bottom if edge == "bottom" else None, right if edge == "right" else None
        picture = picture[corner[1] : stop[0], corner[0] : stop[1]]
    large = cv2.resize(picture, None, fx=scale, fy=scale)
    foot, head = ((end - corner) * scale for end in (true.foot, true.head))
    found = find_near(large, Box(foot, head, 1.0), lambda _: 1.7)
    assert found is not None
    assert max(np.hypot(*(found.foot - foot)), np.hypot(*(found.head - head))) < 0.12 * scale * true.tall


@pytest.mark.parametrize("corner", [(0, 0), (319, 239), (-500, 100), (1000, 20)])
@pytest.mark.parametrize("tall", [2.0, 60.0, 4000.0])
def test_only_the_picture_about_a_box_is_searched(corner, tall):
    at, stature = np.array(corner, float), StartFit(MODEL, camera()).stature
    assert find_near(FRAMES[UPRIGHT], Box(at + [0, tall], at, 1.0), stature) is None


def test_one_descriptor_serves_all_searches(monkeypatch):
    shapes.hog_detector()
    monkeypatch.setattr(cv2, "HOGDescriptor", None)
    assert find_near(FRAMES[UPRIGHT], box_in(UPRIGHT), lambda _: 1.7) is not None
    networks._windows(FRAMES[UPRIGHT])


def test_opencv_searches_in_one_thread_as_more_give_other_bits(monkeypatch):
    threads = []

    def search(*_, **__):
        threads.append(cv2.getNumThreads())
        raise KeyboardInterrupt

    detector = SimpleNamespace(winSize=(64, 128), detectMultiScale=search)
    monkeypatch.setattr(shapes, "hog_detector", lambda: detector)
    cv2.setNumThreads(2)
    with pytest.raises(KeyboardInterrupt):
        find_near(FRAMES[0], box(), lambda _: 1.68)
    assert threads == [1] and cv2.getNumThreads() == 2


def test_who_stands_first_is_started_while_walking(tmp_path):
    standing = 24
    pictures, states = clip(MODEL, SECTIONS, 45)
    write(tmp_path / "film.mp4", [FRAMES[0]] * standing + pictures)
    found = find_start(Video(tmp_path / "film.mp4"), camera(), wall(), MODEL)
    assert found.frame > standing and found.hypotheses[0].speed > 0.7 * states[0].stride_hz
    truth = states[found.frame - standing]
    assert abs(found.mean.heading - truth.heading) < 0.35


def start(frame, phase, sd=0.05):
    mean, sds = MODEL.prior()
    mean.phase, mean.stride_hz, sds.phase = phase, 0.9, sd
    return Start(frame, mean, sds)


def decided(at):
    """Where a draw decided, with the phase at frame 10 by the rate in between."""
    return at and Decided(at, at.mean.phase - at.mean.stride_hz * (at.frame - 10) / 30)


A, LATER, OTHER = start(10, 0.2), start(40, 0.1), start(10, 0.7)


@pytest.mark.parametrize(
    "draws, first, uncertain",
    [
        ([A, LATER, A], A, False),
        ([A, LATER, None], A, False),
        ([OTHER, A, LATER], A, True),
        ([None, A, None], A, True),
        ([None, None, None], None, False),
    ],
)
def test_left_and_right_are_known_only_if_all_draws_agree(monkeypatch, draws, first, uncertain):
    open_start, left = start(20, 0.0, sd=0.5), iter(draws)
    follower = Follower(None, SimpleNamespace(fps=30), None, None, None)
    monkeypatch.setattr(follower, "_draw", lambda *_: decided(next(left)))
    assert follower._settled(open_start, range(90)) is (first or open_start)
    assert follower._uncertain is uncertain


FILM = DATA / "real" / "treadmill"


@pytest.mark.long
@pytest.mark.skipif(not FILM.is_dir(), reason="../shared/data is absent")
def test_a_person_on_a_treadmill_is_refused_with_the_remedy():
    video = Video(next(FILM.glob("video.*")))
    view = Camera.read(str(FILM / "camera.json"), video.size)
    with pytest.raises(UserError, match="stays in place .*give --init FILE.json or use the detector"):
        find_start(video, view, None, MODEL, shapes_first=True)
