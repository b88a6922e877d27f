"""Plot of a session's activity over time, as self-contained SVG or HTML.

One row per link: the colour is its rate relative to its median, gaps are red, marks are vertical lines.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from html import escape
from itertools import groupby
from pathlib import Path

from fti.constants import SECOND_NS
from fti.logger.statistics.interval_stats import TimeGap
from fti.logger.statistics.topic_stats import MARKS, EventNote, TopicStatistics
from fti.new_file import write_new_file
from fti.post.overview import CONTINUOUS, Overview

WIDTH, LEFT, RIGHT = 1280, 248, 1252
HEAD, LANE, ROW, STRIP, FOOT = 104, 17, 36, 24, 92
MAX_LANES, MAX_LABEL_CHARACTERS, LETTER = 6, 34, 6.3
CELLS = (RIGHT - LEFT) // 2
CRISP = 'shape-rendering="crispEdges"'
MAX_SOLID_GAP_WIDTH = 10.0  # a wider gap is hatched
PAGE, PANEL, LINE, TEXT, SOFT, DIM = "#070b10", "#0e151d", "#223040", "#f2f6fa", "#a9b8c7", "#7b8c9d"
RED, AMBER, CYAN = "#ff4453", "#ffb224", "#4cc9f0"
#: Lowest rate of each colour, relative to the median.
COLOURS = (
    (0.001, "#17354a"),
    (0.25, "#1b5a75"),
    (0.5, "#1f8290"),
    (0.75, "#2fd683"),
    (1.3, "#c6e84f"),
    (1.6, "#ffd23f"),
    (2.2, "#fff6d6"),
)
#: Steps of the time axis [s].
STEPS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 43200)
BADGES = {"hil": ("HIL", AMBER), "replay": ("REPLAY", AMBER), "flight": ("FLIGHT", "#2fd683")}
STYLE = f"""
text {{ font-family: "B612", "DejaVu Sans", "Segoe UI", Arial, sans-serif; font-size: 12px; fill: {SOFT}; }}
.title {{ font-size: 20px; font-weight: 700; fill: {TEXT}; }}
.name {{ font-size: 13px; font-weight: 700; fill: {TEXT}; }}
.small {{ font-size: 11px; fill: {DIM}; }}
.bad {{ fill: {RED}; }}
.mark {{ font-size: 11.5px; fill: {CYAN}; }}
.badge {{ font-weight: 700; letter-spacing: 1.5px; fill: #10161c; }}
.end {{ text-anchor: end; }}
.middle {{ text-anchor: middle; }}
"""
HATCH = f"""<pattern id="gap" width="7" height="7" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">
<rect width="7" height="7" fill="#3a0d14"/><rect width="3" height="7" fill="{RED}" fill-opacity="0.75"/></pattern>"""


def write_plot(view: Overview, path: Path) -> None:
    """Write the plot to a new file, ``.html`` or ``.svg``.  Raises StorageError."""
    picture = "\n".join(_Plot(view).lines())
    name = escape(view.recording.path.absolute().name)
    page = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{name} · activity</title>'
        f"<style>body {{ margin: 0; background: {PAGE}; }} svg {{ display: block; width: 100%; height: auto; }}</style>"
        f"</head>\n<body>\n{picture}\n</body></html>\n"
    )
    write_new_file(path, (page if path.suffix == ".html" else picture + "\n").encode())


class _Plot:
    def __init__(self, view: Overview) -> None:
        self._view = view
        self._span_ns = max(view.end_ns - view.begin_ns, 1)
        self._marks = _place_labels([(self._x(n.t_ns), n) for n in view.statistics.events if n.source in MARKS])
        self._alerts = [note for note in view.statistics.events if note.level in ("warning", "error")]
        lanes = max((lane for *_, lane in self._marks), default=-1) + 1
        self._top = HEAD + lanes * LANE + (14 if self._alerts else 0)
        self._bottom = self._top + ROW * len(view.links)
        self._height = self._bottom + FOOT

    def _x(self, t_ns: int) -> float:
        share = (t_ns - self._view.begin_ns) / self._span_ns
        return LEFT + min(max(share, 0.0), 1.0) * (RIGHT - LEFT)

    def lines(self) -> Iterator[str]:
        """The elements."""
        yield f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {self._height}" width="{WIDTH}"'
        yield f' height="{self._height}" role="img" aria-label="activity over time">'
        yield f"<style>{STYLE}</style><defs>{HATCH}</defs>"
        yield f'<rect width="{WIDTH}" height="{self._height}" fill="{PAGE}"/>'
        yield from self._heading()
        yield from self._axis()
        for n, topic in enumerate(self._view.links):
            yield from self._row(topic, self._top + n * ROW)
        yield from self._draw_alerts()
        yield from self._draw_marks()
        yield from self._legend()
        yield "</svg>"

    def _heading(self) -> Iterator[str]:
        view = self._view
        word, colour = BADGES.get(view.origin, (view.origin.upper(), AMBER))
        if view.mode != CONTINUOUS:
            word, colour = f"{word} · {view.mode.upper()}", AMBER
        width = 28 + 9.4 * len(word)
        begin = f"{datetime.fromtimestamp(view.begin_ns // SECOND_NS, UTC):%Y-%m-%d %H:%M:%S} UTC"
        length = _clock(view.duration_s) if view.duration_s >= 60 else f"{view.duration_s:.1f} s"
        messages = sum(topic.messages for topic in view.statistics.topics if not view.is_copy(topic))
        config = f"configuration {view.session_metadata.get('config_sha256', 'unknown')[:12]}"
        software = f"fti {view.session_metadata.get('software', 'unknown')}"
        summary = "  ·  ".join((begin, length, f"{messages:,} messages", software, config))
        yield f'<rect x="28" y="26" width="{width:.0f}" height="26" rx="5" fill="{colour}"/>'
        yield f'<text class="badge middle" x="{28 + width / 2:.0f}" y="44">{escape(word)}</text>'
        yield f'<text class="title" x="{44 + width:.0f}" y="46">{escape(view.recording.path.absolute().name)}</text>'
        yield f'<text x="28" y="76">{escape(summary)}</text>'
        yield f'<line x1="28" x2="{RIGHT}" y1="90" y2="90" stroke="{LINE}"/>'

    def _axis(self) -> Iterator[str]:
        """Grid, seconds and UTC."""
        step = next((s for s in STEPS if s >= self._view.duration_s / 14), STEPS[-1])
        for n in range(int(self._view.duration_s / step) + 1):
            t_ns = self._view.begin_ns + round(n * step * SECOND_NS)
            x = self._x(t_ns)
            since = f"{n * step:g} s" if self._view.duration_s < 60 else _clock(n * step)
            yield f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{self._top}" y2="{self._bottom + 5}" stroke="{LINE}"/>'
            yield f'<text class="middle" x="{x:.1f}" y="{self._bottom + 20}">{since}</text>'
            at = f"{datetime.fromtimestamp(t_ns / SECOND_NS, UTC):%H:%M:%S}"
            yield f'<text class="small middle" x="{x:.1f}" y="{self._bottom + 35}">{at}</text>'
        yield f'<text class="small end" x="{LEFT - 38}" y="{self._bottom + 20}">since the start</text>'
        yield f'<text class="small end" x="{LEFT - 38}" y="{self._bottom + 35}">UTC</text>'

    # ----------------------------------------------------------------------------------------------------- rows

    def _row(self, topic: TopicStatistics, y: int) -> Iterator[str]:
        gaps = self._view.find_gaps(topic)
        name = topic.topic.removeprefix("/raw/")
        yield f'<text class="name" x="28" y="{y + 15}">{escape(name)}</text>'
        yield self._figures(topic, y + 29)
        at = f'y="{y + 6}" height="{STRIP}"'
        yield f'<rect x="{LEFT}" {at} width="{RIGHT - LEFT}" rx="2" fill="{PANEL}"/>'
        yield from self._cells(topic, at)
        for gap in gaps:
            yield self._gap(gap, at)

    def _figures(self, topic: TopicStatistics, y: int) -> str:
        if not topic.messages:
            return f'<text class="small bad" x="28" y="{y}">no message</text>'
        rate = f"{topic.rate_hz:.2f} Hz" if topic.rate_hz else f"{topic.messages} messages"
        gaps = topic.intervals.gap_count
        words = f"{gaps} {'gap' if gaps == 1 else 'gaps'}, longest {topic.longest_gap_ns / SECOND_NS:.2f} s"
        warning = f'<tspan class="bad">  ·  {words}</tspan>'
        return f'<text class="small" x="28" y="{y}" xml:space="preserve">{rate}{warning if gaps else ""}</text>'

    def _cells(self, topic: TopicStatistics, at: str) -> Iterator[str]:
        """Adjacent cells of one colour are one rectangle."""
        usual_ns = (topic.intervals.usual_s or 0.0) * SECOND_NS
        rates = topic.activity.relative(self._view.begin_ns, self._view.end_ns, CELLS, usual_ns)
        colours = (next((colour for low, colour in reversed(COLOURS) if rate >= low), None) for rate in rates)
        place, width = 0, (RIGHT - LEFT) / CELLS
        for colour, run in groupby(colours):
            cells = len(list(run))
            if colour:
                x = LEFT + place * width
                yield f'<rect x="{x:.1f}" {at} width="{cells * width:.1f}" fill="{colour}"/>'
            place += cells

    def _gap(self, gap: TimeGap, at: str) -> str:
        x, end = self._x(gap.begin_ns), self._x(gap.begin_ns + gap.length_ns)
        width = max(end - x, 3.0)
        fill = RED if width <= MAX_SOLID_GAP_WIDTH else "url(#gap)"
        begin_s = self._view.since_begin_s(gap.begin_ns)
        title = f"silent for {gap.length_ns / SECOND_NS:.3f} s from {begin_s:.3f} s on"
        return f'<rect x="{x:.1f}" {at} width="{width:.1f}" fill="{fill}" {CRISP}><title>{title}</title></rect>'

    # --------------------------------------------------------------------------------------------------- events

    def _draw_marks(self) -> Iterator[str]:
        for x, note, anchor, lane in self._marks:
            y = HEAD + lane * LANE + 9
            label = note.text if len(note.text) <= MAX_LABEL_CHARACTERS else note.text[: MAX_LABEL_CHARACTERS - 1] + "…"
            side, shift = ("end", -6) if anchor == "end" else ("", 6)
            ends = f'x1="{x:.1f}" x2="{x:.1f}" y1="{y - 8}" y2="{self._bottom + 5}"'
            yield f'<line {ends} stroke="{CYAN}" stroke-width="1.5"/>'
            title = f"<title>{self._view.since_begin_s(note.t_ns):.3f} s: {escape(note.text)}</title>"
            yield f'<text class="mark {side}" x="{x + shift:.1f}" y="{y}">{escape(label)}{title}</text>'

    def _draw_alerts(self) -> Iterator[str]:
        """Warnings and errors as arrows above the rows."""
        for note in self._alerts:
            colour = RED if note.level == "error" else AMBER
            title = f"{self._view.since_begin_s(note.t_ns):.3f} s: {note.source}: {note.text}"
            arrow = f"M{self._x(note.t_ns):.1f} {self._top - 2} l-5 -9 h10 Z"
            yield f'<path d="{arrow}" fill="{colour}"><title>{escape(title)}</title></path>'

    def _legend(self) -> Iterator[str]:
        y = self._height - 30
        yield f'<text class="small" x="28" y="{y + 10}">rate, relative to the median of the link</text>'
        for n, (rate, colour) in enumerate(COLOURS):
            x = LEFT + n * 58
            yield f'<rect x="{x}" y="{y}" width="58" height="12" fill="{colour}"/>'
            yield f'<text class="small" x="{x}" y="{y + 24}">{"&gt; 0" if n == 0 else f"{rate:g}"}</text>'
        x = LEFT + 58 * len(COLOURS) + 40
        for fill, text, width in ((RED, "gap", 60), ("url(#gap)", "silent", 76), (CYAN, "mark", 0)):
            yield f'<rect x="{x}" y="{y}" width="{3 if fill == CYAN else 16}" height="12" fill="{fill}"/>'
            yield f'<text class="small" x="{x + 22}" y="{y + 10}">{text}</text>'
            x += width
        if self._alerts:
            yield f'<path d="M{x + 76} {y + 11} l-5 -9 h10 Z" fill="{AMBER}"/>'
            yield f'<text class="small" x="{x + 88}" y="{y + 10}">warning or error</text>'


def _place_labels(marks: list[tuple[float, EventNote]]) -> list[tuple[float, EventNote, str, int]]:
    """Labels in the first lane in which they overlap no other label: x, mark, side of the text, lane."""
    ends = [0.0] * MAX_LANES
    placed = []
    for x, note in marks:
        width = LETTER * min(len(note.text), MAX_LABEL_CHARACTERS) + 14
        side = "end" if x + width > RIGHT else "start"
        begin = x - width if side == "end" else x
        lane = next((n for n, end in enumerate(ends) if end <= begin), MAX_LANES - 1)
        ends[lane] = begin + width
        placed.append((x, note, side, lane))
    return placed


def _clock(seconds: float) -> str:
    """``2:03``, ``1:02:03``."""
    hours, rest = divmod(int(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}" if hours else f"{rest // 60}:{rest % 60:02d}"
