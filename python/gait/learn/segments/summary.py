"""Summarise a segment prior in figures and in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from gait.bindings.segment_prior import SegmentPrior
from gait.counts import count_of

VARIANCE_SHARE = 0.91  # of the variance, as in the paper's figure 3


def summary(prior: SegmentPrior) -> dict[str, Any]:
    """Return the figures of the prior."""
    return {
        "recordings": prior.recordings,
        "segments": prior.segments,
        "frames": prior.frames,
        "hop": prior.hop,
        "fps": prior.fps,
        "markers": list(prior.names),
        "headings": prior.headings,
        "components": prior.components,
        "weights": np.round(prior.weights, 4).tolist(),
        "modes": prior.size,
        f"modes_for_{100 * VARIANCE_SHARE:.0f}_percent": modes_for(prior, VARIANCE_SHARE),
        "variance_explained": round(float(prior.explained()[-1]), 4),
        "gamma": round(prior.gamma, 3),
        "stature_m": round(prior.stature, 3),
    }


def modes_for(prior: SegmentPrior, share: float) -> int | None:
    """Return how many modes explain a share of the variance; None if all do not."""
    enough = np.flatnonzero(prior.explained() >= share)
    return int(enough[0]) + 1 if len(enough) else None


def text(s: dict[str, Any]) -> str:
    """Format the figures in one line."""
    turned = "" if not s["headings"] else f", {s['headings']} headings"
    mixed = "" if s["components"] == 1 else f", {s['components']} Gaussians"
    return (
        f"segment prior: {s['segments']} segments of {s['frames']} frames at {s['fps']:g}/s from "
        f"{count_of(s['recordings'], 'recording')}, {len(s['markers'])} markers{turned}{mixed}; "
        f"{s['modes']} modes explain {100 * s['variance_explained']:.1f} % of the variance, "
        f"gamma {s['gamma']:.2f}"
    )


def lines(s: dict[str, Any]) -> list[str]:
    """Format the figures and the names of the markers for people."""
    heading = "latent" if not s["headings"] else f"{s['headings']} in the prior"
    enough = s[f"modes_for_{100 * VARIANCE_SHARE:.0f}_percent"]
    needed = f", {enough} modes explain {100 * VARIANCE_SHARE:.0f} %" if enough else ""
    return [text(s) + needed, f"heading {heading}; markers: {' '.join(s['markers'])}"]
