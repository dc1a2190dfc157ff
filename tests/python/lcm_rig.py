"""What the LCM tests share: a small clip, logs of messages, and gait-trackd as a process."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import lcm
import numpy as np
import pytest

from gait.bindings.model import Model
from gait.bindings.state import State
from gait.camera.camera import Camera
from gait.cli import main
from gait.errors import UserError
from gait.io.video import VideoWriter
from gait.lcm.link import gaitmsg, open_lcm, private_url
from gait.lcm.messages import camera_message, command_message, image_message

ROOT = Path(__file__).resolve().parents[2]
TRACKD = Path(os.environ.get("GAIT_TRACKD", ROOT / "build" / "bin" / "gait-trackd"))
MODEL = ROOT / "python" / "gait" / "data" / "walk.gait"
PYTHON = ROOT / ".venv" / "bin" / "python"
FPS = 30
PATIENCE = 120.0  # seconds for anything that should come at once, even on a busy machine
PARTICLES = 64

CAMERA = Camera(
    width=160,
    height=120,
    fx=140.0,
    fy=140.0,
    cx=79.5,
    cy=59.5,
    R=np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    t=np.array([0.0, 1.0, 4.0]),
)
SD = State(
    phase=0.02, stride_hz=0.02, stature=0.02, heading=0.05, pelvis=np.full(3, 0.03), turn_rate=0.25
)  # of the turn rate as in the prior, because messages do not state it


@cache
def model() -> Model:
    return Model(MODEL)


def person(frame: int) -> State:
    """The person of the clip: 1.2 m/s along x, one stride a second."""
    mean, _ = model().prior()
    state = replace(mean, phase=(0.1 + frame / FPS) % 1.0, stride_hz=1.0, stature=1.75, heading=0.0)
    state.pelvis = np.array([-0.5 + 1.2 * frame / FPS, 0.0, 0.0])
    state.pelvis[2] = model().pelvis_height(state)
    return state


@cache
def plate() -> np.ndarray:
    noise = np.random.default_rng(1).normal(120, 12, (CAMERA.height, CAMERA.width, 3))
    return noise.clip(0, 255).astype(np.uint8)


@cache
def picture(frame: int) -> np.ndarray:
    """One frame: the model's own limbs in flat colours over a noisy plate."""
    ids = model().render(CAMERA, person(frame))
    colours = np.random.default_rng(2).integers(0, 255, (256, 3), np.uint8)
    return np.where(ids[..., None] > 0, colours[ids], plate())


def utime(frame: int) -> int:
    """Capture time in logs."""
    return 1_000_000 + round(frame * 1e6 / FPS)


def start(frame: int = 0, at: int | None = None, sd: State = SD) -> Any:
    """START for a frame of the clip."""
    return command_message(gaitmsg.command_t.START, utime(frame) if at is None else at, person(frame), sd)


def frame_message(frame: int, **changes: Any) -> Any:
    message = image_message(picture(frame), utime(frame), frame)
    for name, value in changes.items():
        setattr(message, name, value)
    return message


Event = tuple[str, Any]
"""Channel, and a message or its bytes."""


def opening(first: int = 0) -> list[Event]:
    """What precedes the frames: camera, empty scene, START."""
    return [
        ("GAIT_CAMERA_0", camera_message(CAMERA, utime(first))),
        ("GAIT_BACKGROUND_0", image_message(plate(), utime(first), -1)),
        ("GAIT_COMMAND", start(first)),
    ]


def frames(first: int, stop: int) -> list[Event]:
    return [("GAIT_IMAGE_0", frame_message(i)) for i in range(first, stop)]


def write_clip(path: Path, count: int) -> Path:
    """Put a clip as files into a folder: video, camera, empty scene, and init for frame 2."""
    with VideoWriter(path / "video.mp4", FPS, crf=5) as video:
        for i in range(count):
            video.write(picture(i))
    (path / "camera.json").write_text(json.dumps(CAMERA.to_dict()))
    cv2.imwrite(str(path / "background.png"), plate())
    state = person(2)
    init = {
        "frame": 2,
        "pelvis": state.pelvis.tolist(),
        "phase": state.phase,
        "stature_m": 1.75,
        "stride_hz": 1.0,
    }
    (path / "init.json").write_text(json.dumps(init | {"heading_rad": 0.0}))
    return path


