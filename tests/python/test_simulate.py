"""The simulator: equal seeds give equal pictures, and the truth is exact and physically plausible."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from gait.bindings.model import read_blob
from gait.body.skeleton import points
from gait.camera.camera import Camera
from gait.cli import main
from gait.errors import UserError
from gait.io import blob
from gait.io.video import Video
from gait.simulate import aids
from gait.simulate.body import BONE_INDEX, PARENT_BONES, POINT_BONE, POINTS, Mesh, draw_anatomy
from gait.simulate.clip import CLIP_FILES, background, files, find_events, pictures, planned_events, simulate
from gait.simulate.curves import CURVE_NAMES, fourier, normative
from gait.simulate.render import Renderer, light, rasterise
from gait.simulate.scenario import PRESETS, VIEWS, Scenario
from gait.simulate.stage import Stage, build_set, set_stage

TINY = Scenario(frames=5, size=(160, 120), seed=3)
SEGMENTS = {
    "l_thigh": ("l_hip", "l_knee"), "l_shank": ("l_knee", "l_ankle"), "r_thigh": ("r_hip", "r_knee"),
    "r_shank": ("r_knee", "r_ankle"), "l_upper_arm": ("l_shoulder", "l_elbow"),
    "l_forearm": ("l_elbow", "l_wrist"), "r_upper_arm": ("r_shoulder", "r_elbow"),
    "r_forearm": ("r_elbow", "r_wrist"), "hips": ("l_hip", "r_hip"),
    "shoulders": ("l_shoulder", "r_shoulder"), "l_foot": ("l_ankle", "l_toe"),
    "r_heel": ("r_ankle", "r_heel"), "head": ("neck", "head_top"),
}  # fmt: skip


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a written clip of 50 small frames."""
    folder = tmp_path_factory.mktemp("clip") / "new" / "side"
    simulate(Scenario(frames=50, size=(240, 180), seed=5), folder)
    return folder


def read_truth(folder: Path) -> dict[str, np.ndarray]:
    """Return the columns of truth.csv."""
    with (folder / "truth.csv").open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def place(truth: dict[str, np.ndarray], joint: str) -> np.ndarray:
    """Return the positions (n, 3) of one joint."""
    return np.column_stack([truth[f"{joint}_{axis}"] for axis in "xyz"])


def all_pictures(scenario: Scenario) -> list[np.ndarray]:
    """Return every frame of a clip."""
    stage = set_stage(scenario)
    return list(pictures(stage, build_set(stage)))


def test_same_seed_gives_the_same_bytes_and_another_seed_does_not() -> None:
    first, again = all_pictures(TINY), all_pictures(TINY)
    assert [p.tobytes() for p in first] == [p.tobytes() for p in again]
    other = all_pictures(replace(TINY, seed=4, frames=2))
    assert other[0].tobytes() != first[0].tobytes()


def test_a_frame_does_not_depend_on_the_frames_before_it() -> None:
    stage = set_stage(replace(TINY, frames=3))
    made = build_set(stage)
    forward = list(pictures(stage, made))
    again = list(pictures(stage, made))
    assert forward[2].tobytes() == again[2].tobytes()


@pytest.mark.long
def test_a_folder_holds_every_file(clip: Path) -> None:
    assert sorted(p.name for p in clip.iterdir()) == sorted(CLIP_FILES)
    video = Video(clip / "video.mp4")
    assert (video.size, video.count, video.fps) == ((240, 180), 50, 30)
    assert Camera.read(str(clip / "camera.json"), video.size).size == (240, 180)
    assert cv2.imread(str(clip / "background.png")).shape == (180, 240, 3)
    assert cv2.imread(str(clip / "contact.jpg")) is not None
    assert read_truth(clip)["frame"].tolist() == list(range(50))


def test_pixels_are_the_cameras_view_of_the_joints(clip: Path) -> None:
    truth, camera = read_truth(clip), Camera.read(str(clip / "camera.json"))
    for joint in POINTS:
        uv = camera.project(place(truth, joint))
        stated = np.column_stack([truth[f"{joint}_u"], truth[f"{joint}_v"]])
        np.testing.assert_allclose(uv, stated, atol=2e-3)
        assert ((stated > 0) & (stated < [240, 180])).all(), joint


