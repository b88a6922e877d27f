"""Alta Passive Monitor packets (APMP) of an Alta Data Technologies ENET-A429, UDP.

Document: AltaCore-ARINC manual, section APMP, which is not public; the layout is from NCAR NIDAS
(``raf/AltaEnet.h``, ``raf/UDPArincSensor.cc``), which records it in flight.  Big-endian 32-bit words:

    0  mode, 1 | 4 sequence number | 8 status, low half 0 is good | 12 "ALTA" | 16 3 reserved | 28 payload bytes
    payload, 32  time of the packet, high and low | 40 IRIG day | 44 IRIG 0 h m s in BCD
            48   n times 16 bytes:  control | time high | time low | ARINC word

    control bit 31 error, bits 24-27 channel, 16-23 sequence number of the channel; times in steps of 20 ns

A packet has at most 1376 bytes of payload (85 words).  It has no checksum: the parity of each word is checked, and a
packet that contains the beginning of another one is truncated.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from fti.drivers._framing import Skip
from fti.drivers.arinc429.packets import ReceivedWord

MAGIC = b"ALTA"
MAGIC_AT = 12
MODE = 1
HEADER = struct.Struct(">3I4s12xI")
TIMES = struct.Struct(">QII")
RECORD = struct.Struct(">IQI")
MAX_PAYLOAD = 1376
TICK_NS = 20
ERROR = 1 << 31


class Apmp:
    """Packets of the converter.  Stateful: it tracks the sequence numbers of packets and of packed words."""

    LIMIT = HEADER.size + MAX_PAYLOAD

    def __init__(self) -> None:
        self._packet, self._word_numbers = 0, [0] * 16
        self._last_packet: int | None = None

    def measure(self, buffer: bytearray) -> int | Skip:
        """See ``_framing``."""
        at = buffer.find(MAGIC, MAGIC_AT)
        begin = at - MAGIC_AT if at >= 0 else len(buffer) - MAGIC_AT - len(MAGIC) + 1
        if begin > 0:
            return Skip(begin, "no_sync")
        if at < 0 or len(buffer) < HEADER.size:
            return 0
        mode, _, _, _, payload = HEADER.unpack_from(buffer)
        if mode != MODE:
            return Skip(1, "bad_mode")
        if not TIMES.size <= payload <= MAX_PAYLOAD or (payload - TIMES.size) % RECORD.size:
            return Skip(1, "bad_length")
        end = HEADER.size + payload
        if self._begins_another(buffer, end):
            return Skip(1, "cut_short")
        return end if len(buffer) >= end else 0

    @staticmethod
    def _begins_another(buffer: bytearray, end: int) -> bool:
        at = buffer.find(MAGIC, MAGIC_AT + len(MAGIC), end)
        return at >= 0 and int.from_bytes(buffer[at - MAGIC_AT : at - MAGIC_AT + 4], "big") == MODE

    def unpack(self, packet: bytes) -> tuple[str, list[ReceivedWord]]:
        """The words; none for a packet with bad status."""
        _, _, status, _, _ = HEADER.unpack_from(packet)
        if status & 0xFFFF:
            return "bad_status", []
        records = RECORD.iter_unpack(packet[HEADER.size + TIMES.size :])
        return "", [ReceivedWord(word, c >> 24 & 0xF, ticks * TICK_NS, bool(c & ERROR)) for c, ticks, word in records]

    def count_missing(self, packet: bytes) -> int:
        """Number of missing packets before this one."""
        number = int.from_bytes(packet[4:8], "big")
        last, self._last_packet = self._last_packet, number
        return number - last - 1 if last is not None and number > last else 0

    def pack(self, words: Sequence[int], bus: int, t_dev_ns: int) -> bytes:
        """A packet with these simultaneous words."""
        ticks = t_dev_ns // TICK_NS
        records = []
        for word in words:
            records.append(RECORD.pack((bus & 0xF) << 24 | self._word_numbers[bus & 0xF] << 16, ticks, word))
            self._word_numbers[bus & 0xF] = (self._word_numbers[bus & 0xF] + 1) & 0xFF
        payload = TIMES.pack(ticks, 0, 0) + b"".join(records)
        header = HEADER.pack(MODE, self._packet, 0, MAGIC, len(payload))
        self._packet = (self._packet + 1) & 0xFFFFFFFF
        return header + payload
