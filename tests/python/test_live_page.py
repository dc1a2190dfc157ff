"""The live page in a real Chromium: numbers, figure, plots, pause, what is missing, recording."""

import math
import os
import time
import urllib.request

import accessibility
import browser
import cv2
import lcm_rig as rig
import numpy as np
import pytest

from gait.lcm.link import events_of, private_url
from gait.live import server
from gait.live.feed import Feed
from gait.live.server import Hub, Pace, Page
from gait.report.terms import STATUS_TERMS

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """Samples and pictures of six frames, and the initial state of the page."""
    folder = tmp_path_factory.mktemp("live")
    opening, frames = rig.opening(), rig.frames(0, 6)
    estimates = rig.play(rig.write_log(folder / "in.log", [*opening, *frames])).estimates
    pairs = [
        each for pair in zip(frames, [("GAIT_ESTIMATE", e) for e in estimates], strict=True) for each in pair
    ]
    log, pictures, samples = rig.write_log(folder / "both.log", [*opening, *pairs]), [], []
    feed = Feed(
        f"file://{log}?speed=0",
        [0],
        rig.model(),
        {},
        lambda _, image: pictures.append(image),
        lambda topic, value: samples.append(value) if topic == "sample" else None,
    )
    while feed.handle(1.0):
        pass
    return samples, pictures, feed


@pytest.fixture
def live(reports, tmp_path, monkeypatch):
    browser.chromium()
    monkeypatch.setenv("GAIT_WEB", str(browser.FETCHED))
    page = Page(0, [0], private_url(), tmp_path)
    page.begin(reports[2].page_data, reports[2].scene)
    yield page
    page.close()


def send(live, reports, which):
    for k in which:
        live.show(0, reports[1][k])
        live.report("sample", reports[0][k])
        time.sleep(0.05)  # as a camera's frames come; the newest alone would arrive


def test_the_page_waits_and_then_shows_a_tracker(live, reports):
    with browser.opened() as page:
        page.goto(live.address)
        browser.until(page, "document.querySelector('#waiting').textContent.includes('gait-trackd')")
        assert reports[2].url in page.inner_text("#waiting")
        assert "gait capture" in page.inner_text("#waiting")
        live.report("frames", {"stream": 0})
        words = "no tracker answers: start gait-trackd"
        browser.until(page, f"document.querySelector('#waiting').textContent.includes('{words}')")
        assert "gait capture" not in page.inner_text("#waiting")
        live.report(
            "health",
            {
                "person": 0,
                "state": "waiting",
                "text": "waiting for a camera",
                "frames": 0,
                "dropped": 2,
                "particles": 9,
            },
        )
        browser.until(page, "document.querySelector('#text').textContent === 'waiting for a camera'")
        browser.until(page, "document.querySelector('#waiting').textContent.includes('Start gait capture')")
        send(live, reports, range(6))
        browser.until(page, "live.scene.data.times.length > 2 && live.curves.data.times.length > 2")
        last = reports[0][5]
        browser.until(page, f"live.scene.data.times.at(-1) === {last['time']}")
        assert page.inner_text("#status") == STATUS_TERMS[last["status"]][0]
        numbers = page.inner_text("#list")
        assert (
            f"{last['speed']:.2f} m/s" in numbers
            and "frames dropped\n2" in numbers
            and not page.inner_text("#waiting")
        )
        browser.until(page, "document.querySelector('#pictures img').naturalWidth === 160")
        browser.until(page, ON_THE_FIGURE)
        assert not page.evaluate("live.curves.data.curves[0].values.includes(null)")
        live.report("sample", last | {"time": last["time"] + 5})  # no line crosses that gap
        browser.until(page, "live.curves.data.curves[0].values.includes(null)")
        accessibility.check(page)


