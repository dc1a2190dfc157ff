import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from gait import Camera, Model, Video, cli
from gait.detect import clothes, networks, people, weights
from gait.detect.networks import LANDMARK_JOINTS, Crop, Person
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints, read
from gait.io.video import Frame
from gait.track.keypoint_start import find_keypoint_start

REAL = Path(__file__).parents[3] / "shared/data/real"
RED, BLUE = (40, 40, 220), (220, 40, 40)


class Stage:
    """People as rectangles of colour, and the two networks that see them exactly."""

    def __init__(self, monkeypatch):
        self.places, self.reach, self.depth, self.fps = {}, 60, 1.0, 25
        monkeypatch.setattr(
            people, "PersonNetwork", lambda: lambda image, small: [list(map(self.crop, self.visible()))]
        )
        monkeypatch.setattr(people, "LandmarkNetwork", lambda name: self.landmarks)
        self.detector = people.PeopleDetector()

    def visible(self):
        """Places of the people in view: the last one hides those behind."""
        places = list(self.places.values())
        return [place for place in places if place == places[-1] or abs(place - places[-1]) > 30]

    @staticmethod
    def crop(place):
        return Crop(np.array([place, 100.0]), 200.0, 0.0)

    def landmarks(self, image, crop):
        """See the person who shows most in the picture, and is near the middle of a crop."""
        best, most = None, 0.0
        for nearer, (place, own) in enumerate(self.drawn):
            part = float((image[own] > 0).any(axis=1).sum() / self.area)
            off = abs(place - crop.centre[0])
            if part > 0.3 and off <= self.reach and part - off / 120 > most:
                best, most = self.person(place, self.depth * nearer), part - off / 120
        return best or Person(0.1, np.zeros((16, 2)), np.zeros(16), crop)

    def person(self, place, nearer=0.0):
        """Someone at a place, whose feet are lower in the picture by some pixels."""
        x = place + 15.0 * np.array([1, -1] * 8)
        y = np.array([60, 60, 75, 75, 90, 90, 110, 110, 140, 140, 170, 170, 172, 172, 174, 174.0])
        return Person(0.9, np.column_stack([x, y + nearer]), np.ones(16), self.crop(place))

    def step(self, number, **places):
        self.places = places
        image, nearest = np.zeros((200, 640, 3), np.uint8), np.full((200, 640), -1, np.int8)
        for k, (name, place) in enumerate(places.items()):
            at = slice(50, 180), slice(max(int(place) - 20, 0), int(place) + 20)
            image[at], nearest[at] = RED if name.startswith("red") else BLUE, k
        self.image, self.area = image, 40 * 130
        self.drawn = [(place, nearest == k) for k, place in enumerate(places.values())]
        found = self.detector.step(Frame(number, number / self.fps, image))
        return {one.id: float(person.uv[:, 0].mean()) for one, person in found}


@pytest.fixture
def stage(monkeypatch):
    return Stage(monkeypatch)


def test_two_people_keep_their_ids(stage):
    for n in range(40):
        found = stage.step(n, red=100 + 4 * n, blue=500)
        assert found == {1: pytest.approx(100 + 4 * n), 2: pytest.approx(500)}


@pytest.mark.parametrize("other", ["blue", "red2"])
def test_people_who_cross_keep_their_ids(other, stage):
    """Also in the same clothes; the one behind is hidden meanwhile."""
    for n in range(60):
        found = stage.step(n, red=80 + 8 * n, **{other: 560 - 8 * n})
        assert found.get(1, 80 + 8 * n) == pytest.approx(80 + 8 * n, abs=31)
    assert found == {1: pytest.approx(80 + 8 * n), 2: pytest.approx(560 - 8 * n)}


@pytest.mark.parametrize("other", ["blue", "red2"])
def test_someone_who_comes_out_from_behind_another_is_found_at_once(stage, other):
    """If the empty scene is known; otherwise the next search finds them."""
    stage.detector = people.PeopleDetector(everyone=True, empty=np.zeros((200, 640, 3), np.uint8))
    for n in range(60):
        found = stage.step(n, red=80 + 8 * n, **{other: 560 - 8 * n})
        apart = abs(480 - 16 * n)
        if apart > 60:
            assert found == {1: pytest.approx(80 + 8 * n), 2: pytest.approx(560 - 8 * n)}


def test_people_who_overlap_from_the_first_frame_are_both_followed(stage):
    """One overtakes the other; without the empty scene crops so near each other count as one person's."""
    stage.detector = people.PeopleDetector(everyone=True, empty=np.zeros((200, 640, 3), np.uint8))
    for n in range(40):
        found = stage.step(n, red=100 + 5 * n, blue=140 + 6 * n)
        assert sorted(found.values()) == [pytest.approx(100 + 5 * n), pytest.approx(140 + 6 * n)]


