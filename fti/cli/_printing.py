"""The only output functions of the command line: they escape control characters, so a text cannot control the terminal.

Every other module of the command line prints through these functions.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from typing import Any

from fti.terminal_text import escape_controls


def print_line(text: object, *, error: bool = False, flush: bool = False) -> None:
    """Print one line.  error : on standard error"""
    print(escape_controls(str(text)), file=sys.stderr if error else sys.stdout, flush=flush)


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
