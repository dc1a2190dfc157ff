"""gait-trackd with bad input: one line that names file, field and remedy; exit code 1, or 2 for usage."""

import json
import os
import re
import subprocess

import lcm_rig as rig
import numpy as np
import pytest

import gait
from gait.bindings.abi import Mode
from gait.bindings.config import LiftConfig, TrackerConfig
from gait.bindings.model import Model
from gait.errors import GaitError
from gait.track.tracker import Tracker

CAMERA = rig.CAMERA.to_dict()
INIT = {"frame": 3, "pelvis": [0, 0, 0.9], "phase": 0.5, "sd": {"pelvis": 0.1}}


def fails(words, *expected, code=1):
    outcome = rig.run(*words)
    assert outcome.code == code, outcome
    lines = [line for line in outcome.words.splitlines() if " particles, " not in line]
    assert len(lines) == 1 and lines[0].startswith("gait-trackd: "), outcome.words
    for word in expected:
        assert str(word) in lines[0], lines[0]
    return lines[0]


def empty_log(tmp_path):
    return rig.write_log(tmp_path / "empty.log", [("OTHER", b"x")])


def options(tmp_path, *more):
    return [*rig.command("--url", f"file://{empty_log(tmp_path)}?speed=0")[1:], *more]


def accepted(tmp_path, *more):
    """The given files are usable, only the log is not; return what was reported."""
    outcome = rig.run(*options(tmp_path, *more))
    assert outcome.code == 1 and "no frames on GAIT_IMAGE_0" in outcome.words.splitlines()[-1], outcome.words
    assert all(" particles, " in line for line in outcome.words.splitlines()[:-1]), outcome.words
    return outcome.words


def test_a_truncated_model_at_every_kind_of_length(tmp_path):
    blob, file = rig.MODEL.read_bytes(), tmp_path / "cut.gait"
    for size in (0, 1, 63, 64, 65, 200, len(blob) // 2, len(blob) - 1):
        file.write_bytes(blob[:size])
        fails(["-m", file], file, "not a usable model", "learn it again")


def test_a_damaged_model(tmp_path):
    blob, file = bytearray(rig.MODEL.read_bytes()), tmp_path / "bad.gait"
    for place in (0, 9, 30, len(blob) // 3, len(blob) - 5):
        changed = blob.copy()
        changed[place] ^= 0x40
        file.write_bytes(changed)
        fails(["-m", file], file, "not a usable model")


def test_files_that_are_not_there(tmp_path):
    nothing = tmp_path / "nothing"
    fails(["-m", nothing], nothing, "model", "No such file")
    fails(["-m", tmp_path], tmp_path / "walk.gait", "model", "No such file")
    fails(["-m", tmp_path, "--mode", "paper"], tmp_path / "paper.gait", "model", "No such file")
    for option, what in (("--camera", "camera"), ("--init", "init")):
        fails(options(tmp_path, option, nothing), nothing, what, "No such file")
    fails(rig.command("--config", nothing)[1:], nothing, "configuration", code=2)
    fails(rig.command("--url", f"file://{nothing}?speed=0")[1:], nothing, "cannot open this log")


def test_a_pipe_is_refused_at_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    fails(["-m", pipe], pipe, "not a regular file", "model")
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps(CAMERA))
    for option in ("--camera", "--init"):
        fails(options(tmp_path, option, pipe), pipe, "not a regular file", option[2:])
    fails(
        options(tmp_path, "--camera", camera, "--background", pipe), pipe, "not a regular file", "background"
    )
    fails(rig.command("--config", pipe)[1:], pipe, "not a regular file", "configuration", code=2)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fx": None}, ["fx is missing", "focal length in pixels"]),
        ({"fx": "wide"}, ["fx is not numeric"]),
        ({"fx": -5}, ["fx is -5"]),
        ({"fx": float("nan")}, ["fx is not finite", "focal length in pixels"]),
        ({"t": [0, -float("inf"), 4]}, ["t is not finite", "metres"]),
        ({"cx": [1, 2]}, ["cx has 2 numbers, not 1"]),
        ({"width": 160.5}, ["width is 160.5"]),
        ({"height": 0}, ["height is 0"]),
        ({"width": 16200}, ["camera.json: width is 16200, outside [1, 16000]"]),
        ({"R": [[1, 0, 0], [0, 1, 0]]}, ["R has 6 numbers, not 9"]),
        ({"R": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, ["R is not a rotation"]),
        ({"R": [[1.001, 0, 0], [0, 1, 0], [0, 0, 1]]}, ["R is not a rotation"]),
        ({"t": [100, 1600, 5000]}, ["lens 1600 m above the floor", "give R and t in metres"]),
        ({"t": [1, 2]}, ["t has 2 numbers", "metres"]),
        ({"t": [1, None, 2]}, ["t is not numeric"]),
        ({"distortion": [1, 2, 3]}, ["distortion", "0, 4 or 5"]),
        ({"distortion": "none"}, ["distortion"]),
        ({"distorsion": [0.1, 0, 0, 0]}, ["line 1: distorsion is not a known key"]),
    ],
)
def test_a_wrong_camera_file(tmp_path, change, words):
    content = {k: v for k, v in (CAMERA | change).items() if v is not None}
    file = tmp_path / "camera.json"
    file.write_text(json.dumps(content))
    fails(options(tmp_path, "--camera", file), file, *words)


