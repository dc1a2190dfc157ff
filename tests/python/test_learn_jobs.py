"""Files read in several processes: equal results, one-line errors, bounded memory, nothing left behind."""

import errno
import gc
import itertools
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import mocap_files as files
import numpy as np
import pytest

from gait.errors import UserError
from gait.learn import arrays
from gait.learn.arrays import ArrayFile
from gait.learn.corpus import forkserver, load, processes, sources
from gait.learn.corpus.stage import Task
from gait.learn.options import LearnOptions
from gait.learn.prior import rank
from gait.signals import Interruptible

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Five toy walks and a broken file in their midst."""
    return files.write_trials(tmp_path_factory.mktemp("walks"), 5)


@pytest.fixture
def at_once(monkeypatch):
    """Make the pool start with the first file."""
    monkeypatch.setattr(processes, "START", -1.0)


@pytest.fixture
def stuck(walks):
    """A file, between others, for which its reader waits forever."""
    path = walks / "01_03x.amc"
    os.mkfifo(path)
    writer = os.open(path, os.O_RDWR)
    yield path
    os.close(writer)
    path.unlink()


def readers_of(path):
    """Yield processes that have `path` open for reading alone, unlike the test and what it is starting."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                if any(os.readlink(fd) == str(path) and reads(fd) for fd in (folder / "fd").iterdir()):
                    yield int(folder.name)
            except OSError:  # gone, or not ours
                continue


def reads(fd):
    """Whether a descriptor, as its place in /proc, is for reading alone."""
    info = (fd.parent.parent / "fdinfo" / fd.name).read_text()
    flags = int(next(line.split()[1] for line in info.splitlines() if line.startswith("flags:")), 8)
    return flags & os.O_ACCMODE == os.O_RDONLY


def wait_for(condition, seconds=120):
    end = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
    return value


def contents(sequences):
    """Everything that could differ."""
    return [
        (s.name, s.subject, s.source, s.fps, s.channels.tobytes(), s.heading.tobytes(), s.strides.tobytes(),
         s.period.frames, s.period.scores.tobytes(), s.measures.stature)
        for s in sequences
    ]  # fmt: skip


def test_processes_give_the_same_bits_in_the_order_of_the_files(walks, at_once):
    found, _ = sources.find([str(walks)])
    alone, refused_alone, _ = load.load_all(found)
    counts = []
    together, refused, _ = load.load_all(found, LearnOptions(jobs=3), counts.append)
    assert contents(together) == contents(alone) and len(together) == 5
    assert refused == refused_alone and "01_02x.amc:3" in refused[0]
    assert counts == [1, 2, 3, 4, 5, 6]


def test_bodies_of_people_whose_files_are_all_refused(tmp_path, at_once):
    """A stranger with one short file; short files of people with others are learnt."""
    for name in ("02_01", "02_02", "03_01", "01_99"):
        files.write_toy(tmp_path, name, frames=110)
    files.write_toy(tmp_path, "01_00", frames=300)
    found, _ = sources.find([str(tmp_path)])
    for jobs in (1, 2):
        learnt, refused, others = load.load_all(found, LearnOptions(jobs=jobs))
        assert [s.subject for s in learnt] == ["01", "01", "02", "02"] and len(refused) == 1
        assert len(others) == 1
        for body in others:  # all toys have the same bones
            assert body.thigh == pytest.approx(learnt[0].measures.thigh) and body.stature > 1


def test_a_bad_file_named_by_itself_stops_the_run_from_a_process_too(walks, at_once):
    found = [(path, path.stem != "01_02x") for path, _ in sources.find([str(walks)])[0]]
    with pytest.raises(UserError, match="01_02x.amc:3: 2 numbers, expected 6"):
        load.load_all(found, LearnOptions(jobs=2))
    assert not multiprocessing.active_children()


def test_workers_are_expected_where_much_is_to_be_read_beside_the_first_file(tmp_path, monkeypatch):
    monkeypatch.setattr(forkserver, "WORTH", 100)
    first, second = tmp_path / "a" / "1.amc", tmp_path / "a" / "b" / "2.amc"
    second.parent.mkdir(parents=True)
    first.write_bytes(bytes(200))
    assert not forkserver.worth([str(tmp_path)]) and not forkserver.worth([str(first), "missing"])
    second.write_bytes(bytes(101))
    assert forkserver.worth([str(tmp_path)]) and forkserver.worth([str(first), str(second)])


