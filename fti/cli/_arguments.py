"""Argument types that several commands share; each rejects a value out of range with one sentence."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path


def seconds(text: str) -> float:
    """A time [s], 0 or more."""
    value = _number(text)
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be 0 or more seconds")
    return value


def factor(text: str) -> float:
    """A factor above 0."""
    value = _number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: must be more than 0")
    return value


def count(text: str) -> int:
    """A whole number, 1 or more."""
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: must be a whole number, 1 or more")
    return int(text)


def new_file(*suffixes: str) -> Callable[[str], Path]:
    """A file that does not exist yet, with one of the suffixes; none : any."""

    def parse(text: str) -> Path:
        path = Path(text)
        if suffixes and path.suffix not in suffixes:
            raise argparse.ArgumentTypeError(f"{text}: must end with {' or '.join(suffixes)}")
        if path.exists():
            raise argparse.ArgumentTypeError(f"{text}: already exists; choose another name")
        return path

    return parse


picture = new_file(".png", ".svg")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: must be a number") from None
