"""How the signals of a DBC become measurements: a quantity by its name, any other a reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fti.drivers._dbc import Signal
from fti.drivers._quantities import QUANTITIES, to_si
from fti.drivers._quick import quick_reading
from fti.types import Measurement, Reading, Stamp

#: Makes the measurement of one signal from the two words of a frame.
Maker = Callable[[Stamp, int, int], Measurement | None]


def quantity_scale(signal: Signal) -> tuple[float, float] | None:
    """Factor and offset from the signal's unit to SI; None when it is no quantity, or its unit does not measure it."""
    if signal.name not in QUANTITIES:
        return None
    try:
        return to_si(signal.name, signal.unit)
    except ValueError:
        return None


def maker_of(message: str, signal: Signal) -> Maker:
    """How the signal becomes a measurement."""
    scale = quantity_scale(signal)
    if scale is not None:
        return _quantity_maker(signal, *scale)
    return _reading_maker(f"{message}.{signal.name}", signal)


def _quantity_maker(signal: Signal, factor: float, offset: float) -> Maker:
    cut, physical, quantity = signal.cut, signal.physical, QUANTITIES[signal.name]
    make = quantity.maker()

    def made(stamp: Stamp, little: int, big: int) -> Measurement | None:
        value, valid = physical(cut(little, big))
        if value is None:
            return quantity.make(stamp, None, valid)
        return make(stamp, value * factor + offset, valid)

    return made


def _reading_maker(name: str, signal: Signal) -> Maker:
    if signal.is_float:
        return _float_maker(name, signal)
    if signal.states:
        return _state_maker(name, signal)
    cut, unit, factor, offset = signal.cut, signal.unit, signal.factor, signal.offset
    low, high = signal.low, signal.high

    def made(stamp: Stamp, little: int, big: int) -> Reading:
        value = cut(little, big) * factor + offset
        return quick_reading(stamp, name, value, unit, low <= value <= high)

    return made


def _state_maker(name: str, signal: Signal) -> Maker:
    cut, unit, names, measures = signal.cut, signal.unit, signal.states, signal.measures
    numbers = _reading_maker(name, replace(signal, states={}))

    def made(stamp: Stamp, little: int, big: int) -> Measurement | None:
        raw = cut(little, big)
        if raw not in names:
            return numbers(stamp, little, big)
        value, valid = (None, False) if measures else (float(raw), True)
        return quick_reading(stamp, name, value, unit, valid, text=names[raw])

    return made


def _float_maker(name: str, signal: Signal) -> Maker:
    cut, unit, physical, names = signal.cut, signal.unit, signal.physical, signal.states

    def made(stamp: Stamp, little: int, big: int) -> Reading:
        raw = cut(little, big)
        value, valid = physical(raw)
        return quick_reading(stamp, name, value, unit, valid, text=names.get(raw, ""))

    return made
