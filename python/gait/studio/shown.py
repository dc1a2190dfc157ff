"""The data of a motion that the page shows, their JSON object, and the interface of ways to lift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from gait.body.skeleton import BONES
from gait.camera.camera import Camera
from gait.io.video import Video
from gait.lift.keypoints.corrections import Edits
from gait.lift.keypoints.suggestions import Suggestion
from gait.motion.footfalls import Events
from gait.studio import curves
from gait.web.motion_data import frames, motion_data, rounded

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Shown:
    """A motion of T frames and J joints.

    Attributes
    ----------
    frame : (T,)
        Frame numbers in the film.
    time : (T,)
        Seconds.
    names : tuple of str
    places, sd : (T, J, 3)
        Positions of the joints, and their standard deviations, metres.
    uv : (T, J, 2)
        The joints in the picture, pixels.
    uv_sd : (T, J)
        Standard deviations along an axis of the picture, pixels.
    off : (T, J)
        How far joints may be from where they are drawn, pixels: uncertainty, and distance from the detection.
    curves : list
        Curves, made by `gait.web.motion_data.curve`.
    events : Events or None
        Heel strikes; None if the person does not walk.
    suggestions : list of Suggestion
    warnings : list of str
    figures : dict
        ``px``, reprojection error (None if images are lifted); ``sd_mm``; ``stature_m``.
    """

    frame: Ints
    time: Floats
    names: tuple[str, ...]
    places: Floats
    sd: Floats
    uv: Floats
    uv_sd: Floats
    off: Floats
    curves: list[dict[str, Any]]
    events: Events | None
    suggestions: list[Suggestion]
    warnings: list[str]
    figures: dict[str, float | None]

    @property
    def tall(self) -> float:
        """Median height of the person in the picture, pixels."""
        v = self.uv[..., 1]
        return float(np.median(v.max(axis=1) - v.min(axis=1)))


NO_CAMERA = (
    "needs a camera: start gait studio with --camera, or with --height, which estimates it from the walk"
)


@dataclass(frozen=True)
class Solved:
    """A motion with all corrections: what is shown of it, and what `Lift` needs to continue from it."""

    shown: Shown
    lifted: Any


@dataclass(frozen=True)
class Nearby:
    """What a correction moved: rows (n,) of the frames, positions (n, J, 3) and pixels (n, J, 2)."""

    rows: npt.NDArray[np.intp]
    places: Floats
    uv: Floats


class Lift(Protocol):
    """A way to lift the film with corrections; it is copied to another process."""

    without: dict[str, str]  #: kinds of corrections (pin, hide, swap) that it does not support, and why
    camera: Camera | None  #: in whose world the motion is

    @property
    def frames(self) -> Ints:
        """Numbers of the frames that can be corrected."""
        ...

    def check(self, edits: Edits) -> None:
        """Raise UserError for impossible corrections."""
        ...

    def whole(self, edits: Edits) -> Solved:
        """Solve the whole motion, as the command does."""
        ...

    def follow(self, solved: Solved) -> None:
        """Continue from a motion."""
        ...

    def near(self, edits: Edits, touched: range) -> Nearby | None:
        """Solve again near the frames touched; None if that is impossible, LinAlgError if it fails."""
        ...

    def words(self) -> list[str]:
        """Arguments of the command, without corrections and output."""
        ...

    def write_table(self, path: str, solved: Solved) -> None:
        """Write the motion, as the command does."""
        ...

    def write_overlay(self, path: str, video: Video, solved: Solved) -> None:
        """Write the film with the figure, as the command does."""
        ...


def page_data(
    shown: Shown, uv: Floats, places: Floats, video: Video, camera: Camera | None
) -> dict[str, Any]:
    """Make the object of `gait.web.motion_data`, for the film's frames from the motion's first to its last.

    Parameters
    ----------
    shown : Shown
    uv, places : (T, J, 2), (T, J, 3)
        Present positions of the joints, which a correction may have moved.
    """
    first, names = int(shown.frame[0]), shown.names
    number = np.arange(first, int(shown.frame[-1]) + 1)
    row = shown.frame - first

    def placed(values: Floats) -> Floats:
        found = np.full((len(number), *values.shape[1:]), np.nan)
        found[row] = values
        return found

    plots = []
    for plot in shown.curves:
        of_all = {key: plot[key] for key in ("values", "low", "high") if plot[key] is not None}
        plots.append(plot | {key: rounded(placed(np.array(each, float)), 3) for key, each in of_all.items()})
    data = motion_data(
        video.fps,
        video.times[number],
        names,
        [(names.index(a), names.index(b)) for a, b in BONES if {a, b} <= set(names)],
        placed(places),
        placed(shown.sd),
        first=first,
        offset=first,
        uv=frames(placed(uv), 2),
        uv_sd=frames(placed(shown.uv_sd), 2),
        size=list(video.size),
        camera=None if camera is None else rounded(camera.centre, 3),
        status=None,
        curves=plots,
        events=curves.event_marks(shown.events),
        strip=rounded(placed(np.nan_to_num(shown.off).mean(axis=1) / max(shown.tall, 1.0)), 4),
    )
    asked = [{"frame": s.frame, "joint": s.joint, "px": round(s.sd_px, 1)} for s in shown.suggestions]
    return data | {
        "tall": shown.tall,
        "proposals": asked,
        "warnings": shown.warnings,
        "figures": shown.figures,
    }


def curves_of(
    frame: Ints, time: Floats, names: Sequence[str], places: Floats, covariance: Floats
) -> tuple[list[dict[str, Any]], Events | None]:
    """Make the curves of angles and phase; also return the heel strikes that determine the phase.

    Parameters
    ----------
    places : (T, J, 3)
        Positions of the joints, metres.
    covariance : (T, 3 J, 3 J)
        Covariance of the coordinates of each frame's joints, square metres.
    """
    events = curves.events_of(frame, time, names, places)
    found = curves.angles_of(names, places, covariance)
    return [*curves.angle_curves(found), *curves.phase_curve(time, events, found)], events
