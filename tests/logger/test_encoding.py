"""Records as JSON: the decoded record equals that of ``json.dumps``, for any content."""

from __future__ import annotations

import json
import math
import types
import typing
from collections import OrderedDict, UserList
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fti.logger.encoding import encode
from fti.messages.measurements import (
    Attitude,
    ImuSample,
    Measurement,
    RangeScan,
    Satellite,
    Satellites,
    Stamp,
    TimeScale,
)
from fti.messages.outputs import Event, Output
from fti.messages.tables import Message

CLASSES: list[type] = [*typing.get_args(Measurement), *typing.get_args(Output), Event, Stamp]


def plain(value: Any) -> Any:
    """A value of plain JSON types, slowly: what is to be written."""
    if isinstance(value, Message):
        left_out = {"arrays"} if isinstance(value, RangeScan) else set()
        return {name: plain(getattr(value, name)) for name in value.__struct_fields__ if name not in left_out}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read(data: bytes) -> str:
    """Decoded values, with the order of names and duplicates; 1 is not 1.0, and 0.0 is not -0.0."""
    return repr(json.loads(data, object_pairs_hook=list))


def expected(value: Any) -> str:
    return read(json.dumps(plain(value), ensure_ascii=False, allow_nan=False).encode(errors="replace"))


class Level(IntEnum):
    LOW = 3


class Way(StrEnum):
    ODD = 'a "quoted" \\ way'


class Length(float):
    """A number with a name of its own."""

    def __repr__(self) -> str:
        return f"{float(self):.1f} m"


FLOATS = st.floats() | st.sampled_from([-0.0, 5e-324, 1e-5, 1e16, 1e22, 1.7976931348623157e308, math.nan, -math.inf])
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers()
    | FLOATS
    | st.text(st.characters())
    | st.sampled_from(["nan", "inf", "null", "%s", "%(a)s", "\udcff", "\u2028", '"', "\\", "\x00", "é", "\U0001f681"])
    | st.sampled_from([Level.LOW, Way.ODD, TimeScale.GPS, Length(1.25), Length("nan")])
    | FLOATS.map(np.float64)
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.lists(inner, max_size=4).map(tuple)
        | st.dictionaries(st.text(max_size=4) | st.integers() | FLOATS | st.none(), inner, max_size=4)
        | st.builds(Stamp, inner, inner, inner, inner)
        | st.builds(lambda a, b: Satellite(system=a, number=b), inner, inner)
    ),
    max_leaves=12,
)


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
@settings(max_examples=10)
@given(data=st.data())
def test_a_record_says_what_json_says(cls: type, data: st.DataObject) -> None:
    """Of the types that it declares."""
    hints = typing.get_type_hints(cls)
    record = data.draw(st.builds(cls, **{name: st.from_type(hint) for name, hint in hints.items()}))
    assert read(encode(record)) == expected(record)


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
@settings(max_examples=10)
@given(data=st.data())
def test_a_record_says_what_json_says_whatever_it_holds(cls: type, data: st.DataObject) -> None:
    """Of types that it does not declare: a driver may be wrong, and numpy's numbers are floats."""
    record = data.draw(st.builds(cls, **dict.fromkeys(typing.get_type_hints(cls), VALUES)))
    assert read(encode(record)) == expected(record)


@settings(max_examples=200)
@example(math.nan)
@example({})
@example({None: 1, "None": 2})
@example(())
@example({"nan": math.nan, "a": ["nan", math.inf, (-math.inf,)]})
@given(VALUES)
def test_a_value_says_what_json_says(value: object) -> None:
    assert read(encode(value)) == expected(value)


def test_what_is_written_quickly_and_what_slowly_is_compact() -> None:
    for largest in (2**64 - 1, 2**64):  # whole numbers of more bits are written slowly
        data = encode({"é": Stamp(largest), "b": (1.5, "\u2028")})
        stamp = f'{{"t_rx_ns":{largest},"t_dev_ns":null,"time_scale":null,"t_valid_ns":null}}'
        assert data.decode() == f'{{"é":{stamp},"b":[1.5,"\u2028"]}}'


def test_classes_of_one_field_and_of_none() -> None:
    @dataclass
    class One:
        only: object

    @dataclass
    class Nothing:
        pass

    assert encode(One((1, None))) == b'{"only":[1,null]}'
    assert encode([Nothing(), One(math.inf)]) == b'[{},{"only":null}]'


def test_other_tables_and_sequences() -> None:
    table = types.MappingProxyType({1: UserList([True, 2.5]), None: OrderedDict(a=range(3))})
    assert encode(table) == b'{"1":[true,2.5],"None":{"a":[0,1,2]}}'


def test_unknown_numbers_are_null() -> None:
    nan, inf = float("nan"), float("inf")
    sample = ImuSample(stamp=Stamp(5), accel_b=(nan, inf, -inf), gyro_b=None)
    assert encode(sample) == (
        b'{"stamp":{"t_rx_ns":5,"t_dev_ns":null,"time_scale":null,"t_valid_ns":null},'
        b'"accel_b":[null,null,null],"gyro_b":null}'
    )


def test_numbers_keep_every_digit() -> None:
    attitude = Attitude(stamp=Stamp(1_767_323_045_123_456_789), roll=0.1 + 0.2)
    back = json.loads(encode(attitude))
    assert back["roll"] == 0.1 + 0.2 and back["stamp"]["t_rx_ns"] == 1_767_323_045_123_456_789


def test_nested_classes_enums_and_tables() -> None:
    epoch = Satellites(stamp=Stamp(1, 2, TimeScale.UTC), satellites=(Satellite(system="gps", number=3),))
    back = json.loads(encode({"a": epoch, "b": [1, True]}))
    assert back["a"]["stamp"]["time_scale"] == "utc"
    assert back["a"]["satellites"][0]["number"] == 3 and back["b"] == [1, True]


@pytest.mark.parametrize("what", [object(), {1.0}, np.zeros(2), np.int64(1), np.float32(1.0), np.bool_(True), 1j])
def test_what_json_cannot_say_is_refused(what: object) -> None:
    for value in (what, [what], {"a": what}, Satellites(stamp=Stamp(1), used=what)):  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=f"{type(what).__name__} cannot be encoded as JSON"):
            encode(value)
