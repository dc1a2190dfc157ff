"""Keypoint files of other tools are recognised by content, whatever their suffix, and read or rejected."""

import json
from pathlib import Path

import numpy as np
import pytest

import gait.cli
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.detections import Clip
from gait.io.detector_formats import reader_of

FAULTS = Path(__file__).resolve().parents[2] / "../shared/data/faults/detector_formats"
PERSON = {"keypoints": [1, 2, 0.5, 3, 4, 0.6], "score": 2.5}
POINT = {"x": 0.5, "y": 0.4, "z": 0.0, "visibility": 0.9}

READ = {
    "alphapose": (json.dumps([{"image_id": "0.jpg", "category_id": 1, **PERSON}]), "read_json_file"),
    "coco": (json.dumps({"images": [], "annotations": [PERSON], "categories": []}), "read_json_file"),
    "openpose": (
        json.dumps({"version": 1.3, "people": [{"pose_keypoints_2d": [1, 2, 0.5]}]}),
        "read_json_file",
    ),
    "mmpose": (
        json.dumps({"meta_info": {}, "instance_info": [{"frame_id": 1, "instances": [PERSON]}]}),
        "read_json_file",
    ),
    "mediapipe": (json.dumps({"frames": [{"landmarks": [POINT]}]}), "read_json_file"),
    "lines": ("\ufeff" + json.dumps({"frame": 0, "keypoints": [[1, 2]]}) + "\n{}", "read_json_file"),
    "dlc": (
        "scorer,D,D,D\nbodyparts,l_knee,l_knee,l_knee\ncoords,x,y,likelihood\n0,1,2,0.9\n",
        "read_dlc_csv",
    ),
    "dlc_crlf": ("scorer,D,D\r\nbodyparts,nose,nose\r\ncoords,x,y\r\n0,1,2\r\n", "read_dlc_csv"),
    "dlc_many": ("scorer,D,D\nindividuals,a,a\nbodyparts,nose,nose\ncoords,x,y\n0,1,2\n", "read_dlc_csv"),
    "sleap": ("track,frame_idx,instance.score,nose.x,nose.y,nose.score\n,0,0.9,1,2,0.9\n", "read_sleap_csv"),
    "h5": ("\x89HDF", "read_h5"),
    "trc": ("PathFileType\t4\nDataRate\tNumMarkers\tUnits\n30\t2\tm\n", "read_pixel_trc"),
}
REFUSED = {
    "yolo": (
        json.dumps([{"name": "person", "class": 0, "keypoints": {"x": [1], "y": [2]}}]),
        "JSON from Ultralytics",
    ),
    "sleap": ("track,frame_idx,score\n0,1,2\n", "SLEAP without columns"),
    "dlc": ("scorer,D,D\nbodyparts,nose,nose\n0,1,2\n", "DeepLabCut without its line coords"),
    "long": ("frame,keypoint,x,y,score\n0,nose,1,2,0.9\n", "one row per point"),
    "mediapipe": ("frame,landmark_id,x,y,visibility\n0,1,0.2,0.3,0.9\n", "MediaPipe, one row per point"),
    "numbered": ("frame,x1,y1,c1,x2,y2,c2\n0,1,2,0.9,3,4,0.9\n", "numbered points"),
    "wide": ("frame,time,nose_x,nose_y,knee_x,knee_y\n0,0,1,2,3,4\n", "columns <joint>_x,<joint>_y"),
    "track": ("frame,time,neck_x,neck_y,neck_z\n0,0,1,2,3\n", "3-D positions"),
    "labels": ("0 0.5 0.5 0.2 0.6 " + " ".join(["0.4 0.5 0.9"] * 17) + "\n", "YOLO labels"),
}
MOTION = {
    "vicon": ("Trajectories\n100\n,,LASI,,\nFrame,Sub Frame,X,Y,Z\n1,0,1,2,3\n", "3-D motion of Vicon"),
    "bvh": ("HIERARCHY\nROOT Hips\n", "3-D motion of a .bvh"),
    "amc": ("#!OML:ASF F:\\a.ASF\n:FULLY-SPECIFIED\n:DEGREES\n1\n", "3-D motion of an .asf or .amc"),
    "mot": ("Coordinates\nversion=1\nendheader\ntime\tpelvis_tx\n", "3-D motion of OpenSim"),
    "c3d": ("\x02P\x10\0", "3-D motion of a .c3d"),
    "other": ("Sheet,1\nwhatever,2,3,4\n", "is no table of keypoints, its first line is 'Sheet'.*DeepLabCut"),
}
BINARY = {
    "pkl": (b"\x80\x04\x95", "pickle"),
    "npz": (b"PK\x03\x04\x14", "archive"),
    "npy": (b"\x93NUMPY\x01", "numpy"),
}


