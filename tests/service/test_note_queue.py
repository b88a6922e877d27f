"""Queued notes are recorded in order, also after a failed medium."""

from __future__ import annotations

from typing import Any

from fti.service.recorder.log_content import NoteQueue


class FakeLog:
    """Remembers what it was given."""

    def __init__(self) -> None:
        self.times: list[int] = []

    def write_json(self, topic: str, t_ns: int, content: dict[str, Any]) -> None:
        self.times.append(t_ns)


def test_what_is_in_no_file_comes_again_before_what_waits() -> None:
    def report(unit: str, error: Exception) -> None:
        raise error

    notes, failing, good = NoteQueue(report), FakeLog(), FakeLog()
    for t_ns in (1, 2):
        notes.add("/fti/ledger", t_ns, {})
    notes.record_all(failing)  # type: ignore[arg-type]
    notes.add("/fti/ledger", 3, {})
    notes.restart()
    notes.record_all(good)  # type: ignore[arg-type]
    assert good.times == [1, 2, 3]
    notes.mark_written()
    notes.restart()
    notes.record_all(good)  # type: ignore[arg-type]
    assert good.times == [1, 2, 3]
