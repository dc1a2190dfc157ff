"""2-D keypoints of a clip as `gait lift` and `gait report lift` take them: read, seen in a view, lifted."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from gait.bindings.segment_prior import SegmentPrior
from gait.camera.camera import Camera
from gait.errors import UserError
from gait.io import keypoints_file as keypoints_file
from gait.io.keypoints_file import Keypoints, shared_place
from gait.learn.corpus.stage import one_thread
from gait.lift.keypoints import noise, swaps
from gait.lift.segment.view import Parallel, Perspective, View, looking_along
from gait.lift.smooth import motion
from gait.lift.smooth.motion import Motion, Options
from gait.progress import progress

MOST_JUMPS, MOST_SPANS = 5, 4  # named
BESIDE = 0.1  # of the points: fewer are those of somebody whom the picture cuts off
SHAKY = 1.3  # times a standard deviation from which points shake more than it says


def read(path: str, prior: SegmentPrior, sd: float, ignore_unknown: bool, quiet: bool) -> Keypoints:
    """Read keypoints of points of a prior whose noise is `sd`, and tell what is left out."""
    keypoints, ignored = keypoints_file.read(path, prior.names, ignore_unknown)
    keypoints.require_motion(path)
    keypoints.require_spread(path, sd)
    if ignored and not quiet:
        print(f"left out, unknown to the model: {' '.join(ignored)}", file=sys.stderr)
    if not quiet:
        for words in _remarks(keypoints):
            print(words, file=sys.stderr)
    return keypoints


def _remarks(keypoints: Keypoints) -> Iterator[str]:
    """Tell what in keypoints is no motion of one person."""
    if found := shared_place(keypoints.uv):
        (u, v), count = found
        yield (
            f"{count} points are at exactly {u:g}, {v:g}: if a detector puts there what it does not see, "
            "leave the cells empty"
        )
    if changes := noise.person_changes(keypoints)[:MOST_JUMPS]:
        places = [
            f"at frame {first}" if last is None else f"in frames {first} to {last}" for first, last in changes
        ]
        yield (
            f"most points jump at once: the track changes person {', '.join(places)}; leave one person's "
            "points alone"
        )


def noise_of(keypoints: Keypoints, quiet: bool) -> float:
    """Tell the points' deviation at full confidence: the usual one, or how much they shake if it is more.

    Points that jump are no shaking: among many, others would pass for right.
    """
    usual = Options.pixel_sd
    shake = noise.shake(noise.without_spikes(keypoints, usual)[0])
    if not shake > SHAKY * usual:
        return usual
    if not quiet:
        print(
            f"the points shake by {shake:.2g} from frame to frame: taken for their noise instead of "
            f"{usual:g} (--pixel-sd)",
            file=sys.stderr,
        )
    return shake


def with_sides(
    path: str,
    prior: SegmentPrior,
    keypoints: Keypoints,
    seen_in: View,
    options: Options,
    quiet: bool,
    hint: str = "",
) -> tuple[Keypoints, dict[str, Any]]:
    """Put left and right back where they were exchanged, tell where (and `hint`); with figures of ``--json``.

    Raises
    ------
    UserError
        One line that names the file `path` of the keypoints, if they cannot be lifted.
    """
    with _naming(path):
        motion.require(prior, keypoints, seen_in, options)
    with one_thread(), progress("sides", len(keypoints.time), quiet) as update:

        def evidence(part: Keypoints) -> float:
            update(int(np.searchsorted(keypoints.frame, part.frame[0])))
            return motion.evidence(prior, part, seen_in, options)

        found, exchanged = swaps.undo_swaps(keypoints, options.pixel_sd, evidence)
    if exchanged and not quiet:
        print(_exchanged(exchanged) + hint, file=sys.stderr)
    moved = (found.uv != keypoints.uv).any(axis=2) & keypoints.seen
    spans = [
        {"joint": each.joint, "first": first, "last": last}
        for each in exchanged
        for first, last in each.spans
    ]
    return found, {"exchanged": int(moved.sum()), "put_back": spans}


def _exchanged(exchanged: list[swaps.Swapped]) -> str:
    """Name stretches of frames, the longest first, and what was exchanged in them."""
    joints: dict[tuple[int, int], list[str]] = {}
    for each in exchanged:
        for span in each.spans:
            joints.setdefault(span, []).append(each.joint)
    spans = sorted(joints, key=lambda span: span[0] - span[1])
    named = [f"{', '.join(joints[span])} in frames {span[0]} to {span[1]}" for span in spans[:MOST_SPANS]]
    more = f" and {len(spans) - MOST_SPANS} more stretches" if len(spans) > MOST_SPANS else ""
    return f"left and right were exchanged and are put back: {'; '.join(named)}{more}"


def without_spikes(keypoints: Keypoints, sd: float, quiet: bool, hint: str = "") -> tuple[Keypoints, dict[str, Any]]:
    """Leave out single points that jump, tell which (and `hint`); with figures of ``--json``."""
    keypoints, jumps = noise.without_spikes(keypoints, sd)
    if jumps and not quiet:
        print(_jumped(jumps) + hint, file=sys.stderr)
    left_out = [{"frame": frame, "point": name} for frame, name in jumps]
    return keypoints, {"jumps": len(jumps), "left_out": left_out}


def _jumped(jumps: list[tuple[int, str]]) -> str:
    """Name the points that were taken out."""
    named = ", ".join(f"{name} in frame {frame}" for frame, name in jumps[:MOST_JUMPS])
    more = f" and {len(jumps) - MOST_JUMPS} more" if len(jumps) > MOST_JUMPS else ""
    return f"left out, far from where they were a frame before and after: {named}{more}"


def view(
    keypoints: Keypoints,
    camera: str | None,
    axis: str | None = None,
    metres: float | None = None,
    quiet: bool = False,
) -> View:
    """See keypoints through a calibrated camera, or else from far away; tell if they cannot be of its picture.

    Parameters
    ----------
    camera : str, optional
        File of the calibration.
    axis : str, optional
        Direction of view from far away; level and with a slowly changing scale if left out.
    metres : float, optional
        Of a unit of u and v along `axis`; unknown if left out.
    """
    if camera:
        calibrated = Camera.read(camera)
        beside = keypoints.outside(calibrated.size)
        if beside > BESIDE and not quiet:
            picture = "{}x{}".format(*calibrated.size)
            print(
                f"{beside:.0%} of the points lie outside of the camera's {picture} picture: is {camera} the "
                "calibration of this video?",
                file=sys.stderr,
            )
        return Perspective(calibrated)
    middle = np.nanmedian(keypoints.uv, axis=(0, 1))  # wild points do not move it
    return Parallel(looking_along(axis or "y"), metres, middle, steady=bool(axis))


def lift(
    path: str,
    prior: SegmentPrior,
    keypoints: Keypoints,
    seen_in: View,
    options: Options,
    names: tuple[str, ...],
    quiet: bool,
) -> Motion:
    """Lift keypoints with a bar of progress; matrices are too small for several threads to gain.

    Raises
    ------
    UserError
        One line that names the file `path` of the keypoints.
    """
    segments = motion.segments_of(prior, keypoints)
    with one_thread(), progress("segments", segments, quiet) as update, _naming(path):
        return motion.lift(prior, keypoints, seen_in, options, names, update)


@contextmanager
def _naming(path: str) -> Iterator[None]:
    """Name a file in errors."""
    try:
        yield
    except UserError as error:
        raise type(error)(f"{path}: {error}") from None
