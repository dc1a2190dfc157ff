"""The parts of the evaluation (tests/bench/eval_*.py) that decide what counts as good."""

import importlib
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_evaluate import FIRST_PHASE, RATE, STRIKES, TRUTH, track

from gait import Camera, TrackerConfig
from gait.io.track_file import Joints

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import camera_walk
import eval_ablate
import eval_clips
import eval_edits
import eval_measures
import eval_plan
import eval_table
import eval_wanted
import mutants
import parts
from eval_marks import Marks

PHASE = (FIRST_PHASE + RATE * TRUTH.frame / 30) % 1


def row(clip, seed=1, arm=eval_plan.BASE, **values):
    """Figures of a good run, changed by `values`."""
    good = {
        **{
            "root_mm": 20.0,
            "free_mm": 50.0,
            "abs_mm": 40.0,
            "px": 3.0,
            "any_px": 3.0,
            "lost_pct": 0.0,
            "lost2_pct": 0.0,
        },
        **{"phase_pct": 1.0, "flips_pct": 0.0, "cover90": 0.9, "root12_mm": 45.0, "crps_mm": 20.0},
        **{
            "lost_run": False,
            "failure": "",
            "empty": False,
            "locked": True,
            "side": "right",
            "near_px": 9.0,
            "clear_px": 12.0,
        },
        **{"strikes_pct": 100.0, "stride_pct": 1.0, "strike_worst": 1.0},
    }
    return {"clip": clip, "seed": seed, "arm": arm} | good | values


def verdict(rows, words):
    return next(v for v in eval_wanted.verdicts(rows) if words in v.measure)


def test_a_swapped_start_is_wrong_only_while_it_reports_tracking():
    swapped = track(phase=(PHASE + 0.5) % 1)
    silent = eval_measures.start_quality(swapped, PHASE)
    assert silent["side"] == "wrong" and silent["locked"] and silent["flipped_silently"] == 1
    honest = eval_measures.start_quality(replace(swapped, status=["ambiguous"] * 100), PHASE)
    assert honest["side"] == "open"
    seldom = ["ambiguous"] * 75 + ["tracking"] * 25  # right only where it states so, most of the time
    assert eval_measures.start_quality(track(status=seldom), PHASE)["side"] == "open"
    assert eval_measures.start_quality(track(status=["lost"] * 100), PHASE)["side"] == "lost"
    late = np.where(np.arange(100) < 20, (PHASE + 0.5) % 1, PHASE)  # mended within the first second
    assert eval_measures.start_quality(track(phase=late), PHASE)["side"] == "right"
    drifting = eval_measures.start_quality(track(phase=(PHASE + 0.1) % 1), PHASE)
    assert not drifting["locked"] and drifting["side"] == "right"
    stands = np.where(np.arange(100) % 3 == 0, np.nan, PHASE)
    assert eval_measures.start_quality(track(), stands) == eval_measures.start_quality(track(), PHASE)
    none = {"locked": None, "side": None}
    assert eval_measures.start_quality(track(), np.full(100, np.nan)) == none


def test_strikes_of_a_track_are_held_against_the_known_ones():
    good = eval_measures.strike_errors(track(), STRIKES)
    assert good["asked"] >= 4 and good["within"] == 1 and good["stride"] < 0.02
    slow = Joints(TRUTH.frame + 5, TRUTH.time, TRUTH.places)
    off = eval_measures.strike_errors(track(slow), STRIKES)
    assert off["within"] == 0 and 3 < off["worst"] < 7 and off["stride"] < 0.02
    still = {name: np.repeat(at[:1], 100, axis=0) for name, at in TRUTH.places.items()}
    none = eval_measures.strike_errors(track(Joints(TRUTH.frame, TRUTH.time, still)), STRIKES)
    assert none["within"] == 0 and none["worst"] == float("inf")


def test_a_run_is_lost_by_its_end_or_by_its_half():
    status = np.array(["tracking"] * 100)
    root = np.full(100, 50.0)
    assert not eval_measures.lost_at_end({"status": status, "root": root})
    assert eval_measures.lost_at_end({"status": status, "root": np.where(np.arange(100) > 79, 200, root)})
    assert not eval_measures.lost_at_end({"status": status, "root": np.where(np.arange(100) > 81, 200, root)})
    assert eval_measures.lost_at_end({"status": np.where(np.arange(100) < 51, "lost", status), "root": root})


