"""Messages of a DBC, compiled for fast decoding and encoding of signals.

cantools parses the DBC.  Decoding and encoding are our own, for thousands of frames a second; the tests compare both
with cantools.

    little-endian (Intel)     word = data as a little-endian number; the signal begins at bit ``start``
    big-endian (Motorola)     word = data as a big-endian number; ``start`` is the most significant bit, counted
                              in a sawtooth: bit 7 of byte 0 is the first, bit 0 of byte 0 the eighth

A raw value becomes ``raw * factor + offset``.  Its state:

    named      in a value table, of a physical signal (it has a unit, a factor or an offset): a state such as
               "not available", never a number
    outside    below the minimum or above the maximum of the DBC ([0|0]: no limits): not valid
    a float that is not finite: not valid
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import cantools.database
from cantools.database.can.database import Database
from cantools.database.errors import Error

MILLISECOND_NS = 1_000_000
NO_SENDER = "Vector__XXX"
#: Pseudo message in which editors store unused signals.
NO_MESSAGE = "VECTOR__INDEPENDENT_SIG_MSG"
#: Tolerance in steps: a raw value at its limit stays within it after rounding.
ROUNDING = 1e-6
#: Maximum size of a J1939 multi-frame message [B]; a signal has at most as many bits.
MAX_LENGTH = 1785
LENGTH_DIGITS = 9
_LENGTHS = (
    (re.compile(r"BO_\s+\d+\s+(\w+)\s*:\s*(\d+)"), MAX_LENGTH, "length of message"),
    (re.compile(r"SG_\s+(\w+)[^:\n]*:\s*(\d+)\s*\|\s*(\d+)"), 8 * MAX_LENGTH, "place or length of signal"),
)
_FLOATS = {16: struct.Struct(">e"), 32: struct.Struct(">f"), 64: struct.Struct(">d")}

#: Extracts a raw value from the little-endian and the big-endian word of a frame.
Extractor = Callable[[int, int], float]
#: Bits of a raw value in the word of a frame in its byte order.
Inserter = Callable[[float], int]


@dataclass(frozen=True, slots=True, eq=False)
class DbcSignal:
    """One signal of a message.

    low, high  : limits in ``unit``, infinite when the DBC states none; min_raw, max_raw : limits on the wire
    states     : raw value -> its name in the value table
    big        : it is big-endian
    modulus    : number of values before it rolls over, for a counter
    selector   : multiplexer that must have one of ``choices`` for this signal to be in the frame; "" : always
    """

    name: str
    unit: str
    extract: Extractor
    insert: Inserter
    big: bool
    factor: float
    offset: float
    low: float
    high: float
    min_raw: float
    max_raw: float
    is_float: bool
    states: Mapping[float, str]
    selector: str
    choices: frozenset[int]
    modulus: int

    @property
    def is_physical(self) -> bool:
        """Is it a physical signal, so that a named value is not a number?"""
        return bool(self.unit) or (self.factor, self.offset) != (1.0, 0.0)

    def physical(self, raw: float) -> tuple[float | None, bool]:
        """Value in ``unit``, and whether it is valid."""
        if (self.is_float and not math.isfinite(raw)) or (self.states and self.is_physical and raw in self.states):
            return None, False
        value = raw * self.factor + self.offset
        return value, self.low <= value <= self.high

    def raw(self, value: float) -> float:
        """The raw value nearest to a physical one, within the limits of the DBC and of the wire."""
        exact = (min(max(value, self.low), self.high) - self.offset) / self.factor
        raw = exact if self.is_float else round(exact)
        return min(max(raw, self.min_raw), self.max_raw)


@dataclass(slots=True)
class DbcMessage:
    """One message.  cycle_ns : period stated in the DBC [ns]; None if there is none."""

    name: str
    can_id: int
    extended: bool
    length: int
    sender: str
    cycle_ns: int | None
    signals: tuple[DbcSignal, ...]
    message: Any  # cantools' Message; the package has no types that mypy can follow
    selectors: tuple[DbcSignal, ...] = field(init=False)
    _choices: tuple[frozenset[int], ...] = field(init=False)  # of each selector: values that select signals
    _present: dict[tuple[float | None, ...], tuple[DbcSignal, ...]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        named = {s.selector for s in self.signals}
        self.selectors = tuple(s for s in self.signals if s.name in named)
        self._choices = tuple(
            frozenset(c for s in self.signals if s.selector == selector.name for c in s.choices)
            for selector in self.selectors
        )

    def signals_in(self, little: int, big: int) -> tuple[DbcSignal, ...]:
        """The signals in this frame: all, or those selected by its multiplexers."""
        if not self.selectors:
            return self.signals
        return self._case([int(s.extract(little, big)) for s in self.selectors])

    def signals_for(self, selectors: Mapping[str, float]) -> tuple[DbcSignal, ...]:
        """The signals of a frame with these multiplexer values."""
        return self._case([selectors.get(s.name) for s in self.selectors]) if self.selectors else self.signals

    def _case(self, values: Sequence[float | None]) -> tuple[DbcSignal, ...]:
        """The same tuple for the same signals; all values that select nothing are one case."""
        used = tuple([v if v in choices else None for v, choices in zip(values, self._choices, strict=True)])
        signals = self._present.get(used)
        if signals is None:
            by_name = dict(zip((s.name for s in self.selectors), used, strict=True))
            signals = self._present[used] = tuple(s for s in self.signals if self._is_present(s, by_name))
        return signals

    def _is_present(self, signal: DbcSignal, chosen: Mapping[str, float | None]) -> bool:
        if not signal.selector:
            return True
        parent = next(s for s in self.selectors if s.name == signal.selector)
        return chosen[signal.selector] in signal.choices and self._is_present(parent, chosen)


@cache
def read_dbc(text: str) -> Database:
    """The database in the text of a DBC.  Raises ValueError with the error."""
    _check_lengths(text)
    try:
        database = cantools.database.load_string(text, "dbc", strict=False)
    except Error as error:
        reason = str(error).removeprefix('DBC: "').removesuffix('"')
        raise ValueError(f"dbc: {reason}") from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        raise ValueError(f"dbc: cantools cannot read it: {type(error).__name__} {str(error)[:200]}") from None
    assert isinstance(database, Database)
    return database


def _check_lengths(text: str) -> None:
    """Raises ValueError for an impossible length, for which cantools would allocate memory for each bit."""
    for pattern, limit, what in _LENGTHS:
        for name, *numbers in pattern.findall(text):
            if wrong := [n for n in numbers if len(n) > LENGTH_DIGITS or int(n) > limit]:
                raise ValueError(f"dbc: {what} {name[:80]!r}: {wrong[0][:20]}: must be at most {limit}")


@cache
def read_layouts(text: str) -> tuple[DbcMessage, ...]:
    """The messages of a DBC.  Raises ValueError with the error."""
    layouts = tuple(_layout(message) for message in read_dbc(text).messages if message.name != NO_MESSAGE)
    first: dict[tuple[int, bool], str] = {}
    for layout in layouts:
        other = first.setdefault((layout.can_id, layout.extended), layout.name)
        if other != layout.name:
            raise ValueError(f"dbc: messages {other!r} and {layout.name!r} have the same identifier {layout.can_id}")
        _check_multiplexers(layout)
    return layouts


def _check_multiplexers(layout: DbcMessage) -> None:
    """Raises ValueError if a multiplexer is not in its message, or selects itself directly or indirectly."""
    parents = {signal.name: signal.selector for signal in layout.signals}
    for name, selector in parents.items():
        visited, parent = {name}, selector
        while parent:
            if parent in visited or parent not in parents:
                wrong = "selects itself" if parent in visited else "is not in its message"
                raise ValueError(f"dbc: multiplexer {parent!r} of signal {name!r} {wrong}")
            visited.add(parent)
            parent = parents[parent]


def _layout(message: Any) -> DbcMessage:
    if message.cycle_time is not None and not isinstance(message.cycle_time, int):
        raise ValueError(f"dbc: message {message.name!r}: GenMsgCycleTime = {message.cycle_time!r}: must be whole ms")
    return DbcMessage(
        name=message.name,
        can_id=message.frame_id,
        extended=message.is_extended_frame,
        length=message.length,
        sender=next((s for s in message.senders if s != NO_SENDER), ""),
        cycle_ns=message.cycle_time * MILLISECOND_NS if message.cycle_time else None,
        signals=tuple(_signal(s, message.length) for s in message.signals),
        message=message,
    )


def _signal(signal: Any, length: int) -> DbcSignal:
    if _first_bit(signal) + signal.length > 8 * length:
        raise ValueError(f"dbc: signal {signal.name!r} does not fit into the {length} bytes of its message")
    conversion = signal.conversion
    is_float = conversion.is_float
    if signal.length < 1 or (is_float and signal.length not in _FLOATS):
        allowed = f"{', '.join(map(str, _FLOATS))} of a floating-point number" if is_float else "1 or more"
        raise ValueError(f"dbc: signal {signal.name!r} has {signal.length} bits; must be {allowed}")
    if not all(math.isfinite(number) and number != 0.0 for number in (conversion.scale, conversion.offset or 1.0)):
        raise ValueError(
            f"dbc: signal {signal.name!r}: factor {conversion.scale}, offset {conversion.offset}: "
            "must be finite, and the factor not 0"
        )
    min_raw, max_raw = _range(signal.length, signal.is_signed, is_float)
    slack = 0.0 if is_float else ROUNDING * abs(float(conversion.scale))
    return DbcSignal(
        name=signal.name,
        unit=signal.unit or "",
        extract=_extractor(signal, length, is_float),
        insert=_inserter(signal, length, is_float),
        big=signal.byte_order == "big_endian",
        factor=float(conversion.scale),
        offset=float(conversion.offset),
        low=-math.inf if signal.minimum is None else signal.minimum - slack,
        high=math.inf if signal.maximum is None else signal.maximum + slack,
        min_raw=min_raw,
        max_raw=max_raw,
        is_float=is_float,
        states={raw: str(name) for raw, name in (signal.choices or {}).items()},
        selector=signal.multiplexer_signal or "",
        choices=frozenset(signal.multiplexer_ids or ()),
        modulus=_modulus(signal, is_float),
    )


def _modulus(signal: Any, is_float: bool) -> int:
    """Number of values as a counter: 2^length, or maximum + 1 if it is smaller (0 to 14)."""
    plain = not is_float and (signal.conversion.scale, signal.conversion.offset) == (1, 0)
    count = int(signal.maximum) + 1 if plain and signal.maximum else 0
    return count if 1 < count < 1 << signal.length else 1 << signal.length


def _range(bits: int, signed: bool, is_float: bool) -> tuple[float, float]:
    if is_float:
        return -math.inf, math.inf
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)


def _extractor(signal: Any, length: int, is_float: bool) -> Extractor:
    bits, first = signal.length, _first_bit(signal)
    mask, sign = (1 << bits) - 1, (1 << bits - 1) * signal.is_signed
    if signal.byte_order == "big_endian":
        return _float_extractor(_big_endian_extractor(8 * length - first - bits, mask, sign), bits, is_float)
    return _float_extractor(_little_endian_extractor(first, mask, sign), bits, is_float)


def _first_bit(signal: Any) -> int:
    """First bit of the signal, counted in its own byte order."""
    start: int = signal.start
    return start - start % 8 + 7 - start % 8 if signal.byte_order == "big_endian" else start


def _little_endian_extractor(shift: int, mask: int, sign: int) -> Callable[[int, int], int]:
    if sign:
        return lambda little, _: ((little >> shift & mask) ^ sign) - sign
    return lambda little, _: little >> shift & mask


def _big_endian_extractor(shift: int, mask: int, sign: int) -> Callable[[int, int], int]:
    if sign:
        return lambda _, big: ((big >> shift & mask) ^ sign) - sign
    return lambda _, big: big >> shift & mask


def _inserter(signal: Any, length: int, is_float: bool) -> Inserter:
    """The inverse of ``_extractor``."""
    bits, first = signal.length, _first_bit(signal)
    shift = 8 * length - first - bits if signal.byte_order == "big_endian" else first
    if is_float:
        pack = _FLOATS[bits].pack
        return lambda raw: int.from_bytes(pack(raw), "big") << shift
    mask = (1 << bits) - 1
    return lambda raw: (int(raw) & mask) << shift


def _float_extractor(extract: Callable[[int, int], int], bits: int, is_float: bool) -> Extractor:
    if not is_float:
        return extract
    unpack, mask = _FLOATS[bits].unpack, (1 << bits) - 1
    return lambda little, big: float(unpack((extract(little, big) & mask).to_bytes(bits // 8, "big"))[0])