def followed(stage, number, **places):
    """Two people followed through a frame, the second beside the first; the frame, and what was found."""
    stage.step(number, **places)
    one, other = stage.detector.people
    frame = Frame(number + 1, (number + 1) / 25, stage.image)
    return one, other, frame, one.keypoints[-1]


def test_a_neighbour_of_unknown_colours_makes_no_one_strange(stage):
    one, other, frame, person = followed(stage, 0, red=200, blue=260)
    other.colours = None
    others = clothes.colours_of(frame.image, other.keypoints[-1], None)
    one.colours = 0.6 * one.colours + 0.4 * others
    assert not stage.detector._strange(one, frame, person, [other], None)
    other.colours = clothes.colours_of(frame.image, person, None)
    assert stage.detector._strange(one, frame, person, [other], None)


def test_colours_distinguish_a_person_from_a_lost_one_but_not_from_one_behind(stage):
    """With someone in front, who is in view, colours of the other on the trunk do not matter."""
    empty = np.zeros((200, 640, 3), np.uint8)
    stage.detector = people.PeopleDetector(everyone=True, empty=empty)
    one, other, frame, person = followed(stage, 0, red=200, blue=260)
    one.colours, other.colours = other.colours, one.colours  # the trunk shows the other's
    hidden = stage.detector._overlaps.hidden
    front = hidden(person.uv, [person.uv + (30, -1)])
    assert not stage.detector._strange(one, frame, person, [other], front)
    assert stage.detector._strange(one, frame, person, [other], hidden(person.uv, [person.uv + (30, 1)]))
    other.lost = True
    assert stage.detector._strange(one, frame, person, [other], None)
    own = clothes.colours_of(frame.image, person, None)
    one.colours, other.colours = 0.5 * (one.colours + own), own  # in sun and shade, and in similar clothes
    assert not stage.detector._strange(one, frame, person, [other], None)


def test_a_new_person_is_known_by_colours_without_the_clothes_of_one_found_in_front(stage, monkeypatch):
    stage.detector = people.PeopleDetector(empty=np.zeros((200, 640, 3), np.uint8))
    stage.step(0, red=200, blue=220)
    frame = Frame(1, 0.04, stage.image)
    behind, front = stage.person(200), stage.person(220, 1.0)
    one = people.Followed(3)
    stage.detector._add(one, frame, behind, [], None)
    mixed = one.colours
    found = [(one, behind)]
    monkeypatch.setattr(
        stage.detector._overlaps, "find_one_more", lambda found, crop: ([stage.person(200, 0.5)], front)
    )
    assert stage.detector._add_new(frame, found, [front.crop])
    stage.step(2, red=200)
    red = clothes.colours_of(stage.image, behind, None)
    assert clothes.alike(one.colours, red) > 0.95 > clothes.alike(mixed, red)


@pytest.mark.parametrize(("depth", "swapped"), [(12.0, False), (1.0, True)])
def test_ids_swapped_where_two_people_met_are_swapped_back(stage, depth, swapped):
    """If their feet differ; both wear red."""
    stage.depth = depth
    stage.detector = people.PeopleDetector(everyone=True, empty=np.zeros((200, 640, 3), np.uint8))
    for n in range(61):
        stage.step(n, red=220 + 2 * n, red2=300)
    one, other = stage.detector.people
    people._swap(one, other, 57)
    for n in range(61, 80):
        stage.step(n, red=220 + 2 * n, red2=300)
    assert one.frames[-15:] == other.frames[-15:] == list(range(65, 80))
    for n in range(-15, 0):
        places = [who.keypoints[n].uv[:, 0].mean() for who in (one, other)]
        assert places == ([300, 380 + 2 * n] if swapped else [380 + 2 * n, 300])


