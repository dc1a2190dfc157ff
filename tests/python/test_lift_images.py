"""The estimate from images: exact derivatives of sticks and energy, sensors, and what users write."""

import json
from dataclasses import replace

import numpy as np
import pytest
from toy_segments import toy_prior

from gait.bindings.model import read_cyclic
from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.video import Frame
from gait.lift.keypoints.corrections import CLICK_SD, as_json, read_corrections
from gait.lift.video import sensors
from gait.lift.video.descent import Link, normal
from gait.lift.video.energy import (
    GAIN_COLUMN,
    HEADING_COLUMN,
    PLACE_COLUMNS,
    Anchor,
    Corrections,
    Energy,
    Reading,
    Shape,
    Sticks,
    stick_responses,
)
from gait.lift.video.placement import PhasePrior, read_placement
from gait.lift.video.sensors import CameraView, FlatView

CAMERA = replace(
    Camera.looking((6, -1, 1.4), (0, 0, 0.9), (640, 480), 500.0),
    distortion=np.array([-0.1, 0.02, 0.001, -0.002, 0.0]),
)
VIEWS = {"camera": CameraView(CAMERA), "flat": FlatView(120.0, (320.0, 400.0))}
STEP = 1e-6


def by_differences(function, at):
    """Slopes (..., n) of function(at) by central differences."""
    steps = STEP * np.eye(len(at))
    return np.stack([(function(at + s) - function(at - s)) / (2 * STEP) for s in steps], axis=-1)


def energy_of(view, headings=0, **parts):
    """Energy of a random segment with all terms, and a state near the middle of the view."""
    prior = toy_prior(frames=6, markers=len(JOINTS), size=4, headings=headings)
    shape, sticks = Shape.of(prior, 0, 1.7), Sticks.of(prior.names)
    rng = np.random.default_rng(1)
    state = np.concatenate([rng.normal(size=4), [0.1, -0.2, 0.03, 0.4 if headings == 0 else 0.0, -0.2, 0.3]])
    weights = rng.dirichlet(np.ones(6), size=5)
    places = view.project(shape.positions(state, weights, sticks.markers)[0])[0]
    grid = sensors.grid(places.mean(axis=1), np.full(5, 200.0))
    energy = Energy(
        shape,
        view,
        sticks,
        weights,
        np.zeros(shape.size),
        np.full(shape.size, 2.0),
        reading=Reading(rng.uniform(size=(5, 80)), grid, np.full(5, 12.0), 0.3),
        corrections=Corrections(
            np.array([0, 3]), np.array([2, 9]), rng.uniform(100, 300, (2, 2)), np.array([3.0, 5])
        ),
        anchor=Anchor(slice(3), rng.normal(size=(3, len(JOINTS), 3)), np.full(len(JOINTS), 0.05)),
    )
    return replace(energy, **parts), state


def test_a_stick_gives_the_integral_of_the_blur_along_it():
    rng = np.random.default_rng(0)
    ends, places, blur = rng.normal(size=(1, 3, 2, 2)) * 20, rng.normal(size=(1, 5, 2)) * 15, 6.0
    value, _ = stick_responses(ends, places, np.array([blur]))
    along = (np.arange(4000) + 0.5) / 4000
    for b, (p, q) in enumerate(ends[0]):
        points = p + along[:, None] * (q - p)
        square = ((places[0][:, None] - points) ** 2).sum(axis=2)
        density = np.exp(-square / (2 * blur**2)) / (2 * np.pi * blur**2)
        wanted = np.sqrt(2 * np.pi) * blur * density.mean(axis=1) * np.linalg.norm(q - p)
        assert value[0, :, b] == pytest.approx(wanted, rel=1e-5, abs=1e-8)


def test_a_stick_towards_the_viewer_has_finite_slopes():
    ends = np.zeros((1, 1, 2, 2))
    value, slope = stick_responses(ends, np.array([[[3.0, 1.0]]]), np.array([5.0]))
    assert np.isfinite(slope).all() and value == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("view", VIEWS)
