"""The script of gait completion completes commands, options, choices and files in bash."""

import shutil
import subprocess

import pytest

import gait.cli
from gait.bindings.shipped import SHIPPED
from gait.cli import COMMANDS, completion


@pytest.fixture(scope="module")
def script():
    return completion.script()


def complete(script, *words, cwd="."):
    """Completions of the last of `words`."""
    quoted = " ".join(f"'{word}'" for word in words)
    run = f"COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _gait; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    done = subprocess.run(
        ["bash", "-c", f"{script}\n{run}"], capture_output=True, text=True, check=True, cwd=cwd
    )
    assert not done.stderr
    return set(done.stdout.split())


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_words_are_completed(script, tmp_path):
    (tmp_path / "walk.mp4").touch()
    assert complete(script, "gait", "") >= {name.split()[0] for name in COMMANDS} | {"--version"}
    assert complete(script, "gait", "exp") == {"export"}
    assert complete(script, "gait", "track", "--key") == {"--keypoints", "--keypoints-sd"}
    assert complete(script, "gait", "track", "w.mp4", "--detector", "") == {
        "auto",
        "full",
        "lite",
        "heavy",
        "none",
    }
    assert complete(script, "gait", "report", "t") == {"track"}
    assert "--json" in complete(script, "gait", "report", "track", "--")
    assert complete(script, "gait", "completion", "") == {"bash", "zsh"}
    assert complete(script, "gait", "track", "wa", cwd=tmp_path) == {"walk.mp4"}
    assert complete(script, "gait", "track", "--people", "") == {"all"}
    assert complete(script, "gait", "track", "-m", "", cwd=tmp_path) == {*SHIPPED, "walk.mp4"}


@pytest.mark.parametrize("shell", completion.SHELLS)
def test_the_command_prints_the_script(shell, script, capsys):
    assert gait.cli.main(["completion", shell]) == 0
    printed = capsys.readouterr().out
    assert printed.endswith(script) and ("bashcompinit" in printed) == (shell == "zsh")
