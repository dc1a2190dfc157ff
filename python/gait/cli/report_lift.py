"""Draw figures of the segment prior and of its estimates in one view, after Leventon and Freeman (1998).

Writes into DIR: report.html (self-contained) and the figures as PNG.  spectrum: variances of the modes
before and after an observation (fig. 3); synthesis: a segment from 40 modes (2); draws from the prior (4);
estimates: original, projection, likelihood only, Bayes (5); the least certain displacements (6); and a lifted
clip (7) if --clip gives its 2-D keypoints.  The segment is the one with the most motion of --mocap, which
should not be a recording that the model was learnt from; without --mocap, a draw from the prior.
"""

from __future__ import annotations

import argparse
import html
import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gait.cli import values
from gait.errors import UsageError, UserError
from gait.io.files import filling, require_folder
from gait.learn.options import SegmentOptions
from gait.lift.smooth.options import METHODS, Options
from gait.progress import note, progress

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from gait.bindings.segment_prior import SegmentPrior
    from gait.io.keypoints_file import Keypoints
    from gait.learn.segments import motion as segment_motion
    from gait.lift.report.segment_figures import Case
    from gait.lift.segment.view import View
    from gait.lift.smooth.motion import Motion
    from gait.report.figures import Drawing

    Floats = npt.NDArray[np.float64]

EXAMPLES = """\
examples:
  gait report lift -o figures
  gait report lift --mocap walk_01.bvh --clip keypoints.csv --camera camera.json -o figures
"""

