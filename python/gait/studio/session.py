"""A session of corrections, with undo and redo: they are saved, and the motion is solved, as they are made.

Each edit solves the motion around it (`Lift.near`) and requests the whole in the background (`refine`), which
then replaces what is shown.
"""

from __future__ import annotations

import json
import shlex
import threading
import time
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from gait import extras
from gait.camera.camera import write_camera
from gait.errors import UserError
from gait.export import files as exports
from gait.io.fields import Fields
from gait.io.files import replacing
from gait.lift.keypoints.corrections import (
    Correction,
    Edits,
    EntryReader,
    FloorPin,
    Hidden,
    Swap,
    read_edits,
)
from gait.studio.curves import phase_at
from gait.studio.refine import ENDED, LAST_ANSWER, Refiner
from gait.studio.shown import NO_CAMERA, Solved, page_data
from gait.studio.source import Source
from gait.web.motion_data import frames, rounded

Floats = npt.NDArray[np.float64]
Point = TypeVar("Point", Correction, FloorPin)

LEAST_MARK_SD_PX, MOST_MARK_SD_PX = 0.3, 50.0  # pixels, of a point marked by hand
LONGEST_WAIT = 60.0  # seconds that an export waits for the whole motion
MOST_UNDONE = 500  # edits that can be undone
LEAST_WAY = 0.05  # metres on the floor that show a direction
ARROW = 0.7  # metres; length of the arrow that shows it


class NotSavedError(UserError):
    """The corrections could not be written; after any other error they are still saved as they were."""


