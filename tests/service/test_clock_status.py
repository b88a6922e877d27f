"""Status of the device clocks in health."""

from __future__ import annotations

from typing import Any

import pytest

from fti.devices import bind_devices
from fti.drivers import nmea0183
from fti.messages.frames import RawFrame
from fti.messages.measurements import DeviceTime, Stamp, TimeScale
from fti.messages.notes import ClockEstimate
from fti.messages.tables import to_table
from fti.service.navigation.decode_chain import Chain
from fti.service.navigation.device_monitor import DeviceMonitor, clock_status
from fti.service.supervisor.health import LATE_NS, HealthBoard
from tests.small_config import LINE, device, parsed

SECOND_NS = 1_000_000_000
MS = 1_000_000
FTI_0 = 1_800_000_000 * SECOND_NS
OFFSET_NS = 250 * MS


def known(**changes: Any) -> ClockEstimate:
    status: dict[str, Any] = {
        "scale": "utc",
        "state": "good",
        "offset_ns": 1_500_000,
        "offset_sd_ns": 20_000.0,
        "drift_ppm": 1.1,
    }
    status |= {"drift_sd_ppm": 0.1, "messages": 200, "late": 3, "refused": 7, "segments": 1}
    status |= {"validity_sd_ns": 20_000.0, "usual_ns": None, "largest_ns": 0.0}
    return ClockEstimate(**(status | changes))


def feed(used: bool, seconds: int) -> tuple[DeviceMonitor, int]:
    """A receiver that sends its time once a second, 250 ms ahead of FTI time; one message in ten is 80 ms late."""
    config = parsed(LINE + device("receiver", "nmea0183", use_device_time=used))
    chain = Chain(config, bind_devices(config), None)
    diagnosis = DeviceMonitor(config, chain)
    encoder = nmea0183.make_encoder(nmea0183.Options())
    t_ns = FTI_0
    for k in range(seconds):
        t_ns = FTI_0 + k * SECOND_NS + (80 * MS if k % 10 == 9 else 0)
        message = DeviceTime(stamp=Stamp(t_ns, FTI_0 + k * SECOND_NS + OFFSET_NS, TimeScale.UTC))
        frame = RawFrame("line", k, t_ns, b"".join(encoder.encode(message)))
        diagnosis.feed(frame)
        chain.feed(frame)
    return diagnosis, t_ns


def clocks(diagnosis: DeviceMonitor, now_ns: int) -> list[dict[str, Any]]:
    return list(to_table(diagnosis.devices(now_ns)["receiver"].clocks))


@pytest.mark.parametrize("used", [True, False])
def test_offset_drift_and_late_messages_of_a_device_are_in_health(used: bool) -> None:
    (clock,) = clocks(*feed(used, 120))
    assert (clock["scale"], clock["state"], clock["used"]) == ("utc", "good", used)
    assert clock["offset_ms"] == pytest.approx(OFFSET_NS / MS, abs=1.0)
    assert abs(clock["drift_ppm"]) < 4 * clock["drift_sd_ppm"] < 20.0
    assert 0.05 < clock["late_share"] <= 0.1  # the first ones come before the usual delay is learnt


def test_a_learnt_clock_has_a_status_and_a_device_without_one_has_none() -> None:
    assert clocks(*feed(True, 0)) == []
    (clock,) = clocks(*feed(True, 3))
    assert (clock["state"], clock["drift_ppm"], clock["offset_sd_ms"]) == ("learning", None, None)


def test_gps_time_is_reported_as_utc() -> None:
    """GPS time began on 1980-01-06 and is 18 s ahead of UTC."""
    status = clock_status(known(scale="gps", offset_ns=-(315_964_800 - 18) * SECOND_NS + 7 * MS), used=True)
    assert status.offset_ms == 7.0
    assert clock_status(known(), used=True).offset_ms == 1.5
    assert clock_status(known(messages=0, late=0), used=True).late_share == 0.0


def test_clocks_of_a_stopped_navigation_are_not_shown() -> None:
    device = {"link": "a", "state": "good", "hint": "", "clocks": [to_table(clock_status(known(), used=True))]}
    board = HealthBoard({"state": "recording"}, {}, {"navigation": {"lag_ms": 1.0}, "devices": {"d": device}})
    assert len(board.compose(0, [])["devices"]["d"]["clocks"]) == 1
    assert board.compose(LATE_NS + SECOND_NS, [])["devices"]["d"]["clocks"] == []
