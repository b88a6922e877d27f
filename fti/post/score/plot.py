"""Plot of a score over time: faults as bars, and below each the intervals of its expected flags."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fti import plot_style
from fti.plot_style import BLUE, GREEN, ORANGE, VERMILION
from fti.post.score.comparison import Score
from fti.post.score.rows import FAILURES, FlagRow, Result, UnexpectedFlag

ROW_INCH = 0.24
BAR = 0.62
MAX_LABEL_CHARACTERS = 64
#: Colour of faults, drawn behind their flags.
PALE = "#D5D5D5"
PlotRow = tuple[str, FlagRow | UnexpectedFlag | None]


def draw_score(score: Score) -> Figure:
    """The whole figure."""
    lines = _lines(score)
    figure = plot_style.new_figure(
        f"{score.scenario.title}: {score.outcome}",
        "bars: the fault (grey) and its flag (green: in time, red: a miss or not expected)",
        width=12.0,
        height=1.6 + ROW_INCH * len(lines),
    )
    axes = figure.subplots()
    for y, (_, one) in enumerate(lines):
        _draw_line(axes, y, one, score)
    for pause in score.flight_truth.pauses:
        axes.axvspan(pause.from_s, pause.until_s, color=ORANGE, alpha=0.3, lw=0)
    axes.set_yticks(range(len(lines)), [text[:MAX_LABEL_CHARACTERS] for text, _ in lines], fontsize=7.5)
    axes.set_ylim(len(lines) - 0.4, -0.6)
    axes.set_xlim(0.0, score.flight_truth.truth.end_s)
    plot_style.label_axes(axes, x="time of the flight [s]")
    return figure


def _lines(score: Score) -> Sequence[PlotRow]:
    """The rows from top to bottom."""
    lines: list[PlotRow] = []
    last = -1
    for row in score.rows:
        if row.fault != last:
            lines.append((f"{row.fault + 1} {row.what}", None))
        last = row.fault
        lines.append((f"{row.subject}: {row.flag}", row))
    return [*lines, *((f"not expected: {one.place} {one.word}", one) for one in score.unexpected)]


def _draw_line(axes: Axes, y: int, one: FlagRow | UnexpectedFlag | None, score: Score) -> None:
    end_s = score.flight_truth.truth.end_s
    if isinstance(one, UnexpectedFlag):
        _bar(axes, y, (one.from_s, min(one.until_s, end_s)), VERMILION)
    elif one is not None:
        _bar(axes, y, (one.from_s, min(one.until_s, end_s)), PALE)
        if one.after_s is not None:
            begin = one.from_s + one.after_s
            cleared_s = end_s if one.clear_s is None else one.until_s + one.clear_s
            _bar(axes, y, (begin, min(cleared_s, end_s)), VERMILION if one.result in FAILURES else GREEN, BAR / 2)
        elif one.result is not Result.FOUND:
            colour = VERMILION if one.result in FAILURES else BLUE
            axes.text(one.from_s, y, one.result, va="center", fontsize=7, color=colour)


def _bar(axes: Axes, y: int, span: tuple[float, float], colour: str, height: float = BAR) -> None:
    axes.barh(y, span[1] - span[0], left=span[0], height=height, color=colour, lw=0)
