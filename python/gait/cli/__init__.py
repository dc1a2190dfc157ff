"""The ``gait`` command.

Each sub-command is a module here with ``NAME``, ``HELP``, ``add_arguments(parser)`` and ``run(args) -> int``.
Its docstring is the text of ``--help``.  Every command gets ``--quiet``, and ``--json`` unless it says
``JSON = False``.  Figures go to stdout, words and progress to stderr; exit codes are 0 ok, 1 failed, 2 usage.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from importlib import import_module
from types import FrameType
from typing import NoReturn

from gait import reproducible
from gait._version import __version__
from gait.errors import GaitError, UsageError, UserError

COMMANDS = {
    "learn": "learn",
    "info": "info",
    "track": "track",
    "eval": "evaluate",
    "lift": "lift",
    "render": "render",
    "camera": "camera",
    "simulate": "simulate",
    "capture": "capture",
    "record": "record",
    "demo": "demo",
    "report": "report",
    "report track": "report_track",
    "report lift": "report_lift",
    "view": "view",
}
"""Command to its module, in the order of ``gait --help``."""


_DIRECTION = re.compile(r"-[xyz]|-[\d.][^,]*,[^,]+,[^,]+")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    if argv is None and words[:1] == ["learn"]:  # the process is ours, and numpy not yet loaded
        reproducible.settle()
    if " ".join(words[:2]) in COMMANDS:  # a command of two words
        words[:2] = [" ".join(words[:2])]
    command = f" {words[0]}" if words and words[0] in COMMANDS else ""
    try:
        with _terminated_like_interrupted():
            args = _parser(words).parse_args(list(_joined(words)))
            code = int(args.run(args))
            sys.stdout.flush()  # at exit a reader that has left would be told in words of Python
            return code
    except UsageError as exc:
        _failed(command, str(exc))
        return 2
    except (UserError, GaitError) as exc:
        return _failed(command, str(exc))
    except BrokenPipeError:  # the reader of our output has left, which is its right
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as exc:
        return _failed(command, f"{exc.filename or 'file'}: {exc.strerror or exc}")
    except KeyboardInterrupt:
        return _failed(command, "interrupted")


@contextlib.contextmanager
def _terminated_like_interrupted() -> Iterator[None]:
    """Let SIGTERM end a command as Ctrl-C does, so that no temporary file stays behind."""
    if threading.current_thread() is not threading.main_thread():  # where handlers cannot be set
        yield
        return
    previous = signal.signal(signal.SIGTERM, _interrupted)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


def _interrupted(number: int, frame: FrameType | None) -> None:
    """Handle a signal as Python handles Ctrl-C."""
    raise KeyboardInterrupt


def _failed(command: str, text: str) -> int:
    print(f"gait{command}: {' '.join(text.split())}", file=sys.stderr)
    return 1


class _Parser(argparse.ArgumentParser):
    """Parser, of the commands too, that says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message}\n")


class _Version(argparse.Action):
    """Say the versions, for which the library is loaded, and end."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from gait.bindings.library import library, version_text  # here, as it loads numpy

        loaded = library()
        print(f"gait {__version__} libgait {version_text(loaded.gait_version())} abi {loaded.gait_abi()}")
        parser.exit()


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Parser of the command named first in `words` (so that only its imports cost time), else of all."""
    parser = _Parser(
        prog="gait",
        description="Learn how people walk from motion capture and track them in calibrated video.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="say the versions of package and library")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in words[:1] if words and words[0] in COMMANDS else COMMANDS:
        module = import_module(f"gait.cli.{COMMANDS[name]}")
        sub = commands.add_parser(
            module.NAME,
            help=module.HELP,
            description=module.__doc__ or module.HELP,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(sub)
        if getattr(module, "JSON", True):
            _offer(sub, "--json", "print the figures as JSON")
        _offer(sub, "--quiet", "no words and no progress on stderr")
        sub.set_defaults(run=module.run)
    return parser


def _joined(words: Sequence[str]) -> Iterator[str]:
    """Words with ``--option -x`` and ``--option -1,0,0`` as one, as argparse takes ``-x`` for an option."""
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
    """Add a switch that every command has, unless the command words it itself."""
    with contextlib.suppress(argparse.ArgumentError):
        parser.add_argument(option, action="store_true", help=text)
