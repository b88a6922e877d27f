"""Latest value."""

from __future__ import annotations

from fti.buffers.latest import LatestValue


def test_the_last_value_wins() -> None:
    latest = LatestValue[str]()
    assert latest.get() == (0, None)
    latest.set("a")
    latest.set("b")
    assert latest.get() == (2, "b")
