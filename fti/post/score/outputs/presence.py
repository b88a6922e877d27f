"""Checks that a topic is present at its rate during the whole flight, in order and without repetition."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fti.arrays import Array, Mask
from fti.hil.oracle.output_effects import Interval, interval_mask
from fti.hil.oracle.required_outputs import OUTPUT_AGE_S, RequiredOutput
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.rows import Result
from fti.post.score.series import TopicSeries

#: Minimum time without a fault for a rate [s].
MIN_INTERVAL_S = 2.0
#: Time until the first output, which needs the first measurements of all its devices [s].
FIRST_S = 1.0
#: Tolerance between the times in content and log [ns]; a 64-bit float has a step of 256 ns.
SAME_NS = 1e3
#: Maximum time of validity after the log time [s].
MAX_FUTURE_S = 0.05
#: Tolerance of gaps while devices are good: rates of a real bus, ticks [s].
MARGIN_S = 0.05


def presence(
    output: RequiredOutput,
    series: TopicSeries,
    t: Array,
    flight: Interval,
    exempt: Sequence[Interval],
    *,
    copies: float,
) -> Iterator[OutputRow]:
    """Rows of one topic.

    t : times of its messages [s of the flight], shape (n,); flight : interval in which it is required [s];
    exempt : intervals in which it may be missing, by faults and lateness of the emulator;
    copies : maximum share of messages with the bytes and the time of the message before
    """
    flight = (flight[0] + FIRST_S, flight[1])
    during = (t >= flight[0]) & (t <= flight[1])
    free = _free(flight, exempt)
    if not during.any():
        needed = bool(free)
        result = Result.FAILS if needed else Result.NOT_COMPARED
        yield OutputRow(output.topic, OutputCheck.RATE, "", result, "no message", _rate_limit(output), flight[0])
        return
    yield _rate(output, t[during], free)
    yield _gap(output, t[during], flight, exempt)
    yield _order(output, series, t, (during, during & ~interval_mask(t, exempt)), copies=copies)


def _rate_limit(output: RequiredOutput) -> str:
    min_hz, max_hz = output.rate_hz
    return f">= {min_hz:.3g} Hz" if max_hz == float("inf") else f"{min_hz:.3g} to {max_hz:.3g} Hz"


def _free(flight: Interval, exempt: Sequence[Interval]) -> list[Interval]:
    """The parts of a flight that no interval covers, if long enough for a rate."""
    free, at = list[Interval](), flight[0]
    for from_s, until_s in [*sorted(exempt), (flight[1], flight[1])]:
        if from_s - at >= MIN_INTERVAL_S:
            free.append((at, min(from_s, flight[1])))
        at = max(at, until_s)
    return [one for one in free if one[1] - one[0] >= MIN_INTERVAL_S]


def _rate(output: RequiredOutput, t: Array, free: Sequence[Interval]) -> OutputRow:
    """The mean rate over all times that are not exempt."""
    limit = _rate_limit(output)
    if not free:
        return OutputRow(output.topic, OutputCheck.RATE, "", Result.NOT_COMPARED, "faults all the time", limit)
    min_hz, max_hz = output.rate_hz
    counts = [int(np.count_nonzero((t >= from_s) & (t < until_s))) for from_s, until_s in free]
    total_s = sum(until_s - from_s for from_s, until_s in free)
    rate = sum(counts) / total_s
    slack = len(free) / total_s  # a message more or less at each border
    return OutputRow(
        output.topic,
        OutputCheck.RATE,
        "",
        result_of(min_hz - slack <= rate <= max_hz + slack),
        f"{rate:.2f} Hz",
        limit,
    )


def _gap(output: RequiredOutput, t: Array, flight: Interval, exempt: Sequence[Interval]) -> OutputRow:
    """The longest gap; begin and end of the flight count as messages."""
    edges = np.concatenate(([flight[0]], t, [flight[1]]))
    gaps = np.diff(edges)
    free = ~_touches(edges[:-1], edges[1:], exempt)
    limits = np.full(len(gaps), np.inf if output.always_gap_s is None else output.always_gap_s)
    limits[free] = output.gap_s
    over = gaps - limits
    worst = int(np.argmax(over))
    return OutputRow(
        output.topic,
        OutputCheck.GAP,
        "",
        result_of(bool(over[worst] <= MARGIN_S)),
        f"{gaps[worst]:.2f} s",
        f"<= {limits[worst]:.2f} s",
        float(edges[worst]),
    )


def _touches(begin: Array, end: Array, intervals: Sequence[Interval]) -> Mask:
    """Which gaps overlap one of the intervals."""
    mask = np.zeros(len(begin), dtype=bool)
    for from_s, until_s in intervals:
        mask |= (begin < until_s) & (end > from_s)
    return mask


def _order(
    output: RequiredOutput, series: TopicSeries, t: Array, during_free: tuple[Mask, Mask], *, copies: float
) -> OutputRow:
    """Messages have ascending log times, without repetition; valid ones have an age within the limits.

    during_free : messages of the flight, and those of them that are not exempt; copies : share of equal messages
    """
    during, free = during_free
    limit = f"ascending, each once, age {-MAX_FUTURE_S:g} to {output.age_s:g} s"
    back, later = np.diff(series.log_ns) < 0, np.zeros(len(t), dtype=bool)
    later[1:] = back
    stamps, age_s = series.column("t_ns"), (series.log_ns - series.valid_ns) / 1e9
    other = np.isfinite(stamps) & (abs(stamps - series.log_ns) > SAME_NS)
    old = free & series.valid & ((age_s > output.age_s) | (age_s < -MAX_FUTURE_S))
    if output.age_s <= OUTPUT_AGE_S:  # outputs of each tick
        later[1:] |= np.diff(series.valid_ns) < 0
    findings = (
        (later, "out of order"),
        (other, "with a t_ns that differs from the log time"),
        (old, "with an age beyond the limits"),
    )
    for where, text in findings:
        at = np.flatnonzero(where & during)
        if len(at):
            remark = f"{len(at)} messages {text}" + (f": {age_s[at[0]]:.2f} s" if where is old else "")
            return _of_times(series, Result.FAILS, remark, limit, float(t[at[0]]))
    if series.repeated > copies * len(series):
        return _of_times(series, Result.FAILS, f"{series.repeated} repeated messages", limit, None)
    return _of_times(series, Result.HOLDS, "in order", limit, None)


def _of_times(series: TopicSeries, result: Result, text: str, limit: str, at_s: float | None) -> OutputRow:
    return OutputRow(series.topic, OutputCheck.TIMES, "", result, text, limit, at_s)
