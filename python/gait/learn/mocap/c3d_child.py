"""Read one .c3d with ezc3d in a separate process, because damaged files can crash that library.

Run as a script with the name of the file.  Writes labels, points (M, T, 3), rate, units, and the parameters
that the header also states, as .npz to stdout; an error is one line on stderr and exit code 1.
"""

import io
import sys
from typing import Any

import ezc3d
import numpy as np

#: Parameters that the header also states.
STATED = (
    *(("POINT", "USED"), ("POINT", "RATE"), ("POINT", "DATA_START"), ("POINT", "SCALE")),
    *(("ANALOG", "USED"), ("ANALOG", "RATE")),
)


def main(path: str) -> None:
    """Read `path` and write its points to stdout."""
    c3d = ezc3d.c3d(path)
    parameters, points = c3d["parameters"]["POINT"], c3d["data"]["points"]
    units = parameters["UNITS"]["value"] if "UNITS" in parameters else []
    labels = [label for k in ("", *range(2, 100)) for label in _labels(parameters, f"LABELS{k}")]
    stated: dict[str, Any] = {
        f"{group}:{name}": _number(c3d["parameters"], group, name) for group, name in STATED
    }
    buffer = io.BytesIO()
    np.savez(
        buffer,
        labels=np.array(labels[: points.shape[1]], str),
        points=np.moveaxis(points[:3], 0, 2),
        rate=float(c3d["header"]["points"]["frame_rate"]),
        units=units[0] if len(units) else "mm",
        **stated,
    )
    sys.stdout.buffer.write(buffer.getvalue())


def _labels(parameters: dict, key: str) -> list:  # type: ignore[type-arg]
    return list(parameters[key]["value"]) if key in parameters else []


def _number(parameters: dict, group: str, name: str) -> float:  # type: ignore[type-arg]
    """Return the first value of a parameter; 0 if it is missing."""
    value = parameters[group][name]["value"] if name in parameters.get(group, {}) else []
    return float(value[0]) if len(value) else 0.0


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except Exception as error:  # whatever ezc3d raises becomes the user's one line in the parent
        sys.exit(" ".join(str(error).split()) or type(error).__name__)
