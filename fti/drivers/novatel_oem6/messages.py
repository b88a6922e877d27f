"""The messages: their numbers, names and decoders."""

from __future__ import annotations

from collections.abc import Callable

from fti.drivers.novatel_oem6.clock import decode_clockmodel, decode_time
from fti.drivers.novatel_oem6.ephemeris import decode_rawephem
from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.drivers.novatel_oem6.observations import decode_range, decode_rangecmp
from fti.drivers.novatel_oem6.sky import decode_psrdop, decode_satvis, decode_satvis2
from fti.drivers.novatel_oem6.solution import decode_bestpos, decode_bestvel
from fti.drivers.novatel_oem6.status import decode_rxstatus
from fti.messages.measurements import Measurement, Stamp

Reader = Callable[[bytes, NovatelHeader, Stamp], list[Measurement]]

CLOCKMODEL, BESTPOS, RANGE, RXSTATUS, BESTVEL, TIME, PSRDOP, SATVIS2 = 16, 42, 43, 93, 99, 101, 174, 1043
RAWEPHEM, SATVIS, RANGECMP = 41, 48, 140
LOG, RESET, UNLOG, UNLOGALL, ANTENNAPOWER = 1, 18, 36, 38, 98

READERS: dict[int, Reader] = {
    BESTPOS: decode_bestpos,
    BESTVEL: decode_bestvel,
    TIME: decode_time,
    CLOCKMODEL: decode_clockmodel,
    RANGE: decode_range,
    RANGECMP: decode_rangecmp,
    PSRDOP: decode_psrdop,
    RAWEPHEM: decode_rawephem,
    SATVIS: decode_satvis,
    SATVIS2: decode_satvis2,
    RXSTATUS: decode_rxstatus,
}
NAMES = {
    1: "LOG", 5: "LOGLIST", 8: "IONUTC", 16: "CLOCKMODEL", 18: "RESET", 25: "RAWGPSSUBFRAME", 26: "CLOCKSTEERING",
    36: "UNLOG", 37: "VERSION", 38: "UNLOGALL", 41: "RAWEPHEM", 42: "BESTPOS", 43: "RANGE", 47: "PSRPOS", 48: "SATVIS",
    72: "PORTSTATS", 73: "ALMANAC", 74: "RAWALM", 83: "TRACKSTAT", 93: "RXSTATUS", 94: "RXSTATUSEVENT",
    96: "MATCHEDPOS", 98: "ANTENNAPOWER", 99: "BESTVEL", 100: "PSRVEL", 101: "TIME", 128: "RXCONFIG", 140: "RANGECMP",
    141: "RTKPOS", 172: "AVEPOS", 174: "PSRDOP", 175: "REFSTATION", 181: "MARKPOS", 206: "VALIDMODELS", 216: "RTKVEL",
    231: "MARKTIME", 241: "BESTXYZ", 243: "PSRXYZ", 287: "RAWWAASFRAME", 317: "COMCONFIG", 507: "INSPVA",
    718: "GLOALMANAC", 719: "GLOCLOCK", 723: "GLOEPHEMERIS", 726: "BESTUTM", 952: "RTKDOP", 963: "HWMONITOR",
    971: "HEADING", 973: "RAWSBASFRAME", 1043: "SATVIS2", 1163: "PSRDOP2", 1194: "BESTSATS", 1273: "RANGECMP2",
    1429: "BESTGNSSPOS", 1430: "BESTGNSSVEL", 1451: "SATXYZ2",
}  # fmt: skip
NUMBERS = {name: number for number, name in NAMES.items()}


def name_of(number: int) -> str:
    """Name of a message; otherwise "message <number>"."""
    return NAMES.get(number, f"message {number}")


def number_of(name: str) -> int:
    """Number of a message by its name, or by its number in digits.  Raises ValueError."""
    text = name.strip().upper()
    if text in NUMBERS:
        return NUMBERS[text]
    if text.isdecimal() and text.isascii() and 0 < int(text) <= 0xFFFF:
        return int(text)
    raise ValueError(f"message = {name!r}: must be a number from 1 to 65535 or one of {', '.join(sorted(NUMBERS))}")
