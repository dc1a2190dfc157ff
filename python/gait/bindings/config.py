"""Settings of the C library's objects, with the library's names, defaults, ranges and descriptions."""

from __future__ import annotations

import ctypes
import math
import operator
from collections.abc import Iterator, Sized
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from gait.bindings import abi
from gait.bindings.library import library, struct_fields

if TYPE_CHECKING:
    import numpy as np  # otherwise imported where it is used, since --help only needs the defaults
    from numpy.typing import ArrayLike, NDArray

    from gait.camera.camera import Camera

_C = TypeVar("_C", bound="Config")


@dataclass(frozen=True)
class Setting:
    """One setting of a config, as described by its table in the C header.

    Attributes
    ----------
    name : str
    text, unit : str
        Meaning; unit, or '' if it has none.
    low, high : float
        Range; NaN where a limit is not checked.
    default, paper : object
        Default; default in ``Mode.PAPER``.
    """

    name: str
    text: str
    unit: str
    low: float
    high: float
    default: Any
    paper: Any


class Config:
    """Settings of an object of the library, as attributes; immutable, see `replace`."""

    _of: ClassVar[str]  # struct
    _apart: ClassVar[frozenset[str]]  # fields that are no settings: other arguments fill them
    _values: dict[str, Any]

    def __init__(self, values: dict[str, Any]) -> None:
        object.__setattr__(self, "_values", values)

    @classmethod
    def _filled(cls, mode: int) -> Any:
        """Make the struct with the library's defaults."""
        fill, c = getattr(library(), cls._of.replace("_config", "_fill")), abi.STRUCTS[cls._of]()
        modes = [mode] if len(fill.argtypes) > 2 else []  # only a tracker has modes
        fill(c, ctypes.sizeof(c), *modes)
        return c

    @classmethod
    def _defaults(cls, mode: int = 0) -> dict[str, Any]:
        c = cls._filled(mode)
        values = {name: getattr(c, name) for name, *_ in c._fields_ if name not in cls._apart}
        return {name: tuple(v) if isinstance(v, ctypes.Array) else v for name, v in values.items()}

    def replace(self: _C, **changes: Any) -> _C:
        """Return a copy with `changes`.

        Raises
        ------
        TypeError
            If a change has a name that is no setting.
        """
        for name in changes:
            if name not in self._values:
                known = ", ".join(self._values)
                raise TypeError(f"{type(self).__name__} has no setting {name!r}; it has {known}")
        return type(self)(self._values | changes)

    @classmethod
    def settings(cls) -> tuple[Setting, ...]:
        """List every setting with its meaning, unit, range and defaults."""
        usual, paper = cls._defaults(0), cls._defaults(1)
        return tuple(
            Setting(row.name, row.text, row.unit, row.low, row.high, usual[row.name], paper[row.name])
            for row in struct_fields(cls._of)
            if row.name in usual
        )

    def _fill(self, c: Any) -> None:
        """Write the values to a struct; ValueError for a value that does not fit its field."""
        for name, value in self._values.items():
            _put(c, name, value)

    def __getattr__(self, name: str) -> Any:
        try:
            return object.__getattribute__(self, "_values")[name]
        except (AttributeError, KeyError):
            raise AttributeError(f"{type(self).__name__} has no setting {name!r}") from None

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable; use replace({name}=...)")

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        return iter(self._values.items())

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._values]

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self._values == other._values

    def __hash__(self) -> int:
        return hash(tuple(self._values.items()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self)})"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._values,)


def _put(c: Any, name: str, value: Any) -> None:
    """Set a field; ValueError for a number that does not fit it, which ctypes would truncate."""
    old = getattr(c, name)
    if isinstance(old, ctypes.Array):
        if not isinstance(value, Sized) or len(value) != len(old):
            raise ValueError(f"config {name}: give {len(old)} numbers")
        old[:] = value  # type: ignore[call-overload]
        return
    whole = isinstance(old, int)
    try:
        setattr(c, name, operator.index(value) if whole else value)
    except TypeError:
        raise ValueError(f"config {name} = {value!r}: give a {'whole ' * whole}number") from None
    if whole and getattr(c, name) != value:
        raise ValueError(f"config {name} = {value} is negative or too large")


class TrackerConfig(Config):
    """Settings of a tracker (``gait_tracker_config``); `default` returns the library's defaults.

    Every setting is an attribute; `settings` lists them with meaning, unit, range and default, as does the
    reference page.
    """

    _of = "gait_tracker_config"
    _apart = frozenset({"struct_size", "cameras", "camera", "exec"})

    @classmethod
    def default(cls, mode: abi.Mode | int = abi.Mode.DEFAULT, **changes: Any) -> TrackerConfig:
        """Return the library's defaults for `mode`, with `changes`.

        Raises
        ------
        TypeError
            If a change has a name that is no setting.
        """
        values = cls._defaults(int(mode))
        values |= {"mode": abi.Mode(values["mode"]), "terms": abi.Term(values["terms"])}
        return cls(values).replace(**changes)

    def to_c(self) -> Any:
        """Make a ``gait_tracker_config`` without cameras and tasks.

        ValueError for a value that does not fit its field.
        """
        c = self._filled(int(self.mode))
        self._fill(c)
        return c


class LiftConfig(Config):
    """Settings of a lifter (``gait_lift_config``) without the view; `default` returns the library's defaults.

    Every setting is an attribute; `settings` lists them with meaning, unit, range and default, as does the
    reference page.
    """

    _of = "gait_lift_config"
    _apart = frozenset({"struct_size", "projection", "camera", "axis"})

    @classmethod
    def default(cls, **changes: Any) -> LiftConfig:
        """Return the library's defaults, with `changes`.

        Raises
        ------
        TypeError
            If a change has a name that is no setting.
        """
        return cls(cls._defaults()).replace(**changes)

    def to_c(self, view: Camera | ArrayLike) -> Any:
        """Make a ``gait_lift_config`` for a camera, or for directions (2, 3) of u and v in the world."""
        from gait.camera.camera import Camera

        c = self._filled(0)
        self._fill(c)
        if isinstance(view, Camera):
            c.projection, c.camera = abi.Projection.PERSPECTIVE, view.to_c()
        else:
            c.projection = abi.Projection.ORTHOGRAPHIC
            for row, axis in zip(c.axis, _axes(view), strict=True):
                row[:] = axis
        return c


def _axes(view: ArrayLike) -> NDArray[np.float64]:
    """Check and convert the directions (2, 3) of u and v."""
    import numpy as np

    try:
        return np.asarray(view, np.float64).reshape(2, 3)
    except (TypeError, ValueError):
        raise TypeError(
            f"view is {view!r:.60}; give a Camera (Camera.read(FILE)), or the directions of u and v: two "
            "rows of three numbers"
        ) from None


def reference(config: type[Config]) -> str:
    """Write a table of the settings in Markdown: name, meaning, unit, range, default."""
    lines = [
        "| setting | meaning | unit | range | default | paper mode |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for item in config.settings():
        limits = "" if math.isnan(item.low) else f"{item.low:.10g} to {item.high:.10g}"
        paper = "" if item.paper == item.default else _written(item.paper)
        lines.append(
            f"| `{item.name}` | {item.text} | {item.unit} | {limits} | {_written(item.default)} | {paper} |"
        )
    return "\n".join(lines) + "\n"


def _written(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(_written(one) for one in value)
    return f"{value:g}" if isinstance(value, float) else str(value)
