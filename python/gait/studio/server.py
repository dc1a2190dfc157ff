"""Routes of the studio's page."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from gait.errors import UserError
from gait.studio.session import Session
from gait.web import serve

_HERE = Path(__file__).parent
_FILES = ("studio.js", "studio.css")
_LONGEST = 10_000  # bytes of a request
_PERIOD = 0.05  # seconds between two checks of the version
_ALIVE = 10.0  # seconds after which a quiet stream shows that it is there


def application(session: Session, port: int) -> ASGIApp:
    """Application of a session's page, for browsers that name the port."""
    own = {name: (_HERE / name).read_bytes() for name in _FILES}

    def answered(act: Callable[[], Any]) -> Response:
        try:
            return JSONResponse(act())
        except UserError as error:
            return JSONResponse({"error": str(error)}, 409)

    def state(request: Request) -> Response:
        return answered(session.state)

    async def edit(request: Request) -> Response:
        return await acted(request, session.edit)

    async def acted(request: Request, act: Callable[[dict[str, Any]], Any]) -> Response:
        try:
            action = await serve.json_object(request, _LONGEST)
        except serve.RequestError as error:
            return JSONResponse({"error": str(error)}, error.status)
        return await run_in_threadpool(answered, lambda: act(action))

    async def start(request: Request) -> Response:
        return await acted(request, session.place_start)

    def undo(request: Request) -> Response:
        return answered(session.undo)

    def redo(request: Request) -> Response:
        return answered(session.redo)

    def film(request: Request) -> Response:
        return FileResponse(session.source.film, media_type="video/mp4")  # answers ranges

    def export(request: Request) -> Response:
        kind = request.path_params["kind"]
        try:
            if kind == "corrections":
                session.save()
                return FileResponse(session.source.corrections, filename="corrections.json")
            path = session.export(kind)
        except (UserError, RuntimeError) as error:
            return JSONResponse({"error": str(error)}, 409)
        return FileResponse(path, filename=f"{Path(session.source.video.path).stem}.{kind}")

    async def changes(request: Request) -> Response:
        async def versions() -> AsyncIterator[str]:
            reported, quiet = -1, 0.0
            while not await request.is_disconnected():
                if session.version != reported:
                    reported, quiet = session.version, 0.0
                    yield f"data: {reported}\n\n"
                elif quiet >= _ALIVE:
                    quiet = 0.0
                    yield ": here\n\n"
                await asyncio.sleep(_PERIOD)
                quiet += _PERIOD

        return StreamingResponse(
            versions(), media_type="text/event-stream", headers={"cache-control": "no-store"}
        )

    routes = [
        Route("/state", state),
        Route("/edit", edit, methods=["POST"]),
        Route("/start", start, methods=["POST"]),
        Route("/undo", undo, methods=["POST"]),
        Route("/redo", redo, methods=["POST"]),
        Route("/film.mp4", film),
        Route("/changes", changes),
        Route("/export/{kind:str}", export),
        Route("/studio/{name}", serve.in_memory(own)),
    ]
    page = (_HERE / "page.html").read_text(encoding="utf-8")
    title = f"gait studio: {Path(session.source.video.path).name}"
    return serve.application(page, title, routes, port)


def run(session: Session, own: socket.socket) -> None:
    """Serve until interrupted."""
    try:
        serve.run(application(session, own.getsockname()[1]), own)
    finally:
        session.close()
