"""A session of corrections: saved as they are made, undone and redone; what they move is solved at once.

Each edit solves the motion around it (`gait.lift.smooth.interactive`) and asks for the whole in the
background (`refine`); when that comes, it replaces what was shown.
"""

from __future__ import annotations

import json
import shlex
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import BONES, JOINTS
from gait.errors import UserError
from gait.io.files import replacing
from gait.io.track_file import write_lifted
from gait.io.trc import write_trc
from gait.lift import run as lift_run
from gait.lift.keypoints.corrections import (
    FEET,
    Correction,
    Edits,
    FloorPin,
    Hidden,
    Swap,
    corrected,
    pins,
    read_edits,
)
from gait.lift.run import Lifted
from gait.lift.segment.view import Perspective
from gait.lift.smooth.interactive import Interactive
from gait.reproducible import one_thread
from gait.studio import curves
from gait.studio.refine import ENDED, LAST, Refiner
from gait.studio.source import Source, picture_sd
from gait.web.motion_data import frames, motion_data, rounded

Floats = npt.NDArray[np.float64]

MOST_UNDONE = 500  # edits that can be undone
LEAST_WAY = 0.05  # metres over the floor that show a direction
ARROW = 0.7  # metres, of the arrow that shows it
LEAST_SD, MOST_SD = 0.3, 50.0  # pixels, of a point given by hand


