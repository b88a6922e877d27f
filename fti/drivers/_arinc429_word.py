"""The ARINC 429 word, as an integer whose least significant bit is bit 1 of the standard.

    32      31 30   29    28 ... 11        10 9   8 ... 1
    parity  SSM     sign  data, bit 28 MSB  SDI   label, octal, most significant bit in bit 1

BNR is two's complement with ``bits`` data bits below the sign; more than 18 of them reach into the SDI.  BCD is five
digits in bits 11-29, the highest of three bits.  Parity is odd over all 32 bits.  Source: ARINC 429 part 1.
"""

from __future__ import annotations

from enum import IntEnum

from fti.drivers._bits import REVERSED

WORD_BITS = 32
BNR_TOP = 28  # bit of the most significant data bit
BNR_BITS_BESIDE_SDI = 18
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


def has_odd_parity(word: int) -> bool:
    """True when the word is undamaged, as far as one bit of parity tells."""
    return word.bit_count() & 1 == 1


def with_parity(word: int) -> int:
    """The word with bit 32 set so that the parity is odd."""
    word &= _PARITY - 1
    return word if has_odd_parity(word) else word | _PARITY


def label_byte(octal: str) -> int:
    """Bits 1-8 for a label written in octal digits ("164")."""
    return REVERSED[int(octal, 8)]


def label_octal(word: int) -> str:
    """The label of a word in octal digits."""
    return f"{REVERSED[word & 0xFF]:03o}"


def ssm(word: int) -> int:
    """Sign/status matrix, 0..3."""
    return word >> _SSM_SHIFT & 3


def sdi(word: int) -> int:
    """Source/destination identifier, 0..3."""
    return word >> _SDI_SHIFT & 3


def decode_bnr(word: int, full_scale: float, bits: int) -> float:
    """Value of a BNR word in the unit of full_scale."""
    raw = word >> (BNR_TOP - bits) & ((2 << bits) - 1)
    signed = raw - (2 << bits) if raw >> bits else raw
    return signed * full_scale / (1 << bits)


def encode_bnr(
    label: str, value: float, full_scale: float, bits: int, *, state: BnrState, sdi: int = 0, turns: bool = False
) -> int:
    """A BNR word.  turns : the value is an angle that goes on at the other end of the scale, instead of saturating."""
    top = 1 << bits
    raw = round(value * top / full_scale)
    raw = raw % (2 * top) if turns else max(-top, min(top - 1, raw)) % (2 * top)
    word = label_byte(label) | raw << (BNR_TOP - bits) | state << _SSM_SHIFT
    return with_parity(word if bits > BNR_BITS_BESIDE_SDI else word | sdi << _SDI_SHIFT)


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
