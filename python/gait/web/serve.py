"""A local server: loopback only, with checks of Host and Origin, serving only the page's files."""

from __future__ import annotations

import asyncio
import contextlib
import html
import json
import math
import mimetypes
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import h11
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import BaseRoute, Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from gait.errors import UserError
from gait.web import modules

HOST = "127.0.0.1"
MOST_CONNECTIONS = 128  # of browsers, each of which opens up to six; further ones are refused
MOST_WAITING = 64  # of these that have not sent a whole request; a further one ends the oldest
REQUEST_S = 5.0  # seconds that a browser has to send a request up to its body, and then each part of that
BODY_S = 120.0  # seconds that it has to send everything
ANSWER_S = 30.0  # seconds that it may leave an answer unread
STREAMS_END = 3  # seconds that event streams have to end when the server does
_NAMES = (HOST, "localhost", "[::1]")
_POLICY = (
    "default-src 'self'; script-src {scripts}; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)


class Guard:
    """Rejects requests caused by another site or machine.

    A page of another site can make a browser send requests here, which have its Origin.  It can also let a
    host name of its own point to this machine; such requests have that Host.
    """

    def __init__(self, app: ASGIApp, port: int, scripts: str) -> None:
        self._app, self._policy = app, _POLICY.format(scripts=scripts)
        self._hosts = {f"{name}:{port}" for name in _NAMES}
        self._origins = {f"http://{host}" for host in self._hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Reject a request, or pass it on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        origin = headers.get("origin")
        safe = scope.get("method") in ("GET", "HEAD")
        if headers.get("host") not in self._hosts:
            await PlainTextResponse("gait serves only this machine\n", 403)(scope, receive, send)
            return
        if not (origin in self._origins or (origin is None and safe)):
            await PlainTextResponse("gait answers only its own page\n", 403)(scope, receive, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [
                    *message["headers"],
                    (b"content-security-policy", self._policy.encode()),
                    (b"x-content-type-options", b"nosniff"),
                    (b"referrer-policy", b"no-referrer"),
                    (b"cross-origin-resource-policy", b"same-origin"),
                ]
            await send(message)

        await self._app(scope, receive, guarded)


def application(
    page: str, title: str, routes: Sequence[BaseRoute], port: int, drawing: bool = True
) -> ASGIApp:
    """Make the application of a page.

    Parameters
    ----------
    page : str
        HTML of the body, which loads its own script from one of the routes.
    title : str
    routes : sequence of starlette.routing.Route
        Further routes; ``/`` and ``/web/NAME`` are reserved.
    port : int
        Port that must be in the Host header.
    drawing : bool
        Whether the page draws figures or curves, which need the downloaded parts.

    Raises
    ------
    UserError
        If these parts are needed but have not been downloaded.
    """
    files = modules.served(drawing)
    head, scripts = modules.served_head(drawing)
    text = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{html.escape(title)}</title>\n<link rel="icon" href="data:,">\n{head}\n</head>\n'
        f"<body>\n{page}\n</body></html>\n"
    )

    async def index(request: Request) -> Response:
        return Response(text, media_type="text/html", headers={"cache-control": "no-store"})

    own = [Route("/", index), Route("/web/{name}", in_memory(files))]
    return Guard(Starlette(routes=[*own, *routes]), port, scripts)


class RequestError(UserError):
    """A request that is too long, or not a JSON object; `status`: HTTP status of the answer."""

    def __init__(self, text: str, status: int = 400) -> None:
        super().__init__(text)
        self.status = status


async def json_object(request: Request, most: int) -> dict[str, Any]:
    """Read the JSON object of a request, of at most `most` bytes.

    Raises
    ------
    RequestError
        If it is longer, or not an object.
    """
    data = b""
    async for part in request.stream():
        data += part
        if len(data) > most:
            raise RequestError("the request is too long; leave some out", 413)
    try:
        found = json.loads(
            data,
            parse_constant=_finite,
            parse_float=_finite,
            parse_int=lambda text: int(text) if _finite(text) else 0,
        )
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise RequestError("the request is not an object; reload the page")
    return found


def _finite(text: str) -> float:
    """Read a number; ValueError if it is not finite."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def in_memory(files: Mapping[str, bytes]) -> Callable[[Request], Response]:
    """Make an endpoint that serves only these files, by their ``name`` in the path."""

    def answer(request: Request) -> Response:
        name = request.path_params["name"]
        if name not in files:
            return PlainTextResponse("not here\n", 404)
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        return Response(files[name], media_type=kind, headers={"cache-control": "no-cache"})

    return answer


def listen(port: int) -> socket.socket:
    """Open a socket on this machine's loopback; port 0 means any free port.

    Raises
    ------
    UserError
        If the port is taken.
    """
    own = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        own.bind((HOST, port))
        own.listen()  # browsers wait until the server is up
    except OSError as error:
        own.close()
        raise UserError(f"port {port}: {error.strerror}; give another --port") from error
    return own


def address(own: socket.socket) -> str:
    """Return the URL of a server on a socket."""
    return f"http://{HOST}:{own.getsockname()[1]}/"


def run(app: ASGIApp, own: socket.socket, ready: Callable[[], None]) -> None:
    """Serve until the process is interrupted; `ready` is called once an interrupt ends the server cleanly."""
    with contextlib.suppress(KeyboardInterrupt):
        _server(app, ready).run(sockets=[own])


def background(app: ASGIApp, own: socket.socket) -> tuple[uvicorn.Server, threading.Thread]:
    """Serve in a thread, until the server's ``should_exit`` is set."""
    server = _server(app, lambda: None)
    thread = threading.Thread(target=lambda: server.run(sockets=[own]), daemon=True)
    thread.start()
    return server, thread


def ending(request: Request) -> bool:
    """Whether the server is ending, so that event streams must end too."""
    return bool(request.scope["ending"]())


def _server(app: ASGIApp, ready: Callable[[], None]) -> uvicorn.Server:
    async def informed(scope: Scope, receive: Receive, send: Send) -> None:
        await app(dict(scope) | {"ending": lambda: server.should_exit}, receive, send)

    config = uvicorn.Config(
        informed,
        log_level="error",
        access_log=False,
        lifespan="off",
        timeout_graceful_shutdown=STREAMS_END,
        limit_concurrency=MOST_CONNECTIONS,
        http=_Connection,
    )
    server = _Server(config, ready)
    return server


class _Connection(H11Protocol):
    """A connection that ends if it does not send a whole request, or does not read an answer, in time."""

    _late: asyncio.TimerHandle | None = None  # runs while the rest of a request is expected
    _end_at = math.inf  # when the whole request must have come, in the loop's time
    _unread: asyncio.TimerHandle | None = None  # runs while an answer waits

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._watch()
        waiting = [one for one in self.connections if isinstance(one, _Connection) and one._late]
        if len(waiting) > MOST_WAITING:
            min(waiting, key=lambda one: one._late.when() if one._late else 0.0)._end()

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        self._watch(more=self.conn.their_state is h11.SEND_BODY)

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._watch()

    def _stop(self) -> None:
        for timer in filter(None, (self._late, self._unread)):
            timer.cancel()
        self._late = self._unread = None

    def _end(self) -> None:
        self._stop()
        self.connections.discard(self)
        self.transport.abort()

    def _watch(self, more: bool = False) -> None:
        owes, now = self.conn.their_state in (h11.IDLE, h11.SEND_BODY), self.loop.time()
        if self._late and (more or not owes):
            self._late.cancel()
            self._late = None
        if not owes:
            self._end_at = math.inf
        elif not self._late:
            self._end_at = min(self._end_at, now + BODY_S)
            self._late = self.loop.call_at(min(now + REQUEST_S, self._end_at), self._end)

    def pause_writing(self) -> None:
        super().pause_writing()
        self._unread = self.loop.call_later(ANSWER_S, self._end)

    def resume_writing(self) -> None:
        super().resume_writing()
        if self._unread:
            self._unread.cancel()


class _Server(uvicorn.Server):
    """Server that reports that it is ready, and closes remaining connections when it ends."""

    def __init__(self, config: uvicorn.Config, ready: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):  # whose answers have not ended in time
            connection.transport.abort()
        await asyncio.sleep(0)  # lets them close
