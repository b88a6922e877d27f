"""The emulated unit: every parameter is sent as a message of type FLOAT."""

from __future__ import annotations

import math
import struct
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cache

from fti.canframe import EXTENDED, EXTENDED_MASK, pack_can, unpack_can
from fti.drivers.canaerospace.data_types import FLOAT, NODATA, UCHAR4
from fti.drivers.canaerospace.decoder import HEADER_SIZE, IDS, NODE_SERVICES
from fti.drivers.canaerospace.parameters import Parameter
from fti.messages.measurements import Measurement, Reading

MESSAGE_SIZE = 8
CODE_AND_VALUE = struct.Struct(">Bf")
FLOAT_MAX = 3.4028234663852886e38
#: Hardware and software revision of the emulated unit; standard identifiers, standard header.
IDENTIFICATION = bytes([1, 1, 0, 0])


@cache
def frame_begin(word: int, node: int) -> bytes:
    """First bytes of frames of normal operation data with a FLOAT, up to the service code."""
    data = bytes([node, FLOAT, 0])
    return pack_can(word & EXTENDED_MASK, data.ljust(MESSAGE_SIZE, b"\0"), extended=bool(word & EXTENDED))[:-5]


def encode_message(word: int, node: int, code: int, value: float) -> bytes:
    """A frame of normal operation data with a FLOAT, clamped to the range of a FLOAT."""
    return frame_begin(word, node) + CODE_AND_VALUE.pack(code, min(max(value, -FLOAT_MAX), FLOAT_MAX))


def identification_request(node: int) -> bytes:
    """Request for identification on node service channel 0: section 4.1."""
    return pack_can(NODE_SERVICES[0][0], bytes([node, NODATA, IDS, 0]))


class Encoder:
    """node : the number of the unit."""

    def __init__(self, parameters: Mapping[int, Parameter], node: int) -> None:
        self._by_name: dict[str, list[Parameter]] = defaultdict(list)
        self._by_class: dict[type[object], list[Parameter]] = defaultdict(list)
        for parameter in parameters.values():
            self._by_name[parameter.name].append(parameter)
            if parameter.quantity:
                self._by_class[parameter.quantity.measurement].append(parameter)
        self._node = node
        self._codes: dict[int, int] = {}

    def encode(self, measurement: Measurement) -> list[bytes]:
        if not getattr(measurement, "valid", True):
            return []
        carrying: Sequence[Parameter] = self._by_class.get(type(measurement), ())
        if isinstance(measurement, Reading):
            carrying = self._by_name.get(measurement.name, ())
        return [self._frame(p, v) for p in carrying if (v := _value_of(p, measurement)) is not None]

    def respond(self, data: bytes) -> list[bytes]:
        """The answer to a request for identification, on the channel of the request."""
        try:
            frame = unpack_can(data)
        except ValueError:
            return []
        is_request = any(frame.can_id in channels for channels in NODE_SERVICES) and frame.can_id % 2 == 0
        if not is_request or frame.extended or len(frame.data) < HEADER_SIZE:
            return []
        node, _, service, code = frame.data[:HEADER_SIZE]
        if service != IDS or node not in (0, self._node):
            return []
        return [pack_can(frame.can_id + 1, bytes([self._node, UCHAR4, IDS, code]) + IDENTIFICATION)]

    def _frame(self, parameter: Parameter, value: float) -> bytes:
        code = self._codes.get(parameter.word, 0)
        self._codes[parameter.word] = (code + 1) & 0xFF
        within = min(max(value, parameter.low), parameter.high)
        return encode_message(parameter.word, self._node, code, (within - parameter.offset) / parameter.factor)


def _value_of(parameter: Parameter, measurement: Measurement) -> float | None:
    """Value of this parameter in the measurement, in its unit."""
    if isinstance(measurement, Reading):
        value = measurement.value if measurement.name == parameter.name else None
        return value if value is not None and math.isfinite(value) else None
    value = parameter.quantity.pick(measurement) if parameter.quantity else None
    if value is None:
        return None
    factor, offset = parameter.scale
    value = (value - offset) / factor
    return value if math.isfinite(value) else None
