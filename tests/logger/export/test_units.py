"""Units: every recorded number has one, and heads of columns tell it once."""

import typing
from typing import Any

import pytest

from fti.logger.export.units import unit_of, with_unit
from fti.messages.measurements import CalibrationPoint, Measurement, Pseudorange, Satellite, Stamp
from fti.messages.outputs import Event, Output
from fti.messages.topic_fields import units
from fti.messages.topics import snake_case

MESSAGES: list[type] = [*typing.get_args(Measurement), *typing.get_args(Output)]

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
    return f"/{'nav' if cls in typing.get_args(Output) else 'device'}/{snake_case(cls.__name__)}"


def bare_numbers(hint: Any) -> bool:
    """Is there a float or int without a unit in a type?"""
    if hint in (int, float):
        return True
    return typing.get_origin(hint) is not typing.Annotated and any(map(bare_numbers, typing.get_args(hint)))


def test_every_number_of_a_message_has_a_unit_in_its_type() -> None:
    classes = [*MESSAGES, CalibrationPoint, Satellite, Pseudorange, Stamp, Event]
    hints = {(c.__name__, k): h for c in classes for k, h in typing.get_type_hints(c, include_extras=True).items()}
    assert [name for name, hint in hints.items() if bare_numbers(hint)] == []


@pytest.mark.parametrize("cls", MESSAGES, ids=lambda cls: cls.__name__)
def test_columns_have_the_units_of_the_fields(cls: type) -> None:
    found = {name: unit_of(topic_of(cls), name) for name in units(cls)}
    assert found == units(cls)
    assert set(found.values()) <= UNITS


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
        ("/gnss/satellites", "satellites.3.cn0_dbhz", "satellites.3.cn0_dbhz"),
        ("/gnss/satellites", "satellites.3.azimuth", "satellites.3.azimuth [rad]"),
        ("/gnss/temperature", "static", "static [K]"),
        ("/gnss/ephemeris", "af2", "af2 [s/s^2]"),
        ("/flap/calibration", "points.0.deflection", "points.0.deflection [rad]"),
        ("/truth/state", "lat", "lat [rad]"),
        ("/fti/alarm_report", "value", "value"),
        ("/ils/deviation", "localizer_ddm", "localizer_ddm"),
        ("/fti/health", "links.ins.rate_hz", "links.ins.rate_hz"),
        ("/fti/health", "storage.free_mb", "storage.free_mb"),
        ("/fti/ledger", "links.ins.in_bytes", "links.ins.in_bytes"),
        ("/ins/attitude", "valid", "valid"),
    ],
)
def test_heads_have_the_unit_once(topic: str, column: str, head: str) -> None:
    assert with_unit(column, unit_of(topic, column)) == head