def write_log(path: Path, events: Sequence[Event]) -> Path:
    log = lcm.EventLog(str(path), "w", overwrite=True)
    for i, (channel, message) in enumerate(events):
        data = message if isinstance(message, bytes) else message.encode()
        log.write_event(i, channel, data)
    log.close()
    return path


def read_log(path: Path, channel: str, kind: Any) -> list[Any]:
    return [kind.decode(e.data) for e in lcm.EventLog(str(path), "r") if e.channel == channel]


SUMMARY = re.compile(r"frames (\d+) dropped (\d+) rejected (\d+) .*digest ([0-9a-f]{16})")


@dataclass
class Outcome:
    """How gait-trackd ended."""

    code: int
    printed: str
    words: str
    estimates: list[Any] = field(default_factory=list)
    particles: list[Any] = field(default_factory=list)

    def _part(self, i: int) -> str:
        found = SUMMARY.search(self.printed)
        assert found, f"no summary: {self.printed!r} {self.words!r}"
        return found.group(i)

    @property
    def frames(self) -> int:
        return int(self._part(1))

    @property
    def dropped(self) -> int:
        return int(self._part(2))

    @property
    def rejected(self) -> int:
        return int(self._part(3))

    @property
    def digest(self) -> str:
        return self._part(4)


def command(*options: object) -> list[str]:
    return [str(TRACKD), "-m", str(MODEL), "-n", str(PARTICLES), *map(str, options)]


