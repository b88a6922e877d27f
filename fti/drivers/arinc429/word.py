"""The ARINC 429 word, as an integer whose least significant bit is bit 1 of the standard.

    32      31 30   29    28 ... 11        10 9   8 ... 1
    parity  SSM     sign  data, bit 28 MSB  SDI   label, octal, most significant bit in bit 1

BNR is two's complement with ``bits`` data bits below the sign; more than 18 of them use the SDI bits.  BCD is five
digits in bits 11-29, the highest of three bits.  A discrete word has independent bits 11-29.  Parity is odd over all
32 bits; some converters make it even, or use bit 32 otherwise.  Source: ARINC 429 part 1.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache
from typing import Literal

from fti.drivers._bits import REVERSED

Parity = Literal["odd", "even", "none"]

BNR_TOP = 28  # bit of the most significant data bit
BNR_BITS_WITH_SDI = 18
DISCRETE_LOW, DISCRETE_HIGH = 11, 29
BCD_DIGITS = 5
_BCD_SHIFT = 10
_SDI_SHIFT = 8
_SSM_SHIFT = 29
_PARITY = 1 << 31


class BnrState(IntEnum):
    """Sign/status matrix of a BNR word."""

    FAILURE = 0
    NO_COMPUTED_DATA = 1
    FUNCTIONAL_TEST = 2
    NORMAL = 3


class BcdState(IntEnum):
    """Sign/status matrix of a BCD word."""

    PLUS = 0
    NO_COMPUTED_DATA = 1
    FUNCTIONAL_TEST = 2
    MINUS = 3


class DiscreteState(IntEnum):
    """Sign/status matrix of a discrete word."""

    NORMAL = 0
    NO_COMPUTED_DATA = 1
    FUNCTIONAL_TEST = 2
    FAILURE = 3


def is_intact(word: int, parity: Parity = "odd") -> bool:
    """Is the parity correct?  Always true without parity."""
    return parity == "none" or (word.bit_count() & 1 == 1) == (parity == "odd")


def with_parity(word: int, parity: Parity = "odd") -> int:
    """The word with bit 32 set for the parity; zero without parity."""
    word &= _PARITY - 1
    return word if is_intact(word, parity) else word | _PARITY


@cache
def label_byte(octal: str) -> int:
    """Bits 1-8 for a label written in octal digits ("164")."""
    return REVERSED[int(octal, 8)]


def label_octal(word: int) -> str:
    """The label of a word in octal digits."""
    return f"{REVERSED[word & 0xFF]:03o}"


def reverse_label(word: int) -> int:
    """The word with the bits of its label reversed."""
    return word & ~0xFF | REVERSED[word & 0xFF]


def ssm(word: int) -> int:
    """Sign/status matrix, 0..3."""
    return word >> _SSM_SHIFT & 3


def decode_steps(word: int, bits: int) -> int:
    """The two's complement number of a BNR word with ``bits`` data bits."""
    raw = word >> (BNR_TOP - bits) & ((2 << bits) - 1)
    return raw - (2 << bits) if raw >> bits else raw


def encode_steps(label: str, raw: int, bits: int, *, state: BnrState, sdi: int = 0) -> int:
    """A BNR word of a two's complement number of ``bits`` data bits and sign."""
    word = label_byte(label) | raw % (2 << bits) << (BNR_TOP - bits) | int(state) << _SSM_SHIFT
    return with_parity(word if bits > BNR_BITS_WITH_SDI else word | sdi << _SDI_SHIFT)


def to_steps(value: float, full_scale: float, bits: int, *, turns: bool) -> int:
    """value in steps of the scale; it saturates, or wraps around for an angle (``turns``)."""
    top = 1 << bits
    raw = round(value * top / full_scale)
    return (raw + top) % (2 * top) - top if turns else max(-top, min(top - 1, raw))


def decode_bnr(word: int, full_scale: float, bits: int) -> float:
    """Value of a BNR word in the unit of full_scale."""
    return decode_steps(word, bits) * full_scale / (1 << bits)


def encode_bnr(
    label: str, value: float, full_scale: float, bits: int, *, state: BnrState, sdi: int = 0, turns: bool = False
) -> int:
    """A BNR word.  turns : see ``to_steps``."""
    return encode_steps(label, to_steps(value, full_scale, bits, turns=turns), bits, state=state, sdi=sdi)


def decode_bcd(word: int, resolution: float) -> float | None:
    """Value of a BCD word in the unit of resolution; None when a digit is above nine."""
    digits = [word >> (_BCD_SHIFT + 4 * i) & (0xF if i < BCD_DIGITS - 1 else 0x7) for i in range(BCD_DIGITS)]
    if max(digits) > 9:
        return None
    number = int("".join(map(str, reversed(digits))))
    value = number * resolution
    return -value if ssm(word) == BcdState.MINUS else value


def encode_bcd(label: str, value: float, resolution: float, *, state: BcdState, sdi: int = 0) -> int:
    """A BCD word, saturating at 79999; a plus state becomes minus for a negative value."""
    number = min(round(abs(value) / resolution), 79_999)
    data = sum((number // 10**i % 10) << (_BCD_SHIFT + 4 * i) for i in range(BCD_DIGITS))
    if state is BcdState.PLUS and value < 0 and number:
        state = BcdState.MINUS
    return with_parity(label_byte(label) | sdi << _SDI_SHIFT | data | state << _SSM_SHIFT)


def decode_field(word: int, low: int, high: int, top: int = 0) -> int:
    """The number in bits low..high of the standard, low least significant; top : position of a separate top bit."""
    number = word >> (low - 1) & ((2 << (high - low)) - 1)
    return number | (word >> (top - 1) & 1) << (high - low + 1) if top else number


def encode_field(value: int, low: int, high: int, top: int = 0) -> int:
    """The number at bits low..high and top, saturating."""
    size = high - low + 1
    number = max(0, min(value, (1 << size + (top > 0)) - 1))
    return (number & ((1 << size) - 1)) << (low - 1) | number >> size << max(top - 1, 0)


def encode_discrete(label: str, data: int, *, state: DiscreteState, sdi: int = 0) -> int:
    """A discrete word.  data : its bits, at their positions in the word."""
    return with_parity(label_byte(label) | sdi << _SDI_SHIFT | data | state << _SSM_SHIFT)
