#!/usr/bin/env python3
"""What joints mean in each source of walks, and how well models of several sources describe people left out.

    .venv/bin/python tests/bench/learn_people.py ../shared/data/mocap

Mean angles, proportions and places of hips and neck by source show where joint centres differ, before and
after the joints of CMU's skeletons are moved to the anatomical ones.  Floors are those of learn_floor.py, as
tracked: of the model of CMU's people alone, and of the model of all people whose licence permits shipping.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import floor_fit
import numpy as np
import numpy.typing as npt
import table
from floor_shapes import SHAPES, TRACKED

from gait.body.model_curves import series
from gait.body.skeleton import ANGLES, SIDES, default_skeleton
from gait.errors import UserError
from gait.io.track_file import Joints
from gait.learn.cycles import sequence
from gait.learn.cycles.sequence import Sequence
from gait.learn.options import JOINT_CENTRES, LearnOptions
from gait.learn.prior import fit, model, people
from gait.learn.rotations import unit
from gait.learn.solve import readers, retarget
from gait.learn.solve.body import Body
from gait.motion.footfalls import STRIKE_SIDES, find_events
from gait.motion.parameters import asymmetry, strides_of
from gait.progress import progress
from gait.reproducible import one_thread_for_good

Floats = npt.NDArray[np.float64]

CMU = "cmu_walk"
#: Sources whose licences permit a shipped model, and sources that serve only as people left out.
FREE = ("btk", "gaitalytics", "bvhtoolbox", "opensim", "mcgill", "cmu_more")
OTHERS = ("ammr", "nimble", "ezc3d", "gaittoolbox", "c3dorg")
UNEVEN = ("step_time_s", "stance_percent")
SCALED = ("cmu_more",)  # lengths of limbs are generic there
ACCLAIM = (CMU, "cmu_more")  # skeletons of CMU
MARKERS = tuple(source for source in (*FREE, *OTHERS) if source not in ("bvhtoolbox", *ACCLAIM))
FOLDS, EVERY = 4, 0.1  # groups of people left out, seconds between the frames compared
HEAD = 0.2  # metres above the neck, for recordings without a head
RECORDED, ANATOMICAL = JOINT_CENTRES
MEAN, SHIPPED = "mean", "as shipped"  # bodies
#: Heels and toes by what is known of them: a strike is where the ankle is furthest ahead if there is no heel.
FOOT = {"heel": ("heel", "ankle"), "toe": ("toe", "ankle")}
SHOWN = ("hip_flexion", "knee_flexion", "ankle_flexion", "shoulder_flexion", "shoulder_rotation")
PLACES = (
    "hips apart",
    "hips ahead of ankles",
    "neck above hips",
    "neck ahead of hips",
    "neck above shoulders",
)
NOTE = """\
{walks} walks of {count} people; the people of a source have equal weights.  Angles are means over whole
cycles and both sides, degrees; lengths are shares of the stature, per cent.  *anatomical*: `gait learn
--joints anatomical`, which moves knees, ankles, shoulders and wrists of CMU's skeletons to where the markers
of other laboratories put them.  In published walks (Plug-in-Gait) the knee is flexed by 22 to 25 degrees on
average.  Asymmetries of step time and stance are 200 |right - left| / (right + left), percentage points,
median over people; the scatter of their few strides is part of them.

Floors, mm, median and mean over people: 14 joints after alignment of the pelvis, with 5 components and
offsets of trunk, shoulders and elbows as in the tracker.  *body*: the mean of the learners', or *as shipped*,
the one that `gait learn` makes, whose joints are in anatomical places.  {folds} groups are left out of every
source at once; people whose recordings show no arms are not among the learners.  People from elsewhere are
the {new} whose whole body was recorded.  Of the people whose licence permits it, seven are not among those of
the shipped `classes`: b3, b4, b5, b6, g2 and p1, who show no arms, so they are not among the learners here
either; and c47, who is one here, because 2.4 strides of a turn by 137 degrees would make the strides of the
model vary too much.

{floors}