@pytest.mark.parametrize(("option", "content"), [("--camera", CAMERA), ("--init", INIT)])
def test_a_key_that_is_there_twice(tmp_path, option, content):
    file = tmp_path / "twice.json"
    key, value = next(iter(content.items()))
    file.write_text(json.dumps(content)[:-1] + f',\n"{key}": {value}}}')
    fails(options(tmp_path, option, file), file, f"line 2: {key} is given twice; remove one")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: expected a value"),
        ("[]", "not a JSON object"),
        ("{", "line 1: expected a string"),
        ('{"a": 1,\n "b" 2}', "line 2: expected a colon"),
        ('{"a": 01}', "expected a comma"),
        ('{"a": 1.}', "expected a value"),
        ('{"a": 1e}', "expected a value"),
        ('{"a": +1}', "expected a value"),
        ('{"a": nan}', "expected a value"),
        ('{"a": 1e999}', "too large"),
        ('{"a": tru}', "expected a value"),
        ('{"a": "\\x"}', "unknown escape"),
        ('{"a": "open', "without closing quote"),
        ('{"a": [1, 2}', "expected a comma or ]"),
        ('{"a": 1} x', "after the end"),
        ("[" * 50, "nested too deeply"),
        ('{"a": [' + "1," * 400 + "1]}", "more values than"),
        ('{"a": 1}\x00', "zero byte"),
    ],
)
def test_json_that_is_none(tmp_path, text, words):
    file = tmp_path / "camera.json"
    file.write_text(text)
    fails(options(tmp_path, "--camera", file), file, words)


@pytest.mark.parametrize("name", ["c.toml", "c.toml:cam_01", "c.yml", "c.txt", "c.pickle:cam_01"])
def test_a_camera_for_gait_capture(tmp_path, name):
    (tmp_path / name.partition(":")[0]).write_text("[cam_01]\n")
    fails(options(tmp_path, "--camera", tmp_path / name), name, "JSON only", "gait capture --camera", "LCM")


def test_the_cameras_of_the_python_side_are_accepted(tmp_path):
    file = tmp_path / "camera.json"
    for change in ({}, {"distortion": []}, {"distortion": [0.1, 0, 0, 0]}, {"note": 'a "quoted" \\u00e9'}):
        file.write_text(json.dumps(CAMERA | change, indent=1))
        assert "camera 160x120" in accepted(tmp_path, "--camera", file)
    file.write_text(json.dumps({k: v for k, v in CAMERA.items() if k != "distortion"}))
    accepted(tmp_path, "--camera", file)


