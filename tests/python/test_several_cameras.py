"""Several cameras that film one walk: the films are synchronised, and the place becomes certain."""

import json
import threading
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from gait import Camera, Video, VideoWriter
from gait.body.skeleton import axis_rotation
from gait.camera.camera import read_camera, write_camera
from gait.camera.silhouette_offset import Filmed, silhouette_offset
from gait.camera.synchronise import Film, find_offset, synchronise
from gait.cli import main
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import read_estimates, read_truth
from gait.io.video import Frame
from gait.simulate.clip import simulate
from gait.simulate.scenario import PRESETS
from gait.simulate.stage import set_stage
from gait.track import clip, clip_keypoints, read_scene
from gait.track.clip import ClipOptions
from gait.track.further_cameras import SeveralVideos, with_further_cameras
from gait.track.person_keypoints import PersonKeypoints

FRAMES, FPS = 30, 30.0
SCENARIO = replace(PRESETS["toward"], frames=FRAMES, size=(160, 120), cameras=2)
JOINTS = (
    "l_shoulder",
    "r_shoulder",
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
    "l_wrist",
    "r_wrist",
    "l_elbow",
    "r_elbow",
)


@pytest.fixture(scope="module")
def stage():
    return set_stage(replace(SCENARIO, view="oblique", frames=90, size=(640, 480)))


def keypoints(stage, camera, frames, rate=1, noise=0.7, stands=False):
    """Joints of a simulated walk in some frames, timed from the first of them."""
    index = stage.frames[list(frames)[:: int(rate)]]
    index = np.full_like(index, index[0]) if stands else index
    points = stage.walk.points(index)
    uv = np.stack([camera.project(points[name]) for name in JOINTS], axis=1)
    uv = uv + noise * np.random.default_rng(int(camera.fx)).standard_normal(uv.shape)
    number = np.arange(len(index))
    return Keypoints(number, rate * number / FPS, JOINTS, uv, np.ones(uv.shape[:2]))


def test_a_film_that_began_later_is_brought_to_the_time_of_the_first(stage):
    first, second = stage.camera, stage.beside[0]
    ours = keypoints(stage, first, range(90))
    for begin, rate in ((0, 1), (7, 1), (25, 2)):
        theirs = keypoints(stage, second, range(begin, 90), rate)
        found = find_offset(ours, first, theirs, second)
        assert found.certain
        assert found.seconds == pytest.approx(begin / FPS, abs=0.012)
        back = find_offset(theirs, second, ours, first)
        assert back.seconds == pytest.approx(-begin / FPS, abs=0.012)


def test_a_person_who_stands_does_not_give_the_time(stage):
    first, second = stage.camera, stage.beside[0]
    ours, theirs = (keypoints(stage, camera, range(60), stands=True) for camera in (first, second))
    assert not find_offset(ours, first, theirs, second).certain
    assert find_offset(ours, first, theirs, second, given=0.2).seconds == 0.2


@pytest.mark.parametrize(("shown", "begin", "end"), [(20, 0, 90), (20, 0, 20), (40, 15, 90), (40, 60, 90)])
def test_films_that_share_less_than_a_second_do_not_give_the_time(stage, shown, begin, end):
    first, second = stage.camera, stage.beside[0]
    ours, theirs = keypoints(stage, first, range(shown)), keypoints(stage, second, range(begin, end))
    found = find_offset(ours, first, theirs, second)
    assert not found.certain
    films = [Film("film", first, {0: ours}, 0), Film("other", second, {0: theirs}, 0)]
    with pytest.raises(UserError, match="which both must show for over 1 s; give --offsets"):
        synchronise(films[:1], films[1], None)


@pytest.mark.parametrize("noise", [2, 4])
def test_noise_does_not_separate_films_that_began_together(stage, noise):
    first, second = stage.camera, stage.beside[0]
    ours, theirs = (keypoints(stage, camera, range(90), noise=noise) for camera in (first, second))
    films = [Film("film", first, {0: ours}, 0), Film("other", second, {0: theirs}, 0)]
    _, found, words = synchronise(films[:1], films[1], None)
    assert found.seconds == 0 and "began together" in words
    assert f"estimated from the person's motion to {found.margin:.2f} s" in words
    late = keypoints(stage, second, range(7, 90), noise=noise)
    found = find_offset(ours, first, late, second)
    assert abs(found.seconds - 7 / FPS) <= found.margin <= 0.15


