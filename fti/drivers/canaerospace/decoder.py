"""CANaerospace frames, one per feed, to measurements."""

from __future__ import annotations

import math
from collections.abc import Mapping

from fti.drivers._bus_decoder import BusDecoder
from fti.drivers._node_supervision import node_status
from fti.drivers.canaerospace.data_types import DOUBLEH, DOUBLEL, ERROR, UCHAR4, decode_values, join_double
from fti.drivers.canaerospace.parameters import Parameter, unknown_parameter
from fti.messages.measurements import Ack, DeviceStatus, Measurement, Reading, Stamp

#: Identifiers of section 2.1: emergency events, node services (high and low priority), normal operation data.
EMERGENCY = range(128)
NODE_SERVICES = (range(128, 200), range(2000, 2032))
NORMAL_OPERATION = range(300, 1800)
#: Node services by their code: section 4.
SERVICES = (
    "ids", "nss", "dds", "dus", "scs", "tis", "fps", "sts", "fss", "tcs", "bss", "nis", "mis", "mcs", "css", "dss",
)  # fmt: skip
IDS = 0
HEADER_SIZE = 4
#: Limit of doubles without second half.
MAX_HALVES = 64


def kind_of(can_id: int) -> str:
    """Kind of an 11-bit identifier; "" for user-defined ones."""
    if can_id in EMERGENCY:
        return "emergency"
    if any(can_id in channels for channels in NODE_SERVICES):
        return "service"
    return "normal" if can_id in NORMAL_OPERATION else ""


def service_name(can_id: int, code: int) -> str:
    """Counter name of a node service: requests have even identifiers, responses odd ones."""
    name = SERVICES[code] if code < len(SERVICES) else f"service_{code}"
    return f"{name}_{'response' if can_id % 2 else 'request'}"


def decode_parameter(parameter: Parameter, values: tuple[float, ...] | str, stamp: Stamp) -> list[Measurement]:
    """Measurements of a message of normal operation data."""
    name = parameter.name
    if isinstance(values, str):
        return [Reading(stamp=stamp, name=name, value=None, text=values)]
    if len(values) == 1:
        return _decode_number(parameter, values[0], stamp)
    return [Reading(stamp=stamp, name=f"{name}.{i}", value=float(v), unit=parameter.unit) for i, v in enumerate(values)]


def _decode_number(parameter: Parameter, number: float, stamp: Stamp) -> list[Measurement]:
    finite = math.isfinite(number)
    value = number * parameter.factor + parameter.offset
    valid = finite and parameter.low <= value <= parameter.high
    if parameter.quantity is None or parameter.make is None:
        content = value if finite else None
        return [Reading(stamp=stamp, name=parameter.name, value=content, unit=parameter.unit, valid=valid)]
    if finite:
        return [parameter.make(stamp, value * parameter.scale[0] + parameter.scale[1], valid)]
    nothing = parameter.quantity.make(stamp, None, False)
    return [] if nothing is None else [nothing]


def decode_emergency(data: bytes, stamp: Stamp) -> DeviceStatus:
    """An emergency event: section 3.2.  Raises ValueError for another form."""
    if data[1] != ERROR or len(data) != 8:
        raise ValueError("an emergency event has data type 1 and four bytes of data")
    error = int.from_bytes(data[6:8], "big", signed=True)
    flags = ("emergency_event", f"node_{data[0]}", f"location_{data[4]}", f"operation_{data[5]}", f"error_{error}")
    return DeviceStatus(stamp=stamp, ok=False, flags=flags)


def decode_identification(data: bytes, stamp: Stamp) -> list[Measurement]:
    """Identification of a node; ok if identifiers and header are standard: section 4.1.

    Raises ValueError for another form.
    """
    if data[1] != UCHAR4 or len(data) != 8:
        raise ValueError("an identification has data type 16 and four bytes of data")
    names = ("hardware", "software", "distribution", "header")
    flags = (f"node_{data[0]}", *(f"{name}_{value}" for name, value in zip(names, data[4:], strict=True)))
    return [
        DeviceStatus(stamp=stamp, ok=data[6:8] == bytes(2), flags=("identified", *flags)),
        Ack(stamp=stamp, command="identify", accepted=True, detail=" ".join(flags)),
    ]


class Decoder(BusDecoder):
    """node : only frames of this node; None: all."""

    def __init__(self, parameters: Mapping[int, Parameter], node: int | None, silent_after: float) -> None:
        super().__init__(silent_after)
        self._node = node
        self._parameters = parameters
        self._halves: dict[tuple[int, int], float] = {}  # DOUBLEH by word and node, until the DOUBLEL arrives

    def _decode_frame(self, word: int, data: bytes, stamp: Stamp, measurements: list[Measurement]) -> str:
        """Append the measurements of a frame; returns the reason if the frame is skipped, otherwise ""."""
        parameter = self._parameters.get(word)
        kind = "normal" if parameter else kind_of(word)
        if not kind:
            return "other_id"
        if len(data) < HEADER_SIZE:
            return "bad_data"
        if self._node is not None and data[0] != self._node:
            return "other_node"
        try:
            if kind == "normal":
                measurements += self._normal(parameter or unknown_parameter(word), data, stamp)
            elif kind == "emergency":
                measurements.append(decode_emergency(data, stamp))
                self.counters.messages["emergency_event"] += 1
            else:
                is_identification = data[2] == IDS and word % 2 == 1
                measurements += decode_identification(data, stamp) if is_identification else []
                self.counters.messages[service_name(word, data[2])] += 1
        except ValueError:
            return "bad_data"
        return ""

    def _normal(self, parameter: Parameter, data: bytes, stamp: Stamp) -> list[Measurement]:
        node, kind, _, code = data[:HEADER_SIZE]
        values = decode_values(kind, data[HEADER_SIZE:])
        if kind in (DOUBLEH, DOUBLEL) and not isinstance(values, str):
            values = self._double(parameter.word, node, kind, values[0])
        self.counters.messages[parameter.name] += 1
        measurements = decode_parameter(parameter, values, stamp) if values else []
        conditions = self._watch.handle_message(stamp.t_rx_ns, node, parameter.name, code=code)
        if conditions:
            measurements.append(node_status(stamp, conditions))
        return measurements

    def _double(self, word: int, node: int, kind: int, half: float) -> tuple[float, ...]:
        """The number, if this is its second half."""
        if kind == DOUBLEH:
            if len(self._halves) >= MAX_HALVES:
                self._halves.clear()
            self._halves[word, node] = half
            return ()
        high = self._halves.pop((word, node), None)
        return () if high is None else (join_double(high, half),)
