"""Print what a model contains: source, sizes, statistics, checksum, and the acknowledgement it requires."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from typing import Any

from gait.counts import count_of

GAIT_KEYS = (
    "stride_hz", "stride_hz_sd", "stride_time_cv", "stride_length", "stride_length_sd", "fps", "stature_m",
    "stature_sd_m",
)  # fmt: skip
"""Names of the numbers of section GAIT."""

EXAMPLES = """\
examples:
  gait info model.gait
  gait info model.gait --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "model",
        metavar="M.gait",
        help="model written by gait learn, or walk, classes or paper of the package",
    )


def run(args: argparse.Namespace) -> int:
    """Read the model and print its description."""
    from gait.bindings.model import read_blob
    from gait.io import blob

    data = read_blob(args.model)
    summary = describe(blob.decode(data, args.model), len(data), blob.checksum(data), args.model)
    print(json.dumps(summary) if args.json else text(args.model, summary))
    return 0


def describe(sections: Mapping[str, Any], size: int, crc: int, name: str = "blob") -> dict[str, Any]:
    """Return the figures of a model, which errors call `name`; missing sections give no entry."""
    import numpy as np

    from gait.bindings.segment_prior import TAGS, SegmentPrior
    from gait.body.model_curves import slope_of
    from gait.io import blob
    from gait.learn.report import classes
    from gait.learn.segments import summary as segment_summary

    result: dict[str, Any] = {
        "bytes": size,
        "crc32": f"{crc:08x}",
        "sections": {tag: list(array.shape) for tag, array in sections.items()},
    }
    for key, tag in (("channels", "CHNM"), ("frames", "FRNM"), ("joints", "PTNM"), ("limbs", "LBNM")):
        if tag in sections:
            result[key] = blob.unpack_names(sections[tag])
    if "CURV" in sections:
        slope_of(sections, name)  # raises UserError if no tracker could use it
        result |= {"components": len(sections["CURV"]) - 1, "phases": sections["CURV"].shape[1]}
    if "GAIT" in sections:
        result["gait"] = dict(
            zip(GAIT_KEYS, np.round(sections["GAIT"].astype(float), 4).tolist(), strict=False)
        )
    if "SCST" in sections:
        result["scores"] = np.round(sections["SCST"].astype(float), 4).tolist()
    if "META" in sections:
        result["meta"] = blob.read_meta(sections, name)
    if found := classes.figures(sections):
        result["classes"] = found
    if any(tag in sections for tag in TAGS):
        result["segments"] = segment_summary.summary(SegmentPrior.from_sections(sections, name))
    return result


def text(name: str, s: Mapping[str, Any]) -> str:
    """Format the figures for people."""
    from gait.learn.report import classes
    from gait.learn.segments import summary as segment_summary

    meta, gait = s.get("meta", {}), s.get("gait", {})
    lines = [f"{name}: {s['bytes']} bytes, checksum {s['crc32']}"]
    if "generator" in meta:
        lines.append(f"{meta.get('activity')} by {meta['generator']}, seed {meta.get('seed')}")
    if "components" in s:
        counts = ", ".join(
            f"{len(s[key])} {key}" for key in ("channels", "frames", "joints", "limbs") if key in s
        )
        lines.append(f"{count_of(s['components'], 'component')}, {s['phases']} phases, {counts}")
    if gait:
        lines += [
            "{stride_hz:.3f} +- {stride_hz_sd:.3f} strides/s, varying by {stride_time_cv:.1%}".format(**gait)
            + (", on which the mean cycle depends" if "PACE" in s["sections"] else ""),
            "stride length {stride_length:.3f} +- {stride_length_sd:.3f} statures".format(**gait),
        ]
    if "sequences" in meta:
        lines += sequence_lines(meta["sequences"]["rows"])
        more = meta["sequences"]["count"] - len(meta["sequences"]["rows"])
        lines += [f"and {more} more"] if more > 0 else []
    if meta.get("unobserved"):
        lines.append("never observed, in the rest pose: " + " ".join(meta["unobserved"]))
    if "variance_explained" in meta:
        shares = meta["variance_explained"][: s.get("components")]
        lines.append("variance explained: " + " ".join(f"{100 * v:.1f}" for v in shares) + " %")
    if "sides_alike" in meta:
        lines.append(f"lasting angles of left and right leg: correlation {meta['sides_alike']:.2f}")
    lines += [classes.line(one) for one in s.get("classes", [])]
    if "segments" in s:
        lines += segment_summary.lines(s["segments"])
    if "acknowledgement" in meta:
        lines.append(meta["acknowledgement"])
    lines += meta.get("credits", [])
    return "\n".join(lines)


def sequence_lines(rows: list[list[Any]]) -> list[str]:
    """Format a table of sequences, rows of gait.learn.prior.model.SEQUENCE_COLUMNS."""
    wide = max([11, *(len(row[0]) for row in rows)]) + 1
    lines = [f"{'sequence':{wide}}{'period':>9}{'cycles':>8}{'sharpness':>11}{'residual':>10}"]
    for name, period, cycles, sharpness, residual in rows:
        rest = "-" if residual is None else f"{residual:.1f} deg"
        lines.append(f"{name:{wide}}{period:>6} ms{cycles:>8.1f}{sharpness:>11.0f}{rest:>10}")
    return lines
