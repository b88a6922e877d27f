"""Any device that sends binary frames; the configuration describes their format and meaning.

Document: none; the options are the description (docs/add-a-sensor.md).  ``fti.formats.described_fields`` documents the
fields; ``at`` is the offset of a field from the first sync byte, 0.

    sync | ... | checksum | trailer         sync and trailer in hexadecimal, "5959"

    length     of the whole frame [bytes], or
    length_in  location of a length field: at, type, bits; the whole frame has ``plus`` bytes more than it states
    checksum   kind; ``at``: offset, negative from the end of the frame; over the bytes from ``start`` up to it
               ``byte_order`` if it differs from that of the frame
    where      required values of a frame of this device; others are framed and counted as "(other)"
    bits       [lowest, count]: only these bits of an integer
    array      ranges of an image or of lines of a scanner, which become one RangeScan; the frames of an image in parts
               are joined, and the points of a missing frame have no return

The default is the Benewake TFmini Plus (SJ-PM-TFmini Plus-T-01 A04, 5.3 and 5.4), little-endian:

    0-1    | 2-3           | 4-5      | 6-7             | 8
    59 59  | distance [cm] | strength | (degC + 256) * 8 | sum of bytes 0-7

    a strength below 100 or of 65535 is not reliable, and the distance is 0 then
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

from fti.config import Positive, StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers import Command
from fti.drivers._arguments import check_complete
from fti.drivers._binary_frame import BinaryField, FrameChecksum, FrameCodec, FrameOptions, Hex
from fti.drivers._framing import FramedDecoder
from fti.drivers._polled_device import PolledDevice
from fti.formats.binary_numbers import ByteOrder
from fti.formats.described_fields import FieldCodec, FieldCollector, WireValue
from fti.formats.range_array import RangeArray
from fti.messages.measurements import Measurement, RangeScan, Stamp

if TYPE_CHECKING:
    from fti.drivers._range_array_codec import ScanAssembler, ScanDivider

DOCUMENT = "none: the configuration describes the frame; the default is Benewake SJ-PM-TFmini Plus-T-01 A04"
MESSAGES = {"frame": "a frame of this device", "(other)": "a frame with other values than ``where`` requires"}
CARRIERS = frozenset({"serial", "udp"})
COMMANDS: Mapping[str, Command] = {
    "send": Command("send bytes unchanged", {"hex": "1 to 256 bytes in hexadecimal"}, answered=False)
}
MAX_COMMAND_BYTES = 256
#: A decoder holds at least so many bytes of an incomplete frame.
MIN_HELD_BYTES = 2048


class FramePoll(StrictModel):
    """The request of a polled device, in hexadecimal."""

    every_s: Annotated[Positive, key("period of the requests", "s", 0.1)]
    send: Annotated[Hex, key("bytes of the request", NO_UNIT, "5A 04 04 62")]


class Options(FrameOptions):
    """Format of the frames, see ``docs/add-a-sensor.md``."""

    on_connect: Annotated[tuple[Hex, ...], key("messages to send after every connect", NO_UNIT)] = ()
    poll: Annotated[
        FramePoll | None,
        key("[device.options.poll]: the request of a polled device; none: it sends without requests", NO_UNIT),
    ] = None


TFMINI_PLUS = Options(
    sync="5959",
    length=9,
    checksum=FrameChecksum(kind="sum8"),
    fields=(
        BinaryField(name="slant_range", at=2, type="u16", scale=0.01, lost=(0.0,), needs=("strength",)),
        BinaryField(name="strength", at=4, type="u16", limits=(100.0, 65534.0)),
        BinaryField(name="temperature", at=6, type="u16", scale=0.125, offset=-256.0, unit="degC"),
    ),
)


def make_frame_codec(options: Options) -> FrameCodec:
    """The frame of the options, or the default without fields.  Raises ValueError."""
    if options.fields or options.array:
        return FrameCodec(options)
    described = options.model_fields_set - {"on_connect", "poll", "fields"}
    if described:
        raise ValueError(f"fields: must be given where {', '.join(sorted(described))} is")
    return FrameCodec(TFMINI_PLUS)


def _make_assembler(array: RangeArray, byte_order: ByteOrder) -> ScanAssembler:
    from fti.drivers._range_array_codec import ScanAssembler  # noqa: PLC0415 - numpy: only where there are arrays

    return ScanAssembler(array, byte_order)


def _make_divider(array: RangeArray, byte_order: ByteOrder) -> ScanDivider:
    from fti.drivers._range_array_codec import ScanDivider  # noqa: PLC0415 - see above

    return ScanDivider(array, byte_order)


class Decoder(FramedDecoder):
    """Frames to measurements.  Raises ValueError for wrong options."""

    def __init__(self, options: Options) -> None:
        self._frame = make_frame_codec(options)
        super().__init__(self._frame.measure, max(MIN_HELD_BYTES, self._frame.length or options.longest) + 1)
        self._assembler = _make_assembler(options.array, options.byte_order) if options.array else None

    def _decode(self, frame: bytes, t_rx_ns: int) -> tuple[str, list[Measurement]]:
        stamp = Stamp(t_rx_ns)
        name, measurements = self._frame.decode(frame, stamp)
        if self._assembler and name == "frame" and self._frame.has_array(frame):
            measurements += self._assembler.add(frame, stamp, self.counters)
        return name, measurements


class Encoder:
    """The emulated device: sends a frame when every field has a new value, at once or on request.

    Invalid values that the frame cannot express are not sent.
    """

    def __init__(self, options: Options) -> None:
        self._frame = make_frame_codec(options)
        self.codecs: Mapping[str, FieldCodec] = self._frame.codecs
        self._collector = FieldCollector(self.codecs)
        self._polled_device = PolledDevice(bytes.fromhex(options.poll.send) if options.poll else b"")
        self._is_text = dict.fromkeys(self.codecs, False)
        self._array = options.array
        self._divider = _make_divider(options.array, options.byte_order) if options.array else None
        self._values: dict[str, WireValue] = {name: codec.default() for name, codec in self.codecs.items()}

    def encode(self, measurement: Measurement) -> list[bytes]:
        if self._divider and self._array:
            return self._encode_scan(measurement, self._divider, self._array)
        values = self._collector.add(measurement, self._is_text)
        return [] if values is None else self._polled_device.offer([self._frame.encode(values)])

    def _encode_scan(self, measurement: Measurement, divider: ScanDivider, array: RangeArray) -> list[bytes]:
        """The frames of a scan with the last values of the fields; other measurements are kept for the next scan."""
        if not isinstance(measurement, RangeScan) or measurement.points != array.points:
            carried = ((name, codec.wire(measurement)) for name, codec in self.codecs.items() if not codec.is_ignored)
            self._values |= {name: wire for name, (is_carried, wire) in carried if is_carried}
            return []
        fills = divider.fills(measurement)
        return self._polled_device.offer([self._frame.encode(self._values, fill) for fill in fills])

    def respond(self, data: bytes) -> list[bytes]:
        return self._polled_device.respond(data)


make_decoder, make_encoder = Decoder, Encoder


def on_connect(options: Options) -> list[bytes]:
    """As configured."""
    return [bytes.fromhex(text) for text in options.on_connect]


def poll(options: Options) -> tuple[float, bytes] | None:
    """As configured."""
    return (options.poll.every_s, bytes.fromhex(options.poll.send)) if options.poll else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a command.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    try:
        data = bytes.fromhex(args["hex"])
    except ValueError:
        data = b""
    if not 1 <= len(data) <= MAX_COMMAND_BYTES:
        raise ValueError(f"send: hex = {args['hex'][:60]!r}: must be 1 to 256 bytes in hexadecimal")
    return data
