"""Landmarks of people who overlap in the picture, with the empty scene in place of the others."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_person import write

from gait.camera.camera import Camera, write_camera
from gait.camera.path import CameraPose, write_path
from gait.detect.networks import LANDMARK_JOINTS, Crop, Person
from gait.detect.outline import draw_person
from gait.detect.overlaps import Overlaps, same_joints
from gait.errors import UserError
from gait.io.video import Frame
from gait.track import read_scene
from gait.track.clip_camera import static_plate
from gait.track.options import ClipOptions

HEIGHT, WIDTH = 240, 320
EMPTY = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)


def joints(u, lowest=200.0):
    """Joints (16, 2) of a person from the front."""
    sides = [1, -1] * 8
    across = np.repeat([9, 13, 14, 6, 6, 6, 6, 7], 2) * sides
    down = np.repeat([28, 50, 68, 72, 104, 134, 138, 140], 2)
    return np.column_stack([u + across, down + lowest - 140.0]).astype(float)


def crop_of(uv):
    return Crop(np.array([uv[:, 0].mean(), uv[:, 1].max() - 70]), 200.0, 0.0)


def person(uv, score=0.9):
    return Person(score, uv, np.ones(16), crop_of(uv))


def area(uv):
    canvas = np.zeros((HEIGHT, WIDTH), np.uint8)
    draw_person(canvas, dict(zip(LANDMARK_JOINTS, uv, strict=True)), 1)
    return canvas > 0


def picture(*people):
    """Draw people, each with joints and a grey level, the nearest last."""
    image = EMPTY.copy()
    for uv, level in people:
        image[area(uv)] = level
    return image


class Network:
    """Finds one person in the middle of all that differs from the empty scene, as if it were one person's."""

    def __init__(self):
        self.picture = None

    def __call__(self, image, crop):
        self.picture = image
        columns = np.nonzero((image != EMPTY).any(axis=2))[1]
        left, right = crop.centre[0] - crop.side / 8, crop.centre[0] + crop.side / 8
        columns = columns[(columns > left) & (columns < right)]
        return person(joints(columns.mean())) if len(columns) > 10 else person(joints(0.0), 0.0)


def overlaps(*people):
    network = Network()
    one = Overlaps(EMPTY, network)
    one.see(picture(*people))
    return one, network


FAR, NEAR = joints(150.0, 195.0), joints(165.0, 200.0)


def test_others_are_replaced_by_the_empty_scene_where_they_are_nearer():
    one, network = overlaps((FAR, 200), (NEAR, 30))
    behind, hidden = one.find(crop_of(FAR), FAR, [NEAR])
    assert (network.picture[area(NEAR)] == 90).all() and (network.picture == 200).any()
    assert behind.score > 0.5 and not (hidden & ~area(NEAR)).any()
    one.find(crop_of(NEAR), NEAR, [FAR])
    assert (network.picture[area(NEAR)] == 30).all() and not (network.picture == 200).any()


def test_of_two_at_the_same_depth_one_hides_the_other():
    one, _ = overlaps()
    left, right = joints(150.0), joints(165.0)
    assert one.hidden(left, [right]).any() != (one.hidden(right, [left]) & area(right)).any()


def test_without_others_the_picture_is_left_as_it_is():
    one, network = overlaps((FAR, 200))
    _, hidden = one.find(crop_of(FAR), FAR, [])
    assert hidden is None and (network.picture == picture((FAR, 200))).all()


def test_someone_who_is_hidden_is_not_found():
    hardly = joints(166.0, 199.0)
    one, network = overlaps((hardly, 200), (NEAR, 30))
    one._landmarks = lambda image, crop: person(network(image, crop).uv - (0.0, 1.0))
    assert one.find(crop_of(hardly), hardly, [NEAR])[0].score == 0


@pytest.mark.parametrize(("u", "found"), [(170.0, False), (175.0, True)])
def test_someone_with_only_an_edge_in_view_is_not_found(u, found):
    """All of what is in view is foreground: a seventh, or a third, of them."""
    behind = joints(u, 199.0)
    one, _ = overlaps((behind, 200), (NEAR, 30))
    one._landmarks = lambda image, crop: person(behind)
    assert (one.find(crop_of(behind), behind, [NEAR])[0].score > 0) == found


def test_landmarks_in_the_empty_scene_are_no_person():
    one, network = overlaps((NEAR, 30))
    one._landmarks = lambda image, crop: person(joints(60.0))
    assert one.find(crop_of(NEAR), joints(60.0), [NEAR])[0].score == 0


def test_two_people_taken_for_one_become_two():
    left, right = joints(105.0), joints(160.0)
    one, network = overlaps((left, 200), (right, 30))
    both = network(picture((left, 200), (right, 30)), crop_of(joints(130.0)))
    assert both.uv[:, 0].mean() > 120
    found = one.find_one_more([both], crop_of(joints(175.0)))
    assert found is not None
    places = sorted(p.uv[:, 0].mean() for p in (*found[0], found[1]))
    assert places[0] < 115 and places[1] > 152 and not same_joints(found[0][0], found[1])


@pytest.mark.parametrize("one_place", [False, True])
def test_no_one_is_added_if_two_people_known_would_become_one(one_place):
    left, middle, right = joints(105.0), joints(125.0), joints(215.0)
    one, _ = overlaps((left, 200), (middle, 30), (right, 140))

    def landmarks(image, crop):
        u = crop.centre[0]
        return person(joints(116.0 if one_place and 110 < u < 190 else u))

    one._landmarks = landmarks
    more = one.find_one_more([person(left), person(middle)], crop_of(right))
    assert (more is None) == one_place