def test_views_give_exact_slopes(view):
    at = np.array([0.3, -0.4, 0.8])
    _, slope = VIEWS[view].project(at)
    wanted = by_differences(lambda p: VIEWS[view].project(p)[0], at)
    assert slope == pytest.approx(wanted, rel=1e-5, abs=1e-5)


def test_a_camera_projects_as_the_camera_does_and_moves_nothing_along_its_rays():
    points = np.array([[0.3, -0.4, 0.8], [-0.5, 0.1, 1.5]])
    uv, _ = VIEWS["camera"].project(points)
    assert uv == pytest.approx(CAMERA.project(points))
    away = VIEWS["camera"].away(points[0])
    assert VIEWS["camera"].project(points[0] + 0.3 * away)[0] == pytest.approx(uv[0], abs=1e-6)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("headings", [0, 2])
def test_the_energy_has_an_exact_jacobian(view, headings):
    """Equal to 1e-5 relative."""
    energy, state = energy_of(VIEWS[view], headings)
    _, slope = energy.rows(state)
    wanted = by_differences(lambda s: energy.rows(s)[0], state)
    assert np.abs(slope - wanted).max() < 1e-5 * np.abs(slope).max()
    columns = np.abs(slope - wanted).max(axis=0) / np.maximum(np.abs(slope).max(axis=0), 1e-9)
    assert columns.max() < 1e-5
    assert (np.abs(slope[:, HEADING_COLUMN]) > 0).sum() > (1 if headings == 0 else 0)


def test_the_energy_is_eq_7():
    energy, state = energy_of(VIEWS["flat"], anchor=None)
    rows, _ = energy.rows(state)
    places, _ = energy.shape.positions(state, energy.weights, slice(None))
    uv, _ = energy.view.project(places)
    corrections, reading = energy.corrections, energy.reading
    pulled = uv[corrections.frame, corrections.marker] - corrections.uv
    value, _ = energy.sticks.responses(uv[:, energy.sticks.markers], reading.places, reading.blur)
    observed = state[-1] + np.exp(state[GAIN_COLUMN]) * value - reading.value
    wanted = ((pulled / corrections.sd[:, None]) ** 2).sum() + (observed**2).sum() / reading.sd**2
    assert rows @ rows == pytest.approx(wanted + (state**2).sum() / 4)


def test_a_chain_ties_neighbours_where_they_overlap():
    energy, state = energy_of(VIEWS["flat"], reading=None, corrections=None, anchor=None)
    link = Link(3, np.full(len(JOINTS), 0.02))
    states = np.stack([state, state + 0.1])
    apart, tied = normal([energy, energy], None, states), normal([energy, energy], link, states)
    places = [energy.shape.positions(s, np.eye(6), slice(None))[0] for s in states]
    assert tied.cost - apart.cost == pytest.approx((((places[0][3:] - places[1][:3]) / 0.02) ** 2).sum())

    def cost(flat):
        return np.array([normal([energy, energy], link, flat.reshape(2, -1)).cost])

    slope = by_differences(cost, states.ravel())[0]
    assert 2 * tied.gradient.ravel() == pytest.approx(slope, rel=1e-4, abs=1e-2)


def line_film(scale=1.0, offset=0.0, plate=None):
    """Film of one frame: a grey vertical bar on a plain ground."""
    image = np.full((240, 320), 60.0)
    image[:, 155:165] = 120
    image = np.clip(scale * image + offset, 0, 255).astype(np.uint8)
    return sensors.Film.make([Frame(7, 0.25, image)], 150.0, plate)


def test_sensors_see_a_bar_where_it_is_at_any_contrast():
    bright, dim = line_film(), line_film(0.6, 10)
    places = np.stack([np.linspace(60, 260, 21), np.full(21, 120.0)], axis=1)[None]
    first, second = (film.read(np.array([0]), places)[0] for film in (bright, dim))
    assert abs(places[0, np.argmax(first), 0] - 160) < 6
    assert first.max() > 5 * first[0]
    assert second == pytest.approx(first, abs=0.15 * first.max())
    assert bright.first == 7 and bright.times == pytest.approx([0.25])


