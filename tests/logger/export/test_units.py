"""Units: every recorded number has one, and heads of columns tell it once."""

import dataclasses
import types as python_types
import typing
from collections.abc import Iterator

import pytest

from fti import types
from fti.logger.derived_log import snake_case
from fti.logger.export.units import unit_of, with_unit

UNITS = {
    "rad",
    "m",
    "m/s",
    "m/s^2",
    "rad/s",
    "Pa",
    "K",
    "T",
    "DDM",
    "dB-Hz",
    "Hz",
    "cycles",
    "s",
    "s/s",
    "s/s^2",
    "m^0.5",
    "ns",
    "1",
    "unit",
}


def topic_of(cls: type) -> str:
    return f"/{'nav' if cls in typing.get_args(types.Output) else 'device'}/{snake_case(cls.__name__)}"


def numbers_of(cls: type, prefix: str = "") -> Iterator[str]:
    """Paths of the fields that are numbers, also in what the fields are made of."""
    for name, hint in typing.get_type_hints(cls).items():
        members = typing.get_args(hint) if isinstance(hint, python_types.UnionType) else (hint,)
        for member in members:
            inner = typing.get_args(member)[0] if typing.get_origin(member) is tuple else member
            if inner in (int, float):
                yield f"{prefix}{name}" + (".0" if inner is not member else "")
            elif dataclasses.is_dataclass(inner):
                yield from numbers_of(typing.cast(type, inner), f"{prefix}{name}.")


@pytest.mark.parametrize(
    "cls", [*typing.get_args(types.Measurement), *typing.get_args(types.Output)], ids=lambda cls: cls.__name__
)
def test_every_number_has_a_unit(cls: type) -> None:
    units = {name: unit_of(topic_of(cls), name) for name in numbers_of(cls)}
    assert units
    assert {name: unit for name, unit in units.items() if unit not in UNITS} == {}


@pytest.mark.parametrize(
    ("topic", "column", "head"),
    [
        ("/ins/attitude", "roll", "roll [rad]"),
        ("/imu/imu_sample", "accel_b.2", "accel_b.2 [m/s^2]"),
        ("/ins/velocity", "sd", "sd [m/s]"),
        ("/laser/range", "sd", "sd [m]"),
        ("/nav/glide_slope", "sd", "sd [rad]"),
        ("/nav/glide_slope", "s", "s [m]"),
        ("/nav/height_above_ground/laser", "raw", "raw [m]"),
        ("/flap/surface_deflection", "raw", "raw"),
        ("/nav/location", "latitude", "latitude [deg]"),
        ("/ins/attitude", "stamp.t_rx_ns", "stamp.t_rx_ns"),
        ("/gnss/satellites", "hdop", "hdop"),
        ("/ils/deviation", "localizer_ddm", "localizer_ddm"),
        ("/fti/health", "links.ins.rate_hz", "links.ins.rate_hz"),
        ("/fti/health", "storage.free_mb", "storage.free_mb"),
        ("/fti/ledger", "links.ins.in_bytes", "links.ins.in_bytes"),
        ("/ins/attitude", "valid", "valid"),
    ],
)
def test_heads_have_the_unit_once(topic: str, column: str, head: str) -> None:
    assert with_unit(column, unit_of(topic, column)) == head
