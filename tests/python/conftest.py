"""What all Python tests share."""

import os
import resource
import signal
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None)  # a busy machine fails no test
settings.load_profile("untimed")

if "PYTEST_XDIST_WORKER" in os.environ:
    # Before numpy is loaded: threads of parallel processes would only wait for each other's processors.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell that starts a command in the background makes it and its children ignore interruptions.
    signal.signal(signal.SIGINT, signal.default_int_handler)

signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the same of nohup and closed terminals

sys.path.insert(
    0, str(Path(__file__).parents[1] / "reference")
)  # numpy versions of what the C library computes


# Tracks must not depend on whether the detector's weights were fetched; tests of the detector set this.
os.environ["GAIT_WEIGHTS"] = str(Path(__file__).parent)  # a folder without weights


@pytest.fixture
def fetched(monkeypatch):
    """Let the detector find the weights that `make setup` downloaded; returns their folder."""
    from gait.detect import weights  # here, after the settings above

    folder = Path(sys.prefix) / "share/gait/weights"
    if not all(
        (folder / one.file).is_file() for one in (weights.PERSON, *weights.LANDMARK_NETWORKS.values())
    ):
        pytest.skip("the detector's weights are absent: gait detect --fetch")
    monkeypatch.setenv("GAIT_WEIGHTS", str(folder))
    return folder


# Files whose few tests take long start first, so that no processor is idle at the end.
LONG = "docs initial learn_dask learn_jobs learn_report lift_robust paper studio"
FIRST = [f"test_{name}.py" for name in LONG.split()]


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: item.path.name not in FIRST)


@pytest.fixture(scope="module", autouse=True)
def _chromium_ends():
    """A file's tests share one Chromium (browser.py)."""
    yield
    if "browser" in sys.modules:
        sys.modules["browser"].end()


def _cpu():
    """Processor time of this process and of its finished children, seconds."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


_before = _cpu()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """Record the processor time of each part of a test: other programs do not count."""
    global _before
    report = yield
    now = _cpu()
    report.user_properties.append(("cpu", now - _before))
    _before = now
    return report


SLOW = 60.0  # seconds of processor time from which a test is listed


def pytest_terminal_summary(terminalreporter):
    """Print the slowest tests, and the counts in the form of the C tests: errors count as failures."""
    cpu = Counter()
    for report in (r for reports in terminalreporter.stats.values() for r in reports):
        if isinstance(report, pytest.TestReport):
            cpu[report.nodeid.removeprefix("tests/python/")] += dict(report.user_properties)["cpu"]
    if cpu.total() > SLOW:
        terminalreporter.write_line(f"{cpu.total():.0f} s of processor time, most of it in")
        for name, seconds in cpu.most_common(12):
            terminalreporter.write_line(f"{seconds:6.1f} s {name}")
    count = {k: len(terminalreporter.getreports(k)) for k in ("passed", "failed", "error", "skipped")}
    failed = count["failed"] + count["error"]
    terminalreporter.write_line(
        f"Python tests: {count['passed']} passed, {failed} failed, {count['skipped']} skipped"
    )
