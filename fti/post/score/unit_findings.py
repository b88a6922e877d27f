"""Checks of the unit in every flight: it starts in time, keeps up, records without gaps, and runs to the end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from fti.hil.oracle.alarm_flags import STARTUP_S
from fti.post.score.alarm_states import missing_alarms
from fti.post.score.flight_observation import FlightObservation
from fti.post.score.rows import UNIT, FlightFinding, Result
from fti.post.score.truth_reader import FlightPause, length_s, merge_pauses, overlap_s

#: Navigation may be behind for this part of a flight.  On a busy computer with two cores it is behind at times, and
#: misses flags if that lasts.
MAX_BEHIND_SHARE = 0.2
#: Time to catch up after a pause of the bench, or after the start [s].
CATCH_UP_S = 5.0
#: Health reports navigation once a second: maximum time from its last report to the end of the flight [s].
MAX_SILENT_S = 5.0
#: The recorder ticks every 20 ms.  Maximum length of one gap [s], and maximum share of all gaps.
MAX_TICK_GAP_S, MAX_TICK_GAP_SHARE = 1.0, 0.02
#: A session may end this time before its truth, when both are stopped [s].
MAX_END_S = 3.0


def unit_findings(observation: FlightObservation, start_limit_s: float) -> Iterator[FlightFinding]:
    """The five findings.  start_limit_s : time that the unit may take until its first report [s]"""
    first_report_s = observation.observed_flags.first_report_s
    text = f"first report of navigation after {first_report_s:.1f} s; {start_limit_s:g} s are allowed"
    if math.isinf(first_report_s):
        text = "no report of navigation during the flight"
    yield _finding("start", first_report_s <= start_limit_s, text)
    share = _behind_share(observation)
    text = f"navigation was behind for {share:.0%} of the flight; {MAX_BEHIND_SHARE:.0%} are allowed"
    yield _finding("navigation in time", share <= MAX_BEHIND_SHARE, text)
    silent_s = max(observation.end_s - observation.observed_flags.last_report_s, 0.0)
    text = f"no report of navigation in the last {silent_s:.0f} s; {MAX_SILENT_S:g} s are allowed"
    yield _finding("navigation until the end", silent_s <= MAX_SILENT_S, text)
    yield _ticks(observation, start_limit_s)
    yield _alarms(observation)


def _behind_share(observation: FlightObservation) -> float:
    """Part of the flight in which navigation was behind that neither bench nor start explains, 0 to 1."""
    exempt = [FlightPause(p.from_s, p.until_s + CATCH_UP_S) for p in observation.pauses]
    if observation.start_s:
        exempt.append(FlightPause(0.0, observation.start_s + CATCH_UP_S))
    return _counted_s(observation.observed_flags.lag_intervals, exempt, observation.end_s) / observation.end_s


def _ticks(observation: FlightObservation, start_limit_s: float) -> FlightFinding:
    """Gaps of the recorder's ticks that no pause of the bench explains."""
    first_s, last_s = observation.observed_flags.ticks
    if math.isinf(first_s) and first_s > 0.0:
        return _finding("recorder", False, "no tick of the recorder during the flight")
    end = FlightPause(min(last_s + MAX_END_S, observation.end_s), observation.end_s)
    gaps = [*observation.observed_flags.tick_gaps, FlightPause(start_limit_s, max(first_s, start_limit_s)), end]
    exempt = [FlightPause(p.from_s, p.until_s + CATCH_UP_S) for p in observation.pauses]
    missing = _counted_s(gaps, exempt, observation.end_s)
    max_gap = max((_counted_s([gap], exempt, observation.end_s) for gap in gaps), default=0.0)
    holds = max_gap <= MAX_TICK_GAP_S and missing <= MAX_TICK_GAP_SHARE * observation.end_s
    allowed = f"{MAX_TICK_GAP_S:g} s at once and {MAX_TICK_GAP_SHARE:.0%} of the flight are allowed"
    return _finding("recorder", holds, f"ticks are missing for {missing:.2f} s, at most {max_gap:.2f} s; {allowed}")


def _alarms(observation: FlightObservation) -> FlightFinding:
    """Required alarms of outputs, devices and links that are missing."""
    missing = list(missing_alarms(observation.observed_flags, observation.start_s + STARTUP_S, observation.end_s))
    parts = "; ".join(f"{alarm} from {from_s:.1f} to {until_s:.1f} s" for alarm, from_s, until_s in missing[:3])
    more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
    return _finding("alarms", not missing, f"alarms are missing: {parts}{more}" if missing else "no alarm is missing")


def _counted_s(intervals: Iterable[FlightPause], exempt: Iterable[FlightPause], end_s: float) -> float:
    """Part of these intervals that is in the flight and not exempt [s]."""
    clipped = [FlightPause(max(p.from_s, 0.0), min(p.until_s, end_s)) for p in merge_pauses(intervals)]
    remaining = [p for p in clipped if p.until_s > p.from_s]
    exempt_intervals = list(merge_pauses(exempt))
    return length_s(remaining) - sum(overlap_s(exempt_intervals, p.from_s, p.until_s) for p in remaining)


def _finding(name: str, holds: bool, text: str) -> FlightFinding:
    return FlightFinding(UNIT, name, Result.HOLDS if holds else Result.FAILS, text)
