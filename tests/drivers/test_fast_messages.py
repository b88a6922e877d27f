"""Fast construction gives the same objects as the classes."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields
from typing import Any, get_args

import pytest

from fti.formats.fast_messages import fast_class
from fti.messages.measurements import Measurement, Position, Stamp


@pytest.mark.parametrize("kind", [Stamp, *get_args(Measurement)])
def test_a_quick_class_makes_the_same(kind: Any) -> None:
    values = {field.name: i for i, field in enumerate(fields(kind))}
    made, usual = fast_class(kind)(**values), kind(**values)
    assert type(made) is kind
    assert (made, hash(made), repr(made)) == (usual, hash(usual), repr(usual))


def test_what_is_left_out_has_its_default() -> None:
    assert fast_class(Position)(stamp=Stamp(1), lat=0.5) == Position(stamp=Stamp(1), lat=0.5)


def test_it_is_frozen_and_knows_its_fields() -> None:
    quick_position: Any = fast_class(Position)
    with pytest.raises(FrozenInstanceError):
        quick_position(stamp=Stamp(1)).lat = 1.0
    for wrong in ({}, {"stamp": Stamp(1), "latitude": 1.0}):
        with pytest.raises(TypeError):
            quick_position(**wrong)
