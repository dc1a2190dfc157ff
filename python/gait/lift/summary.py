"""Figures of a motion lifted from keypoints, as ``gait lift --json`` prints them."""

from __future__ import annotations

from typing import Any

import numpy as np

from gait.lift.run import Lifted
from gait.lift.segment.explain import Uncertain

MOVED = 3  # joints listed for a displacement, those that it moves most


def summary(lifted: Lifted) -> dict[str, Any]:
    """Return the figures by name; lengths in the unit that ends the name."""
    keypoints, found = lifted.keypoints, lifted.motion
    return {
        "frames": len(keypoints.frame),
        "method": lifted.options.method,
        "markers": {"visible": list(dict.fromkeys(keypoints.names)), "estimated": list(found.names)},
        "visible_share": float(keypoints.visible.mean()),
        "reprojection_px": float(np.nanmedian(found.error)),
        "sd_mm": 1000 * float(np.median(found.sd)),
        "stature_m": found.stature if found.steps else None,  # methods of single segments do not estimate it
        "iterations": found.steps,
        "settled": found.settled,
        "log10_volume_ratio": found.log_volume_ratio,
        "segments": least_certain(found.uncertain, found.names),
        "chi2_per_observation": chi2 if np.isfinite(chi2 := found.chi2_per_observation) else None,
        "prior_widened": found.wider,
        "segments_alone": found.alone,
        "outliers": 0 if found.outliers is None else int(found.outliers.sum()),
        "resized": found.resized,
        **lifted.repairs,
        "pixel_sd": lifted.options.pixel_sd,
    }


def least_certain(left: Uncertain, names: tuple[str, ...]) -> dict[str, Any]:
    """Return medians over single segments: volume, least certain displacements, joints these move most."""
    most = np.argsort(-left.shares, axis=1, kind="stable")[:, :MOVED]
    figures = {
        "sd_mm": (1000 * left.sd).tolist(),
        "in_depth": left.along.tolist(),
        "rigid": left.rigid.tolist(),
        "joints": [[names[j] for j in row] for row in most],
    }
    each = [dict(zip(figures, values, strict=True)) for values in zip(*figures.values(), strict=True)]
    return {"log10_volume_ratio": left.log10_volume, "least_certain": each}
