"""Binary frames that the configuration describes: offsets and types of numbers, checksum, trailer, length."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from typing import Annotated

import pydantic

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers._checksums import CHECKSUMS, ChecksumKind
from fti.drivers._framing import Skip, skip_to
from fti.formats.binary_numbers import MAX_FRAME_BYTES, ByteOffset, ByteOrder, NumberCodec, NumberLocation
from fti.formats.described_fields import Field, FieldCodec, WireValue, decode_fields, make_field_codecs
from fti.formats.range_array import RangeArray
from fti.messages.measurements import Measurement, Stamp

Hex = Annotated[str, pydantic.Field(pattern=r"^([0-9A-Fa-f]{2} ?)*$")]


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
    array: Annotated[
        RangeArray | None,
        key("[device.options.array]: ranges of an image or of lines, which become one scan; none: no ranges", NO_UNIT),
    ] = None


def _array_ends(array: RangeArray, byte_order: ByteOrder) -> dict[str, int]:
    """Ends of the numbers of an array, by their keys.  Raises ValueError with the wrong one."""
    array.check()
    found = {
        "array": array.end(
            NumberCodec.at_location(NumberLocation(at=array.at, type=array.type), byte_order, "").form.size
        )
    }
    for name, location in (("array.part_in", array.part_in), ("array.image_in", array.image_in)):
        if location:
            found[name] = NumberCodec.at_location(location, byte_order, name).end
    return found


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
        self.codecs: dict[str, FieldCodec] = {}
        if names or options.array is None:
            self.codecs = make_field_codecs(names, options.fields, lambda name, word: self.numbers[name].to_wire(word))
        self._ends = {name: number.end for name, number in self.numbers.items()}
        if options.array:
            self._ends |= _array_ends(options.array, order)
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
        for name, end in [*self._ends.items(), *(("where", number.end) for number, _ in self.where)]:
            if end > self._body_end(self.length):
                raise ValueError(f"{name}: ends at byte {end}, the data at {self._body_end(self.length)}")

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

    def has_array(self, frame: bytes) -> bool:
        """Is the whole frame long enough for the numbers of its array?"""
        end = self._body_end(len(frame))
        return all(self._ends[name] <= end for name in self._ends.keys() - self.numbers.keys())

    def encode(self, values: Mapping[str, WireValue], fill: Callable[[bytearray], None] | None = None) -> bytes:
        """The frame with these values; undescribed bytes are 0.  fill : writes other bytes before the checksum"""
        tail = self._checksum_size + len(self.trailer)
        numbers = [*(n for n, _ in self.where), *filter(None, [self.length_number])]
        length = self.length or max([*self._ends.values(), *(number.end for number in numbers)]) + tail
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
        if fill:
            fill(frame)
        if self.checksum:
            at = self.checksum.position(length)
            value = CHECKSUMS[self.checksum.kind].compute(bytes(frame[self.checksum.start : at]))
            frame[at : at + self._checksum_size] = value.to_bytes(self._checksum_size, self._checksum_order)
        return bytes(frame)
