"""Validity times of measurements by the clocks of their devices, and the reports of the clocks."""

from __future__ import annotations

import numpy as np
import pytest

from fti.config import Device
from fti.messages.measurements import Attitude, ImuSample, Measurement, Stamp, TimeScale
from fti.messages.tables import to_table
from fti.nav.device_time.clock_estimator import ClockEstimator
from fti.nav.device_time.device_times import DeviceTimes

SECOND_NS = 1_000_000_000
MS = 1_000_000
FTI_0 = 1_800_000_000 * SECOND_NS
GPS_NS = -315_964_782 * SECOND_NS


def device(name: str = "ins", **more: object) -> Device:
    return Device.model_validate(
        {"name": name, "link": "line", "driver": "imar_ixcom", "latency_ms": 4.0, "max_age_ms": 500.0, **more}
    )


def message(t_ns: int, late_ms: float = 0.0, scale: TimeScale | None = TimeScale.GPS) -> tuple[ImuSample, Attitude]:
    """What one message of the time t_ns yields: two measurements with the same stamp."""
    stamp = Stamp(t_ns + 4 * MS + round(late_ms * MS), t_ns + GPS_NS if scale else None, scale)
    return ImuSample(stamp=stamp), Attitude(stamp=stamp, roll=0.0)


def fly(times: DeviceTimes, begin_s: int, end_s: int, name: str = "ins") -> list[tuple[int, Measurement]]:
    """Ten messages a second, each a little late; a tick in between.  (true time, measurement)"""
    rng = np.random.default_rng(begin_s)
    rows: list[tuple[int, Measurement]] = []
    for k in range(10 * begin_s, 10 * end_s):
        true_ns = FTI_0 + k * SECOND_NS // 10
        rows += [(true_ns, times.stamp(name, m)) for m in message(true_ns, abs(float(rng.normal(0.0, 2.0))))]
    return rows


def errors_ms(rows: list[tuple[int, Measurement]]) -> list[float]:
    return [((m.stamp.t_valid_ns or 0) - true) / MS for true, m in rows]


def test_first_the_arrival_and_then_the_devices_own_clock() -> None:
    times = DeviceTimes([device()])
    first, _, later = fly(times, 0, 10), fly(times, 10, 60), fly(times, 60, 90)
    assert all(m.stamp.t_valid_ns == m.stamp.t_rx_ns - 4 * MS for _, m in first)
    assert max(errors_ms(first)) > 4.0
    assert max(map(abs, errors_ms(later))) < 0.5


def test_a_clock_that_fails_gives_no_measurement_the_time_of_another_message(monkeypatch: pytest.MonkeyPatch) -> None:
    """Navigation goes on after a failure with the next measurement of the same message."""
    times = DeviceTimes([device()])
    times.stamp("ins", message(FTI_0)[0])
    later = message(FTI_0 + SECOND_NS)

    def fail(*_: object) -> int:
        raise ArithmeticError

    with monkeypatch.context() as patch:
        patch.setattr(ClockEstimator, "feed", fail)
        with pytest.raises(ArithmeticError):
            times.stamp("ins", later[0])
    assert times.stamp("ins", later[1]).stamp.t_rx_ns == later[1].stamp.t_rx_ns


def test_measurements_of_one_message_were_true_at_one_time_and_count_once() -> None:
    times = DeviceTimes([device()])
    rows = fly(times, 0, 60)
    assert all(a.stamp == b.stamp for (_, a), (_, b) in zip(rows[::2], rows[1::2], strict=True))
    note = times.tick(FTI_0 + 60 * SECOND_NS)
    assert note
    assert note.clocks["ins_gps"].messages == len(rows) // 2


def test_the_time_of_a_device_can_be_ignored_by_configuration() -> None:
    """Its clock is estimated and reported all the same."""
    times = DeviceTimes([device(use_device_time=False)])
    assert all(m.stamp.t_valid_ns == m.stamp.t_rx_ns - 4 * MS for _, m in fly(times, 0, 60))
    note = times.tick(FTI_0 + 60 * SECOND_NS)
    assert note
    assert note.clocks["ins_gps"].state == "good"