def test_of_a_folder_of_models_the_mode_takes_its_own(tmp_path):
    camera, folder = tmp_path / "camera.json", rig.MODEL.parent
    camera.write_text(json.dumps(CAMERA))
    for words, name in (([], "walk"), (["--mode", "paper"], "paper")):
        found = accepted(tmp_path, "--camera", camera, "-m", folder, *words)
        assert f"model {Model(name).info.digest:016x}" in found
    accepted(tmp_path, "--camera", camera, "-m", folder, "--mode", "paper", "--lift")  # by walk.gait


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"phse": 0.5}, ["phse is not a known key"]),
        ({"sd": {"speed": 1}}, ["speed is not a known key"]),
        ({"sd": 0.1}, ["sd is not an object"]),
        ({"sd": {"pelvis": -1}}, ["sd.pelvis is -1"]),
        ({"phase": 1.5}, ["phase is 1.5", "right heel strike"]),
        ({"stature_m": 17.5}, ["stature_m is 17.5", "metres"]),
        ({"stride_hz": 55}, ["stride_hz is 55"]),
        ({"pelvis": [1.1e4, 0]}, ["pelvis is 11000, outside [-10000, 10000]"]),
        ({"pelvis": [1]}, ["pelvis has 1 numbers", "x and y"]),
        ({"frame": -4}, ["frame is -4"]),
        ({"frame": 1.5}, ["frame is 1.5, not a whole number", "frame number, from 0"]),
        ({"heading_rad": "north"}, ["heading_rad is not numeric"]),
    ],
)
def test_a_wrong_init_file(tmp_path, change, words):
    file = tmp_path / "init.json"
    file.write_text(json.dumps(INIT | change))
    fails(options(tmp_path, "--init", file), file, *words)


def test_init_files_of_the_python_side_are_accepted(tmp_path):
    file = tmp_path / "init.json"
    for change in ({}, {"pelvis": [1, 2]}, {"sd": {"pelvis": [0.1, 0.2, 0.3]}}, {"sd": {"stature_m": 0.1}}):
        file.write_text(json.dumps(INIT | change))
        accepted(tmp_path, "--init", file)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"PNG", "not a binary PGM or PPM"),
        (b"P4\n1 1\n", "not a binary PGM or PPM"),
        (b"P5\n160 120\n65535\n", "8 bits"),
        (b"P5\n160 120\n255\n" + b"x" * 100, "shorter than its header"),
        (b"P5\n0 120\n255\n", "damaged header"),
        (b"P6\n80 60\n255\n" + b"x" * (80 * 60 * 3), "background of 80x60, but the camera has 160x120"),
    ],
)
def test_a_wrong_background(tmp_path, content, words):
    camera, scene = tmp_path / "c.json", tmp_path / "p.ppm"
    camera.write_text(json.dumps(CAMERA))
    scene.write_bytes(content)
    fails(options(tmp_path, "--camera", camera, "--background", scene), scene, words)


