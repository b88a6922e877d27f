"""Verification of frame checksums without the code of the drivers, for every driver whose frames have one."""

from __future__ import annotations

import binascii
import functools
import itertools
import operator
import struct
import zlib
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega
from pymavlink.generator.mavcrc import x25crc


def _xmodem(frame: bytes) -> bool:
    """iXCOM, LightWare: CRC-16/XMODEM, little-endian at the end; with these two exchanged the remainder is zero."""
    return binascii.crc_hqx(frame[:-2] + frame[:-3:-1], 0) == 0


def _exclusive_or(frame: bytes) -> bool:
    """NMEA 0183: exclusive or of what stands between the start and the asterisk, in two hexadecimal digits."""
    body, _, reported = frame[1:].rstrip(b"\r\n").rpartition(b"*")
    return len(reported) == 2 and functools.reduce(operator.xor, body, 0) == int(reported, 16)


def _arinc429(frame: bytes) -> bool:
    """A word has odd parity; the head of a chapter 10 packet the sum of its words; APMP relies on UDP."""
    if len(frame) == 4:
        return bin(int.from_bytes(frame, "big")).count("1") % 2 == 1
    return frame[:2] != b"\x25\xeb" or sum(struct.unpack_from("<11H", frame)) & 0xFFFF == frame[22] | frame[23] << 8


def _novatel(frame: bytes) -> bool:
    """CRC-32 without the usual inversions; in hexadecimal at the end of a line; abbreviated lines have none."""
    if frame[:1] == b"\xaa":
        return _plain_crc32(frame[:-4]) == int.from_bytes(frame[-4:], "little")
    if frame[:1] in (b"#", b"%"):
        body, _, reported = frame[1:].rstrip(b"\r\n").rpartition(b"*")
        return _plain_crc32(body) == int(reported, 16)
    return frame[:1] == b"<"


def _plain_crc32(data: bytes) -> int:
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _ublox(frame: bytes) -> bool:
    """UBX: 8-bit Fletcher; NMEA on the same port; RTCM 3: CRC-24Q, whose remainder over all is zero."""
    if frame[:1] in (b"$", b"!"):
        return _exclusive_or(frame)
    if frame[:1] == b"\xd3":
        return _crc24q(frame) == 0
    sums = list(itertools.accumulate(frame[2:-2]))
    return bytes((sums[-1] & 0xFF, sum(sums) & 0xFF)) == frame[-2:]


def _crc24q(data: bytes) -> int:
    remainder = 0
    for byte in data:
        remainder ^= byte << 16
        for _ in range(8):
            remainder = remainder << 1 ^ (0x1864CFB if remainder & 0x800000 else 0)
    return remainder


def _crc32_at_end(frame: bytes) -> bool:
    """The usual CRC-32, little-endian at the end; over all with it the register holds a constant (ISO 3309)."""
    return zlib.crc32(frame) == 0x2144DF1C


def _mavlink(frame: bytes) -> bool:
    """X.25 over all behind the start, then the extra byte of the message definition."""
    second = frame[0] == 0xFD
    head, number = (10, int.from_bytes(frame[7:10], "little")) if second else (6, frame[5])
    end = head + frame[1]
    crc: Any = x25crc(frame[1:end])
    crc.accumulate(bytes([ardupilotmega.mavlink_map[number].crc_extra]))
    return bool(crc.crc == int.from_bytes(frame[end : end + 2], "little"))


def _described(frame: bytes) -> bool:
    """Binary frames of the vectors: Benewake's sum of the bytes before it, LightWare's CRC-16/XMODEM."""
    return _xmodem(frame) if frame[0] == 0xAA else sum(frame[:-1]) & 0xFF == frame[-1]


#: Driver -> the check of one frame.
CHECKED: dict[str, Callable[[bytes], bool]] = {
    "arinc429": _arinc429,
    "imar_ixcom": _xmodem,
    "lightware_binary": _xmodem,
    "mavlink": _mavlink,
    "multibeam_altimeter": _crc32_at_end,
    "nmea0183": _exclusive_or,
    "novatel_oem6": _novatel,
    "power_unit": _exclusive_or,
    "ublox_ubx": _ublox,
}
_BY_CONTROLLER = "the controller checks each CAN frame, and gives out none that is damaged"
#: Driver -> why its frames cannot be checked here.
UNCHECKED = {
    "ascii_line": "the configuration says which checksum there is; see test_checksums.py",
    "binary_struct": "the configuration says which checksum there is; see test_checksums.py",
    "canaerospace": _BY_CONTROLLER,
    "dbc": _BY_CONTROLLER,
    "deflection_pickups": _BY_CONTROLLER,
    "freeflight_ra4500": "the maker's checksum is not public; an option, off by default",
    "honeywell_hmr2300": "the device sends none; words are found by their distance",
    "lightware_ascii": "the device sends none",
    "velodyne_vlp16": "the device sends none",
}
