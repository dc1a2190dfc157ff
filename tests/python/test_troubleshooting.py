"""Every line that the troubleshooting page quotes is in the code."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "libgait/doc/troubleshooting.md"
GAP = "\0"  # of what a line fills in


def templates():
    """Texts in the code, with a gap where something is filled in."""
    found = set()
    for path in (ROOT / "python/gait").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = [part.value if isinstance(part, ast.Constant) else GAP for part in node.values]
                found.add("".join(parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    for path in [*(ROOT / "libgait/src").rglob("*.c"), *(ROOT / "tools").rglob("*.c")]:
        joined = re.sub(r'"\s*\n\s*"', "", path.read_text(encoding="utf-8"))
        found.update(re.findall(r'"((?:[^"\\\n]|\\.)*)"', joined))
    return found


QUOTES = re.findall(r"^\| `(.+?)` \|", PAGE.read_text(encoding="utf-8"), re.M)


def quoted(quote, texts):
    """Whether a text of the code may become a quote, in which ... stands for anything."""
    pieces = quote.split("...")
    pattern, longest = re.compile(".*?".join(map(re.escape, pieces)), re.S), max(pieces, key=len)
    if any(pattern.search(text) for text in texts if longest in text):
        return True
    # some lines are put together from several texts: each long piece must be in one
    words = [piece.strip(" :;,.x()") for piece in pieces]
    return all(any(word in text for text in texts) for word in words if len(word) > 8)


def test_every_quoted_line_is_in_the_code_and_no_other():
    texts = templates()
    assert len(QUOTES) > 25
    assert [quote for quote in QUOTES if not quoted(quote, texts)] == []
    assert not quoted("...: no such video at all; buy a camera", texts)
    assert not quoted("the focal length jumps from ... px to ... px in the later ones", texts)
