"""Keypoints of other tools are read: a walk written in each format comes back as the same keypoints."""

import json
import pickle

import numpy as np
import pytest
from walking_keypoints import SIZE, keypoints, view

import gait.cli
from gait.camera.camera import write_camera
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.detections import Clip
from gait.io.layouts import LAYOUTS, joint_named, points_of

FPS = 15.0
CAMERA = view()
WALK = keypoints(CAMERA, seconds=1.6)
OTHER = WALK.uv + (300.0, 5.0)  # another person beside, in fewer frames
FEWER = 10
JOINTS = keypoints_file.read  # the function under test, with the model's names
NAMES = WALK.names


def read(path, **clip):
    return keypoints_file.read(path, NAMES, clip=Clip(**{"fps": FPS} | clip))


def layout(count, uv, confidence=0.9):
    """Triples (P, 3) of a layout for joints (J, 2); points that are no joints lie at 7, 7."""
    points = np.full((count, 3), (7.0, 7.0, 0.8))
    for i, name in enumerate(points_of(count)):
        joint = joint_named(name)
        if joint in NAMES:
            points[i] = (*uv[NAMES.index(joint)], confidence)
    return points


def joints_of(count):
    return {joint_named(name) for name in points_of(count)} & set(NAMES)


def people(count, t):
    """Both people of a frame, the other one first."""
    return [*([layout(count, OTHER[t])] if t < FEWER else []), layout(count, WALK.uv[t])]


def openpose(folder, count, triples=people):
    folder.mkdir()
    for t in range(len(WALK.frame)):
        found = [{"person_id": [-1], "pose_keypoints_2d": p.ravel().tolist()} for p in triples(count, t)]
        name = folder / f"walk_{t:012d}_keypoints.json"
        name.write_text(json.dumps({"version": 1.3, "people": found}))
    return folder


def written(path, content):
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def alphapose(path, count, ids=True):
    found = []
    for t in range(len(WALK.frame)):
        for i, p in enumerate(people(count, t)[::-1]):
            entry = {"image_id": f"{t}.jpg", "category_id": 1, "keypoints": p.ravel().tolist(), "score": 2.9}
            found.append(entry | {"box": [1, 2, 3, 4], "idx": float(i) if ids else 0.0})
    return written(path, found)


def coco(path, named=False):
    names = (
        [[f"face_{i}" if name == "-" else name for i, name in enumerate(LAYOUTS[17][1].split())]]
        if named
        else [[]]
    )
    images = [
        {"id": 900 + t, "file_name": f"f_{t:04d}.png", "width": 1280, "height": 720}
        for t in WALK.frame.tolist()
    ]
    found = []
    for t in range(len(WALK.frame)):
        for i, p in enumerate(people(17, t)[::-1]):
            p[:, 2] = 2
            found.append(
                {"id": len(found), "image_id": 900 + t, "track_id": i, "keypoints": p.ravel().tolist()}
            )
    return written(
        path, {"images": images, "annotations": found, "categories": [{"id": 1, "keypoints": names[0]}]}
    )


def mmpose(path, meta, first):
    frames = []
    for t in range(len(WALK.frame)):
        instances = [
            {"keypoints": p[:, :2].tolist(), "keypoint_scores": p[:, 2].tolist(), "bbox": [[0, 0, 1, 1]]}
            for p in people(26, t)
        ]
        frames.append({"frame_id": t + first, "instances": instances})
    names = {str(i): name for i, name in enumerate(LAYOUTS[26][1].split())}
    return written(
        path, {"meta_info": {"keypoint_id2name": names}, "instance_info": frames} if meta else frames
    )


