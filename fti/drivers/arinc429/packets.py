"""Common interface of the packet formats: words with bus, time and error flag."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from fti.drivers._framing import Skip
from fti.messages.measurements import Stamp, TimeScale


class ReceivedWord(NamedTuple):
    """A word in a packet.  bus : its number; t_dev_ns : time of the converter [ns]; error : its error flag."""

    word: int
    bus: int
    t_dev_ns: int
    error: bool


class Packets(Protocol):
    """Codec of a packet format."""

    LIMIT: int  # maximum size of a packet [bytes]

    def measure(self, buffer: bytearray) -> int | Skip:
        """See ``_framing``; the checksums of a returned packet are correct."""

    def unpack(self, packet: bytes) -> tuple[str, list[ReceivedWord]]:
        """Counter name of the packet ("" if its words are counted instead), and its words."""

    def count_missing(self, packet: bytes) -> int:
        """Number of missing packets before this one, from the sequence numbers; 0 after a restart."""

    def pack(self, words: Sequence[int], bus: int, t_dev_ns: int) -> bytes:
        """A packet with these words."""


def boot_ns(stamp: Stamp) -> int:
    """Time of the emulated converter [ns]: since its start, otherwise the arrival."""
    if stamp.t_dev_ns is not None and stamp.time_scale is TimeScale.BOOT:
        return stamp.t_dev_ns
    return stamp.t_rx_ns
