"""Lift 2-D keypoints of a person, or a video, to 3-D motion with standard deviations.

KEYPOINTS.csv has the columns frame,time,<joint>_u,<joint>_v and optionally <joint>_c: pixels (u to the
right, v down, pixel centres at integers) and a confidence from 0 to 1, which divides the standard deviation.
Empty cells are missing points.  Joints are those of the model's segment prior (gait info M.gait).  The prior
over short segments of motion supplies the depth and the missing joints (Leventon and Freeman 1998).

Keypoints of other tools are recognised by their content: a folder of OpenPose, JSON of COCO, AlphaPose,
MMPose or MediaPipe, CSV or HDF5 of DeepLabCut or SLEAP, TRC in pixels of Sports2D or Pose2Sim.  If the file
has no times, they come from --video or --fps.

In a VIDEO the joints of a walking person are detected first (see gait detect).  Without --camera the camera
is estimated from the walk, given the person's stature (see gait camera --walk); the standard deviations in
OUT.csv include its uncertainty.  With --placement the images themselves are lifted, without a detector: see
the options under "from a video's images".

Views: with --camera the result is in the camera's world.  --orthographic looks from far away along an axis of
a world with z up; the scale comes from the person's stature unless --metres-per-unit gives it.  Without
either, the camera is assumed to be level and far away (looking along y), with a slowly changing scale.
Neither determines the position along the line of sight; the lowest foot is placed on the floor.

Several views of one person, each with a --camera in one world, are lifted together, in the frames of the
first: the distance no longer comes from the person's size.  When their films began is estimated from the
motion unless --offsets gives it.

OUT.csv: frame,time and for each joint _x,_y,_z (metres) and _sx,_sy,_sz (posterior standard deviations).
"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait.bindings.abi import MAX_CAMERAS
from gait.cli import values
from gait.counts import count_of
from gait.errors import UsageError, UserError
from gait.io.files import replacing, require_outputs
from gait.lift.smooth.options import METHODS, Options
from gait.progress import warning

if TYPE_CHECKING:
    from gait.bindings.segment_prior import SegmentPrior
    from gait.io.detections import Clip
    from gait.lift.detected import Detected, Request
    from gait.lift.run import FilmedView
    from gait.track.from_walk import Calibration

EXAMPLES = """\
examples:
  gait lift walk.mp4 --height 1.75 -o motion.csv --camera-out camera.json
  gait lift keypoints.csv --camera camera.json -o motion.csv
  gait lift left.csv right.csv --camera calibration.toml -o motion.csv
  gait lift walk.mp4 --camera camera.json --placement init.json -o motion.csv --suggest 5
"""
FILES_HELP = """\
P.json gives the person's rough position in one frame.  With --camera it has the format of gait track --init:
  {"frame": 64, "pelvis": [-0.1, 5.5, 0.9], "heading_rad": -1.57, "stature_m": 1.65}
Without a camera, or with one that is estimated from the walk (--height), it is in pixels; the result is then
in the picture's axes (x to the right, y away, z up):
  {"frame": 64, "pelvis_px": [1376, 734], "height_px": 415, "heading_rad": 3.14, "stature_m": 1.65}
"phase" (of walking; 0: right heel strike, 0.5: left heel strike) determines which leg is in front; without
it, left and right may be swapped for a person seen from the side.  C.json gives positions of joints (or other
markers of the model) and optionally their standard deviation (default: 4 pixels):
  {"corrections": [{"frame": 70, "joint": "l_knee", "uv": [1285.5, 812], "sd_px": 5}]}
