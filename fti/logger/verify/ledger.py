"""Reader of recorded ledgers: the received, recorded, held and dropped frames and bytes of each link.

A recorder writes a ledger every second, and a final one on a normal end.  Each recorder of a session counts from zero.
``fti.service.recorder.link_ledger`` defines the counters and their sums, ``fti.logger.note_changes`` the records of
changes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from fti.logger.reading.json_message import parse_table
from fti.logger.reading.note_states import NoteStates
from fti.messages.topics import LEDGER_TOPIC, RAW_PREFIX, SENT_PREFIX, TICK_TOPIC

#: Frames dropped for this reason have no number.
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
class LedgerEntry:
    """One account.

    dropped        : by reason; unknown bytes are 0
    stamps_refused : frames whose kernel timestamp was refused
    """

    incoming: Amount = NOTHING
    recorded: Amount = NOTHING
    held: Amount = NOTHING
    dropped: dict[str, Amount] = field(default_factory=dict)
    errors: dict[str, int] = field(default_factory=dict)
    stamps_refused: int = 0

    @classmethod
    def parse(cls, table: dict[str, Any]) -> LedgerEntry:
        """Parse an account of a note.  Raises KeyError, TypeError or ValueError when it is invalid."""
        incoming, recorded, held = (
            Amount(_count(table[f"{part}_frames"]), _count(table[f"{part}_bytes"]))
            for part in ("in", "recorded", "held")
        )
        dropped = {
            reason: Amount(_count(lost["frames"]), _count(lost["bytes"] or 0))
            for reason, lost in table["dropped"].items()
        }
        errors = {name: _count(n) for name, n in table.get("errors", {}).items()}
        return cls(incoming, recorded, held, dropped, errors, _count(table.get("stamp_refused", 0)))

    @property
    def numbered(self) -> Amount:
        """Received frames with a number."""
        return self.incoming.minus(Amount(self.dropped.get(SOCKET_QUEUE, NOTHING).frames))

    @property
    def lost(self) -> Amount:
        """Dropped frames with a number."""
        lost = NOTHING
        for reason, amount in self.dropped.items():
            if reason != SOCKET_QUEUE:
                lost = lost.plus(amount)
        return lost

    def faults(self) -> Iterator[str]:
        """Sums that do not match."""
        accounted = self.recorded.plus(self.held).plus(self.lost)
        for what, incoming, sum_ in zip(("frames", "bytes"), self.numbered, accounted, strict=True):
            if incoming != sum_:
                yield f"{incoming} {what} came in, {sum_} are recorded, held or dropped"


class RecorderIdentity(NamedTuple):
    """Recorder of a ledger: its first number, process id and start [ns, FTI time]."""

    first_seq: int
    pid: int
    started_ns: int


@dataclass(frozen=True, slots=True)
class LedgerNote:
    """One ledger.

    next_seq : number of the next frame; final : last ledger of the recorder; whole : no entry is missing
    digest   : equal for equal ledgers
    """

    t_ns: int
    recorder: RecorderIdentity
    next_seq: int
    final: bool
    entries: dict[str, LedgerEntry]
    whole: bool = True
    digest: int = 0

    @classmethod
    def parse(cls, data: bytes) -> LedgerNote:
        """Parse a ledger.  Raises KeyError, TypeError, AttributeError or ValueError when it is invalid."""
        return LedgerReader().read(0, data)

    def faults(self) -> Iterator[str]:
        """Contradictions within the ledger."""
        for topic, entry in self.entries.items():
            for fault in entry.faults():
                yield f"{topic}: {fault}"
        incoming = sum(entry.numbered.frames for entry in self.entries.values())
        assigned = self.next_seq - self.recorder.first_seq
        if self.whole and incoming != assigned:
            yield f"{assigned} numbers were assigned, {incoming} frames came in"

    def falls_behind(self, earlier: LedgerNote) -> bool:
        """Is a counter less than in an earlier ledger of the same recorder?"""
        return self.next_seq < earlier.next_seq or any(
            entry.incoming.frames < before.incoming.frames
            or entry.lost.frames < before.lost.frames
            or entry.stamps_refused < before.stamps_refused
            or any(entry.errors.get(name, 0) < count for name, count in before.errors.items())
            for topic, entry in self.entries.items()
            if (before := earlier.entries.get(topic))
        )


class _ParsedAccount(NamedTuple):
    """The account of a link in a ledger: as recorded, parsed, and its digest."""

    table: Any
    received: LedgerEntry
    sent: LedgerEntry
    digest: int


class LedgerReader:
    """Reads the ledgers of a session in the order of its files; unchanged accounts are parsed once."""

    def __init__(self) -> None:
        self._states = NoteStates()
        self._accounts: dict[str, _ParsedAccount] = {}

    def read(self, log_time: int, data: bytes) -> LedgerNote:
        """Read a ledger.  Raises KeyError, TypeError, AttributeError or ValueError when it is invalid."""
        _, table, whole = self._states.feed(LEDGER_TOPIC, log_time, parse_table(data))
        recorder = RecorderIdentity(*(_count(table["recorder"][name]) for name in RecorderIdentity._fields))
        entries, digests = {TICK_TOPIC: LedgerEntry.parse(table["ticks"])}, [_digest(table["ticks"])]
        for link, found in table["links"].items():
            account = self._account(link, found)
            entries[RAW_PREFIX + link], entries[SENT_PREFIX + link] = account.received, account.sent
            digests.append(account.digest)
        head = _count(table["t_ns"]), recorder, _count(table["next_seq"]), bool(table["final"])
        return LedgerNote(*head, entries, whole, hash((head, *digests)))

    def _account(self, link: str, table: Any) -> _ParsedAccount:
        known = self._accounts.get(link)
        if known is None or (table is not known.table and table != known.table):
            known = _ParsedAccount(
                table, LedgerEntry.parse(table), LedgerEntry.parse(table["sent"]), hash((link, _digest(table)))
            )
            self._accounts[link] = known
        return known


def _digest(table: Any) -> int:
    return hash(json.dumps(table, sort_keys=True))


def _count(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**64:
        raise ValueError(f"{value!r} is not a count")
    return value
