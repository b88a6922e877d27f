"""The notes of gaps: each is counted, and only the first are told one by one."""

from __future__ import annotations

import json

from fti.logger.proof.gaps import MOST_TOLD, Gaps


def note(number: int) -> bytes:
    return json.dumps({"kind": "ring", "after_seq": 10 * number, "before_seq": 10 * number + 5}).encode()


def test_an_overload_of_half_an_hour_is_no_thousand_lines() -> None:
    gaps = Gaps()
    for number in range(1500):
        gaps.take(0, note(number), raw=False)
    assert len(gaps.told) == MOST_TOLD
    assert gaps.told[1].endswith("navigation has not seen numbers 11 to 14")
    assert gaps.untold == 1500 - MOST_TOLD


def test_what_cannot_be_read_is_counted() -> None:
    gaps = Gaps()
    for data in (b"", b"[]", b'{"kind": "ring"}', b'{"kind": "ring", "after_seq": "x", "before_seq": 2}'):
        gaps.take(0, data, raw=False)
    assert (gaps.unreadable, gaps.told) == (4, [])
