"""Record a tracker's estimates from LCM in a track file and a log, and read such a log."""

from __future__ import annotations

import time
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gait.bindings.estimate import Estimate
from gait.errors import UserError
from gait.io.files import replacing
from gait.io.track_file import TrackWriter, require_joints
from gait.io.video import Frame
from gait.lcm.link import (
    LogWriter,
    break_of,
    end_at_an_event,
    events_of,
    handle,
    is_log,
    listener,
    log_of,
    now,
    require_log,
    silence,
)
from gait.lcm.messages import classes_message, estimate_after
from gait.progress import durations

LISTENING = "listening"
"""First word of the note on stderr that all estimates from now on will be recorded."""

_NO_IMAGE = np.empty((0, 0), np.uint8)
_TURN = 0.1  # seconds; longest wait before checking whether to stop
_QUEUE = 1000  # estimates that may wait for the disk
_LONGEST_WAIT = 10  # estimates until the names of the classes must be known
_OTHER_CLASSES = "other classes of motion than the stream's"
_SNAPSHOT = 1_000_000  # microseconds; period of gait-trackd's snapshots


@dataclass
class Figures:
    """Measurements during the recording: one entry per estimate; milliseconds."""

    step: list[float] = field(default_factory=list)
    latency: list[float] = field(default_factory=list)
    utime: list[int] = field(default_factory=list)
    arrived: list[int] = field(default_factory=list)
    last: Any = None
    lost: int = 0
    damaged: int = 0

    def add(self, message: Any, arrived: int) -> None:
        """Add one estimate."""
        if self.last is not None and message.step > self.last.step + 1:
            self.lost += message.step - self.last.step - 1
        self.last = message
        self.step.append(message.step_us / 1e3)
        self.latency.append((arrived - message.utime) / 1e3)
        self.utime.append(message.utime)
        self.arrived.append(arrived)

    def summary(self, live: bool) -> dict[str, Any]:
        """Return the figures of ``gait record --json``.

        Latency is meaningful only for a `live` stream.  Its rate is that of arrival, otherwise of capture.
        """
        times = self.arrived if live else self.utime
        span = (times[-1] - times[0]) / 1e6 if len(times) > 1 else 0.0
        last = self.last
        return {
            "frames": len(self.utime),
            "dropped": last.dropped if last else 0,
            "lost": self.lost,
            "damaged": self.damaged,
            "fps": (len(self.utime) - 1) / span if span > 0 else None,
            "step_ms": durations(self.step) if self.step else None,
            "latency_ms": durations(self.latency) if live and self.latency else None,
            "model_digest": _hex(last.model_digest) if last else None,
            "digest": _hex(last.tracker_digest) if last else None,
        }


ESTIMATE, LAGGED = "GAIT_ESTIMATE", "GAIT_ESTIMATE_LAG"
CLASSES = {ESTIMATE: "GAIT_CLASSES", LAGGED: "GAIT_CLASSES_LAG"}
"""Channel of the class probabilities that come before each estimate."""


def channel_of(person: int | None, channel: str = ESTIMATE) -> str:
    """Return the channel of one of several people; None: people are not distinguished."""
    return channel if person is None else f"{channel}_{person}"


class _ClassNames:
    """Names of a stream's classes of motion: the first that two successive messages have; others are wrong.

    Until then, `names` are those of the newest message.
    """

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self._agreed = False

    @property
    def known(self) -> bool:
        """Whether `names` cannot change any more, or there are no messages."""
        return self._agreed or not self.names

    def add(self, message: Any, channel: str) -> None:
        """Take the names of a ``classes_t``; UserError if they are wrong."""
        names = tuple(message.name)
        if self._agreed and names != self.names:
            raise UserError(f"{channel}: {_OTHER_CLASSES}")
        self._agreed = names == self.names
        self.names = names


def _without_classes(estimate: Estimate) -> Estimate:
    """Make an estimate like those that come without a ``classes_t``."""
    return replace(estimate, motion_class="walk", class_probability=np.ones(1))