def test_marks_count_the_near_leg_and_the_clear_joints(tmp_path):
    view = Camera.looking((0.0, -9.0, 1.0), (0.0, 0.0, 1.0), (640, 480), 500.0)
    names = ["neck", "l_hip", "l_knee", "l_ankle", "l_toe", "r_knee", "head_centre"]
    places = [TRUTH.places[n] for n in names[:-1]]
    places.append(0.5 * (TRUTH.places["neck"] + TRUTH.places["head_top"]))
    frames = [10, 40, 95]
    uv = view.project(np.stack(places, axis=1)[frames])
    uv[:, 1:4] += [6.0, 0.0]  # the near leg
    uv[:, 5] += [0.0, 400.0]  # hidden: does not count
    visible = [[2, 1, 2, 2, 2, 0, 2]] * 3
    data = {
        **{"frame_numbers": frames, "joints": names, "uv": uv.tolist(), "vis": visible, "near_side": "left"},
        "heel_strikes": {"right": STRIKES.right.tolist(), "left": STRIKES.left.tolist()},
    }
    (tmp_path / "marks.json").write_text(json.dumps(data))
    measures = Marks.read(tmp_path / "marks.json").measure(track(), view)
    assert measures["near_px"] == pytest.approx(6, abs=1e-6)
    # clear: neck 0, knee 6, ankle 6, toe 0, head 0
    assert measures["clear_px"] == pytest.approx(0, abs=1e-6) and measures["lost"] == 0
    assert measures["phase"]["p90"] < 0.02
    lost = Marks.read(tmp_path / "marks.json").measure(track(move=3.0), view)
    assert lost["lost"] == 1 and lost["trust"] == {"wrong_tracking": 1.0, "weighted_lost": 2.0}


def test_every_wanted_line_passes_on_good_runs_and_fails_on_bad_ones():
    clips = ("a", "b", "toward300_08", "outdoor")
    arms = (eval_plan.BASE, *eval_wanted.STARTS, "stature +5 %", "background none", "every 2", "every 3")
    good = [row(clip, seed, arm) for arm in arms for clip in clips for seed in (1, 2, 3)]
    assert [v.passed for v in eval_wanted.verdicts(good)][:-1] == [True] * 15
    assert eval_wanted.missed(good) == []
    bad = {
        "root-aligned median": {"root_mm": 41.0},
        "absolute": {"abs_mm": 46.0},
        "runs freely": {"free_mm": 33.0},
        "wrong stature": {"px": 4.0, "arm": "stature +5 %"},
        "lost frames": {"lost2_pct": 30.0},
        "phase error": {"flips_pct": 1.0},
        "auto: phase locked": {"locked": False, "arm": eval_wanted.AUTO},
        "auto: left and right": {"side": "wrong", "arm": eval_wanted.AUTO},
        "detector: left and right": {"side": "wrong", "arm": "default/images"},
        "coverage": {"cover90": 0.1},
        "no background": {"root_mm": 45.0, "arm": "background none"},
        "px to near": {"near_px": 11.5},
        "heel strikes": {"strikes_pct": 80.0},
        "frames/s": {"root_mm": 45.0, "arm": "every 3"},
    }
    for words, values in bad.items():
        arm = values.get("arm", eval_plan.BASE)
        rows = [r | values if r["arm"] == arm else r for r in good]
        assert verdict(rows, words).passed is False, words
        assert verdict(rows, words).measure in eval_wanted.missed(rows)


def test_what_was_not_run_is_neither_passed_nor_failed():
    reported = {v.measure: v.passed for v in eval_wanted.verdicts([row("a")])}
    assert reported["auto: phase locked within 1 s"] is None and reported["no background plate"] is None
    half = verdict([row("a"), row("a", arm="every 2")], "frames/s")
    assert half.passed is None and "every 2" in half.reached


def test_a_run_that_gave_up_is_not_left_out():
    rows = [row("a", seed, failure="no", root_mm=None, lost_run=True) for seed in (1, 2)] + [row("a", 3)]
    assert verdict(rows, "root-aligned median").passed is False
    assert verdict(rows, "runs freely").passed is False
    assert "2 of 3" in verdict(rows, "lost frames").reached


