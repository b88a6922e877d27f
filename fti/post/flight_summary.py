"""A flight in a few numbers: dropped frames, approaches that the clearance monitor followed, position sources."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from fti.logger.reading.json_message import parse_table
from fti.logger.reading.mcap_file import McapMessage
from fti.logger.verify.ledger import LedgerEntry, LedgerReader, RecorderIdentity
from fti.messages.outputs import IntegrityState
from fti.messages.reasons import Reason
from fti.messages.topics import LEDGER_TOPIC, RAW_PREFIX

INTEGRITY_TOPIC, NAVIGATION_TOPIC = "/nav/clearance_integrity", "/nav/nav_solution"
#: The aircraft is not in the profile of the reference, or no longer.
OUTSIDE = frozenset((Reason.END, Reason.OUTSIDE_PROFILE, Reason.GO_AROUND))
COMPARED = frozenset(IntegrityState) - {IntegrityState.NO_PROFILE, IntegrityState.ACQUIRE}
#: Farther back on the path begins another approach [m]: more than a jump of the position.
MAX_RETREAT_M = 500.0
#: Frames that a session in mode "snapshot" does not record.
NOT_LOST = "not_triggered"
NO_SOURCE = "no source"
#: Period at which navigation is evaluated; it has 25 Hz, and parsing takes time [ns].
SAMPLE_NS = 200_000_000


@dataclass(slots=True)
class Approach:
    """An approach in the profile of the reference of the clearance monitor.

    begin_s, end_s : path length before the intercept point at its first and last usable sample [m]
    states         : number of outputs in each state, from the first full window to end_s; empty without a full window
    """

    begin_s: float
    end_s: float
    states: Counter[str] = field(default_factory=Counter)


@dataclass(slots=True)
class FlightSummary:
    """Filled by ``handlers`` while a recording is read; invalid messages are ignored.

    has_ledger : is there an account of the frames
    approaches : in order of time
    positions  : number of navigation outputs with each position source, or NO_SOURCE; valid : of those that are valid
    """

    has_ledger: bool = False
    approaches: list[Approach] = field(default_factory=list)
    positions: Counter[str] = field(default_factory=Counter)
    valid: int = 0
    _entries: dict[tuple[RecorderIdentity, str], LedgerEntry] = field(default_factory=dict)
    _ledgers: LedgerReader = field(default_factory=LedgerReader)
    _approach: Approach | None = None
    _unusable: int = 0
    _next_ns: int = 0

    @property
    def handlers(self) -> dict[str, Callable[[McapMessage], None]]:
        """The function for the messages of each topic."""
        return {
            LEDGER_TOPIC: self._add_ledger,
            INTEGRITY_TOPIC: self._add_integrity,
            NAVIGATION_TOPIC: self._add_navigation,
        }

    def dropped_frames(self) -> Counter[str]:
        """Received frames of each link that are in no file, as the recorders counted them."""
        dropped = Counter[str]()
        for (_, topic), entry in self._entries.items():
            frames = sum(amount.frames for reason, amount in entry.dropped.items() if reason != NOT_LOST)
            if frames and topic.startswith(RAW_PREFIX):
                dropped[topic.removeprefix(RAW_PREFIX)] += frames
        return dropped

    def _add_ledger(self, item: McapMessage) -> None:
        with suppress(KeyError, TypeError, AttributeError, ValueError):
            note = self._ledgers.read(item.log_time, item.data)
            self.has_ledger = True
            for topic, entry in note.entries.items():
                self._entries[note.recorder, topic] = entry

    def _add_integrity(self, item: McapMessage) -> None:
        table = _table(item.data)
        state, s, reasons = str(table.get("state")), _finite(table.get("s_end")), table.get("reasons")
        if s is None:
            self._unusable += 1
            if isinstance(reasons, list) and not OUTSIDE.isdisjoint(map(str, reasons)):
                self._approach = None
            return
        if self._approach is None or s > self._approach.end_s + MAX_RETREAT_M:
            self._approach, self._unusable = Approach(s, s), 0
            self.approaches.append(self._approach)
        self._approach.end_s = s
        if self._approach.states:
            self._approach.states[IntegrityState.UNAVAILABLE] += self._unusable
        if state in COMPARED:
            self._approach.states[state] += 1
        self._unusable = 0

    def _add_navigation(self, item: McapMessage) -> None:
        if item.log_time < self._next_ns:
            return
        self._next_ns = item.log_time + SAMPLE_NS
        table = _table(item.data)
        self.positions[str(table.get("position_source") or NO_SOURCE)] += 1
        self.valid += table.get("valid") is True


def _table(data: bytes) -> Mapping[str, Any]:
    try:
        return parse_table(data)
    except ValueError:
        return {}


def _finite(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and abs(value) < 1e9 else None
