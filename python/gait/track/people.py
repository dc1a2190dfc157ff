"""Track several people in a clip, each with a separate tracker.

The detector identifies people, even when they cross.  Each person is tracked as if alone, except that the
others' keypoints are left out, that the silhouette is not compared where others are nearer
(`gait.track.other_people`), and that the track starts in the best second, as others may hide the person.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings.abi import TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.detect.people import by_size
from gait.errors import UserError
from gait.io.files import replacing
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame
from gait.progress import note, progress
from gait.report.colours import PERSON_COLOURS
from gait.report.drawing import Overlay
from gait.report.film import Films, PageFilm
from gait.report.people_page import Person, people_page
from gait.track.clip import track_all_motions, track_scene
from gait.track.clip_background import require_scene
from gait.track.clip_output import Check
from gait.track.first_state import start_in_keypoints
from gait.track.options import ClipOptions
from gait.track.other_people import Outline, with_track
from gait.track.read_scene import read_scene
from gait.track.scene import Scene

Array = NDArray[np.float64]

MOST_PEOPLE = 8
"""Most people tracked in one clip."""

_NO_WALK = "no second in which they walk in full view"

Estimates = dict[int, Estimate]


def track_people(options: ClipOptions) -> dict[str, Any]:
    """Track everyone who walks, at most `options.people`; return the figures of ``gait track --json``.

    People are numbered from 1.  Files are written for each, with the number in their names; the overlay shows
    all.

    Raises
    ------
    UserError
        If a file cannot be read, or no one walks.
    """
    assert options.people is not None
    scene = read_scene(options)
    require_scene(options, scene, scene.frames.start)
    starts, others = _starts(options, scene)
    scene, starts = _numbered_scene(scene, starts, list(others))
    found: dict[int, Estimates] = {}
    outlines = dict(scene.people)
    people: dict[str, Any] = {}
    models: dict[int, Model] = {}
    for id, start in starts.items():
        note(f"person {id}", options.quiet)
        own = _scene_of(scene, id, list(starts), outlines)
        first = id == next(iter(starts))
        options_of = _options_of(options, scene, id, first)
        people[str(id)], found[id], models[id] = _track(options_of, own, start)
        outlines[id] = with_track(scene.people[id], _joints(scene, found[id]), np.asarray(scene.video.times))
    files = {}
    if options.overlay or options.report:
        film = _draw(options, scene, found, models)
    if options.overlay:
        files["overlay"] = options.overlay
    if options.report:
        assert film is not None
        shown = {
            str(id): Person(people[str(id)]["verdict"], Path(numbered(options.report, id)).name, colour)
            for id, colour in _colours(found).items()
        }
        with replacing(options.report) as temporary:
            page = people_page(Path(options.video).name, shown, list(others.values()), film)
            temporary.write_text(page, encoding="utf-8")
        files["report"] = options.report
    return {
        "people": people,
        "others": list(others.values()),
        "followed": any(one["followed"] for one in people.values()),
        "files": files,
    }


def _track(options: ClipOptions, scene: Scene, start: Start) -> tuple[dict[str, Any], Estimates, Model]:
    """Track the person of a scene; return the figures, the estimates, and the model that tracked."""
    kept: tuple[Estimates, Model] | None = None

    def track(chosen: ClipOptions, scene: Scene, check: Check) -> dict[str, Any]:
        nonlocal kept
        begin = start if chosen is options else _start(scene, scene.person, options.height)
        if begin is None:
            raise UserError(f"{options.video}: person {scene.person}: {_NO_WALK}")
        found: Estimates = {}
        figures = track_scene(chosen, scene, begin, _kept(found), check=check)
        kept = found, scene.model
        return figures

    figures = track_all_motions(options, scene, track)
    assert kept is not None
    return figures, *kept


def numbered(path: str, id: int) -> str:
    """Add a person's number to a file name: track.csv becomes track-2.csv."""
    named = Path(path)
    return str(named.with_name(f"{named.stem}-{id}{named.suffix}"))


def _starts(options: ClipOptions, scene: Scene) -> tuple[dict[int, Start], dict[int, str]]:
    """Find the first state of everyone who walks, in the order of `by_size`; and why others do not."""
    starts: dict[int, Start] = {}
    most = options.people
    more = f"at most {most} people are tracked" if most == MOST_PEOPLE else f"--people {most} leaves them out"
    others = {id: _not_tracked(scene, id, more) for id in by_size(scene.people)}
    for id in by_size(scene.people):
        if len(starts) == options.people:
            break
        stature = options.height if id == scene.person else None
        found = _start(scene, id, stature)
        if found is None:
            others[id] = _not_tracked(scene, id, _NO_WALK)
        else:
            del others[id]
            starts[id] = found
    if not starts:
        raise UserError(f"{options.video}: no one walks in full view for a second; check the camera")
    return starts, others