class Recorder:
    """Records estimates as they arrive.

    Parameters
    ----------
    url : str
    output : str
        Track file, as ``gait track`` writes it.
    log : str, optional
        LCM log to write the messages to, each with its time of arrival, for `read_run`.
    channel : str
        ``GAIT_ESTIMATE``, or ``GAIT_ESTIMATE_LAG``: each frame estimated some frames later.
    person : int, optional
        Number of the person to record, of several; the track then contains it.

    Attributes
    ----------
    figures : Figures
    stop : bool
        Set it to end `run`.
    other : str or None
        Describes the other stream whose beginning ended the recording.
    damage : str or None
        Describes the fault of the first message that was skipped.
    """

    def __init__(
        self,
        url: str,
        output: str,
        log: str | None = None,
        channel: str = ESTIMATE,
        person: int | None = None,
    ) -> None:
        self._lcm, self._live, self._url = listener(url), not is_log(url), url
        self._output, self._path, self._person = output, log, person
        self._channel = channel_of(person, channel)
        self._waiting: list[tuple[Any, Estimate, tuple[str, ...]]] = []  # with the names of its classes
        self._classes: tuple[Any, bytes] | None = None  # the newest
        self._names = _ClassNames()
        self._writer: TrackWriter | None = None
        self._log: LogWriter | None = None
        self._origin = 0
        self._two, self._first = False, 0
        self._restart: Any = None  # last estimate whose steps went back
        self._last = 0.0
        self.figures = Figures()
        self.stop = False
        self.other: str | None = None
        self.damage: str | None = None
        self._classes_channel = channel_of(person, CLASSES[channel])
        self._lcm.subscribe(self._channel, self._on_estimate).set_queue_capacity(_QUEUE)
        self._lcm.subscribe(self._classes_channel, self._on_classes).set_queue_capacity(_QUEUE)

    def run(
        self, frames: int | None = None, idle: float | None = None, patience: float | None = None
    ) -> None:
        """Record until `frames` have arrived, none has for `idle` seconds, the log ends, or `stop` is set.

        The beginning of another stream also ends it, as a file contains only one.

        Raises
        ------
        UserError
            If no estimate arrived, or none within `patience` seconds if given; then no file is written.
            If two trackers publish at once, or a log breaks off; the file then contains the part before.
        """
        begun = time.monotonic()
        with ExitStack() as self._stack:
            if self._path is not None:
                temporary = self._stack.enter_context(replacing(self._path, end_at_an_event, end_at_an_event))
                self._log = self._stack.enter_context(closing(LogWriter(temporary, name=self._path)))
            ended = False
            while not self.stop and not (ended := not handle(self._lcm, _TURN, not self._live)):
                count, clock = len(self.figures.utime), time.monotonic()
                quiet = idle is not None and clock - self._last > idle
                late = patience is not None and clock - begun > patience
                if (frames is not None and count >= frames) or (quiet if count else late):
                    break
            self._flush()
            if not self.figures.utime:
                raise UserError(
                    f"{self._channel}: no estimate was received; {self.damage or silence(self._url)}"
                )
        if self._two:
            raise UserError(
                f"{self._output}: two trackers publish on this URL; stop one of them (frames in the file, "
                f"all from before this was noticed: {len(self.figures.utime)})"
            )
        if ended and not self._live:
            self._require_whole()

    def summary(self) -> dict[str, Any]:
        """Return the figures of the recording."""
        return self.figures.summary(self._live)

    def _on_classes(self, channel: str, data: bytes) -> None:
        try:
            classes = classes_message(data, channel)
            self._names.add(classes, channel)
            self._classes = classes, data
        except UserError as fault:
            self._skip(fault)

    def _skip(self, fault: UserError) -> None:
        """Count a bad message, which does not end a recording."""
        self.figures.damaged += 1
        self.damage = self.damage or str(fault)

    def _on_estimate(self, channel: str, data: bytes) -> None:
        arrived = now()
        classes, encoded = self._classes or (None, b"")
        try:
            message, estimate = estimate_after(data, channel, self.figures.last, classes)
            if self.figures.last is None:
                require_joints(estimate.joint_names)
        except UserError as fault:
            self._skip(fault)
            return
        if self.figures.last is None:
            self._first = message.receive_utime
        elif not self._goes_on(self.figures.last, message):
            self.stop = True
            return
        self.figures.add(message, arrived)
        if classes is not None and classes.utime != message.utime:
            classes = None
        if self._log is not None:
            if classes is not None:
                self._log.write(arrived, self._classes_channel, encoded)
            self._log.write(arrived, channel, data)
        self._last = time.monotonic()
        self._waiting.append((message, estimate, () if classes is None else tuple(classes.name)))
        known = self._names.known or len(self._waiting) == _LONGEST_WAIT
        if self._writer is not None or (len(self._waiting) > 1 and known):
            self._flush()

    def _require_whole(self) -> None:
        """Raise UserError if the log that has ended is incomplete."""
        path = log_of(self._url)[0]
        fault = break_of(path)
        if fault:
            raise UserError(f"{path}: {fault}; {self._output} contains the part before")

    def _goes_on(self, previous: Any, message: Any) -> bool:
        """Whether an estimate continues the stream of the previous one; if not, store why in `other`."""
        played_again = message.receive_utime == self._first  # as when a log repeats
        if not played_again and (_of_two(previous, message) or self._alternates(previous, message)):
            self._two = True
        elif _number(message) <= _number(previous):
            self.other = f"another stream began (frame {_number(message)} after {_number(previous)})"
        else:
            return True
        return False

    def _alternates(self, previous: Any, message: Any) -> bool:
        """Whether steps go back as those of two trackers do that run at the same time and share the frames.

        Steps of one tracker go back when it continues from a snapshot.  It may be killed again, but the
        snapshot is then the same, or was written since.
        """
        if not _goes_back(previous, message):
            return False
        before, self._restart = self._restart, message
        return (
            before is not None
            and message.step > before.step
            and message.receive_utime - before.receive_utime < _SNAPSHOT
        )

    def _flush(self) -> None:
        """Write waiting rows.

        The first waits for the second, as both are needed for the time of frame 0, and for names of classes.
        """
        if self._waiting and self._writer is None:
            self._open()
        for message, estimate, names in self._waiting:
            if names not in ((), self._names.names):
                self._skip(UserError(f"{self._classes_channel}: {_OTHER_CLASSES}"))
                estimate = _without_classes(estimate)
            assert self._writer is not None
            seconds = (message.utime - self._origin) / 1e6
            self._writer.write(Frame(_number(message), seconds, _NO_IMAGE), estimate)
        self._waiting.clear()

    def _open(self) -> None:
        first, last = self._waiting[0][0], self._waiting[-1][0]
        interval = (last.utime - first.utime) / max(1, _number(last) - _number(first))
        self._origin = first.utime - round(interval * _number(first))
        joints = tuple(joint.name for joint in first.joints)
        angles = tuple(angle.name for angle in first.angles)
        self._writer = self._stack.enter_context(
            TrackWriter(
                self._output, first.mean.ncoef, joints, angles, self._names.names, person=self._person
            )
        )