def mediapipe(path, form):
    frames = []
    for t in range(len(WALK.frame)):
        shares = (layout(33, WALK.uv[t])[:, :2] + 0.5) / SIZE
        points = [{"x": x, "y": y, "z": 0.0, "visibility": 0.9} for x, y in shares.tolist()]
        timed = {"timestamp_ms": 1000 * t / FPS, "landmarks": points}
        frames.append({"list": points, "pose": {"pose_landmarks": [points]}, "time": timed}[form])
    return written(path, {"frames": frames} if form == "time" else frames)


def dlc_rows(individuals):
    """Header lines and rows of DeepLabCut."""
    parts = [(who, name) for who in individuals for name in NAMES]
    columns = [(who, name, axis) for who, name in parts for axis in ("x", "y", "likelihood")]
    values = []
    for t in range(len(WALK.frame)):
        row = []
        for who, name in parts:
            uv = (OTHER if who == "b" else WALK.uv)[t, NAMES.index(name)]
            row += [np.nan] * 3 if who == "b" and t >= FEWER else [*uv, 0.9]
        values.append(row)
    return columns, np.array(values)


def dlc_csv(path, individuals=("",)):
    columns, values = dlc_rows(individuals)
    lines = [",".join(["scorer", *["net"] * len(columns)])]
    if individuals != ("",):
        lines.append(",".join(["individuals", *(who for who, _, _ in columns)]))
    lines.append(",".join(["bodyparts", *(name for _, name, _ in columns)]))
    lines.append(",".join(["coords", *(axis for _, _, axis in columns)]))
    lines += [
        ",".join([str(t), *("" if np.isnan(v) else f"{v:.6f}" for v in row)]) for t, row in enumerate(values)
    ]
    return written(path, "\n".join(lines) + "\n")


def dlc_h5(path, form, individuals=("",)):
    """As pandas and PyTables lay it out (looked up in files of pandas 2 and 3)."""
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: extra h5")
    columns, values = dlc_rows(individuals)
    levels = (
        [("net", *column) for column in columns]
        if individuals != ("",)
        else [("net", *c[1:]) for c in columns]
    )
    with h5py.File(path, "w") as file:
        group = file.create_group("df_with_missing")
        group.attrs["pandas_type"] = np.bytes_("frame_table" if form == "table" else "frame")
        if form == "table":
            kind = [("index", "<i8"), ("values_block_0", "<f8", (len(levels),))]
            rows = [(t, row) for t, row in enumerate(values)]
            group["table"] = np.array(rows, kind)
            group.attrs["non_index_axes"] = np.bytes_(pickle.dumps([(1, levels)], protocol=0))
            return path
        group.attrs["nblocks"], group.attrs["axis0_nlevels"] = 1, len(levels[0])
        for k in range(len(levels[0])):
            names = sorted({level[k] for level in levels})
            group[f"block0_items_level{k}"] = np.bytes_(names)
            group[f"block0_items_label{k}"] = np.int8([names.index(level[k]) for level in levels])
        group["axis1"], group["block0_values"] = np.arange(len(values)), values
    return path


def sleap_csv(path):
    head = ["track", "frame_idx", "instance.score", *(f"{n}.{a}" for n in NAMES for a in ("x", "y", "score"))]
    lines = [",".join(head)]
    for t in range(len(WALK.frame)):
        for who, uv in (("track_0", WALK.uv[t]), *([("track_1", OTHER[t])] if t < FEWER else [])):
            cells = [f"{v:.6f}" for point in uv for v in (*point, 0.9)]
            lines.append(",".join([who, str(t), "0.9", *cells]))
    return written(path, "\n".join(lines) + "\n")


def sleap_h5(path, dims):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: extra h5")
    tracks = np.stack([WALK.uv, OTHER], axis=1)  # frame, track, node, xy
    tracks[FEWER:, 1] = np.nan
    order = ["frame", "track", "node", "xy"]
    stored = dims or ["track", "xy", "node", "frame"]
    with h5py.File(path, "w") as file:
        file["tracks"] = tracks.transpose([order.index(d) for d in stored])
        scores = np.full(tracks.shape[:3], 0.9)
        file["point_scores"] = scores.transpose([order.index(d) for d in stored if d != "xy"])
        file["node_names"], file["track_names"] = np.bytes_(NAMES), np.bytes_(["track_0", "track_1"])
        if dims:
            file["tracks"].attrs["dims"] = json.dumps(dims)
    return path


