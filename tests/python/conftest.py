"""What all Python tests share."""

import os
import signal
import sys
from pathlib import Path

if "PYTEST_XDIST_WORKER" in os.environ:
    # Before numpy is loaded: threads of processes side by side would only wait for each other's processors.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # A shell that starts something in the background lets it, and all that it starts, ignore interruptions.
    signal.signal(signal.SIGINT, signal.default_int_handler)

sys.path.insert(
    0, str(Path(__file__).parents[1] / "reference")
)  # numpy versions of what the C library computes


# Tracks must not depend on whether the detector's weights were fetched; tests of the detector set this.
os.environ["GAIT_WEIGHTS"] = str(Path(__file__).parent)  # a folder without weights


def pytest_terminal_summary(terminalreporter):
    """Print the counts in the form of the C tests: an error outside a test counts as a failed one."""
    count = {k: len(terminalreporter.getreports(k)) for k in ("passed", "failed", "error", "skipped")}
    failed = count["failed"] + count["error"]
    terminalreporter.write_line(
        f"Python tests: {count['passed']} passed, {failed} failed, {count['skipped']} skipped"
    )
