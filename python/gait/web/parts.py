"""Third-party components of web pages: three.js draws the 3-D figure, ECharts the curves.

They are contained in the Python package ``nicegui``, which is downloaded but not installed.
"""

from __future__ import annotations

from gait.io.published import Published, Store

FETCH = "run gait studio --fetch once, with a network connection"
"""How a user gets the parts."""

_WHEEL = "nicegui==2.24.2"
THREE = Published(
    "three.module.js",
    _WHEEL,
    "nicegui/elements/lib/three/three.module.js",
    "bdbe1d0133b5e8e02bd6299abc75338ab32e5225c0db39f4f3e76a22cbbeb156",
)
ORBIT = Published(
    "OrbitControls.js",
    _WHEEL,
    "nicegui/elements/lib/three/modules/OrbitControls.js",
    "80efaadea4f8a636a65fb0bd08bfef62f3d93a0bb94e2e7500f23176c5c07f4e",
)
ECHARTS = Published(
    "echarts.min.js",
    _WHEEL,
    "nicegui/elements/lib/echarts/echarts.min.js",
    "e84270bd0cd5bdf60fefc26d00c2a391cb2e81f4d26a7a9ee16185a54773a3cf",
)
STORE = Store(
    "web",
    "GAIT_WEB",
    "components of web pages",
    FETCH,
    (THREE, ORBIT, ECHARTS),
    f"""From {_WHEEL} (MIT, LICENSE):
three.module.js, OrbitControls.js: three.js r168, copyright 2010-2024 Three.js Authors, licence MIT, the
  text of LICENSE with that copyright.
echarts.min.js: Apache ECharts 5.6.0, licence Apache-2.0 (http://www.apache.org/licenses/LICENSE-2.0).
The head of each file has its notice, which stays in pages that hold the file.
""",
)
find, load, fetch = STORE.find, STORE.load, STORE.fetch