def test_ablation_is_paired_and_its_interval_knows_noise_from_effect():
    rng = np.random.default_rng(5)
    rows = []
    for clip in "abcdef":
        hard = rng.uniform(20, 200)  # clips differ far more than the effect
        for seed in (1, 2, 3):
            base = hard + rng.normal(0, 2)
            rows.append(row(clip, seed, root_mm=base))
            rows.append(row(clip, seed, "no edges", root_mm=base + 8 + rng.normal(0, 2)))
            rows.append(row(clip, seed, "no tilt", root_mm=base + rng.normal(0, 2)))
    costs = {line["name"]: line["root_mm"] for line in eval_ablate.costs(rows)}
    mean, low, high = costs["edges"]
    assert 6 < low < mean < high < 10 and low < 8 < high
    assert costs["tilt"][1] < 0 < costs["tilt"][2]
    later = [r | {"root_mm": r["root_mm"] - 3} for r in rows]
    assert {line["name"]: line["root_mm"] for line in eval_ablate.changes(rows, later)} == {
        arm: pytest.approx((-3, -3, -3)) for arm in (eval_plan.BASE, "no edges", "no tilt")
    }


def test_errors_and_time_by_number_of_particles_are_means_over_clips():
    rows = [row("a", seed, step_ms=3.0, root_mm=error) for seed, error in ((1, 29.0), (2, 31.0))]
    assert len(eval_table.by_particles(rows, 2000)) == 1  # nothing was varied
    rows += [row("outdoor", step_ms=9.0, root_mm=None)]
    rows += [row("a", seed, "N 500", step_ms=1.0, root_mm=32.0) for seed in (1, 2, 3)]
    rows += [row("b", 1, "N 500", step_ms=2.0, root_mm=52.0)]
    head, few, many = eval_table.by_particles(rows, 2000)
    few, many = (dict(zip(head, line, strict=True)) for line in (few, many))
    assert (few["particles"], few["runs"], few["root mm"], few["ms"]) == ("500", "4", "42.0", "1.5")
    assert (many["particles"], many["root mm"], many["ms"]) == ("2000", "30.0 +- 1.0", "3.0 +- 0.0")


def test_the_time_to_an_error_is_that_of_the_fastest_run_that_reaches_it():
    arms = {"default/truth": (3.0, 30.5), "N 500": (1.0, 32.0), "N 500, rejuvenation 1.5 s": (0.9, 33.0)}
    rows = [row("a", 1, arm, step_ms=ms, root_mm=mm, abs_mm=60.0) for arm, (ms, mm) in arms.items()]
    assert eval_table.time_to_error(rows, 2000)[1:] == [
        ["root", "31", "3.0", "2000"],
        ["root", "32", "1.0", "500"],
        ["root", "33", "0.9", "500, rejuvenation 1.5 s"],
        ["abs", "60", "0.9", "500, rejuvenation 1.5 s"],
    ]
    assert len(eval_table.time_to_error(rows[:1], 2000)) == 1  # nothing was varied


def test_switches_turn_off_what_is_on():
    config = TrackerConfig.default()
    found = eval_ablate.switches(config)
    assert {"silhouette", "edges"} <= set(found)
    for name, changes in found.items():
        assert any(getattr(config, key) != value for key, value in changes.items()), name
        config.replace(**changes)  # each names settings that exist
    off = config.replace(**found["edges"])
    assert "edges" not in eval_ablate.switches(off)


def test_arms_vary_one_thing_each():
    arms = eval_plan.varied_arms(
        seeds=2,
        stature_error=0.05,
        backgrounds=["none", "plate"],
        every=[1, 3],
        particles=[300],
        rejuvenation=[1.5],
    )
    few = ["N 300", "N 300, rejuvenation 1.5 s"]
    assert [a.name for a in arms] == ["stature +5 %", "stature -5 %", "background none", "every 3", *few]
    assert {a.seeds for a in arms} == {2} and arms[-2].changes == (("particles", 300),)
    assert arms[-1].changes == (("particles", 300), ("rejuvenation_time", 1.5))
    assert [a.seeds for a in eval_plan.main_arms(["default", "paper"], ["auto"], None)] == [4, 3]


