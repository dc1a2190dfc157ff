"""Make a clip: pictures and truth, written to a folder."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gait.errors import UserError
from gait.io.video import VideoWriter
from gait.io.files import replacing, require_writable
from gait.simulate.arrays import Picture
from gait.simulate.render import Renderer, develop
from gait.simulate.scenario import Scenario
from gait.simulate.stage import Set, Stage, build_set, set_stage
from gait.simulate.truth import CRF, describe, find_events, first_state, write_truth

FILES = ("video.mp4", "background.png", "camera.json", "truth.csv", "init.json", "meta.json", "contact.jpg")
_CONTACTS = (3, 2)  # pictures across and down in contact.jpg


def pictures(stage: Stage, made: Set) -> Iterator[Picture]:
    """Yield the frames of the clip, (h, w, 3) BGR; each depends only on the scenario and its own number."""
    scenario = stage.scenario
    renderer = Renderer(stage.camera, made.scene, made.mesh, made.look, stage.walk)
    for frame in range(scenario.frames):
        rng = scenario.stream("sensor", frame)
        gain = 1 + 0.01 * scenario.flicker * float(np.clip(rng.standard_normal(), -2.5, 2.5))
        yield develop(renderer.light(frame), gain, scenario.noise, rng)


def background(made: Set) -> Picture:
    """Return the empty scene as the camera sees it, without noise, (h, w, 3) BGR."""
    return develop(made.scene.plate, 1.0, 0.0, None)


def simulate(
    scenario: Scenario, folder: str | os.PathLike[str], progress: Callable[[int], None] | None = None
) -> dict[str, Any]:
    """Write a clip and everything known about it into `folder`, which is made if need be.

    Parameters
    ----------
    scenario : Scenario
    folder : path
        Gets the files of `FILES`, in the formats that `gait capture` and `gait eval` read.
    progress : callable, optional
        Called with the number of frames done.

    Returns
    -------
    dict
        The contents of meta.json.

    Raises
    ------
    UserError
        If the folder cannot be written or the options contradict each other.
    """
    stage = set_stage(scenario)
    target = _folder(folder)
    made = build_set(stage)
    events = find_events(stage)
    meta = describe(stage, made, events)
    strikes = events["r_heel_strike"]
    _write_video(target, stage, made, progress)
    _write_picture(target / "background.png", background(made))
    write_truth(target / "truth.csv", stage, strikes)
    _write_json(target / "camera.json", stage.camera.to_dict())
    _write_json(target / "init.json", first_state(stage, strikes))
    _write_json(target / "meta.json", meta)
    return meta


def _folder(folder: str | os.PathLike[str]) -> Path:
    """Make the folder and check that every file can be put there, before the work."""
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise UserError(f"{target}: is a file; give the name of a folder") from None
    except OSError as exc:
        raise UserError(f"{target}: cannot be made ({exc.strerror}); choose another place") from None
    for name in FILES:
        require_writable(target / name)
    return target


def _write_video(target: Path, stage: Stage, made: Set, progress: Callable[[int], None] | None) -> None:
    """Write the frames, and a sheet of some of them."""
    across, down = _CONTACTS
    wanted = np.linspace(0, stage.scenario.frames - 1, across * down).round().astype(int).tolist()
    sheet = {}
    with VideoWriter(target / "video.mp4", stage.scenario.fps, crf=CRF) as writer:
        for number, picture in enumerate(pictures(stage, made)):
            writer.write(picture)
            if number in wanted:
                sheet[number] = picture
            if progress is not None:
                progress(number + 1)
    shown = [sheet[number] for number in wanted]
    rows = [np.hstack(shown[k * across : (k + 1) * across]) for k in range(down)]
    _write_picture(target / "contact.jpg", np.vstack(rows))


def _write_picture(path: Path, picture: Picture) -> None:
    with replacing(path) as temporary:
        if not cv2.imwrite(str(temporary), picture):
            raise UserError(f"{path}: cannot be written; check the disk")


def _write_json(path: Path, data: dict[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
