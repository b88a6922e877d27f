"""A score over time: faults as bars, and under each the flags that it had to raise, when they stood."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti import figures
from fti.figures import BLUE, GREEN, ORANGE, VERMILION
from fti.post.score.judging import Score
from fti.post.score.rows import FAILURES, Row, Unexpected, Verdict

ROW_INCH = 0.24
BAR = 0.62
LONGEST = 64
#: A fault stands behind its flags.
PALE = "#D5D5D5"
Line = tuple[str, Row | Unexpected | None]


def draw(score: Score, file: Path) -> None:
    """Write the picture (.png, .svg), which must not be there yet.  Raises StorageError."""
    figures.write(lambda: _figure(score), file)


def _figure(score: Score) -> Figure:
    lines = _lines(score)
    figure = figures.sheet(
        f"{score.scenario.title}: {score.outcome}",
        "bars: the fault (grey) and when its flag stood (green: in time, red: a miss or not expected)",
        width=12.0,
        height=1.6 + ROW_INCH * len(lines),
    )
    axes = figure.subplots()
    for y, (_, one) in enumerate(lines):
        _draw_line(axes, y, one, score)
    for pause in score.flown.pauses:
        axes.axvspan(pause.from_s, pause.until_s, color=ORANGE, alpha=0.3, lw=0)
    axes.set_yticks(range(len(lines)), [text[:LONGEST] for text, _ in lines], fontsize=7.5)
    axes.set_ylim(len(lines) - 0.4, -0.6)
    axes.set_xlim(0.0, score.flown.truth.end_s)
    figures.label(axes, x="time of the flight [s]")
    return figure


def _lines(score: Score) -> Sequence[Line]:
    """What stands in the rows from the top down."""
    lines: list[Line] = []
    last = -1
    for row in score.rows:
        if row.fault != last:
            lines.append((f"{row.fault + 1} {row.what}", None))
        last = row.fault
        lines.append((f"{row.subject}: {row.flag}", row))
    return [*lines, *((f"not expected: {one.place} {one.word}", one) for one in score.unexpected)]


def _draw_line(axes: Axes, y: int, one: Row | Unexpected | None, score: Score) -> None:
    end_s = score.flown.truth.end_s
    if isinstance(one, Unexpected):
        _bar(axes, y, (one.from_s, min(one.until_s, end_s)), VERMILION)
    elif one is not None:
        _bar(axes, y, (one.from_s, min(one.until_s, end_s)), PALE)
        if one.after_s is not None:
            begin = one.from_s + one.after_s
            gone = end_s if one.clear_s is None else one.until_s + one.clear_s
            _bar(axes, y, (begin, min(gone, end_s)), VERMILION if one.verdict in FAILURES else GREEN, BAR / 2)
        elif one.verdict is not Verdict.FOUND:
            colour = VERMILION if one.verdict in FAILURES else BLUE
            axes.text(one.from_s, y, one.verdict, va="center", fontsize=7, color=colour)


def _bar(axes: Axes, y: int, span: tuple[float, float], colour: str, height: float = BAR) -> None:
    axes.barh(y, span[1] - span[0], left=span[0], height=height, color=colour, lw=0)
