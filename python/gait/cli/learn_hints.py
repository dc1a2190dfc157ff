"""What gait learn tells of its input that is no error but may not be meant."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from gait.learn.mocap import marker_map
from gait.learn.mocap.marker_sets import plain
from gait.learn.mocap.remarks import Noticed
from gait.learn.solve.readers import MARKED

MOST_NAMES = 6  # of labels


def idle_map(markers: Path | None, files: Iterable[Path]) -> Iterator[str]:
    """Say that a mapping is of no use, before the files are read."""
    if markers and not any(path.suffix.lower() in MARKED for path in files):
        yield f"--markers {markers}: not used: no file is a {' or '.join(MARKED)}"


def hints(markers: Path | None, noticed: Noticed) -> Iterator[str]:
    """Say what was noticed while the files were read; a mapping may serve several sets, but not a typo."""
    if markers and noticed.labels:
        absent = [repr(name) for name in marker_map.named(markers) if plain(name) not in noticed.labels]
        if absent:
            names = ", ".join(absent[:MOST_NAMES]) + (" ..." if len(absent) > MOST_NAMES else "")
            yield f"--markers {markers}: no file read has a marker {names}; check the spelling"
    if noticed.zeros:
        (path, zeros), others = noticed.zeros[0], len(noticed.zeros) - 1
        more = f" (and so on in {others} more file{'s' * (others > 1)})" if others else ""
        yield f"{path}: exactly 0: {zeros}{more}; if that is missing data, give --zeros-missing"
