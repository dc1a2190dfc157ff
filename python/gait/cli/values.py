"""Options shared by commands: types of values with ranges, and common arguments."""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, _ActionsContainer
from collections.abc import Callable, Sequence
from pathlib import Path

from gait.bindings.abi import Mode
from gait.bindings.config import TrackerConfig
from gait.errors import LibraryError, UsageError

PARTICLES_RANGE = (16, 1 << 20)  # as in gait.h and gait-trackd, like the ranges below
THREADS = (1, 256)  # GAIT_POOL_MAX
SEED_RANGE = (0, (1 << 64) - 1)
STREAM = (0, 30)
PERSON = (1, 8)
LONGEST_OFFSET_S = 86400.0  # a day
PICTURES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")
PAGES = (".html", ".htm")
FILMS = (".mp4", ".mkv", ".mov")  # suffixes of films that can be written
CAMERA = "camera file: JSON, OpenCV YAML or XML, FILE.toml:NAME, or of another tool"


def whole(low: int, high: int | None = None) -> Callable[[str], int]:
    """Make a type: whole numbers in [low, high]."""

    def value(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            number = low - 1
        if number < low or (high is not None and number > high):
            wanted = f"from {low} up" if high is None else f"from {low} to {high}"
            raise ArgumentTypeError(f"{text}: give a whole number {wanted}")
        return number

    return value


def tracker(text: str) -> str:
    """Parse the number of a person, or the URL on which a tracker publishes."""
    if "://" in text:
        return text
    try:
        return str(whole(*PERSON)(text))
    except ArgumentTypeError as fault:
        raise ArgumentTypeError(f"{fault}, or a URL") from None


def between(low: float, high: float, unit: str) -> Callable[[str], float]:
    """Make a type: numbers in [low, high], in `unit`."""

    def value(text: str) -> float:
        number = _number(text)
        if not low <= number <= high:
            raise ArgumentTypeError(f"{text}: give {unit} from {low:g} to {high:g}")
        return number

    return value


def stature(text: str) -> float:
    """Parse the height of a person in metres."""
    from gait.bindings.state import state_range  # here, as it imports NumPy

    low, high = state_range("stature")
    metres = _number(text)
    if not low <= metres <= high:
        raise ArgumentTypeError(f"{text}: is not a stature; give metres from {low} to {high}")
    return metres


def positive(text: str) -> float:
    """Parse a finite number above 0."""
    value = _number(text)
    if not 0 < value < float("inf"):
        raise ArgumentTypeError(f"{text}: give a number above 0")
    return value


def seconds(text: str) -> float:
    """Parse a finite time in seconds, at least 0."""
    value = _number(text)
    if not 0 <= value < float("inf"):
        raise ArgumentTypeError(f"{text}: give seconds from 0 up")
    return value


def norm_age(text: str) -> float:
    """Parse an age in years for which norms are known."""
    value = _number(text)
    if not 20 <= value < 80:  # as gait.motion.norms.AGES
        raise ArgumentTypeError(f"{text}: norms are known from 20 to 79 years; leave it out")
    return value


def named(*endings: str) -> Callable[[str], str]:
    """Make a type: names of outputs with one of these endings; empty names are rejected later."""

    def value(text: str) -> str:
        if text and not text.lower().endswith(endings):
            raise ArgumentTypeError(
                f"{text}: has the wrong suffix; give a name that ends in {' or '.join(endings)}"
            )
        return text

    return value


def require_order(start: int, stop: int) -> None:
    """Raise UsageError unless `start` comes before `stop`."""
    if stop <= start:
        raise UsageError(f"--stop {stop}: must be greater than --start {start}")


def add_camera(
    parser: ArgumentParser,
    note: str = "",
    scale: bool = False,
    several: bool = False,
) -> None:
    """Add ``--camera``, with `several` one per film, and, with `scale`, ``--scale-camera``."""
    action = "append" if several else "store"
    parser.add_argument("--camera", action=action, metavar="CAM", help=CAMERA + note)
    if scale:
        parser.add_argument(
            "--scale-camera",
            action="store_true",
            help="the video is resized: scale a camera that was calibrated at another resolution",
        )


#: How often an option about files of other tools may be given.
EACH_VIEW = "of several views one for each such file in their order, or one for all"


def offsets(text: str) -> tuple[float, ...]:
    """Parse seconds, separated by commas."""
    try:
        seconds = tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ArgumentTypeError(f"{text!r} is not a list of seconds, such as 0.5,-1.2") from None
    if not all(abs(one) <= LONGEST_OFFSET_S for one in seconds):
        raise ArgumentTypeError(f"{text}: give seconds from -{LONGEST_OFFSET_S:g} to {LONGEST_OFFSET_S:g}")
    return seconds


def camera_of(given: Sequence[str] | None, offsets: Sequence[float] | None) -> str | None:
    """Return the camera file of a single film or view, from those `given`; UsageError if there are more."""
    if offsets is not None:
        raise UsageError("--offsets: is for further films")
    if given and len(given) > 1:
        raise UsageError(f"--camera: {len(given)} for one film; give one, or further films")
    return given[0] if given else None


def cameras_of(
    given: Sequence[str] | None, offsets: Sequence[float] | None, films: Sequence[str]
) -> list[str]:
    """Return the camera file of each of several films or views, from those `given`.

    Raises
    ------
    UsageError
        If their number, or that of `offsets`, is wrong, or a film is given twice.
    """
    from gait.camera.camera import camera_names  # here, so that --help answers at once

    cameras = [name for file in given or () for name in camera_names(file)]
    if len(cameras) != len(films):
        raise UsageError(
            f"--camera: {len(cameras)} for {len(films)} films; give one for each, all in one world"
        )
    if offsets is not None and len(offsets) != len(films) - 1:
        raise UsageError(f"--offsets: {len(offsets)} for {len(films) - 1} further films; give one for each")
    files = [Path(film).resolve() for film in films]
    for k, film in enumerate(films):
        if files[k] in files[:k]:
            raise UsageError(f"{film}: is given twice; give each film once")
    return cameras


def add_fov(parser: _ActionsContainer) -> None:
    """Add ``--fov``."""
    parser.add_argument(
        "--fov",
        type=between(2, 150, "degrees"),
        metavar="DEG",
        help="horizontal field of view of a camera that is estimated from the walk (default: from the focal "
        "length that a phone wrote into the file; else unknown, near 65 along the longer side)",
    )


def add_norms(parser: ArgumentParser) -> None:
    """Add ``--age`` and ``--sex``, on which the norm of the comfortable speed depends."""
    parser.add_argument(
        "--age", type=norm_age, metavar="YEARS", help="age of the person, for the norm of speed (20 to 79)"
    )
    parser.add_argument("--sex", choices=("f", "m"), help="sex of the person, with --age (default: both)")


def require_age(age: float | None, sex: str | None) -> None:
    """Raise UsageError for a sex without an age."""
    if sex and age is None:
        raise UsageError("--sex: needs --age")


TRACKED = "default: the one with the track's classes of motion"
"""Default of ``--model`` of commands that report a track."""


def add_model(
    parser: ArgumentParser, what: str = "walking model", default: str = "default: walk; in paper mode paper"
) -> None:
    """Add ``--model``; None means the package's model, or what `default` describes for the help."""
    parser.add_argument(
        "-m",
        "--model",
        metavar="M.gait",
        help=f"{what}: a file, or a model of the package: walk, paper or classes ({default})",
    )


def add_seed(parser: _ActionsContainer, of: str) -> None:
    """Add ``--seed``; `of`: what it is the seed of, for the help."""
    help = f"seed of {of} (default: 1)"
    parser.add_argument("--seed", type=whole(*SEED_RANGE), default=1, metavar="S", help=help)


def add_url(parser: ArgumentParser) -> None:
    """Add ``--url``."""
    parser.add_argument(
        "--url",
        metavar="URL",
        help="LCM network or log (default: LCM_DEFAULT_URL, or multicast on this host)",
    )


def add_clip(parser: ArgumentParser, use: str, init: str = "auto", background: str = "auto") -> None:
    """Add ``--init --background --height --start --stop``; `use`: what is done with frames, for the help."""
    parser.add_argument(
        "--init", default=init, metavar="INIT.json|auto", help=f"first state (default: {init})"
    )
    parser.add_argument(
        "--background",
        default=background,
        metavar="PNG|auto|none",
        help=f"empty scene: an image, auto for the median of the clip, or none (default: {background})",
    )
    parser.add_argument("--height", type=stature, metavar="M", help="the person's stature in metres")
    parser.add_argument("--start", type=whole(0), metavar="F", help=f"first frame to {use}, counted from 0")
    parser.add_argument("--stop", type=whole(0), metavar="F", help=f"first frame not to {use}")


def add_person(parser: _ActionsContainer, several: bool = False) -> None:
    """Add ``--person``, with `several` one for each view."""
    further = ", and in further views the one whose joints fit the first view best" * several
    parser.add_argument(
        "--person",
        action="append" if several else "store",
        metavar="ID",
        help="which of several people in another tool's file: a track, individual or number from the note "
        f"that lists them (default: the one who is seen most{further})" + f"; {EACH_VIEW}" * several,
    )


def add_filter(parser: ArgumentParser, threads: int) -> None:
    """Add ``--particles --threads``."""
    usual, paper = _particles(Mode.DEFAULT), _particles(Mode.PAPER)
    parser.add_argument(
        "--particles",
        type=whole(*PARTICLES_RANGE),
        metavar="N",
        help=f"size of the particle set, {PARTICLES_RANGE[0]} to {PARTICLES_RANGE[1]} "
        f"(default: {usual}, in paper mode {paper})",
    )
    parser.add_argument(
        "--threads",
        type=whole(*THREADS),
        default=threads,
        metavar="T",
        help=f"threads of the tracker, up to {THREADS[1]}; the result does not depend on them "
        f"(default: {threads})",
    )


def _particles(mode: Mode) -> str:
    """Write the default number of particles, for help that must be readable even without the library."""
    try:
        return str(TrackerConfig.default(mode).particles)
    except LibraryError:
        return "the library's default"


def _number(text: str) -> float:
    """Parse a number; NaN if the text is not one."""
    try:
        return float(text)
    except ValueError:
        return float("nan")
