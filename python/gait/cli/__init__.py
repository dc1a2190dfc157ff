"""The ``gait`` command.

Each command is a row of ``COMMANDS`` and a module here with ``add_arguments(parser)`` and ``run(args) ->
int``. The module's docstring is the text of ``--help``, followed by its ``EXAMPLES``.  The module imports
only what its options need; anything heavier, including NumPy, is imported in the functions that use it, so
that ``--help`` and usage errors appear at once.

Every command has ``--quiet``, and ``--json`` unless the module has ``JSON = False``.  Figures go to stdout,
notes and progress to stderr.  Exit codes are 0 for success, 1 for a failure and 2 for wrong usage.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import NamedTuple, NoReturn

from gait import extras, reproducible
from gait._version import __version__
from gait.errors import GaitError, UsageError, UserError
from gait.signals import Interruptible, end_undisturbed


class Command(NamedTuple):
    """A command: its module here, its line in ``gait --help``, and the extras of libgait that it needs."""

    module: str
    help: str
    extras: tuple[str, ...] = ()


COMMANDS = {
    "learn": Command("learn", "learn a cyclic model from motion capture", ("mocap",)),
    "info": Command("info", "show what a model contains"),
    "doctor": Command("doctor", "check this machine, with a remedy for every fault"),
    "track": Command("track", "track a walking person in a video file", ("video",)),
    "eval": Command("evaluate", "compare a track with the truth", ("video",)),
    "detect": Command("detect", "find the 2-D keypoints of the people in a video", ("video",)),
    "lift": Command("lift", "lift a video, or 2-D keypoints, to 3-D motion", ("video", "mocap")),
    "studio": Command(
        "studio", "correct the motion in a video by hand, on a web page", ("video", "mocap", "studio")
    ),
    "render": Command("render", "draw a pose or a model", ("video",)),
    "calibrate": Command("calibrate", "calibrate the lens of a camera with a printed board", ("video",)),
    "camera": Command("camera", "estimate a camera from points on the ground or a walk", ("video",)),
    "simulate": Command("simulate", "make a test clip of a walking person with ground truth", ("video",)),
    "capture": Command("capture", "send the frames of a video or a camera over LCM", ("video", "lcm")),
    "record": Command("record", "record the estimates of gait-trackd into a track file", ("video", "lcm")),
    "demo": Command(
        "demo", "run capture, tracker and recorder on a clip, and report", ("video", "lcm", "report")
    ),
    "batch": Command("batch", "track or lift many clips by a project file", ("video",)),
    "export": Command("export", "convert a track or a motion to another tool's format"),
    "report": Command(
        "report", "make a one-page report of a run: verdict, film, figure, gait, angles", ("video", "report")
    ),
    "report track": Command(
        "report_track", "measure the gait parameters of a track, with plots", ("video", "report")
    ),
    "report lift": Command(
        "report_lift", "draw figures of the segment prior and of lifting", ("video", "report", "mocap")
    ),
    "paper": Command(
        "paper", "reproduce every figure of the two papers from motion capture", ("video", "report", "mocap")
    ),
    "completion": Command("completion", "print a shell completion script"),
    "view": Command("view", "watch the estimates of gait-trackd in a browser", ("video", "lcm", "studio")),
}
"""Commands in the order of ``gait --help``."""


_DIRECTION = re.compile(r"-[xyz]|-[\d.][^,]*,[^,]+,[^,]+")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None and words[:1] in (["learn"], ["paper"]):  # not from Python, so numpy is not loaded yet
        reproducible.settle()
    if " ".join(words[:2]) in COMMANDS:  # a command with two words
        words[:2] = [" ".join(words[:2])]
    command = f" {words[0]}" if words and words[0] in COMMANDS else ""
    try:
        with Interruptible(ignored=True):
            args = _parse(words)
            code = int(args.run(args))
        if argv is None:  # the program ends here: a second Ctrl-C must not change its exit code
            end_undisturbed()
        sys.stdout.flush()  # at exit, Python would report a closed pipe
        return code
    except UsageError as exc:
        _failed(command, str(exc))
        return 2
    except (UserError, GaitError) as exc:
        return _failed(command, str(exc))
    except ModuleNotFoundError as exc:
        needed = COMMANDS[words[0]].extras if command else ()
        text = extras.remedy(f"gait{command}", needed, (exc.name or "").partition(".")[0])
        if not text:
            raise
        print(text, file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader of our output has closed it, which is not our failure
        _silence()
        return 1
    except MemoryError as exc:
        return _failed(command, f"not enough memory: {str(exc) or 'close other programs or give less'}")
    except OSError as exc:
        return _failed(command, f"{exc.filename or _unnamed(exc)}: {exc.strerror or exc}")
    except KeyboardInterrupt:
        return _failed(command, "interrupted")


def _parse(words: Sequence[str]) -> argparse.Namespace:
    """Parse the command line; exit with code 2 after an error, which names the command."""
    parser = _parser(words)
    if not words:
        parser.error("give a COMMAND; see gait --help")
    args, unknown = parser.parse_known_args(list(_joined(words)))
    if unknown:  # which the parser itself would report without the command
        parser.prog = f"gait {args.command}"
        parser.error(f"unrecognized arguments: {' '.join(unknown)}; see {parser.prog} --help")
    return args


def _unnamed(error: OSError) -> str:
    """Name what an OSError without a file name is about: the standard output if it cannot be written.

    An unbuffered one has nothing left to try again, and is named for any error of writing.
    """
    from gait.io.files import WRITE_ERRORS

    try:
        sys.stdout.flush()
    except OSError:
        _silence()
        return "standard output"
    unbuffered = getattr(sys.stdout, "write_through", False) and error.errno in WRITE_ERRORS
    return "standard output" if unbuffered else "file"


def _silence() -> None:
    """Discard what is left to print, which Python would try again at exit."""
    with contextlib.suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _failed(command: str, text: str) -> int:
    print(f"gait{command}: {' '.join(text.split())}", file=sys.stderr)
    return 1


class _Parser(argparse.ArgumentParser):
    """Parser that reports errors in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message}\n")


