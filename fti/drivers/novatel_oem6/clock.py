"""Time: the stamp of every message, TIME and CLOCKMODEL.

    TIME 101, 44 B        0 clock model status u32 | 4 offset d [s] | 12 its sigma d [s] | 20 UTC offset d [s]
                          28 UTC year u32, month, day, hour, minute u8, millisecond u32 | 40 UTC status u32
    CLOCKMODEL 16, 132 B  0 clock model status u32 | 4 rejected u32 | 8 propagated, updated [ms] u32
                          16 bias [m], rate [m/s], reserved d | 40 covariance 9 d, row by row | 112 last bias [m],
                          last rate [m/s] d | 128 constellation changed u32

offset = receiver time - GPS time; CLOCKMODEL has it times the speed of light [m].
"""

from __future__ import annotations

import math
import struct

from msgspec.structs import replace

from fti.constants import SECOND_NS, SPEED_OF_LIGHT
from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.formats.device_time import GPS_EPOCH_UTC_NS, gps_ns, gps_week, utc_date
from fti.messages.measurements import DeviceTime, Measurement, Reading, ReceiverClock, Stamp, TimeScale

TIME = struct.Struct("<IdddIBBBBII")
CLOCKMODEL = struct.Struct("<IIII3d9d2dI")
WEEK_MS = 604_800_000

#: Statuses with a time accurate to microseconds, or extrapolated from such a time: FREEWHEELING, FINE,
#: FINEBACKUPSTEERING, FINESTEERING.  COARSE is +-10 ms; SATTIME is the time of a satellite message.
TIME_KNOWN = frozenset({130, 160, 170, 180})
FINE_STEERING = 180
MODEL_VALID, MODEL_INVALID = 0, 3
UTC_INVALID, UTC_VALID = 0, 1
UTC_OFFSET = "utc_offset"


def finite_or_none(value: float) -> float | None:
    """The value; None if it is not finite."""
    return value if math.isfinite(value) else None


def stamp_of(header: NovatelHeader, t_rx_ns: int) -> Stamp:
    """Stamp with the GPS time of the header, if valid."""
    if header.time_status not in TIME_KNOWN or header.milliseconds >= WEEK_MS:
        return Stamp(t_rx_ns)
    return Stamp(t_rx_ns, gps_ns(header.week, header.milliseconds * 1_000_000), TimeScale.GPS)


def subtract_latency(stamp: Stamp, latency_s: float) -> Stamp:
    """The stamp, latency_s before the time of the header."""
    if stamp.t_dev_ns is None or not math.isfinite(latency_s) or not 0.0 <= latency_s < 60.0:
        return stamp
    return replace(stamp, t_dev_ns=stamp.t_dev_ns - round(latency_s * SECOND_NS))


def decode_time(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """TIME: offset of the receiver's clock, UTC - GPS, and the time itself."""
    status, offset, offset_sd, utc_offset, *_, utc_status = TIME.unpack_from(body)
    clock = ReceiverClock(
        stamp=stamp,
        offset=finite_or_none(offset),
        offset_sd=finite_or_none(offset_sd),
        valid=status == MODEL_VALID and math.isfinite(offset),
    )
    is_utc_known = utc_status == UTC_VALID and math.isfinite(utc_offset)
    leap = Reading(stamp=stamp, name=UTC_OFFSET, value=finite_or_none(utc_offset), unit="s", valid=is_utc_known)
    return [clock, leap, DeviceTime(stamp=stamp)]


def decode_clockmodel(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """CLOCKMODEL in seconds: offset, drift and their sigma."""
    v = CLOCKMODEL.unpack_from(body)
    bias, rate, bias_variance, rate_variance = (finite_or_none(x) for x in (v[4], v[5], v[7], v[11]))
    return [
        ReceiverClock(
            stamp=stamp,
            offset=_over_c(bias),
            drift=_over_c(rate),
            offset_sd=_sd(bias_variance),
            drift_sd=_sd(rate_variance),
            valid=v[0] == MODEL_VALID and bias is not None and rate is not None,
        )
    ]


def _over_c(metres: float | None) -> float | None:
    return None if metres is None else metres / SPEED_OF_LIGHT


def _sd(variance: float | None) -> float | None:
    return None if variance is None or variance < 0.0 else math.sqrt(variance) / SPEED_OF_LIGHT


def encode_time(clock: ReceiverClock | None, utc_offset: Reading | None, t_gps_ns: int | None) -> bytes:
    """Body of TIME; without a time the calendar is zero and UTC is invalid."""
    status = MODEL_VALID if clock is not None and clock.valid else MODEL_INVALID
    offset = (clock and clock.offset) or 0.0
    offset_sd = (clock and clock.offset_sd) or 0.0
    seconds = (utc_offset and utc_offset.value) or 0.0
    is_utc_known = t_gps_ns is not None and utc_offset is not None and utc_offset.valid
    calendar = _calendar(t_gps_ns, seconds - offset) if is_utc_known and t_gps_ns is not None else (0,) * 6
    return TIME.pack(status, offset, offset_sd, seconds, *calendar, UTC_VALID if is_utc_known else UTC_INVALID)


def _calendar(t_gps_ns: int, offset_s: float) -> tuple[int, ...]:
    """Year, month, day, hour, minute, millisecond of UTC."""
    utc = GPS_EPOCH_UTC_NS + t_gps_ns + round(offset_s * 1000) * 1_000_000
    day, of_day_ns = utc_date(utc)
    minutes, rest_ns = divmod(of_day_ns, 60 * SECOND_NS)
    return day.year, day.month, day.day, minutes // 60, minutes % 60, rest_ns // 1_000_000


def encode_clockmodel(clock: ReceiverClock, t_gps_ns: int | None) -> bytes:
    """Body of CLOCKMODEL; missing values are zero."""
    at_ms = gps_week(t_gps_ns)[1] // 1_000_000 if t_gps_ns is not None else 0
    bias, rate = ((x or 0.0) * SPEED_OF_LIGHT for x in (clock.offset, clock.drift))
    variances = [((x or 0.0) * SPEED_OF_LIGHT) ** 2 for x in (clock.offset_sd, clock.drift_sd)]
    covariance = (variances[0], 0.0, 0.0, 0.0, variances[1], 0.0, 0.0, 0.0, 0.0)
    status = MODEL_VALID if clock.valid else MODEL_INVALID
    return CLOCKMODEL.pack(status, 0, at_ms, at_ms, bias, rate, 0.0, *covariance, bias, rate, 0)
