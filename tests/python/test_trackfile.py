"""Track, truth and TRC files."""

import resource
import signal
from dataclasses import replace

import numpy as np
import pytest

import gait.cli
from gait import Estimate, Flag, Frame, Model, State, TrackStatus, UserError
from gait.body.skeleton import EVAL15, JOINTS
from gait.io.track_file import TrackWriter, fault_of, read_track, read_truth
from gait.io.trc import write_trc
from gait.motion.parameters import write_rows

MODEL = Model()
HEADER = (
    "frame,time,status,phase,stride_hz,heading_rad,stature_m,speed_m_s,ess,log_evidence,c_1,c_2,c_3,c_4,c_5,"
    "pelvis_x,pelvis_y,pelvis_z,pelvis_sx,pelvis_sy,pelvis_sz,"
    "neck_x,neck_y,neck_z,neck_sx,neck_sy,neck_sz,"
    "head_top_x,head_top_y,head_top_z,head_top_sx,head_top_sy,head_top_sz,"
)
ORDER = [
    *("pelvis", "neck", "head_top", "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist"),
    *("l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle", "l_toe", "r_toe", "l_heel", "r_heel"),
]


def estimate(i):
    rng = np.random.default_rng(i)
    return Estimate(
        utime=i * 33333,
        frame=i,
        status=TrackStatus(i % 4),
        flags=Flag(0),
        log_evidence=-80.5 - i,
        ess=123.4,
        phase_r=0.9,
        hypothesis_weight=1.0,
        speed=1.25,
        mean=State(phase=0.1 * i, stride_hz=0.9, stature=1.7, heading=-1.0, coef=rng.normal(size=5)),
        sd=State(),
        best=State(),
        joints=rng.normal(size=(19, 3)),
        joint_sd=rng.uniform(0.01, 0.1, (19, 3)),
        angles=rng.normal(size=24),
        joint_names=MODEL.joint_names,
    )


def write(path, count=4):
    with TrackWriter(path, 5, MODEL.joint_names, MODEL.angle_names) as rows:
        for i in range(count):
            rows.write(Frame(10 + i, (10 + i) / 30, None), estimate(i))


def test_every_column_of_a_track_and_of_a_reports_tables_has_its_type_in_parquet(tmp_path):
    """A film's digest may look like a number; the frames of events are between frames."""
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: extra parquet")
    names = MODEL.joint_names, MODEL.angle_names, ("walk", "stand")
    with TrackWriter(tmp_path / "t.csv", 5, *names, range(8), person=2, film="12e4") as rows:
        for i in range(8):
            one = replace(estimate(i), reason="legs cross", class_probability=np.array([0.75, 0.25]))
            rows.write(Frame(i, i / 30, None), one)
    events = [{"event": "right_heel_strike", "time_s": 0.5, "frame": 15.25, "sd_s": np.nan}]
    strides = [{"side": "left", "start_s": 0.5, "sure": True}]
    write_rows(tmp_path / "events.csv", events)
    write_rows(tmp_path / "strides.csv", strides)
    found = {}
    for table in ("t", "events", "strides"):
        out = tmp_path / f"{table}.parquet"
        assert gait.cli.main(["export", str(tmp_path / f"{table}.csv"), "-o", str(out)]) == 0
        found[table] = parquet.read_table(out).to_pylist()[-2:]
    ambiguous, lost = found["t"]
    assert (ambiguous["status"], ambiguous["reason"], lost["reason"]) == ("ambiguous", "legs cross", None)
    assert (lost["film"], lost["person"], lost["last_frame"]) == ("12e4", 2, 7)
    assert (lost["motion_class"], lost["p_walk"], lost["frame"]) == ("walk", 0.75, 7)
    assert found["events"] == [events[0] | {"sd_s": None}]
    assert found["strides"] == [strides[0] | {"sure": 1.0}]


