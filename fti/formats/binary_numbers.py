"""Numbers in a binary frame that the configuration describes: location, type, and their codec."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Annotated, Literal

import pydantic

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key

#: Payload of the largest datagram.
MAX_FRAME_BYTES = 65_507
CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q", "f32": "f",
         "f64": "d"}  # fmt: skip
ByteOffset = Annotated[int, pydantic.Field(ge=0, lt=MAX_FRAME_BYTES)]
Bits = tuple[Annotated[int, pydantic.Field(ge=0, le=63)], Annotated[int, pydantic.Field(ge=1, le=64)]]
ByteOrder = Literal["little", "big"]
NumberType = Literal["u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"]


class NumberLocation(StrictModel):
    """Location and type of a number in a frame."""

    at: Annotated[ByteOffset, key("offset of its first byte; that of the first byte of the frame is 0", "byte", 2)]
    type: Annotated[
        NumberType,
        key("type: u unsigned, i signed, f floating point, with the number of bits", NO_UNIT, "u16"),
    ]
    bits: Annotated[
        Bits | None,
        key("only these bits of an unsigned number: lowest bit, number of bits; none: all", "bit", [0, 12]),
    ] = None


@dataclass(frozen=True, slots=True)
class NumberCodec:
    """Codec of a number."""

    at: int
    form: struct.Struct
    is_integer: bool
    low: int  # lowest bit
    mask: int  # of the used bits, without the shift

    @classmethod
    def at_location(cls, location: NumberLocation, byte_order: str, where: str) -> NumberCodec:
        """The codec of a location.  Raises ValueError with ``where``."""
        form = struct.Struct(("<" if byte_order == "little" else ">") + CODES[location.type])
        is_integer, size = not location.type.startswith("f"), 8 * form.size
        low, count = location.bits or (0, size)
        if location.bits and (not is_integer or location.type.startswith("i") or low + count > size):
            raise ValueError(f"{where}: bits = {list(location.bits)}: must lie in a u8, u16, u32 or u64")
        return cls(location.at, form, is_integer, low, (1 << count) - 1)

    @property
    def end(self) -> int:
        """Offset of the first byte after it."""
        return self.at + self.form.size

    @property
    def is_bit_field(self) -> bool:
        """Are only some bits of the number used?"""
        return self.mask.bit_length() < 8 * self.form.size

    def read(self, frame: bytes | bytearray) -> int | float:
        """The number in a frame that reaches to ``end``."""
        value: int | float = self.form.unpack_from(frame, self.at)[0]
        return int(value) >> self.low & self.mask if self.is_bit_field else value

    def write(self, frame: bytearray, value: float) -> None:
        """Write the number into a frame, saturated to the range of the type."""
        if not self.is_integer:
            self.form.pack_into(frame, self.at, value)
            return
        number = min(max(round(value), self._min_value), self._min_value + self.mask)
        if self.is_bit_field:
            others = self.form.unpack_from(frame, self.at)[0] & ~(self.mask << self.low)
            number = others | number << self.low
        self.form.pack_into(frame, self.at, number)

    def to_wire(self, word: float | str) -> float:
        """The number as read back after sending it.  Raises ValueError if the type cannot represent it."""
        if isinstance(word, str):
            raise ValueError(f"{word!r} is text; a frame has only numbers, hexadecimal ones like 0xFFFF")
        if not self.is_integer:
            try:
                rounded: float = self.form.unpack(self.form.pack(word))[0]
            except OverflowError:
                raise ValueError(f"{word:g} is too large for this type") from None
            return rounded
        min_value, max_value = self._min_value, self._min_value + self.mask
        if word != round(word) or not min_value <= word <= max_value:
            raise ValueError(f"{word:.15g} does not fit; allowed are whole numbers from {min_value} to {max_value}")
        return word

    @property
    def _min_value(self) -> int:
        return -(self.mask + 1 >> 1) if self.form.format[-1].islower() else 0
