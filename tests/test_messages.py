"""The messages: frozen, closed, without numbers for "unknown"."""

from __future__ import annotations

import enum
import inspect
import types
import typing

import pytest
from msgspec import structs

from fti.messages import frames, measurements, outputs, reasons
from fti.messages.frames import LinkState, RawFrame
from fti.messages.measurements import Attitude, Measurement, RadioHeight, Stamp
from fti.messages.outputs import Output
from fti.messages.reasons import Reason
from fti.messages.tables import Message
from fti.messages.units import union_members

MEASUREMENTS = typing.get_args(Measurement)
OUTPUTS = typing.get_args(Output)
MODULES = (frames, measurements, outputs, reasons)
CLASSES = sorted(
    {c for m in MODULES for _, c in inspect.getmembers(m, inspect.isclass) if issubclass(c, Message)} - {Message},
    key=lambda c: c.__name__,
)
ENUMS = sorted(
    {
        c
        for m in MODULES
        for _, c in inspect.getmembers(m, inspect.isclass)
        if issubclass(c, enum.Enum) and c is not enum.StrEnum
    },
    key=lambda c: c.__name__,
)


@pytest.mark.parametrize("cls", CLASSES, ids=lambda c: c.__name__)
def test_every_type_is_frozen_and_has_slots(cls: type) -> None:
    assert cls.__struct_config__.frozen  # type: ignore[attr-defined]
    assert "__dict__" not in dir(cls)
    assert cls.__doc__


@pytest.mark.parametrize("cls", MEASUREMENTS, ids=lambda c: c.__name__)
def test_every_measurement_has_a_stamp_first(cls: type) -> None:
    first = structs.fields(cls)[0]
    assert (first.name, first.type) == ("stamp", Stamp)


@pytest.mark.parametrize("cls", OUTPUTS, ids=lambda c: c.__name__)
def test_every_output_says_when_whether_and_why_not(cls: type) -> None:
    assert {field.name for field in structs.fields(cls)} >= {"t_ns", "t_valid_ns", "valid", "reasons"}


@pytest.mark.parametrize("cls", [*MEASUREMENTS, *OUTPUTS], ids=lambda c: c.__name__)
def test_a_quantity_that_may_be_absent_defaults_to_none(cls: type) -> None:
    """Never to a number: a default of 0.0 would be a value."""
    hints = typing.get_type_hints(cls)
    for field in structs.fields(cls):
        numeric = {int, float} & set(union_members(hints[field.name]))
        if numeric and not field.required:
            assert field.default is None, field.name


def test_the_union_is_closed_over_every_class_with_a_stamp() -> None:
    stamped = {c for c in CLASSES if "stamp" in c.__struct_fields__}
    assert stamped == set(MEASUREMENTS)
    assert isinstance(Measurement, types.UnionType)


@pytest.mark.parametrize("cls", ENUMS, ids=lambda c: c.__name__)
def test_enums_are_strings_for_the_wire(cls: type[enum.Enum]) -> None:
    values = [member.value for member in cls]
    assert all(isinstance(v, str) and v for v in values)
    assert len(set(values)) == len(values)


def test_frozen_means_frozen() -> None:
    frame = RawFrame("a", 0, 1, b"x")
    with pytest.raises(AttributeError):
        frame.seq = 1  # type: ignore[misc]
    with pytest.raises(TypeError):
        object.__setattr__(frame, "seq", 1)


def test_measurements_take_names_only() -> None:
    """Two floats in the wrong order would be silent."""
    with pytest.raises(TypeError):
        RadioHeight(Stamp(1), 30.0)  # type: ignore[call-arg]
    assert Attitude(stamp=Stamp(1), roll=0.1).pitch is None


def test_states_read_as_words() -> None:
    assert str(LinkState.WRONG_RATE) == "wrong rate"
    assert f"{Reason.OFF_TRACK}" == "off_track"