class Session:
    """Film, motion and corrections of one page.

    Parameters
    ----------
    source : Source
    """

    def __init__(self, source: Source) -> None:
        self.source, self._lift = source, source.lift
        self._lock = threading.Condition()  # notified when the whole has been solved
        used = range(int(source.lift.frames[0]), int(source.lift.frames[-1]) + 1)
        self._known = source.prior, used, source.video.size
        self._reader = EntryReader(*self._known)
        self.edits = self._read()
        self._undo: list[Edits] = []
        self._redo: list[Edits] = []
        self._begun = time.time_ns()  # distinguishes versions of different sessions, which count from 0
        self.version = 0  #: of what is shown; the page reloads it when the version increases
        self._asked = 0
        self.fault = ""
        self._refiner = Refiner(source.lift, self._on_refined)
        self._use(source.lift.whole(self.edits))
        self.refining = False

    def close(self) -> None:
        """End the background process."""
        self._refiner.close()

    # ---- what is shown

    def state(self) -> dict[str, Any]:
        """Return everything that the page shows: the object of `gait.web.motion_data`, and corrections."""
        with self._lock:
            source = self.source
            data = page_data(self._solved.shown, self._uv, self._places, source.video, self._lift.camera)
            also = {"title": Path(source.video.path).name, "command": self.command()}
            return data | self._work() | also

    def _work(self) -> dict[str, Any]:
        """Return the corrections and the possible actions."""
        return {
            "begun": self._begun,
            "version": self.version,
            "edits": self.edits.as_json(),
            "file": str(self.source.corrections),
            "undo": len(self._undo),
            "redo": len(self._redo),
            "refining": self.refining,
            "fault": self.fault,
            "without": self._lift.without
            | ({} if self._lift.camera else {"start": f"Track start {NO_CAMERA}"}),
            "start": self._start(),
        }

    def command(self) -> str:
        """Command that makes the same motion from the file."""
        words = [*self._lift.words(), *self.source.model_words, "--corrections"]
        return " ".join([*words, shlex.quote(str(self.source.corrections)), "-o", "motion.csv"])

    # ---- edits

    def edit(self, action: dict[str, Any]) -> dict[str, Any]:
        """Perform an action of the page; return what moved.

        Raises
        ------
        UserError
            If the action is not possible.
        """
        with self._lock:
            return self._change(self._after(action), [*self._undo, self.edits][-MOST_UNDONE:], [])

    def undo(self) -> dict[str, Any]:
        """Undo the last edit."""
        with self._lock:
            if not self._undo:
                raise UserError("there is nothing to undo")
            return self._change(self._undo[-1], self._undo[:-1], [*self._redo, self.edits])

    def redo(self) -> dict[str, Any]:
        """Redo the edit that was undone last."""
        with self._lock:
            if not self._redo:
                raise UserError("there is nothing to redo")
            return self._change(self._redo[-1], [*self._undo, self.edits], self._redo[:-1])

    def place_start(self, action: dict[str, Any]) -> dict[str, Any]:
        """Write an init file for `gait track --init` from a point on the floor and one ahead of it.

        Raises
        ------
        UserError
            If there is no camera, or the points are not on the floor.
        """
        with self._lock:
            camera, shown = self._lift.camera, self._solved.shown
            if camera is None:
                raise UserError("a start is on the floor of a calibrated camera; give --camera")
            asked = Fields("the start", action)
            frame = self._reader.frame(asked, "frame")
            ends = [self._reader.pixel(asked, key) for key in ("from", "to")]
            here, ahead = camera.on_plane(np.array(ends), 0.0)
            way = ahead - here
            if not np.linalg.norm(way) > LEAST_WAY:
                raise UserError("drag over the floor, from below the person in the direction of walking")
            begin: dict[str, Any] = {
                "frame": frame,
                "pelvis": rounded(here[:2]),
                "heading_rad": round(float(np.arctan2(way[1], way[0])), 4),
                "stature_m": shown.figures["stature_m"],
            }
            begin |= phase_at(float(self.source.video.times[frame]), shown.events)
            if not self.source.camera_words:
                self._write_camera()  # gait track needs the camera that was estimated
            with replacing(self._start_file) as temporary:
                temporary.write_text(json.dumps(begin, indent=1) + "\n", encoding="utf-8")
            return {"start": self._start()}

    @property
    def _start_file(self) -> Path:
        return self.source.folder / "init.json"

    def _start(self) -> dict[str, Any] | None:
        """Return the start's position in the picture, and the command that uses it; None if there is none."""
        camera = self._lift.camera
        if camera is None or not self._start_file.exists():
            return None
        begin = json.loads(self._start_file.read_text(encoding="utf-8"))
        here = np.array([*begin["pelvis"][:2], 0.0])
        ahead = here + ARROW * np.array([np.cos(begin["heading_rad"]), np.sin(begin["heading_rad"]), 0.0])
        words = ["gait track", shlex.quote(str(self.source.video.path)), "--init"]
        found = ["--camera", shlex.quote(str(self.source.folder / EXPORT_FILES["camera"]))]
        words += [shlex.quote(str(self._start_file)), *(self.source.camera_words or found), "-o track.csv"]
        ends = rounded(camera.project(np.stack([here, ahead])), 2)
        return {"frame": begin["frame"], "from": ends[0], "to": ends[1], "command": " ".join(words)}

    def _after(self, action: dict[str, Any]) -> Edits:
        """Return the edits after an action, which adds or removes one."""
        kind, edits = action.get("do"), self.edits
        asked = Fields("the correction", {key: value for key, value in action.items() if key != "do"})
        if kind == "pull":
            new = _tidy(self._reader.correction(asked))
            kept = tuple(c for c in edits.corrections if (c.frame, c.joint) != (new.frame, new.joint))
            return replace(edits, corrections=(*kept, new))
        if kind == "pin":
            pin = _tidy(self._reader.pin(asked))
            if (
                self._lift.camera is not None
                and np.isnan(self._lift.camera.on_plane(np.array(pin.uv), 0.0)).any()
            ):
                raise UserError("there is no floor above the horizon; click where the foot stands")
            others = tuple(p for p in edits.floor if (p.frame, p.joint) != (pin.frame, pin.joint))
            return replace(edits, floor=(*others, pin))
        if kind == "hide":
            return replace(edits, hidden=(*edits.hidden, self._reader.hidden(asked)))
        if kind == "swap":
            return replace(edits, swapped=(*edits.swapped, self._reader.swap(asked)))
        if kind == "remove":
            key = str(asked.get("list", "reload the page"))
            listed = getattr(edits, key) if key in edits.as_json() else ()
            index = asked.integer("index", 0, len(listed) - 1, "there is no such correction")
            rest: dict[str, Any] = {key: (*listed[:index], *listed[index + 1 :])}
            return replace(edits, **rest)
        if kind == "clear":
            return Edits()
        raise UserError(f"the page asked for {kind!r}, which is unknown; reload it")

    def _change(self, wanted: Edits, undo: list[Edits], redo: list[Edits]) -> dict[str, Any]:
        """Save other edits, solve what they move, and request the whole; after an error nothing changes."""
        begin = time.perf_counter()
        touched = _touched(self.edits, wanted)
        self._lift.check(wanted)  # raises before anything is saved
        with ThreadPoolExecutor(1) as other:
            saving = other.submit(self._save, wanted)  # writes while the motion is solved
            answer = self._moved(wanted, touched) if touched else {}
        try:
            saving.result()
        except NotSavedError:
            self._use(self._solved)  # discards what moved
            raise
        self.edits, self._undo, self._redo = wanted, undo, redo
        self.version += 1
        self._asked += 1
        self.refining = True
        if not self._refiner.ask(self._asked, wanted):
            self.refining, self.fault = False, ENDED
        seconds = time.perf_counter() - begin
        return self._work() | answer | {"ms": round(1000 * seconds)}

    def _moved(self, wanted: Edits, touched: range) -> dict[str, Any]:
        """Solve near the frames that were touched; return what moved, for the page."""
        try:
            near = self._lift.near(wanted, touched)
        except np.linalg.LinAlgError:
            self.fault = (
                "the motion near this correction cannot be solved; it will follow with the whole clip"
            )
            return {}
        if near is None:
            return {}
        self._places[near.rows], self._uv[near.rows] = near.places, near.uv
        frame = self._solved.shown.frame
        return {
            "rows": (frame[near.rows] - frame[0]).tolist(),
            "points": frames(near.places),
            "uv": frames(near.uv, 2),
        }

    def _on_refined(self, number: int, found: Solved | str) -> None:
        """Show the whole motion, unless there have been more edits since."""
        with self._lock:
            if number not in (self._asked, LAST_ANSWER):
                return
            self.refining, self.fault = False, found if isinstance(found, str) else ""
            if not isinstance(found, str):
                self._use(found)
            self.version += 1
            self._lock.notify_all()

    def _use(self, solved: Solved) -> None:
        """Show a motion and continue from it."""
        self._solved = solved
        self._places, self._uv = solved.shown.places.copy(), solved.shown.uv.copy()
        self._lift.follow(solved)

    # ---- files

    def _read(self) -> Edits:
        path = self.source.corrections
        if not path.exists():
            return Edits()
        edits = read_edits(path, *self._known)
        try:
            self._lift.check(edits)
        except UserError as error:
            raise UserError(f"{path}: {error}") from None
        return edits

    def save(self) -> None:
        """Write the corrections, completely or not at all."""
        self._save(self.edits)

    def _save(self, edits: Edits) -> None:
        try:
            with replacing(self.source.corrections) as temporary:
                temporary.write_text(json.dumps(edits.as_json(), indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            why = f"not saved: {error.strerror}; fix that, then correct again"
            raise NotSavedError(f"{self.source.corrections}: {why}") from error

    def export(self, kind: str) -> Path:
        """Write the whole motion as a command would: in a format of `gait export`, as ``csv`` or ``mp4``.

        ``camera`` writes the camera, estimated or given.  Waits while the whole is being solved.

        Raises
        ------
        UserError
            If the whole is not solved in time, or there is no such file.
        """
        if kind not in EXPORT_FILES:
            raise UserError(f"{kind}: unknown export")
        with self._lock:
            if not self._lock.wait_for(lambda: not self.refining, LONGEST_WAIT):
                raise UserError("the whole motion is still being computed; export it later")
            if self.fault:
                raise UserError(f"the last corrections are not yet in the whole motion: {self.fault}")
            solved, folder = self._solved, self.source.folder
        path = folder / EXPORT_FILES[kind]
        if kind == "camera":
            self._write_camera()
        elif kind == "mp4":
            self._lift.write_overlay(str(path), self.source.video, solved)
        else:
            table = str(folder / EXPORT_FILES["csv"])
            self._lift.write_table(table, solved)
            if kind != "csv":
                _convert(table, path)
            if beside := exports.BESIDE.get(path.suffix):
                return _zipped(path, path.with_suffix(beside))
        return path

    def _write_camera(self) -> None:
        if self._lift.camera is None:
            raise UserError("there is no camera; give --camera, or --height for one from the walk")
        with replacing(self.source.folder / EXPORT_FILES["camera"]) as temporary:
            write_camera(temporary, self._lift.camera)


EXPORT_FILES = {"csv": "motion.csv", "mp4": "overlay.mp4", "camera": "camera.json"} | {
    suffix[1:]: f"motion{suffix}" for suffix in exports.EXPORT_SUFFIXES
}
"""Kinds of exports, and their files in the folder beside the film."""


def _convert(table: str, path: Path) -> None:
    """Convert a motion to the format of another tool."""
    try:
        exports.write(table, str(path))
    except ImportError as error:
        lacking = (error.name or "").partition(".")[0]
        raise UserError(extras.remedy(f"a file {path.suffix}", (), lacking) or str(error)) from None


def _zipped(*paths: Path) -> Path:
    """Write an archive of files, beside the first of them."""
    found = paths[0].with_suffix(f"{paths[0].suffix}.zip")
    with replacing(found) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in paths:
            archive.write(path, path.name)
    return found


def _tidy(point: Point) -> Point:
    """Round a point marked by hand to a sensible precision."""
    u, v = (round(x, 2) for x in point.uv)
    return replace(point, uv=(u, v), sd_px=round(min(max(point.sd_px, LEAST_MARK_SD_PX), MOST_MARK_SD_PX), 2))


def _touched(old: Edits, new: Edits) -> range | None:
    """Return the range from the first to the last frame that an edit changes; None if there are none."""
    changed: list[int] = []
    for key in ("corrections", "hidden", "swapped", "floor"):
        for each in set(getattr(old, key)) ^ set(getattr(new, key)):
            changed += [each.first, each.last] if isinstance(each, Hidden | Swap) else [each.frame]
    return range(min(changed), max(changed) + 1) if changed else None
