"""Output of ``fti info``: a session in ten lines."""

from __future__ import annotations

import shlex
import shutil
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence

from fti.cli._info_view import ORIGINS, SEVERITIES, alarm_text, duration_text, moment, size_text
from fti.constants import SECOND_NS
from fti.logger.reading.session_metadata import remarks
from fti.logger.statistics.topic_stats import MARKS
from fti.messages.topics import RAW_PREFIX
from fti.post.flight_summary import Approach
from fti.post.overview import Overview

INDENT = 14
SHOWN = 3


def as_summary(view: Overview, paths: Sequence[str]) -> Iterator[str]:
    """Lines of text.  paths : as given by the user"""
    yield str(view.recording.path)
    for text in remarks(view.recording):
        yield f"  *** {text} ***"
    rows = {
        "session": f"{view.session_metadata.get('name', '–')}, {ORIGINS.get(view.origin, view.origin)}, {view.mode}",
        "started": _begin(view),
        "files": _files(view),
        "losses": _losses(view),
        "alarms": _alarms(view),
        "marks": _listed([event.text for event in view.statistics.events if event.source in MARKS]),
        "approaches": _listed([_approach(flown) for flown in view.flight.approaches if flown.states]),
        "position": _position(view),
    }
    width = shutil.get_terminal_size((120, 40)).columns
    for name, text in rows.items():
        lines = textwrap.wrap(text, width - INDENT, break_long_words=False, break_on_hyphens=False)
        for head, line in zip((name, *[""] * len(lines)), lines, strict=False):
            yield f"  {head:{INDENT - 2}}{line}"
    yield f"details: fti info -v {shlex.join(paths)}"


def _begin(view: Overview) -> str:
    return f"{moment(view.begin_ns, date=True)}, {duration_text(view.duration_s)}" if view.begin_ns else "no messages"


def _files(view: Overview) -> str:
    size = size_text(sum(file.bytes for file in view.files))
    wrong = [f"{file.path.name}: {file.words}" for file in view.files if file.fault or not file.finished]
    return f"{len(view.files)}, {size}, " + (f"not whole: {'; '.join(wrong)}" if wrong else "all finished")


def _losses(view: Overview) -> str:
    """Dropped frames, the worst link first; links without a message; the longest silence of the others."""
    dropped = view.flight.dropped_frames()
    parts = ["no frame dropped" if view.flight.has_ledger else "dropped frames are unknown (no ledger)"]
    if dropped:
        parts = [
            f"{dropped.total()} frames dropped ({', '.join(f'{n} of {link}' for link, n in dropped.most_common())})"
        ]
    links = [topic for topic in view.links if topic.topic.startswith(RAW_PREFIX)]
    if silent := [link.topic for link in links if not link.messages]:
        parts.append(f"no message on {', '.join(silent)}")
    gaps = [(gap.length_ns, link.topic) for link in links if link.messages for gap in view.find_gaps(link)]
    if gaps:
        length_ns, topic = max(gaps)
        parts.append(f"longest silence {length_ns / SECOND_NS:.1f} s on {topic}")
    return "; ".join(parts)


def _alarms(view: Overview) -> str:
    """Number by severity, and the longest alarm of the worst severity."""
    alarms = view.statistics.alarms
    if not alarms.spans:
        return "none"
    number = Counter(span.severity for span in alarms.spans)
    counts = ", ".join(f"{number[severity]} {severity}" for severity in SEVERITIES if number[severity])
    total = len(alarms.spans) + alarms.more_alarms
    worst = min(alarms.spans, key=lambda s: (SEVERITIES.index(s.severity), s.begin_ns - (s.end_ns or view.end_ns)))
    return f"{total} ({counts}), the worst: {alarm_text(worst)}"


def _approach(flown: Approach) -> str:
    """The part of the path, and how often the clearance monitor was in each state."""
    part = f"{flown.begin_s / 1000.0:.1f} to {flown.end_s / 1000.0:.1f} km before the intercept point"
    return f"{part}, {_shares(flown.states)}"


def _position(view: Overview) -> str:
    positions = view.flight.positions
    if not positions:
        return "no outputs of navigation"
    valid = Counter(valid=view.flight.valid)
    return f"from {_shares(positions)}; {_shares(valid, positions.total()) if view.flight.valid else 'never valid'}"


def _shares(counts: Counter[str], total: int | None = None) -> str:
    """Names with their shares of all."""
    total = total or counts.total()
    return ", ".join(f"{name} {_percent(n / total)}" for name, n in counts.most_common() if n)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.01 else "< 1 %"


def _listed(texts: Sequence[str]) -> str:
    more = f"; and {len(texts) - SHOWN} more" if len(texts) > SHOWN else ""
    return f"{len(texts)}: {'; '.join(texts[:SHOWN])}{more}" if texts else "none"
