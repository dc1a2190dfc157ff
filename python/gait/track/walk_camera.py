"""Estimate the camera of a film from the walk in it, for `gait camera`, `gait track` and `gait lift`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.keypoints_file import Keypoints
from gait.io.lens_tag import equivalent_mm, lens_tag, view_across
from gait.io.video import Video, reporting_damage
from gait.progress import note, progress, warning
from gait.track.from_walk import Calibration, calibrate
from gait.track.walk_start import GIVEN_FOV_SD, usual_camera

_TAG_SD = 0.1  # sd of the log focal length; stabilised films are cropped by about as much


def find_people(video: Video, quiet: bool, first: int = 0, stop: int | None = None) -> dict[int, Keypoints]:
    """Find the keypoints of people in a film with the detector, rounded as in a file of keypoints.

    The order is that of `by_size`.

    Raises
    ------
    UserError
        If the detector's weights are missing, or it finds no person.
    """
    from gait.detect.people import by_size, detect, require_length, require_person  # loads the runtime

    frames = video.span(first, stop)
    require_length(video, frames)
    warn = partial(warning, quiet=quiet)
    with reporting_damage(video, warn), progress("detecting", len(frames), quiet) as update:
        people = detect(video, first=first, stop=stop, update=update)
    require_person(people, video)
    return {id: keypoints_file.as_filed(people[id]) for id in by_size(people)}


def expected_fov(video: Video, fov: float | None, quiet: bool) -> tuple[float | None, float]:
    """Return the field of view known from the user or the file.

    Parameters
    ----------
    video : Video
        Its file may state a focal length.
    fov : float or None
        The user's value, degrees, which takes precedence.
    quiet : bool
        Do not print what the file states.

    Returns
    -------
    fov : float or None
        Horizontal field of view, degrees.
    sd : float
        Standard deviation of the log focal length.
    """
    tag = None if fov is not None else lens_tag(video.path)
    if tag is None:
        return fov, GIVEN_FOV_SD
    mm = equivalent_mm(tag)
    if mm is None:
        warning(f"{video.path}: states a focal length of {tag[:20]!r}, which is not one: ignored", quiet)
        return None, GIVEN_FOV_SD
    fov = view_across(mm, video.size)
    note(
        f"{video.path}: states a focal length of {mm:g} mm (35 mm film), a view of {fov:.0f} deg across: "
        f"used as known to within {100 * _TAG_SD:.0f} % (--fov overrides it)",
        quiet,
    )
    return fov, _TAG_SD


def expected_camera(video: Video, fov: float | None) -> Camera:
    """Return the camera expected without using the walk; parameters are as for `expected_fov`."""
    return usual_camera(video.size, expected_fov(video, fov, quiet=True)[0])


def calibrate_film(
    video: Video,
    people: Mapping[int, Keypoints],
    model: Model,
    height: float,
    fov: float | None,
    quiet: bool,
) -> tuple[int, Calibration]:
    """Estimate the camera of a film from the first person whose walk determines it.

    Parameters
    ----------
    video : Video
    people : mapping of int to Keypoints
        Keypoints by id, in the order in which people are tried.
    model, height
        As for `calibrate`; `height` is that of the person who walks.
    fov, quiet
        As for `expected_fov`.

    Returns
    -------
    id : int
        The person who walks.
    found : Calibration

    Raises
    ------
    UserError
        As in `calibrate`, or if the feet are not in view, for the first person; it names the file.
    """
    from gait.detect.people import require_feet  # as above

    fov, sd = expected_fov(video, fov, quiet)
    faults = []
    for id, keypoints in people.items():
        try:
            require_feet(keypoints, video)
            found = calibrate(keypoints, video.size, model, height, fov=fov, fov_sd=sd, where=str(video.path))
        except UserError as fault:
            faults.append(fault)
        else:
            return id, found
    raise faults[0]


def note_camera(found: Calibration, quiet: bool) -> None:
    """Print the camera that was estimated."""
    for line in found.describe():
        note(line, quiet)
