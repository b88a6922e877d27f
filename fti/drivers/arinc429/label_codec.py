"""Codecs of labels: conversion between words and measurements, one class per kind of word.

Sign/status: normal is valid; failure, no computed data and test are not valid, and the first two have no value.  Each
state other than normal also gives a DeviceStatus with the flag <name>_<state>.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple, Protocol

from msgspec import structs

from fti.constants import FOOT
from fti.drivers.arinc429 import word as wire
from fti.drivers.arinc429.labels import EQUIPMENT_LABEL, Label, LabelSet
from fti.drivers.arinc429.word import BcdState, BnrState, DiscreteState
from fti.formats.quantities import DIMENSIONS, QUANTITIES, UNITS, Quantity
from fti.messages.measurements import DeviceStatus, Measurement, RadioHeight, Reading, Stamp
from fti.ranging.radar.quantise import quantisation_step_ft, quantise_ft

Decode = Callable[[int, Stamp], list[Measurement]]
#: A class of measurements, or the name of a Reading.
SourceKey = type[Any] | str
NOT_NORMAL = {
    "bnr": {0: "failure", 1: "no_computed_data", 2: "functional_test"},
    "bcd": {1: "no_computed_data", 2: "functional_test"},
    "discrete": {1: "no_computed_data", 2: "functional_test", 3: "failure"},
}
NO_VALUE = ("failure", "no_computed_data", "bad_digit")


class Handler(NamedTuple):
    """Decoder of the words of one label.  sdi : only of this source; name : of its counter."""

    label: str
    sdi: int | None
    name: str
    decode: Decode


def source_key(measurement: Measurement) -> SourceKey:
    """Key of a measurement among the sources."""
    return measurement.name if isinstance(measurement, Reading) else type(measurement)


class LabelCodec(Protocol):
    """Codec of one entry of a label set.  Each decoder and encoder has its own: it may be stateful."""

    def handlers(self) -> Sequence[Handler]:
        """One handler for each label."""

    def sources(self) -> Collection[SourceKey]:
        """Measurements that ``encode`` may convert; it is called only for these."""

    def encode(self, measurement: Measurement) -> list[int]:
        """The words of a measurement, with odd parity; empty if it carries nothing of this entry."""


def _status(stamp: Stamp, name: str, cause: str) -> DeviceStatus:
    return DeviceStatus(stamp=stamp, ok=False, flags=(f"{name}_{cause}",))


def _quantity(label: Label) -> tuple[Quantity, float, float]:
    """Quantity of a label, factor and offset to SI; a reading in an unknown unit keeps it."""
    if label.quantity:
        return QUANTITIES[label.quantity], *UNITS[label.unit]
    si = next((group[0] for group in DIMENSIONS if label.unit in group), label.unit)
    quantity = Quantity(Reading, "value", si, constant=(("name", label.reading), ("unit", si)))
    return quantity, *UNITS.get(label.unit, (1.0, 0.0))


class NumberLabel:
    """A BNR or BCD word."""

    def __init__(self, label: Label) -> None:
        self.label = label
        self.name = label.quantity or label.reading
        self.quantity, factor, self._offset = _quantity(label)
        self._factor = factor * label.sign
        self._make = self.quantity.maker()
        self.turns = label.kind == "bnr" and label.unit == "deg" and label.range == 180.0
        self._scale, self._bits = label.range or 1.0, label.bits or 1
        self._resolution = label.resolution or 1.0

    def handlers(self) -> Sequence[Handler]:
        return [Handler(self.label.label, self.label.sdi, self.name, self.decode)]

    def decode(self, word: int, stamp: Stamp) -> list[Measurement]:
        """The measurement of a word, and a status if its state is not normal."""
        bcd = self.label.kind == "bcd"
        value = wire.decode_bcd(word, self._resolution) if bcd else wire.decode_bnr(word, self._scale, self._bits)
        cause = "bad_digit" if value is None else NOT_NORMAL[self.label.kind].get(wire.ssm(word), "")
        return self.to_measurement(None if cause in NO_VALUE else value, cause, stamp)

    def to_measurement(self, value: float | None, cause: str, stamp: Stamp) -> list[Measurement]:
        """value : in the unit of the wire; cause : why it is not normal."""
        si = None if value is None else value * self._factor + self._offset
        measurement = self.quantity.make(stamp, None, valid=False) if si is None else self._make(stamp, si, not cause)
        if self.label.steps and si is not None and isinstance(measurement, RadioHeight):
            sd = quantisation_step_ft(round(si / FOOT, 6)) * FOOT / math.sqrt(12)
            measurement = structs.replace(measurement, sd=sd)
        status = [_status(stamp, self.name, cause)] if cause else []
        return [measurement, *status] if measurement else [*status]

    def sources(self) -> Collection[SourceKey]:
        return [self.label.reading if self.quantity.measurement is Reading else self.quantity.measurement]

    def encode(self, measurement: Measurement) -> list[int]:
        value_and_state = self.value_and_state(measurement)
        return [] if value_and_state is None else [self._word(*value_and_state)]

    def value_and_state(self, measurement: Measurement) -> tuple[float, BnrState] | None:
        """Value in the unit of the wire and state; None if the measurement does not carry this label."""
        value = self.quantity.pick(measurement)
        if value is None:
            return (0.0, BnrState.NO_COMPUTED_DATA) if self.quantity.is_empty(measurement) else None
        if self.label.steps:
            value = quantise_ft(value / FOOT) * FOOT
        valid = getattr(measurement, "valid", True)
        return (value - self._offset) / self._factor, BnrState.NORMAL if valid else BnrState.FUNCTIONAL_TEST

    def _word(self, value: float, state: BnrState) -> int:
        at, sdi = self.label, self.label.sdi or 0
        if at.kind == "bcd":
            bcd = BcdState.PLUS if state is BnrState.NORMAL else BcdState(state)
            return wire.encode_bcd(at.label, value, self._resolution, state=bcd, sdi=sdi)
        return wire.encode_bnr(at.label, value, self._scale, self._bits, state=state, sdi=sdi, turns=self.turns)


class FineNumberLabel:
    """A BNR number in two words: the fine word follows the coarse one and extends it below its last bit.

    The coarse word alone gives no measurement.  Both are one two's complement number, so the fine part is never
    negative (ARINC 743A, labels 110 and 120).  A fine word later than MAX_SEPARATION_NS belongs to another coarse
    word, which was lost or follows: combining them would give an error of up to 19 m.
    """

    MAX_SEPARATION_NS = 100_000_000

    def __init__(self, label: Label, fine_label: str) -> None:
        self._coarse = NumberLabel(label)
        self._fine_label, self._name = fine_label, f"{self._coarse.name}_fine"
        self._bits, self._fine_bits = label.bits or 1, label.fine_bits
        self._scale = label.range or 1.0
        self._last: tuple[int, Stamp] | None = None

    def handlers(self) -> Sequence[Handler]:
        coarse = self._coarse.label
        return [
            Handler(coarse.label, coarse.sdi, self._coarse.name, self._decode_coarse),
            Handler(self._fine_label, coarse.sdi, self._name, self._decode_fine),
        ]

    def _decode_coarse(self, word: int, stamp: Stamp) -> list[Measurement]:
        if wire.ssm(word) != BnrState.NORMAL:
            self._last = None
            return self._coarse.decode(word, stamp)
        self._last = (wire.decode_steps(word, self._bits), stamp)
        return []

    def _decode_fine(self, word: int, stamp: Stamp) -> list[Measurement]:
        last, self._last = self._last, None
        if cause := NOT_NORMAL["bnr"].get(wire.ssm(word), ""):
            return [_status(stamp, self._name, cause)]
        if last is None:
            return []
        coarse, at = last
        if _separation_ns(at, stamp) > self.MAX_SEPARATION_NS:
            return [_status(stamp, self._name, "too_late")]
        fine = wire.decode_steps(word, self._fine_bits) & ((1 << self._fine_bits) - 1)
        steps = (coarse << self._fine_bits) + fine
        return self._coarse.to_measurement(steps * self._scale / (1 << (self._bits + self._fine_bits)), "", at)

    def sources(self) -> Collection[SourceKey]:
        return self._coarse.sources()

    def encode(self, measurement: Measurement) -> list[int]:
        value_and_state = self._coarse.value_and_state(measurement)
        if value_and_state is None:
            return []
        value, state = value_and_state
        steps = wire.to_steps(value, self._scale, self._bits + self._fine_bits, turns=self._coarse.turns)
        coarse, fine = divmod(steps, 1 << self._fine_bits)
        label, sdi = self._coarse.label.label, self._coarse.label.sdi or 0
        return [
            wire.encode_steps(label, coarse, self._bits, state=state, sdi=sdi),
            wire.encode_steps(self._fine_label, fine, self._fine_bits, state=state, sdi=sdi),
        ]


def _separation_ns(first: Stamp, second: Stamp) -> int:
    """Time between two words [ns], by the clock of the converter if available."""
    if first.t_dev_ns is None or second.t_dev_ns is None:
        return second.t_rx_ns - first.t_rx_ns
    return second.t_dev_ns - first.t_dev_ns


class DiscreteLabel:
    """A word of single bits and small numbers: a Reading for each field, then one DeviceStatus for the flags.

    The encoder keeps the fields, and sends the word with the DeviceStatus; without flags, with the last field.
    """

    def __init__(self, label: Label) -> None:
        self.label = label
        self._state = DiscreteState.NORMAL
        self._bits = dict.fromkeys(label.fields, 0)

    def handlers(self) -> Sequence[Handler]:
        return [Handler(self.label.label, self.label.sdi, self.label.name, self.decode)]

    def decode(self, word: int, stamp: Stamp) -> list[Measurement]:
        """A Reading for each field; a DeviceStatus if there are flags or the state is not normal."""
        at = self.label
        cause = NOT_NORMAL["discrete"].get(wire.ssm(word), "")
        measurements: list[Measurement] = []
        for name, bits in at.fields.items():
            value = None if cause in NO_VALUE else float(wire.decode_field(word, *bits))
            measurements.append(Reading(stamp=stamp, name=name, value=value, valid=not cause))
        if not at.flags and not cause:
            return measurements
        set_flags = () if cause in NO_VALUE else tuple(name for name, bit in at.flags.items() if word >> bit - 1 & 1)
        flags = (*set_flags, f"{at.name}_{cause}") if cause else set_flags
        ok = not cause and not set(flags).intersection(at.not_ok)
        return [*measurements, DeviceStatus(stamp=stamp, ok=ok, flags=flags)]

    def sources(self) -> Collection[SourceKey]:
        return [*self.label.fields, *([DeviceStatus] if self.label.flags else [])]

    def encode(self, measurement: Measurement) -> list[int]:
        at = self.label
        if isinstance(measurement, Reading) and measurement.name in at.fields:
            self._bits[measurement.name] = round(measurement.value or 0.0)
            invalid = DiscreteState.NO_COMPUTED_DATA if measurement.value is None else DiscreteState.FUNCTIONAL_TEST
            self._state = DiscreteState.NORMAL if measurement.valid else invalid
            return [] if at.flags or measurement.name != [*at.fields][-1] else [self._word(())]
        if isinstance(measurement, DeviceStatus) and at.flags:
            return self._encode_flags(measurement.flags)
        return []

    def _encode_flags(self, flags: tuple[str, ...]) -> list[int]:
        """The word; none if the status has only flags of other words."""
        states = {f"{self.label.name}_{cause}": code for code, cause in NOT_NORMAL["discrete"].items()}
        if flags and not set(flags).intersection({*self.label.flags, *states}):
            return []
        state = next((states[flag] for flag in flags if flag in states), DiscreteState.NORMAL)
        self._state = DiscreteState(state)
        return [self._word(flags)]

    def _word(self, flags: tuple[str, ...]) -> int:
        at = self.label
        data = sum(1 << bit - 1 for name, bit in at.flags.items() if name in flags)
        data |= sum(wire.encode_field(self._bits[name], *bits) for name, bits in at.fields.items())
        return wire.encode_discrete(at.label, data, state=self._state, sdi=at.sdi or 0)


class EquipmentLabel:
    """Label 377: equipment identifier, three hexadecimal digits in bits 22-11.  Another one than expected is not ok."""

    NAME = "equipment_id"
    LOW, HIGH = 11, 22

    def __init__(self, expected: str) -> None:
        self._expected = int(expected, 16)

    def handlers(self) -> Sequence[Handler]:
        return [Handler(EQUIPMENT_LABEL, None, self.NAME, self.decode)]

    def decode(self, word: int, stamp: Stamp) -> list[Measurement]:
        """The identifier, and a status if it differs from that of the label set."""
        number = wire.decode_field(word, self.LOW, self.HIGH)
        measurements: list[Measurement] = [Reading(stamp=stamp, name=self.NAME, value=float(number))]
        if number != self._expected:
            flag = f"equipment_{number:03X}_instead_of_{self._expected:03X}"
            measurements.append(DeviceStatus(stamp=stamp, ok=False, flags=(flag,)))
        return measurements

    def sources(self) -> Collection[SourceKey]:
        return [self.NAME]

    def encode(self, measurement: Measurement) -> list[int]:
        if not isinstance(measurement, Reading) or measurement.name != self.NAME:
            return []
        data = wire.encode_field(round(measurement.value or 0.0), self.LOW, self.HIGH)
        return [wire.encode_discrete(EQUIPMENT_LABEL, data, state=DiscreteState.NORMAL)]


def make_codecs(label_set: LabelSet) -> list[LabelCodec]:
    """Codecs of a set and its identifier.  Raises ValueError without labels, or for a label that occurs twice."""
    codecs = [_make_codec(label) for label in label_set.labels]
    if not codecs:
        raise ValueError("labels: none enabled; configure labels or a set")
    keys = [(handler.label, handler.sdi) for entry in codecs for handler in entry.handlers()]
    if twice := [label for label, sdi in keys if keys.count((label, sdi)) > 1]:
        raise ValueError(f"labels: {twice[0]} occurs twice with the same sdi")
    if label_set.equipment is not None and EQUIPMENT_LABEL not in {label for label, _ in keys}:
        codecs.append(EquipmentLabel(label_set.equipment))
    return codecs


def _make_codec(label: Label) -> LabelCodec:
    if label.kind == "discrete":
        return DiscreteLabel(label)
    return FineNumberLabel(label, label.fine_label) if label.fine_label else NumberLabel(label)
