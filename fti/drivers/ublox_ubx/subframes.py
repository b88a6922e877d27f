"""RXM-SFRBX: words of the navigation message; subframes 1 to 3 of GPS L1 C/A give an ephemeris.

    02 13 RXM-SFRBX       0 gnssId | 1 svId | 2 sigId (0 up to u-blox 8) | 3 freqId | 4 numWords | 8 n x: word u32

A word of GPS L1 C/A is 30 bits at the lower end, of which the last six are the parity; the receiver has checked it and
undone the inversion of the data.
"""

from __future__ import annotations

import struct

from fti.drivers._lnav import PREAMBLE, Subframe, read_ephemeris
from fti.drivers.ublox_ubx.frames import PayloadShape
from fti.drivers.ublox_ubx.receiver_state import ReceiverState
from fti.messages.measurements import Measurement, Stamp

HEAD = struct.Struct("<BBBxBxxx")
WORDS = struct.Struct("<10I")
SFRBX_SHAPE = PayloadShape(HEAD.size, 4, 4)
GPS, L1_CA = 0, 0
PARITY_BITS, WORD_MASK, WORD_BYTES = 6, 0xFFFFFF, 3


def read_sfrbx(p: bytes, receiver: ReceiverState, t_rx_ns: int) -> list[Measurement]:
    """RXM-SFRBX: the ephemeris, if the subframe completes it."""
    gnss_id, number, signal_id, count = HEAD.unpack_from(p)
    if len(p) != SFRBX_SHAPE.size + count * SFRBX_SHAPE.step:
        raise ValueError("count of words and length differ")
    if (gnss_id, signal_id, count) != (GPS, L1_CA, 10):
        return []
    words = WORDS.unpack_from(p, HEAD.size)
    data = b"".join((word >> PARITY_BITS & WORD_MASK).to_bytes(WORD_BYTES, "big") for word in words)
    if data[0] != PREAMBLE:
        return []
    subframes = receiver.add_subframe(number, Subframe(data))
    ephemeris = read_ephemeris(number, subframes, Stamp(t_rx_ns)) if subframes else None
    return [ephemeris] if ephemeris else []
