"""The notes of gaps: each is counted, and only the first ones are described."""

from __future__ import annotations

import json

from fti.logger.verify.gap_check import MAX_DESCRIBED_NOTES, GapNotes


def note(number: int) -> bytes:
    return json.dumps({"kind": "ring", "after_seq": 10 * number, "before_seq": 10 * number + 5}).encode()


def test_an_overload_of_half_an_hour_is_no_thousand_lines() -> None:
    gaps = GapNotes()
    for number in range(1500):
        gaps.feed(0, note(number), raw=False)
    assert len(gaps.descriptions) == MAX_DESCRIBED_NOTES
    assert gaps.descriptions[1].endswith("navigation has missed numbers 11 to 14")
    assert gaps.omitted_notes == 1500 - MAX_DESCRIBED_NOTES


def test_what_cannot_be_read_is_counted() -> None:
    gaps = GapNotes()
    for data in (b"", b"[]", b'{"kind": "ring"}', b'{"kind": "ring", "after_seq": "x", "before_seq": 2}'):
        gaps.feed(0, data, raw=False)
    assert (gaps.unreadable, gaps.descriptions) == (4, [])
