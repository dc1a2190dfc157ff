"""Lift the film from its images with corrections, as `gait lift VIDEO --placement --corrections` does."""

from __future__ import annotations

import shlex
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.track_file import write_lifted
from gait.io.video import Video
from gait.lift.keypoints.corrections import Edits
from gait.lift.video import run as video_run
from gait.lift.video.clip_segments import ClipSegments
from gait.lift.video.figure import Figure
from gait.lift.video.fit_clip import (
    POOR_CORRELATION,
    ClipFit,
    fit_clip,
    joint_covariances,
    linearised,
    picture_sd,
    suggestions,
)
from gait.lift.video.interactive import Interactive
from gait.lift.video.run import LiftedVideo, Request
from gait.lift.video.sensors import CameraView
from gait.reproducible import one_thread
from gait.studio.keypoint_lift import SUGGESTED
from gait.studio.shown import Nearby, Shown, Solved, curves_of

Floats = npt.NDArray[np.float64]


class PictureLift:
    """See `gait.studio.shown.Lift`.

    Parameters
    ----------
    clip : ClipSegments
        The clip without corrections.
    request : Request
        How to lift the images.
    more : list of str
        Further arguments of the command.
    """

    without = {
        "hide": "There are no detected joints to hide when images are lifted; drag the joint",
        "swap": "There are no detected joints to swap when images are lifted; drag the legs",
        "pin": "Feet can only be pinned when keypoints are lifted; drag the foot to the floor instead",
    }

    def __init__(self, clip: ClipSegments, request: Request, more: list[str]) -> None:
        self._clip, self._request, self._more = clip, request, more
        self.camera: Camera | None = clip.view.camera if isinstance(clip.view, CameraView) else None
        self._joints = clip.prior.index([name for name in JOINTS if name in clip.prior.names])
        self._names = tuple(clip.prior.names[j] for j in self._joints)
        self._near: Interactive | None = None

    @property
    def frames(self) -> npt.NDArray[np.int64]:
        """Numbers of the frames that are lifted."""
        return self._clip.film.first + np.arange(len(self._clip.film.times))

    def check(self, edits: Edits) -> None:
        """Raise UserError for edits that are only possible with keypoints."""
        if edits.hidden or edits.swapped or edits.floor:
            raise UserError(
                "only corrections of joints are possible when images are lifted; remove the others"
            )

    def whole(self, edits: Edits) -> Solved:
        """Fit the clip with corrections."""
        clip = replace(self._clip, corrections=edits.corrections)
        with one_thread():
            fit = fit_clip(clip)
            at = linearised(clip, fit.sequence)
        whole = video_run.widened(self._request, fit)
        places = fit.places[:, self._joints]
        curves, events = curves_of(
            fit.frame, fit.time, self._names, places, joint_covariances(clip, fit, self._joints)
        )
        sd = picture_sd(clip, fit, self._joints)
        poor = fit.fit_correlation < POOR_CORRELATION
        shown = Shown(
            frame=fit.frame,
            time=fit.time,
            names=self._names,
            places=places,
            sd=whole.sd[:, self._joints],
            uv=clip.view.project(places)[0],
            uv_sd=sd,
            off=sd,
            curves=curves,
            events=events,
            suggestions=suggestions(clip, fit)[:SUGGESTED],
            warnings=[video_run.poor_correlation(self._request, fit.fit_correlation)] if poor else [],
            figures={
                "px": None,
                "sd_mm": round(1000 * float(np.median(whole.sd[:, self._joints])), 1),
                "stature_m": round(float(clip.placement.stature), 3),
            },
        )
        return Solved(shown, (edits, whole, at))

    def follow(self, solved: Solved) -> None:
        """Continue from an estimate."""
        edits, fit, at = solved.lifted
        self._near = Interactive(replace(self._clip, corrections=edits.corrections), fit, at)

    def near(self, edits: Edits, touched: range) -> Nearby | None:
        """Take one step of the whole clip."""
        if self._near is None:
            return None
        with one_thread():
            places = self._near.solve(edits.corrections)[:, self._joints]
        return Nearby(np.arange(len(places)), places, self._clip.view.project(places)[0])

    def words(self) -> list[str]:
        """Arguments of ``gait lift``."""
        request = self._request
        found = ["gait lift", shlex.quote(request.video), "--placement", shlex.quote(request.placement)]
        found += ["--camera", shlex.quote(request.camera)] if request.camera else []
        found += ["--scale-camera"] if request.scale_camera else []
        found += ["--height", f"{request.height:g}"] if request.height else []
        found += self._more
        found += ["--background", shlex.quote(request.background)] if request.background != "auto" else []
        return found

    def write_table(self, path: str, solved: Solved) -> None:
        """Write the joints, in the order of the prior."""
        fit: ClipFit = solved.lifted[1]
        own = [j for j, name in enumerate(self._clip.prior.names) if name in JOINTS]
        names = [self._clip.prior.names[j] for j in own]
        write_lifted(path, fit.frame, fit.time, names, fit.places[:, own], fit.sd[:, own])

    def write_overlay(self, path: str, video: Video, solved: Solved) -> None:
        """Draw the cylinder figure."""
        edits, fit, _ = solved.lifted
        clip = replace(self._clip, corrections=edits.corrections)
        figure = Figure.fit(fit.places, clip.prior.names)
        video_run.draw_overlay(path, LiftedVideo(video, clip, fit, fit, figure), True)