def trc(path, unit):
    count, names = len(WALK.frame), ["".join(w.capitalize() for w in name.split("_")) for name in NAMES]
    lines = [
        "PathFileType\t4\t(X/Y/Z)\twalk.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{FPS:g}\t{FPS:g}\t{count}\t{len(names)}\t{unit}\t{FPS:g}\t0\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t\t",
        "\t\t" + "\t".join(f"X{i}\tY{i}\tZ{i}" for i in range(1, len(names) + 1)),
    ]
    for t in range(count):
        cells = [f"{v:.6f}" for uv in WALK.uv[t] for v in (*uv, 0.0)]
        lines.append("\t".join([str(t + 1), f"{t / FPS:.6f}", *cells]))
    return written(path, "\n".join(lines) + "\n")


CASES = {
    "openpose_body_25": (lambda p: openpose(p / "json", 25), joints_of(25), 0.9),
    "openpose_coco_18": (lambda p: openpose(p / "json", 18), joints_of(18), 0.9),
    "openpose_coco_17": (lambda p: openpose(p / "json", 17), joints_of(17), 0.9),
    "openpose_halpe_26": (lambda p: openpose(p / "json", 26), joints_of(26), 0.9),
    "alphapose_17": (lambda p: alphapose(p / "a.json", 17), joints_of(17), 0.9),
    "alphapose_136_no_ids": (lambda p: alphapose(p / "a.json", 136, ids=False), joints_of(136), 0.9),
    "coco": (lambda p: coco(p / "a.json"), joints_of(17), 1.0),
    "coco_named": (lambda p: coco(p / "a.json", named=True), joints_of(17), 1.0),
    "mmpose_demo": (lambda p: mmpose(p / "a.json", True, 1), joints_of(26), 0.9),
    "mmpose_inferencer": (lambda p: mmpose(p / "a.json", False, 0), joints_of(26), 0.9),
    "mediapipe": (lambda p: mediapipe(p / "a.json", "list"), joints_of(33), 0.9),
    "mediapipe_tasks": (lambda p: mediapipe(p / "a.json", "pose"), joints_of(33), 0.9),
    "mediapipe_times": (lambda p: mediapipe(p / "a.json", "time"), joints_of(33), 0.9),
    "dlc_csv": (lambda p: dlc_csv(p / "a.csv"), set(NAMES), 0.9),
    "dlc_csv_many": (lambda p: dlc_csv(p / "a.csv", ("a", "b")), set(NAMES), 0.9),
    "dlc_h5_table": (lambda p: dlc_h5(p / "a.h5", "table"), set(NAMES), 0.9),
    "dlc_h5_fixed": (lambda p: dlc_h5(p / "a.h5", "fixed", ("a", "b")), set(NAMES), 0.9),
    "sleap_csv": (lambda p: sleap_csv(p / "a.csv"), set(NAMES), 0.9),
    "sleap_h5": (lambda p: sleap_h5(p / "a.h5", None), set(NAMES), 0.9),
    "sleap_h5_dims": (lambda p: sleap_h5(p / "a.h5", ["frame", "track", "node", "xy"]), set(NAMES), 0.9),
    "sports2d_trc": (lambda p: trc(p / "a.trc", "m"), set(NAMES), 1.0),
    "pixel_trc": (lambda p: trc(p / "a.trc", "px"), set(NAMES), 1.0),
}


