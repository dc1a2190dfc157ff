"""Whole clips lifted from pictures: stick figures of the shipped model's walk, and the command."""

import csv
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gait.bindings.model import read_blob
from gait.bindings.segment_prior import TAGS, SegmentPrior
from gait.body.skeleton import EVAL15, JOINTS, pose
from gait.cli import main
from gait.errors import UserError
from gait.io import blob
from gait.io.video import Video, VideoWriter
from gait.lift.keypoints.corrections import CLICK_SD, Correction, as_json, read_edits
from gait.lift.video import run as lift_video
from gait.lift.video.clip_segments import Settings
from gait.lift.video.figure import BODY_LIMBS, Figure, draw_figure
from gait.lift.video.fit_clip import _share, fit_clip, suggestions
from gait.lift.video.placement import (
    PHASE_SD,
    PLACE_SD,
    PLACED_HEADING_SD,
    RATE_SD_HZ,
    STATURE_SD_M,
    read_placement,
)
from gait.motion.evaluate import root_errors

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import lift_clicks
import lift_sticks

FPS, STATURE, SPEED = 20.0, 1.7, 1.2
GAP = 1e-6  # metres
EVAL = [JOINTS.index(name) for name in EVAL15]


@pytest.fixture(scope="module")
def prior():
    return SegmentPrior.load()


def walk(frames=24, coef=(0.7, -0.5)):
    """Walk of the shipped cyclic model with its own proportions and path."""
    time = np.arange(frames) / FPS
    place = np.column_stack([SPEED * time, np.zeros(frames), np.full(frames, 0.9)])
    joints, _ = pose(
        blob.decode(read_blob(None), "walk.gait"), 0.9 * time, coef, STATURE, 0.0, 0.0, 0.0, place
    )
    joints[..., 2] -= joints[..., 2].min() - 0.01
    return lift_sticks.Walk(list(JOINTS), joints, FPS, 0.0, STATURE)


@pytest.fixture(scope="module")
def clip(prior):
    return lift_sticks.stick_clip(prior, walk(), np.radians(60), seed=1)


def root(fit, prior):
    return float(np.median(root_errors(fit.places[:, prior.index(EVAL15)], walk().joints[:, EVAL])))


@pytest.fixture(scope="module")
def corrected(clip):
    """The clip and its estimate: without corrections, then after every six."""
    return list(lift_clicks.corrected(clip, walk().joints[:, EVAL], EVAL15, 12, share=0.25))


def test_sensors_alone_follow_a_stick_figure(corrected, prior):
    _, fit = corrected[0]
    assert root(fit, prior) < 70
    assert fit.places.shape == (24, len(prior.names), 3) and np.isfinite(fit.sd).all()


def test_corrections_help_and_are_kept(corrected, prior):
    (_, free), (some, fit) = corrected[0], corrected[-1]
    assert len(some.corrections) == 12
    assert root(fit, prior) < min(45, root(free, prior))
    misses = lift_video.correction_errors(some, fit)
    assert np.median(misses) < 8
    assert np.median(misses) < np.median(lift_video.correction_errors(some, free))


def test_corrections_make_the_estimate_surer(corrected, clip):
    (_, free), (some, fit) = corrected[0], corrected[-1]
    assert np.median(fit.sd) < np.median(free.sd)
    assert len(suggestions(some, fit)) <= len(suggestions(clip, free))


def test_what_is_suggested_is_uncertain(corrected, clip):
    _, fit = corrected[0]
    asked = suggestions(clip, fit)
    frame, joint = asked[0].frame, clip.prior.index([asked[0].joint])[0]
    assert clip.view.scale(fit.places[frame, joint]) * fit.sd[frame, joint].max() > 0.3 * asked[0].sd_px
    assert len({(s.frame, s.joint) for s in asked}) == len(asked)


def test_known_markers_without_sensors_give_the_motion(clip, prior):
    truth = walk().joints[:, EVAL]
    uv = clip.view.project(truth)[0]
    known = [
        Correction(k, name, tuple(uv[k, j].tolist()), 1.0) for k in range(24) for j, name in enumerate(EVAL15)
    ]
    fit = fit_clip(replace(clip, corrections=known, settings=Settings(sensor_sd=np.inf)))
    assert root(fit, prior) < 25


