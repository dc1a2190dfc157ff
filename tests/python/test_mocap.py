"""Readers of ASF/AMC and BVH: geometry, agreement of the two, and messages for malformed files."""

from pathlib import Path

import mocap_files as files
import numpy as np
import pytest

from gait.body.skeleton import ANGLES
from gait.errors import UserError
from gait.learn.mocap import acclaim, bvh, recording
from gait.learn.solve import body, retarget

DATA = Path(__file__).parents[2] / "../shared/data/mocap"
CGSPEED = {
    "root": "Hips", "lfemur": "LeftUpLeg", "ltibia": "LeftLeg", "lfoot": "LeftFoot", "lhumerus": "LeftArm",
    "lradius": "LeftForeArm", "lhand": "LeftHand", "rfemur": "RightUpLeg", "rtibia": "RightLeg",
    "rfoot": "RightFoot", "rhumerus": "RightArm", "rradius": "RightForeArm", "rhand": "RightHand",
    "lowerback": "Spine", "lowerneck": "Neck", "upperneck": "Neck1", "head": "Head",
}  # fmt: skip
MIXAMO = {k: f"mixamorig:{v}" for k, v in CGSPEED.items()} | {
    "upperneck": "mixamorig:Neck",
    "lowerneck": "chest",
}
POSER = {
    "root": "hip", "lfemur": "lThigh", "ltibia": "lShin", "lfoot": "lFoot", "lhumerus": "lShldr",
    "lradius": "lForeArm", "lhand": "lHand", "rfemur": "rThigh", "rtibia": "rShin", "rfoot": "rFoot",
    "rhumerus": "rShldr", "rradius": "rForeArm", "rhand": "rHand", "upperneck": "neck", "lowerneck": "chest",
}  # fmt: skip


@pytest.fixture
def amc(tmp_path):
    return files.write_toy(tmp_path / "77", frames=130)


def angles(rec):
    person, _ = retarget.level(body.from_bones(rec))
    return retarget.angles(person, retarget.measure(person))


def test_rest_pose_is_upright_and_faces_x(amc):
    rec = acclaim.read(amc)
    rest = {name: (a, b) for name, a, b in zip(rec.bones, rec.rest_start, rec.rest_end, strict=True)}
    assert rest["lfemur"][0][1] == pytest.approx(2.5 * 0.66 * 0.0254 / 0.45)  # left is +y
    assert rest["head"][1][2] > 0.4 and rest["lfoot"][1][0] > 0.1
    assert rest["lradius"][1][1] > rest["lradius"][0][1]


def test_bones_keep_their_lengths_and_join(amc):
    rec = acclaim.read(amc)
    length = np.linalg.norm(rec.end - rec.start, axis=2)
    assert length == pytest.approx(np.broadcast_to(length[0], length.shape))
    thigh, shank = rec.bones.index("lfemur"), rec.bones.index("ltibia")
    assert length[0, thigh] == pytest.approx(7.4 * 0.0254 / 0.45, rel=1e-3)
    assert rec.end[:, thigh] == pytest.approx(rec.start[:, shank])
    assert rec.rotation @ np.swapaxes(rec.rotation, 2, 3) == pytest.approx(
        np.broadcast_to(np.eye(3), rec.rotation.shape), abs=1e-9
    )


BIOVISION = {
    "root": "Hips", "lowerback": "Chest", "lowerneck": "Chest4", "upperneck": "Neck",
    "lfemur": "LeftHip", "ltibia": "LeftKnee", "lfoot": "LeftAnkle",
    "rfemur": "RightHip", "rtibia": "RightKnee", "rfoot": "RightAnkle",
    "lclavicle": "LeftCollar", "lhumerus": "LeftShoulder", "lradius": "LeftElbow", "lhand": "LeftWrist",
    "rclavicle": "RightCollar", "rhumerus": "RightShoulder", "rradius": "RightElbow", "rhand": "RightWrist",
}  # fmt: skip
BIPED = {
    "root": "Bip01_Pelvis", "lowerback": "Bip01_Spine", "lowerneck": "Bip01_Spine3",
    "upperneck": "Bip01_Neck", "head": "Bip01_Head",
    **{f"{s}{old}": f"Bip01_{s.upper()}_{new}" for s in "lr" for old, new in (
        ("femur", "Thigh"), ("tibia", "Calf"), ("foot", "Foot"), ("clavicle", "Clavicle"),
        ("humerus", "UpperArm"), ("radius", "Forearm"), ("hand", "Hand"),
    )},
}  # fmt: skip
PARTS = {
    "femur": "UpperLeg", "tibia": "LowerLeg", "foot": "Foot", "clavicle": "Shoulder",
    "humerus": "UpperArm", "radius": "LowerArm", "hand": "Hand",
}  # fmt: skip
TRUNK = {"root": "Hips", "lowerback": "Spine", "lowerneck": "Chest", "upperneck": "Neck", "head": "Head"}


