"""Run capture, tracker and recorder on a clip, as separate processes, and write a report."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any

from gait.bindings.initial import Start
from gait.bindings.model import Model, model_file
from gait.camera.camera import Camera
from gait.errors import UsageError, UserError
from gait.io.fields import read_json
from gait.io.files import keep_unfinished, making, require_folder
from gait.io.track_file import read_truth
from gait.io.video import Video, read_plate
from gait.lcm.link import ROUTE_REMEDY, multicast_works, private_url, receive_buffer
from gait.lcm.record import LISTENING
from gait.lcm.report import write_report
from gait.motion.evaluate import Measures
from gait.progress import note
from gait.report.run_files import RunFiles
from gait.signals import die_with_parent

_GRACE = 5.0  # seconds that a process has to end when asked
_TURN = 0.05  # seconds between polls


class Child:
    """A process, and its name for messages."""

    def __init__(self, name: str, process: subprocess.Popen[str]) -> None:
        self.name, self.process = name, process

    @property
    def running(self) -> bool:
        """Whether it is still running."""
        return self.process.poll() is None

    def interrupt(self) -> None:
        """Ask it to end (SIGINT), so that it completes its files."""
        if self.running:
            self.process.send_signal(signal.SIGINT)

    def wait_for_word(self, word: str) -> None:
        """Wait until a line on its piped stderr begins with `word`.

        Raises
        ------
        UserError
            If it ends before.
        """
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if line.startswith(word):
                return
            print(line, end="", file=sys.stderr)
        raise UserError(f"{self.name}: ended before it was ready; see its output above")

    def result(self, patience: float) -> str:
        """Wait for its end and return what it printed to stdout.

        Raises
        ------
        UserError
            If it failed or did not end; its own messages are on stderr already.
        """
        try:
            printed, words = self.process.communicate(timeout=patience)
        except subprocess.TimeoutExpired:
            raise UserError(f"{self.name}: did not end within {patience:g} s; see its output above") from None
        if words:
            print(words, end="", file=sys.stderr)
        if self.process.returncode != 0:
            raise UserError(
                f"{self.name}: failed with exit code {self.process.returncode}; see its output above"
            )
        return printed


class Session:
    """Start processes that end with this one: at the end of the block, however it ends, even by SIGKILL.

    It ends only processes that it started.
    """

    def __init__(self) -> None:
        self._children: list[Child] = []

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, exc: BaseException | None, trace: TracebackType | None
    ) -> None:
        for child in self._children:
            child.interrupt()
        deadline = time.monotonic() + _GRACE
        for child in self._children:
            _end(child.process, deadline)

    def start(self, name: str, command: Sequence[str], *, pipe_errors: bool = False) -> Child:
        """Start a process with piped stdout, and, if `pipe_errors`, piped stderr.

        It gets its own session, so that Ctrl-C reaches only this process, which then ends the others.
        """
        try:
            process = subprocess.Popen(
                list(command),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE if pipe_errors else None,
                text=True,
                start_new_session=True,
                preexec_fn=die_with_parent,
            )
        except OSError as exc:
            raise UserError(f"{command[0]}: cannot be started ({exc.strerror}); run make tools") from None
        self._children.append(Child(name, process))
        return self._children[-1]

    def wait(self, awaited: Child, needed: Sequence[Child]) -> None:
        """Wait until `awaited` has ended; raise UserError at once if one of the `needed` ends before it."""
        while awaited.running:
            for child in needed:
                if not child.running:
                    raise UserError(f"{child.name}: ended too early; see its output above")
            time.sleep(_TURN)


def _end(process: subprocess.Popen[str], deadline: float) -> None:
    """Wait for a process until `deadline` (monotonic clock), then kill it."""
    try:
        process.wait(max(0.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    for stream in (process.stdout, process.stderr):
        if stream is not None:
            stream.close()


RESULTS = ("track.csv", "overlay.mp4", "report.html")
_RECORDED = ("track.csv", "estimates.log")
_READY = 60.0  # seconds that the tracker has to confirm camera and start
_LARGE_FRAME_BYTES = 1 << 21  # bytes of a colour frame above which receivers cannot keep up
_IDLE_S = 2.0  # seconds without an estimate after which the recording ends
_END = 30.0  # seconds that a process has to end when its work is done
_BESIDE = {"camera": "camera.json", "init": "init.json", "background": "background.png", "truth": "truth.csv"}


@dataclass(frozen=True)
class Demo:
    """What to track, and how; see ``gait demo --help``.

    Attributes
    ----------
    output : Path
        Folder for the results.
    trackd, model : str
        The tracker's program and its model, a file or the name of one in the package.
    threads : int
        Threads of the tracker.
    video, camera, init, background, truth : str, optional
        The clip and its files; files not given are searched for beside the video.  Without a video a clip is
        rendered.
    height : float, optional
        The person's stature, metres.
    start, stop, particles : int, optional
        As for gait capture and gait-trackd.
    quiet : bool
        Suppress notes and progress.
    """

    output: Path
    trackd: str
    model: str
    threads: int
    video: str | None = None
    camera: str | None = None
    init: str | None = None
    background: str | None = None
    truth: str | None = None
    height: float | None = None
    start: int | None = None
    stop: int | None = None
    particles: int | None = None
    quiet: bool = False

    def run(self) -> tuple[dict[str, Any], Measures | None]:
        """Make the clip if needed, run the processes, and write the report.

        Returns
        -------
        recording : dict
            The figures of ``gait record --json``.
        measures : dict or None
            The errors, if the truth is known.

        Raises
        ------
        UserError
            If an input cannot be read or one of the processes fails.
        """
        if not Path(self.trackd).is_file():
            raise UserError(f"{self.trackd}: no such program; run make tools, or give --trackd")
        self._check_inputs()
        require_folder(self.output)
        live = multicast_works()
        with making(self.output), _alone(self.output):
            for name in (*RESULTS, *_RECORDED):
                (self.output / name).unlink(missing_ok=True)  # not to be mistaken for this run
            clip, recording = self._recorded(live)
            assert clip.video is not None and clip.camera is not None
            files = RunFiles(
                track=str(self.output / "track.csv"),
                video=clip.video,
                page=str(self.output / "report.html"),
                camera=clip.camera,
                overlay=str(self.output / "overlay.mp4"),
                truth=clip.truth,
                model=self.model,
                quiet=self.quiet,
            )
            _, measures = write_report(str(self.output / "estimates.log"), files, live=live)
        return recording, measures

    def _recorded(self, live: bool) -> tuple[Demo, dict[str, Any]]:
        """Run the processes; return this demo with its clip's files, and the figures of the recording."""
        try:
            with Session() as session:
                clip = self._with_clip(session)
                if live:
                    return clip, clip._run_live(session)
                note(f"gait demo: no latency will be measured: {ROUTE_REMEDY}; using a log file")
                return clip, clip._run_through_log(session)
        except BaseException:
            for file in (self.output / name for name in _RECORDED):
                if file.exists():
                    keep_unfinished(file, file)
            raise

    def _check_inputs(self) -> None:
        """Read the user's files, so that faults are reported before anything is rendered or started."""
        model = Model(self.model)
        if self.video is None:
            for name in _BESIDE:
                if getattr(self, name) not in (None, "auto", "none"):
                    raise UsageError(f"--{name}: is for your own clip; also give --video (make demo VIDEO=)")
            return
        size = Video(self.video).size
        clip = self._complete()
        assert clip.camera is not None
        Camera.read(clip.camera, size)
        if clip.init not in (None, "auto"):
            Start.read(clip.init, model, height=self.height)
        if clip.background not in (None, "auto", "none"):
            read_plate(clip.background, size)
        if clip.truth is not None:
            read_truth(clip.truth)

    def _with_clip(self, session: Session) -> Demo:
        """Return this demo with all files of its clip, which is rendered unless the user gave one."""
        if self.video is not None:
            return self._complete()
        folder = self.output / "clip"
        note("rendering a clip", self.quiet)
        session.start("gait simulate", [*_gait("simulate"), "-o", str(folder)]).result(600.0)
        return replace(self, video=str(folder / "video.mp4"))._complete()

    def _complete(self) -> Demo:
        """Add files that are beside the video."""
        assert self.video is not None
        beside = {name: Path(self.video).parent / file for name, file in _BESIDE.items()}
        found: dict[str, Any] = {
            name: getattr(self, name) or (str(path) if path.is_file() else None)
            for name, path in beside.items()
        }
        if found["camera"] is None:
            raise UserError(
                f"{self.video}: has no camera.json beside it; give --camera (make demo CAMERA=...)"
            )
        return replace(self, **found)

    def _run_live(self, session: Session) -> dict[str, Any]:
        """Run all three at once over multicast; return the figures of the recording."""
        url = private_url()
        tracker = session.start("gait-trackd", self._trackd(url))
        recorder = session.start("gait record", self._record(url), pipe_errors=True)
        recorder.wait_for_word(LISTENING)
        sending = ["--url", url, "--wait", str(_READY), *self._compression(session)]
        capture = session.start("gait capture", [*self._capture(), *sending])
        session.wait(capture, needed=[tracker, recorder])
        capture.result(_END)
        figures: dict[str, Any] = json.loads(recorder.result(_END))
        tracker.interrupt()
        note(f"gait-trackd: {tracker.result(_END).strip()}", self.quiet)
        return figures

    def _compression(self, session: Session) -> list[str]:
        """Choose options of gait capture so that two frames fit a receive buffer, in colour if possible."""
        assert self.video is not None
        width, height = Video(self.video).size
        if 2 * 3 * width * height <= receive_buffer():
            return []
        if session.start("gait-trackd", [self.trackd, "--version"]).result(_END).strip().endswith("jpeg yes"):
            note("frames are larger than half the receive buffer: sent as JPEG", self.quiet)
            return ["--jpeg", "90"]
        if 3 * width * height <= _LARGE_FRAME_BYTES:
            return []
        note(
            "frames are larger than half the receive buffer and gait-trackd has no JPEG: sent in grey",
            self.quiet,
        )
        return ["--grey"]

    def _run_through_log(self, session: Session) -> dict[str, Any]:
        """Run the processes one after the other through log files, without loss but not in real time."""
        frames, estimates = ((self.output / name).resolve() for name in ("frames.log", "sent.log"))
        for file in (frames, estimates):
            file.unlink(missing_ok=True)
        try:
            to_log = ["--url", f"file://{frames}?mode=w", "--rate", "max"]
            session.start("gait capture", [*self._capture(), *to_log]).result(600.0)
            tracker = self._trackd(f"file://{frames}?speed=0")
            tracker += ["--out", f"file://{estimates}?mode=w"]
            note(f"gait-trackd: {session.start('gait-trackd', tracker).result(3600.0).strip()}", self.quiet)
            recorder = session.start("gait record", self._record(f"file://{estimates}?speed=0"))
            figures: dict[str, Any] = json.loads(recorder.result(600.0))
        finally:
            for file in (frames, estimates):
                file.unlink(missing_ok=True)
        return figures

    def _trackd(self, url: str) -> list[str]:
        particles = ["--particles", str(self.particles)] if self.particles else []
        threads = ["--threads", str(self.threads)]
        return [self.trackd, "--model", str(model_file(self.model)), "--url", url, *threads, *particles]

    def _record(self, url: str) -> list[str]:
        files = ["-o", str(self.output / "track.csv"), "--log", str(self.output / "estimates.log")]
        return [*_gait("record"), "--url", url, *files, "--until-idle", str(_IDLE_S), "--json"]

    def _capture(self) -> list[str]:
        """Make the command line of gait capture, without the URL."""
        init = self.init or "auto"
        start = self.start if self.start is not None else _frame_of(init)
        given = {
            "camera": self.camera,
            "init": init,
            "background": self.background or "auto",
            "model": self.model,
            "height": self.height,
            "stop": self.stop,
            "start": start,
        }
        options = [w for name, value in given.items() if value is not None for w in (f"--{name}", str(value))]
        assert self.video is not None
        return [*_gait("capture"), self.video, *options, *(["--quiet"] if self.quiet else [])]


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Lock the folder for this demo; the lock ends with the process, however that ends."""
    folder = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UserError(f"{out}: another demo is writing there; wait for it or give -o DIR") from None
        yield
    finally:
        os.close(folder)


def _gait(command: str) -> list[str]:
    """Make the beginning of the command line of a gait command, run by this Python."""
    return [sys.executable, "-m", "gait", command]


def _frame_of(init: str) -> int:
    """Read the frame of an init file, before which frames need not be sent."""
    if init == "auto":
        return 0
    fields = read_json(init, "start")
    return fields.integer("frame", 0, 1 << 31, "give the frame number, from 0") if "frame" in fields else 0
