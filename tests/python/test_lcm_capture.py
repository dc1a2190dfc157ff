"""gait capture as a process: the logs that it writes, and its end by a signal."""

import resource
import signal
import subprocess
import time

import av
import lcm_rig as rig
import pytest

from gait.lcm.link import gaitmsg

COUNT = 12


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A clip as files: video, camera, empty scene, init."""
    return rig.write_clip(tmp_path_factory.mktemp("clip"), COUNT)


def words_of(folder, url):
    return [
        "capture",
        folder / "video.mp4",
        "--camera",
        folder / "camera.json",
        "--rate",
        "max",
        "--url",
        url,
    ]


def capture(folder, url):
    return rig.gait(*words_of(folder, url))


def one_line(done, code, words):
    assert done.returncode == code and words in done.stderr, done
    assert done.stdout == "" and done.stderr.count("\n") == 1, done


def test_a_full_disk_is_reported(folder):
    done = capture(folder, "file:///dev/full?mode=a")
    one_line(done, 1, "/dev/full: the log cannot be written: No space left on device")


@pytest.mark.parametrize("missing", [COUNT * 50_000, 100], ids=["early", "in the last bytes"])
def test_a_log_that_may_not_grow_is_reported(folder, tmp_path, missing):
    log = tmp_path / "x.log"
    assert capture(folder, f"file://{log}?mode=w").returncode == 0
    limit = log.stat().st_size - missing
    assert limit > 0
    before = log.read_bytes()

    def small():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    command = [str(rig.PYTHON), "-m", "gait", *map(str, words_of(folder, f"file://{log}?mode=w"))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=small)
    one_line(done, 1, "x.log: the log cannot be written: File too large")
    assert log.read_bytes() == before and list(tmp_path.iterdir()) == [log]


def test_a_log_can_be_added_to(folder, tmp_path):
    log = tmp_path / "x.log"
    for mode in "wa":
        assert capture(folder, f"file://{log}?speed=0&mode={mode}").returncode == 0
    assert len(rig.read_log(log, "GAIT_IMAGE_0", gaitmsg.image_t)) == 2 * COUNT


def test_a_damaged_film_is_reported(folder, tmp_path):
    """Its frames are sent nevertheless, as the decoder guesses what they showed."""
    video = folder / "video.mp4"
    whole = video.read_bytes()
    with av.open(str(video)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    spoilt = bytearray(whole)
    for packet in packets[3:6]:
        middle = packet.pos + packet.size // 2
        spoilt[middle : middle + 4] = bytes(255 - byte for byte in whole[middle : middle + 4])
    (tmp_path / "video.mp4").write_bytes(spoilt)
    words = ["--url", f"file://{tmp_path}/out.log?mode=w", "--camera", folder / "camera.json"]
    done = rig.gait("capture", tmp_path / "video.mp4", *words, "--background", "none", "--rate", "max")
    assert done.returncode == 0 and f"warning: {tmp_path}/video.mp4: frames are damaged: " in done.stderr
    done = rig.gait("capture", video, *words, "--background", "none", "--rate", "max")
    assert done.returncode == 0 and "damaged" not in done.stderr


def test_films_that_begin_at_one_time_have_the_same_stamps(folder, tmp_path):
    stamps = []
    for stream in "01":
        log = tmp_path / f"{stream}.log"
        done = rig.gait(
            *words_of(folder, f"file://{log}?mode=w"), "--stream", stream, "--begin-at", "1800000000.25"
        )
        assert done.returncode == 0, done.stderr
        stamps.append([m.utime for m in rig.read_log(log, f"GAIT_IMAGE_{stream}", gaitmsg.image_t)])
    assert stamps[0] == stamps[1] and stamps[0][0] == 1_800_000_000_250_000 and len(stamps[0]) == COUNT


@pytest.mark.parametrize("mode", ["", "?speed=0", "?mode=r", "?mode=write"])
def test_a_log_without_the_mode_of_writing_is_refused(folder, tmp_path, mode):
    log = rig.write_log(tmp_path / "x.log", rig.opening())
    before = log.read_bytes()
    one_line(capture(folder, f"file://{log}{mode}"), 2, "add ?mode=w (new) or ?mode=a")
    assert log.read_bytes() == before


@pytest.mark.parametrize("name", ["video.mp4", "camera.json"])
def test_what_is_read_is_never_overwritten(folder, name):
    before = (folder / name).read_bytes()
    done = capture(folder, f"file://{folder / name}?mode=w")
    one_line(done, 1, f"{name}: is read by this command")
    assert (folder / name).read_bytes() == before


def test_a_folder_that_is_missing_is_reported(folder, tmp_path):
    done = capture(folder, f"file://{tmp_path}/none/x.log?mode=w")
    one_line(done, 1, "none does not exist; create it first")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_after_a_whole_frame(folder, tmp_path, number):
    """As a script starts it with &: SIGINT is then ignored."""
    log = tmp_path / "x.log"
    words = [folder / "video.mp4", "--loop", "--rate", "200", "--url", f"file://{log}?mode=w"]
    process = subprocess.Popen(
        [str(rig.PYTHON), "-m", "gait", "capture", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )
    try:
        while sum(p.stat().st_size for p in tmp_path.iterdir()) < 1_000_000:
            assert process.poll() is None and not log.exists()  # it gets its name when it is complete
            time.sleep(0.01)
        process.send_signal(number)
        printed, words = process.communicate(timeout=rig.PATIENCE)
    finally:
        process.kill()
        process.communicate()
    assert (process.returncode, words) == (0, "")
    images = rig.read_log(log, "GAIT_IMAGE_0", gaitmsg.image_t)
    assert printed.startswith(f"{len(images)} frames sent"), printed
    assert log.stat().st_size == sum(28 + len("GAIT_IMAGE_0") + len(i.encode()) for i in images)
