"""Send browsers the newest pictures, all estimates and the tracker's state, less often on a busy machine."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from gait.errors import UserError
from gait.io.video import Image
from gait.live.recording import Recording, recover_recordings
from gait.web import modules, serve

_HERE = Path(__file__).parent
_FILES = ("live.js", "live.css")
_STAT = Path("/proc/stat")
_MOST_BROWSERS = 16  # browsers at a time
_ALIVE_S = 0.5  # seconds after which a quiet stream sends a sign of life, or ends with the server
_QUALITY = 80  # of JPEG pictures
_KEPT_SAMPLES = 256  # most samples that a slow browser gets late
_FASTEST = 1 / 60  # least seconds between messages to a browser
_SLOWEST = 0.4  # the same at first and on a busy machine, times the number of browsers,
_RAREST = 4.0  # but at most this
_MEASURED = 0.5  # seconds over which idle time is measured
_BUSY, _IDLE = 0.15, 0.3  # share of idle time below which messages become rarer, above which more frequent
_SPARE = 0.6  # share of idle time from which on browsers are not the cause of dropped frames
_HELD = 20.0  # seconds after a dropped frame in which messages do not become more frequent
_QUICKEST = 0.4  # least factor by which the time between messages changes at one measurement


def _picture(stream: int) -> str:
    """Return the topic of a camera's pictures."""
    return f"picture {stream}"


def _described(recording: Recording) -> dict[str, Any]:
    return {"path": ", ".join(map(str, recording.paths)), "fault": recording.fault}


class Pace:
    """Time between messages to a browser: longer while no core is idle or the tracker drops frames.

    Browsers on this machine use the cores that track, and tracking has priority.  They get their messages in
    turn, so that they do not all draw at the same time.

    Attributes
    ----------
    current : float
        Present interval, seconds.
    dropped : int
        Frames that the tracker has dropped so far.
    """

    def __init__(self) -> None:
        self.current = self._slowest = _SLOWEST
        self._browsers, self._turn = 1, 0.0
        self.dropped = self._dropped = 0
        self._held = 0.0
        self._at, self._before = time.monotonic(), _idle_time()

    def apart(self) -> float:
        """Present time between the turns of two browsers, seconds."""
        return self.interval() / self._browsers

    def wait(self) -> float:
        """Give a browser its next turn, and return the seconds until then."""
        now = time.monotonic()
        self._turn = max(now + self.interval(), self._turn + self.apart())
        return self._turn - now

    def interval(self) -> float:
        """Present interval, seconds."""
        now = time.monotonic()
        if now - self._at > _MEASURED:
            found = _idle_time()
            idle, total = (a - b for a, b in zip(found, self._before, strict=True))
            self._at, self._before = now, found
            self.adapt(idle / total if total > 0 else _share_idle(), self.dropped > self._dropped)
            self._dropped = self.dropped
        return self.current

    def adapt(self, idle: float, dropped: bool = False) -> None:
        """Adapt the interval to the share of idle time, and to whether frames were dropped meanwhile.

        Messages become more frequent by the factor that leaves `_IDLE` if all work is proportional to them.
        """
        if dropped and idle < _SPARE:
            self._held = time.monotonic() + _HELD
        busy = idle < (_SPARE if dropped else _BUSY)
        quicker = 1.0 if time.monotonic() < self._held else max((1 - idle) / (1 - _IDLE), _QUICKEST)
        factor = 2.0 if busy else min(quicker, 1.0)
        self.current = min(max(factor * self.current, _FASTEST), self._slowest)

    def begin(self, browsers: int) -> None:
        """Begin slowly with this number of browsers."""
        self._browsers = max(browsers, 1)
        self.current = self._slowest = min(_SLOWEST * self._browsers, _RAREST)
        self._at, self._before = time.monotonic(), _idle_time()


def _idle_time() -> tuple[int, int]:
    """Read idle time and total time of the cores, ticks; zeros on systems other than Linux."""
    try:
        first = _STAT.read_text(encoding="ascii").partition("\n")[0]
    except OSError:
        return 0, 0
    times = [int(word) for word in first.split()[1:9]]
    return times[3] + times[4], sum(times)


