"""JavaScript modules of our pages, and the head of a page: with modules served, or embedded.

The modules import each other and their parts by plain names (``three``, ``gait/scene.js``), so the same files
work in both kinds of page; an import map has their places.  There is no bundler.
"""

from __future__ import annotations

import base64
import hashlib
import json
from pathlib import Path

from gait.web import parts

OWN = ("scene.js", "film.js", "curves.js")
"""Our modules, imported as ``gait/NAME``."""
_PLAIN = {"three": parts.THREE, "three/OrbitControls.js": parts.ORBIT}
_HERE = Path(__file__).parent


def available() -> bool:
    """Whether the parts that draw figures and curves were fetched."""
    return all(parts.find(part) is not None for part in (*_PLAIN.values(), parts.ECHARTS))


def own(name: str) -> str:
    """Text of a module of ours or of style.css."""
    return (_HERE / name).read_text(encoding="utf-8")


def served(drawing: bool = True) -> dict[str, bytes]:
    """Files to serve below ``/web/`` for a page with `served_head`, by name.

    Raises
    ------
    UserError
        If the parts were not fetched and are needed, for `drawing` figures or curves.
    """
    needed = (*_PLAIN.values(), parts.ECHARTS) if drawing else ()
    fetched = {part.file: parts.load(part) for part in needed}
    return fetched | {name: own(name).encode() for name in (*OWN, "style.css")}


def served_head(drawing: bool = True) -> tuple[str, str]:
    """Head of a page whose server has `served()`, and the sources of its scripts for a security policy.

    Returns
    -------
    head : str
        HTML: style, import map, and ECharts as ``window.echarts``.
    script_src : str
        What ``Content-Security-Policy: script-src`` has to allow.
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
    """Head of a page that needs no other file (2.9 MB): style, import map and ECharts written into it.

    Parameters
    ----------
    parts_too : bool
        False leaves out the parts and what needs them: of our modules film.js is left.

    Raises
    ------
    UserError
        If the parts were not fetched.
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
    """Write an object into a page; a module reads it by ``JSON.parse(document.getElementById(name)...)``.

    Parameters
    ----------
    name : str
        The element's id.
    data : object
        JSON without NaN, such as `gait.web.motion_data.motion_data` gives.
    """
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="{name}">{text}</script>'
