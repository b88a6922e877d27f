"""Raw observations: RXM-RAWX and its predecessor RXM-RAW.

The time of the epoch is that of the receiver clock, near GPS time; NAV-CLOCK has the offset.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable

from fti.constants import SECOND_NS
from fti.drivers.ublox_ubx.frames import PayloadShape, frame
from fti.drivers.ublox_ubx.receiver_state import ReceiverState
from fti.drivers.ublox_ubx.sky import SYSTEMS, system
from fti.formats.device_time import WEEK_S, gps_ns, gps_week
from fti.messages.measurements import Measurement, Pseudorange, Pseudoranges, Stamp, TimeScale

HEAD = struct.Struct("<dHbBBBxx")
SIGNAL = struct.Struct("<ddfBBBBHBBBBBx")
RAW_HEAD = struct.Struct("<ihBx")
RAW_SATELLITE = struct.Struct("<ddfBbbB")
RAWX_SHAPE = PayloadShape(HEAD.size, SIGNAL.size, 11)
RAW_SHAPE = PayloadShape(RAW_HEAD.size, RAW_SATELLITE.size, 6)

PSEUDORANGE_VALID, PHASE_VALID, HALF_CYCLE_KNOWN = 1 << 0, 1 << 1, 1 << 2
PSEUDORANGE_SD_UNIT, PHASE_SD_UNIT, PHASE_SD_UNKNOWN = 0.01, 0.004, 15
LEAP_KNOWN, LEAP_S = 1 << 0, 18
LOCK_TIME_MAX_MS = 64_500
RAW_PSEUDORANGE_OK, RAW_PHASE_OK = 4, 5  # mesQI
GLONASS_CHANNEL_0 = 7
DOPPLER_SD_CODE = 5

#: Signals by system and sigId, as the band and attribute of a RINEX 3 observation code.
SIGNALS = {
    "gps": {0: "L1C", 3: "L2L", 4: "L2S", 6: "L5I", 7: "L5Q"},
    "sbas": {0: "L1C"},
    "galileo": {0: "L1C", 1: "L1B", 3: "L5I", 4: "L5Q", 5: "L7I", 6: "L7Q", 8: "L6B", 9: "L6C", 10: "L6A"},
    "beidou": {0: "L2I", 1: "L2I", 2: "L7I", 3: "L7I", 4: "L6I", 10: "L6I", 5: "L1P", 6: "L1D", 7: "L5P", 8: "L5D"},
    "imes": {0: "L1C"},
    "qzss": {0: "L1C", 1: "L1Z", 4: "L2S", 5: "L2L", 8: "L5I", 9: "L5Q", 12: "L1E"},
    "glonass": {0: "L1C", 2: "L2C"},
    "navic": {0: "L5A"},
}
#: The lowest sigId of each signal.
SIGNAL_IDS = {(name, signal): i for name, signals in SIGNALS.items() for i, signal in reversed(signals.items())}
#: Carriers by band; exceptions; GLONASS by its channel (freqId - 7): carrier of channel 0 and step.
BANDS = {"1": 1575.42e6, "2": 1227.60e6, "5": 1176.45e6, "6": 1278.75e6, "7": 1207.14e6}
SPECIAL_CARRIERS_HZ = {("beidou", "L2I"): 1561.098e6, ("beidou", "L6I"): 1268.52e6}
GLONASS = {"L1C": (1602.0e6, 0.5625e6), "L2C": (1246.0e6, 0.4375e6)}
CARRIERS = {
    (name, signal): SPECIAL_CARRIERS_HZ.get((name, signal), BANDS[signal[1]])
    for name, signals in SIGNALS.items()
    for signal in signals.values()
    if name != "glonass"
}


def carrier_hz(name: str, signal: str, frequency_id: int) -> float | None:
    """Nominal frequency of the carrier [Hz]; None for a signal without a name."""
    if name == "glonass" and signal in GLONASS:
        base, step = GLONASS[signal]
        return base + step * (frequency_id - GLONASS_CHANNEL_0)
    return CARRIERS.get((name, signal))


def frequency_id(o: Pseudorange) -> int:
    """The freqId of an observation; channel 0 if its carrier is unknown, 0 for other systems than GLONASS."""
    if o.system != "glonass":
        return 0
    base, step = GLONASS[o.signal]
    return GLONASS_CHANNEL_0 + (0 if o.carrier_hz is None else round((o.carrier_hz - base) / step))


def read_rawx(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """RXM-RAWX."""
    second, week, _, count, _, _ = HEAD.unpack_from(p)
    if len(p) != RAWX_SHAPE.size + count * RAWX_SHAPE.step:
        raise ValueError("count of signals and length differ")
    stamp = Stamp(t_rx_ns)
    if week and 0.0 <= second < WEEK_S:
        stamp = Stamp(t_rx_ns, gps_ns(week, round(second * SECOND_NS)), TimeScale.GPS)
    return [Pseudoranges(stamp=stamp, observations=tuple(map(_signal, SIGNAL.iter_unpack(p[HEAD.size :]))))]


def _signal(wire: tuple[float, float, float, int, int, int, int, int, int, int, int, int, int]) -> Pseudorange:
    (pseudorange, phase, doppler, gnss_id, number, signal_id, channel, lock_ms, cn0, pseudorange_sd, phase_sd, _,
     tracking) = wire  # fmt: skip
    name = system(gnss_id)
    signal = SIGNALS.get(name, {}).get(signal_id) or f"signal_{signal_id}"
    ranged = tracking & PSEUDORANGE_VALID and math.isfinite(pseudorange)
    phased = tracking & PHASE_VALID and math.isfinite(phase)
    phase_sd &= 0x0F
    return Pseudorange(
        system=name,
        number=number,
        signal=signal,
        pseudorange=pseudorange if ranged else None,
        pseudorange_sd=PSEUDORANGE_SD_UNIT * (1 << (pseudorange_sd & 0x0F)) if ranged else None,
        carrier_phase=phase if phased else None,
        carrier_phase_sd=PHASE_SD_UNIT * phase_sd if phased and phase_sd != PHASE_SD_UNKNOWN else None,
        doppler=doppler if math.isfinite(doppler) else None,
        cn0_dbhz=float(cn0) if cn0 else None,
        lock_time=lock_ms / 1000,
        carrier_hz=carrier_hz(name, signal, channel),
    )


def read_raw(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """RXM-RAW: GPS and SBAS on L1."""
    itow, week, count = RAW_HEAD.unpack_from(p)
    if len(p) != RAW_SHAPE.size + count * RAW_SHAPE.step:
        raise ValueError("count of satellites and length differ")
    stamp = Stamp(t_rx_ns)
    if week > 0 and 0 <= itow < WEEK_S * 1000:
        stamp = Stamp(t_rx_ns, gps_ns(week, itow * 1_000_000), TimeScale.GPS)
    return [Pseudoranges(stamp=stamp, observations=tuple(_raw(RAW_SATELLITE.iter_unpack(p[RAW_HEAD.size :]))))]


def _raw(wires: Iterable[tuple[float, float, float, int, int, int, int]]) -> Iterable[Pseudorange]:
    for phase, pseudorange, doppler, number, quality, cn0, _ in wires:
        ranged = quality >= RAW_PSEUDORANGE_OK and math.isfinite(pseudorange)
        yield Pseudorange(
            system="sbas" if number >= 120 else "gps",
            number=number,
            signal="L1C",
            pseudorange=pseudorange if ranged else None,
            carrier_phase=phase if quality >= RAW_PHASE_OK and math.isfinite(phase) else None,
            doppler=doppler if ranged and math.isfinite(doppler) else None,
            cn0_dbhz=float(cn0) if cn0 > 0 else None,
            carrier_hz=BANDS["1"],
        )


def make_rawx(t_gps_ns: int, observations: tuple[Pseudorange, ...]) -> bytes:
    """RXM-RAWX of these observations; unknown signals are omitted."""
    week, of_week_ns = gps_week(t_gps_ns)
    encodable = [(o, i) for o in observations if (i := SIGNAL_IDS.get((o.system, o.signal))) is not None]
    head = HEAD.pack(of_week_ns / SECOND_NS, week, LEAP_S, len(encodable), LEAP_KNOWN, 1)
    return frame(0x02, 0x15, head + b"".join(_pack(o, i) for o, i in encodable))


def _pack(o: Pseudorange, signal_id: int) -> bytes:
    tracking = (PSEUDORANGE_VALID if o.pseudorange is not None else 0) | (
        PHASE_VALID | HALF_CYCLE_KNOWN if o.carrier_phase is not None else 0
    )
    sd = o.pseudorange_sd or PSEUDORANGE_SD_UNIT
    pseudorange_sd = min(max(round(math.log2(sd / PSEUDORANGE_SD_UNIT)), 0), 15)
    phase_sd = PHASE_SD_UNKNOWN if o.carrier_phase_sd is None else min(round(o.carrier_phase_sd / PHASE_SD_UNIT), 14)
    lock_ms = min(round((o.lock_time or 0.0) * 1000), LOCK_TIME_MAX_MS)
    return SIGNAL.pack(
        o.pseudorange or 0.0, o.carrier_phase or 0.0, o.doppler or 0.0, SYSTEMS.index(o.system), o.number, signal_id,
        frequency_id(o), lock_ms, round(o.cn0_dbhz or 0.0), pseudorange_sd, phase_sd,
        DOPPLER_SD_CODE, tracking,
    )  # fmt: skip