def test_bones_keep_their_length(clip: Path) -> None:
    truth = read_truth(clip)
    meta = json.loads((clip / "meta.json").read_text())
    for name, (a, b) in SEGMENTS.items():
        length = np.linalg.norm(place(truth, a) - place(truth, b), axis=1)
        assert np.ptp(length) < 1e-5, name
        own = name.removeprefix("l_").removeprefix("r_")
        if own in meta["limb_lengths_m"]:
            assert length[0] == pytest.approx(meta["limb_lengths_m"][own], abs=1e-4)


def test_speed_and_heading_are_those_of_the_pelvis(clip: Path) -> None:
    truth = read_truth(clip)
    step = np.gradient(place(truth, "pelvis")[:, :2], 1 / 30, axis=0)[1:-1]
    h = truth["heading_rad"][1:-1]
    along = step[:, 0] * np.cos(h) + step[:, 1] * np.sin(h)
    np.testing.assert_allclose(along, truth["speed_m_s"][1:-1], atol=0.02)


def test_the_start_is_near_the_truth_by_its_own_sd(clip: Path) -> None:
    init, truth = json.loads((clip / "init.json").read_text()), read_truth(clip)
    meta = json.loads((clip / "meta.json").read_text())
    error = {
        "pelvis": np.abs(np.array(init["pelvis"]) - place(truth, "pelvis")[0]).max(),
        "heading_rad": abs(init["heading_rad"] - truth["heading_rad"][0]),
        "phase": abs((init["phase"] - truth["phase"][0] + 0.5) % 1 - 0.5),
        "stride_hz": abs(init["stride_hz"] - 1 / meta["stride_period_s"]),
        "stature_m": abs(init["stature_m"] - meta["stature_m"]),
    }
    assert set(init["sd"]) == set(error)
    for key, value in error.items():
        assert 1e-6 < value < 4.5 * init["sd"][key], key


@pytest.mark.parametrize("seed", range(6))
def test_the_gait_is_plausible(seed: int) -> None:
    stage = set_stage(Scenario(seed=seed, frames=90, view=VIEWS[seed]))
    walk, body = stage.walk, stage.body
    points, step = walk.points(), walk.timing.step
    inside = slice(stage.frames[0], stage.frames[-1] + 1)
    for side in "lr":
        phase = walk.timing.of_side(side) % 1
        on_ball = (phase > 0.12) & (phase < 0.45)
        speed = np.linalg.norm(np.gradient(points[f"{side}_toe"], step, axis=0), axis=1)
        assert speed[inside][on_ball[inside]].max() < 0.15
        clearance = np.minimum(
            points[f"{side}_heel"][:, 2] - body["heel_up"], points[f"{side}_toe"][:, 2] - body["ball_up"]
        )
        assert clearance[inside].min() > -0.008
        stance = phase < 0.6
        assert clearance[inside][stance[inside]].max() < 0.035
    bob = np.ptp(points["pelvis"][inside, 2])
    assert 0.01 < bob < 0.09
    highest = points["head_top"][inside, 2].max()
    assert 0.94 * body.stature < highest < 1.005 * body.stature


@pytest.mark.parametrize("seed", [0, 7])
def test_heel_strikes_agree_with_the_truth(seed: int) -> None:
    stage = set_stage(Scenario(seed=seed, frames=120, fps=30))
    events, walk = find_events(stage), stage.walk
    points = walk.points(stage.frames)
    for side in "lr":
        ahead = ((points[f"{side}_heel"] - points["pelvis"])[:, :2]) @ [
            np.cos(walk.heading[stage.frames[0]]),
            np.sin(walk.heading[stage.frames[0]]),
        ]
        shown = [i for i in range(2, 118) if ahead[i] == ahead[i - 2 : i + 3].max() and ahead[i] > 0.1]
        stated = [t for t in events[f"{side}_heel_strike"] if 2 < t < 117]
        assert len(shown) >= 3
        assert np.abs(np.array(shown) - np.array(stated)).max() <= 0.6
    strikes = events["r_heel_strike"] / 30
    planned = np.interp(strikes, walk.timing.time, walk.timing.phase)
    assert np.abs((planned + 0.5) % 1 - 0.5).max() < 0.03
    assert 0.003 < np.diff(strikes).std() / np.diff(strikes).mean() < 0.06