@pytest.mark.parametrize("case", CASES)
def test_a_walk_comes_back_from_every_format(case, tmp_path):
    make, joints, confidence = CASES[case]
    found, _ = read(make(tmp_path), size=SIZE)
    assert set(found.names) == joints and len(joints) >= 12
    assert found.frame.tolist() == WALK.frame.tolist()
    assert np.allclose(found.time, WALK.time, atol=1e-6)
    expected = WALK.uv[:, [NAMES.index(name) for name in found.names]]
    assert np.allclose(found.uv, expected, atol=1e-5)
    assert np.allclose(found.confidence, confidence, atol=1e-9)


@pytest.mark.parametrize("case", ["openpose_body_25", "alphapose_17", "sleap_h5", "dlc_csv_many"])
def test_the_other_person_is_chosen_by_id_and_both_are_listed(case, tmp_path, capsys):
    make, _, _ = CASES[case]
    path = make(tmp_path)
    read(path)
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1 and "has 2 people: " in printed and "--person" in printed
    other = {"openpose_body_25": "0", "alphapose_17": "1", "sleap_h5": "track_1", "dlc_csv_many": "b"}[case]
    found, _ = read(path, person=other)
    assert found.frame.tolist() == list(range(FEWER))
    assert np.allclose(found.uv, OTHER[:FEWER, [NAMES.index(name) for name in found.names]], atol=1e-5)
    with pytest.raises(UserError, match=r"has no person 77; --person is one of .*\(24 frames\)"):
        read(path, person="77")


def test_times_come_from_the_video_the_rate_or_the_file_and_else_are_asked_for(tmp_path):
    path = openpose(tmp_path / "json", 25)
    times = 0.5 + np.arange(40) / 20
    assert np.allclose(read(path, fps=None, times=times)[0].time, times[: len(WALK.time)])
    with pytest.raises(UserError, match="has no times; give --fps HZ, or --video"):
        read(path, fps=None)
    with pytest.raises(UserError, match="has frames 0 to 23, the video 0 to 9"):
        read(path, fps=None, times=times[:10])
    timed = mediapipe(tmp_path / "a.json", "time")
    assert np.allclose(read(timed, fps=None, size=SIZE)[0].time, WALK.time)
    with pytest.raises(UserError, match="fractions of the picture's width and height; give --video"):
        read(timed)


def test_people_without_ids_are_followed_through_each_others_places_in_the_list(tmp_path):
    def shuffled(count, t):
        both = people(count, t)
        return both[::-1] if t % 3 else both

    found, _ = read(openpose(tmp_path / "json", 25, shuffled))
    expected = WALK.uv[:, [NAMES.index(name) for name in found.names]]
    assert np.allclose(found.uv, expected, atol=1e-5)


def test_points_that_are_not_visible_are_left_out(tmp_path):
    def gone(count, t):
        points = layout(count, WALK.uv[t])
        points[points_of(count).index("l_knee")] = 0, 0, 0
        points[points_of(count).index("r_knee"), 2] = 0.05
        points[points_of(count).index("r_ankle")] = -1, -1, 0.7
        return [points]

    found, ignored = read(openpose(tmp_path / "json", 25, gone))
    missing = {name for i, name in enumerate(found.names) if np.isnan(found.uv[:, i]).all()}
    assert missing == {"l_knee", "r_knee", "r_ankle"}
    assert ignored == ["pelvis"]  # NAMES has none; points of the layout that are no joints have no names