def named(side, form="{}"):
    """Names by one pattern, those of limbs by another with {side} and {part}, such as "{part}_{side}"."""
    limbs = {
        f"{s}{old}": side.format(side=word, s=s.upper(), part=part)
        for s, word in (("l", "Left"), ("r", "Right"))
        for old, part in PARTS.items()
    }
    return {bone: form.format(name) for bone, name in (TRUNK | limbs).items()}


NAMES = {
    "suffix": named("{part}_{s}"),
    "suffix word": named("{part}{side}"),
    "prefix": {bone: f"Character1_{name}" for bone, name in CGSPEED.items()},
    "prefix and suffix": named("{part}.{s}", "DEF-{}"),
    "ending": named("{side}{part}", "{}_jnt"),
    "cmu": None,
    "cgspeed": CGSPEED,
    "mixamo": MIXAMO,
    "poser": POSER,
    "biovision": BIOVISION,
    "biped": BIPED,
}


@pytest.mark.parametrize("rename", NAMES.values(), ids=NAMES)
def test_bvh_gives_the_angles_of_the_amc_it_was_made_from(amc, rename):
    path = amc.with_suffix(".bvh")
    path.write_text(files.bvh_from_amc(amc, rename, unit=0.01))
    first, second = acclaim.read(amc), bvh.read(path)
    assert second.fps == pytest.approx(first.fps, rel=1e-4)
    thigh = second.bones.index((rename or {}).get("lfemur", "lfemur"))
    assert second.start[:, thigh] == pytest.approx(first.start[:, first.bones.index("lfemur")], abs=1e-4)
    assert np.degrees(angles(second)) == pytest.approx(np.degrees(angles(first)), abs=0.02)


def test_a_node_that_only_places_the_body_does_not_show_which_axis_is_up(amc):
    """It stays at the origin, 90 m from the person."""
    path = amc.with_suffix(".bvh")
    lines = files.bvh_from_amc(amc, named("{part}_{s}"), unit=0.01).splitlines()
    cut = lines.index("MOTION")
    lines[1] = "  JOINT Hips"
    head = [
        "HIERARCHY",
        "ROOT Reference",
        "{",
        "  OFFSET 0 0 0",
        "  CHANNELS 3 Zrotation Yrotation Xrotation",
    ]
    rows = [[0, 0, 0, *map(float, row.split())] for row in lines[cut + 3 :]]
    rows = [" ".join(f"{v:.6f}" for v in [*row[:5], row[5] + 9000, *row[6:]]) for row in rows]
    path.write_text("\n".join([*head, *lines[1:cut], "}", *lines[cut : cut + 3], *rows]) + "\n")
    assert np.degrees(angles(bvh.read(path))) == pytest.approx(
        np.degrees(angles(acclaim.read(amc))), abs=0.02
    )


def test_bvh_of_a_real_walk(tmp_path):
    source = DATA / "cmu_walk/35/35_01.amc"
    if not source.is_file():
        pytest.skip(f"{source} is absent: the learning data are not part of the repository")
    path = tmp_path / "35_01.bvh"
    path.write_text(files.bvh_from_amc(source, CGSPEED))
    assert np.degrees(angles(bvh.read(path))) == pytest.approx(
        np.degrees(angles(acclaim.read(source))), abs=0.05
    )


def test_blanks_about_the_colons_of_a_bvh_are_free(amc):
    path, text = amc.with_suffix(".bvh"), files.bvh_from_amc(amc)
    path.write_text(text)
    known = bvh.read(path)
    path.write_text(text.replace("Frames: ", "FRAMES:").replace("Frame Time: ", "FrameTime : "))
    found = bvh.read(path)
    assert found.fps == known.fps and (found.rotation == known.rotation).all()


def test_radians_by_the_header_of_either_file(amc):
    known = acclaim.read(amc)
    lines = amc.read_text().splitlines()
    for i, line in enumerate(lines):
        name, *numbers = line.split()
        if numbers:
            place = 3 if name == "root" else 0
            turned = [float(v) if k < place else np.radians(float(v)) for k, v in enumerate(numbers)]
            lines[i] = " ".join([name, *(f"{v:.9f}" for v in turned)])
    motion = "\n".join(lines) + "\n"
    amc.write_text(motion.replace(":DEGREES", ":RADIANS"))
    assert acclaim.read(amc).rotation == pytest.approx(known.rotation, abs=1e-7)
    amc.write_text(motion.replace(":DEGREES\n", ""))
    asf = amc.parent / "77.asf"
    text = asf.read_text()
    for axes in {bone[4] for bone in files.BONES}:
        words = " ".join(f"{np.radians(v):.9f}" for v in axes)
        text = text.replace(f"axis {' '.join(map(str, axes))} XYZ", f"axis {words} XYZ")
    asf.write_text(text.replace("angle deg", "angle rad"))
    assert acclaim.read(amc).rotation == pytest.approx(known.rotation, abs=1e-7)


