"""gait batch: clips in separate processes; runs resume after a kill, and damaged clips end nothing."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
from walking_keypoints import SIZE, keypoints, view

import gait.cli
from gait.batch import project
from gait.batch.run import DONE, FAILED, Runner, write_summary
from gait.camera.camera import Camera, write_camera
from gait.errors import UserError
from gait.io.keypoints_file import write

# A stand-in for gait: records each call, crashes on "bad", waits on "slow" until the file GO exists.
FAKE = """\
import json, os, sys, time
from pathlib import Path
words = sys.argv[1:]
log = Path(os.environ["FAKE_LOG"])
with log.open("a") as file:
    file.write(" ".join(words[:2]) + "\\n")
if words[0] == "track":
    if "bad" in words[1]:
        print("gait track: bad.mp4: damaged", file=sys.stderr)
        os.abort() if "crash" in words[1] else sys.exit(1)
    while "slow" in words[1] and not log.with_name("GO").exists():
        time.sleep(0.01)
    out = Path(words[words.index("-o") + 1])
    one = {"frames": 3, "init": 1, "tracking": 2, "digest": "x", "verdict": "Tracked <3>", "warning": "alone",
           "notes": ["not used: init.json"], "offsets_s": [0.1234, -2]}
    print("start found\\nwarning: camera.json: does not fit\\nwarning: broken", file=sys.stderr)
    people = "12" if "--people" in words else ""
    for path in [out.with_name(f"track-{k}.csv") for k in people] or [out]:
        path.write_text("frame\\n")
    one = [] if "list" in words[1] else one
    print(json.dumps({"people": dict.fromkeys(people, one), "others": []} if people else one))
elif words[:2] == ["report", "track"]:
    folder = Path(words[words.index("-o") + 1])
    folder.mkdir(exist_ok=True)
    (folder / "report.html").write_text("page")
    both = {"mean": 1.25, "sd": 0.1, "between": None}
    print("warning: short", file=sys.stderr)
    print(json.dumps({"summary": {"speed_m_s": {"both": both}, "double_support_percent": {"both": None}}}))
