"""Static trials: places of markers and lengths from a person who stands, for recordings with clusters."""

from pathlib import Path

import marked_person as mw
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_marker_files import write_trc

from gait import cli
from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.learn.corpus import load
from gait.learn.mocap.markers import LANDMARKS
from gait.learn.options import LearnOptions
from gait.learn.solve import kinematics, readers, retarget, static_trial
from gait.learn.solve.kinematics import SEGMENTS
from gait.reproducible import one_thread

#: Markers while standing alone, and those that stay on: four a cluster, whose labels have no meaning.
STANDING = [
    f"{s}.{name}" for s in "LR" for name in ("Knee.Lat", "Knee.Med", "Ankle.Lat", "Ankle.Med", "MT1", "MT5")
]
PELVIS = [f"{s}.{name}" for s in "LR" for name in ("ASIS", "PSIS")]
FEET = [f"{s}.Heel" for s in "LR"]
CLUSTERS = {
    f"{s}{part[0].upper()}C{k}": (f"{s.lower()}_{part}", k)
    for s in "LR"
    for part in ("thigh", "shank")
    for k in range(4)
}
WHERE = {"thigh": -0.14, "shank": -0.10}
LEGS = [k for k, name in enumerate(ANGLES) if "hip" in name or "knee" in name or "ankle" in name]
PLACES = {
    **{f"{s}.ASIS": f"{s.lower()}_asis" for s in "LR"},
    **{f"{s}.PSIS": f"{s.lower()}_psis" for s in "LR"},
    **{f"{s}.Heel": f"{s.lower()}_heel" for s in "LR"},
    **{f"{s}.{a}": f"{s.lower()}_{b}" for s in "LR" for a, b in (
        ("Knee.Lat", "knee_lateral"), ("Knee.Med", "knee_medial"), ("Ankle.Lat", "ankle_lateral"),
        ("Ankle.Med", "ankle_medial"), ("MT1", "mt1"), ("MT5", "mt5"),
    )},
}  # fmt: skip


@pytest.fixture(autouse=True)
def single():
    with one_thread():
        yield


