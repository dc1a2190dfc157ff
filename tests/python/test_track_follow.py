"""A person is followed wherever they are in view: before the start, after a loss, beside other people."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_person import camera, clip, wall, write

from gait import Model, Tracker, TrackerConfig, TrackStatus, Video
from gait.bindings.frame import FrameKeypoints
from gait.bindings.initial import Start
from gait.bindings.model import read_blob
from gait.bindings.start_fit import Hypothesis
from gait.body.skeleton import other_sides
from gait.cli import main
from gait.io import blob, keypoints_file, video
from gait.io.track_file import read_track
from gait.io.video import Frame
from gait.track import clip_keypoints
from gait.track.clip_output import _without_pictures
from gait.track.follow import Follower
from gait.track.person_keypoints import PersonKeypoints
from gait.track.plausible import Plausibility

MODEL = Model()
SECTIONS = blob.decode(read_blob(None))
FRAMES, TRUE = clip(MODEL, SECTIONS, 30)
FORWARDS = {"walk": 1}
JOINTS = np.array([MODEL.pose(state)[0] for state in TRUE])
START = 15
GAP = 45


def init(folder, state, number):
    start = {
        "frame": number,
        "pelvis": state.pelvis.tolist(),
        "heading_rad": state.heading,
        "phase": state.phase,
        "stride_hz": state.stride_hz,
        "stature_m": state.stature,
    }
    (folder / "init.json").write_text(json.dumps(start))


@pytest.fixture
def folder(tmp_path):
    """The drawn walk with its camera, its empty scene and a start in the middle."""
    write(tmp_path / "walk.mp4", FRAMES)
    cv2.imwrite(str(tmp_path / "plate.png"), wall())
    (tmp_path / "camera.json").write_text(json.dumps(camera().to_dict()))
    init(tmp_path, TRUE[START], START)
    return tmp_path


def track(folder, *options):
    words = ["track", folder / "walk.mp4", "--camera", folder / "camera.json", "-o", folder / "o.csv"]
    words += ["--init", folder / "init.json", "--particles", 400, "--detector", "none"]
    if "--background" not in options:
        words += ["--background", folder / "plate.png"]
    return main([str(word) for word in (*words, *options)])


def errors(folder):
    """Frames of the track, and their errors where the walk is in view, metres."""
    rows = read_track(folder / "o.csv")
    mine = np.stack([rows.places[name] for name in ("l_knee", "r_knee", "l_ankle", "r_ankle")], axis=1)
    order = [MODEL.joint_names.index(name) for name in ("l_knee", "r_knee", "l_ankle", "r_ankle")]
    return rows, mine, order


def test_every_frame_is_covered_from_a_start_in_the_middle(folder, capsys):
    more = ("--overlay", folder / "o.mp4", "--trc", folder / "o.trc")
    assert track(folder, *more) == 0
    rows, mine, order = errors(folder)
    assert rows.frame.tolist() == list(range(len(FRAMES))) and set(rows.status) == {"tracking"}
    off = np.linalg.norm(mine - JOINTS[:, order], axis=2).mean(axis=1)
    assert off.max() < 0.12 and np.median(off[:START]) < 0.06
    assert Video(folder / "o.mp4").count == len(FRAMES)
    assert len((folder / "o.trc").read_text().splitlines()) == len(FRAMES) + 6
    assert "followed from frame 0 to 29" in capsys.readouterr().err


def test_the_smoother_covers_the_frames_before_the_start_too(folder):
    assert track(folder, "--smooth", "--draws", folder / "d.npz") == 0
    rows, mine, order = errors(folder)
    with np.load(folder / "d.npz") as draws:
        assert rows.frame.tolist() == draws["frame"].tolist() == list(range(len(FRAMES)))
    assert np.linalg.norm(mine - JOINTS[:, order], axis=2).mean() < 0.12


def test_frames_from_the_last_to_the_first(folder, monkeypatch):
    film = Video(folder / "walk.mp4")
    monkeypatch.setattr(video, "_CHUNK_BYTES", 1)  # the least chunk, 8 frames
    back, forth = list(film.backwards(21, 2)), list(film.frames(2, 21))
    assert [(f.number, f.time) for f in back] == [(f.number, f.time) for f in reversed(forth)]
    assert np.array_equal(back[0].image, forth[-1].image)


@pytest.mark.parametrize("at", [0, len(FRAMES) + GAP + START])
@pytest.mark.parametrize("ids", [(1,), (1, 2)])
def test_a_person_who_comes_back_is_found_by_keypoints(ids, at, folder, capsys, monkeypatch):
    """The person walks, is away, and walks again from the first place; the start is in either walk.

    With the keypoints of a file, or of a detector that gives the person another id.
    """
    write(folder / "walk.mp4", [*FRAMES, *[wall()] * GAP, *FRAMES])
    again = len(FRAMES) + GAP
    init(folder, TRUE[at % again], at)
    count = 2 * len(FRAMES) + GAP
    uv = np.full((count, len(MODEL.joint_names), 2), np.nan)
    uv[: len(FRAMES)] = uv[-len(FRAMES) :] = camera().project(JOINTS)
    frame = np.arange(count)
    found = keypoints_file.Keypoints(frame, frame / 30, MODEL.joint_names, uv, np.ones(uv.shape[:2]))
    if len(ids) == 1:
        keypoints_file.write(folder / "k.csv", found)
        assert track(folder, "--keypoints", folder / "k.csv") == 0
    else:
        people = {
            id: replace(
                found,
                frame=frame[part],
                time=found.time[part],
                uv=uv[part],
                confidence=found.confidence[part],
            )
            for id, part in ((1, slice(0, again)), (2, slice(again, count)))
        }
        monkeypatch.setattr(clip_keypoints, "_detect", lambda *_: (people, 1 if at == 0 else 2))
        assert track(folder) == 0
    rows, mine, order = errors(folder)
    assert rows.frame.tolist() == frame.tolist()
    assert "lost" in rows.status[len(FRAMES) : again]
    for walk in (slice(0, len(FRAMES)), slice(again, count)):
        off = np.linalg.norm(mine[walk] - JOINTS[:, order], axis=2).mean(axis=1)
        assert off.max() < 0.15 and "lost" not in rows.status[walk]
    assert "back at frame" in capsys.readouterr().err


@pytest.mark.parametrize("known", [True, False], ids=["keypoints", "pictures"])
def test_a_lost_person_is_found_again_within_a_second_in_full_view(known, folder):
    """Hidden for 1.5 s behind a wall, then walking on.

    Without keypoints, pictures take longer to show left and right, and the distance from the camera.
    """
    back, count = START + 45, START + 90
    pictures, states = clip(MODEL, SECTIONS, count, start=(-2.3, 0.0))
    pictures[START:back] = [wall()] * (back - START)
    write(folder / "walk.mp4", pictures)
    init(folder, states[0], 0)
    joints = np.array([MODEL.pose(state)[0] for state in states])
    if known:
        uv, frame = camera().project(joints.reshape(-1, 3)).reshape(*joints.shape[:2], 2), np.arange(count)
        uv[START:back] = np.nan
        found = keypoints_file.Keypoints(frame, frame / 30, MODEL.joint_names, uv, np.ones(uv.shape[:2]))
        keypoints_file.write(folder / "k.csv", found)
    assert track(folder, *(["--keypoints", folder / "k.csv"] if known else ["--particles", 1000])) == 0
    rows, mine, order = errors(folder)
    off = mine - joints[rows.frame][:, order]
    off = np.linalg.norm(off, axis=2).mean(axis=1) if known else np.abs(off.mean(axis=1)[:, 0])
    again = rows.frame >= back + 30
    assert "lost" in rows.status[:back] and again.sum() == count - back - 30
    assert off[again].max() < 0.15 and "lost" not in np.array(rows.status)[again]


@pytest.mark.parametrize("cut", ["picture's edge", "occluder"])
def test_feet_that_leave_the_picture_do_not_end_the_track(cut, folder, capsys):
    """The person walks towards the camera, or something hides them up to the knees for half a second."""
    view, count, hidden = camera(), 45, slice(15, 30)
    way = {"start": (-1.2, 0.0)}
    if cut == "picture's edge":
        view = camera(place=(0.0, -5.0, 1.5))
        way = {"start": (0.0, -1.1), "heading": -np.pi / 2}
    pictures, states = clip(MODEL, SECTIONS, count, view=view, **way)
    joints = np.array([MODEL.pose(state)[0] for state in states])
    feet = [MODEL.joint_names.index(name) for name in ("l_ankle", "r_ankle")]
    if cut == "occluder":
        knees = view.project(joints[:, [MODEL.joint_names.index("l_knee")]])[..., 1]
        for picture in pictures[hidden]:
            picture[int(knees.min()) :] = 60
    else:
        assert (view.project(joints[-1, feet])[..., 1] > pictures[0].shape[0]).all()
    write(folder / "walk.mp4", pictures)
    (folder / "camera.json").write_text(json.dumps(view.to_dict()))
    init(folder, states[0], 0)
    assert track(folder) == 0
    rows, mine, order = errors(folder)
    assert set(rows.status) == {"tracking"} and f"from frame 0 to {count - 1}" in capsys.readouterr().err
    assert np.linalg.norm(mine - joints[:, order], axis=2).max() < 0.2


def test_a_mirror_image_with_keypoints_loses_against_the_person(folder, monkeypatch):
    """The detector takes it for a second person, and for a while finds only this one."""
    real = camera().project(JOINTS)
    swap = {"l_": "r_", "r_": "l_"}
    other = [MODEL.joint_names.index(swap.get(n[:2], n[:2]) + n[2:]) for n in MODEL.joint_names]
    image = camera().project(JOINTS[:, other] * [1, -1, 1] + [0, 3.0, 0])  # in a mirror 1.5 m behind the path
    real[10:18] = np.nan
    frame = np.arange(len(FRAMES))
    people = {
        id: keypoints_file.Keypoints(frame, frame / 30, MODEL.joint_names, uv, np.ones(uv.shape[:2]))
        for id, uv in ((1, image), (2, real))
    }
    monkeypatch.setattr(clip_keypoints, "_detect", lambda *_: (people, 1))
    assert track(folder, "--init", "auto") == 0
    rows, mine, order = errors(folder)
    assert rows.frame.tolist() == frame.tolist() and "lost" not in rows.status
    assert np.linalg.norm(mine - JOINTS[:, order], axis=2).mean(axis=1).max() < 0.2


@pytest.mark.long
def test_a_film_of_noise_ends_with_a_warning(folder, capsys):
    random = np.random.default_rng(1)
    write(folder / "walk.mp4", random.integers(0, 255, (40, 240, 320, 3), dtype=np.uint8))
    assert track(folder, "--background", "auto") == 1
    assert "the person was lost nearly all the time" in capsys.readouterr().err
    rows = read_track(folder / "o.csv")
    assert "tracking" not in rows.status and rows.status[-1] == "lost"


@pytest.fixture(scope="module")
def estimate():
    """Estimates of a tracker for the last frame of the walk."""
    tracker = Tracker(MODEL, camera(), TrackerConfig.default(particles=200), background=wall())
    mean, sd = MODEL.prior()
    sd.pelvis[:] = sd.heading = sd.phase = 0.02
    tracker.start(TRUE[-1], sd, 0)
    tracker.step(FRAMES[-1], 0)
    now = tracker.step(FRAMES[-1], 1)
    return replace(now, joints=JOINTS[-1], mean=TRUE[-1], status=TrackStatus.TRACKING)


def found(shift=0.0, joints=JOINTS[-1]):
    """Keypoints of a person so many metres aside."""
    return FrameKeypoints(MODEL.joint_names, camera().project(joints + [shift, 0, 0]), 2.0)


def test_keypoints_of_another_person_are_left_out(estimate):
    us, them, away = found(0.03), found(0.9), replace(estimate, status=TrackStatus.LOST)
    people = PersonKeypoints(camera(), {1: {0: them, 1: them}, 2: {0: us}}, 1)
    zero, one, two = (Frame(i, i / 30, FRAMES[-1]) for i in range(3))
    assert people.choose(zero, estimate) is us and people.choose(one, estimate) is None
    assert people.choose(one, None) is them and people.choose(one, away) is them
    assert people.agree(zero, estimate) is True and people.agree(one, estimate) is False
    assert people.agree(two, estimate) is None and people.near(two, estimate) is None
    assert people.near(one, estimate) is False and people.near(zero, estimate) is True


def test_a_figure_of_another_size_is_not_near(estimate):
    """Scaled about the feet, so that the ankles agree."""
    feet = JOINTS[-1].min(axis=0)
    for size, near in ((1.05, True), (1.8, False), (0.55, False)):
        people = PersonKeypoints(camera(), {1: {0: found(joints=feet + size * (JOINTS[-1] - feet))}}, 1)
        assert people.near(Frame(0, 0.0, FRAMES[-1]), estimate) is near


class Script:
    """A tracker that stays on the person, or leaves them at a frame, until it is started again."""

    step_seconds = 0.0

    def __init__(self, estimate, leaves, starts):
        self.estimate, self.leaves, self.starts = estimate, leaves, starts
        self.config = TrackerConfig.default()
        self.gone = False

    def like(self, config):
        return Script(self.estimate, self.leaves, self.starts)

    def start(self, mean, sd, utime):
        self.starts.append(round(utime * 30 / 1e6))
        self.gone = False

    def step(self, image, utime, keypoints, poses, backgrounds, people):
        self.gone |= round(abs(utime) * 30 / 1e6) == self.leaves
        return replace(self.estimate, joints=JOINTS[-1] + [self.gone * 1.0, 0, 0])


class Film:
    """Frames whose pictures are not used."""

    fps = 30.0

    def frames(self, first, stop):
        return (Frame(n, n / 30, FRAMES[0]) for n in range(first, stop))

    def backwards(self, stop, first):
        return reversed(list(self.frames(first, stop)))


@pytest.fixture
def astray(estimate):
    """Follow a track that leaves the person at frame 20 or, backwards, at 79.

    The person is found in frames 0 to 19 and 80 to 99; between them are ghosts for a second, then nothing,
    then the person.  Returns the times of the starts in frames, the intervals searched for a start, and the
    rows.
    """

    def run(start, ghosts, nothing, again):
        joints = {n: found() for n in range(100)}
        joints |= {n: found(-2.0) for n in ghosts} | {n: found(np.nan) for n in nothing}
        people = PersonKeypoints(camera(), {1: joints}, 1)
        starts, asked = [], []

        def find(first, stop, stature):
            asked.append((first, stop))
            return Start(again, estimate.mean, estimate.sd) if first <= again < stop else None

        follower = Follower(
            Script(estimate, ghosts[0], starts),
            Film(),
            people,
            Plausibility(people, 1.75, 0.05, 0.0, FORWARDS, [camera()]),
            find,
        )
        rows = list(follower.follow(Start(start, estimate.mean, estimate.sd), range(100)))
        assert [frame.number for frame, _ in rows] == list(range(100))
        near = [bool(people.near(frame, now)) for frame, now in rows]
        return starts, asked, near, [now.status.name for _, now in rows]

    return run


def test_a_person_hidden_for_long_is_taken_up_again(astray):
    """Frames without keypoints do not hide that the track left the person."""
    starts, asked, near, statuses = astray(0, range(20, 50), range(50, 65), 65)
    assert starts == [0, -65, 65]  # a negative one is backwards
    assert len(asked) == 1 and 35 <= asked[0][0] <= 37
    assert all(near[65:]) and "LOST" not in statuses[65:]


def test_judging_forgets_a_track_backwards(astray, monkeypatch):
    """When the track that was lost goes on, its last second is not that of the search backwards."""
    events = []
    judged, restart = Plausibility.judged, Plausibility.restart
    monkeypatch.setattr(
        Plausibility, "judged", lambda self, *row: (events.append(row[0].number), judged(self, *row))[1]
    )
    monkeypatch.setattr(Plausibility, "restart", lambda self: (events.append("restart"), restart(self))[1])
    astray(0, range(20, 50), range(50, 65), 65)
    pairs = zip(events, events[1:], strict=False)
    steps = [abs(other - one) for one, other in pairs if "restart" not in (one, other)]
    assert len(steps) > 80 and set(steps) == {1}


def test_a_track_that_goes_astray_backwards_is_cut_and_the_person_searched_earlier(astray):
    starts, asked, near, _ = astray(99, range(79, 49, -1), range(49, 34, -1), 5)
    assert asked[0] == (0, 80)
    assert starts == [-99, -5, 5, 99]
    assert all(near[:35])


class Stops(Script):
    """A tracker of a person who stands from frame 20 to 49, and shows left and right from frame 60 on."""

    def like(self, config):
        return Stops(self.estimate, self.leaves, self.starts)

    def step(self, image, utime, keypoints, poses, backgrounds, people):
        number = round(abs(utime) * 30 / 1e6)
        now = super().step(image, utime, keypoints, poses, backgrounds, people)
        known = TrackStatus.TRACKING if number >= 20 and not 50 <= number < 60 else TrackStatus.AMBIGUOUS
        return replace(now, status=known, speed=0.0 if 20 <= number < 50 else 1.2)


@pytest.mark.parametrize(("frames", "wanted"), [(50, [0]), (100, [-66, 20])])
def test_a_stand_does_not_show_which_leg_is_the_right_one(estimate, frames, wanted):
    """A start without a phase is moved to where the person walks with status `tracking`, not to a stand."""
    people = PersonKeypoints(camera(), {1: {n: found() for n in range(100)}}, 1)
    plausible = Plausibility(people, 1.75, 0.05, 0.0, FORWARDS, [camera()])
    starts = []
    follower = Follower(
        Stops(estimate, -1, starts), Film(), people, plausible, lambda *_: None, one_pass=True
    )
    start = Start(0, estimate.mean, replace(estimate.sd, phase=0.5))
    rows = list(follower.follow(start, range(frames)))
    assert starts == [0, 0, 0, *wanted]  # three draws of particles first; a negative one is backwards
    assert [frame.number for frame, _ in rows] == list(range(wanted[-1], frames))


def test_legs_that_keypoints_show_elsewhere_are_no_agreement(estimate):
    legs = [i for i, name in enumerate(MODEL.joint_names) if name[2:] in ("knee", "ankle")]
    astride = JOINTS[-1].copy()
    astride[legs, 0] += [0.25 * (-1) ** i for i in range(len(legs))]
    people = PersonKeypoints(camera(), {0: {0: found(joints=astride)}}, 0)
    frame = Frame(0, 0.0, FRAMES[-1])
    assert people.choose(frame, estimate) is not None and people.agree(frame, estimate) is False


def test_swapped_legs_agree(estimate):
    """The tracker judges left and right; a detector swaps them in single frames."""
    people = PersonKeypoints(camera(), {0: {0: found(joints=JOINTS[-1][other_sides(MODEL.joint_names)])}}, 0)
    assert people.agree(Frame(0, 0.0, FRAMES[-1]), estimate) is True


def swapped(*parts):
    """Order of the joints with left and right of some parts swapped; of all without any."""
    other = other_sides(MODEL.joint_names)
    names = enumerate(MODEL.joint_names)
    return [other[i] if not parts or name[2:] in parts else i for i, name in names]


@pytest.fixture(scope="module")
def of_sides(estimate):
    """Judge 40 frames of an estimate turned by an angle, some of whose keypoints have other sides."""

    def run(turn, order, when):
        c, s, middle = np.cos(turn), np.sin(turn), JOINTS[-1][0]
        joints = (JOINTS[-1] - middle) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + middle
        keypoints = {n: found(joints=joints[order] if n in when else joints) for n in range(60)}
        people = PersonKeypoints(camera(), {1: keypoints}, 1)
        plausible = Plausibility(people, 1.75, 0.05, 0.0, FORWARDS, [camera()])
        rows = [(Frame(n, n / 30, FRAMES[0]), replace(estimate, joints=joints, frame=n)) for n in range(60)]
        return plausible, rows

    return run


@pytest.mark.parametrize(
    ("turn", "parts", "when", "ambiguous"),
    [
        (np.pi / 2, (), range(0), range(0)),
        (np.pi / 2, (), range(4, 18), range(0)),
        (np.pi / 2, (), range(4, 20), range(19, 43)),
        (np.pi / 2, (), range(2, 34, 2), range(32, 49)),
        (-np.pi / 2, (), range(1, 17), range(16, 40)),
        (np.pi / 2, ("shoulder",), range(60), range(0)),
        (np.pi / 2, ("hip", "knee", "ankle"), range(60), range(0)),
        (0.0, (), range(60), range(0)),
    ],
)
def test_trunks_that_face_the_other_way_for_half_a_second_are_ambiguous(
    of_sides, turn, parts, when, ambiguous
):
    """Shoulders and hips together, in views from the front or behind; the walk is seen from the side."""
    plausible, rows = of_sides(turn, swapped(*parts), when)
    judged = [plausible.judged(*row) for row in rows]
    found = [n for n, now in enumerate(judged) if now.status != TrackStatus.TRACKING]
    assert found == list(ambiguous)
    assert {judged[n].reason for n in found} <= {"the detected joints show the person facing the other way"}


def ambiguous(plausible, found, smooth=False):
    """Frames of a track that are not `tracking`, once its later ones are known."""
    judged = plausible.judged_later(found) if smooth else plausible.known_later(plausible._anew(found))
    return [frame.number for frame, now in judged if now.status != TrackStatus.TRACKING]


@pytest.mark.parametrize(("earlier", "first"), [((), 44), (range(2, 14, 2), 44), (range(2, 16, 2), 2)])
def test_a_track_is_ambiguous_from_the_first_mirrored_trunk_that_led_to_it(of_sides, earlier, first):
    """No second without mirrored trunks lies between."""
    plausible, rows = of_sides(np.pi / 2, swapped(), [*earlier, *range(44, 60)])
    assert ambiguous(plausible, rows) == list(range(first, 60))
    assert ambiguous(plausible, rows, smooth=True) == list(range(max(first - 30, 0), 60))
    assert ambiguous(plausible, rows[:59], smooth=True) == []


@pytest.mark.parametrize(("mirrored", "longest"), [(range(0), 0), (range(0, 60, 3), 32)])
def test_frames_wait_only_if_anything_indicates_it_and_for_two_seconds_at_most(of_sides, mirrored, longest):
    plausible, rows = of_sides(np.pi / 2, swapped(), mirrored)
    given = iter([(frame._replace(time=frame.number / 16), now) for frame, now in rows])
    waited = [59 - given.__length_hint__() - frame.number for frame, _ in plausible.known_later(given)]
    assert max(waited) == longest


@pytest.mark.parametrize(
    ("metres", "speed", "wanted"),
    [(-0.4, 1.2, range(23, 60)), (-0.4, 0.15, ()), (-0.25, 1.2, ()), (1.2, 1.2, ())],
)
def test_a_person_who_moves_against_the_strides_is_ambiguous(of_sides, metres, speed, wanted):
    """By more than 0.3 m in a second, unlike people on a treadmill; strides below 0.2 m do not count."""
    plausible, rows = of_sides(0.0, swapped(), range(0))
    found = [(frame, ahead_by(metres * frame.time, replace(now, speed=speed))) for frame, now in rows]
    judged = [plausible.judged(*row) for row in found]
    assert [n for n, now in enumerate(judged) if now.status != TrackStatus.TRACKING] == list(wanted)
    assert {judged[n].reason for n in wanted} <= {"the path leads against the direction of the strides"}
    later = ambiguous(plausible, found)
    assert later == (list(range(later[0], 60)) if wanted else []) and (not wanted or later[0] < 8)


def ahead_by(metres, estimate):
    """Move an estimate along its heading."""
    way = np.array([np.cos(estimate.mean.heading), np.sin(estimate.mean.heading), 0.0])
    return replace(estimate, mean=replace(estimate.mean, pelvis=estimate.mean.pelvis + metres * way))


def test_a_track_backwards_from_a_later_start_is_another_track(of_sides):
    """A person who is found again further back did not move there."""
    plausible, rows = of_sides(0.0, swapped(), range(0))
    again = [(frame, ahead_by(-2.0, replace(now, frame=now.frame - 60))) for frame, now in rows[30:]]
    assert {now.status for _, now in plausible.known_later(iter(rows[:30] + again))} == {TrackStatus.TRACKING}


def test_frames_that_wait_have_no_pictures():
    picture = Frame(3, 0.1, np.ones((4, 4, 3), np.uint8), plate=np.ones((4, 4, 3), np.uint8))
    [(frame, estimate)] = _without_pictures([(picture._replace(others=(picture, None)), "estimate")])
    assert (frame.number, frame.time, estimate) == (3, 0.1, "estimate")
    assert frame.image.size == frame.others[0].image.size == 0 and frame.others[1] is None
    assert frame.plate is frame.others[0].plate is None


@pytest.mark.parametrize(("start", "wanted"), [(20, range(24, 40)), (30, ())])
def test_what_was_before_a_start_does_not_count_after_it(of_sides, start, wanted):
    plausible, rows = of_sides(np.pi / 2, swapped(), range(24, 40))
    found = [(frame, replace(now, frame=frame.number - start)) for frame, now in rows[:40]]
    assert ambiguous(plausible, found) == list(wanted)


def test_a_single_frame_does_not_show_the_other_way_at_any_rate(of_sides):
    plausible, rows = of_sides(np.pi / 2, swapped(), [5])
    slow = [(Frame(frame.number, frame.number / 3, FRAMES[0]), now) for frame, now in rows]
    assert {plausible.judged(*row).status for row in slow} == {TrackStatus.TRACKING}


class Walks(Script):
    """A tracker of a steady walk, which records the phases of its starts; those of hypotheses are open."""

    def like(self, config):
        return Walks(self.estimate, self.leaves, self.starts)

    def start(self, mean, sd, utime):
        self.starts.append(mean.phase)

    def start_hypotheses(self, hypotheses, utime):
        self.starts.append(None)

    def step(self, image, utime, keypoints, poses, backgrounds, people):
        now = super().step(image, utime, keypoints, poses, backgrounds, people)
        mean = self.estimate.mean
        return replace(now, mean=replace(mean, phase=(0.1 + mean.stride_hz * utime / 1e6) % 1))


@pytest.mark.parametrize(
    ("phase", "change", "wanted"),
    [
        (0.12, {}, 0.12),
        (0.62, {}, 0.12),
        (0.36, {}, None),
        (0.12, {"heading": np.pi}, None),
        (0.12, {"motion_class": 1}, None),
        (0.12, {"stride_hz": 0.5}, 0.12),
    ],
)
def test_a_start_has_the_side_that_was_decided(estimate, phase, change, wanted):
    """If the hypothesis is of another walk, the track starts where the walk was decided, frame 6."""
    mean = replace(estimate.mean, **{"phase": phase, **change})
    one = Hypothesis(mean, estimate.sd, 1.2, 0.1, 1.0, 1.0, False, True, np.eye(6))
    people = PersonKeypoints(camera(), {1: {n: found() for n in range(20)}}, 1)
    starts = []
    follower = Follower(
        Walks(estimate, -1, starts),
        Film(),
        people,
        Plausibility(people, 1.75, 0.05, 0.0, FORWARDS, [camera()]),
        lambda *_: None,
    )
    rows = list(follower.follow(Start(0, mean, estimate.sd, hypotheses=(one,)), range(20)))
    assert len(rows) == 20 and starts[0] is None
    begin = 0.1 + 6 * estimate.mean.stride_hz / 30 if wanted is None else wanted
    assert starts[-1] == pytest.approx(begin, abs=1e-3)


class Pauses(Walks):
    """Walks that stand from frame 4 for as long as one and a half strides take."""

    def like(self, config):
        return Pauses(self.estimate, self.leaves, self.starts)

    def step(self, image, utime, keypoints, poses, backgrounds, people):
        number, pause = round(utime * 30 / 1e6), round(45 / self.estimate.mean.stride_hz)
        stood = min(max(number - 4, 0), pause) / 30
        now = super().step(image, round(utime - 1e6 * stood), keypoints, poses, backgrounds, people)
        return replace(now, speed=0.0 if 4 < number <= 4 + pause else 1.2)


class Returns(Walks):
    """Walks backwards: the phase falls."""

    def like(self, config):
        return Returns(self.estimate, self.leaves, self.starts)

    def step(self, image, utime, keypoints, poses, backgrounds, people):
        now = super().step(image, -utime, keypoints, poses, backgrounds, people)
        return replace(now, motion_class="back")


def test_the_side_of_a_walk_backwards_is_that_of_the_start(estimate):
    mean = replace(estimate.mean, phase=0.62)
    one = Hypothesis(mean, estimate.sd, 1.2, 0.1, 1.0, 1.0, False, True, np.eye(6))
    people = PersonKeypoints(camera(), {1: {n: found() for n in range(20)}}, 1)
    starts = []
    plausible = Plausibility(people, 1.75, 0.05, 0.0, FORWARDS | {"back": -1}, [camera()])
    follower = Follower(Returns(estimate, -1, starts), Film(), people, plausible, lambda *_: None)
    list(follower.follow(Start(0, mean, estimate.sd, hypotheses=(one,)), range(20)))
    assert starts == [None, pytest.approx(0.12)]


def test_a_side_decided_after_a_stand_is_that_of_the_start(estimate):
    mean = replace(estimate.mean, phase=0.12)
    one = Hypothesis(mean, estimate.sd, 1.2, 0.1, 1.0, 1.0, False, True, np.eye(6))
    people = PersonKeypoints(camera(), {1: {n: found() for n in range(90)}}, 1)
    starts = []
    plausible = Plausibility(people, 1.75, 0.05, 0.0, FORWARDS, [camera()])
    follower = Follower(Pauses(estimate, -1, starts), Film(), people, plausible, lambda *_: None)
    list(follower.follow(Start(0, mean, estimate.sd, hypotheses=(one,)), range(90)))
    assert starts == [None, pytest.approx(0.12)]


@pytest.mark.parametrize(
    "spike, grown, heading, motion_class, status",
    [
        (0.0, 0.0, 0.0, "walk", "TRACKING"),
        (1.0, 0.0, 0.0, "walk", "AMBIGUOUS"),
        (0.0, 0.5, 0.0, "walk", "AMBIGUOUS"),
        (0.0, 0.0, np.pi, "walk", "AMBIGUOUS"),
        (0.0, 0.0, np.pi, "back", "TRACKING"),
    ],
)
def test_without_keypoints_a_walk_must_be_plausible(estimate, spike, grown, heading, motion_class, status):
    plausible = Plausibility(
        PersonKeypoints(camera(), {}, -1), 1.75, 0.05, 0.0, FORWARDS | {"back": -1}, [camera()]
    )
    for i in range(40):
        mean = replace(TRUE[-1], stature=1.75 + grown, heading=heading)
        mean.pelvis = np.array([1.2 * i / 30 + spike * (i > 20), 0.0, 0.95])
        walking = replace(estimate, mean=mean, speed=1.2, motion_class=motion_class)
        now = plausible.judged(Frame(i, i / 30, FRAMES[0]), walking)
    assert now.status == TrackStatus[status]


@pytest.mark.parametrize(
    "view, first, expected, status",
    [
        (camera(), [], False, "TRACKING"),  # from the side
        (camera((-6.0, 1.0, 1.4)), [], False, "AMBIGUOUS"),
        (camera((-6.0, 1.0, 1.4)), [], True, "TRACKING"),
        (camera((-6.0, 1.0, 1.4)), ["walk"] * 10, False, "AMBIGUOUS"),
        (camera((-6.0, 1.0, 1.4)), ["walk"] * 20, False, "TRACKING"),
        (camera((-6.0, 1.0, 1.4)), ["stand"] * 20, False, "AMBIGUOUS"),
    ],
)
def test_who_walks_backwards_before_the_camera_must_have_shown_the_direction(
    estimate, view, first, expected, status
):
    """The person goes along x, facing the other way but for the first frames."""
    directions = {"walk": 1, "back": -1, "stand": 0}
    people = PersonKeypoints(view, {}, -1)
    plausible = Plausibility(people, 1.75, 0.05, 0.0, directions, [view], backwards=expected)
    place, found = 0.0, []
    for i, motion_class in enumerate([*first, *["back"] * 40]):
        speed = 0.0 if motion_class == "stand" else 1.2
        place += (-speed if motion_class == "walk" else speed) / 30
        mean = replace(TRUE[-1], heading=np.pi, pelvis=np.array([place, 0.0, 0.95]))
        moving = replace(estimate, frame=i, mean=mean, speed=speed, motion_class=motion_class)
        found.append((Frame(i, i / 30, FRAMES[0]), moving))
    judged = [now.status for _, now in plausible.judged_later(found)]
    assert set(judged[-30:]) == {TrackStatus[status]}


@pytest.mark.parametrize(
    "speed, off, status",
    [(1.2, 0.07, "TRACKING"), (0.0, 0.03, "TRACKING"), (0.0, 0.07, "AMBIGUOUS")],
)
def test_the_legs_of_a_person_who_stands_must_be_where_they_stand(estimate, speed, off, status):
    """The detector shows one leg elsewhere, by a share of the person's height."""
    standing = replace(estimate, speed=speed)
    names = tuple(estimate.joint_names)
    uv = camera().project(estimate.joints)
    height = np.ptp(uv[:, 1])
    uv[[names.index("r_knee"), names.index("r_ankle")], 0] += off * height
    keypoints = FrameKeypoints(names, uv, np.ones(len(names)))
    people = PersonKeypoints(camera(), {1: {0: keypoints}}, 1)
    plausible = Plausibility(people, 1.75, 0.05, 0.0, FORWARDS, [camera()])
    assert plausible.judged(Frame(0, 0.0, FRAMES[0]), standing).status == TrackStatus[status]
