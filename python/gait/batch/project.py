"""A project file (TOML): clips, common settings, and the outputs of each clip."""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from gait._version import __version__
from gait.camera.camera import split_name
from gait.errors import UserError, unreadable
from gait.io.fields import Fields, parsing
from gait.io.files import require_no_device

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EXPORT_FORMATS = ("trc", "c3d", "bvh", "mot", "parquet", "rrd", "mcap")
MADE = ("track", "lift", "overlay", "report", *EXPORT_FORMATS)
_FILES = {"video": "videos", "camera": "cameras"}  # of one film; of several
_KEYS = ("subject", "height", "person", "people", "start", "stop", "make", "options", "keypoints",
         *_FILES, *_FILES.values())  # fmt: skip


@dataclass(frozen=True)
class Clip:
    """One clip of a project; paths of files are absolute."""

    name: str
    videos: tuple[str, ...] = ()  #: several: the same walk, each with its camera
    keypoints: tuple[str, ...] = ()  #: several: of the same walk, each with its camera
    cameras: tuple[str, ...] = ()
    subject: str = ""  #: the person's name, for the summary
    height: float | None = None  #: metres
    person: str | None = None  #: which of several people in `keypoints`
    people: str | None = None  #: number of people to track, or "all"
    start: int | None = None
    stop: int | None = None
    make: tuple[str, ...] = ("track", "report")
    options: tuple[str, ...] = ()  #: further arguments of gait track or gait lift

    @property
    def video(self) -> str | None:
        """The film whose frames the track has."""
        return self.videos[0] if self.videos else None

    @property
    def lifted(self) -> bool:
        """Whether the clip is lifted rather than tracked."""
        return "lift" in self.make

    @property
    def result(self) -> str:
        """Name of the file from which all others are made."""
        return "motion.csv" if self.lifted else "track.csv"

    def key(self) -> str:
        """Hash of all that the outputs depend on: settings, version, size and time of the input files.

        Files named in `options` count, and all files in a folder of keypoints.
        """
        paths = [*self.videos, *(split_name(camera)[0] for camera in self.cameras), *self.keypoints]
        named = (word.partition("=")[2] if word.startswith("--") else word for word in self.options)
        paths += [path for path in named if os.path.exists(path)]
        paths += sorted(entry.path for path in paths if os.path.isdir(path) for entry in os.scandir(path))
        files = [os.stat(path) for path in paths]
        state = [asdict(self), [(file.st_size, file.st_mtime_ns) for file in files], __version__]
        return hashlib.sha256(json.dumps(state).encode()).hexdigest()

    def command(self, folder: Path) -> list[str]:
        """Arguments of the gait command that writes `result` to a folder."""
        result = str(folder / self.result)
        return self._lift(result) if self.lifted else self._track(result, folder)

    def further(self, folder: Path, person: str | None) -> dict[Path, list[str]]:
        """Other files and folders, of one person if there are several, and arguments of gait to make each."""
        ending = "" if person is None else f"-{person}"
        stem = self.result.partition(".")[0] + ending
        result = str(folder / f"{stem}.csv")
        made = {}
        if "report" in self.make and not self.lifted:
            made[folder / f"report{ending}"] = ["report", "track", result]
        for suffix in EXPORT_FORMATS:
            if suffix in self.make:
                made[folder / f"{stem}.{suffix}"] = ["export", result]
        return {path: [*words, "-o", str(path), "--json"] for path, words in made.items()}

    def _track(self, result: str, folder: Path) -> list[str]:
        words = ["track", *self.videos, "-o", result, "--json", *self._common()]
        if "overlay" in self.make:
            words += ["--overlay", str(folder / "overlay.mp4")]
        if self.keypoints:
            words += ["--keypoints", *self.keypoints]
        return [*words, *self.options]

    def _lift(self, result: str) -> list[str]:
        given = self.keypoints or self.videos
        words = ["lift", *given, "-o", result, "--json", *self._common()]
        if self.keypoints and self.video:
            words += ["--video", self.video]
        return [*words, *self.options]

    def _common(self) -> list[str]:
        names = ("height", "person", "people", "start", "stop")
        given = [("camera", camera) for camera in self.cameras]
        given += [(name, getattr(self, name)) for name in names]
        return [word for name, value in given if value is not None for word in (f"--{name}", str(value))]


def read(path: str | os.PathLike[str]) -> list[Clip]:
    """Read the clips of a project.

    UserError if the file or an entry in it is invalid.  If a clip's own files are missing or damaged, only
    that clip fails, when it is run.
    """
    require_no_device(path, "project")
    try:
        text = Path(path).read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    with parsing(str(path), "TOML", "correct it"):
        data = tomllib.loads(text.decode("utf-8-sig"))
    whole = Fields(str(path), data)
    whole.only(("defaults", "clip"))
    folder = Path(path).resolve().parent
    common = _clip(whole.table("defaults", ""), Clip(""), folder)
    entries = data.get("clip", [])
    if not isinstance(entries, list) or not entries:
        raise UserError(f"{path}: has no [[clip]]; give each a video")
    clips = []
    for i, entry in enumerate(entries, 1):
        where = f"{path}: clip {i}"
        if not isinstance(entry, dict):
            raise UserError(f"{where}: is not a table; begin it with [[clip]]")
        fields = Fields(where, entry)
        clip = _clip(fields, common, folder, named=True)
        _require(fields, clip)
        clips.append(clip)
    twice = next((clip.name for clip in clips if sum(other.name == clip.name for other in clips) > 1), None)
    if twice is not None:
        raise UserError(f"{path}: two clips are named {twice}; give each its own name")
    return clips


