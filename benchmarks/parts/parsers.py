"""Ready-made parsers on the same bytes as our decoders: each takes reads and returns the number of messages."""

from __future__ import annotations

import importlib.resources
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import arinc429
import cantools.database
import ixcom.parser
import pynmeagps
import pyubx2
from novatel_edie import oem
from pymavlink.dialects.v20 import ardupilotmega

from fti.canframe import unpack_can

Parser = Callable[[Sequence[bytes]], int]


def run_ixcom(reads: Sequence[bytes]) -> int:
    """The maker's package."""
    parser, found = ixcom.parser.MessageParser(), list[object]()
    parser.callbacks.append(lambda message, **_: found.append(message))
    for data in reads:
        parser.messageSearcher.process_bytes(data)
    return len(found)


def run_novatel_edie(reads: Sequence[bytes]) -> int:
    """The maker's package."""
    parser, found = oem.Parser(), 0
    for data in reads:
        parser.write(data)
        found += sum(1 for _ in parser)
    return found


def run_pynmeagps(reads: Sequence[bytes]) -> int:
    """Reads a stream, so it gets all at once."""
    return sum(1 for _ in pynmeagps.NMEAReader(BytesIO(b"".join(reads)), quitonerror=0))


def run_pyubx2(reads: Sequence[bytes]) -> int:
    """Reads a stream, so it gets all at once."""
    return sum(1 for _ in pyubx2.UBXReader(BytesIO(b"".join(reads)), quitonerror=0))


def run_pymavlink(reads: Sequence[bytes]) -> int:
    """The parser of the dialect."""
    parser = ardupilotmega.MAVLink(None)
    parser.robust_parsing = True
    return sum(len(parser.parse_buffer(data) or ()) for data in reads)


def run_cantools(reads: Sequence[bytes]) -> int:
    """Decodes each frame with the built-in DBC of CANaerospace."""
    text = importlib.resources.files("fti.drivers.canaerospace").joinpath("parameters.dbc").read_text(encoding="utf-8")
    database: Any = cantools.database.load_string(text, "dbc")
    found = 0
    for data in reads:
        frame = unpack_can(data)
        try:
            found += bool(database.decode_message(frame.can_id, frame.data, decode_choices=False))
        except KeyError:
            continue
    return found


def run_arinc429(reads: Sequence[bytes]) -> int:
    """One word after the other; it looks for no beginning, and drops the sign."""
    decoder, words = arinc429.Decoder(), b"".join(reads)
    for at in range(0, len(words), 4):
        decoder.decode(int.from_bytes(words[at : at + 4], "big"), "BNR")
    return len(words) // 4