"""

_ONLY_KEYPOINTS = (
    *("orthographic", "metres_per_unit", "pixel_sd", "floor_sd", "method", "no_contact"),
    *("no_bones", "ignore_unknown", "keep_sides", "keep_spikes", "trc", "person", "fps", "video"),
    *("stabilize", "balance"),
)
_ONLY_PICTURES = ("background", "alone")
_ONLY_VIDEO = ("placement", *_ONLY_PICTURES, "start", "stop", "fov", "camera_out", "stabilize")
_ONLY_ONE_VIEW = (
    *("placement", "orthographic", "metres_per_unit", "stabilize", "corrections", "suggest", "balance"),
    *("video", "fov", "scale_camera", "camera_out"),
)
DEFAULT_PIXEL_SD, DEFAULT_FLOOR_SD = Options.pixel_sd, Options.floor_sd  # pixels, metres
WHOLE_BODY_SHARE = 0.5  # share of a displacement's energy from which it counts as moving the whole body
UNKNOWN_MM = 1000.0  # a less certain displacement is the distance, in a view without perspective


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    _add_common(parser)
    _add_keypoints(parser.add_argument_group("from keypoints"))
    _add_video(parser.add_argument_group("from a video"))
    _add_pictures(parser.add_argument_group("from a video's images", FILES_HELP))


def _add_common(parser: argparse.ArgumentParser) -> None:
    """Add options: files, camera, person, and further outputs."""
    parser.add_argument(
        "input",
        nargs="+",
        metavar="KEYPOINTS|VIDEO",
        help="2-D keypoints, or a video in which to detect them; several: of one person, by several cameras",
    )
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        type=values.named(".csv"),
        metavar="OUT.csv",
        help="positions and standard deviations, metres",
    )
    parser.add_argument(
        "-m", "--model", metavar="M.gait", help="model with a segment prior (default: the shipped one)"
    )
    values.add_camera(
        parser,
        "; without it the camera of a VIDEO is estimated from the walk, given --height; of several views one "
        "for each in their order, or a TOML file with as many cameras",
        scale=True,
        several=True,
    )
    parser.add_argument(
        "--offsets",
        type=values.offsets,
        metavar="S[,S]",
        help="how many seconds after the first each further film began (default: estimated from the motion)",
    )
    parser.add_argument(
        "--height",
        type=values.stature,
        metavar="M",
        help="the person's stature in metres (default: unknown, near the mean of the training data)",
    )
    parser.add_argument(
        "--all-markers", action="store_true", help="write all markers of the prior, not only its joints"
    )
    parser.add_argument(
        "--corrections", metavar="C.json", help="corrections by hand, as gait studio writes them"
    )
    parser.add_argument(
        "--suggest",
        type=values.whole(0),
        metavar="N",
        help="list the N corrections that would help most (default: 0)",
    )
    parser.add_argument(
        "--overlay",
        type=values.named(*values.FILMS),
        metavar="O.mp4",
        help="draw the cylinder figure into the video (into --video, if the input is keypoints)",
    )


def _add_keypoints(group: argparse._ArgumentGroup) -> None:
    """Add options: view, estimator, repairs of keypoints, and what another tool's file may lack."""
    add = group.add_argument
    add(
        "--orthographic",
        metavar="AXIS",
        help="without a camera: view from far away along x, y, z, -x, -y, -z or X,Y,Z",
    )
    add(
        "--metres-per-unit",
        type=values.between(1e-6, 1e3, "metres"),
        metavar="M",
        help="length of a unit of u and v, with --orthographic (default: from the person's stature)",
    )
    add(
        "--pixel-sd",
        type=values.between(1e-6, 1e6, "a standard deviation"),
        metavar="SD",
        help="standard deviation of u and v at full confidence, in their unit (default: how much the points "
        f"jitter from frame to frame, at least {DEFAULT_PIXEL_SD:g})",
    )
    add(
        "--floor-sd",
        type=values.between(1e-4, 100, "metres"),
        metavar="M",
        help="standard deviation of the floor's height around z = 0 in metres, with --camera and "
        f"--method smooth (default: {DEFAULT_FLOOR_SD:g}; larger on steps)",
    )
    add(
        "--method",
        choices=METHODS,
        help="smooth (default): one Gaussian over the whole sequence; blend: overlapping segments, each "
        "estimated alone and blended as in the paper; segment: one after another; likelihood: like blend, "
        "but without the prior of the modes (least squares), for comparison",
    )
    switches = (
        ("--no-contact", "smooth: let feet on the floor slide"),
        ("--no-bones", "smooth: let bone lengths change"),
        (
            "--balance",
            "smooth: prefer motions whose ground force acts within the polygon of the standing feet",
        ),
        ("--ignore-unknown", "ignore points that the model does not know"),
        ("--keep-sides", "do not undo swaps of left and right"),
        ("--keep-spikes", "keep spikes: points far from their positions a frame before and after"),
    )
    for option, help in switches:
        add(option, action="store_true", help=help)
    add("--trc", type=values.named(".trc"), metavar="O.trc", help="also write the positions for OpenSim")
    values.add_person(group, several=True)
    add(
        "--fps",
        action="append",
        type=values.between(1, 1e5, "frames per second"),
        metavar="HZ",
        help="frames per second of another tool's keypoints, which number frames from 0; " + values.EACH_VIEW,
    )
    add(
        "--video",
        metavar="VIDEO",
        help="video in which another tool found the keypoints: gives frame times and size",
    )


