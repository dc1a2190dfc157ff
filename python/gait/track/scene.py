"""A clip, its camera, and what was found in it before tracking."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from gait.bindings.frame import FrameKeypoints
from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.camera.path import CameraPose, one_place
from gait.io.keypoints_file import Keypoints
from gait.io.video import Frame, Image, Video
from gait.track.from_walk import Calibration
from gait.track.moving_video import MovingVideo
from gait.track.other_people import OtherPeople, Outline
from gait.track.stabilise import FURTHEST_TURN, CameraTurns, in_reference, in_words


@dataclass(frozen=True)
class Scene:
    """A clip, its camera, and what was found in it before tracking.

    Attributes
    ----------
    video : Video
        A `MovingVideo` if the camera moves.
    camera : Camera
        If the camera moves, that of the reference frame of `motion`, or of the first frame.
    model : Model
    plate : image or None
        The empty scene; with a moving camera, the frames of `video` have it.
    motion : CameraTurns or None
        How the camera turns, if that was estimated from the clip.
    frames : range
        Frames to track.
    people : dict of int to Keypoints
        Keypoints of everyone found, by id.
    person : int
        Id in `people` of the person to track; -1 without keypoints.
    keypoints : dict of int to dict of int to FrameKeypoints
        The keypoints with their standard deviations, by id and frame.
    calibration : Calibration or None
        The estimate of the camera, if none was given.
    apart : dict of int to dict of int to FrameKeypoints
        Like `keypoints`, of people who have their own tracks.
    outlines : dict of int to Outline
        Areas of the picture that people cover, by id, if several people are tracked.
    further : tuple of Scene
        The same walk filmed by further cameras; `video` contains their frames.
    began : tuple of str
        Time offset of each of these films, in words.
    offsets : tuple of float
        When each of them began, seconds after the first film.
    turn : float or None
        How far the camera turns although it counts as still, as for `turn_in_samples`; 0 if it does not.
    longer : dict of int to Keypoints
        `people` also in frames that are not tracked, from which time offsets are estimated.
    against_camera : str
        How the camera file contradicts the walk, in words; empty if it does not.
    """

    video: Video
    camera: Camera
    model: Model
    plate: Image | None
    motion: CameraTurns | None
    frames: range
    people: dict[int, Keypoints]
    person: int
    keypoints: dict[int, dict[int, FrameKeypoints]]
    calibration: Calibration | None
    apart: dict[int, dict[int, FrameKeypoints]] = field(default_factory=dict)
    outlines: dict[int, Outline] = field(default_factory=dict)
    further: tuple[Scene, ...] = ()
    began: tuple[str, ...] = ()
    offsets: tuple[float, ...] = ()
    turn: float | None = 0.0
    longer: dict[int, Keypoints] = field(default_factory=dict)
    against_camera: str = ""

    @property
    def moved(self) -> str:
        """How the camera moves although it counts as still, in words; empty if it does not."""
        return in_words(self.turn) if self.turn != 0 else ""

    @property
    def moves_far(self) -> bool:
        """Whether it does more than turn a little, so that a person who walks may seem to walk in place."""
        return self.turn is None or self.turn > FURTHEST_TURN * self.video.width

    @property
    def moving(self) -> MovingVideo | None:
        """Return `video` if the camera moves, otherwise None."""
        return self.video if isinstance(self.video, MovingVideo) else None

    @property
    def poses(self) -> Mapping[int, CameraPose]:
        """Return the camera's pose in each frame if it moves, otherwise nothing."""
        return self.moving.poses if self.moving else {}

    @property
    def empty(self) -> Image | None:
        """The empty scene, as a panorama if the camera turns; None if it is unknown."""
        if self.moving is None or self.moving.panorama is None:
            return self.plate
        return self.moving.panorama.image

    def camera_at(self, number: int) -> Camera:
        """Return the camera of a frame."""
        return self.poses[number].camera(self.camera) if self.poses else self.camera

    def without_plate(self) -> Scene:
        """Return the same scene without its plate."""
        return replace(self, plate=None, video=self.moving.without_panorama() if self.moving else self.video)

    def nearest_of(self) -> Callable[[Frame], Image | None]:
        """Return the function that finds who is nearest in each pixel of a frame."""
        if not self.outlines or self.empty is None:
            return lambda _: None
        others = [outline for id, outline in self.outlines.items() if id != self.person]
        return OtherPeople(self.camera, self.outlines[self.person], others).nearest

    def others(self) -> list[int]:
        """Return the ids that are never in view together with the person, and so may be the same person."""
        if not self.people:
            return []
        frames = {id: one.visible_frames() for id, one in self.people.items()}
        return [id for id in frames if id != self.person and frames[id].isdisjoint(frames[self.person])]


def person_in_reference(scene: Scene) -> Keypoints | None:
    """Convert the person's keypoints to those of a camera that stands still; None if the camera travels."""
    keypoints = scene.people.get(scene.person)
    if keypoints is None or not scene.poses:
        return keypoints
    if not one_place(list(scene.poses.values())):
        return None
    cameras = {number: pose.camera(scene.camera) for number, pose in scene.poses.items()}
    return in_reference(keypoints, cameras, scene.camera)