FIGURES = 5  # without that of a clip
_FROM = "Mean distance of the markers from their true positions"
_WORDS = {
    "mean_mm": ("error of the mean motion", " mm", f"{_FROM}, without using the view."),
    "likelihood_mm": (
        "error of the likelihood alone",
        " mm",
        f"{_FROM}, by least squares without the prior.",
    ),
    "bayes_mm": ("error of the Bayesian estimate", " mm", f"{_FROM}, from the view and the prior."),
    "log10_volume_ratio": (
        "volume of the posterior over the prior, log10",
        "",
        "How much the view restricts the motion: -3 means to a thousandth.",
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "-m", "--model", metavar="M.gait", help="model with a segment prior (default: the shipped one)"
    )
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for page and figures")
    parser.add_argument(
        "--mocap",
        metavar="FILE",
        help="recording (.amc .bvh .c3d .trc .csv) to view (default: a draw from the prior)",
    )
    parser.add_argument("--clip", metavar="KEYPOINTS.csv", help="2-D keypoints of a clip, as for gait lift")
    parser.add_argument(
        "--camera", metavar="CAM", help="the clip's calibration (default: a level view from far away)"
    )
    parser.add_argument(
        "--method", choices=METHODS, help=f"how the clip is lifted, as in gait lift (default: {METHODS[0]})"
    )
    values.add_seed(parser, "noise and draws")


def run(args: argparse.Namespace) -> int:
    """Draw the figures, write the page, and print the numbers."""
    from gait.bindings.segment_prior import SegmentPrior
    from gait.lift.report.segment_figures import case
    from gait.report.page import Page

    if args.camera and not args.clip:
        raise UsageError("--camera is for a clip; give its keypoints with --clip")
    if args.method and not args.clip:
        raise UsageError("--method is for a clip; give its keypoints with --clip")
    require_folder(args.output)
    prior = SegmentPrior.load(args.model)
    lifted = _clip(args, prior) if args.clip else None
    segment = _segment(args.mocap, prior) if args.mocap else None
    truth, stature = segment or (None, prior.stature)
    what = f"a segment of {Path(args.mocap).name}" if args.mocap else "a draw from the prior"
    shown = case(args.model, truth, stature, what, args.seed)
    page = Page(f"{Path(args.model).name if args.model else 'Shipped model'}: segments of motion")
    page.table("Prior", _facts(prior))
    figures = _figures(shown)
    worded = {_WORDS[key][0]: f"{value:.4g}{_WORDS[key][1]}" for key, value in figures.items()}
    page.table(
        "Estimates of the segment from one view", worded, {_WORDS[k][0]: _WORDS[k][2] for k in figures}
    )
    with filling(args.output) as folder, progress("figures", FIGURES + bool(lifted), args.quiet) as update:
        for done, drawing in enumerate(_drawings(args, shown, lifted), 1):
            page.figure(drawing.heading, _written(folder, drawing))
            update(done)
        (folder / "report.html").write_text(page.text(), encoding="utf-8")
    print(json.dumps(figures) if args.json else "\n".join(f"{k}: {v}" for k, v in worded.items()))
    return 0


def _clip(args: argparse.Namespace, prior: SegmentPrior) -> tuple[Keypoints, Motion, View]:
    """Lift the clip's keypoints as `gait lift` does."""
    from gait.lift import run as lift_run

    request = lift_run.Request(
        Options(args.method or METHODS[0]), camera=args.camera, ignore_unknown=True, hints=False
    )
    found = lift_run.lift_file(args.clip, prior, request, partial(note, quiet=args.quiet), args.quiet)
    return found.keypoints, found.motion, found.view.alone()


def _drawings(
    args: argparse.Namespace, shown: Case, lifted: tuple[Keypoints, Motion, View] | None
) -> Iterator[Drawing]:
    from gait.lift.report import motion_figures
    from gait.lift.report.segment_figures import drawings

    yield from drawings(shown, args.seed)
    if lifted:
        yield motion_figures.clip(*lifted, Path(args.clip).name)


def _segment(path: str, prior: SegmentPrior) -> tuple[Floats, float]:
    """Return the segment (F, J, 3) of a recording with the most motion, and the stature; metres."""
    import numpy as np

    from gait.learn.segments import corpus as segment_corpus
    from gait.learn.segments import motion as segment_motion
    from gait.learn.segments.corpus import Corpus
    from gait.learn.solve import readers

    wanted = SegmentOptions(source="only", frames=prior.frames, hop=prior.hop, fps=prior.fps, people=False)
    read = segment_motion.of(Path(path), readers.read(Path(path)), wanted)
    unknown = [name for name in prior.names if name not in read.names]
    if unknown:
        raise UserError(
            f"{path}: has no marker {unknown[0]!r} of the model's prior; choose another recording"
        )
    with Corpus() as corpus:
        corpus.put(Path(path).stem, "", Path(path), read)
        cut = segment_corpus.segments(corpus.recordings()[0], prior.names, wanted)
    cut = cut[np.isfinite(cut).all(axis=(1, 2, 3))]
    if not len(cut):
        raise UserError(f"{path}: {_why_no_segment(read, prior)}; choose another recording")
    stature = read.stature if np.isfinite(read.stature) else prior.stature
    return cut[cut.var(axis=1).sum(axis=(1, 2)).argmax()] * stature, stature


def _why_no_segment(read: segment_motion.Motion, prior: SegmentPrior) -> str:
    """Explain why a recording has no segment with all markers of a prior."""
    import numpy as np

    wanted = prior.frames / prior.fps
    if len(read.places) < prior.frames:
        return f"lasts {len(read.places) / prior.fps:.2g} s, a segment of the model {wanted:g} s"
    observed = np.asarray(np.isfinite(read.places).all(axis=2))
    absent = [name for name in prior.names if not observed[:, read.names.index(name)].any()]
    if absent:
        return f"never shows {' '.join(absent)}, which the model's prior has"
    return f"has gaps in every {wanted:g} s, the length of the model's segments"


def _written(folder: Path, drawing: Drawing) -> str:
    """Write a figure as PNG; return its part of the page."""
    caption, data = html.escape(drawing.caption), drawing.write(folder)
    return f'<p>{caption}</p><img style="max-width: 100%" alt="{caption}" src="{data}">'


def _facts(prior: SegmentPrior) -> dict[str, str]:
    return {
        "markers": f"{len(prior.names)}",
        "segment": f"{prior.frames} frames at {prior.fps:g} per second",
        "learnt from": f"{prior.segments} segments of {prior.recordings} recordings",
        "modes": f"{prior.size}" + (f" of each of {prior.components}" if prior.components > 1 else ""),
        "headings": "unknown" if prior.headings == 0 else f"{prior.headings} copies in the world's axes",
        "inflation of the variance outside the modes": f"{prior.gamma:.2f}",
    }


def _figures(c: Case) -> dict[str, Any]:
    """Return the figures of ``--json``: errors in mm per marker."""
    import numpy as np

    def apart(found: Floats) -> float:
        return 1000 * float(np.linalg.norm(found - c.truth, axis=2).mean())

    return {
        "mean_mm": apart(c.gaussian.mean),
        "likelihood_mm": apart(c.likelihood),
        "bayes_mm": apart(c.bayes),
        "log10_volume_ratio": c.log10_volume,
    }