class _Version(argparse.Action):
    """Print the versions of package and library, and exit."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from gait.bindings.library import library, version_text  # here, as it loads numpy

        loaded = library()
        print(f"gait {__version__} libgait {version_text(loaded.gait_version())} abi {loaded.gait_abi()}")
        parser.exit()


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Make the parser for `words`; it has only the command named first, or else lists all, importing none."""
    parser = _Parser(
        prog="gait",
        description="Learn how people walk from motion capture, and track them in video.",
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="print the versions of package and library"
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    chosen = words[0] if words and words[0] in COMMANDS else None
    for name, command in COMMANDS.items() if chosen is None else [(chosen, COMMANDS[chosen])]:
        sub = commands.add_parser(name, help=command.help)
        if chosen is not None:
            _fill(sub, command)
    return parser


def parser_of(name: str) -> argparse.ArgumentParser:
    """Make the parser of one command."""
    parser = _Parser(prog=f"gait {name}")
    _fill(parser, COMMANDS[name])
    return parser


def _fill(parser: argparse.ArgumentParser, command: Command) -> None:
    """Add help and options of a command."""
    module = import_module(f"gait.cli.{command.module}")
    parser.description, parser.epilog = module.__doc__, getattr(module, "EXAMPLES", None)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    module.add_arguments(parser)
    if getattr(module, "JSON", True):
        _offer(parser, "--json", "print the figures as JSON")
    _offer(parser, "--quiet", "suppress notes and progress")
    parser.set_defaults(run=module.run)


def _joined(words: Sequence[str]) -> Iterator[str]:
    """Join ``--orthographic -x``, or ``-1,0,0``, into one word: argparse would take ``-x`` as an option."""
    held = ""
    for word in words:
        if held and _DIRECTION.fullmatch(word):
            word, held = f"{held}={word}", ""
        elif held:
            yield held
        held = word if len(word) > 2 and "--orthographic".startswith(word) else ""
        if not held:
            yield word
    if held:
        yield held


def _offer(parser: argparse.ArgumentParser, option: str, text: str) -> None:
    """Add a switch common to all commands, unless the command defines it itself."""
    with contextlib.suppress(argparse.ArgumentError):
        parser.add_argument(option, action="store_true", help=text)
