"""Track a clip as in the field: capture, tracker and recorder are processes that talk over LCM.

gait capture streams the clip at its true frame rate, gait-trackd tracks it, gait record collects the
estimates.  Writes track.csv, estimates.log, overlay.mp4 and report.html; prints the error against the truth
(where it is known), frame rate, latency from capture to the received estimate, and frames dropped.

Without VIDEO a walker is rendered, with truth.  With it, camera.json, init.json, background.png and truth.csv
beside the video are used unless given.  Where this machine has no multicast route the same processes work one
after the other through an LCM log file; there is no latency then.
"""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gait.bindings.initial import Start
from gait.bindings.model import Model
from gait.camera.camera import Camera
from gait.cli import defaults, values
from gait.cli.evaluate import text as evaluation_text
from gait.cli.record import LISTENING
from gait.cli.record import text as recording_text
from gait.cli.report import make_report
from gait.errors import UsageError, UserError
from gait.io.fields import read_json
from gait.io.files import require_folder
from gait.io.track_file import read_truth
from gait.io.video import Video, read_plate
from gait.lcm.link import ROUTE_REMEDY, multicast_works, private_url, receive_buffer
from gait.lcm.session import Session

_ROOT = Path(__file__).resolve().parents[3]
_TRACKD = _ROOT / "build" / "bin" / "gait-trackd"
_MODEL = _ROOT / "python" / "gait" / "data" / "walk.gait"
_RESULTS = ("track.csv", "overlay.mp4", "report.html")
_READY = 60.0  # seconds in which the tracker must have confirmed camera and start
_LARGE = 1 << 21  # bytes of a colour frame that no receiver keeps up with
_IDLE = 2.0  # seconds without an estimate that end the recording
_END = 30.0  # seconds that a process may take to end once its work is done


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("--video", metavar="VIDEO", help="the clip (a rendered one)")
    parser.add_argument("--camera", metavar="CAM", help="JSON, OpenCV YAML/XML or FILE.toml:name")
    parser.add_argument("--init", metavar="INIT.json|auto", help="first state (auto)")
    parser.add_argument("--background", metavar="PNG|auto|none", help="empty scene (auto)")
    parser.add_argument("--truth", metavar="TRUTH.csv", help="for the errors")
    parser.add_argument("--height", type=values.stature, metavar="M", help="the person's stature in metres")
    frame, particles, threads = (values.whole(*r) for r in ((0,), values.PARTICLES, values.THREADS))
    parser.add_argument("--start", type=frame, metavar="F", help="first frame to send (that of --init)")
    parser.add_argument("--stop", type=frame, metavar="F", help="first frame not to send")
    parser.add_argument(
        "--particles", type=particles, metavar="N", help=f"hypotheses ({defaults.particles()})"
    )
    parser.add_argument(
        "--threads", type=threads, default=_threads(), metavar="T", help="of the tracker (%(default)s)"
    )
    parser.add_argument(
        "-m", "--model", default=str(_MODEL), metavar="M.gait", help="walking model (the shipped one)"
    )
    parser.add_argument("--trackd", default=str(_TRACKD), metavar="PROGRAM", help="gait-trackd (build/bin)")
    parser.add_argument("-o", "--output", default="build/demo", metavar="DIR", help="folder for the results")


def _threads() -> int:
    """All cores but the one that decodes the clip, up to four."""
    return max(1, min(4, (os.cpu_count() or 1) - 1))


@dataclass
class Clip:
    """What is tracked.

    Attributes
    ----------
    video, camera, init, background : str
        As for gait capture.
    truth : str or None
    """

    video: str
    camera: str
    init: str
    background: str
    truth: str | None


def run(args: argparse.Namespace) -> int:
    """Make the clip, run the processes, report."""
    if not Path(args.trackd).is_file():
        raise UserError(f"{args.trackd}: no such program; run make tools, or give --trackd")
    _check_inputs(args)
    require_folder(args.output)
    out = Path(args.output)
    out.mkdir(parents=True, exist_ok=True)
    live = multicast_works()
    with _alone(out), Session() as session:
        for name in _RESULTS:
            (out / name).unlink(missing_ok=True)  # should this run fail, they would look like its own
        clip = _clip(args, out, session)
        if live:
            recording = _run_live(args, clip, out, session)
        else:
            print(
                f"gait demo: no latency will be measured: {ROUTE_REMEDY}; using a log file", file=sys.stderr
            )
            recording = _run_through_log(args, clip, out, session)
        measures = make_report(_report_arguments(args, clip, out, live), quiet=args.quiet)
    if args.json:
        print(json.dumps({"recording": recording, "error": measures}))
        return 0
    if measures is not None:
        print(f"error against the truth\n{evaluation_text(measures)}\n")
    print(recording_text(recording))
    print(" ".join(str(out / name) for name in _RESULTS))
    return 0


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Hold the folder for this demo; the lock goes with the process, however that ends."""
    folder = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise UserError(f"{out}: another demo is writing there; wait for it or give -o DIR") from None
        yield
    finally:
        os.close(folder)


def _check_inputs(args: argparse.Namespace) -> None:
    """Read what the user gave, so that a fault shows before anything is rendered or started."""
    model = Model(args.model)
    own = {name: getattr(args, name) for name in ("camera", "init", "background", "truth")}
    files = {name: path for name, path in own.items() if path not in (None, "auto", "none")}
    if args.video is None:
        for name in files:
            raise UsageError(f"--{name}: belongs to a clip of your own; give --video too (make demo VIDEO=)")
        return
    size = Video(args.video).size
    clip = _clip_of(args)
    Camera.read(clip.camera, size)
    if clip.init != "auto":
        Start.read(clip.init, model, height=args.height)
    if clip.background not in ("auto", "none"):
        read_plate(clip.background, size)
    if clip.truth is not None:
        read_truth(clip.truth)


def _clip(args: argparse.Namespace, out: Path, session: Session) -> Clip:
    """Take the user's clip with what lies beside it, or render one."""
    if args.video is None:
        folder = out / "clip"
        _say(args, "rendering a clip")
        session.start("gait simulate", [*_gait("simulate"), "-o", str(folder)]).result(600.0)
        args.video = str(folder / "video.mp4")
    return _clip_of(args)


