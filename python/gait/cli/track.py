"""Track a walking person in a video file.

Without --camera the camera is estimated from the walk, given the person's stature (see gait camera --walk).
The standard deviations in OUT.csv include its uncertainty.

The first state comes from --init: a JSON file with the person's position and phase, or auto.  auto fits a
second of walking to the detector's keypoints (or those of --keypoints), which also gives the phase and
distinguishes left from right.  If no keypoints fit, it compares a second of frames with the background, which
gives position, stature and heading but not the phase.  If the network did not run, and there is no background
or no person stands out against it, OpenCV's people detector is used, which is less accurate.  For a start
from images the person must be in full view, feet included.  Of several people, one who walks is preferred.  A
long shadow misplaces the start.

After a start without a phase the status is init for about a second, and then ambiguous until the images
decide between left and right.

The person is also tracked backwards from the start.  A lost person is searched for near the last position.
With keypoints the track resumes at the next second in which the same person walks; without them it starts
again with a person who walks in full view for a second (not with --smooth).

Several films of the same walk from static cameras locate the person much better than one.  OUT.csv has the
frames of the first film, which also gives the start; the nearest frames in time of the others are used.
Their time offsets are estimated from the person's motion unless --offsets gives them.

--people tracks several people, each with a separate tracker.  They are numbered from 1 in the order in which
they are in view longest and appear tallest: in the names of each person's files (OUT-1.csv, OUT-2.csv), in
the column person, in --json and above the heads in the overlay.  People found but not tracked have no number;
the command states when and where they are in view.  --height is the stature of the person in view longest and
tallest or, without --camera, of the first in that order whose walk determines the camera.

Without -m the film is tracked with the model walk, which knows only walking.  If the person seems to stand,
run or walk backwards for half a second, is tracking in less than half of the frames (in 3 s and more), or is
not found, it is tracked again with the model classes, which knows these motions too; but not without
keypoints.

--keypoints adds joints that a detector has found in the frames, in the formats that gait lift reads.  Joints
that the model does not have are ignored; frames may be missing.

OUT.csv has one row per frame: frame, time (s), status (init, tracking, ambiguous or lost), phase of the
stride (0 at the right heel strike), stride rate, heading, stature, speed; effective sample size, log
evidence; scores of the components; each joint's position in the world (_x _y _z, metres) and its standard
deviation (_sx _sy _sz); angles (_deg); standard deviations of phase, rate, heading, stature and scores.
"""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from gait.bindings.abi import MAX_CAMERAS, Mode
from gait.cli import values
from gait.errors import UsageError
from gait.io.files import require_outputs
from gait.track.options import KEYPOINTS_SD, ClipOptions

if TYPE_CHECKING:
    from gait.track.scene import Scene
    from gait.track.standing import Moved

