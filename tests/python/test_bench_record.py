"""What `make bench` keeps of a run."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench


def recorded(folder, monkeypatch, *options):
    """The page of a program that prints one line."""
    page = folder / "page.md"
    words = ["--cc", f"{sys.executable} -I", "--page", str(page), *options, "echo", "rate  8.57 fps  MISSED"]
    monkeypatch.setattr("sys.argv", ["bench.py", *words])
    monkeypatch.setattr(bench.bench_plot, "draw", lambda table, picture: None)
    bench.main()
    return page.read_text()


def test_a_record_states_what_made_it_and_all_that_was_printed(tmp_path, monkeypatch):
    page = recorded(tmp_path, monkeypatch, "--csv", str(tmp_path / "a-machine.csv"))
    assert page.startswith("# Speed of a step\n\n`make bench ARGS=--record` at commit")
    assert "Python 3." in page and re.search(
        r"; \d{4}-\d\d-\d\d \d\d:\d\d UTC\. All figures: a-machine\.csv\.", page
    )
    assert re.search(r"```\nrate  8\.57 fps  MISSED --csv \S+a-machine\.csv\n```", page)


def test_a_record_without_a_table_of_figures(tmp_path, monkeypatch):
    page = recorded(tmp_path, monkeypatch, "--target", "bench-lift", "--title", "Speed of lifting")
    assert page.startswith("# Speed of lifting\n\n`make bench-lift ARGS=--record` at commit")
    assert "All figures" not in page and "```\nrate  8.57 fps  MISSED\n```" in page


def test_several_runs_are_judged_by_their_medians(tmp_path, monkeypatch, capsys):
    script = (
        "echo $((n + 1)) >n; echo rate '>= 30.00' 2$n fps reached; echo '  time <= 1.30' 1.$n times MISSED"
    )
    program = tmp_path / "program"
    program.write_text(f"#!/bin/sh\nn=$(cat n)\n{script}\n")
    program.chmod(0o755)
    (tmp_path / "n").write_text("1")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["bench.py", "--page", "page.md", "--runs", "3", str(program)])
    bench.main()
    page, shown = (tmp_path / "page.md").read_text(), capsys.readouterr().out
    assert "ARGS='--record --runs 3'" in page and page.endswith("\n  time <= 1.30 1.3 times MISSED\n```\n")
    for text in page, shown:
        assert re.search(r"\n3 runs .*\nrate +>= +30\.00 +22\.00 +21\.00 +23\.00  0 of 3  MISSED\n", text)
        assert re.search(r"\n  time +<= +1\.30 +1\.20 +1\.10 +1\.30  3 of 3  reached\n", text)


@pytest.mark.parametrize("runs", ["0", "-1", "many"])
def test_a_number_of_runs_that_is_none(runs, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["bench.py", f"--runs={runs}", "true"])
    with pytest.raises(SystemExit) as stop:
        bench.main()
    assert stop.value.code == 2 and f"{runs} is not a number of at least 1" in capsys.readouterr().err


def test_a_bench_that_fails_leaves_no_record(tmp_path, monkeypatch, capsys):
    table, page = tmp_path / "new/a.csv", tmp_path / "bench.md"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "sys.argv", ["bench.py", "--page", str(page), "--csv", str(table), "sh", "-c", "echo on; exit 3"]
    )
    with pytest.raises(SystemExit) as stop:
        bench.main()
    assert stop.value.code == 3 and not page.exists() and not table.exists()
    assert capsys.readouterr().out == "on\n"
