"""The page of a run: what it states, and that it opens, plays and fits in a real Chromium."""

import contextlib
import csv
import io
import json
import re
from dataclasses import replace

import accessibility
import av
import browser
import numpy as np
import pytest
from drawn_person import FPS, camera, clip, write
from walking_track import walking_track

from gait import Estimate, Flag, Frame, Model, State, TrackStatus, Video
from gait.batch.run import DONE, FAILED, write_summary
from gait.bindings.model import read_blob
from gait.cli import main
from gait.errors import UserError
from gait.io import blob
from gait.io.track_file import TrackWriter, read_track
from gait.io.video import VideoWriter
from gait.motion.verdict import WHICH_LEG, verdict_of
from gait.report.film import page_size

pytestmark = pytest.mark.long

MODEL = Model()
CHANGE = np.arange(12.0).reshape(3, 4) / 1000
FRAMES, FIRST = 90, 6  # of the film; the first with an estimate
STATUS = {
    **dict.fromkeys(range(6, 9), TrackStatus.INIT),
    **dict.fromkeys(range(40, 44), TrackStatus.AMBIGUOUS),
    **dict.fromkeys(range(86, 90), TrackStatus.LOST),
}


def estimate(number, state):
    joints, angles = MODEL.pose(state)
    return Estimate(
        utime=round(1e6 * number / FPS), frame=number, status=STATUS.get(number, TrackStatus.TRACKING),
        flags=Flag(0), log_evidence=0.0, ess=1.0, phase_r=1.0, hypothesis_weight=1.0, speed=1.2, mean=state,
        sd=State(phase=0.01, stride_hz=0.02, coef=np.full(5, 0.3)), best=state, joints=joints + 0.01,
        joint_sd=np.full(joints.shape, 0.02), angles=angles, joint_names=MODEL.joint_names,
    )  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A film of three seconds, its camera, its truth, and a track with frames of every status."""
    here = tmp_path_factory.mktemp("run")
    pictures, states = clip(MODEL, blob.decode(read_blob(None)), FRAMES, start=(-1.5, 0.0))
    write(here / "walk.mp4", pictures)
    (here / "camera.json").write_text(json.dumps(camera().to_dict()))
    with TrackWriter(here / "run.csv", 5, MODEL.joint_names, MODEL.angle_names) as rows:
        for number in range(FIRST, FRAMES):
            rows.write(Frame(number, number / FPS, None), estimate(number, states[number]))
    names = MODEL.joint_names, MODEL.angle_names, ()
    with TrackWriter(here / "part.csv", 5, *names, range(4, 84), lambda time: time * CHANGE) as rows:
        for number in range(FIRST, 84):
            found = replace(estimate(number, states[number]), reason="legs cross" if number < 42 else "")
            rows.write(Frame(number, number / FPS, None), found)
    with open(here / "truth.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "time", *(f"{j}_{a}" for j in MODEL.joint_names for a in "xyz")])
        for i, state in enumerate(states):
            rows.writerow([i, i / FPS, *MODEL.pose(state)[0].ravel()])
    return here


@pytest.fixture(scope="module")
def whole(folder):
    """A page with everything (the turning figure if its parts were downloaded), and what was printed."""
    out = io.StringIO()
    words = [
        "report",
        "run.csv",
        "--video",
        "walk.mp4",
        "--truth",
        "truth.csv",
        "--overlay",
        "o.mp4",
        "--quiet",
    ]
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out):
        patch.setenv("GAIT_WEB", str(browser.FETCHED))
        patch.chdir(folder)
        assert main([*words, "-o", "whole.html"]) == 0
    return folder / "whole.html", out.getvalue()


def test_the_verdict_counts_what_is_tracked_unsure_and_missing(folder):
    found = verdict_of(read_track(folder / "run.csv"), FRAMES)
    assert found.counts == {"init": 3, "tracking": 73, "ambiguous": 4, "lost": 4}
    assert re.fullmatch(
        r"Tracked 77 of 90 frames, [12] whole strides?, 1\.\d\d m/s; uncertain in 4 frames; "
        "lost in 4 frames; settling in 3 frames; not found in 6 frames",
        found.sentence(),  # without why, which this file does not hold
    )
    assert found.statuses() == (
        "84 frames: 3 init, 73 tracking, 4 ambiguous, 4 lost; 6 more without an estimate"
    )
    assert found.warning() is None


def test_a_page_of_a_part_of_the_film_states_the_same_as_the_tracker(folder, capsys):
    words = ["report", folder / "part.csv", "--video", folder / "walk.mp4", "-o", folder / "part.html"]
    assert main([str(word) for word in words]) == 0
    lead = re.search('<p class="lead">(.*?)</p>', (folder / "part.html").read_text())[1]
    assert "Tracked 75 of 80 frames" in lead and lead.endswith("not found in 2 frames.")
    assert f"uncertain in 4 frames: legs cross (2), {WHICH_LEG} (2)" in lead
    # Its camera has its own world; the camera.json beside it belongs to another.
    track = read_track(folder / "part.csv")
    np.testing.assert_allclose(track.camera_change[-1], track.time[-1] * CHANGE, atol=1e-6)
    assert "camera was estimated from the walk; to see the figure" in capsys.readouterr().err


def test_another_film_is_recognised(folder, tmp_path, capsys):
    """A copy in another container is the same film, one encoded anew may be; other times are not."""
    film = Video(folder / "walk.mp4")
    pictures = [frame.image for frame in film.frames()]
    write(tmp_path / "anew.mp4", [np.roll(picture, 40, axis=1) for picture in pictures])
    with VideoWriter(tmp_path / "slow.mp4", FPS / 2) as slow:
        for picture in pictures:
            slow.write(picture)
    with av.open(folder / "walk.mp4") as old, av.open(tmp_path / "copy.mkv", "w") as new:
        stream = new.add_stream_from_template(old.streams.video[0])
        for packet in old.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                new.mux(packet)
    track = replace(read_track(folder / "run.csv"), film=film.digest)
    assert track.compare_film("run.csv", Video(tmp_path / "copy.mkv")) == ""
    words = track.compare_film("run.csv", Video(tmp_path / "anew.mp4"))
    assert "anew.mp4: is not the file that was tracked" in words
    with pytest.raises(UserError, match="slow.mp4: is not the film that was tracked: its frame"):
        track.compare_film("run.csv", Video(tmp_path / "slow.mp4"))


def test_a_track_without_any_sure_frame_is_warned_of():
    track = walking_track()
    track.status[:] = ["ambiguous"] * len(track.status)
    assert "do not rely on this track" in verdict_of(track).warning()
    track.status[:] = ["lost"] * len(track.status)
    assert verdict_of(track).sentence() == ("Tracked 0 of 150 frames, 3 whole strides; lost in 150 frames")


def test_walking_in_place_is_stated():
    track = walking_track()
    numbers = track.numbers | {"speed_m_s": np.full(150, 1.2)}
    still = {name: place - track.places["pelvis"] * (1, 1, 0) for name, place in track.places.items()}
    assert "1.20 m/s in place" in verdict_of(replace(track, places=still, numbers=numbers)).sentence()


@pytest.mark.parametrize(
    ("size", "frames", "least", "most"),
    [((640, 480), 120, 640, 640), ((3840, 2160), 120, 1280, 1280), ((1280, 720), 20000, 320, 320),
     ((1080, 1920), 900, 400, 720)],
)  # fmt: skip
def test_the_film_in_a_page_is_some_megabytes(size, frames, least, most):
    (width, height), bits = page_size(size, frames, 30.0)
    assert least <= width <= most and width / height == pytest.approx(size[0] / size[1], rel=0.02)
    assert width % 2 == height % 2 == 0
    assert bits * frames / 30 / 8 == pytest.approx(5e6, rel=0.01)


def test_the_page_states_the_verdict_first_and_no_raw_names(folder, whole):
    page, printed = whole[0].read_text(encoding="utf-8"), whole[1]
    assert f'<p class="lead">{printed.splitlines()[0]}</p>' in page
    body = re.sub(r"<script.*?</script>|<style.*?</style>|<svg.*?</svg>", "", page, flags=re.S).replace(
        str(folder), ""
    )
    for heading in ("Gait", "Footfalls", "Angles over the stride", "Path over the floor", "Uncertainty",
                    "Error against the truth", "Camera and files", "Conventions"):  # fmt: skip
        assert f"<h2>{heading}</h2>" in body
    assert not re.search(r"\b(abs|root\w*|proc|static|free|\w+_mm|torso_\w|\w+_deg)\b", body)
    assert 'abbr title="Mean distance of 15 joints' in body
    assert "start, background, particles" in body and "not in these files" in body
    assert "has the size of the tracked one, 320 × 240 pixels" in body
    film = Video(folder / "o.mp4")
    assert (film.size, film.count) == ((320, 240), FRAMES)  # frames without an estimate too


def test_without_a_camera_or_the_parts_the_page_names_how_to_get_the_figure(
    folder, tmp_path, monkeypatch, capsys
):
    monkeypatch.setenv("GAIT_WEB", str(tmp_path))
    for name in ("run.csv", "walk.mp4"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    words = ["report", tmp_path / "run.csv", "--video", tmp_path / "walk.mp4"]
    assert main([str(word) for word in words]) == 0
    assert "no camera is known, so the film is shown without the figure; give" in capsys.readouterr().err
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "The 3-D figure is not in this page: run gait studio --fetch" in page
    assert 'id="run-figure"' not in page and "echarts" not in page and len(page) < 2e6
    assert main([str(word) for word in words]) == 1  # that page may be a better one, of gait track
    assert "run.html: exists already; give -o" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["run.csv", "--track", "run.csv"], "--track: goes with a log"),
        (["walk.mp4"], "walk.mp4: is a film, not a track; track it first"),
        (["camera.json"], "camera.json: is not a track OUT.csv; with a log, also give --track"),
        (["run.csv", "--camera", "none.json"], "none.json: no such camera file"),
        (["run.csv", "--truth", "none.csv"], "none.csv: no such truth file"),
        (["run.csv", "--overlay", "walk.mp4"], "walk.mp4: is read by this command"),
        (["long.csv"], "long.csv: has frame 189, walk.mp4 ends at 89; give the film that was tracked"),
    ],
)
def test_what_does_not_fit_is_one_line(folder, options, words, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    head, *rows = (folder / "run.csv").read_text().splitlines()
    (folder / "long.csv").write_text(
        "".join(f"{row}\n" for row in [head, *(re.sub(r"^(\d+)", r"1\1", r) for r in rows[-80:])])
    )
    before = sorted(folder.iterdir())
    assert main(["report", *options, "--video", "walk.mp4"]) in (1, 2)
    printed = capsys.readouterr().err
    assert words in printed and printed.count("\n") == 1 and sorted(folder.iterdir()) == before


@pytest.fixture
def page_file(whole):
    """The page, for a browser."""
    browser.chromium()
    return whole[0]


def overflow(page):
    return page.evaluate("document.documentElement.scrollWidth - innerWidth")


def test_the_page_of_a_batch_fits_screens(tmp_path):
    name, done = "visit_1/walk_with_the_long_name_of_a_camera_GX010234", {"state": DONE, "speed_m_s": 1.2345}
    (tmp_path / name / "report").mkdir(parents=True)
    (tmp_path / name / "report/report.html").write_text("")
    rows = [{"name": name, "subject": "Anna", **done}, {"name": "b", "state": FAILED, "error": "b: damaged"}]
    write_summary(tmp_path, rows)
    accessibility.check_file(tmp_path / "index.html")


def test_the_page_fits_screens(page_file):
    with browser.opened() as page:
        page.goto(page_file.as_uri())
        page.wait_for_function("window.run")
        accessibility.check(page)
        for width in (390, 1920):
            page.set_viewport_size({"width": width, "height": 844})
            shown = page.evaluate("getComputedStyle(document.querySelector('.plot-narrow')).display")
            assert (shown == "none") == (width > 760)
        explained = "document.querySelector('details.terms dd').checkVisibility()"
        assert not page.evaluate(explained)
        page.emulate_media(media="print")
        assert page.evaluate(explained)


def test_the_page_plays_and_turns_and_fetches_nothing(page_file):
    with browser.opened() as page:
        asked = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto(page_file.as_uri())
        page.wait_for_function("window.run && run.film.video.readyState > 1 && run.film.index >= 6")
        assert overflow(page) <= 0
        assert page.evaluate("run.film.index") == FIRST  # where the track begins
        page.evaluate("run.film.seek(2)")
        assert not page.evaluate("run.scene.figure.visible")  # no estimate yet
        page.evaluate("run.film.seek(30)")
        assert page.evaluate("run.scene.index") == 30 and page.evaluate("run.scene.figure.visible")
        before = page.evaluate("run.scene.camera.position.x")
        box = page.locator("#run-figure canvas").bounding_box()
        page.mouse.move(box["x"] + 200, box["y"] + 200)
        page.mouse.down()
        page.mouse.move(box["x"] + 260, box["y"] + 210, steps=3)
        page.mouse.up()
        assert abs(page.evaluate("run.scene.camera.position.x") - before) > 0.1
        cursor = "parseFloat(document.querySelector('.over-time .cursor').style.left)"
        left = page.evaluate(cursor)
        page.keyboard.press("Space")
        page.wait_for_function(f"run.film.index > 35 && run.scene.index > 35 && {cursor} > {left}")
        page.keyboard.press("Space")
        assert not page.evaluate("run.film.playing")
        plot = page.locator(".over-time .plot-large").first
        plot.scroll_into_view_if_needed()
        box = plot.bounding_box()
        page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + 60)
        assert 55 < page.evaluate("run.film.index") < 80
        assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