def test_the_rate_is_that_of_the_motion_unless_given(amc):
    assert acclaim.read(amc).fps == 120
    amc.write_text(":SAMPLES-PER-SECOND 60\n" + amc.read_text())
    assert acclaim.read(amc).fps == 60 and acclaim.read(amc, 30.0).fps == 30
    amc.write_text(amc.read_text().replace("SECOND 60", "SECOND 0"))
    with pytest.raises(UserError, match="77_01.amc:1: 0 frames per second"):
        acclaim.read(amc)


def test_an_unknown_unit_of_angles_is_named(amc):
    asf = amc.parent / "77.asf"
    asf.write_text(asf.read_text().replace("angle deg", "angle turns"))
    words = "77.asf:4: unknown angle unit 'turns'; write 'angle deg' or 'angle rad'"
    with pytest.raises(UserError, match=words):
        acclaim.read(amc)


def test_z_up_bvh_is_recognised(amc, tmp_path):
    """The same motion with its axes turned (x, y, z) -> (z, x, y) in the file."""
    text = files.bvh_from_amc(amc, unit=1.0)
    lines = []
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ["OFFSET"]:
            words = ["OFFSET", words[3], words[1], words[2]]
        elif words[:1] == ["CHANNELS"]:
            turn = {"X": "Y", "Y": "Z", "Z": "X"}
            words = [turn[w[0]] + w[1:] if w[0] in turn else w for w in words]
        lines.append(" ".join(words))
    path = tmp_path / "z.bvh"
    path.write_text("\n".join(lines) + "\n")
    assert angles(bvh.read(path)) == pytest.approx(angles(acclaim.read(amc)), abs=1e-4)


def test_runs_of_zeros_are_missing_and_fixed_bones_are_not():
    columns = np.ones((12, 2))
    columns[2:5] = 0
    columns[7:9] = 0
    columns[10, 0] = 0
    missing = np.isnan(recording.mask_zero_runs(columns)).all(axis=1)
    assert list(np.flatnonzero(missing)) == [2, 3, 4]
    assert not np.isnan(recording.mask_zero_runs(np.zeros((9, 1)))).any()


