"""Exceptions of the package: errors that a user can fix, and errors of the C library."""

from __future__ import annotations


class UserError(Exception):
    """Bad input: one line naming the file, the field and the remedy.  Commands print it and exit 1."""


class UsageError(UserError):
    """Options that are out of range or do not go together.  Commands print it and exit 2."""


class LibraryError(UserError):
    """libgait could not be loaded, or the file found has another version or layout than this package."""


LONGEST_QUOTE = 40  # characters of a file that a message quotes


def quoted(text: str) -> str:
    """Quote text from a file in a message: shortened and printable, whatever the file contains."""
    return repr(text if len(text) <= LONGEST_QUOTE else text[:LONGEST_QUOTE] + "...")


def unreadable(path: object, error: OSError) -> UserError:
    """Make the error for a file that the system cannot open or read."""
    what = "its permissions" if isinstance(error, PermissionError) else "the name"
    return UserError(f"{path}: {error.strerror}; check {what}")


class GaitError(Exception):
    """A C call failed.

    Attributes
    ----------
    status : int
        The negative ``gait_result``.
    name : str
        Its name, such as ``"GAIT_ERR_CORRUPT"``.
    text : str
        One line of detail.
    index : int
        Camera, section or parameter concerned; -1 if none.
    """

    def __init__(self, status: int, name: str, text: str = "", index: int = -1) -> None:
        super().__init__(f"{name}: {text}" if text else name)
        self.status, self.name, self.text, self.index = int(status), name, text, index


class GaitArgumentError(GaitError, ValueError):
    """``GAIT_ERR_ARG``: an argument is not finite or outside its documented range."""


class GaitLimitError(GaitError, ValueError):
    """``GAIT_ERR_LIMIT``: a count or size is out of range, such as that of particles, tasks or cameras."""