@pytest.mark.parametrize("suffix", [".json", ".csv", ".txt", ".dat"])
@pytest.mark.parametrize("kind", READ)
def test_files_of_other_tools_are_recognised_whatever_their_suffix(kind, suffix, tmp_path):
    text, reader = READ[kind]
    path = tmp_path / f"file{suffix}"
    path.write_text(text, newline="", encoding="latin-1" if kind == "h5" else "utf-8")
    assert reader_of(path).__name__ == reader


@pytest.mark.parametrize("suffix", [".json", ".csv"])
@pytest.mark.parametrize("kind", REFUSED)
def test_those_that_are_not_read_are_named(kind, suffix, tmp_path):
    text, words = REFUSED[kind]
    path = tmp_path / f"file{suffix}"
    path.write_text(text, newline="")
    with pytest.raises(UserError, match=f"(?s){words}.*keypoints are CSV with one row per frame"):
        reader_of(path)


@pytest.mark.parametrize("kind", BINARY)
def test_other_files_are_named_by_their_first_bytes(kind, tmp_path):
    (tmp_path / "a.bin").write_bytes(BINARY[kind][0] + bytes(100))
    with pytest.raises(UserError, match=BINARY[kind][1]):
        reader_of(tmp_path / "a.bin")


@pytest.mark.parametrize("kind", MOTION)
def test_motion_and_unknown_tables_are_named(kind, tmp_path):
    text, words = MOTION[kind]
    path = tmp_path / "a.csv"
    path.write_text(text, newline="")
    with pytest.raises(UserError, match=words):
        keypoints_file.read(path, ("neck",), clip=Clip(fps=30))


@pytest.mark.parametrize("suffix", [".json", ".h5", ".mat"])
def test_data_that_are_no_keypoints_are_not_called_a_video(suffix, tmp_path, capsys):
    path = tmp_path / f"a{suffix}"
    path.write_text("hello")
    assert gait.cli.main(["lift", str(path), "--height", "1.7", "-o", str(tmp_path / "a.csv")]) == 1
    assert "is neither a video nor known keypoints; keypoints are CSV" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["yolo", "long", "track"])
@pytest.mark.parametrize("suffix", [".json", ".csv"])
def test_lift_refuses_them_in_one_line(kind, suffix, tmp_path, capsys):
    path = tmp_path / f"file{suffix}"
    path.write_text(REFUSED[kind][0])
    assert gait.cli.main(["lift", str(path), "-o", str(tmp_path / "a.csv")]) == 1
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1 and f"{path}: is " in printed and "--placement" not in printed
    assert not (tmp_path / "a.csv").exists()


@pytest.mark.parametrize(
    "text",
    [
        "frame,time,neck_u,neck_v,neck_c,hand_x,hand_y\n0,0,1,2,1,3,4\n",
        "frame;time;neck_u;neck_v\n0;0;1,5;2\n",
        "time,frame,label,neck_u,neck_v\n0,0,1,2,3\n",
        "nothing",
        "",
        "[cam]\nsize = [1, 2]\n",
    ],
)
def test_own_files_and_unknown_ones_are_left_to_the_reader(text, tmp_path):
    (tmp_path / "a.csv").write_text(text)
    assert reader_of(tmp_path / "a.csv") is None


def test_videos_are_not_taken_for_tables(tmp_path):
    rng = np.random.default_rng(1)
    for seed in range(20):
        (tmp_path / "a.mp4").write_bytes(b"\0\0\0\x20ftypisom" + rng.bytes(70000))
        assert reader_of(tmp_path / "a.mp4") is None, seed


@pytest.mark.skipif(not FAULTS.is_dir(), reason="../shared/data/faults is absent")
def test_public_files():
    with pytest.raises(UserError, match="has 2 points without names"):
        keypoints_file.read(FAULTS / "alphapose.json", ["l_knee"])
    found, _ = keypoints_file.read(FAULTS / "dlc.csv", ["l_knee"], clip=Clip(fps=30))
    assert found.uv[:, 0].tolist() == [[310.2, 220.1], [311.2, 220.4], [312.0, 220.9]]
