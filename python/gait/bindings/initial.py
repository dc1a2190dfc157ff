"""The start of a track: the person's first state and its standard deviations."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gait.bindings.model import Model
from gait.bindings.start_fit import Hypothesis
from gait.bindings.state import State, state_range
from gait.errors import UserError
from gait.io.fields import Fields, read_json

# Standard deviations of values for which an init file gives none.
DEFAULT_SD = {"pelvis": 0.05, "heading_rad": 0.1, "phase": 0.05, "stride_hz": 0.05, "stature_m": 0.03}
KEYS = ("frame", *DEFAULT_SD, "sd")
OUTSIDE_PICTURE = "the start is outside the picture; check pelvis and camera"

FILE_SCALARS = {  # key in the file: attribute of State, remedy
    "heading_rad": ("heading", "give the walking direction about z in radians, 0 = along +x"),
    "phase": ("phase", "give the phase of the stride from 0 (right heel strike) to 1"),
    "stride_hz": ("stride_hz", "give strides (two steps) per second, about 0.9"),
    "stature_m": ("stature", "give the person's height in metres"),
}


@dataclass(frozen=True)
class Start:
    """First state of a track.

    Attributes
    ----------
    frame : int
        Frame of the video that it describes.
    mean, sd : State
        Independent normal distributions; a phase or heading whose sd is half a turn or more is uniform.
    apparent_stature : float, optional
        Stature estimated from the images, metres, if it contradicts the one in `mean`.
    in_place : bool
        The person walks in place, as on a treadmill.
    hypotheses : tuple of Hypothesis
        Alternatives that the images decide between, most probable first; empty if the user gave the start.
    source : str
        What the start was found from, in words; empty if the user gave it.
    """

    frame: int
    mean: State
    sd: State
    apparent_stature: float | None = None
    in_place: bool = False
    hypotheses: tuple[Hypothesis, ...] = ()
    source: str = ""

    @staticmethod
    def read(
        path: str | os.PathLike[str], model: Model, *, frame: int | None = None, height: float | None = None
    ) -> Start:
        """Read an init file; missing values come from the model's broad prior.

        Parameters
        ----------
        path : path
            JSON with `KEYS`, each optional.  A pelvis of two numbers gets the model's height above ground.
        model : Model
        frame : int, optional
            First frame; if the file gives one too, it must be the same.
        height : float, optional
            Stature in metres, which takes precedence over the file's.

        Raises
        ------
        UserError
            One line naming file, key and remedy.
        """
        fields, sds = read_start(path, "start", KEYS)
        if "frame" in fields:
            own = frame_number(fields)
            if frame not in (None, own):
                raise fields.fail("frame", f"is {own}, --start is {frame}", "leave one of them out")
            frame = own
        mean, sd = model.prior()
        for key, (name, remedy) in FILE_SCALARS.items():
            if key in fields:
                setattr(mean, name, fields.number(key, *state_range(name), remedy))
                setattr(sd, name, DEFAULT_SD[key])
            if key in sds:
                setattr(sd, name, sds.number(key, 0.0, 10.0, "give a standard deviation, not negative"))
        if height is not None:
            set_height(mean, sd, height)
        _place(fields, sds, model, mean, sd)
        mean.phase %= 1.0
        return Start(frame or 0, mean, sd)


def read_start(path: str | os.PathLike[str], what: str, keys: Sequence[str]) -> tuple[Fields, Fields]:
    """Read a file about a person's position: its fields, of which `keys` are allowed, and those of its "sd".

    Raises
    ------
    UserError
        One line naming file, key and remedy.
    """
    fields = read_json(path, what)
    fields.only(keys)
    sds = fields.table("sd", "give standard deviations by key")
    sds.only(tuple(DEFAULT_SD))
    return fields, sds


def frame_number(fields: Fields) -> int:
    """Read the frame that a start describes."""
    return fields.integer("frame", 0, 1 << 31, "give the frame number, from 0")


def set_height(mean: State, sd: State, height: float) -> None:
    """Set a known stature in metres in a first state; its sd becomes at most that of a measured height."""
    low, high = state_range("stature")
    if not low <= height <= high:
        raise UserError(f"--height: {height:g} m is not a stature; give metres from {low} to {high}")
    mean.stature = height
    sd.stature = min(sd.stature, DEFAULT_SD["stature_m"])


def _place(fields: Fields, sds: Fields, model: Model, mean: State, sd: State) -> None:
    """Set the position of the pelvis; its height is the model's unless the file gives it."""
    remedy = "give x and y (and z if known) of the pelvis in metres"
    known = 2
    if "pelvis" in fields:
        known = 3 if fields.count("pelvis", remedy) == 3 else 2
        mean.pelvis[:known] = fields.array("pelvis", (known,), remedy)
        far = state_range("pelvis")[1]
        if (np.abs(mean.pelvis) > far).any():
            what = f"is more than {far:g} m from the origin"
            raise fields.fail("pelvis", what, "put the world's origin near the scene")
        sd.pelvis[:] = DEFAULT_SD["pelvis"]
    if known == 2:
        mean.pelvis[2] = model.pelvis_height(mean)
    if "pelvis" in sds:
        remedy = "give one number or three, metres"
        values = sds.one_or_three("pelvis", remedy)
        if (values < 0).any():
            raise sds.fail("pelvis", "is negative", remedy)
        sd.pelvis[:] = values
