"""What the two kinds of packets have in common: words with a bus, a time and perhaps an error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from fti.drivers._framing import Skip
from fti.types import Stamp, TimeScale


class ReceivedWord(NamedTuple):
    """A word out of a packet.  bus : its number; t_dev_ns : time of the packet's maker [ns]; error : it says so."""

    word: int
    bus: int
    t_dev_ns: int
    error: bool


class Packets(Protocol):
    """One kind of packet, both ways."""

    LIMIT: int  # longest packet that is held [bytes]

    def measure(self, buffer: bytearray) -> int | Skip:
        """See ``_framing``: a packet that is returned holds its checksums."""

    def unpack(self, packet: bytes) -> tuple[str, list[ReceivedWord]]:
        """What the packet is counted as ("" where its words are), and its words."""

    def count_missing(self, packet: bytes) -> int:
        """How many packets are missing before this one, as their numbers show; none where they begin again."""

    def pack(self, words: Sequence[int], bus: int, t_dev_ns: int) -> bytes:
        """A packet with these words."""


def boot_ns(stamp: Stamp) -> int:
    """Time of the emulated maker of packets [ns]: since it was switched on, else the arrival."""
    if stamp.t_dev_ns is not None and stamp.time_scale is TimeScale.BOOT:
        return stamp.t_dev_ns
    return stamp.t_rx_ns