Places of hips and neck: means over whole cycles in the axes of the pelvis, in brackets the standard deviation
between people; shares of the stature, per cent.  *hips*: the point midway between both, and so for ankles and
shoulders.  With markers the distance of the neck from the shoulders is that of the fitted skeleton.  Lengths
of `cmu_more` are those of generic skeletons.

{places}
"""


@dataclass
class Person:
    """A walk with the body it was read from and its source."""

    walk: Sequence
    body: Body
    source: str


def load(folder: Path, joints: str, wanted: tuple[str, ...]) -> list[Person]:
    """Read all walks of sources that can be learnt from."""
    found: list[Person] = []
    places = [(name, folder / name if name == CMU else folder / "more" / name) for name in wanted]
    files = [
        (name, path)
        for name, place in places
        for path in sorted(place.rglob("*"))
        if path.suffix.lower() in readers.SUFFIXES
    ]
    with progress("reading motion", len(files), False) as update:
        for done, (source, path) in enumerate(files, 1):
            try:
                body = readers.read(path, LearnOptions(joints=joints))
                walk = sequence.prepare(path, body)
            except UserError as error:
                print(f"left out: {error}", file=sys.stderr)
                continue
            if source in SCALED:
                walk = replace(walk, measures=None)
            found.append(Person(walk, body, source))
            update(done)
    return found


def by_person(some: list[Person], values: Callable[[Person], list[float]]) -> Floats:
    """Values (people, n): means over the walks of each person."""
    found: dict[str, list[list[float]]] = {}
    for one in some:
        found.setdefault(one.walk.subject, []).append(values(one))
    return np.array([np.nanmean(rows, axis=0) for rows in found.values()])


def row(name: str, some: list[Person]) -> list[Any]:
    """Cells of the table of a source."""
    people_of = by_person(some, angles_and_lengths)
    values = [*np.nanmean(people_of, axis=0), *usual_asymmetries(some)]
    return [name, len(people_of), *(f"{value:.1f}" if np.isfinite(value) else None for value in values)]


def cycles_of(one: Person) -> slice:
    """Return the frames of whole cycles."""
    return slice(int(int(one.walk.cycles) * one.walk.period.frames))


def angles_and_lengths(one: Person) -> list[float]:
    """Mean angles SHOWN, degrees, and lengths of limbs, per cent of the stature."""
    whole = one.walk.channels[cycles_of(one)]
    angles = [
        float(np.degrees(np.nanmean(whole[:, [ANGLES.index(f"{s}_{angle}") for s in SIDES]])))
        for angle in SHOWN
    ]
    m = one.walk.measures or retarget.measure(retarget.levelled(one.body.part(*one.walk.kept)))
    parts = (m.thigh, m.shank, m.sole, m.shoulder[:, 2], m.upper_arm, m.forearm)
    return [*angles, *(100 * float(np.mean(part)) / m.stature for part in parts)]


def places_of(one: Person) -> list[float]:
    """Mean PLACES of a walk, per cent of the stature."""
    body = retarget.levelled(one.body.part(*one.walk.kept))
    stature = (one.walk.measures or retarget.measure(body)).stature
    joints, cycles = body.joints, cycles_of(one)

    def between(start: Floats, end: Floats) -> Floats:
        local = np.einsum("tji,tj->ti", body.pelvis, end - start)
        return np.asarray(100 * np.nanmean(local[cycles], axis=0) / stature)

    ankles, shoulders = ((joints[f"l_{name}"] + joints[f"r_{name}"]) / 2 for name in ("ankle", "shoulder"))
    hips, neck = joints["pelvis"], joints["neck"]
    ahead, _, above = between(hips, neck)
    return [
        float(between(joints["r_hip"], joints["l_hip"])[1]),
        float(between(ankles, hips)[0]),
        float(above),
        float(ahead),
        float(between(shoulders, neck)[2]),
    ]


def place_row(name: str, some: list[Person]) -> list[str]:
    """Cells of the table of PLACES."""
    found = by_person(some, places_of)
    cells = []
    for column in found.T:
        known = column[np.isfinite(column)]
        spread = f" ({known.std(ddof=1):.1f})" if len(known) > 1 else ""
        cells.append(f"{known.mean():.1f}{spread}" if len(known) else "-")
    return [name, str(len(found)), *cells]


def usual_asymmetries(some: list[Person]) -> list[float]:
    """Medians over people of the asymmetry of step time and of stance, without sign, percentage points."""
    by_person: dict[str, list[list[float]]] = {}
    for one in some:
        if found := asymmetries(one):
            by_person.setdefault(one.walk.subject, []).append(found)
    means = [np.mean(rows, axis=0) for rows in by_person.values()]
    return list(np.median(np.abs(means), axis=0)) if means else [np.nan] * len(UNEVEN)


def asymmetries(one: Person) -> list[float]:
    """Asymmetries of UNEVEN in a walk, per cent; empty if it shows no whole stride of either foot."""
    joints = one.body.part(*one.walk.kept).joints
    places = {"pelvis": joints["pelvis"]}
    for side in "rl":
        places[f"{side}_ankle"] = joints[f"{side}_ankle"]
        for part, known in FOOT.items():
            places[f"{side}_{part}"] = next(joints[name] for k in known if (name := f"{side}_{k}") in joints)
    frame = np.flatnonzero(np.isfinite(np.concatenate(list(places.values()), axis=1)).all(axis=1))
    motion = Joints(frame, frame / one.walk.fps, {name: place[frame] for name, place in places.items()})
    try:
        strides = strides_of(motion, find_events(motion))
    except (UserError, IndexError):
        return []
    means = [[np.nanmean(strides[side].values[name]) for side in STRIKE_SIDES] for name in UNEVEN]
    found = [float(asymmetry(*pair)) for pair in means]
    return found if np.isfinite(found).all() else []


def walk_of(one: Person) -> floor_fit.Walk | None:
    """Select frames in which all joints are known; None if there are hardly any."""
    s, body = one.walk, one.body.part(*one.walk.kept)
    joints = dict(body.joints)
    if not np.isfinite(joints["head"]).any():
        joints["head"] = joints["neck"] + HEAD * unit(joints["neck"] - joints["pelvis"])
    body = retarget.levelled(replace(body, joints=joints))
    joints, stature = dict(body.joints), s.measures.stature
    joints["head_top"] = (
        joints["neck"] + unit(joints["head"] - joints["neck"]) * retarget.HEAD_LENGTH * stature
    )
    away = np.stack([joints[name] - joints["pelvis"] for name in floor_fit.COMPARED], axis=1)
    local = np.einsum("tji,tpj->tpi", body.pelvis, away)[:: max(1, round(EVERY * s.fps))]
    frames = np.arange(len(s.channels))[:: max(1, round(EVERY * s.fps))]
    visible = np.isfinite(local).all(axis=(1, 2))
    if visible.sum() < 4:
        return None
    at, channels = frames[visible] / s.period.frames, np.nan_to_num(s.channels[frames[visible]])
    return floor_fit.Walk(s.subject, at, local[visible], channels, s.measures, s.fps / s.period.frames)


def sections_of(learners: list[Person]) -> dict[str, dict[str, Any]]:
    """Curves as tracked, by body."""
    learned = fit.fit([one.walk for one in learners])
    bodies = {one.walk.subject: one.walk.measures for one in learners if one.walk.measures is not None}
    follows = {"PACE": series(learned.pace_curve, people.TERMS), "GAIT": model.gait_statistics(learned)}
    curves = SHAPES[TRACKED].sections(learned) | follows
    shapes = {MEAN: retarget.mean_proportions(list(bodies.values())), SHIPPED: learned.proportions}
    return {body: curves | default_skeleton(shape).sections() for body, shape in shapes.items()}


def _shows_arms(one: Person) -> bool:
    """Whether a recording shows more than pelvis and legs."""
    return bool(np.isfinite(one.walk.channels[:, ANGLES.index("l_shoulder_flexion")]).any())


def floors(
    all_people: list[Person], sources: tuple[str, ...]
) -> dict[str, tuple[dict[str, float], dict[str, float]]]:
    """Floors of people of CMU and from elsewhere, each left out of the learners, by body and name."""
    whole = [one for one in all_people if one.walk.measures is not None and walk_of(one) is not None]
    found: dict[str, tuple[dict[str, list[float]], ...]] = {MEAN: ({}, {}), SHIPPED: ({}, {})}
    for k in range(FOLDS):
        out = {
            name
            for source in {one.source for one in whole}
            for name in sorted({one.walk.subject for one in whole if one.source == source})[k::FOLDS]
        }
        learners = [
            one
            for one in all_people
            if one.source in sources and one.walk.subject not in out and _shows_arms(one)
        ]
        made = sections_of(learners)
        for one in whole:
            if one.walk.subject in out:
                for body, kinds in found.items():
                    mm = floor_fit.in_joints(walk_of(one), made[body]).joints_mm
                    kinds[one.source != CMU].setdefault(one.walk.subject, []).append(mm)
    return {
        body: tuple({who: float(np.mean(mm)) for who, mm in kind.items()} for kind in kinds)
        for body, kinds in found.items()
    }


def floor_table(kinds: dict[str, list[Person]]) -> tuple[str, int]:
    """Compare the models; return Markdown and the number of people from elsewhere."""
    rows: list[list[Any]] = []
    new: dict[str, float] = {}
    for kind, all_people in kinds.items():
        for name, sources in (("CMU", (CMU,)), ("CMU and all free", (CMU, *FREE))):
            for body, (cmu, new) in floors(all_people, sources).items():
                figures = (f"{f(list(x.values())):.1f}" for x in (cmu, new) for f in (np.median, np.mean))
                rows.append([kind, name, body, *figures])
                each = {who: round(mm) for who, mm in (cmu | new).items()}
                print(*rows[-1], each, file=sys.stderr, flush=True)
    head = ["joints", "learnt from", "body", "CMU median", "CMU mean", "elsewhere median", "elsewhere mean"]
    return table.markdown(head, [[str(c) for c in cells] for cells in rows], [False] * 3 + [True] * 4), len(
        new
    )


def sources(kinds: dict[str, list[Person]]) -> Iterator[tuple[str, list[Person]]]:
    """Yield the people of each source, those of CMU's skeletons as recorded and moved."""
    for name in (CMU, *FREE, *OTHERS):
        for kind, all_people in kinds.items():
            some = [one for one in all_people if one.source == name]
            if some and (kind == RECORDED or name in ACCLAIM):
                yield (f"{name}, {kind}" if name in ACCLAIM else name), some