def test_speed_and_cadence_are_obeyed() -> None:
    walk = set_stage(Scenario(speed=0.9, stride_hz=0.8, frames=60)).walk
    assert walk.speed.mean() == pytest.approx(0.9, abs=0.01)
    assert np.gradient(walk.timing.phase, walk.timing.step).mean() == pytest.approx(0.8, rel=0.03)


def test_a_leg_that_is_spared_stands_shorter_and_strikes_later_and_further_ahead() -> None:
    even, left, right = (set_stage(Scenario(seed=3, asymmetry=a, frames=120)) for a in (0.0, 20.0, -20.0))
    assert {left.walk.timing.stride_hz, right.walk.timing.stride_hz} == {even.walk.timing.stride_hz}
    uneven = []
    for stage in (left, even, right):
        events, contacts = find_events(stage), planned_events(stage)
        stance, step = {}, {}
        places = stage.walk.points()
        at = {
            s: stage.frames[0] + stage.walk.timing.per_frame * contacts[f"{s}_heel_strike"][2:4] for s in "lr"
        }
        for s in "lr":
            begun = contacts[f"{s}_heel_strike"]
            stance[s] = np.mean(
                [contacts[f"{s}_toe_off"][contacts[f"{s}_toe_off"] > t][0] - t for t in begun[:3]]
            )
            index = np.rint(at[s]).astype(int)
            ahead = (places[f"{s}_ankle"] - places["pelvis"])[index, :2]
            step[s] = np.linalg.norm(ahead, axis=1).mean()
        assert all(len(events[name]) >= 3 for name in events)
        uneven.append((stance["r"] - stance["l"], step["l"] - step["r"]))
    assert uneven[0][0] > 1 > uneven[1][0] > -1 > uneven[2][0]  # frames
    assert uneven[0][1] > uneven[1][1] + 0.02 and uneven[2][1] < uneven[1][1] - 0.02  # metres


def test_a_stick_is_rigid_and_stands_still_beside_the_other_foot() -> None:
    stage = set_stage(Scenario(seed=3, asymmetry=10.0, aid="stick", frames=90))
    walk, bone = stage.walk, BONE_INDEX["r_aid"]
    turns = walk.turns[stage.frames][:, bone]
    np.testing.assert_allclose(np.linalg.det(turns), 1.0, atol=1e-9)
    tip = walk.origins[stage.frames][:, bone] - aids.length(stage.body) * turns[:, :, 2]
    stands = (walk.timing.of_side("l")[stage.frames] % 1 > 0.1) & (
        walk.timing.of_side("l")[stage.frames] % 1 < 0.45
    )
    step = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    assert step[stands[1:] & stands[:-1]].max() < 0.02 < step.max() / 2
    assert np.abs(tip[stands, 2]).max() < 0.1
    assert not walk.turns[:, BONE_INDEX["l_aid"]].any()


def test_drawn_bodies_have_the_proportions_of_the_model() -> None:
    model = blob.decode(read_blob(None))
    drawn = [draw_anatomy(1.7, np.random.default_rng(seed), model) for seed in range(40)]
    for body in drawn:
        upright = ("ankle_height", "shank", "thigh", "hip_drop", "neck_up", "head_up")
        assert sum(body[key] for key in upright) == pytest.approx(1.7)
    mean = dict(zip(blob.unpack_names(model["PTNM"]), points(model, np.zeros((1, 30)))[0], strict=True))
    for limb, (a, b, c) in {"leg": ("hip", "knee", "ankle"), "arm": ("shoulder", "elbow", "wrist")}.items():
        ends = [mean[f"l_{name}"] for name in (a, b, c)]
        meant = np.linalg.norm(ends[0] - ends[1]) / np.linalg.norm(ends[1] - ends[2])
        first, second = {"leg": ("thigh", "shank"), "arm": ("upper_arm", "forearm")}[limb]
        ratios = np.array([body[first] / body[second] for body in drawn])
        assert ratios.mean() == pytest.approx(meant, abs=0.04), limb
        assert ratios.std() > 0.02


