"""Optional packages: which extra of libgait installs each, and the message when one is missing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec

EXTRAS = {
    "video": {
        "cv2": "OpenCV",
        "av": "PyAV",
        "scipy": "SciPy",
        "threadpoolctl": "threadpoolctl",
        "yaml": "PyYAML",
    },
    "lcm": {"lcm": "LCM"},
    "detect": {"ai_edge_litert": "LiteRT"},
    "report": {"matplotlib": "Matplotlib", "scipy": "SciPy"},
    "mocap": {"scipy": "SciPy", "ezc3d": "ezc3d", "threadpoolctl": "threadpoolctl"},
    "h5": {"h5py": "h5py"},
    "parquet": {"pyarrow": "PyArrow"},
    "rerun": {"rerun": "Rerun"},
    "mcap": {"mcap": "mcap"},
    "ros2": {"mcap_ros2": "mcap-ros2-support", "scipy": "SciPy"},
    "dask": {"distributed": "Dask"},
    "studio": {"starlette": "Starlette", "uvicorn": "uvicorn"},
}
"""Extra of pyproject.toml to what it brings: module to name of the package."""


def remedy(user: str, extras: Sequence[str], module: str | None = None) -> str:
    """Return one line: which packages `user` lacks and how to install them; empty if nothing is missing.

    Parameters
    ----------
    user : str
        Command or function that needs the extras.
    extras : sequence of str
    module : str, optional
        A module that could not be imported; if none of `extras` installs it, an extra that does is added.
    """
    if module == "numpy":  # without which nothing else works
        return f"{user} needs NumPy: pip install numpy"
    if module and not any(module in EXTRAS[extra] for extra in extras):
        extras = [*extras, *[extra for extra in EXTRAS if module in EXTRAS[extra]][:1]]
    lacking = {e: [label for m, label in EXTRAS[e].items() if find_spec(m) is None] for e in extras}
    labels = list(dict.fromkeys(label for found in lacking.values() for label in found))
    if not labels:
        return ""
    words = " and ".join(filter(None, [", ".join(labels[:-1]), labels[-1]]))
    return f"{user} needs {words}: pip install 'libgait[{','.join(e for e in lacking if lacking[e])}]'"


@contextmanager
def importing(user: str, *extras: str) -> Iterator[None]:
    """Name the packages that `user` lacks, and how to install them, if an import in this block fails."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(remedy(user, extras) or str(error), name=error.name) from None
