"""JavaScript modules of our pages, and the head of a page: with modules served, or embedded.

The modules import each other and third-party parts by plain names (``three``, ``gait/scene.js``), which an
import map resolves, so the same files work in both kinds of page.  There is no bundler.
"""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path

from gait.web import parts

OWN = ("scene.js", "flat.js", "film.js", "curves.js")
"""Our modules, imported as ``gait/NAME``."""
_PLAIN = {"three": parts.THREE, "three/OrbitControls.js": parts.ORBIT}
_HERE = Path(__file__).parent


def available() -> bool:
    """Whether the parts that draw figures and curves have been downloaded."""
    return all(parts.find(part) is not None for part in (*_PLAIN.values(), parts.ECHARTS))


def own(name: str) -> str:
    """Read the text of one of our modules, or of style.css."""
    return (_HERE / name).read_text(encoding="utf-8")


def served(drawing: bool = True) -> dict[str, bytes]:
    """Return the files to serve below ``/web/`` for a page with `served_head`, by name.

    Raises
    ------
    UserError
        If the parts, needed for `drawing` figures or curves, have not been downloaded.
    """
    needed = (*_PLAIN.values(), parts.ECHARTS) if drawing else ()
    fetched = {part.file: parts.load(part) for part in needed}
    return fetched | {name: own(name).encode() for name in (*OWN, "style.css")}


def served_head(drawing: bool = True) -> tuple[str, str]:
    """Make the head of a page whose server has `served()`, and the allowed sources of its scripts.

    Returns
    -------
    head : str
        HTML: style, import map, and ECharts as ``window.echarts``.
    script_src : str
        What ``Content-Security-Policy: script-src`` must allow.
    """
    imports = {name: f"/web/{part.file}" for name, part in _PLAIN.items()}
    imports |= {f"gait/{name}": f"/web/{name}" for name in OWN}
    text = json.dumps({"imports": imports})
    digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
    head = f'<link rel="stylesheet" href="/web/style.css">\n<script type="importmap">{text}</script>'
    if drawing:
        head += f'\n<script src="/web/{parts.ECHARTS.file}"></script>'
    return head, f"'self' 'sha256-{digest}'"


def inlined_head(parts_too: bool = True) -> str:
    """Make the head of a self-contained page (2.9 MB), with style, import map and ECharts embedded.

    Parameters
    ----------
    parts_too : bool
        False omits the parts and the modules that need them, so that only film.js is embedded.

    Raises
    ------
    UserError
        If the parts have not been downloaded.
    """
    modules = {name: parts.load(part) for name, part in _PLAIN.items() if parts_too}
    modules |= {f"gait/{name}": own(name).encode() for name in (OWN if parts_too else ("film.js",))}
    imports = {
        name: "data:text/javascript;base64," + base64.b64encode(data).decode()
        for name, data in modules.items()
    }
    head = (
        f"<style>\n{own('style.css')}</style>\n"
        f'<script type="importmap">{json.dumps({"imports": imports})}</script>\n'
    )
    if not parts_too:
        return head
    echarts = parts.load(parts.ECHARTS).decode().replace("</script", "<\\/script")
    return f"{head}<script>{echarts}</script>"


def inlined_json(name: str, data: object) -> str:
    """Embed an object in a page; a module reads it with ``JSON.parse(document.getElementById(name)...)``.

    Parameters
    ----------
    name : str
        The element's id.
    data : object
        JSON without NaN, such as from `gait.web.motion_data.motion_data`.
    """
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'
