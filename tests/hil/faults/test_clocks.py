"""Faults of a device's clock: what it says of the time, in what it sends; when it sends stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from fti.hil.faults.clocks import ClockFaults
from fti.hil.tables.fault_types import ClockDrift, ClockJump, Fault
from fti.messages.measurements import Range, Stamp, TimeScale
from tests.hil.faults.device_flights import Flight, bind_device, fly, nominal


def times(name: str, flight: Flight) -> dict[float, int]:
    """Device time of the first measurement of each cycle [ns], by when it left."""
    bound = bind_device(name)
    decoder = bound.driver.make_decoder(bound.options)
    found = {}
    for t, messages in flight:
        times_ns = [m.stamp.t_dev_ns for data in messages for m in decoder.feed(data, round(t * 1e9))]
        if known := [t_ns for t_ns in times_ns if t_ns is not None]:
            found[t] = known[0]
    return found


def gained(name: str, fault: Fault) -> dict[float, float]:
    """How far the clock is ahead [s] of the one without the fault, by when the message left [s]."""
    without, with_fault = times(name, nominal(name)), times(name, fly(name, fault))
    assert with_fault.keys() == without.keys()
    return {t: 1e-9 * (with_fault[t] - without[t]) for t in without}


#: A clock of which the driver sends whole milliseconds.
TICK_S = {"imar_ixcom": 1e-6, "mavlink": 1e-3, "novatel_oem6": 1e-3, "ublox_ubx": 1e-3, "nmea0183": 1e-3,
          "arinc429_apmp": 1e-6, "arinc429_chapter10": 1e-6}  # fmt: skip


@pytest.mark.parametrize("name", TICK_S)
@pytest.mark.parametrize("by_s", [-7.0, 0.25, 3600.0])
def test_a_clock_jumps_in_the_interval_and_comes_back(name: str, by_s: float) -> None:
    errors_s = gained(name, ClockJump(kind="clock_jump", from_s=2.0, to_s=4.0, by_s=by_s))
    inside = [s for t, s in errors_s.items() if 2.01 <= t < 4.0]
    outside = [s for t, s in errors_s.items() if t < 2.0 or t > 4.1]
    assert len(inside) >= 15
    np.testing.assert_allclose(inside, by_s, atol=1.1 * TICK_S[name])
    assert set(outside) == {0.0}


def test_what_a_drift_has_gained_stays() -> None:
    """1 % for two seconds is 20 ms."""
    errors_s = gained("imar_ixcom", ClockDrift(kind="clock_drift", from_s=2.0, to_s=4.0, ppm=1e4))
    assert {s for t, s in errors_s.items() if t < 2.0} == {0.0}
    at_3_s = next(s for t, s in errors_s.items() if t >= 3.0)
    assert at_3_s == pytest.approx(0.0102, abs=2e-6)  # the first sample after it is that of 3.02 s
    np.testing.assert_allclose([s for t, s in errors_s.items() if t > 4.1], 0.020, atol=2e-6)


def test_faults_of_one_clock_add() -> None:
    drift = ClockDrift(kind="clock_drift", from_s=0.0, to_s=10.0, ppm=100.0)
    jump = ClockJump(kind="clock_jump", from_s=5.0, to_s=6.0, by_s=-1.0)
    clock = ClockFaults(bind_device("nmea0183"), [drift, jump])
    assert clock.error_s(5.5) == pytest.approx(-1.0 + 5.5e-4, abs=1e-12)
    assert clock.error_s(60.0) == pytest.approx(1e-3, abs=1e-12)


def test_a_time_since_power_on_is_never_below_zero_and_no_time_stays_none() -> None:
    jump = ClockJump(kind="clock_jump", from_s=0.0, to_s=9.0, by_s=-5.0)
    clock = ClockFaults(bind_device("mavlink"), [jump])
    boot, none = (Range(stamp=s, slant_range=1.0) for s in (Stamp(7, 2_000_000_000, TimeScale.BOOT), Stamp(7)))
    assert [m.stamp for m in clock.apply(1.0, [boot, none])] == [Stamp(7, 0, TimeScale.BOOT), Stamp(7)]


def test_messages_leave_when_they_would_have() -> None:
    spoiled = fly("ublox_ubx", ClockJump(kind="clock_jump", from_s=2.0, to_s=4.0, by_s=60.0))
    assert [t for t, _ in spoiled] == [t for t, _ in nominal("ublox_ubx")]
