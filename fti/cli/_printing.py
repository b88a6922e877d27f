"""The only output functions of the command line: they escape control characters, so a text cannot control the terminal.

Every other module of the command line prints through these functions.  On a terminal a line that is too long is folded;
elsewhere it stays one line for scripts.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fti.new_file import write_new_file
from fti.terminal_text import escape_controls

#: Between two columns of a table.
COLUMN_GAP = re.compile(r"(?<=\S)  +(?=\S)")
#: Further indentation of the parts of a line without columns.
CONTINUATION = 4
#: A folded line is not indented farther than this share of the width.
MAX_FOLD_SHARE = 0.75


def print_line(text: object, *, error: bool = False, flush: bool = False, is_folded: bool = True) -> None:
    """Print one line.  error : on standard error; is_folded : fold it on a terminal, if it is too long"""
    stream, line = sys.stderr if error else sys.stdout, escape_controls(str(text))
    lines = fold_line(line, shutil.get_terminal_size().columns) if is_folded and stream.isatty() else [line]
    print("\n".join(lines), file=stream, flush=flush)


def fold_line(line: str, width: int) -> list[str]:
    """A line, folded at spaces to fit a width: its parts begin below its last column, or indented."""
    if len(line) <= width:
        return [line]
    columns = [gap.end() for gap in COLUMN_GAP.finditer(line) if gap.end() <= MAX_FOLD_SHARE * width]
    parts = [line]
    for indent in (*columns[-1:], len(line) - len(line.lstrip()) + CONTINUATION):
        parts = textwrap.wrap(
            line, width, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
        )
        if max(map(len, parts)) <= width:
            break  # otherwise a word is too long below its column
    return parts


def print_lines(lines: Iterable[str], *, error: bool = False) -> None:
    """Print lines; a newline inside a line is escaped."""
    for line in lines:
        print_line(line, error=error)


def print_json(value: Any, *, indent: int | None = 1, flush: bool = False) -> None:
    """Print JSON.  ``json`` escapes everything but DEL."""
    print(json.dumps(value, indent=indent).replace("\x7f", "\\u007f"), flush=flush)


def print_status(text: str) -> None:
    """Show a state on standard error, in place of the last one; on a terminal only."""
    print(f"{escape_controls(text)}\x1b[K", end="\r", file=sys.stderr, flush=True)


def write_text(text: str, out: Path | None) -> None:
    """Write a text to a file that must not exist; without one print it, with its lines as they are."""
    if out:
        write_new_file(out, text.encode())
        print_line(f"{out}: written")
    else:
        for line in text.splitlines():
            print_line(line, is_folded=False)