def _clip_of(args: argparse.Namespace) -> Clip:
    """Put what was given together with what lies beside the video."""
    beside = Path(args.video).parent
    camera = args.camera or _beside(beside / "camera.json")
    if camera is None:
        raise UserError(f"{args.video}: has no camera.json beside it; give --camera (make demo CAMERA=...)")
    return Clip(
        video=args.video,
        camera=camera,
        init=args.init or _beside(beside / "init.json") or "auto",
        background=args.background or _beside(beside / "background.png") or "auto",
        truth=args.truth or _beside(beside / "truth.csv"),
    )


def _beside(path: Path) -> str | None:
    return str(path) if path.is_file() else None


def _run_live(args: argparse.Namespace, clip: Clip, out: Path, session: Session) -> dict[str, Any]:
    """All three at once over multicast; returns the figures of the recording."""
    url = private_url()
    tracker = session.start("gait-trackd", _trackd(args, url))
    recorder = session.start("gait record", _record(url, out), pipe_errors=True)
    recorder.wait_for_word(LISTENING)
    sending = ["--url", url, "--wait", str(_READY), *_compression(args, clip, session)]
    capture = session.start("gait capture", [*_capture(args, clip), *sending])
    session.wait(capture, needed=[tracker, recorder])
    capture.result(_END)
    figures: dict[str, Any] = json.loads(recorder.result(_END))
    tracker.interrupt()
    _say(args, f"gait-trackd: {tracker.result(_END).strip()}")
    return figures


def _compression(args: argparse.Namespace, clip: Clip, session: Session) -> list[str]:
    """Options of gait capture that make a frame fit the receivers' buffers twice; colour where it does."""
    width, height = Video(clip.video).size
    if 2 * 3 * width * height <= receive_buffer():
        return []
    if session.start("gait-trackd", [args.trackd, "--version"]).result(_END).strip().endswith("jpeg yes"):
        _say(args, "frames are larger than half the receive buffer: sent as JPEG")
        return ["--jpeg", "90"]
    if 3 * width * height <= _LARGE:
        return []
    _say(args, "frames are larger than half the receive buffer and gait-trackd has no JPEG: sent in grey")
    return ["--grey"]


def _run_through_log(args: argparse.Namespace, clip: Clip, out: Path, session: Session) -> dict[str, Any]:
    """One after the other through files: nothing is lost, nothing is in real time."""
    frames, estimates = ((out / name).resolve() for name in ("frames.log", "sent.log"))
    for file in (frames, estimates):
        file.unlink(missing_ok=True)
    try:
        to_log = ["--url", f"file://{frames}?mode=w", "--rate", "max"]
        session.start("gait capture", [*_capture(args, clip), *to_log]).result(600.0)
        tracker = _trackd(args, f"file://{frames}?speed=0")
        words = session.start("gait-trackd", [*tracker, "--out", f"file://{estimates}?mode=w"]).result(3600.0)
        _say(args, f"gait-trackd: {words.strip()}")
        recorder = session.start("gait record", _record(f"file://{estimates}?speed=0", out))
        figures: dict[str, Any] = json.loads(recorder.result(600.0))
    finally:
        for file in (frames, estimates):
            file.unlink(missing_ok=True)
    return figures


def _gait(command: str) -> list[str]:
    """Start of the command line of a sub-command, in this very Python."""
    return [sys.executable, "-m", "gait", command]


def _trackd(args: argparse.Namespace, url: str) -> list[str]:
    particles = ["--particles", str(args.particles)] if args.particles else []
    return [args.trackd, "--model", args.model, "--url", url, "--threads", str(args.threads), *particles]


def _record(url: str, out: Path) -> list[str]:
    files = ["-o", str(out / "track.csv"), "--log", str(out / "estimates.log")]
    return [*_gait("record"), "--url", url, *files, "--until-idle", str(_IDLE), "--json"]


def _capture(args: argparse.Namespace, clip: Clip) -> list[str]:
    """Command line of gait capture without the URL."""
    command = [*_gait("capture"), clip.video, "--camera", clip.camera, "--init", clip.init]
    command += ["--background", clip.background, "--model", args.model]
    for option in ("height", "stop"):
        if getattr(args, option) is not None:
            command += [f"--{option}", str(getattr(args, option))]
    start = args.start if args.start is not None else _frame_of(clip.init)
    return [*command, "--start", str(start), *(["--quiet"] if args.quiet else [])]


def _frame_of(init: str) -> int:
    """Frame of an init file: sending what comes before would be for nothing."""
    if init == "auto":
        return 0
    fields = read_json(init, "init")
    return fields.integer("frame", 0, 1 << 31, "give the frame number, from 0") if "frame" in fields else 0


def _report_arguments(args: argparse.Namespace, clip: Clip, out: Path, live: bool) -> argparse.Namespace:
    return argparse.Namespace(
        log=str(out / "estimates.log"),
        track=str(out / "track.csv"),
        video=clip.video,
        camera=clip.camera,
        output=str(out / "report.html"),
        overlay=str(out / "overlay.mp4"),
        truth=clip.truth,
        model=args.model,
        replayed=not live,
    )


def _say(args: argparse.Namespace, words: str) -> None:
    if not args.quiet:
        print(words, file=sys.stderr)
