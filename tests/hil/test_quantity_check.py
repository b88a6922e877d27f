"""A fault of a number that a device does not measure is refused before the flight, with those that it does measure."""

from __future__ import annotations

from typing import Any

import pytest

from fti.errors import ConfigError
from fti.hil.sensors.quantity_check import check_fault_quantities
from fti.hil.tables.fault_types import Bias
from tests.hil.faults.device_flights import DEVICES, DURATION_S, fly, make_sensor
from tests.hil.worlds import world


def checked(device: str, quantity: str, **keys: Any) -> None:
    fault = Bias(kind="bias", from_s=1.0, to_s=2.0, quantity=quantity, value=1.0, **keys)
    environment = world(DURATION_S, fault=(fault,))
    check_fault_quantities([make_sensor(device, environment)], environment)


@pytest.mark.parametrize("name", DEVICES)
def test_what_every_device_measures_is_taken(name: str) -> None:
    checked(name, DEVICES[name].quantity, devices=("device",), name=DEVICES[name].name)


@pytest.mark.parametrize(
    ("device", "quantity", "keys", "error"),
    [
        ("nmea0183", "range.slant_range", {"devices": ("device",)},
         r"fault\[0\]\.quantity: 'device' does not measure range\.slant_range; it has .*position\.lat, position\.lon"),
        ("nmea0183", "range.slant_range", {}, r"'device' does not measure range\.slant_range"),
        ("power_unit", "reading.value", {"name": "pressure"},
         r"does not measure reading\.value of 'pressure'; it has reading\.value of 'supply_voltage'"),
    ],
)  # fmt: skip
def test_what_it_does_not_measure_is_refused(device: str, quantity: str, keys: dict[str, Any], error: str) -> None:
    with pytest.raises(ConfigError, match=error):
        checked(device, quantity, **keys)


def test_of_several_devices_one_is_enough_when_none_is_named() -> None:
    fault = Bias(kind="bias", from_s=1.0, to_s=2.0, quantity="range.slant_range", value=1.0)
    environment = world(DURATION_S, fault=(fault,))
    check_fault_quantities(
        [make_sensor("nmea0183", environment), make_sensor("lightware_ascii", environment)], environment
    )


def test_looking_at_a_device_does_not_change_its_flight() -> None:
    fault = Bias(kind="bias", from_s=90.0, to_s=91.0, quantity="position.lat", value=1.0)
    environment = world(DURATION_S, fault=(fault,))
    used, unused = make_sensor("novatel_oem6", environment), make_sensor("novatel_oem6", environment)
    check_fault_quantities([used], environment)
    assert fly("novatel_oem6", sensor=used) == fly("novatel_oem6", sensor=unused)
