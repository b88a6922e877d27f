"""The channel tracking status word, and the signals that it names.

    bit 0-4 tracking state, 5-9 channel, 10 phase locked, 11 parity known, 12 code locked, 13-15 correlator,
        16-18 system, 20 grouped, 21-25 signal, 27 primary L1 channel, 28 half cycle added, 30 locked out, 31 forced

Signals are named by band and attribute of a RINEX 3 observation code.
"""

from __future__ import annotations

from typing import NamedTuple

SYSTEMS = ("gps", "glonass", "sbas", "galileo", "beidou", "qzss", "navic", "other")
PHASE_LOCKED, PARITY_KNOWN, CODE_LOCKED = 1 << 10, 1 << 11, 1 << 12
SYSTEM_BIT, SIGNAL_BIT = 16, 21
PHASE_LOCK_LOOP, GROUPED, PRIMARY_L1 = 4, 1 << 20, 1 << 27

L1, L2, L5, E6, E5B, E5, B1I, B3I = 1575.42, 1227.60, 1176.45, 1278.75, 1207.14, 1191.795, 1561.098, 1268.52
GLONASS_L1, GLONASS_L2, GLONASS_L3 = 1602.0, 1246.0, 1202.025
GLONASS_STEP = {GLONASS_L1: 0.5625, GLONASS_L2: 0.4375, GLONASS_L3: 0.0}


class GnssSignal(NamedTuple):
    """RINEX name, and carrier [MHz] (of GLONASS: of channel 0)."""

    name: str
    mhz: float


#: Signals by system and number; if two numbers are one signal, the encoder uses the first.
SIGNALS: dict[str, dict[int, GnssSignal]] = {
    "gps": {
        0: GnssSignal("L1C", L1), 5: GnssSignal("L2P", L2), 9: GnssSignal("L2W", L2), 14: GnssSignal("L5Q", L5),
        16: GnssSignal("L1L", L1), 17: GnssSignal("L2S", L2),
    },
    "glonass": {
        0: GnssSignal("L1C", GLONASS_L1), 1: GnssSignal("L2C", GLONASS_L2), 5: GnssSignal("L2P", GLONASS_L2),
        6: GnssSignal("L3Q", GLONASS_L3),
    },
    "sbas": {0: GnssSignal("L1C", L1), 6: GnssSignal("L5I", L5)},
    "galileo": {
        1: GnssSignal("L1B", L1), 2: GnssSignal("L1C", L1), 6: GnssSignal("L6B", E6), 7: GnssSignal("L6C", E6),
        12: GnssSignal("L5Q", L5), 17: GnssSignal("L7Q", E5B), 20: GnssSignal("L8Q", E5),
    },
    "beidou": {
        0: GnssSignal("L2I", B1I), 1: GnssSignal("L7I", E5B), 2: GnssSignal("L6I", B3I), 4: GnssSignal("L2I", B1I),
        5: GnssSignal("L7I", E5B), 6: GnssSignal("L6I", B3I), 7: GnssSignal("L1P", L1), 9: GnssSignal("L5P", L5),
        11: GnssSignal("L7D", E5B),
    },
    "qzss": {
        0: GnssSignal("L1C", L1), 14: GnssSignal("L5Q", L5), 16: GnssSignal("L1L", L1), 17: GnssSignal("L2S", L2),
        27: GnssSignal("L6L", E6),
    },
    "navic": {0: GnssSignal("L5A", L5)},
    "other": {},
}  # fmt: skip


class Tracking(NamedTuple):
    """Decoded status word; signal is None if the document does not name it."""

    system: str
    number: int
    signal: GnssSignal | None
    phase_locked: bool
    code_locked: bool

    @property
    def name(self) -> str:
        """Name of the signal."""
        return self.signal.name if self.signal else f"signal_{self.number}"


def decode_tracking(word: int) -> Tracking:
    """Decode a status word."""
    system, number = SYSTEMS[word >> SYSTEM_BIT & 7], word >> SIGNAL_BIT & 31
    signal = SIGNALS[system].get(number)
    return Tracking(system, number, signal, bool(word & PHASE_LOCKED), bool(word & CODE_LOCKED))


def encode_tracking(system: str, name: str, channel: int, phase_locked: bool, code_locked: bool) -> int | None:
    """The status word of a signal on a channel; None for an unknown signal."""
    number = next((n for n, signal in SIGNALS.get(system, {}).items() if signal.name == name), None)
    if number is None:
        return None
    word = PHASE_LOCK_LOOP | (channel & 31) << 5 | SYSTEMS.index(system) << SYSTEM_BIT | number << SIGNAL_BIT | GROUPED
    word |= PRIMARY_L1 if name == "L1C" else 0
    return word | (PHASE_LOCKED | PARITY_KNOWN if phase_locked else 0) | (CODE_LOCKED if code_locked else 0)


def carrier_hz(signal: GnssSignal, channel: int) -> float:
    """Frequency of the carrier; channel : of GLONASS, -7..6."""
    return (signal.mhz + GLONASS_STEP.get(signal.mhz, 0.0) * channel) * 1e6


def glonass_channel(name: str, hz: float | None) -> int:
    """The channel of a GLONASS carrier; 0 if unknown."""
    signal = next((s for s in SIGNALS["glonass"].values() if s.name == name), None)
    if signal is None or hz is None or not GLONASS_STEP[signal.mhz]:
        return 0
    return round((hz / 1e6 - signal.mhz) / GLONASS_STEP[signal.mhz])