def marked(labels, angles, travel=1.3, seed=5):
    """Points (T, M, 3) of a person with unusual lengths in poses (T, 24), and the true body's angles."""
    rng = np.random.default_rng(seed)
    scales = mw.own_lengths(rng, 0.05)
    time = np.arange(len(angles)) / 120
    phase = 2 * np.pi * np.arange(len(angles)) / 110
    place = np.stack([travel * time, 0 * time, 0.95 + 0.02 * np.cos(2 * phase) * bool(travel)], axis=1)
    turn = Rotation.from_rotvec(
        np.stack([0.05 + 0 * phase, 0.1 + 0 * phase, 0.1 * np.sin(phase)], 1)
    ).as_matrix()
    marks, offsets = [], rng.normal(scale=0.004, size=(len(PLACES) + len(CLUSTERS), 3))
    for label in labels:
        if label in PLACES:
            mark = LANDMARKS[PLACES[label]]
            k = list(PLACES).index(label)
            marks.append((mark.segment, np.array(mark.at) + offsets[k] / 1.8))
        else:
            segment, k = CLUSTERS[label]
            side = 1 if segment[0] == "l" else -1
            at = [0.03 * (-1) ** k, side * 0.045, WHERE[segment[2:]] - 0.03 * (k // 2)]
            marks.append((segment, np.array(at) + offsets[len(PLACES) + list(CLUSTERS).index(label)] / 1.8))
    segment = np.array([SEGMENTS.index(name) for name, _ in marks])
    local = kinematics.segment_scales(scales)[segment] * np.array([at for _, at in marks])
    pose = kinematics.Pose(place, turn, angles)
    points = kinematics.pose_skeleton(pose, kinematics.segment_origins(scales)).points(local, segment)
    return points + rng.normal(scale=0.001, size=points.shape)


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """A walk with clusters and the static trial of the person."""
    folder = tmp_path_factory.mktemp("lab")
    still = np.zeros((80, len(ANGLES)))
    still[:, [ANGLES.index(f"{s}_knee_flexion") for s in "lr"]] = 0.05
    moving = [*PELVIS, *CLUSTERS, *FEET]
    walk = walking(330)
    write_trc(
        folder / "Eva_static.trc", [*moving, *STANDING], marked([*moving, *STANDING], still, travel=0.0)
    )
    write_trc(folder / "Eva_walk.trc", moving, marked(moving, walk))
    return folder, walk


def walking(frames):
    """Angles (T, 24) of a walk without arms."""
    phase = 2 * np.pi * np.arange(frames) / 110
    angles = np.zeros((frames, len(ANGLES)))
    for s, lag in (("l", 0.0), ("r", np.pi)):
        angles[:, ANGLES.index(f"{s}_hip_flexion")] = 0.1 + 0.4 * np.sin(phase + lag + 1)
        angles[:, ANGLES.index(f"{s}_knee_flexion")] = 0.45 + 0.4 * np.sin(phase + lag)
        angles[:, ANGLES.index(f"{s}_ankle_flexion")] = 0.15 * np.sin(phase + lag + 2)
    return angles


def test_a_walk_with_clusters_has_the_angles_of_the_person(laboratory):
    folder, walk = laboratory
    found = static_trial.calibrate(folder / "Eva_static.trc", LearnOptions())
    for label, (segment, _) in CLUSTERS.items():
        assert found.markers.landmarks[label.lower()].segment == segment
    body = readers.read(folder / "Eva_walk.trc", LearnOptions(markers=found.markers), found.log_scales)
    apart = np.degrees(retarget.angles(body, retarget.measure(body)) - walk)[:, LEGS]
    moving = apart - np.nanmean(apart, axis=0)
    assert np.isfinite(apart).all() and np.sqrt((moving**2).mean()) < 2
    knees = [LEGS.index(ANGLES.index(f"{s}_knee_flexion")) for s in "lr"]
    assert np.abs(apart[:, knees].mean(axis=0)).max() < 4


def test_the_command_needs_the_static_trial_and_reports_it(laboratory, tmp_path, capsys):
    folder, _ = laboratory
    words = ["learn", str(folder / "Eva_walk.trc"), "-o", str(tmp_path / "m.gait"), "--activity", "any"]
    words += ["--segments", "none", "--components", "1"]
    assert cli.main(words) == 1
    assert "give the trial in which knees and ankles were marked as --static" in capsys.readouterr().err
    assert cli.main([*words, "--static", str(folder / "Eva_static.trc")]) == 0


def test_a_static_trial_in_the_folder_is_not_learnt(laboratory):
    folder, _ = laboratory
    options = LearnOptions(static=(str(folder / "Eva_static.trc"),), activity="any")
    shared = load.shared_lengths([(folder / "Eva_walk.trc", True)], options)
    assert shared == [None]
    assert len(load.load_all([(folder / "Eva_walk.trc", True)], options).sequences) == 1


def test_a_static_trial_without_known_knees_is_named(laboratory, tmp_path):
    labels = [*PELVIS, *CLUSTERS, *FEET]
    points = marked(labels, np.zeros((20, len(ANGLES))), travel=0.0)
    write_trc(tmp_path / "static.trc", labels, points)
    with pytest.raises(UserError, match=r"--static .*static.trc: no known marker .* at hips, knees"):
        static_trial.calibrate(tmp_path / "static.trc", LearnOptions())
    with pytest.raises(UserError, match=r"--static .*a.amc: is not .c3d or .trc"):
        static_trial.calibrate(tmp_path / "a.amc", LearnOptions())


def test_trials_serve_their_person_or_their_folder():
    paths = [Path(p) for p in ("x/S01_walk1.c3d", "x/S02_walk1.c3d", "y/run25.trc", "y/run35.trc", "z/a.amc")]
    people = ["S01", "S02", "y", "y", "z"]
    statics = [Path(p) for p in ("x/S02_static.c3d", "x/S01_static.c3d", "y/static.c3d")]
    assert static_trial.serving(paths, people, statics, ["S02", "S01", "q"]) == [
        statics[1], statics[0], statics[2], statics[2], None,
    ]  # fmt: skip
    mixed = [Path("d/RBDS001runT25.trc"), Path("d/RBDS002runT25.trc")]
    both = [Path("d/RBDS001static.trc"), Path("d/RBDS002static.trc")]
    assert static_trial.serving(mixed, ["d", "d"], both, ["d", "d"]) == both
    with pytest.raises(UserError, match=r"--static q/other.trc: there is no recording"):
        static_trial.serving(paths, people, [Path("q/other.trc")], ["other"])
