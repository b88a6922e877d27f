"""Altimeters whose errors stay within the gate: their sigma contains them.  Flights over hills, by ``fti.ranging``."""

from __future__ import annotations

import numpy as np
import pytest

from tests.nav.altimeter_flights import RATE_HZ, Array, Fault, fly, outputs

SECONDS, ONSET_S, SETTLED_S = 60.0, 20.0, 25.0


def late(t: Array, values: Array) -> Array:
    """By 1 s."""
    return np.where(t < ONSET_S, values, np.interp(t - 1.0, t, values))


def renewed_seldom(t: Array, values: Array) -> Array:
    """A new value every 1.5 s."""
    indices = (np.arange(len(t)) // round(1.5 * RATE_HZ)) * round(1.5 * RATE_HZ)
    return np.where(t < ONSET_S, values, values[indices])


def error_over_sigma(seed: int, fault: Fault | None) -> tuple[Array, Array]:
    """Of the valid samples of a laser with a fault: time [s], error of the height in stated sigmas."""
    flight = fly(seed, SECONDS, agl=100.0, relief_sd=10.0)
    heights = list(outputs(flight, "laser", known=True, fault=fault))
    valid = np.array([height.valid for height in heights])
    errors = np.array([height.height_agl or np.nan for height in heights]) - flight.height
    return flight.t[valid], (errors / np.array([height.sd or np.nan for height in heights]))[valid]


@pytest.mark.parametrize("fault", [late, renewed_seldom])
def test_errors_within_the_gate_are_within_the_sigma(fault: Fault) -> None:
    rows = [error_over_sigma(3000 + seed, fault) for seed in range(4)]
    z = np.concatenate([z[t >= SETTLED_S] for t, z in rows])
    print(f"{len(z)} valid samples: |z| < 2 in {100 * np.mean(abs(z) < 2.0):.1f} %, worst {abs(z).max():.1f}")
    assert len(z) > 200
    assert np.mean(abs(z) < 2.0) >= 0.85


def test_the_sigma_of_a_sound_one_is_not_larger_than_its_errors_ask_for() -> None:
    z = np.concatenate([error_over_sigma(3000 + seed, None)[1] for seed in range(4)])
    assert np.mean(abs(z) < 2.0) >= 0.93
    assert np.sqrt(np.mean(z**2)) >= 0.5
