"""Draw the coordinate frames and the phase dial: figures.py [FOLDER] (make screenshots).

Everything drawn is computed: the bodies are the shipped model's, and a camera of the package projects them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

import gait
from gait.body.skeleton import BONES

ToPage = Callable[[np.ndarray], np.ndarray]
DOC = Path(__file__).resolve().parents[1]
LEFT, RIGHT, MIDDLE = "#0072b2", "#b34a00", "#3f444c"
STYLE = """<style>
  text { fill: #1c2733; font: 15px sans-serif }
  .small { font-size: 13px; fill: #46525e }
  .axis { stroke-width: 3; fill: none }
  .faint { stroke: #c3ccd6; stroke-width: 1; fill: none }
</style>
<rect width="100%" height="100%" fill="#ffffff"/>"""


def svg(width: int, height: int, title: str, body: list[str]) -> str:
    """Whole file."""
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">'
    return "\n".join([head, f"<title>{title}</title>", STYLE, *body, "</svg>\n"])


def line(points: np.ndarray, colour: str, width: float = 2.0, extra: str = "") -> str:
    """Polyline."""
    text = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{text}" stroke="{colour}" stroke-width="{width}" fill="none" {extra}/>'


def text(at: np.ndarray | tuple[float, float], words: str, extra: str = "") -> str:
    """Words."""
    return f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" {extra}>{words}</text>'


def arrow(start: np.ndarray, end: np.ndarray, colour: str, width: float = 3.0) -> str:
    """Line with a head."""
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    across = np.array([-along[1], along[0]])
    head = [end, end - 11 * along + 5 * across, end - 11 * along - 5 * across]
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in head)
    shaft = line(np.array([start, end - 8 * along]), colour, width)
    return f'{shaft}<polygon points="{corners}" fill="{colour}"/>'


def body(model: gait.Model, phase: float, heading: float = 0.0, place: tuple[float, float] = (0, 0)) -> dict:
    """Joints of the average person at a phase, metres."""
    state = gait.State(phase=phase, stature=1.75, heading=heading, stride_hz=model.info.stride_hz)
    state.pelvis = np.array([*place, model.pelvis_height(state)])
    joints, _ = model.pose(state)
    return dict(zip(model.joint_names, np.asarray(joints, float).reshape(-1, 3), strict=True))


def figure(joints: dict, to_page: ToPage, width: float = 4.0) -> list[str]:
    """Stick figure, the left side first, which is farther away in a view from the right."""
    out = []
    for side in ("l", "", "r"):
        colour = {"r": RIGHT, "l": LEFT}.get(side, MIDDLE)
        for a, b in BONES:
            own = a[0] if a[1] == "_" else b[0] if b[1] == "_" else ""
            if own == side and a in joints and b in joints:
                dash = 'stroke-dasharray="7 4"' if side == "r" else ""
                ends = np.array([to_page(joints[a]), to_page(joints[b])])
                out.append(line(ends, colour, width, f'stroke-linecap="round" {dash}'))
    return out


def frames(model: gait.Model) -> str:
    """World, heading, camera and picture."""
    viewer = gait.Camera.looking((1.2, -7.0, 2.9), (0.55, -0.6, 0.62), (900, 480), 900.0)

    def page(point: ArrayLike) -> np.ndarray:
        return viewer.project(np.asarray(point, float))

    out = []
    for k in range(-2, 4):
        out.append(line(np.array([page((k, y, 0)) for y in (-3, 2)]), "#c3ccd6", 1))
    for k in range(-3, 3):
        out.append(line(np.array([page((x, k, 0)) for x in (-2, 3)]), "#c3ccd6", 1))
    origin = page((0, 0, 0))
    for end, name, colour in (
        ((1.2, 0, 0), "x", "#c1121f"),
        ((0, 1.2, 0), "y", "#2a7f3f"),
        ((0, 0, 1.2), "z", "#1d4ed8"),
    ):
        out += [arrow(origin, page(end), colour), text(page(np.array(end) * 1.08), name)]
    out.append(text(origin + [-150, 34], "world: origin on the floor, z up", 'class="small"'))
    place, heading = np.array([1.5, 0.4, 0.0]), np.radians(40)
    out += figure(body(model, 0.05, heading, tuple(place[:2])), page, 4)
    ahead = np.array([np.cos(heading), np.sin(heading), 0])
    out.append(arrow(page(place), page(place + 1.3 * ahead), "#111111"))
    out.append(
        line(np.array([page(place), page(place + [1.1, 0, 0])]), "#c1121f", 1.5, 'stroke-dasharray="5 4"')
    )
    turn = np.linspace(0, heading, 20)
    out.append(
        line(
            np.array([page(place + 0.75 * np.array([np.cos(a), np.sin(a), 0])) for a in turn]), "#111111", 1.5
        )
    )
    out.append(text(page(place + [0.95, 0.28, 0]) + [4, 4], "heading"))
    out.append(text(page(place + 1.35 * ahead) + [-10, -10], "walks this way", 'class="small"'))
    camera = gait.Camera.looking((-1.5, -2.0, 1.25), (1.2, 0.4, 0.9), (640, 480), 600.0)
    centre, depth = camera.centre, 0.8
    corners = [(0, 0), (639, 0), (639, 479), (0, 479)]
    rays = camera.rays(corners)
    far = centre + rays * (depth / (rays @ camera.R[2]))[:, None]
    out += [line(np.array([page(centre), page(corner)]), "#7a8794", 1) for corner in far]
    out.append(line(np.array([page(corner) for corner in [*far, far[0]]]), "#46525e", 2))
    for row, name, colour, length in (
        (0, "x", "#c1121f", 0.5),
        (1, "y", "#2a7f3f", 0.45),
        (2, "z", "#1d4ed8", 1.3),
    ):
        end = centre + length * camera.R[row]
        out += [arrow(page(centre), page(end), colour, 2), text(page(end) + [5, 5], name, 'class="small"')]
    out.append(text(page(centre) + [-88, 92], "camera: x right, y down, z ahead;"))
    out.append(text(page(centre) + [-88, 112], "R and t take the world's points to it"))
    for end, name in (((330, 0), "u"), ((0, 300), "v")):
        ray = camera.rays([end])[0]
        at = centre + ray * depth / (ray @ camera.R[2])
        out += [arrow(page(far[0]), page(at), "#111111", 2), text(page(at) + [4, -6], name)]
    out.append(text(page(far[0]) + [-16, -12], "pixel (0, 0): top left", 'class="small"'))
    return svg(900, 480, "World, heading, camera and picture", out)


def dial(model: gait.Model) -> str:
    """Phase dial: eight bodies of a stride, seen from their right."""
    out, middle, radius = [], np.array([380.0, 320.0]), 130.0
    out.append(
        f'<circle cx="{middle[0]}" cy="{middle[1]}" r="{radius}" fill="#f4f5f7" '
        'stroke="#46525e" stroke-width="2"/>'
    )
    for start, end, colour, r in ((0.0, 0.62, RIGHT, 112), (0.5, 1.12, LEFT, 98)):
        turn = 2 * np.pi * np.linspace(start, end, 60)
        arc = middle + r * np.column_stack([np.sin(turn), -np.cos(turn)])
        out.append(line(arc, colour, 8, 'stroke-dasharray="9 4"' if colour == RIGHT else ""))
    for k in range(8):
        phase = k / 8
        way = np.array([np.sin(2 * np.pi * phase), -np.cos(2 * np.pi * phase)])
        out.append(line(middle + np.outer([radius - 6, radius + 6], way), "#46525e", 2))
        out.append(text(middle + 76 * way + [-14, 5], f"{phase:.3g}", 'class="small"'))
        joints, at = body(model, phase), middle + 225 * way * [1.18, 1.0]

        def page(point: np.ndarray, at: np.ndarray = at, low: np.ndarray = joints["pelvis"]) -> np.ndarray:
            return at + 62 * np.array([point[0] - low[0], -(point[2] - 0.9)])

        out += figure(joints, page, 3.4)
    tip = middle + 62 * np.array([np.sin(0.6), -np.cos(0.6)])
    out.append(arrow(middle, tip, "#111111"))
    out.append(text(middle + [150, -265], "phase 0: right heel strike"))
    out.append(text(middle + [150, 285], "phase 0.5: left heel strike"))
    out.append(text((20, 30), "right: orange, dashed", f'style="fill:{RIGHT}"'))
    out.append(text((20, 52), "left: blue", f'style="fill:{LEFT}"'))
    out.append(text(middle + [-48, 22], "arcs: foot on", 'class="small"'))
    out.append(text(middle + [-48, 38], "the floor", 'class="small"'))
    return svg(760, 640, "Phase of the stride as a clock face", out)


def main() -> int:
    """Write the figures."""
    folder, model = Path(sys.argv[1]) if len(sys.argv) > 1 else DOC, gait.Model()
    for name, draw in (("frames.svg", frames), ("phase.svg", dial)):
        (folder / name).write_text(draw(model), encoding="utf-8")
        print(folder / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
