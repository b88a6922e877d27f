"""Argument types that several commands share; each rejects a value out of range with one sentence."""

from __future__ import annotations

import argparse
import math
import re
import sys
from collections.abc import Callable
from pathlib import Path

MIN_POSITIVE, MAX_FINITE = math.ulp(0.0), sys.float_info.max


def number(low: float, high: float, allowed: str) -> Callable[[str], float]:
    """The type of a number in [low, high].  allowed : the allowed values as text"""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text!r}: must be {allowed}")
        return value

    return parse


def whole_number(low: int, high: int | None = None) -> Callable[[str], int]:
    """The type of a whole number from low to high, or without upper limit."""

    def parse(text: str) -> int:
        if not text.isascii() or not text.isdigit() or int(text) < low or (high is not None and int(text) > high):
            allowed = f", {low} or more" if high is None else f" from {low} to {high}"
            raise argparse.ArgumentTypeError(f"{text!r}: must be a whole number{allowed}")
        return int(text)

    return parse


def session_name(text: str) -> str:
    """The type of a session name."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", text):
        raise argparse.ArgumentTypeError(f"{text!r}: must be lower-case letters, digits and _, a letter first")
    return text


seconds = number(0.0, MAX_FINITE, "0 or more seconds")
factor = number(MIN_POSITIVE, MAX_FINITE, "a number above 0")


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