def _start(scene: Scene, id: int, stature: float | None) -> Start | None:
    """Find the first state of a person in the second that shows it best; None for one who never walks."""
    frames = scene.frames
    found = start_in_keypoints(scene, id, frames.start, frames.stop, stature, best_second=True)
    if found is None or not found.hypotheses[0].walks:
        return None
    return replace(found, source="the joints detected in the images")


def _not_tracked(scene: Scene, id: int, why: str) -> str:
    found = scene.people[id]
    first, last = found.frame[[0, -1]].tolist()
    u, v = np.nanmean(found.uv[0], axis=0)
    where = f"from frame {first} to {last}, at first near pixel ({u:.0f}, {v:.0f})"
    return f"someone in view {where}, is not tracked: {why}"


def _numbered_scene(
    scene: Scene, starts: dict[int, Start], others: list[int]
) -> tuple[Scene, dict[int, Start]]:
    """Give those who start the numbers from 1, and then the others, whose numbers the user never reads."""
    numbers = {id: number for number, id in enumerate([*starts, *others], 1)}
    scene = replace(
        scene,
        person=numbers[scene.person],
        people={numbers[id]: one for id, one in scene.people.items()},
        keypoints={numbers[id]: one for id, one in scene.keypoints.items()},
    )
    return scene, {numbers[id]: start for id, start in starts.items()}


def _options_of(options: ClipOptions, scene: Scene, id: int, first: bool) -> ClipOptions:
    """Return the options of one person's track; only that of the `first` writes the camera."""
    return replace(
        options,
        output=numbered(options.output, id),
        trc=options.trc and numbered(options.trc, id),
        draws=options.draws and numbered(options.draws, id),
        report=options.report and numbered(options.report, id),
        overlay=None,
        camera_out=options.camera_out if first else None,
        cameras_out=options.cameras_out if first else None,
        height=options.height if id == scene.person else None,
    )


def _scene_of(scene: Scene, id: int, tracked: list[int], outlines: dict[int, Keypoints]) -> Scene:
    """Return the scene of one person, in which the other tracked people are kept apart."""
    apart = {other for other in tracked if other != id}
    return replace(
        scene,
        person=id,
        people={other: one for other, one in scene.people.items() if other not in apart},
        keypoints={other: one for other, one in scene.keypoints.items() if other not in apart},
        apart={other: one for other, one in scene.keypoints.items() if other in apart},
        outlines={other: Outline(one, scene.video.fps, scene.camera) for other, one in outlines.items()},
    )


def _kept(into: Estimates) -> Callable[[Frame, Estimate], None]:
    def keep(frame: Frame, estimate: Estimate) -> None:
        into[frame.number] = estimate

    return keep


def _joints(scene: Scene, found: Estimates) -> dict[int, dict[str, Array]]:
    """Project the estimated joints to pixels in the frames in which the person was followed."""
    out = {}
    for number, estimate in found.items():
        uv = scene.camera_at(number).project(estimate.joints)
        if estimate.status != TrackStatus.LOST and np.isfinite(uv).all():
            out[number] = dict(zip(estimate.joint_names, uv, strict=True))
    return out


def _colours(found: dict[int, Estimates]) -> dict[int, tuple[int, int, int]]:
    """Choose a colour for each person, BGR."""
    return {id: PERSON_COLOURS[k % len(PERSON_COLOURS)] for k, id in enumerate(sorted(found))}


def _draw(
    options: ClipOptions, scene: Scene, found: dict[int, Estimates], models: Mapping[int, Model]
) -> PageFilm | None:
    """Write the film with everyone, each in their own colour and with their number above the head.

    Returns the film for the page, if one is to be written.
    """
    colours = {str(id): colour for id, colour in _colours(found).items()}
    still = {model: Overlay(model, scene.camera) for model in models.values()}
    size = (scene.camera.width, scene.camera.height)
    with (
        Films(options.overlay, options.report, scene.frames, size, scene.video.fps) as films,
        progress("drawing", len(scene.frames), options.quiet) as update,
    ):
        for frame in scene.video.frames(scene.frames.start, scene.frames.stop):
            picture = frame.image
            for model, overlay in still.items():
                if frame.pose is not None:
                    overlay = Overlay(model, frame.camera(scene.camera))
                ids = [id for id, one in sorted(found.items()) if models[id] is model and frame.number in one]
                now = {str(id): found[id][frame.number] for id in ids}
                picture = overlay.draw_people(picture, now, colours)
            films.write(picture, frame.number)
            update(frame.number - scene.frames.start + 1)
    return films.page
