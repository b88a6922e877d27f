r"""Any device that sends text lines; the configuration describes their format and meaning.

Document: none; the options are the description (docs/add-a-sensor.md).  ``_line_template`` documents the template
of a line, ``fti.formats.described_fields`` the fields.

    line         "$WIMTA,{static_air_temperature:.1f},C*{checksum:02X}"       fields: name, unit, scale, lost, ...
    terminator   each of its characters ends a line; all of them are sent
    checksum     over the bytes between the first ``after`` and the last ``before``; the field is {checksum:..}

A line that does not match the template is skipped (``other_line``; ``no_match`` if it has unprintable characters), also
one with a wrong checksum or a missing beginning.

The default is an assumption for the ILM 500 laser altimeter, whose format is not public: metres as a decimal number, CR
or CR LF, at most 500 m; without a return a "no return" distance of LightWare lasers (``_rangefinder``), 0, a negative
number, or a line "E<number>".
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated

import pydantic

from fti.config import Positive, StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers import Command, Counters
from fti.drivers._arguments import check_complete
from fti.drivers._checksums import CHECKSUMS, ChecksumKind
from fti.drivers._line_framing import FirstLine, LineFramer
from fti.drivers._line_template import CHECKSUM, Template
from fti.drivers._polled_device import PolledDevice
from fti.drivers._rangefinder import LOST_M
from fti.formats.described_fields import Field, FieldCodec, FieldCollector, decode_fields, make_field_codecs
from fti.messages.measurements import Measurement, Stamp

DOCUMENT = "none: the configuration describes the line; the default is an assumption for the ILM 500 laser altimeter"
MESSAGES = {"line": "a line that matches the template", "lost_line": 'a line that means "no measurement"'}
CARRIERS = frozenset({"serial", "udp"})
COMMANDS: Mapping[str, Command] = {
    "send": Command("send a line; the terminator is added", {"text": "the line, 1 to 256 characters"}, answered=False)
}
MAX_COMMAND_BYTES = 256
PRINTABLE = re.compile(rb"[\x20-\x7e\t]*")


class LineChecksum(StrictModel):
    """The checksum of a line; its field in the template is {checksum}."""

    kind: Annotated[ChecksumKind, key("algorithm", NO_UNIT, "xor8")]
    after: Annotated[str, key("text before the covered part; empty: the line begins with it", NO_UNIT, "$")] = ""
    before: Annotated[
        str, key("text after the covered part; empty: it ends where the checksum begins", NO_UNIT, "*")
    ] = ""

    def compute(self, line: bytes) -> int:
        """The checksum of the part of a line before {checksum}."""
        data = line.partition(self.after.encode("latin-1"))[2] if self.after else line
        data = data.rpartition(self.before.encode("latin-1"))[0] if self.before else data
        return CHECKSUMS[self.kind].compute(data)


class LinePoll(StrictModel):
    """The request of a polled device, a text."""

    every_s: Annotated[Positive, key("period of the requests", "s", 1.0)]
    send: Annotated[
        str,
        pydantic.Field(min_length=1, max_length=MAX_COMMAND_BYTES),
        key("text of the request, with its terminator", NO_UNIT, "0R2\r\n"),
    ]


class Options(StrictModel):
    """Format of the lines, see ``docs/add-a-sensor.md``."""

    line: Annotated[str, key("template of a line, with a field {NAME:FORMAT} for each value", NO_UNIT)] = (
        "{slant_range:f}"
    )
    fields: Annotated[
        tuple[Field, ...],
        key(
            "[[device.options.fields]]: meaning of the fields of the template; a field without one is a number in SI "
            "units",
            NO_UNIT,
        ),
    ] = (Field(name="slant_range", lost=(*LOST_M, 0.0), limits=(0.0, 500.0)),)
    lost_lines: Annotated[
        tuple[str, ...],
        key("templates of lines that mean that there is no measurement, even where line matches them", NO_UNIT),
    ] = ("E{_code:d}",)
    terminator: Annotated[
        str,
        pydantic.Field(min_length=1, max_length=4),
        key("each of its characters ends a line; all of them are sent after a line", NO_UNIT),
    ] = "\r\n"
    checksum: Annotated[
        LineChecksum | None,
        key("[device.options.checksum]: checksum of a line; none: the template has no {checksum}", NO_UNIT),
    ] = None
    longest: Annotated[int, pydantic.Field(ge=8, le=2048), key("maximum length of a line", "byte")] = 256
    first_line: Annotated[
        FirstLine,
        key(
            "the first bytes after a connect; skip: they may be the end of a line; take: they begin a line, as in "
            "datagrams; never on a serial line",
            NO_UNIT,
        ),
    ] = "skip"
    on_connect: Annotated[
        tuple[str, ...], key("texts to send after every connect, with their terminators", NO_UNIT)
    ] = ()
    poll: Annotated[
        LinePoll | None,
        key("[device.options.poll]: the request of a polled device; none: it sends without requests", NO_UNIT),
    ] = None


class LineCodec:
    """Codec of the lines of the options.  Raises ValueError for wrong options."""

    def __init__(self, options: Options) -> None:
        _check_characters(options)
        lost = {f.name: tuple(word for word in f.lost if isinstance(word, str)) for f in options.fields}
        self.template = Template(options.line, lost)
        self.lost = [_lost_line(text) for text in options.lost_lines]
        min_length = len(self.template.write({})) + 1
        if options.longest < min_length:
            raise ValueError(f"longest = {options.longest}: a line with its end has at least {min_length} characters")
        self.checksum = options.checksum
        names = [name for name in self.template.names if name != CHECKSUM]
        if not names:
            raise ValueError("line: has no {field}")
        fields = options.fields
        if "fields" not in options.model_fields_set:
            fields = tuple(f for f in fields if f.name in names)
        self.codecs: dict[str, FieldCodec] = make_field_codecs(names, fields, self.template.to_wire)
        for name, is_text in self.template.is_text.items():
            meaning = self.codecs.get(name)
            if is_text and meaning and (meaning.quantity or meaning.field.limits):
                raise ValueError(f"fields: {name}: is text in the line; a quantity and limits need a number")
        if (CHECKSUM in self.template.names) != (options.checksum is not None):
            raise ValueError("checksum: must be configured if the line has {checksum}, and only then")
        if options.checksum:
            _check_checksum(options.checksum, self.template)
        for text in (options.line, *options.lost_lines):
            if any(end in text for end in options.terminator):
                raise ValueError(f"line: {text!r} contains a character of the terminator {options.terminator!r}")

    def _is_lost(self, line: bytes) -> bool:
        return any(lost.match(line) for lost in self.lost)

    def refuse(self, line: bytes) -> str:
        """Reason why a line is not a message, otherwise ""."""
        if self._is_lost(line):
            return ""
        match = self.template.match(line)
        if match is None:
            return "other_line" if PRINTABLE.fullmatch(line) else "no_match"
        if self.checksum is None:
            return ""
        stated = self.template.read(match)[CHECKSUM]
        return "" if stated == self.checksum.compute(line[: match.start(CHECKSUM)]) else "bad_checksum"

    def decode(self, line: bytes, stamp: Stamp) -> tuple[str, list[Measurement]]:
        """Name and measurements of an accepted line."""
        match = None if self._is_lost(line) else self.template.match(line)
        if match is None:
            return "lost_line", decode_fields(self.codecs, {}, stamp)
        return "line", decode_fields(self.codecs, self.template.read(match), stamp)


def _check_characters(options: Options) -> None:
    """Sent text must have one byte per character.  Raises ValueError."""
    texts = {"terminator": options.terminator, "poll.send": options.poll.send if options.poll else ""}
    for name, text in (*texts.items(), *(("on_connect", text) for text in options.on_connect)):
        if any(ord(character) > 255 for character in text):
            raise ValueError(f"{name} = {text!r}: each character must be one byte, up to U+00FF")


def _lost_line(text: str) -> Template:
    try:
        return Template(text)
    except ValueError as error:
        raise ValueError(f"lost_lines: {text!r}: {str(error).removeprefix('line: ')}") from None


def _check_checksum(rule: LineChecksum, template: Template) -> None:
    """Raises ValueError if the line does not fit the checksum."""
    at = template.names.index(CHECKSUM)
    field, texts = template.fields[at], [p.before for p in template.fields[: at + 1]]
    size = 2 * CHECKSUMS[rule.kind].size
    if field.kind not in "dxX" or (field.kind != "d" and field.width not in (0, size)):
        raise ValueError(f"checksum: {rule.kind} needs the format {{checksum:0{size}X}}, 0{size}x or d")
    for name, text in (("after", rule.after), ("before", rule.before)):
        if not any(text in before for before in texts):
            raise ValueError(f"checksum: {name} = {text!r}: must be in the line before the checksum")


class Decoder:
    """Lines to measurements.  Raises ValueError for wrong options."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._line = LineCodec(options)
        self._framer = LineFramer(
            self._line.refuse,
            self.counters,
            max_length=options.longest,
            starts_with_line=options.first_line == "take",
            ends=options.terminator.encode("latin-1"),
        )

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        for t_ns, frame in self._framer.feed(data, t_rx_ns):
            if len(frame) > 1:
                name, decoded = self._line.decode(frame[:-1], Stamp(t_ns))
                self.counters.messages[name] += 1
                measurements += decoded
        return measurements