ON_THE_FIGURE = """(({scene}) => {
  const canvas = scene.renderer.domElement, pixels = canvas.getContext('2d');
  return Boolean(pixels) && scene.limbs.balls.every((ball) => {  // without a card, a 2-D canvas
    const {x, y} = ball.position.clone().project(scene.camera);
    const at = [(1 + x) * canvas.width / 2, (1 - y) * canvas.height / 2].map(Math.round);
    const [back, found] = [[2, canvas.height - 2], at].map((uv) => pixels.getImageData(...uv, 1, 1).data);
    return found.some((value, k) => Math.abs(value - back[k]) > 40);
  });
})(live)"""  # whether each joint has another colour than the ground
OUTSIDE = """[...document.querySelectorAll('.panel, header')].flatMap((panel) => {
  const box = panel.getBoundingClientRect();
  return [...panel.querySelectorAll('*'), ...(panel.matches('header') ? [] : [panel])].filter((each) => {
    const own = each.getBoundingClientRect();
    const others = [...document.querySelectorAll('.panel, header')].filter((other) => !other.contains(each));
    return own.width && own.height && (own.left < box.left - 1 || own.right > box.right + 1
      || own.top < box.top - 1 || own.bottom > box.bottom + 1 || others.some((other) => {
        const its = other.getBoundingClientRect();
        return own.left < its.right - 1 && own.right > its.left + 1
          && own.top < its.bottom - 1 && own.bottom > its.top + 1;
      }));
  }).map((each) => `${each.tagName} ${each.id} of ${panel.id || panel.className}`);
})"""  # what lies outside its panel, or over another


@pytest.mark.parametrize("width", [1280, 390])
def test_everything_stays_in_its_panel_when_the_film_has_ended(live, reports, width):
    with browser.opened(width) as page:
        page.goto(live.address)
        browser.until(page, "window.live !== undefined")
        live.show(0, np.zeros((720, 1280, 3), np.uint8))
        live.report("sample", reports[0][5])
        browser.until(page, "document.querySelector('#pictures img').naturalWidth === 1280")
        browser.until(page, "live.curves.data.times.length > 0")
        browser.until(page, "document.querySelector('#waiting').textContent")
        health = {
            "person": 0,
            "state": "running",
            "text": "tracking",
            "frames": 6,
            "dropped": 0,
            "particles": 9,
        }
        live.report("health", health)
        browser.until(page, "document.querySelector('#waiting').textContent.includes('film has ended')")
        assert "Start" not in page.inner_text("#waiting")
        assert page.evaluate(OUTSIDE) == []
        image = page.locator("#pictures img").bounding_box()
        assert image["height"] > 150 and image["width"] > 300


def test_pause_holds_the_page(live, reports):
    with browser.opened() as page:
        page.goto(live.address)
        browser.until(page, "window.live !== undefined")
        send(live, reports, [0, 1])
        browser.until(page, "live.scene.data.times.length > 0")
        page.keyboard.press("Space")
        held = page.inner_text("#list")
        send(live, reports, [4, 5])
        page.wait_for_timeout(300)
        assert page.inner_text("#list") == held
        page.click("#pause")
        send(live, reports, [5])
        browser.until(page, f"live.scene.data.times.at(-1) === {reports[0][5]['time']}")


def test_a_snapshot_saves_the_picture_that_is_shown(live, reports, tmp_path):
    with browser.opened() as page:
        page.goto(live.address)
        browser.until(page, "window.live !== undefined")
        send(live, reports, [2])
        browser.until(page, "document.querySelector('#pictures img').naturalWidth === 160")
        with page.expect_download() as download:
            page.click("#snapshot")
        assert download.value.suggested_filename == "gait-camera-0.png"
        download.value.save_as(tmp_path / "saved.png")
    with urllib.request.urlopen(f"{live.address}frame/0.jpg") as answer:
        shown = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_COLOR_BGR)
    saved = cv2.imread(str(tmp_path / "saved.png"))
    assert saved.shape == shown.shape and np.abs(saved.astype(int) - shown).mean() < 2  # two JPEG decoders


def test_several_people_have_numbers_and_figures_of_their_own(reports, tmp_path, monkeypatch):
    browser.chromium()
    monkeypatch.setenv("GAIT_WEB", str(browser.FETCHED))
    url, people = private_url(), [private_url(), private_url()]
    live = Page(0, [0], url, tmp_path, people)
    live.begin(lambda: reports[2].page_data() | {"people": people}, {})
    try:
        with browser.opened() as page:
            page.goto(live.address)
            browser.until(page, "window.live !== undefined")
            live.report("sample", reports[0][0] | {"person": 1, "speed": 1.11})
            live.report("sample", reports[0][0] | {"speed": 2.22})
            browser.until(
                page, "live.scene.others.length === 1 && document.body.innerText.includes('2.22 m/s')"
            )
            page.click("#people button >> nth=1")
            live.report("sample", reports[0][1] | {"person": 1, "speed": 1.11})
            browser.until(page, "document.querySelector('#list').innerText.includes('1.11 m/s')")
            assert "2.22" not in page.inner_text("#list")
            accessibility.check(page)
    finally:
        live.close()