def test_corrections_of_a_marker_err_alike_within_a_segment(clip):
    """Several show no more of what the prior leaves out than one does; other markers are not affected."""

    def lasting(*spots):
        held = [Correction(frame, joint, (300.0, 200.0), 3.0) for frame, joint in spots]
        energy = replace(clip, corrections=held).energy(0, 0, clip.mean_state(), looking=False)
        return energy.corrections.sd**2 - 3.0**2

    (knee,), (wrist,) = lasting((0, "l_knee")), lasting((2, "r_wrist"))
    assert lasting((0, "l_knee"), (2, "l_knee"), (2, "r_wrist")) == pytest.approx([2 * knee, 2 * knee, wrist])


def test_the_papers_way_is_continuous_in_depth(clip, monkeypatch):
    """F10: moved, neighbours put what they share equally far away on average; unmoved they do not."""
    alone = replace(clip, settings=Settings(joined=False))
    fit = fit_clip(alone)
    gaps = lift_sticks.depth_gaps(alone, fit.sequence)
    assert len(gaps) == len(clip.starts) - 1 > 2
    assert np.abs(gaps).max() < GAP
    assert lift_sticks.spike(alone, fit) < 0.01 * STATURE
    monkeypatch.setattr("gait.lift.video.fit_clip._continuous", lambda _, sequence: sequence)
    assert np.abs(lift_sticks.depth_gaps(alone, fit_clip(alone).sequence)).max() > 100 * GAP


def test_segments_come_in_and_go_by_even_steps(clip):
    """A triangle over frames: neighbours' weights sum to 1, and the step at an end is as large as within."""
    first, second = _share(clip, 0), _share(clip, 1)
    hop = clip.prior.hop
    assert first[hop:] + second[:-hop] == pytest.approx(np.ones(hop))
    assert np.diff(second)[: hop - 1] == pytest.approx(2 * second[0])


def test_a_placement_in_the_middle_works_both_ways(clip, prior):
    pelvis = walk().joints[12, JOINTS.index("pelvis")]
    placed = replace(clip.placement, frame=12, ground=pelvis[:2] + 0.05)
    middle = replace(clip, placement=placed)
    assert middle.origin > 0
    assert root(fit_clip(middle), prior) < 70


def test_the_cylinder_figure_keeps_its_bones(corrected, prior):
    _, fit = corrected[-1]
    figure = Figure.fit(fit.places, prior.names)
    joints = dict(zip(JOINTS, np.moveaxis(figure.joints(), 1, 0), strict=True))
    for bone, length in figure.lengths().items():
        a, b = {"thigh": ("hip", "knee"), "shank": ("knee", "ankle")}.get(bone[2:], ("elbow", "wrist"))
        if bone.endswith("upper_arm"):
            a, b = "shoulder", "elbow"
        each = np.linalg.norm(joints[f"{bone[:2]}{a}"] - joints[f"{bone[:2]}{b}"], axis=1)
        assert each == pytest.approx(np.full(24, length), abs=1e-9)
    assert np.nanmedian(figure.residual) < 0.02
    assert abs(figure.stature / STATURE - 1) < 0.1
    assert figure.surfaces().shape[:2] == (24, len(BODY_LIMBS))


def test_the_figure_is_drawn_where_the_body_is(corrected, clip, prior):
    _, fit = corrected[-1]
    figure = Figure.fit(fit.places, prior.names)
    blank = np.zeros((480, 640, 3), np.uint8)
    drawn = draw_figure(blank, clip.view, figure.surfaces()[5], figure.joints()[5])
    rows, columns = np.nonzero(drawn.any(axis=2))
    uv = clip.view.project(figure.joints()[5])[0]
    assert abs(columns.mean() - uv[:, 0].mean()) < 20
    assert rows.min() < uv[:, 1].min() + 5 and rows.max() > uv[:, 1].max() - 5