UNKNOWN = {
    "hand": ([{"image_id": "1.jpg", "keypoints": [1.0, 2.0, 0.5] * 21}], "has 21 points without names"),
    "no_person": ({"version": 1.3, "people": []}, "has no frame number|contains no person"),
    "no_list": ({"people": 3}, "people is not a list|no frame number"),
    "numbers": ([[1, 2], [3, 4]], "contains no person"),
    "landmark": ([{"landmarks": [{"x": "a", "y": 1}]}], "no numbers x and y"),
    "image": (
        {"images": [], "annotations": [{"image_id": 3, "keypoints": [1, 2, 2]}]},
        "image_id 3 is not in images",
    ),
    "shape": (
        {"instance_info": [{"frame_id": 1, "instances": [{"keypoints": 5, "keypoint_scores": [1]}]}]},
        "do not match",
    ),
    "mixed": (
        [{"image_id": 1, "keypoints": [1.0] * 51}, {"image_id": 2, "keypoints": [1.0] * 78}],
        "17 points and 26",
    ),
    "unlike": ({"images": 5, "annotations": []}, "in an unknown layout"),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_unknown_layouts_are_refused_in_one_line(case, tmp_path):
    content, words = UNKNOWN[case]
    with pytest.raises(UserError, match=words) as caught:
        read(written(tmp_path / "a.json", content))
    assert str(tmp_path / "a.json") in str(caught.value) and "\n" not in str(caught.value)


def test_damaged_files_end_in_one_line(tmp_path):
    rng = np.random.default_rng(3)
    sources = [alphapose(tmp_path / "a.json", 17), dlc_csv(tmp_path / "b.csv"), sleap_csv(tmp_path / "c.csv"),
               trc(tmp_path / "d.trc", "px"), mmpose(tmp_path / "e.json", True, 1)]  # fmt: skip
    refused = 0
    for source in sources:
        content = source.read_bytes()
        for _ in range(12):
            damaged = bytearray(content[: rng.integers(200, 4000)] if rng.random() < 0.5 else content)
            for at in rng.integers(0, len(damaged), 4):
                damaged[at] = rng.integers(1, 127)
            path = tmp_path / f"damaged{source.suffix}"
            path.write_bytes(damaged)
            try:
                read(path)
            except UserError as error:
                refused += 1
                assert "\n" not in str(error)
    assert refused > 10


def test_no_object_of_a_pickle_is_made(tmp_path):
    h5py = pytest.importorskip("h5py", reason="h5py is not installed: extra h5")
    path = dlc_h5(tmp_path / "a.h5", "table")
    with h5py.File(path, "r+") as file:
        file["df_with_missing"].attrs["non_index_axes"] = np.bytes_(pickle.dumps(Clip, protocol=0))
    with pytest.raises(UserError, match="contains an object gait.io.detections.Clip"):
        read(path)


@pytest.mark.parametrize(
    ("name", "joint"),
    [
        *(("LKnee", "l_knee"), ("left_knee", "l_knee"), ("knee_l", "l_knee"), ("RBigToe", "r_toe")),
        *(("rightAnkle", "r_ankle"), ("Hip", "pelvis"), ("lhip", "l_hip"), ("leftshoulder", "l_shoulder")),
        *(
            ("l_small_toe", ""),
            ("Neck", ""),
            ("Head", "head_top"),
            ("knee", ""),
            ("LR_knee", ""),
            ("nose", ""),
        ),
    ],
)
def test_names_of_joints(name, joint):
    assert joint_named(name) == joint


def test_lift_takes_a_folder_and_the_command_names_the_person(tmp_path, capsys):
    camera = tmp_path / "cam.json"
    write_camera(camera, CAMERA)
    folder, out = openpose(tmp_path / "json", 26), tmp_path / "out.csv"
    given = [
        "lift",
        str(folder),
        "--camera",
        str(camera),
        "-o",
        str(out),
        "--fps",
        "15",
        "--method",
        "segment",
    ]
    assert gait.cli.main(given) == 0
    assert len(out.read_text().splitlines()) == len(WALK.frame) + 1
    assert "took 1 (--person)" in capsys.readouterr().err
    assert gait.cli.main([*given, "--video", "a.mp4"]) == 2
    assert "--fps and --video exclude each other" in capsys.readouterr().err


def test_own_files_need_neither_person_nor_rate(tmp_path):
    keypoints_file.write(tmp_path / "a.csv", WALK)
    with pytest.raises(UserError, match="leave out --person and --fps"):
        read(tmp_path / "a.csv")
