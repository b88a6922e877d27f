"""Pairs of outputs: each valid solution has a location, each message of the monitor a glide slope.

Both have the same log time; faults and lateness explain none without the other.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fti.hil.oracle.flag_definitions import INTEGRITY, SOLUTION
from fti.hil.oracle.required_outputs import GLIDE, LOCATION
from fti.messages.outputs import IntegrityState
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.series import TopicSeries

MessageTable = Mapping[str, Any]
#: Closer to the intercept point there is no angle [m], with a margin of one metre.
MIN_ALONG_TRACK_M = 151.0
GOOD = (IntegrityState.OK, IntegrityState.MONITOR)


def locations(location: TopicSeries, solution: TopicSeries) -> OutputRow:
    """A location for each valid solution, and for no other; heading and velocity that it states are those of it."""
    solutions = {t_ns: row for t_ns, row in _by_time(solution).items() if row.get("valid") is True}
    found = _by_time(location)
    wrong = [t_ns for t_ns in solutions.keys() & found.keys() if not _has_motion(found[t_ns], solutions[t_ns])]
    count = len(solutions.keys() ^ found.keys()) + len(wrong)
    return _row(location.topic, "of valid solutions", count, "a location for each valid solution, with its motion")


def _has_motion(location: MessageTable, solution: MessageTable) -> bool:
    """Are heading and velocity (east, north, up) those of the solution?  One of an earlier version states none."""
    if location.get("heading", solution.get("heading")) != solution.get("heading"):
        return False
    velocity, down = location.get("velocity"), solution.get("vel_down")
    if velocity is None:
        return True
    up = -down if isinstance(down, int | float) else None
    expected = {"x": solution.get("vel_east"), "y": solution.get("vel_north"), "z": up}
    return bool(velocity == expected)


def glide_slopes(slope: TopicSeries, integrity: TopicSeries) -> OutputRow:
    """Valid exactly where the monitor is good, without an obstacle or a bad match, and far enough away."""
    monitor = _by_time(integrity)
    slopes = _by_time(slope)
    wrong = sum(not _belongs(row, monitor.get(t_ns)) for t_ns, row in slopes.items()) + len(
        monitor.keys() - slopes.keys()
    )
    return _row(slope.topic, "of the monitor", wrong, "valid with a good monitor, T1 and T4 clear, beyond 150 m")


def _belongs(slope: MessageTable, monitor: MessageTable | None) -> bool:
    if monitor is None:
        return False
    good = monitor.get("state") in GOOD
    if slope.get("valid") is True:
        return good
    ratios = (monitor.get("t1_ratio"), monitor.get("t4_ratio"))
    clear = not any(isinstance(ratio, int | float) and not ratio < 1.0 for ratio in ratios)
    s = slope.get("s")
    return not (good and clear and isinstance(s, int | float) and s >= MIN_ALONG_TRACK_M)


def _by_time(series: TopicSeries) -> dict[int, MessageTable]:
    return dict(zip(series.log_ns.tolist(), series.rows, strict=True))


def _row(topic: str, what: str, count: int, limit: str) -> OutputRow:
    text = f"{count} messages differ" if count else "consistent"
    return OutputRow(topic, OutputCheck.CONSISTENT, what, result_of(not count), text, limit)


#: Topic -> the topic that it belongs to, and the check of both.
PAIRS: Mapping[str, tuple[str, Callable[[TopicSeries, TopicSeries], OutputRow]]] = {
    LOCATION: (SOLUTION, locations),
    GLIDE: (INTEGRITY, glide_slopes),
}
