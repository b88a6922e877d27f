"""The shipped disturbances of satellite navigation are those of the source, second by second."""

from __future__ import annotations

import numpy as np
import pytest

from fti.hil import scenario as scenarios
from fti.hil.faults.gnss import GnssFaults
from fti.hil.faults.kinds import GnssOffset

#: Spiegel 2018, table 7.4: until [s], horizontal and vertical standard deviation [m].
TABLE_7_4 = ((30, 2, 3), (40, 4, 6), (80, 2, 3), (100, 5, 7), (170, 2, 3), (200, 6, 8), (250, 2, 3))
#: Table 7.5: from, to [s] without satellite navigation.
TABLE_7_5 = ((30, 40), (80, 100), (170, 200))
T = np.arange(250.0)


def faults(name: str) -> GnssFaults:
    return GnssFaults("gnss", scenarios.load(scenarios.find(name)).fault)


def test_the_degraded_phases_are_those_of_table_7_4() -> None:
    expected = [next(row[1:] for row in TABLE_7_4 if t < row[0]) for t in T]
    np.testing.assert_array_equal(faults("gnss_degraded").degraded(T), expected)
    assert not faults("gnss_degraded").jammed(T).any()


def test_the_outages_are_those_of_table_7_5() -> None:
    expected = [any(begin <= t < end for begin, end in TABLE_7_5) for t in T]
    np.testing.assert_array_equal(faults("gnss_outages").jammed(T), expected)


@pytest.mark.parametrize("name", ["gnss_degraded", "gnss_outages"])
def test_the_flight_is_as_long_as_the_tables(name: str) -> None:
    flight = scenarios.load(scenarios.find(name)).flight
    assert flight.kind == "approach"
    assert flight.duration_s == 250.0


def test_a_false_signal_begins_where_the_receiver_is() -> None:
    """200 m north and 60 m up in 40 s, from 20 s on; to other devices nothing happens."""
    offset, rate = faults("gnss_offset").offset_n(T)
    assert not offset[T <= 20.0].any()
    np.testing.assert_allclose(np.diff(offset, axis=0)[20:59], rate[21:60])
    np.testing.assert_allclose(offset[(T >= 60.0) & (T < 75.0)], [[200.0, 0.0, -60.0]] * 15)
    assert not offset[T >= 75.0].any()
    others = GnssFaults("autopilot", scenarios.load(scenarios.find("gnss_offset")).fault)
    assert not others.offset_n(T)[0].any()


def test_without_a_time_it_is_there_at_once() -> None:
    fault = GnssOffset(kind="gnss_offset", from_s=5.0, to_s=9.0, east_m=-30.0)
    offset, rate = GnssFaults("gnss", [fault]).offset_n(np.array([4.9, 5.0, 8.9, 9.0]))
    np.testing.assert_array_equal(offset[:, 1], [0.0, -30.0, -30.0, 0.0])
    assert not rate.any()
