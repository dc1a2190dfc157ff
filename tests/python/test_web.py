"""What pages share: parts, modules, and the server."""

import asyncio
import http.client
import json
from concurrent.futures import ThreadPoolExecutor

import browser
import numpy as np
import pytest
from starlette.responses import StreamingResponse
from starlette.routing import Route

from gait.errors import UserError
from gait.web import modules, parts, serve
from gait.web.motion_data import curve, motion_data

JOINTS = ("pelvis", "l_knee", "r_knee", "l_ankle", "r_ankle", "head")
BONES = ((0, 1), (0, 2), (1, 3), (2, 4), (0, 5))
REST = np.array([[0, 0, 0.9], [0, 0.1, 0.5], [0, -0.1, 0.5], [0, 0.1, 0.1], [0, -0.1, 0.1], [0, 0, 1.6]])
SCRIPT = """
import { Scene } from 'gait/scene.js';
import { Curves } from 'gait/curves.js';
const data = JSON.parse(document.getElementById('data').textContent);
window.scene = new Scene(document.getElementById('scene'), data);
window.curves = new Curves(document.getElementById('curves'), data, (index) => { window.asked = index; });
window.curves.show(30);
window.scene.show(30);
"""


def walk(count=60):
    """A figure that slides along x, with curves."""
    times = np.arange(count) / 30
    points = REST + np.stack([times, 0 * times, 0 * times], axis=1)[:, None]
    points[5] = np.nan
    swing = 20 * np.sin(6 * times)
    curves = [
        curve("knee flexion", "°", swing + (side == "left") * 5, 2 + 0 * times, side)
        for side in ("left", "right")
    ]
    return motion_data(30, times, JOINTS, BONES, points, np.full(points.shape, 0.03), curves=curves)


@pytest.fixture
def fetched(monkeypatch):
    browser.chromium()
    monkeypatch.setenv("GAIT_WEB", str(browser.FETCHED))


def body(data, script=""):
    places = '<div id="scene" style="height:300px"></div><div id="curves"></div>'
    return f'{places}{modules.inlined_json("data", data)}<script type="module">{script}</script>'


def test_unknown_numbers_become_null():
    data = walk()
    assert data["points"][5] is None and data["points"][6][0] == [0.2, 0.0, 0.9]
    json.dumps(data, allow_nan=False)
    assert data["curves"][0]["high"][0] == pytest.approx(5 + 1.645 * 2, abs=2e-3)


def test_text_cannot_end_a_script():
    assert "</script><b>" not in modules.inlined_json("x", {"a": "</script><b>"})


def test_parts_that_were_not_fetched_are_named_with_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setenv("GAIT_WEB", str(tmp_path))
    with pytest.raises(
        UserError, match="three.module.js: components of web pages are not in .*gait studio --fetch"
    ):
        modules.inlined_head()


def test_damaged_parts_are_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("GAIT_WEB", str(tmp_path))
    (tmp_path / parts.THREE.file).write_text("alert(1)")
    with pytest.raises(UserError, match="is damaged or has another version"):
        parts.load(parts.THREE)


@pytest.mark.long
@pytest.mark.parametrize("dark", [False, True])
def test_a_page_that_needs_no_other_file_draws(fetched, tmp_path, dark):
    page_file = tmp_path / "page.html"
    page_file.write_text(
        f"<!DOCTYPE html><html lang='en'><head><meta charset='utf-8'><title>x</title>{modules.inlined_head()}"
        f"</head><body>{body(walk(), SCRIPT)}</body></html>"
    )
    with browser.opened(dark=dark) as page:
        page.goto(page_file.as_uri())
        page.wait_for_function("window.curves")
        assert page.evaluate("window.scene.figure.visible")
        page.evaluate("window.scene.show(5)")
        assert not page.evaluate("window.scene.figure.visible")
        left = float(page.evaluate("parseFloat(document.querySelector('.cursor').style.left)"))
        page.evaluate("window.curves.show(50)")
        assert float(page.evaluate("parseFloat(document.querySelector('.cursor').style.left)")) > left
        box = page.locator(".plot").first.bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 40)
        assert 20 < page.evaluate("window.asked") < 45
        grown = page.evaluate(
            "(scene.append({times: [9], points: [scene.data.points[0]]}), scene.data.times.length)"
        )
        assert grown == 61


def ask(url, path="/", method="GET", **headers):
    """Status and body of a request whose headers are exactly these."""
    host = url.split("/")[2]
    connection = http.client.HTTPConnection(host)
    connection.putrequest(method, path, skip_host=True)
    for name, value in ({"Host": host} | headers).items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, answer.read(), answer
    connection.close()
    return found


def test_only_this_machines_own_page_is_answered(fetched):
    with browser.serving(lambda port: serve.application("<main>hello</main>", "t", [], port)) as url:
        status, text, answer = ask(url)
        assert status == 200 and b"hello" in text
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        host = url.split("/")[2]
        assert ask(url, Host="evil.example")[0] == 403
        assert ask(url, Host="")[0] in (400, 403)
        assert ask(url, Origin="http://evil.example")[0] == 403
        assert ask(url, Origin="null")[0] == 403
        assert ask(url, method="POST")[0] == 403
        assert ask(url, method="POST", Origin=f"http://{host}")[0] == 405
        assert ask(url, "/web/three.module.js")[0] == 200
        for path in ("/web/serve.py", "/web/..%2fserve.py", "/web/../parts.py", "/etc/passwd"):
            assert ask(url, path)[0] == 404


def test_an_unread_answer_ends_with_the_server(fetched, monkeypatch):
    monkeypatch.setattr(serve, "STREAMS_END", 0)

    async def endless():
        while True:
            yield bytes(1 << 20)

    own = serve.listen(0)
    port = own.getsockname()[1]
    film = Route("/film", lambda request: StreamingResponse(endless()))
    server, thread = serve.background(serve.application("<main>hello</main>", "t", [film], port), own)
    asked = http.client.HTTPConnection("127.0.0.1", port, timeout=30)
    asked.request("GET", "/film")
    assert asked.getresponse().status == 200
    server.should_exit = True
    thread.join(30)
    assert not thread.is_alive() and not server.server_state.connections
    asked.close()


def test_a_port_that_is_taken_is_one_line():
    with serve.listen(0) as own, pytest.raises(UserError, match="give another --port"):
        serve.listen(own.getsockname()[1])


@pytest.mark.parametrize(
    "body", [b'{"a": NaN}', b'{"a": 1e999}', b'{"a": 1' + b"0" * 400 + b"}", b"[" * 3000, b"[]"]
)
def test_a_request_holds_finite_numbers_alone(body):
    class Sent:
        async def stream(self):
            yield body

    with ThreadPoolExecutor(1) as pool:  # this thread may have the loop of an open Chromium
        asked = pool.submit(asyncio.run, serve.json_object(Sent(), 10_000))
        with pytest.raises(serve.RequestError, match="not an object"):
            asked.result()
