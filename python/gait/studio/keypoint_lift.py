"""Lift the film from 2-D keypoints with corrections, as `gait lift KEYPOINTS --corrections` does."""

from __future__ import annotations

import shlex
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.bindings.segment_prior import SegmentPrior
from gait.body.skeleton import JOINTS
from gait.io.keypoints_file import Keypoints
from gait.io.track_file import write_lifted
from gait.io.video import Video
from gait.lift import picture
from gait.lift import run as lift_run
from gait.lift.keypoints.corrections import Edits, corrected, pins
from gait.lift.run import Lifted, Prepared, Request
from gait.lift.segment.view import Perspective
from gait.lift.smooth.interactive import Interactive
from gait.reproducible import one_thread
from gait.studio.shown import NO_CAMERA, Nearby, Shown, Solved, curves_of

Floats = npt.NDArray[np.float64]

SUGGESTED = 8  # most corrections that are suggested


class KeypointLift:
    """See `gait.studio.shown.Lift`.

    Parameters
    ----------
    path : str
        File of the keypoints.
    prior : SegmentPrior
    prepared : Prepared
        Keypoints without the detector's swaps and spikes.
    request : Request
        How to lift them.
    video : str
        The film.
    more : list of str
        Further arguments of the command that lifts the film itself.
    """

    def __init__(
        self,
        path: str,
        prior: SegmentPrior,
        prepared: Prepared,
        request: Request,
        video: str,
        more: list[str],
    ) -> None:
        self._path, self._prior, self._request, self._video = path, prior, request, video
        self._more = more
        self._prepared = replace(prepared, options=replace(prepared.options, covariance=True))
        self.camera = prepared.view.camera if isinstance(prepared.view, Perspective) else None
        self.without = {} if self.camera else {"pin": f"Pin foot {NO_CAMERA}"}
        self._near: Interactive | None = None
        self._corrected = Edits(), self._prepared.keypoints
        self._names: tuple[str, ...] = ()

    @property
    def frames(self) -> npt.NDArray[np.int64]:
        """Numbers of the frames with keypoints."""
        return self._prepared.keypoints.frame

    def check(self, edits: Edits) -> None:
        """Raise UserError for corrections of frames or positions that do not exist."""
        pins(self._points(edits), edits, self.camera, self._prior)

    def _points(self, edits: Edits) -> Keypoints:
        """Apply and check corrections of the keypoints."""
        if self._corrected[0] is not edits:
            sd = self._prepared.options.pixel_sd
            self._corrected = edits, corrected(self._prepared.keypoints, edits, sd)
        return self._corrected[1]

    def whole(self, edits: Edits) -> Solved:
        """Lift the keypoints with corrections."""
        lifted = lift_run.lift_prepared(self._path, self._prepared, edits, self._prior, self._request, True)
        motion, keypoints = lifted.motion, lifted.keypoints
        assert motion.uv is not None
        columns = _columns(motion.names)
        rows = (3 * columns[:, None] + np.arange(3)).ravel()
        names = tuple(motion.names[j] for j in columns)
        places, uv_sd = motion.places[:, columns], picture.picture_sd(lifted)[:, columns]
        covariance = picture.covariances(lifted)[:, rows[:, None], rows]
        curves, events = curves_of(keypoints.frame, keypoints.time, names, places, covariance)
        shown = Shown(
            frame=keypoints.frame,
            time=keypoints.time,
            names=names,
            places=places,
            sd=motion.sd[:, columns],
            uv=motion.uv[:, columns],
            uv_sd=uv_sd,
            off=np.hypot(uv_sd, picture.missed(lifted)[:, columns]),
            curves=curves,
            events=events,
            suggestions=picture.suggestions(lifted, SUGGESTED),
            warnings=lift_run.warnings_of(lifted, self._prior.stature),
            figures={
                "px": round(float(np.nanmedian(motion.error)), 2),
                "sd_mm": round(1000 * float(np.median(motion.sd[:, columns])), 1),
                "stature_m": round(float(motion.stature), 3),
            },
        )
        return Solved(shown, replace(lifted, motion=replace(motion, covariance=None)))  # it is large

    def follow(self, solved: Solved) -> None:
        """Continue from a motion."""
        lifted: Lifted = solved.lifted
        self._names, self._near = lifted.motion.names, None
        if lifted.motion.state is not None:
            known = self._prior, lifted.view.alone(), lifted.options, lifted.keypoints.names
            with one_thread():
                self._near = Interactive(*known, lifted.motion)

    def near(self, edits: Edits, touched: range) -> Nearby | None:
        """Solve the blocks around the frames that were touched."""
        keypoints = self._points(edits)
        if self._near is None or not set(keypoints.names) <= set(self._names):
            return None
        pinned = pins(keypoints, edits, self.camera, self._prior)
        with one_thread():
            found = self._near.solve(keypoints, pinned, touched)
        columns = _columns(self._names)
        return Nearby(found.rows, found.places[:, columns], found.uv[:, columns])

    def words(self) -> list[str]:
        """Arguments of ``gait lift``."""
        request = self._request
        if request.calibration is None:
            found = ["gait lift", shlex.quote(self._path)]
        else:
            found = ["gait lift", shlex.quote(self._video), *self._more]
        found += ["--camera", shlex.quote(request.camera)] if request.camera else []
        found += ["--scale-camera", "--video", shlex.quote(self._video)] if request.size else []
        return found + (["--height", f"{request.options.stature:g}"] if request.options.stature else [])

    def write_table(self, path: str, solved: Solved) -> None:
        """Write all estimated markers."""
        motion, points = solved.lifted.motion, solved.lifted.keypoints
        write_lifted(path, points.frame, points.time, motion.names, motion.places, motion.sd)

    def write_overlay(self, path: str, video: Video, solved: Solved) -> None:
        """Draw the cylinder figure."""
        picture.draw_overlay(path, video, solved.lifted, True)


def _columns(names: tuple[str, ...]) -> npt.NDArray[np.intp]:
    """Find the columns of markers that are joints."""
    return np.array([j for j, name in enumerate(names) if name in JOINTS], np.intp)
