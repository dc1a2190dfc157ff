"""The segment prior in a blob: written, read back, and refused where it is damaged."""

import numpy as np
import pytest
from toy_segments import toy_blob, toy_prior

from gait.bindings.segment_prior import TAGS, SegmentPrior
from gait.errors import UserError
from gait.io import blob
from gait.learn.segments.segment_sections import sections


@pytest.mark.parametrize("components", [1, 3])
def test_prior_survives_the_file(tmp_path, components):
    """What was written is read, to the rounding of the file."""
    prior = toy_prior(5, 8, 6, seed=2, components=components)
    path = tmp_path / "toy.gait"
    path.write_bytes(toy_blob(prior))
    read = SegmentPrior.load(path)
    assert read.names == prior.names
    whole = ("frames", "hop", "headings", "components", "size", "segments", "recordings", "fps", "gamma")
    assert [getattr(read, name) for name in whole] == [getattr(prior, name) for name in whole]
    for name in ("weights", "mean", "modes", "sd", "residual", "stature"):
        np.testing.assert_allclose(getattr(read, name), getattr(prior, name), rtol=1e-6, atol=1e-6)


def test_markers_are_found_by_name():
    """Places follow the order asked for; an unknown name is an error that lists the known ones."""
    prior = toy_prior(3, 4, 2)
    assert prior.index(["head_top", "pelvis"]).tolist() == [2, 0]
    with pytest.raises(UserError, match="'nose' is not in the prior; it knows pelvis neck"):
        prior.index(["nose"])


def test_blob_without_prior_says_how_to_learn_it(tmp_path):
    """A cyclic model without the sections, or with a part of them."""
    with pytest.raises(UserError, match=r"x.gait: holds no segment prior; learn it with gait learn"):
        SegmentPrior.from_sections({}, "x.gait")
    parts = {k: v for k, v in sections(toy_prior()).items() if k != "SGSD"}
    with pytest.raises(UserError, match="holds no section SGSD"):
        SegmentPrior.from_sections(parts, "x.gait")


def _changed(tag: str, change) -> dict:
    parts = {k: v.copy() for k, v in sections(toy_prior()).items()}
    parts[tag] = change(parts[tag])
    return parts


@pytest.mark.parametrize(
    ("tag", "change"),
    [
        ("SGIN", lambda a: a[:5]),
        ("SGIN", lambda a: a * np.array([1, 9, 1, 1, 1, 1, 1, 1], np.int32)),
        ("SGIN", lambda a: a + np.array([0, 0, 3, 0, 0, 0, 0, 0], np.int32)),
        ("SGRT", lambda a: a * np.float32(0)),
        ("SGWT", lambda a: a * np.float32(2)),
        ("SGMN", lambda a: a[:, 1:]),
        ("SGMD", lambda a: a * np.float32(np.nan)),
        ("SGSD", lambda a: -a),
        ("SGPS", lambda a: a[:, :3]),
    ],
)
def test_contradictions_are_refused(tag, change):
    """Shapes, counts, signs and values are checked before use."""
    with pytest.raises(UserError, match=r"bad.gait: .*; learn the model again"):
        SegmentPrior.from_sections(_changed(tag, change), "bad.gait")


def test_the_group_is_complete_and_ordered():
    """The sections are those of the format, none left out."""
    assert tuple(blob.decode(toy_blob(toy_prior()))) == TAGS
