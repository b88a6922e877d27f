"""Graduation keeps parabolas and slow waves, halves those of its period, and takes the steps of a recorder out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.smoothing import angle_between, displacements, fit, graduate
from fti.hil.flight.trajectory import FlightSamples
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from tests.hil.flight.recordings import quantised

Array = NDArray[np.float64]


def uneven(n: int = 400) -> Array:
    return np.asarray(np.cumsum(np.random.default_rng(4).uniform(0.07, 0.13, n)))


def test_a_parabola_passes_whatever_the_times() -> None:
    t = uneven()
    values = np.stack([2e5 + 60.0 * t - 0.7 * t**2, 3.0 * t], axis=1)
    np.testing.assert_allclose(graduate(t, values, 3.0), values, atol=1e-6)


@pytest.mark.parametrize(("period", "passed"), [(20.0, 1.0), (4.0, 64 / 65), (2.0, 0.5), (1.0, 1 / 65), (0.5, 0.0)])
def test_a_wave_passes_by_its_period(period: float, passed: float) -> None:
    """The sixth power of the frequency: half at 2 s, 1/65 at half of it."""
    t = np.arange(4000.0) / 100.0
    wave = np.sin(2.0 * np.pi * t / period)[:, None]
    middle = slice(1500, 2500)
    gain = graduate(t, wave, 2.0)[middle, 0] @ wave[middle, 0] / (wave[middle, 0] @ wave[middle, 0])
    assert gain == pytest.approx(passed, abs=2e-3)


def test_a_period_of_two_samples_is_refused() -> None:
    with pytest.raises(ValueError, match=r"samples 0\.100 s apart cannot be smoothed over 0\.150 s"):
        graduate(np.arange(20.0) / 10.0, np.zeros((20, 1)), 0.15)


def test_the_smallest_angles_are_accurate() -> None:
    mats = mat_from_rpy([0.1, 0.2, 0.3], [0.5, 0.1, -0.4], [1.0, 2.0, 3.0])
    turned = mats @ mat_from_rpy([1e-12, 0.0, 3.0], [0.0, 1e-7, 0.0], [0.0, 0.0, 0.0])
    np.testing.assert_allclose(angle_between(mats, turned), [1e-12, 1e-7, 3.0], rtol=1e-3)


@pytest.fixture(scope="module")
def recorded() -> tuple[FlightSamples, FlightSamples]:
    """A turn near 180 deg, true and in single precision, 10 Hz."""
    corner = [(48.0, 179.90), (48.0, 179.97), (48.04, 179.97)]
    waypoints = [Waypoint(np.deg2rad(lat), np.deg2rad(lon), 800.0, 60.0) for lat, lon in corner]
    flight = waypoint_flight(waypoints, np.deg2rad(25.0), (3.0, 2.0))
    t = np.arange(0.0, flight.end, 0.1)
    s = flight.state(t)
    return FlightSamples(t, s.lat, s.lon, s.alt, s.roll, s.pitch, s.heading), quantised(s, t)


def test_steps_of_single_precision_are_filtered_out(recorded: tuple[FlightSamples, FlightSamples]) -> None:
    """At 180 deg: steps of 1.5 m cos 48 in longitude, 0.76 m in latitude; filter decimetres, spline millimetres."""
    true, steps = recorded
    coarse_m, _ = displacements(true, steps)
    assert 0.3 < coarse_m.max() < 0.7
    flight_fit = fit(steps, 2.0)
    assert 0.1 < np.sqrt(np.mean(flight_fit.filter_m**2)) < 0.5
    assert np.rad2deg(flight_fit.filter_rad.max()) < 0.05
    assert 0.0 < np.sqrt(np.mean(flight_fit.spline_m**2)) < 5e-3
    assert np.rad2deg(flight_fit.spline_rad.max()) < 1e-3
    state = flight_fit.flight.state(true.t[5:-10])
    true_speed = 60.0
    assert np.abs(np.linalg.norm(state.vel_n, axis=1) - true_speed).max() < 1.0
    assert np.linalg.norm(state.accel_e, axis=1).max() < 10.0


def test_without_a_filter_the_steps_shake_the_flight(recorded: tuple[FlightSamples, FlightSamples]) -> None:
    """Which is what the filter is for: half a metre in a tenth of a second."""
    flight_fit = fit(recorded[1], None)
    assert np.linalg.norm(flight_fit.flight.state(recorded[0].t).accel_e, axis=1).max() > 100.0
    assert len(flight_fit.spline_m) == 0
    np.testing.assert_array_equal(flight_fit.filter_m, 0.0)


def test_the_errors_are_reported_as_text(recorded: tuple[FlightSamples, FlightSamples]) -> None:
    error_text = fit(recorded[1], 2.0).error_text()
    assert error_text.startswith("filtered minus recorded: 0.")
    assert "; spline minus filtered: 0.00" in error_text
    assert "deg rms, at most" in error_text
