"""The generated message classes of package ``gaitmsg`` (lcm_types/), wherever this installation has them."""

from __future__ import annotations

import functools
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from gait.errors import UserError

_HERE = Path(__file__).resolve().parent
_PLACES = (_HERE.parent / "lib", _HERE.parents[2] / "build" / "lcm" / "python")
"""Folders that may hold ``gaitmsg``: of an installed package, of the source tree."""


@functools.cache
def generated() -> ModuleType:
    """Import the package.

    Raises
    ------
    UserError
        If it has not been generated.
    """
    for place in (None, *_PLACES):
        if place is not None:
            if not (place / "gaitmsg" / "__init__.py").is_file():
                continue
            sys.path.append(str(place))
        try:
            return import_module("gaitmsg")
        except ModuleNotFoundError:
            continue
    raise UserError(f"gaitmsg: no generated LCM types in {_PLACES[-1]}; run make tools")


class _OnUse:
    """The package, imported when a class is asked for: the words of ``--help`` need none."""

    def __getattr__(self, name: str) -> Any:
        return getattr(generated(), name)


gaitmsg = _OnUse()
