"""Make a clip: images and ground truth, written to a folder."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gait._version import __version__
from gait.bindings.initial import DEFAULT_SD
from gait.camera.path import CameraPose, write_path
from gait.io.files import making, replacing, require_folder, require_writable
from gait.io.video import VideoWriter, write_picture
from gait.motion.footfalls import Strikes
from gait.simulate.body import BONE_INDEX, SIDES
from gait.simulate.geometry import Array, Ints, Picture
from gait.simulate.render import DEFOCUS_PX, SHUTTER, Renderer, develop, light
from gait.simulate.scenario import COMPANY, Scenario
from gait.simulate.scene import Scene, build_scene
from gait.simulate.stage import Set, Stage, build_set, set_stage
from gait.simulate.walk import TOE_OFF, Walk

CRF = 14
FORWARD_MOTIONS = "walk", "turn"  # motions in which a person always walks forwards


def find_events(stage: Stage) -> dict[str, Array]:
    """Return heel strikes and toe-offs as fractional frames, including those just outside the clip.

    A heel strike is when the heel is furthest ahead of the pelvis, a toe-off when the toe is furthest behind
    it (Zeni et al. 2008), on the fine time grid.
    """
    walk = stage.walk
    if stage.scenario.motion not in FORWARD_MOTIONS:
        return planned_events(stage)
    points = walk.points()
    ahead = np.column_stack([np.cos(walk.heading), np.sin(walk.heading)])
    per_frame, first = walk.timing.per_frame, stage.frames[0]
    out = {}
    for side in SIDES:
        for joint, event, sign in (("heel", "heel_strike", 1), ("toe", "toe_off", -1)):
            reach = sign * ((points[f"{side}_{joint}"] - points["pelvis"])[:, :2] * ahead).sum(1)
            out[f"{side}_{event}"] = (_peaks(reach, walk) - first) / per_frame
    return out


def planned_events(stage: Stage) -> dict[str, Array]:
    """Return the planned events: a foot lands (heel_strike) and leaves the floor (toe_off).

    In a walk backwards, whose phase falls, it lands at the phase of a toe-off and leaves at that of a strike.
    """
    timing, first = stage.walk.timing, stage.frames[0]
    index = np.arange(len(timing.phase), dtype=float)
    forwards = timing.phase[-1] > timing.phase[0]
    out = {}
    for side in SIDES:
        phase = timing.of_side(side)
        phase, at = (phase, index) if forwards else (phase[::-1], index[::-1])
        moving = np.append(True, np.diff(phase) > 0)
        lands, leaves = (0.0, TOE_OFF) if forwards else (TOE_OFF, 0.0)
        for event, share in (("heel_strike", lands), ("toe_off", leaves)):
            whole = np.arange(np.ceil(phase[0] - share), np.floor(phase[-1] - share) + 1) + share
            out[f"{side}_{event}"] = np.sort(
                (np.interp(whole, phase[moving], at[moving]) - first) / timing.per_frame
            )
    return out


def _peaks(value: Array, walk: Walk) -> Array:
    """Return grid positions of the largest value in each stride, refined by a parabola."""
    half = int(0.35 / (walk.timing.step * np.gradient(walk.timing.phase, walk.timing.step).mean()))
    inner = np.arange(half, len(value) - half)
    windows = np.lib.stride_tricks.sliding_window_view(value, 2 * half + 1)
    top = inner[windows[: len(inner)].argmax(1) == half]
    a, b, c = value[top - 1], value[top], value[top + 1]
    curve = a - 2 * b + c
    return top + np.where(curve < 0, 0.5 * (a - c) / np.where(curve < 0, curve, -1), 0)


def cycles_at(strikes: Array, frames: Array) -> Array:
    """Return the unwrapped phase at frames: whole numbers at right heel strikes, linear in between."""
    return np.interp(frames, strikes, np.arange(len(strikes), dtype=float))


def write_truth(path: Path, stage: Stage, strikes: Array) -> None:
    """Write joints (metres, world) and their pixels, heading, speed, phase and some angles of every frame."""
    walk, frames = stage.walk, stage.frames
    count = np.arange(len(frames), dtype=float)
    heading = _wrapped(walk.heading[frames])
    steady = stage.scenario.motion in FORWARD_MOTIONS
    columns: dict[str, Array] = {
        "phase": (cycles_at(strikes, count) if steady else walk.timing.phase[frames]) % 1.0,
        "heading_rad": heading,
        "pelvis_yaw_rad": _wrapped(heading + walk.pelvis_yaw[frames]),
        "speed_m_s": walk.speed[frames],
    }
    for name, place in walk.points(frames).items():
        uv = stage.project(place)
        for axis, values in zip("xyzuv", (*place.T, *uv.T), strict=True):
            columns[f"{name}_{axis}"] = values
    columns |= _angles(walk, frames)
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="ascii") as file:
        writer = csv.writer(file)
        named = [] if steady else ["motion_class"]
        writer.writerow(["frame", "time", *columns, *named])
        for i in range(len(frames)):
            row = [f"{values[i]:.6f}" for values in columns.values()]
            writer.writerow(
                [i, f"{i / stage.scenario.fps:.6f}", *row, *([stage.classes[i]] if named else [])]
            )


def _wrapped(angle: Array) -> Array:
    return (angle + np.pi) % (2 * np.pi) - np.pi


def _angles(walk: Walk, frames: Ints) -> dict[str, Array]:
    """Return hinge angles and pitches in degrees, flexion and forward positive."""
    turns = walk.turns[frames]
    out = {}
    for side in SIDES:
        for name, upper, lower in (("knee", "thigh", "shank"), ("elbow", "upper_arm", "forearm")):
            a, b = (turns[:, BONE_INDEX[f"{side}_{bone}"], :, 2] for bone in (upper, lower))
            out[f"{side}_{name}_flexion_deg"] = np.degrees(np.arccos(np.clip((a * b).sum(1), -1, 1)))
        for name, bone in (("thigh", "thigh"), ("upperarm", "upper_arm")):
            down = -turns[:, BONE_INDEX[f"{side}_{bone}"], :, 2]
            heading = walk.heading[frames]
            ahead = down[:, 0] * np.cos(heading) + down[:, 1] * np.sin(heading)
            out[f"{side}_{name}_pitch_deg"] = np.degrees(np.arctan2(ahead, -down[:, 2]))
    return out


def first_state(stage: Stage, strikes: Array) -> dict[str, Any]:
    """Return the init file: the truth at frame 0 with an error drawn from its own standard deviations."""
    rng, walk, at = stage.scenario.stream("init"), stage.walk, stage.frames[0]
    cycles = cycles_at(strikes, np.array([0.0, 1.0]))
    if stage.scenario.motion not in FORWARD_MOTIONS:
        cycles = walk.timing.phase[at] + np.array([0.0, walk.timing.stride_hz / stage.scenario.fps])
    truth = {
        "heading_rad": float(_wrapped(walk.heading[at])),
        "phase": float(cycles[0] % 1),
        "stride_hz": float(abs(cycles[1] - cycles[0]) * stage.scenario.fps),
        "stature_m": stage.body.stature,
    }
    pelvis = walk.origins[at, 0] + DEFAULT_SD["pelvis"] * rng.standard_normal(3)
    noisy = {key: value + DEFAULT_SD[key] * float(rng.standard_normal()) for key, value in truth.items()}
    noisy["phase"] %= 1.0
    rounded = {key: round(value, 5) for key, value in noisy.items()}
    return {"frame": 0, "pelvis": pelvis.round(5).tolist(), **rounded, "sd": dict(DEFAULT_SD)}


def describe(stage: Stage, made: Set, events: dict[str, Array], seed: int) -> dict[str, Any]:
    """Return a person's meta.json: how the clip was made, from which seed, and what they do in it."""
    scenario, walk, frames = stage.scenario, stage.walk, stage.frames
    inside = {
        name: [round(float(t), 3) for t in times if 0 <= t <= len(frames) - 1]
        for name, times in events.items()
    }
    strides = Strikes(events["r_heel_strike"], np.zeros(0)).strides() / scenario.fps
    pelvis = walk.origins[frames, 0]
    tall = _height_px(stage)
    about = {
        "clip": f"gait simulate, seed {seed}",
        "fps": scenario.fps,
        "frames": scenario.frames,
        "width": stage.camera.width,
        "height": stage.camera.height,
        "motion": _source(scenario.gait),
        "steady": scenario.motion in FORWARD_MOTIONS,
        "moving": scenario.moving,
        "view": scenario.view,
        "direction": "left to right" if scenario.direction == "lr" else "right to left",
        "background": "procedural, clutter" if scenario.clutter else "procedural",
        "calibration": "exact",
        "body": "lofted and skinned mesh with its own skeleton"
        + (", proportions drawn from the model's people" if scenario.body == "drawn" else ""),
        "asymmetry_percent": scenario.asymmetry,
        "aid": scenario.aid,
        "clothing": made.appearance.notes,
        "difficulty": [word for word in ("pole", "clutter") if getattr(scenario, word)],
        "poles": _pole(stage, made),
        "mean_speed_m_s": round(float(walk.speed[frames].mean()), 4),
        "stride_period_s": round(float(strides.mean()), 4),
        "stride_period_sd_s": round(float(strides.std()), 4),
        "net_displacement_m": (pelvis[-1] - pelvis[0]).round(3).tolist(),
        "events_video_frames": inside,
        "contacts_video_frames": {
            name: [round(float(t), 3) for t in times if 0 <= t <= len(frames) - 1]
            for name, times in planned_events(stage).items()
        },
        "events_note": "fractional 0-based video frames; heel strike: heel furthest ahead of the pelvis "
        "(Zeni); toe-off: toe (MTP) furthest behind; contacts: as the walk was planned; "
        "backwards: heel strike and toe-off are where the foot lands and leaves, as planned",
        "limb_lengths_m": {key: round(value, 4) for key, value in stage.body.lengths.items()},
        "stature_m": round(stage.body.stature, 4),
        "person_height_px": [round(float(q)) for q in np.percentile(tall, (0, 50, 100))],
    }
    return about | {
        "noise_sigma": scenario.noise,
        "defocus_sigma_px": DEFOCUS_PX,
        "shutter_fraction_of_frame": SHUTTER,
        "flicker": scenario.flicker,
        "crf": CRF,
        "seed": seed,
        "generator": f"gait {__version__}",
        "license": "BSD-3-Clause, as libgait: motion, body, clothes and scene are generated",
    }


