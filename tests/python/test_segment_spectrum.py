"""F1: how much of the variance of recorded motion leading modes hold, against plain singular values."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from gait.learn.segment_options import Segments
from gait.learn.segments import segment_corpus, segment_fit, segment_motion
from gait.learn.segments.segment_corpus import Corpus
from gait.learn.solve import readers

MOCAP = Path(__file__).parents[3] / "shared" / "data" / "mocap" / "cmu_misc"
FOUR = ("01/01_14.amc", "02/02_04.amc", "02/02_05.amc", "02/02_07.amc")
ALL = tuple(sorted(str(path.relative_to(MOCAP)) for path in MOCAP.glob("*/*.amc")))
MODES = 50


def shares(files: Iterable[str]) -> tuple[np.ndarray, np.ndarray]:
    """Cumulative shares of the variance (MODES,) that the prior's modes hold, and by singular values."""
    wanted = Segments(source="only", people=False, modes=MODES)
    with Corpus() as corpus:
        for file in files:
            path = MOCAP / file
            corpus.put(path.stem, path.parent.name, path, segment_motion.of(path, readers.read(path), wanted))
        recordings = corpus.recordings()
        prior = segment_fit.fit(recordings, wanted)
        rows = np.concatenate([segment_corpus.segments(r, prior.names, wanted) for r in recordings])
    flat = rows.reshape(len(rows), -1)
    values = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False) ** 2
    variance = prior.sd[0] ** 2
    outside = 3 * prior.frames * prior.residual[0].sum()
    have = np.cumsum(variance / (variance.sum() + outside))
    return have, np.cumsum(values / values.sum())[:MODES]


@pytest.mark.skipif(not MOCAP.is_dir(), reason="no motion capture here")
@pytest.mark.parametrize(
    ("files", "held", "count"),
    [(FOUR, (0.9948, 0.9972), 10), (ALL, (0.9886, 0.9933), 13)],
    ids=["four", "all"],
)
def test_modes_hold_as_much_variance_as_singular_values_say(
    files: tuple[str, ...], held: tuple[float, float], count: int
) -> None:
    have, want = shares(files)
    assert np.abs(have - want).max() < 1e-3
    assert have[[39, 49]] == pytest.approx(held, abs=1e-3)
    assert np.searchsorted(have, 0.91) + 1 == count
