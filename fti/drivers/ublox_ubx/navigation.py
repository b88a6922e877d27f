"""Position, velocity, attitude and status: NAV-PVT and older messages with parts of it."""

from __future__ import annotations

import math
import struct
from datetime import date

from fti.constants import SECOND_NS
from fti.drivers.ublox_ubx.receiver_state import UNKNOWN_U32, WEEK_MS, ReceiverState, metres
from fti.formats.device_time import GPS_EPOCH_UTC_NS, LEAP_NS, WEEK_S, gps_ns, utc_ns
from fti.geodesy.formulas import geodetic_from_ecef, mat_en, rotate_back, wrap_heading
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    Measurement,
    Position,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)

#                     iTOW year.. tAcc nano fix.. lon lat h hMSL  acc  NED,g,hd  acc pDOP
PVT = struct.Struct("<I H5BB      I    i    4B    i   i   i i     2I   5i        2I  H")
HNR_PVT = struct.Struct("<IH5BBi2B2x4i4i3I")
STATUS = struct.Struct("<I4B2I")
SOL = struct.Struct("<IihBB3iI3iIHBB")
POSLLH = struct.Struct("<I4i2I")
HPPOSLLH = struct.Struct("<BHBI4i4b2I")
VELNED = struct.Struct("<I3iIIiII")
ATT = struct.Struct("<IB3x3i3I")

VALID_TIMES = 0b11  # validDate and validTime
FIX_OK, DIFFERENTIAL = 1 << 0, 1 << 1
INVALID_LLH = 1 << 0
WEEK_SET, TOW_SET = 1 << 2, 1 << 3
FIXES = ("no_fix", "dead_reckoning", "fix_2d", "fix_3d", "gnss_dead_reckoning", "time_only")
MEASURED_FIXES = frozenset(FIXES[2:5])
CARRIER = ("", "rtk_float", "rtk_fixed")
#: The receiver's own limit of accuracy for a fix, factory default [m].
ACCURACY_MASK = 100.0


