"""The ledger of the recorder: what comes in is recorded, held or dropped, whatever the writer and the medium do."""

from __future__ import annotations

import json
from typing import Any

import jsonschema
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from fti.buffers.triple_buffer import TripleBuffer
from fti.links import LinkStatus
from fti.logger.schemas import note_schema
from fti.logger.verify.ledger import LedgerNote
from fti.messages.frames import LinkState
from fti.messages.tables import to_table
from fti.service.recorder.link_ledger import BufferedLink, LinkLedger, link_health


class FakeLink:
    """A link as far as the ledger look at it."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.status = LinkStatus(state=LinkState.GOOD)


class FakeIntake:
    """The counter of all numbers."""

    def __init__(self, first: int) -> None:
        self.seq = first

    def flush(self) -> int:
        return self.seq


class Rig:
    """The ledger of two links, of which frames are put and taken by hand."""

    def __init__(self, first: int = 0, capacity: int = 200) -> None:
        self.sequencer = FakeIntake(first)
        self.units = [self._unit("a", 0, capacity), self._unit("b", 1, capacity)]
        self.ticks = TripleBuffer(capacity)
        self.ledger = LinkLedger(self.units, self.ticks, self.sequencer, 17)  # type: ignore[arg-type]

    def _unit(self, name: str, index: int, capacity: int) -> BufferedLink:
        link: Any = FakeLink(name)
        return BufferedLink(link, "udp", index, TripleBuffer(capacity), TripleBuffer(capacity))

    @property
    def buffers(self) -> list[TripleBuffer]:
        return [self.ticks, *(b for unit in self.units for b in (unit.received, unit.sent))]

    def put(self, which: int, size: int) -> None:
        self.buffers[which].put(self.sequencer.seq, self.sequencer.seq, bytes(size))
        self.sequencer.seq += 1

    def note(self, **keys: Any) -> dict[str, Any]:
        note: dict[str, Any] = to_table(self.ledger.read(1000, **keys))
        jsonschema.validate(note, json.loads(note_schema("/fti/ledger").data))
        return note


class AnyOrder(RuleBasedStateMachine):
    """Frames come, the writer takes and the medium accepts, or not, or the kernel drops: the sums hold at all times."""

    def __init__(self) -> None:
        super().__init__()
        self.rig = Rig(first=5)

    @rule(which=st.integers(0, 4), size=st.integers(0, 60))
    def come(self, which: int, size: int) -> None:
        self.rig.put(which, size)

    @rule(which=st.integers(0, 4), accepted=st.booleans())
    def write(self, which: int, accepted: bool) -> None:
        taken = self.rig.buffers[which].take()
        if accepted:
            self.rig.buffers[which].confirm_written(len(taken))

    @rule(link=st.integers(0, 1), frames=st.integers(1, 9))
    def drop_in_kernel(self, link: int, frames: int) -> None:
        self.rig.units[link].link.status.socket_dropped += frames

    @invariant()
    def sums_hold(self) -> None:
        note = LedgerNote.parse(json.dumps(self.rig.note()).encode())
        assert list(note.faults()) == []
        assert note.next_seq - note.recorder.first_seq == sum(e.numbered.frames for e in note.entries.values())


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=settings().max_examples // 5, stateful_step_count=40)


def test_a_ledger_identifies_its_recorder() -> None:
    rig = Rig(first=1234)
    rig.put(1, 10)
    note = rig.note(final=True)
    assert note["recorder"]["first_seq"] == 1234 and note["recorder"]["started_ns"] == 17
    assert (note["next_seq"], note["final"], note["t_ns"]) == (1235, True, 1000)
    assert rig.note()["final"] is False


def test_every_loss_has_its_reason() -> None:
    rig = Rig()
    for _ in range(60):
        rig.put(1, 20)
    rig.units[0].link.status.socket_dropped = 3
    account = rig.note()["links"]["a"]
    stats = rig.units[0].received.stats
    assert stats.dropped_frames > 0
    assert account["dropped"] == {
        "socket_queue": {"frames": 3, "bytes": None},
        "buffer_overflow": {"frames": stats.dropped_frames, "bytes": stats.dropped_bytes},
    }
    assert account["in_frames"] == 63 and account["in_bytes"] == 1200
    assert rig.note()["links"]["b"]["dropped"] == {}


def test_what_was_sent_has_an_account_of_its_own() -> None:
    rig = Rig()
    rig.put(2, 7)
    account = rig.note()["links"]["a"]
    assert (account["in_frames"], account["sent"]["in_frames"], account["sent"]["held_bytes"]) == (0, 1, 7)


def test_line_errors_stand_beside_the_account() -> None:
    rig = Rig()
    rig.units[1].link.status.errors["uart_overrun"] = 4
    note = rig.note()
    assert note["links"]["b"]["errors"] == {"uart_overrun": 4} and note["links"]["b"]["in_frames"] == 0
    assert note["links"]["a"]["errors"] == {}


def test_refused_stamps_stand_beside_the_account() -> None:
    rig = Rig()
    rig.units[1].link.status.stamp_refused = 79_948
    note = rig.note()
    assert [note["links"][name]["stamp_refused"] for name in "ab"] == [0, 79_948]
    entries = LedgerNote.parse(json.dumps(note).encode()).entries
    assert (entries["/raw/b"].stamps_refused, entries["/tx/b"].stamps_refused) == (79_948, 0)


def test_health_of_a_link_has_its_account() -> None:
    rig = Rig()
    rig.put(1, 10)
    row = to_table(link_health(rig.units[0], 2000))
    assert row["ledger"] == rig.note()["links"]["a"]
    assert row["dropped_frames"] == 0


@pytest.mark.parametrize("change", [{"links": {"a": {}}}, {"next_seq": -1}, {"recorder": None}, {"ticks": 1}])
def test_a_ledger_that_is_none_is_refused(change: dict[str, Any]) -> None:
    data = json.dumps({**Rig().note(), **change}).encode()
    with pytest.raises((KeyError, TypeError, AttributeError, ValueError)):
        LedgerNote.parse(data)
