"""The navigation message LNAV of GPS: subframes 1 to 3, which hold the ephemeris of the satellite that sends them.

Document: IS-GPS-200, 20.3.3 (subframes, figure 20-1; tables 20-I and 20-III: bits, scale factors, units).

A subframe has no parity here: ten words of 24 bits, 30 bytes.  Bits are counted from 0:

    all   0 preamble 0x8B | 24 time of the week, 17 | 41 alert | 43 number of the subframe, 3
    1     48 week, 10 | 60 accuracy, 4 | 64 health, 6 | 70 IODC, 2 | 160 TGD, 8 | 168 IODC, 8 | 176 toc, 16 | 192 af2, 8
          200 af1, 16 | 216 af0, 22
    2     48 IODE, 8 | 56 Crs, 16 | 72 delta n, 16 | 88 M0, 32 | 120 Cuc, 16 | 136 e, 32 | 168 Cus, 16 | 184 sqrt A, 32
          216 toe, 16
    3     48 Cic, 16 | 64 Omega0, 32 | 96 Cis, 16 | 112 i0, 32 | 144 Crc, 16 | 160 omega, 32 | 192 Omega dot, 24
          216 IODE, 8 | 224 i dot, 14
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fti.messages.measurements import Ephemeris, Stamp

PREAMBLE = 0x8B
SUBFRAME_BITS = 240
#: User range accuracy by its index: upper bounds [m]; index 15 predicts none.
ACCURACY_M = (
    2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24.0, 48.0, 96.0, 192.0, 384.0, 768.0, 1536.0, 3072.0, 6144.0,
)  # fmt: skip
REFERENCE_STEP_S = 16.0


class Subframe:
    """Bits of one subframe.  data : 30 bytes, without parity"""

    def __init__(self, data: bytes) -> None:
        if len(data) * 8 != SUBFRAME_BITS or data[0] != PREAMBLE:
            raise ValueError("a subframe is 30 bytes that begin with 0x8B")
        self._value = int.from_bytes(data, "big")

    def unsigned(self, at: int, bits: int) -> int:
        """Bits from a place on, as a number without sign."""
        return self._value >> (SUBFRAME_BITS - at - bits) & ((1 << bits) - 1)

    def signed(self, at: int, bits: int, exponent: int) -> float:
        """Bits from a place on, in two's complement, times 2^exponent."""
        half = 1 << (bits - 1)
        return math.ldexp((self.unsigned(at, bits) ^ half) - half, exponent)

    def angle(self, at: int, bits: int, exponent: int) -> float:
        """``signed`` in semicircles, converted to radians."""
        return math.pi * self.signed(at, bits, exponent)

    @property
    def number(self) -> int:
        """1 to 5."""
        return self.unsigned(43, 3)

    @property
    def issue(self) -> int | None:
        """Issue of the data: IODE, of subframe 1 the lower eight bits of IODC; None of other subframes."""
        at = {1: 168, 2: 48, 3: 216}.get(self.number)
        return None if at is None else self.unsigned(at, 8)


def read_ephemeris(number: int, subframes: Sequence[Subframe], stamp: Stamp) -> Ephemeris | None:
    """The ephemeris in subframes 1, 2 and 3 of a satellite; None if the numbers or the issues do not match."""
    clock, orbit, plane = subframes
    if [each.number for each in subframes] != [1, 2, 3] or len({each.issue for each in subframes}) != 1:
        return None
    accuracy = clock.unsigned(60, 4)
    return Ephemeris(
        stamp=stamp,
        system="gps",
        number=number,
        week=clock.unsigned(48, 10),
        issue=orbit.unsigned(48, 8),
        toc=REFERENCE_STEP_S * clock.unsigned(176, 16),
        af0=clock.signed(216, 22, -31),
        af1=clock.signed(200, 16, -43),
        af2=clock.signed(192, 8, -55),
        tgd=clock.signed(160, 8, -31),
        toe=REFERENCE_STEP_S * orbit.unsigned(216, 16),
        sqrt_a=math.ldexp(orbit.unsigned(184, 32), -19),
        e=math.ldexp(orbit.unsigned(136, 32), -33),
        m0=orbit.angle(88, 32, -31),
        delta_n=orbit.angle(72, 16, -43),
        omega0=plane.angle(64, 32, -31),
        omega_dot=plane.angle(192, 24, -43),
        i0=plane.angle(112, 32, -31),
        idot=plane.angle(224, 14, -43),
        omega=plane.angle(160, 32, -31),
        cuc=orbit.signed(120, 16, -29),
        cus=orbit.signed(168, 16, -29),
        cic=plane.signed(48, 16, -29),
        cis=plane.signed(96, 16, -29),
        crc=plane.signed(144, 16, -5),
        crs=orbit.signed(56, 16, -5),
        accuracy=ACCURACY_M[accuracy] if accuracy < len(ACCURACY_M) else None,
        healthy=not clock.unsigned(64, 6) and not any(each.unsigned(41, 1) for each in subframes),
    )
