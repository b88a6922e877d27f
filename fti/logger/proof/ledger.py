"""The ledger as it stands in a file: what a recorder says that came in, was recorded, is held and was dropped.

A note is written once a second, and a last one when the recorder ends in good order.  Each recorder of a session counts
from zero.  See ``fti.service.accounts`` for what the numbers mean and which sums they keep.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fti.logger.raw_log import TICK_TOPIC
from fti.logger.reading.recording import RAW, SENT

LEDGER_TOPIC = "/fti/ledger"
#: Frames that were dropped for this reason never got a number.
SOCKET_QUEUE = "socket_queue"


class Amount(NamedTuple):
    """Frames and bytes."""

    frames: int = 0
    bytes: int = 0

    def plus(self, other: Amount) -> Amount:
        """The sum."""
        return Amount(self.frames + other.frames, self.bytes + other.bytes)

    def minus(self, other: Amount) -> Amount:
        """The difference."""
        return Amount(self.frames - other.frames, self.bytes - other.bytes)


NOTHING = Amount()


@dataclass(frozen=True, slots=True)
class Entry:
    """One account.

    dropped        : by reason; bytes are 0 where nobody knows them
    stamps_refused : frames whose kernel stamp was not believed
    """

    came: Amount = NOTHING
    recorded: Amount = NOTHING
    held: Amount = NOTHING
    dropped: dict[str, Amount] = field(default_factory=dict)
    errors: dict[str, int] = field(default_factory=dict)
    stamps_refused: int = 0

    @classmethod
    def parse(cls, table: dict[str, Any]) -> Entry:
        """An account of a note.  Raises KeyError, TypeError or ValueError when it is none."""
        came, recorded, held = (
            Amount(_count(table[f"{part}_frames"]), _count(table[f"{part}_bytes"]))
            for part in ("in", "recorded", "held")
        )
        dropped = {
            reason: Amount(_count(lost["frames"]), _count(lost["bytes"] or 0))
            for reason, lost in table["dropped"].items()
        }
        errors = {name: _count(n) for name, n in table.get("errors", {}).items()}
        return cls(came, recorded, held, dropped, errors, _count(table.get("stamp_refused", 0)))

    @property
    def numbered(self) -> Amount:
        """What came in and got a number."""
        return self.came.minus(Amount(self.dropped.get(SOCKET_QUEUE, NOTHING).frames))

    @property
    def lost(self) -> Amount:
        """What got a number and was dropped."""
        lost = NOTHING
        for reason, amount in self.dropped.items():
            if reason != SOCKET_QUEUE:
                lost = lost.plus(amount)
        return lost

    def faults(self) -> Iterator[str]:
        """Sums that do not hold."""
        told = self.recorded.plus(self.held).plus(self.lost)
        for what, came, sum_ in zip(("frames", "bytes"), self.numbered, told, strict=True):
            if came != sum_:
                yield f"{came} {what} came in, {sum_} are recorded, held or dropped"


class Recorder(NamedTuple):
    """Who wrote a ledger: its first number, process and start [ns, FTI time]."""

    first_seq: int
    pid: int
    started_ns: int


@dataclass(frozen=True, slots=True)
class Note:
    """One ledger.  next_seq : the number that the next frame gets; final : the recorder's last word."""

    t_ns: int
    recorder: Recorder
    next_seq: int
    final: bool
    entries: dict[str, Entry]

    @classmethod
    def parse(cls, data: bytes) -> Note:
        """A ledger from its JSON.  Raises KeyError, TypeError, AttributeError or ValueError when it is none."""
        table = json.loads(data)
        recorder = Recorder(*(_count(table["recorder"][name]) for name in Recorder._fields))
        entries = {TICK_TOPIC: Entry.parse(table["ticks"])}
        for link, account in table["links"].items():
            entries[RAW + link] = Entry.parse(account)
            entries[SENT + link] = Entry.parse(account["sent"])
        return cls(_count(table["t_ns"]), recorder, _count(table["next_seq"]), bool(table["final"]), entries)

    def faults(self) -> Iterator[str]:
        """What cannot be true of it, whatever the files hold."""
        for topic, entry in self.entries.items():
            for fault in entry.faults():
                yield f"{topic}: {fault}"
        came = sum(entry.numbered.frames for entry in self.entries.values())
        given = self.next_seq - self.recorder.first_seq
        if came != given:
            yield f"{given} numbers were given, {came} frames came in"

    def falls_behind(self, earlier: Note) -> bool:
        """Does it tell of less than an earlier one of the same recorder?"""
        return self.next_seq < earlier.next_seq or any(
            entry.came.frames < before.came.frames
            or entry.lost.frames < before.lost.frames
            or entry.stamps_refused < before.stamps_refused
            or any(entry.errors.get(name, 0) < count for name, count in before.errors.items())
            for topic, entry in self.entries.items()
            if (before := earlier.entries.get(topic))
        )


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**64:
        raise ValueError(f"{value!r} is no count")
    return value
