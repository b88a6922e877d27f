"""IRIG 106 chapter 10 packets with ARINC 429 words, type 0x38, in a stream, a file or UDP datagrams.

Document: IRIG 106-22 chapter 11 (packet header 11.2.1, ARINC-429 data format 0 11.2.9).  Little-endian:

    0  sync 25 EB | 2 channel u16 | 4 packet length u32 | 8 data length u32 | 12 version u8 | 13 sequence u8
    14 flags u8 | 15 type u8 | 16 relative time counter, 48 bits of 100 ns | 22 checksum u16, sum of the 11 before
    24 secondary header, 12 bytes, when flags bit 7: time u64 | 0 u16 | checksum u16, sum of the 5 before
       channel specific word: number of words u16 | 0 u16
       for each word:   gap u20, 100 ns since the word before | 0 | speed | parity error | format error | bus u8
                        ARINC word u32
       filler to 4 bytes, and checksum of the body when flags bits 0-1: sum of bytes, u16 or u32 words (1, 2, 3)

The counter is the time of the first word; the gaps are added to it.  Packets of other types are framed and counted
as ``packet_0x11``.  A UDP datagram of the standard begins with 4 bytes of its own (format 1, a whole packet), which
are counted as skipped; packets in several datagrams are not reassembled.  A packet longer than LIMIT is
skipped: recorders close one every 100 ms, in which eight full buses make 18 kB.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from fti.drivers._framing import Skip, skip_to
from fti.drivers.arinc429.packets import ReceivedWord

SYNC = b"\x25\xeb"
TRANSFER_HEADER = 4  # of a datagram: version 1, whole packet, sequence number
WHOLE_PACKET = 0x01
HEADER = struct.Struct("<2sHIIBBBBIHH")
SECONDARY_SIZE = 12
HAS_SECONDARY = 0x80
TYPE_ARINC = 0x38
VERSION = 6  # data format version of IRIG 106-15 and later
SPECIFIC = struct.Struct("<HH")
RECORD = struct.Struct("<II")
GAP = 0xFFFFF
HIGH_SPEED, PARITY_ERROR, FORMAT_ERROR = 1 << 21, 1 << 22, 1 << 23
TICK_NS = 100
CHECKSUM_32 = 3
SUMMANDS = {1: (1, "B"), 2: (2, "H"), 3: (4, "I")}  # size and struct code of the summands


def _sum(data: bytes | bytearray, code: str, size: int) -> int:
    numbers: tuple[int, ...] = struct.unpack(f"<{len(data) // size}{code}", data)
    return sum(numbers) & ((1 << 8 * size) - 1)


def _header_end(flags: int) -> int:
    return HEADER.size + (SECONDARY_SIZE if flags & HAS_SECONDARY else 0)


class Chapter10:
    """Packets of a recorder.  Stateful: it tracks the sequence numbers of each channel."""

    LIMIT = 65_536

    def __init__(self) -> None:
        self._sequence = 0
        self._last_packets: dict[int, tuple[int, int]] = {}  # channel -> number and time of its last packet

    def measure(self, buffer: bytearray) -> int | Skip:
        """See ``_framing``."""
        if buffer[0] == WHOLE_PACKET:
            return self._measure_transfer_header(buffer)
        if skip := self._to_sync(buffer):
            return skip
        if len(buffer) < HEADER.size:
            return 0
        if _sum(buffer[: HEADER.size - 2], "H", 2) != int.from_bytes(buffer[HEADER.size - 2 : HEADER.size], "little"):
            return Skip(1, "bad_header_checksum")
        return self._measure_body(buffer)

    @staticmethod
    def _measure_transfer_header(buffer: bytearray) -> int | Skip:
        if len(buffer) < TRANSFER_HEADER + len(SYNC):
            return 0
        is_one = buffer.startswith(SYNC, TRANSFER_HEADER)
        return Skip(TRANSFER_HEADER, "transfer_header") if is_one else Skip(1, "no_sync")

    @staticmethod
    def _to_sync(buffer: bytearray) -> Skip | None:
        """Skip to the next sync, or to a possible datagram header before it."""
        skip = skip_to(buffer, SYNC)
        if skip is None:
            return None
        at = buffer.find(WHOLE_PACKET, 0, skip.size)
        return Skip(at, skip.reason) if at > 0 else skip

    def _measure_body(self, buffer: bytearray) -> int | Skip:
        _, _, length, data_length, _, _, flags, kind, _, _, _ = HEADER.unpack_from(buffer)
        start = _header_end(flags)
        trailer = length - start - data_length
        if trailer < SUMMANDS.get(flags & 3, (0, ""))[0] or length % 4:
            return Skip(1, "bad_length")
        if length > self.LIMIT:
            return Skip(1, "too_long")
        if kind == TYPE_ARINC and len(buffer) >= start + SPECIFIC.size:
            count, _ = SPECIFIC.unpack_from(buffer, start)
            if data_length != SPECIFIC.size + count * RECORD.size:
                return Skip(1, "bad_count")
        if len(buffer) < length:
            return 0
        return Skip(1, "bad_checksum") if _is_damaged(buffer, length, flags) else length

    def unpack(self, packet: bytes) -> tuple[str, list[ReceivedWord]]:
        """The words of an ARINC 429 packet; none for other types."""
        _, _, _, _, _, _, flags, kind, low, high, _ = HEADER.unpack_from(packet)
        if kind != TYPE_ARINC:
            return f"packet_0x{kind:02x}", []
        start = _header_end(flags)
        count, _ = SPECIFIC.unpack_from(packet, start)
        start += SPECIFIC.size
        ticks = low | high << 32
        words = []
        for about, word in RECORD.iter_unpack(packet[start : start + count * RECORD.size]):
            ticks += about & GAP
            words.append(ReceivedWord(word, about >> 24, ticks * TICK_NS, bool(about & (PARITY_ERROR | FORMAT_ERROR))))
        return "", words

    def count_missing(self, packet: bytes) -> int:
        """Number of missing packets of this channel before this one, up to 255; 0 when its time goes back."""
        _, channel, _, _, _, number, _, _, low, high, _ = HEADER.unpack_from(packet)
        ticks = low | high << 32
        last, at = self._last_packets.get(channel, (number, ticks))
        self._last_packets[channel] = number, ticks
        return (number - last - 1) & 0xFF if ticks > at else 0

    def pack(self, words: Sequence[int], bus: int, t_dev_ns: int) -> bytes:
        """A packet with these simultaneous words of a high-speed bus, with a checksum of 32 bits."""
        body = SPECIFIC.pack(len(words), 0) + b"".join(RECORD.pack(bus << 24 | HIGH_SPEED, word) for word in words)
        ticks = t_dev_ns // TICK_NS
        header = HEADER.pack(
            SYNC, 1, HEADER.size + len(body) + 4, len(body), VERSION, self._sequence, CHECKSUM_32, TYPE_ARINC,
            ticks & 0xFFFFFFFF, ticks >> 32 & 0xFFFF, 0,
        )[:-2]  # fmt: skip
        self._sequence = (self._sequence + 1) & 0xFF
        return header + struct.pack("<H", _sum(header, "H", 2)) + body + struct.pack("<I", _sum(body, "I", 4))


def _is_damaged(buffer: bytearray, length: int, flags: int) -> bool:
    """Is the checksum of the secondary header or of the body wrong?"""
    start = _header_end(flags)
    if flags & HAS_SECONDARY:
        last = start - 2
        if _sum(buffer[HEADER.size : last], "H", 2) != int.from_bytes(buffer[last:start], "little"):
            return True
    if not flags & 3:
        return False
    size, code = SUMMANDS[flags & 3]
    body, stated = buffer[start : length - size], buffer[length - size : length]
    return _sum(body[: len(body) // size * size], code, size) != int.from_bytes(stated, "little")
