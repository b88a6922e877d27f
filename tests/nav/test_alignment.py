"""Attitude from force and velocity: on a simulated flight in turns and climbs, and when it is undetermined."""

from __future__ import annotations

import numpy as np
import pytest

from fti.geodesy.rotations import mat_en, rpy_from_mat
from fti.hil.flight.random_routes import random_flight
from fti.hil.sensors.inertial import specific_force_b
from fti.nav.filter.initial_alignment import HEADING_SD, TILT_SD, attitude_in_flight


@pytest.mark.parametrize("seed", range(4))
def test_it_is_that_of_the_flight_but_for_wind_and_angle_of_attack(seed: int) -> None:
    """A hundred moments of each flight, banks of 25 deg among them; wind of 5 m/s is 5 deg of crab at 60 m/s."""
    state = random_flight(np.random.default_rng(seed), 200.0).state(np.linspace(1.0, 199.0, 100))
    force_b = specific_force_b(state)
    to_n = np.swapaxes(mat_en(state.lat, state.lon), 1, 2)
    off = []
    for k in range(100):
        values = attitude_in_flight(
            force_b[k], state.vel_n[k], to_n[k] @ state.accel_e[k], float(state.lat[k]), float(state.alt[k])
        )
        assert values is not None
        roll, pitch, heading = (float(x) for x in rpy_from_mat(values))
        turned = (heading - state.heading[k] + np.pi) % (2.0 * np.pi) - np.pi
        off.append((roll - state.roll[k], pitch - state.pitch[k], turned))
    roll_rms, pitch_rms, heading_rms = np.sqrt(np.mean(np.square(off), axis=0))
    assert roll_rms < 1.5 * TILT_SD
    assert pitch_rms < 1.5 * TILT_SD
    assert heading_rms < 1.5 * HEADING_SD


def test_there_is_none_on_the_ground_and_in_free_fall() -> None:
    level, flying = np.array([0.0, 0.0, -9.8]), np.array([50.0, 0.0, 0.0])
    assert attitude_in_flight(level, np.array([3.0, 0.0, 0.0]), np.zeros(3), 0.8, 0.0) is None
    assert attitude_in_flight(np.zeros(3), flying, np.array([0.0, 0.0, 9.81]), 0.8, 0.0) is None
    assert attitude_in_flight(level, flying, np.zeros(3), 0.8, 0.0) is not None
