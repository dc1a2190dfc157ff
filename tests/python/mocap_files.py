"""Small motion files for tests: a toy person in ASF/AMC, any ASF/AMC written again as BVH, a stand."""

import csv
from pathlib import Path

import gait_generator as g
import numpy as np
from scipy.spatial.transform import Rotation

import gait
from gait.body.skeleton import JOINTS
from gait.learn.mocap import acclaim
from gait.learn.mocap.recording import Y_UP

# name, parent, direction, length (units of inch / 0.45), axis (degrees), dof
BONES = [
    ("lhipjoint", "root", (0.66, -0.71, 0.25), 2.5, (0, 0, 0), ""),
    ("lfemur", "lhipjoint", (0.34202, -0.939693, 0), 7.4, (0, 0, 20), "rx ry rz"),
    ("ltibia", "lfemur", (0.34202, -0.939693, 0), 7.8, (0, 0, 20), "rx"),
    ("lfoot", "ltibia", (0.09, -0.25, 0.964), 2.3, (-90, 0, 20), "rx rz"),
    ("rhipjoint", "root", (-0.66, -0.71, 0.25), 2.5, (0, 0, 0), ""),
    ("rfemur", "rhipjoint", (-0.34202, -0.939693, 0), 7.4, (0, 0, -20), "rx ry rz"),
    ("rtibia", "rfemur", (-0.34202, -0.939693, 0), 7.8, (0, 0, -20), "rx"),
    ("rfoot", "rtibia", (-0.09, -0.25, 0.964), 2.3, (-90, 0, -20), "rx rz"),
    ("lowerback", "root", (0, 1, -0.05), 6.2, (0, 0, 0), "rx ry rz"),
    ("lowerneck", "lowerback", (0, 1, 0), 1.6, (0, 0, 0), "rx ry rz"),
    ("upperneck", "lowerneck", (0, 1, 0), 1.6, (0, 0, 0), ""),
    ("head", "upperneck", (0, 1, 0), 1.6, (0, 0, 0), "rx ry rz"),
    ("lclavicle", "lowerback", (0.97, 0.25, 0), 3.5, (0, 0, 0), ""),
    ("lhumerus", "lclavicle", (1, 0, 0), 4.9, (180, -30, -90), "rx ry rz"),
    ("lradius", "lhumerus", (1, 0, 0), 3.4, (180, -30, -90), "rx"),
    ("lwrist", "lradius", (1, 0, 0), 1.7, (0, 90, 90), "ry"),
    ("lhand", "lwrist", (1, 0, 0), 0.7, (0, 90, 90), "rx rz"),
    ("rclavicle", "lowerback", (-0.97, 0.25, 0), 3.5, (0, 0, 0), ""),
    ("rhumerus", "rclavicle", (-1, 0, 0), 4.9, (180, 30, 90), "rx ry rz"),
    ("rradius", "rhumerus", (-1, 0, 0), 3.4, (180, 30, 90), "rx"),
    ("rwrist", "rradius", (-1, 0, 0), 1.7, (0, -90, -90), "ry"),
    ("rhand", "rwrist", (-1, 0, 0), 0.7, (0, -90, -90), "rx rz"),
]


def toy_asf():
    """Text of a skeleton with all bones that a person needs."""
    lines = [":version 1.10", ":units", "  length 0.45", "  angle deg", ":root"]
    lines += [
        "  order TX TY TZ RX RY RZ",
        "  axis XYZ",
        "  position 0 0 0",
        "  orientation 0 0 0",
        ":bonedata",
    ]
    for i, (name, _, direction, length, axis, dof) in enumerate(BONES, 1):
        lines += ["  begin", f"    id {i}", f"    name {name}"]
        lines += [f"    direction {' '.join(map(str, direction))}", f"    length {length}"]
        lines += [f"    axis {' '.join(map(str, axis))} XYZ", *([f"    dof {dof}"] if dof else []), "  end"]
    lines += [":hierarchy", "  begin"]
    parents = list(dict.fromkeys(parent for _, parent, *_ in BONES))
    lines += [f"    {p} {' '.join(name for name, parent, *_ in BONES if parent == p)}" for p in parents]
    return "\n".join([*lines, "  end"]) + "\n"


def toy_amc(frames=300, period=120.0, offset=10.0, speed=1.3, swing=1.0, seed=0, together=False):
    """Text of a straight walk at 120 frames/s, angles like the normative ones times `swing`.

    `together`: the left leg and arm move with the right ones.
    """
    phase = (np.arange(frames) - offset) / period
    curve = swing * g.mean_curves(phase) + np.random.default_rng(seed).normal(scale=0.1, size=(frames, 19))
    if together:
        curve[:, 11:] = curve[:, 3:11]
    unit = acclaim.INCH / 0.45
    lines = [":FULLY-SPECIFIED", ":DEGREES"]
    for t in range(frames):
        neck, right, left = curve[t, :3], curve[t, 3:11], curve[t, 11:]
        forward, height = speed * t / 120.0 / unit, 3.2 + max(_reach(right), _reach(left))
        values = {"root": [0.0, height, forward, 0.0, 0.0, 0.0], "lowerback": [3.0, 0.5, 0.5]}
        values["lowerneck"] = values["head"] = list(neck / 2)
        for side, sign, a in (("l", 1, left), ("r", -1, right)):
            values[f"{side}femur"] = [-a[4], 2.0 * sign, -20.0 * sign + a[5] / 2]
            values[f"{side}tibia"] = [a[7] + 5.0]
            values[f"{side}foot"] = [-5.0 + a[7] / 10, 0.0]
            values[f"{side}humerus"] = [a[0], 5.0 * sign, -75.0 * sign]
            values[f"{side}radius"] = [a[3] + 5.0]
            values[f"{side}wrist"], values[f"{side}hand"] = [0.0], [0.0, 0.0]
        lines.append(str(t + 1))
        lines += [f"{name} {' '.join(f'{v:.5f}' for v in row)}" for name, row in values.items()]
    return "\n".join(lines) + "\n"