@pytest.mark.parametrize(
    ("fps", "wrong", "swapped"), [(25, 2, False), (25, 4, True), (100, 8, False), (100, 14, True)]
)
def test_feet_swap_ids_after_the_same_time_at_any_frame_rate(stage, fps, wrong, swapped):
    """Both wear red, and come apart; the feet of each then are where the other's were, for some frames."""
    stage.depth, stage.fps = 12.0, fps
    stage.detector = people.PeopleDetector(everyone=True, empty=np.zeros((200, 640, 3), np.uint8))
    frames = np.arange(61 * fps // 25)
    for n in frames:
        stage.step(n, red=220 + 50 * n / fps, red2=300)
    stage.depth = -12.0
    for n in range(len(frames), len(frames) + wrong):
        found = stage.step(n, red=220 + 50 * n / fps, red2=300)
    assert found[2 if swapped else 1] == pytest.approx(220 + 50 * n / fps)


def test_clothes_show_whether_two_people_are_swapped(stage):
    one, other, frame, person = followed(stage, 0, red=200, blue=260)
    second = other.keypoints[-1]
    assert people.PeopleDetector._swap_gain(frame, (one, second), (other, person)) == people._MOST_GAIN
    assert people.PeopleDetector._swap_gain(frame, (one, person), (other, second)) == -people._MOST_GAIN
    one.colours = None
    assert abs(people.PeopleDetector._swap_gain(frame, (one, second), (other, person))) < 0.1


def test_a_live_detector_forgets_who_met(stage):
    stage.detector = people.PeopleDetector(live=True)
    for n in range(30):
        stage.step(n, red=220 + 4 * n, blue=300)
    assert stage.detector._met
    stage.step(round(25 * people._FORGET) + 31, blue=300)
    stage.step(round(25 * people._FORGET) + 32, blue=300)
    assert not stage.detector._met


@pytest.mark.parametrize("empty", [None, np.zeros((200, 640, 3), np.uint8)])
def test_where_someone_hidden_is_expected_no_one_else_gets_a_number(stage, empty):
    """Joints found there may be of two people, so their colours may be no one's."""
    stage.detector = people.PeopleDetector(everyone=True, empty=empty)
    for n in range(20):
        stage.step(n, red=220 + 4 * n, blue=300)
    for n in range(20, 50):
        assert 3 not in stage.step(n, blue2=340, blue=300)
    for n in range(50, 130):
        found = stage.step(n, blue2=340, blue=300)
    assert found == {2: pytest.approx(300), 3: pytest.approx(340)}


@pytest.mark.parametrize(("first", "shift", "taken"), [(0, 14.0, True), (0, 60.0, False), (9, 60.0, True)])
def test_a_person_found_again_beside_a_new_one_stays_on_the_course(stage, monkeypatch, first, shift, taken):
    """If there is a course."""
    stage.detector = people.PeopleDetector(empty=np.zeros((200, 640, 3), np.uint8))
    for n in range(first, 10):
        stage.step(n, red=200 + 4 * n)
    one = stage.detector.people[0]
    last = one.keypoints[-1]
    again, new = stage.person(236 + shift), stage.person(400)
    found = [(one, last)]
    monkeypatch.setattr(stage.detector._overlaps, "find_one_more", lambda found, crop: ([again], new))
    assert stage.detector._add_new(Frame(9, 0.36, stage.image), found, [new.crop])
    assert found[0][1] is one.keypoints[-1] is (again if taken else last)
    new = last  # no one else, as the one found stays where it is
    assert stage.detector._add_new(Frame(9, 0.36, stage.image), found[:1], [new.crop]) == taken


@pytest.mark.parametrize(("seconds", "same"), [(1.0, True), (50.0, False)])
def test_one_whose_trunk_is_hidden_gets_an_old_id_only_soon_after(stage, seconds, same):
    one, other, frame, person = followed(stage, 0, red=200, blue=500)
    one.lost = True
    frame = frame._replace(time=one.times[-1] + seconds)
    assert (stage.detector._who(frame, person, np.ones((200, 640), bool), []) is one) == same


def test_the_course_of_someone_near_another_goes_on_while_most_of_them_is_in_view(stage):
    stage.detector = people.PeopleDetector(empty=np.zeros((200, 640, 3), np.uint8))
    for n in range(10):
        stage.step(n, red=200 + 2 * n, blue=500)
    one, other = stage.detector.people
    for shift, free in ((20, 9), (40, 11)):  # a third and two thirds of them in view
        person = stage.person(218)
        hidden = stage.detector._overlaps.hidden(person.uv, [person.uv + (shift, 1)])
        stage.detector._add(one, Frame(10, 0.4, stage.image), person, [other], hidden)
        assert one.free == free


def test_three_people_whose_boxes_are_one_are_found_from_the_nearest_on(stage):
    stage.detector = people.PeopleDetector(everyone=True, empty=np.zeros((200, 640, 3), np.uint8))
    stage.detector._find = lambda image, small: iter([[stage.crop(300)]])
    stage.reach = 35
    found = stage.step(0, red=275, green=325, blue=300)
    assert sorted(found.values()) == [pytest.approx(275), pytest.approx(300), pytest.approx(325)]


def test_one_who_walks_on_behind_a_wall_has_the_old_id(stage):
    for n in range(80):
        found = stage.step(n, **({} if 20 <= n < 60 else {"red": 40 + 6 * n}))
    assert set(found) == {1} and len(stage.detector.people) == 1


def test_one_who_returns_has_the_old_id(stage):
    for n in range(10):
        stage.step(n, red=300)
    for n in range(10, 40):
        assert stage.step(n) == {}
    assert [set(stage.step(n, red=330)) for n in range(40, 50)][-1] == {1}


def test_another_in_the_same_place_is_new(stage):
    for n in range(10):
        stage.step(n, red=300)
    for n in range(10, 30):
        stage.step(n)
    assert [set(stage.step(n, blue=310)) for n in range(30, 40)][-1] == {2}


def test_people_at_one_place_are_one(stage):
    stage.step(0, red=200, blue=400)
    for n in range(1, 30):
        found = stage.step(n, red=min(200 + 8 * n, 396), blue=400)
        assert len(found) == len({round(x, 3) for x in found.values()})


def test_a_thing_taken_for_a_person_hides_no_small_person(stage):
    """The whole picture shows a thing, parts of it the person."""
    stage.detector._find = lambda image, small: iter([[stage.crop(600)], [stage.crop(200)]])
    assert stage.step(0, red=200) == {1: pytest.approx(200)}


def test_a_second_person_who_shows_only_in_parts_is_found_soon_after_the_first(stage):
    """A scan stops at the part with someone new; the next one comes before the usual second is over."""
    stage.detector._find = lambda image, small: iter([[stage.crop(200)], [stage.crop(500)]])
    found = [set(stage.step(n, red=200, blue=500)) for n in range(10)]
    assert found[0] == {1} and found[-1] == {1, 2}


def test_people_of_a_group_whose_boxes_are_one_are_found_beside_each_other(stage):
    stage.detector = people.PeopleDetector(everyone=True)
    stage.detector._find = lambda image, small: iter([[stage.crop(300)]])
    assert len(stage.step(0, red=230, green=300, blue=370)) == 3


def test_a_crop_follows_at_the_persons_speed(stage):
    for n in range(10):
        assert set(stage.step(n, red=100 + 50 * n)) == {1}


def test_a_live_detector_finds_the_same_and_keeps_little(stage):
    """People cross, turn back, leave and return for a minute."""
    live, whole = people.PeopleDetector(live=True), stage.detector
    for n in range(1500):
        second, places = n / 25, {"blue": 320 + 230 * np.cos(n / 60)}
        if second % 20 < 12:
            places["red"] = 80 + 480 * (second % 20) / 12
        stage.detector = whole
        expected = stage.step(n, **places)
        stage.detector = live
        assert stage.step(n, **places) == expected
        assert all(len(one.frames) == len(one.keypoints) == len(one.times) < 60 for one in live.people)
    assert sum(len(one.frames) for one in whole.people) > 2000
    for n in range(1500, 1500 + 61 * 25):
        stage.step(n)
    assert live.people == []  # no one would get an old id


def test_who_is_lost_does_not_bring_more_searches_for_everyone(stage):
    """They are looked for five times a second; small people and groups once."""
    stage.detector = people.PeopleDetector(everyone=True)
    find, asked = stage.detector._find, []
    stage.detector._find = lambda image, small: asked.append(small) or find(image, small)
    for n in range(10):
        stage.step(n, red=200, blue=500)
    asked.clear()
    for n in range(10, 60):
        stage.step(n, red=200)
    assert 6 <= len(asked) <= 10 and sum(asked) == 2


def test_the_main_person_is_in_view_long_and_large():
    def keypoints(frames, height):
        uv = np.zeros((frames, 16, 2))
        uv[:, 14:, 1] = height
        return Keypoints(
            np.arange(frames), np.arange(frames) / 25, tuple(LANDMARK_JOINTS), uv, np.ones((frames, 16))
        )

    assert people.main_person({1: keypoints(100, 50), 2: keypoints(60, 200)}) == 2


def test_tiles_cover_the_picture():
    for width, height, side in ((1280, 720, 720), (720, 1280, 360), (640, 480, 640)):
        covered = np.zeros((height, width), bool)
        for left, top, right, bottom in networks._tiles(width, height, side):
            covered[top:bottom, left:right] = True
        assert covered.all()


def test_absent_weights_name_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setenv("GAIT_WEIGHTS", str(tmp_path))
    with pytest.raises(
        UserError, match=f"pose_detection.tflite: .* not in {tmp_path}; run gait detect --fetch"
    ):
        weights.load(weights.PERSON)


def test_damaged_weights_are_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("GAIT_WEIGHTS", str(tmp_path))
    (tmp_path / weights.PERSON.file).write_bytes(b"another network")
    with pytest.raises(UserError, match="is damaged or has another version; delete it"):
        weights.load(weights.PERSON)


def test_a_folder_of_weights_that_is_none_is_refused(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GAIT_WEIGHTS", str(tmp_path / "nowhere"))
    with pytest.raises(
        UserError, match="GAIT_WEIGHTS: .*nowhere is not a folder; unset it, or run gait detect"
    ):
        weights.find(weights.PERSON)


@pytest.mark.parametrize("command", [["detect"], ["camera", "--height", "1.7", "--walk"]])
def test_a_picture_is_no_film(command, tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "picture.png"), np.zeros((64, 64, 3), np.uint8))
    out = tmp_path / ("out.json" if "camera" in command else "out.csv")
    assert cli.main([*command, str(tmp_path / "picture.png"), "-o", str(out)]) == 1
    assert "picture.png: has only 1 frame; give a video of at least a second" in capsys.readouterr().err
    assert not out.exists()


def test_a_package_that_cannot_be_had_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setenv("GAIT_WEIGHTS", str(tmp_path))
    failed = subprocess.CompletedProcess([], 1, "", "a\nERROR: no network\n")
    monkeypatch.setattr(subprocess, "run", lambda *args, **kwargs: failed)
    with pytest.raises(
        UserError, match=r"mediapipe==.*cannot be downloaded \(ERROR: no network\); try again"
    ):
        weights.fetch(lambda line: None)
    assert list(tmp_path.iterdir()) == []


def test_weights_that_are_there_already_are_reported(fetched, capsys):
    assert cli.main(["detect", "--fetch"]) == 0
    assert "already there: pose_detection.tflite" in capsys.readouterr().err


@pytest.mark.parametrize("words", [[], ["VIDEO"], ["-o", "k.csv"]])
def test_usage(words, capsys):
    assert cli.main(["detect", *words]) == 2
    assert "give VIDEO and -o KEYPOINTS.csv, or --fetch" in capsys.readouterr().err


def test_both_runtimes_give_the_same_landmarks(fetched):
    data = weights.load(weights.LANDMARK_NETWORKS["full"])
    x = np.random.default_rng(1).random((1, 256, 256, 3)).astype(np.float32)
    lite, opencv = networks._litert(data), networks._opencv(data)
    if lite is None:
        pytest.skip("LiteRT is not installed")
    a, b = lite(x), opencv(x)
    for name, tolerance in (("Identity", 0.01), ("Identity_1", 1e-4)):
        assert np.abs(a[name].ravel() - b[name].ravel()).max() < tolerance
    assert a["Identity_3"].shape == b["Identity_3"].shape


def test_no_person_writes_nothing(fetched, tmp_path, capsys):
    from gait import VideoWriter

    noise = np.random.default_rng(2)
    with VideoWriter(tmp_path / "noise.mp4", 25) as video:
        for _ in range(3):
            video.write(noise.integers(0, 255, (240, 320, 3), np.uint8))
    out = tmp_path / "k.csv"
    assert cli.main(["detect", str(tmp_path / "noise.mp4"), "-o", str(out)]) == 1
    assert "no person found" in capsys.readouterr().err
    assert not out.exists()


def test_a_simulated_walk_is_found(fetched, tmp_path, capsys):
    clip = tmp_path / "walk"
    assert cli.main(["simulate", "-o", str(clip), "--frames", "8", "--size", "480x360", "--quiet"]) == 0
    out = tmp_path / "k.csv"
    capsys.readouterr()
    assert cli.main(["detect", str(clip / "video.mp4"), "-o", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["person"] == 1
    keypoints, _ = read(out, tuple(LANDMARK_JOINTS))
    assert len(keypoints.frame) >= 6


def test_people_of_a_real_film_are_found_and_placed(fetched):
    clip = REAL / "lab_side"
    if not clip.is_dir():
        pytest.skip("../shared/data is absent")
    known = json.loads((clip / "init.json").read_text())
    found = people.detect(Video(clip / "video.mp4"), first=26, stop=60)
    start = find_keypoint_start(
        found[people.main_person(found)], Camera.read(clip / "camera.json"), Model(), height=1.65
    )
    gone = (known["frame"] - start.frame) / 30
    phase = start.mean.phase + gone * start.mean.stride_hz - known["phase"]
    assert abs((phase + 0.5) % 1 - 0.5) < 0.1
    assert abs(start.mean.heading - known["heading_rad"]) < 0.2
    assert abs(start.mean.pelvis[1] - known["pelvis"][1]) < 0.8