def read_pvt(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-PVT: everything of one epoch; UTC, whose nanoseconds may be negative."""
    (itow, year, month, day, hour, minute, second, valid, _, nano, kind, flags, _, used, lon, lat, height, h_msl,
     h_acc, v_acc, north, east, down, speed, track, s_acc, _, pdop) = PVT.unpack_from(p)  # fmt: skip
    calendar = (year, month, day, hour, minute, second)
    stamp = Stamp(t_rx_ns)
    if valid & VALID_TIMES == VALID_TIMES:
        stamp = _utc(receiver, (t_rx_ns, itow), calendar, nano)
    else:
        receiver.clear_week()
    status = _status(stamp, kind, flags, CARRIER[flags >> 6] if flags >> 6 < len(CARRIER) else "")
    receiver.fix = status.ok
    lost = len(p) > PVT.size and bool(p[PVT.size] & INVALID_LLH)
    return [
        Velocity(
            stamp=stamp, north=north / 1000, east=east / 1000, down=down / 1000, ground_speed=speed / 1000,
            track=wrap_heading(math.radians(track * 1e-5)), sd=metres(s_acc), valid=status.ok,
        ),
        Satellites(stamp=stamp, used=used, pdop=dop(pdop)),
        status,
        Position(stamp=stamp, valid=False) if lost else Position(
            stamp=stamp, lat=math.radians(lat * 1e-7), lon=math.radians(lon * 1e-7), alt=height / 1000,
            alt_msl=h_msl / 1000, undulation=(height - h_msl) / 1000, horizontal_sd=metres(h_acc),
            vertical_sd=metres(v_acc), valid=status.ok,
        ),
    ]  # fmt: skip


def _utc(receiver: ReceiverState, times: tuple[int, int], calendar: tuple[int, ...], nano: int) -> Stamp:
    """The stamp of a UTC; also sets the GPS week from UTC and iTOW (leap seconds are small in comparison).

    times : arrival [ns], iTOW [ms]; calendar : year, month, day, hour, minute, second
    """
    (t_rx_ns, itow_ms), (year, month, day, hour, minute, second) = times, calendar
    t_dev_ns = utc_ns(date(year, month, day), ((hour * 60 + minute) * 60 + second) * SECOND_NS + nano)
    if itow_ms < WEEK_MS:
        gps_s = (t_dev_ns - GPS_EPOCH_UTC_NS + LEAP_NS) / SECOND_NS
        receiver.set_week(round((gps_s - itow_ms / 1000) / WEEK_S), itow_ms)
    return Stamp(t_rx_ns, t_dev_ns, TimeScale.UTC)


def read_hnr_pvt(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """HNR-PVT: the solution between epochs of a receiver with inertial sensors."""
    (itow, year, month, day, hour, minute, second, valid, nano, kind, flags, lon, lat, height, h_msl, ground_speed, _,
     heading, _, h_acc, v_acc, s_acc) = HNR_PVT.unpack_from(p)  # fmt: skip
    calendar = (year, month, day, hour, minute, second)
    stamp = _utc(receiver, (t_rx_ns, itow), calendar, nano) if valid & VALID_TIMES == VALID_TIMES else Stamp(t_rx_ns)
    status = _status(stamp, kind, flags)
    return [
        Velocity(
            stamp=stamp, ground_speed=ground_speed / 1000, track=wrap_heading(math.radians(heading * 1e-5)),
            sd=metres(s_acc), valid=status.ok,
        ),
        status,
        Position(
            stamp=stamp, lat=math.radians(lat * 1e-7), lon=math.radians(lon * 1e-7), alt=height / 1000,
            alt_msl=h_msl / 1000, undulation=(height - h_msl) / 1000, horizontal_sd=metres(h_acc),
            vertical_sd=metres(v_acc), valid=status.ok,
        ),
    ]  # fmt: skip


def _status(stamp: Stamp, kind: int, flags: int, carrier: str = "") -> DeviceStatus:
    """Kind of fix and flags; ok if it is measured and within the limits of the receiver."""
    fix = FIXES[kind] if kind < len(FIXES) else f"fix_{kind}"
    within = bool(flags & FIX_OK)
    names = (fix, "" if within else "beyond_limits", "dgps" if flags & DIFFERENTIAL else "", carrier)
    return DeviceStatus(stamp=stamp, ok=within and fix in MEASURED_FIXES, flags=tuple(flag for flag in names if flag))


def dop(hundredths: int) -> float | None:
    """A dilution of precision; the maximum means unknown."""
    return hundredths / 100 if hundredths < 9999 else None


def read_status(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-STATUS."""
    itow, kind, flags, *_ = STATUS.unpack_from(p)
    status = _status(receiver.stamp(t_rx_ns, itow), kind, flags)
    receiver.fix = status.ok
    return [status]


def read_sol(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-SOL: earth-centred; its accuracy is of the whole vector and bounds each part."""
    itow, fraction, week, kind, flags, x, y, z, p_acc, vx, vy, vz, s_acc, pdop, _, used = SOL.unpack_from(p)
    stamp = Stamp(t_rx_ns)
    if flags & WEEK_SET and flags & TOW_SET and week > 0 and itow < WEEK_MS:
        receiver.set_week(week, itow)
        stamp = Stamp(t_rx_ns, gps_ns(week, itow * 1_000_000 + fraction), TimeScale.GPS)
    else:
        receiver.clear_week()
    status = _status(stamp, kind, flags)
    receiver.fix = status.ok
    lat, lon, alt = geodetic_from_ecef(x / 100, y / 100, z / 100)
    north, east, down = rotate_back(mat_en(lat, lon), (vx / 100, vy / 100, vz / 100))
    sd = None if p_acc == UNKNOWN_U32 else p_acc / 100
    speed_sd = None if s_acc == UNKNOWN_U32 else s_acc / 100
    return [
        Velocity(stamp=stamp, north=north, east=east, down=down, sd=speed_sd, valid=status.ok),
        Satellites(stamp=stamp, used=used, pdop=dop(pdop)),
        status,
        Position(
            stamp=stamp, lat=lat, lon=lon, alt=alt, horizontal_sd=sd, vertical_sd=sd, valid=status.ok
        ),
    ]  # fmt: skip


def _is_trusted(receiver: ReceiverState, sd: float | None, limit: float) -> bool:
    """Validity of messages without a flag: that of the newest fix, and an accuracy within the limit."""
    return receiver.fix is not False and sd is not None and sd <= limit


def read_posllh(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-POSLLH: has no validity flag."""
    itow, lon, lat, height, h_msl, h_acc, v_acc = POSLLH.unpack_from(p)
    horizontal_sd = metres(h_acc)
    return [
        Position(
            stamp=receiver.stamp(t_rx_ns, itow), lat=math.radians(lat * 1e-7), lon=math.radians(lon * 1e-7),
            alt=height / 1000, alt_msl=h_msl / 1000, undulation=(height - h_msl) / 1000,
            horizontal_sd=horizontal_sd, vertical_sd=metres(v_acc),
            valid=_is_trusted(receiver, horizontal_sd, ACCURACY_MASK),
        )
    ]  # fmt: skip


def read_hpposllh(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-HPPOSLLH: degrees to 1e-9, lengths to 0.1 mm."""
    _, _, flags, itow, lon, lat, height, h_msl, lon_hp, lat_hp, height_hp, h_msl_hp, h_acc, v_acc = (
        HPPOSLLH.unpack_from(p)
    )
    stamp = receiver.stamp(t_rx_ns, itow)
    if flags & INVALID_LLH:
        return [Position(stamp=stamp, valid=False)]
    horizontal_sd = None if h_acc == UNKNOWN_U32 else h_acc / 10_000
    alt, alt_msl = (height * 10 + height_hp) / 10_000, (h_msl * 10 + h_msl_hp) / 10_000
    return [
        Position(
            stamp=stamp, lat=math.radians((lat * 100 + lat_hp) * 1e-9), lon=math.radians((lon * 100 + lon_hp) * 1e-9),
            alt=alt, alt_msl=alt_msl, undulation=alt - alt_msl, horizontal_sd=horizontal_sd,
            vertical_sd=None if v_acc == UNKNOWN_U32 else v_acc / 10_000,
            valid=_is_trusted(receiver, horizontal_sd, ACCURACY_MASK),
        )
    ]  # fmt: skip


def read_velned(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-VELNED: cm/s; has no validity flag."""
    itow, north, east, down, _, ground_speed, heading, s_acc, _ = VELNED.unpack_from(p)
    sd = None if s_acc == UNKNOWN_U32 else s_acc / 100
    return [
        Velocity(
            stamp=receiver.stamp(t_rx_ns, itow), north=north / 100, east=east / 100, down=down / 100,
            ground_speed=ground_speed / 100, track=wrap_heading(math.radians(heading * 1e-5)), sd=sd,
            valid=_is_trusted(receiver, sd, ACCURACY_MASK),
        )
    ]  # fmt: skip


def read_att(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """NAV-ATT: the attitude of a receiver with inertial sensors; an accuracy of 0 means none."""
    itow, _, roll, pitch, heading, *accuracies = ATT.unpack_from(p)
    roll_sd, pitch_sd, heading_sd = (math.radians(a * 1e-5) if 0 < a < UNKNOWN_U32 else None for a in accuracies)
    has_tilt = roll_sd is not None and pitch_sd is not None
    return [
        Attitude(
            stamp=receiver.stamp(t_rx_ns, itow),
            roll=math.radians(roll * 1e-5), pitch=math.radians(pitch * 1e-5),
            heading=None if heading_sd is None else wrap_heading(math.radians(heading * 1e-5)),
            roll_sd=roll_sd, pitch_sd=pitch_sd, heading_sd=heading_sd, valid=has_tilt,
        )
    ]  # fmt: skip
