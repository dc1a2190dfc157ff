"""People of other tools' files are linked over time."""

import numpy as np

from gait.io.detections import Clip, Detection, Detections, read_people

NAMES = ("l_hip", "r_hip", "l_ankle", "r_ankle")
BODY = np.array([[0, 0], [10, 0], [0, 100], [10, 100]], float)


def observed(places):
    """Detections of people who stand at `places` (px), by frame."""
    return [
        Detection(frame, None, np.column_stack([BODY + [u, 0.0], np.ones(4)]))
        for frame, where in places.items()
        for u in where
    ]


def hips(found, frames, person=None):
    """The left hip's u of a person; by default of the one in view most."""
    people, _, _ = read_people("k", Detections(NAMES, found, fps=30.0), Clip(person=person))
    first = next(iter(people.values()))
    assert first.frame.tolist() == list(frames)
    return first.uv[:, 0, 0]


def test_people_who_meet_while_none_is_found_are_not_taken_for_each_other(capsys):
    """They approach each other by 2 px a frame and pass between frames 30 and 50."""
    found = {k: (2.0 * k, 160 - 2.0 * k) for k in [*range(30), *range(50, 100)]}
    assert np.diff(hips(observed(found), range(50, 100))).tolist() in ([2.0] * 49, [-2.0] * 49)
    assert "k: people may have changed places before frame 50," in capsys.readouterr().err


def test_a_gap_of_one_of_two_people_or_a_short_one_is_bridged(capsys):
    gap, known = range(30, 50), [*range(30), *range(50, 60)]
    for other in (500.0, 90.0):  # far away, or where the missing person may be
        found = {k: (other,) if k in gap else (20 + 2.0 * k, other) for k in range(60)}
        assert np.diff(hips(observed(found), known, "0")).max() == 42
    short = {k: (20.0, 60.0) for k in range(60) if not 30 <= k < 35}
    assert np.ptp(hips(observed(short), short)) == 0
    assert "changed places" not in capsys.readouterr().err