def _number(message: Any) -> int:
    """Return the frame number of an estimate: the source's, or else the count of steps."""
    return int(message.frame if message.frame >= 0 else message.step)


def _of_two(previous: Any, message: Any) -> bool:
    """Whether two successive estimates show that two trackers run at the same time.

    One tracker makes one estimate per frame, and receives frames in order.
    """
    return _number(message) <= _number(previous) and (
        message.utime == previous.utime or message.receive_utime <= previous.receive_utime
    )


def _goes_back(previous: Any, message: Any) -> bool:
    """Whether steps of a later frame do not continue those of the previous estimate.

    A tracker counts its steps; only a later START makes it count from 0 again.
    """
    began = message.frame - message.step - message.dropped
    return message.frame >= 0 and message.step <= previous.step and began <= previous.frame


def _hex(digest: int) -> str:
    return f"{digest & (1 << 64) - 1:016x}"


Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """The estimates of one stream, n of them.

    Attributes
    ----------
    frame : ndarray of int, shape (n,)
        Frame numbers at the source, increasing.
    seconds : ndarray of shape (n,)
        Capture times since the first estimate.
    estimates : list of Estimate
    step_ms : ndarray of shape (n,)
        Time that the tracker spent on each frame.
    latency_ms : ndarray of shape (n,)
        From capture to the arrival of the estimate in the log.
    dropped : int
        Number of frames captured but not tracked.
    tracker_digest : int
        Digest after the last frame, unsigned.
    remark : str or None
        Describes what else the log contains.
    """

    frame: NDArray[np.int64]
    seconds: Array
    estimates: list[Estimate]
    step_ms: Array
    latency_ms: Array
    dropped: int
    tracker_digest: int
    remark: str | None = None


def read_run(path: str, person: int | None = None) -> Run:
    """Read the ``GAIT_ESTIMATE`` messages of a log from ``gait record --log`` or ``lcm-logger``.

    `person` is the number of the person to read, of several.  Only the first stream is used; a frame number
    that does not increase begins another.
    """
    require_log(path)
    messages: list[Any] = []
    estimates: list[Estimate] = []
    classes: Any = None  # the newest classes, which come before their estimate
    named, names = _ClassNames(), list[tuple[str, ...]]()
    remark, damage = None, None
    arrived: list[int] = []
    for event in events_of(path, whole=False):
        if event.channel not in (channel_of(person), channel_of(person, CLASSES[ESTIMATE])):
            continue
        try:
            if event.channel != channel_of(person):
                found = classes_message(event.data, path)
                named.add(found, path)
                classes = found
                continue
            message, estimate = estimate_after(event.data, path, messages[0] if messages else None, classes)
            if not messages:
                require_joints(estimate.joint_names)
        except UserError as fault:
            damage = damage or f"a message is skipped: {fault}"
            continue
        if messages and message.frame <= messages[-1].frame:
            remark = f"another stream begins with frame {message.frame}; only the first is used"
            break
        messages.append(message)
        estimates.append(estimate)
        names.append(tuple(classes.name) if classes is not None and classes.utime == message.utime else ())
        arrived.append(event.timestamp)
    if not messages:
        why = damage or break_of(path) or "record while gait-trackd is tracking"
        raise UserError(f"{path}: contains no {channel_of(person)} message; {why}")
    for k, of_one in enumerate(names):
        if of_one not in ((), named.names):
            damage = damage or f"a message is skipped: {path}: {_OTHER_CLASSES}"
            estimates[k] = _without_classes(estimates[k])
    utime = np.array([m.utime for m in messages], np.int64)
    return Run(
        frame=np.array([m.frame for m in messages], np.int64),
        seconds=(utime - utime[0]) / 1e6,
        estimates=estimates,
        step_ms=np.array([m.step_us for m in messages]) / 1e3,
        latency_ms=(np.array(arrived, np.int64) - utime) / 1e3,
        dropped=messages[-1].dropped,
        tracker_digest=messages[-1].tracker_digest & (1 << 64) - 1,
        remark=remark or damage,
    )