def test_sensors_with_a_plate_are_blind_to_the_scene():
    plate = np.full((240, 320), 60, np.uint8)
    plate[:, 155:165] = 120
    places = np.stack([np.linspace(60, 260, 21), np.full(21, 120.0)], axis=1)[None]
    assert line_film(plate=plate).read(np.array([0]), places).max() < 0.02
    plain = np.full((240, 320), 60, np.uint8)
    assert (
        line_film(plate=plain).read(np.array([0]), places).max()
        > 0.3 * line_film().read(np.array([0]), places).max()
    )


def written(tmp_path, content):
    path = tmp_path / "file.json"
    path.write_text(json.dumps(content))
    return path


PRIOR = toy_prior(frames=6, markers=len(JOINTS))
ROUGH = {"frame": 3, "pelvis": [1, 2, 0.9], "heading_rad": 0.5, "stature_m": 1.7}


def test_a_start_of_the_tracker_is_a_placement(tmp_path):
    start = ROUGH | {"phase": 0.2, "stride_hz": 0.9, "sd": {"pelvis": [0.1, 0.2, 0.1], "phase": 0.1}}
    placed = read_placement(written(tmp_path, start), PRIOR, True)
    assert placed.ground == pytest.approx([1, 2]) and placed.ground_sd == 0.2 and placed.frame == 3


def test_corrections_survive_writing(tmp_path):
    content = {"corrections": [{"frame": 2, "joint": "l_knee", "uv": [10.5, 20.0]}]}
    found = read_corrections(written(tmp_path, content), PRIOR, 10)
    assert found[0].sd_px == CLICK_SD and found[0].uv == (10.5, 20.0)
    assert read_corrections(written(tmp_path, as_json(found)), PRIOR, 10) == found


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frame": None}, "frame"),
        ({"stature_m": 17}, "stature_m is 17"),
        ({"height": 3}, "height is not a known key"),
        ({"pelvis": [1]}, "pelvis"),
        ({"sd": {"pelvis": -1}}, "pelvis is -1"),
        ({"sd": {"pelvis": [0.1, -2, 0.1]}}, "pelvis is -2"),
        ({"sd": {"pelvis": [1, 2]}}, "pelvis has shape 2, not one number"),
        ({"sd": {"phse": 0.1}}, "phse is not a known key"),
        ({"sd": {"phase": 0}}, "phase is 0"),
        ({"phase": "left"}, "phase is not a number"),
        ({"phase": 1.5}, "phase is 1.5"),
        ({"stride_hz": 0}, "stride_hz is 0"),
        ({"pelvis": [1, [2, 3]]}, "pelvis is not an array of numbers"),
        ({"sd": {"pelvis": [0.1, [0.1]]}}, "pelvis is not an array of numbers"),
    ],
)
def test_a_wrong_placement_is_named(tmp_path, change, words):
    with pytest.raises(UserError, match=words):
        read_placement(written(tmp_path, ROUGH | change), PRIOR, True)


