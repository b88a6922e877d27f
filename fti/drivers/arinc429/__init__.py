"""ARINC 429 words from a converter or recorder: bare words, Alta APMP, or IRIG 106 chapter 10.

Document: ARINC 429 part 1 (word, in ``word``) and part 2 (labels).  The label sets of equipment are data:
``labels.toml`` and a user file (``labels_file``), because the meaning of a label depends on the equipment: 165 is a
radio height in BCD on a radio altimeter and a vertical velocity on GPS equipment.

    packets "none"        four bytes per word and nothing else: serial or UDP; synchronisation: ``stream``
            "apmp"        Alta ENET-A429 over UDP: ``apmp``
            "chapter10"   IRIG 106 chapter 10 type 0x38: ``chapter10``

    byte_order "big"      bits 32-25 | 24-17 | 16-9 | 8-1 (label); packets define their own order
    byte_order "little"   bits 8-1 (label) | 16-9 | 24-17 | 32-25
    label_reversed        the label's most significant bit is bit 1, as on the bus; false: the card has reversed it
    parity                of the 32 bits: odd (standard), even, or none: bit 32 has another meaning
    bus                   only this bus (channel) of the packets; words of others are counted as "other_bus"

There is no common standard for words over a serial line, hence the options.  In packets each word has the time of the
converter since its start, with a resolution of 20 ns or 100 ns; a word with an error flag or a wrong parity is only
counted ("bus_error", "bad_parity").  Missing packets are counted as lost.

Kinds of words: BNR, BCD, and discrete (single bits as flags of a DeviceStatus, small numbers as Reading).  Values
without a measurement class become a Reading by name.  Label 377 identifies the equipment: another one than that of the
set gives a status that is not ok.  Sign/status: ``label_codec``.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, key
from fti.drivers import Counters
from fti.drivers._framing import Framer
from fti.drivers._no_commands import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.drivers.arinc429 import word as wire
from fti.drivers.arinc429.apmp import Apmp
from fti.drivers.arinc429.chapter10 import Chapter10
from fti.drivers.arinc429.label_codec import Handler, LabelCodec, SourceKey, make_codecs, source_key
from fti.drivers.arinc429.labels import Label, LabelSet, choose
from fti.drivers.arinc429.packets import Packets, boot_ns
from fti.drivers.arinc429.stream import SEARCH_BYTES, WORD_BYTES, WordStream, required_words
from fti.formats.quantities import QUANTITIES
from fti.messages.measurements import Measurement, Stamp, TimeScale

DOCUMENT = "ARINC 429 part 1 (word) and part 2 (labels); bare words, Alta APMP, IRIG 106-22 chapter 11 type 0x38"
MESSAGES = dict.fromkeys(QUANTITIES, "BNR or BCD word of this quantity") | {
    "equipment_id": "label 377: identifier of the equipment",
    "other": "a word whose label is not enabled",
    "other_bus": "a word of another bus than the configured one",
    "bad_parity": "a word of a packet with wrong parity",
    "bus_error": "a word with an error flag of the converter",
    "bad_status": "an APMP packet whose status is not good",
    "(other)": "readings, discrete and fine words by the names of the label set; packet_0x11: packet of another type",
}
CARRIERS = frozenset({"serial", "udp"})
PACKETS: dict[str, type[Apmp | Chapter10]] = {"apmp": Apmp, "chapter10": Chapter10}


class Options(StrictModel):
    """Options of an ARINC 429 bus."""

    packets: Annotated[
        Literal["none", "apmp", "chapter10"],
        key(
            "carrier of the words; none: four bytes per word; apmp: Alta ENET-A429; chapter10: IRIG 106 chapter 10",
            NO_UNIT,
        ),
    ] = "none"
    byte_order: Annotated[
        Literal["big", "little"],
        key(
            "byte order of bare words; big: bits 32-25 first; little: the label first; packets define their own",
            NO_UNIT,
        ),
    ] = "big"
    label_reversed: Annotated[
        bool,
        key(
            "true: the most significant bit of the label is bit 1, as on the bus; false: the card has reversed it",
            NO_UNIT,
        ),
    ] = True
    parity: Annotated[
        Literal["odd", "even", "none"],
        key("parity of the 32 bits, odd by the standard; none: bit 32 has another meaning", NO_UNIT),
    ] = "odd"
    bus: Annotated[
        Annotated[int, Field(ge=0, le=255)] | None,
        key("only this bus (channel) of the packets; none: every bus", NO_UNIT, 1),
    ] = None
    set: Annotated[str, key("name of the label set of the equipment; none: only labels", NO_UNIT)] = "radio_altimeter"
    labels_file: Annotated[
        str | None,
        key("file with label sets of your own; none: the built-in sets", NO_UNIT, "labels/air_data_unit.toml"),
    ] = None
    labels: Annotated[
        Annotated[
            Annotated[tuple[Label, ...], Tag("list")] | Annotated[str, Tag("text")],
            Discriminator(lambda labels: "text" if isinstance(labels, str) else "list"),
        ],
        key("further labels, with priority over the set; or the text of labels_file, filled in from it", NO_UNIT),
    ] = ()


def enabled_labels(options: Options) -> LabelSet:
    """The enabled labels.  Raises ValueError or ConfigError for a missing or wrong set."""
    if isinstance(options.labels, str):
        return choose(options.set, options.labels)
    label_set = choose(options.set, "")
    own = {(item.label, item.sdi) for item in options.labels}
    others = tuple(item for item in label_set.labels if (item.label, item.sdi) not in own)
    return label_set.model_copy(update={"labels": options.labels + others})


#: Bits of label and source identifier of a word.
KEY = 0x3FF


class Decoder:
    """Words to measurements.  Raises ValueError if no label is enabled or the set does not exist."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._options = options
        self._must_reverse_label = not options.label_reversed
        handlers = [handler for codec in make_codecs(enabled_labels(options)) for handler in codec.handlers()]
        handlers.sort(key=lambda handler: handler.sdi is not None)  # a specific source replaces any source
        self._handlers = {key: handler for handler in handlers for key in _keys_of(handler)}
        self._packets: Packets | None = None
        if options.packets == "none":
            required = required_words(sum(1.0 if h.sdi is None else 0.25 for h in handlers), options.parity)
            stream = WordStream(self._word, lambda word: word & KEY in self._handlers, options.parity, required)
            self._framer = Framer(stream.measure, self.counters, limit=SEARCH_BYTES)
        else:
            self._packets = PACKETS[options.packets]()
            self._framer = Framer(self._packets.measure, self.counters, limit=self._packets.LIMIT)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        measurements: list[Measurement] = []
        for t_rx, frame in self._framer.feed(data, t_rx_ns):
            if self._packets is None:
                measurements += self._decode_word(self._word(frame), Stamp(t_rx))
            else:
                measurements += self._decode_packet(self._packets, frame, t_rx)
        return measurements

    def _word(self, data: bytes | bytearray) -> int:
        word = int.from_bytes(data, self._options.byte_order)
        return wire.reverse_label(word) if self._must_reverse_label else word

    def _decode_word(self, word: int, stamp: Stamp) -> list[Measurement]:
        handler = self._handlers.get(word & KEY)
        if handler is None:
            self.counters.messages["other"] += 1
            return []
        self.counters.messages[handler.name] += 1
        return handler.decode(word, stamp)

    def _decode_packet(self, packets: Packets, packet: bytes, t_rx_ns: int) -> list[Measurement]:
        if count_missing := packets.count_missing(packet):
            self.counters.lost[self._options.packets] += count_missing
        name, words = packets.unpack(packet)
        if name:
            self.counters.messages[name] += 1
        measurements: list[Measurement] = []
        for received in words:
            word = wire.reverse_label(received.word) if self._must_reverse_label else received.word
            if self._options.bus is not None and received.bus != self._options.bus:
                self.counters.messages["other_bus"] += 1
            elif received.error:
                self.counters.messages["bus_error"] += 1
            elif not wire.is_intact(word, self._options.parity):
                self.counters.messages["bad_parity"] += 1
            else:
                measurements += self._decode_word(word, Stamp(t_rx_ns, received.t_dev_ns, TimeScale.BOOT))
        return measurements