def test_noise_on_a_start_is_the_seeds_and_a_wrong_stature_is_believed(tmp_path):
    with open(tmp_path / "truth.csv", "w") as file:
        names = list(TRUTH.places)
        file.write("frame,time,heading_rad," + ",".join(f"{n}_{a}" for n in names for a in "xyz") + "\n")
        for i, frame in enumerate(TRUTH.frame):
            numbers = np.concatenate([TRUTH.places[n][i] for n in names])
            file.write(f"{frame},{TRUTH.time[i]},0.7," + ",".join(f"{v:.6f}" for v in numbers) + "\n")
    events = {"r_heel_strike": STRIKES.right.tolist(), "l_heel_strike": STRIKES.left.tolist()}
    (tmp_path / "meta.json").write_text(json.dumps({"stature_m": 1.7, "events_video_frames": events}))
    clip = eval_plan.Clip("c", tmp_path, tmp_path / "v", tmp_path / "c", truth=tmp_path / "truth.csv")
    starts = [eval_clips.noisy_start(clip, seed, 0.0) for seed in range(200)]
    phase = np.array([s["phase"] for s in starts])
    assert phase.mean() == pytest.approx(FIRST_PHASE, abs=0.01)
    assert phase.std() == pytest.approx(eval_clips.SD["phase"], rel=0.15)
    assert starts[3] == eval_clips.noisy_start(clip, 3, 0.0)
    assert {s["stature_m"] for s in starts} == {1.7}
    wrong = eval_clips.noisy_start(clip, 3, -0.05)
    assert wrong["stature_m"] == pytest.approx(0.95 * 1.7)
    assert wrong["sd"]["stature_m"] < 0.05 * 1.7 < 0.1  # the tracker did not know
    still = eval_clips.noisy_start(replace(clip, steady=False), 3, 0.0)
    assert "phase" not in still and "stride_hz" not in still and "phase" not in still["sd"]


def test_an_edited_clip_has_the_truth_of_its_frames(tmp_path):
    from gait.simulate.clip import simulate
    from gait.simulate.scenario import Scenario

    source, target = tmp_path / "walk", tmp_path / "back"
    simulate(Scenario(frames=12, size=(160, 120), seed=3), source)
    target.mkdir()
    assert eval_edits.backwards([source], target)["steady"] is False
    was, now = (eval_edits.read_truth(p / "truth.csv") for p in (source, target))
    np.testing.assert_allclose(now.places["pelvis"], was.places["pelvis"][::-1])
    np.testing.assert_allclose(now.time, was.time, atol=1e-5)
    first, last = eval_edits._frames(target)[0], eval_edits._frames(source)[-1]
    assert np.abs(first.astype(int) - last).mean() < 6
    cut = tmp_path / "cut"
    cut.mkdir()
    eval_edits.leaves([source], cut)
    views = [Camera.read(str(p / "camera.json")) for p in (source, cut)]
    shift = views[0].project(was.places["neck"]) - views[1].project(was.places["neck"])
    np.testing.assert_allclose(shift, [[40, 0]] * 12, atol=1e-9)
    assert eval_edits._frames(cut)[0].shape == (120, 80, 3)


def test_models_of_an_evaluation_are_known_by_the_sources_they_are_learned_by(tmp_path):
    assert eval_clips.models([], tmp_path, 1, lambda done: None) == {}


def test_a_part_run_alone_is_joined_with_the_last_tables_of_the_others(tmp_path, monkeypatch):
    monkeypatch.setattr(parts.table, "RESULTS", tmp_path)
    evaluation = parts.Evaluation(
        "eval-learn", "learn", "Learning", {"learn_size.py": (), "learn_speed.py": ()}
    )
    for name in ("learn_size", "learn_speed"):
        (tmp_path / f"{name}.csv").write_text("measure,met\nsize,yes\n")
        (tmp_path / f"{name}.md").write_text(f"## {name}\n")
    runs = {"learn_speed.py": parts.Run("learn_speed", "at commit b", 7, "a bound is missed")}
    evaluation.write(runs)
    runs = evaluation.known() | {"learn_size.py": parts.Run("learn_size", "at commit a", 3, "")}
    evaluation.write(runs)
    assert evaluation.known() == runs
    page = (tmp_path / "learn.md").read_text()
    order = (
        "a Took: learn_size.py 3 s.",
        "b Took: learn_speed.py 7 s.",
        "Failed:",
        "# learn_size",
        "# learn_speed",
    )
    places = [page.index(line) for line in order]
    assert places == sorted(places) and "| size | 2 | 0 |" in page