@pytest.fixture(scope="module")
def files(tmp_path_factory, clip):
    """Video, camera and placement of the stick figure."""
    folder = tmp_path_factory.mktemp("sticks")
    with VideoWriter(folder / "video.mp4", FPS) as film:
        for frame in lift_sticks.pictures(walk(), clip.view.camera, 1):
            film.write(frame.image)
    (folder / "camera.json").write_text(json.dumps(clip.view.camera.to_dict()))
    placed = {"frame": 0, "pelvis": [*clip.placement.ground, 0.9], "heading_rad": clip.placement.heading}
    (folder / "placement.json").write_text(json.dumps(placed | {"stature_m": STATURE}))
    return folder


def lift(*words):
    """Run the command on words."""
    return main(["lift", *map(str, words)])


@pytest.mark.long
def test_the_command_lifts_a_video(files, tmp_path, corrected, prior, capsys):
    some, _ = corrected[-1]
    (tmp_path / "clicks.json").write_text(json.dumps(as_json(some.corrections)))
    words = [files / "video.mp4", "--camera", files / "camera.json", "--placement", files / "placement.json"]
    words += ["--corrections", tmp_path / "clicks.json", "--background", "none", "--json", "--quiet"]
    words += ["--overlay", tmp_path / "o.mp4", "--suggest", 3, "--output", tmp_path / "out.csv"]
    assert lift(*words) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["frames"] == 24 and figures["corrections"]["given"] == 12
    assert figures["corrections"]["miss_px"]["with"] < figures["corrections"]["miss_px"]["without"]
    assert len(figures["suggest"]) <= 3 and figures["fit_correlation"] > lift_video.POOR_CORRELATION
    assert Video(tmp_path / "o.mp4").count == 24
    with open(tmp_path / "out.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 24 and set(rows[0]) == {"frame", "time"} | {
        f"{name}_{axis}" for name in JOINTS for axis in ("x", "y", "z", "sx", "sy", "sz")
    }
    found = np.array([[[float(r[f"{n}_{a}"]) for a in "xyz"] for n in EVAL15] for r in rows])
    assert np.median(root_errors(found, walk().joints[:, EVAL])) < 45


def test_without_a_camera_the_axes_are_the_pictures(files, tmp_path, clip, capsys, monkeypatch):
    """Sensor readings that the figure does not explain are reported as well."""
    monkeypatch.setattr(lift_video, "POOR_CORRELATION", 1.0)
    uv = clip.view.project(walk().joints)[0]
    pelvis = uv[0, JOINTS.index("pelvis")]
    across = (uv[-1] - uv[0])[JOINTS.index("pelvis"), 0]
    placed = {"frame": 0, "pelvis_px": pelvis.tolist(), "height_px": 260, "stature_m": STATURE}
    heading = np.pi if across < 0 else 0.0
    (tmp_path / "p.json").write_text(json.dumps(placed | {"heading_rad": heading}))
    words = [files / "video.mp4", "--placement", tmp_path / "p.json", "--background", "none"]
    assert lift(*words, "--stop", 20, "--output", tmp_path / "out.csv") == 0
    printed = capsys.readouterr()
    assert "figure: stature" in printed.out
    assert (
        "the figure may have lost the person" in printed.err
        and "give --background or --corrections" in printed.err
    )
    with open(tmp_path / "out.csv", newline="") as file:
        x = [float(row["pelvis_x"]) for row in csv.DictReader(file)]
    assert len(x) == 20 and np.sign(x[-1] - x[0]) == np.sign(across)


@pytest.fixture
def refused(files, tmp_path, capsys):
    """Run the command with options of a video and give what it prints; it must fail and write nothing."""

    def run(*words, code=1):
        out = tmp_path / "out.csv"
        assert lift(files / "video.mp4", *words, "--output", out, "--quiet", "--background", "none") == code
        assert not out.exists()
        return capsys.readouterr().err

    return run


