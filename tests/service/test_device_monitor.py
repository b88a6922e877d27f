"""States of devices, where navigation does not count in step with time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from fti.devices import bind_devices
from fti.drivers import nmea0183
from fti.messages.frames import RawFrame
from fti.messages.health import DeviceHealth
from fti.messages.measurements import DeviceTime, Stamp, TimeScale
from fti.service.navigation.decode_chain import Chain
from fti.service.navigation.device_monitor import DeviceMonitor
from tests.small_config import LINE, device, parsed

SECOND_NS = 1_000_000_000
BEGIN_NS = 1_800_000_000 * SECOND_NS
RATE_HZ = 5
REPORT_S = 0.5
CONFIG = LINE + device("receiver", "nmea0183", rate_hz=5.0)


class Navigation:
    """A receiver that sends at ``sent_hz`` from the beginning on, and navigation that counts up to a set time."""

    def __init__(self, sent_hz: float) -> None:
        config = parsed(CONFIG)
        self._chain = Chain(config, bind_devices(config), None)
        self._monitor = DeviceMonitor(config, self._chain)
        self._messages = _messages(sent_hz)
        self._next = next(self._messages)

    def count_until(self, s: float) -> None:
        while self._next.t_rx_ns <= BEGIN_NS + s * SECOND_NS:
            self._monitor.feed(self._next)
            self._chain.feed(self._next)
            self._next = next(self._messages)

    def report(self, s: float) -> DeviceHealth:
        return self._monitor.devices(BEGIN_NS + round(s * SECOND_NS))["receiver"]


def _messages(sent_hz: float) -> Iterator[RawFrame]:
    encoder = nmea0183.make_encoder(nmea0183.Options())
    seq = 0
    while True:
        seq += 1
        t_ns = BEGIN_NS + round(seq / sent_hz * SECOND_NS)
        message = DeviceTime(stamp=Stamp(t_ns, t_ns, TimeScale.UTC))
        yield RawFrame("line", seq, t_ns, b"".join(encoder.encode(message)))


def states(navigation: Navigation, from_s: float, until_s: float, lag_s: float = 0.0) -> set[str]:
    reports = round((until_s - from_s) / REPORT_S)
    found = set()
    for s in (from_s + REPORT_S * (k + 1) for k in range(reports)):
        navigation.count_until(s - lag_s)
        found.add(str(navigation.report(s).state))
    return found


@pytest.mark.parametrize("waited_s", [1.0, 3.0, 20.0])
def test_a_navigation_that_begins_late_and_catches_up_finds_no_wrong_rate(waited_s: float) -> None:
    navigation = Navigation(RATE_HZ)
    assert navigation.report(waited_s).state == "silent"  # nothing has been counted yet
    assert states(navigation, waited_s, waited_s + 12.0) == {"good"}


def test_a_navigation_that_stood_still_finds_no_wrong_rate() -> None:
    navigation = Navigation(RATE_HZ)
    assert states(navigation, 0.0, 10.0) == {"good"}
    for s in (11.0, 12.0, 13.0):  # it reports, and has counted nothing since
        assert navigation.report(s).state != "wrong rate"
    assert states(navigation, 13.0, 25.0) == {"good"}


@pytest.mark.parametrize("sent_hz", [0.6 * RATE_HZ, 2 * RATE_HZ])
def test_a_wrong_rate_is_found_by_a_navigation_that_is_behind_too(sent_hz: float) -> None:
    navigation = Navigation(sent_hz)
    assert "wrong rate" not in states(navigation, 0.0, 3.0, lag_s=0.4)
    states(navigation, 3.0, 5.0, lag_s=0.4)
    assert states(navigation, 5.0, 12.0, lag_s=0.4) == {"wrong rate"}


def test_the_rate_is_that_of_the_messages() -> None:
    navigation = Navigation(RATE_HZ)
    states(navigation, 7.0, 12.0)
    assert navigation.report(12.0).rate_hz == pytest.approx(RATE_HZ, abs=0.1)
