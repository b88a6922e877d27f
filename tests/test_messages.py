"""The messages: frozen, closed, without numbers for "unknown"."""

from __future__ import annotations

import dataclasses
import enum
import inspect
import types
import typing

import pytest

from fti.messages import frames, measurements, outputs, reasons
from fti.messages.frames import LinkState, RawFrame
from fti.messages.measurements import Attitude, Measurement, RadioHeight, Stamp
from fti.messages.outputs import Output
from fti.messages.reasons import Reason
from fti.messages.units import union_members

MEASUREMENTS = typing.get_args(Measurement)
OUTPUTS = typing.get_args(Output)
MODULES = (frames, measurements, outputs, reasons)
CLASSES = [c for m in MODULES for _, c in inspect.getmembers(m, dataclasses.is_dataclass)]
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
    assert cls.__dataclass_params__.frozen  # type: ignore[attr-defined]
    assert "__slots__" in vars(cls)
    assert cls.__doc__
    assert not cls.__doc__.startswith(f"{cls.__name__}("), "the docstring is the one that dataclass makes"


@pytest.mark.parametrize("cls", MEASUREMENTS, ids=lambda c: c.__name__)
def test_every_measurement_has_a_stamp_first(cls: type) -> None:
    first = dataclasses.fields(cls)[0]
    assert (first.name, first.type) == ("stamp", "Stamp")


@pytest.mark.parametrize("cls", OUTPUTS, ids=lambda c: c.__name__)
def test_every_output_says_when_whether_and_why_not(cls: type) -> None:
    names = {f.name for f in dataclasses.fields(cls)}
    assert {"t_ns", "t_valid_ns", "valid", "reasons"} <= names


@pytest.mark.parametrize("cls", [*MEASUREMENTS, *OUTPUTS], ids=lambda c: c.__name__)
def test_a_quantity_that_may_be_absent_defaults_to_none(cls: type) -> None:
    """Never to a number: a default of 0.0 would be a value."""
    hints = typing.get_type_hints(cls)
    for field in dataclasses.fields(cls):
        numeric = {int, float} & set(union_members(hints[field.name]))
        if numeric and field.default is not dataclasses.MISSING:
            assert field.default is None, field.name


def test_the_union_is_closed_over_every_class_with_a_stamp() -> None:
    stamped = {c for c in CLASSES if any(f.name == "stamp" for f in dataclasses.fields(c))}
    assert stamped == set(MEASUREMENTS)
    assert isinstance(Measurement, types.UnionType)


@pytest.mark.parametrize("cls", ENUMS, ids=lambda c: c.__name__)
def test_enums_are_strings_for_the_wire(cls: type[enum.Enum]) -> None:
    values = [member.value for member in cls]
    assert all(isinstance(v, str) and v for v in values)
    assert len(set(values)) == len(values)


def test_frozen_means_frozen() -> None:
    frame = RawFrame("a", 0, 1, b"x")
    with pytest.raises(dataclasses.FrozenInstanceError):
        frame.seq = 1  # type: ignore[misc]
    with pytest.raises(AttributeError):
        object.__setattr__(frame, "extra", 1)


def test_measurements_take_names_only() -> None:
    """Two floats in the wrong order would be silent."""
    with pytest.raises(TypeError):
        RadioHeight(Stamp(1), 30.0)  # type: ignore[call-arg]
    assert Attitude(stamp=Stamp(1), roll=0.1).pitch is None


def test_states_read_as_words() -> None:
    assert str(LinkState.WRONG_RATE) == "wrong rate"
    assert f"{Reason.OFF_TRACK}" == "off_track"
