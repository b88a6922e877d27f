"""Ephemerides of GPS satellites: RAWEPHEM.

RAWEPHEM 41   0 number u32 | 4 reference week u32 | 8 reference second u32 | 12 subframe 1 | 42 subframe 2
              72 subframe 3, each of 30 B: ten words without parity
"""

from __future__ import annotations

import struct

from fti.drivers._lnav import Subframe, read_ephemeris
from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.messages.measurements import Measurement, Stamp

RAWEPHEM = struct.Struct("<III30s30s30s")
MAX_GPS = 32


def decode_rawephem(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """RAWEPHEM; none if the subframes do not belong to one ephemeris."""
    number, _, _, *parts = RAWEPHEM.unpack_from(body)
    if not 1 <= number <= MAX_GPS:
        return []
    try:
        subframes = [Subframe(part) for part in parts]
    except ValueError:
        return []
    ephemeris = read_ephemeris(number, subframes, stamp)
    return [ephemeris] if ephemeris else []
