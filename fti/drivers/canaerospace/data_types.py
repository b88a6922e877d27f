"""Data types of CANaerospace, section 2.2: byte 1 of the header is the number, the data begin at byte 4, big-endian."""

from __future__ import annotations

import struct
from typing import NamedTuple

NODATA, ERROR, FLOAT, SHORT2, UCHAR4, DOUBLEH, DOUBLEL = 0, 1, 2, 12, 16, 30, 31
#: A SHORT2 is a value and the full scale of 32767: section 5.
FULL_SCALE = 32767


class DataType(NamedTuple):
    """A type: name and layout; ``is_text`` for ASCII characters."""

    name: str
    layout: struct.Struct
    is_text: bool = False


def _table(*rows: tuple[int, str, str]) -> dict[int, DataType]:
    return {
        number: DataType(name, struct.Struct(">" + layout), name.startswith("ACHAR")) for number, name, layout in rows
    }


TYPES = _table(
    (NODATA, "NODATA", ""), (ERROR, "ERROR", "I"), (FLOAT, "FLOAT", "f"),
    (3, "LONG", "i"), (4, "ULONG", "I"), (5, "BLONG", "I"),
    (6, "SHORT", "h"), (7, "USHORT", "H"), (8, "BSHORT", "H"),
    (9, "CHAR", "b"), (10, "UCHAR", "B"), (11, "BCHAR", "B"),
    (SHORT2, "SHORT2", "hh"), (13, "USHORT2", "HH"), (14, "BSHORT2", "HH"),
    (15, "CHAR4", "4b"), (UCHAR4, "UCHAR4", "4B"), (17, "BCHAR4", "4B"),
    (18, "CHAR2", "2b"), (19, "UCHAR2", "2B"), (20, "BCHAR2", "2B"),
    (21, "MEMID", "I"), (22, "CHKSUM", "I"),
    (23, "ACHAR", "1s"), (24, "ACHAR2", "2s"), (25, "ACHAR4", "4s"),
    (26, "CHAR3", "3b"), (27, "UCHAR3", "3B"), (28, "BCHAR3", "3B"), (29, "ACHAR3", "3s"),
    (DOUBLEH, "DOUBLEH", "I"), (DOUBLEL, "DOUBLEL", "I"),
)  # fmt: skip


def decode_values(number: int, data: bytes) -> tuple[float, ...] | str:
    """The numbers in the data, or the text; a SHORT2 gives one scaled number.

    Raises ValueError for a reserved or user-defined type, and for a wrong data length.
    """
    kind = TYPES.get(number)
    if kind is None:
        raise ValueError(f"data type {number}; known are 0 to {max(TYPES)}")
    if len(data) != kind.layout.size:
        raise ValueError(f"{len(data)} bytes of data; a {kind.name} has {kind.layout.size}")
    values = kind.layout.unpack(data)
    if kind.is_text:
        return str(values[0], "ascii", "replace").rstrip("\0 ")
    if number == SHORT2:
        return (values[0] * values[1] / FULL_SCALE,)
    return values


def join_double(high: float, low: float) -> float:
    """The number from its halves DOUBLEH and DOUBLEL."""
    number: float = struct.unpack(">d", struct.pack(">II", int(high), int(low)))[0]
    return number
