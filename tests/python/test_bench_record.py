"""What `make bench` keeps of a run."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench


def recorded(folder, monkeypatch, *options):
    """The page of a program that says one line."""
    page = folder / "page.md"
    words = ["--cc", f"{sys.executable} -I", "--page", str(page), *options, "echo", "rate  8.57 fps  MISSED"]
    monkeypatch.setattr("sys.argv", ["bench.py", *words])
    monkeypatch.setattr(bench.bench_plot, "draw", lambda table, picture: None)
    bench.main()
    return page.read_text()


def test_a_record_says_what_made_it_and_all_that_was_printed(tmp_path, monkeypatch):
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


def test_a_bench_that_fails_leaves_no_record(tmp_path, monkeypatch, capsys):
    table, page = tmp_path / "new/a.csv", tmp_path / "bench.md"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "sys.argv",
        ["bench.py", "--page", str(page), "--csv", str(table), "sh", "-c", "echo on; exit 3"],
    )
    with pytest.raises(SystemExit) as stop:
        bench.main()
    assert stop.value.code == 3 and not page.exists() and not table.exists()
    assert capsys.readouterr().out == "on\n"
