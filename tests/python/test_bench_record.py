"""What `make bench` keeps of a run."""

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))
import bench


def test_a_record_says_what_made_it_and_all_that_was_printed(tmp_path):
    page = bench.page("rate  >= 30  8.57 fps  MISSED\n", tmp_path / "a-machine.csv", f"{sys.executable} -I")
    assert "make bench ARGS=--record" in page and re.search(r"at commit [0-9a-f]{7,}|at commit unknown", page)
    assert "Python 3." in page and re.search(
        r"; \d{4}-\d\d-\d\d \d\d:\d\d UTC\. All figures: a-machine\.csv\.", page
    )
    assert "```\nrate  >= 30  8.57 fps  MISSED\n```" in page


def test_a_bench_that_fails_leaves_no_record(tmp_path, monkeypatch, capsys):
    table, page = tmp_path / "new/a.csv", tmp_path / "bench.md"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "sys.argv", ["bench.py", "--page", str(page), "sh", str(table), "-c", "echo on; exit 3"]
    )
    monkeypatch.setattr(bench, "run", lambda command, run=bench.run: run([command[0], *command[3:]]))
    with pytest.raises(SystemExit) as stop:
        bench.main()
    assert stop.value.code == 3 and not page.exists() and not table.exists()
    assert capsys.readouterr().out == "on\n"
