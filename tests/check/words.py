#!/usr/bin/env python3
"""words.py ROOT [PATH...]: no tracked file under the paths uses a private word where the field has a term.

Prints file:line, the word and its replacement; with --count as first argument, the number of faults of each
file and of each word.  Identifiers are split at underscores and between cases: `addMingle` is add, mingle.
"""

import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

# Forms of a private word -> what to write instead.  These fail in names, comments and documents.
WORDS = {
    "mingle mingles mingled mingling": "rejuvenate",
    "weigh weighs weighed weighing": "compute the likelihood, weight",
    "walker walkers": "particle (state), person (who is tracked)",
    "population populations": "particle set",
    "ticket tickets": "cumulative weights",
    "fork forks forked forking": "split",
    "exchange exchanges exchanged exchanging": "mirror; swap of 2-D points",
    "eye eyes": "projection, camera",
    "belief beliefs": "posterior, estimate",
    "say says said saying": "state, report, print; residuals",
    "tell tells told telling": "report, show",
    "doubt doubts doubted doubtful": "robust weights, outlier",
    "spring springs": "corrections",
    "bordered": "block arrowhead",
    "likeness likenesses": "fit correlation",
    "sighting sightings": "person detection",
    "spotter spotters": "automatic start",
    "autostart": "automatic start, auto_start",
    "arming": "start trigger, start_trigger",
    "deviation deviations": "standard deviation, sd; departure",
    "somebody nobody anybody everybody whoever": "the person, no person, a person who",
    "odd wild": "outlier",
    "room rooms": "capacity, space; folder",
    "bare": "empty, plain",
    "stretch stretches": "interval",
    "sight sights": "observation, view",
    "misfit misfits": "fit_threshold (config), chi2 (sum), chi2_per_observation (mean)",
    "whom": "plain words for who does what",
}
# The same, but only where the word is an identifier of code or a part of one: in prose it is plain English.
NAMES = {
    "facing": "front_back",
    "look looks looked": "features, feature extraction",
    "loss": "track_loss",
    "wide": "simd_f64; width",
    "seen": "visible, observed",
    "jump jumps": "spikes",
    "spread spreads": "uncertainty, sd",
    "soft": "soft constraint",
    "beginning": "phase prior",
    "bet bets": "hypothesis",
}
PHRASES = {
    r"giv(?:e|es|ing|en) up|gave up": "end the search, stop, merge",
    r"(?:hang|hangs|hung|hanging) on": "depend on",
}
# What may stand around a word: matched with the line and the place of the word in it.
ALLOWED = {
    "eye": r"\b(?:np|numpy|torch|jnp)\.eye\b",
    "deviation": r"(?i:standard|absolute)[\s*#_-]*deviations?",
    "odd": r"\bodd[ _](?:number|size|count|width|height|order|length|harmonic|row|lane|byte|frame)s?|"
    r"even (?:and|or) odd|odd (?:and|or) even",
    "sight": r"lines? of sight",
    "room": r"\broom_normal\b",  # name of a film
    "loss": r"(?i:track(?:ing)?[ _]?loss|loss(?:es)? of|soft_l1|huber|loss=)",
    "fork": r"\bfork\(\)",
    "exchange": r"(?i:data|file|interchange|c3d) exchange",
    "soft": r"soft_(?:constraint|l1)|SOFT_CONSTRAINT",
}
SUFFIXES = {
    ".c",
    ".cpp",
    ".h",
    ".py",
    ".md",
    ".sh",
    ".lcm",
    ".toml",
    ".yml",
    ".yaml",
    ".txt",
    ".mk",
    ".in",
    ".cmake",
}
PAGES = {".js", ".css", ".html"}  # IN_NAMES are terms of the core; libraries of pages have `lookAt`, `wide`
BARE_NAMES = {"Makefile", "LAYERS", "README", "CMakeLists.txt"}
OWN = {
    "tests/check/words.py",
    "tests/python/test_checks.py",
    "libgait/doc/changelog.md",
}  # they list old names
PIECE = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
TOKEN = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")


def forms(table: dict[str, str]) -> dict[str, str]:
    """Each form of a word to its replacement."""
    return {form: to for words, to in table.items() for form in words.split()}


ANYWHERE, IN_NAMES = forms(WORDS), forms(NAMES)
PHRASE = [(re.compile(rf"\b(?:{p})\b", re.I), to) for p, to in PHRASES.items()]


def allowed(word: str, before: str, line: str, at: int) -> bool:
    """The word appears here in a context that ALLOWED lists, which may begin on the line before."""
    around = ALLOWED.get(word) or ALLOWED.get(word.removesuffix("s"))
    text, at = f"{before}\n{line}", len(before) + 1 + at
    return around is not None and any(m.start() <= at < m.end() for m in re.finditer(around, text))


def is_name(line: str, token: re.Match[str], code: bool) -> bool:
    """The token is an identifier: more than one piece, or in code and used as one."""
    if len(PIECE.findall(token[0])) > 1 or "_" in token[0]:
        return True
    after, before = line[token.end() : token.end() + 2], line[: token.start()]
    if not code or "/*" in before or "#" in before:
        return False
    used = re.match(r"\(|\[|->|\.\w|;|=|:=", after) or (re.match(r"[,)]", after) and "(" in before)
    return bool(used) or before.endswith((".", "->", "&", "*"))


def faults_of_line(before: str, line: str, code: bool, names: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Private words of a line and what to write instead."""
    for token in TOKEN.finditer(line):
        name = None
        for piece in PIECE.finditer(token[0]):
            word, at = piece[0].lower(), token.start() + piece.start()
            to = ANYWHERE.get(word)
            if to is None and word in names:
                name = is_name(line, token, code) if name is None else name
                to = names[word] if name else None
            if to is not None and not allowed(word, before, line, at):
                yield word, to
    for phrase, to in PHRASE:
        for found in phrase.finditer(line):
            yield found[0].lower(), to


def faults(path: str, text: str) -> Iterator[tuple[int, str, str]]:
    """Line, word and replacement of each private word of a file and of its name (line 0)."""
    code = Path(path).suffix in {".c", ".cpp", ".h", ".py"}
    names = {} if Path(path).suffix in PAGES else IN_NAMES
    before = ""
    for number, line in enumerate([Path(path).stem, *text.splitlines()]):
        for word, to in faults_of_line(before, line, code, names):
            yield number, word, to
        before = line


def tracked(root: Path, paths: list[str]) -> list[str]:
    """Text files that git tracks under the paths, or all files of a folder without git."""
    git = subprocess.run(
        ["git", "-C", root, "ls-files", "-z", "--", *paths], capture_output=True, text=True, check=False
    )
    if git.returncode:
        raise SystemExit(f"words: {root} is not a git checkout")
    names = [n for n in git.stdout.split("\0") if n and (root / n).is_file() and n not in OWN]
    return [n for n in names if Path(n).suffix in SUFFIXES | PAGES or Path(n).name in BARE_NAMES]


def main() -> int:
    count = sys.argv[1] == "--count"
    root, *paths = sys.argv[1 + count :]
    files: Counter[str] = Counter()
    words: Counter[str] = Counter()
    for name in tracked(Path(root), paths):
        for line, word, to in faults(name, (Path(root) / name).read_text(encoding="utf-8", errors="replace")):
            files[name] += 1
            words[word] += 1
            if not count:
                print(f"{name}:{line}: {word!r}: write {to}")
    if count:
        for table in files, words:
            print("\n".join(f"{n:6} {name}" for name, n in table.most_common()), end="\n\n")
    return bool(files)


if __name__ == "__main__":
    sys.exit(main())