def picture_span(stage: Stage, mesh: Mesh, frame: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounding box of the figure's surface in pixels."""
    index = stage.frames[frame]
    vertices, _ = mesh.pose(stage.walk.origins[index], stage.walk.turns[index])
    uv = stage.camera.project(vertices + stage.walk.origins[index, 0])
    return uv.min(0), uv.max(0)


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_shows_the_whole_person_in_front_of_the_scene(view: str) -> None:
    stage = set_stage(replace(TINY, view=view, frames=40))
    made = build_set(stage)
    empty = background(made.scene).astype(int)
    for frame in (0, 39):
        low, high = picture_span(stage, made.mesh, frame)
        assert (low > 0).all()
        assert (high < [160, 120]).all()
    quiet = replace(stage.scenario, noise=0.0)
    picture = next(pictures(replace(stage, scenario=quiet), made)).astype(int)
    changed = np.abs(picture - empty).max(-1) > 12
    low, high = picture_span(stage, made.mesh, 0)
    rows, columns = np.nonzero(changed)
    assert low[1] - 3 <= rows.min() <= low[1] + 6  # the top of the head
    assert columns.min() <= high[0]
    assert changed.sum() > 0.2 * np.prod(high - low)


def test_the_directions_are_mirrored() -> None:
    for direction, sign in (("lr", 1), ("rl", -1)):
        stage = set_stage(replace(TINY, direction=direction, frames=30))
        u = stage.camera.project(stage.walk.origins[stage.frames, 0])[:, 0]
        assert sign * (u[-1] - u[0]) > 20


@pytest.mark.long
def test_pole_hides_joints_and_is_part_of_the_background() -> None:
    scenario = replace(TINY, view="oblique", frames=60)
    plain, pole = (set_stage(replace(scenario, pole=flag)) for flag in (False, True))
    np.testing.assert_array_equal(plain.walk.origins, pole.walk.origins)
    made = build_set(pole)
    assert build_set(plain).scene.front.max() == 0
    front = made.scene.front > 0.99
    assert front.sum() > 200
    empty = background(made.scene)
    quiet = replace(pole, scenario=replace(pole.scenario, noise=0.0))
    inner = cv2.erode(front.astype(np.uint8), np.ones((3, 3))) > 0
    changed = np.abs(np.stack(list(pictures(quiet, made)))[:, inner].astype(int) - empty[inner]).max()
    assert changed <= 3  # nothing of the person shows through the pole


def test_noise_and_flicker_have_their_stated_size() -> None:
    stage = set_stage(replace(TINY, frames=30))
    made = build_set(stage)
    empty = background(made.scene).astype(float)
    noisy = replace(stage, scenario=replace(stage.scenario, noise=3.0))
    difference = next(pictures(noisy, made)) - empty
    low, high = np.percentile(difference, (16, 84))
    assert 0.5 * (high - low) == pytest.approx(3.0, abs=0.6)  # in whole grey levels
    flickering = replace(stage, scenario=replace(stage.scenario, noise=0.0, flicker=4.0))
    usable = (empty > 60) & (empty < 215)
    gains = [np.median(picture[usable] / empty[usable]) for picture in pictures(flickering, made)]
    assert np.std(gains) == pytest.approx(0.04, rel=0.35)
    assert np.mean(gains) == pytest.approx(1.0, abs=0.02)


def test_raster_keeps_the_nearest_front_face() -> None:
    square = np.array([[1, 1], [1, 9], [9, 9], [9, 1]], np.float32)
    xy = np.concatenate([square, square])
    near = np.array([1, 1, 1, 1, 2, 2, 2, 2], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [4, 6, 5]], np.int32)
    hits = rasterise(xy, near, faces, 16, 16)
    assert len(hits.row) == 81
    assert set(hits.face.tolist()) <= {2, 3}
    np.testing.assert_allclose(hits.weights.sum(1), 1, atol=1e-6)
    back = rasterise(xy, near, faces[4:], 16, 16)
    assert len(back.row) == 0
    cut = rasterise(xy + np.float32(12), near, faces, 16, 16)
    assert cut.row.max() == cut.column.max() == 15


