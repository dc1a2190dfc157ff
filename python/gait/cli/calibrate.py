"""Calibrate the lens of a camera with a printed board.

Print the board (--print-board), mount it on something flat, and film it with the settings of the later
films: the same lens, size of picture and zoom, without stabilisation.  Move slowly; show the board in every
corner of the picture, tilted by 30 degrees to all four sides, near and far.  Half a minute is enough.  Either
the board or the camera may move.  The size of the board does not matter for the lens.

The command picks sharp frames of different poses, prints the reprojection error of the corners, and lists
missing poses.  It rejects an unreliable calibration.  LENS.json is a camera file without the camera's
position, which gait camera adds.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait.cli import values
from gait.errors import UsageError
from gait.io.files import replacing, require_outputs
from gait.progress import progress

if TYPE_CHECKING:
    from gait.camera.calibrating import Lens

PAPER_NAMES = ("a4", "letter", "a3")

EXAMPLES = """\
examples:
  gait calibrate --print-board board.pdf
  gait calibrate board.mp4 -o lens.json
  gait calibrate pictures/*.jpg --board 9x6 -o lens.json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("input", nargs="*", metavar="FILM|PICTURE", help="one film, or pictures of one size")
    parser.add_argument("-o", "--output", type=values.named(".json"), metavar="LENS.json", help="the lens")
    parser.add_argument(
        "--board",
        default="charuco",
        metavar="charuco|NxM",
        help="the printed board with markers (default), or the inner corners of a chessboard, as 9x6",
    )
    parser.add_argument(
        "--print-board",
        type=values.named(".pdf", ".png"),
        metavar="B.pdf|B.png",
        help="write the board to print, true to size",
    )
    parser.add_argument(
        "--paper", choices=PAPER_NAMES, default="a4", help="paper of --print-board, landscape (default: a4)"
    )


def run(args: argparse.Namespace) -> int:
    """Print the board, or calibrate and write the lens."""
    from gait.camera.board import read_board  # OpenCV

    if not args.print_board and not (args.input and args.output):
        raise UsageError("give a film or pictures and -o LENS.json, or --print-board B.pdf")
    try:
        board = read_board(args.board)
    except ValueError as error:
        raise UsageError(f"--board {error}") from None
    if args.print_board:
        if args.input or args.output:
            raise UsageError("--print-board: leave out the film and -o; calibrate when the board is printed")
        return _print(args, board)
    require_outputs((args.output,), tuple(args.input))
    lens = _calibrate(args, board)
    _write(args.output, lens)
    summary = _summary(lens)
    print(json.dumps(summary) if args.json else _text(args.output, summary))
    return 0


def _print(args: argparse.Namespace, board: Any) -> int:
    from gait.camera.board import print_board

    kind = Path(args.print_board).suffix.lower()
    require_outputs((args.print_board,), ())
    with replacing(args.print_board) as temporary:
        side = print_board(temporary, kind, board, args.paper)
    words = (
        f"{args.print_board}: {board}, {side:g} mm each, on {args.paper}; print it at 100 %, mount it flat"
    )
    print(json.dumps({"board": str(board), "square_mm": side, "paper": args.paper}) if args.json else words)
    return 0


def _calibrate(args: argparse.Namespace, board: Any) -> Lens:
    from gait.camera.calibrating import calibrate_film, calibrate_pictures
    from gait.io.video import Video

    kinds = {Path(path).suffix.lower() in values.PICTURES for path in args.input}
    if kinds == {True}:
        with progress("searching for the board", len(args.input), args.quiet) as update:
            return calibrate_pictures(args.input, board, update)
    if len(args.input) > 1:
        raise UsageError("give one film, or only pictures")
    video = Video(args.input[0])
    with progress("searching for the board", video.count, args.quiet) as update:
        return calibrate_film(video, board, update)


def _write(path: str, lens: Lens) -> None:
    from gait.camera.camera import write_lens

    note = f"gait calibrate: {len(lens.views)} pictures, {lens.rms:.2f} px rms"
    with replacing(path) as temporary:
        write_lens(temporary, lens.camera, note)


def _summary(lens: Lens) -> dict[str, Any]:
    """Return the figures of ``--json``."""
    camera = lens.camera
    return {
        "pictures": lens.tried,
        "used": len(lens.views),
        "blurred": lens.blurred,
        "left_out": list(lens.left_out),
        "rms_px": lens.rms,
        "error_px": {view.name: float(error) for view, error in zip(lens.views, lens.error, strict=True)},
        "size": list(camera.size),
        "focal_px": [camera.fx, camera.fy],
        "focal_sd_px": lens.focal_sd,
        "fov_deg": list(lens.fov),
        "middle_px": [camera.cx, camera.cy],
        "distortion": camera.distortion.tolist(),
        "missing": list(lens.missing),
    }


def _text(path: str, s: dict[str, Any]) -> str:
    width, height = s["size"]
    fx, fy = s["focal_px"]
    lines = [
        f"{s['used']} of {s['pictures']} pictures used"
        + (f", {s['blurred']} too blurred" if s["blurred"] else "")
        + (
            f"; ignored, because they do not fit the others: {', '.join(s['left_out'])}"
            if s["left_out"]
            else ""
        )
    ]
    names = [f"{Path(name).name} {error:.2f} px" for name, error in s["error_px"].items()]
    cell = max(map(len, names)) + 2
    columns = max(1, 100 // cell)
    for k in range(0, len(names), columns):
        lines.append("  " + "".join(f"{name:<{cell}}" for name in names[k : k + columns]).rstrip())
    lines += [
        f"{s['rms_px']:.2f} px rms in all",
        f"focal length {fx:.1f} x {fy:.1f} +- {s['focal_sd_px']:.1f} px, view {s['fov_deg'][0]:.1f} x "
        f"{s['fov_deg'][1]:.1f} degrees of {width}x{height}",
    ]
    lines += [f"more certain with: {words}" for words in s["missing"]]
    lines.append(f"next, place the camera: gait camera --page VIDEO --lens {path} -o camera.json")
    return "\n".join(lines)
