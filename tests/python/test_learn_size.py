"""A model stays small, whatever the recordings are called and however many there are."""

import json

import mocap_files as files
import numpy as np
import pytest

import gait.cli
from gait.io import blob
from gait.learn.prior import lengths, model, pace

PEOPLE = 14  # more than META has rows
LIMIT = 100_000  # bytes of a cyclic model of five components


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    """Five components of people with names as long as a file system takes, who walk at two rates each."""
    folder = tmp_path_factory.mktemp("named")
    for i in range(PEOPLE):
        for trial, period in (("01", 112.0 + i), ("02", 126.0 - i)):
            name = f"{'Ä' * 120}{i:02}_{trial}"
            files.write_toy(folder / "walks", name, period=period, swing=0.9 + 0.02 * i, seed=i, frames=300)
    words = ["learn", folder / "walks", "-o", folder / "m.gait", "--components", 5, "--segments", "none"]
    assert gait.cli.main([*map(str, words), "--activity", "walk" * 100, "--quiet"]) == 0
    return folder / "m.gait"


def test_five_components_take_less_than_100_kB(learned):
    sections = blob.read(learned)
    assert sections["PACE"].shape == (pace.TERMS, 30) and len(sections["PROP"]) == lengths.COUNT
    meta = json.loads(sections["META"].tobytes())
    assert meta["subject_count"] == PEOPLE and meta["sequences"]["count"] == 2 * PEOPLE
    assert len(meta["subjects"]) == len(meta["sequences"]["rows"]) == model.MOST_ROWS
    assert model.CMU in meta["acknowledgement"]
    assert learned.stat().st_size < LIMIT - 1000


@pytest.mark.parametrize(
    "name", ["02_01", "x" * 32, "Ä" * 40, "\t\n" * 40, "\udcff" * 9, '"' * 99, "𝔸" * 20, ""]
)
def test_names_in_a_model_are_bounded(name):
    kept = model.shortened(name)
    assert len(json.dumps(kept)) <= model.MOST_NAME
    assert kept == name if len(json.dumps(name)) <= model.MOST_NAME else name.startswith(kept[:-3])


def test_zeros_have_no_sign():
    stored = model.rounded(np.array([-1e-9, 1e-9, -0.0, -0.25]))
    assert stored.tobytes() == np.array([0, 0, 0, -0.25], np.float32).tobytes()
