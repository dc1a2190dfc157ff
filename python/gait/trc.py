"""Write joints as TRC, the marker format of OpenSim."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from gait.files import replacing

Array = NDArray[np.float64]


def write_trc(
    path: str | os.PathLike[str], names: tuple[str, ...], times: Array, joints: Array, rate: float
) -> None:
    """Write joints (n, P, 3) in metres, z up, as OpenSim's y-up frame: x_trc = y, y_trc = z, z_trc = x.

    Parameters
    ----------
    path : path
    names : tuple of str
        The P joints.
    times : ndarray of shape (n,)
        Seconds.
    rate : float
        Frames per second.
    """
    count, markers = joints.shape[:2]
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{os.path.basename(path)}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:g}\t{rate:g}\t{count}\t{markers}\tm\t{rate:g}\t1\t{count}",
        "Frame#\tTime\t" + "".join(f"{name}\t\t\t" for name in names).rstrip("\t"),
        "\t\t" + "\t".join(f"{axis}{i + 1}" for i in range(markers) for axis in "XYZ"),
        "",
    ]
    turned = joints[..., [1, 2, 0]].reshape(count, -1)
    body = [
        f"{i + 1}\t{time:.6f}\t" + "\t".join(f"{value:.5f}" for value in row)
        for i, (time, row) in enumerate(zip(times, turned, strict=True))
    ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join([*head, *body, ""]), encoding="utf-8")
