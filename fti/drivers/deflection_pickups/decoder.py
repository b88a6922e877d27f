"""Frames of the pickups, one per feed, to deflections, acknowledgements and calibration tables."""

from __future__ import annotations

from collections.abc import Mapping

from fti.drivers._bus_decoder import BusDecoder
from fti.drivers._node_supervision import node_status
from fti.drivers.deflection_pickups.layout import REQUEST, PickupBus, PickupMessage
from fti.drivers.deflection_pickups.live_tables import LiveTables
from fti.drivers.deflection_pickups.table import CalibrationTable
from fti.messages.measurements import Measurement, Stamp, SurfaceDeflection


class Decoder(BusDecoder):
    """tables : from the calibration file; afterwards only acknowledgements of nodes change them."""

    def __init__(self, bus: PickupBus, tables: Mapping[str, CalibrationTable], silent_after: float) -> None:
        super().__init__(silent_after)
        self._bus = bus
        self._tables = LiveTables(bus, tables)
        self._raw: dict[str, tuple[int, int | None]] = {}  # last raw count and its message code

    def copy_state(self, previous: Decoder) -> None:
        """Keep the tables over missing frames, see ``drivers.StatefulDecoder``."""
        self._tables.copy_tables(previous._tables)

    def _decode_frame(self, word: int, data: bytes, stamp: Stamp, measurements: list[Measurement]) -> str:
        """Append the measurements of a frame; returns the reason if the frame is skipped, otherwise ""."""
        message = self._bus.messages.get(word)
        if message is not None:
            return self._deflections(message, data, stamp, measurements)
        if word == self._bus.request:
            self.counters.messages[REQUEST] += 1
            return ""
        if word != self._bus.response:
            return "other_id"
        try:
            name, decoded = self._tables.handle_response(data, stamp)
        except ValueError:
            return "bad_data"
        if not name:
            return "other_node"
        self.counters.messages[name] += 1
        measurements += decoded
        return ""

    def _deflections(self, message: PickupMessage, data: bytes, stamp: Stamp, measurements: list[Measurement]) -> str:
        layout = message.layout
        if len(data) < layout.length:
            return "bad_data"
        payload = data[: layout.length]
        little, big = int.from_bytes(payload, "little"), int.from_bytes(payload, "big")
        if message.own_id is not None and message.own_id.extract(little, big) != message.node_id:
            return "other_node"
        code = None if message.counter is None else int(message.counter.extract(little, big))
        deflections = self._decode_deflections(message, (little, big), stamp, code)
        if deflections is None:
            return "bad_data"
        self.counters.messages[layout.name] += 1
        measurements += deflections
        modulus = message.counter.modulus if message.counter else 0
        conditions = self._watch.handle_message(
            stamp.t_rx_ns, message.node, layout.name, code=code, modulus=modulus, cycle_ns=layout.cycle_ns
        )
        if conditions:
            measurements.append(node_status(stamp, conditions))
        return ""

    def _decode_deflections(
        self, message: PickupMessage, words: tuple[int, int], stamp: Stamp, code: int | None
    ) -> list[Measurement] | None:
        """The deflections in a frame; None when its multiplexer (the data type) selects none of them."""
        present = message.layout.signals_in(*words)
        measurements: list[Measurement] = []
        is_ours = False
        for surface, signal in message.raw.items():
            if signal in present:
                is_ours = True
                count = int(signal.extract(*words))
                self._raw[surface] = count, code
                if self._bus.sensors[surface].raw_only:
                    angle = self._tables.deflection(surface, count)
                    measurements.append(
                        SurfaceDeflection(
                            stamp=stamp, surface=surface, deflection=angle, raw=count, valid=angle is not None
                        )
                    )
        for surface, (signal, factor) in message.deflection.items():
            if signal in present:
                is_ours = True
                measurements.append(
                    self._node_deflection(surface, signal.physical(signal.extract(*words)), factor, (stamp, code))
                )
        return measurements if is_ours else None

    def _node_deflection(
        self, surface: str, physical: tuple[float | None, bool], factor: float, sample: tuple[Stamp, int | None]
    ) -> SurfaceDeflection:
        """Deflection from the node, with the raw count of the same sample."""
        (value, valid), (stamp, code) = physical, sample
        raw, counted = self._raw.pop(surface, (None, None))
        return SurfaceDeflection(
            stamp=stamp,
            surface=surface,
            deflection=None if value is None else value * factor,
            raw=raw if counted == code else None,
            valid=valid,
        )
