"""A receiver that returns after 50 s: 30 s on trial, with the levels of the coasting filter; then reacquired.

Truth, unit and receiver are those of ``receiver_flights``; the oldest copy of a tactical unit is replaced after 28 s,
of the heights after 60 s.
"""

from __future__ import annotations

import numpy as np
import pytest

from fti.messages.reasons import Reason
from fti.nav.filter.aiding import GnssPosition
from fti.nav.filter.innovation_gate import GateDecision
from fti.nav.filter.segment import AidingEntry, FilterSegment
from fti.nav.separation.absence import AbsenceMonitor
from tests.nav.receiver_flights import Fault, Fixes, FlightResult, draw, fly, offset_after, silent

LOST, BACK = 300.0, 350.0
SECOND_NS = 1_000_000_000
NAMES = frozenset({"gnss.position"})


#: In the gate of the filter that has coasted for 50 s.
LIE_M, LARGER_M = 6.0, 10.0


def constant_lie(metres: float) -> Fault:
    """Silent for 50 s, and then so many metres too far east."""
    lie = offset_after(BACK, lambda since: np.tile([0.0, metres, 0.0], (len(since), 1)))

    def fault(fixes: Fixes) -> Fixes:
        return silent(LOST, BACK)(lie(fixes))

    return fault


@pytest.fixture(scope="module")
def returned() -> FlightResult:
    return fly(draw(0), {"gnss": silent(LOST, BACK)})


def reacquired_at(flight: FlightResult) -> np.ndarray:
    return np.array(
        [t for t, why in zip(flight.t, flight.unchecked, strict=True) if Reason.REACQUIRED in why and t > 200]
    )


def test_a_receiver_that_was_absent_for_long_is_reacquired_until_all_copies_exist(returned: FlightResult) -> None:
    """30 s on trial; then the copy of before the absence goes, and 7 s later there are four again."""
    times = reacquired_at(returned)
    assert BACK <= times[0] <= BACK + 3.0
    assert BACK + 30.0 <= times[-1] <= BACK + 30.0 + 10.0
    assert len(times) == pytest.approx(times[-1] - times[0] + 1, abs=1)
    assert len(returned.refused_at("gnss")) == 0
    assert returned.misled(60.0) == 0.0
    assert "gnss: back after 50 s" in returned.texts()


def test_a_short_absence_changes_nothing() -> None:
    flight = fly(draw(0), {"gnss": silent(LOST, LOST + 20.0)})
    assert len(reacquired_at(flight)) == 0
    assert not flight.events


def test_a_lie_that_comes_back_in_the_gate_of_the_filter_is_within_the_levels_while_on_trial() -> None:
    """6 m after 50 s of coasting to 6 m, which no gate sees.  Levels of younger copies alone would be 12 m."""
    flight = fly(draw(0), {"gnss": constant_lie(LIE_M)})
    t, hpl = np.array(flight.t), np.array(flight.hpl)
    followed = (t > BACK + 2.0) & (t < BACK + 30.0)
    coasted_m = hpl[t < BACK][-1]
    assert np.all(flight.radial[followed] > 0.7 * LIE_M), "the filter has followed it"
    assert coasted_m > 30.0
    assert np.all(hpl[followed] > coasted_m)
    assert Reason.REACQUIRED in flight.unchecked[int(np.argmax(t > BACK + 34.0))]


def test_a_larger_lie_that_comes_back_in_the_gate_is_refused_while_on_trial() -> None:
    """The copy of before the absence contradicts the filter that has followed it."""
    flight = fly(draw(0), {"gnss": constant_lie(LARGER_M)})
    assert BACK < flight.refused_at("gnss")[0] < BACK + 30.0
    assert flight.misled(60.0) == 0.0


def accepted(*seconds: float) -> FilterSegment:
    aiding = GnssPosition(0.8, 0.2, 100.0, 1.0, 2.0, name="gnss.position")
    entries = tuple(AidingEntry(round(t * SECOND_NS), aiding, decision=GateDecision.ACCEPTED) for t in seconds)
    return FilterSegment(None, (), entries)


def test_an_absence_on_trial_and_a_refusal_begin_the_trial_anew() -> None:
    """Ages of 28 s.  By hand: back at 100, silent from 110 to 113, refused at 120: over at 150, with 31 fixes."""
    monitor = AbsenceMonitor(NAMES, 28 * SECOND_NS)
    assert not monitor.follow(accepted(*range(61)))
    assert not monitor.follow(accepted(88.0)), "28 s are not longer than the oldest copy gets old"
    monitor.clear()
    monitor.follow(accepted(60.0))
    assert monitor.follow(accepted(100.0))
    assert monitor.absence_s == pytest.approx(40.0)
    assert not monitor.follow(accepted(*range(101, 111)))
    assert not monitor.follow(accepted(*range(113, 121))), "the same trial"
    monitor.disturb(120 * SECOND_NS)
    for t in range(121, 150):
        monitor.follow(accepted(float(t)))
        assert monitor.end_trial() is None, t
    monitor.follow(accepted(150.0))
    assert monitor.end_trial() == 120 * SECOND_NS
    assert not monitor.is_on_trial


def test_few_fixes_are_no_trial() -> None:
    """One every 2 s: 30 of them are there after 58 s."""
    monitor = AbsenceMonitor(NAMES, 28 * SECOND_NS)
    monitor.follow(accepted(0.0))
    passed = []
    for t in range(100, 170, 2):
        monitor.follow(accepted(float(t)))
        passed.append((monitor.end_trial(), t))
    assert [t for start, t in passed if start is not None] == [158]
