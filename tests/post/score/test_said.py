"""What counts of a session are taken to say."""

from __future__ import annotations

import pytest

from fti import config as configuration
from fti.post.score.said import _Reader
from tests.helpers import ROOT

DAMAGED = "damaged bytes"


def words(*skipped: dict[str, int]) -> list[bool]:
    """Whether each of a row of health reports calls the altimeter's bytes damaged."""
    reader = _Reader(configuration.load(ROOT / "configs" / "demo.toml"))
    said = []
    for counts in skipped:
        device = {"state": "good", "clocks": [], "skipped": counts}
        ((_, found),) = reader._health({"devices": {"altimeter": device}, "links": {}})
        said.append(DAMAGED in found)
    return said


@pytest.mark.parametrize(
    ("counts", "damaged"),
    [
        ({"bad_checksum": 10}, True),
        ({"no_sync": 3}, True),
        ({"pause": 7, "no_sync": 3}, False),  # one message in two pieces: the machine had no time
        ({"pause": 60, "no_sync": 40}, True),  # many of them: messages are cut short
        ({"pause": 0, "comment": 5}, False),
    ],
)
def test_damaged_is_what_is_refused_but_not_one_message_in_two_pieces(counts: dict[str, int], damaged: bool) -> None:
    assert words({}, counts, counts) == [False, damaged, False]