def test_several_cameras_have_pictures_of_their_own(reports, tmp_path, monkeypatch):
    browser.chromium()
    monkeypatch.setenv("GAIT_WEB", str(browser.FETCHED))
    live = Page(0, [0, 3], private_url(), tmp_path)
    live.begin(lambda: reports[2].page_data() | {"streams": [0, 3]}, {})
    try:
        with browser.opened() as page:
            page.goto(live.address)
            browser.until(page, "window.live !== undefined")
            assert page.locator("#pictures figcaption").all_inner_texts() == ["camera 0", "camera 3"]
            live.show(3, reports[1][0][:60])
            live.show(0, reports[1][0])
            sizes = "[...document.querySelectorAll('#pictures img')].map((each) => each.naturalHeight)"
            browser.until(page, f"JSON.stringify({sizes}) === '[120,60]'")
            accessibility.check(page)
    finally:
        live.close()


def test_a_browser_connects_again_to_another_gait_view(live, reports, tmp_path):
    with browser.opened(strict=False) as page:
        page.goto(live.address)
        browser.until(page, "window.live !== undefined")
        send(live, reports, [0])
        browser.until(page, "live.scene.data.times.length > 0")
        live.close()
        browser.until(page, "document.querySelector('#status').textContent === 'gait view is not there'")
        again = Page(int(live.address.split(":")[2].rstrip("/")), [0], private_url(), tmp_path)
        try:
            send(again, reports, [1])
            browser.until(page, f"live.scene.data.times.at(-1) === {reports[0][1]['time']}")
        finally:
            again.close()


def test_the_page_ends_without_an_error_under_an_open_browser(live, capfd):
    with browser.opened(strict=False) as page:
        page.goto(live.address)
        browser.until(page, "window.live !== undefined")
        live.close()
        browser.until(page, "document.querySelector('#status').textContent === 'gait view is not there'")
    assert capfd.readouterr().err == ""


def test_the_record_button_makes_a_log(live, tmp_path):
    rig.need_multicast()
    with browser.opened() as page:
        page.goto(live.address)
        browser.until(page, "window.live !== undefined")
        page.click("#record")
        browser.until(page, "document.querySelector('#record').textContent === 'Stop recording'")
        page.reload()
        browser.until(
            page,
            "window.live !== undefined && document.querySelector('#record').textContent === 'Stop recording'",
        )
        page.click("#record")
        browser.until(page, "document.querySelector('#message').textContent.startsWith('Recorded in')")
        page.wait_for_timeout(100)
    (log,) = tmp_path.glob("gait-*.log")
    assert "GAIT_CAMERA_0" in {event.channel for event in events_of(log)}


def test_browsers_get_less_often_what_a_busy_machine_shows_and_miss_no_sample(tmp_path, monkeypatch):
    pace, hub = Pace(), Hub()
    pace.begin(10)
    for _ in range(6):
        pace.adapt(idle=0.8)
    assert pace.current < 1 / 30
    for _ in range(20):
        pace.adapt(idle=0.5, dropped=True)
    assert pace.current == 4.0
    pace.adapt(idle=0.9)
    assert pace.current == 4.0  # frames were dropped just before
    pace._held = 0.0
    pace.adapt(idle=0.9, dropped=True)  # the tracker itself is too slow
    assert pace.current < 4.0
    for _ in range(20):
        pace.adapt(idle=0.0)
    assert pace.current == 4.0
    pace._at = math.inf  # stays as it is
    assert [round(pace.wait() - (1 + 0.1 * k) * pace.current, 2) for k in range(10)] == [0.0] * 10  # in turn
    monkeypatch.setattr(server, "_STAT", tmp_path / "no Linux")
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    pace.begin(1)
    pace._at -= 1
    assert pace.interval() < 0.2
    for k in range(5):
        hub.put("sample 0", k, kept=3)
        hub.put("health 0", k)
    assert hub.since("sample 0", 4) == (5, [4]) and hub.since("sample 0", 0) == (5, [2, 3, 4])
    assert hub.since("health 0", 0) == (5, [4]) and hub.since("health 0", 5) == (5, [])
