"""Make the page of a run from its files: the track, the film, and camera and truth if available."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gait.bindings.abi import Flag, TrackStatus
from gait.bindings.estimate import Estimate
from gait.bindings.model import Model, read_cyclic
from gait.bindings.state import State
from gait.body.motion_classes import WALKING
from gait.body.skeleton import JOINTS
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io.files import is_unfinished, replacing
from gait.io.track_file import CLASS_PREFIX, Track, read_track
from gait.io.video import Video
from gait.motion.evaluate import Measures
from gait.motion.footfalls import Draws
from gait.motion.norms import beside_norms
from gait.motion.parameters import measured, without_norm
from gait.motion.tracked_model import model_for
from gait.motion.verdict import Verdict, verdict_of
from gait.progress import note, progress
from gait.report.camera_facts import camera_facts
from gait.report.comparison import compare
from gait.report.drawing import LEGEND_SECONDS, Overlay
from gait.report.film import Films, PageFilm
from gait.report.run_page import Run, cycles_of, run_page


@dataclass(frozen=True)
class RunFiles:
    """What to report on, and what to write.

    Attributes
    ----------
    track, video, page : str
        The track, the clip that was tracked, the HTML file to write.
    camera : str, optional
        The clip's camera; by default ``camera.json`` beside the track or the clip.
    scale_camera : bool
        Whether to resize a camera of another resolution to the clip's.
    overlay : str, optional
        Video to write.
    truth, draws : str, optional
        True motion; motions of ``gait track --smooth --draws``.
    model : str, optional
        By default the model of the package that has the track's classes of motion.
    age, sex : optional
        Age of the person in years, and ``f`` or ``m``, for the norm of the speed.
    quiet : bool
        Suppress notes and progress.
    """

    track: str
    video: str
    page: str
    camera: str | None = None
    scale_camera: bool = False
    overlay: str | None = None
    truth: str | None = None
    draws: str | None = None
    model: str | None = None
    age: float | None = None
    sex: str | None = None
    quiet: bool = False


def write_report(
    files: RunFiles,
    estimates: Mapping[int, Estimate] | None = None,
    facts: Mapping[str, dict[str, str]] | None = None,
    drawings: Mapping[str, str] | None = None,
) -> tuple[Verdict, Measures | None]:
    """Write the page and the overlay video; return the verdict, and the errors if the truth is known.

    Parameters
    ----------
    files : RunFiles
    estimates : mapping of int to Estimate, optional
        Estimates by frame, if they contain more than the track.
    facts, drawings : mapping, optional
        Further tables and drawings for the page, by heading.

    Raises
    ------
    UserError
        If a file cannot be read or written, or the track has frames that the clip does not have.
    """
    video, track = Video(files.video), read_track(files.track)
    tracked = model_for(track, files.track, files.model)
    model = Model(tracked)
    if track.frame[-1] >= video.count:
        raise UserError(
            f"{files.track}: has frame {track.frame[-1]}, {files.video} ends at {video.count - 1}; give the "
            "film that was tracked"
        )
    other = track.compare_film(files.track, video)
    note(other, files.quiet or not other)
    last = f"the command that tracked was interrupted after frame {track.frame[-1]}"
    cut = last if is_unfinished(files.track) else ""
    path, remark = _camera(files, track)
    camera = None if path is None else Camera.read(path, video.size, files.scale_camera)
    draws = Draws.read(files.draws, track) if files.draws else None
    errors = compare(track, files.truth, files.model, camera) if files.truth else None
    note(remark, files.quiet or not remark)
    parameters = measured(track, draws)
    sections = read_cyclic(tracked)
    norms = [] if parameters is None else beside_norms(track, parameters, sections, files.age, files.sex)
    overlay = None if camera is None else Overlay(model, camera)
    frames = range(video.count) if track.frames is None else track.frames
    film = _draw(files, video, frames, estimates or estimates_of(track, model), overlay)
    run = Run(
        title=video.path.name,
        track=track,
        verdict=verdict_of(track, video.count, parameters=parameters),
        parameters=parameters,
        cycles=cycles_of(track, parameters, sections, draws),
        norms=norms,
        without_norm="" if parameters is None else without_norm(parameters, sections),
        model=tracked,
        film=film,
        times=video.times[film.frames.start : film.frames.stop],
        camera=camera,
        errors=errors,
        notes=[words for words in (cut, video.broken, other) if words],
        facts={**(facts or {}), "Camera and files": _facts(files, video, path, camera)},
        drawings=dict(drawings or {}),
    )
    with replacing(files.page) as temporary:
        temporary.write_text(run_page(run), encoding="utf-8")
    return run.verdict, None if errors is None else errors.measures


def estimates_of(track: Track, model: Model) -> dict[int, Estimate]:
    """Make estimates for drawing, by frame, from the columns of a track.

    Posture and proportions of the body are not in the file, so they are those of the model.
    """
    numbers, components = track.numbers, model.info.components
    joints = np.stack([track.places[name] for name in JOINTS], axis=1)
    sd = np.stack([track.sd[name] for name in JOINTS], axis=1)
    order = [JOINTS.index(name) for name in model.joint_names]

    def column(name: str, k: int) -> float:
        return float(numbers[name][k]) if name in numbers else 0.0

    found = {}
    for k, number in enumerate(track.frame.tolist()):
        motion_class, probability = WALKING, np.ones(1)
        if track.motion_class and track.motion_class[k]:
            motion_class = track.motion_class[k]
            probability = np.array([column(f"{CLASS_PREFIX}{name}", k) for name in track.classes])
        still = model.directions.get(motion_class) == 0  # one posture, whatever phase and rate
        mean = State(
            phase=0.0 if still else float(track.phase[k]),
            stride_hz=0.0 if still else column("stride_hz", k),
            stature=column("stature_m", k),
            heading=column("heading_rad", k),
            pelvis=track.places["pelvis"][k],
            coef=np.array([column(f"c_{c + 1}", k) for c in range(components)]),
            motion_class=model.classes.index(motion_class) if motion_class in model.classes else 0,
        )
        found[number] = Estimate(
            utime=round(1e6 * float(track.time[k])),
            frame=k,
            status=TrackStatus[track.status[k].upper()],
            flags=Flag(0),
            log_evidence=column("log_evidence", k),
            ess=column("ess", k),
            phase_r=1.0,
            hypothesis_weight=1.0,
            speed=column("speed_m_s", k),
            mean=mean,
            sd=State(phase=column("phase_sd", k)),
            best=mean,
            joints=joints[k, order],
            joint_sd=sd[k, order],
            angles=np.zeros(0),
            joint_names=model.joint_names,
            motion_class=motion_class,
            class_probability=probability,
        )
    return found


def _draw(
    files: RunFiles, video: Video, frames: range, estimates: Mapping[int, Estimate], overlay: Overlay | None
) -> PageFilm:
    """Draw all frames that were to be tracked, and write them to the films."""
    begin = video.times[frames.start]
    with (
        Films(files.overlay, files.page, frames, video.size, video.fps) as films,
        progress("film", len(frames), files.quiet) as update,
    ):
        for done, frame in enumerate(video.frames(frames.start, frames.stop), 1):
            estimate, legend = estimates.get(frame.number), frame.time - begin < LEGEND_SECONDS
            picture = frame.image
            if overlay is not None and estimate is None:
                picture = overlay.draw_absent(picture, frame.time, frame.number, legend=legend)
            elif overlay is not None and estimate is not None:
                picture = overlay.draw(picture, estimate, frame.number, legend=legend)
            films.write(picture, frame.number)
            update(done)
    if films.page is None:
        raise video.no_frame(frames.start)
    return films.page


def _camera(files: RunFiles, track: Track) -> tuple[str | None, str]:
    """Read the given camera, or the file beside the track or the clip; also return a remark in that case.

    A camera that was estimated from the walk has its own world, to which other camera files do not belong.
    """
    if files.camera is not None:
        return files.camera, ""
    if track.camera_change is not None:
        remedy = "give the file of gait track --camera-out as --camera"
        return (
            None,
            f"the track's camera was estimated from the walk; to see the figure in the film, {remedy}",
        )
    beside = [Path(name).with_name("camera.json") for name in (files.track, files.video)]
    path = next((str(one) for one in beside if one.is_file()), None)
    if path is None:
        return None, "no camera is known, so the film is shown without the figure; give --camera"
    return path, f"camera: {path}, found beside the track or film; --camera gives another"


def _facts(files: RunFiles, video: Video, path: str | None, camera: Camera | None) -> dict[str, str]:
    rows = {
        "track": files.track,
        "film": f"{files.video}, {video.width} × {video.height} px, {video.count} frames, "
        f"{video.fps:.4g} per second",
        "camera": "not given" if path is None else path,
        "start, background, particles": "not in these files; see the page of gait track --report",
    }
    if camera is not None:
        rows |= camera_facts(camera)
    named = {"overlay": files.overlay, "truth": files.truth, "draws": files.draws, "model": files.model}
    return rows | {what: name for what, name in named.items() if name}
