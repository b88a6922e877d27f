"""Readmission of an excluded source: after a step that cancels the contradiction, or if it would be detected."""

from __future__ import annotations

import numpy as np
import pytest

from fti.nav.filter.aiding import Aiding, GnssHeight, GnssPosition, GnssVelocity
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.innovation_gate import LIMITS
from fti.nav.filter.segment import AidingEntry
from fti.nav.separation.excluded_receivers import ExcludedReceiver, describe_readmission
from fti.nav.separation.monitor import QUANTITY_AXES
from fti.nav.separation.readmission import AGREED_COUNT, Contradiction, ReadmissionCheck

SECOND = 1_000_000_000
POSITION = GnssPosition(0.8, 0.2, None, 1.0, 1.0)
HEIGHT, VELOCITY = GnssHeight(POSITION), GnssVelocity(0.0, 0.0, 0.0, 0.1)


def here(sd: float) -> Estimate:
    """The filter with a sigma of position [m]."""
    start = InitialState(0.8, 0.2, 700.0, (50.0, 0.0, 0.0), 0.0, 0.0, 0.0, (sd,) * 3, (0.5,) * 3, (0.01,) * 3)
    return start.estimate(0, np.zeros(6), FilterModel())


def returning() -> ReadmissionCheck:
    aids: dict[str, Aiding] = {"position": POSITION, "height": HEIGHT, "velocity": VELOCITY}
    return ReadmissionCheck({aiding.name: Contradiction(QUANTITY_AXES[name]) for name, aiding in aids.items()})


def entry(t: float, size: float, sd: float) -> AidingEntry:
    """A position so far from the filter [m]."""
    return AidingEntry(round(t * SECOND), POSITION, nis=(size / sd) ** 2, innovation=np.array([size, 0.0]))


def feed(check: ReadmissionCheck, sizes: dict[float, float], sd: float) -> None:
    for t, size in sizes.items():
        check.compare(entry(t, size, sd), here(sd))


def agree(check: ReadmissionCheck, from_s: float, seconds: float, sd: float) -> float:
    for t in np.arange(from_s, from_s + seconds, 0.5).tolist():
        check.compare(entry(t, 0.0, sd), here(sd))
    return from_s + seconds


def test_a_step_back_of_100_m_closes_where_the_filter_is_certain() -> None:
    check = returning()
    feed(check, {0.0: 100.0, 1.0: 100.0}, sd=5.0)
    end = agree(check, 1.5, 31.0, sd=5.0)
    assert check.has_agreed(round(end * SECOND))
    assert check.is_confirmed(here(30.0)), "it was closed when the filter was certain"
    assert check.tolerance == pytest.approx(21.0, rel=1e-3)


def test_a_step_back_that_may_be_a_fault_closes_nothing() -> None:
    """4.2 sigma of 12 m are more than half of 100 m."""
    check = returning()
    feed(check, {0.0: 100.0, 1.0: 100.0}, sd=12.0)
    agree(check, 1.5, 31.0, sd=12.0)
    assert check.tolerance is None
    assert not check.is_confirmed(here(13.0))
    assert check.is_confirmed(here(12.4)), "below an eighth of the contradiction it would be seen"


def test_a_filter_that_drifts_towards_the_lie_is_no_step() -> None:
    """The contradiction ended 3 s after its last measurement outside: a step is not proved."""
    check = returning()
    feed(check, {0.0: 100.0}, sd=5.0)
    agree(check, 3.0, 31.0, sd=5.0)
    assert check.tolerance is None


def test_30_s_and_30_fixes_are_asked() -> None:
    check = returning()
    feed(check, {0.0: 100.0}, sd=5.0)
    for t in np.arange(1.0, 41.0, 1.5).tolist():
        check.compare(entry(t, 0.0, 5.0), here(5.0))
    assert check.times < AGREED_COUNT
    assert not check.has_agreed(41 * SECOND)
    quick = returning()
    feed(quick, {0.0: 100.0}, sd=5.0)
    assert not quick.has_agreed(round(agree(quick, 1.0, 29.0, sd=5.0) * SECOND))


def test_one_sample_outside_begins_anew() -> None:
    check = returning()
    feed(check, {0.0: 100.0}, sd=5.0)
    agree(check, 1.0, 29.0, sd=5.0)
    feed(check, {30.0: 100.0}, sd=5.0)
    assert not check.has_agreed(32 * SECOND)
    assert check.has_agreed(round(agree(check, 30.5, 30.5, sd=5.0) * SECOND))


def test_all_quantities_must_agree() -> None:
    check = returning()
    feed(check, {0.0: 100.0}, sd=5.0)
    wrong = AidingEntry(SECOND, VELOCITY, nis=2.0 * LIMITS[3], innovation=np.array([3.0, 0.0, 0.0]))
    check.compare(wrong, here(5.0))
    agree(check, 1.5, 40.0, sd=5.0)
    assert not check.has_agreed(41 * SECOND)
    right = AidingEntry(42 * SECOND, VELOCITY, nis=0.0, innovation=np.zeros(3))
    check.compare(right, here(5.0))
    assert check.has_agreed(round(agree(check, 42.5, 31.0, sd=5.0) * SECOND))


def test_a_contradiction_within_the_noise_of_the_source_is_not_ended_by_agreement() -> None:
    """0.1 m/s from the copies, by a velocity of 0.1 m/s: inside the gate all the time, which shows nothing."""
    check = ReadmissionCheck(
        {VELOCITY.name: Contradiction(QUANTITY_AXES["velocity"], 0.1, 0), POSITION.name: Contradiction(slice(0, 2))}
    )
    start = InitialState(0.8, 0.2, 700.0, (50.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1.0,) * 3, (0.005,) * 3, (0.01,) * 3)
    certain = start.estimate(0, np.zeros(6), FilterModel())
    for t in np.arange(0.2, 40.0, 0.5).tolist():
        check.compare(AidingEntry(round(t * SECOND), VELOCITY, nis=0.0, innovation=np.zeros(3)), certain)
        check.compare(entry(t, 0.0, 1.0), certain)
    assert check.has_agreed(40 * SECOND)
    assert check.tolerance is None
    assert not check.is_confirmed(certain)
    assert "a sigma" not in describe_readmission(ExcludedReceiver("gnss", "gnss", 0, check))


def test_what_would_readmit_it_is_named_as_far_as_it_is_known() -> None:
    """An eighth of 100 m; a height is confirmed by no source; without a size the operator alone."""
    check = returning()
    feed(check, {0.0: 100.0}, sd=5.0)
    outside = describe_readmission(ExcludedReceiver("gnss", "gnss", 0, check))
    for part in ("a step back", "a sigma of the filter below 12.5 m (position)", "independent source", "readmit gnss'"):
        assert part in outside
    agree(check, 3.0, 31.0, sd=5.0)
    assert "a step back" not in describe_readmission(ExcludedReceiver("gnss", "gnss", 0, check))
    height = ReadmissionCheck({HEIGHT.name: Contradiction(QUANTITY_AXES["height"], 47.0, 0, is_outside=True)})
    alone = describe_readmission(ExcludedReceiver("gnss", "gnss height", 0, height))
    assert "below 5.9 m (height)" in alone
    assert "readmit gnss'" in alone
    assert "independent" not in alone
    check.reset()
    assert describe_readmission(ExcludedReceiver("gnss", "gnss", 0, check)) == "'fti readmit gnss'"