def test_faults_are_named(files, tmp_path, refused):
    placed = ["--placement", files / "placement.json"]
    assert "--placement" in refused(code=2)
    assert "pelvis_px is missing" in refused(*placed)
    camera = ["--camera", files / "camera.json"]
    assert "frame 0 is not among the frames 5 to 23" in refused(*camera, *placed, "--start", 5)
    gone = refused(*camera, *placed, "--start", 5000)
    assert "no frame from 5000" in gone and "its frames are 0 to 23" in gone and "--start" in gone
    behind = json.loads((files / "placement.json").read_text()) | {"pelvis": [50, 500]}
    (tmp_path / "behind.json").write_text(json.dumps(behind))
    assert "behind the camera" in refused(*camera, "--placement", tmp_path / "behind.json")
    for place, words in (
        ([-246, -426], "px tall in a picture of 640x480; give position and stature"),
        ([3.74, 5.28], "px tall in a picture of 640x480; give position and stature"),
        ([-4.5, 3.0], "of a picture of 640x480; place the person where the picture shows some of it"),
    ):
        (tmp_path / "far.json").write_text(json.dumps(behind | {"pelvis": place}))
        assert words in refused(*camera, "--placement", tmp_path / "far.json")
    outliers = {"frame": 3, "joint": "l_knee", "uv": [100000, 20]}
    (tmp_path / "c.json").write_text(json.dumps({"corrections": [outliers]}))
    printed = refused(*camera, *placed, "--corrections", tmp_path / "c.json")
    assert "correction 1: uv is (100000, 20), far outside a picture of 640x480" in printed
    (tmp_path / "c.json").write_text('{"corrections": [{"frame": 99, "joint": "l_knee", "uv": [1, 2]}]}')
    assert "frame is 99" in refused(*camera, *placed, "--corrections", tmp_path / "c.json")
    with pytest.raises(SystemExit):
        refused(*camera, *placed, "--overlay", tmp_path / "o.gif")
    size = (files / "video.mp4").stat().st_size
    assert "is read by this command" in refused(*camera, *placed, "--overlay", files / "video.mp4")
    assert (files / "video.mp4").stat().st_size == size


def test_a_model_without_a_cycle_takes_the_phase_of_the_shipped_one(prior, tmp_path):
    shipped = blob.decode(read_blob(None))
    path = tmp_path / "only.gait"
    blob.write(path, {tag: shipped[tag] for tag in ("META", *TAGS)})
    assert set(lift_video._cycle(str(path))) == set(lift_video._cycle(None))
    assert lift_video._cycle(str(path))["CURV"].tobytes() == shipped["CURV"].tobytes()


def test_the_documented_files_are_read(prior, tmp_path):
    page = (Path(__file__).parents[2] / "libgait/doc/reference/files.md").read_text(encoding="utf-8")
    page = page.split("## Placement")[1].split("## Motion capture")[0]
    calibrated, flat, corrections = (block.split("```")[0] for block in page.split("```json")[1:])
    path = tmp_path / "file.json"
    path.write_text(calibrated)
    assert read_placement(path, prior, True).phase == 0.3
    path.write_text(flat)
    assert read_placement(path, prior, False).height_px == 415
    path.write_text(corrections)
    found = read_edits(path, prior, range(100))
    pulled = found.corrections
    assert [c.joint for c in pulled] == ["l_knee", "r_ankle"] and pulled[1].sd_px == CLICK_SD
    assert len(found.hidden) == len(found.swapped) == len(found.floor) == 1
    usual = f"{PLACE_SD:g} m, {PLACED_HEADING_SD:g}, {STATURE_SD_M:g} m, {PHASE_SD:g}, {RATE_SD_HZ:g} |"
    assert usual in page and f"| {CLICK_SD:g} |" in page


@pytest.mark.parametrize(("option", "joined"), [([], True), (["--alone"], False)])
def test_the_papers_way_is_an_option(refused, files, monkeypatch, option, joined):
    def observed(clip, quiet):
        raise UserError(f"joined {clip.settings.joined}")

    monkeypatch.setattr(lift_video, "_fits", observed)
    words = ["--camera", files / "camera.json", "--placement", files / "placement.json", *option]
    assert f"joined {joined}" in refused(*words)