class Session:
    """Film, motion and corrections of one page.

    Parameters
    ----------
    source : Source
    model : str or None
        File of the model.
    """

    def __init__(self, source: Source, model: str | None) -> None:
        self.source, self._model = source, model
        self._lock = threading.RLock()
        self.edits = self._read()
        self._undo: list[Edits] = []
        self._redo: list[Edits] = []
        self.version = 0  #: of what is shown; the page asks again when it grows
        self._asked = 0
        self.fault = ""
        prior, prepared, request = source.prior, source.prepared, source.request
        self._use(lift_run.lift_prepared(source.keypoints, prepared, self.edits, prior, request, False))
        self._refiner = Refiner(model, prepared, request, source.keypoints, self._on_refined)
        self.refining = False

    def close(self) -> None:
        """End the process in the background."""
        self._refiner.close()

    # ---- what is shown

    def state(self) -> dict[str, Any]:
        """Everything the page shows: the object of `gait.web.motion_data`, and the corrections."""
        with self._lock:
            motion, keypoints, video = self._lifted.motion, self._lifted.keypoints, self.source.video
            first, names = int(keypoints.frame[0]), self._names
            number = np.arange(first, int(keypoints.frame[-1]) + 1)
            times = video.times[number]

            def placed(values: Floats) -> Floats:
                return _by_frame(values, keypoints.frame, number)

            places, sd = self._places[:, self._shown], motion.sd[:, self._shown]
            events = curves.events_of(keypoints.frame, keypoints.time, names, places)
            plots = curves.angle_curves(names, places, motion.rooted_sd[:, self._shown])
            plots += curves.phase_curve(keypoints.time, events)
            for plot in plots:
                for key in ("values", "low", "high"):
                    if plot[key] is not None:
                        values = np.array([np.nan if v is None else v for v in plot[key]])
                        plot[key] = rounded(placed(values), 3)
            view = self._lifted.view
            px = curves.off_px(self._lifted, self._names, self._picture_sd())
            data = motion_data(
                video.fps,
                times,
                names,
                [(names.index(a), names.index(b)) for a, b in BONES if {a, b} <= set(names)],
                placed(places),
                placed(sd),
                first=first,
                offset=first,
                uv=[self._pixels(one) for one in placed(self._uv[:, self._shown])],
                uv_sd=frames(placed(self._picture_sd()[:, self._shown]), 2),
                size=list(video.size),
                camera=rounded(view.camera.centre, 3) if isinstance(view, Perspective) else None,
                status=None,
                curves=plots,
                events=curves.event_marks(events),
                strip=rounded(placed(np.nan_to_num(px).mean(axis=1) / max(self._tall(), 1.0)), 4),
            )
            asked = curves.proposals(keypoints.frame, keypoints.time, names, px, self.edits)
            return (
                data
                | self._work()
                | {
                    "title": Path(video.path).name,
                    "tall": self._tall(),
                    "proposals": [{"frame": p.frame, "joint": p.joint, "px": round(p.px, 1)} for p in asked],
                    "command": self.command(),
                    "warnings": lift_run.warnings_of(self._lifted, self.source.prior.stature),
                    "figures": {
                        "px": round(float(np.nanmedian(motion.error)), 2),
                        "sd_mm": round(1000 * float(np.median(sd)), 1),
                        "stature_m": round(float(motion.stature), 3),
                    },
                }
            )

    def _work(self) -> dict[str, Any]:
        """Corrections and what can be done with them."""
        return {
            "version": self.version,
            "edits": self.edits.as_json(),
            "file": str(self.source.corrections),
            "undo": len(self._undo),
            "redo": len(self._redo),
            "refining": self.refining,
            "fault": self.fault,
            "floor": isinstance(self._lifted.view, Perspective),
            "start": self._start(),
        }

    def command(self) -> str:
        """Command that gives the same motion from the file."""
        request, source = self.source.request, self.source
        words = ["gait lift", _quoted(source.keypoints if request.calibration is None else source.video.path)]
        words += ["--camera", _quoted(request.camera)] if request.camera else []
        words += ["--height", f"{request.options.stature:g}"] if request.options.stature else []
        words += ["--model", _quoted(self._model)] if self._model else []
        return " ".join([*words, "--corrections", _quoted(source.corrections), "-o", "motion.csv"])

    # ---- edits

    def edit(self, action: dict[str, Any]) -> dict[str, Any]:
        """Do what the page asks for; give what moved.

        Raises
        ------
        UserError
            If it asks for what cannot be.
        """
        with self._lock:
            return self._change(self._after(action), [*self._undo, self.edits][-MOST_UNDONE:], [])

    def undo(self) -> dict[str, Any]:
        """Take the last edit back."""
        with self._lock:
            if not self._undo:
                raise UserError("there is nothing to undo")
            return self._change(self._undo[-1], self._undo[:-1], [*self._redo, self.edits])

    def redo(self) -> dict[str, Any]:
        """Do again what was taken back last."""
        with self._lock:
            if not self._redo:
                raise UserError("there is nothing to redo")
            return self._change(self._redo[-1], [*self._undo, self.edits], self._redo[:-1])

    def place_start(self, action: dict[str, Any]) -> dict[str, Any]:
        """Write where `gait track --init` may start: a point of the floor, and one ahead of it.

        Raises
        ------
        UserError
            If there is no camera, or the points are none of the floor.
        """
        with self._lock:
            view = self._lifted.view
            if not isinstance(view, Perspective):
                raise UserError("a start is a place on the floor of a calibrated camera; give --camera")
            frame, ends = self._frame(action), [self._pixel(action, key) for key in ("from", "to")]
            here, ahead = view.camera.on_plane(np.array(ends), 0.0)
            way = ahead - here
            if not np.linalg.norm(way) > LEAST_WAY:
                raise UserError("drag over the floor, from under the person to where they walk")
            begin: dict[str, Any] = {
                "frame": frame,
                "pelvis": rounded(here[:2]),
                "heading_rad": round(float(np.arctan2(way[1], way[0])), 4),
                "stature_m": round(float(self._lifted.motion.stature), 3),
            }
            keypoints, places = self._lifted.keypoints, self._places[:, self._shown]
            events = curves.events_of(keypoints.frame, keypoints.time, self._names, places)
            begin |= curves.phase_at(float(self.source.video.times[frame]), events)
            with replacing(self._start_file) as temporary:
                temporary.write_text(json.dumps(begin, indent=1) + "\n", encoding="utf-8")
            return {"start": self._start()}

    @property
    def _start_file(self) -> Path:
        return self.source.folder / "init.json"

    def _start(self) -> dict[str, Any] | None:
        """Where the start is in the picture, and the command that takes it; None without one."""
        view = self._lifted.view
        if not self._start_file.exists() or not isinstance(view, Perspective):
            return None
        begin = json.loads(self._start_file.read_text(encoding="utf-8"))
        here = np.array([*begin["pelvis"][:2], 0.0])
        ahead = here + ARROW * np.array([np.cos(begin["heading_rad"]), np.sin(begin["heading_rad"]), 0.0])
        words = ["gait track", _quoted(self.source.video.path), "--init", _quoted(self._start_file)]
        request = self.source.request
        words += ["--camera", _quoted(request.camera)] if request.camera else []
        words += ["--height", f"{request.options.stature:g}"] if request.options.stature else []
        words += ["-o track.csv"]
        ends = rounded(view.camera.project(np.stack([here, ahead])), 2)
        return {"frame": begin["frame"], "from": ends[0], "to": ends[1], "command": " ".join(words)}

    def _after(self, action: dict[str, Any]) -> Edits:
        """Edits with one more, or one less."""
        kind, edits = action.get("do"), self.edits
        if kind == "pull":
            new = Correction(self._frame(action), self._joint(action), self._pixel(action), self._sd(action))
            kept = tuple(c for c in edits.corrections if (c.frame, c.joint) != (new.frame, new.joint))
            return replace(edits, corrections=(*kept, new))
        if kind == "pin":
            pin = FloorPin(self._frame(action), self._joint(action), self._pixel(action), self._sd(action))
            if not pin.joint.endswith(FEET):
                raise UserError(f"{pin.joint}: only a toe, heel or ankle stands on the floor")
            others = tuple(p for p in edits.floor if (p.frame, p.joint) != (pin.frame, pin.joint))
            return replace(edits, floor=(*others, pin))
        if kind == "hide":
            return replace(edits, hidden=(*edits.hidden, Hidden(*self._range(action), self._joint(action))))
        if kind == "swap":
            return replace(edits, swapped=(*edits.swapped, Swap(*self._range(action))))
        if kind == "remove":
            key, index = str(action.get("list")), action.get("index")
            listed = getattr(edits, key, None) if key in edits.as_json() else None
            if listed is None or not isinstance(index, int) or not 0 <= index < len(listed):
                raise UserError("there is no such correction")
            rest: dict[str, Any] = {key: (*listed[:index], *listed[index + 1 :])}
            return replace(edits, **rest)
        if kind == "clear":
            return Edits()
        raise UserError(f"the page asked for {kind!r}, which is unknown; reload it")

    def _frame(self, action: dict[str, Any], key: str = "frame") -> int:
        frame, known = action.get(key), self.source.prepared.keypoints.frame
        if not isinstance(frame, int) or frame not in known:
            raise UserError(f"frame {frame}: has no keypoints; choose another")
        return frame

    def _range(self, action: dict[str, Any]) -> tuple[int, int]:
        first, last = sorted((self._frame(action, "first"), self._frame(action, "last")))
        return first, last

    def _joint(self, action: dict[str, Any]) -> str:
        joint = action.get("joint")
        if joint not in self._names:
            raise UserError(f"{joint}: no such joint")
        return str(joint)

    def _pixel(self, action: dict[str, Any], key: str = "uv") -> tuple[float, float]:
        found = action.get(key)
        size = self.source.video.size
        if (
            not isinstance(found, list)
            or len(found) != 2
            or not all(isinstance(x, int | float) for x in found)
        ):
            raise UserError("the place in the picture is missing")
        if any(not -n <= x <= 2 * n for x, n in zip(found, size, strict=True)):
            raise UserError("the place is far outside of the picture")
        return round(float(found[0]), 2), round(float(found[1]), 2)

    def _sd(self, action: dict[str, Any]) -> float:
        sd = action.get("sd_px")
        return round(min(max(float(sd), LEAST_SD), MOST_SD), 2) if isinstance(sd, int | float) else 1.0

    def _change(self, wanted: Edits, undo: list[Edits], redo: list[Edits]) -> dict[str, Any]:
        """Save other edits, solve what they move, and ask for the whole; a refused edit changes nothing."""
        begin = time.perf_counter()
        touched = _touched(self.edits, wanted)
        keypoints, pinned = self._applied(wanted)  # refused before anything is saved
        self._save(wanted)
        self.edits, self._undo, self._redo = wanted, undo, redo
        answer: dict[str, Any] = {}
        if (
            touched
            and self._interactive is not None
            and set(keypoints.names) <= set(self._lifted.motion.names)
        ):
            try:
                with one_thread():
                    near = self._interactive.solve(keypoints, pinned, touched)
            except np.linalg.LinAlgError:
                self.fault = "the motion cannot be solved near this correction; it waits for the whole"
            else:
                self._places[near.rows], self._uv[near.rows] = near.places, near.uv
                frame = self._lifted.keypoints.frame[near.rows] - self._lifted.keypoints.frame[0]
                answer = {
                    "rows": frame.tolist(),
                    "points": frames(near.places[:, self._shown]),
                    "uv": [self._pixels(one) for one in near.uv[:, self._shown]],
                }
        self.version += 1
        self._asked += 1
        self.refining = True
        if not self._refiner.ask(self._asked, wanted):
            self.refining, self.fault = False, ENDED
        seconds = time.perf_counter() - begin
        return self._work() | answer | {"ms": round(1000 * seconds)}

    def _on_refined(self, number: int, found: Lifted | str) -> None:
        """Take the whole motion, unless there were more edits since."""
        with self._lock:
            if number not in (self._asked, LAST):
                return
            self.refining, self.fault = False, found if isinstance(found, str) else ""
            if not isinstance(found, str):
                self._use(found)
            self.version += 1

    def _applied(self, edits: Edits) -> tuple[Any, Any]:
        prepared = self.source.prepared
        keypoints = corrected(prepared.keypoints, edits, prepared.options.pixel_sd)
        camera = prepared.view.camera if isinstance(prepared.view, Perspective) else None
        return keypoints, pins(keypoints, edits, camera, self.source.prior)

    def _use(self, lifted: Lifted) -> None:
        """Show a motion and go on from it."""
        motion = lifted.motion
        assert motion.uv is not None
        self._lifted, self._places, self._uv = lifted, motion.places.copy(), motion.uv.copy()
        self._names = tuple(name for name in motion.names if name in JOINTS)
        self._shown = [motion.names.index(name) for name in self._names]
        self._interactive = None
        if motion.state is not None:
            known = self.source.prior, lifted.view, lifted.options, lifted.keypoints.names
            self._interactive = Interactive(*known, motion)

    # ---- how far joints may be off

    def _picture_sd(self) -> Floats:
        """Give standard deviations (T, J) in the picture, pixels."""
        motion, view = self._lifted.motion, self._lifted.view
        if isinstance(view, Perspective):
            # An uncertain camera moves the places in the world, and hardly where they are in its picture.
            sd = motion.sd if self.source.request.calibration is None else motion.rooted_sd
            return picture_sd(view.camera.project, motion.places, sd)
        return np.asarray(motion.sd.mean(axis=2) * self._tall() / max(motion.stature, 0.1))

    def _tall(self) -> float:
        """Median height of the person in the picture, pixels."""
        v = self._uv[:, self._shown, 1]
        return float(np.median(v.max(axis=1) - v.min(axis=1)))

    def _pixels(self, uv: Floats) -> list[Any] | None:
        return rounded(uv, 2) if np.isfinite(uv).all() else None

    # ---- files

    def _read(self) -> Edits:
        path, keypoints = self.source.corrections, self.source.prepared.keypoints
        if not path.exists():
            return Edits()
        whole = range(int(keypoints.frame[0]), int(keypoints.frame[-1]) + 1)
        return read_edits(path, self.source.prior, whole, self.source.video.size)

    def save(self) -> None:
        """Write the corrections; they appear whole or not at all."""
        self._save(self.edits)

    def _save(self, edits: Edits) -> None:
        try:
            with replacing(self.source.corrections) as temporary:
                temporary.write_text(json.dumps(edits.as_json(), indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise UserError(f"{self.source.corrections}: not saved: {error.strerror}") from error

    def export(self, kind: str) -> Path:
        """Write the whole motion of the corrections as a batch command does; `csv` or `trc`.

        Raises
        ------
        UserError
            If the whole is not solved yet, or there is no such file.
        """
        if kind not in ("csv", "trc"):
            raise UserError(f"{kind}: no such export")
        with self._lock:
            if self.refining:
                raise UserError("the whole motion is still being solved; wait a moment")
            if self.fault:
                raise UserError(f"the last corrections are not in the whole motion: {self.fault}")
            keypoints, motion = self._lifted.keypoints, self._lifted.motion
            path = self.source.folder / f"motion.{kind}"
            if kind == "csv":
                write_lifted(path, keypoints.frame, keypoints.time, motion.names, motion.places, motion.sd)
            else:
                rate = (len(keypoints.time) - 1) / float(keypoints.time[-1] - keypoints.time[0])
                write_trc(path, motion.names, keypoints.time, motion.places, rate)
            return path


def _touched(old: Edits, new: Edits) -> range | None:
    """Frames between the first and the last that an edit changes; None if there are none."""
    changed: list[int] = []
    for key in ("corrections", "hidden", "swapped", "floor"):
        for each in set(getattr(old, key)) ^ set(getattr(new, key)):
            changed += [each.first, each.last] if isinstance(each, Hidden | Swap) else [each.frame]
    return range(min(changed), max(changed) + 1) if changed else None


def _by_frame(values: Floats, frame: npt.NDArray[np.int64], number: npt.NDArray[np.int64]) -> Floats:
    """Values (T, ...) of some frames at all of `number`; NaN where there is no such frame."""
    found = np.full((len(number), *values.shape[1:]), np.nan)
    found[frame - number[0]] = values
    return found


def _quoted(path: str | Path) -> str:
    return shlex.quote(str(path))