def test_missing_rotations_make_missing_angles_only_below_them(amc):
    lines = amc.read_text().splitlines()
    frame = 0
    for i, line in enumerate(lines):
        frame = int(line) if line.isdigit() else frame
        if 40 <= frame < 50 and line.startswith("lhumerus"):
            lines[i] = "lhumerus 0 0 0"
    amc.write_text("\n".join(lines) + "\n")
    table = angles(acclaim.read(amc, zeros_missing=True))
    gaps = {n: np.flatnonzero(np.isnan(c)) for n, c in zip(ANGLES, table.T, strict=True)}
    assert all(list(gap) in ([], list(range(39, 49))) for gap in gaps.values())
    assert len(gaps["l_shoulder_flexion"]) == 10 and not len(gaps["r_knee_flexion"])


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (lambda s: s.replace("ltibia", "lshin", 1), r":\d+", "does not move"),
        (lambda s: s.replace("rtibia ", "rtibia x", 1), r":\d+", "not a list of numbers"),
        (lambda s: s.replace("rtibia ", "rtibia 1 ", 1), r":\d+", "2 numbers, expected 1"),
        (lambda s: s.replace("rtibia ", "rtibia nan #", 1), r":\d+", "finite"),
        (lambda s: s.replace("\n3\n", "\n5\n", 1), r":\d+", "frame 5 follows 2"),
        (lambda s: s[: s.index("\n7\n") - 60], r":\d+", "frame 6 has no bone"),
        (lambda s: "", "", r"too few frames \(0\)"),
        (lambda s: s[: s.index("\n2\n") + 1], "", r"too few frames \(1\)"),
    ],
)
def test_malformed_amc_is_named_with_its_line(amc, change, line, words):
    amc.write_text(change(amc.read_text()))
    with pytest.raises(UserError, match=f"77_01.amc{line}: .*{words}"):
        acclaim.read(amc)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace(":hierarchy", ":hier"), "section :hierarchy is missing"),
        (lambda s: s.replace("length 7.4", "length long", 1), r":\d+: 'long' is not a list of numbers"),
        (lambda s: s.replace("lfemur ltibia", "lfemur ltibbia"), r":\d+: bone 'ltibbia' is not in"),
        (lambda s: s.replace("TX TY TZ", "TX TY"), "order"),
        (lambda s: s.replace("direction 1 0 0", "direction 1 0", 1), r":\d+: .* numbers, expected 3"),
        (lambda s: s.replace("20 XYZ", "20 XYW", 1), r":\d+: 'xyw' is not an order of X, Y and Z"),
        (lambda s: s.replace("20 XYZ", "20 XYY", 1), r":\d+: 'xyy' is not an order of X, Y and Z"),
        (lambda s: s.replace("length 0.45", "length 0"), r":3: the unit of length is 0"),
        (lambda s: s.replace("dof rx ry", "dof rx rw", 1), r":\d+: 'rx rw rz' are not degrees of freedom"),
        (lambda s: s.replace("dof rx ry", "dof rx rx", 1), r":\d+: 'rx rx rz' are not degrees of freedom"),
        (lambda s: s.replace("    length 7.4\n", "", 1), ": bone 'lfemur' has no length"),
        (
            lambda s: s.replace("lfemur ltibia", "lfemur ltibia lhipjoint"),
            r":\d+: 'lhipjoint' has two parents",
        ),
    ],
)
def test_malformed_asf_is_named(amc, change, words):
    asf = amc.with_name("77.asf")
    asf.write_text(change(asf.read_text()))
    with pytest.raises(UserError, match=f"77.asf.*{words}"):
        acclaim.read(amc)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text.replace("\nroot", "  # of the frame\nroot"),
        lambda text: text.replace("\nroot", "\n\nroot", 1),
        lambda text: text.replace("\n2\n", "\n2 # second\n"),
    ],
)
def test_a_layout_of_its_own_is_read_as_the_usual_one(amc, spoil):
    skeleton = acclaim.read_skeleton(amc.with_name("77.asf"))
    known = acclaim.read_motion(amc, skeleton)
    other = amc.with_name("77_02.amc")
    other.write_text(spoil(amc.read_text()))
    assert other.read_text() != amc.read_text()
    found = acclaim.read_motion(other, skeleton)
    assert list(found) == list(known)
    assert all(np.array_equal(found[name], known[name]) for name in known)


def test_bones_may_come_in_another_order_in_each_frame(amc):
    skeleton = acclaim.read_skeleton(amc.with_name("77.asf"))
    known = acclaim.read_motion(amc, skeleton)
    head, second, rest = amc.read_text().partition("\n2\n")
    lines, number, rest = rest.partition("\n3\n")
    turned = "\n".join(reversed(lines.split("\n")))
    amc.write_text(head + second + turned + number + rest)
    found = acclaim.read_motion(amc, skeleton)
    assert list(found) == list(known)
    assert all(np.array_equal(found[name], known[name]) for name in known)


def test_skeleton_beside_the_motion_is_found(amc, tmp_path):
    amc.with_name("77.asf").unlink()
    with pytest.raises(UserError, match=r"no skeleton 77\.asf beside it"):
        acclaim.read(amc)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.replace("HIERARCHY", "HIER"), r":1: 'HIER' instead of HIERARCHY"),
        (lambda s: s.replace("OFFSET 0", "OFFSET a0", 1), r":\d+: 'a0\.\d+' instead of a number"),
        (lambda s: s.replace("Zrotation", "Wrotation", 1), r":\d+: unknown channel 'Wrotation'"),
        (lambda s: s[: s.index("MOTION")], r":\d+: the file ends too early"),
        (lambda s: s.replace("Frames: 130", "Frames: 131"), "130 rows for 131 frames"),
        (lambda s: s.replace("Frame Time: 0.0", "Frame Time: -0.0"), r":\d+: .*the frame time is -0"),
        (lambda s: s[: s.rindex(" ")] + "\n", r":\d+: \d+ words instead of \d+ numbers"),
    ],
)
def test_malformed_bvh_is_named(amc, change, words):
    path = amc.with_suffix(".bvh")
    path.write_text(change(files.bvh_from_amc(amc)))
    with pytest.raises(UserError, match=f"77_01.bvh.*{words}"):
        bvh.read(path)


def test_a_skeleton_without_legs_is_refused_by_name(amc):
    path = amc.with_suffix(".bvh")
    path.write_text(files.bvh_from_amc(amc, {"lfemur": "tentacle"}))
    with pytest.raises(UserError, match="no bone for 'l_thigh'"):
        body.from_bones(bvh.read(path))