def place_table(kinds: dict[str, list[Person]]) -> str:
    """Places of hips and neck by source, and of all people with markers."""
    marked = [one for one in kinds[RECORDED] if one.source in MARKERS]
    rows = [place_row(*each) for each in (*sources(kinds), ("all with markers", marked))]
    return table.markdown(["source", "people", *PLACES], rows, [False] + [True] * (1 + len(PLACES)))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("mocap", type=Path, help=f"folder with {CMU} and more")
    folder = parser.parse_args().mocap
    if not (folder / "more").is_dir():
        print(f"learn_people: {folder}: no folder more; name the one of all recordings", file=sys.stderr)
        return 1
    one_thread_for_good()
    warnings.simplefilter("ignore", RuntimeWarning)  # means of parts that no recording of a source shows
    found = load(folder, RECORDED, (CMU, *FREE, *OTHERS))
    others = [one for one in found if one.source not in ACCLAIM]
    kinds = {RECORDED: found, ANATOMICAL: [*load(folder, ANATOMICAL, ACCLAIM), *others]}
    written, new = floor_table(kinds)
    count = len({one.walk.subject for one in found})
    places = place_table(kinds)
    note = NOTE.format(walks=len(found), count=count, folds=FOLDS, new=new, floors=written, places=places)
    lengths = ("thigh", "shank", "sole", "shoulder", "upper arm", "forearm")
    uneven = ("step time asym.", "stance asym.")
    rows = [row(*each) for each in sources(kinds)]
    columns = ["source", "people", *(name.replace("_", " ") for name in SHOWN), *lengths, *uneven]
    table.publish("learn_people", "People of several sources", columns, rows, note)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UserError as error:
        sys.exit(f"learn_people: {error}")
