"""Air data: pressures of the day, what probes and tubes add to them, and the flow of the flight."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from fti import drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.geodesy.atmosphere import ISA_PRESSURE, Atmosphere
from fti.hil.environment import calibrated_airspeed, impact_pressure
from fti.hil.flight.trajectory import FlightSamples, FlightState, SplineFlight
from fti.hil.sensors.air_data import AirData, true_airspeed
from fti.hil.sensors.errors import first_order_lag
from fti.hil.tables.schema import AirConditions
from fti.messages.measurements import Airspeed, PressureAltitude, Stamp
from tests.hil.worlds import world

Array = NDArray[np.float64]
KNOT, UNDULATION = 1852.0 / 3600.0, 47.0
T = np.arange(0.0, 60.0, 0.1)


def straight(
    speed: float = 60.0, descent: float = 0.0, wind_n: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> FlightState:
    """Northwards over the ground at 1000 m above the ellipsoid, nose to the north, wings level."""
    t = np.arange(-1.0, 62.0, 0.1)
    zero = np.zeros_like(t)
    lat = math.radians(48.0) + speed * t / 6.37e6
    flight = SplineFlight.from_samples(
        FlightSamples(t, lat, zero + math.radians(11.0), 1000.0 - descent * t, zero, zero, zero, wind_n)
    )
    return flight.state(T)


def computer(state: FlightState, air: AirConditions | None = None, seed: int = 1, **settings: float) -> AirData:
    device = Device.model_validate({"name": "air", "link": "line", "driver": "canaerospace"})
    driver = drivers.load("canaerospace")
    environment = world(1.0, air=air or AirConditions(), sensor={"air": settings})
    return AirData(BoundDevice(device, driver, driver.Options()), state, environment, T, np.random.default_rng(seed))


def altitudes(data: AirData) -> Array:
    """Means of what it shows at the standard setting and at the crew's [m]."""
    shown = [[m.alt_press for m in data.measure(k, Stamp(0)) if isinstance(m, PressureAltitude)] for k in range(len(T))]
    return np.asarray(np.mean(shown, axis=0))


# ---------------------------------------------------------------------------------------------------------- formulas


def test_speeds_at_mach_0_8_on_flight_level_350_are_those_of_a_flight_computer() -> None:
    """ISO 2533: 23 842 Pa and 218.81 K at 10 668 m; TAS 461 kt, CAS 272 kt."""
    air, height = Atmosphere(), 35_000 * 0.3048
    p, temperature = air.p_static(height), air.temperature(height)
    assert float(p) == pytest.approx(23_842.0, abs=3.0)
    assert float(temperature) == pytest.approx(218.81, abs=0.01)
    tas = 0.8 * math.sqrt(1.4 * 287.05287 * 218.81)
    assert tas / KNOT == pytest.approx(461.1, abs=0.3)
    assert float(calibrated_airspeed(impact_pressure(tas, p, temperature))) / KNOT == pytest.approx(271.9, abs=0.3)


def test_true_airspeed_is_the_way_back_from_impact_pressure() -> None:
    for height in (0.0, 3000.0, 9000.0):
        p, temperature = Atmosphere().p_static(height), Atmosphere().temperature(height)
        for tas in (5.0, 60.0, 250.0):
            assert float(true_airspeed(impact_pressure(tas, p, temperature), p, temperature)) == pytest.approx(tas)


def test_a_lag_follows_a_ramp_behind_by_its_time_whatever_the_sampling() -> None:
    for step in (0.01, 0.1, 1.0):
        t = np.arange(0.0, 10.0, step)
        np.testing.assert_allclose(
            first_order_lag(t, 3.0 * t, 0.5), 3.0 * (t - 0.5 * (1.0 - np.exp(-t / 0.5))), atol=1e-9
        )


# ---------------------------------------------------------------------------------------------------------- the flow