EXAMPLES = """\
examples:
  gait track walk.mp4 --height 1.75 -o track.csv --camera-out camera.json
  gait track walk.mp4 --camera camera.json -o track.csv
  gait track walk.mp4 --camera camera.json --init init.json --background empty.png --height 1.75 \\
      -o track.csv --overlay overlay.mp4
  gait track walk.mp4 --camera camera.json -o track.csv --report run.html
  gait track walk.mp4 --camera camera.json --people all -o track.csv --overlay everyone.mp4
  gait track left.mp4 right.mp4 --camera calibration.toml -o track.csv
  gait track walk.mp4 --camera camera.json -o track.csv --smooth --draws draws.npz
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add = parser.add_argument
    add("video", nargs="+", metavar="VIDEO", help="any file that FFmpeg reads; several: see above")
    values.add_camera(
        parser,
        "; without it the camera is estimated from the walk, which needs --height; for several films one for "
        "each in their order (--camera A --camera B), or a TOML file with as many cameras",
        scale=True,
        several=True,
    )
    add(
        "--offsets",
        type=values.offsets,
        metavar="S[,S]",
        help="how many seconds after the first each further film began (default: estimated from the motion)",
    )
    values.add_fov(parser)
    add(
        "--camera-path",
        metavar="POSES.csv",
        help="poses of a moving camera: time or frame; r11 to r33, tx, ty, tz (world to camera) or x, y, z, "
        "qx, qy, qz, qw (camera to world); turn_sd_deg, place_sd_m if not exact; --camera gives its lens",
    )
    add(
        "--camera-out",
        type=values.named(".json"),
        metavar="CAM.json",
        help="also write the camera, estimated or given",
    )
    add(
        "--cameras-out",
        type=values.named(".csv"),
        metavar="CAMERAS.csv",
        help="also write the camera of each frame, if it moves",
    )
    add("-o", "--output", required=True, type=values.named(".csv"), metavar="OUT.csv", help="the track")
    default = "default: walk, then classes if that does not follow the person; in paper mode paper"
    values.add_model(parser, default=default)
    values.add_clip(parser, "track")
    add(
        "--body",
        metavar="BODY.json|auto",
        help="measurements of the person, instead of --height: stature_m, and any of leg_m, arm_m or "
        "their parts, hip_width_m, shoulder_width_m. auto: estimate where the person's joints are, from a "
        "first pass with several films, and with one by also lifting its keypoints, as gait lift does",
    )
    values.add_filter(parser, threads=1)
    values.add_seed(parser, "the random numbers")
    add(
        "--mode",
        choices=[m.name.lower() for m in Mode],
        default="default",
        help="set of settings (default: default)",
    )
    add(
        "--detector",
        choices=["auto", "full", "lite", "heavy", "none"],
        default="auto",
        help="network that detects joints, for the start and as a likelihood term (default: auto: full if "
        "downloaded)",
    )
    add(
        "--keypoints",
        "--tracks",
        metavar="KEYPOINTS",
        help="2-D joints found in the frames, used besides the images",
    )
    values.add_person(parser)
    add(
        "--people",
        type=_people,
        metavar="N|all",
        help="track several people: all who walk, or the N (up to 8) in view longest and tallest",
    )
    add(
        "--keypoints-sd",
        "--tracks-sd",
        type=values.positive,
        metavar="PX",
        help="standard deviation of keypoints at full confidence, including the difference between the "
        f"detector's joints and the model's, where the file does not give theirs (default: {KEYPOINTS_SD:g})",
    )
    add(
        "--stabilize",
        choices=["pans", "auto", "off"],
        default="pans",
        help="which motion of the camera is estimated: pans: turns by more than a tenth of the picture's "
        "width; auto: any; off: none. Joints are then in the scene's frame: that of the first frame if a "
        "camera is given, or else of the frame that the command names (default: pans)",
    )
    add(
        "--overlay",
        type=values.named(*values.FILMS),
        metavar="O.mp4",
        help="also draw the estimates into the video",
    )
    add(
        "--smooth",
        action="store_true",
        help="estimate each frame from the whole clip, including later frames",
    )
    add(
        "--draws",
        type=values.named(".npz"),
        metavar="D.npz",
        help="with --smooth: also write the sampled motions for gait report track",
    )
    add(
        "--report",
        type=values.named(*values.PAGES),
        metavar="R.html",
        help="also write a page with verdict, film, figure, gait and angles",
    )
    add("--trc", type=values.named(".trc"), metavar="O.trc", help="also write the joints for OpenSim (y up)")


def run(args: argparse.Namespace) -> int:
    """Track the clip and print a summary."""
    from gait.body.measured import MeasuredBody
    from gait.track.clip import track_clip
    from gait.track.people import numbered, track_people

    if args.stop is not None:
        values.require_order(args.start or 0, args.stop)
    if args.draws and not args.smooth:
        raise UsageError("--draws: needs --smooth")
    if args.keypoints_sd and not args.keypoints:
        raise UsageError("--keypoints-sd: needs --keypoints")
    if args.person and not args.keypoints:
        raise UsageError("--person: needs --keypoints")
    own_body = args.body == "auto"
    if own_body and args.mode == "paper":
        raise UsageError("--body auto: paper mode uses no keypoints; give a file, or leave out one of both")
    if own_body and args.detector == "none" and not args.keypoints:
        raise UsageError("--body auto: needs the detector or --keypoints; give a file, or leave it out")
    if own_body and (args.draws or args.camera_path or args.stabilize == "auto"):
        raise UsageError("--body auto: leave out --draws, --camera-path and --stabilize auto, or --body auto")
    if args.body and not own_body and args.height is not None:
        raise UsageError("--height: --body has the stature; leave out one of them")
    if args.people is not None:
        alone = {"--init": args.init != "auto", "--keypoints": args.keypoints, "--mode": args.mode == "paper"}
        alone |= {"--detector none": args.detector == "none"}
        for option, given in alone.items():
            if given:
                raise UsageError(f"--people: needs the detector to find everyone; leave out {option}")
        if args.body is not None:
            raise UsageError("--people: everyone has the model's body; leave out --body")
    films = args.video
    cameras = _cameras(args)
    file = None if own_body else args.body
    if not (args.camera or args.height or file):
        raise UsageError("give --camera CAM, or --height M to estimate the camera from the walk")
    if not args.camera and args.init != "auto":
        raise UsageError("--init: needs --camera, which defines its world")
    if args.camera_path and not args.camera:
        raise UsageError("--camera-path: needs --camera for the lens")
    if args.camera_path and args.stabilize == "auto":
        raise UsageError("--stabilize: estimates the poses that --camera-path gives; leave out one of them")
    if args.camera_path and args.background not in ("auto", "none"):
        raise UsageError("--background: an image needs a static camera; with --camera-path give auto or none")
    if args.scale_camera and not args.camera:
        raise UsageError("--scale-camera: needs --camera")
    if args.camera and args.fov:
        raise UsageError("--fov: is for an estimated camera; leave out --camera or --fov")
    of_each = (args.output, args.trc, args.draws, args.report)  # with --people, of each person
    require_outputs(
        (
            *of_each,
            *(numbered(path, k + 1) for k in range(args.people or 0) for path in of_each if path),
            args.camera_out,
            args.cameras_out,
            args.overlay,
        ),
        (
            *films,
            *cameras,
            args.model,
            args.camera_path,
            args.init,
            args.background,
            args.keypoints,
            file,
        ),
    )
    body = MeasuredBody.read(file) if file else None
    if args.report:
        import gait.report.run_page  # noqa: F401  so that a missing package is reported before long work

    apart = ("model_reason", "further", "own_body")
    given = {name: getattr(args, name) for name in ClipOptions.__dataclass_fields__ if name not in apart}
    given |= {
        "own_body": own_body,
        "mode": Mode[args.mode.upper()],
        "keypoints_sd": args.keypoints_sd or KEYPOINTS_SD,
    }
    given |= {"body": body, "height": args.height if body is None else body.stature}
    given |= {"video": films[0], "camera": cameras[0] if cameras else None}
    given["further"] = tuple(zip(films[1:], cameras[1:], strict=True)) if films[1:] else ()
    if args.people is None:
        summary = track_clip(ClipOptions(**given), _half_lifted if own_body and len(films) == 1 else None)
        text = _text
    else:
        summary = track_people(ClipOptions(**given))
        text = _text_of_people
    print(json.dumps(summary) if args.json else text(summary))
    return 0 if summary["followed"] else 1


def _half_lifted(options: ClipOptions, scene: Scene) -> Moved:
    from gait.lift.tracked import half_lifted

    return half_lifted(options, scene)


def _cameras(args: argparse.Namespace) -> list[str]:
    """Return the camera file of each film; empty if the camera is to be estimated."""
    films = len(args.video)
    if films > MAX_CAMERAS:
        raise UsageError(f"{films} films; give at most {MAX_CAMERAS}")
    if films == 1:
        camera = values.camera_of(args.camera, args.offsets)
        return [camera] if camera else []
    alone = {
        "--people": args.people, "--keypoints": args.keypoints, "--camera-path": args.camera_path,
        "--stabilize": args.stabilize == "auto", "--cameras-out": args.cameras_out,
        "--draws": args.draws,  # of the model's body, not of the joints that several cameras measure
        "--background with a file": args.background not in ("auto", "none"),
    }  # fmt: skip
    for option, given in alone.items():
        if given:
            raise UsageError(f"{option}: is for one film; leave it out, or track one film")
    return values.cameras_of(args.camera, args.offsets, args.video)


def _people(text: str) -> int:
    """Parse the largest number of people to track."""
    most = 8
    if text == "all":
        return most
    if text.isdecimal() and 1 <= int(text) <= most:
        return int(text)
    raise argparse.ArgumentTypeError(f"{text!r} is neither all nor a number from 1 to {most}")


def _text_of_people(summary: dict[str, Any]) -> str:
    lines = []
    for number, one in summary["people"].items():
        lines.append(f"person {number}: {one['verdict']}; model {one['used']['model']}.")
        if one["warning"]:
            lines.append(f"warning: {one['warning']}")
        lines.append(f"  written: {', '.join(f'{what} {path}' for what, path in one['files'].items())}")
    lines += [f"written: {what} {path}" for what, path in summary["files"].items()]
    lines += summary["others"]
    return "\n".join(lines)


def _text(summary: dict[str, Any]) -> str:
    step, threads = summary["step_ms"], summary["threads"]
    lines = [
        f"{summary['particles']} particles, {threads} thread{'s' if threads > 1 else ''}, "
        f"{summary['memory_bytes']} bytes, digest {summary['digest']}",
        f"step {step['median']:.1f} ms median, {step['p99']:.1f} ms p99, {step['max']:.1f} ms max; "
        f"{summary['wall_fps']:.1f} frames/s in all",
    ]
    lines += [f"{name}: {words}" for name, words in summary["used"].items()]
    lines += [f"written: {', '.join(f'{what} {path}' for what, path in summary['files'].items())}"]
    lines += [f"note: {words}" for words in summary["notes"]]
    if summary["warning"]:
        lines.append(f"warning: {summary['warning']}")
    return "\n".join([*lines, summary["statuses"], f"{summary['verdict']}."])
