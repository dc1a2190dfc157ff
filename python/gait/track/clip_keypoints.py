"""Keypoints of the people in a clip, from the detector or a file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gait.bindings.abi import Mode
from gait.bindings.model import Model
from gait.detect import weights
from gait.errors import UserError
from gait.io import keypoints_file
from gait.io.detections import Clip
from gait.io.keypoints_file import Keypoints
from gait.io.video import Image, Video
from gait.progress import progress, warning
from gait.track.options import ClipOptions

_FOR_OFFSETS_S = 10.0  # seconds of a film, or its frames to track, that show time offsets of other films


def detects(options: ClipOptions) -> bool:
    """Whether to run the detector: not with a file of keypoints, and with ``auto`` only if it has weights."""
    if options.keypoints or options.detector == "none" or options.mode == Mode.PAPER:
        return False
    return options.detector != "auto" or has_detector(options)


def finds_shapes(options: ClipOptions) -> bool:
    """Whether to search people's shapes: if there are no keypoints, and no empty scene was given."""
    given = options.keypoints or options.background not in ("auto", "none")
    return not (given or options.mode == Mode.PAPER or detects(options))


def has_detector(options: ClipOptions) -> bool:
    """Whether the weights are on this machine."""
    needed = (weights.PERSON, weights.LANDMARK_NETWORKS.get(options.network))
    return all(weight is not None and weights.find(weight) for weight in needed)


def require_detector(options: ClipOptions) -> None:
    """Raise UserError, before long work, if weights are damaged, or keypoints missing although needed."""
    if not (options.camera or options.keypoints or detects(options)):
        remedy = (
            "leave out --detector none, or give --camera" if options.detector == "none" else weights.FETCH
        )
        raise UserError(f"{options.video}: without --camera the keypoints of a walk are needed: {remedy}")
    if detects(options) or options.people is not None:
        weights.load(weights.PERSON)
        weights.load(weights.LANDMARK_NETWORKS[options.network])


def find_people(
    options: ClipOptions, video: Video, model: Model, frames: range, empty: Image | None
) -> tuple[dict[int, Keypoints], int]:
    """Return everyone's keypoints, from the file or found by the detector, and the id of the main person.

    The detector searches the frames to track, and more around few of them if time offsets are estimated.
    `empty`: the empty scene of a static camera, if it is known and everyone is wanted.
    """
    if options.keypoints:
        return {0: _read_keypoints(options, video, model, frames)}, 0
    if not options.further or options.offsets is not None:
        return _detect(options, video, frames, empty)
    wanted = round(_FOR_OFFSETS_S * video.fps)
    stop = min(max(frames.stop, frames.start + wanted), video.count)
    searched = range(max(min(frames.start, stop - wanted), 0), stop)
    return _detect(options, video, searched, empty)


def _detect(
    options: ClipOptions, video: Video, frames: range, empty: Image | None
) -> tuple[dict[int, Keypoints], int]:
    """Find everyone's keypoints with the detector, and the main person; empty without a detector."""
    if not detects(options):
        return {}, -1
    from gait.detect import people as detector  # here, as it loads the networks' runtime

    if not options.camera:
        detector.require_length(video, frames)
    with progress("detecting", len(frames), options.quiet) as update:
        everyone = options.people is not None
        people = detector.detect(
            video,
            options.network,
            first=frames.start,
            stop=frames.stop,
            update=update,
            everyone=everyone,
            empty=empty,
        )
    if not options.camera:
        detector.require_person(people, video)
    if not people:
        return {}, -1
    return people, detector.main_person(people)


def cut_to(people: dict[int, Keypoints], person: int, frames: range) -> tuple[dict[int, Keypoints], int]:
    """Cut keypoints to `frames`; return them and the main person: `person` if nothing is cut."""
    if all(one.frame[0] in frames and one.frame[-1] in frames for one in people.values()):
        return people, person
    from gait.detect.people import main_person  # here, as it loads the networks' runtime

    visible = {}
    for id, one in people.items():
        rows = np.flatnonzero(
            (one.frame >= frames.start) & (one.frame < frames.stop) & one.visible.any(axis=1)
        )
        if len(rows):
            visible[id] = one.part(slice(rows[0], rows[-1] + 1))
    return visible, main_person(visible) if visible else -1


def _read_keypoints(options: ClipOptions, video: Video, model: Model, frames: range) -> Keypoints:
    """Read keypoints of the model's joints from a file; UserError unless some are in frames to track."""
    assert options.keypoints is not None
    clip = Clip(options.person, times=video.times, size=video.size, quiet=options.quiet)
    read, ignored = keypoints_file.read(options.keypoints, model.joint_names, ignore_unknown=True, clip=clip)
    if ignored:
        warning(f"ignored: {' '.join(ignored)}", options.quiet)
    read.require_extent(options.keypoints, options.keypoints_sd)
    read.require_inside(options.keypoints, video.size)
    if not any(frame in frames for frame in read.frame.tolist()):
        raise UserError(
            f"{options.keypoints}: has none of the tracked frames; number frames as in the video, from 0"
        )
    if words := read.compare_times(options.keypoints, video.times):
        warning(f"{options.keypoints}: {words}", options.quiet)
    return replace(read, frame_sd=read.in_frame(options.keypoints_sd))
