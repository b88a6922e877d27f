"""Run benchmarks one after another, and write the output of each into docs/benchmarks.md.

    python -m benchmarks [NAME ...]

Without a name all of them run.  The text between the marks of a benchmark in that file is replaced; the rest is
unchanged.  Exit code 1 when a target is missed.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER.parent / "docs" / "benchmarks.md"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py") if not path.stem.startswith("_"))


def run(name: str) -> tuple[int, str]:
    """Exit code and output of a benchmark, which is also printed at once."""
    command = [sys.executable, "-u", str(FOLDER / f"{name}.py")]
    printed = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        for line in process.stdout:
            print(line, end="", flush=True)
            printed.append(line)
    return process.returncode, "".join(printed)


def replace_block(page: str, name: str, printed: str) -> str:
    """The page with a new block.  Raises ValueError without exactly one place for it."""
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->"
    found = re.compile(f"(?<={re.escape(begin)}).*?(?={re.escape(end)})", re.DOTALL)
    block = f"```\n{printed.rstrip()}\n```\n"
    page, count = found.subn(lambda _: block, page)
    if count != 1:
        raise ValueError(f"{PAGE}: has {count} places between {begin.strip()} and {end}; one is needed")
    return page


def main() -> int:
    """Run them, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}")
    names = parser.parse_args().names
    if unknown := sorted(set(names) - set(NAMES)):
        parser.error(f"unknown benchmark {', '.join(unknown)}; there are {', '.join(NAMES)}")
    worst = 0
    for name in names or NAMES:
        print(f"== {name}", flush=True)
        code, printed = run(name)
        PAGE.write_text(replace_block(PAGE.read_text(), name, printed))
        worst = max(worst, code)
    return worst


if __name__ == "__main__":
    sys.exit(main())
