"""Descriptions of the inputs and outputs of a tracked clip: start, background, camera, files."""

from __future__ import annotations

from pathlib import Path

from gait.bindings.abi import Mode
from gait.bindings.initial import Start
from gait.camera.path import one_place
from gait.io.video import EMPTY_SCENE_FRAMES
from gait.report.camera_facts import camera_facts
from gait.track.clip_camera import motion_remedy
from gait.track.clip_keypoints import detects
from gait.track.first_state import start_words
from gait.track.options import ClipOptions
from gait.track.scene import Scene
from gait.track.stabilise import CameraTurns

_OWN_BODY = {
    True: "from a first pass",
    False: "joints half-way to those lifted from the keypoints, while the person walks straight on",
}
_BESIDE = {"init": "init.json", "camera": "camera.json"}


def setup(options: ClipOptions, scene: Scene, start: Start, used: bool) -> dict[str, str]:
    """Describe in words the inputs used, by name; `used`: whether the background was."""
    words = {
        "model": options.model_name + (options.model_reason and f", as {options.model_reason}"),
        "start": _start(options, start),
        "background": _background(options, scene, used),
        "camera": _camera(options, scene),
        "joints found": _keypoints(options, scene),
        **({"body estimated": _OWN_BODY[bool(options.further)]} if options.own_body else {}),
    }
    for (video, camera), began in zip(options.further, scene.began, strict=True):
        words |= {f"further film {video}": f"camera {camera}, {began}"}
    return words


def settings(options: ClipOptions, scene: Scene, particles: int) -> dict[str, str]:
    """Describe further settings in words, by name."""
    return camera_facts(scene.camera) | {
        "picture": f"{scene.video.width} × {scene.video.height} px, {scene.video.fps:.4g} frames per second",
        "stature given": "not given" if options.height is None else f"{options.height:.2f} m",
        "body measured": "no" if options.body is None else options.body.source,
        "settings": "of the paper" if options.mode == Mode.PAPER else "default",
        "estimates": "each frame from the whole film (smoothed)"
        if options.smooth
        else "each frame from the frames before it",
        "particles": f"{particles}, random numbers from seed {options.seed}",
    }


def files(options: ClipOptions) -> dict[str, str]:
    """List the outputs by their contents."""
    named = {
        "track": options.output,
        "camera": options.camera_out,
        "camera of each frame": options.cameras_out,
        "overlay": options.overlay,
        "draws": options.draws,
        "joints for OpenSim": options.trc,
        "report": options.report,
    }
    return {what: path for what, path in named.items() if path}


def beside(options: ClipOptions) -> list[str]:
    """List files beside the film that the user may have meant to use."""
    given = {"init": options.init != "auto", "camera": options.camera is not None}
    found = {option: Path(options.video).with_name(name) for option, name in _BESIDE.items()}
    return [
        f"not used: {path} beside the film; to use it: --{option} {path}"
        for option, path in found.items()
        if not given[option] and path.is_file() and not _same(path, options.camera_out)
    ]


def _same(path: Path, other: str | None) -> bool:
    return other is not None and path.resolve() == Path(other).resolve()


def _start(options: ClipOptions, start: Start) -> str:
    if options.init != "auto":
        return f"{options.init}, frame {start.frame}"
    return f"found at frame {start.frame} from {start.source}: {start_words(start)}"


def _background(options: ClipOptions, scene: Scene, used: bool) -> str:
    if options.background == "none":
        return "none, as asked"
    if options.background != "auto":
        return options.background
    median = f"the median of {EMPTY_SCENE_FRAMES} frames of the film"
    if not used and scene.poses and not one_place(list(scene.poses.values())):
        return "none: the camera travels"
    if scene.moved:
        return "none: the camera moves"
    return median if used else f"none: {median} shows the person"


def _camera(options: ClipOptions, scene: Scene) -> str:
    if options.camera_path:
        return f"{options.camera}, moving as in {options.camera_path}"
    motion = ""
    if scene.moved:
        what = "but its motion was not found" if options.stabilize == "auto" else "counts as still"
        motion = f", which {scene.moved}, {what} ({motion_remedy(options, scene.turn)})"
    elif scene.motion is not None:
        turn = f"which turns by up to {scene.motion.furthest(scene.frames):.0f} px"
        motion = f"{_reference(scene.motion)}, {turn} (--cameras-out writes that of each frame)"
    elif scene.poses:
        motion = ", in frame 0, which travels (--cameras-out writes that of each frame)"
    if scene.calibration is None:
        return f"{scene.against_camera or options.camera}{motion}"
    return f"estimated from the walk and the stature of {options.height:.2f} m{motion}"


def _reference(motion: CameraTurns) -> str:
    return ", of the background" if motion.reference < 0 else f", in frame {motion.reference}"


def _keypoints(options: ClipOptions, scene: Scene) -> str:
    if options.keypoints:
        return f"from {options.keypoints}"
    if not scene.people:
        if options.detector == "none" or options.mode == Mode.PAPER:
            return "none: without the detector"
        return "none" if detects(options) else "none (no detector weights: gait detect --fetch)"
    return f"by the detector, network {options.network}"
