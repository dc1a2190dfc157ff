"""One body for all recordings of a person with markers: stretches that all of them tell together.

The optimum of a joint fit, by one Gauss-Newton step: what the recordings tell about their own optima adds up,
and with it what is known of people.  Places of markers are each recording's own, as they are put on anew.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gait.learn.corpus.stage import Prepared, Task
from gait.learn.reading import Reading
from gait.learn.solve.readers import MARKED
from gait.learn.solve.stretch_information import NOTHING, PEOPLE, Information, odds

Floats = npt.NDArray[np.float64]

TRUST = np.log(10)  # names tell people apart ten times as often as they do not
MOST_NAMES = 4  # of files in a line


@dataclass(frozen=True)
class Shared:
    """Stretches (S,) of a person and the number of recordings that tell them."""

    stretch: Floats
    recordings: int


@dataclass
class _Body:
    """What its recordings tell of a body, and their files (indices)."""

    told: Information = NOTHING
    files: list[int] = field(default_factory=list)

    def add(self, file: int, found: Information) -> None:
        self.told += found
        self.files.append(file)


def shared(
    paths: Sequence[Path],
    persons: Sequence[str],
    reading: Reading,
    done: Callable[[list[Task]], Generator[Prepared, None, None]],
    tell: Callable[[str], None],
    progress: Callable[[int], None],
) -> list[Shared | None]:
    """Measure who has several recordings of markers; None for files that are fitted by themselves.

    The result does not depend on the order of the files.

    Parameters
    ----------
    persons : sequence of str
        Whose the files are.
    done : callable
        Gives the outcomes of tasks in their order.
    tell : callable
        Gets a line about each body that is not the person's others'.
    progress : callable
        Gets the number of files done.
    """
    result: list[Shared | None] = [None] * len(paths)
    marked = [i for i, path in enumerate(paths) if path.suffix.lower() in MARKED]
    count = Counter(persons[i] for i in marked)
    order = [(persons[i], os.path.abspath(path)) for i, path in enumerate(paths)]
    several = sorted((i for i in marked if count[persons[i]] > 1), key=lambda i: order[i])
    with closing(done([Task(paths[i], reading, measuring=True) for i in several])) as outcomes:
        for person, files in groupby(enumerate(several, 1), key=lambda item: persons[item[1]]):
            bodies: list[_Body] = []
            for number, file in files:
                found = next(outcomes).stretches
                if found is not None:
                    _choose(bodies, found).add(file, found)
                progress(number)
            for body in bodies:
                if len(body.files) > 1:
                    stretch = Shared((PEOPLE + body.told).mean(), len(body.files))
                    for i in body.files:
                        result[i] = stretch
            for line in _strangers(person, [[paths[i] for i in body.files] for body in bodies]):
                tell(line)
    return result


def _choose(bodies: list[_Body], found: Information) -> _Body:
    """Body that a recording is most likely of; a new one if that is likelier."""
    each = [odds(body.told, found) for body in bodies]
    if not each or max(each) < -TRUST:
        bodies.append(_Body())
        return bodies[-1]
    return bodies[int(np.argmax(each))]


def _strangers(person: str, bodies: list[list[Path]]) -> list[str]:
    """Lines about the recordings that are not of the body of most."""
    most = max(bodies, key=len, default=[])
    return [
        f"{_listed(files)}: limbs of other lengths than in {most[0]}, which is taken for {person!r} too; "
        "measured apart. If these are two people, see --subjects"
        for files in bodies
        if files is not most
    ]


def _listed(files: list[Path]) -> str:
    """Name the first few."""
    return " ".join(map(str, files[:MOST_NAMES])) + " ..." * (len(files) > MOST_NAMES)