def test_a_background_with_comments_is_read(tmp_path):
    camera, scene = tmp_path / "c.json", tmp_path / "p.pgm"
    camera.write_text(json.dumps(CAMERA))
    grey = np.ascontiguousarray(rig.plate()[..., 0])
    scene.write_bytes(b"P5 # made by hand\n160\n# and\n120 255\n" + grey.tobytes())
    accepted(tmp_path, "--camera", camera, "--background", scene)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "--model FILE is required"),
        (["--frobnicate"], "unknown argument --frobnicate"),
        (["-m"], "--model needs a value"),
        (["-m", "x", "--particles", "2.5"], "--particles 2.5: give a whole number from 16"),
        (["-m", "x", "--particles", "3"], "--particles 3: give a whole number from 16 to 1048576"),
        (["-m", "x", "--particles", "many"], "--particles many"),
        (["-m", "x", "--seed", "-1"], "--seed -1"),
        (["-m", "x", "--seed", "99999999999999999999"], "--seed 99999999999999999999"),
        (["-m", "x", "--girth", "nan"], "--girth nan"),
        (["-m", "x", "--mode", "fast"], "--mode fast: give default or paper"),
        (["-m", "x", "--quiet=maybe"], "--quiet maybe: give true or false"),
        (["-m", "x", "--url", "memq://"], "--url memq://: works only within one process"),
        (["-m", "x", "--background", "p.ppm"], "--background needs --camera"),
        (["-m", "x", "--lift-model", "p.gait"], "--lift-model needs --lift"),
        (["-m", "x", "--lift-stature", "1.7"], "--lift-stature needs --lift"),
        (["-m", "x", "--lift-sd", "3"], "--lift-sd needs --lift"),
        (["-m", "x", "--lift-lag", "0"], "--lift-lag needs --lift"),
        (["-m", "x", "--keypoints-sd", "4"], "--keypoints-sd needs --keypoints-term"),
        (["-m", "x", "--cpu-mask", "16"], "--cpu-mask 16"),
        (["-m", "x", "--url", "u" * 2000], "--url: give a value of 1 to 1023 characters"),
    ],
)
def test_usage(words, expected):
    fails(words, expected, code=2)


def test_help_lists_every_option():
    outcome = rig.run("--help")
    assert outcome.code == 0 and not outcome.words
    for option in ("--model", "--camera", "--init", "--url", "--threads", "--phase-noise", "--stature-noise"):
        assert option in outcome.printed


def test_help_states_what_an_option_does_when_it_is_not_given_or_too_small():
    printed = " ".join(rig.run("--help").printed.split())
    assert "auto, the default: start when a person has walked" in printed
    assert "Pauses longer than --max-dt are bridged by predictions of at most --max-dt each" in printed
    assert "--init FILE waits for START" in printed
    assert "more than a second old, or in the future, counts from its arrival" in printed


def test_help_names_the_defaults_of_the_library():
    usual, paper = (TrackerConfig.default(mode) for mode in Mode)
    printed = rig.run("--help").printed
    assert f"default {usual.particles}, paper mode {paper.particles}\n" in printed
    assert f"default {usual.acquisition_particles}, paper mode {paper.acquisition_particles}\n" in printed
    lift = LiftConfig.default()
    assert f"default {lift.sd:g} pixels" in printed and f"delayed, default {lift.lag}\n" in printed
    for item in TrackerConfig.settings():
        if isinstance(item.default, float):
            assert f"--{item.name.replace('_', '-')} X\n        {item.text}\n" in printed


SETTINGS = [name for name, value in TrackerConfig.default() if isinstance(value, float)]


@pytest.mark.parametrize("name", SETTINGS)
def test_the_ranges_are_those_of_the_library(name):
    """Every value that the library would reject is a usage error, and no other value is."""
    change, option = {name: 1e9}, name.replace("_", "-")
    with pytest.raises(GaitError, match="is outside") as refused:
        Tracker(Model(), rig.CAMERA, TrackerConfig.default(**change))
    low, high = re.search(r"outside \[(.*), (.*)\]", refused.value.text).groups()
    fails(["-m", "x", f"--{option}", "1e9"], f"--{option} 1e9: give a number from {low} to {high}", code=2)


def test_version_states_whether_jpeg_is_understood():
    outcome = rig.run("--version")
    assert outcome.code == 0
    assert outcome.printed in [f"gait-trackd {gait.__version__} jpeg {answer}\n" for answer in ("yes", "no")]


