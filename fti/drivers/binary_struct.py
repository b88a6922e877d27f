"""Any device that sends binary frames: what they look like, and what they mean, stands in the configuration.

Document: none; the options are the description (docs/add-a-sensor.md).  The fields are explained in ``_fields``; each
has a place, as the maker's table has it: ``at`` counts from the first sync byte, 0.

    sync | ... | checksum | trailer         sync and trailer in hexadecimal, "5959"

    length     of the whole frame [bytes], or
    length_in  where it is told: at, type, bits; the whole frame has ``plus`` bytes more than is told
    checksum   kind; ``at``: where it stands, negative from the frame's end; over the bytes from ``start`` up to it
               ``byte_order`` where it is not the frame's
    where      what must stand in a frame for it to be this device's; others are framed, and counted as "(other)"
    bits       [lowest, number]: only these bits of a whole number

The default is the Benewake TFmini Plus (SJ-PM-TFmini Plus-T-01 A04, 5.3 and 5.4), little-endian:

    0-1    | 2-3           | 4-5      | 6-7             | 8
    59 59  | distance [cm] | strength | (degC + 256) * 8 | sum of bytes 0-7

    a strength below 100 or of 65535 is not reliable, and the distance is 0 then
"""

from __future__ import annotations

from collections.abc import Mapping

from fti.config import Positive, StrictModel
from fti.drivers import Command, Counters
from fti.drivers._arguments import check_complete
from fti.drivers._binary_frame import MAX_FRAME_BYTES, BinaryField, FrameChecksum, FrameCodec, FrameOptions, Hex
from fti.drivers._fields import FieldCodec, FieldCollector
from fti.drivers._framing import Framer
from fti.drivers._polled_device import PolledDevice
from fti.types import Measurement, Stamp

DOCUMENT = "none: the configuration describes the frame; the default is Benewake SJ-PM-TFmini Plus-T-01 A04"
MESSAGES = {"frame": "a frame of this device", "(other)": "a frame in which something else stands than ``where`` says"}
CARRIERS = frozenset({"serial", "udp"})
COMMANDS: Mapping[str, Command] = {
    "send": Command("send bytes as they are", {"hex": "1 to 256 bytes in hexadecimal"}, answered=False)
}
MAX_COMMAND_BYTES = 256


class FramePoll(StrictModel):
    """``send``: the question in hexadecimal; ``every_s`` [s]."""

    every_s: Positive
    send: Hex


class Options(FrameOptions):
    """The frame; ``on_connect``: what the device is told after every connect, in hexadecimal."""

    on_connect: tuple[Hex, ...] = ()
    poll: FramePoll | None = None


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
    """The frame that the options describe; the default's when they describe none.  Raises ValueError."""
    if options.fields:
        return FrameCodec(options)
    described = options.model_fields_set - {"on_connect", "poll", "fields"}
    if described:
        raise ValueError(f"fields: must be given where {', '.join(sorted(described))} is")
    return FrameCodec(TFMINI_PLUS)


class Decoder:
    """Frames to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._frame = make_frame_codec(options)
        self._framer = Framer(self._frame.measure, self.counters, limit=MAX_FRAME_BYTES + 1)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for t_ns, frame in self._framer.feed(data, t_rx_ns):
            name, measurements = self._frame.decode(frame, Stamp(t_ns))
            self.counters.messages[name] += 1
            found += measurements
        return found


class Encoder:
    """The device's end: a frame when every field has been told anew, at once or when it is asked.

    What the device knows to be wrong, and has no word for, is not sent.
    """

    def __init__(self, options: Options) -> None:
        self._frame = make_frame_codec(options)
        self.known: Mapping[str, FieldCodec] = self._frame.known
        self._collector = FieldCollector(self.known)
        self._polled_device = PolledDevice(bytes.fromhex(options.poll.send) if options.poll else b"")
        self._is_text = dict.fromkeys(self.known, False)

    def encode(self, measurement: Measurement) -> list[bytes]:
        values = self._collector.take(measurement, self._is_text)
        return [] if values is None else self._polled_device.offer([self._frame.encode(values)])

    def respond(self, data: bytes) -> list[bytes]:
        return self._polled_device.respond(data)


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder.  Raises ValueError when the description is wrong."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder.  Raises ValueError when the description is wrong."""
    return Encoder(options)


def on_connect(options: Options) -> list[bytes]:
    """What the options say."""
    return [bytes.fromhex(text) for text in options.on_connect]


def poll(options: Options) -> tuple[float, bytes] | None:
    """What the options say."""
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
