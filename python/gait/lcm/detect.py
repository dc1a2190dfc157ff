"""Joints of people in frames that arrive over LCM: ``GAIT_IMAGE_<i>`` in, ``GAIT_TRACKS_<i>`` out."""

from __future__ import annotations

from typing import Any

import numpy as np

from gait.detect import profile
from gait.detect.networks import JOINTS
from gait.detect.people import Followed, PeopleDetector
from gait.errors import UserError
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame
from gait.lcm.link import gaitmsg, handle, is_log, open_lcm
from gait.lcm.messages import decode, frame_number, picture, tracks_message

_KEPT = 1  # frames that wait: older ones are dropped while the detector is busy


_KEEPS = 10.0  # seconds out of view after which a person's number may be given to another


class Numbers:
    """Numbers of the people in view, from 1: the trackers are few, the people who pass are not.

    A person who comes back has the old number, surely within `_KEEPS` seconds.

    Parameters
    ----------
    most : int
        Largest number.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._owners: dict[int, tuple[int, float]] = {}  # number: id, and when that person was seen last

    def number(self, id: int, time: float) -> int | None:
        """Give the number of the person with an id, in view at a time in seconds; None: all are taken."""
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
    """Locates the joints of people in every frame that the machine has time for.

    Those of person N go to ``GAIT_TRACKS_<i>_<N>``, and to ``GAIT_TRACKS_<i>`` those of the person found in
    most frames so far, and of the next one when that person is gone.

    Parameters
    ----------
    url : str
        A network; a log cannot be answered.
    stream : int
        Number of the camera.
    network : str
        ``full``, ``lite`` or ``heavy``.
    people : int
        People followed at a time.

    Attributes
    ----------
    frames, found : int
        Frames examined, and those of them with a person.
    damage : str or None
        Describes what is wrong with the first message that could not be used.

    Raises
    ------
    UserError
        If the weights are absent or damaged, or LCM cannot be opened.
    """

    def __init__(self, url: str, stream: int, network: str, people: int) -> None:
        if is_log(url):
            raise UserError(f"--url {url}: --lcm needs a network, not a log; use gait detect VIDEO")
        self._network, self._detector = network, PeopleDetector(network, people)
        self._numbers = Numbers(people)
        self._lcm = open_lcm(url)
        self._channel = f"GAIT_TRACKS_{stream}"
        self._lcm.subscribe(f"GAIT_IMAGE_{stream}", self._on_image).set_queue_capacity(_KEPT)
        self._origin: int | None = None
        self.frames = self.found = 0
        self.damage: str | None = None

    def handle(self, seconds: float) -> None:
        """Take in a frame, waiting at most so long, but for damaged ones."""
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
        if people:
            longest, _ = max(people, key=lambda pair: len(pair[0].frames))
            self.found += 1
            for one, _ in people:
                data = self._tracks(one, message).encode()
                if one is longest:
                    self._lcm.publish(self._channel, data)
                if (number := self._numbers.number(one.id, seconds)) is not None:
                    self._lcm.publish(f"{self._channel}_{number}", data)

    def _tracks(self, one: Followed, image: Any) -> Any:
        """Joints of a person in the newest frame, where the model has them."""
        last = one.keypoints[-1]
        frame, time = np.array(one.frames[-1:]), np.array(one.times[-1:])
        raw = Keypoints(frame, time, tuple(JOINTS), last.uv[None], last.confidence[None])
        found = profile.corrected(raw, self._network)
        assert found.frame_sd is not None and found.lasting_sd is not None
        correlation = profile.changing_sd(raw, self._network)[1]
        errors = np.stack([found.frame_sd[0], found.lasting_sd[0], correlation], axis=1)
        number = frame_number(image)
        return tracks_message(list(JOINTS), found.uv[0], image.utime, number, last.confidence, errors=errors)