@pytest.mark.parametrize("word", ["--version", "--help"])
def test_an_answer_that_cannot_be_written_is_reported(word):
    with open("/dev/full", "w") as full:
        done = subprocess.run([rig.TRACKD, word], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    printed = "gait-trackd: stdout cannot be written: No space left on device\n"
    assert (done.returncode, done.stderr) == (1, printed)


def test_the_default_of_tasks_is_the_number_of_threads():
    words = rig.run("--help").printed.partition("--tasks N")[2].partition("--")[0]
    assert "default the number of" in words


def test_configuration_file_and_command_line(tmp_path):
    log = rig.write_log(tmp_path / "a.log", [*rig.opening(), *rig.frames(0, 3)])
    config = tmp_path / "trackd.conf"
    config.write_text("# for the test\nseed = 5\n\n  phase-noise=0.2 # loose\nparticles-channel = true\n")
    by_file = rig.play(log, "--config", config)
    by_hand = rig.play(log, "--seed", 5, "--phase-noise", 0.2)
    assert by_file.digest == by_hand.digest and len(by_file.particles) == 3
    winner = rig.play(log, "--config", config, "--seed", 6, "--phase-noise=0.2", "--particles-channel=no")
    assert winner.digest == rig.play(log, "--seed", 6, "--phase-noise", 0.2).digest and not winner.particles


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("seed = 1\nsped = 2\n", "line 2: unknown option sped"),
        ("seed\n", "line 1: 'seed' is not of the form name = value"),
        ("threads = 0\n", "line 1: --threads 0"),
        ("quiet = perhaps\n", "line 1: --quiet perhaps"),
        ("seed = 1\nlag = 3\nseed = 1\n", "line 3: seed is already given in line 1; remove one"),
        ("config = other.conf\n", "line 1: config is allowed on the command line only"),
        ("\x1b[2J\x07 = 1\n", "trackd.conf: not a text file; give lines `name = value`"),
        ("seed = 1\n\0seed = 2\n", "trackd.conf: not a text file"),
    ],
)
def test_a_wrong_configuration_file(tmp_path, text, words):
    config = tmp_path / "trackd.conf"
    config.write_text(text)
    fails(rig.command("--config", config)[1:], config, words, code=2)


def test_a_url_to_publish_on_that_lcm_refuses(tmp_path):
    log = rig.write_log(tmp_path / "e.log", [("OTHER", b"x")])
    words = rig.command("--url", f"file://{log}?speed=0", "--out", "nonsense://")[1:]
    fails(words, "nonsense://: cannot open LCM", "(?mode=w to write)")


@pytest.mark.parametrize(
    ("url", "remedy", "of_python"),
    [
        ("nonsense://", "; give udpm://ADDRESS:PORT or file:///PATH?speed=0", ""),
        (
            "udpm://999.1.1.1:7667",
            "999.1.1.1 is not a multicast address",
            "; give udpm://239.255.76.67:7667?ttl=0",
        ),
    ],
)
def test_a_url_that_lcm_refuses(url, remedy, of_python):
    fails(rig.command("--url", url)[1:], url, remedy)
    done = rig.gait("record", "--url", url, "-o", "x.csv")
    assert done.returncode == 1 and (of_python or remedy) in done.stderr


@pytest.mark.parametrize("address", ["10.0.0.1", "127.0.0.1", "240.0.0.1"])
def test_an_address_that_is_not_multicast_is_reported(address):
    printed = f"{address} is not a multicast address; give one from 224.0.0.0 to 239.255.255.255"
    fails(rig.command("--url", f"udpm://{address}:7667?ttl=0")[1:], printed)


def test_no_multicast_route_is_one_line_with_the_remedy():
    done = rig.without_network(*rig.command())
    assert done.returncode == 1 and done.stderr.count("\n") == 1, done.stderr
    assert "cannot open LCM" in done.stderr and "ip route add 224.0.0.0/4 dev lo" in done.stderr
    done = rig.without_network(str(rig.PYTHON), "-m", "gait", "record", "-o", "x.csv")
    assert "ip route add 224.0.0.0/4 dev lo" in done.stderr and "Traceback" not in done.stderr


def test_an_output_that_cannot_be_opened(tmp_path):
    out = f"file://{tmp_path}/no/such/folder.log?mode=w"
    fails(options(tmp_path, "--out", out), "folder.log", "cannot be written: No such file")
