"""Weights of the detector: files of two published packages.

The networks are BlazePose's (Bazarevsky and others 2020; Google, Apache-2.0).  They are contained in the
Python package ``mediapipe`` and the npm package ``@mediapipe/pose``, which are downloaded but not installed.
"""

from __future__ import annotations

from gait.io.published import Published, Store

FETCH = "run gait detect --fetch once, with a network connection"
"""How a user gets the weights."""

_WHEEL, _NPM = "mediapipe==0.10.21", "@mediapipe/pose@0.5.1675469404"
PERSON = Published(
    "pose_detection.tflite",
    _WHEEL,
    "mediapipe/modules/pose_detection/pose_detection.tflite",
    "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
)
LANDMARK_NETWORKS = {
    "full": Published(
        "pose_landmark_full.tflite",
        _WHEEL,
        "mediapipe/modules/pose_landmark/pose_landmark_full.tflite",
        "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    ),
    "lite": Published(
        "pose_landmark_lite.tflite",
        _NPM,
        "package/pose_landmark_lite.tflite",
        "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61",
    ),
    "heavy": Published(
        "pose_landmark_heavy.tflite",
        _NPM,
        "package/pose_landmark_heavy.tflite",
        "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe",
    ),
}
"""Landmark networks by name; `full` is the default, `lite` faster, `heavy` slower."""

STORE = Store(
    "weights",
    "GAIT_WEIGHTS",
    "the detector's weights",
    FETCH,
    (PERSON, *LANDMARK_NETWORKS.values()),
    f"BlazePose networks by Google, licence Apache-2.0 (LICENSE), from {_WHEEL} and {_NPM}.\n",
)
find, load, fetch = STORE.find, STORE.load, STORE.fetch
