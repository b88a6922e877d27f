"""Frames of iXCOM: header, footer, checksum; the table is in the package's docstring."""

from __future__ import annotations

import binascii
import struct

from msgspec import Struct

from fti.constants import SECOND_NS
from fti.drivers._framing import Skip, skip_to
from fti.drivers.imar_ixcom.status import Footer, decode_footer
from fti.formats.device_time import gps_ns, gps_week
from fti.messages.measurements import Stamp, TimeScale

SYNC = b"\x7e"
HEADER = struct.Struct("<BBBBHHII")
FOOTER_SIZE = 4
FRAME_MIN, FRAME_MAX = HEADER.size + FOOTER_SIZE, 4096


class IxcomFrame(Struct, frozen=True, gc=False):
    """A whole, checked frame."""

    number: int
    counter: int
    stamp: Stamp
    payload: bytes
    footer: Footer


def measure(buffer: bytearray) -> int | Skip:
    """Framing; see ``fti.drivers._framing``."""
    if buffer[0] != SYNC[0]:
        return skip_to(buffer, SYNC) or 0
    if len(buffer) < 6:
        return 0
    length = buffer[4] | buffer[5] << 8
    if not FRAME_MIN <= length <= FRAME_MAX:
        return Skip(1, "bad_length")
    if len(buffer) < length:
        return 0
    good = binascii.crc_hqx(buffer[: length - 2], 0) == buffer[length - 2] | buffer[length - 1] << 8
    return length if good else Skip(1, "bad_checksum")


def read_frame(data: bytes, t_rx_ns: int) -> IxcomFrame:
    """The parts of a checked frame; without device time until GNSS has set the clock."""
    _, number, counter, _, _, week, seconds, micros = HEADER.unpack_from(data)
    footer = decode_footer(data[-4] | data[-3] << 8)
    t_gps_ns = gps_ns(week, seconds * SECOND_NS + micros * 1000)
    stamp = Stamp(t_rx_ns, t_gps_ns, TimeScale.GPS) if footer.is_time_valid else Stamp(t_rx_ns)
    return IxcomFrame(number, counter, stamp, data[HEADER.size : -FOOTER_SIZE], footer)


def encode_frame(number: int, counter: int, t_gps_ns: int, status: int, payload: bytes) -> bytes:
    """Any frame of the protocol.  t_gps_ns : GPS time [ns]; status : the footer's word."""
    week, in_week_ns = gps_week(t_gps_ns + 500)  # to the nearest microsecond
    seconds, rest_ns = divmod(in_week_ns, SECOND_NS)
    length = HEADER.size + len(payload) + FOOTER_SIZE
    body = HEADER.pack(SYNC[0], number, counter & 0xFF, 0, length, week & 0xFFFF, seconds, rest_ns // 1000)
    body += payload + status.to_bytes(2, "little")
    return body + binascii.crc_hqx(body, 0).to_bytes(2, "little")
