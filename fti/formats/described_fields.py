"""Fields that the configuration describes: conversion between wire values and measurements.

    value = number * scale + offset        [unit]

A field with the name of a quantity of ``quantities`` (or with one in ``quantity``) becomes the measurement that carries
it, in SI; any other name becomes a ``Reading`` in its unit.  A field whose name begins with "_" is ignored.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

import pydantic

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key
from fti.formats.quantities import QUANTITIES, Quantity, to_si
from fti.messages.measurements import DmeRange, Measurement, Range, Reading, Stamp, StaticPressure, Temperature

WireValue = float | str | None  # value of a field: a number, text, or none
#: Wire value of a word of ``lost`` or ``good``; ValueError if the field cannot carry it.
ToWire = Callable[[str, float | str], float | str]
#: Slant ranges, absolute pressures and temperatures: negative values are not valid.
NON_NEGATIVE = frozenset({Range, DmeRange, StaticPressure, Temperature})
FieldName = Annotated[str, pydantic.Field(pattern=r"^(_?[a-z][a-z0-9_]*|_)$", max_length=64)]


class Field(StrictModel):
    """Meaning of a field of a line or of a frame: value = number x scale + offset, in ``unit``."""

    name: Annotated[
        FieldName,
        key(
            "name of a quantity, or any other name for a reading; with _ at the beginning the field is only checked",
            NO_UNIT,
            "slant_range",
        ),
    ]
    quantity: Annotated[
        str, key("quantity of the value, where its name is not one, as with two static pressures", NO_UNIT)
    ] = ""
    unit: Annotated[str, key("unit of the value; empty: SI; of a reading any word", NO_UNIT)] = ""
    scale: Annotated[float, key("factor of the number", "unit per digit")] = 1.0
    offset: Annotated[float, key("added after the multiplication with scale", "unit")] = 0.0
    lost: Annotated[
        tuple[float | str, ...],
        key("values without a measurement: numbers as sent, before scale, or texts", NO_UNIT, [0.0]),
    ] = ()
    limits: Annotated[
        tuple[float, float] | None, key("smallest and largest valid value; none: no limits", "unit", [0.0, 500.0])
    ] = None
    good: Annotated[
        tuple[float | str, ...],
        key("required values, numbers as sent or texts; all others are not valid; empty: every value", NO_UNIT),
    ] = ()
    needs: Annotated[
        tuple[str, ...], key("other fields that must be valid for this one to be valid, with their own needs", NO_UNIT)
    ] = ()


@dataclass(frozen=True, slots=True)
class FieldCodec:
    """Codec of a field: value [unit] = number * scale + offset, SI = value * factor + shift."""

    field: Field
    quantity: Quantity | None
    factor: float
    shift: float

    @property
    def is_ignored(self) -> bool:
        """Does the field give no measurement?"""
        return self.field.name.startswith("_")

    def is_valid(self, wire: WireValue) -> bool:
        """Is the value valid, without regard to other fields?"""
        f = self.field
        if wire is None or wire in f.lost or (f.good and wire not in f.good):
            return False
        if isinstance(wire, str):
            return self.quantity is None
        value = wire * f.scale + f.offset
        if self.quantity is None or self.quantity.measurement not in NON_NEGATIVE:
            is_possible = math.isfinite(value)
        else:
            is_possible = 0.0 <= value * self.factor + self.shift < math.inf
        return is_possible and (f.limits is None or f.limits[0] <= value <= f.limits[1])

    def measurement(self, wire: WireValue, valid: bool, stamp: Stamp) -> Measurement | None:
        """The measurement of the field; None if the class needs a value and there is none."""
        value = wire * self.field.scale + self.field.offset if valid and isinstance(wire, float) else None
        if self.quantity is not None:
            si = None if value is None else value * self.factor + self.shift
            return self.quantity.make(stamp, si, valid)
        text = wire if valid and isinstance(wire, str) else ""
        return Reading(stamp=stamp, name=self.field.name, value=value, unit=self.field.unit, valid=valid, text=text)

    def wire(self, measurement: Measurement) -> tuple[bool, WireValue]:
        """Does a measurement carry this field, and its wire value; None: the device cannot express it."""
        carried = self._carried_value(measurement)
        if carried is None:
            return False, None
        valid, value = carried
        if not valid or value is None:
            return True, self.field.lost[0] if self.field.lost else None
        if isinstance(value, str):
            return True, value
        if not math.isfinite(value):
            return True, None
        unit = (value - self.shift) / self.factor
        return True, (unit - self.field.offset) / self.field.scale

    def _carried_value(self, measurement: Measurement) -> tuple[bool, float | str | None] | None:
        valid = getattr(measurement, "valid", True)
        if self.quantity is not None:
            value = self.quantity.pick(measurement)
            return (valid, value) if value is not None or self.quantity.is_empty(measurement) else None
        if isinstance(measurement, Reading) and measurement.name == self.field.name:
            return valid, measurement.text or None if measurement.value is None else measurement.value
        return None

    def default(self) -> WireValue:
        """Wire value without a measurement: a good one."""
        return self.field.good[0] if self.field.good else None


def make_field_codecs(names: Sequence[str], described: Sequence[Field], to_wire: ToWire) -> dict[str, FieldCodec]:
    """The field codecs of a message, in its order.  Raises ValueError with the wrong field and the allowed values."""
    by_name = {f.name: f for f in described}
    for f in described:
        if f.name not in names:
            raise ValueError(f"fields: {f.name!r} is not in the message; there are {', '.join(names)}")
        for needed in f.needs:
            if needed not in names:
                raise ValueError(f"fields: {f.name}: needs {needed!r}, which is not in the message")
        if sum(other.name == f.name for other in described) > 1:
            raise ValueError(f"fields: {f.name!r} is described twice")
    codecs = {
        name: _make_field_codec(_with_wire_words(by_name.get(name) or Field(name=name), by_name, to_wire))
        for name in names
    }
    if all(m.is_ignored for m in codecs.values()):
        raise ValueError("fields: none becomes a measurement; a name without '_' at its beginning does")
    return codecs


def _with_wire_words(described: Field, by_name: Mapping[str, Field], to_wire: ToWire) -> Field:
    """The field with decoded words, and with all its needed fields, also indirect ones."""

    def read(key: str, words: Sequence[float | str]) -> tuple[float | str, ...]:
        try:
            return tuple(to_wire(described.name, word) for word in words)
        except ValueError as error:
            raise ValueError(f"fields: {described.name}: {key}: {error}") from None

    needed: list[str] = []
    waiting = list(described.needs)
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.append(name)
            waiting += by_name[name].needs if name in by_name else ()
    read_words = {"lost": read("lost", described.lost), "good": read("good", described.good)}
    return described.model_copy(update={**read_words, "needs": tuple(needed)})


def _make_field_codec(described: Field) -> FieldCodec:
    name = described.quantity or described.name
    if described.quantity and described.quantity not in QUANTITIES:
        known = ", ".join(QUANTITIES)
        raise ValueError(f"fields: {described.name}: quantity {described.quantity!r}; there are {known}")
    if described.scale == 0.0:
        raise ValueError(f"fields: {described.name}: scale = 0; must not be 0")
    if described.limits and not described.limits[0] < described.limits[1]:
        raise ValueError(f"fields: {described.name}: limits = {list(described.limits)}; the first must be below")
    if name not in QUANTITIES:
        return FieldCodec(described, None, 1.0, 0.0)
    try:
        factor, shift = to_si(name, described.unit or QUANTITIES[name].unit)
    except ValueError as error:
        where = f"fields: {described.name}: " if described.quantity else "fields: "
        raise ValueError(f"{where}{error}") from None
    return FieldCodec(described, QUANTITIES[name], factor, shift)


def decode_fields(codecs: Mapping[str, FieldCodec], wires: Mapping[str, WireValue], stamp: Stamp) -> list[Measurement]:
    """The measurements of one message.  wires : values of its fields; a missing field has no value."""
    good = {name: codec.is_valid(wires.get(name)) for name, codec in codecs.items()}
    measurements = []
    for name, codec in codecs.items():
        if codec.is_ignored:
            continue
        valid = good[name] and all(good[needed] for needed in codec.field.needs)
        measurement = codec.measurement(wires.get(name), valid, stamp)
        if measurement is not None:
            measurements.append(measurement)
    return measurements


@dataclass(slots=True)
class FieldCollector:
    """The emulator's side: collects values from measurements until every field of a message is new."""

    codecs: Mapping[str, FieldCodec]
    _values: dict[str, WireValue] = field(default_factory=dict)
    _texts: dict[str, WireValue] = field(default_factory=dict)

    def add(self, measurement: Measurement, is_text: Mapping[str, bool]) -> dict[str, WireValue] | None:
        """The values of the message if this one completes it; None if incomplete or not expressible."""
        for name, codec in self.codecs.items():
            is_carried, wire = (False, None) if codec.is_ignored else codec.wire(measurement)
            if is_carried:
                (self._texts if is_text[name] else self._values)[name] = wire
        required = [n for n, m in self.codecs.items() if not m.is_ignored and not is_text[n]]
        if any(name not in self._values for name in required):
            return None
        values, self._values = self._values, {}
        if any(wire is None for wire in values.values()):
            return None
        return {n: values.get(n, self._texts.get(n, m.default())) for n, m in self.codecs.items()}