@pytest.mark.parametrize("count", [0, 3])
def test_rows_of_an_interrupted_track_are_kept(tmp_path, count):
    with (
        pytest.raises(KeyboardInterrupt),
        TrackWriter(tmp_path / "t.csv", 5, MODEL.joint_names, MODEL.angle_names) as rows,
    ):
        for i in range(count):
            rows.write(Frame(i, i / 30, None), estimate(i))
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.iterdir()] == ["t.unfinished.csv"][: bool(count)]
    assert not count or read_track(tmp_path / "t.unfinished.csv").frame.tolist() == [0, 1, 2]


def test_a_full_disk_keeps_whole_rows(tmp_path):
    write(tmp_path / "t.csv")
    whole = (tmp_path / "t.csv").stat().st_size
    (tmp_path / "t.csv").unlink()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (whole - 100, limits[1]))
        with pytest.raises(UserError, match="t.csv: File too large; choose another place"):
            write(tmp_path / "t.csv")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)
    assert [p.name for p in tmp_path.iterdir()] == ["t.unfinished.csv"]
    assert read_track(tmp_path / "t.unfinished.csv").frame.tolist() == [10, 11, 12]


def test_header_is_that_of_the_interface(tmp_path):
    write(tmp_path / "t.csv")
    header, first, *_ = (tmp_path / "t.csv").read_text().split("\n")
    assert header.startswith(HEADER)
    names = header.split(",")
    joints = [name[: -len("_sx")] for name in names if name.endswith("_sx")]
    assert joints == ORDER == JOINTS and ORDER[:15] == EVAL15
    spreads = [
        "phase_sd",
        "stride_hz_sd",
        "heading_sd_rad",
        "stature_sd_m",
        *(f"c_{k}_sd" for k in range(1, 6)),
    ]
    assert names[-33:-9] == [f"{name}_deg" for name in MODEL.angle_names] and names[-9:] == spreads
    assert len(names) == 10 + 5 + 6 * 19 + 24 + 9 == len(first.split(","))
    assert first.startswith("10,0.333333,init,0.000000,0.900000,-1.000000,1.700000,1.250000,123.40,-80.5000,")
    assert f"{np.degrees(estimate(0).angles[-1]):.3f}" == first.split(",")[-10]


def test_what_was_written_is_read_back(tmp_path):
    write(tmp_path / "t.csv")
    track = read_track(tmp_path / "t.csv")
    assert track.frame.tolist() == [10, 11, 12, 13]
    assert track.status == ["init", "tracking", "ambiguous", "lost"]
    np.testing.assert_allclose(track.time, np.arange(10, 14) / 30, atol=1e-6)
    np.testing.assert_allclose(track.phase, [0, 0.1, 0.2, 0.3])
    for i in range(4):
        for k, name in enumerate(JOINTS):
            np.testing.assert_allclose(track.places[name][i], estimate(i).joints[k], atol=6e-6)
            np.testing.assert_allclose(track.sd[name][i], estimate(i).joint_sd[k], atol=6e-6)
    np.testing.assert_allclose(track.eval15()[2, 14], estimate(2).joints[14], atol=6e-6)


def test_a_track_cut_anywhere_is_refused_or_has_fewer_rows(tmp_path):
    write(tmp_path / "t.csv", 3)
    data, cut = (tmp_path / "t.csv").read_bytes(), tmp_path / "cut.csv"
    whole = read_track(tmp_path / "t.csv")
    counts = set()
    for size in range(len(data)):
        cut.write_bytes(data[:size])
        try:
            track = read_track(cut)
        except UserError as exc:
            assert str(exc).startswith(f"{cut}: ") and "\n" not in str(exc)
            continue
        count = len(track.frame)
        counts.add(count)
        assert data[:size].endswith(b"\n")
        assert np.array_equal(track.eval15(), whole.eval15()[:count])
    assert counts == {1, 2}