def _source(gait: str) -> str:
    return "normative gait cycle" if gait == "generator" else f"curves of {Path(gait).name}"


def _height_px(stage: Stage) -> Array:
    """Return the picture height of the person from the lower heel to the head's top, per frame."""
    points = {name: stage.project(xyz)[:, 1] for name, xyz in stage.walk.points(stage.frames).items()}
    low = np.max([points[name] for name in ("l_heel", "r_heel", "l_toe", "r_toe")], axis=0)
    return low - points["head_top"]


def _pole(stage: Stage, made: Set) -> list[dict[str, Any]]:
    """Return position and effect of the pole: frames in which it hides joints, and largest share hidden."""
    pole = made.layout.pole
    if pole is None:
        return []
    uv = stage.camera.project(np.stack(list(stage.walk.points(stage.frames).values()), axis=1))
    column, row = np.moveaxis(np.rint(np.nan_to_num(uv)).astype(int), -1, 0)
    inside = (column >= 0) & (row >= 0) & (column < stage.camera.width) & (row < stage.camera.height)
    front = made.scene.front[
        np.clip(row, 0, stage.camera.height - 1), np.clip(column, 0, stage.camera.width - 1)
    ]
    share = ((front > 0.5) & inside).mean(1)
    hit = np.flatnonzero(share > 0)
    centre = 0.5 * (pole.low + pole.high)
    return [
        {
            "x": round(float(centre[0]), 3),
            "y": round(float(centre[1]), 3),
            "radius_m": round(float(0.5 * (pole.high[0] - pole.low[0])), 3),
            "frames": [int(hit[0]), int(hit[-1])] if len(hit) else [],
            "most_joints_hidden": round(float(share.max()), 2),
        }
    ]


