"""ARINC 429 words over a serial line or UDP, as a converter hands them over.

Document: ARINC 429 part 1 (word) and part 2 (labels); the word is in ``_arinc429_word``, the label sets of equipment
in ``arinc429_labels.toml``.  There is no common standard for the serial side: four bytes a word, no framing.

    byte_order "big"      bits 32-25 | 24-17 | 16-9 | 8-1 (label)
    byte_order "little"   bits 8-1 (label) | 16-9 | 24-17 | 32-25
    label_reversed        the label's most significant bit is bit 1, as on the bus; false: the card has turned it

Open, therefore options: byte order, turned label, and which labels there are (``set`` for the equipment, ``labels``
in addition or instead; the same label means different things on different equipment).

Resynchronisation: where words begin is known when two enabled labels stand in good parity at a distance of whole
words, with good parity between them; until then nothing is released.  From then on an enabled label is released at
once.  A word that is not enabled is framed and counted as "other" as soon as the next enabled label shows that words
still begin there: turned by a whole byte a word keeps its parity, so after a lost byte parity alone would believe the
wrong place.  A word in bad parity starts the search again.  At most SEARCH_BYTES are held; as many bytes of good
parity are proof too.
Sign/status: normal is valid; failure, no computed data and test are not valid, and the first two
carry no value.
"""

from __future__ import annotations

import importlib.resources
import tomllib
from functools import cache
from typing import Annotated, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from fti.config import StrictModel, bind
from fti.drivers import Counters
from fti.drivers import _arinc429_word as wire
from fti.drivers._arinc429_word import BcdState, BnrState
from fti.drivers._bits import REVERSED
from fti.drivers._framing import Framer, Skip
from fti.drivers._quantities import QUANTITIES, Quantity, to_si
from fti.drivers._talker import COMMANDS, command, on_connect, poll  # noqa: F401 - the rest of the contract
from fti.types import DeviceStatus, Measurement, Stamp

DOCUMENT = "ARINC 429 part 1 (word) and part 2 (labels), over four-byte words of a converter"
MESSAGES = dict.fromkeys(QUANTITIES, "BNR or BCD word of this quantity") | {"other": "a word not enabled"}
CARRIERS = frozenset({"serial", "udp"})

WORD_BYTES = 4
SEARCH_BYTES = 64 * WORD_BYTES
SETS = ("radio_altimeter", "radio_altimeter_bcd", "air_data", "ahrs", "gps", "ils")


class Label(StrictModel):
    """One enabled label.

    label : octal digits; quantity and unit : see ``_quantities``; range [unit] and bits of a BNR word; resolution
    [unit] of a BCD word's last digit; sign -1 where this equipment counts the other way; sdi : only this source
    """

    label: Annotated[str, Field(pattern=r"^[0-3][0-7]{2}$")]
    quantity: str
    unit: str
    kind: Literal["bnr", "bcd"] = "bnr"
    range: Annotated[float, Field(gt=0)] | None = None
    bits: Annotated[int, Field(ge=1, le=20)] | None = None
    resolution: Annotated[float, Field(gt=0)] | None = None
    sign: Literal[1, -1] = 1
    sdi: Annotated[int, Field(ge=0, le=3)] | None = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.quantity not in QUANTITIES:
            raise ValueError(f"label {self.label}: no quantity {self.quantity!r}; there are {', '.join(QUANTITIES)}")
        to_si(self.quantity, self.unit)
        if self.kind == "bnr" and (self.range is None or self.bits is None):
            raise ValueError(f"label {self.label}: a BNR word needs range and bits")
        if self.kind == "bcd" and self.resolution is None:
            raise ValueError(f"label {self.label}: a BCD word needs resolution")
        return self


class _LabelSet(StrictModel):
    labels: tuple[Label, ...]


class Options(StrictModel):
    """``set``: labels of the equipment, or "none"; ``labels``: further ones, which go before those of the set."""

    byte_order: Literal["big", "little"] = "big"
    label_reversed: bool = True
    set: Literal["radio_altimeter", "radio_altimeter_bcd", "air_data", "ahrs", "gps", "ils", "none"] = "radio_altimeter"
    labels: tuple[Label, ...] = ()