def test_another_joint_order_of_the_model_is_sorted_out(tmp_path):
    turned = MODEL.joint_names[::-1]
    with TrackWriter(tmp_path / "t.csv", 5, turned, MODEL.angle_names) as rows:
        rows.write(Frame(0, 0.0, None), estimate(0))
    np.testing.assert_allclose(
        read_track(tmp_path / "t.csv").places["pelvis"][0], estimate(0).joints[18], atol=6e-6
    )
    with pytest.raises(UserError, match="model: has no joint l_toe"):
        TrackWriter(tmp_path / "t.csv", 5, tuple(n for n in turned if n != "l_toe"), MODEL.angle_names)


def test_an_error_leaves_no_file(tmp_path):
    with pytest.raises(RuntimeError), TrackWriter(tmp_path / "t.csv", 5, MODEL.joint_names, ()) as rows:
        rows.write(Frame(0, 0.0, None), estimate(0))
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def spoil(path, change):
    lines = path.read_text().split("\n")
    change(lines)
    path.write_text("\n".join(lines))


@pytest.mark.parametrize(
    "change, words",
    [
        (
            lambda s: s.__setitem__(2, s[2].replace("tracking", "dancing")),
            "line 3: status 'dancing' is not one of",
        ),
        (
            lambda s: s.__setitem__(2, s[2] + ",1"),
            "line 3 has 163 cells, the header 162; cut off. write it again",
        ),
        (
            lambda s: s.__setitem__(3, s[3].replace("0.200000", "nan", 1)),
            "line 4: phase is 'nan'; give a finite",
        ),
        (lambda s: s.__setitem__(0, s[0].replace("l_knee_sx", "x")), "column l_knee_sx is missing"),
        (
            lambda s: s.__setitem__(2, "9" + s[2][2:]),
            r"line \d+: frame is \d+; it must be whole numbers that increase",
        ),
        (lambda s: s.__delitem__(slice(1, None)), "has no rows"),
        (
            lambda s: s.__setitem__(slice(None), ['{"width": 640,', '"R": [1,', "0]}"]),
            "not a track file, .* give",
        ),
    ],
)
def test_damaged_tracks_are_reported(change, words, tmp_path):
    write(tmp_path / "t.csv")
    spoil(tmp_path / "t.csv", change)
    with pytest.raises(UserError, match=f"t.csv: {words}"):
        read_track(tmp_path / "t.csv")


def with_classes(path, names, *rows):
    """Write a track with the columns of motion classes, given the cells of each row."""
    write(path, len(rows))
    lines = path.read_text().splitlines()
    path.write_text("\n".join(f"{a},{b}" for a, b in zip(lines, (names, *rows), strict=True)) + "\n")
    return path


def test_classes_of_motion_are_read_with_their_probabilities(tmp_path):
    rows = "stand,0.3333,0.6666", ",,", "walk,1.0000,0.0000"
    track = read_track(with_classes(tmp_path / "t.csv", "motion_class,p_walk,p_stand", *rows))
    assert track.classes == ("walk", "stand") and track.motion_class == ["stand", "", "walk"]
    np.testing.assert_array_equal(track.numbers["p_walk"], [0.3333, np.nan, 1])


