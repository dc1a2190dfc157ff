"""What no walker can reach is refused at reading, in every kind of file, with its place."""

import mocap_files as files
import pytest

from gait.errors import UserError
from gait.learn.solve import readers


def damaged(path, change):
    """Change a file's lines."""
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")
    return path


def put(row, column, value, separator=None):
    """Return a change that sets one word of one line."""

    def change(lines):
        cells = lines[row].split(separator)
        cells[column] = value
        return [*lines[:row], (separator or " ").join(cells), *lines[row + 1 :]]

    return change


def table(path, columns, rows=40):
    """Write a table of ones over time."""
    lines = [",".join(["time", *columns])]
    lines += [",".join([f"{t / 100:.2f}", *["1"] * len(columns)]) for t in range(rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("value", ["1e300", "-99999"])
@pytest.mark.parametrize(
    "column", ["l_hip_flexion_deg", "l_hip_flexion_rad", "l_hip_flexion", "root_forward", "l_hip_x"]
)
def test_tables(tmp_path, column, value):
    legs = [f"{s}_{joint}_flexion_deg" for s in "lr" for joint in ("hip", "knee")]
    path = table(tmp_path / "a.csv", [column, *(name for name in legs if not name.startswith(column))])
    words = rf"a\.csv(:21|: frame 20): {column} .* at most \d+ (\w+ )?are plausible"
    with pytest.raises(UserError, match=words):
        readers.read(damaged(path, put(20, 1, value, ",")))


@pytest.mark.parametrize("word", ["abc", "inf", "-Infinity", "1e999", "1.2.3"])
def test_words_are_no_numbers(tmp_path, word):
    path = table(tmp_path / "a.csv", ["l_knee_flexion_deg"])
    with pytest.raises(UserError, match=f"a.csv:8: l_knee_flexion_deg: '{word}' is not a number"):
        readers.read(damaged(path, put(7, 1, word, ",")))


@pytest.mark.parametrize(
    ("bone", "words"), [("root", "frame 3: root tx .* metres"), ("lfemur", "frame 3: lfemur rx .* degrees")]
)
def test_amc(tmp_path, bone, words):
    path = files.write_toy(tmp_path, frames=5)
    row = [i for i, line in enumerate(path.read_text().splitlines()) if line.startswith(f"{bone} ")][2]
    with pytest.raises(UserError, match=words):
        readers.read(damaged(path, put(row, 1, "1e300")))


def test_amc_in_radians_says_so(tmp_path):
    path = files.write_toy(tmp_path, frames=5)
    path.write_text(path.read_text().replace(":DEGREES", ":RADIANS"))
    with pytest.raises(UserError, match=r"degrees \(radians in the file\), at most"):
        readers.read(path)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [(0, "1e300", "frame 5: root .position .* metres"), (4, "1e308", "frame 5: root .rotation .* degrees")],
)
def test_bvh(tmp_path, column, value, words):
    path = tmp_path / "a.bvh"
    path.write_text(files.bvh_from_amc(files.write_toy(tmp_path, frames=5)))
    with pytest.raises(UserError, match=words):
        readers.read(damaged(path, put(-1, column, value)))