def test_the_forkserver_starts_for_a_large_run_before_what_is_slow_to_import(tmp_path):
    """Runs that end at once: the skeleton beside a recording is invalid."""
    script = (
        "import sys, gait.cli; from gait.learn.corpus import forkserver\n"
        "forkserver.start = lambda: print('scipy' in sys.modules)\n"
        "for jobs, large in ('2', True), ('1', True), ('2', False):\n"
        "    forkserver.worth = lambda sources: large\n"
        f"    gait.cli.main(['learn', 'x.asf', '-o', {str(tmp_path / 'm.gait')!r}, '--jobs', jobs])"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert run.stdout == "False\n" and run.stderr.count("gait learn: x.asf: no such file") == 3


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="blocked signals are listed elsewhere")
def test_the_server_that_imports_does_not_hear_an_interruption():
    """From a terminal the signal reaches the whole group; the command itself ends its server."""
    status = "print(open(f'/proc/{forkserver._forkserver._forkserver_pid}/status').read())"
    program = (
        "from multiprocessing import forkserver; from gait.learn.corpus import forkserver as f; "
        f"f.start(); {status}"
    )
    reported = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    held = next(line.split()[1] for line in reported.stdout.splitlines() if line.startswith("SigBlk"))
    assert int(held, 16) >> (signal.SIGINT - 1) & 1


def test_workers_have_the_stage_from_the_server_that_was_started():
    script = """
import sys
from gait.learn.corpus import forkserver

if __name__ == "__main__":
    forkserver.start()
    with forkserver.context().Pool(1) as pool:
        print(pool.apply(eval, ("'gait.learn.corpus.stage' in __import__('sys').modules",)))
    print("gait.learn.corpus.stage" in sys.modules)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "False"]


def test_few_small_files_do_not_start_processes_and_many_do(walks, monkeypatch):
    started, clock = [], itertools.count()
    monkeypatch.setattr(processes, "_pooled", lambda tasks, *_: started.append(len(tasks)) or iter(()))
    monkeypatch.setattr(processes, "time", SimpleNamespace(perf_counter=lambda: 0.1 * next(clock)))
    task = Task(walks / "01_00.amc")
    assert len(list(processes.prepared([task] * 3, 2))) == 3 and not started
    done = len(list(processes.prepared([task] * 3000, 2)))
    assert started == [3000 - done] and done == 1


def test_a_file_that_kills_its_process_is_named_and_the_rest_is_read(walks, stuck, at_once):
    found = [(p, True) for p in sorted(walks.glob("*.amc"))]
    finished = threading.Event()

    def kill_readers():
        while not finished.wait(0.02):
            for pid in readers_of(stuck):
                os.kill(pid, signal.SIGKILL)

    killer = threading.Thread(target=kill_readers)
    killer.start()
    try:
        sequences, refused, _ = load.load_all(found, LearnOptions(jobs=2))
    finally:
        finished.set()
        killer.join()
    assert [s.name for s in sequences] == [f"01_{i:02}" for i in range(5)]
    assert [line.split(":")[0] for line in refused] == [str(walks / "01_02x.amc"), str(stuck)]
    assert "was killed" in refused[1] and "--exclude" in refused[1] and "\n" not in refused[1]
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_stopped_command_leaves_no_processes(walks, stuck, tmp_path, number):
    script = (
        "import sys, gait.cli; from pathlib import Path; from gait.learn.corpus import processes, sources\n"
        "processes.START = -1.0\n"
        f"files = [(p, True) for p in sorted(Path({str(walks)!r}).glob('*.amc'))]\n"
        "sources.find = lambda *_: (files, [])\n"
        f"sys.exit(gait.cli.main(['learn', 'x', '-o', {str(tmp_path / 'm.gait')!r}, '--jobs', '2']))"
    )
    run = subprocess.Popen(
        [sys.executable, "-c", script],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    try:
        wait_for(lambda: list(readers_of(stuck)) or run.poll() is not None)
        if number == signal.SIGINT:  # from a terminal it reaches the whole group
            os.killpg(run.pid, number)
        else:
            run.send_signal(number)
        words = run.communicate(timeout=120)[1]
    finally:
        run.kill()
    if number == signal.SIGKILL:
        assert run.returncode == -signal.SIGKILL
    else:
        assert (run.returncode, words) == (1, "gait learn: interrupted\n")
    wait_for(lambda: not _group_lives(run.pid))
    assert not list(tmp_path.glob("*gait*"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_waits_while_a_worker_starts(number):
    ended = []
    with pytest.raises(KeyboardInterrupt), Interruptible(), forkserver.held_back():
        thread = threading.Thread(target=os.kill, args=(os.getpid(), number))
        unblocked = signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})  # as in a thread of a library
        thread.start()
        thread.join()
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        ended.append(number)
    assert ended == [number]


def _group_lives(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def test_spooled_arrays_come_back_and_leave_no_file(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    arrays = [np.arange(12.0).reshape(3, 4), np.zeros((0, 4)), np.full((2, 2), np.nan)]
    with ArrayFile() as file:
        for array in arrays:
            file.put(array)
        views = file.views()
        assert not list(tmp_path.iterdir())
    for array, view in zip(arrays, views, strict=True):
        assert np.array_equal(array, view, equal_nan=True) and view.shape == array.shape
        assert not view.flags.owndata and not view.flags.writeable


def test_signals_that_were_read_are_not_held_in_memory(walks):
    path = walks / "01_04.amc"
    held = []
    tracemalloc.start()
    for count in (1, 3, 5):  # the first fills caches
        sequences = load.load_all([(path, True)] * count).sequences  # busy, it would start processes
        gc.collect()
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert held[2] - held[1] < 2 * 0.5 * sequences[0].channels.nbytes


def test_a_full_disk_is_one_line_with_its_remedy(walks, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: open("/dev/full", "r+b", buffering=0))  # noqa: SIM115
    with pytest.raises(UserError, match=f"{os.strerror(errno.ENOSPC)}.*set TMPDIR"):
        load.load_all(sources.find([str(walks)])[0])


STATUS = Path("/proc/self/status")
MOST = 0.05  # MB per cycle; a cycle's values alone are 0.03 MB, and they are used in a dozen ways
COPIES = 18, 27  # of six recordings: enough cycles for the components' fixed memory to be in use

CHILD = """
import json, sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from functools import partial
from gait.learn.cycles import align
from gait.learn.prior import fit, imputation, model
from gait.learn.corpus import load, sources
from gait.learn.options import LearnOptions
from gait.reproducible import one_thread
from gait.learn import arrays

