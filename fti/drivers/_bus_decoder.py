"""What the decoders of CAN buses share: one frame a feed, watched nodes, every byte framed or counted as skipped."""

from __future__ import annotations

from abc import ABC, abstractmethod

from fti.drivers import Counters
from fti.drivers._can import frame_head, skip_reason
from fti.drivers._fast_messages import fast_stamp
from fti.drivers._node_supervision import NodeSupervisor, node_status
from fti.types import Measurement, Stamp


class BusDecoder(ABC):
    """A decoder that only has to say what is in a frame.

    silent_after : periods without a message after which a node counts as silent
    """

    def __init__(self, silent_after: float) -> None:
        self.counters = Counters()
        self._watch = NodeSupervisor(silent_after, self.counters.lost)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        self.counters.bytes_in += len(data)
        told = self._watch.tick(t_rx_ns)
        found: list[Measurement] = [node_status(fast_stamp(t_rx_ns), told)] if told else []
        word, length = frame_head(data)
        reason = self._decode_frame(word, data[8 : 8 + length], fast_stamp(t_rx_ns), found)
        if reason:
            self.counters.skipped[skip_reason(data) if reason == "other_id" else reason] += len(data)
        else:
            self.counters.framed += len(data)
        return found

    @abstractmethod
    def _decode_frame(self, word: int, data: bytes, stamp: Stamp, found: list[Measurement]) -> str:
        """Add what is in a frame; why the frame is skipped, "" when it is not."""
