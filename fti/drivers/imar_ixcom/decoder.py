"""Bytes to measurements."""

from __future__ import annotations

from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers._source_priority import SourcePriority, ranks_of
from fti.drivers.imar_ixcom.commands import decode_response
from fti.drivers.imar_ixcom.decoder_state import DecoderState
from fti.drivers.imar_ixcom.messages import BY_NUMBER, IxcomMessage
from fti.drivers.imar_ixcom.options import NUMBERS, RESERVED, Options
from fti.drivers.imar_ixcom.system_status import MIN_PAYLOAD_BYTES
from fti.drivers.imar_ixcom.wire import FRAME_MAX, IxcomFrame, measure, read_frame
from fti.messages.measurements import ImuSample, Measurement, Position, PressureAltitude, Velocity

#: The messages that carry a quantity, highest priority first; the messages of a group come from the same filter.
PREFERRED: dict[type, tuple[tuple[str, ...], ...]] = {
    ImuSample: (("IMUCORR",), ("INSSOL",), ("IMURAW",)),
    Velocity: (("INSSOL", "INSVELNED", "INSVELENU", "INSGNDSPEED"), ("GNSSSOL",)),
    Position: (("INSSOL", "INSPOSLLH"), ("GNSSSOL",)),
    PressureAltitude: (("AIRDATA",), ("INSSOL",)),
}
RANKS = ranks_of(PREFERRED)


class Decoder:
    """Frames of iXCOM; the messages of the table to measurements, responses to acknowledgements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._only = frozenset(options.only)
        self._framer = Framer(measure, self.counters, limit=FRAME_MAX)
        self._decoder_state = DecoderState(options)
        self._source_priority = SourcePriority()
        self._counted: dict[str, int] = {}

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        """See ``drivers.Decoder``."""
        measurements: list[Measurement] = []
        for stamp_ns, frame_bytes in self._framer.feed(data, t_rx_ns):
            measurements += self._decode_frame(read_frame(frame_bytes, stamp_ns))
        return measurements

    def _decode_frame(self, frame: IxcomFrame) -> list[Measurement]:
        name, message = BY_NUMBER[frame.number]
        is_enabled = not self._only or name in self._only
        measurements = self._decode(message, frame) if message and is_enabled else []
        if measurements is None:
            self.counters.messages[f"{name} of unknown length"] += 1
            return []
        self.counters.messages[name] += 1
        if frame.number in RESERVED:
            ack = decode_response(frame) if is_enabled and frame.number == NUMBERS["RESPONSE"] else None
            return [ack] if ack else []
        self._count(name, frame.counter)
        return measurements

    def _count(self, name: str, counter: int) -> None:
        """Each message has a rolling counter of its own; a step backwards is a restart of the device."""
        missed = (counter - self._counted.get(name, counter - 1) - 1) & 0xFF
        self._counted[name] = counter
        if 0 < missed < 0x80:
            self.counters.lost[name] += missed

    def _decode(self, message: IxcomMessage, frame: IxcomFrame) -> list[Measurement] | None:
        size = len(frame.payload)
        if size != message.size and (message.size is not None or size < MIN_PAYLOAD_BYTES):
            return None
        measurements = message.decode(frame, self._decoder_state)
        if measurements is None:
            return None
        status = self._decoder_state.status(frame, message.emits_status)
        ranks = RANKS.get(message.name)
        return [*status, *(self._source_priority.select(message.name, ranks, measurements) if ranks else measurements)]