def _add_video(group: argparse._ArgumentGroup) -> None:
    """Add the options for videos only."""
    values.add_fov(group)
    group.add_argument(
        "--camera-out",
        type=values.named(".json"),
        metavar="CAM.json",
        help="also write the camera, estimated or given",
    )
    group.add_argument(
        "--stabilize",
        choices=["auto", "off"],
        help="auto: estimate how the camera moves; joints are then in the scene's frame: that of the first "
        "frame if a camera is given, or else of the frame that the command names (default: off)",
    )
    group.add_argument(
        "--start",
        type=values.whole(0),
        metavar="F",
        help="first frame to use (default: that of --placement, or 0)",
    )
    group.add_argument(
        "--stop",
        type=values.whole(0),
        metavar="F",
        help="first frame not to use (default: to the end); of several films, like --start, of the first",
    )


def _add_pictures(group: argparse._ArgumentGroup) -> None:
    """Add the options for lifting without a detector."""
    group.add_argument(
        "--placement", metavar="P.json", help="rough position of the person in one frame; lifts the images"
    )
    group.add_argument(
        "--background",
        metavar="PNG|auto|none",
        help="empty scene, whose edges the sensors ignore: an image, auto (default) for the median of the "
        "clip, or none",
    )
    group.add_argument(
        "--alone",
        action="store_true",
        help="estimate segments one after the other, as in the paper (default: jointly)",
    )


def run(args: argparse.Namespace) -> int:
    """Lift keypoints or a video."""
    _take_views(args)
    video = _is_video(args.input, bool(args.placement))
    _require_own(args, video)
    if args.stop is not None:
        values.require_order(args.start or 0, args.stop)
    require_outputs(
        (args.output, args.trc, args.overlay, args.camera_out),
        (args.input, args.model, args.camera, args.placement, args.corrections, args.background, args.video)
        + tuple(file for view in args.further for file in view),
    )
    summary, text = _lift_pictures(args) if args.placement else _lift_keypoints(args, video)
    print(json.dumps(summary) if args.json else text)
    return 0


def _take_views(args: argparse.Namespace) -> None:
    """Set `input` and `camera` to those of the first view, and `further` to those of the others."""
    inputs = args.input
    if len(inputs) == 1:
        args.input, args.camera, args.further = inputs[0], values.camera_of(args.camera, args.offsets), []
        return
    if len(inputs) > MAX_CAMERAS:
        raise UsageError(f"{len(inputs)} views; give at most {MAX_CAMERAS}")
    if args.method not in (None, "smooth"):
        raise UsageError(f"--method {args.method}: is for one view; of several use smooth")
    for option in _ONLY_ONE_VIEW:
        if getattr(args, option) not in (None, False, "off"):
            raise UsageError(f"--{option.replace('_', '-')}: is for one view; leave it out, or lift one view")
    cameras = values.cameras_of(args.camera, args.offsets, inputs)
    args.input, args.camera = inputs[0], cameras[0]
    args.further = list(zip(inputs[1:], cameras[1:], strict=True))


