"""Requests to the nodes: CANaerospace node services (section 4), with services of our own (100-107).

request       node u8 (0: all) | data type | service | sensor u8 (255: all)         | data
response      node u8          | data type | service | sensor + 16 x result         | data
service 100 insert, 101 modify, 102 delete a point: data type 100: raw u16 | 0.01 deg i16; the response echoes
              the stored (deleted) point
service 103 read the table: no data; response, data type 16: number of points u8 | 0 0 0; then the points
service 104-107 a point of the table of sensor 0-3: data type 100, the message code is its number
service 0 identification (IDS), as section 4.1 has it
service 5 transmission interval (TIS): data type 12: identifier u16 | interval [ms] u16; response: message code 0
              accepted, -6 out of range (section 4.6), no data, or the request's data as an echo

results: 0 done, 1 no such sensor, 2 not monotone, 3 fewer than 2 points, 4 too many points, 5 no such point,
6 the point exists already
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from fti.canframe import EXTENDED, EXTENDED_MASK, pack_can
from fti.drivers.canaerospace.data_types import NODATA, SHORT2, UCHAR4

IDS, TIS, INSERT, MODIFY, DELETE, READ, POINT = 0, 5, 100, 101, 102, 103, 104
NAMES = {INSERT: "insert_point", MODIFY: "modify_point", DELETE: "delete_point", READ: "read_table", TIS: "set_rate"}
NUMBERS = {name: number for number, name in NAMES.items()}
POINT_TYPE = 100
ALL_NODES, ALL_SENSORS = 0, 255
DONE, NO_SENSOR, NOT_MONOTONE, TOO_FEW, TOO_MANY, NO_POINT, POINT_EXISTS = range(7)
RESULTS = (
    "done",
    "no such sensor",
    "refused: the table would not be monotone",
    "refused: fewer than 2 points would remain",
    "refused: the table is full",
    "refused: no point with this raw count",
    "refused: a point with this raw count exists",
)
OUT_OF_RANGE = 256 - 6

_HEADER = struct.Struct(">BBBB")
_POINT = struct.Struct(">Hh")
_INTERVAL = struct.Struct(">HH")


@dataclass(frozen=True, slots=True)
class Service:
    """A node service request or response.  code : the message code; data : after the header."""

    node: int
    number: int
    code: int
    kind: int = NODATA
    data: bytes = b""

    @property
    def sensor(self) -> int:
        """Number of the sensor in a response."""
        return self.code & 0x0F

    @property
    def result(self) -> str:
        """Text of the result of a response."""
        result = self.code >> 4
        return RESULTS[result] if result < len(RESULTS) else f"refused: result {result}"

    @property
    def is_done(self) -> bool:
        """Has the node executed the request?"""
        return self.code >> 4 == DONE


def unpack_service(data: bytes) -> Service:
    """A node service in the data of a frame.  Raises ValueError if they are too short."""
    if len(data) < _HEADER.size:
        raise ValueError("a node service has a header of four bytes")
    node, kind, number, code = _HEADER.unpack_from(data)
    return Service(node, number, code, kind, data[_HEADER.size :])


def pack_service(word: int, service: Service) -> bytes:
    """The frame of a node service."""
    header = _HEADER.pack(service.node, service.kind, service.number, service.code)
    return pack_can(word & EXTENDED_MASK, header + service.data, extended=bool(word & EXTENDED))


def pack_point(raw: int, hundredths: int) -> bytes:
    """A point as data."""
    return _POINT.pack(raw, hundredths)


def unpack_point(service: Service) -> tuple[int, int]:
    """Raw count and hundredths of a degree.  Raises ValueError for other data."""
    if service.kind != POINT_TYPE or len(service.data) != _POINT.size:
        raise ValueError("a point has data type 100 and four bytes")
    raw, hundredths = _POINT.unpack(service.data)
    return raw, hundredths


def pack_count(count: int) -> bytes:
    """The number of points that follow."""
    return bytes([count, 0, 0, 0])


def unpack_count(service: Service) -> int:
    """The number of points that follow.  Raises ValueError for other data."""
    if service.kind != UCHAR4 or len(service.data) != 4:
        raise ValueError("the number of points has data type 16 and four bytes")
    return service.data[0]


def interval_request(node: int, can_id: int, interval_ms: int) -> Service:
    """Request for a message every ``interval_ms`` milliseconds."""
    return Service(node, TIS, 0, SHORT2, _INTERVAL.pack(can_id & 0xFFFF, interval_ms))


def unpack_interval(service: Service) -> tuple[int, int] | None:
    """Identifier and interval [ms] in a request or its echo; None without them."""
    if service.kind != SHORT2 or len(service.data) != _INTERVAL.size:
        return None
    can_id, interval_ms = _INTERVAL.unpack(service.data)
    return can_id, interval_ms