def test_wind_from_the_right_is_sideslip_and_a_headwind_is_airspeed() -> None:
    """60 m/s northwards, nose to the north: 6 m/s from the east make atan(0.1), 10 m/s from the north 70 m/s."""
    side, head = computer(straight(wind_n=(0.0, -6.0, 0.0))), computer(straight(wind_n=(-10.0, 0.0, 0.0)))
    assert np.rad2deg(side.aos.mean()) == pytest.approx(math.degrees(math.atan(0.1)), abs=0.05)
    assert np.rad2deg(head.aos.mean()) == pytest.approx(0.0, abs=0.05)
    assert head.tas.mean() == pytest.approx(70.0, rel=0.01)


def test_an_updraught_is_angle_of_attack() -> None:
    lifted = computer(straight(wind_n=(0.0, 0.0, -3.0)))
    assert np.rad2deg(lifted.aoa.mean()) == pytest.approx(math.degrees(math.atan(3.0 / 60.0)), abs=0.05)


# -------------------------------------------------------------------------------------------------------- altimeters


@pytest.mark.parametrize(("qnh_hpa", "deviation"), [(1013.25, 0.0), (990.0, 0.0), (1030.0, -20.0)])
def test_at_the_height_of_the_station_the_set_altimeter_is_right_and_the_standard_is_not(
    qnh_hpa: float, deviation: float
) -> None:
    """The station of the test field is 500 m above the ellipsoid.  1 hPa is 8.3 m at sea level."""
    state = straight()
    air = AirConditions(qnh_hpa=qnh_hpa, isa_deviation_k=deviation)
    low = FlightState(
        **{name: getattr(state, name) for name in FlightState.__slots__} | {"alt": np.full_like(T, 500.0)}
    )
    standard, at_qnh = altitudes(computer(low, air, static_error=0.0))
    assert at_qnh == pytest.approx(500.0 - UNDULATION, abs=1.5)
    assert standard - at_qnh == pytest.approx((1013.25 - qnh_hpa) * 8.3, abs=2.5 + 0.01 * abs(1013.25 - qnh_hpa) * 8.3)


def test_an_altimeter_that_is_set_wrong_is_wrong_by_the_setting() -> None:
    right, wrong = (
        altitudes(computer(straight(), AirConditions(qnh_hpa=1000.0), altimeter_hpa=s)) for s in (1000.0, 1010.0)
    )
    assert wrong[1] - right[1] == pytest.approx(10.0 * 8.35, abs=1.0)
    assert wrong[0] == pytest.approx(right[0])


# ------------------------------------------------------------------------------------------------- probes and tubes


def test_a_position_error_lowers_the_altitude_and_the_speed() -> None:
    """C_p 0.05 of 2050 Pa: 102 Pa too much at the port are 9 m; q_c lacks 5 %, the speed half of that."""
    true, off = (computer(straight(), static_error=c) for c in (0.0, 0.05))
    excess = 0.05 * impact_pressure(60.0, Atmosphere().p_static(953.0), Atmosphere().temperature(953.0))
    assert (off.p_static - true.p_static).mean() == pytest.approx(float(excess), rel=0.01)
    assert altitudes(true)[0] - altitudes(off)[0] == pytest.approx(float(excess) / (1.117 * 9.81), rel=0.02)
    speeds = [
        np.mean([m.cas for k in range(len(T)) for m in c.measure(k, Stamp(0)) if isinstance(m, Airspeed) and m.cas])
        for c in (true, off)
    ]
    assert speeds[1] / speeds[0] == pytest.approx(math.sqrt(0.95), abs=0.001)


def test_a_slow_static_tube_shows_what_was_higher() -> None:
    """5 m/s down, 2 s late: 10 m too high; and the pitot tube that is quick makes q_c wrong by the difference."""
    quick, late = (
        computer(straight(descent=5.0), static_error=0.0, static_lag_s=s, pitot_lag_s=0.0) for s in (0.0, 2.0)
    )
    settled = T > 15.0
    late_by = (quick.p_static - late.p_static)[settled].mean()
    assert late_by == pytest.approx(10.0 * 1.12 * 9.81, rel=0.03)
    assert (late.q_c - quick.q_c)[settled].mean() == pytest.approx(late_by, rel=0.02)


def test_the_standard_day_at_sea_level_is_what_calibrated_means() -> None:
    assert float(calibrated_airspeed(impact_pressure(60.0, ISA_PRESSURE, 288.15))) == pytest.approx(60.0)
