"""Time and the receiver's clock: NAV-TIMEGPS, NAV-TIMEUTC, NAV-CLOCK."""

from __future__ import annotations

import struct
from datetime import date

from fti.constants import SECOND_NS
from fti.drivers.ublox_ubx.frames import frame
from fti.drivers.ublox_ubx.receiver_state import UNKNOWN_U32, WEEK_MS, ReceiverState
from fti.formats.device_time import gps_ns, utc_ns
from fti.messages.measurements import DeviceTime, Measurement, ReceiverClock, Stamp, TimeScale

TIMEGPS = struct.Struct("<IihbBI")
TIMEUTC = struct.Struct("<IIiH6B")
CLOCK = struct.Struct("<IiiII")
TOW_VALID, WEEK_VALID, UTC_VALID = 1 << 0, 1 << 1, 1 << 2
NS, PS = 1e-9, 1e-12


def read_timegps(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-TIMEGPS: iTOW [ms] and the rest of it [ns]."""
    itow, fraction, week, _, valid, _ = TIMEGPS.unpack_from(p)
    if not (valid & TOW_VALID and valid & WEEK_VALID) or week < 0 or itow >= WEEK_MS:
        receiver.clear_week()
        return []
    receiver.set_week(week, itow)
    return [DeviceTime(stamp=Stamp(t_rx_ns, gps_ns(week, itow * 1_000_000 + fraction), TimeScale.GPS))]


def read_timeutc(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-TIMEUTC; the nanoseconds may be negative."""
    _, _, nano, year, month, day, hour, minute, second, valid = TIMEUTC.unpack_from(p)
    if not valid & UTC_VALID:
        return []
    of_day_ns = ((hour * 60 + minute) * 60 + second) * SECOND_NS + nano
    return [DeviceTime(stamp=Stamp(t_rx_ns, utc_ns(date(year, month, day), of_day_ns), TimeScale.UTC))]


def read_clock(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-CLOCK: [ns], [ns/s], [ns], [ps/s]."""
    itow, bias, drift, t_acc, f_acc = CLOCK.unpack_from(p)
    return [
        ReceiverClock(
            stamp=receiver.stamp(t_rx_ns, itow),
            offset=bias * NS,
            drift=drift * NS,
            offset_sd=None if t_acc == UNKNOWN_U32 else t_acc * NS,
            drift_sd=None if f_acc == UNKNOWN_U32 else f_acc * PS,
            valid=t_acc != UNKNOWN_U32 and receiver.fix is not False,
        )
    ]


def make_clock(itow_ms: int, clock: ReceiverClock) -> bytes:
    """NAV-CLOCK."""
    bias, drift = (round((value or 0.0) / NS) for value in (clock.offset, clock.drift))
    t_acc = UNKNOWN_U32 if clock.offset_sd is None or not clock.valid else round(clock.offset_sd / NS)
    f_acc = UNKNOWN_U32 if clock.drift_sd is None else round(clock.drift_sd / PS)
    return frame(0x01, 0x22, CLOCK.pack(itow_ms, bias, drift, t_acc, f_acc))
