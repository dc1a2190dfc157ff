"""Files read on a Dask cluster, here a local one: the same result, and one line for each failure."""

import contextlib
import importlib.metadata
import io
import os
import shutil
import subprocess
import sys
from pathlib import Path

import marked_person as mw
import mocap_files as files
import pytest
from test_marker_files import write_c3d

import gait.cli
from gait import reproducible
from gait.errors import UserError
from gait.learn.corpus import cluster, load, sources
from gait.learn.options import LearnOptions

distributed = pytest.importorskip("distributed", reason="Dask is not installed: make setup")
pytestmark = [
    pytest.mark.long,
    pytest.mark.filterwarnings("ignore"),  # those of distributed are not ours to mend
]
LEARN = ["learn", "--components", "2"]


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """Six toy walks and a broken file in their midst."""
    return files.write_trials(tmp_path_factory.mktemp("walks"), 6)


@pytest.fixture(scope="module")
def alone(walks, tmp_path_factory):
    """Bytes of the model that this machine learns without a cluster, and its notes."""
    model, notes = tmp_path_factory.mktemp("alone") / "m.gait", io.StringIO()
    with contextlib.redirect_stderr(notes):
        assert gait.cli.main([*LEARN, str(walks), "-o", str(model), "--jobs", "1"]) == 0
    return model.read_bytes(), notes.getvalue()


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """Scheduler and workers exist but may be slow to answer on a busy machine."""
    monkeypatch.setattr(cluster, "CONNECT", 120.0)


@pytest.fixture(autouse=True)
def as_the_command_line(monkeypatch):
    """What `gait learn` sets for itself; the workers get it from the remedy that an error names."""
    for name, value in reproducible.COMMON.items():
        monkeypatch.setenv(name, value)


@pytest.fixture(scope="module")
def local():
    """A scheduler with two workers that are started with the remedy."""
    dask_worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--nworkers", "2", "--nthreads", "1"]
    remedy = ["--no-dashboard", "--preload-nanny", "gait.reproducible"]
    with distributed.LocalCluster(n_workers=0, dashboard_address=None, silence_logs=50) as local:
        started = subprocess.Popen(
            [*dask_worker, *remedy, local.scheduler_address], stderr=subprocess.DEVNULL
        )
        try:
            with distributed.Client(local, set_as_default=False) as client:
                client.wait_for_workers(2, timeout=120)
            yield local
        finally:
            started.terminate()
            started.wait(30)


@pytest.fixture
def scheduler(local):
    return local.scheduler_address


def test_a_cluster_gives_the_same_model(walks, alone, scheduler, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(walks.parent)  # the workers have another folder
    model = tmp_path / "dask.gait"
    assert gait.cli.main([*LEARN, walks.name, "-o", str(model), "--dask", scheduler]) == 0
    notes = alone[1].replace(f"{walks.parent}/", "")
    assert capsys.readouterr().err == notes and "01_02x.amc:3" in notes
    assert model.read_bytes() == alone[0]


def test_a_cluster_measures_people_alike(scheduler, tmp_path, monkeypatch):
    for k in (1, 2):
        points = mw.person(mw.LOWER, frames=60, again=k)[0]
        write_c3d(tmp_path / f"anna_{k}.c3d", mw.LOWER, points)
    monkeypatch.chdir(tmp_path)
    found, _ = sources.find(["."])
    here, there = (load.shared_lengths(found, LearnOptions(dask=dask)) for dask in (None, scheduler))
    for one, other in zip(there, here, strict=True):  # by other kernels
        assert one.log_scales == pytest.approx(other.log_scales, rel=1e-9)


def test_a_bad_file_named_by_itself_stops_the_run(walks, scheduler):
    with pytest.raises(UserError, match="01_02x.amc:3: 2 numbers, expected 6"):
        load.load_all([(walks / "01_02x.amc", False)], LearnOptions(dask=scheduler))


def test_a_file_that_workers_do_not_see_is_named_with_the_remedy(walks, scheduler, tmp_path):
    with pytest.raises(UserError, match="absent.amc: a worker cannot access .* under the same path"):
        load.load_all([(tmp_path / "absent.amc", True)], LearnOptions(dask=scheduler))


@pytest.mark.parametrize("package", ["libgait", "scipy"])
def test_a_worker_of_another_version_is_refused(package, walks, scheduler, monkeypatch):
    here = os.getpid()
    true = importlib.metadata.version
    monkeypatch.setattr(
        importlib.metadata,
        "version",
        lambda name: "0.0.1" if here == os.getpid() and name == package else true(name),
    )
    words = rf"worker tcp://.* has \d.* of {package}, this machine 0.0.1; install"
    with pytest.raises(UserError, match=words):
        load.load_all([(walks / "01_00.amc", True)], LearnOptions(dask=scheduler))


@pytest.mark.parametrize(
    ("address", "words"),
    [("cluster", "is not an address"), ("tcp://127.0.0.1:9", "no scheduler with a worker answered within")],
)
def test_an_address_without_a_scheduler_is_one_line(walks, tmp_path, monkeypatch, capsys, address, words):
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    out = str(tmp_path / "m.gait")
    assert gait.cli.main(["learn", str(walks), "-o", out, "--dask", address]) in (1, 2)
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1 and not list(tmp_path.iterdir())


def test_without_dask_the_remedy_is_named(walks, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UserError, match="needs Dask: pip install"):
        load.load_all([(walks / "01_00.amc", True)], LearnOptions(dask="127.0.0.1:9"))


def test_a_worker_with_other_kernels_is_refused_with_the_remedy(walks, scheduler, monkeypatch):
    monkeypatch.setattr(reproducible, "chosen", lambda: {"OPENBLAS_CORETYPE": "none that a worker has"})
    with pytest.raises(UserError, match=r"CPU of worker tcp://.*--preload-nanny gait\.reproducible tcp://"):
        load.load_all([(walks / "01_00.amc", True)], LearnOptions(dask=scheduler))


def test_a_file_that_kills_its_workers_is_named(walks, local, tmp_path, monkeypatch):
    """To the client, workers that die on a task are KilledWorker; here a task of the last test ends them."""
    bad = Path(shutil.copy(walks / "01_00.amc", tmp_path / "05_01.amc"))
    true = cluster._run
    monkeypatch.setattr(
        cluster,
        "_run",
        lambda task, wanted: os._exit(9) if task.path.name == "05_01.amc" else true(task, wanted),
    )
    monkeypatch.setattr(local.scheduler, "allowed_failures", 0)  # 3 take 16 s
    files = [(walks / "01_01.amc", True), (bad, True)]
    refused = load.load_all(files, LearnOptions(dask=local.scheduler_address)).refused
    assert len(refused) == 1 and refused[0].startswith(f"{bad}: the workers that read it were killed")
