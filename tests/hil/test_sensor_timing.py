"""``[sensor.NAME]``: shift, drift, jitter and latency of one device, and every rate down to a period of 1 ms."""

from __future__ import annotations

import numpy as np
import pytest

from fti import drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.errors import ConfigError
from fti.hil.sensors import MODELS, SimulatedSensor
from tests.hil.worlds import world

DURATION_S = 10.0


def sensor(rate_hz: float = 20.0, configured_latency_ms: float = 5.0, **settings: float) -> SimulatedSensor:
    module = drivers.load("freeflight_ra4500")
    keys = {"name": "radar", "link": "line", "driver": "freeflight_ra4500"}
    device = Device.model_validate({**keys, "rate_hz": rate_hz, "latency_ms": configured_latency_ms})
    environment = world(DURATION_S, sensor={"radar": settings})
    return SimulatedSensor(
        BoundDevice(device, module, module.Options()), MODELS["freeflight_ra4500"], environment, seed=1
    )


def test_the_first_sample_is_where_the_shift_says() -> None:
    assert sensor(shift_ms=0.0).t[0] == 0.0
    assert sensor(shift_ms=12.5).t[0] == 0.0125
    assert sensor(shift_ms=2000.0).t[0] == 2.0


def test_drift_is_that_of_the_clock() -> None:
    """A clock that is 500 ppm fast is 5 ms early with the sample of 10 s."""
    right, fast = sensor(shift_ms=0.0, drift_ppm=0.0), sensor(shift_ms=0.0, drift_ppm=500.0)
    assert right.t[199] == pytest.approx(9.95, abs=1e-9)
    assert right.t[199] - fast.t[199] == pytest.approx(9.95 * 500e-6, rel=1e-3)


def test_latency_is_that_of_the_scenario_before_that_of_the_configuration() -> None:
    configured, other = sensor(jitter_ms=0.0), sensor(jitter_ms=0.0, latency_ms=80.0)
    np.testing.assert_allclose(configured.due - configured.t, 0.005, atol=1e-12)
    np.testing.assert_allclose(other.due - other.t, 0.080, atol=1e-12)


def test_jitter_has_the_size_asked_for_and_never_makes_a_message_early() -> None:
    result = sensor(rate_hz=100.0, latency_ms=0.0, jitter_ms=2.0)
    waited = result.due - result.t
    assert waited.min() >= 0.0
    assert np.sqrt(np.mean(waited**2)) == pytest.approx(0.002, rel=0.1)


@pytest.mark.parametrize("rate_hz", [1, 3, 7, 25, 333, 999, 1000])
def test_any_rate_down_to_a_period_of_1_ms_is_held(rate_hz: int) -> None:
    result = sensor(rate_hz=rate_hz, shift_ms=0.0, drift_ppm=0.0, jitter_ms=0.0)
    assert len(result.t) == rate_hz * DURATION_S
    np.testing.assert_allclose(result.t, np.arange(len(result.t)) / rate_hz, atol=1e-9)


def test_other_devices_and_what_is_not_set_stay_as_they_were() -> None:
    module = drivers.load("freeflight_ra4500")
    device = Device.model_validate({"name": "other", "link": "line", "driver": "freeflight_ra4500"})
    bound = BoundDevice(device, module, module.Options())
    with_settings, without = (
        SimulatedSensor(bound, MODELS["freeflight_ra4500"], world(DURATION_S, sensor=settings), seed=1)
        for settings in ({"radar": {"shift_ms": 1.0}}, {})
    )
    assert (with_settings.due == without.due).all()
    assert sensor().drift_ppm == sensor(shift_ms=3.0).drift_ppm


def test_a_shift_beyond_the_flight_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"sensor\.radar: no sample in a flight of 10 s, the first one .* 11 s"):
        sensor(shift_ms=11_000.0)
