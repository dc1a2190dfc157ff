"""Make a test clip of a walking person, with ground truth.

Writes into DIR: video.mp4, background.png (the empty scene; for a moving camera poses.csv instead, for gait
track --camera-path), camera.json, truth.csv (joints in metres and pixels), init.json (the truth at frame 0
with some error, to start a tracker), meta.json (heel strikes, stature and how the clip was made) and
contact.jpg; for further people truth_2.csv, init_2.json, meta_2.json and so on; for further cameras
video_2.mp4, background_2.png, camera_2.json and so on (pixels in truth.csv are those of the first).  The same
options and seed give the same pictures.

presets (other options change them; the defaults below are those of demo):
  demo     side view, left to right, 4 s
  side     side view, right to left, the exposure flickers by 1 %
  oblique  at 45 degrees, coming nearer
  toward   5 s straight towards the camera
  pole     at 45 degrees, a pole hides the person for a while, strong background
  stopping, standing, backwards, turning
           at 45 degrees (turning: side view): walks, stops and walks on; stands; walks backwards; turns a
           corner
  slow, fast, limping, stick, crutches
           0.6 m/s from the side; 1.9 m/s; spares the left leg; walks with a stick or with forearm crutches
  running, accelerating
           from the side, like the runners of the package's model; walks and begins to run
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import fields, replace
from functools import partial
from typing import Any

from gait.progress import progress
from gait.simulate.scenario import (
    AIDS,
    BODIES,
    COMPANY,
    DIRECTIONS,
    GENERATOR,
    MOST_CAMERAS,
    MOTIONS,
    MOVING,
    PRESETS,
    VIEWS,
    Scenario,
)

EXAMPLES = """\
examples:
  gait simulate -o walk
  gait simulate -o follow --moving follow
  gait simulate -o two --cameras 2
  gait simulate -o meet --people crossing --view oblique
  gait simulate -o walk --preset pole --seed 7 --stature 1.68 --size 1280x720
  gait simulate -o walk --preset stick --body drawn
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options; those not given come from the preset."""
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for the clip")
    parser.add_argument(
        "--preset", choices=PRESETS, default="demo", help="scenario to start from (default: demo)"
    )
    add = partial(_add, parser)
    add("--view", choices=VIEWS, help="direction of view")
    add("--direction", choices=DIRECTIONS, help="walk left to right (lr) or right to left (rl)")
    add(
        "--motion",
        choices=MOTIONS,
        help="stop: walk, stop, stand and walk on; turn: turn a corner; run: as in --gait, or like the "
        "package's runners; accelerate: walk and begin to run",
    )
    add(
        "--asymmetry",
        type=float,
        metavar="PCT",
        help="how much the left leg (negative: the right) is spared, as with a prosthesis, per cent",
    )
    add("--aid", choices=AIDS, help="walk with a stick or with forearm crutches")
    add(
        "--body",
        choices=BODIES,
        help="table: textbook proportions, varied at random; drawn: those of the people that the model was "
        "learnt from",
    )
    add(
        "--moving",
        choices=MOVING,
        help="follow: a robot follows the person, 1 m behind, whatever the --view; pan: the camera turns to "
        "them; shake: it is hand-held",
    )
    add(
        "--people",
        choices=COMPANY,
        help="a second person comes the other way, three walk abreast, or a faster person overtakes; "
        "--stature, --speed, --asymmetry and --aid are those of the first",
    )
    add(
        "--cameras",
        type=int,
        metavar="N",
        help=f"film with several cameras at once, up to {MOST_CAMERAS}: video_2.mp4, camera_2.json and so on",
    )
    add("--frames", type=int, metavar="N", help="number of frames")
    add("--fps", type=float, metavar="HZ", help="frames per second")
    add("--size", type=_size, metavar="WxH", help="pixels, even")
    add("--stature", type=float, metavar="M", help="of the person, metres")
    add("--speed", type=float, metavar="M_S", help="metres per second")
    add("--stride-hz", type=float, metavar="HZ", help="strides (two steps) per second")
    add("--distance", type=float, metavar="M", help="camera to the middle of the path, metres")
    add("--camera-height", type=float, metavar="M", help="camera above the ground, metres")
    add("--seed", type=int, metavar="S", help="seed for person, clothes, gait, scene and noise")
    add("--pole", action="store_true", default=None, help="put a pole in front of the path")
    add("--clutter", action="store_true", default=None, help="use a busier background")
    add("--flicker", type=float, metavar="PCT", help="standard deviation of the exposure, per cent")
    add("--noise", type=float, metavar="SIGMA", help="sensor noise, grey levels")
    add(
        "--gait",
        "--model",
        metavar=f"M.gait|{GENERATOR}",
        help="walk like a model, or with a normative gait",
    )


def _add(parser: argparse.ArgumentParser, option: str, *more: str, help: str, **settings: Any) -> None:
    """Add an option of a scenario; its help ends with the value in the preset demo."""
    value = getattr(PRESETS["demo"], option.removeprefix("--").replace("-", "_"))
    if isinstance(value, tuple):
        value = "x".join(map(str, value))
    elif isinstance(value, float):
        value = f"{value:g}"
    default = "" if isinstance(value, bool) else f" (default: {value or 'by the seed'})"
    parser.add_argument(option, *more, help=help + default, **settings)


def run(args: argparse.Namespace) -> int:
    """Make the clip and print what it shows."""
    from gait.simulate.clip import files, simulate

    scenario = replace(PRESETS[args.preset], **_given(args))
    begun = time.perf_counter()
    with progress("rendering", scenario.frames * scenario.cameras, args.quiet) as update:
        meta = simulate(scenario, args.output, update)
    summary = {
        "frames": scenario.frames,
        "view": scenario.view,
        "moving": scenario.moving,
        "people": 1 + COMPANY[scenario.people],
        "seed": scenario.seed,
        "stature_m": meta["stature_m"],
        "speed_m_s": meta["mean_speed_m_s"],
        "stride_hz": round(1 / meta["stride_period_s"], 4),
        "person_px": meta["person_height_px"],
        "seconds": round(time.perf_counter() - begun, 2),
    }
    print(
        json.dumps(summary | {"files": list(files(scenario))}) if args.json else _text(summary, args.output)
    )
    return 0


def _given(args: argparse.Namespace) -> dict[str, Any]:
    """Return the options of a scenario that are on the command line."""
    values = {field.name: getattr(args, field.name) for field in fields(Scenario)}
    return {name: value for name, value in values.items() if value is not None}


def _text(summary: dict[str, Any], folder: str) -> str:
    low, middle, high = summary["person_px"]
    view = {
        "follow": "from a robot that follows behind",
        "pan": f"{summary['view']} view from a camera that pans",
        "shake": f"{summary['view']} view from a hand-held camera",
    }.get(summary["moving"], f"{summary['view']} view")
    people = summary["people"]
    who = "a person of" if people == 1 else f"{people} people, the first of"
    return (
        f"{folder}: {summary['frames']} frames, {view}, {who} "
        f"{summary['stature_m']:.2f} m and {middle} ({low}-{high}) pixels at "
        f"{summary['speed_m_s']:.2f} m/s, {summary['stride_hz']:.2f} strides/s"
    )


def _size(text: str) -> tuple[int, int]:
    """Parse WIDTHxHEIGHT."""
    width, _, height = text.lower().partition("x")
    try:
        return int(width), int(height)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, such as 640x480") from None