def test_no_one_is_added_to_one_person():
    one, network = overlaps((NEAR, 30))
    alone = network(picture((NEAR, 30)), crop_of(NEAR))
    assert one.find_one_more([alone], crop_of(joints(140.0))) is None


@pytest.mark.parametrize(("width", "found"), [(6, False), (40, True)])
def test_a_thing_beside_a_person_is_no_other_person(width, found):
    """A network that sees someone in it; they must add a third of a person to the foreground."""
    image = picture((NEAR, 30))
    part = image[60:200, 185 : 185 + width]
    part[part == 90] = 200
    beside = joints(181.0, 199.0)
    one = Overlaps(EMPTY, lambda image, crop: person(NEAR if crop.centre[0] < 173 else beside))
    one.see(image)
    one._remains = lambda people, crop: True
    assert (one.find_one_more([person(NEAR)], crop_of(beside)) is not None) == found


@pytest.mark.parametrize(
    ("u", "width", "enough"), [(160, 15, True), (160, 9, False), (0, 9, True), (0, 4, False)]
)
def test_someone_new_needs_foreground_in_the_part_of_a_crop_that_is_in_the_picture(u, width, enough):
    image = EMPTY.copy()
    image[:, u : u + width] = 200
    one = Overlaps(EMPTY, Network())
    one.see(image)
    assert one._remains([], Crop(np.array([u, 120.0]), 200.0, 0.0)) == enough


def test_someone_in_the_empty_scene_is_found_if_no_one_else_is_near():
    stands, near, away = joints(262.0), joints(220.0), joints(58.0)
    for walks, found in ((away, True), (near, False)):
        one = Overlaps(picture((stands, 30)), Network())
        one.see(picture((stands, 30), (walks, 200)))
        more = one.find_one_more([person(walks)], crop_of(stands))
        assert (more is not None) == found
    more = one.find_one_more([], crop_of(stands))
    assert more is not None and abs(more[1].uv[:, 0].mean() - 262) < 5


def test_an_empty_scene_of_another_size_is_refused():
    with pytest.raises(UserError, match="size"):
        Overlaps(EMPTY, Network()).see(EMPTY[1:])


def test_an_empty_scene_in_grey_is_refused():
    with pytest.raises(UserError, match=r"must be a BGR picture \(h, w, 3\), not \(240, 320\)"):
        Overlaps(EMPTY[..., 0], Network())


def test_limbs_that_end_in_an_unknown_joint_are_not_drawn():
    uv = joints(150.0)
    uv[2] += 60, 0  # an elbow far to the left
    names = list(LANDMARK_JOINTS)
    assert names[2] == "l_elbow"
    whole, at = area(uv), dict(zip(LANDMARK_JOINTS, uv, strict=True))
    parts = []
    for elbow in ({}, {"l_elbow": np.full(2, np.nan)}):
        canvas = np.zeros((HEIGHT, WIDTH), np.uint8)
        draw_person(canvas, {name: at[name] for name in names if name != "l_elbow"} | elbow, 1)
        parts.append(canvas > 0)
    assert (parts[0] == parts[1]).all() and whole[:, 200:].any() and not parts[0][:, 200:].any()


@pytest.mark.parametrize(("shift", "known"), [(0, True), (9, False)])
def test_a_camera_that_moves_has_no_empty_scene(shift, known, capsys):
    plate = np.random.default_rng(1).integers(0, 255, (HEIGHT // 8, WIDTH // 8, 3), np.uint8)
    plate = plate.repeat(8, axis=0).repeat(8, axis=1)
    samples = [Frame(n, n / 25, np.roll(plate, n * shift, axis=1)) for n in range(8)]
    camera = Camera(WIDTH, HEIGHT, 300.0, 300.0, 160.0, 120.0, np.eye(3), np.zeros(3))
    options = ClipOptions("v.mp4", "c.json", "t.csv", people=8)
    assert (static_plate(options, None, camera, samples, plate) is plate) == known
    assert ("the camera moves: people who overlap" in capsys.readouterr().err) != known
    assert static_plate(options, None, camera, samples, None) is None
    assert "there is no background: people who overlap" in capsys.readouterr().err


@pytest.mark.parametrize("people", [None, 8])
def test_a_camera_with_given_poses_has_no_empty_scene(people, tmp_path, monkeypatch, capsys):
    write(tmp_path / "v.mp4", [EMPTY] * 6)
    still = Camera.looking((0.0, -6.0, 1.4), (0.0, 0.0, 0.9), (WIDTH, HEIGHT), 330.0)
    write_camera(tmp_path / "c.json", still)
    poses = [CameraPose.of(replace(still, t=still.t + (0.1 * k, 0.0, 0.0))) for k in range(6)]
    write_path(tmp_path / "p.csv", range(6), poses, by_frame=True)
    monkeypatch.setattr(read_scene, "require_detector", lambda _: None)
    monkeypatch.setattr(read_scene, "detects", lambda _: True)
    monkeypatch.setattr(read_scene, "find_people", lambda *_: ({}, -1))
    files = (str(tmp_path / name) for name in ("v.mp4", "c.json", "t.csv"))
    read_scene.read_scene(ClipOptions(*files, camera_path=str(tmp_path / "p.csv"), people=people))
    assert ("the camera moves: people who overlap" in capsys.readouterr().err) == (people is not None)