def _is_video(path: str, pictures: bool) -> bool:
    """Whether a file is a video, not keypoints; without a suffix, only if its `pictures` are to be lifted."""
    from gait.io.detector_formats import DATA, KNOWN, reader_of

    suffix = Path(path).suffix.lower()
    video = suffix not in (".csv", ".tsv", ".txt") and bool(suffix or pictures)
    if video and not set("%:") & set(path) and not Path(path).exists():
        raise UserError(f"{path}: no such file; check the name")
    reader = reader_of(path) if video and Path(path).exists() else None
    if reader is None and suffix in DATA:
        raise UserError(f"{path}: is neither a video nor known keypoints; {KNOWN}")
    return video and reader is None


def _lift_keypoints(args: argparse.Namespace, video: bool) -> tuple[dict[str, Any], str]:
    """Lift keypoints from a file or found in a video; return the summary, and the summary in words."""
    from gait.bindings.model import walking_model
    from gait.io.track_file import write_lifted
    from gait.io.trc import write_trc
    from gait.lift import run as lift_run
    from gait.lift.segment.view import Perspective
    from gait.lift.summary import summary
    from gait.track.camera_check import contradiction

    _check(args, video)
    clips = _clips(args)
    warn = partial(warning, quiet=args.quiet)
    prior = lift_run.load_prior(args.model, warn)
    in_video = _detect(args, prior, args.input, args.camera) if video else None
    calibration = in_video.calibration if in_video else None
    request = lift_run.Request(
        options=_options(args),
        pixel_sd_given=args.pixel_sd is not None,
        camera=args.camera,
        size=_scaled(args),
        calibration=calibration,
        axis=args.orthographic,
        metres=args.metres_per_unit,
        ignore_unknown=args.ignore_unknown,
        keep_sides=args.keep_sides,
        keep_spikes=args.keep_spikes,
        all_markers=args.all_markers,
        clip=clips[0],
        stabilised=args.stabilize == "auto",
        corrections=args.corrections,
    )
    if args.further:
        views = _filmed(args, prior, in_video, clips)
        lifted = lift_run.lift_views(views, args.offsets, prior, request, warn, args.quiet)
    elif in_video is None:
        lifted = lift_run.lift_file(args.input, prior, request, warn, args.quiet)
    else:
        lifted = lift_run.lift_keypoints(args.input, in_video.keypoints, prior, request, warn, args.quiet)
    keypoints, found = lifted.keypoints, lifted.motion
    lift_run.require_person(args.input, lifted, request)
    for words in lift_run.warnings_of(lifted, prior.stature):
        warn(words)
    if not video and args.height and not (args.camera or args.orthographic):
        warn(
            f"no camera, so the path over the floor is unknown; gait camera --walk {args.input} --size WxH "
            f"--height {args.height:g} -o camera.json estimates one from the walk"
        )
    if (
        isinstance(lifted.view, Perspective)
        and calibration is None
        and (fault := contradiction(lifted.view.camera, keypoints, walking_model(args.model), args.height))
    ):
        warn(f"{args.camera}: {fault}")
    write_lifted(args.output, keypoints.frame, keypoints.time, found.names, found.places, found.sd)
    if args.trc:
        write_trc(args.trc, found.names, keypoints.time, found.places, keypoints.rate)
    _write_camera(args, calibration)
    figures = summary(lifted)
    if args.overlay or args.suggest:
        from gait.io.video import Video  # imports PyAV, not needed for files of keypoints
        from gait.lift import picture

        if args.overlay:
            film = Video(args.input if video else args.video)
            picture.draw_overlay(args.overlay, film, lifted, args.quiet, in_video.turns if in_video else None)
        if args.suggest:
            asked = picture.suggestions(lifted, args.suggest)
            figures["suggest"] = [{"frame": s.frame, "joint": s.joint, "sd_px": s.sd_px} for s in asked]
    figures |= {} if calibration is None else {"camera": calibration.figures()}
    return figures, _text(figures)


