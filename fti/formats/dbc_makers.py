"""Conversion of DBC signals to measurements: a quantity by its name, any other signal to a reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from fti.formats.dbc_messages import DbcSignal
from fti.formats.quantities import QUANTITIES, to_si
from fti.messages.measurements import Measurement, Reading, Stamp

#: Makes the measurement of one signal from the two words of a frame.
Maker = Callable[[Stamp, int, int], Measurement | None]


def quantity_scale(signal: DbcSignal) -> tuple[float, float] | None:
    """Factor and offset from the signal's unit to SI; None if it is not a quantity, or its unit does not match."""
    if signal.name not in QUANTITIES:
        return None
    try:
        return to_si(signal.name, signal.unit)
    except ValueError:
        return None


def maker_of(message: str, signal: DbcSignal) -> Maker:
    """The function that converts the signal to a measurement."""
    scale = quantity_scale(signal)
    if scale is not None:
        return _quantity_maker(signal, *scale)
    return _reading_maker(f"{message}.{signal.name}", signal)


def _quantity_maker(signal: DbcSignal, factor: float, offset: float) -> Maker:
    extract, physical, quantity = signal.extract, signal.physical, QUANTITIES[signal.name]
    make = quantity.maker()

    def convert(stamp: Stamp, little: int, big: int) -> Measurement | None:
        value, valid = physical(extract(little, big))
        if value is None:
            return quantity.make(stamp, None, valid)
        return make(stamp, value * factor + offset, valid)

    return convert


def _reading_maker(name: str, signal: DbcSignal) -> Maker:
    if signal.is_float:
        return _float_maker(name, signal)
    if signal.states:
        return _state_maker(name, signal)
    extract, unit, factor, offset = signal.extract, signal.unit, signal.factor, signal.offset
    low, high = signal.low, signal.high

    def convert(stamp: Stamp, little: int, big: int) -> Reading:
        value = extract(little, big) * factor + offset
        return Reading(stamp=stamp, name=name, value=value, unit=unit, valid=low <= value <= high)

    return convert


def _state_maker(name: str, signal: DbcSignal) -> Maker:
    extract, unit, names, is_physical = signal.extract, signal.unit, signal.states, signal.is_physical
    numbers = _reading_maker(name, replace(signal, states={}))

    def convert(stamp: Stamp, little: int, big: int) -> Measurement | None:
        raw = extract(little, big)
        if raw not in names:
            return numbers(stamp, little, big)
        value, valid = (None, False) if is_physical else (float(raw), True)
        return Reading(stamp=stamp, name=name, value=value, unit=unit, valid=valid, text=names[raw])

    return convert


def _float_maker(name: str, signal: DbcSignal) -> Maker:
    extract, unit, physical, names = signal.extract, signal.unit, signal.physical, signal.states

    def convert(stamp: Stamp, little: int, big: int) -> Reading:
        raw = extract(little, big)
        value, valid = physical(raw)
        return Reading(stamp=stamp, name=name, value=value, unit=unit, valid=valid, text=names.get(raw, ""))

    return convert
