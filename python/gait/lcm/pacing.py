"""Frames at the rate they were taken: absolute deadlines, so that delays never add up."""

from __future__ import annotations

import time
from collections.abc import Callable

from gait.errors import UsageError
from gait.lcm.messages import now

_MAX_HZ = 1000.0


class Pacer:
    """When to send each frame, and which capture time to write on it.

    Capture times always follow the video's own clock; only the sending is faster or slower.

    Parameters
    ----------
    rate : float or None
        Frames per second; None: as the video was taken; infinity: no waiting.
    first : float
        Video time of the first frame, seconds.
    lead : float
        Seconds from now until the first frame is due.

    Attributes
    ----------
    origin : int
        Capture time of video time 0, microseconds since the Unix epoch.
    late : float
        Largest delay of a frame behind its deadline, seconds.
    """

    def __init__(
        self,
        rate: float | None = None,
        first: float = 0.0,
        lead: float = 0.0,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._rate, self._first = rate, first
        self._clock, self._sleep = clock, sleep
        self._begin = clock() + lead
        self._sent = 0
        self.origin = now() + round((lead - first) * 1e6)
        self.late = 0.0

    def utime(self, video_time: float) -> int:
        """Capture time of a frame `video_time` seconds into the video."""
        return self.origin + round(video_time * 1e6)

    def wait(self, video_time: float) -> None:
        """Return when the frame at `video_time` seconds is due; at once if it is late."""
        after = video_time - self._first if self._rate is None else self._sent / self._rate
        self._sent += 1
        delay = self._begin + after - self._clock()
        if delay > 0:
            self._sleep(delay)
        elif self._rate != float("inf"):
            self.late = max(self.late, -delay)


def parse_rate(text: str) -> float | None:
    """Read ``true``, ``max`` or a number of frames per second, for `Pacer`."""
    if text == "true":
        return None
    if text == "max":
        return float("inf")
    try:
        hertz = float(text)
    except ValueError:
        hertz = 0.0
    if not 0 < hertz <= _MAX_HZ:
        raise UsageError(f"--rate {text}: give true, max or frames per second up to {_MAX_HZ:g}")
    return hertz