def _detect(args: argparse.Namespace, prior: SegmentPrior, video: str, camera: str | None) -> Detected:
    """Find the person's keypoints in one of the videos, from one of the cameras."""
    from gait.lift.detected import find_keypoints  # imports OpenCV and PyAV, not needed for files

    return find_keypoints(_request(args, video, camera), prior, args.quiet)


def _request(args: argparse.Namespace, video: str, camera: str | None) -> Request:
    from gait.lift import detected

    return detected.Request(
        video=video,
        camera=camera,
        model=args.model,
        corrections=args.corrections,
        scale_camera=args.scale_camera,
        parallel=bool(args.orthographic),
        height=args.height,
        fov=args.fov,
        start=args.start,
        stop=args.stop,
        stabilize=args.stabilize == "auto",
    )


def _views(args: argparse.Namespace) -> list[tuple[str, str]]:
    """File and camera of each view."""
    return [(args.input, args.camera), *args.further]


def _filmed(
    args: argparse.Namespace, prior: SegmentPrior, in_video: Detected | None, clips: list[Clip]
) -> list[FilmedView]:
    """Collect several views; `in_video`: what was found in the first, if it is a film."""
    from gait.lift.run import FilmedView

    views: list[FilmedView] = []
    for (path, camera), clip in zip(_views(args), clips, strict=True):
        found = None if views else in_video
        if views and _is_video(path, False):
            whole = argparse.Namespace(**{**vars(args), "start": None, "stop": None})
            found = _detect(whole, prior, path, camera)
        people = {str(id): one for id, one in found.people.items()} if found else None
        views.append(FilmedView(path, camera, people, clip, found.still if found else None))
    return views


def _clips(args: argparse.Namespace) -> list[Clip]:
    """Collect what each view's file of another tool may lack: person, times, and the size of the picture.

    UserError if cameras of several views are at the same place.
    """
    from gait.camera.camera import Camera
    from gait.camera.synchronise import require_apart
    from gait.io.detections import Clip

    size = times = None
    if args.video:
        from gait.io.video import Video  # imports PyAV, not needed for files with times

        film = Video(args.video)
        size, times = film.size, film.times
    clips = []
    people, rates = (_of_views(args, option) for option in ("person", "fps"))
    cameras = [Camera.read(camera) if camera and not size else None for _, camera in _views(args)]
    for camera, person, fps in zip(cameras, people, rates, strict=True):
        clips.append(Clip(person, fps, times, camera.size if camera else size, args.quiet))
    if args.further:
        require_apart([path for path, _ in _views(args)], [camera for camera in cameras if camera])
    return clips


def _of_views(args: argparse.Namespace, option: str) -> list[Any]:
    """Assign the values of an option to the views with files of another tool; None to others."""
    from gait.io.detector_formats import reader_of

    given, paths = getattr(args, option) or [], [path for path, _ in _views(args)]
    if not given:
        return [None] * len(paths)
    if len(paths) == len(given) == 1:
        return list(given)
    foreign = [Path(path).exists() and reader_of(path) is not None for path in paths]
    if not any(foreign):
        raise UsageError(f"--{option}: is for files of other tools, and no view has one")
    if len(given) not in (1, sum(foreign)):
        raise UsageError(
            f"--{option}: {len(given)} for {count_of(sum(foreign), 'file')} of other tools; give one for "
            "each, or one for all"
        )
    each = iter(given if len(given) > 1 else given * sum(foreign))
    return [next(each) if own else None for own in foreign]