class Encoder:
    """The emulated device: sends a line when every field has a new value, at once or on request.

    Invalid values that the line cannot express are not sent.
    """

    def __init__(self, options: Options) -> None:
        self._line = LineCodec(options)
        self.codecs: Mapping[str, FieldCodec] = self._line.codecs
        self._end = options.terminator.encode("latin-1")
        self._collector = FieldCollector(self.codecs)
        self._polled_device = PolledDevice(options.poll.send.encode("latin-1") if options.poll else b"")

    def encode(self, measurement: Measurement) -> list[bytes]:
        values = self._collector.add(measurement, self._line.template.is_text)
        if values is None:
            return []
        checksum = self._line.checksum.compute if self._line.checksum else None
        return self._polled_device.offer([self._line.template.write(values, checksum) + self._end])

    def respond(self, data: bytes) -> list[bytes]:
        return self._polled_device.respond(data)


make_decoder, make_encoder = Decoder, Encoder


def on_connect(options: Options) -> list[bytes]:
    """As configured."""
    return [text.encode("latin-1") for text in options.on_connect]


def poll(options: Options) -> tuple[float, bytes] | None:
    """As configured."""
    return (options.poll.every_s, options.poll.send.encode("latin-1")) if options.poll else None


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The bytes of a line.  Raises ValueError."""
    check_complete(COMMANDS, name, args)
    text, end = args["text"], (options or Options()).terminator
    if not 1 <= len(text) <= MAX_COMMAND_BYTES or not text.isascii() or any(c in text for c in end):
        raise ValueError(f"send: text = {text[:60]!r}: must be 1 to 256 ASCII characters without the terminator")
    return (text + end).encode("latin-1")
