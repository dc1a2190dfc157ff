"""Read pickles of lists, tuples, mappings, text, numbers and numpy arrays; no code in them is run."""

from __future__ import annotations

import io
import pickle
from typing import Any

_ARRAYS = {
    *(
        (f"numpy.{core}.multiarray", name)
        for core in ("core", "_core")
        for name in ("_reconstruct", "scalar")
    ),
    *(("numpy", name) for name in ("ndarray", "dtype")),
    ("_codecs", "encode"),
}


class _Plain(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _ARRAYS:
            raise ValueError(f"contains an object {module}.{name}")
        return super().find_class(module, name)


def load(data: bytes) -> Any:
    """Read a pickle. ValueError if it is damaged or contains anything but plain data."""
    try:
        return _Plain(io.BytesIO(bytes(data))).load()
    except (
        pickle.UnpicklingError,
        EOFError,
        AttributeError,
        ImportError,
        IndexError,
        KeyError,
        TypeError,
    ) as error:
        raise ValueError(str(error)) from None
