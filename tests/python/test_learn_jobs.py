"""Files read in several processes: the same result, one line for what fails, nothing left behind."""

import errno
import gc
import itertools
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

from gait import cli
from gait.errors import UserError
from gait.learn.corpus import fork_server, pool, sources
from gait.learn.corpus.stage import Task
from gait.learn.spool import Spool


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Five toy walks and a broken file in their midst."""
    return files.write_trials(tmp_path_factory.mktemp("walks"), 5)


@pytest.fixture
def at_once(monkeypatch):
    """Make the pool start with the first file."""
    monkeypatch.setattr(pool, "START", -1.0)


@pytest.fixture
def stuck(walks):
    """A file on which its reader waits for ever, between others."""
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
    """All that could differ."""
    return [
        (s.name, s.subject, s.source, s.fps, s.channels.tobytes(), s.heading.tobytes(), s.strides.tobytes(),
         s.period.frames, s.period.scores.tobytes(), s.measures.stature)
        for s in sequences
    ]  # fmt: skip


def test_processes_give_the_same_bits_in_the_order_of_the_files(walks, at_once):
    found = sources.find([str(walks)])
    alone, refused_alone = sources.load_all(found, jobs=1)
    counts = []
    together, refused = sources.load_all(found, progress=counts.append, jobs=3)
    assert contents(together) == contents(alone) and len(together) == 5
    assert refused == refused_alone and "01_02x.amc:3" in refused[0]
    assert counts == [1, 2, 3, 4, 5, 6]


def test_bodies_of_people_of_whom_no_file_can_be_used(tmp_path, at_once):
    """Two strangers of one cycle, the one twice; a walker's own short file counts for nothing."""
    for name in ("02_01", "02_02", "03_01", "01_99"):
        files.write_toy(tmp_path, name, frames=110)
    files.write_toy(tmp_path, "01_00", frames=300)
    found = sources.find([str(tmp_path)])
    for jobs in (1, 2):
        others = []
        learnt, refused = sources.load_all(found, jobs=jobs, others=others)
        assert [s.subject for s in learnt] == ["01"] and len(refused) == 4
        assert len(others) == 2
        for body in others:  # all toys have the same bones
            assert body.thigh == pytest.approx(learnt[0].measures.thigh) and body.stature > 1


def test_a_bad_file_named_by_itself_stops_the_run_from_a_process_too(walks, at_once):
    found = [(path, path.stem != "01_02x") for path, _ in sources.find([str(walks)])]
    with pytest.raises(UserError, match="01_02x.amc:3: 2 numbers where 6"):
        sources.load_all(found, jobs=2)
    assert not multiprocessing.active_children()


def test_workers_are_expected_where_much_is_to_be_read_beside_the_first_file(tmp_path, monkeypatch):
    monkeypatch.setattr(fork_server, "WORTH", 100)
    first, second = tmp_path / "a" / "1.amc", tmp_path / "a" / "b" / "2.amc"
    second.parent.mkdir(parents=True)
    first.write_bytes(bytes(200))
    assert not fork_server.worth([str(tmp_path)]) and not fork_server.worth([str(first), "missing"])
    second.write_bytes(bytes(101))
    assert fork_server.worth([str(tmp_path)]) and fork_server.worth([str(first), str(second)])


@pytest.mark.parametrize(("jobs", "large", "starts"), [("2", True, 1), ("1", True, 0), ("2", False, 0)])
def test_the_fork_server_starts_before_what_is_slow_to_import(jobs, large, starts, tmp_path):
    """A run that ends at once: the skeleton beside a recording is none."""
    script = (
        "import sys, gait.cli; from gait.learn.corpus import fork_server\n"
        f"fork_server.worth = lambda sources: {large}\n"
        "fork_server.start = lambda: print('scipy' in sys.modules)\n"
        f"gait.cli.main(['learn', 'x.asf', '-o', {str(tmp_path / 'm.gait')!r}, '--jobs', {jobs!r}])"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert run.stdout == starts * "False\n" and run.stderr.startswith("gait learn: x.asf: no such file")


@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="signals held back are told elsewhere")
def test_the_server_that_imports_does_not_hear_an_interruption():
    """From a terminal it reaches the whole group; the command ends its server itself."""
    tell = "print(open(f'/proc/{forkserver._forkserver._forkserver_pid}/status').read())"
    program = (
        "from multiprocessing import forkserver; from gait.learn.corpus import fork_server as f; "
        f"f.start(); {tell}"
    )
    told = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    held = next(line.split()[1] for line in told.stdout.splitlines() if line.startswith("SigBlk"))
    assert int(held, 16) >> (signal.SIGINT - 1) & 1


def test_workers_have_the_stage_from_the_server_that_was_started():
    script = """
import sys
from gait.learn.corpus import fork_server

if __name__ == "__main__":
    fork_server.start()
    with fork_server.context().Pool(1) as pool:
        print(pool.apply(eval, ("'gait.learn.corpus.stage' in __import__('sys').modules",)))
    print("gait.learn.corpus.stage" in sys.modules)
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["True", "False"]


def test_few_small_files_do_not_start_processes_and_many_do(walks, monkeypatch):
    started, clock = [], itertools.count()
    monkeypatch.setattr(pool, "_pooled", lambda tasks, *_: started.append(len(tasks)) or iter(()))
    monkeypatch.setattr(pool, "time", SimpleNamespace(perf_counter=lambda: 0.1 * next(clock)))
    task = Task(walks / "01_00.amc")
    assert len(list(pool.prepared([task] * 3, 2))) == 3 and not started
    done = len(list(pool.prepared([task] * 3000, 2)))
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
        sequences, refused = sources.load_all(found, jobs=2)
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
        "import sys, gait.cli; from pathlib import Path; from gait.learn.corpus import pool, sources\n"
        "pool.START = -1.0\n"
        f"sources.find = lambda *_: [(p, True) for p in sorted(Path({str(walks)!r}).glob('*.amc'))]\n"
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
    with pytest.raises(KeyboardInterrupt), cli._terminated_like_interrupted(), fork_server.held_back():
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
    with Spool() as spool:
        for array in arrays:
            spool.put(array)
        views = spool.views()
        assert not list(tmp_path.iterdir())
    for array, view in zip(arrays, views, strict=True):
        assert np.array_equal(array, view, equal_nan=True) and view.shape == array.shape
        assert not view.flags.owndata and not view.flags.writeable


def test_signals_that_were_read_are_not_held_in_memory(walks):
    path = walks / "01_04.amc"
    held = []
    tracemalloc.start()
    for count in (1, 9, 17):  # the first fills caches
        sequences, _ = sources.load_all([(path, True)] * count, jobs=1)  # busy, it would start processes
        gc.collect()
        held.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert held[2] - held[1] < 8 * 0.5 * sequences[0].channels.nbytes


def test_a_full_disk_is_one_line_with_its_remedy(walks, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: open("/dev/full", "r+b", buffering=0))  # noqa: SIM115
    with pytest.raises(UserError, match=f"{os.strerror(errno.ENOSPC)}.*set TMPDIR"):
        sources.load_all(sources.find([str(walks)]))
