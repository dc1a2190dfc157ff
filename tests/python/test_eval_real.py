"""What `make eval-real` counts as good, checked with tracks whose quality is known."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_evaluate import FIRST_PHASE, RATE, TRUTH, track

from gait import Camera
from gait.cli import main
from gait.io.track_file import read_estimates
from gait.simulate.clip import simulate
from gait.simulate.scenario import Scenario

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import eval_real
import real_clip

CAMERA = Camera.looking((7.0, -6.0, 1.5), (2.6, -0.7, 0.9), (640, 480), 500.0)
CAMERAS = dict.fromkeys(TRUTH.frame.tolist(), CAMERA)
OTHER = {"l": "r", "r": "l"}


def reference(swapped=False):
    """Joints of the truth in the picture by frame, with ears and heels."""
    found = {}
    for row, frame in enumerate(TRUTH.frame.tolist()):
        points = real_clip.project(track(), row, CAMERA)
        points |= {ear: points["head_top"] + [0.0, 10.0] for ear in ("l_ear", "r_ear")}
        if swapped:
            points = {
                OTHER.get(name[0], name[0]) + name[1:] if name[1] == "_" else name: at
                for name, at in points.items()
            }
        found[frame] = points
    return found


def clip(**changes):
    right = ((np.arange(1, 4) - FIRST_PHASE) / RATE * 30).tolist()
    made = real_clip.Clip(
        folder=Path("clip"),
        video=Path("video.mp4"),
        first=0,
        last=99,
        fps=30.0,
        stature=1.7,
        stride_hz=RATE,
        strikes=[(frame, 0.0) for frame in right],
        reference=reference(),
    )
    return replace(made, **changes)


def test_the_truth_is_good_and_on_time():
    score = real_clip.score(clip(), track(), CAMERAS)
    assert score.share == {"good": 1.0, "swap": 0.0, "legs": 0.0, "off": 0.0, "none": 0.0}
    assert (score.tracking, score.wrong) == (100, 0)
    assert score.error < 1e-6 and abs(score.stride_error) < 1e-6 and score.strike_error < 1e-3


def test_a_phase_that_falls_backwards_has_the_same_rate():
    back = replace(track(), phase=-track().phase)
    strikes = [(frame, -phase) for frame, phase in clip().strikes]
    score = real_clip.score(clip(strikes=strikes), back, CAMERAS)
    assert abs(score.stride_error) < 1e-6 and 0 <= score.strike_error < 1e-3


def test_a_rate_that_is_wrong_or_not_known_is_missed():
    strikes = [(frame + side, 0.5 * (side > 0)) for frame in (4.0, 30.0, 56.0) for side in (0.0, 13.5)]
    assert real_clip.rate_of(strikes, 26.0) == pytest.approx(1.0, rel=0.02)
    assert real_clip.rate_of(strikes[:2], 26.0) is None
    score = real_clip.score(clip(), track(), CAMERAS)
    result = eval_real.Result("walk", "known", score, 1.0, 1.0)
    assert not eval_real._missed([result], [result])
    for error in (0.04, np.nan):
        wrong = replace(result, score=replace(score, stride_error=error))
        assert "stride rate" in eval_real._missed([wrong], [wrong])[0]


def test_a_person_who_stands_at_first_has_no_rate_there():
    walk = track()
    late = [(frame, phase) for frame, phase in clip().strikes if frame > 20]
    blank = np.where(walk.frame < 20, np.nan, walk.phase)
    score = real_clip.score(clip(strikes=late), replace(walk, phase=blank), CAMERAS)
    assert abs(score.stride_error) < 1e-6 and score.strike_error < 1e-3


def test_a_person_who_stands_at_times_has_no_rate(tmp_path):
    simulate(Scenario(frames=60, size=(96, 72), noise=0.0), tmp_path)
    assert real_clip.from_truth(tmp_path).stride_hz == pytest.approx(0.9, abs=0.2)
    truth = tmp_path / "truth.csv"
    head, *rows = truth.read_text().splitlines()
    classes = ["walk"] * (len(rows) - 1) + ["stand"]
    lines = [f"{row},{name}" for row, name in zip([head, *rows], ["motion_class", *classes], strict=True)]
    truth.write_text("\n".join([*lines, ""]))
    assert real_clip.from_truth(tmp_path).stride_hz is None


def test_a_track_elsewhere_is_wrong_only_under_tracking():
    away = real_clip.score(clip(), track(move=1.0), CAMERAS)
    assert away.share["off"] == 1.0 and away.wrong == 100
    lost = real_clip.score(clip(), track(move=1.0, status=["lost"] * 100), CAMERAS)
    assert lost.share["off"] == 1.0 and (lost.tracking, lost.wrong) == (0, 0)


def test_swapped_legs_are_a_swap_where_they_are_apart():
    score = real_clip.score(clip(reference=reference(swapped=True)), track(), CAMERAS)
    assert score.share["swap"] > 0.5 and score.wrong == round(100 * (1 - score.share["good"]))


def test_frames_that_are_not_in_the_track_count():
    half = {frame: points for frame, points in reference().items() if frame < 50}
    assert real_clip.score(clip(reference=half), track(), CAMERAS).share["good"] == 1.0
    truth = replace(
        TRUTH,
        frame=TRUTH.frame[:50],
        time=TRUTH.time[:50],
        places={name: at[:50] for name, at in TRUTH.places.items()},
    )
    score = real_clip.score(clip(), track(truth), CAMERAS)
    assert score.share["none"] == 0.5 and score.share["good"] == 0.5


def result(arm="auto", good=1.0, **changes):
    share = dict.fromkeys(real_clip.KINDS, 0.0) | {"good": good, "off": 1.0 - good}
    score = real_clip.Score(share, tracking=100, stride_error=0.0)
    return eval_real.Result("clip", arm, replace(score, **changes), cpu=1.0, fps=10.0)


@pytest.mark.parametrize(
    ("results", "words"),
    [
        ([result(), result(good=0.9)], None),
        ([result(), result(good=0.6)], "clip auto: good 60%"),
        ([result(good=0.8), result(good=0.8)], "auto: good 80% on average"),
        ([result("auto-classes", good=0.6)], "clip auto-classes: good 60%"),
        ([result(wrong=3)], "3 of 100 frames"),
        ([result(stride_error=-0.04)], "stride rate -4.0%"),
        ([replace(result(), failed="no person")], "clip auto: no person"),
    ],
)
def test_a_missed_bound_is_named(results, words):
    missed = eval_real._missed(results, results)
    assert (missed == []) if words is None else any(words in line for line in missed)


def test_the_arm_without_background_is_judged_beside_auto():
    everything = [result(), result("nobg", good=0.9)]
    assert "nobg: good 90% on average, auto 100%" in eval_real._missed(everything[1:], everything)


@pytest.mark.long
def test_who_is_passed_by_others_is_followed_among_them(tmp_path, fetched):
    """A man with a cane walks towards the camera; a woman passes behind him and goes up the stairs."""
    clips = Path(__file__).parents[3] / "shared/data/real"
    if not clips.is_dir():
        pytest.skip("the real films are not beside the repository")
    [man] = real_clip.read_clips(clips, ["cane"])
    camera, out = str(man.folder / "camera.json"), str(tmp_path / "t.csv")
    given = [str(man.video), "--camera", camera, "--people", "all", "-o", out]
    assert main(["track", *given, "--quiet"]) == 0
    followed, woman = (read_estimates(str(tmp_path / f"t-{k}.csv")) for k in (1, 2))
    cameras = dict.fromkeys(followed.frame.tolist(), Camera.read(camera))
    found = real_clip.score(man, followed, cameras)
    assert found.share["good"] > 0.95 and found.tracking > 120 and found.wrong == 0
    assert "tracking" not in woman.status[30:]  # she is hidden, or elsewhere