def _share_idle() -> float:
    """Share of idle time according to the load average of one minute."""
    return 1 - os.getloadavg()[0] / (os.cpu_count() or 1)


class Hub:
    """The newest values of each topic, for any number of browsers.

    `put` may be called in any thread; `newer` runs in the server's.  A slow browser misses values but does
    not delay others.
    """

    def __init__(self) -> None:
        self._loop: asyncio.AbstractEventLoop | None = None
        self._newest: dict[str, tuple[int, deque[Any]]] = {}
        self._news: dict[str, asyncio.Event] = {}
        self._lock = threading.Lock()

    def put(self, topic: str, value: Any, kept: int = 1) -> None:
        """Make `value` the newest of its topic, of which the last `kept` are stored."""
        with self._lock:
            count, values = self._newest.get(topic, (0, deque(maxlen=kept)))
            values.append(value)
            self._newest[topic] = count + 1, values
            loop = self._loop
        if loop is not None and not loop.is_closed():
            loop.call_soon_threadsafe(self._wake, topic)

    def _wake(self, topic: str) -> None:
        if (event := self._news.pop(topic, None)) is not None:
            event.set()

    def since(self, topic: str, than: int) -> tuple[int, list[Any]]:
        """Return the count of values so far, and the stored ones after the count `than`."""
        with self._lock:
            count, values = self._newest.get(topic, (0, deque()))
            return count, list(values)[max(len(values) - (count - than), 0) :]

    async def newer(self, topic: str, than: int, seconds: float) -> None:
        """Wait at most this long for a value after the count `than`."""
        self._loop = asyncio.get_running_loop()
        event = self._news.setdefault(topic, asyncio.Event())
        if self.since(topic, than)[0] <= than:
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(event.wait(), seconds)


