"""What a run left behind: estimates with their times, read back from an LCM log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lcm
import numpy as np
from numpy.typing import NDArray

from gait.bindings.estimate import Estimate
from gait.errors import UserError
from gait.lcm.log import break_of
from gait.lcm.messages import estimate_after, estimate_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """The estimates of one stream, n of them.

    Attributes
    ----------
    frame : ndarray of int, shape (n,)
        Numbers at the source, increasing.
    seconds : ndarray of shape (n,)
        Capture time since the first estimate.
    estimates : list of Estimate
    step_ms : ndarray of shape (n,)
        Time the tracker spent on the frame.
    latency_ms : ndarray of shape (n,)
        From capture to the arrival of the estimate in the log.
    dropped : int
        Frames captured and never tracked.
    tracker_digest : int
        After the last frame, unsigned.
    remark : str or None
        What the log holds beyond that.
    """

    frame: NDArray[np.int64]
    seconds: Array
    estimates: list[Estimate]
    step_ms: Array
    latency_ms: Array
    dropped: int
    tracker_digest: int
    remark: str | None = None


def read_run(path: str) -> Run:
    """Read the ``GAIT_ESTIMATE`` messages of a log of ``gait record --log`` or ``lcm-logger``.

    Only the first stream counts: a frame number that does not increase begins another.
    """
    if not Path(path).is_file():
        raise UserError(f"{path}: no such LCM log; make one with gait record --log or lcm-logger")
    messages: list[Any] = []
    remark, damage = None, None
    arrived: list[int] = []
    for event in lcm.EventLog(path, "r"):
        if event.channel != "GAIT_ESTIMATE":
            continue
        try:
            message = estimate_after(event.data, path, messages[0] if messages else None)
        except UserError as fault:
            damage = damage or f"a message is left out: {fault}"
            continue
        if messages and message.frame <= messages[-1].frame:
            remark = f"another stream begins with frame {message.frame}; only the first is used"
            break
        messages.append(message)
        arrived.append(event.timestamp)
    if not messages:
        why = damage or break_of(path) or "record while gait-trackd is tracking"
        raise UserError(f"{path}: holds no GAIT_ESTIMATE message; {why}")
    utime = np.array([m.utime for m in messages], np.int64)
    return Run(
        frame=np.array([m.frame for m in messages], np.int64),
        seconds=(utime - utime[0]) / 1e6,
        estimates=[estimate_of(m) for m in messages],
        step_ms=np.array([m.step_us for m in messages]) / 1e3,
        latency_ms=(np.array(arrived, np.int64) - utime) / 1e3,
        dropped=messages[-1].dropped,
        tracker_digest=messages[-1].tracker_digest & (1 << 64) - 1,
        remark=remark or damage,
    )