def test_without_a_time_of_its_own_the_arrival_counts() -> None:
    times = DeviceTimes([device()])
    stamped = times.stamp("ins", message(FTI_0, 7.0, None)[0])
    assert stamped.stamp.t_valid_ns == FTI_0 + 7 * MS
    assert times.tick(FTI_0 + SECOND_NS) is None


def test_what_a_device_declares_invalid_is_not_put_into_the_past() -> None:
    """Its clock may have been set back just then: the last valid value would stand behind the warning."""
    times = DeviceTimes([device()])
    fly(times, 0, 60)
    stamp = message(FTI_0 + 60 * SECOND_NS, 300.0)[1].stamp
    valid, invalid = (times.stamp("ins", Attitude(stamp=stamp, roll=0.0, valid=valid)) for valid in (True, False))
    assert valid.stamp.t_valid_ns == pytest.approx(FTI_0 + 60 * SECOND_NS, abs=MS)
    assert invalid.stamp.t_valid_ns == stamp.t_rx_ns - 4 * MS


@pytest.mark.parametrize("t_dev_ns", [(2**64 - 1) * 1000, 65535 * 604_800 * SECOND_NS, -(2**63)])
def test_a_time_that_no_clock_shows_is_none(t_dev_ns: int) -> None:
    """The largest number of its field, from a device that does not know the time."""
    times = DeviceTimes([device()])
    stamped = times.stamp("ins", Attitude(stamp=Stamp(FTI_0 + 4 * MS, t_dev_ns, TimeScale.GPS)))
    assert stamped.stamp.t_valid_ns == FTI_0
    assert times.tick(FTI_0 + SECOND_NS) is None


def test_once_a_second_the_state_of_every_clock_is_reported() -> None:
    times = DeviceTimes([device()])
    fly(times, 0, 60)
    at = FTI_0 + 60 * SECOND_NS
    notes = [times.tick(at + k * 20 * MS) for k in range(100)]
    assert [note.t_ns for note in notes if note] == [at, at + SECOND_NS]
    assert notes[0]
    clock = notes[0].clocks["ins_gps"]
    assert clock.state == "good"
    assert clock.offset_ns == pytest.approx(GPS_NS, abs=0.5 * MS)
    assert clock.drift_ppm is not None and clock.drift_sd_ppm is not None
    assert abs(clock.drift_ppm) < 4 * clock.drift_sd_ppm
    assert clock.validity_sd_ns < MS
    assert clock.segments == 1


def test_gnss_time_at_fti_time_comes_from_who_knows_it() -> None:
    times = DeviceTimes([device("other"), device()])
    fly(times, 0, 5)
    first = times.tick(FTI_0 + 5 * SECOND_NS)
    assert first
    assert to_table(first.gnss) == {}
    fly(times, 5, 60)
    at = FTI_0 + 60 * SECOND_NS
    note = times.tick(at)
    assert note
    assert (note.gnss.device, note.gnss.scale) == ("ins", "gps")
    assert note.gnss.time_ns == pytest.approx(at + GPS_NS, abs=0.5 * MS)


def test_one_event_reports_that_a_clock_is_known() -> None:
    times = DeviceTimes([device()])
    fly(times, 0, 120)
    (event,) = times.drain_events(FTI_0)
    assert event.text.startswith("the clock of ins (gps) is known: ")
    assert event.level == "info"
    assert times.drain_events(FTI_0) == []


def test_the_same_measurements_give_the_same_notes() -> None:
    def note() -> object:
        times = DeviceTimes([device()])
        fly(times, 0, 40)
        return times.tick(FTI_0 + 40 * SECOND_NS)

    assert note() == note()


def test_a_part_that_is_not_valid_counts_from_its_arrival_in_one_message_with_others() -> None:
    times = DeviceTimes([device()])
    fly(times, 0, 60)
    stamp = message(FTI_0 + 60 * SECOND_NS, late_ms=20.0)[0].stamp
    parts = [times.stamp("ins", Attitude(stamp=stamp, roll=0.0, valid=valid)) for valid in (True, False, True)]
    late = [(stamp.t_rx_ns - (part.stamp.t_valid_ns or 0)) / MS for part in parts]
    assert late == [pytest.approx(24.0, abs=1.0), 4.0, late[0]]