def test_only_one_part_is_run_and_the_heads_of_the_others_stay(tmp_path, monkeypatch):
    """The page names the commit of each part, and what the last run of each missed."""
    monkeypatch.setattr(parts.table, "RESULTS", tmp_path)
    monkeypatch.setattr(parts, "HERE", tmp_path)
    evaluation = parts.Evaluation("eval-lift", "lift", "Lifting", {"one.py": (), "two.py": ()})

    def run(commit, only, code=0):
        for name in ("one", "two"):
            text = f"from pathlib import Path\nat = Path(__file__).parent / '{name}_table.md'\n"
            text += "raise SystemExit(3)\n" if code == 3 else ""
            text += f"at.write_text('## {name} {commit}')\n"
            text += f"at.with_suffix('.csv').write_text('measure,met')\nraise SystemExit({code})\n"
            (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.setattr(parts, "facts", lambda _: f"at commit {commit};")
        return evaluation.main(only), (tmp_path / "lift.md").read_text()

    assert run("aaa", None)[0] == 0
    code, page = run("bbb", ["two.py"], 1)
    assert code == 1 and page.index("at commit aaa; Took: one.py") < page.index("at commit bbb; Took: two.py")
    assert "## one aaa" in page and "## two bbb" in page and "Failed: two.py (a bound is missed)" in page
    code, page = run("ccc", ["one.py"])
    assert code == 0 and "at commit ccc; Took: one.py" in page and "at commit bbb; Took: two.py" in page
    assert "aaa" not in page and "Failed: two.py" in page
    code, page = run("ddd", ["two.py"], 3)
    assert code == 1 and "## two bbb" in page and "ddd" not in page
    assert "Failed: two.py (no table: run it by itself; its tables are older)" in page


def test_bounds_of_learning_are_counted_by_measure(tmp_path):
    rows = ["measure,met", "auto,yes", "L10,yes", "L5,yes", "L5,NO", "L5 by style,NO", "L6,"]
    (tmp_path / "learn_a.csv").write_text("\n".join(rows) + "\n")
    lines = parts.summary([tmp_path / "learn_a.md"]).splitlines()[4:]
    assert lines == ["| L5 | 1 | 1 |", "| L5 by style | 0 | 1 |", "| L10 | 1 | 0 |", "| auto | 1 | 0 |"]


def test_every_mutant_changes_a_line_that_is_there():
    assert not list(mutants.stale())
    assert list(mutants.stale((mutants.MUTANTS[0]._replace(before="no such line"),)))


@pytest.mark.parametrize(
    "place, value, name",
    [
        (1, -16.0, "focal"),
        (3, 1.6, "tilt"),
        (6, -9.0, "height"),
        (8, 24.0, "joints"),
        (10, 8.5, "speed"),
        (12, 79.0, "pelvis"),
        (12, 100.0, "pelvis"),
    ],
)
def test_a_camera_from_a_walk_that_misses_a_bound_fails(place, value, name, tmp_path, monkeypatch):
    good = ["clip", -14.0, 9.0, 1.4, 0.7, 0.0, 7.0, 6.0, 22.0, 20.0, -7.0, 0.0, 90.0]
    row = [*good[:place], value, *good[place + 1 :]]
    assert camera_walk.missed(good) == [] and camera_walk.missed(row) == [name]
    (tmp_path / "eval" / "dev" / "clip").mkdir(parents=True)
    monkeypatch.setattr(camera_walk.eval_clips, "DATA", tmp_path)
    monkeypatch.setattr(camera_walk.table, "RESULTS", tmp_path)
    monkeypatch.setattr(sys, "argv", ["camera_walk.py"])
    for figures, held, code in ((good, 9, 0), (row, 9, 1), (good, 7, 1), (good, 10, 1)):
        found = figures, [True] * held + [False] * (10 - held)
        monkeypatch.setattr(camera_walk, "_clip", lambda _, found=found: found)
        assert camera_walk.main() == code


def test_every_bench_finds_what_it_imports():
    """Most of these run seldom and by hand: a module of the package that moved would be noticed late."""
    for path in Path(eval_clips.__file__).parent.glob("*.py"):
        importlib.import_module(path.stem)