def test_the_offset_is_from_more_frames_than_are_tracked(stage, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    cameras = {"a.mp4": stage.camera, "b.mp4": stage.beside[0]}
    for film, camera in cameras.items():
        write_camera(tmp_path / f"{film}.json", camera)
        with VideoWriter(film, FPS) as writer:
            for _ in range(90):
                writer.write(np.full((480, 640, 3), 90, np.uint8))

    def detected(options, video, frames, empty):
        found = keypoints(stage, cameras[str(options.video)], range(90))
        return {4: found.part(slice(frames.start, frames.stop))}, 4

    monkeypatch.setattr(clip_keypoints, "_detect", detected)
    monkeypatch.setattr(read_scene, "require_detector", lambda options: None)
    monkeypatch.setattr(read_scene, "detects", lambda options: True)
    options = ClipOptions("a.mp4", "a.mp4.json", "t.csv", background="none", stabilize="off", quiet=True)
    options = replace(options, further=(("b.mp4", "b.mp4.json"),))
    for start, stop in ((0, 20), (75, 90)):
        few = replace(options, start=start, stop=stop)
        alone = read_scene.read_scene(few)
        assert alone.people[4].frame.tolist() == list(range(start, stop))
        assert with_further_cameras(few, alone).began[0].startswith("began together with the first film")
        given = read_scene.read_scene(replace(few, offsets=(0.0,)))
        assert len(given.longer[4].frame) == stop - start  # more would take time for nothing


class _Drawing(Video):
    """Frames without a file, of a body made of spheres."""

    def __init__(self, stage, camera, frames, bottom=480):
        points = stage.walk.points(stage.frames[list(frames)])
        self.places = np.stack([points[name] for name in (*JOINTS, "neck", "head_top")], axis=1)
        self.camera, self.bottom = camera, bottom
        noise = np.random.default_rng(int(camera.fx))
        self.wall = noise.integers(90, 130, (480, 640, 1), np.uint8).repeat(3, axis=2)

    def frames(self, start=0, stop=None, *, grey=False):
        for number in range(len(self.places))[start:stop]:
            image = self.wall.copy()
            pixels, depth = self.camera.project(self.places[number]), self.camera.depth(self.places[number])
            for (u, v), away in zip(pixels, depth, strict=True):
                middle = int(round(16 * u)), int(round(16 * v))
                cv2.circle(image, middle, int(16 * 0.07 * self.camera.fx / away), (20, 20, 20), -1, shift=4)
            for (u, v), (x, y) in zip(pixels[:-1], pixels[1:], strict=True):
                cv2.line(image, (int(u), int(v)), (int(x), int(y)), (20, 20, 20), 5)
            image[self.bottom :] = self.wall[self.bottom :]
            yield Frame(number, number / FPS, image)

    def pick(self, wanted, progress=None):
        return (frame for frame in self.frames() if frame.number in wanted)


def _filmed(stage, camera, frames, **options):
    return Filmed(_Drawing(stage, camera, frames, **options), camera, keypoints(stage, camera, frames))


def test_silhouettes_show_the_offset_more_exactly_than_joints(stage):
    first, other = _filmed(stage, stage.camera, range(90)), _filmed(stage, stage.beside[0], range(11, 90))
    late = 11 / FPS
    assert silhouette_offset(first, other, late + 0.03) == pytest.approx(late, abs=0.003)
    assert silhouette_offset(other, first, -late - 0.04) == pytest.approx(-late, abs=0.003)
    assert silhouette_offset(first, other, late + 0.25) is None  # too far away for the search
    films = [Film("film", one.camera, {0: one.keypoints}, 0, one.video) for one in (first, other)]
    _, offset, words = synchronise(films[:1], films[1], None)
    assert offset.seconds == pytest.approx(late, abs=0.003)
    assert "s after the first film, estimated from the person's silhouette" in words
    _, offset, words = synchronise(films[:1], replace(films[1], video=None), None)
    assert offset.source == "motion" and "estimated from the person's motion" in words


def test_silhouettes_that_do_not_show_the_offset_are_not_used(stage):
    first = _filmed(stage, stage.camera, range(90))
    standing = _filmed(stage, stage.beside[0], [40] * 60)
    assert silhouette_offset(first, standing, 0.4) is None
    away = _filmed(stage, stage.beside[0], range(11, 90), bottom=0)
    assert silhouette_offset(first, away, 11 / FPS) is None


class _Film(Video):
    """Frames without a file."""

    def __init__(self, times):
        self.path, self.fps, self.count, self.times = None, 1 / np.diff(times).mean(), len(times), times
        self.width = self.height = 2
        self.digest = ""

    def frames(self, start=0, stop=None, *, grey=False):
        for number, time in list(enumerate(self.times))[start:stop]:
            yield Frame(number, float(time), np.full((2, 2, 3), number, np.uint8))


def test_each_frame_has_the_nearest_of_the_other_film_and_none_is_used_twice():
    slow, fast = _Film(np.arange(20) / 25), _Film(np.arange(40) / 60)
    offset = 0.2
    for one, other, began in ((slow, fast, offset), (fast, slow, -offset)):
        several = SeveralVideos(one, [other], [began])
        forwards = list(several.frames(3, 18))
        assert [frame.number for frame in forwards] == list(range(3, 18))
        pairs = [(frame, frame.others[0]) for frame in forwards if frame.others[0] is not None]
        assert len(pairs) >= 6
        assert len({view.number for _, view in pairs}) == len(pairs)
        for frame, view in pairs:
            apart = np.abs(other.times + began - frame.time)
            assert view.number == apart.argmin() and apart.min() <= 0.5 / 25
        back = [
            (frame.number, frame.others[0] and frame.others[0].number) for frame in several.backwards(18, 3)
        ]
        assert back[::-1] == [(f.number, f.others[0] and f.others[0].number) for f in forwards]
    for never in (100.0, -100.0):
        with pytest.raises(UserError, match="no frame is at the time of one of .*correct --offsets"):
            SeveralVideos(slow, [fast], [never])
    early = list(SeveralVideos(slow, [fast], [0.5]).frames(0, 5))
    assert all(frame.others == (None,) for frame in early)  # the other film had not begun


@pytest.mark.parametrize(
    ("film", "offset", "words"),
    [
        ("one.mp4", "0", "one.mp4: has one frame"),
        ("late.mp4", "100", "late.mp4: no frame is at the time of one of"),
    ],
)
def test_a_film_that_shows_nothing_of_the_walk_is_refused_before_long_work(
    film, offset, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(clip, "read_scene", lambda _: pytest.fail("began long work"))
    for name, count in ("v.mp4", 4), ("late.mp4", 4), ("one.mp4", 1):
        with VideoWriter(name, FPS) as writer:
            for _ in range(count):
                writer.write(np.zeros((240, 320, 3), np.uint8))
    for number, place in enumerate(((0.0, -6.0, 1.4), (4.0, -4.0, 1.4))):
        write_camera(tmp_path / f"{number}.json", Camera.looking(place, (0.0, 0.0, 0.9), (320, 240), 330.0))
    words_given = ["track", "v.mp4", film, "--camera", "0.json", "--camera", "1.json", "--offsets", offset]
    assert main([*words_given, "-o", "t.csv"]) == 1
    assert words in capsys.readouterr().err


def test_most_cameras_decide_whether_keypoints_are_near():
    camera, frame = SimpleNamespace(), Frame(0, 0.0, np.zeros((2, 2), np.uint8))
    frame = frame._replace(others=(frame, None, frame))

    class Answers(PersonKeypoints):
        def __init__(self, answer, further=()):
            super().__init__(camera, {}, 0, further=further)
            self.answer = answer

        def _near(self, frame, estimate):
            return self.answer

        _agree = _faces = _near

    for answers, wanted in (
        ((None, None, None), None),
        ((False, True, True), True),
        ((False, None, True), True),
        ((False, None, False), False),
        ((None, None, False), False),
    ):
        first, second, third = answers
        one = Answers(
            first, [Answers(second), Answers(True), Answers(third)]
        )  # the third camera has no frame
        assert one.near(frame, None) is one.agree(frame, None) is one.faces(frame, None) is wanted


@pytest.mark.long
def test_a_second_camera_shows_how_far_the_person_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    simulate(SCENARIO, ".")
    start = json.loads((tmp_path / "init.json").read_text())
    start["pelvis"][1] += 0.3  # nearer to the camera than the person is
    start["sd"]["pelvis"] = 0.4
    (tmp_path / "init.json").write_text(json.dumps(start))
    words = ["--init", "init.json", "--particles", "300", "--detector", "none", "--seed", "3"]
    cameras = ["--camera", "camera.json", "--camera", "camera_2.json"]
    assert (
        main(
            [
                "track",
                "video.mp4",
                "video_2.mp4",
                *cameras,
                "--offsets",
                "0",
                *words,
                "-o",
                "two.csv",
                "--overlay",
                "o.mp4",
                "--json",
            ]
        )
        == 0
    )
    printed = json.loads(capsys.readouterr().out)
    assert printed["used"]["further film video_2.mp4"].startswith("camera camera_2.json, began together")
    assert printed["offsets_s"] == [0]
    assert Video("o.mp4").size == (320, 120)
    assert main(["track", "video.mp4", *cameras[:2], *words, "-o", "one.csv"]) == 0
    truth = read_truth("truth.csv").eval15()
    errors = {}
    for name in ("one", "two"):
        track = read_estimates(f"{name}.csv")
        errors[name] = np.median(np.linalg.norm(track.eval15() - truth[track.frame], axis=2).mean(axis=1))
    assert errors["two"] < 0.6 * errors["one"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--camera", "a.json"], "--camera: 1 for 2 films"),
        (["--camera", "a.json", "--camera", "b.json", "--offsets", "0,1"], "--offsets: 2 for 1 further"),
        (["--camera", "a.json", "--camera", "b.json", "--people", "all"], "--people: is for one film"),
        (
            ["--camera", "a.json", "--camera", "b.json", "--smooth", "--draws", "d.npz"],
            "--draws: is for one film",
        ),
        (["--camera", "three.toml"], "--camera: 3 for 2 films"),
        (["--camera", "three.toml", "--offsets", "soon"], "'soon' is not a list of seconds"),
        (["--camera", "three.toml", "--offsets", "1e308"], "1e308: give seconds from -86400 to 86400"),
        (["--camera", "three.toml", "--offsets", "nan"], "nan: give seconds from -86400 to 86400"),
    ],
)
def test_films_cameras_and_offsets_must_match(words, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    table = "matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]\n"
    (tmp_path / "three.toml").write_text("".join(f"[c{k}]\n{table}" for k in range(3)))
    try:
        code = main(["track", "v.mp4", "w.mp4", *words, "-o", "t.csv"])
    except SystemExit as exc:  # of argparse
        code = exc.code
    assert code == 2
    assert message in capsys.readouterr().err


def test_without_joints_the_offset_must_be_given(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    simulate(replace(SCENARIO, frames=8), ".")
    words = ["track", "video.mp4", "video_2.mp4", "--camera", "camera.json", "--camera", "camera_2.json"]
    assert main([*words, "--init", "init.json", "--detector", "none", "-o", "t.csv"]) == 1
    assert "give --offsets" in capsys.readouterr().err
    assert not (tmp_path / "t.csv").exists()


@pytest.mark.parametrize("command", ["track", "lift"])
def test_one_film_has_one_camera_and_is_given_once(command, tmp_path, monkeypatch, capsys):
    """A file of the same name in another folder is another film."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    cameras = ["--camera", "a.json", "--camera", "b.json"]
    assert main([command, "a.csv", *cameras, "-o", "t.csv"]) == 2
    assert "--camera: 2 for one film; give one, or further films" in capsys.readouterr().err
    assert main([command, "a.csv", "sub/../a.csv", *cameras, "-o", "t.csv"]) == 2
    assert "sub/../a.csv: is given twice; give each film once" in capsys.readouterr().err
    assert main([command, "a.csv", "sub/a.csv", *cameras, "-o", "t.csv"]) == 1
    assert "twice" not in capsys.readouterr().err


def test_cameras_at_one_place_are_refused_before_long_work(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(clip, "read_scene", None)
    simulate(replace(SCENARIO, frames=8), ".")
    words = ["track", "video.mp4", "video_2.mp4", "--camera", "camera.json", "--camera", "camera.json"]
    assert main([*words, "--init", "init.json", "--detector", "none", "-o", "t.csv"]) == 1
    assert "video_2.mp4: its camera is at the same place as that of video.mp4" in capsys.readouterr().err


def test_only_the_first_film_has_to_show_the_start(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    simulate(replace(SCENARIO, frames=6), ".")
    away = json.loads((tmp_path / "camera_2.json").read_text())
    turned = axis_rotation(1, 0.7)  # aside, so that the person is out of the picture
    away["R"], away["t"] = (turned @ away["R"]).tolist(), (turned @ away["t"]).tolist()
    (tmp_path / "away.json").write_text(json.dumps(away))
    words = ["track", "video.mp4", "video_2.mp4", "--camera", "camera.json", "--camera", "away.json"]
    words += ["--offsets", "0", "--init", "init.json", "--detector", "none", "--background", "none"]
    assert main([*words, "--particles", "100", "-o", "t.csv"]) == 0, capsys.readouterr().err
    alone = ["track", "video_2.mp4", "--camera", "away.json", *words[words.index("--init") :], "-o", "u.csv"]
    assert main(alone) == 1
    assert "the start is outside the picture" in capsys.readouterr().err


def test_one_thread_chooses_keypoints(tmp_path, monkeypatch):
    """Choices are remembered, so the results of two threads would depend on their order."""
    monkeypatch.chdir(tmp_path)
    simulate(replace(SCENARIO, frames=6), ".")
    choose, threads = PersonKeypoints.choose, []

    def noted(self, frame, last):
        threads.append(threading.get_ident())
        return choose(self, frame, last)

    monkeypatch.setattr(PersonKeypoints, "choose", noted)
    words = ["track", "video.mp4", "video_2.mp4", "--camera", "camera.json", "--camera", "camera_2.json"]
    words += ["--offsets", "0", "--init", "init.json", "--mode", "paper", "--particles", "100"]
    assert main([*words, "-o", "t.csv"]) == 0
    assert len(set(threads)) == 1


@pytest.mark.long
@pytest.mark.parametrize("smooth", [[], ["--smooth"]])
def test_joints_are_measured_as_well_before_a_film_ends(smooth, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulate(SCENARIO, ".")
    names = (*JOINTS, "l_shoulder", "r_shoulder")
    truth, half = read_truth("truth.csv"), FRAMES // 2
    with VideoWriter("short.mp4", FPS) as writer:
        for frame in Video("video_2.mp4").frames(0, half):
            writer.write(frame.image)

    def detected(options, video, frames, empty):
        camera, random = read_camera(options.camera), np.random.default_rng(1)
        uv = np.stack([camera.project(truth.places[name][list(frames)]) for name in names], axis=1)
        uv = uv + 0.3 * random.standard_normal(uv.shape)
        ones = np.ones(uv.shape[:2])
        return {0: Keypoints(np.array(frames), np.array(frames) / FPS, names, uv, ones)}, 0

    monkeypatch.setattr(clip_keypoints, "_detect", detected)
    monkeypatch.setattr(read_scene, "require_detector", lambda options: None)
    monkeypatch.setattr(read_scene, "detects", lambda options: True)
    errors = {}
    for film in ("video_2.mp4", "short.mp4"):
        words = ["track", "video.mp4", film, "--camera", "camera.json", "--camera", "camera_2.json", *smooth]
        words += ["--offsets", "0", "--init", "init.json", "--particles", "300", "-o", "t.csv"]
        assert main(words) == 0
        track = read_estimates("t.csv")
        off = [track.places[name] - truth.places[name][track.frame] for name in names]
        errors[film] = np.linalg.norm(off, axis=2).mean(axis=0)
    last = slice(half - 6, half)  # 0.2 s, whose surroundings have frames of one camera
    # The smoother has frames of one camera after them; without the second film errors are twice as large.
    assert errors["short.mp4"][last].mean() < 1.25 * errors["video_2.mp4"][last].mean()
