"""Bytes to measurements."""

from __future__ import annotations

from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers.imar_ixcom.commands import decode_response
from fti.drivers.imar_ixcom.heard import Heard
from fti.drivers.imar_ixcom.messages import BY_NUMBER, RANKS, Message
from fti.drivers.imar_ixcom.options import NAMES, NUMBERS, Options
from fti.drivers.imar_ixcom.sysstat import SHORTEST
from fti.drivers.imar_ixcom.wire import FRAME_MAX, Frame, measure, read_frame
from fti.types import Measurement


class Decoder:
    """Frames of iXCOM; the messages of the table to measurements, responses to acknowledgements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._only = frozenset(options.only)
        self._framer = Framer(measure, self.counters, limit=FRAME_MAX)
        self._heard = Heard(options)
        self._believed: dict[type, int] = {}

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        """See the contract."""
        found: list[Measurement] = []
        for stamp_ns, whole in self._framer.feed(data, t_rx_ns):
            found += self._take(read_frame(whole, stamp_ns))
        return found

    def _take(self, frame: Frame) -> list[Measurement]:
        name = NAMES.get(frame.number, f"0x{frame.number:02X}")
        message = BY_NUMBER.get(frame.number)
        taken = not self._only or name in self._only
        found = self._decode(message, frame) if message and taken else []
        if found is None:
            self.counters.messages[f"{name} of unknown length"] += 1
            return []
        self.counters.messages[name] += 1
        if frame.number == NUMBERS["RESPONSE"] and taken:
            ack = decode_response(frame)
            return [ack] if ack else []
        return found

    def _decode(self, message: Message, frame: Frame) -> list[Measurement] | None:
        size = len(frame.payload)
        if size != message.size and (message.size is not None or size < SHORTEST):
            return None
        found = message.decode(frame, self._heard)
        if found is None:
            return None
        told = self._heard.status(frame, message.tells_status)
        ranks = RANKS[message.name]
        return [*told, *(m for m in found if type(m) not in ranks or self._is_believed(type(m), ranks[type(m)]))]

    def _is_believed(self, kind: type, rank: int) -> bool:
        """No message that goes before this one has carried such a measurement yet."""
        best = self._believed.setdefault(kind, rank)
        if rank < best:
            self._believed[kind] = rank
        return rank <= best