def test_without_a_camera_the_person_is_placed_in_the_picture(tmp_path):
    with pytest.raises(UserError, match="pelvis_px is missing"):
        read_placement(written(tmp_path, ROUGH), PRIOR, False)
    flat = ROUGH | {"pelvis_px": [100, 200], "height_px": 300}
    placed = read_placement(written(tmp_path, flat), PRIOR, False)
    assert placed.height_px == 300 and placed.unused == ("pelvis",)
    assert read_placement(written(tmp_path, flat), PRIOR, True).unused == ("pelvis_px", "height_px")
    assert read_placement(written(tmp_path, ROUGH), PRIOR, True).unused == ()


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"frame": 10, "joint": "l_knee", "uv": [1, 2]}, "correction 1: frame is 10"),
        ({"frame": 1, "joint": "tail", "uv": [1, 2]}, "joint is 'tail'"),
        ({"frame": 1, "joint": "l_knee", "uv": [1]}, "uv has shape"),
        ({"frame": 1, "joint": "l_knee", "uv": [1, 2], "sd_px": 0}, "sd_px is 0"),
        ([1, 2], "not an object of keys"),
    ],
)
def test_a_wrong_correction_is_named(tmp_path, entry, words):
    with pytest.raises(UserError, match=words):
        read_corrections(written(tmp_path, {"corrections": [entry]}), PRIOR, 10)


def test_two_corrections_of_one_joint_and_frame_are_refused(tmp_path):
    knee = {"frame": 2, "joint": "l_knee", "uv": [1, 2]}
    clicks = [knee, knee | {"frame": 3}, knee | {"joint": "r_knee"}, knee | {"uv": [9, 9]}]
    with pytest.raises(
        UserError, match="correction 4 points at l_knee in frame 2, as correction 1 does; remove"
    ):
        read_corrections(written(tmp_path, {"corrections": clicks}), PRIOR, 10)
    assert len(read_corrections(written(tmp_path, {"corrections": clicks[:3]}), PRIOR, 10)) == 3


def test_a_correction_outside_the_clip_is_named(tmp_path):
    clicks = {"corrections": [{"frame": f, "joint": "l_knee", "uv": [1, 2]} for f in (5, 4)]}
    with pytest.raises(UserError, match=r"file\.json: correction 2: frame is 4.* 5 to 9, or other --start"):
        read_corrections(written(tmp_path, clicks), PRIOR, 10, 5)


def test_a_prior_of_other_markers_is_refused():
    with pytest.raises(UserError, match="no marker"):
        Sticks.of(toy_prior(markers=6).names)


def test_place_is_a_slice_of_the_state():
    assert np.arange(10)[PLACE_COLUMNS].tolist() == [4, 5, 6]


def test_a_phase_shows_which_leg_is_ahead(tmp_path):
    """Half a stride later left and right are swapped; a phase that is hardly known shows nothing."""
    prior, cycle = SegmentPrior.load(), read_cyclic(None)
    path = tmp_path / "p.json"

    def ahead(phase):
        """How far the left ankle is in front of the right one in the first frame, metres."""
        path.write_text(json.dumps(ROUGH | {"phase": phase, "stride_hz": 0.9}))
        phase_prior = PhasePrior.of(prior, cycle, read_placement(path, prior, True))
        state = np.concatenate([phase_prior.mean[0], np.zeros(6)])
        assert (phase_prior.sd[0] <= 1).all() and phase_prior.sd[0].min() < 0.6
        ankles, _ = Shape.of(prior, 0, 1.7).positions(
            state, np.eye(prior.frames), prior.index(["l_ankle", "r_ankle"])
        )
        return ankles[0, 0, 0] - ankles[0, 1, 0]

    assert ahead(0.0) < -0.3  # the right heel strikes
    assert ahead(0.5) == pytest.approx(-ahead(0.0), rel=0.2)
    for vague in ({"phase": 0.5, "sd": {"phase": 0.3}}, {}):
        path.write_text(json.dumps(ROUGH | vague))
        assert PhasePrior.of(prior, cycle, read_placement(path, prior, True)) is None


def test_without_a_plate_noise_has_no_edges():
    rng = np.random.default_rng(0)
    grey = (150 + 3 * rng.standard_normal((200, 200))).astype(np.float32)
    grey[80:120, 98:103] = 40
    edges = sensors.normalised_gradient(grey, 8.0)
    left = sensors.above_usual(edges)
    away = np.s_[:60]
    assert left[away].mean() < 0.05 * edges[away].mean()
    assert left[90:110, 94:107].max() > 0.8 * edges[90:110, 94:107].max()
