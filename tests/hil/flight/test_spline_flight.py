"""A flight through samples: it passes them, its derivatives are derivatives, at any place and in any attitude."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from fti.geodesy.rotations import mat_from_rpy
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.hil.flight.trajectory import FlightSamples, FlightState, SplineFlight, earth_frame_velocity

Array = NDArray[np.float64]

T = np.arange(0.0, 60.0, 0.5)
AT = np.linspace(1.0, 59.0, 301)


def wobbling(lat_deg: float, lon_deg: float) -> FlightSamples:
    """Two minutes of swaying flight to the north-east."""
    east, north = 60.0 * T + 200.0 * np.sin(T / 9.0), 50.0 * T
    lat = np.deg2rad(lat_deg) + north / 6.37e6
    lon = np.deg2rad(lon_deg) + east / 6.37e6 / np.cos(np.deg2rad(lat_deg))
    alt = 500.0 + 30.0 * np.cos(T / 11.0)
    return FlightSamples(T, lat, lon, alt, 0.4 * np.sin(T / 5.0), 0.1 * np.cos(T / 7.0), (6.0 + T / 30.0) % (2 * np.pi))


PLACES = [(0.0, 0.0), (48.0, 179.99), (-75.0, -120.0), (89.9, 10.0)]


@pytest.mark.parametrize("place", PLACES)
def test_it_passes_through_its_samples(place: tuple[float, float]) -> None:
    samples = wobbling(*place)
    state = SplineFlight.from_samples(samples).state(T)
    there, expected = (ecef_from_geodetic(s.lat, s.lon, s.alt) for s in (state, samples))
    np.testing.assert_allclose(there, expected, atol=5e-9)
    np.testing.assert_allclose(attitude(state), attitude(samples), atol=1e-13)


@pytest.mark.parametrize("place", PLACES)
def test_its_derivatives_are_derivatives(place: tuple[float, float]) -> None:
    flight, h = SplineFlight.from_samples(wobbling(*place)), 1e-3
    after, now, before = (flight.state(AT + step) for step in (h, 0.0, -h))
    moved = ecef_from_geodetic(after.lat, after.lon, after.alt) - ecef_from_geodetic(before.lat, before.lon, before.alt)
    np.testing.assert_allclose(earth_frame_velocity(now), moved / (2 * h), atol=5e-6)
    gained = earth_frame_velocity(after) - earth_frame_velocity(before)
    np.testing.assert_allclose(now.accel_e, gained / (2 * h), atol=1e-6)
    turned = np.einsum("nji,njk->nik", attitude(before), attitude(after))  # I + skew(omega) 2 h
    skew = (turned - np.swapaxes(turned, 1, 2)) / (4 * h)
    rates = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    np.testing.assert_allclose(now.omega_nb_b, rates, atol=1e-6)


def test_a_loop_is_an_attitude_like_any_other() -> None:
    """Pitching at 0.2 rad/s over the vertical, where angles have no rate: 0.2 rad/s about y all along."""
    samples = wobbling(30.0, 0.0)
    looping = mat_from_rpy(0.0 * T, 0.2 * T, 0.0 * T)
    roll = np.where(np.cos(0.2 * T) < 0.0, np.pi, 0.0)  # what a device says: on its back, headed south
    pitch, heading = np.arcsin(np.sin(0.2 * T)), roll
    np.testing.assert_allclose(mat_from_rpy(roll, pitch, heading), looping, atol=1e-12)
    flight = SplineFlight.from_samples(replace(samples, roll=roll, pitch=pitch, heading=heading))
    assert np.cos(flight.state(AT).pitch).min() < 0.02
    np.testing.assert_allclose(flight.state(AT).omega_nb_b, np.tile([0.0, 0.2, 0.0], (len(AT), 1)), atol=2e-8)


def test_times_need_no_equal_steps() -> None:
    """The same sines, sampled unevenly: position within a millimetre between the samples."""
    uneven = np.sort(np.concatenate([T[::2], T[::5] + 0.13]))
    even = wobbling(45.0, 7.0)
    thinned = FlightSamples(uneven, *(np.interp(uneven, T, values) * 0.0 for values in vars_of(even)))
    lat = 0.8 + 60.0 * uneven / 6.37e6
    alt = 500.0 + 30.0 * np.cos(uneven / 11.0)
    state = SplineFlight.from_samples(replace(thinned, lat=lat, alt=alt)).state(AT)
    np.testing.assert_allclose(state.alt, 500.0 + 30.0 * np.cos(AT / 11.0), atol=1e-3)
    np.testing.assert_allclose(-state.vel_n[:, 2], -30.0 / 11.0 * np.sin(AT / 11.0), atol=1e-3)


def test_air_flow_of_a_constant_and_of_a_gusty_wind() -> None:
    samples = wobbling(45.0, 7.0)
    wind = np.stack([5.0 + np.sin(T / 4.0), np.full_like(T, -3.0), 0.5 * np.cos(T / 3.0)], axis=1)
    state = SplineFlight.from_samples(replace(samples, wind_n=wind)).state(T[4:-4])
    air_n = state.vel_n - wind[4:-4]
    np.testing.assert_allclose(state.tas, np.linalg.norm(air_n, axis=1), atol=1e-9)
    air_b = np.einsum("nji,nj->ni", attitude(state), air_n)
    np.testing.assert_allclose(np.tan(state.aoa), air_b[:, 2] / air_b[:, 0], atol=1e-9)
    still = SplineFlight.from_samples(replace(samples, wind_n=(5.0, -3.0, 0.5))).state(AT)
    np.testing.assert_allclose(still.tas, np.linalg.norm(still.vel_n - [5.0, -3.0, 0.5], axis=1), atol=1e-9)


def test_a_gap_is_refused_in_words() -> None:
    samples = wobbling(45.0, 7.0)
    keep = (T < 20.0) | (T > 23.0)
    broken = FlightSamples(T[keep], *(values[keep] for values in vars_of(samples)))
    with pytest.raises(ValueError, match=r"no samples of the flight from 19\.500 s to 23\.500 s: a gap of 4\.000 s"):
        SplineFlight.from_samples(broken)


@pytest.mark.parametrize("field", ["lat", "alt", "pitch"])
def test_what_is_no_number_is_refused(field: str) -> None:
    samples = wobbling(45.0, 7.0)
    values = getattr(samples, field).copy()
    values[7] = np.nan
    with pytest.raises(ValueError, match="not a number"):
        SplineFlight.from_samples(replace(samples, **{field: values}))


def test_times_that_run_back_are_refused() -> None:
    with pytest.raises(ValueError, match="must increase"):
        SplineFlight.from_samples(replace(wobbling(45.0, 7.0), t=T[::-1]))


def vars_of(samples: FlightSamples) -> tuple[Array, ...]:
    return samples.lat, samples.lon, samples.alt, samples.roll, samples.pitch, samples.heading


def attitude(of: FlightState | FlightSamples) -> Array:
    return mat_from_rpy(of.roll, of.pitch, of.heading)
