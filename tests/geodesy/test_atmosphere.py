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
