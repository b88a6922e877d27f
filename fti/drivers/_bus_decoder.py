"""Base class of CAN bus decoders: one frame per feed, node supervision, counters of bytes."""

from __future__ import annotations

from abc import ABC, abstractmethod

from fti.drivers import Counters
from fti.drivers._node_supervision import NodeSupervisor, node_status
from fti.formats.can_identifiers import frame_head, skip_reason
from fti.messages.measurements import Measurement, Stamp


class BusDecoder(ABC):
    """Subclasses decode the contents of one frame.

    silent_after : periods without a message until a node counts as silent
    """

    def __init__(self, silent_after: float) -> None:
        self.counters = Counters()
        self._watch = NodeSupervisor(silent_after, self.counters.lost)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        self.counters.bytes_in += len(data)
        conditions = self._watch.tick(t_rx_ns)
        measurements: list[Measurement] = [node_status(Stamp(t_rx_ns), conditions)] if conditions else []
        word, length = frame_head(data)
        reason = self._decode_frame(word, data[8 : 8 + length], Stamp(t_rx_ns), measurements)
        if reason:
            self.counters.skipped[skip_reason(data) if reason == "other_id" else reason] += len(data)
        else:
            self.counters.framed += len(data)
        return measurements

    @abstractmethod
    def _decode_frame(self, word: int, data: bytes, stamp: Stamp, measurements: list[Measurement]) -> str:
        """Append the measurements of a frame; returns the reason if the frame is skipped, otherwise ""."""
