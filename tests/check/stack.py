#!/usr/bin/env python3
"""stack.py LIMIT FILE.su...: no function uses over LIMIT bytes of stack, or an amount set at run time."""

import sys
from pathlib import Path


def main() -> int:
    limit, files = int(sys.argv[1]), sys.argv[2:]
    if not files:
        print("no .su files: was the library built?")
        return 1
    failed = False
    for path in files:
        for line in Path(path).read_text(encoding="utf-8").splitlines():
            name, size, kind = line.rsplit("\t", 2)
            if int(size) > limit or kind == "dynamic":
                print(f"{name}: {size} bytes of stack, {kind}")
                failed = True
    return failed


if __name__ == "__main__":
    sys.exit(main())
