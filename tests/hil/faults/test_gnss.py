"""The shipped disturbances of satellite navigation are those of the source, second by second."""

from __future__ import annotations

import numpy as np
import pytest

from fti.devices import bind_devices
from fti.hil import scenario as scenarios
from fti.hil.faults.applicability import applies_to, inapplicable_reason
from fti.hil.faults.gnss import GnssFaults
from fti.hil.oracle.fault_flags import flags_of_fault
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.scenario import Scenario
from fti.hil.tables.fault_types import GnssOffset, GnssOutage

#: Spiegel 2018, table 7.4: until [s], horizontal and vertical standard deviation [m].
TABLE_7_4 = ((30, 2, 3), (40, 4, 6), (80, 2, 3), (100, 5, 7), (170, 2, 3), (200, 6, 8), (250, 2, 3))
#: Table 7.5: from, to [s] without satellite navigation.
TABLE_7_5 = ((30, 40), (80, 100), (170, 200))
T = np.arange(250.0)


def shipped(name: str) -> Scenario:
    return scenarios.load(scenarios.find(name))


def faults(name: str) -> GnssFaults:
    return GnssFaults("gnss", shipped(name).fault)


def test_the_degraded_phases_are_those_of_table_7_4() -> None:
    expected = [next(row[1:] for row in TABLE_7_4 if t < row[0]) for t in T]
    np.testing.assert_array_equal(faults("gnss_degraded").degraded_sds(T), expected)
    assert not faults("gnss_degraded").jamming_mask(T).any()


def test_the_outages_are_those_of_table_7_5() -> None:
    expected = [any(begin <= t < end for begin, end in TABLE_7_5) for t in T]
    np.testing.assert_array_equal(faults("gnss_outages").jamming_mask(T), expected)


@pytest.mark.parametrize("name", ["gnss_degraded", "gnss_outages"])
def test_the_flight_is_as_long_as_the_tables(name: str) -> None:
    flight = shipped(name).flight
    assert flight.kind == "approach"
    assert flight.duration_s == 250.0


def test_a_false_signal_begins_where_the_receiver_is() -> None:
    """200 m north and 60 m up in 40 s, from 20 s on; to other devices nothing happens."""
    offset, rate = GnssFaults("receiver", shipped("gnss_offset").fault).offset_n(T)
    assert not offset[T <= 20.0].any()
    np.testing.assert_allclose(np.diff(offset, axis=0)[20:59], rate[21:60])
    np.testing.assert_allclose(offset[(T >= 60.0) & (T < 75.0)], [[200.0, 0.0, -60.0]] * 15)
    assert not offset[T >= 75.0].any()
    others = GnssFaults("ins", shipped("gnss_offset").fault)
    assert not others.offset_n(T)[0].any()


def test_without_a_time_it_is_there_at_once() -> None:
    fault = GnssOffset(kind="gnss_offset", from_s=5.0, to_s=9.0, east_m=-30.0)
    offset, rate = GnssFaults("gnss", [fault]).offset_n(np.array([4.9, 5.0, 8.9, 9.0]))
    np.testing.assert_array_equal(offset[:, 1], [0.0, -30.0, -30.0, 0.0])
    assert not rate.any()


# ------------------------------------------------------------------------------------------- whose faults they are


def test_only_a_device_that_may_have_a_receiver_can_have_one() -> None:
    bound = {b.device.name: b for b in bind_devices(scenarios.load_config(shipped("gnss_outages")))}
    fault = shipped("gnss_outages").fault[0]
    assert {name for name, b in bound.items() if applies_to(fault, b)} == {"ins", "ahrs", "gnss", "autopilot"}
    named = GnssOutage(kind="gnss_outage", devices=("altimeter",), from_s=1.0, to_s=2.0)
    assert "freeflight_ra4500 has no satellite receiver" in inapplicable_reason(named, bound["altimeter"])


def test_what_has_only_satellites_must_say_that_there_are_none() -> None:
    scenario = shipped("gnss_outages")
    config = scenarios.load_config(scenario)
    craft = AircraftRoles(config, bind_devices(config), scenario)
    still = np.zeros(len(T))
    truth = TruthSeries(T, *[still] * 6)
    found = {case.subject: case for case in flags_of_fault(scenario.fault[0], craft, truth)}
    assert {name for name, case in found.items() if case.expected_flags} == {"gnss", "autopilot"}
    assert {case.unknown for case in found.values() if not case.expected_flags} == {
        "the device continues without satellites"
    }