def test_left_side_of_the_normative_gait_is_half_a_cycle_late() -> None:
    curves = normative(np.random.default_rng(0))
    phase = np.linspace(0, 1, 50, endpoint=False)
    still = np.zeros((50, len(curves.modes)))
    right, left = curves.angles(phase, still), curves.angles(phase + 0.5, still)
    assert np.abs(right["r_knee_flexion"] - left["l_knee_flexion"]).max() < np.radians(5)
    assert np.degrees(right["r_knee_flexion"].max()) == pytest.approx(62, abs=6)
    assert 0.68 < phase[right["r_knee_flexion"].argmax()] < 0.8


def write_model(path: Path, knee: str = "r_knee_flexion") -> None:
    """Write a two-component model whose curves are the normative ones."""
    curves = normative(np.random.default_rng(1))
    samples = (fourier(np.arange(64) / 64) @ curves.mean.T).astype(np.float32)
    names = [name.replace("pelvis_", "root_") for name in CURVE_NAMES]
    names[names.index("r_knee_flexion")] = knee
    blob.write(
        path,
        {
            "CHNM": blob.pack_names(names),
            "CURV": np.stack([samples, 0.05 * samples, 0 * samples]),
            "SCST": np.array([[1, 0.8, 0.3], [1, 0.5, 0.2]], np.float32),
        },
    )


def test_a_models_curves_can_be_walked(tmp_path: Path) -> None:
    write_model(tmp_path / "m.gait")
    scenario = replace(TINY, gait=str(tmp_path / "m.gait"), frames=40)
    modelled, generated = set_stage(scenario), set_stage(replace(TINY, frames=40))
    assert modelled.walk.speed.mean() == pytest.approx(generated.walk.speed.mean(), abs=0.02)
    assert np.abs(modelled.walk.turns - generated.walk.turns).max() > 0.02
    write_model(tmp_path / "arms.gait", "knee_of_another_kind")
    with pytest.raises(UserError, match=r"arms\.gait: has no channel r_knee_flexion"):
        set_stage(replace(TINY, gait=str(tmp_path / "arms.gait")))