class Page:
    """The live page, with its server in a separate thread.

    Parameters
    ----------
    port : int
        Port of 127.0.0.1; 0: any free one.
    streams : sequence of int
        Numbers of the cameras.
    url : str
        LCM URL on which frames arrive; recorded.
    folder : path
        Folder for recordings.
    people : sequence of str
        URLs of the trackers whose estimates are shown; recorded.  By default `url`.

    Attributes
    ----------
    address : str
        URL to open in a browser.
    """

    def __init__(
        self, port: int, streams: Sequence[int], url: str, folder: str | Path, people: Sequence[str] = ()
    ) -> None:
        self._streams, self._url, self._folder = tuple(streams), url, folder
        self._people = tuple(people) or (url,)
        self.hub = Hub()
        self._data: Callable[[], dict[str, Any]] = dict
        self._scene: Mapping[str, bytes] = {}
        self._recording: Recording | None = None
        self._topics = [f"{topic} {k}" for topic in ("sample", "health") for k in range(len(self._people))]
        self._topics += ["recording", "frames", *map(_picture, streams)]
        self._drops: dict[int, int] = {}  # frames, by person
        self._pictures: dict[int, Image] = {}
        self._jpeg: dict[int, tuple[int, bytes]] = {}
        self._open, self._pace, self._shown = 0, Pace(), 0.0
        recover_recordings(folder)
        own = serve.listen(port)
        self.address = serve.address(own)
        self._server, self._thread = serve.background(self._application(own.getsockname()[1]), own)

    def begin(self, data: Callable[[], dict[str, Any]], scene: Mapping[str, bytes]) -> None:
        """Set the initial data of the figure and the plots, and the messages with which recordings begin."""
        self._data, self._scene = data, scene

    def show(self, stream: int, image: Image) -> None:
        """Make a picture the newest of its camera; browsers are notified, and request it."""
        self._pictures[stream], self._shown = image, time.monotonic()
        self.hub.put(_picture(stream), stream)

    def report(self, topic: str, value: dict[str, Any]) -> None:
        """Make a sample, the tracker's health, or the arrival of frames the newest of its topic."""
        if topic == "health":
            self._drops[value["person"]] = value["dropped"]
            self._pace.dropped = sum(self._drops.values())
        of_person = f"{topic} {value['person']}" if "person" in value else topic
        text = json.dumps(value, allow_nan=False, separators=(",", ":"))
        self.hub.put(of_person, text, _KEPT_SAMPLES if topic == "sample" else 1)

    def watched(self) -> bool:
        """Whether a browser shows the page, and it is time for a picture."""
        return self._open > 0 and time.monotonic() - self._shown > self._pace.apart()

    def close(self) -> None:
        """Stop the server and a recording."""
        self._server.should_exit = True
        self._thread.join()
        if self._recording is not None:
            self._recording.end()

    def _application(self, port: int) -> ASGIApp:
        own = {name: (_HERE / name).read_bytes() for name in _FILES}
        routes = [
            Route("/state", self._state),
            Route("/frame/{stream:int}.jpg", self._frame),
            Route("/events", self._events),
            Route("/record", self._record, methods=["POST"]),
            Route("/live/{name}", serve.in_memory(own)),
        ]
        page = (_HERE / "page.html").read_text(encoding="utf-8")
        return serve.application(page, "gait view", routes, port, drawing=modules.available())

    def _state(self, request: Request) -> Response:
        found = self._data() | {"parts": modules.available(), "recording": self._recorded()}
        return JSONResponse(found)

    def _recorded(self) -> dict[str, Any]:
        return {} if self._recording is None else _described(self._recording)

    async def _record(self, request: Request) -> Response:
        """Begin a recording (``?on=1``) or end it (``?on=0``), if that is not already so."""
        on = request.query_params.get("on") == "1"
        ended = self._recording
        if on and (ended is None or ended.fault):
            try:
                self._recording = Recording(
                    self._url, self._people, self._folder, self._report_recording, self._scene
                )
            except UserError as error:
                return JSONResponse({"error": str(error)}, 409)
        elif not on and ended is not None:
            await asyncio.to_thread(ended.end)  # a failure is reported meanwhile
            self._recording = None
        self._report_recording()
        return JSONResponse(self._recorded() or ({} if ended is None else _described(ended)))

    def _report_recording(self) -> None:
        """Report to all browsers whether a recording is running."""
        self.report("recording", self._recorded())

    def _frame(self, request: Request) -> Response:
        stream = request.path_params["stream"]
        count, _ = self.hub.since(_picture(stream), 0)
        if count == 0:
            return PlainTextResponse("no picture yet\n", 503 if stream in self._streams else 404)
        made, jpeg = self._jpeg.get(stream, (0, b""))
        if made != count:  # encoded for the first browser that asks; others get the same
            options = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
            jpeg = cv2.imencode(".jpg", self._pictures[stream], options)[1].tobytes()
            self._jpeg[stream] = count, jpeg
        return Response(jpeg, media_type="image/jpeg", headers={"cache-control": "no-store"})

    async def _events(self, request: Request) -> Response:
        async def lines() -> AsyncIterator[bytes]:
            counts = dict.fromkeys(self._topics, 0)
            while not serve.ending(request):
                waits = [
                    asyncio.ensure_future(self.hub.newer(name, counts[name], _ALIVE_S)) for name in counts
                ]
                await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
                for wait in waits:
                    wait.cancel()
                text = b""
                for name, before in counts.items():
                    counts[name], values = self.hub.since(name, before)
                    for value in values:
                        text += f"event: {name.split()[0]}\ndata: {value}\n\n".encode()
                yield text or b": here\n\n"
                await asyncio.sleep(self._pace.wait())

        if self._open >= _MOST_BROWSERS:
            return PlainTextResponse("too many browsers\n", 503)
        self._count(1)  # at once: otherwise simultaneous requests would all pass
        return _Stream(lines(), lambda: self._count(-1))

    def _count(self, more: int) -> None:
        self._open += more
        self._pace.begin(self._open)


class _Stream(StreamingResponse):
    """Stream of events; `ended` is called at its end, also if it never began."""

    def __init__(self, lines: AsyncIterator[bytes], ended: Callable[[], None]) -> None:
        super().__init__(lines, media_type="text/event-stream", headers={"cache-control": "no-store"})
        self._ended = ended

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._ended()
