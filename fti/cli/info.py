"""Show what a recording holds.

For each topic: messages, bytes, rate, first and last message after the begin, longest gap, and activity over time.
Reads finished recordings, killed ones and those that are being written.

  fti info data/da42_20260102T030405Z_0
  fti info flight_000.mcap --json
"""

from __future__ import annotations

import argparse
import json
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fti.logger.recording import Recording
    from fti.logger.survey import TopicSurvey

CELLS = 32
SECOND_NS = 1_000_000_000
BARS = " ▁▂▃▄▅▆▇█"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """SESSION and --json."""
    parser.add_argument("session", metavar="SESSION", help="session folder or MCAP file")
    parser.add_argument("--json", action="store_true", help="print JSON only")


def run(args: argparse.Namespace) -> int:
    """Read everything and print it; 3 when a file broke off."""
    from fti.logger.recording import Recording
    from fti.logger.survey import survey

    recording = Recording.open(args.session)
    topics = survey(recording)
    if args.json:
        print(json.dumps(as_json(recording, topics), indent=1))
    else:
        print("\n".join(as_text(recording, topics)))
    return 3 if recording.faults else 0


def as_json(recording: Recording, topics: list[TopicSurvey]) -> dict[str, Any]:
    """The same as the text, for programs.  Times in ns, rates in Hz, gaps in s."""
    from fti.logger.survey import time_span

    begin, end = time_span(topics)
    return {
        "path": str(recording.path),
        "first_ns": begin,
        "last_ns": end,
        "duration_s": (end - begin) / SECOND_NS,
        "metadata": recording.metadata,
        "attachments": {name: len(data) for name, data in recording.attachments().items()},
        "links": recording.links,
        "files": [_file(recording, path) for path in recording.files],
        "topics": [_topic(topic, begin, end) for topic in topics],
    }


def _file(recording: Recording, path: Any) -> dict[str, Any]:
    fault = recording.faults.get(path)
    return {"name": path.name, "bytes": path.stat().st_size, "fault": fault.text if fault else None}


def _topic(topic: TopicSurvey, begin: int, end: int) -> dict[str, Any]:
    return {
        "topic": topic.topic,
        "kind": topic.kind,
        "messages": topic.messages,
        "bytes": topic.bytes,
        "rate_hz": topic.rate_hz,
        "first_ns": topic.first_ns if topic.messages else None,
        "last_ns": topic.last_ns if topic.messages else None,
        "longest_gap_s": topic.longest_gap_ns / SECOND_NS,
        "activity": topic.activity(begin, end, CELLS),
    }


def as_text(recording: Recording, topics: list[TopicSurvey]) -> list[str]:
    """Lines for a person."""
    from fti.logger.survey import time_span

    begin, end = time_span(topics)
    origin = recording.metadata.get("fti", {}).get("origin")
    started = f"{datetime.fromtimestamp(begin / SECOND_NS, UTC):%Y-%m-%d %H:%M:%S} UTC" if begin else "no messages"
    lines = [f"{recording.path}  {started}  {(end - begin) / SECOND_NS:.1f} s{f'  origin {origin}' if origin else ''}"]
    for file in (_file(recording, path) for path in recording.files):
        lines += [f"  {file['name']}  {size_text(file['bytes'])}{'  ' + file['fault'] if file['fault'] else ''}"]
    if recording.attachments():
        lines.append(f"  attached: {', '.join(recording.attachments())}")
    width = max((len(topic.topic) for topic in topics), default=5)
    lines.append(
        f"{'topic':{width}} {'messages':>9} {'bytes':>9} {'Hz':>8} {'first s':>8} {'last s':>8} {'gap s':>8}  activity"
    )
    return lines + [_line(topic, width, begin, end) for topic in topics]


def _line(topic: TopicSurvey, width: int, begin: int, end: int) -> str:
    if not topic.messages:
        return f"{topic.topic:{width}} {0:9}  silent"
    rate = "-" if topic.rate_hz is None else f"{topic.rate_hz:.2f}"
    times = (topic.first_ns - begin, topic.last_ns - begin, topic.longest_gap_ns)
    shown = " ".join(f"{time / SECOND_NS:8.2f}" for time in times)
    bar = activity_bar(topic.activity(begin, end, CELLS))
    return f"{topic.topic:{width}} {topic.messages:9} {size_text(topic.bytes):>9} {rate:>8} {shown}  {bar}"


def activity_bar(counts: list[int]) -> str:
    """Counts as a row of bars; the smallest bar is at least one message."""
    top = max(counts, default=0) or 1
    return "".join(BARS[-(-count * (len(BARS) - 1) // top)] for count in counts)


def size_text(size: float) -> str:
    """Bytes with a unit."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000 or unit == "GB":
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000
    raise AssertionError("unreachable")