CLIP_FILES = (
    "video.mp4",
    "background.png",
    "camera.json",
    "truth.csv",
    "init.json",
    "meta.json",
    "contact.jpg",
)
_POSES = "poses.csv"  # instead of the empty scene, if the camera moves
_PERSON = ("truth.csv", "init.json", "meta.json")  # for each person; names for the first have no number
_CAMERA = ("video.mp4", "background.png", "camera.json")  # for each camera; the same
_CONTACTS = (3, 2)  # pictures across and down in contact.jpg


def pictures(stage: Stage, made: Set, number: int = 1) -> Iterator[Picture]:
    """Yield the frames of a camera, (h, w, 3) BGR; each depends only on the scenario and its own number.

    `number`: number of the camera, from 1.
    """
    scenario = stage.scenario
    figures = [(made.mesh, made.appearance, stage.walk)]
    figures += [(*figure, one.walk) for figure, one in zip(made.others, stage.others, strict=True)]
    camera, scene = stage.camera, made.scene
    if number > 1:
        camera = stage.beside[number - 2]
        scene = build_scene(camera, made.layout, made.coats)
    people = [Renderer(camera, scene, *figure) for figure in figures]
    for frame in range(scenario.frames):
        if stage.cameras:
            scene = build_scene(stage.cameras[frame], made.layout, made.coats)
            people = [Renderer(stage.cameras[frame], scene, *figure) for figure in figures]
        rng = scenario.stream("sensor", frame, *([number] if number > 1 else []))
        gain = 1 + 0.01 * scenario.flicker * float(np.clip(rng.standard_normal(), -2.5, 2.5))
        yield develop(light(people, frame), gain, scenario.noise, rng)


