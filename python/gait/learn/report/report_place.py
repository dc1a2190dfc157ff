"""Where a report may be written: no page of somebody else's is replaced."""

from __future__ import annotations

import html
from pathlib import Path

from gait.errors import UserError

PAGE = "index.html"
MARK = ": gait learn</title>"  # ends the title of our pages
HEAD = 4096  # bytes of a page in which its title ends


def title(activity: str) -> str:
    """Title of the page, by which it is known again."""
    return f"<title>{html.escape(activity)}{MARK}"


def require_own(folder: Path) -> None:
    """Refuse a folder whose page is not one of `gait learn`; for long work, call it before the work.

    Raises
    ------
    UserError
    """
    page = folder / PAGE
    if not page.exists():
        return
    try:
        with page.open("rb") as file:
            own = MARK.encode() in file.read(HEAD)
    except OSError as error:
        raise UserError(f"--report {folder}: {PAGE}: {error.strerror}; choose another folder") from error
    if not own:
        raise UserError(
            f"--report {folder}: {PAGE} there was not made by gait learn; choose another folder, or remove it"
        )