def _write_camera(args: argparse.Namespace, calibration: Calibration | None) -> None:
    """Write the camera, estimated or given, if asked for."""
    from gait.camera.camera import read_camera, write_camera

    if args.camera_out:
        with replacing(args.camera_out) as temporary:
            if calibration is None:
                write_camera(temporary, read_camera(args.camera, _scaled(args), scale=True))
            else:
                write_camera(temporary, calibration.camera)


def _scaled(args: argparse.Namespace) -> tuple[int, int] | None:
    """Return the size to which --scale-camera resizes the camera, that of the video."""
    from gait.io.video import Video

    return Video(args.video or args.input).size if args.scale_camera else None


def _lift_pictures(args: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """Lift the images of a video; return the summary, and the summary in words."""
    from gait.body.skeleton import JOINTS
    from gait.io.track_file import write_lifted
    from gait.lift import run as lift_run
    from gait.lift.detected import find_camera
    from gait.lift.video import run as video_run

    warn = partial(warning, quiet=args.quiet)
    prior, calibration = lift_run.load_prior(args.model, warn), None
    if args.height:
        calibration = find_camera(_request(args, args.input, None), prior, args.quiet)
    request = video_run.Request(
        video=args.input,
        placement=args.placement,
        model=args.model,
        camera=args.camera,
        scale_camera=args.scale_camera,
        calibration=calibration,
        height=args.height,
        corrections=args.corrections,
        background=args.background or "auto",
        start=args.start,
        stop=args.stop,
        joined=not args.alone,
    )
    lifted = video_run.lift_video(request, prior, warn, args.quiet)
    fit = lifted.fit
    shown = [i for i, name in enumerate(prior.names) if name in JOINTS or args.all_markers]
    names = [prior.names[i] for i in shown]
    write_lifted(args.output, fit.frame, fit.time, names, fit.places[:, shown], fit.sd[:, shown])
    if args.overlay:
        video_run.draw_overlay(args.overlay, lifted, args.quiet)
    _write_camera(args, calibration)
    summary = video_run.summary(lifted, args.suggest or 0)
    summary |= {} if calibration is None else {"camera": calibration.figures()}
    return summary, _video_text(summary)


def _options(args: argparse.Namespace) -> Options:
    return Options(
        args.method or METHODS[0],
        args.height,
        args.pixel_sd or DEFAULT_PIXEL_SD,
        args.floor_sd or DEFAULT_FLOOR_SD,
        not args.no_contact,
        not args.no_bones,
        args.balance,
        covariance=bool(args.suggest),
    )


def _require_own(args: argparse.Namespace, video: bool) -> None:
    """Raise UsageError for options that would have no effect."""
    useless: tuple[str, ...]
    if not video:
        useless, why = _ONLY_VIDEO, f"is for a video, and {args.input} contains keypoints"
    elif args.placement:
        useless, why = _ONLY_KEYPOINTS, "is for keypoints, and --placement for the images of a video"
    else:
        useless, why = (
            _ONLY_PICTURES,
            "needs --placement, the person's rough position in one frame",
        )
    given = bool(args.camera or args.orthographic)
    for option in useless:
        value = getattr(args, option)
        if value is not None and value is not False:
            raise UsageError(f"--{option.replace('_', '-')} {why}")
    if video and args.placement and args.camera and args.height:
        raise UsageError("--height: the placement gives the stature; leave out --height or --camera")
    if args.scale_camera and not ((video or args.video) and args.camera):
        raise UsageError("--scale-camera: is for the --camera of a VIDEO (or --video), whose size it takes")
    if args.fov and (given or not args.height):
        raise UsageError("--fov: is for a camera estimated from the walk, with --height and no --camera")
    if args.camera_out and not (args.camera or (args.height and not given)):
        raise UsageError("--camera-out: there is no camera; give --camera, or --height for one from the walk")


def _check(args: argparse.Namespace, video: bool) -> None:
    """Raise UsageError for options that exclude each other, and for a video without camera or stature."""
    if video and not (args.camera or args.orthographic or args.height):
        raise UsageError("give --camera CAM, or --height M to estimate the camera from the walk")
    smooth = args.method in (None, "smooth")
    if args.fps and args.video:
        raise UsageError("--fps and --video exclude each other; give one of them")
    if args.overlay and not (video or args.video):
        raise UsageError("--overlay: give the --video in which the keypoints were found")
    if args.overlay and args.orthographic and args.stabilize == "auto":
        raise UsageError("--overlay: a turning camera needs its lens; give --camera or --height")
    if args.camera and args.orthographic:
        raise UsageError("--camera and --orthographic exclude each other; give one of them")
    if args.metres_per_unit and not args.orthographic:
        raise UsageError("--metres-per-unit goes with --orthographic")
    if not smooth and (args.no_contact or args.no_bones or args.balance):
        raise UsageError("--no-contact, --no-bones and --balance go with --method smooth")
    if args.balance and args.no_contact:
        raise UsageError("--balance needs feet that stand: leave out --no-contact")
    camera = args.camera or (args.height and video and not args.orthographic)
    if args.floor_sd and not (smooth and camera):
        raise UsageError("--floor-sd goes with --camera and --method smooth")


def _text(s: dict[str, Any]) -> str:
    markers, count = s["markers"], len(s["markers"]["visible"])
    lines = [
        f"{s['frames']} frames; {count_of(count, 'point')} a frame, visible in {s['visible_share']:.0%}; "
        f"{len(markers['estimated'])} markers estimated",
        f"{s['reprojection_px']:.2f} px from the keypoints, median sd {s['sd_mm']:.0f} mm"
        + (f", stature {s['stature_m']:.2f} m" if s["stature_m"] else ""),
    ]
    if s["iterations"]:
        lines.append(f"{'converged after' if s['settled'] else 'stopped after'} {s['iterations']} iterations")
    return "\n".join([*lines, _left(s["segments"]), *_asked(s.get("suggest", []))])


def _asked(suggested: list[dict[str, Any]]) -> list[str]:
    return [f"frame {s['frame']:5d}  {s['joint']:<11} +- {s['sd_px']:.0f} px" for s in suggested]


def _left(segments: dict[str, Any]) -> str:
    """Describe the least certain displacements of segments."""
    modes = segments["least_certain"]
    each = []
    for mode in modes:
        moved = "the whole body" if mode["rigid"] > WHOLE_BODY_SHARE else " ".join(mode["joints"])
        each.append(f"{moved} {mode['sd_mm']:.0f} mm ({100 * mode['in_depth']:.0f} % in depth)")
    words = f"least certain in a single segment: {', '.join(each)}"
    unknown = modes[0]["sd_mm"] > UNKNOWN_MM
    return words + "; the first is the person's distance, which the view does not determine" * bool(unknown)


def _video_text(summary: dict[str, Any]) -> str:
    c, figure = summary["corrections"], summary["figure"]
    lines = [
        f"{summary['frames']} frames in {summary['segments']} segments, median sd {summary['sd_mm']:.0f} mm",
        f"{c['given']} corrections ({c['per_frame']:.2f} per frame), {c['needed']} of them more than "
        f"{c['within_px']:.0f} px from the estimate without corrections",
        f"{c['wanted']} more ({c['wanted_per_frame']:.2f} per frame) would bring every joint within "
        f"{c['within_px']:.0f} px",
        f"figure: stature {figure['stature_m']:.2f} m, {figure['residual_mm']:.0f} mm from the markers",
    ]
    return "\n".join([*lines, *_asked(summary["suggest"])])