def files(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the files of a clip."""
    more = [_numbered(name, k) for k in range(2, 2 + COMPANY[scenario.people]) for name in _PERSON]
    names = [*CLIP_FILES, *more]
    for number in range(2, scenario.cameras + 1):
        names += [_numbered(name, number) for name in _CAMERA]
    if scenario.moving == "none":
        return tuple(names)
    return tuple(_POSES if name == "background.png" else name for name in names)


def _numbered(name: str, number: int) -> str:
    """Return the name of a file for the camera or person with this number, from 1."""
    path = Path(name)
    return name if number == 1 else f"{path.stem}_{number}{path.suffix}"


def background(scene: Scene) -> Picture:
    """Return the empty scene as its camera sees it, without noise, (h, w, 3) BGR."""
    return develop(scene.plate, 1.0, 0.0, None)


def simulate(
    scenario: Scenario,
    folder: str | os.PathLike[str],
    progress: Callable[[int], None] | None = None,
    keep: bool = True,
) -> dict[str, Any]:
    """Write a clip and its ground truth to `folder`, which is created if needed.

    `folder`: receives the files of `files`, in the formats that `gait capture` and `gait eval` read;
    `progress`: called with the number of frames done, over all cameras; `keep`: keep an unfinished video if
    interrupted. Returns the contents of meta.json. UserError if the folder cannot be written or the options
    contradict each other.
    """
    stage = set_stage(scenario)
    with _folder(folder, files(scenario)) as target:
        made = build_set(stage)
        figures = [(made.mesh, made.appearance), *made.others]
        for number in range(1, scenario.cameras + 1):
            _write_video(target, stage, made, number, progress, keep)
        if stage.cameras:
            times = [frame / scenario.fps for frame in range(scenario.frames)]
            poses = [CameraPose.of(camera) for camera in stage.cameras]
            with replacing(target / _POSES) as temporary:
                write_path(temporary, times, poses, by_frame=False)
        else:
            _write_picture(target / "background.png", background(made.scene))
        _write_json(target / "camera.json", stage.camera.to_dict())
        for number, camera in enumerate(stage.beside, 2):
            scene = build_scene(camera, made.layout, made.coats)
            _write_picture(target / _numbered("background.png", number), background(scene))
            _write_json(target / _numbered("camera.json", number), camera.to_dict())
        metas = []
        for k, (one, (_, appearance)) in enumerate(zip([stage, *stage.others], figures, strict=True), 1):
            events = find_events(one)
            write_truth(target / _numbered("truth.csv", k), one, events["r_heel_strike"])
            _write_json(target / _numbered("init.json", k), first_state(one, events["r_heel_strike"]))
            metas.append(describe(one, replace(made, appearance=appearance), events, scenario.seed))
            _write_json(target / _numbered("meta.json", k), metas[-1])
        return metas[0]


@contextmanager
def _folder(folder: str | os.PathLike[str], names: Iterable[str]) -> Iterator[Path]:
    """Create the folder, and check before the work that every file can be written there.

    Folders that did not exist are removed if the block fails before anything is written.
    """
    target = Path(folder)
    require_folder(target)
    with making(target):
        for name in names:
            require_writable(target / name)
        yield target


def _write_video(
    target: Path,
    stage: Stage,
    made: Set,
    number: int,
    progress: Callable[[int], None] | None,
    keep: bool,
) -> None:
    """Write the frames of a camera, and a sheet of some of the first one's."""
    across, down = _CONTACTS
    frames = stage.scenario.frames
    wanted = np.linspace(0, frames - 1, across * down).round().astype(int).tolist()
    sheet = {}
    video = target / _numbered("video.mp4", number)
    with VideoWriter(video, stage.scenario.fps, crf=CRF, keep=keep) as writer:
        for frame, picture in enumerate(pictures(stage, made, number)):
            writer.write(picture)
            if frame in wanted:
                sheet[frame] = picture
            if progress is not None:
                progress((number - 1) * frames + frame + 1)
    if number > 1:
        return
    shown = [sheet[frame] for frame in wanted]
    rows = [np.hstack(shown[k * across : (k + 1) * across]) for k in range(down)]
    _write_picture(target / "contact.jpg", np.vstack(rows))


def _write_picture(path: Path, picture: Picture) -> None:
    with replacing(path) as temporary:
        write_picture(temporary, picture)


def _write_json(path: Path, data: dict[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
