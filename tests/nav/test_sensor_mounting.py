"""Rotation of measurements from sensor axes to body axes."""

from __future__ import annotations

import pytest

from fti.config import Device
from fti.messages.measurements import Attitude, ImuSample, MagneticField, Measurement, Stamp
from fti.nav.sensor_mounting import Mountings

FIELD = MagneticField(stamp=Stamp(1), field_b=(20e-6, 3e-6, 40e-6))


def turn(rpy_bs_deg: tuple[float, float, float], m: Measurement, device: str = "mag") -> Measurement:
    mag = Device(name="mag", link="line", driver="honeywell_hmr2300", rpy_bs_deg=rpy_bs_deg)
    return Mountings([mag]).turn(device, m)


@pytest.mark.parametrize(
    ("rpy_bs_deg", "expected"),
    [
        ((0.0, 0.0, 90.0), (-3e-6, 20e-6, 40e-6)),  # x of the case looks to the right: what it feels is on y
        ((180.0, 0.0, 0.0), (20e-6, -3e-6, -40e-6)),  # on its back
        ((0.0, 90.0, 0.0), (40e-6, 3e-6, -20e-6)),  # x looks up
    ],
)
def test_a_field_is_turned_as_the_case_is_mounted(
    rpy_bs_deg: tuple[float, float, float], expected: tuple[float, float, float]
) -> None:
    measurement = turn(rpy_bs_deg, FIELD)
    assert isinstance(measurement, MagneticField)
    assert measurement.field_b == pytest.approx(expected, abs=1e-18)
    assert measurement.stamp == FIELD.stamp


def test_what_is_felt_is_turned_as_well_and_what_is_not_stays_unknown() -> None:
    on_its_back = turn((180.0, 0.0, 0.0), ImuSample(stamp=Stamp(1), accel_b=(0.5, 0.1, 9.8)))
    assert isinstance(on_its_back, ImuSample)
    assert on_its_back.accel_b == pytest.approx((0.5, -0.1, -9.8), abs=1e-14)
    assert on_its_back.gyro_b is None
    across = turn((0.0, 0.0, 90.0), ImuSample(stamp=Stamp(1), gyro_b=(0.01, 0.02, 0.03)))
    assert isinstance(across, ImuSample)
    assert across.gyro_b == pytest.approx((-0.02, 0.01, 0.03), abs=1e-16)


def test_what_is_aligned_or_no_field_or_anothers_stays_as_it_is() -> None:
    attitude = Attitude(stamp=Stamp(1), roll=0.1)
    assert turn((0.0, 0.0, 0.0), FIELD) is FIELD
    assert turn((0.0, 0.0, 90.0), FIELD, "other") is FIELD
    assert turn((0.0, 0.0, 90.0), attitude) is attitude
