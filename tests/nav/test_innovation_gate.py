"""The gate: its quantiles, refusals, reinitialisation, and the sources that bound an axis for others."""

from __future__ import annotations

import pytest
from scipy.stats import chi2

from fti.nav.filter.aiding import Aiding, BaroAltitude, GnssHeight, GnssPosition, GnssVelocity
from fti.nav.filter.exclusion import NOT_EXCLUDED, Cause, Exclusion
from fti.nav.filter.innovation_gate import (
    LIMITS,
    LOCKOUT_NS,
    GateDecision,
    GateState,
    decide,
    excluded_names,
    is_bounded_by_others,
    rejected_names,
    update_states,
    with_exclusion,
)

GNSS = GnssPosition(0.8, 0.2, 700.0, 2.0, 3.0)
HEIGHT = GnssHeight(GNSS)
BARO = BaroAltitude(700.0, 1.0)
SECOND = 1_000_000_000


@pytest.mark.parametrize("dof", [1, 2, 3])
def test_limits_are_the_quantiles_of_chi_square(dof: int) -> None:
    assert LIMITS[dof] == pytest.approx(chi2.isf(1e-4, dof), abs=1e-3)


def test_a_fitting_measurement_is_accepted_and_others_are_refused() -> None:
    assert decide({}, BARO, 0, 15.1, 1) is GateDecision.ACCEPTED
    assert decide({}, BARO, 0, 15.2, 1) is GateDecision.REFUSED
    assert decide({}, BARO, 0, float("nan"), 1) is GateDecision.REFUSED


def refused(aiding: Aiding) -> dict[str, GateState]:
    return update_states(update_states({}, aiding, 0, GateDecision.ACCEPTED), aiding, SECOND, GateDecision.REFUSED)


def test_satellites_that_are_refused_stay_out_however_long() -> None:
    """They were let in after five seconds: a step of 100 m was taken, with a sigma of 1.6 m."""
    states = refused(GNSS)
    assert decide(states, GNSS, SECOND + 100 * LOCKOUT_NS, 1e6, 3) is GateDecision.REFUSED
    assert rejected_names(states) == ("gnss.position",)


def test_the_offset_of_a_barometer_is_estimated_anew_after_the_lockout() -> None:
    states = refused(BARO)
    assert decide(states, BARO, SECOND + LOCKOUT_NS - 1, 1e6, 1) is GateDecision.REFUSED
    assert decide(states, BARO, SECOND + LOCKOUT_NS, 1e6, 1) is GateDecision.REINITIALISED
    assert rejected_names(update_states(states, BARO, 7 * SECOND, GateDecision.REINITIALISED)) == ()


def test_others_vouch_for_five_seconds_and_for_their_axes() -> None:
    """An altimeter that was accepted a second later, and then left its range, had locked satellites out."""
    level, _ = GNSS.split()
    states = update_states(refused(HEIGHT), BARO, 3 * SECOND, GateDecision.ACCEPTED)
    assert is_bounded_by_others(states, HEIGHT, 3 * SECOND + LOCKOUT_NS - 1)
    assert not is_bounded_by_others(states, HEIGHT, 3 * SECOND + LOCKOUT_NS)
    assert not is_bounded_by_others(states, level, 4 * SECOND)


def test_an_excluded_source_is_in_the_states_until_its_readmission() -> None:
    states = with_exclusion(refused(GNSS), [("gnss.position", Exclusion(SECOND, Cause.SEPARATION))])
    assert (excluded_names(states), rejected_names(states)) == (("gnss.position",), ())
    assert excluded_names(with_exclusion(states, [("gnss.position", NOT_EXCLUDED)])) == ()


def test_a_velocity_bounds_nothing_and_is_never_forced_in() -> None:
    velocity = GnssVelocity(0.0, 0.0, 0.0, 0.1)
    states = update_states({}, velocity, 0, GateDecision.REFUSED)
    assert decide(states, velocity, 100 * SECOND, 1e6, 3) is GateDecision.REFUSED
