"""Fast construction of measurements for buses with tens of thousands of values a second.

The constructor of a frozen class sets every field through ``object.__setattr__``: 1.7 us for a Reading; decoding it
takes 0.4 us.  Setting the slots directly takes 0.7 us, with the same result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, fields, make_dataclass
from typing import Any, TypeVar, cast

from fti.messages.measurements import Reading, Stamp

T = TypeVar("T")
_new = object.__new__
_slots = vars(Stamp)
_set_t_rx, _set_t_dev = _slots["t_rx_ns"].__set__, _slots["t_dev_ns"].__set__
_set_scale, _set_t_valid = _slots["time_scale"].__set__, _slots["t_valid_ns"].__set__
_slots = vars(Reading)
_set_stamp, _set_name, _set_value = _slots["stamp"].__set__, _slots["name"].__set__, _slots["value"].__set__
_set_unit, _set_valid, _set_text = _slots["unit"].__set__, _slots["valid"].__set__, _slots["text"].__set__


def fast_stamp(t_rx_ns: int) -> Stamp:
    """``Stamp(t_rx_ns)``."""
    stamp = _new(Stamp)
    _set_t_rx(stamp, t_rx_ns)
    _set_t_dev(stamp, None)
    _set_scale(stamp, None)
    _set_t_valid(stamp, None)
    return stamp


def fast_reading(stamp: Stamp, name: str, value: float | None, unit: str, valid: bool, *, text: str = "") -> Reading:
    """``Reading`` of these fields."""
    reading = _new(Reading)
    _set_stamp(reading, stamp)
    _set_name(reading, name)
    _set_value(reading, value)
    _set_unit(reading, unit)
    _set_valid(reading, valid)
    _set_text(reading, text)
    return reading


def fast_maker(kind: type[Any], name: str, fixed: Mapping[str, object]) -> Callable[[Stamp, float | None, bool], Any]:
    """A function (stamp, value, valid) that creates ``kind(stamp=..., valid=..., NAME=value, **fixed)``."""
    values = {f.name: fixed.get(f.name, f.default) for f in fields(kind)}
    slots = vars(kind)
    set_stamp, set_valid, set_value = (slots[key].__set__ for key in ("stamp", "valid", name))
    rest = tuple((slots[key].__set__, value) for key, value in values.items() if key not in ("stamp", "valid", name))

    def make(stamp: Stamp, value: float | None, valid: bool) -> Any:
        instance = _new(kind)
        set_stamp(instance, stamp)
        set_valid(instance, valid)
        set_value(instance, value)
        for put, content in rest:
            put(instance, content)
        return instance

    return make


def fast_class(kind: type[T]) -> type[T]:
    """A constructor for ``kind``, a frozen class with slots, with the same arguments in less than half the time.

    It sets the fields of a twin class that is not frozen, then changes the class of the instance to ``kind``.
    """

    def freeze(instance: Any) -> None:
        instance.__class__ = kind

    source: Any = kind
    names = [(f.name, f.type, field(default=f.default, kw_only=f.kw_only)) for f in fields(source)]
    twin = make_dataclass(kind.__name__, names, namespace={"__post_init__": freeze}, slots=True, eq=False, repr=False)
    return cast("type[T]", twin)
