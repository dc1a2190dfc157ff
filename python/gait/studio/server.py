"""Routes of the studio's page."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from gait.errors import UserError
from gait.studio.session import NotSavedError, Session
from gait.web import serve

_HERE = Path(__file__).parent
_FILES = ("studio.js", "studio.css")
_LONGEST_REQUEST_BYTES = 10_000  # bytes of a request
_PERIOD = 0.05  # seconds between checks of the version
_ALIVE_S = 10.0  # seconds after which a quiet stream sends a sign of life


class _Endpoints:
    """Endpoints through which the page uses a session."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def routes(self) -> list[Route]:
        """List the routes of all endpoints."""
        own = {name: (_HERE / name).read_bytes() for name in _FILES}
        session, posted = self._session, ["POST"]
        return [
            Route("/state", lambda request: _answered(session.state)),
            Route("/edit", self._action(session.edit), methods=posted),
            Route("/start", self._action(session.place_start), methods=posted),
            Route("/undo", lambda request: _answered(session.undo), methods=posted),
            Route("/redo", lambda request: _answered(session.redo), methods=posted),
            Route("/film.mp4", self.film),
            Route("/changes", self.changes),
            Route("/export/{kind:str}", self.export),
            Route("/studio/{name}", serve.in_memory(own)),
        ]

    @staticmethod
    def _action(act: Callable[[dict[str, Any]], Any]) -> Callable[[Request], Awaitable[Response]]:
        """Make an endpoint that reads the JSON object of a request and acts on it."""

        async def answer(request: Request) -> Response:
            try:
                action = await serve.json_object(request, _LONGEST_REQUEST_BYTES)
            except serve.RequestError as error:
                return JSONResponse({"error": str(error)}, error.status)
            return await run_in_threadpool(_answered, lambda: act(action))

        return answer

    def film(self, request: Request) -> Response:
        """Answer with the film, or with ranges of it."""
        return FileResponse(self._session.source.film, media_type="video/mp4")

    def export(self, request: Request) -> Response:
        """Write a file and answer with it."""
        session, kind = self._session, request.path_params["kind"]
        try:
            if kind == "corrections":
                session.save()
                return FileResponse(session.source.corrections, filename="corrections.json")
            path = session.export(kind)
        except (UserError, RuntimeError) as error:
            return JSONResponse({"error": str(error)}, 409)
        return FileResponse(path, filename=f"{Path(session.source.video.path).stem}.{path.name}")

    async def changes(self, request: Request) -> Response:
        """Send the version of what is shown whenever it changes."""
        return StreamingResponse(
            self._versions(request), media_type="text/event-stream", headers={"cache-control": "no-store"}
        )

    async def _versions(self, request: Request) -> AsyncIterator[str]:
        reported, quiet = -1, 0.0
        while not (serve.ending(request) or await request.is_disconnected()):
            if self._session.version != reported:
                reported, quiet = self._session.version, 0.0
                yield f"data: {reported}\n\n"
            elif quiet >= _ALIVE_S:
                quiet = 0.0
                yield ": here\n\n"
            await asyncio.sleep(_PERIOD)
            quiet += _PERIOD


def _answered(act: Callable[[], Any]) -> Response:
    """Answer with the result of an action, or with its error."""
    try:
        return JSONResponse(act())
    except UserError as error:
        return JSONResponse({"error": str(error)}, 507 if isinstance(error, NotSavedError) else 409)


def application(session: Session, port: int) -> ASGIApp:
    """Make the application of a session's page, for requests to this port."""
    page = (_HERE / "page.html").read_text(encoding="utf-8")
    title = f"gait studio: {Path(session.source.video.path).name}"
    return serve.application(page, title, _Endpoints(session).routes(), port)


def run(session: Session, own: socket.socket, ready: Callable[[], None]) -> None:
    """Serve until interrupted; `ready` as for `gait.web.serve.run`."""
    try:
        serve.run(application(session, own.getsockname()[1]), own, ready)
    finally:
        session.close()
