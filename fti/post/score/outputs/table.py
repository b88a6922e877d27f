"""Output checks as text: one line per output of navigation and per device, then the failed checks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence

from fti.post.score.outputs.accuracy import DURING_FAULT
from fti.post.score.outputs.row import OutputCheck, OutputRow
from fti.post.score.rows import FAILURES, Result

HEAD = ("output", "rate", "longest gap", "valid", "checks that hold")


def output_lines(rows: Sequence[OutputRow]) -> Iterator[str]:
    """Lines of all rows; none without rows."""
    if not rows:
        return
    yield from text_table([HEAD, *_cells(rows)])
    yield from (f"does not hold: {describe(row)}" for row in rows if row.result in FAILURES)
    yield from (f"not compared: {describe(row)}" for row in rows if row.found.endswith(DURING_FAULT))


def describe(row: OutputRow) -> str:
    """One row in one line."""
    what = " ".join(part for part in (row.topic, row.what, row.check) if part)
    when = "" if row.at_s is None else f" at {row.at_s:.2f} s"
    return f"{what}: {row.found}{when}; allowed {row.limit}"


def _cells(rows: Sequence[OutputRow]) -> Iterator[tuple[str, ...]]:
    """One row per topic of navigation, and one per device."""
    groups: dict[str, list[OutputRow]] = defaultdict(list)
    for row in rows:
        device = row.topic.split("/")[1]
        groups[row.topic if device == "nav" else f"/{device}/*"].append(row)
    for name, group in groups.items():
        checks = [row for row in group if row.result is not Result.NOT_COMPARED]
        passed = sum(row.result not in FAILURES for row in checks)
        is_device = name.endswith("/*")
        found = {row.check: row.found for row in group if not is_device and not row.what}
        valid = found.get(OutputCheck.VALID, "").partition(" ")[0]
        yield name, found.get(OutputCheck.RATE, ""), found.get(OutputCheck.GAP, ""), valid, f"{passed} of {len(checks)}"


def text_table(rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """Columns of text: lines with aligned columns; repeated cells of the first column are left out."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    last = ""
    for row in rows:
        first = "" if row[0] == last else row[0]
        last = row[0]
        yield "  ".join(cell.ljust(width) for cell, width in zip((first, *row[1:]), widths, strict=True)).rstrip()