@cache
def label_set(name: str) -> tuple[Label, ...]:
    """The labels of a built-in set."""
    text = importlib.resources.files("fti.drivers").joinpath("arinc429_labels.toml").read_text(encoding="utf-8")
    return bind(_LabelSet, tomllib.loads(text)[name], "arinc429_labels.toml", name).labels


class Entry(NamedTuple):
    """A label made ready: quantity, factor and offset to SI (sign included), what a full turn is."""

    label: Label
    quantity: Quantity
    factor: float
    offset: float
    turns: bool

    def decode(self, word: int, stamp: Stamp) -> list[Measurement]:
        """The measurement of a word, and a status when the equipment does not call it normal."""
        state = wire.ssm(word)
        normal = state == BnrState.NORMAL if self.label.kind == "bnr" else state in (BcdState.PLUS, BcdState.MINUS)
        value = self._value(word)
        if value is None:
            normal = False
        failed = state == BnrState.FAILURE and self.label.kind == "bnr"
        known = None if failed or state == BnrState.NO_COMPUTED_DATA or value is None else value
        si = None if known is None else known * self.factor + self.offset
        found = self.quantity.make(stamp, si, normal)
        return ([found] if found else []) + ([] if normal else [self._status(stamp, state, value)])

    def encode(self, measurement: Measurement) -> int | None:
        """The word for a measurement; None when it carries nothing of this label."""
        value = self.quantity.pick(measurement)
        if value is None and not self.quantity.is_empty(measurement):
            return None
        valid = getattr(measurement, "valid", True)
        number = 0.0 if value is None else (value - self.offset) / self.factor
        return self._word(number, valid, value is None)

    def _value(self, word: int) -> float | None:
        if self.label.kind == "bcd":
            return wire.decode_bcd(word, self.label.resolution or 1.0)
        return wire.decode_bnr(word, self.label.range or 1.0, self.label.bits or 1)

    def _status(self, stamp: Stamp, state: int, value: float | None) -> DeviceStatus:
        what = "bad_digit" if value is None else ("failure", "no_computed_data", "functional_test")[state]
        return DeviceStatus(stamp=stamp, ok=False, flags=(f"{self.label.quantity}_{what}",))

    def _word(self, number: float, valid: bool, empty: bool) -> int:
        at = self.label
        if at.kind == "bcd":
            bcd = BcdState.NO_COMPUTED_DATA if empty else BcdState.PLUS if valid else BcdState.FUNCTIONAL_TEST
            return wire.encode_bcd(at.label, number, at.resolution or 1.0, state=bcd, sdi=at.sdi or 0)
        bnr = BnrState.NO_COMPUTED_DATA if empty else BnrState.NORMAL if valid else BnrState.FUNCTIONAL_TEST
        return wire.encode_bnr(
            at.label, number, at.range or 1.0, at.bits or 1, state=bnr, sdi=at.sdi or 0, turns=self.turns
        )


def make_entries(options: Options) -> list[Entry]:
    """The enabled labels.  Raises ValueError when there are none or one stands twice."""
    own = {(item.label, item.sdi) for item in options.labels}
    built_in = () if options.set == "none" else label_set(options.set)
    labels = [*options.labels, *(item for item in built_in if (item.label, item.sdi) not in own)]
    if not labels:
        raise ValueError("labels: none are enabled; give labels or a set")
    if len(own) < len(options.labels):
        raise ValueError("labels: one stands twice with the same sdi")
    return [_entry(item) for item in labels]


def _entry(item: Label) -> Entry:
    factor, offset = to_si(item.quantity, item.unit)
    turns = item.kind == "bnr" and item.unit == "deg" and item.range == 180.0
    return Entry(item, QUANTITIES[item.quantity], factor * item.sign, offset, turns)


class Evidence(NamedTuple):
    """Whether words begin somewhere, and the end of the word that shows it."""

    end: int
    good: bool