else:
    out = Path(words[words.index("-o") + 1])
    if out.suffix == ".bvh" and not log.with_name("GO").exists():
        print("gait export: cannot", file=sys.stderr)
        sys.exit(1)
    out.write_text("made")
    print(json.dumps({"frames": 3}))
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with the stand-in and clips."""
    (tmp_path / "fake.py").write_text(FAKE)
    for name in ("a", "b", "slow", "bad", "badcrash", "list"):
        (tmp_path / f"{name}.mp4").write_bytes(name.encode())
    monkeypatch.setenv("FAKE_LOG", str(tmp_path / "log"))
    return tmp_path


def clips_of(place, text):
    (place / "p.toml").write_text(text)
    return project.read(place / "p.toml")


def runner(place):
    return Runner(place / "out", (sys.executable, str(place / "fake.py")))


def calls(place):
    log = place / "log"
    return sorted(log.read_text().splitlines()) if log.exists() else []


PROJECT = """
[defaults]
height = 1.75
make = ["track", "report", "c3d"]
[[clip]]
video = "a.mp4"
subject = "Anna"
[[clip]]
video = "bad.mp4"
[[clip]]
video = "badcrash.mp4"
[[clip]]
video = "none.mp4"
[[clip]]
video = "b.mp4"
name = "again b"
height = 1.6
make = ["track"]
"""


def test_one_damaged_clip_never_ends_the_rest(place):
    clips, reported = clips_of(place, PROJECT), []
    rows = runner(place).run(clips, 2, reported.append)
    assert [row["state"] for row in rows] == [DONE, FAILED, FAILED, FAILED, DONE] and len(reported) == 5
    assert rows[1]["error"] == "gait track: bad.mp4: damaged"
    assert "none.mp4: No such file" in rows[3]["error"]
    assert rows[0]["speed_m_s"] == 1.25 and rows[0]["tracking"] == 2 and rows[0]["subject"] == "Anna"
    assert "double_support_percent" not in rows[0]  # null, as for a clip of few strides
    out = place / "out"
    assert not (out / "bad").exists() and not (out / "none").exists()
    assert {file.name for file in (out / "a").iterdir()} == {"track.csv", "track.c3d", "report", "done.json"}
    assert write_summary(out, rows)[0] == "summary.csv"
    with open(out / "summary.csv", newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["name"] for row in table] == ["a", "bad", "badcrash", "none", "again b"]
    assert table[0]["speed_m_s_sd"] == "0.1" and table[1]["frames"] == ""
    page = (out / "index.html").read_text()
    assert (
        'href="a/report/report.html"' in page
        and "5 clips, 3 failed" in page
        and "http" not in page.split("<body")[1]
    )


def test_figures_that_are_none_of_a_track_fail_the_clip_only(place):
    """The stand-in prints a list for it."""
    text = '[defaults]\nheight = 1.7\nmake = ["track"]\n'
    clips = clips_of(place, text + '[[clip]]\nvideo = "list.mp4"\n[[clip]]\nvideo = "a.mp4"\n')
    for _ in range(2):
        rows = runner(place).run(clips, 1, lambda _: None)
        assert [row["state"] for row in rows] == [FAILED, DONE]
        assert re.fullmatch(r".*out/list: TypeError: .+", rows[0]["error"])


def test_verdict_warnings_offsets_and_shares_are_shown(place):
    """Warnings of the track and of its report, each once; other lines on stderr are no warnings."""
    for _ in range(2):
        rows = runner(place).run(clips_of(place, PROJECT), 1, lambda _: None)
        assert rows[0]["warnings"] == "alone | camera.json: does not fit | broken | short"
        assert (rows[0]["verdict"], rows[0]["offsets_s"]) == ("Tracked <3>", "0.123 -2.000")
    write_summary(place / "out", rows)
    with open(place / "out/summary.csv", newline="") as file:
        assert next(csv.DictReader(file))["warnings"] == rows[0]["warnings"]
    head, _, rest = (place / "out/index.html").read_text().partition("<tbody")
    assert "<td>init 33%, tracking 67%</td><td>4</td>" in rest and "further films began" in head
    assert "<p>a: Tracked &lt;3&gt;.</p>" in rest
    assert '<p class="warning">a: camera.json: does not fit</p>' in rest
    assert "sd, mm" not in head  # which no clip has


def test_a_file_that_cannot_be_made_fails_the_clip_but_not_its_other_files(place):
    """Run again, the clip is not tracked anew; a file that an earlier run left is not passed off as made."""
    clips = clips_of(place, '[[clip]]\nvideo = "a.mp4"\nheight = 1.7\nmake = ["bvh", "c3d", "report"]\n')
    (place / "out/a").mkdir(parents=True)
    (place / "out/a/track.bvh").write_text("old")
    rows = runner(place).run(clips, 1, lambda _: None)
    assert (rows[0]["state"], rows[0]["error"], rows[0]["tracking"]) == (FAILED, "gait export: cannot", 2)
    write_summary(place / "out", rows)
    files = ["a/report/report.html", "a/track.c3d", "a/track.csv"]
    assert re.findall('href="(.*?)"', (place / "out/index.html").read_text().partition("<tbody")[2]) == files
    (place / "GO").touch()
    assert runner(place).run(clips, 1, lambda _: None)[0]["state"] == DONE
    assert calls(place).count(f"track {place}/a.mp4") == 1 and (place / "out/a/track.bvh").is_file()


def test_failures_do_not_change_the_columns_order(place):
    clips, heads = clips_of(place, PROJECT), []
    rows = runner(place).run(clips, 2, lambda _: None)
    for some in (rows, rows[::-1]):
        write_summary(place / "out", some)
        heads.append((place / "out/summary.csv").read_text().splitlines()[0])
    assert heads[0] == heads[1]


GROUP = '[[clip]]\nvideo = "a.mp4"\npeople = "all"\nheight = 1.7\nmake = ["track", "report", "c3d"]\n'


def test_several_people_have_rows_and_files_of_their_own(place):
    clips = clips_of(place, GROUP)
    for _ in range(2):
        rows = runner(place).run(clips, 1, lambda _: None)
        assert [(row["name"], row["person"], row["tracking"], row["state"]) for row in rows] == [
            ("a", 1, 2, DONE),
            ("a", 2, 2, DONE),
        ]
    assert calls(place).count(f"track {place}/a.mp4") == 1
    made = {file.name for file in (place / "out/a").iterdir()}
    assert {"track-1.csv", "track-2.csv", "track-2.c3d", "report-1", "report-2"} <= made
    write_summary(place / "out", rows)
    row = (place / "out/index.html").read_text().partition("a, person 2")[2]
    files = ["a/report-2/report.html", "a/track-2.c3d", "a/track-2.csv"]
    assert re.findall('href="(.*?)"', row) == files


def test_clips_are_counted_not_people(place, monkeypatch, capsys):
    clips_of(place, GROUP)
    monkeypatch.setattr(Runner.__init__, "__defaults__", (runner(place).gait,))
    words = ["batch", str(place / "p.toml"), "-o", str(place / "out")]
    assert gait.cli.main(words) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("1 clip, 0 failed; ") and "a, person 2: done; Tracked <3>\n" in printed.err
    assert "warning: a, person 2: camera.json: does not fit\n" in printed.err
    assert gait.cli.main(words) == 0  # again
    printed = capsys.readouterr()
    assert printed.out.startswith("1 clip, 0 failed, 1 skipped; ")
    assert "a, person 2: done, by an earlier run; skipped; Tracked <3>\n" in printed.err


@pytest.mark.parametrize("make", ["track", "lift"])
def test_several_films_are_one_clip_and_all_their_files_count(place, capsys, make):
    """gait track and gait lift take these words, and fail because the films have a few bytes only."""
    write_camera(place / "ca.json", view())
    write_camera(place / "cb.json", view(height=1.9))
    text = f'[[clip]]\nvideos = ["a.mp4", "b.mp4"]\ncameras = ["ca.json", "cb.json"]\nmake = ["{make}"]\n'
    [clip] = clips_of(place, text)
    words = clip.command(place)
    films = [str(place / "a.mp4"), str(place / "b.mp4")]
    cameras = ["--camera", str(place / "ca.json"), "--camera", str(place / "cb.json")]
    assert clip.name == "a" and words[0] == make and words[1:3] == films and words[-4:] == cameras
    before = clip.key()
    (place / "b.mp4").write_bytes(b"another")
    assert clip.key() != before
    assert gait.cli.main(words) == 1 and "a.mp4: cannot be read as video" in capsys.readouterr().err
    assert runner(place).run([clip], 1, lambda _: None)[0]["input"] == films[0]


def test_cameras_of_one_file_keypoint_folders_and_files_in_options_count(place):
    """A name of a camera is no part of the path; an edited file in a folder does not change the folder."""
    (place / "calib.toml").write_text("")
    (place / "joints").mkdir()
    frame, start = place / "joints/000.json", place / "start.json"
    for file in (frame, start):
        file.write_text("{}")
    text = '[[clip]]\nkeypoints = "joints"\ncamera = "calib.toml:cam_01"\nmake = ["lift"]\noptions = ["{}"]\n'
    keys = []
    for option in (start, f"--init={start}"):
        [clip] = clips_of(place, text.replace("{}", str(option)))
        keys += [clip.key(), clip.key()]
        for file in (frame, start):
            file.write_text(file.read_text() + " ")
            keys.append(clip.key())
    assert keys[0] == keys[1] and keys[4] == keys[5] and len(set(keys)) == 6


def test_a_cluster_runs_the_same_project(place, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: extra dask")
    from gait.batch import cluster
    from gait.learn.corpus import cluster as connection

    monkeypatch.setattr(connection, "CONNECT", 120.0)
    clips, reported, fake = clips_of(place, PROJECT), [], (sys.executable, str(place / "fake.py"))
    one = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "protocol": "tcp"}
    with (
        warnings.catch_warnings(),
        distributed.LocalCluster(**one, dashboard_address=None, silence_logs=50) as local,
    ):
        warnings.simplefilter("ignore")  # warnings of distributed, which are not ours to fix
        rows = cluster.run(place / "out", clips, local.scheduler_address, reported.append, fake)
    states = [DONE, FAILED, FAILED, FAILED, DONE]
    assert [row["state"] for row in rows] == states and len(reported) == 5
    assert "none.mp4: No such file" in rows[3]["error"] and rows[1]["error"] == "gait track: bad.mp4: damaged"
    again = runner(place).run(clips, 1, lambda _: None)
    assert again[0] == rows[0] and calls(place).count(f"track {place}/a.mp4") == 1  # done on the cluster


def test_what_is_done_is_not_made_again_and_what_changed_is(place):
    clips = clips_of(place, PROJECT)
    runner(place).run(clips, 2, lambda _: None)
    (place / "log").unlink()
    rows = runner(place).run(clips, 2, lambda _: None)
    assert calls(place) == [f"track {place}/bad.mp4", f"track {place}/badcrash.mp4"]
    assert rows[0]["state"] == DONE and rows[0]["speed_m_s"] == 1.25
    (place / "log").unlink()
    (place / "bad.mp4").rename(place / "mended.mp4")
    (place / "a.mp4").write_bytes(b"another")
    clips = clips_of(place, PROJECT.replace("bad.mp4", "mended.mp4").replace("1.6", "1.7"))
    rows = runner(place).run(clips, 2, lambda _: None)
    again = [f"track {place}/{name}.mp4" for name in ("a", "b", "badcrash", "mended")]
    assert [call for call in calls(place) if call.startswith("track")] == again
    assert [row["state"] for row in rows] == [DONE, DONE, FAILED, FAILED, DONE]


def test_a_kill_ends_the_commands_and_the_rest_is_resumed(place):
    text = '[defaults]\nheight = 1.7\nmake = ["track"]\n'
    text += '[[clip]]\nvideo = "a.mp4"\n[[clip]]\nvideo = "slow.mp4"\n'
    clips_of(place, text)
    script = (
        "import sys; from pathlib import Path\n"
        "from gait.batch import project; from gait.batch.run import Runner\n"
        "place = Path(sys.argv[1]); fake = (sys.executable, str(place / 'fake.py'))\n"
        "clips = project.read(place / 'p.toml')\n"
        "Runner(place / 'out', fake).run(clips, 1, lambda row: print(row['name'], flush=True))"
    )
    command = [sys.executable, "-c", script, str(place)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "a\n"  # slow is waiting now, or will be
    while f"track {place}/slow.mp4" not in calls(place):
        assert process.poll() is None
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()
    (place / "log").unlink()
    (place / "GO").touch()
    rows = runner(place).run(project.read(place / "p.toml"), 1, lambda _: None)
    assert [row["state"] for row in rows] == [DONE, DONE]
    assert calls(place) == [f"track {place}/slow.mp4"]


def test_an_interrupt_ends_the_commands(place):
    clips = clips_of(place, '[[clip]]\nvideo = "slow.mp4"\nheight = 1.7\nmake = ["track"]\n')

    def interrupt():
        while not calls(place):
            pass
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        runner(place).run(clips, 1, lambda _: None)
    thread.join()
    assert not (place / "out/slow/track.csv").exists() and not (place / "out/slow/done.json").exists()


OPTIONS = "[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\noptions = [{}]\n"


def test_options_that_no_key_gives_are_taken(place):
    [clip] = clips_of(place, OPTIONS.format('"--stop", "50", "--offsets", "-0.1"'))
    assert clip.command(place)[-4:] == ["--stop", "50", "--offsets", "-0.1"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r"has no \[\[clip\]\]; give each a video"),
        ("[[clip]]\nvideo = 'a.mp4'\n", "clip 1: camera and height are missing"),
        ("[[clip]]\nheight = 1.7\n", "clip 1: name is ''"),
        ("[[clip]]\nname = 'a'\nheight = 1.7\n", "clip 1: video is missing"),
        ("[[clip]]\nvideo = 'a.mp4'\nhieght = 1.7\n", "hieght is not a known key"),
        ("[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\nmake = ['fbx']\n", "make has 'fbx'; use track lift"),
        ("[[clip]]\nvideo = 'a.mp4'\nheight = 17\n", "height is 17, outside"),
        ("[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\nname = '../a'\n", "name is '../a'"),
        (
            "[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\n[[clip]]\nvideo = 'a.avi'\nheight = 1.7\n",
            "two clips are named a",
        ),
        (
            "[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\nmake = ['lift', 'report']\n",
            "make has lift together with track",
        ),
        ("[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\npeople = 9\n", "people is 9, outside"),
        (
            "[[clip]]\nvideo = 'a.mp4'\nheight = 1.7\npeople = 2\nmake = ['lift']\n",
            "people cannot be combined with lift",
        ),
        ("[[clip]]\nvideos = 'a.mp4'\nheight = 1.7\n", r"videos is not a list.*left.mp4"),
        ("[[clip]]\nvideo = 'a.mp4'\nvideos = ['b.mp4']\nheight = 1.7\n", "videos is given beside video"),
        (
            "[[clip]]\nvideos = ['a.mp4', 'b.mp4']\nkeypoints = 'k.csv'\nheight = 1.7\n",
            "videos cannot be combined with keypoints",
        ),
        ("[[clip]]\nvideos = ['a.mp4', 'b.mp4']\nheight = 1.7\n", "cameras are missing; give the camera of"),
        (
            "[[clip]]\nkeypoints = ['k.csv', 'l.csv']\nmake = ['lift']\n",
            "cameras are missing; give the camera of",
        ),
        (
            "[[clip]]\nkeypoints = ['k.csv', 'l.csv']\nvideo = 'a.mp4'\nheight = 1.7\n",
            "keypoints are several",
        ),
        ("[[clip]]\nkeypoints = [1]\nmake = ['lift']\n", r"keypoints is not a list.*left.csv"),
        (
            "[defaults]\nstop = 9\n[[clip]]\nkeypoints = 'k.json'\nmake = ['lift']\n",
            r"clip 1: stop is for a film, .*leave out stop here and in \[defaults\]",
        ),
        (
            OPTIONS.format('"-o", "weg.csv"'),
            "p.toml: clip 1: options has '-o', which .* itself; leave it out",
        ),
        (OPTIONS.format('"-oweg.csv"'), "options has '-oweg.csv', which"),
        (OPTIONS.format('"--out=weg.csv"'), "options has '--out=weg.csv', which"),
        (OPTIONS.format('"--json"'), "options has '--json', which .*; leave it out"),
        (
            OPTIONS.format('"--people", "all"'),
            "options has '--people', which .*; give the key people instead",
        ),
        (
            OPTIONS.format('"--height=1.8"'),
            "options has '--height=1.8', which .*; give the key height instead",
        ),
        ("[[clip]\n", "not valid TOML"),
    ],
)
def test_a_project_that_cannot_be_right_is_one_line(text, words, place):
    with pytest.raises(UserError, match=words) as caught:
        clips_of(place, text)
    assert "\n" not in str(caught.value)


def test_keypoints_of_several_views_are_lifted_together(tmp_path, capsys):
    """As gait lift would; a changed file of the second view counts."""
    for name, at in (("a", view()), ("b", Camera.looking((6.0, 5.0, 1.6), (0.3, 5.5, 0.9), SIZE, 1000.0))):
        write_camera(tmp_path / f"{name}.json", at)
        write(tmp_path / f"{name}.csv", keypoints(at, seconds=1.6))
    (tmp_path / "p.toml").write_text(
        '[[clip]]\nkeypoints = ["a.csv", "b.csv"]\ncameras = ["a.json", "b.json"]\nmake = ["lift"]\n'
        'options = ["--offsets", "0"]\n'
    )
    assert gait.cli.main(["batch", str(tmp_path / "p.toml"), "-o", str(tmp_path / "out"), "--json"]) == 0
    [row] = json.loads(capsys.readouterr().out)["rows"]
    assert (row["name"], row["frames"], row["offsets_s"]) == ("a", 24, "0.000")
    [clip] = project.read(tmp_path / "p.toml")
    before = clip.key()
    (tmp_path / "b.csv").write_text("")
    assert clip.key() != before


def test_the_command_lifts_keypoints_and_exports_them(tmp_path, capsys):
    camera = view()
    write_camera(tmp_path / "cam.json", camera)
    write(tmp_path / "k.csv", keypoints(camera, seconds=1.6))
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "p.toml").write_text(
        'defaults = {camera = "cam.json", make = ["lift", "trc"], options = ["--method", "segment"]}\n'
        '[[clip]]\nkeypoints = "k.csv"\n[[clip]]\nkeypoints = "empty.csv"\n'
    )
    assert gait.cli.main(["batch", str(tmp_path / "p.toml"), "-o", str(tmp_path / "out"), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["clips"] == 2 and found["failed"] == 1
    assert found["rows"][0]["frames"] == 24 and "empty.csv" in found["rows"][1]["error"]
    assert {file.name for file in (tmp_path / "out/k").iterdir()} == {"motion.csv", "motion.trc", "done.json"}
    assert Path(tmp_path / "out/index.html").is_file() and np.isfinite(found["rows"][0]["sd_mm"])