def _reach(angles):
    """Hip over the ankle of a leg: the lower one stands on the ground."""
    hip, knee = np.radians(angles[4]), np.radians(angles[7] + 5.0)
    return 7.4 * np.cos(hip) + 7.8 * np.cos(knee - hip)


def write_toy(folder, name="77_01", **motion):
    """Write a toy skeleton (if there is none) and motion; return the .amc's path."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name.split('_')[0]}.asf").write_text(toy_asf())
    (folder / f"{name}.amc").write_text(toy_amc(**motion))
    return folder / f"{name}.amc"


def bvh_from_amc(path, rename=None, unit=0.0254 / 0.45):
    """Text of the same motion as BVH: one joint per bone, file axes kept, lengths in `unit` metres."""
    skeleton = acclaim.read_skeleton(acclaim.find_skeleton(path))
    motion = acclaim.read(path)
    bones, scale = skeleton.bones, skeleton.metres / unit
    world = Y_UP.T @ motion.rotation @ Y_UP
    columns, lines = [motion.start[:, 0] @ Y_UP / unit], ["HIERARCHY"]

    def joint(i, depth):
        bone, pad = bones[i], "  " * depth
        parent = bones[bone.parent] if bone.parent > 0 else None
        offset = parent.direction * parent.length * scale if parent else np.zeros(3)
        lines.append(f"{pad}{'JOINT' if i else 'ROOT'} {(rename or {}).get(bone.name, bone.name)}")
        lines.extend([f"{pad}{{", f"{pad}  OFFSET {' '.join(f'{v:.8f}' for v in offset)}"])
        place = "6 Xposition Yposition Zposition" if not i else "3"
        lines.append(f"{pad}  CHANNELS {place} Zrotation Yrotation Xrotation")
        above = world[:, bone.parent] if i else np.broadcast_to(np.eye(3), world[:, 0].shape)
        turn = np.swapaxes(above, 1, 2) @ world[:, i]
        columns.append(Rotation.from_matrix(turn).as_euler("ZYX", degrees=True))
        children = [k for k, other in enumerate(bones) if other.parent == i and k]
        for k in children:
            joint(k, depth + 1)
        if not children:
            end = bone.direction * bone.length * scale
            lines.extend(
                [f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET {' '.join(f'{v:.8f}' for v in end)}"]
            )
            lines.append(f"{pad}  }}")
        lines.append(f"{pad}}}")

    joint(0, 0)
    rows = np.concatenate(columns, axis=1)
    lines += ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {1 / motion.fps:.8f}"]
    return "\n".join([*lines, *(" ".join(f"{v:.6f}" for v in row) for row in rows)]) + "\n"


def write_people(folder):
    """Six toy walks of three subjects in a folder each."""
    for i, (subject, trial) in enumerate([(1, 1), (1, 2), (2, 1), (2, 2), (3, 1), (3, 2)]):
        motion = {"period": 110.0 + 6 * i, "offset": 13.0 * i, "swing": 0.85 + 0.05 * i, "seed": i}
        write_toy(folder / f"{subject:02}", f"{subject:02}_{trial:02}", frames=400, **motion)
    return folder


def write_trials(folder, count):
    """Toy walks of one subject with a broken file among them."""
    for i in range(count):
        write_toy(folder, f"01_{i:02}", period=110.0 + 5 * i, seed=i, frames=300 + 20 * i)
    (folder / "01_02x.amc").write_text(BROKEN)
    return folder


def write_stand(folder, name, model, elbow, walks=False, raised=0.0, stops=90):
    """Write three seconds of joints of a person with bent elbows and raised arms, at 30 frames/s.

    The person sways, or walks until the frame `stops`.
    """
    rng = np.random.default_rng(1)
    folder.mkdir(exist_ok=True)
    with (folder / f"{name}.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame", "time", *(f"{joint}_{axis}" for joint in JOINTS for axis in "xyz")])
        order = [model.joint_names.index(joint) for joint in JOINTS]
        for frame in range(90):
            state = gait.State(stature=1.7, motion_class=0 if walks else 1, offset=np.zeros(24))
            state.phase = min(frame, stops) / 33 % 1 if walks else 0
            state.offset[[model.angle_names.index(f"{s}_elbow_flexion") for s in "lr"]] = elbow
            state.offset[[model.angle_names.index(f"{s}_shoulder_abduction") for s in "lr"]] = raised
            ahead = 1.4 * min(frame, stops) / 33 if walks else 0.004 * np.sin(frame / 10)
            state.pelvis = np.array([ahead, 0.001 * rng.normal(), model.pelvis_height(state)])
            places = model.pose(state)[0][order]
            rows.writerow([frame, f"{frame / 30:.6f}", *(f"{x:.4f}" for x in places.ravel())])


BROKEN = ":DEGREES\n1\nroot 1 2\n"