class Decoder:
    """Words to measurements."""

    def __init__(self, options: Options) -> None:
        self.counters = Counters()
        self._order = options.byte_order
        self._turned = not options.label_reversed
        self._entries: dict[int, list[Entry]] = {}
        for entry in make_entries(options):
            self._entries.setdefault(wire.label_byte(entry.label.label), []).append(entry)
        self._locked = False
        self._framer = Framer(self._measure, self.counters, limit=SEARCH_BYTES)

    def feed(self, data: bytes, t_rx_ns: int) -> list[Measurement]:
        found: list[Measurement] = []
        for stamp, frame in self._framer.feed(data, t_rx_ns):
            word = self._word(frame)
            entry = self._entry(word)
            self.counters.messages[entry.label.quantity if entry else "other"] += 1
            if entry:
                found += entry.decode(word, Stamp(stamp))
        return found

    def _word(self, data: bytes | bytearray) -> int:
        word = int.from_bytes(data, self._order)
        return word & ~0xFF | REVERSED[word & 0xFF] if self._turned else word

    def _entry(self, word: int) -> Entry | None:
        for entry in self._entries.get(word & 0xFF, ()):
            if entry.label.sdi is None or entry.label.sdi == wire.sdi(word):
                return entry
        return None

    def _measure(self, buffer: bytearray) -> int | Skip:
        if len(buffer) < WORD_BYTES:
            return 0
        word = self._word(buffer[:WORD_BYTES])
        good, enabled = wire.has_odd_parity(word), self._entry(word) is not None
        if self._locked and good:
            return WORD_BYTES if enabled else self._confirm(buffer)
        if good and enabled:
            return self._search(buffer)
        reason = "bad_parity" if self._locked else "no_sync"
        self._locked = False
        return Skip(1, reason)

    def _search(self, buffer: bytearray) -> int | Skip:
        """An enabled label stands here: words begin here if another one follows at a distance of whole words."""
        seen = self._evidence(buffer, 0, 2)
        if seen is None and len(buffer) < SEARCH_BYTES:
            return 0
        if seen is not None and not seen.good:
            return Skip(1, "no_sync")
        self._locked = True
        return WORD_BYTES

    def _confirm(self, buffer: bytearray) -> int | Skip:
        """A word that is not enabled: do words still begin here, or somewhere else?  What is shown first counts."""
        here = self._evidence(buffer, 0, 1)
        found = [(seen.end, at) for at in (1, 2, 3) if (seen := self._evidence(buffer, at, 2)) and seen.good]
        if found and (here is None or min(found)[0] < here.end):
            self._locked = False
            return Skip(min(found)[1], "no_sync")
        if here is None:
            return 0 if len(buffer) < SEARCH_BYTES else WORD_BYTES
        if here.good:
            return WORD_BYTES
        self._locked = False
        return Skip(1, "no_sync")

    def _evidence(self, buffer: bytearray, start: int, wanted: int) -> Evidence | None:
        """So many enabled labels from start on, or a bad parity before; None when the buffer shows neither."""
        for at in range(start, len(buffer) - WORD_BYTES + 1, WORD_BYTES):
            word = self._word(buffer[at : at + WORD_BYTES])
            if not wire.has_odd_parity(word):
                return Evidence(at + WORD_BYTES, False)
            wanted -= self._entry(word) is not None
            if wanted == 0:
                return Evidence(at + WORD_BYTES, True)
        return None


class Encoder:
    """The equipment's end of the line: for each measurement the words of the enabled labels that carry it."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._entries = make_entries(options)

    def encode(self, measurement: Measurement) -> list[bytes]:
        words = [entry.encode(measurement) for entry in self._entries]
        return [self._bytes(word) for word in words if word is not None]

    def respond(self, data: bytes) -> list[bytes]:
        return []

    def _bytes(self, word: int) -> bytes:
        if not self._options.label_reversed:
            word = word & ~0xFF | REVERSED[word & 0xFF]
        return word.to_bytes(WORD_BYTES, self._options.byte_order)


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder.  Raises ValueError when no label is enabled."""
    return Decoder(options)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder.  Raises ValueError when no label is enabled."""
    return Encoder(options)
