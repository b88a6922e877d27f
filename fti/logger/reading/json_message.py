"""Parser of JSON messages within the limits; one sentence for messages that cannot be used."""

from __future__ import annotations

import json
import re
from types import TracebackType
from typing import Any

import orjson

from fti.errors import RecordingError
from fti.logger.reading.limits import MAX_DIGITS, MAX_JSON_BYTES, MAX_JSON_DEPTH, LimitError

_BRACKETS = b"[]{}"
_NO_BRACKETS = bytes(set(range(256)) - set(_BRACKETS))
_CLOSING = b"]}"
#: Twenty digits in a row: an integer beyond 64 bits would become a float.
_DIGITS_AS_ZEROS = bytes.maketrans(b"123456789", b"0" * 9)
_LONG_NUMBER = b"0" * 20
_TEXT = re.compile(rb'"(?:[^"\\]|\\[\s\S])*+"')
#: Exceptions that the use of a foreign or damaged message can raise.
FAULTS = (KeyError, TypeError, AttributeError, ValueError, IndexError, OverflowError, RecursionError)


def parse_json(data: bytes) -> Any:
    """Parse a JSON text.  Raises ValueError, and LimitError beyond a limit.

    Half of a surrogate pair becomes "?", because it cannot be encoded.  The name of a file may have one.
    """
    if len(data) > MAX_JSON_BYTES:
        raise LimitError(f"JSON of {len(data)} bytes; at most {MAX_JSON_BYTES} are read")
    if data.count(b"[") + data.count(b"{") > MAX_JSON_DEPTH and _depth(data) > MAX_JSON_DEPTH:
        raise LimitError(f"JSON is nested deeper than {MAX_JSON_DEPTH}")
    if _LONG_NUMBER not in data.translate(_DIGITS_AS_ZEROS):
        try:
            return orjson.loads(data)
        except orjson.JSONDecodeError:  # it may still be what the slower parser accepts: NaN, half a surrogate pair
            pass
    value = _DECODER.decode(data.decode())
    return _without_halves(value) if b"\\ud" in data or b"\\uD" in data else value


def _without_halves(value: Any) -> Any:
    text = json.dumps(value, ensure_ascii=False)
    written = text.encode("utf-8", "replace")
    return value if written.decode() == text else _DECODER.decode(written.decode())


def parse_table(data: bytes) -> dict[str, Any]:
    """Parse a text that must be a JSON object.  Raises ValueError."""
    value = parse_json(data)
    if not isinstance(value, dict):
        raise ValueError("it is not a JSON object")
    return value


class using_message:  # noqa: N801  used as a function
    """Context that converts faults of a recorded message to a RecordingError with its topic and time [ns]."""

    __slots__ = ("_t_ns", "_topic")

    def __init__(self, topic: str, t_ns: int) -> None:
        self._topic, self._t_ns = topic, t_ns

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, KeyError):
            raise RecordingError(f"{self._topic}: the message at {self._t_ns} ns has no {error}") from None
        if isinstance(error, FAULTS):
            raise RecordingError(f"{self._topic}: the message at {self._t_ns} ns cannot be used: {error}") from None


def whole_number(value: Any) -> int:
    """An integer of 64 bits.  Raises ValueError for everything else."""
    if type(value) is not int or not -(2**63) <= value < 2**63:
        raise ValueError(f"{str(value)[:40]!r} is not a whole number of 64 bits")
    return value


def _depth(data: bytes) -> int:
    depth = deepest = 0
    for bracket in _TEXT.sub(b"", data).translate(None, _NO_BRACKETS):
        if bracket in _CLOSING:
            depth -= 1
        else:
            depth += 1
            deepest = max(deepest, depth)
    return deepest


def _whole(text: str) -> int:
    if len(text) > MAX_DIGITS + 1:
        raise LimitError(f"a number of {len(text)} digits; at most {MAX_DIGITS} are read")
    return int(text)


_DECODER = json.JSONDecoder(parse_int=_whole)
