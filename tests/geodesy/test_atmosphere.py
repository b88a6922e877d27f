import numpy as np
import pytest

from fti.geodesy.atmosphere import Atmosphere, pressure_altitude


def test_standard_atmosphere_at_tabulated_heights() -> None:
    """ISO 2533, table: pressure and temperature at 0, 1000, 3000 m (geopotential)."""
    air, heights = Atmosphere(), np.array([0.0, 1000.0, 3000.0])
    np.testing.assert_allclose(air.p_static(heights), [101325.0, 89874.6, 70108.5], rtol=1e-5)
    np.testing.assert_allclose(air.temperature(heights), [288.15, 281.65, 268.65])


def test_pressure_at_sea_level_is_the_qnh() -> None:
    assert Atmosphere(qnh=98000.0).p_static(0.0) == pytest.approx(98000.0)
    assert pressure_altitude(Atmosphere(qnh=98000.0).p_static(500.0)) == pytest.approx(
        500.0 + float(pressure_altitude(98000.0))
    )


def test_cold_air_makes_an_altimeter_read_too_much() -> None:
    """ISA - 20 K, 300 m above the station: 22 m.  ICAO Doc 8168 has H dT / (T_0 + dT - L (H + H_s) / 2)."""
    for station in (0.0, 500.0):
        air = Atmosphere(qnh=99000.0, deviation=-20.0, station=station)
        shown = air.pressure_altitude(station + 300.0) - pressure_altitude(air.qnh)
        at_station = station + float(pressure_altitude(air.qnh))
        rule = 300.0 * 20.0 / (288.15 - 20.0 - 0.0065 * (at_station + 150.0))
        assert float(shown) - station - 300.0 == pytest.approx(rule, abs=0.1)
        assert rule == pytest.approx(22.4, abs=0.5)
        assert air.pressure_altitude(station) - pressure_altitude(air.qnh) == pytest.approx(station, abs=1e-9)


@pytest.mark.parametrize("deviation", [-60.0, -20.0, 0.0, 35.0, 60.0])
def test_air_is_in_hydrostatic_balance(deviation: float) -> None:
    """dp/dz = -g p / (R T), by a difference of 2 m: its error is 1e-9 of the gradient."""
    air, heights = Atmosphere(97500.0, deviation, 350.0), np.linspace(-300.0, 10_000.0, 41)
    slope = (air.p_static(heights + 1.0) - air.p_static(heights - 1.0)) / 2.0
    expected = -9.80665 * air.p_static(heights) / (287.05287 * air.temperature(heights))
    np.testing.assert_allclose(slope, expected, rtol=1e-7)
    np.testing.assert_allclose(air.alt_msl(air.pressure_altitude(heights)), heights, rtol=0, atol=1e-8)
