"""What counts of a session are taken to say."""

from __future__ import annotations

import json
import math

import pytest

from fti import config as configuration
from fti.post.score.messages import FlagReader
from fti.post.score.observed_flags import ObservedFlags
from fti.post.score.truth_reader import FlightPause
from tests.helpers import ROOT

DAMAGED = "damaged bytes"


def words(*skipped: dict[str, int]) -> list[bool]:
    """Whether each of a row of health reports calls the altimeter's bytes damaged."""
    reader = FlagReader(configuration.load(ROOT / "configs" / "demo.toml"))
    observed = []
    for counts in skipped:
        device = {"state": "good", "clocks": [], "skipped": counts}
        ((_, found),) = reader._health({"devices": {"altimeter": device}, "links": {}})
        observed.append(DAMAGED in found)
    return observed


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


def test_navigation_began_with_its_first_word_and_was_behind_by_its_lag() -> None:
    reader = FlagReader(configuration.load(ROOT / "configs" / "demo.toml"))
    observed = ObservedFlags(first_report_s=math.inf)
    silent = {"lag_ms": 4000.0, "hint": "navigation has said nothing for 4 s"}
    for t, navigation in ((1.0, {}), (9.0, {"lag_ms": 800.0}), (10.0, {"lag_ms": 20.0}), (14.0, silent)):
        reader.lag(t, json.dumps({"navigation": navigation}).encode(), observed)
    assert (observed.first_report_s, observed.last_report_s) == (9.0, 10.0)
    assert observed.lag_intervals == [FlightPause(8.2, 9.0), FlightPause(10.0, 14.0)]
