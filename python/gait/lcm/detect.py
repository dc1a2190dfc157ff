"""Detect joints of people in frames that arrive over LCM (``GAIT_IMAGE_<i>``); send ``GAIT_TRACKS_<i>``."""

from __future__ import annotations

from typing import Any

import numpy as np

from gait.detect import profile
from gait.detect.networks import LANDMARK_JOINTS
from gait.detect.people import Followed, PeopleDetector
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame
from gait.lcm.link import gaitmsg, handle, is_log, open_lcm
from gait.lcm.messages import decode, frame_number, picture, tracks_message

_KEPT_FRAMES = 1  # frames that wait while the detector is busy; older ones are dropped


_AWAY = 1.0  # seconds out of view after which `GAIT_TRACKS_<i>` takes another person
_KEEPS = 10.0  # seconds out of view after which a person's number may be reused


class Numbers:
    """Numbers of the people in view, from 1; there are few trackers, but many people may pass.

    A person who comes back has the old number, at least within `_KEEPS` seconds.

    Parameters
    ----------
    most : int
        Largest number.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._owners: dict[int, tuple[int, float]] = {}  # by number: id, and when that person was last seen

    def number(self, id: int, time: float) -> int | None:
        """Return the number of the person with an id, in view at a time [s]; None if all are taken."""
        found = next((number for number, (owner, _) in self._owners.items() if owner == id), None)
        if found is None and len(self._owners) < self._most:
            found = len(self._owners) + 1
        elif found is None:
            oldest = min(self._owners, key=lambda number: self._owners[number][1])
            found = oldest if time - self._owners[oldest][1] >= _KEEPS else None
        if found is not None:
            self._owners[found] = id, time
        return found


class LiveDetector:
    """Detects the joints of people in as many frames as the machine can process.

    The joints of person N are sent on ``GAIT_TRACKS_<i>_<N>``.  Those of one person are also sent on
    ``GAIT_TRACKS_<i>``: always the same, until that person has been out of view for a second; then of the one
    found in most frames so far.  Every frame that is processed has a message on each of these channels; one
    without joints means that the person is not in view, so that a tracker need not wait.

    Parameters
    ----------
    url : str
        A network, not a log.
    stream : int
        Number of the camera.
    network : str
        ``full``, ``lite`` or ``heavy``.
    people : int
        Most people followed at a time.

    Attributes
    ----------
    frames, found : int
        Numbers of frames processed, and of those with a person.
    damage : str or None
        Describes the fault of the first message that could not be used.

    Raises
    ------
    UserError
        If the weights are missing or damaged, or LCM cannot be opened.
    """

    def __init__(self, url: str, stream: int, network: str, people: int) -> None:
        if is_log(url):
            raise UserError(f"--url {url}: --lcm needs a network, not a log; use gait detect VIDEO")
        self._network, self._detector = network, PeopleDetector(network, people, live=True)
        self._people, self._numbers = people, Numbers(people)
        self._main, self._main_last = 0, -np.inf  # id of the person on the channel without a number, seconds
        self._lcm = open_lcm(url)
        self._channel = f"GAIT_TRACKS_{stream}"
        self._lcm.subscribe(f"GAIT_IMAGE_{stream}", self._on_image).set_queue_capacity(_KEPT_FRAMES)
        self._origin: int | None = None
        self.frames = self.found = 0
        self.damage: str | None = None

    def handle(self, seconds: float) -> None:
        """Process a frame, waiting for it at most this long; skip damaged ones."""
        try:
            handle(self._lcm, seconds, False)
        except UserError as fault:
            self.damage = self.damage or str(fault)

    def _on_image(self, channel: str, data: bytes) -> None:
        message = decode(gaitmsg.image_t, data, channel)
        image = picture(message)
        if image.ndim == 2:
            image = np.repeat(image[..., None], 3, axis=2)
        self._origin = message.utime if self._origin is None else self._origin
        seconds = (message.utime - self._origin) / 1e6
        people = self._detector.step(Frame(self.frames, seconds, image))
        self.frames += 1
        self.found += bool(people)
        found = {one.id: self._tracks(one, message) for one, _ in people}
        main = self._main_of([one for one, _ in people], seconds)
        sent = {self._channel: found.get(main)}
        numbers = {self._numbers.number(id, seconds): tracks for id, tracks in found.items()}
        sent |= {f"{self._channel}_{number}": numbers.get(number) for number in range(1, self._people + 1)}
        nothing = tracks_message(
            (), np.empty((0, 2)), message.utime, frame_number(message), errors=np.empty((0, 3))
        )
        for channel, tracks in sent.items():
            self._lcm.publish(channel, (tracks or nothing).encode())

    def _main_of(self, people: list[Followed], time: float) -> int:
        """Return the id of the person on the channel without a number; 0: there has been no one yet."""
        if any(one.id == self._main for one in people):
            self._main_last = time
        elif people and not 0 <= time - self._main_last < _AWAY:
            self._main, self._main_last = max(people, key=lambda one: one.count).id, time
        return self._main

    def _tracks(self, one: Followed, image: Any) -> Any:
        """Make the message with a person's joints in the newest frame, converted to the model's."""
        last = one.keypoints[-1]
        frame, time = np.array(one.frames[-1:]), np.array(one.times[-1:])
        raw = Keypoints(frame, time, tuple(LANDMARK_JOINTS), last.uv[None], last.confidence[None])
        found = profile.corrected(raw, self._network)
        assert found.frame_sd is not None and found.lasting_sd is not None
        correlation = profile.changing_sd(raw, self._network)[1]
        errors = np.stack([found.frame_sd[0], found.lasting_sd[0], correlation], axis=1)
        number = frame_number(image)
        return tracks_message(
            list(LANDMARK_JOINTS), found.uv[0], image.utime, number, last.confidence, errors=errors
        )
