"""Output of ``fti info``: one session as text and as JSON."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from fti.alarms.condition import Severity
from fti.constants import SECOND_NS
from fti.logger.reading.session_metadata import remarks
from fti.logger.statistics.alarm_spans import AlarmSpan
from fti.logger.statistics.interval_stats import TimeGap
from fti.logger.statistics.topic_stats import MARKS, EventNote, TopicStatistics
from fti.messages.topics import RAW_PREFIX, TICK_TOPIC
from fti.post.overview import CONTINUOUS, Overview

BARS = "·▁▂▃▄▅▆▇█"
USUAL_BAR = 6  # height for rates near the median
MIN_USUAL_RATIO, MAX_USUAL_RATIO = 0.75, 1.3
MIN_WIDTH, MAX_WIDTH = 20, 160
GAPS_SHOWN = 12
EVENTS_SHOWN = ALARMS_SHOWN = 40
SEVERITIES = [*Severity]
JSON_CELLS = 64
ORIGINS = {
    "hil": "HIL: emulated sensors, no flight",
    "replay": "REPLAY: bytes of an earlier session",
    "flight": "flight",
}


def as_text(view: Overview) -> Iterator[str]:
    """Lines of text."""
    yield from _heading(view)
    yield from _files(view)
    yield from _topics(view)
    yield from _activity(view)
    yield from _gaps(view)
    yield from _alarms(view)
    yield from _events(view)


def _heading(view: Overview) -> Iterator[str]:
    session_metadata = view.session_metadata
    yield str(view.recording.path)
    for text in remarks(view.recording):
        yield f"  *** {text} ***"
    origin = ORIGINS.get(view.origin, f"origin {view.origin}")
    yield f"  session   {session_metadata.get('name', '–')}, {origin}, {view.mode}"
    begin = moment(view.begin_ns, date=True) if view.begin_ns else "no messages"
    yield f"  started   {begin}, {duration_text(view.duration_s)}"
    config = f"{session_metadata.get('config_file', 'unknown')} {session_metadata.get('config_sha256', '')[:12]}"
    yield f"  software  fti {session_metadata.get('software', 'unknown')}, configuration {config.strip()}"
    if offsets := view.clock_offset_s():
        yield f"  clock     real time - FTI time {offsets[0]:+.6f} s at the start, {offsets[1]:+.6f} s at the end"
    if gnss := view.gnss():
        begin = moment(view.begin_ns + gnss.utc_minus_fti_ns, date=True)
        offset_s = gnss.utc_minus_fti_ns / SECOND_NS
        yield f"  GNSS      UTC - FTI time {offset_s:+.6f} s by {gnss.device} ({gnss.scale}): started {begin}"
    if attached := view.recording.attachments():
        yield f"  attached  {', '.join(attached)}"


def _files(view: Overview) -> Iterator[str]:
    yield ""
    places = {file.path.parent for file in view.files}
    names = [str(file.path) if len(places) > 1 else file.path.name for file in view.files]
    width = max(map(len, names))
    for name, file in zip(names, view.files, strict=True):
        yield f"{name:{width}}  {size_text(file.bytes):>9}  {file.words}"


# ----------------------------------------------------------------------------------------------------------- topics

HEADS = ("topic", "messages", "bytes", "Hz", "device Hz", "sd ms", "p99 ms", "longest s", "gaps")


def _topics(view: Overview) -> Iterator[str]:
    yield ""
    rows = [_row(view, topic) for topic in view.statistics.topics if not view.is_copy(topic)]
    widths = [max(len(row[n]) for row in (HEADS, *rows)) for n in range(len(HEADS))]
    for row in (HEADS, *rows):
        cells = [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        yield "  ".join((row[0].ljust(widths[0]), *cells)).rstrip()
    yield "sd, p99: of the intervals that are not gaps; gap: 5 times longer than 95 % of the intervals"


def _row(view: Overview, topic: TopicStatistics) -> tuple[str, ...]:
    if not topic.messages:
        return (topic.topic, "0", "silent", *[""] * (len(HEADS) - 3))
    intervals, max_gap = topic.intervals, topic.intervals.longest
    return (
        topic.topic,
        str(topic.messages),
        size_text(topic.bytes),
        _number(topic.rate_hz, 2),
        _number(view.rates.get(topic.topic), 0, ""),
        _number(intervals.sd_s and 1000.0 * intervals.sd_s, 2),
        _number(intervals.p99_s and 1000.0 * intervals.p99_s, 1),
        _number(max_gap and max_gap.length_ns / SECOND_NS, 3),
        str(intervals.gap_count or ""),
    )


def _number(value: float | None, digits: int, unknown: str = "-") -> str:
    return unknown if value is None else f"{value:.{digits}f}"


# --------------------------------------------------------------------------------------------------------- activity


def _activity(view: Overview) -> Iterator[str]:
    topics = [topic for topic in view.statistics.topics if topic.topic != TICK_TOPIC and not view.is_copy(topic)]
    width = max((len(topic.topic) for topic in topics), default=5)
    cells = min(max(shutil.get_terminal_size((120, 40)).columns - width - 3, MIN_WIDTH), MAX_WIDTH)
    yield ""
    end = f"{view.duration_s:.1f} s"
    yield f"{'activity':{width}}  0 s{end:>{cells - 3}}"
    for topic in topics:
        usual_ns = (topic.intervals.usual_s or 0.0) * SECOND_NS
        rates = topic.activity.relative(view.begin_ns, view.end_ns, cells, usual_ns)
        yield f"{topic.topic:{width}}  {activity_bar(rates)}"


def activity_bar(rates: Sequence[float]) -> str:
    """Rates relative to their median as a row of bars; a dot: no message, the smallest bar: at least one message."""
    return "".join(BARS[_height(rate)] for rate in rates)


def _height(rate: float) -> int:
    if MIN_USUAL_RATIO <= rate <= MAX_USUAL_RATIO:
        return USUAL_BAR
    return min(max(round(USUAL_BAR * rate), 1), len(BARS) - 1) if rate else 0


# --------------------------------------------------------------------------------------------------- gaps and events


def _gaps(view: Overview) -> Iterator[str]:
    found = [(gap, link) for link in view.links if link.topic.startswith(RAW_PREFIX) for gap in view.find_gaps(link)]
    if not found:
        return
    chosen = sorted(found, key=lambda pair: -pair[0].length_ns)[:GAPS_SHOWN]
    more = "" if len(found) == len(chosen) else f", the longest {len(chosen)} of {len(found)}"
    yield ""
    yield f"{'silent links' if view.mode == CONTINUOUS else 'silent, or not triggered'}{more}"
    for gap, topic in sorted(chosen, key=lambda pair: pair[0].begin_ns):
        yield f"  {_when(view, gap.begin_ns)}  {topic.topic}: {_silence(view, topic, gap)}"


def _silence(view: Overview, topic: TopicStatistics, gap: TimeGap) -> str:
    seconds = f"{gap.length_ns / SECOND_NS:.3f} s"
    if not topic.messages:
        return "no message"
    if gap.begin_ns == topic.last_ns:
        return f"{seconds} until the end"
    return f"{seconds} until its first message" if gap.begin_ns < topic.first_ns else seconds


def _alarms(view: Overview) -> Iterator[str]:
    """Alarms with their durations; when there are many, the most severe come first."""
    alarms = view.statistics.alarms
    if not alarms.spans:
        return
    chosen = sorted(alarms.spans, key=lambda span: SEVERITIES.index(span.severity))[:ALARMS_SHOWN]
    total = len(alarms.spans) + alarms.more_alarms
    yield ""
    yield "alarms" + ("" if len(chosen) == total else f", {len(chosen)} of {total}; --json has them all")
    for span in sorted(chosen, key=lambda span: span.begin_ns):
        yield f"  {_when(view, span.begin_ns)}  {alarm_text(span)}"


def alarm_text(span: AlarmSpan) -> str:
    """One alarm as text."""
    duration = "to the end" if span.end_ns is None else f"for {(span.end_ns - span.begin_ns) / SECOND_NS:.1f} s"
    acknowledged = f", acknowledged by {span.acknowledged_by}" if span.acknowledged_by else ""
    cause = f": {span.cause}" if span.cause else ""
    return f"{span.severity}: {span.title}{cause} ({duration}{acknowledged})"


def _events(view: Overview) -> Iterator[str]:
    """Marks and events; when there are many, marks, warnings and errors come first."""
    events = view.statistics.events
    if not events:
        return
    chosen = events
    if len(events) > EVENTS_SHOWN:
        important = [e for e in events if e.source in MARKS or e.level != "info"]
        chosen = sorted([*important, *(e for e in events if e not in important)][:EVENTS_SHOWN])
    total = len(events) + view.statistics.more_events
    yield ""
    yield "marks and events" + ("" if len(chosen) == total else f", {len(chosen)} of {total}; --json has them all")
    for event in chosen:
        yield f"  {_when(view, event.t_ns)}  {event_text(event)}"


def event_text(event: EventNote) -> str:
    """One event as text."""
    level = "" if event.level == "info" else f"{event.level}: "
    return f"{level}{event.source}: {event.text}"


def _when(view: Overview, t_ns: int) -> str:
    return f"{moment(t_ns)}  {view.since_begin_s(t_ns):+10.3f} s"


def moment(t_ns: int, *, date: bool = False) -> str:
    """FTI time in UTC, to the millisecond."""
    at = datetime.fromtimestamp(t_ns // SECOND_NS, UTC)
    return f"{at:%Y-%m-%d %H:%M:%S} UTC" if date else f"{at:%H:%M:%S}.{t_ns // 1_000_000 % 1000:03d}"


def duration_text(seconds: float) -> str:
    """Seconds; from one minute also hours, minutes and seconds."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    return f"{seconds:.1f} s ({int(seconds // 3600)}:{int(seconds // 60) % 60:02d}:{int(seconds) % 60:02d})"


def size_text(size: float) -> str:
    """Bytes with a unit."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000 or unit == "GB":
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000
    raise AssertionError("unreachable")


# ------------------------------------------------------------------------------------------------------------- JSON


def as_json(view: Overview) -> dict[str, Any]:
    """The same for programs.  Times in ns, rates in Hz, intervals in s."""
    recording = view.recording
    offsets, gnss = view.clock_offset_s(), view.gnss()
    return {
        "path": str(recording.path),
        "name": view.session_metadata.get("name"),
        "origin": view.origin,
        "mode": view.mode,
        "remarks": list(remarks(recording)),
        "first_ns": view.begin_ns,
        "last_ns": view.end_ns,
        "duration_s": view.duration_s,
        "software": view.session_metadata.get("software"),
        "config_sha256": view.session_metadata.get("config_sha256"),
        "clock_offset_s": {"begin": offsets[0], "end": offsets[1]} if offsets else None,
        "clocks": view.statistics.clocks,
        "gnss": asdict(gnss) if gnss else None,
        "metadata": recording.metadata,
        "attachments": {name: len(data) for name, data in recording.attachments().items()},
        "links": recording.links,
        "files": [
            {
                "name": file.path.name,
                "folder": str(file.path.parent),
                "bytes": file.bytes,
                "finished": file.finished,
                "compression": file.compression,
                "fault": file.fault,
            }
            for file in view.files
        ],
        "topics": [_topic_json(view, topic) for topic in view.statistics.topics],
        "alarms": [
            {**asdict(span), "begin_s": view.since_begin_s(span.begin_ns)} for span in view.statistics.alarms.spans
        ],
        "more_alarms": view.statistics.alarms.more_alarms,
        "events": [{**event._asdict(), "t_s": view.since_begin_s(event.t_ns)} for event in view.statistics.events],
        "more_events": view.statistics.more_events,
    }


def _topic_json(view: Overview, topic: TopicStatistics) -> dict[str, Any]:
    intervals = topic.intervals
    return {
        "topic": topic.topic,
        "kind": topic.kind,
        "messages": topic.messages,
        "bytes": topic.bytes,
        "rate_hz": topic.rate_hz,
        "configured_hz": view.rates.get(topic.topic),
        "first_ns": topic.first_ns if topic.messages else None,
        "last_ns": topic.last_ns if topic.messages else None,
        "usual_interval_s": intervals.usual_s,
        "jitter_sd_s": intervals.sd_s,
        "interval_p99_s": intervals.p99_s,
        "longest_gap_s": topic.longest_gap_ns / SECOND_NS,
        "gap_limit_s": intervals.gap_limit_s,
        "gap_count": intervals.gap_count,
        "gaps": _gaps_json(view, intervals.gaps),
        "silences": _gaps_json(view, view.find_gaps(topic)),
        "activity": topic.activity.counts(view.begin_ns, view.end_ns, JSON_CELLS),
    }


def _gaps_json(view: Overview, gaps: Iterable[TimeGap]) -> list[dict[str, Any]]:
    return [
        {"begin_ns": g.begin_ns, "begin_s": view.since_begin_s(g.begin_ns), "length_s": g.length_ns / SECOND_NS}
        for g in gaps
    ]
