"""The receiver's health: RXSTATUS.

    RXSTATUS 93   0 error word u32 | 4 count of status words u32 | 8 entries of 16 B: status, priority, set, clear u32
                  (receiver status, auxiliary 1, 2, 3)

The receiver status word is also in the header of every message.  Names of the bits: OEM6 firmware reference, tables
"Receiver Error", "Receiver Status" and "Auxiliary 1 Status"; bits 25-28 of the receiver status are those of OEM7
receivers, whose bits 8 to 17 have other meanings.  Bits without a name come out as ``aux2_bit_5``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.messages.measurements import DeviceStatus, Measurement, Stamp

HEAD = struct.Struct("<II")
WORD = struct.Struct("<IIII")
WORDS = ("receiver", "aux1", "aux2", "aux3")

ERRORS = {
    0: "dram_error", 1: "invalid_firmware", 2: "rom_error", 4: "esn_error", 5: "auth_code_error",
    7: "supply_voltage_error", 9: "temperature_error", 10: "minos_error", 11: "pll_rf_error", 15: "nvm_error",
    16: "software_resource_error", 17: "model_invalid", 20: "remote_loading", 21: "export_restriction",
    22: "safe_mode", 31: "component_failure",
}  # fmt: skip
STATUS = {
    0: "error", 1: "temperature", 2: "supply_voltage", 3: "antenna_unpowered", 4: "lna_failure", 5: "antenna_open",
    6: "antenna_shorted", 7: "cpu_overload", 8: "com1_overrun", 9: "com2_overrun", 10: "com3_overrun",
    11: "link_overrun", 15: "rf1_agc", 17: "rf2_agc", 18: "almanac_invalid", 19: "position_invalid",
    20: "position_fixed", 21: "clock_steering_off", 22: "clock_model_invalid", 23: "oscillator_locked",
    24: "software_resource", 25: "version_0", 26: "version_1",
    27: "hdr_tracking", 28: "digital_filtering", 29: "aux3_event", 30: "aux2_event", 31: "aux1_event",
}  # fmt: skip
AUX1 = {
    0: "rf1_jammer", 1: "rf2_jammer", 2: "rf3_jammer", 3: "position_averaging", 7: "usb_unconnected",
    8: "usb1_overrun", 9: "usb2_overrun", 10: "usb3_overrun", 12: "profile_error", 13: "ethernet_throttled",
    18: "ethernet_unconnected", 19: "icom1_overrun", 20: "icom2_overrun", 21: "icom3_overrun", 22: "ncom1_overrun",
    23: "ncom2_overrun", 24: "ncom3_overrun", 31: "imu_outlier",
}  # fmt: skip
#: Conditions that are not errors of the receiver.
HARMLESS = frozenset(
    {"almanac_invalid", "position_invalid", "position_fixed", "clock_steering_off", "clock_model_invalid",
     "oscillator_locked", "antenna_unpowered", "aux1_event", "aux2_event", "aux3_event", "version_0", "version_1",
     "hdr_tracking", "digital_filtering"}
)  # fmt: skip


def _name_bits(table: dict[int, str], prefix: str) -> tuple[str, ...]:
    return tuple(table.get(bit, f"{prefix}_bit_{bit}") for bit in range(32))


#: Names of the 32 bits of every word, the error word first.
BITS = (
    _name_bits(ERRORS, "error"),
    _name_bits(STATUS, "receiver"),
    _name_bits(AUX1, "aux1"),
    _name_bits({}, "aux2"),
    _name_bits({}, "aux3"),
)


def _flags(word: int, names: Iterable[str]) -> tuple[str, ...]:
    return tuple(name for bit, name in enumerate(names) if word >> bit & 1)


def decode_rxstatus(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """RXSTATUS: the names of all bits that are set; ok without errors and receiver conditions."""
    errors, count = HEAD.unpack_from(body)
    words = [WORD.unpack_from(body, HEAD.size + i * WORD.size)[0] for i in range(min(count, len(WORDS)))]
    flags = sum((_flags(word, names) for word, names in zip([errors, *words], BITS, strict=False)), ())
    ok = not errors and not (words and set(_flags(words[0], BITS[1])) - HARMLESS)
    return [DeviceStatus(stamp=stamp, ok=ok, flags=flags)]


def encode_words(flags: Iterable[str]) -> list[int]:
    """Error word, receiver status word and three auxiliary words."""
    names_set = frozenset(flags)
    return [sum(1 << bit for bit, name in enumerate(names) if name in names_set) for names in BITS]


def encode_rxstatus(status: DeviceStatus) -> bytes:
    """Body of RXSTATUS, without masks."""
    errors, *words = encode_words(status.flags)
    return HEAD.pack(errors, len(words)) + b"".join(WORD.pack(word, 0, 0, 0) for word in words)
