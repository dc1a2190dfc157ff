"""Draw a pose of a walking model, or all its components.

Without --strip: one person at --phase or in the state of --state, seen by --camera or by a built-in one.
With --strip: a sheet with the mean cycle and each principal component at -2, 0 and +2 standard deviations
at eight phases, from the right side.  --class chooses one of the model's classes of motion.

The JSON of --state may have phase, stride_hz, stature, heading, pitch, roll (radians), pelvis [x, y, z] and
coef [c1, c2, ...].  Missing values are those of the average person, standing on the ground at the origin.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from gait.cli import values
from gait.errors import UserError
from gait.io.files import replacing, require_outputs

if TYPE_CHECKING:
    from gait.bindings.model import Model
    from gait.bindings.state import State

JSON = False

EXAMPLES = """\
examples:
  gait render --phase 0.25 -o pose.png
  gait render -m model.gait --strip -o model.png
  gait render -m classes --class run --strip -o run.png
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    values.add_model(parser)
    parser.add_argument(
        "-o",
        "--output",
        required=True,
        type=values.named(*values.PICTURES),
        metavar="OUT.png",
        help="the picture",
    )
    values.add_camera(parser, " (default: a built-in view)")
    add = parser.add_mutually_exclusive_group().add_argument
    share = values.between(0, 1, "a share of the stride")
    add("--phase", type=share, metavar="P", help="phase of the stride; 0 (default) is the right heel strike")
    add("--state", metavar="JSON", help="file with the whole state")
    add("--strip", action="store_true", help="draw the sheet of all components")
    parser.add_argument(
        "--class", dest="motion_class", metavar="NAME", help="class of motion (default: the model's first)"
    )


def run(args: argparse.Namespace) -> int:
    """Draw the picture and write it."""
    from gait.bindings.model import Model
    from gait.camera.camera import Camera
    from gait.io.video import write_picture
    from gait.report.drawing import default_view, draw_sheet, draw_standing

    require_outputs((args.output,), (args.model, args.camera, args.state))
    model = Model(args.model)
    if args.motion_class not in (None, *model.classes):
        names = ", ".join(model.classes)
        raise UserError(f"--class {args.motion_class}: the model has no such class; give one of {names}")
    motion_class = model.classes.index(args.motion_class) if args.motion_class else 0
    if args.strip:
        if args.camera:
            raise UserError("--camera: --strip has its own view; leave out one of them")
        picture = draw_sheet(model, motion_class)
    else:
        state = _state(args, model, motion_class)
        camera = Camera.read(args.camera) if args.camera else default_view(state)
        picture = draw_standing(model, state, camera)
    with replacing(args.output) as temporary:
        write_picture(temporary, picture)
    return 0


def _state(args: argparse.Namespace, model: Model, motion_class: int) -> State:
    """Make the state from --phase or --state, on the ground at the origin unless it has a position."""
    from gait.bindings.state import POSE_SCALARS, State, state_range
    from gait.io.fields import Fields, read_json

    info = model.class_info(motion_class)
    state = State(stride_hz=info.stride_hz, motion_class=motion_class)
    if args.phase is not None:
        state.phase = args.phase % 1.0
    fields = read_json(args.state, "state") if args.state else Fields("state", {})
    fields.only((*POSE_SCALARS, "pelvis", "coef"))
    for name in POSE_SCALARS:
        if name in fields:
            setattr(state, name, fields.number(name, *state_range(name), "see gait render --help"))
    if "coef" in fields:
        remedy = "give a list of scores in standard deviations"
        count = fields.count("coef", remedy)
        if count > info.components:
            raise fields.fail("coef", f"has {count} scores", f"the model has {info.components} components")
        state.coef = fields.array("coef", (count,), remedy)
    state.pelvis[2] = model.pelvis_height(state)
    if "pelvis" in fields:
        state.pelvis = fields.array("pelvis", (3,), "give x, y, z in metres")
    return state