def _keys_of(handler: Handler) -> list[int]:
    """Label and source identifier of the words that it decodes."""
    return [wire.label_byte(handler.label) | sdi << 8 for sdi in (range(4) if handler.sdi is None else (handler.sdi,))]


class Encoder:
    """The emulated equipment: for each measurement the words of the enabled labels that carry it.

    Bare words are sent one by one, packets with all words of the measurement.
    """

    def __init__(self, options: Options) -> None:
        self._options = options
        self._codecs: dict[SourceKey, list[LabelCodec]] = {}
        for entry in make_codecs(enabled_labels(options)):
            for source in entry.sources():
                self._codecs.setdefault(source, []).append(entry)
        self._packets: Packets | None = None if options.packets == "none" else PACKETS[options.packets]()

    def encode(self, measurement: Measurement) -> list[bytes]:
        codecs = self._codecs.get(source_key(measurement))
        if codecs is None:
            return []
        words = [self._to_wire(word) for entry in codecs for word in entry.encode(measurement)]
        if self._packets is None:
            return [word.to_bytes(WORD_BYTES, self._options.byte_order) for word in words]
        return [self._packets.pack(words, self._options.bus or 0, boot_ns(measurement.stamp))] if words else []

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _to_wire(self, word: int) -> int:
        word = word if self._options.parity == "odd" else wire.with_parity(word, self._options.parity)
        return word if self._options.label_reversed else wire.reverse_label(word)


make_decoder, make_encoder = Decoder, Encoder
