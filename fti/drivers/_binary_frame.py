"""Binary frames that the configuration describes: offsets and types of numbers, checksum, trailer, length."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import pydantic

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers._checksums import CHECKSUMS, ChecksumKind
from fti.drivers._framing import Skip, skip_to
from fti.formats.described_fields import Field, WireValue, decode_fields, make_field_codecs
from fti.messages.measurements import Measurement, Stamp

MAX_FRAME_BYTES = 2048
CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "u64": "Q", "i64": "q", "f32": "f",
         "f64": "d"}  # fmt: skip
ByteOffset = Annotated[int, pydantic.Field(ge=0, lt=MAX_FRAME_BYTES)]
Bits = tuple[Annotated[int, pydantic.Field(ge=0, le=63)], Annotated[int, pydantic.Field(ge=1, le=64)]]
ByteOrder = Literal["little", "big"]
Hex = Annotated[str, pydantic.Field(pattern=r"^([0-9A-Fa-f]{2} ?)*$")]


class NumberLocation(StrictModel):
    """Location and type of a number in a frame."""

    at: Annotated[ByteOffset, key("offset of its first byte; that of the first byte of the frame is 0", "byte", 2)]
    type: Annotated[
        Literal["u8", "i8", "u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64"],
        key("type: u unsigned, i signed, f floating point, with the number of bits", NO_UNIT, "u16"),
    ]
    bits: Annotated[
        Bits | None,
        key("only these bits of an unsigned number: lowest bit, number of bits; none: all", "bit", [0, 12]),
    ] = None


class BinaryField(Field, NumberLocation):
    """A field of a frame: its meaning and its location."""


class LengthLocation(NumberLocation):
    """Location of the length of a frame."""

    plus: Annotated[
        int,
        pydantic.Field(ge=-MAX_FRAME_BYTES, le=MAX_FRAME_BYTES),
        key("added to the number: the whole frame has that many bytes", "byte"),
    ] = 0


class ConstantField(NumberLocation):
    """A number with a required value; frames with another value belong to another device."""

    value: Annotated[int, key("required value", ONE, 44)]


class FrameChecksum(StrictModel):
    """The checksum of a frame."""

    kind: Annotated[ChecksumKind, key("algorithm", NO_UNIT, "sum8")]
    at: Annotated[
        Annotated[int, pydantic.Field(ge=-MAX_FRAME_BYTES, lt=MAX_FRAME_BYTES)] | None,
        key("offset of the checksum, negative: from the end of the frame; none: the last bytes", "byte", -2),
    ] = None
    start: Annotated[
        ByteOffset, key("offset of the first covered byte; those up to the checksum are covered", "byte")
    ] = 0
    byte_order: Annotated[
        ByteOrder | None, key("byte order of the checksum; none: that of the frame", NO_UNIT, "big")
    ] = None

    def position(self, length: int) -> int:
        """Offset of the checksum in a frame of this length."""
        at = -CHECKSUMS[self.kind].size if self.at is None else self.at
        return at + length if at < 0 else at


class FrameOptions(StrictModel):
    """Format of a frame, see ``binary_struct``."""

    sync: Annotated[Hex, key("first bytes of every frame", NO_UNIT, "59 59")] = ""
    length: Annotated[
        Annotated[int, pydantic.Field(ge=2, le=MAX_FRAME_BYTES)] | None,
        key("length of the whole frame; none: stated by length_in", "byte", 9),
    ] = None
    length_in: Annotated[
        LengthLocation | None,
        key("[device.options.length_in]: location of the length in the frame; none: length is constant", NO_UNIT),
    ] = None
    longest: Annotated[
        int, pydantic.Field(ge=2, le=MAX_FRAME_BYTES), key("with length_in: maximum length of a frame", "byte")
    ] = 256
    byte_order: Annotated[ByteOrder, key("byte order of the numbers; little: low byte first", NO_UNIT)] = "little"
    trailer: Annotated[Hex, key("last bytes of every frame; empty: none", NO_UNIT)] = ""
    checksum: Annotated[
        FrameChecksum | None,
        key("[device.options.checksum]: checksum of a frame; none: frames are accepted unchecked", NO_UNIT),
    ] = None
    where: Annotated[
        tuple[ConstantField, ...],
        key("[[device.options.where]]: required numbers of a frame of this device; others are counted", NO_UNIT),
    ] = ()
    fields: Annotated[
        tuple[BinaryField, ...],
        key(
            "[[device.options.fields]]: fields of the frame; empty and no other key of the frame: the Benewake TFmini "
            "Plus",
            NO_UNIT,
        ),
    ] = ()


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


class FrameCodec:
    """Codec of the frame of the options.  Raises ValueError for wrong options."""

    def __init__(self, options: FrameOptions) -> None:
        order = options.byte_order
        self.sync, self.trailer = bytes.fromhex(options.sync), bytes.fromhex(options.trailer)
        self.checksum = options.checksum
        self._checksum_order: ByteOrder = (options.checksum and options.checksum.byte_order) or order
        self.length, self.max_length = options.length, options.longest
        length_in = options.length_in
        self.length_number = None if length_in is None else NumberCodec.at_location(length_in, order, "length_in")
        self.plus = length_in.plus if length_in else 0
        self.where = [(NumberCodec.at_location(w, order, f"where[{i}]"), w.value) for i, w in enumerate(options.where)]
        self.numbers = {f.name: NumberCodec.at_location(f, order, f"fields: {f.name}") for f in options.fields}
        names = [f.name for f in options.fields]
        self.codecs = make_field_codecs(names, options.fields, lambda name, word: self.numbers[name].to_wire(word))
        self._check()
        self._check_where()
        self._check_round_trip()

    def _check(self) -> None:
        if not self.sync:
            raise ValueError("sync: must be given, at least one byte in hexadecimal")
        if (self.length is None) == (self.length_number is None):
            raise ValueError("length: one of length and length_in must be given")
        tail = self._checksum_size + len(self.trailer)
        if self.length is None:
            return
        if len(self.sync) + tail > self.length:
            raise ValueError(f"length = {self.length}: shorter than sync, checksum and trailer")
        for name, number in [*self.numbers.items(), *(("where", number) for number, _ in self.where)]:
            if number.end > self._body_end(self.length):
                raise ValueError(f"{name}: ends at byte {number.end}, the data at {self._body_end(self.length)}")

    def _check_where(self) -> None:
        for i, (number, value) in enumerate(self.where):
            try:
                number.to_wire(value)
            except ValueError as error:
                raise ValueError(f"where[{i}]: value = {error}") from None

    def _check_round_trip(self) -> None:
        try:
            frame = self.encode({})
        except (struct.error, OverflowError, IndexError):
            frame = b""
        if not frame or self.measure(bytearray(frame)) != len(frame):
            raise ValueError(
                "a frame encoded as described cannot be decoded; "
                "check length_in (plus), longest, checksum (at, start) and the locations of fields"
            )

    def _body_end(self, length: int) -> int:
        """End of the data in a frame of this length: at the trailer, or at a checksum before it."""
        at_end = self.checksum is not None and (self.checksum.at is None or self.checksum.at < 0)
        return length - len(self.trailer) if not at_end or not self.checksum else self.checksum.position(length)

    @property
    def _checksum_size(self) -> int:
        return CHECKSUMS[self.checksum.kind].size if self.checksum else 0

    def measure(self, buffer: bytearray) -> int | Skip:
        """Size of the frame at the start of the buffer, or a Skip; see ``_framing``."""
        if skip := skip_to(buffer, self.sync):
            return skip
        length = self._length(buffer)
        if isinstance(length, Skip) or len(buffer) < length or length == 0:
            return length if isinstance(length, Skip) else 0
        if self.trailer and buffer[length - len(self.trailer) : length] != self.trailer:
            return Skip(1, "bad_trailer")
        return length if self._is_checksum_valid(buffer, length) else Skip(1, "bad_checksum")

    def _length(self, buffer: bytearray) -> int | Skip:
        """Length of the frame at the start of the buffer; 0 until its length field has arrived."""
        if self.length_number is None:
            return self.length or 0
        if len(buffer) < self.length_number.end:
            return 0
        length = int(self.length_number.read(buffer)) + self.plus
        min_length = max(len(self.sync), self.length_number.end) + self._checksum_size + len(self.trailer)
        return length if min_length <= length <= self.max_length else Skip(1, "bad_length")

    def _is_checksum_valid(self, frame: bytearray, length: int) -> bool:
        if self.checksum is None:
            return True
        at = self.checksum.position(length)
        size = self._checksum_size
        if not self.checksum.start <= at <= length - size:
            return False
        stated = int.from_bytes(frame[at : at + size], self._checksum_order)
        return stated == CHECKSUMS[self.checksum.kind].compute(bytes(frame[self.checksum.start : at]))

    def decode(self, frame: bytes, stamp: Stamp) -> tuple[str, list[Measurement]]:
        """Name and measurements of a whole frame."""
        for number, value in self.where:
            if number.end > self._body_end(len(frame)) or number.read(frame) != value:
                return "(other)", []
        end = self._body_end(len(frame))
        wires: dict[str, WireValue] = {
            name: float(number.read(frame)) for name, number in self.numbers.items() if number.end <= end
        }
        return "frame", decode_fields(self.codecs, wires, stamp)

    def encode(self, values: Mapping[str, WireValue]) -> bytes:
        """The frame with these values; undescribed bytes are 0."""
        tail = self._checksum_size + len(self.trailer)
        numbers = [*self.numbers.values(), *(n for n, _ in self.where), *filter(None, [self.length_number])]
        length = self.length or max(number.end for number in numbers) + tail
        frame = bytearray(length)
        frame[: len(self.sync)] = self.sync
        frame[length - len(self.trailer) :] = self.trailer
        if self.length_number:
            self.length_number.write(frame, length - self.plus)
        for number, value in self.where:
            number.write(frame, value)
        for name, number in self.numbers.items():
            wire = values.get(name)
            number.write(frame, wire if isinstance(wire, float) else 0.0)
        if self.checksum:
            at = self.checksum.position(length)
            value = CHECKSUMS[self.checksum.kind].compute(bytes(frame[self.checksum.start : at]))
            frame[at : at + self._checksum_size] = value.to_bytes(self._checksum_size, self._checksum_order)
        return bytes(frame)