def run(*words: object) -> Outcome:
    """Run gait-trackd to its end with exactly these arguments."""
    done = subprocess.run(
        [str(TRACKD), *map(str, words)], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    return Outcome(done.returncode, done.stdout, done.stderr)


def play(log: Path, *options: object) -> Outcome:
    """Track a log; return the estimates that gait-trackd publishes.  Having no estimates is a failure."""
    out = log.with_suffix(".out")
    out.unlink(missing_ok=True)
    outcome = run(*command("--url", f"file://{log}?speed=0", "--out", f"file://{out}?mode=w", *options)[1:])
    if outcome.code != 0:
        out = log.with_suffix(".unfinished.out")
    outcome.estimates = read_log(out, "GAIT_ESTIMATE", gaitmsg.estimate_t)
    came = outcome.estimates or read_log(out, "GAIT_LIFT", gaitmsg.estimate_t)
    assert outcome.code == (0 if came else 1), outcome.words
    outcome.particles = read_log(out, "GAIT_PARTICLES", gaitmsg.particles_t)
    return outcome


class Listener:
    """Collects what a tracker publishes, and sends messages to it; `pid` is the tracker's.

    Of several people `estimates` and `statuses` are the first one's, `second` are estimates of the second.
    """

    pid = 0

    def __init__(self, url: str) -> None:
        self._lcm = open_lcm(url)
        self.estimates: list[Any] = []
        self.second: list[Any] = []
        self.statuses: list[Any] = []
        self.lifted: list[Any] = []
        self._keep("GAIT_ESTIMATE(_1)?", gaitmsg.estimate_t, self.estimates)
        self._keep("GAIT_ESTIMATE_2", gaitmsg.estimate_t, self.second)
        self._keep("GAIT_STATUS(_1)?", gaitmsg.status_t, self.statuses)
        self._keep("GAIT_LIFT", gaitmsg.estimate_t, self.lifted)

    def _keep(self, channel: str, kind: Any, into: list[Any]) -> None:
        subscription = self._lcm.subscribe(channel, lambda _, data: into.append(kind.decode(data)))
        subscription.set_queue_capacity(1000)

    def send(self, events: Sequence[Event]) -> None:
        for channel, message in events:
            self._lcm.publish(channel, message.encode())

    def listen(self, ms: int) -> None:
        """Receive a message, waiting at most so long."""
        self._lcm.handle_timeout(ms)

    def until(self, condition: Callable[[], bool], what: str, seconds: float = PATIENCE) -> None:
        """Receive messages until the condition holds; fail if it does not in time."""
        deadline = time.monotonic() + seconds
        while not condition():
            left = deadline - time.monotonic()
            assert left > 0, f"{what} did not come; last status: {self.last and self.last.text!r}"
            self._lcm.handle_timeout(max(1, round(1000 * left)))

    @property
    def last(self) -> Any:
        return self.statuses[-1] if self.statuses else None

    def ask(self, events: Sequence[Event], condition: Callable[[Any], bool], what: str) -> None:
        """Send repeatedly until a status that is newer than the first message shows the effect."""
        self.statuses.clear()
        deadline = time.monotonic() + PATIENCE
        while not any(condition(s) for s in self.statuses):
            assert time.monotonic() < deadline, f"{what} did not come; last status: {self.last}"
            self.send(events)
            self._lcm.handle_timeout(200)


def kill(listener: Listener) -> None:
    """Kill a tracker after a second without frames, in which it writes a snapshot, if it is to."""
    before = len(listener.statuses)
    listener.until(lambda: len(listener.statuses) > before + 2, "a second without frames")
    os.kill(listener.pid, signal.SIGKILL)


def peak_kb(pid: int) -> int:
    """Largest resident memory that a process has had; skip if the kernel does not report it."""
    lines = Path(f"/proc/{pid}/status")
    printed = re.search(r"VmHWM:\s+(\d+) kB", lines.read_text() if lines.exists() else "")
    if not printed:
        pytest.skip("no VmHWM in /proc/PID/status")
    return int(printed.group(1))


Daemon = AbstractContextManager[tuple[Listener, Callable[[], Outcome]]]


def daemon(url: str, *options: object) -> Daemon:
    """gait-trackd on a network; yields a listener and a function that ends the daemon cleanly."""
    return started(command("--url", url, *options), url)


@contextmanager
def started(words: Sequence[str], url: str) -> Iterator[tuple[Listener, Callable[[], Outcome]]]:
    """The same with exactly these words, that make it use `url`."""
    listener = Listener(url)
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    listener.pid = process.pid

    def finish() -> Outcome:
        process.send_signal(signal.SIGINT)
        printed, words = process.communicate(timeout=PATIENCE)
        return Outcome(process.returncode, printed, words)

    try:
        listener.until(lambda: bool(listener.statuses), "a first status")
        yield listener, finish
    finally:
        process.kill()
        process.communicate()


def gait(*words: object) -> subprocess.CompletedProcess[str]:
    """Run a command of gait in this process, which saves starting another one."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code: Any = main([str(word) for word in words])
        except SystemExit as usage:
            code = usage.code
    return subprocess.CompletedProcess(words, code, out.getvalue(), err.getvalue())


@cache
def _multicast_fault() -> str | None:
    """Why messages do not get through here, or None; found by sending one to itself."""
    url = private_url()
    try:
        link = open_lcm(url)
        got: list[bytes] = []
        link.subscribe("SELF", lambda _, data: got.append(data))
    except (UserError, OSError, RuntimeError) as exc:
        return str(exc)
    link.publish("SELF", b"x")
    return None if link.handle_timeout(3000) > 0 and got else "a message to oneself does not arrive"


def need_multicast() -> None:
    """Skip a test on a machine without multicast."""
    fault = _multicast_fault()
    if fault:
        pytest.skip(f"no multicast: {fault}")


def without_network(*words: str) -> subprocess.CompletedProcess[str]:
    """Run a command in an empty network namespace; skip if that is not allowed."""
    unshare = ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--map-root-user", "--net"]
    try:
        tried = subprocess.run([*unshare, "true"], capture_output=True, timeout=PATIENCE, check=False)
        allowed = tried.returncode == 0
    except FileNotFoundError:
        allowed = False
    if not allowed:
        pytest.skip("no network namespaces here (unshare --net)")
    return subprocess.run(
        [*unshare, *words], capture_output=True, text=True, timeout=2 * PATIENCE, check=False
    )


def written(path: Path) -> int:
    """Bytes of an unfinished recording."""
    return sum(part.stat().st_size for part in path.parent.glob(f".{path.stem}.*"))
