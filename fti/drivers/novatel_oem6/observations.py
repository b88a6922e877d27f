"""Raw observations: RANGE and its compressed form RANGECMP.

    RANGE 43      0 count u32 | 4 entries of 44 B: number u16, GLONASS channel + 7 u16 | pseudorange d [m],
                  its sigma f [m] | accumulated Doppler range d [cycles], its sigma f [cycles] | Doppler f [Hz]
                  C/N0 f [dB-Hz] | lock time f [s] | channel tracking status u32
    RANGECMP 140  0 count u32 | 4 entries of 24 B: tracking status u32 | 28 bits Doppler / 256 Hz, 36 bits
                  pseudorange / 128 m | i32 accumulated Doppler range / 256 cycles, modulo 2^23 cycles |
                  4 bits sigma of the pseudorange (a table), 4 bits sigma of the phase ((n + 1) / 512 cycles) |
                  u8 number | 21 bits lock time / 32 s, 5 bits C/N0 - 20 dB-Hz, 22 bits reserved

The accumulated Doppler range increases when the satellite approaches; the carrier phase, as in RINEX, is its negative.
Doppler is positive when it approaches, as in RINEX.  Without code lock there is no pseudorange, without phase lock
neither phase nor Doppler.  While the parity is unknown the phase may be wrong by half a cycle.
Numbers: 38-61 are GLONASS slots + 37, from 193 on QZSS + 192.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

from fti.constants import SPEED_OF_LIGHT
from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.drivers.novatel_oem6.signals import (
    Tracking,
    carrier_hz,
    decode_tracking,
    encode_tracking,
    glonass_channel,
)
from fti.drivers.novatel_oem6.sky import number_in_system, satellite_number
from fti.messages.measurements import Measurement, Pseudorange, Pseudoranges, Stamp

COUNT = struct.Struct("<I")
RANGE = struct.Struct("<HHdfdffffI")
RANGECMP = struct.Struct("<IQiBBI2x")
CHANNEL_BASE = 7
PHASE_MODULUS = 1 << 23
PSEUDORANGE_SD = (
    0.050, 0.075, 0.113, 0.169, 0.253, 0.380, 0.570, 0.854, 1.281, 2.375, 4.750, 9.500, 19.000, 38.000, 76.000, 152.000,
)  # fmt: skip
MAX_NUMBER = 0xFFFF


@dataclass(frozen=True, slots=True)
class _RangeEntry:
    """One entry of either message; the phase has the sign of RINEX."""

    number: int
    tracking: Tracking
    pseudorange: float
    pseudorange_sd: float
    phase: float
    phase_sd: float
    doppler: float
    cn0: float
    lock_time: float
    hz: float | None

    def to_si(self) -> Pseudorange:
        """The observation, without unlocked values."""
        t = self.tracking
        ranged = t.code_locked and 0.0 < self.pseudorange < math.inf
        phased = t.phase_locked and math.isfinite(self.phase)
        return Pseudorange(
            system=t.system,
            number=number_in_system(t.system, self.number),
            signal=t.name,
            pseudorange=self.pseudorange if ranged else None,
            pseudorange_sd=self.pseudorange_sd if ranged and math.isfinite(self.pseudorange_sd) else None,
            carrier_phase=self.phase if phased else None,
            carrier_phase_sd=self.phase_sd if phased and math.isfinite(self.phase_sd) else None,
            doppler=self.doppler if t.phase_locked and math.isfinite(self.doppler) else None,
            cn0_dbhz=self.cn0 if 0.0 < self.cn0 < math.inf else None,
            lock_time=self.lock_time if math.isfinite(self.lock_time) else None,
            carrier_hz=self.hz,
        )


def decode_range(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """RANGE."""
    observations = []
    for number, channel, psr, psr_sd, adr, adr_sd, doppler, cn0, lock, word in RANGE.iter_unpack(body[COUNT.size :]):
        t = decode_tracking(word)
        hz = carrier_hz(t.signal, channel - CHANNEL_BASE) if t.signal else None
        observations.append(_RangeEntry(number, t, psr, psr_sd, -adr, adr_sd, doppler, cn0, lock, hz).to_si())
    return [Pseudoranges(stamp=stamp, observations=tuple(observations))]


def decode_rangecmp(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """RANGECMP."""
    entries = RANGECMP.iter_unpack(body[COUNT.size :])
    return [Pseudoranges(stamp=stamp, observations=tuple(_expand(entry).to_si() for entry in entries))]


def _expand(entry: tuple[int, int, int, int, int, int]) -> _RangeEntry:
    word, both, adr, sigmas, number, rest = entry
    t = decode_tracking(word)
    doppler = (both & 0xFFFFFFF ^ 0x8000000) - 0x8000000
    psr = (both >> 28) / 128
    # The GLONASS channel is not in the message; the carrier of channel 0 is accurate enough to count turns.
    phase = _unroll(-adr / 256, psr * carrier_hz(t.signal, 0) / SPEED_OF_LIGHT) if t.signal else -adr / 256
    return _RangeEntry(
        number=number,
        tracking=t,
        pseudorange=psr,
        pseudorange_sd=PSEUDORANGE_SD[sigmas & 15],
        phase=phase,
        phase_sd=((sigmas >> 4) + 1) / 512,
        doppler=doppler / 256,
        cn0=float((rest >> 21 & 31) + 20),
        lock_time=(rest & 0x1FFFFF) / 32,
        hz=carrier_hz(t.signal, 0) if t.signal and t.system != "glonass" else None,
    )


def _unroll(phase: float, near: float) -> float:
    """The phase nearest to ``near``, shifted by whole moduli."""
    return phase + PHASE_MODULUS * round((near - phase) / PHASE_MODULUS)


def encode_range(measured: Pseudoranges) -> bytes:
    """Body of RANGE; unknown signals are omitted."""
    entries = [e for channel, o in enumerate(measured.observations) if (e := _entry(o, channel)) is not None]
    return COUNT.pack(len(entries)) + b"".join(entries)


def _entry(o: Pseudorange, channel: int) -> bytes | None:
    word = encode_tracking(o.system, o.signal, channel, o.carrier_phase is not None, o.pseudorange is not None)
    number = satellite_number(o.system, o.number)
    if word is None or not 0 <= number <= MAX_NUMBER:
        return None
    frequency = glonass_channel(o.signal, o.carrier_hz) + CHANNEL_BASE if o.system == "glonass" else 0
    return RANGE.pack(
        number, frequency, o.pseudorange or 0.0, o.pseudorange_sd or 0.0, -(o.carrier_phase or 0.0),
        o.carrier_phase_sd or 0.0, o.doppler or 0.0, o.cn0_dbhz or 0.0, o.lock_time or 0.0, word,
    )  # fmt: skip
