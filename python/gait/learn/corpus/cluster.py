"""Run tasks on a Dask cluster; outcomes are in the order of the files.

The workers read the files themselves, so they need the same paths as this machine, on a shared file system.
They also need the same versions of this package, numpy, scipy and ezc3d, and the same kernels
(`gait.reproducible`), or the results would differ.
"""

from __future__ import annotations

import logging
import re
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

from gait import extras, reproducible
from gait.errors import UsageError, UserError
from gait.learn.corpus.stage import Prepared, Task

if TYPE_CHECKING:
    from distributed import Client, Future

ADDRESS = re.compile(r"(tcp://|tls://)?[^/\s]+:\d{1,5}")
CONNECT = 5.0  # seconds for a scheduler to answer and to have a worker
WORKER_CHECK_S = 10.0  # seconds between checks whether there still are workers
FILES_PER_THREAD = 4  # files in flight per thread of the workers
SAME_PACKAGES = ("libgait", "numpy", "scipy", "ezc3d")  # packages on which the results depend


@dataclass(frozen=True)
class Mismatch:
    """A worker that would give other results: its version of a package, or its kernels (no package)."""

    worker: str
    package: str = ""
    found: str = ""

    def refusal(self, address: str) -> UserError:
        """Return the error with its remedy."""
        if self.package:
            return UserError(
                f"--dask {address}: worker {self.worker} has {self.found} of {self.package}, "
                f"this machine {metadata.version(self.package)}; install the same versions on both"
            )
        return UserError(
            f"--dask {address}: last digits would depend on the CPU of worker {self.worker}; "
            f"start it with 'dask worker --preload-nanny {reproducible.__name__} {address}'"
        )


def prepared(tasks: Sequence[Task], address: str) -> Generator[Prepared, None, None]:
    """Yield the outcomes of tasks in their order, from the workers of the scheduler at `address`.

    UserError if dask is not installed, the scheduler does not answer, or workers have other versions or
    cannot see the files.
    """
    with connected(address) as client:
        require_packages(client, address)
        wanted = _environment()
        ahead = FILES_PER_THREAD * max(1, sum(client.nthreads().values()))
        waiting, flying = deque(tasks), deque[tuple[Path, "Future"]]()
        while waiting or flying:
            while waiting and len(flying) < ahead:
                task = waiting.popleft()
                there = replace(task, path=task.path.absolute())
                flying.append((task.path, client.submit(_run, there, wanted, pure=False)))
            path, future = flying.popleft()
            outcome = _result(client, address, path, future)
            if isinstance(outcome, Mismatch):
                raise outcome.refusal(address)
            yield _as_named(outcome, path)


def _environment() -> dict[str, str]:
    """Return what results depend on besides the task: versions of packages, and the kernels."""
    return {package: metadata.version(package) for package in SAME_PACKAGES} | reproducible.chosen()


def _run(task: Task, wanted: dict[str, str]) -> Prepared | Mismatch | None:
    """Run a task on a worker that matches the client; None if it does not see the file.

    Every task checks this, because a worker may join while others are at work.
    """
    from distributed import get_worker

    if (here := _environment()) != wanted:
        package = next((p for p in SAME_PACKAGES if here[p] != wanted[p]), "")
        return Mismatch(get_worker().address, package, here.get(package, ""))
    reproducible.one_thread_for_good()
    return task.run() if task.path.is_file() else None


@contextmanager
def connected(address: str) -> Iterator[Client]:
    """Connect to a scheduler that answers and has a worker.  UserError if there is none, or no dask."""
    if not ADDRESS.fullmatch(address):
        raise UsageError(f"--dask {address}: is not an address; give one such as tcp://192.168.0.7:8786")
    if lacking := extras.remedy("--dask", ["dask"]):
        raise UserError(lacking)
    from distributed import Client

    log = logging.getLogger("distributed")
    before = log.level
    log.setLevel(logging.CRITICAL)  # we report a lost connection in one line, without its tracebacks
    try:
        with ExitStack() as stack:
            try:
                client = stack.enter_context(Client(address, timeout=CONNECT, set_as_default=False))
                client.wait_for_workers(1, timeout=CONNECT)
            except (TimeoutError, OSError) as error:
                raise UserError(
                    f"--dask {address}: no scheduler with a worker answered within {CONNECT:.0f} s; "
                    "start them with 'dask scheduler' and "
                    f"'dask worker --preload-nanny {reproducible.__name__} {address}'"
                ) from error
            yield client
    finally:
        log.setLevel(before)


def require_packages(client: Client, address: str) -> None:
    """Raise UserError if workers lack a package or have another version, as they might not unpickle tasks."""
    for package in SAME_PACKAGES:
        for worker, there in client.run(metadata.version, package, on_error="return").items():
            if isinstance(there, metadata.PackageNotFoundError):
                raise Mismatch(worker, package, "none").refusal(address)
            if isinstance(there, str) and there != metadata.version(package):
                raise Mismatch(worker, package, there).refusal(address)


def _result(client: Client, address: str, path: Path, future: Future) -> Prepared | Mismatch | None:
    """Wait for a result while there are workers."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm import CommClosedError

    lost = UserError(f"--dask {address}: the connection was lost at {path}; start again")
    while True:
        try:
            outcome: Prepared | Mismatch | None = future.result(timeout=WORKER_CHECK_S)
            return outcome
        except KilledWorker:
            killed = UserError(
                f"{path}: the workers that read it were killed (out of memory?); "
                "leave it out with --exclude or cut the recording"
            )
            return Prepared(refused=killed)
        except TimeoutError as error:
            if client.status != "running" or not client.nthreads():
                raise lost from error
        except (CancelledError, CommClosedError) as error:
            raise lost from error


def _as_named(outcome: Prepared | None, path: Path) -> Prepared:
    """Return the outcome as if the file had been read under its name here."""
    if outcome is None:
        raise UserError(
            f"{path}: a worker cannot access {path.absolute()}; put the files where all workers find them "
            "under the same path"
        )
    if outcome.refused:
        words = str(outcome.refused).replace(str(path.absolute()), str(path))
        outcome = replace(outcome, refused=type(outcome.refused)(words))
    if outcome.sequence:
        outcome = replace(outcome, sequence=replace(outcome.sequence, source=path))
    return outcome