@pytest.mark.parametrize(
    ("names", "row", "words"),
    [
        ("motion_class", "walk", "column motion_class needs a column p_<class> for each class; give the"),
        ("motion_class,p_walk,p_stand", "fly,0.5,0.5", "line 3: motion_class 'fly' is not one of walk stand"),
        ("motion_class,p_walk,p_stand", "walk,7,0", "line 3: p_walk is '7'; give a probability, from 0 to 1"),
        ("motion_class,p_walk,p_stand", "walk,1,-0.1", "line 3: p_stand is '-0.1'; give a probability"),
        ("motion_class,p_walk,p_stand", "walk,0.8,0.4", r"line 3: p_walk \+ p_stand is 1.2; give prob"),
        ("motion_class,p_walk,p_stand", "walk,1,", "line 3: of motion_class p_walk p_stand some are empty;"),
        ("motion_class,p_walk,p_stand", ",1,0", "line 3: of motion_class p_walk p_stand some are empty;"),
    ],
)
def test_classes_of_motion_that_cannot_be_are_named(names, row, words, tmp_path):
    good = "walk" if names == "motion_class" else "walk,1,0"
    with pytest.raises(UserError, match=f"t.csv: {words}"):
        read_track(with_classes(tmp_path / "t.csv", names, good, row))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"joints": (4, 1)}, f"{MODEL.joint_names[4]}_y is nan"),
        ({"joint_sd": (18, 2)}, f"{MODEL.joint_names[18]}_sz is nan"),
        ({"angles": 6}, "angle_deg 7 is nan"),
        ({"coef": 2}, "c_3 is nan"),
        ({"pelvis": 1}, "pelvis_y of the state is nan"),
        ({"heading": None}, "heading_rad is nan"),
    ],
)
def test_the_number_that_cannot_be_is_named(change, words):
    one = estimate(0)
    assert fault_of(one) is None
    ((name, at),) = change.items()
    if at is None:
        one.mean.heading = np.nan
    else:
        getattr(one if hasattr(one, name) else one.mean, name)[at] = np.nan
    assert fault_of(one) == words


def test_more_than_a_million_particles_can_be_read_back(tmp_path):
    with TrackWriter(tmp_path / "t.csv", 5, MODEL.joint_names, MODEL.angle_names) as rows:
        rows.write(Frame(0, 0.0, None), replace(estimate(0), ess=float(1 << 20)))
    assert read_track(tmp_path / "t.csv").numbers["ess"] == [1 << 20]


def test_a_negative_sd_is_named(tmp_path):
    write(tmp_path / "t.csv")

    def negate(lines):
        cells = lines[2].split(",")
        cells[lines[0].split(",").index("l_knee_sy")] = "-0.25"
        lines[2] = ",".join(cells)

    spoil(tmp_path / "t.csv", negate)
    with pytest.raises(UserError, match=r"t.csv: line 3: l_knee_sy is '-0.25'; give 0 or more"):
        read_track(tmp_path / "t.csv")


def test_truth_needs_eval15_and_takes_feet_if_there(tmp_path):
    write(tmp_path / "t.csv")  # a track has the columns of a truth, and more
    truth = read_truth(tmp_path / "t.csv")
    assert set(truth.places) == set(JOINTS)
    spoil(tmp_path / "t.csv", lambda s: s.__setitem__(0, s[0].replace("l_heel_x", "q")))
    assert "l_heel" not in read_truth(tmp_path / "t.csv").places
    spoil(tmp_path / "t.csv", lambda s: s.__setitem__(0, s[0].replace("neck_y", "p")))
    with pytest.raises(UserError, match="t.csv: column neck_y is missing; a truth file needs it"):
        read_truth(tmp_path / "t.csv")
    with pytest.raises(UserError, match="none.csv: no such truth file"):
        read_truth(tmp_path / "none.csv")


def test_trc_has_opensims_frame_and_counts(tmp_path):
    joints = np.arange(12, dtype=float).reshape(2, 2, 3)
    write_trc(tmp_path / "o.trc", ("a", "b"), np.array([0.5, 0.6]), joints, 10.0)
    lines = (tmp_path / "o.trc").read_text().split("\n")
    assert lines[0] == "PathFileType\t4\t(X/Y/Z)\to.trc"
    assert lines[2].split("\t") == ["10", "10", "2", "2", "m", "10", "1", "2"]
    assert lines[3] == "Frame#\tTime\ta\t\t\tb" and lines[4] == "\t\tX1\tY1\tZ1\tX2\tY2\tZ2"
    # world (0, 1, 2), z up, is (1, 2, 0) with y up
    assert lines[6].split("\t") == [
        "1",
        "0.500000",
        "1.00000",
        "2.00000",
        "0.00000",
        "4.00000",
        "5.00000",
        "3.00000",
    ]
    assert len(lines) == 9 and lines[8] == ""
