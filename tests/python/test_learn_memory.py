"""Memory while learning: it grows by little more than what the components need."""

import json
import subprocess
import sys
import tracemalloc
from pathlib import Path

import mocap_files as files
import numpy as np
import pytest

from gait.learn import spool
from gait.learn.prior import rank

STATUS = Path("/proc/self/status")
MOST = 0.05  # MB per cycle; a cycle's values alone are 0.03 MB, and they are used in a dozen ways
COPIES = 30, 60  # of six recordings: enough cycles for the components' fixed memory to be in use

CHILD = """
import json, sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from gait.learn.prior import fit, model
from gait.learn.corpus import sources, stage
from gait.learn import spool

def copy(s, k):
    noise = 0.02 * np.random.default_rng(k).normal(size=s.channels.shape)
    return replace(s, name=f"{s.name}-{k}", channels=spool.stored([s.channels + noise], noise.shape[1:]))

read, _ = sources.load_all(sources.find([sys.argv[1]]))
with stage.one_thread():
    learned = fit.fit([copy(s, k) for s in read for k in range(int(sys.argv[2]))])
    model.sections(learned, "walk", 1)
peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
print(json.dumps({"cycles": len(learned.cycles.values), "peak": int(peak.split()[1]) / 1024}))
"""


def peak(folder, copies):
    """Cycles learnt and the largest resident memory of the process that did, MB."""
    words = [sys.executable, "-c", CHILD, str(folder), str(copies)]
    out = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    return out["cycles"], out["peak"]


@pytest.mark.skipif(
    not STATUS.exists() or "VmHWM" not in STATUS.read_text(), reason="no VmHWM in /proc/self/status"
)
def test_memory_grows_little_with_the_cycles(tmp_path):
    for i in range(6):
        motion = {"period": 110.0 + 6 * i, "offset": 13.0 * i, "swing": 0.85 + 0.05 * i, "seed": i}
        files.write_toy(tmp_path / f"{i // 2:02}", f"{i // 2:02}_{i % 2:02}", frames=400, **motion)
    (few, small), (many, large) = (peak(tmp_path, copies) for copies in COPIES)
    assert many >= 2 * few > 700
    assert large - small <= MOST * (many - few), f"{few} cycles: {small:.0f} MB, {many}: {large:.0f} MB"


@pytest.mark.parametrize("people", [True, False], ids=["people", "blocks"])
def test_choosing_the_number_of_components_keeps_cycles_on_disk(people):
    """Memory grows by less than one copy of the cycles that are added."""
    shape, peaks = (64, 10), []
    for blocks in (4, 12):
        rng = np.random.default_rng(0)
        values = spool.stored((rng.normal(size=(spool.ROWS, *shape)) for _ in range(blocks)), shape)
        groups = np.arange(len(values)) % 8 if people else None
        tracemalloc.start()
        rank.choose(values, np.ones(values.shape, bool), rng, groups, 5, 1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 8 * spool.ROWS * 8 * np.prod(shape)


def test_rows_on_disk_are_those_put_there_also_after_their_release():
    rows = np.random.default_rng(1).normal(size=(3 * spool.ROWS + 5, 4, 2))
    kept = spool.stored((rows[part] for part in spool.by_rows(rows)), rows.shape[1:])
    read = []
    for part in spool.by_rows(kept):
        read.append(kept[part].copy())
    spool.release(kept, rows)
    np.testing.assert_array_equal(np.concatenate(read), rows)
    np.testing.assert_array_equal(kept, rows)
    assert spool.stored(iter([]), (4, 2)).shape == (0, 4, 2)
