"""A page for clicking marks on the floor and typing their distances, to place the camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from gait.camera.camera import Camera, write_camera
from gait.camera.marks import coordinates, floor_lines, place_marks, place_unknown
from gait.camera.placing import FEWEST_GROUND_POINTS
from gait.errors import UserError
from gait.io.files import replacing
from gait.web import serve

_MOST_MARKS = 60  # most marks
_LARGEST_COORDINATE = 1e4  # largest coordinate, metres or pixels
_POLE = 1.75  # metres; height of the pole that is drawn
_LONGEST_REQUEST_BYTES = 1 << 16  # longest request
_HERE = Path(__file__).parent


@dataclass(frozen=True)
class Scene:
    """What the page shows, and the file that it writes.

    Attributes
    ----------
    name : str
        Name of the film or picture.
    size : (int, int)
    frames : int
        Number of frames.
    picture : callable
        Returns a frame by its number.
    lens : Camera or None
        None: the focal length is also estimated from the marks.
    lens_words : str
        Where the lens is from, in words.
    output : str
        Camera file to write.
    first : int
        Frame shown first.
    """

    name: str
    size: tuple[int, int]
    frames: int
    picture: Callable[[int], np.ndarray[Any, Any]]
    lens: Camera | None
    lens_words: str
    output: str
    first: int = 0


def application(scene: Scene, port: int, written: Callable[[str], None] = lambda words: None) -> ASGIApp:
    """Make the page's application; `written` is called with a line when the camera file has been written."""
    own = {name: (_HERE / name).read_bytes() for name in ("camera_page.js", "camera_page.css")}
    page = _Page(scene, written)
    routes = [
        Route("/page/{name}", serve.in_memory(own)),
        Route("/about.json", page.about),
        Route("/frame/{number:int}.jpg", page.frame),
        Route("/place", page.place, methods=["POST"]),
        Route("/save", page.save, methods=["POST"]),
    ]
    body = '<main id="page"></main><script type="module" src="/page/camera_page.js"></script>'
    return serve.application(body, f"gait camera: {scene.name}", routes, port, drawing=False)


class _Page:
    """Endpoints of the page."""

    def __init__(self, scene: Scene, written: Callable[[str], None]) -> None:
        self._scene, self._written = scene, written

    def about(self, request: Request) -> Response:
        """Answer with what the page shows."""
        scene = self._scene
        return JSONResponse(
            {
                "name": scene.name,
                "size": list(scene.size),
                "frames": scene.frames,
                "first": scene.first,
                "lens": scene.lens_words,
                "least": FEWEST_GROUND_POINTS,
                "output": Path(scene.output).name,
            }
        )

    def frame(self, request: Request) -> Response:
        """Answer with a frame of the film."""
        number = int(request.path_params["number"])
        if number >= self._scene.frames:
            return PlainTextResponse("not here\n", 404)
        quality = [cv2.IMWRITE_JPEG_QUALITY, 92]
        data = cv2.imencode(".jpg", self._scene.picture(number), quality)[1].tobytes()
        return Response(data, media_type="image/jpeg")

    async def place(self, request: Request) -> Response:
        """Place the camera from the marks."""
        return await self._answer(request, lambda found: None)

    async def save(self, request: Request) -> Response:
        """Place the camera from the marks and write its file."""
        return await self._answer(request, self._save)

    async def _answer(self, request: Request, use: Callable[[dict[str, Any]], None]) -> Response:
        try:
            marks = await serve.json_object(request, _LONGEST_REQUEST_BYTES)
            found = await run_in_threadpool(solve, self._scene, marks)
            use(found)
        except UserError as error:
            return JSONResponse({"fault": str(error).removeprefix("marks: ")})
        except OSError as error:
            return JSONResponse({"fault": f"{self._scene.output} was not written: {error.strerror}"})
        del found["camera"]
        return JSONResponse(found)

    def _save(self, found: dict[str, Any]) -> None:
        output = self._scene.output
        with replacing(output) as temporary:
            write_camera(temporary, found["camera"])
        self._written(f"{output}: written, {found['rms']:.2f} px rms from {len(found['off'])} marks")


def solve(scene: Scene, marks: dict[str, Any]) -> dict[str, Any]:
    """Place the camera from marks sent by the page.

    Parameters
    ----------
    scene : Scene
    marks : dict
        ``uv``: pixels of each mark; and ``xy``: their metres, or ``distances``: [i, j, metres] of pairs.

    Returns
    -------
    dict
        ``camera``, its ``place``, ``focal`` length and relative ``sd`` of the latter; ``xy`` of the marks;
        ``shown``: their projections; ``off`` and ``rms``: reprojection errors in pixels; ``missed_m``:
        residual of each distance; lines of the floor's ``grid`` and a ``pole`` as high as a person, in
        pixels.

    Raises
    ------
    UserError
        Describing missing or contradictory marks.
    """
    uv = _numbers(marks.get("uv"), "pixels")
    if len(uv) < FEWEST_GROUND_POINTS:
        lacking = FEWEST_GROUND_POINTS - len(uv)
        raise UserError(f"marks: click {lacking} more mark{'s' if lacking > 1 else ''} on the floor")
    missed: list[float] = []
    if mirrored := "distances" in marks:
        distances = _distances(marks["distances"], len(uv))
        xy, far = coordinates(len(uv), distances)
        missed = far.tolist()
    else:
        xy = _numbers(marks.get("xy"), "metres")
        if len(xy) != len(uv):
            raise UserError("marks: give x and y of every mark")
    sd = 0.0
    if scene.lens is not None:
        camera, off, xy = place_marks(scene.lens, uv, xy, mirrored)
    else:
        camera, off, xy, sd = place_unknown(scene.size, uv, xy, mirrored)
    foot = np.array([*xy.mean(axis=0), 0.0])
    return {
        "camera": camera,
        "off": off.tolist(),
        "rms": float(np.sqrt((off**2).mean())),
        "missed_m": missed,
        "xy": xy.tolist(),
        "place": camera.centre.tolist(),
        "shown": camera.project(np.pad(xy, ((0, 0), (0, 1)))).tolist(),
        "grid": floor_lines(camera, xy),
        "pole": np.nan_to_num(camera.project([foot, foot + [0, 0, _POLE]])).tolist(),
        "focal": camera.fx,
        "sd": sd,
    }


def _numbers(rows: Any, unit: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        found = np.asarray(rows, np.float64).reshape(-1, 2)
    except (TypeError, ValueError):
        found = np.full((1, 2), np.nan)
    if len(found) > _MOST_MARKS or not (np.abs(found) <= _LARGEST_COORDINATE).all():
        raise UserError(f"marks: give numbers of {unit} for every mark")
    return found


def _distances(rows: Any, count: int) -> dict[tuple[int, int], float]:
    found = {}
    try:
        for i, j, metres in rows:
            pair, length = (int(min(i, j)), int(max(i, j))), float(metres)
            if not (0 <= pair[0] < pair[1] < count and 0 < length <= _LARGEST_COORDINATE):
                raise ValueError
            found[pair] = length
    except (TypeError, ValueError):
        raise UserError("marks: give distances in metres, above 0") from None
    return found