def test_people_cross_and_the_nearer_one_hides_the_other(tmp_path: Path) -> None:
    scenario = replace(TINY, people="crossing", frames=41)
    stage = set_stage(scenario)
    made, people = build_set(stage), [stage, *stage.others]
    ways = [one.walk.origins[one.frames, 0] for one in people]
    assert (ways[0][0, 0] - ways[1][0, 0]) * (ways[0][-1, 0] - ways[1][-1, 0]) < 0
    figures = zip([(made.mesh, made.appearance), *made.others], people, strict=True)
    drawn = [Renderer(stage.camera, made.scene, *figure, one.walk) for figure, one in figures]
    both, nearer = light(drawn, 20), min(drawn, key=lambda one: one.depth(20))
    alone = light([nearer], 20)
    shown = np.abs(alone - made.scene.plate).max(axis=2) > 0.1
    assert shown.sum() > 100 and np.median(np.abs(both - alone)[shown]) < 1e-6
    simulate(replace(scenario, frames=3), tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted(files(scenario))
    apart = np.abs(place(read_truth(tmp_path), "pelvis")[0] - json_pelvis(tmp_path / "init_2.json"))
    assert apart.max() > 0.5


def test_each_person_of_a_clip_is_described_separately(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--people", "crossing", "--view", "toward", "--frames", "3", "--size", "160x120", "--quiet"]
    assert main(["simulate", "-o", str(tmp_path), *words]) == 0
    first, second = (json.loads((tmp_path / name).read_text()) for name in ("meta.json", "meta_2.json"))
    assert (first["direction"], second["direction"]) == ("left to right", "right to left")
    assert (first["view"], second["view"]) == ("toward", "away")
    assert first["seed"] == second["seed"] and first["clip"] == second["clip"]
    assert f"2 people, the first of {first['stature_m']:.2f} m" in capsys.readouterr().out


def json_pelvis(path: Path) -> np.ndarray:
    """Return the place in an init file."""
    return np.array(json.loads(path.read_text())["pelvis"])


def test_presets_are_sound() -> None:
    for name, preset in PRESETS.items():
        stage = set_stage(preset)
        assert stage.camera.size == (640, 480), name
        assert 90 <= preset.frames <= 180
    assert PRESETS["pole"].pole


def test_the_command_reports_what_it_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", "-o", str(tmp_path / "a"), "--frames", "4", "--size", "160x120", "--stature", "1.7"]
    assert main([*words, "--json", "--quiet"]) == 0
    out = capsys.readouterr()
    figures = json.loads(out.out)
    assert (figures["frames"], figures["stature_m"], out.err) == (4, 1.7, "")
    assert sorted(figures["files"]) == sorted(p.name for p in (tmp_path / "a").iterdir())


@pytest.mark.parametrize(
    ("moving", "view"),
    [("follow", "from a robot that follows behind"), ("pan", "side view from a camera that pans")],
)
def test_the_command_states_from_where_the_picture_is(
    moving: str, view: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "-o", str(tmp_path / "a"), "--frames", "4", "--size", "160x120", "--moving", moving]
    assert main([*words, "--quiet"]) == 0
    assert f": 4 frames, {view}, a person of" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--frames", "1"], "--frames 1"),
        (["--size", "161x120"], "--size 161x120"),
        (["--speed", "2.4", "--stride-hz", "0.5"], ": speed 2.40 m/s: at 0.50 strides/s and"),
        (["--view", "toward", "--distance", "2"], "--distance 2"),
        (["--gait", "nowhere.gait"], "nowhere.gait"),
        (["--noise", "-1"], "--noise -1"),
        (["--speed", "nan"], "--speed nan"),
        (["--asymmetry", "45"], "--asymmetry 45: give a value from -30 to 30"),
        (["--motion", "backwards", "--aid", "stick"], "--motion backwards: cannot be combined"),
    ],
)
def test_bad_values_are_one_line(
    options: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = "--gait" in options  # a file, not a value
    assert main(["simulate", "-o", str(tmp_path / "x"), *options]) == (1 if missing else 2)
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert named in err


@pytest.mark.parametrize("options", [[], ["-o", "x", "--size", "big"], ["-o", "x", "--view", "below"]])
def test_usage_errors_exit_with_2(options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["simulate", *options])
    assert stop.value.code == 2
    assert "gait simulate" in capsys.readouterr().err


def test_a_file_in_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(UserError, match="taken: is a file"):
        simulate(TINY, tmp_path / "taken")


def test_an_interrupt_leaves_no_empty_folder_but_keeps_the_users(tmp_path: Path) -> None:
    def interrupt(done: int) -> None:
        raise KeyboardInterrupt

    (tmp_path / "there").mkdir()
    for name in ("new", "there"):
        with pytest.raises(KeyboardInterrupt):
            simulate(TINY, tmp_path / name, interrupt, keep=False)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]


def test_a_model_that_cannot_be_walked_leaves_no_folder(tmp_path: Path) -> None:
    (tmp_path / "old.gait").write_bytes(b"no model")
    with pytest.raises(UserError, match="old.gait"):
        simulate(replace(TINY, gait=str(tmp_path / "old.gait")), tmp_path / "clip")
    assert not (tmp_path / "clip").exists()


def test_every_bone_and_point_hangs_together() -> None:
    shown: set[str] = set()
    for bone, parent in PARENT_BONES.items():
        assert parent is None or parent in shown
        shown.add(bone)
    assert set(POINT_BONE.values()) <= shown