align.MOST_ALIGNMENT_PASSES = 2  # more passes take time but no more memory
imputation.climb = partial(imputation.climb, passes=2)

def copy(s, k):
    noise = 0.02 * np.random.default_rng(k).normal(size=s.channels.shape)
    return replace(s, name=f"{s.name}-{k}", channels=arrays.stored([s.channels + noise], noise.shape[1:]))

read = load.load_all(sources.find([sys.argv[1]])[0]).sequences
with one_thread():
    learned = fit.fit([copy(s, k) for s in read for k in range(int(sys.argv[2]))])
    model.sections(learned, LearnOptions())
peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
print(json.dumps({"cycles": len(learned.cycles.values), "peak": int(peak.split()[1]) / 1024}))
"""


def peak(folder, copies):
    """Cycles learnt, and the peak resident memory of the process that learnt them, MB."""
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
    assert many >= 1.5 * few > 500
    assert large - small <= MOST * (many - few), f"{few} cycles: {small:.0f} MB, {many}: {large:.0f} MB"


@pytest.mark.parametrize("people", [True, False], ids=["people", "blocks"])
def test_choosing_the_number_of_components_keeps_cycles_on_disk(people):
    """Memory grows by less than one copy of the cycles that are added."""
    shape, peaks = (64, 10), []
    for blocks in (4, 12):
        rng = np.random.default_rng(0)
        values = arrays.stored((rng.normal(size=(arrays.ROWS, *shape)) for _ in range(blocks)), shape)
        groups = np.arange(len(values)) % 8 if people else None
        tracemalloc.start()
        rank.choose(values, np.ones(values.shape, bool), rng, groups, 5, 1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 8 * arrays.ROWS * 8 * np.prod(shape)


def test_rows_on_disk_are_those_put_there_also_after_their_release():
    rows = np.random.default_rng(1).normal(size=(3 * arrays.ROWS + 5, 4, 2))
    kept = arrays.stored((rows[part] for part in arrays.by_rows(rows)), rows.shape[1:])
    read = []
    for part in arrays.by_rows(kept):
        read.append(kept[part].copy())
    arrays.release(kept, rows)
    np.testing.assert_array_equal(np.concatenate(read), rows)
    np.testing.assert_array_equal(kept, rows)
    assert arrays.stored(iter([]), (4, 2)).shape == (0, 4, 2)