def _clip(fields: Fields, common: Clip, folder: Path, named: bool = False) -> Clip:
    """Make a clip from its table; entries that it lacks come from the common ones."""
    fields.only((*_KEYS, "name") if named else _KEYS)
    given: dict[str, Any] = {}
    for name in ("subject", "person"):
        if name in fields:
            given[name] = _text(fields, name)
    if "keypoints" in fields:
        as_list = isinstance(fields.get("keypoints", ""), list)
        files = _words(fields, "keypoints", None) if as_list else (_text(fields, "keypoints"),)
        given["keypoints"] = tuple(str(folder / file) for file in files)
    for one, several in _FILES.items():
        if one in fields and several in fields:
            raise fields.fail(several, f"is given beside {one}", "leave out one of them")
        if one in fields:
            given[several] = (str(folder / _text(fields, one)),)
        if several in fields:
            given[several] = tuple(str(folder / file) for file in _words(fields, several, None))
    if "people" in fields:
        given["people"] = (
            "all"
            if fields.get("people", "") == "all"
            else str(fields.integer("people", 1, 8, 'give a number, or "all"'))
        )
    if "height" in fields:
        given["height"] = fields.number("height", 0.3, 3.0, "give metres")
    for name in ("start", "stop"):
        if name in fields:
            given[name] = fields.integer(name, 0, 1 << 31, "give a frame, from 0")
    for name, known in (("make", MADE), ("options", None)):
        if name in fields:
            given[name] = _words(fields, name, known)
    if named:
        stem = Path(next(iter((*given.get("videos", ()), *given.get("keypoints", ()))), "")).stem
        given["name"] = _text(fields, "name") if "name" in fields else stem
    return replace(common, **given)


def _require(fields: Fields, clip: Clip) -> None:
    """Raise UserError for a clip whose entries do not go together."""
    if not re.fullmatch(r"[\w][\w .+-]*", clip.name):
        raise fields.fail("name", f"is {clip.name!r}", "give letters, digits, spaces and . _ + -")
    if not clip.lifted and not clip.video:
        raise fields.fail("video", "is missing", "give the file, or make lift from keypoints")
    if not clip.video and not clip.keypoints:
        raise fields.fail("video", "and keypoints are missing", "give one of them")
    if clip.lifted and {"track", "overlay", "report"} & set(clip.make):
        raise fields.fail("make", "has lift together with track, overlay or report", "make a clip of each")
    if len(clip.videos) > 1 and clip.keypoints:
        raise fields.fail("videos", "cannot be combined with keypoints", "give video, or leave out keypoints")
    if len(clip.keypoints) > 1 and (clip.video or not clip.lifted):
        raise fields.fail("keypoints", "are several", "make lift, without a video, or give one file")
    if max(len(clip.videos), len(clip.keypoints)) > 1 and not clip.cameras:
        raise fields.fail("cameras", "are missing", "give the camera of each view, here or in [defaults]")
    if clip.people and (clip.lifted or clip.keypoints):
        raise fields.fail(
            "people", "cannot be combined with lift or keypoints", "several people are tracked in a video"
        )
    for name in ("start", "stop"):
        if clip.lifted and clip.keypoints and getattr(clip, name) is not None:
            why = "is for a film, and this clip lifts keypoints"
            raise fields.fail(name, why, f"leave out {name} here and in [defaults], and give it to each film")
    if not clip.cameras and clip.height is None and not (clip.lifted and clip.keypoints):
        raise fields.fail("camera", "and height are missing", "give one of them, here or in [defaults]")
    _require_options(fields, clip)


def _require_options(fields: Fields, clip: Clip) -> None:
    """Raise UserError if `options` has an option that the clip's command line has without it."""
    own = {word for word in replace(clip, options=()).command(Path()) if word.startswith("-")}
    for word in clip.options:
        name = word.partition("=")[0]
        output = word.startswith("-o") or (len(name) > 3 and "--output".startswith(name))
        if output or name in own | {"--people", "--quiet"}:
            remedy = f"give the key {name[2:]} instead" if name[2:] in _KEYS else "leave it out"
            raise fields.fail("options", f"has {word!r}, which gait batch sets itself", remedy)


def _text(fields: Fields, name: str) -> str:
    value = fields.get(name, "give text")
    if not isinstance(value, str) or not value:
        raise fields.fail(name, "is not text", "give it in quotes")
    return value


_EXAMPLES = {
    "make": '["track", "report"]',
    "options": '["--detector", "lite"]',
    "videos": '["left.mp4", "right.mp4"]',
    "keypoints": '["left.csv", "right.csv"]',
    "cameras": '["left.json", "right.json"]',
}


def _words(fields: Fields, name: str, known: tuple[str, ...] | None) -> tuple[str, ...]:
    value = fields.get(name, "give a list of words")
    if not isinstance(value, list) or not all(isinstance(word, str) for word in value):
        raise fields.fail(name, "is not a list of words", f"give it as {_EXAMPLES[name]}")
    wrong = [word for word in value if known is not None and word not in known]
    if wrong:
        raise fields.fail(name, f"has {wrong[0]!r}", f"use {' '.join(known or ())}")
    return tuple(value)
