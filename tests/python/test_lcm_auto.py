"""gait-trackd --init auto: starts with the person who walks through the empty scene, and after a loss."""

import lcm_rig as rig
import numpy as np

from gait.bindings.state import State
from gait.lcm.link import gaitmsg
from gait.lcm.messages import command_message, image_message

LOST = gaitmsg.estimate_t.LOST
SCENE = rig.opening()[:2]  # camera and empty scene, no START


def empty(first, stop):
    return [("GAIT_IMAGE_0", image_message(rig.plate(), rig.utime(i), i)) for i in range(first, stop)]


def later(pictures, by):
    """The pictures of the clip, `by` frames later."""
    return [("GAIT_IMAGE_0", image_message(rig.picture(i), rig.utime(i + by), i + by)) for i in pictures]


def track(tmp_path, events, *options):
    return rig.play(rig.write_log(tmp_path / "a.log", events), *options)


def test_who_walks_in_is_tracked_after_a_second(tmp_path):
    got = track(tmp_path, [*SCENE, *empty(0, 20), *later(range(45), 20)])
    begun = got.estimates[0].frame
    assert 48 <= begun <= 60 and [m.frame for m in got.estimates] == list(range(begun, 65))
    true, found = rig.person(begun - 20), got.estimates[0].mean
    assert np.hypot(*(np.array(found.pelvis[:2]) - true.pelvis[:2])) < 0.5
    assert abs(found.heading) < 0.5 and abs(found.stature - true.stature) < 0.15


def test_no_person_is_found_in_an_empty_scene_or_without_one(tmp_path):
    assert track(tmp_path, [*SCENE, *empty(0, 50)]).frames == 0
    assert track(tmp_path, [SCENE[0], *rig.frames(0, 50)]).frames == 0


def test_stop_means_stop(tmp_path):
    stop = ("GAIT_COMMAND", command_message(gaitmsg.command_t.STOP, rig.utime(0), State(), State()))
    assert track(tmp_path, [*SCENE, stop, *rig.frames(0, 45)]).frames == 0


def test_who_comes_back_is_tracked_again(tmp_path):
    got = track(tmp_path, [*rig.opening(), *rig.frames(0, 20), *empty(20, 50), *later(range(60), 50)])
    status = {m.frame: m.status for m in got.estimates}
    assert status[40] == LOST and status[49] == LOST
    assert all(status[i] != LOST for i in range(100, 110))


def test_a_clock_set_back_far_is_a_new_search(tmp_path):
    """A person who is there is found again a second later."""
    back = [("GAIT_IMAGE_0", image_message(rig.picture(i), rig.utime(i) - 900_000, i)) for i in range(15, 60)]
    got = track(tmp_path, [*rig.opening(), *rig.frames(0, 15), *back], "--max-gap", 0.5)
    assert got.words.count("went back by 0.867 s (at most 0.500): stopped; searching for a person again") == 1
    assert got.words.count("person found at frame") == 1 and got.rejected == 0
    assert {m.frame for m in got.estimates} >= {*range(15), *range(55, 60)}


def test_the_scene_of_another_camera_is_reported_once(tmp_path):
    other = np.full_like(rig.plate(), 60)
    other[:, ::2] = 180
    scene = [SCENE[0], ("GAIT_BACKGROUND_0", image_message(other, rig.utime(0), -1))]
    for begin in (scene, [*scene, rig.opening()[2]]):  # while looking for a person, and while tracking
        words = track(tmp_path, [*begin, *rig.frames(0, 10)]).words
        assert (
            words.count("trackd: half of the image differs from the background: give that of this camera")
            == 1
        )


def test_search_and_detection_are_reported(tmp_path):
    words = track(tmp_path, [*SCENE, *empty(0, 20), *later(range(45), 20)]).words
    assert words.count("searching for a person who walks in full view") == 1
    assert words.count("person found at frame") == 1 and "differs" not in words
